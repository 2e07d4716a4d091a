"""Trajectories with names and units, made of what a run leaves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from headway.engine.run import Result
from headway.scenario.scenario import Scenario
from headway.schema import describe
from headway.version import __version__

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["limits", "to_dataset", "variables"]

Array = NDArray[np.float64]


def variables(scenario: Scenario, result: Result) -> dict[str, Array]:
    """All variables of the schema that depend on (vehicle, time), as plain arrays in SI units."""
    x, v, a = (q[..., 0].T for q in result.motion)  # views: a long platoon's results are kept once
    length = lengths(scenario)
    gap, relative, policy = (np.full_like(x, np.nan) for _ in range(3))
    gap[1:] = x[:-1] - length[:-1, None] - x[1:]
    relative[1:] = v[:-1] - v[1:]
    for n, follower in enumerate(scenario.followers, start=1):
        policy[n] = gap[n] - follower.model.desired_gap(v[n])
    return {
        "position": x,
        "speed": v,
        "acceleration": a,
        "gap": gap,
        "relative_speed": relative,
        "spacing_error": gap - gap[:, :1],
        "policy_error": policy,
    }


def lengths(scenario: Scenario) -> Array:
    """Length [m] of each vehicle, the leader first."""
    return np.array([scenario.leader_length, *(f.length for f in scenario.followers)])


def limits(scenario: Scenario) -> tuple[Array, Array]:
    """Least and largest acceleration [m/s²] that each vehicle can be commanded, infinite where there is no limit."""
    pairs = [v.limits or (-np.inf, np.inf) for v in scenario.followers]
    low, high = np.array([(-np.inf, np.inf), *pairs], dtype=float).T
    return low, high


def to_dataset(scenario: Scenario, result: Result) -> xr.Dataset:
    """The dataset of the schema, with the scenario, its hash and citations in the attributes."""
    import xarray as xr

    models = [f.model for f in scenario.followers]
    low, high = limits(scenario)
    limited = {"limit_low": ("vehicle", low), "limit_high": ("vehicle", high)}
    dataset = xr.Dataset(
        {name: (("vehicle", "time"), values) for name, values in variables(scenario, result).items()}
        | {"collision_time": ("vehicle", result.collision[:, 0])},
        coords={
            "vehicle": np.arange(1 + len(models)),
            "time": result.time,
            "model": ("vehicle", ["leader", *(m.name for m in models)]),
            "length": ("vehicle", lengths(scenario), {"units": "m", "long_name": "vehicle length"}),
        }
        | (limited if np.isfinite((low, high)).any() else {}),
        attrs={
            "title": scenario.name or f"platoon behind a {scenario.leader.kind} leader",
            "scenario": scenario.to_toml(),
            "scenario_hash": scenario.hash,
            "seed": scenario.seed,
            "scheme": scenario.scheme,
            "dt": scenario.step,
            "headway_version": __version__,
            "citations": "\n".join(
                dict.fromkeys(
                    m.law.source + (f", doi:{m.law.doi}" if m.law.doi else "") for m in models if m.law.source
                )
            ),
        },
    )
    return describe(dataset)
