"""Whole strings behind a recorded leader: replayed, or mixed of fitted and assumed vehicles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from headway.calibration.segments import Window
from headway.checked import typed
from headway.data.recording import Recording
from headway.errors import HeadwayError
from headway.scenario.behind import behind
from headway.scenario.vehicle import Vehicle

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["MEASURES", "one_in", "part_of", "replay"]

#: what `one_in` measures: unit and meaning
MEASURES = {
    "speed_deviation": ("m/s", "standard deviation of the last vehicle's speed"),
    "growth": ("1", "standard deviation of speed, last vehicle over leader"),
    "least_speed": ("m/s", "least speed of any vehicle"),
    "least_gap": ("m", "least gap of any vehicle"),
    "head_to_tail_gain": ("1", "largest gain from leader to tail over frequencies, linear theory at the mean speed"),
}


def part_of(recording: Recording, window: Window | None) -> Recording:
    """A recording, or its part within a window.

    Args:
        recording: the recording.
        window: (start, end) [s of the recording]; None leaves all of it.
    """
    return recording if window is None else recording.between(*window)


@typed
def replay(recording: Recording, followers: Sequence[Vehicle], window: Window | None = None) -> xr.Dataset:
    """The whole string simulated from the recorded leader alone.

    Compare it with `headway.data.compare(replay(…), recording.between(*window).from_zero())`.

    Args:
        recording: the recorded platoon.
        followers: one vehicle for each recorded follower, front to back.
        window: (start, end) [s of the recording]; all of it if None.

    Returns:
        A dataset as of `headway.simulate`; times start at 0.

    Raises:
        HeadwayError: where the number of vehicles differs.
    """
    from headway.engine.simulate import simulate

    if len(followers) != recording.vehicles - 1:
        raise HeadwayError(
            f"{recording.source} has {recording.vehicles - 1} followers and {len(followers)} are given; a replay needs "
            "one for each"
        )
    return simulate(behind(recording, list(followers), window=window)[0])


@typed
def one_in(
    recording: Recording,
    cars: Vehicle | Sequence[Vehicle],
    other: Vehicle,
    every: Sequence[int] = (0, 10, 5, 3, 2, 1),
    followers: int = 10,
    window: Window | None = None,
) -> xr.Dataset:
    """Effect on a string of replacing each n-th follower by another vehicle: `MEASURES` along `every`.

    All start in equilibrium behind the recorded leader. In groups of n the last is replaced. A radio needs a sender:
    every car is taken to send what `other` hears.

    Args:
        recording: the recorded platoon, of which the leader counts.
        cars: the vehicles of the string, repeated to `followers`.
        other: the vehicle that replaces some.
        every: values of n from 0 (none is replaced) to `followers`.
        followers: length of the string.
        window: (start, end) [s of the recording]; all of it if None.

    Raises:
        HeadwayError: for an n that is no such number.
    """
    import xarray as xr

    from headway.engine.simulate import simulate_many

    base = [cars] if isinstance(cars, Vehicle) else list(cars)
    for n in every:
        if isinstance(n, bool) or not isinstance(n, int | np.integer) or not 0 <= n <= followers:
            raise HeadwayError(f"every = {n!r} is not a whole number from 0 to {followers}")
    strings = [[other if n and (i + 1) % n == 0 else base[i % len(base)] for i in range(followers)] for n in every]
    runs = simulate_many([behind(recording, s, window=window, state="equilibrium")[0] for s in strings])
    results: dict[str, list[float]] = {name: [] for name in MEASURES}
    for string, run in zip(strings, runs, strict=True):
        speed, gap = run.speed.values, run.gap.values[1:]
        results["speed_deviation"].append(float(speed[-1].std()))
        results["growth"].append(float(speed[-1].std() / speed[0].std()))
        results["least_speed"].append(float(speed[1:].min()))
        results["least_gap"].append(float(gap.min()))
        results["head_to_tail_gain"].append(_gain(string, float(speed[0].mean())))
    return xr.Dataset(
        {
            n: ("every", values, dict(zip(("units", "long_name"), MEASURES[n], strict=True)))
            for n, values in results.items()
        },
        coords={"every": list(every)},
        attrs={"source": recording.source, "other": repr(other.model), "followers": followers},
    )


def _gain(string: Sequence[Vehicle], speed: float) -> float:
    """Supremum of the head-to-tail gain; infinite where a vehicle is locally unstable."""
    from headway.theory.platoon import head_to_tail

    chain = head_to_tail(list(string), speed)
    return chain.peak.gain if chain.locally_stable else math.inf
