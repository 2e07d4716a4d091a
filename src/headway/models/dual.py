"""Exact derivatives: forward-mode numbers that Python operators, comparisons and NumPy ufuncs understand.

A `Dual` carries a value and its derivatives with respect to any number of directions. A law called
with duals returns its value and its exact partial derivatives, without finite differences and
without a second definition of the law.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

__all__ = ["Dual", "derivative", "partials", "value"]


class Dual:
    """`value + Σ ε_i · slope[i]`, scalar value, `slope` of shape (directions,)."""

    __slots__ = ("slope", "value")
    __array_priority__ = 1000

    def __init__(self, value: float, slope: Any) -> None:
        self.value = float(value)
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
        quotient = np.float64(self.value) / b
        return Dual(quotient, (self.slope - quotient * derivative(other)) / b)

    def __rtruediv__(self, other: Any) -> Dual:
        return Dual(value(other), np.zeros_like(self.slope)) / self

    def __pow__(self, other: Any) -> Dual:
        x, n = self.value, value(other)
        result = np.float64(x) ** n
        slope = 0.0 * self.slope if n == 0 else n * np.float64(x) ** (n - 1) * self.slope
        if isinstance(other, Dual):
            slope = slope + np.log(x) * result * other.slope
        return Dual(result, slope)

    def __rpow__(self, other: Any) -> Dual:
        result = value(other) ** self.value
        return Dual(result, math.log(value(other)) * result * self.slope)

    def __abs__(self) -> Dual:
        return -self if self.value < 0 else self

    def __lt__(self, other: Any) -> bool:
        return self.value < value(other)

    def __le__(self, other: Any) -> bool:
        return self.value <= value(other)

    def __gt__(self, other: Any) -> bool:
        return self.value > value(other)

    def __ge__(self, other: Any) -> bool:
        return self.value >= value(other)

    def __eq__(self, other: object) -> bool:
        return self.value == value(other)

    def __bool__(self) -> bool:
        return self.value != 0.0

    __hash__ = None  # type: ignore[assignment]  # equal values may differ in slope, so a dual is no key

    def __float__(self) -> float:
        raise TypeError("a law turned a signal into a plain float, which loses its derivative")

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
            return args[1] if args[0] else args[2]
        if function is np.clip and len(args) == 3:
            return _minimum(_maximum(args[0], args[1]), args[2])
        return NotImplemented


def value(x: Any) -> float:
    """The value of a dual, or the number itself."""
    return x.value if isinstance(x, Dual) else x


def derivative(x: Any) -> Any:
    """The slopes of a dual, or 0 for a constant."""
    return x.slope if isinstance(x, Dual) else 0.0


def _maximum(a: Any, b: Any) -> Any:
    return a if value(a) >= value(b) else b


def _minimum(a: Any, b: Any) -> Any:
    return a if value(a) <= value(b) else b


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


def partials(function: Callable[..., Any], arguments: dict[str, float]) -> dict[str, float]:
    """Exact partial derivatives of `function(*arguments.values())` with respect to each argument.

    Where the function branches there, the derivative of the branch it took is returned.
    """
    n = len(arguments)
    seeds = [Dual(x, np.eye(n)[i]) for i, x in enumerate(arguments.values())]
    with np.errstate(all="ignore"):
        result = function(*seeds)
    slope = np.broadcast_to(derivative(result), (n,))
    return {name: float(slope[i]) for i, name in enumerate(arguments)}
