"""Errors of a follower in closed loop on recorded stretches, beside two drivers that need no model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from headway.arrays import Array
from headway.calibration.loop import Loop
from headway.calibration.segments import Segment
from headway.calibration.space import Space

__all__ = ["Errors", "errors_on"]


class Errors(NamedTuple):
    """Errors on the stretches of one recording, beside two drivers that need no model; NaN where the model collides.

    Attributes:
        source: the recording.
        vehicle: number of the follower.
        seconds: length of the stretches together [s].
        gap: r.m.s. gap error [m].
        gap_relative: r.m.s. gap error over r.m.s. recorded gap [1].
        speed: r.m.s. speed error [m/s].
        constant_gap: gap error [m] of a driver who keeps the mean recorded speed of the stretch.
        constant_speed: that driver's speed error [m/s].
        copy_gap: gap error [m] of a driver who does at once what the vehicle ahead does, so that the gap stays.
        copy_speed: that driver's speed error [m/s].
    """

    source: str
    vehicle: int
    seconds: float
    gap: float
    gap_relative: float
    speed: float
    constant_gap: float
    constant_speed: float
    copy_gap: float
    copy_speed: float


def errors_on(segments: Sequence[Segment], space: Space, at: Array) -> Errors:
    """Errors of one candidate on stretches of one recording.

    Args:
        segments: the stretches, at least one.
        space: what is fitted.
        at: the candidate (p,) in the unit cube.
    """
    loop = Loop(space, segments)
    gap, speed = loop.rms(at[:, None])[:, 0]
    parts = [_baselines(s, start) for s, start in zip(segments, loop.starts, strict=True)]
    steady, copy = (_rms(loop, np.concatenate([p[i] for p in parts], axis=1)) for i in (0, 1))
    return Errors(
        segments[0].source, segments[0].vehicle, sum(s.duration for s in segments), float(gap),
        float(gap / loop.scale[0]), float(speed), *steady, *copy,
    )  # fmt: skip


def _baselines(segment: Segment, start: Array) -> tuple[Array, Array]:
    """Gap and speed (2, n) of the steady driver and of the one who copies."""
    ahead = segment.lead[0, :: segment.every]
    mean = float(np.nanmean(segment.speed))
    steady = np.stack((start[0] + ahead - mean * segment.time, np.full(ahead.size, mean)))
    return steady, np.stack((np.full(ahead.size, start[0]), segment.lead[1, :: segment.every]))


def _rms(loop: Loop, path: Array) -> tuple[float, float]:
    error = np.where(loop.valid, path - loop.observed, 0.0)
    gap, speed = np.sqrt((error**2).sum(axis=1) / np.maximum(loop.counts, 1))
    return float(gap), float(speed)
