"""Where a growing disturbance goes: convective and absolute string instability.

Seen along the ray n = ψ t, which passes ψ vehicles per second, a disturbance of a long string grows
like e^{σ(ψ) t} with

    σ(ψ) = Re[p + ψ ln G(p)]   at the saddle   1 + ψ G'(p)/G(p) = 0

(steepest descent; Wilson and Ward, Transp. Plan. Technol. 34, 3, 2011; Treiber and Kesting, Traffic
Flow Dynamics, 15.5). At a frequency of largest gain the saddle is iω itself and the ray is the one of
the group delay; from there it is followed through the complex plane by Newton's method. A ray of ψ
moves along the road at c = v - ψ (s + length): a roadside observer sees ψ0 = v/(s + length).
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from headway.arrays import Array
from headway.theory.quasipolynomial import QuasiPolynomial
from headway.theory.scalar import root

__all__ = ["Kind", "Propagation", "Saddle", "Verdict", "classify", "growth_rate", "saddles"]

Kind = Literal[
    "stable", "convectively unstable upstream", "convectively unstable downstream", "absolutely unstable",
    "locally unstable",
]  # fmt: skip


Verdict = Literal["stable", "unstable", "locally unstable"]

#: what samples may miss of ln sup |G|
_SAMPLED = 1e-4

#: first step from ray to ray while an edge is looked for
_STEP = 1.02


class Propagation(NamedTuple):
    """How a small disturbance of a long string of equal vehicles spreads.

    Attributes:
        kind: "stable" (it decays along every ray), "absolutely unstable" (it grows at a fixed place of the
            road until the place is lost), "convectively unstable upstream" or "… downstream" (it grows, but
            leaves every fixed place behind, against or with the traffic), "locally unstable" (a single
            vehicle is; then there is no wave to speak of and all numbers but `roadside_ray` are NaN).
        roadside_growth: σ(ψ0) [1/s], what grows at a fixed place of the road.
        roadside_ray: ψ0 [vehicles/s], the flow past a fixed place.
        growth: the largest σ [1/s]; 0 for a string that is stable.
        ray: its ψ [vehicles/s]; that of the kinematic waves for a string that is stable.
        first_ray: the least ψ [vehicles/s] with positive σ; NaN if stable.
        last_ray: the largest ψ [vehicles/s] with positive σ; NaN if stable.
        velocity: of the fastest growing part along the road [m/s], positive with the traffic:
            v - ray · (gap + length).
        downstream_edge: velocity [m/s] of the front of the growing packet, that of `first_ray`.
        upstream_edge: velocity [m/s] of the rear of the growing packet, that of `last_ray`.
    """

    kind: Kind
    roadside_growth: float
    roadside_ray: float
    growth: float
    ray: float
    first_ray: float
    last_ray: float
    velocity: float
    downstream_edge: float
    upstream_edge: float


class Saddle:
    """One saddle of p + ψ ln G(p), followed from ray to ray.

    Attributes:
        start: the ray [vehicles/s] that it is followed from.
    """

    def __init__(self, top: QuasiPolynomial, bottom: QuasiPolynomial, p: complex, lines: tuple[Array, Array]) -> None:
        """Start at a saddle.

        Args:
            top: numerator of G.
            bottom: denominator of G.
            p: place of the saddle, on the imaginary axis.
            lines: real parts a >= 0 [1/s] and ln sup |G(a + iω)| over all ω, both (lines,): bounds of the growth.
        """
        self._top, self._bottom = top, bottom
        self._lines = lines
        # nothing arrives before the shortest delay has passed at every vehicle
        self._front = 1.0 / min(top.delay) if min(top.delay) > 0.0 else math.inf
        self.start = (-1.0 / self._slopes(p)[1]).real
        self._rays, self._places = [self.start], [self._newton(p, self.start) or p]

    def _slopes(self, p: complex) -> tuple[float, complex, complex]:
        """Return ln |G|, (ln G)' and (ln G)'' at p."""
        (n, n1, n2), (d, d1, d2) = self._top.jet(p), self._bottom.jet(p)
        a, b = n1 / n, d1 / d
        return math.log(abs(n / d)), a - b, n2 / n - a * a - d2 / d + b * b

    def _newton(self, p: complex, ray: float) -> complex | None:
        for _ in range(12):
            try:
                _, first, second = self._slopes(p)
                step = (1.0 / ray + first) / second
            except (ZeroDivisionError, OverflowError, ValueError):
                return None
            p -= step
            if abs(step) <= 1e-13 * (1.0 + abs(p)):
                return p
        return None

    def at(self, ray: float) -> complex | None:
        """Return the place of the saddle on a ray [vehicles/s], or None where it cannot be followed."""
        i = bisect.bisect(self._rays, ray)
        near = min((j for j in (i - 1, i) if 0 <= j < len(self._rays)), key=lambda j: abs(self._rays[j] - ray))
        psi, p = self._rays[near], self._places[near]
        step = ray - psi
        while psi != ray:
            step = math.copysign(min(abs(step), abs(ray - psi)), ray - psi)
            reached = ray if abs(step) >= abs(ray - psi) * (1.0 - 1e-12) else psi + step
            _, first, second = self._slopes(p)
            predicted = p - first / (psi * second) * (reached - psi) if second else p
            place = self._newton(predicted, reached)
            if place is None or abs(place - predicted) > 0.3 * abs(predicted - p) + 1e-9 * (1.0 + abs(p)):
                step *= 0.5
                if abs(step) > 1e-5 * psi:
                    continue
                # two saddles meet here; past it the lower one is on the path of steepest descent
                step = math.copysign(min(5e-4 * psi, abs(ray - psi)), ray - psi)
                reached = psi + step
                others = [self._newton(p + d * abs(p), reached) for d in (0.3, -0.3, 0.1, -0.1, 0.03, -0.03)]
                met = [q for q in others if q is not None and abs(q - p) < 0.5 * abs(p)]
                if not met:
                    return None
                place = min(met, key=lambda q: self._height(q, reached))
            psi, p = reached, place
            j = bisect.bisect(self._rays, psi)
            self._rays.insert(j, psi)
            self._places.insert(j, p)
            step *= 1.6
        return p

    def _height(self, p: complex, ray: float) -> float:
        return p.real + ray * self._slopes(p)[0]

    def growth(self, ray: float) -> float:
        """Return σ [1/s] on a ray [vehicles/s]; -inf where nothing arrives, NaN where the saddle cannot be followed."""
        if ray >= self._front:
            return -math.inf
        p = self.at(ray)
        if p is None:
            return math.nan
        # the growth cannot exceed this bound; a followed saddle above it is spurious, so take the bound
        real, gain = self._lines
        height, most = self._height(p, ray), float(np.min(real + ray * gain))
        return height if height <= most + _SAMPLED * ray else most

    def slope(self, ray: float) -> float:
        """Return dσ/dψ = ln |G| at the saddle of a ray [vehicles/s]; NaN where there is none."""
        p = self.at(ray) if ray < self._front else None
        return math.nan if p is None else self._slopes(p)[0]

    def largest(self) -> tuple[float, float]:
        """Return (σ [1/s], ψ [vehicles/s]) of the ray on which the disturbance grows fastest."""
        rate = self.slope(self.start)
        ray = self.start if abs(rate) < 1e-13 else self._cross(self.slope, _STEP if rate > 0 else 1.0 / _STEP)
        return (self.growth(ray) if math.isfinite(ray) else math.inf), ray

    def edge(self, factor: float) -> float:
        """Return the ray [vehicles/s] beyond which nothing grows.

        Args:
            factor: first step from ray to ray; above 1 for the last ray, below 1 for the first.

        Returns:
            The ray; infinite, or 0 below the start, if there is none.
        """
        return self._cross(self.growth, factor)

    def _cross(self, what: Callable[[float], float], factor: float) -> float:
        """Return where `what` changes its sign beyond the start, or where the saddle ends (in ever shorter waves)."""
        sign = math.copysign(1.0, what(self.start))
        near = self.start
        while 1e-8 * self.start < near < 1e8 * self.start:
            far = near * factor
            value = what(far)
            if math.isnan(value):
                return self._end(near, far)
            if value * sign <= 0:
                return root(what, near, far) if math.isfinite(value) else self._end(near, far)
            near, factor = far, min(max(factor**1.2, 0.67), 1.5)
        return math.inf if factor > 1 else 0.0

    def _end(self, inside: float, outside: float) -> float:
        for _ in range(30):
            middle = 0.5 * (inside + outside)
            inside, outside = (inside, middle) if math.isnan(self.slope(middle)) else (middle, outside)
        return inside


