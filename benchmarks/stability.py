"""Stability maps (seconds, microseconds a point) and whole `headway stability` processes."""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections.abc import Mapping
from typing import Any

import headway as hw
from headway.models import CACC, GMM, IDM, OVM

from .environment import OUT
from .startup import headway

_LEADER_LATE = {"s": 1.0, "vl": 1.0}
_T, _A = (0.5, 2.5), (0.3, 2.0)

#: name → vehicle, axes, settings, points along each axis
_MAPS: dict[str, tuple[Any, Mapping[str, Any], dict[str, Any], int]] = {
    "idm string, T × delay, all late": (IDM, {"T": _T, "delay": (0.0, 1.5)}, {"speed": 23.0}, 512),
    "idm string, T × delay, s and vl late": (
        hw.Vehicle(IDM, delay=_LEADER_LATE), {"T": _T, "delay": (0.0, 1.5)}, {"speed": 23.0}, 512,
    ),
    "idm string, T × a, no delay": (IDM, {"T": _T, "a": _A}, {"speed": 23.0}, 512),
    "idm string, T × a, 0.5 s": (hw.Vehicle(IDM, delay=0.5), {"T": _T, "a": _A}, {"speed": 23.0}, 512),
    "idm string, T × a, 1.5 s": (hw.Vehicle(IDM, delay=1.5), {"T": _T, "a": _A}, {"speed": 23.0}, 512),
    "idm string, T × a, 15 s": (hw.Vehicle(IDM, delay=15.0), {"T": _T, "a": _A}, {"speed": 23.0}, 512),
    "ovm string, gap × alpha": (OVM, {"gap": (0.25, 50.0), "alpha": (0.01, 3.0)}, {}, 512),
    "gmm string, alpha × l, 1 s": (
        hw.Vehicle(GMM, delay=1.0), {"alpha": (0.01, 3.0), "l": (-1.0, 4.0)}, {"speed": 23.0, "gap": 10.0}, 512,
    ),
    "cacc string, kv × ka, radio 0.15 s": (
        hw.Vehicle(CACC, delay={"vl": 0.15, "al": 0.15}), {"kv": (0.0, 2.0), "ka": (0.0, 2.0)}, {"speed": 23.0}, 512,
    ),
    "idm gain, T × delay": (IDM, {"T": _T, "delay": (0.0, 1.5)}, {"speed": 23.0, "what": "gain"}, 512),
    "idm local, T × delay": (IDM, {"T": _T, "delay": (0.0, 3.0)}, {"speed": 23.0, "what": "local"}, 128),
    "idm critical delay, T × a": (IDM, {"T": _T, "a": _A}, {"speed": 23.0, "what": "critical_delay"}, 128),
}  # fmt: skip


def maps() -> dict[str, dict[str, float]]:
    """Seconds (best of three, after a first map that may compile) and microseconds a point, boundary included."""
    found = {}
    for name, (car, axes, settings, count) in _MAPS.items():
        hw.stability_map(car, {n: (*limits, 9) for n, limits in axes.items()}, **settings)
        times = []
        for _ in range(3):
            begin = time.perf_counter()
            hw.stability_map(car, {n: (*limits, count) for n, limits in axes.items()}, **settings)
            times.append(time.perf_counter() - begin)
        found[name] = {"points": count**2, "seconds": min(times), "us a point": 1e6 * min(times) / count**2}
    return found


def main() -> int:
    """Print the tables and write `out/bench/stability.json`."""
    found = maps()
    for name, (points, seconds, each) in ((name, tuple(numbers.values())) for name, numbers in found.items()):
        print(f"{name:42}{points:8.0f} points{seconds:8.2f} s{each:9.2f} µs a point")
    arguments = ("stability", "idm", "--speed", "23", "--delay", "0.5")
    headway(*arguments)
    process = statistics.median(headway(*arguments) for _ in range(7))
    first = next(iter(found.values()))["seconds"]
    print(f"headway {' '.join(arguments)}: {process:.2f} s (at most 1.2)")
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "stability.json").write_text(json.dumps({"maps": found, "headway stability [s]": process}, indent=1))
    return 0 if process <= 1.2 and first <= 2.0 else 1


if __name__ == "__main__":
    sys.exit(main())
