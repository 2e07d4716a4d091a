"""rk4 with all on-board signals 0.5 s late against jitcdde, an adaptive solver of delay equations."""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np

from headway.engine.simulate import simulate
from headway.models.registry import IDM
from headway.scenario.leaders import Sine
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle

from .environment import OUT, AbsentError, run, sine_platoon

DT, END, DELAY, KEEP, ALLOWED = 0.01, 50.0, 0.5, 0.1, 1e-6


def compare() -> dict[str, Any]:
    """Largest difference of positions, and jitcdde's time per follower and 0.01 s."""
    platoon = sine_platoon()
    mean, amplitude, omega = platoon["leader"]
    car = Vehicle(IDM(**platoon["idm"]), delay=DELAY, length=platoon["length"])
    ours = simulate(
        Scenario(
            leader=Sine(mean=mean, amplitude=amplitude, omega=omega),
            followers=[car] * platoon["followers"],
            duration=END,
            dt=DT,
            output_step=KEEP,
            leader_length=platoon["length"],
        )
    )
    setup = platoon | {"delay": DELAY, "times": ours.time.values.tolist(), "tolerance": 1e-6}
    answer = run("run_jitcdde", setup)
    kept = np.isin(ours.time.values, answer["times"])
    return {
        "version": str(answer["version"]),
        "position": float(np.abs(ours.position.values.T[kept, 1:] - answer["positions"]).max()),
        "ns": 1e9 * float(answer["seconds"]) / (END / DT * platoon["followers"]),
        "compiling": float(answer["compiling"]),
    }


def main() -> int:
    """Print the difference and write `out/bench/jitcdde.json`."""
    try:
        found = compare()
    except AbsentError as reason:
        print(f"jitcdde: not compared, {reason}")
        return 0
    within = found["position"] <= ALLOWED
    print(
        f"jitcdde {found['version']}, {END:g} s at dt {DT:g} s: "
        f"largest difference in position {found['position']:.1e} m "
        f"({'within' if within else 'NOT within'} {ALLOWED:g} m); jitcdde takes {found['ns']:.0f} ns per follower and "
        f"{DT:g} s at a tolerance of 1e-6, after {found['compiling']:.1f} s of compiling"
    )
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "jitcdde.json").write_text(json.dumps(found, indent=1))
    return 0 if within else 1


if __name__ == "__main__":
    sys.exit(main())