def saddles(
    top: QuasiPolynomial, bottom: QuasiPolynomial, peaks: Sequence[float], peak_gain: float, long_wave: float,
    omega: Array,
) -> tuple[Saddle, ...]:  # fmt: skip
    """Return the saddles that matter: those of amplified frequencies, and of long waves that spread.

    Args:
        top: numerator of G.
        bottom: denominator of G.
        peaks: frequencies [rad/s] of local maxima of the gain above 1.
        peak_gain: sup |G|.
        long_wave: coefficient of long waves [1/s²], see `Linear.long_wave`.
        omega: rising frequencies [rad/s] that resolve the gain.
    """
    if not top.power.size:
        return ()
    starts = [1j * w for w in peaks] + [0j] * (long_wave > 0)
    lines = _lines(top, bottom, omega, peak_gain) if peaks else (np.zeros(1), np.array([math.log(peak_gain) + 1e-12]))
    return tuple(branch for p in starts if (branch := Saddle(top, bottom, p, lines)).start > 0)


def _lines(top: QuasiPolynomial, bottom: QuasiPolynomial, omega: Array, peak_gain: float) -> tuple[Array, Array]:
    """Return real parts a >= 0 [1/s] and ln sup |G(a + iω)|, from samples at `omega`."""
    real = np.concatenate(([0.0], np.geomspace(1e-3, 10.0, 80)))
    gain = np.array([np.log(np.abs(top(a + 1j * omega) / bottom(a + 1j * omega)).max()) for a in real])
    gain[0] = math.log(peak_gain) + 1e-12
    return real, gain


