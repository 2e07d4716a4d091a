"""Measures of sampled signals as plain arrays (…, T) → (…): what `metrics`, studies and the command line share.

Extremes lie between samples: they are refined by the quartic through the five samples around the
extreme one, so that a measure does not depend on how densely results were kept. That holds where the
five lie on one smooth curve. At a corner, beside a jump, on a plateau the sample stands, and what has
bounds (an acceleration its limits, a speed standstill) is never refined beyond them. NaN samples are
left out; a signal without any other gives NaN.

All is plain arithmetic, element by element and sum by sum in the order of time, so that a measure
of many signals at once has the bits of one alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from headway.arrays import Array
from headway.sampling import trapezoid

__all__ = ["FREE", "FROM_ZERO", "Bounds", "amplitude_of", "extreme_of", "peak_of", "refined", "rms_of"]

#: least and largest value that a signal can have: numbers, or arrays (…,) as of its extremes
Bounds = tuple[Any, Any]

FREE: Bounds = (-np.inf, np.inf)
#: bounds of speeds and gaps
FROM_ZERO: Bounds = (0.0, np.inf)

#: Newton steps towards the top of the quartic from that of the parabola
_STEPS = 4

#: by how much the bend of one smooth curve may change from sample to sample, as shares of it: its second
#: difference (a sine of nine samples a period has as much), and from one side to the other
_CORNER, _SKEW = 0.5, 1.0


def extreme_of(time: Array, values: Array, sign: float, bounds: Bounds = FREE) -> Array:
    """Largest or least value over time, refined between samples.

    Args:
        time: sample times (T,) [s], rising.
        values: signal (…, T); NaN samples are left out.
        sign: 1 for the largest value, -1 for the least.
        bounds: least and largest value that the signal can have, numbers or arrays (…,).

    Returns:
        Extremes (…,), in the unit of the signal; NaN where there is no sample.
    """
    rows = sign * np.asarray(values, dtype=float).reshape(-1, time.size)
    finite = np.isfinite(rows)
    place = np.argmax(np.where(finite, rows, -np.inf), axis=1)
    each = np.arange(rows.shape[0])
    best = np.where(finite.any(axis=1), rows[each, place], np.nan)
    around = rows[each, np.clip(place + np.arange(-2, 3)[:, None], 0, time.size - 1)]
    bound = sign * np.asarray(bounds[1] if sign > 0 else bounds[0], dtype=float)
    most = np.broadcast_to(bound, np.shape(values)[:-1]).ravel()
    return (sign * refined(time, best, place, around, most)).reshape(np.shape(values)[:-1])


def refined(
    time: Array, best: Array, place: NDArray[np.int64], around: Array, most: Any = np.inf, ringing: bool = False
) -> Array:
    """Highest values of signals, refined from their highest samples by the quartic through five samples.

    Where a sample has not two finite neighbours on either side, or the five do not lie on one smooth curve, the sample
    stands.

    Args:
        time: sample times (T,) [s].
        best: highest sample (n,) of each signal.
        place: its number (n,) among the times.
        around: that sample and its neighbours (5, n).
        most: bound (n,) beyond which nothing is refined; a sample that is there already stands.
        ringing: whether the signals swing freely, so that coarse samples are no corners.

    Returns:
        Highest values (n,).
    """
    inner: Any = np.flatnonzero((place >= 2) & (place + 3 <= time.size) & np.isfinite(around).all(axis=0))
    if not inner.size:
        return best
    if inner.size == best.size:
        inner = slice(None)  # as nearly always
    top = place[inner]
    t = (time[top + np.arange(-2, 3)[:, None]] - time[top]) / (time[top + 1] - time[top - 1])
    y = around[:, inner] - best[inner]
    result = best.copy()
    with np.errstate(all="ignore"):
        result[inner] += _above(t[[0, 1, 3, 4]], y[[0, 1, 3, 4]], ringing)
    return np.where(result > most, np.maximum(best, most), result)


def _above(t: Array, y: Array, ringing: bool) -> Array:
    """How far (n,) a signal rises over its highest sample at 0, whose neighbours at `t` (4, n) have heights `y`."""
    # the quartic through 0 is t times a cubic, which divided differences give
    d = y / t
    d01, d12, d23 = (d[1] - d[0]) / (t[1] - t[0]), (d[2] - d[1]) / (t[2] - t[1]), (d[3] - d[2]) / (t[3] - t[2])
    d012, d123 = (d12 - d01) / (t[2] - t[0]), (d23 - d12) / (t[3] - t[1])
    # the bends through three samples each: behind, at and before the highest
    back = (d[1] - (y[1] - y[0]) / (t[1] - t[0])) / -t[0]
    front = ((y[3] - y[2]) / (t[3] - t[2]) - d[2]) / t[3]
    smooth = (np.abs(back + front - 2.0 * d12) <= -_CORNER * d12) & (np.abs(front - back) <= -_SKEW * d12)
    c4 = (d123 - d012) / (t[3] - t[0])
    c3 = d012 - c4 * (t[0] + t[1] + t[2])
    c2 = d01 - d012 * (t[0] + t[1]) + c4 * (t[0] * t[1] + t[0] * t[2] + t[1] * t[2])
    c1 = d[0] - d01 * t[0] + d012 * t[0] * t[1] - c4 * t[0] * t[1] * t[2]
    # the parabola through the three middle samples
    bend = d12
    slope = d[1] - bend * t[1]
    hill = bend < 0
    u = np.where(hill, np.clip(-slope / (2.0 * bend), t[1], t[2]), 0.0)
    for _ in range(_STEPS):
        rate = c1 + u * (2.0 * c2 + u * (3.0 * c3 + u * 4.0 * c4))
        curve = 2.0 * c2 + u * (6.0 * c3 + u * 12.0 * c4)
        u = np.where(curve < 0, np.clip(u - rate / curve, t[1], t[2]), u)
    height = u * (c1 + u * (c2 + u * (c3 + u * c4)))
    # where the quartic rises above the parabola it follows something else than the hill
    fits = hill & (smooth | ringing) & (height > 0) & (height <= -slope * slope / (2.0 * bend))
    return np.where(fits, height, 0.0)


def peak_of(time: Array, values: Array, bounds: Bounds = FREE) -> Array:
    """Largest magnitude (…,) over time of values (…, T) at times (T,) [s], refined within bounds."""
    return np.fmax(np.abs(extreme_of(time, values, 1.0, bounds)), np.abs(extreme_of(time, values, -1.0, bounds)))


def amplitude_of(time: Array, values: Array, bounds: Bounds = FREE) -> Array:
    """Half the range (…,) over time of values (…, T) at times (T,) [s], refined within bounds."""
    return 0.5 * (extreme_of(time, values, 1.0, bounds) - extreme_of(time, values, -1.0, bounds))


def rms_of(time: Array, values: Array) -> Array:
    """Root of the mean square (…,) over time of values (…, T) at times (T,) [s], by the trapezoid rule."""
    weight = trapezoid(time)
    finite = np.isfinite(values)
    total = np.cumsum(finite * weight, axis=-1)[..., -1]
    square = np.cumsum(np.where(finite, values, 0.0) ** 2 * weight, axis=-1)[..., -1]
    return np.sqrt(np.divide(square, total, out=np.full(np.shape(total), np.nan), where=total > 0))
