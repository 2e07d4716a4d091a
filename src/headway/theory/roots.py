"""Rightmost characteristic roots of equations with delays.

The infinitesimal generator of the delay equation is collocated at Chebyshev nodes of the longest
delay (Breda, Maset, Vermiglio, SIAM J. Sci. Comput. 27, 482, 2005); its rightmost eigenvalues are
starts for Newton's method on the exact characteristic function. So are the places of the imaginary
axis where that function is small, because few nodes do not see fast oscillations. The number of
nodes is doubled until the rightmost root stands and no unstable root is missing, which the turns of
the function along the imaginary axis count. Without delays the roots are those of a polynomial.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from headway.theory.quasipolynomial import QuasiPolynomial
from headway.theory.scalar import root

__all__ = ["Roots", "chain_abscissa", "growing_roots", "rightmost"]

_NODES = (12, 24, 48, 96, 192)
_SETTLED = 1e-9
#: starts on the imaginary axis
_STARTS = 24


class Roots(NamedTuple):
    """The rightmost characteristic roots, and how exact they are.

    Attributes:
        roots: [1/s] (roots,), the rightmost first; of a conjugate pair the one with the positive imaginary part first.
        residual: the largest |characteristic function| at them, relative to its terms.
        nodes: number of collocation nodes; 0 where a polynomial was solved.
    """

    roots: NDArray[np.complex128]
    residual: float
    nodes: int


def rightmost(characteristic: QuasiPolynomial, count: int = 6) -> Roots:
    """Return the rightmost roots of a characteristic function.

    Args:
        characteristic: the function; its highest power is undelayed, or delayed and smaller.
        count: number of roots, at least 1.

    Returns:
        Up to `count` roots; none for a constant.
    """
    if not characteristic.delays:
        roots = np.asarray(np.roots(characteristic.polynomial(0.0)), dtype=np.complex128)
        return Roots(_sorted(roots)[:count], _residual(characteristic, roots), 0)
    previous = np.nan
    roots = np.empty(0, complex)
    nodes = 0
    near = _near_axis(characteristic)
    growing = growing_roots(characteristic) if chain_abscissa(characteristic) < 0.0 else 0
    for nodes in _NODES:
        starts = _collocated(characteristic, nodes)
        starts = starts[np.argsort(-starts.real)][: 4 * count]
        roots = _newton(characteristic, np.concatenate((starts, near)), count)
        complete = np.count_nonzero(roots.real > 0.0) >= min(growing, count)
        if complete and roots.size and abs(roots[0] - previous) < _SETTLED * (1.0 + abs(roots[0])):
            break
        previous = roots[0] if roots.size else np.nan
    return Roots(roots, _residual(characteristic, roots), nodes)


def chain_abscissa(f: QuasiPolynomial) -> float:
    """Return the real part [1/s] that the endless chain of roots of a neutral equation tends to.

    It solves Σ |c_k| e^{-σ τ_k} = |c_0| over the terms of the highest power, exact for one late term and for delays
    without a common measure. From 0 on no delay, however short, leaves the equation stable (Hale and Verduyn Lunel,
    Introduction to Functional Differential Equations, 9.6).

    Args:
        f: the characteristic function.

    Returns:
        The real part; -inf for a retarded equation, inf for one without an undelayed highest power.
    """
    top = f.power == f.degree
    now = abs(float(np.sum(f.coefficient[top & (f.delay == 0.0)])))
    late, delay = np.abs(f.coefficient[top & (f.delay > 0.0)]), f.delay[top & (f.delay > 0.0)]
    if not late.size:
        return -math.inf
    if now == 0.0:
        return math.inf
    if late.size == 1:
        return math.log(float(late[0]) / now) / float(delay[0])
    reach = math.log(float(late.sum()) / now)
    ends = sorted((reach / float(delay.min()), reach / float(delay.max())))
    return root(lambda x: float(np.sum(late * np.exp(-x * delay))) - now, ends[0] - 1e-9, ends[1] + 1e-9)


def growing_roots(f: QuasiPolynomial) -> int:
    """Count the roots with a positive real part by the principle of the argument: n/2 - Δarg f(iω)/π.

    Args:
        f: the characteristic function, whose chain of roots, if it has one, lies to the left (`chain_abscissa`).

    Returns:
        The number; 999 and more for an endless chain.
    """
    end = f.leads_from()
    if not math.isfinite(end):
        return 0 if f.degree == 0 else f.degree + 999
    omega = _spaced(f, end)
    value = f(1j * omega)
    for _ in range(40):
        turn = np.angle(value[1:] * np.conj(value[:-1]))
        wide = np.flatnonzero((np.abs(turn) > 1.1) & (np.diff(omega) > 1e-12 * (1.0 + omega[1:])))
        if not wide.size:
            break
        middle = 0.5 * (omega[wide] + omega[wide + 1])
        omega, value = np.insert(omega, wide + 1, middle), np.insert(value, wide + 1, f(1j * middle))
    turned = float(np.sum(np.angle(value[1:] * np.conj(value[:-1]))))
    # beyond the end the function stays within a quarter turn of its leading term
    leading = float(f.polynomial(0.0)[0])
    turned += float(np.angle(leading * 1j**f.degree * np.conj(value[-1])))
    return max(round(0.5 * f.degree - turned / math.pi), 0)


def _spaced(f: QuasiPolynomial, end: float) -> NDArray[np.float64]:
    """Return frequencies from 0 to `end` [rad/s] that resolve the longest delay by π/8, at most two million."""
    longest = max(f.delays, default=0.0)
    count = min(int(end * 8.0 * longest / np.pi) + 400, 2_000_000)
    return np.union1d(np.linspace(0.0, end, count), np.geomspace(1e-3, end, 400))


def _near_axis(f: QuasiPolynomial) -> NDArray[np.complex128]:
    """Return places iω with ω > 0 where |f| is small, the smallest first."""
    end = min(f.leads_from(), 1e4)
    omega = _spaced(f, end)[:200_000]
    size = np.abs(f(1j * omega)) / f.magnitude(omega)
    low = np.flatnonzero((size[1:-1] <= size[:-2]) & (size[1:-1] < size[2:])) + 1
    best = low[np.argsort(size[low])][:_STARTS]
    return np.asarray(1j * omega[best], dtype=np.complex128)


def _collocated(characteristic: QuasiPolynomial, nodes: int) -> NDArray[np.complex128]:
    """Return eigenvalues of the collocated generator for y(θ), …, y^(n-1)(θ), θ in [-τ_max, 0]."""
    n, longest = characteristic.degree, max(characteristic.delays)
    theta = 0.5 * longest * (np.cos(np.pi * np.arange(nodes + 1) / nodes) - 1.0)
    difference = _differentiation(theta)
    size = nodes + 1
    matrix = np.kron(np.eye(n), difference)
    leading = sum(
        c for c, k, t in zip(characteristic.coefficient, characteristic.power, characteristic.delay, strict=True)
        if k == n and t == 0.0
    )  # fmt: skip
    for block in range(n):
        # at θ = 0 the derivative of each component is the next one, that of the last the equation itself
        matrix[block * size] = 0.0
        if block < n - 1:
            matrix[block * size, (block + 1) * size] = 1.0
    last = (n - 1) * size
    for c, k, tau in zip(characteristic.coefficient, characteristic.power, characteristic.delay, strict=True):
        if k == n and tau == 0.0:
            continue
        row = _interpolation(theta, -tau)
        if k == n:  # a delayed highest derivative: the derivative of the last component back then
            matrix[last, last : last + size] -= c / leading * (row @ difference)
        else:
            matrix[last, k * size : (k + 1) * size] -= c / leading * row
    return np.linalg.eigvals(matrix).astype(complex)


def _differentiation(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the differentiation matrix on Chebyshev points `x` (Trefethen, Spectral Methods in MATLAB, ch. 6)."""
    n = x.size - 1
    c = np.ones(n + 1)
    c[0] = c[-1] = 2.0
    c *= (-1.0) ** np.arange(n + 1)
    dx = x[:, None] - x[None, :]
    matrix = np.outer(c, 1.0 / c) / (dx + np.eye(n + 1))
    return matrix - np.diag(matrix.sum(axis=1))


