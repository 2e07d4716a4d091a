"""Whole strings behind a recorded leader: replayed, or mixed of fitted and assumed vehicles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from headway.calibration.segments import Window, start_of
from headway.data.recording import Recording
from headway.errors import HeadwayError, shorten
from headway.scenario.recorded import Recorded
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["MEASURES", "behind_recorded", "one_in", "replay", "section"]

#: longest step [s] of a simulated string
_DT = 0.05

#: seconds after the start of a record in which a first gap may still come
_PATIENCE = 1.0

#: what `one_in` measures: unit and meaning
MEASURES = {
    "speed_deviation": ("m/s", "standard deviation of the last vehicle's speed"),
    "growth": ("1", "standard deviation of speed, last vehicle over leader"),
    "least_speed": ("m/s", "least speed of any vehicle"),
    "least_gap": ("m", "least gap of any vehicle"),
    "head_to_tail_gain": ("1", "largest gain from leader to tail over frequencies, linear theory at the mean speed"),
}


def section(recording: Recording, window: Window | None) -> Recording:
    """The recording, or its part within `window` [s of the recording]."""
    return recording if window is None else recording.between(*window)


def behind_recorded(
    recording: Recording, followers: Sequence[Vehicle], window: Window | None = None, start: str = "recorded"
) -> Scenario:
    """A scenario with `followers` behind the recorded leader, from its first sample (or that of `window`) on.

    start: "recorded" gives follower n the recorded initial gap and speed of vehicle n, so there may be no more
    followers than the recording has; "equilibrium" starts all in their equilibrium at the leader's speed.
    Raises HeadwayError where the leader's speed or an initial value is missing.
    """
    part = section(recording, window)
    cars = list(followers)
    if not cars or not all(isinstance(c, Vehicle) for c in cars):
        raise HeadwayError(f"followers {shorten(followers)} are not one or more vehicles")
    if not np.isfinite(part.speed[0]).all():
        bad = float(part.time[int(np.argmax(~np.isfinite(part.speed[0])))])
        raise HeadwayError(f"{part.source}: the leader's speed is missing at {bad:g} s; choose a window without holes")
    time = part.time - part.time[0]
    step = float(np.median(np.diff(time)))
    leader = Recorded(time=tuple(time), speed=tuple(part.speed[0]))
    common: dict[str, Any] = {
        "dt": step / math.ceil(step / _DT - 1e-6), "output_step": step, "leader_length": part.lengths[0],
    }  # fmt: skip
    if start == "equilibrium":
        return Scenario(leader, cars, **common)
    if start != "recorded":
        raise HeadwayError(f"start = {start!r} is not known; allowed are recorded, equilibrium")
    if len(cars) >= part.vehicles:
        raise HeadwayError(
            f"{part.source} has {part.vehicles - 1} followers and {len(cars)} are to start where they did; "
            "give as many or fewer, or start in equilibrium"
        )
    gaps, offsets = [], []
    for n in range(1, len(cars) + 1):
        head = slice(0, int(np.searchsorted(time, _PATIENCE + 1e-9)))
        if not (np.isfinite(part.gap[n, head]).any() and np.isfinite(part.speed[n, head]).any()):
            raise HeadwayError(
                f"{part.source}: vehicle {n} has no gap or speed within a second of {part.time[0]:g} s; choose another "
                "window"
            )
        gap, speed = start_of(part.gap[n], part.speed[n])
        gaps.append(float(gap))
        offsets.append((n, float(speed - part.speed[0, 0])))
    return Scenario(leader, cars, gaps=tuple(gaps), speed_offsets=tuple(offsets), **common)


def replay(recording: Recording, followers: Sequence[Vehicle], window: Window | None = None) -> xr.Dataset:
    """The whole string simulated from the recorded leader alone: a dataset as of `headway.simulate`.

    followers: one vehicle for each recorded one, front to back. Times start at 0; compare with
    `headway.data.compare(replay(…), section(recording, window).from_zero())`.
    """
    from headway.engine.simulate import simulate

    if len(followers) != recording.vehicles - 1:
        raise HeadwayError(
            f"{recording.source} has {recording.vehicles - 1} followers and {len(followers)} are given; a replay needs "
            "one for each"
        )
    return simulate(behind_recorded(recording, followers, window))


def one_in(
    recording: Recording,
    cars: Vehicle | Sequence[Vehicle],
    other: Vehicle,
    every: Sequence[int] = (0, 10, 5, 3, 2, 1),
    followers: int = 10,
    window: Window | None = None,
) -> xr.Dataset:
    """What it changes that each n-th follower is `other` instead: `MEASURES` along `every` (0: none is).

    cars: the vehicles of the string, repeated to `followers`; all start in equilibrium behind the recorded leader. In
    groups of n the last is replaced. A radio needs a sender: every car is taken to send what `other` hears.
    """
    import xarray as xr

    from headway.engine.simulate import simulate_many

    base = [cars] if isinstance(cars, Vehicle) else list(cars)
    for n in every:
        if isinstance(n, bool) or not isinstance(n, int | np.integer) or not 0 <= n <= followers:
            raise HeadwayError(f"every = {n!r} is not a whole number from 0 to {followers}")
    strings = [[other if n and (i + 1) % n == 0 else base[i % len(base)] for i in range(followers)] for n in every]
    runs = simulate_many([behind_recorded(recording, s, window, "equilibrium") for s in strings])
    found: dict[str, list[float]] = {name: [] for name in MEASURES}
    for string, run in zip(strings, runs, strict=True):
        speed, gap = run.speed.values, run.gap.values[1:]
        found["speed_deviation"].append(float(speed[-1].std()))
        found["growth"].append(float(speed[-1].std() / speed[0].std()))
        found["least_speed"].append(float(speed[1:].min()))
        found["least_gap"].append(float(gap.min()))
        found["head_to_tail_gain"].append(_gain(string, float(speed[0].mean())))
    return xr.Dataset(
        {
            n: ("every", values, dict(zip(("units", "long_name"), MEASURES[n], strict=True)))
            for n, values in found.items()
        },
        coords={"every": list(every)},
        attrs={"source": recording.source, "other": repr(other.model), "followers": followers},
    )


def _gain(string: Sequence[Vehicle], speed: float) -> float:
    """Supremum of the head-to-tail gain; infinite where a vehicle is locally unstable."""
    from headway.analysis.linear import head_to_tail

    chain = head_to_tail(list(string), speed)
    return chain.peak.gain if chain.locally_stable else math.inf
