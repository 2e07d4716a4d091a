"""A batch of which only extremes and squares are kept; see `headway.engine.reduce`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from headway.engine import layout
from headway.engine.plan import Plan
from headway.engine.reduce import AT_ONCE, EXTREMES, QUANTITIES, SQUARE, Kept, finish_kept, reduced, reduced_ballistic
from headway.engine.run import Prepared, Run
from headway.sampling import trapezoid

__all__ = ["ABOUT_GAPS", "EXTREMES", "QUANTITIES", "SQUARE", "Measured", "Measurement", "Reduction"]

Array = NDArray[np.float64]

#: signals that the leader has not
ABOUT_GAPS = ("gap", "relative_speed", "spacing_error")


@dataclass(frozen=True)
class Reduction:
    """What was kept of one signal in lanes of one batch. N+1 vehicles, B lanes; the leader has no gap (NaN).

    `best` (2, N+1, B) highest sample of y and of -y, `place` (2, N+1, B) its number, `around`
    (2, 5, N+1, B) it and its neighbours, `mean_square` (N+1, B).
    """

    best: Array
    place: NDArray[np.int64]
    around: Array
    mean_square: Array


class Measurement(NamedTuple):
    """What is left of a batch of N+1 vehicles, B lanes."""

    reductions: dict[str, Reduction]
    collision: Array  # (N+1, B) [s], NaN if none
    unsound: NDArray[np.bool_]  # (B,) lanes whose law answered something that is no number, or that were given up
    unsettled: NDArray[np.bool_]  # (B,) lanes that another plan has to run again, see `Result`


class Measured(Run):
    """Integration of plans whose trajectories are reduced on the way. `wanted`: signal → `EXTREMES | SQUARE`."""

    def __init__(
        self, plan: Plan, wanted: Mapping[str, int], prepared: Prepared | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> None:  # fmt: skip
        super().__init__(plan, prepared, cancelled)
        count, elements = len(wanted), self.rows * self.lanes
        self.wanted = tuple(wanted)
        self.time = self.mesh.time[self.mesh.record]
        self.kept = Kept(
            what=np.array([(QUANTITIES.index(n), mode) for n, mode in wanted.items()], dtype=np.int64).reshape(-1, 2),
            weight=trapezoid(self.time),
            length=np.empty(elements - self.lanes),
            start=np.empty(elements - self.lanes),
            recent=np.empty((count, AT_ONCE + 4, elements)),
            best=np.empty((count, 2, elements)),
            place=np.empty((count, 2, elements), dtype=np.int64),
            around=np.empty((count, 2, 5, elements)),
            square=np.empty((count, elements)),
            rows=np.zeros(AT_ONCE, dtype=np.int64),
            right=np.zeros(AT_ONCE, dtype=np.int64),
        )
        self._clear()

    def again(self, plan: Plan, prepared: Prepared | None) -> None:
        """Begin with another plan of the same frame and as many lanes, in the memory that is there."""
        self.plan, self.prepared, self.made, self.out_row = plan, prepared, 0, 0
        self._begin(self.state)
        self._clear()

    def _clear(self) -> None:
        kept, x = self.kept, self.plan.x
        kept.length[:] = self.plan.platoon.length
        kept.start[:] = x[:-1].ravel() - kept.length - x[1:].ravel()
        kept.recent.fill(np.nan)
        kept.best.fill(-np.inf)
        for array in (kept.place, kept.around, kept.square):
            array.fill(0)
        self.number = 0

    def _rows_kept(self) -> int:
        return 1

    def _ring_size(self, first: int, last: int) -> int:
        return super()._ring_size(first, last) + AT_ONCE

    def advance(self, first: int, last: int, row0: int, steps: layout.Steps) -> int:
        """Make steps as `Run.advance` does, and reduce what they leave."""
        platoon, state = self.plan.platoon, self.state
        silent = steps._replace(flags=steps.flags & ~layout.FLAG_RECORD)
        record = self.mesh.record[self.made : self.made + steps.step.size]
        if self.ballistic:
            done, self.number = reduced_ballistic(
                first, last, row0, platoon, silent, record, state, self.kept, self.number, self.outputs, self.lanes
            )
        else:
            done, self.number = reduced(
                first, last, row0, self.detect, self.plan.extra, self.stepper, platoon, silent, record,
                state, self.alone, self.kept, self.number, self.outputs, self.lanes,
            )  # fmt: skip
        return int(done)

    def measure(self) -> Measurement:
        """Integrate to the end."""
        self._integrate()
        ring, row = self.state.ring, (self.mesh.steps + 1) % self.state.ring.shape[1]
        finish_kept(self.kept, self.number, row, ring, self.lanes)
        collision = self.state.collision.copy()
        hit = np.fmin.accumulate(np.where(np.isnan(collision), np.inf, collision), axis=0)
        # what is not finite once never is again
        end = ring[:, row].reshape(5, self.rows, self.lanes)[[0, 1, 3]]
        unsound = (~np.isfinite(end).all(axis=0) & ~np.isfinite(hit)).any(axis=0)
        # the weights of the samples before a collision of oneself or further ahead
        total = np.append(0.0, np.cumsum(self.kept.weight))[np.searchsorted(self.time, hit)]
        shape = (self.rows, self.lanes)
        kept = self.kept
        found = {}
        for q, name in enumerate(self.wanted):
            best = np.where(np.isfinite(kept.best[q]), kept.best[q], np.nan)
            found[name] = Reduction(
                best.reshape(2, *shape), kept.place[q].reshape(2, *shape).copy(),
                kept.around[q].reshape(2, 5, *shape).copy(),
                np.divide(kept.square[q].reshape(shape), total, out=np.full(shape, np.nan), where=total > 0.0),
            )  # fmt: skip
            if name in ABOUT_GAPS:
                found[name].mean_square[0] = np.nan
        return Measurement(found, collision, unsound & ~self.unsettled, self.unsettled)
