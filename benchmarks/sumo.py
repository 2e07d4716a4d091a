"""`scheme="ballistic"` against SUMO's IDM: positions, speeds and gaps at every step of 50 s."""

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

DT, END, ALLOWED = 0.01, 50.0, 1e-6


def compare() -> dict[str, Any]:
    """Largest differences, and SUMO's time per vehicle and step."""
    platoon = sine_platoon()
    names = {"accel": "a", "decel": "b", "tau": "T", "minGap": "s0"}
    steps = round(END / DT)
    setup = platoon | {"dt": DT, "steps": steps, "v0": platoon["idm"]["v0"]}
    setup["idm"] = {sumo: platoon["idm"][own] for sumo, own in names.items()} | {"delta": 4.0}
    answer = run("run_sumo", setup)
    x, v = answer["record"][:, 0], answer["record"][:, 1]
    mean, amplitude, omega = platoon["leader"]
    ours = simulate(
        Scenario(
            leader=Sine(mean=mean, amplitude=amplitude, omega=omega),
            followers=[Vehicle(IDM(**platoon["idm"]), length=platoon["length"])] * platoon["followers"],
            duration=END,
            dt=DT,
            output_step=DT,
            scheme="ballistic",
            # the state that SUMO says it began with
            gaps=tuple(float(g) for g in x[0, :-1] - x[0, 1:] - platoon["length"]),
            leader_length=platoon["length"],
        )
    )
    gap = x[:, :-1] - x[:, 1:] - platoon["length"]
    return {
        "version": str(answer["version"]),
        "position": float(np.abs(ours.position.values.T - (x - x[0, 0])).max()),
        "speed": float(np.abs(ours.speed.values.T - v).max()),
        "gap": float(np.abs(ours.gap.values.T[:, 1:] - gap).max()),
        "gap at the start": float(np.abs(gap[0] - platoon["gap"]).max()),
        "ns": 1e9 * float(answer["seconds"]) / (steps * (platoon["followers"] + 1)),
    }


def main() -> int:
    """Print the differences and write `out/bench/sumo.json`."""
    try:
        found = compare()
    except AbsentError as reason:
        print(f"SUMO: not compared, {reason}")
        return 0
    within = found["position"] <= ALLOWED
    print(
        f"{found['version']}, {END:g} s at dt {DT:g} s: largest difference in position {found['position']:.1e} m, "
        f"speed {found['speed']:.1e} m/s, gap {found['gap']:.1e} m "
        f"({'within' if within else 'NOT within'} {ALLOWED:g} m); "
        f"SUMO takes {found['ns']:.0f} ns per vehicle and step"
    )
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "sumo.json").write_text(json.dumps(found, indent=1))
    return 0 if within else 1


if __name__ == "__main__":
    sys.exit(main())