def _interpolation(x: NDArray[np.float64], at: float) -> NDArray[np.float64]:
    """Return barycentric weights that read the interpolant on Chebyshev points `x` at one place."""
    exact = np.flatnonzero(np.abs(x - at) < 1e-14 * max(1.0, abs(at)))
    row = np.zeros(x.size)
    if exact.size:
        row[exact[0]] = 1.0
        return row
    weight = (-1.0) ** np.arange(x.size)
    weight[0] *= 0.5
    weight[-1] *= 0.5
    row = weight / (at - x)
    return row / row.sum()


def _newton(f: QuasiPolynomial, starts: NDArray[np.complex128], count: int) -> NDArray[np.complex128]:
    """Polish the rightmost starts on the exact function; keep different roots."""
    z = starts.copy()
    first = z.copy()
    with np.errstate(all="ignore"):
        for _ in range(40):
            step = f(z) / f.derivative(z)
            z = z - step
            if np.nanmax(np.abs(step), initial=0.0) < 1e-14 * (1.0 + np.nanmax(np.abs(z), initial=0.0)):
                break
        # Newton may run away from a start that is no eigenvalue of the equation itself
        good = np.isfinite(z) & (np.abs(z - first) < 0.5 * (1.0 + np.abs(first))) & (_relative(f, z) < 1e-8)
    different: list[complex] = []
    z = np.concatenate((z, np.conj(z)))  # a start on the upper half of the axis stands for a pair
    good = np.concatenate((good, good))
    for place in z[good][np.argsort(-z[good].real)]:
        if all(abs(place - other) > 1e-7 * (1.0 + abs(place)) for other in different):
            different.append(complex(place))
    return _sorted(np.array(different, dtype=complex))[:count]


def _relative(f: QuasiPolynomial, z: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return |f| relative to the magnitudes of its terms."""
    terms = np.abs(f.coefficient * z[..., None] ** f.power * np.exp(-z[..., None] * f.delay))
    return np.abs(f(z)) / np.maximum(terms.sum(axis=-1), 1e-300)


def _residual(f: QuasiPolynomial, roots: NDArray[np.complex128]) -> float:
    return float(np.max(_relative(f, np.asarray(roots, dtype=complex)), initial=0.0))


def _sorted(roots: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Sort roots, the rightmost first; of a conjugate pair the one with the positive imaginary part first."""
    roots = np.asarray(roots, dtype=complex)
    return roots[np.lexsort((-roots.imag, -np.round(roots.real, 12)))]
