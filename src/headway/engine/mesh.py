"""The time mesh of a run and, for each delayed look-up, which step of the past it falls in and how to read it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from headway.engine.breaking import Jumps

__all__ = ["AT", "CUBIC", "Lookup", "Mesh", "build_mesh", "look_up"]

Array = NDArray[np.float64]

#: positions inside a step at which accelerations are evaluated: start, middle, end, and the extra
#: point from which a history of accelerations becomes fourth order between its nodes
AT = (0.0, 0.5, 1.0, 1.0 / 3.0)

#: jumps of this order or lower make a command differ on both sides of a node
TWO_SIDED = 2


@dataclass
class Mesh:
    """Nodes (K+1,) of a run; `jump` where accelerations are two-sided, `record` where results are kept."""

    time: Array
    jump: NDArray[np.bool_]
    record: NDArray[np.bool_]

    @property
    def steps(self) -> int:
        """Number of steps."""
        return self.time.size - 1

    def insert(self, times: Array, jump: NDArray[np.bool_]) -> None:
        """Add nodes at `times`; where one exists already it only takes over the flag."""
        for t, two_sided in zip(times, jump, strict=True):
            i = int(np.searchsorted(self.time, t))
            near = [j for j in (i - 1, i) if 0 <= j <= self.steps and abs(self.time[j] - t) < _close(t)]
            if near:
                self.jump[near[0]] |= two_sided
            elif 0 < i <= self.steps:
                self.time = np.insert(self.time, i, t)
                self.jump = np.insert(self.jump, i, two_sided)
                self.record = np.insert(self.record, i, False)


def _close(t: float) -> float:
    return 1.5e-9 + 1e-14 * abs(t)


def build_mesh(end: float, dt: float, outputs: Array, jumps: Jumps | None) -> Mesh:
    """Steps of `dt`, shortened to end on every breaking point (None: the ballistic scheme, which has none) and output.

    Where a chain of delays would give more breaking points than twice the plain steps, the
    smoothest are left out first (order 4, then 3).
    """
    count = int(np.ceil(end / dt - 1e-9))
    plain = np.append(np.arange(count) * dt, end)
    parts = [plain, outputs]
    two_sided = np.empty(0)
    if jumps is not None:
        order = 4
        while order > TWO_SIDED and np.sum(jumps.order <= order) > 2 * count + 1000:
            order -= 1
        time = jumps.time[(jumps.order <= order) & (jumps.time < end)]
        two_sided = jumps.time[jumps.order <= TWO_SIDED]
        parts.append(time)
    raw = np.sort(np.concatenate(parts))
    nodes = raw[np.concatenate(([True], np.diff(raw) > 1.5e-9))]
    nodes[0], nodes[-1] = 0.0, end
    return Mesh(nodes, _marks(nodes, two_sided), _marks(nodes, outputs))


def _marks(nodes: Array, times: Array) -> NDArray[np.bool_]:
    """True at the nodes nearest to `times`, as far as they are the same times."""
    marks = np.zeros(nodes.size, dtype=bool)
    if times.size:
        right = np.clip(np.searchsorted(nodes, times), 1, nodes.size - 1)
        nearest = np.where(times - nodes[right - 1] < nodes[right] - times, right - 1, right)
        marks[nearest[np.abs(nodes[nearest] - times) < 2e-9]] = True
    return marks


@dataclass(frozen=True)
class Lookup:
    """How to read the past for each delay slot d, step k and position of `AT` (axes in this order).

    `row` history row r, counted from that of the first step: the value lies between rows r and r+1
    (in the history row 0 is the time before 0, row k+1 the node k). `share` how far between
    the two, from 0 to 1. `motion` (…, 4) weights of x_r, x_r+1, v_r, v_r+1 for a position, and of
    v, a alike for a speed. `acceleration` (…, 5) weights of v_r, v_r+1, a_r (right), a_r+1 (left)
    and the extra point. `inside` (K,): some look-up needs the step itself that is being made.
    """

    row: NDArray[np.int64]
    share: Array
    motion: Array
    speed: Array
    acceleration: Array
    inside: NDArray[np.bool_]


def look_up(nodes: Array, first: int, last: int, delays: Array, before: float, extra: bool, ballistic: bool) -> Lookup:
    """Look-ups of steps `first` … `last`-1 for each of `delays` [s]; history begins `before` seconds before 0.

    Row numbers count from the row of step `first`. On a node the start of a step takes the limit from
    the right, its end that from the left.
    """
    start, length = nodes[first:last], np.diff(nodes[first : last + 1])
    # only as much of the past as the longest delay reaches; `base` is the history row of its first node
    reach = nodes[first] - float(delays.max(initial=0.0)) - 1e-8
    base = max(int(np.searchsorted(nodes, reach)) - 1, 0)
    history = nodes[base : last + 1] if base else np.concatenate(([-before], nodes[: last + 1]))
    base = base + 1 if base else 0
    at = np.array(AT)
    t = start[None, :, None] + length[None, :, None] * at - delays[:, None, None]
    row = np.searchsorted(history, t, side="right") - 1
    row = np.clip(row, 0, history.size - 2)
    for offset in (0, 1):
        # snap to a node that only rounding separates from the time looked up
        near = np.abs(history[row + offset] - t) < 2e-9 + 1e-14 * np.abs(t)
        t = np.where(near, history[row + offset], t)
    row = np.clip(np.searchsorted(history, t, side="right") - 1, 0, history.size - 2)
    on_node = t == history[row]
    left = on_node & (at == 1.0) & (row > 0)
    row = np.where(left, row - 1, row)
    step = history[row + 1] - history[row]
    theta = np.where(left, 1.0, (t - history[row]) / step)
    past = row + base == 0
    motion, speed = (_ballistic if ballistic else _hermite)(theta, step)
    linear = np.stack((1.0 - theta, theta, 0.0 * theta, 0.0 * theta), axis=-1)
    motion = np.where(past[..., None], linear, motion)
    speed = np.where(past[..., None], linear, speed)
    acceleration = _held(theta) if ballistic else _acceleration(theta, step, extra)
    acceleration = np.where(past[..., None], 0.0, acceleration)
    relative = row + base - (first + 1)
    inside = np.any(relative == np.arange(last - first)[None, :, None], axis=(0, 2))
    return Lookup(relative, theta, motion, speed, acceleration, inside)


def _hermite(theta: Array, step: Array) -> tuple[Array, Array]:
    one = 1.0 - theta
    w = np.stack(
        (
            one * one * (1.0 + 2.0 * theta),
            theta * theta * (3.0 - 2.0 * theta),
            step * theta * one * one,
            -step * theta * theta * one,
        ),
        axis=-1,
    )
    return w, w


def _ballistic(theta: Array, step: Array) -> tuple[Array, Array]:
    """Constant acceleration within a step: positions quadratic, speeds linear."""
    zero = 0.0 * theta
    half = 0.5 * theta * theta
    position = np.stack((1.0 + zero, zero, step * (theta - half), step * half), axis=-1)
    return position, np.stack((1.0 - theta, theta, zero, zero), axis=-1)


def _held(theta: Array) -> Array:
    weights = np.zeros((*theta.shape, 5))
    weights[..., 2] = 1.0
    return weights


def _cubic_weights() -> Array:
    """Weights (coefficients in θ) of the cubic with given values at 0, 1/3, 1 and given mean.

    The mean acceleration of a step is known to its fifth order from the speeds at its ends; with
    three values it fixes a cubic. (A midpoint would not: the cubic that vanishes at 0, 1/2, 1 has mean 0.)
    """
    points = np.array([0.0, AT[3], 1.0])
    system = np.vstack([np.vander(points, 4, increasing=True), [1.0, 1 / 2, 1 / 3, 1 / 4]])
    return np.linalg.inv(system).T  # rows: value at 0, at 1/3, at 1, mean; columns: powers of θ


CUBIC = _cubic_weights()


def _acceleration(theta: Array, step: Array, extra: bool) -> Array:
    weights = np.empty((*theta.shape, 5))
    if extra:
        powers = np.stack((np.ones_like(theta), theta, theta**2, theta**3), axis=-1)
        start, third, end, mean = (powers @ row for row in CUBIC)
    else:
        # derivative of the speed's Hermite cubic: exact to fourth order at nodes and midpoints
        start, end = (1.0 - theta) * (1.0 - 3.0 * theta), theta * (3.0 * theta - 2.0)
        third, mean = np.zeros_like(theta), 6.0 * theta * (1.0 - theta)
    weights[..., 0], weights[..., 1] = -mean / step, mean / step
    weights[..., 2], weights[..., 3], weights[..., 4] = start, end, third
    return weights
