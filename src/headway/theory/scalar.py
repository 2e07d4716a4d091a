"""Roots and least values of functions of one number by SciPy, loaded when first asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

__all__ = ["least", "root"]


def root(f: Callable[[float], float], a: float, b: float, accuracy: float = 1e-13) -> float:
    """A root between `a` and `b`, where `f` has different signs."""
    from scipy.optimize import brentq

    return float(brentq(f, a, b, xtol=accuracy))


def least(f: Callable[[Any], Any], a: float, b: float) -> tuple[float, float]:
    """(value, place) of the least value of `f` between `a` and `b`, which have a sample below both between them."""
    from scipy.optimize import minimize_scalar

    found = minimize_scalar(f, bounds=(a, b), method="bounded", options={"xatol": 1e-11 * b})
    return float(found.fun), float(found.x)
