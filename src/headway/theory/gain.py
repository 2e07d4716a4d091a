"""String stability of transfer functions with delays: verdict, margin and peak gain from one spectrum.

A follower is (strictly, L2) string stable if |G(iω)| <= 1 at every frequency. G(0) = 1, so the
verdict is read from H = (|D|² - |N|²)/ω², whose limit for long waves is the coefficient C. Below a
small frequency its series is used, so that it has digits where |G| is 1 to rounding. The limit of
short waves is that of the leading terms; from `Tail.end` on they leave no room for growth.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from headway.theory.quasipolynomial import HIGHEST, QuasiPolynomial
from headway.theory.scalar import least_point

__all__ = [
    "ABOVE_ONE", "BALANCED", "NOISE", "SAMPLES", "TOLERANCE", "VERDICTS", "WINDOW", "Peak", "Spectrum", "Tail",
    "amplified", "grid", "long_wave", "margin", "smallest", "spectrum", "tail",
]  # fmt: skip

Array = NDArray[np.float64]

#: a margin above minus this counts as stable [1/s²]
TOLERANCE = 1e-10

#: the verdicts by code; 0 is left to what has no equilibrium
VERDICTS = ("no equilibrium", "locally unstable", "string unstable", "string stable")

#: a limit of |G| for short waves nearer to 1 than this is 1: then the terms after the leading ones decide
BALANCED = 1e-12

#: |G|² - 1 below this is rounding where frequencies are high
NOISE = 1e-13

#: the least gain above 1: what a growing frequency has at least
ABOVE_ONE = math.nextafter(1.0, 2.0)

#: samples up to which every oscillation of the longest delay is resolved, and samples of each window beyond them
SAMPLES, WINDOW = 40_000, 128


#: local extremes that are refined
_REFINED = 12


class Peak(NamedTuple):
    """The largest gain over all frequencies, and where it is.

    Attributes:
        gain: sup |G| [1], at least 0.
        frequency: [rad/s]; 0 where that is the limit of long waves, infinite where that of short ones.
        certified: whether it was proved, by bounds of second derivatives between samples and of the tail,
            that no frequency exceeds the gain by more than a part in a million.
    """

    gain: float
    frequency: float
    certified: bool


class Spectrum(NamedTuple):
    """Margin and peak gain from one sweep over all frequencies, so that verdict and gain cannot differ.

    Attributes:
        margin: min over ω of (|D|² - |N|²)/ω² [1/s²], -inf where the limit of short waves grows.
        peak: sup |G|; exactly 1 or less where the margin says stable, above 1 where it does not.
    """

    margin: float
    peak: Peak

    @property
    def stable(self) -> bool:
        """Whether no frequency is amplified."""
        return self.margin >= -TOLERANCE


class Tail(NamedTuple):
    """How a transfer function ends at short waves.

    Attributes:
        limit: limit superior of |G| for ω → ∞.
        end: frequency [rad/s] from which on |G| stays below 1 if the limit does.
    """

    limit: float
    end: float


def _series(q: QuasiPolynomial, count: int) -> list[float]:
    """Return the Taylor coefficients of p^0 … p^(count-1)."""
    result = []
    for j in range(count):
        k = j - q.power
        use = k >= 0
        factorials = np.array([math.factorial(int(i)) for i in k[use]])
        result.append(float(np.sum(q.coefficient[use] * (-q.delay[use]) ** k[use] / factorials)))
    return result


def _even(q: QuasiPolynomial) -> tuple[float, float, float]:
    """Return the coefficients of ω^0, ω² and ω⁴ in |q(iω)|²."""
    c0, c1, c2, c3, c4 = _series(q, 5)
    return c0 * c0, c1 * c1 - 2 * c0 * c2, c2 * c2 - 2 * c1 * c3 + 2 * c0 * c4


def long_wave(top: QuasiPolynomial, bottom: QuasiPolynomial) -> float:
    """Return the limit of (|D|² - |N|²)/ω² for ω → 0 [1/s²], infinite where G(0) is not 1.

    Args:
        top: numerator N.
        bottom: denominator D.
    """
    t, b = _even(top), _even(bottom)
    if abs(b[0] - t[0]) > 1e-12 * b[0]:
        return math.copysign(math.inf, b[0] - t[0])
    return b[1] - t[1]


def _excess(top: QuasiPolynomial, bottom: QuasiPolynomial) -> Callable[[Any], Any]:
    """Return the function H(ω) = (|D|² - |N|²)/ω², which keeps its digits for ω → 0."""
    t, b = _even(top), _even(bottom)
    closes = abs(b[0] - t[0]) <= 1e-12 * b[0]
    small = 1e-2 / (1.0 + max((*bottom.delays, *top.delays), default=0.0)) if closes else 0.0

    def h(omega: Any) -> Any:
        w = np.maximum(np.asarray(omega, dtype=float), 1e-12)
        size = np.abs(bottom(1j * w)) ** 2
        direct = (size - np.abs(top(1j * w)) ** 2) / w**2
        # where waves are short, equal leading terms leave nothing but rounding
        direct = np.where((w > 1.0) & (np.abs(direct) * w**2 <= NOISE * size), 0.0, direct)
        return np.where(w < small, b[1] - t[1] + w * w * (b[2] - t[2]), direct)

    return h


def tail(top: QuasiPolynomial, bottom: QuasiPolynomial) -> Tail:
    """Return the limit of short waves and the end of the frequencies that matter.

    Args:
        top: numerator N.
        bottom: denominator D.
    """
    n = bottom.degree
    highest = bottom.power == n
    leading = abs(float(np.sum(bottom.coefficient[highest & (bottom.delay == 0)])))
    late = float(np.sum(np.abs(bottom.coefficient[highest & (bottom.delay > 0)])))
    above = float(np.sum(np.abs(top.coefficient[top.power == n])))
    limit = above / (leading - late) if leading > late else math.inf
    if abs(limit - 1.0) <= BALANCED:
        limit = 1.0
    end = bottom.leads_from(top)
    if math.isinf(end):
        # the limit is 1, above it, or so near that the leading terms decide nowhere
        shortest = min((*bottom.delays, *top.delays), default=math.inf)
        end = min(max(1e4, 64.0 * math.pi / shortest), HIGHEST)
    return Tail(limit, end)


def grid(top: QuasiPolynomial, bottom: QuasiPolynomial) -> Array:
    """Return rising frequencies [rad/s] that resolve every oscillation of the delays.

    They are spaced logarithmically, and by less than π/(8 τ) of the longest delay τ; beyond `SAMPLES` of the
    latter, windows of `WINDOW` samples are resolved, one each time the frequency has risen by a tenth.

    Args:
        top: numerator N.
        bottom: denominator D.
    """
    end = tail(top, bottom).end
    longest = max((*bottom.delays, *top.delays), default=0.0)
    parts: list[Array] = [np.geomspace(1e-4, end, 2000)]
    if longest > 0.0:
        step = math.pi / (8.0 * longest)
        resolved = min(end, SAMPLES * step)
        parts.append(np.linspace(0.0, resolved, int(resolved / step) + 2)[1:])
        if resolved < end:
            starts = np.geomspace(resolved, end, int(math.log(end / resolved) / math.log(1.1)) + 2)
            parts.append((starts[:, None] + step * np.arange(WINDOW)).ravel())
    else:
        parts.append(np.linspace(0.0, min(end, 1e4), 2000)[1:])
    return np.unique(np.concatenate(parts))


def spectrum(top: QuasiPolynomial, bottom: QuasiPolynomial) -> Spectrum:
    """Return the margin and the peak of N/D on the imaginary axis.

    Args:
        top: numerator N.
        bottom: denominator D.
    """
    limit, end = tail(top, bottom)
    omega = grid(top, bottom)
    lowest = -math.inf
    if limit <= 1.0:
        lowest = smallest(_excess(top, bottom), omega, long_wave(top, bottom))[0]
    heard, rest = abs(complex(top(0.0))), abs(complex(bottom(0.0)))
    zero = heard / rest if rest > 0.0 else math.inf if heard > 0.0 else 0.0

    def inverse(w: Any) -> Any:
        p = 1j * np.asarray(w)
        return np.abs(bottom(p)) ** 2 / np.maximum(np.abs(top(p)) ** 2, 1e-300)

    # resonances are poles of |G| and parabolas of its inverse
    value, where = smallest(inverse, omega, min(zero, 1e150) ** -2.0 if zero > 0.0 else math.inf)
    gain = 1.0 / math.sqrt(value)
    if limit > gain:
        gain, where = limit, math.inf
    if lowest >= -TOLERANCE:
        # what is not amplified has |G| = 1 to rounding where waves are long
        if gain >= 1.0 - 1e-12:
            gain, where = min(zero, 1.0), 0.0
    else:
        gain = max(gain, ABOVE_ONE)
    certified = limit > gain or (limit < 1.0 and _certified(top, bottom, gain * (1.0 + 1e-6), end))
    return Spectrum(lowest, Peak(gain, where, certified or math.isinf(where)))


def margin(top: QuasiPolynomial, bottom: QuasiPolynomial) -> float:
    """Return the least H over all frequencies [1/s²]; -inf where the limit of short waves grows.

    Args:
        top: numerator N.
        bottom: denominator D.
    """
    if tail(top, bottom).limit > 1.0:
        return -math.inf
    return smallest(_excess(top, bottom), grid(top, bottom), long_wave(top, bottom))[0]


def smallest(h: Callable[[Any], Any], omega: Array, at_zero: float) -> tuple[float, float]:
    """Return the least value of a function of the frequency and where it is.

    Local minima of the samples are refined: those that parabolas make the deepest, and the lowest.

    Args:
        h: the function, of arrays of frequencies [rad/s].
        omega: rising frequencies [rad/s] that resolve it.
        at_zero: its limit for ω → 0.

    Returns:
        (value, frequency [rad/s]).
    """
    values = h(omega)
    inner = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])) + 1
    best = min((at_zero, 0.0), (float(values[0]), float(omega[0])), (float(values[-1]), float(omega[-1])))
    left, middle, right = values[inner - 1], values[inner], values[inner + 1]
    with np.errstate(all="ignore"):
        depth = middle - np.nan_to_num((left - right) ** 2 / (8.0 * (left - 2.0 * middle + right)))
    # sharp dips between coarse samples look deeper than they are: the lowest samples count, too
    chosen = np.union1d(inner[np.argsort(depth)][:_REFINED], inner[np.argsort(middle)][:_REFINED])
    for i in chosen:
        best = min(best, least_point(h, float(omega[i - 1]), float(omega[i + 1])), (float(values[i]), float(omega[i])))
    return best


def amplified(top: QuasiPolynomial, bottom: QuasiPolynomial) -> list[float]:
    """Return the frequencies [rad/s] of up to eight local maxima of |G| above 1, the largest first.

    The end of the sweep is the last of them if |G| is above 1 there.

    Args:
        top: numerator N.
        bottom: denominator D.
    """

    def less(w: Any) -> Any:
        return -np.abs(top(1j * np.asarray(w)) / bottom(1j * np.asarray(w)))

    omega = grid(top, bottom)
    values = less(omega)
    inner = np.flatnonzero((values[1:-1] < values[:-2]) & (values[1:-1] <= values[2:])) + 1
    maxima = [least_point(less, float(omega[i - 1]), float(omega[i + 1])) for i in inner if values[i] < -1.0 - 1e-10]
    frequencies = [where for _, where in sorted(maxima)[:8]]
    return [*frequencies, float(omega[-1])] if values[-1] < -1.0 - 1e-10 else frequencies


def _certified(top: QuasiPolynomial, bottom: QuasiPolynomial, gain: float, end: float) -> bool:
    """Whether gain² |D|² - |N|² is proved positive on [0, end], by samples less a bound of the change between them."""

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
