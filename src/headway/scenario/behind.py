"""A simulated platoon in the place of a recorded one: behind the same leader, from the same start."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from headway.checked import typed
from headway.data.readers import read
from headway.data.recording import Recording, start_of
from headway.errors import HeadwayError, shorten
from headway.scenario.recorded import Recorded
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle

__all__ = ["behind"]

#: longest step [s] of a simulated string
_DT = 0.05

#: seconds after the start of a section in which a first gap and speed may still come
_PATIENCE = 1.0


@typed
def behind(
    record: Recording | str | os.PathLike[str],
    followers: Vehicle | Sequence[Vehicle],
    *,
    window: tuple[float, float] | None = None,
    state: Literal["recorded", "equilibrium"] = "recorded",
    reading: Mapping[str, Any] | None = None,
    **fields: Any,
) -> tuple[Scenario, Recording]:
    """A scenario with simulated followers behind the recorded leader, and the recording beside it.

    Both have times from 0. Compare with `headway.data.compare(simulate(scenario), recording)`.

    Args:
        record: A recording, or the file of one.
        followers: One vehicle for every recorded follower, or a list front to back.
        window: Start and end [s], as the record counts; all of it if not given.
        state: "recorded" begins with the recorded gaps and speeds, each with its vehicle's recorded length, so
            there may be no more followers than the recording has; "equilibrium" rests at the leader's speed.
        reading: How a file is read (format, columns, units), as `headway.data.read` takes it.
        **fields: Fields of the scenario. Without `dt` and `output_step` results are at the recording's own
            times, by equal steps of at most 0.05 s.

    Raises:
        HeadwayError: If the file cannot be read, the leader's speed has holes, or an initial gap or speed is missing.
    """
    whole = record if isinstance(record, Recording) else read(record, **dict(reading or {}))
    part = whole if window is None else whole.between(*window)
    if state not in ("recorded", "equilibrium"):
        raise HeadwayError(f"state = {shorten(state)} is not known; allowed are recorded, equilibrium")
    if isinstance(followers, Vehicle):
        if part.vehicles < 2:
            raise HeadwayError(f"{part.source}: has no followers to compare with")
        cars = [followers] * (part.vehicles - 1)
    else:
        cars = list(followers)
    if not cars:
        raise HeadwayError("followers are no vehicles; one or more are needed")
    section = part.from_zero()
    step = float(np.median(np.diff(section.time)))
    common: dict[str, Any] = {
        "dt": step / math.ceil(step / _DT - 1e-6), "output_step": step, "leader_length": part.lengths[0], **fields,
    }  # fmt: skip
    leader = _leader(record, whole, part, reading)
    if state == "equilibrium":
        return Scenario(leader, cars, **common), section
    if len(cars) >= part.vehicles:
        raise HeadwayError(
            f"{part.source} has {part.vehicles - 1} followers and {len(cars)} are to start where they did; "
            "give as many or fewer, or start in equilibrium"
        )
    cars = [dataclasses.replace(car, length=part.lengths[n]) for n, car in enumerate(cars, start=1)]
    gaps, speeds = _start(whole, part, len(cars))
    cruise = float(leader.motion(0, section.duration).before)
    offsets = tuple((n, speed - cruise) for n, speed in enumerate(speeds, start=1))
    return Scenario(leader, cars, gaps=gaps, speed_offsets=offsets, **common), section


def _leader(record: Any, whole: Recording, part: Recording, reading: Mapping[str, Any] | None) -> Recorded:
    """The recorded leader: by its file where it has one, so that the scenario stays short."""
    if not np.isfinite(part.speed[0]).all():
        hole = float(part.time[int(np.argmax(~np.isfinite(part.speed[0])))])
        raise HeadwayError(f"{part.source}: the leader's speed is missing at {hole:g} s; choose a window without holes")
    if isinstance(record, Recording):
        return Recorded(time=tuple(part.time - part.time[0]), speed=tuple(part.speed[0]))
    table = {k: v for k, v in dict(reading or {}).items() if k in ("format", "columns", "units") and v}
    start, end = (float(t - whole.time[0]) for t in (part.time[0], part.time[-1]))
    return Recorded(file=os.fspath(record), start=start, end=end, **table)


def _start(whole: Recording, part: Recording, count: int) -> tuple[tuple[float, ...], list[float]]:
    """First gaps [m] and speeds [m/s] of followers 1 … count."""
    head = slice(0, int(np.searchsorted(part.time - part.time[0], _PATIENCE + 1e-9)))
    gaps, speeds = [], []
    for n in range(1, count + 1):
        if not (np.isfinite(part.gap[n, head]).any() and np.isfinite(part.speed[n, head]).any()):
            raise HeadwayError(
                f"{part.source}: follower {n} has no gap or speed within a second of {part.time[0]:g} s; "
                f"{_later(whole, part, count)}"
            )
        gap, speed = (float(x) for x in start_of(part.gap[n], part.speed[n]))
        if gap <= 0:
            raise HeadwayError(
                f"{part.source}: follower {n} has a gap of {gap:g} m at {part.time[0]:g} s; "
                f"{_later(whole, part, count)}"
            )
        gaps.append(gap)
        speeds.append(speed)
    return tuple(gaps), speeds


def _later(whole: Recording, part: Recording, count: int) -> str:
    """Where all initial values are there."""
    rows = slice(1, count + 1)
    good = np.isfinite(whole.gap[rows]).all(axis=0) & np.isfinite(whole.speed[: count + 1]).all(axis=0)
    good &= np.nan_to_num(whole.gap[rows]).min(axis=0) > 0
    later = whole.time[good & (whole.time > part.time[0])]
    return f"choose another start, e.g. {later[0]:g} s" if later.size else "the recording never has all of them"
