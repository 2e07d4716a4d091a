"""`simulate`: from a scenario to trajectories with names and units."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from headway.checked import typed
from headway.engine.plan import Plan, structure
from headway.engine.run import Result, Run
from headway.engine.trajectories import to_dataset
from headway.errors import HeadwayError
from headway.scenario.resolution import warn_of_coarse_step
from headway.scenario.scenario import Scenario

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["check_sound", "simulate", "simulate_many", "solve"]

Array = NDArray[np.float64]

#: followers × lanes of one block of a batch: so many that a step's fixed cost does not show, so few that
#: its arrays stay in the caches (a ballistic step does little beside passing over them)
_ELEMENTS = {"rk4": 1280, "ballistic": 384}


@typed
def simulate(scenario: Scenario) -> xr.Dataset:
    """Trajectories of a scenario.

    Returns a dataset with dimensions (vehicle, time): `position speed acceleration gap
    relative_speed spacing_error policy_error`, and `collision_time` per vehicle (NaN if none; a
    vehicle that collides and all behind it are NaN from then on). SI units; vehicle 0 is the leader
    and has no gap. Where an acceleration jumps at an output time, its limit from the right is given.

    Raises `HeadwayError` if a law returns a value that is not finite.
    """
    warn_of_coarse_step(scenario)
    return to_dataset(scenario, solve(scenario))


@typed
def simulate_many(scenarios: Sequence[Scenario]) -> list[xr.Dataset]:
    """Trajectories of many scenarios; those that share a structure are integrated side by side.

    Each result has the same bits as `simulate` gives for its scenario alone.
    """
    groups: dict[tuple, list[int]] = {}
    for i, scenario in enumerate(scenarios):
        groups.setdefault(structure(scenario), []).append(i)
    results: dict[int, Result] = {}
    for members in groups.values():
        warn_of_coarse_step(scenarios[members[0]])
        size = lanes_per_block(scenarios[members[0]])
        for at in range(0, len(members), size):
            block = members[at : at + size]
            results.update(zip(block, _block([scenarios[i] for i in block]), strict=True))
    return [to_dataset(s, results[i]) for i, s in enumerate(scenarios)]


def lanes_per_block(scenario: Scenario) -> int:
    """How many lanes of this structure are integrated side by side."""
    return max(1, _ELEMENTS[scenario.scheme] // len(scenario.followers))


def _block(scenarios: Sequence[Scenario]) -> list[Result]:
    if len(scenarios) == 1:
        return [solve(scenarios[0])]
    batch = Run(Plan.of(scenarios)).go()
    results = [batch.lane(b) for b in range(len(scenarios))]
    again = np.flatnonzero(batch.unsettled).tolist()
    if again:
        second = Run(dataclasses.replace(Plan.of([scenarios[b] for b in again]), extra=True)).go()
        for n, b in enumerate(again):
            results[b] = second.lane(n)
    for scenario, result in zip(scenarios, results, strict=True):
        check_sound(scenario, result)
    return results


def solve(scenario: Scenario, cancelled: Callable[[], bool] | None = None) -> Result:
    """Integrate one scenario; see `headway.engine.trajectories` for what becomes of the result.

    `cancelled` is asked several times a second whether to end: `CancelledError`.
    """
    plan = Plan.of([scenario])
    result = Run(plan, cancelled=cancelled).go()
    if result.unsettled.any():
        result = Run(dataclasses.replace(plan, extra=True), cancelled=cancelled).go()
    check_sound(scenario, result)
    return result


def check_sound(scenario: Scenario, result: Result) -> None:
    """`HeadwayError` where a value is not finite and not behind a collision: the law gave it, or the lane ended."""
    hit = np.flatnonzero(np.isfinite(result.collision[:, 0]))
    simulated = hit.min() if hit.size else result.motion.shape[2]
    bad = ~np.isfinite(result.motion[:, :, :simulated, 0]).all(axis=0)
    if not bad.any():
        return
    when, who = np.argwhere(bad)[0]
    if result.fault[0]:
        raise HeadwayError(
            f"shortly before t = {result.time[when]:g} s vehicles stop, start or reach their limits more often than "
            "can be followed within one step; a law that switches between two answers does that: make it continuous"
        )
    before = max(int(when) - 1, 0)
    x, v = result.motion[0, before, :, 0], result.motion[1, before, :, 0]
    length = scenario.leader_length if who == 1 else scenario.followers[who - 2].length
    raise HeadwayError(
        f"follower {who}: {scenario.followers[who - 1].model.name} returned a value that is not finite at "
        f"t = {result.time[when]:g} s (shortly before: s = {x[who - 1] - length - x[who]:.4g} m, v = {v[who]:.4g} m/s, "
        f"dv = {v[who - 1] - v[who]:.4g} m/s)"
    )
