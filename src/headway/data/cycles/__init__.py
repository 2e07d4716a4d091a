"""Standard drive cycles, shipped as plain tables in the unit in which they were laid down.

WLTC in km/h with one decimal (UN GTR 15, class 3a and 3b); UDDS, US06 and HWFET in mph with one decimal (US EPA).
NOTICE beside the tables says where the figures come from and what was changed. Needs NumPy only.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from headway.checked import typed
from headway.errors import unknown_name

__all__ = ["CYCLES", "DrivingCycle", "cycle_file", "load_cycle"]

_TITLES = {
    "wltc3b": ("WLTC class 3b, worldwide harmonised light vehicles test cycle", "UN GTR 15"),
    "wltc3a": ("WLTC class 3a, worldwide harmonised light vehicles test cycle", "UN GTR 15"),
    "udds": ("UDDS, urban dynamometer driving schedule", "US EPA"),
    "us06": ("US06, supplemental FTP: aggressive and high-speed driving", "US EPA"),
    "hwfet": ("HWFET, highway fuel economy test", "US EPA"),
}

CYCLES = tuple(_TITLES)
"""Names that `load_cycle` knows."""

_TO_SI = {"speed_kmh": (1.0, 3.6), "speed_mph": (0.44704, 1.0)}  # m/s = value * first / second, exact by definition


@dataclass(frozen=True, eq=False)
class DrivingCycle:
    """A speed profile in steps of 1 s from 0; its arrays are read-only.

    Attributes:
        name: one of `CYCLES`.
        title: the name in full.
        source: where its figures come from.
        time: (T,) [s].
        speed: (T,) [m/s] >= 0.
    """

    name: str
    title: str
    source: str
    time: NDArray[np.float64]
    speed: NDArray[np.float64]


def cycle_file(name: str) -> Path:
    """The path of a cycle's table.

    Args:
        name: one of `CYCLES`.

    Raises:
        HeadwayError: for another name.
    """
    if name not in _TITLES:
        raise unknown_name("cycle", name, CYCLES)
    return Path(str(files(__package__) / f"{name}.csv"))


@typed
@cache
def load_cycle(name: str) -> DrivingCycle:
    """The speed profile of a standard drive cycle.

    Args:
        name: one of `CYCLES`.

    Raises:
        HeadwayError: for another name.
    """
    path = cycle_file(name)
    with path.open(encoding="utf-8") as stream:
        column = stream.readline().strip().split(",")[1]
        table = np.loadtxt(stream, delimiter=",", dtype=np.float64)
    times, over = _TO_SI[column]
    time, speed = table[:, 0].copy(), table[:, 1] * times / over
    for array in (time, speed):
        array.flags.writeable = False
    title, origin = _TITLES[name]
    return DrivingCycle(name, title, f"{origin}; figures from fastsim 2.1.5 (see NOTICE)", time, speed)