def growth_rate(branches: Sequence[Saddle], ray: Any) -> Any:
    """Return the growth rate on rays, the largest of all saddles.

    Args:
        branches: the saddles.
        ray: [vehicles/s] of any shape.

    Returns:
        σ [1/s] of that shape; -inf where nothing has arrived yet, NaN where no saddle can be followed.
    """
    rays = np.asarray(ray, dtype=float)
    result = np.full(rays.size, math.nan)
    for branch in branches:
        # outwards from where each saddle starts, so that every step is short
        for i in np.argsort(np.abs(rays.ravel() - branch.start)):
            psi = float(rays.ravel()[i])
            if psi > 0.0:
                result[i] = np.fmax(result[i], branch.growth(psi))
    return result.reshape(rays.shape)[()]


def classify(branches: Sequence[Saddle], speed: float, spacing: float, verdict: Verdict) -> Propagation:
    """Return how a disturbance spreads, from the saddles of the string.

    Args:
        branches: the saddles.
        speed: of the vehicles [m/s].
        spacing: gap and length [m] of a vehicle.
        verdict: on one vehicle and on the string.
    """
    here = speed / spacing
    nothing = math.nan
    if verdict == "locally unstable":
        return Propagation(verdict, nothing, here, *[nothing] * 7)
    at_road = float(growth_rate(branches, here))
    growing = [b for b in branches if b.growth(b.start) > 0.0]
    if verdict == "stable" or not growing:
        ray = branches[-1].start if branches else nothing
        return Propagation("stable", at_road, here, 0.0, ray, nothing, nothing, speed - ray * spacing, nothing, nothing)
    largest, ray = max(b.largest() for b in growing)
    first, last = min(b.edge(1.0 / _STEP) for b in growing), max(b.edge(_STEP) for b in growing)
    kind: Kind = "absolutely unstable"
    if not at_road > 0:
        kind = "convectively unstable upstream" if ray > here else "convectively unstable downstream"
    front, core, rear = (speed - r * spacing for r in (first, ray, last))
    return Propagation(kind, at_road, here, largest, ray, first, last, core, front, rear)
