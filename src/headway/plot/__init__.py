"""All figures, under one name: `headway.plot`.

Every function returns a `matplotlib.figure.Figure` that belongs to no window, of the width of a
printed page and readable there without colour; `save` writes it. Functions of one panel draw on
axes of another figure where these are passed, without a title. What cannot be drawn raises `HeadwayError`.
"""

from __future__ import annotations

from headway.checked import typed
from headway.plot.calibration import calibrated, gains, growth, penetration, replayed
from headway.plot.export import save
from headway.plot.maps import panels, paper_map, stability_map
from headway.plot.study import study_lines, study_map
from headway.plot.theory import damping, gain_phase, responses, root_locus
from headway.plot.trajectories import accelerations, comparison, gaps, overview, spacing_errors, speeds, time_space
from headway.plot.waves import propagation

__all__ = [
    "accelerations", "calibrated", "comparison", "damping", "gain_phase", "gains", "gaps", "growth", "overview",
    "panels", "paper_map", "penetration", "propagation", "replayed", "responses", "root_locus", "save",
    "spacing_errors", "speeds", "stability_map", "study_lines", "study_map", "time_space",
]  # fmt: skip

# every figure refuses what it cannot draw at its door
globals().update({name: typed(globals()[name], f"plot.{name}") for name in __all__})
