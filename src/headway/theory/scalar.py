"""Roots and minima of functions of one number by SciPy, which is loaded at the first call."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

__all__ = ["least_point", "root"]


def root(f: Callable[[float], float], a: float, b: float, accuracy: float = 1e-13) -> float:
    """Return a root between two places at which a function has different signs.

    Args:
        f: the function.
        a: one place.
        b: the other place.
        accuracy: how far the root may be off.
    """
    from scipy.optimize import brentq

    return float(brentq(f, a, b, xtol=accuracy))


def least_point(f: Callable[[Any], Any], a: float, b: float) -> tuple[float, float]:
    """Return the least value of a function between two places, and its place.

    Args:
        f: the function.
        a: the lower place.
        b: the higher place; between the two lies a sample below both.

    Returns:
        (value, place), the place to a part in 10^11.
    """
    from scipy.optimize import minimize_scalar

    result = minimize_scalar(f, bounds=(a, b), method="bounded", options={"xatol": 1e-11 * b})
    return float(result.fun), float(result.x)
