"""Quasi-polynomials Σ c_k p^n_k e^{-p τ_k}: numerators and denominators of transfer functions with delays."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["HIGHEST", "QuasiPolynomial"]

#: frequency [rad/s] beyond which the limit of short waves is not looked for
HIGHEST = 1e7


@dataclass(frozen=True, eq=False)
class QuasiPolynomial:
    """Terms `coefficient * p**power * exp(-p * delay)`; all arrays (terms,)."""

    coefficient: NDArray[np.float64]
    power: NDArray[np.int64]
    delay: NDArray[np.float64]

    @classmethod
    def of(cls, *terms: tuple[float, int, float]) -> QuasiPolynomial:
        """Build a quasi-polynomial from terms; terms that vanish are left out, equal ones are added.

        Args:
            terms: (coefficient, power of p, delay [s]) of each.
        """
        summed: dict[tuple[int, float], float] = {}
        for c, n, tau in terms:
            summed[n, tau] = summed.get((n, tau), 0.0) + c
        nonzero = [(c, n, tau) for (n, tau), c in sorted(summed.items()) if c != 0.0]
        columns = list(zip(*nonzero, strict=True)) if nonzero else [(), (), ()]
        return cls(np.array(columns[0], float), np.array(columns[1], np.int64), np.array(columns[2], float))

    def __call__(self, p: Any) -> Any:
        """Return the values at complex `p` of any shape."""
        z = np.asarray(p, dtype=complex)[..., None]
        return np.sum(self.coefficient * z**self.power * np.exp(-z * self.delay), axis=-1)

    def derivative(self, p: Any) -> Any:
        """Return the derivative with respect to p, at complex `p` of any shape."""
        z = np.asarray(p, dtype=complex)[..., None]
        slope = self.power * z ** np.maximum(self.power - 1, 0) - self.delay * z**self.power
        return np.sum(self.coefficient * slope * np.exp(-z * self.delay), axis=-1)

    def jet(self, p: complex) -> tuple[complex, complex, complex]:
        """Return the value, the first and the second derivative at one complex `p`."""
        value = first = second = 0j
        for c, n, tau in self.terms:
            term = c * cmath.exp(-p * tau)
            whole, slope = p**n, n * p ** (n - 1) if n else 0.0
            bend = n * (n - 1) * p ** (n - 2) if n > 1 else 0.0
            value += term * whole
            first += term * (slope - tau * whole)
            second += term * (bend - 2.0 * tau * slope + tau * tau * whole)
        return value, first, second

    def magnitude(self, omega: Any) -> Any:
        """Return the bound Σ |c_k| ω^n_k of the magnitude at iω, `omega` [rad/s] >= 0 of any shape."""
        w = np.asarray(omega, dtype=float)[..., None]
        return np.sum(np.abs(self.coefficient) * w**self.power, axis=-1)

    def curvature(self, omega: Any) -> Any:
        """Return a bound of |d²/dω²| at iω that grows with ω, `omega` [rad/s] >= 0 of any shape."""
        w, n, tau = np.asarray(omega, dtype=float)[..., None], self.power, self.delay
        terms = n * (n - 1) * w ** np.maximum(n - 2, 0) + 2 * n * tau * w ** np.maximum(n - 1, 0) + tau**2 * w**n
        return np.sum(np.abs(self.coefficient) * terms, axis=-1)

    def leads_from(self, other: QuasiPolynomial | None = None) -> float:
        """Frequency beyond which the leading term on the imaginary axis exceeds all other terms and those of `other`.

        Args:
            other: a quasi-polynomial whose terms are to be exceeded as well.

        Returns:
            The frequency [rad/s], from 1 up to `HIGHEST`; infinite where the leading term never exceeds the rest.
        """
        n = self.degree
        coefficient, power, delay = self.coefficient, self.power, self.delay
        if other is not None:
            coefficient = np.concatenate((coefficient, other.coefficient))
            power = np.concatenate((power, other.power))
            delay = np.concatenate((delay, np.full(other.power.size, np.inf)))  # never part of the leading term
        now = delay == 0.0
        first = abs(float(np.sum(coefficient[now & (power == n)])))
        late = ~now & (power >= n)
        # where nothing else has the highest power, the next one joins it at a right angle
        second = 0.0 if late.any() else abs(float(np.sum(coefficient[now & (power == n - 1)])))
        joined = now & ((power == n) | (power == n - 1 if second else False))
        rest, rest_power = np.abs(coefficient[~joined]), power[~joined]
        omega = 1.0
        while omega < HIGHEST:
            if math.hypot(first, second / omega) > np.sum(rest * omega ** (rest_power - float(n))):
                return omega
            omega *= 1.5
        return math.inf

    @property
    def terms(self) -> list[tuple[float, int, float]]:
        """(coefficient, power, delay) of each term."""
        return list(zip(self.coefficient.tolist(), self.power.tolist(), self.delay.tolist(), strict=True))

    @property
    def lowest(self) -> int:
        """Lowest power of p."""
        return int(self.power.min()) if self.power.size else 0

    @property
    def degree(self) -> int:
        """Highest power of p."""
        return int(self.power.max()) if self.power.size else 0

    def over(self, power: int) -> QuasiPolynomial:
        """Return the quotient by p**power; no term may have a lower power."""
        return QuasiPolynomial(self.coefficient, self.power - power, self.delay)

    def polynomial(self, delay: float) -> NDArray[np.float64]:
        """Return the coefficients, highest power first, of the terms with this delay [s]."""
        result = np.zeros(self.degree + 1)
        for c, n, tau in self.terms:
            if tau == delay:
                result[self.degree - n] += c
        return result

    @property
    def delays(self) -> tuple[float, ...]:
        """The different delays greater than 0, rising."""
        return tuple(sorted({float(t) for t in self.delay if t > 0.0}))
