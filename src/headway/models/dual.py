"""Exact derivatives: forward-mode numbers that Python operators, comparisons and NumPy ufuncs understand.

A `Dual` carries a value, or an array of values, and its derivatives with respect to any number of
directions. A law called with duals returns its value and its exact partial derivatives, without
finite differences and without a second definition of the law. A law that branches with `if` on a
signal can be called with scalar duals only: an array of truths has no truth, and Python says so.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from headway.errors import HeadwayError

__all__ = ["Dual", "derivative", "partials", "select", "value"]


class Dual:
    """`value + Σ ε_i · slope[i]`; `value` a number or an array, `slope` of shape (directions, *value.shape)."""

    __slots__ = ("slope", "value")
    __array_priority__ = 1000

    def __init__(self, value: Any, slope: Any) -> None:
        self.value: Any = value if np.ndim(value) else float(value)
        self.slope = np.asarray(slope, dtype=float)

    def __repr__(self) -> str:
        return f"Dual({self.value!r}, {self.slope.tolist()!r})"

    def __add__(self, other: Any) -> Dual:
        return Dual(self.value + value(other), self.slope + derivative(other))

    __radd__ = __add__

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slope)

    def __pos__(self) -> Dual:
        return self

    def __sub__(self, other: Any) -> Dual:
        return Dual(self.value - value(other), self.slope - derivative(other))

    def __rsub__(self, other: Any) -> Dual:
        return -self + other

    def __mul__(self, other: Any) -> Dual:
        return Dual(self.value * value(other), self.slope * value(other) + self.value * derivative(other))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Dual:
        b = value(other)
        quotient = np.asarray(self.value, dtype=float) / b
        return Dual(quotient, (self.slope - quotient * derivative(other)) / b)

    def __rtruediv__(self, other: Any) -> Dual:
        return Dual(value(other), np.zeros_like(self.slope)) / self

    def __pow__(self, other: Any) -> Dual:
        x, n = np.asarray(self.value, dtype=float)[()], value(other)
        result = x**n
        slope = select(np.equal(n, 0), 0.0 * self.slope, n * x ** (n - 1) * self.slope)
        if isinstance(other, Dual):
            slope = slope + np.log(x) * result * other.slope
        return Dual(result, slope)

    def __rpow__(self, other: Any) -> Dual:
        result = value(other) ** self.value
        return Dual(result, np.log(value(other)) * result * self.slope)

    def __abs__(self) -> Dual:
        return select(self.value < 0, -self, self)

    def __lt__(self, other: Any) -> Any:
        return self.value < value(other)

    def __le__(self, other: Any) -> Any:
        return self.value <= value(other)

    def __gt__(self, other: Any) -> Any:
        return self.value > value(other)

    def __ge__(self, other: Any) -> Any:
        return self.value >= value(other)

    def __eq__(self, other: object) -> Any:
        return self.value == value(other)

    def __bool__(self) -> bool:
        return bool(self.value != 0.0)

    __hash__ = None  # type: ignore[assignment]  # equal values may differ in slope, so a dual is no key

    def __float__(self) -> float:
        raise HeadwayError(
            "a law turned a signal into a plain float, which loses its derivative; take functions such as sqrt, exp "
            "and tanh from numpy or headway.maths, not from math, and do not call float()"
        )

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        if method != "__call__" or kwargs:
            return NotImplemented
        if ufunc in _UNARY:
            x = inputs[0]
            function, slope = _UNARY[ufunc]
            return Dual(function(x.value), slope(x.value) * x.slope)
        if ufunc in _BINARY:
            return _BINARY[ufunc](*inputs)
        return NotImplemented

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        if function is np.where and len(args) == 3:
            return select(*args)
        if function is np.interp and len(args) == 3 and not any(isinstance(a, Dual) for a in args[1:]):
            return _interpolated(*args)
        if function is np.clip and len(args) == 3:
            return _minimum(_maximum(args[0], args[1]), args[2])
        return NotImplemented


def _interpolated(x: Dual, knots: Any, values: Any) -> Dual:
    """`np.interp` of a table of numbers; its slope is that of the piece to the right, 0 outside."""
    xp, fp = np.asarray(knots, dtype=float), np.asarray(values, dtype=float)
    slopes = np.concatenate(([0.0], np.diff(fp) / np.diff(xp), [0.0]))
    piece = np.where(x.value == xp[-1], 0, np.searchsorted(xp, x.value, side="right"))
    return Dual(np.interp(x.value, xp, fp), slopes[piece] * x.slope)


def value(x: Any) -> Any:
    """The value of a dual, or the number itself."""
    return x.value if isinstance(x, Dual) else x


def derivative(x: Any) -> Any:
    """The slopes of a dual, or 0 for a constant."""
    return x.slope if isinstance(x, Dual) else 0.0


def select(condition: Any, a: Any, b: Any) -> Any:
    """`a` where the condition holds, else `b`: numbers, arrays or duals."""
    if np.ndim(condition) == 0:
        return a if condition else b
    if not isinstance(a, Dual) and not isinstance(b, Dual):
        return np.where(condition, a, b)
    return Dual(np.where(condition, value(a), value(b)), np.where(condition, derivative(a), derivative(b)))


def _maximum(a: Any, b: Any) -> Any:
    return select(value(a) >= value(b), a, b)


def _minimum(a: Any, b: Any) -> Any:
    return select(value(a) <= value(b), a, b)


_UNARY: dict[Any, tuple[Callable[[float], Any], Callable[[float], Any]]] = {
    np.sqrt: (np.sqrt, lambda x: 0.5 / np.sqrt(x)),
    np.exp: (np.exp, np.exp),
    np.log: (np.log, lambda x: 1.0 / x),
    np.log1p: (np.log1p, lambda x: 1.0 / (1.0 + x)),
    np.expm1: (np.expm1, np.exp),
    np.tanh: (np.tanh, lambda x: 1.0 - np.tanh(x) ** 2),
    np.sinh: (np.sinh, np.cosh),
    np.cosh: (np.cosh, np.sinh),
    np.sin: (np.sin, np.cos),
    np.cos: (np.cos, lambda x: -np.sin(x)),
    np.tan: (np.tan, lambda x: 1.0 / np.cos(x) ** 2),
    np.arctan: (np.arctan, lambda x: 1.0 / (1.0 + x * x)),
    np.square: (np.square, lambda x: 2.0 * x),
    np.absolute: (np.absolute, np.sign),
    np.negative: (np.negative, lambda x: -1.0),
    np.sign: (np.sign, lambda x: 0.0),
}

_BINARY: dict[Any, Callable[[Any, Any], Any]] = {
    np.add: lambda a, b: a + b if isinstance(a, Dual) else b + a,
    np.subtract: lambda a, b: a - b if isinstance(a, Dual) else b.__rsub__(a),
    np.multiply: lambda a, b: a * b if isinstance(a, Dual) else b * a,
    np.true_divide: lambda a, b: a / b if isinstance(a, Dual) else b.__rtruediv__(a),
    np.power: lambda a, b: a**b if isinstance(a, Dual) else b.__rpow__(a),
    np.maximum: _maximum,
    np.minimum: _minimum,
    np.fmax: _maximum,
    np.fmin: _minimum,
    np.less: lambda a, b: value(a) < value(b),
    np.less_equal: lambda a, b: value(a) <= value(b),
    np.greater: lambda a, b: value(a) > value(b),
    np.greater_equal: lambda a, b: value(a) >= value(b),
    np.equal: lambda a, b: value(a) == value(b),
    np.not_equal: lambda a, b: value(a) != value(b),
}


def partials(function: Callable[..., Any], arguments: dict[str, Any]) -> dict[str, Any]:
    """Exact partial derivatives of `function(*arguments.values())` with respect to each argument.

    Arguments are numbers or arrays of one shape, and so are the derivatives. Where the function
    branches there, the derivative of the branch it took is returned.
    """
    n, shape = len(arguments), np.broadcast_shapes(*(np.shape(x) for x in arguments.values()))
    seeds = []
    for i, x in enumerate(arguments.values()):
        slope = np.zeros((n, *shape))
        slope[i] = 1.0
        seeds.append(Dual(np.broadcast_to(x, shape), slope))
    with np.errstate(all="ignore"):
        result = function(*seeds)
    slope = np.broadcast_to(derivative(result), (n, *shape))
    return {name: slope[i] if shape else float(slope[i]) for i, name in enumerate(arguments)}
