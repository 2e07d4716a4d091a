"""Measures of sampled signals as plain arrays (…, T) → (…): what `metrics` and the command line share.

Extremes lie between samples: they are refined by the polynomial through the five samples around
the extreme one, so that a measure does not depend on how densely results were kept. NaN samples
are left out; a signal without any other gives NaN.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["amplitude_of", "extreme_of", "peak_of", "rms_of"]

Array = NDArray[np.float64]


def extreme_of(time: Array, values: Array, sign: float) -> Array:
    """Largest value over time (`sign` = 1) or least (-1)."""
    rows = np.asarray(values, dtype=float).reshape(-1, time.size)
    return np.array([sign * _highest(time, sign * row) for row in rows]).reshape(values.shape[:-1])


def peak_of(time: Array, values: Array) -> Array:
    """Largest magnitude over time."""
    return np.fmax(np.abs(extreme_of(time, values, 1.0)), np.abs(extreme_of(time, values, -1.0)))


def amplitude_of(time: Array, values: Array) -> Array:
    """Half the range over time."""
    return 0.5 * (extreme_of(time, values, 1.0) - extreme_of(time, values, -1.0))


def rms_of(time: Array, values: Array) -> Array:
    """Root of the mean square over time, by the trapezoid rule."""
    weight = np.zeros(time.size)
    half = 0.5 * np.diff(time)
    weight[:-1] += half
    weight[1:] += half
    known = np.isfinite(values)
    total = np.sum(known * weight, axis=-1)
    square = np.sum(np.where(known, values, 0.0) ** 2 * weight, axis=-1)
    return np.sqrt(np.divide(square, total, out=np.full(np.shape(total), np.nan), where=total > 0))


def _highest(time: Array, row: Array) -> float:
    known = np.flatnonzero(np.isfinite(row))
    if known.size == 0:
        return float("nan")
    top = int(known[np.argmax(row[known])])
    at = slice(top - 2, top + 3)
    if top < 2 or top + 3 > row.size or not np.isfinite(row[at]).all():
        return float(row[top])
    t, y = (time[at] - time[top]) / (time[top + 1] - time[top - 1]), row[at] - row[top]
    quartic = np.polyfit(t, y, 4)
    roots = np.roots(np.polyder(quartic))
    inside = roots[(abs(roots.imag) < 1e-9) & (roots.real > t[1]) & (roots.real < t[3])].real
    best = float(np.max(np.polyval(quartic, inside), initial=0.0))
    # at a corner of the signal the quartic and the parabola disagree; then the sample stands
    return float(row[top] + (best if best <= 2.0 * _parabola_top(t, y) else 0.0))


def _parabola_top(t: Array, y: Array) -> float:
    """Height over the middle sample of the parabola through the three middle ones."""
    bend, slope, _ = np.polyfit(t[1:4], y[1:4], 2)
    return float(-slope * slope / (4.0 * bend)) if bend < 0 else 0.0
