"""Bounded least squares for many problems side by side (Levenberg and Marquardt): every candidate of all is a lane.

A problem has a record, an initial state and a set of free quantities of its own; so the polish of several
seeds, the refits of a bootstrap and the points of a profile are one and the same task.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from headway.arrays import Array
from headway.calibration.loop import Loop
from headway.study.executors import cores

__all__ = ["Problems", "polish"]

#: step of the forward differences in the unit cube; trajectories are smooth to 1e-9
_STEP = 1e-5

#: lanes that are driven at once: few enough for their trajectories to stay near
_LANES = 160


@dataclass
class Problems:
    """P least-squares problems side by side.

    Attributes:
        at: (p, P) where they start, in the unit cube.
        free: (p, P) which quantities may move.
        observed: (2, N, P or 1) gaps [m] and speeds [m/s] to be met.
        starts: (2, P) initial gap and speed for each segment; the recorded ones if None.
    """

    at: Array
    free: NDArray[np.bool_]
    observed: Array
    starts: Sequence[Array] | None = None

    @classmethod
    def to_record(cls, loop: Loop, at: Array) -> Problems:
        """Problems that start at points (p, P), all quantities free, and are to meet the record of the loop."""
        return cls(at, np.ones(at.shape, bool), loop.observed[:, :, None])

    def part(self, chosen: slice) -> Problems:
        """The problems of a slice."""
        observed = self.observed if self.observed.shape[2] == 1 else self.observed[:, :, chosen]
        starts = None if self.starts is None else [s[:, chosen] for s in self.starts]
        return Problems(self.at[:, chosen], self.free[:, chosen], observed, starts)


def polish(loop: Loop, problems: Problems, rounds: int = 12) -> tuple[Array, Array]:
    """Points of the unit cube near the least objective of each problem, never worse than where it starts.

    For "gap+speed", a sum of two roots, the two sums of squares are weighted anew in every round.

    Args:
        loop: the closed loop of candidates behind the recording.
        problems: where to start, what may move and what is to be met.
        rounds: most steps of the Levenberg-Marquardt method.

    Returns:
        The points (p, P), and the objectives (P,) there.
    """
    width = max(1, _LANES // (problems.at.shape[0] + 1))
    parts = [slice(i, i + width) for i in range(0, problems.at.shape[1], width)]
    with ThreadPoolExecutor(cores()) as pool:
        results = list(pool.map(lambda part: _together(loop, problems.part(part), rounds), parts))
    return np.concatenate([x for x, _ in results], axis=1), np.concatenate([f for _, f in results])


def _together(loop: Loop, problems: Problems, rounds: int) -> tuple[Array, Array]:
    count = problems.at.shape[1]
    best, damping = problems.at.copy(), np.full(count, 1e-2)
    value, slopes, normal = _linearised(loop, problems, best)
    for _ in range(rounds):
        # a quantity at its bound that would leave it is held there
        held = ~problems.free | ((best <= 0) & (slopes > 0)) | ((best >= 1) & (slopes < 0))
        trial = best.copy()
        for i in range(count):
            move = ~held[:, i]
            if np.isfinite(normal[i]).all() and move.any():
                square = normal[i][np.ix_(move, move)]
                diagonal = np.diag(square) + 1e-12 * max(float(np.diag(square).max()), 1e-300)
                trial[move, i] -= np.linalg.solve(square + damping[i] * np.diag(diagonal), slopes[move, i])
        trial = np.clip(trial, 0.0, 1.0)
        moved = np.abs(trial - best).max(axis=0)
        if (moved < 1e-9).all():
            break
        new, new_slopes, new_normal = _linearised(loop, problems, trial)
        better = new < value
        gain = np.where(better, value - new, 0.0)
        best[:, better], slopes[:, better], normal[better] = trial[:, better], new_slopes[:, better], new_normal[better]
        value = np.where(better, new, value)
        damping = np.clip(np.where(better, 0.2, 6.0) * damping, 1e-9, 1e9)
        if (better & (gain < 1e-8 * value)).sum() + (~better & (moved < 1e-6)).sum() == count:
            break
    return best, value


def _linearised(loop: Loop, problems: Problems, at: Array) -> tuple[Array, Array, Array]:
    """Objective (P,), its slopes up to a factor (p, P) and the normal matrices (P, p, p) at points (p, P)."""
    p, count = at.shape
    step = np.where(at > 1.0 - _STEP, -_STEP, _STEP)
    lanes = np.repeat(at[:, :, None], p + 1, axis=2)  # the point itself, then one quantity moved after the other
    for i in range(p):
        lanes[i, :, i + 1] += step[i]
    starts = None if problems.starts is None else [np.repeat(s, p + 1, axis=1) for s in problems.starts]
    paths, crash = loop.paths(lanes.reshape(p, -1), starts)
    paths = paths.reshape(2, -1, count, p + 1)
    crash = crash.reshape(count, p + 1)
    sums = np.empty((2, count))
    slopes, normal = np.zeros((p, count)), np.zeros((count, p, p))
    rows = (0,) if loop.objective == "gap" else (0, 1)
    parts = []
    for q in (0, 1):
        valid = loop.valid[q]
        error = paths[q, valid, :, 0] - problems.observed[q][valid]
        sums[q] = np.einsum("np,np->p", error, error)
        if q in rows:
            change = (paths[q, valid, :, 1:] - paths[q, valid, :, :1]) / step.T
            parts.append((q, error, change))
    value = loop.weigh(sums, crash[:, 0])
    for q, error, change in parts:
        # the slope of a root is that of its square, divided by twice the root
        weight = 1.0 / np.sqrt(np.maximum(sums[q], 1e-30) * loop.counts[q]) / loop.scale[q]
        slopes += weight * np.einsum("np,npj->jp", error, change)
        normal += weight[:, None, None] * np.einsum("npi,npj->pij", change, change, optimize=True)
    normal[(crash > 0).any(axis=1)] = np.nan
    return value, slopes, normal
