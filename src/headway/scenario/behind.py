"""A simulated platoon in the place of a recorded one: behind the same leader, from the same start."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from headway.data.readers import read
from headway.data.recording import Recording
from headway.errors import HeadwayError
from headway.scenario.recorded import Recorded
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle

__all__ = ["behind"]


def behind(
    file: str | os.PathLike[str],
    follower: Vehicle,
    *,
    start: float = 0.0,
    end: float | None = None,
    reading: Mapping[str, Any] | None = None,
    **fields: Any,
) -> tuple[Scenario, Recording]:
    """A scenario with as many `follower`s as the file has, behind its leader, and the recording itself.

    Followers begin with the recorded gaps [m] and speeds [m/s] at `start` [s]; the section ends at
    `end` (the end of the record if None). Both have times from 0. `reading` goes to
    `headway.data.read` (format, columns, units), `fields` to the scenario (dt, scheme, …). Compare
    with `headway.data.compare(simulate(scenario), recording)`.

    Raises `HeadwayError` where the file cannot be read or the initial state is missing.
    """
    options = dict(reading or {})
    record = read(Path(file), **options).from_zero()
    last = record.duration if end is None else end
    section = record.between(start, last).from_zero()
    if section.vehicles < 2:
        raise HeadwayError(f"{file}: has no followers to compare with")
    gaps, speeds = section.gap[1:, 0], section.speed[:, 0]
    good = np.isfinite(record.gap[1:]).all(axis=0) & np.isfinite(record.speed).all(axis=0)
    good &= np.nan_to_num(record.gap[1:]).min(axis=0) > 0
    later = record.time[good & (record.time > start)]
    hint = f"choose another start, e.g. {later[0]:g} s" if later.size else "it never has all of them"
    for n, (gap, speed) in enumerate(zip(gaps, speeds[1:], strict=True), start=1):
        if not (np.isfinite(gap) and np.isfinite(speed)):
            raise HeadwayError(f"{file}: follower {n} has no gap or speed at {start:g} s; {hint}")
        if gap <= 0:
            raise HeadwayError(f"{file}: follower {n} has a gap of {gap:g} m at {start:g} s; {hint}")
    table = {k: options[k] for k in ("format", "columns", "units") if options.get(k)}
    leader = Recorded(file=str(file), start=start, end=last, **table)
    cruise = float(leader.motion(0, last - start).before)
    offsets = tuple((n, float(v) - cruise) for n, v in enumerate(speeds[1:], start=1))
    vehicles = [dataclasses.replace(follower, length=length) for length in section.lengths[1:]]
    scenario = Scenario(
        leader, vehicles, gaps=tuple(float(g) for g in gaps), speed_offsets=offsets,
        leader_length=section.lengths[0], **fields,
    )  # fmt: skip
    return scenario, section
