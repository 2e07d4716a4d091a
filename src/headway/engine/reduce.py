"""Extremes and squares of signals, kept while the kernel runs: what a study wants of platoons, not their trajectories.

After some steps the states at their starts are turned into the signals asked for. Of each the last
samples are kept, the highest and the least sample so far with its two neighbours on either side
(from which the extreme between samples is found, see `headway.metrics.extremes`), and the sum of
weighted squares. Nothing grows with the duration.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from headway.engine.kernel import advance, advance_ballistic
from headway.engine.loops import copy, fast, seldom

__all__ = ["AT_ONCE", "EXTREMES", "QUANTITIES", "SQUARE", "Kept", "finish_kept", "reduced", "reduced_ballistic"]

#: signals that can be reduced, by code
QUANTITIES = ("position", "speed", "acceleration", "gap", "relative_speed", "spacing_error")
_POSITION, _SPEED, _ACCELERATION, _GAP, _RELATIVE, _ERROR = range(6)

#: what is kept of a signal
EXTREMES, SQUARE = 1, 2

#: elements that are looked through together for a new extreme
_PATCH = 64

#: steps that are made before their starts are reduced, and rows that their samples and the neighbours need
AT_ONCE = 4
_ROWS = AT_ONCE + 4

_kernel = njit(error_model="numpy", nogil=True, cache=True, _nrt=False)


class Kept(NamedTuple):
    """What is kept of each of Q signals of E = (N+1) lanes elements. Least values are kept as the highest of -y."""

    what: np.ndarray  # (Q, 2) code of the signal, and EXTREMES | SQUARE
    weight: np.ndarray  # (outputs,) of each sample in a mean square
    length: np.ndarray  # (E - lanes,) of the vehicle ahead
    start: np.ndarray  # (E - lanes,) gap at the start
    recent: np.ndarray  # (Q, AT_ONCE + 4, E) the last samples
    best: np.ndarray  # (Q, 2, E) highest of y and of -y
    place: np.ndarray  # (Q, 2, E) number of that sample
    around: np.ndarray  # (Q, 2, 5, E) it and its neighbours
    square: np.ndarray  # (Q, E) weighted sum of squares
    rows: np.ndarray  # (AT_ONCE,) where in the ring the samples stand that are being taken
    right: np.ndarray  # (AT_ONCE,) not 0 where their accelerations have two limits


@fast
def _difference(out, a, b):
    for i in range(out.size):
        out[i] = a[i] - b[i]


@fast
def _gap(out, ahead, own, length):
    for i in range(out.size):
        out[i] = ahead[i] - length[i] - own[i]


@fast
def _error(out, ahead, own, length, start):
    for i in range(out.size):
        out[i] = (ahead[i] - length[i] - own[i]) - start[i]


@fast
def _simulated(out, a, x):
    """Accelerations, but none of vehicles beyond a collision: laws of late signals go on answering for a while."""
    for i in range(out.size):
        out[i] = a[i] + (x[i] - x[i])


@fast
def _add_square(total, y, w):
    for i in range(total.size):
        # beyond a collision nothing is known
        square = y[i] * y[i] * w
        total[i] += square if square == square else 0.0


@fast
def _news(y, after, high, low):
    """Whether a sample is a new highest or least one, and not less extreme than the next."""
    found = 0
    for i in range(y.size):
        # (said so that the last sample before a collision, behind which there is none, counts)
        found |= ((y[i] > high[i]) & (not y[i] < after[i])) | ((-y[i] > low[i]) & (not y[i] > after[i]))
    return found != 0


@seldom
def _keep(kept, q, number, first, last):
    """Take sample `number` where it is a new extreme."""
    recent = kept.recent[q]
    y, after = recent[number % _ROWS], recent[(number + 1) % _ROWS]
    for side in range(2):
        best, place, around = kept.best[q, side], kept.place[q, side], kept.around[q, side]
        sign = 1.0 if side == 0 else -1.0
        for i in range(first, last):
            if sign * y[i] > best[i] and not sign * y[i] < sign * after[i]:
                best[i] = sign * y[i]
                place[i] = number
                for j in range(5):
                    around[j, i] = sign * recent[(number - 2 + j) % _ROWS, i]


@fast
def _signal(code, y, x, v, a, first, last, kept, B):
    """The signal of elements `first` … `last`-1."""
    if code == _POSITION:
        copy(y, x[first:last])
    elif code == _SPEED:
        copy(y, v[first:last])
    elif code == _ACCELERATION:
        _simulated(y, a[first:last], x[first:last])
    elif code == _RELATIVE:
        _difference(y, v[first - B : last - B], v[first:last])
    else:
        ahead, length = x[first - B : last - B], kept.length[first - B : last - B]
        if code == _GAP:
            _gap(y, ahead, x[first:last], length)
        else:
            _error(y, ahead, x[first:last], length, kept.start[first - B : last - B])


@fast
def _take(kept, number, rows, right, count, ring, B):
    """Take `count` samples from `number` on, which stand in `rows` of the ring.

    A sample is judged when the two after it are known. A patch of elements passes all samples before
    the next patch, so that it is read once from a far memory.
    """
    E = ring.shape[2]
    for q in range(kept.what.shape[0]):
        code, mode = kept.what[q, 0], kept.what[q, 1]
        high, low = kept.best[q, 0], kept.best[q, 1]
        for first in range(B if code >= _GAP else 0, E, _PATCH):
            last = min(first + _PATCH, E)
            for j in range(count):
                y = kept.recent[q, (number + j) % _ROWS, first:last]
                a = ring[2 if right[j] else 3, rows[j]]
                _signal(code, y, ring[0, rows[j]], ring[1, rows[j]], a, first, last, kept, B)
                if mode & SQUARE:
                    _add_square(kept.square[q, first:last], y, kept.weight[number + j])
            if mode & EXTREMES:
                for c in range(max(number - 2, 0), number + count - 2):
                    y, after = kept.recent[q, c % _ROWS], kept.recent[q, (c + 1) % _ROWS]
                    if _news(y[first:last], after[first:last], high[first:last], low[first:last]):
                        _keep(kept, q, c, first, last)


@_kernel
def reduced(first, last, row0, detect, extra, lanes, platoon, steps, record, state, alone, kept, number, out, B):
    """Make steps `first` … `last`-1 by `advance` and reduce each start to `record`.

    Returns (number of the next step, samples so far); it may return before `last` is reached, as `advance` may.

    `steps` record nothing themselves, so `out` is not written to.
    """
    ring, rows, right = state.ring, kept.rows, kept.right
    k = first
    while k < last:
        end, _ = advance(k, min(k + AT_ONCE, last), row0, detect, extra, lanes, platoon, steps, state, alone, out, 0, B)
        if end == k:
            break
        count = 0
        for i in range(k, end):
            if record[i]:
                rows[count] = (row0 + i) % ring.shape[1]
                right[count] = state.two[rows[count]]
                count += 1
        _take(kept, number, rows, right, count, ring, B)
        number += count
        k = end
    return k, number


@_kernel
def reduced_ballistic(first, last, row0, platoon, steps, record, state, kept, number, out, B):
    """Make steps by `advance_ballistic` and reduce each start to `record`; as `reduced`."""
    ring, rows, right = state.ring, kept.rows, kept.right
    for k in range(first, last, AT_ONCE):
        end = min(k + AT_ONCE, last)
        advance_ballistic(k, end, row0, platoon, steps, state, out, 0, B)
        count = 0
        for i in range(k, end):
            if record[i]:
                rows[count] = (row0 + i) % ring.shape[1]
                right[count] = 0
                count += 1
        _take(kept, number, rows, right, count, ring, B)
        number += count
    return last, number


@_kernel
def finish_kept(kept, number, row, ring, B):
    """Take the state at the end, which starts no step, and judge the last two samples, which have no neighbours."""
    kept.rows[0], kept.right[0] = row, 0
    _take(kept, number, kept.rows, kept.right, 1, ring, B)
    for q in range(kept.what.shape[0]):
        if kept.what[q, 1] & EXTREMES:
            for late in range(max(number - 1, 0), number + 1):
                y = kept.recent[q, late % _ROWS]
                for i in range(y.size):
                    for side in range(2):
                        value = y[i] if side == 0 else -y[i]
                        if value > kept.best[q, side, i]:
                            kept.best[q, side, i] = value
                            kept.place[q, side, i] = late
