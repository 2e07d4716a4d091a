"""Measuring an order of convergence."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def geometric(largest: float, smallest: float, count: int = 13) -> np.ndarray:
    """Steps [s] in a geometric row; off the grid of anything, so that no two meshes are alike."""
    return np.geomspace(largest, smallest, count)


def order(error: Callable[[float], float], steps: np.ndarray) -> float:
    """Least-squares slope of log error against log step.

    With breaking points off the grid each mesh has short steps in other places and the constant of
    the error wanders by a factor of two or so; hence many steps over more than a decade.
    """
    errors = [error(float(dt)) for dt in steps]
    assert min(errors) > 1e-13, f"errors down to rounding: {errors}"
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
