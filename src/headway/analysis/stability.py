"""String stability of transfer functions with delays: peak gains, margins, critical delays, whole strings.

A follower is (strictly, L2) string stable if |G(iω)| <= 1 at every frequency. G(0) = 1, so the
verdict is read from H = (|D|² - |N|²)/ω², whose limit for long waves is the coefficient C. Below a
small frequency its series is used, so that it has digits where |G| is 1 to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from headway.analysis.quasipolynomial import QuasiPolynomial
from headway.analysis.search import least, root

if TYPE_CHECKING:
    from headway.analysis.linear import Linear

__all__ = [
    "TOLERANCE", "Chain", "Peak", "amplified", "critical_scale", "long_wave", "margin", "peak",
]  # fmt: skip

Array = NDArray[np.float64]

#: a margin above minus this counts as stable [1/s²]
TOLERANCE = 1e-10

#: longest delay [s] up to which a critical one is looked for
_LONGEST = 200.0


class Peak(NamedTuple):
    """sup |G| and the frequency [rad/s] where it is (0: long waves, inf: short ones).

    `certified`: it was proved, by bounds of second derivatives between samples and of the tail, that
    no frequency exceeds the gain by more than a part in a million.
    """

    gain: float
    frequency: float
    certified: bool


def _series(q: QuasiPolynomial, count: int) -> list[float]:
    """Coefficients of p^0 … p^(count-1)."""
    result = []
    for j in range(count):
        k = j - q.power
        use = k >= 0
        factorials = np.array([math.factorial(int(i)) for i in k[use]])
        result.append(float(np.sum(q.coefficient[use] * (-q.delay[use]) ** k[use] / factorials)))
    return result


def _even(q: QuasiPolynomial) -> tuple[float, float, float]:
    """Coefficients of ω^0, ω², ω⁴ of |q(iω)|²."""
    c0, c1, c2, c3, c4 = _series(q, 5)
    return c0 * c0, c1 * c1 - 2 * c0 * c2, c2 * c2 - 2 * c1 * c3 + 2 * c0 * c4


def long_wave(top: QuasiPolynomial, bottom: QuasiPolynomial) -> float:
    """Limit of (|D|² - |N|²)/ω² for ω → 0 [1/s²], infinite where G(0) is not 1."""
    t, b = _even(top), _even(bottom)
    if abs(b[0] - t[0]) > 1e-12 * b[0]:
        return math.copysign(math.inf, b[0] - t[0])
    return b[1] - t[1]


def _excess(top: QuasiPolynomial, bottom: QuasiPolynomial) -> Callable[[Any], Any]:
    """H(ω) = (|D|² - |N|²)/ω², with digits for ω → 0 too."""
    t, b = _even(top), _even(bottom)
    closes = abs(b[0] - t[0]) <= 1e-12 * b[0]
    small = 1e-2 / (1.0 + max((*bottom.delays, *top.delays), default=0.0)) if closes else 0.0

    def h(omega: Any) -> Any:
        w = np.maximum(np.asarray(omega, dtype=float), 1e-12)
        direct = (np.abs(bottom(1j * w)) ** 2 - np.abs(top(1j * w)) ** 2) / w**2
        return np.where(w < small, b[1] - t[1] + w * w * (b[2] - t[2]), direct)

    return h


def _tail(top: QuasiPolynomial, bottom: QuasiPolynomial) -> tuple[float, float]:
    """Limit superior of |G| for ω → ∞, and a frequency from which on |G| stays below 1 (if the limit does)."""
    n = bottom.degree
    leading = float(np.sum(bottom.coefficient[(bottom.power == n) & (bottom.delay == 0)]))
    late = float(np.sum(np.abs(bottom.coefficient[(bottom.power == n) & (bottom.delay > 0)])))
    above = float(np.sum(np.abs(top.coefficient[top.power == n])))
    limit = above / (leading - late) if leading > late else math.inf
    omega = 1.0
    while limit < 1.0 and omega < 1e6:
        below = 2.0 * (leading - late) * omega**n - bottom.magnitude(omega) + 2.0 * late * omega**n
        if below > top.magnitude(omega) and below > 0:
            break
        omega *= 1.5
    return limit, omega if limit < 1.0 else max(omega, 200.0)


def grid(top: QuasiPolynomial, bottom: QuasiPolynomial) -> Array:
    """Frequencies [rad/s] that resolve every oscillation of the delays: logarithmic, and Δω < π/(8 τ)."""
    limit, end = _tail(top, bottom)
    longest = max((*bottom.delays, *top.delays), default=0.0)
    count = min(int(end * 8.0 * longest / math.pi) + 2, 200_000)
    parts: list[Array] = [np.geomspace(1e-4, end, 2000), np.linspace(0.0, end, count)[1:]]
    if limit == 1.0 and longest > 0.0:
        # short waves neither grow nor fade by their leading terms: the next ones decide, at some phase of the delays
        parts.append(1e4 + np.arange(1024.0) * (math.pi / 64.0 / max(longest, 1e-4)))
    return np.unique(np.concatenate(parts))


def margin(top: QuasiPolynomial, bottom: QuasiPolynomial) -> float:
    """Least H over all frequencies, see `Linear.margin`."""
    return _least(_excess(top, bottom), grid(top, bottom), long_wave(top, bottom))[0]


def _least(h: Callable[[Any], Any], omega: Array, at_zero: float) -> tuple[float, float]:
    """Least value of `h` and where, every local minimum of the samples refined."""
    values = h(omega)
    inner = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])) + 1
    best = min((at_zero, 0.0), (float(values[0]), float(omega[0])), (float(values[-1]), float(omega[-1])))
    for i in inner[np.argsort(values[inner])][:8]:
        best = min(best, least(h, float(omega[i - 1]), float(omega[i + 1])), (float(values[i]), float(omega[i])))
    return best


def amplified(top: QuasiPolynomial, bottom: QuasiPolynomial) -> list[float]:
    """Frequencies [rad/s] of all local maxima of |G| above 1; the end of the sweep if |G| is above 1 there."""

    def less(w: Any) -> Any:
        return -np.abs(top(1j * np.asarray(w)) / bottom(1j * np.asarray(w)))

    omega = grid(top, bottom)
    values = less(omega)
    inner = np.flatnonzero((values[1:-1] < values[:-2]) & (values[1:-1] <= values[2:])) + 1
    found = [least(less, float(omega[i - 1]), float(omega[i + 1])) for i in inner if values[i] < -1.0 - 1e-10]
    frequencies = [where for _, where in sorted(found)[:8]]
    return [*frequencies, float(omega[-1])] if values[-1] < -1.0 - 1e-10 else frequencies


def peak(top: QuasiPolynomial, bottom: QuasiPolynomial) -> Peak:
    """sup |N/D| on the imaginary axis with certified refinement and tail bound."""
    limit, end = _tail(top, bottom)
    omega = grid(top, bottom)
    zero = abs(complex(top(0.0)) / complex(bottom(0.0))) if complex(bottom(0.0)) != 0 else math.inf

    def less(w: Any) -> Any:
        return -np.abs(top(1j * np.asarray(w)) / bottom(1j * np.asarray(w)))

    value, where = _least(less, omega, -zero)
    # long waves that are not amplified have |G| = 1 to rounding: the peak is at 0 then
    if -value <= zero * (1.0 + 1e-12):
        value, where = -zero, 0.0
    if limit > -value:
        return Peak(limit, math.inf, True)
    return Peak(-value, where, limit < 1.0 and _certified(top, bottom, -value * (1.0 + 1e-6), end))


def _certified(top: QuasiPolynomial, bottom: QuasiPolynomial, gain: float, end: float) -> bool:
    """Whether gain² |D|² - |N|² is proved positive on [0, end]: samples less a bound of what can happen between."""

    def value(w: Array) -> Array:
        return gain**2 * np.abs(bottom(1j * w)) ** 2 - np.abs(top(1j * w)) ** 2

    def bend(w: Array, width: Array) -> Array:
        # second derivative of |q|² is at most 2 |q'|² + 2 |q| |q''|; each factor is taken at the sample plus its growth
        total = np.zeros_like(w)
        for q, weight in ((bottom, gain**2), (top, 1.0)):
            second = q.curvature(w + width)
            first = np.abs(q.derivative(1j * w)) + width * second
            size = np.abs(q(1j * w)) + width * first
            total += 2.0 * weight * (first**2 + size * second)
        return total

    left = np.concatenate(([0.0], np.geomspace(1e-3, end, 400)[:-1]))
    right = np.concatenate((left[1:], [end]))
    for _ in range(24):
        width = right - left
        low = np.minimum(value(left), value(right)) - bend(left, width) * width**2 / 8.0
        open_ = low <= 0.0
        if not open_.any():
            return True
        left, right = left[open_], right[open_]
        if left.size > 200_000 or np.any(value(left) <= 0.0):
            return False
        middle = 0.5 * (left + right)
        left, right = np.concatenate((left, middle)), np.concatenate((middle, right))
    return False


# -- critical delays -------------------------------------------------------------------------------


def critical_scale(linear: Linear, kind: str, unit: float) -> float:
    """First factor of the delay pattern at which a verdict is lost, see `Linear.critical_delay`."""
    still = linear.slowed(0.0)
    local = _critical_local(linear, still, unit)
    if kind == "local":
        return local

    def smallest(factor: float) -> float:
        late = linear.slowed(factor)
        return margin(late.numerator, late.characteristic)

    if local == 0.0 or smallest(0.0) < -TOLERANCE:
        return 0.0
    end = min(local, _LONGEST / unit)
    steps = np.unique(np.concatenate((np.geomspace(1e-3 / unit, end, 60), np.linspace(0.0, end, 61)[1:])))
    found = _first_sign_change(smallest, steps[steps <= end], TOLERANCE)
    return found if found is not None else local


def _first_sign_change(f: Callable[[float], float], at: Array, slack: float) -> float | None:
    """The first root of `f` between rising places, where it turns below -slack; None if it does not.

    Dips between the places are looked into: a verdict may be lost there and be regained.
    """
    xs, values = [0.0], [f(0.0)]
    for x in at.tolist():
        xs.append(x)
        values.append(f(x))
        low, before = (x if values[-1] < -slack else None), -2
        if low is None and len(xs) > 2:
            left, middle, right = values[-3:]
            # a parabola through three values dips below the middle one by less than they differ
            if left > middle <= right and middle < max(left, right) - middle:
                low, before = _dip(f, xs[-3], x, -slack), -3
        if low is not None:
            return root(f, xs[before], low) if values[before] > 0 else xs[before]
    return None


def _dip(f: Callable[[float], float], a: float, b: float, below: float) -> float | None:
    """The place of the least value between `a` and `b` if it is `below`."""
    value, place = least(f, a, b)
    return place if value < below else None


def _critical_local(linear: Linear, still: Linear, unit: float) -> float:
    if not still.locally_stable:
        return 0.0
    characteristic = linear.slowed(1.0).characteristic
    if not characteristic.delays:
        return math.inf
    if len(characteristic.delays) == 1:
        return _crossing(characteristic) / unit

    def damping(factor: float) -> float:
        return linear.slowed(factor).decay_rate

    found = _first_sign_change(damping, np.geomspace(1e-3, _LONGEST / unit, 120), 0.0)
    return math.inf if found is None else found


def _crossing(characteristic: QuasiPolynomial) -> float:
    """Least delay [s] at which P(iω) + Q(iω) e^{-iωτ} = 0, exactly: |P|² = |Q|² is a polynomial in ω."""
    (delay,) = characteristic.delays
    now, late = characteristic.polynomial(0.0), characteristic.polynomial(delay)

    def squared(c: Array) -> Array:
        turned = c * 1j ** np.arange(c.size - 1, -1, -1)
        return np.real(np.polymul(turned, np.conj(turned)))

    roots = np.roots(np.trim_zeros(np.polysub(squared(now), squared(late)), "f"))
    crossings = roots[(np.abs(roots.imag) < 1e-9 * (1.0 + np.abs(roots))) & (roots.real > 1e-12)].real
    delays = [float(np.angle(-np.polyval(late, 1j * w) / np.polyval(now, 1j * w)) % (2 * np.pi)) / w for w in crossings]
    return min(delays, default=math.inf)


# -- whole strings ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Chain:
    """Linear theory of a string of different vehicles, front to back, behind one leader."""

    vehicles: tuple[Linear, ...]

    def responses(self, omega: Any) -> Any:
        """Complex speed of every follower per speed of the leader, (vehicles, *omega.shape)."""
        p = 1j * np.asarray(omega, dtype=float)
        speed = np.ones_like(p)
        found = []
        for v in self.vehicles:
            speed = (v.numerator(p) * speed + v.leader_numerator(p)) / v.characteristic(p)
            found.append(speed)
        return np.array(found)

    def gain(self, omega: Any) -> Any:
        """Head-to-tail gain."""
        return np.abs(self.responses(omega)[-1])

    @property
    def locally_stable(self) -> bool:
        """Whether every vehicle is."""
        return all(v.locally_stable for v in self.vehicles)

    @property
    def strictly_string_stable(self) -> bool:
        """|G_n| <= 1 for every vehicle (Ploeg et al. 2014)."""
        return all(v.string_stable for v in self.vehicles)

    @property
    def peak(self) -> Peak:
        """sup of the head-to-tail gain and where."""
        return self._sup(lambda w: self.gain(w))

    @property
    def worst(self) -> Peak:
        """sup over all frequencies and all vehicles of the gain from the leader."""
        return self._sup(lambda w: np.abs(self.responses(w)).max(axis=0))

    @property
    def head_to_tail_stable(self) -> bool:
        """Whether no frequency is larger at the tail than at the head."""
        return self.locally_stable and self.peak.gain <= 1.0 + 1e-9

    def _sup(self, gain: Callable[[Any], Any]) -> Peak:
        if not self.locally_stable:
            return Peak(math.inf, math.nan, False)
        omega = np.unique(np.concatenate([grid(v.numerator, v.characteristic) for v in set(self.vehicles)]))
        value, where = _least(lambda w: -gain(w), omega, -1.0)
        # the sweep ends where every vehicle calms its predecessor, or else among waves as short as any
        if where == omega[-1]:
            where = math.inf
        return Peak(1.0, 0.0, False) if -value <= 1.0 + 1e-12 else Peak(-value, where, False)
