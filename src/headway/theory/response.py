"""Response in time of a transfer function with delays: the speed after an impulse and after a step.

G = N/D is written as a chain of integrators with the late signals as inputs,

    y = x_1 + Σ b_n u(t-τ) - Σ a_n y(t-τ),   x_j' = x_{j+1} + Σ b_{n-j} u(t-τ) - Σ a_{n-j} y(t-τ),

and solved by the method of steps: between the places where a delay carries a kink the answer is
smooth, and on each such piece it is a polynomial by collocation at Gauss points (Hairer, Nørsett,
Wanner, Solving Ordinary Differential Equations I, II.7 and II.17). Once the sum over the rightmost
characteristic roots, Σ N/D' e^{pt}, reproduces the pieces over a whole memory of the equation it
takes their place: the future depends on nothing but that memory. Where it does not (a double root,
an endless chain of roots of a neutral equation) the pieces go on.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from headway.arrays import Array
from headway.theory.quasipolynomial import QuasiPolynomial
from headway.theory.roots import rightmost

__all__ = ["Response"]

_NODES = 16
#: a kink is smoothed by every integration; this many times reflected it is below the rounding of a piece
_LEVELS = 9
#: modes take over where they reproduce a whole memory to this, relative to the largest answer
_AGREES = 1e-11
#: echoes of an impulse smaller than this are left out, and no more than this many are kept
_ECHO, _ECHOES = 1e-13, 200
#: pieces up to which the modes are waited for
_PATIENCE = 4_000
_MODES = 24
#: a mode smaller than this is over
_NOTHING = 1e-13


class _Rule(NamedTuple):
    """Gauss points on [-1, 1], their integration matrix on [0, 1], and values → Chebyshev coefficients."""

    points: Array
    integral: Array
    coefficients: Array


def _rule(count: int) -> _Rule:
    points = np.polynomial.legendre.leggauss(count)[0]
    values = np.polynomial.chebyshev.chebvander(points, count - 1)
    coefficients = np.linalg.inv(values)
    # integrals of the Chebyshev polynomials from -1 to each point, half of it for a piece of length 1
    primitive = np.polynomial.chebyshev.chebint(np.eye(count), lbnd=-1.0)
    integral = 0.5 * np.polynomial.chebyshev.chebval(points, primitive).T @ coefficients
    return _Rule(points, integral, np.asarray(coefficients, dtype=np.float64))


_GAUSS = _rule(_NODES)
_END = 0.5 * np.polynomial.chebyshev.chebint(np.eye(_NODES), lbnd=-1.0).sum(axis=0) @ _GAUSS.coefficients


class _Late(NamedTuple):
    """A late term: its row in the integrator form (-1: direct), its delay [s] and its coefficient."""

    row: int
    delay: float
    weight: float


def _rows(q: QuasiPolynomial, degree: int, leading: float) -> list[_Late]:
    return [
        _Late(degree - 1 - int(k), float(t), float(c) / leading)
        for c, k, t in zip(q.coefficient, q.power, q.delay, strict=True)
    ]


class Response:
    """Response of N/D to a unit impulse and a unit step at t = 0.

    Attributes:
        direct: (delay [s], weight) of the impulses that pass straight through; of echoes the first 200.
    """

    def __init__(self, top: QuasiPolynomial, bottom: QuasiPolynomial) -> None:
        """Solve the first pieces, up to where the sum over the rightmost roots takes over.

        Args:
            top: numerator N.
            bottom: denominator D.
        """
        self._top, self._bottom = top, bottom
        n = bottom.degree
        leading = float(bottom.polynomial(0.0)[0])
        terms = _rows(bottom, n, leading)
        self._inputs = _rows(top, n, leading)
        self._late = [t for t in terms if t.delay > 0.0]
        self.direct = _echoes([i for i in self._inputs if i.row < 0], [t for t in self._late if t.row < 0])
        self._now = np.zeros(n)  # what the present y contributes to each integrator
        for t in terms:
            if t.delay == 0.0 and t.row >= 0:
                self._now[t.row] -= t.weight
        self._matrix = np.diag(np.ones(n - 1), 1)
        self._matrix[:, 0] += self._now
        rate = max((abs(t.weight) ** (1.0 / (t.row + 1)) for t in terms if t.row >= 0), default=0.0)
        self._longest = min((4.0 / max(rate, 1e-3), *bottom.delays))
        self._memory = max(bottom.delays, default=2.0 * self._longest)
        self._start = max(top.delays, default=0.0)
        rest = complex(bottom(0.0))
        self._final = (complex(top(0.0)) / rest).real if rest != 0 else math.nan
        self._knots, self._state = np.zeros(1), np.zeros(n)
        self._steps, self._impulses = np.empty((0, _NODES)), np.empty((0, _NODES))
        self._modes: tuple[NDArray[np.complex128], NDArray[np.complex128]] | None = None
        span = self._start + 6.0 * self._memory
        self._extend(span)
        while not self._adopt_modes() and self._knots.size < _PATIENCE:
            span *= 2.0
            self._extend(span)

    # -- values -----------------------------------------------------------------------------------

    def impulse(self, t: Any) -> Any:
        """Return the response [1/s] to a unit impulse, without `direct`, at times `t` [s] of any shape; 0 for t < 0."""
        return self._evaluate(t, impulse=True)

    def step(self, t: Any) -> Any:
        """Return the response [1] to a unit step at times `t` [s] of any shape; at a jump the later value."""
        return self._evaluate(t, impulse=False)

    def _evaluate(self, t: Any, impulse: bool) -> Any:
        times = np.asarray(t, dtype=float)
        flat = times.ravel()
        if self._modes is None and flat.size and flat.max() >= self._knots[-1]:
            self._extend(float(flat.max()) + self._longest)
        later = flat >= self._knots[-1]
        result = np.empty(flat.size)
        result[~later] = self._read(self._impulses if impulse else self._steps, flat[~later])
        if later.any():
            result[later] = self._sum_of_modes(flat[later], impulse)
        return result.reshape(times.shape)[()]

    # -- method of steps --------------------------------------------------------------------------

    def _extend(self, until: float) -> None:
        """Solve pieces up to `until` [s] at least."""
        first = self._knots.size - 1
        grown = self._mesh(until)
        self._knots = np.concatenate((self._knots, grown))
        room = np.empty((grown.size, _NODES))
        self._steps, self._impulses = np.concatenate((self._steps, room)), np.concatenate((self._impulses, room))
        inverses: dict[float, Array] = {}
        for k in range(first, self._knots.size - 1):
            self._advance(k, inverses)

    def _mesh(self, until: float) -> Array:
        """Return ends of pieces after the present end: where delays carry a kink, and between as accuracy needs."""
        present = self._knots[-1]
        places = {0.0, *(i.delay for i in self._inputs)}
        latest = places
        neutral = any(t.row < 0 for t in self._late)
        level = 0
        while latest and (neutral or level < _LEVELS):
            latest = {round(x + t.delay, 12) for x in latest for t in self._late if x + t.delay <= until} - places
            places |= latest
            level += 1
        kinks = np.array(sorted(x for x in places if present < x < until))
        ends = np.concatenate(([present], kinks, [until]))
        ends = ends[np.concatenate(([True], np.diff(ends) > 1e-10 * (1.0 + until)))]
        pieces = [
            np.linspace(a, b, max(1, math.ceil((b - a) / self._longest * (1 - 1e-12))) + 1)[1:]
            for a, b in pairwise(ends)
        ]
        return np.concatenate(pieces) if pieces else np.empty(0)

    def _advance(self, k: int, inverses: dict[float, Array]) -> None:
        """Solve piece `k`; all late inputs lie in earlier pieces."""
        a, length = self._knots[k], self._knots[k + 1] - self._knots[k]
        n = self._state.size
        t = a + 0.5 * length * (_GAUSS.points + 1.0)
        drive = np.zeros((_NODES, n))
        through, through_slope = np.zeros(_NODES), np.zeros(_NODES)
        for i in self._inputs:
            if i.row >= 0:
                drive[:, i.row] += i.weight * (t > i.delay)
            else:
                through += i.weight * (t > i.delay)
        for late in self._late:
            back = self._read(self._steps, t - late.delay)
            if late.row >= 0:
                drive[:, late.row] -= late.weight * back
            else:
                through -= late.weight * back
                through_slope -= late.weight * self._read(self._impulses, t - late.delay)
        drive += through[:, None] * self._now
        key = round(length, 14)
        if key not in inverses:
            # X = 1 x_a + length A (X Mᵀ + drive), inverted once for each length
            inverses[key] = np.linalg.inv(np.eye(_NODES * n) - length * np.kron(_GAUSS.integral, self._matrix))
        right = self._state + length * _GAUSS.integral @ drive
        x = (inverses[key] @ right.ravel()).reshape(_NODES, n)
        slope = x @ self._matrix.T + drive
        self._steps[k] = _GAUSS.coefficients @ (x[:, 0] + through)
        self._impulses[k] = _GAUSS.coefficients @ (slope[:, 0] + through_slope)
        self._state = self._state + length * _END @ slope

    def _read(self, coefficients: Array, t: Array) -> Array:
        """Return values of the pieces at times before the end."""
        k = np.clip(np.searchsorted(self._knots, t, side="right") - 1, 0, self._knots.size - 2)
        z = 2.0 * (t - self._knots[k]) / (self._knots[k + 1] - self._knots[k]) - 1.0
        return np.where(t >= 0.0, np.einsum("ij,ij->i", _powers(z), coefficients[k]), 0.0)

    # -- modes ------------------------------------------------------------------------------------

    def _adopt_modes(self) -> bool:
        """Continue with the sum over the rightmost roots if it agrees with the pieces over the last memory."""
        modes = rightmost(self._bottom, _MODES).roots
        end = self._knots[-1]
        first = int(np.searchsorted(self._knots, end - self._memory * (1.0 + 1e-9)))
        if end - self._memory < self._start or not modes.size or np.min(np.abs(modes)) < 1e-9:
            return False
        with np.errstate(all="ignore"):
            self._modes = modes, self._top(modes) / self._bottom.derivative(modes)
            t = np.concatenate([np.linspace(a, b, 9)[1:-1] for a, b in pairwise(self._knots[first:])])
            for pieces, impulse in ((self._steps, False), (self._impulses, True)):
                error = np.max(np.abs(self._read(pieces, t) - self._sum_of_modes(t, impulse)))
                if not error <= _AGREES * max(1.0, float(np.max(np.abs(pieces[:, 0])))):
                    self._modes = None
                    return False
        return True

    def _sum_of_modes(self, t: Array, impulse: bool) -> Array:
        assert self._modes is not None
        roots, residues = self._modes
        weights = residues if impulse else residues / roots
        total = np.real(np.exp(np.multiply.outer(t, roots)) @ weights)
        return total if impulse else total + self._final

    # -- total variation --------------------------------------------------------------------------

    def variation(self) -> float:
        """Return ‖g‖₁ [1], the total variation of a step response that settles, with the weights of `direct`."""
        if self._modes is None:
            slowest = float(-rightmost(self._bottom).roots[0].real)
            self._extend(float(self._knots[-1]) + 30.0 / slowest)
        fractions = np.linspace(0.0, 1.0, 3 * _NODES)
        powers = _powers(2.0 * fractions - 1.0)
        total = sum(abs(w) for _, w in self.direct)
        total += _variation(
            self._steps @ powers.T, self._impulses @ powers.T, np.diff(self._knots),
            lambda k, x: np.einsum("ij,ij->i", _powers(2.0 * x - 1.0), self._steps[k]),
        )  # fmt: skip
        return total + (self._modal_variation() if self._modes is not None else 0.0)

    def _modal_variation(self) -> float:
        """Return the variation after the pieces: sampled until one mode is left, in closed form from there."""
        assert self._modes is not None
        roots, residues = self._modes
        size = np.abs(residues / roots)
        start, total = float(self._knots[-1]), 0.0
        leads = np.abs(roots.real - roots[0].real) < 1e-9 * (1.0 + abs(roots[0].real))
        leads &= np.abs(np.abs(roots.imag) - abs(roots[0].imag)) < 1e-9
        while True:
            alive = size * np.exp(roots.real * start)
            if alive.max() < _NOTHING:
                return total
            if np.all(alive[~leads] < max(_NOTHING, 1e-9 * float(alive[leads].max()))):
                break
            fastest = np.max(np.abs(roots[alive > _NOTHING]))
            grid = np.linspace(start, start + 8.0 * math.pi / fastest, 513)
            total += self._varies(grid)
            start = float(grid[-1])
        omega, sigma = abs(roots[0].imag), -roots[0].real
        if omega < 1e-12:
            return total + abs(float(self._sum_of_modes(np.array([start]), False)[0]) - self._final)
        # half a period later everything is turned round and smaller by a factor
        half = math.pi / omega
        return total + self._varies(np.linspace(start, start + half, 257)) / -math.expm1(-sigma * half)

    def _varies(self, grid: Array) -> float:
        h, g = self._sum_of_modes(grid, False), self._sum_of_modes(grid, True)
        length = float(grid[-1] - grid[0])
        return _variation(
            h[None], g[None], np.array([length]), lambda _, x: self._sum_of_modes(grid[0] + length * x, False)
        )


def _powers(z: Array) -> Array:
    """Return the Chebyshev polynomials at z, (*z.shape, _NODES)."""
    return np.cos(np.arccos(np.clip(z, -1.0, 1.0))[..., None] * np.arange(_NODES))


def _variation(h: Array, g: Array, length: Array, value: Callable[[Any, Array], Array]) -> float:
    """Return the total variation of functions on pieces, from values and slopes at equal distances.

    Where the slope changes its sign between two samples, the extreme lies where that of the cubic through both
    values and slopes does.

    Args:
        h: values (pieces, samples).
        g: slopes [1/s] (pieces, samples).
        length: of each piece [s].
        value: the function of numbers of pieces and fractions of them.
    """
    parts = h.shape[1] - 1
    d = length[:, None] / parts
    rise = np.diff(h, axis=1)
    left, right = g[:, :-1] * d, g[:, 1:] * d
    rows, columns = np.nonzero(left * right < 0.0)
    left, right, through = left[rows, columns], right[rows, columns], rise[rows, columns]
    # slope of the cubic: left + 2 b x + c x², its root in (0, 1) without cancellation
    b, c = 3.0 * through - 2.0 * left - right, 3.0 * (left + right - 2.0 * through)
    with np.errstate(all="ignore"):
        q = -(b + np.copysign(np.sqrt(np.maximum(b * b - left * c, 0.0)), b))
        one, other = q / c, left / q
    x = np.where((one > 0.0) & (one < 1.0), one, np.clip(other, 0.0, 1.0))
    top = value(rows, (columns + x) / parts)
    detour = np.abs(top - h[rows, columns]) + np.abs(h[rows, columns + 1] - top) - np.abs(through)
    return float(np.sum(np.abs(rise)) + np.sum(detour))


def _echoes(through: list[_Late], late: list[_Late]) -> tuple[tuple[float, float], ...]:
    """Return (delay [s], weight) of every impulse that passes straight through, echoes of a neutral equation too."""
    total: dict[float, float] = {}
    wave = [(i.delay, i.weight) for i in through]
    while wave and len(total) < _ECHOES:
        for delay, weight in wave:
            total[round(delay, 12)] = total.get(round(delay, 12), 0.0) + weight
        wave = [(d + t.delay, -w * t.weight) for d, w in wave for t in late if abs(w * t.weight) > _ECHO]
    return tuple(sorted((d, w) for d, w in total.items() if w != 0.0))
