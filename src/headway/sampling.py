"""Weights of samples in integrals over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["trapezoid"]


def trapezoid(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weight [s] of each sample at `time` (T,) by the trapezoid rule."""
    weight = np.zeros(time.size)
    half = 0.5 * np.diff(time)
    weight[:-1] += half
    weight[1:] += half
    return weight
