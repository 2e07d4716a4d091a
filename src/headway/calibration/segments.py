"""Pieces of a recording behind which a follower can be driven, and what is wrong with the rest, in words."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from headway.arrays import Array
from headway.data.checks import MISMATCH, check
from headway.data.recording import Recording
from headway.errors import HeadwayError
from headway.sampling import areas
from headway.scenario.recorded import Recorded

__all__ = ["LONGEST_STEP", "Segment", "Window", "cut"]


#: (start, end) [s] in a recording's own time
Window = tuple[float, float]

#: longest step [s] of the loop; a record with a longer one is stepped within
LONGEST_STEP = 0.1

#: a piece shorter than this [s] is left out, and less than this altogether is refused
_LEAST_PIECE, _LEAST_ALTOGETHER = 10.0, 30.0

#: change of the gap [m] in one sample, beyond what speeds explain, that only another vehicle ahead explains
_JUMP = 3.0

#: range of the leader's speed [m/s] below which a record excites nothing
_LEAST_MOTION = 0.5


@dataclass(frozen=True, eq=False)
class Segment:
    """A stretch behind one vehicle ahead. n samples, m steps a sample; times from 0.

    Attributes:
        source: the recording.
        vehicle: number of the follower.
        begin: its start in the recording's time [s].
        step: from sample to sample [s].
        every: m, steps of the loop from sample to sample.
        gap: (n,) [m] of the follower, NaN where missing.
        speed: (n,) [m/s] of the follower, NaN where missing.
        lead: (5, (n-1) m + 1) position, speed and acceleration of the vehicle ahead, and speed and acceleration of the
            platoon's first, at the steps.
        ahead: (n,) recorded speed of the vehicle ahead [m/s].
        length: length of the vehicle ahead [m].
    """

    source: str
    vehicle: int
    begin: float
    step: float
    every: int
    gap: Array
    speed: Array
    lead: Array
    ahead: Array
    length: float

    @property
    def time(self) -> Array:
        """Times [s] of the samples, from 0."""
        return np.asarray(self.step * np.arange(self.gap.size), dtype=np.float64)

    @property
    def duration(self) -> float:
        """Seconds from the first to the last sample."""
        return self.step * (self.gap.size - 1)


def cut(
    recording: Recording, vehicle: int, windows: Sequence[Window] = (), testing: bool = False
) -> tuple[list[Segment], list[str]]:
    """The stretches of a recording behind which a follower can be driven, and notes on the rest.

    Cut where the speed ahead is missing or the gap jumps to another leader; holes in the follower's own record stay
    NaN.

    Args:
        recording: the recorded platoon.
        vehicle: number of the follower, from 1.
        windows: (start, end) [s of the recording]; all of it if there are none.
        testing: whether the stretches are only tested on; else they must be long and lively enough to tell parameters
            apart.

    Returns:
        The segments, and notes in sentences.

    Raises:
        HeadwayError: with what can still be done, for a vehicle that is not there, times that do not rise, gaps that
            are not positive, a confused unit, too little left, or a leader without motion.
    """
    place = recording.source
    if isinstance(vehicle, bool) or not isinstance(vehicle, int | np.integer) or not 1 <= vehicle < recording.vehicles:
        raise HeadwayError(
            f"{place}: there is no follower {vehicle!r}; allowed are 1 to {recording.vehicles - 1} (0 is the leader)"
        )
    notes: list[str] = []
    record = _usable(recording, int(vehicle), notes)
    pieces = _pieces(record, int(vehicle), windows or [(float(record.time[0]), float(record.time[-1]))], notes)
    stretches = [p for p in pieces if record.time[p.stop - 1] - record.time[p.start] >= _LEAST_PIECE - 1e-6]
    for p in pieces:
        if p not in stretches and p.stop - p.start > 1:
            notes.append(
                f"The piece from {record.time[p.start]:g} to {record.time[p.stop - 1]:g} s is shorter than "
                f"{_LEAST_PIECE:g} s and left out."
            )
    total = sum(float(record.time[p.stop - 1] - record.time[p.start]) for p in stretches)
    if not stretches or (total < _LEAST_ALTOGETHER - 1e-6 and not testing):
        raise HeadwayError(
            f"{place}: vehicle {vehicle} has {total:.3g} s of unbroken record and {_LEAST_ALTOGETHER:g} s are needed "
            "to tell parameters apart; add other runs, or widen the window (the record runs from "
            f"{record.time[0]:g} to {record.time[-1]:g} s)"
        )
    segments = [_segment(record, int(vehicle), p) for p in stretches]
    speeds = np.concatenate([s.ahead for s in segments])
    if np.ptp(speeds) < _LEAST_MOTION and not testing:
        gap = float(np.nanmean(np.concatenate([s.gap for s in segments])))
        raise HeadwayError(
            f"{place}: the vehicle ahead of {vehicle} varies its speed by {np.ptp(speeds):.2g} m/s only, which "
            f"excites nothing; all that this record tells is the equilibrium gap, {gap:.3g} m at "
            f"{speeds.mean():.3g} m/s"
        )
    return segments, notes


def _usable(recording: Recording, vehicle: int, notes: list[str]) -> Recording:
    """The recording at uniform steps; refused where its numbers cannot be right."""
    for finding in check(recording):
        if finding.kind == "time-order":
            raise HeadwayError(f"{recording.source}: {finding.message.rstrip('.')}; sort it first")
        if finding.kind == "units" and finding.vehicle == vehicle:
            raise HeadwayError(f"{recording.source}: {finding.message} Name the unit, e.g. --unit speed=km/h")
        if finding.kind == "gap" and finding.vehicle == vehicle:
            raise HeadwayError(
                f"{recording.source}: {finding.message.rstrip('.')}; choose a window without them (train)"
            )
        if finding.kind == "time-step":
            step = float(np.median(np.diff(recording.time)))
            notes.append(f"The time step is not uniform; resampled to {step:.4g} s.")
            recording = recording.resampled(step)
    _agreement(recording, vehicle, notes)
    return recording


def _agreement(record: Recording, vehicle: int, notes: list[str]) -> None:
    """Note where gap and speeds tell different stories, and how good a gap error can then be."""
    relative = record.speed[vehicle - 1] - record.speed[vehicle]
    step = np.diff(record.time)
    off = np.diff(record.gap[vehicle]) - areas(record.time, relative)
    off = off[np.isfinite(off) & (np.abs(off) < _JUMP)]
    if not off.size:
        return
    rms, path = float(np.sqrt(np.mean(off**2)) / np.median(step)), np.cumsum(off)
    floor = float(np.std(path))
    if rms > MISMATCH or floor > 2.0:
        notes.append(
            f"Gap and speeds disagree: the gap's rate differs by {rms:.2g} m/s r.m.s. from the speed difference, and "
            f"even the recorded speeds, integrated, miss the gap by {floor:.2g} m r.m.s.; calibrate on the gap alone "
            "and do not trust smaller errors."
        )


def _pieces(record: Recording, vehicle: int, windows: Sequence[Window], notes: list[str]) -> list[slice]:
    """Runs of samples with a leader throughout and a known start."""
    time, gap, own = record.time, record.gap[vehicle], record.speed[vehicle]
    ahead = record.speed[vehicle - 1]
    usable = np.isfinite(ahead) & np.isfinite(record.speed[0])
    if not usable.all():
        notes.append(f"The speed ahead is missing in {int((~usable).sum())} samples; the record is cut there.")
    missing = int((~np.isfinite(gap)).sum())
    if missing:
        notes.append(f"{missing} of {gap.size} gaps are missing; errors are not counted there.")
    expected = np.append(0.0, np.diff(time) * (ahead[1:] - own[1:] + ahead[:-1] - own[:-1]) / 2)
    change = np.append(0.0, np.diff(gap)) - np.nan_to_num(expected)
    jump = np.abs(np.nan_to_num(change)) > _JUMP
    if jump.any():
        first = float(time[int(np.argmax(jump))])
        notes.append(
            f"The gap jumps {int(jump.sum())} times by more than {_JUMP:g} m beyond what the speeds explain, first at "
            f"{first:g} s: another vehicle came between or the sensor slipped; the record is cut there."
        )
    runs = []
    for start, end in windows:
        if not (math.isfinite(start) and math.isfinite(end) and start < end):
            raise HeadwayError(f"{record.source}: the window {start:g}:{end:g} is empty; write start:end in seconds")
        inside = (time >= start - 1e-9) & (time <= end + 1e-9)
        if inside.sum() < 2:
            raise HeadwayError(
                f"{record.source}: the window {start:g}:{end:g} holds {int(inside.sum())} samples; the record runs "
                f"from {time[0]:g} to {time[-1]:g} s"
            )
        good = usable & inside
        edges = np.flatnonzero(np.diff(np.concatenate(([0], good.astype(int), [0]))))
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            bounds = [int(a), *(int(i) for i in np.flatnonzero(jump) if a < i < b), int(b)]
            for lo, hi in itertools.pairwise(bounds):
                both = np.flatnonzero(np.isfinite(gap[lo:hi]) & np.isfinite(own[lo:hi]))
                if both.size:
                    runs.append(slice(lo + int(both[0]), hi))
    return runs


def _segment(record: Recording, vehicle: int, piece: slice) -> Segment:
    time = record.time[piece]
    step = float((time[-1] - time[0]) / (time.size - 1))
    every = max(1, math.ceil(step / LONGEST_STEP - 1e-6))
    nodes = step / every * np.arange((time.size - 1) * every + 1)
    rows = []
    for n in (vehicle - 1, 0):
        motion = Recorded(
            time=tuple(step * np.arange(time.size)), speed=tuple(record.speed[n][piece])
        ).motion(0, 0.0)  # fmt: skip
        rows.append(motion.at(np.minimum(nodes, motion.start[-1])))
    lead = np.array([rows[0][0], rows[0][1], rows[0][2], rows[1][1], rows[1][2]])
    return Segment(
        record.source, vehicle, float(time[0]), step, every, record.gap[vehicle][piece], record.speed[vehicle][piece],
        np.ascontiguousarray(lead), record.speed[vehicle - 1][piece], record.lengths[vehicle - 1],
    )  # fmt: skip
