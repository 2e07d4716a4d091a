"""Integrals of samples over time: weights of the samples, and areas between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["areas", "trapezoid"]


def trapezoid(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weight [s] of each sample at `time` (T,) by the trapezoid rule."""
    weight = np.zeros(time.size)
    half = 0.5 * np.diff(time)
    weight[:-1] += half
    weight[1:] += half
    return weight


def areas(time: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Integral (T - 1,) of `values` (T,) over each interval between times (T,) [s], by the trapezoid rule."""
    return np.diff(time) * (values[1:] + values[:-1]) / 2
