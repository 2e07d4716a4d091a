"""Functions for laws that work in three worlds: compiled, on arrays and on duals.

A law may use Python's operators, `min`, `max`, `abs`, `if`, and NumPy's scalar ufuncs. Three things
are better taken from here, because inside compiled code they stay branch-free and vectorise:
`where`, `tanh` and `power`. `headway.engine.compile` gives each its compiled form.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from headway.models.dual import Dual, select

__all__ = ["maximum", "minimum", "power", "tanh", "where"]


def where(condition: Any, a: Any, b: Any) -> Any:
    """`a` where `condition` holds, else `b`; both are evaluated."""
    return select(condition, a, b)


def maximum(a: Any, b: Any) -> Any:
    """The larger of the two."""
    return np.maximum(a, b)


def minimum(a: Any, b: Any) -> Any:
    """The smaller of the two."""
    return np.minimum(a, b)


def tanh_within(x: Any) -> Any:
    """tanh for |x| <= 20 by a rational approximation of tanh(x/32) and five argument doublings, error below 4e-16.

    Plain arithmetic and hence the same bits on every machine; it vectorises, which a call of the C
    library does not. `headway.engine.compile` compiles this same function.
    """
    y = x * 0.03125
    q = y * y
    t = y * (10395.0 + q * (1260.0 + q * 21.0)) / (10395.0 + q * (4725.0 + q * (210.0 + q)))
    t = 2.0 * t / (1.0 + t * t)
    t = 2.0 * t / (1.0 + t * t)
    t = 2.0 * t / (1.0 + t * t)
    t = 2.0 * t / (1.0 + t * t)
    return 2.0 * t / (1.0 + t * t)


def tanh(x: Any) -> Any:
    """Hyperbolic tangent."""
    return np.tanh(x) if isinstance(x, Dual) else tanh_within(np.minimum(np.maximum(x, -20.0), 20.0))


def power_scalar(x: Any, n: float) -> Any:
    """`x**n` with the small whole exponents that the field uses written out, so that no `pow` is called."""
    if n == 4.0:
        q = x * x
        return q * q
    if n == 1.0:
        return x
    if n == 2.0:
        return x * x
    if n == 0.0:
        return 1.0
    if n == 3.0:
        return x * x * x
    if n == -1.0:
        return 1.0 / x
    if n == -2.0:
        return 1.0 / (x * x)
    return x**n


def power(x: Any, n: Any) -> Any:
    """`x**n`; declare the parameter `n` with `Param(..., structural=True)` to keep the loop branch-free."""
    if np.ndim(n):
        return x**n
    result = power_scalar(x, n)
    return result + 0.0 * x if n == 0.0 and isinstance(x, np.ndarray) else result
