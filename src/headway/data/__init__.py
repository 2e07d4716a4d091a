"""Real trajectories: read them, check them, fetch them, compare a simulation with them."""

from headway.data.catalogue import CatalogueEntry, catalogue, fetch
from headway.data.checks import Finding, check
from headway.data.compare import compare
from headway.data.cycles import CYCLES, DrivingCycle, load_cycle
from headway.data.readers import FORMATS, Recording, read

__all__ = [
    "CYCLES",
    "FORMATS",
    "CatalogueEntry",
    "DrivingCycle",
    "Finding",
    "Recording",
    "catalogue",
    "check",
    "compare",
    "fetch",
    "load_cycle",
    "read",
]
