"""Candidates in closed loop behind recorded vehicles: from points of the unit cube to errors and trajectories."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from headway.arrays import Array
from headway.calibration.kernel import follow
from headway.calibration.segments import Segment
from headway.calibration.space import Space
from headway.data.recording import start_of
from headway.engine.compile import address
from headway.engine.layout import SIGNAL_CODES, SIGNAL_TABLE
from headway.errors import HeadwayError
from headway.models.signal import AHEAD, SIGNALS

__all__ = ["OBJECTIVES", "PENALTY", "Loop"]


#: what can be minimised
OBJECTIVES = ("gap", "gap+speed")

#: objective of a candidate that collides at the end of the record; twice it at the start
PENALTY = 100.0


class Loop:
    """Closed loop of candidates behind the vehicle ahead in each segment.

    The objective is NRMSE(gap) = sqrt(mean e²)/sqrt(mean recorded²), for "gap+speed" plus that of speed, over all
    segments (Punzo and Montanino, Transp. Res. B 91, 2016). L lanes, p quantities, N samples of all segments.

    Args:
        space: the quantities that are fitted, and the vehicle that has them.
        segments: stretches of recordings.
        objective: one of `OBJECTIVES`.
    """

    def __init__(self, space: Space, segments: Sequence[Segment], objective: str = "gap") -> None:
        self.space, self.segments, self.objective = space, list(segments), objective
        law = space.vehicle.model.law
        self.fixed = tuple(
            (n, x) for n, x in space.vehicle.model.items if law.parameters[n].info.structural and n not in space.names
        )
        fixed = {n for n, _ in self.fixed}
        lagged = space.vehicle.lag > 0 or "lag" in space.names
        # own acceleration that is heard at once is solved for, as in the engine
        implicit = "a" in law.signals and not lagged and space.pattern["a"][0] * _longest(space) == 0.0
        self.address = address(law, self.fixed, tuple(n for n in law.parameters if n not in fixed), implicit, False)
        self.codes = SIGNAL_TABLE[[SIGNAL_CODES[s] for s in law.signals]]
        for name in law.signals:
            if SIGNALS[name].of > AHEAD:
                raise HeadwayError(f"{law.name} perceives {name}: a fit has only the vehicle ahead and the leader")
        self.pattern = np.array([half for name in law.signals for half in space.pattern[name]])
        self.same = np.array([self._heard_before(i) for i in range(len(self.codes))], dtype=np.int64)
        self.limits = np.array(space.vehicle.limits or (-math.inf, math.inf))
        gap, speed = (np.concatenate([getattr(s, n) for s in segments]) for n in ("gap", "speed"))
        self.valid = np.stack((np.isfinite(gap), np.isfinite(speed)))
        self.observed = np.stack((gap, speed))
        self.counts = self.valid.sum(axis=1)
        squares = np.nan_to_num(self.observed) ** 2
        #: r.m.s. of recorded gap and speed, by which errors are divided
        self.scale = np.sqrt(squares.sum(axis=1) / np.maximum(self.counts, 1))
        self.evaluations = 0

    @functools.cached_property
    def starts(self) -> list[Array]:
        """Initial gap and speed (2,) of each segment."""
        return [start_of(s.gap, s.speed) for s in self.segments]

    @property
    def parts_of(self) -> list[slice]:
        """Where each segment's samples stand among the N."""
        ends = np.cumsum([s.gap.size for s in self.segments])
        return [slice(int(e - s.gap.size), int(e)) for s, e in zip(self.segments, ends, strict=True)]

    def _heard_before(self, i: int) -> int:
        """Number of an earlier signal that hears one's own speed as late as signal `i` does; -1 if there is none."""
        own_speed = SIGNAL_TABLE[SIGNAL_CODES["v"]]
        for n in range(i):
            if np.array_equal(self.codes[n], own_speed) and self.pattern[2 * n + 1] == self.pattern[2 * i + 1]:
                return n
        return -1

    def errors(self, unit: Array) -> Array:
        """Objective (L,) of candidates (p, L) in the unit cube."""
        sums, crash, _ = self._drive(unit, None, keep=False)
        return self.weigh(sums, crash)

    def weigh(self, sums: Array, crash: Array) -> Array:
        """Objective of candidates from their errors.

        Args:
            sums: (2, L) sums of squares of gap and speed.
            crash: (L,) shares of the record left after a collision.

        Returns:
            (L,) the objective; `PENALTY` and more where there is a collision.
        """
        relative = np.sqrt(sums / np.maximum(self.counts, 1)[:, None]) / self.scale[:, None]
        value = relative[0] if self.objective == "gap" else relative[0] + relative[1]
        return np.where(crash > 0, PENALTY * (1.0 + crash), np.minimum(value, PENALTY))

    def rms(self, unit: Array) -> Array:
        """r.m.s. errors (2, L) of gap [m] and speed [m/s] of candidates (p, L); NaN where a candidate collides."""
        sums, crash, _ = self._drive(unit, None, keep=False)
        return np.where(crash > 0, np.nan, np.sqrt(sums / np.maximum(self.counts, 1)[:, None]))

    def paths(self, unit: Array, starts: Sequence[Array] | None = None) -> tuple[Array, Array]:
        """Trajectories of candidates.

        Args:
            unit: (p, L) points of the unit cube.
            starts: initial gap and speed (2, L) for each segment; the recorded ones if None.

        Returns:
            Gaps [m] and speeds [m/s] (2, N, L), and the shares (L,) of the record left after a collision.
        """
        _, crash, path = self._drive(unit, starts, keep=True)
        return path, crash

    def _drive(self, unit: Array, starts: Sequence[Array] | None, keep: bool) -> tuple[Array, Array, Array]:
        lanes = unit.shape[1]
        self.evaluations += lanes
        values = dict(zip(self.space.names, self.space.values(unit), strict=True))
        parameters = np.empty((max(len(self.space.vehicle.model.items), 1), lanes))
        for i, (name, x) in enumerate(self.space.vehicle.model.items):
            parameters[i] = values.get(name, x)
        delay = values.get("delay", np.full(lanes, self.space.vehicle.perception.longest))
        lag = values.get("lag", np.full(lanes, self.space.vehicle.lag))
        sums, left, paths = np.zeros((2, lanes)), np.zeros(lanes), []
        for i, (segment, part) in enumerate(zip(self.segments, self.parts_of, strict=True)):
            h = segment.step / segment.every
            start = self.starts[i][:, None] if starts is None else starts[i]
            shift, weight = self._look_ups(delay, h)
            valid = self.valid[:, part]
            observed = np.concatenate((np.where(valid, self.observed[:, part], 0.0), valid))
            crash, n = np.empty(lanes), len(self.codes)
            path = np.empty((2, segment.gap.size if keep else 0, lanes))
            ring = np.zeros((3, 1 << int(shift.max() + 3).bit_length(), lanes))
            follow(
                self.address, self.codes, self.same, shift, weight, _actuator(lag, h), self.limits, parameters,
                segment.lead, np.ascontiguousarray(np.broadcast_to(start, (2, lanes))), h, segment.every, observed,
                sums, crash, path, ring, np.empty((n + 1, lanes)), np.empty((n, 3), dtype=np.int64),
                np.empty((2, lanes)), np.empty(lanes),
            )  # fmt: skip
            left += crash / len(self.segments)
            paths.append(path)
        return sums, left, np.concatenate(paths, axis=1)

    def _look_ups(self, delay: Array, h: float) -> tuple[NDArray[np.int64], Array]:
        """For each half of each signal, whole steps back (2 signals, L) and weights (2 signals, 5, L).

        Weights of the two values and two slopes of a cubic Hermite step, and the share of the earlier value in a
        line; see `headway.calibration.kernel`.
        """
        ratio = self.pattern
        steps = ratio[:, None] * delay / h
        shift = np.floor(steps + 1e-9)
        rest = np.maximum(steps - shift, 0.0)
        u = 1.0 - rest
        weight = np.stack(
            (
                (1 + 2 * u) * rest**2, u * u * (3 - 2 * u), h * u * rest**2, -h * u * u * rest, rest,
            ), axis=1,
        )  # fmt: skip
        return shift.astype(np.int64), np.ascontiguousarray(weight)


def _longest(space: Space) -> float:
    """The longest delay [s] that a candidate can have."""
    return space.high[space.names.index("delay")] if "delay" in space.names else space.vehicle.perception.longest


def _actuator(lag: Array, h: float) -> Array:
    """(3, L): a_end = w0 a + w1 u + w2 u_end, exact for a first-order lag and a command linear in the step."""
    with np.errstate(all="ignore"):
        gone = np.where(lag > 0, np.exp(-h / lag), 0.0)
        mean = np.where(lag > 0, lag / h * (1.0 - gone), 0.0)
    return np.stack((gone, mean - gone, 1.0 - mean))
