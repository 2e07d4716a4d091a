"""Four models under one sinusoid, and the same four behind a section of a real driving cycle.

    python examples/demo.py [folder]

Writes a figure and the trajectories (NetCDF) of each comparison into the folder (default out/demo)
and prints what the disturbance does on its way down each platoon.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import headway as hw

MODELS = ("idm", "ovm", "gmm", "cacc")
COMPARISONS = {
    "sinusoid": ("23 ± 2 m/s at 0.63 rad/s, 50 s, no delay", "paper:compare-0-{}"),
    "wltc3b": ("WLTC class 3b, extra-high phase, 1477 to 1800 s", "example:wltc-{}"),
}


def main(folder: Path) -> None:
    """Run both comparisons and write everything into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    started = time.perf_counter()
    for name, (what, pattern) in COMPARISONS.items():
        results = {m: hw.simulate(hw.library.library_scenario(pattern.format(m))) for m in MODELS}
        for m, result in results.items():
            hw.save(result, folder / f"{name}-{m}.nc")
        hw.plot.save(hw.plot.comparison(results), folder / f"{name}.png")
        print(f"\n{what}")
        print(
            f"  {'model':<6}{'peak error of the first pair':>30}{'of the last':>14}"
            f"{'speed amplitude, last : leader':>32}"
        )
        for m, result in results.items():
            table = hw.metrics.summary(result)
            peaks = table.peak_spacing_error.values
            ratio = float(table.speed_amplitude[-1] / table.speed_amplitude[0])
            print(f"  {m:<6}{peaks[1]:>28.3g} m{peaks[-1]:>12.3g} m{ratio:>32.3g}{verdict(ratio, table)}")
    print(f"\nfigures and trajectories are in {folder} ({time.perf_counter() - started:.1f} s)")


def verdict(ratio: float, table) -> str:
    """What became of the disturbance, in words."""
    if table.collision_time.notnull().any():
        return "  a follower collides"
    return "  grows" if ratio > 1.001 else ("  is passed on" if ratio > 0.97 else "  dies down")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/demo"))
