"""Exact linear theory of a follower with delays, lag and radio.

Around an equilibrium a follower answers the speed of the vehicle ahead with

    G(p) = N(p) / D(p),
    N = f_s e^{-pτ_s} + p f_dv e^{-pτ} + p f_vl e^{-pτ} + p² f_al e^{-pτ},
    D = p² (1 + T_a p) + f_s e^{-pτ_s} + p f_dv e^{-pτ'} - p f_v e^{-pτ_v} - p² f_a e^{-pτ_a},

each signal with its own delay (τ of the leader's half of dv, τ' of one's own), T_a the actuator lag.
This is one formula for every law, whatever is late (theory: Wilson and Ward, Transp. Plan. Technol.
34, 3, 2011; Treiber and Kesting, Traffic Flow Dynamics, ch. 16; Ploeg et al. 2014).
"""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from headway.analysis import stability
from headway.analysis.quasipolynomial import QuasiPolynomial
from headway.analysis.roots import Roots, rightmost
from headway.errors import HeadwayError, unknown_name
from headway.models import Model
from headway.scenario.vehicle import Vehicle

__all__ = ["Linear", "head_to_tail", "linearize"]

Damping = Literal["undamped", "underdamped", "critically damped", "overdamped"]


def linearize(vehicle: Vehicle | Model, speed: float, gap: float | None = None) -> Linear:
    """Linear theory of `vehicle` where everybody drives `speed` [m/s].

    `gap` [m] is needed where every gap is an equilibrium (GMM). Raises `HeadwayError` if there is
    no equilibrium, or if the law has no finite derivative there.
    """
    car = vehicle if isinstance(vehicle, Vehicle) else Vehicle(vehicle)
    s = car.model.equilibrium_gap(speed) if gap is None else float(gap)
    if s <= 0:
        raise HeadwayError(f"gap = {s:g} m is not positive")
    slopes = car.model.partials(speed, s)
    for name, value in slopes.items():
        if not math.isfinite(value):
            raise HeadwayError(
                f"{car.model.name} is not differentiable at {speed:g} m/s and {s:g} m: "
                f"its derivative by {name} is {value}"
            )
    return Linear(car, float(speed), s, tuple(slopes.items()))


@dataclass(frozen=True)
class Linear:
    """Linear theory at an equilibrium; made by `linearize`. SI units, angular frequencies in rad/s."""

    vehicle: Vehicle
    speed: float
    gap: float
    slopes: tuple[tuple[str, float], ...]

    # -- the law ---------------------------------------------------------------------------------

    @property
    def partials(self) -> dict[str, float]:
        """Partial derivatives of the law by signal: `s` [1/s²]; `v dv vl v0l` [1/s]; `a al a0l` [1]."""
        return dict(self.slopes)

    @functools.cached_property
    def _loop(self) -> float:
        """1 - f_a: what a law that hears its own acceleration is divided by (1 for all others)."""
        return 1.0 - self.partials.get("a", 0.0)

    @property
    def natural_frequency(self) -> float:
        """ω0 = sqrt(f_s) of the law without delay and lag; 0 if it does not react to the gap."""
        return math.sqrt(max(self.partials.get("s", 0.0) / self._loop, 0.0))

    @property
    def damping_ratio(self) -> float:
        """ξ = (f_dv - f_v) / (2 ω0) of the law without delay and lag; infinite if ω0 = 0."""
        f = self.partials
        damping = (f.get("dv", 0.0) - f.get("v", 0.0)) / self._loop
        return damping / (2.0 * self.natural_frequency) if self.natural_frequency > 0 else math.inf

    @property
    def damping_class(self) -> Damping:
        """Class of the law without delay and lag."""
        xi = self.damping_ratio
        if xi <= 0:
            return "undamped"
        if abs(xi - 1.0) < 1e-9:
            return "critically damped"
        return "underdamped" if xi < 1 else "overdamped"

    # -- transfer functions ----------------------------------------------------------------------

    @functools.cached_property
    def characteristic(self) -> QuasiPolynomial:
        """D(p), without the factor p that a law has which rests at every gap."""
        return self._both[1]

    @functools.cached_property
    def numerator(self) -> QuasiPolynomial:
        """N(p), divided alike."""
        return self._both[0]

    @functools.cached_property
    def leader_numerator(self) -> QuasiPolynomial:
        """Numerator of the answer to the platoon leader's speed; empty for laws that do not hear it."""
        return self._both[2]

    @functools.cached_property
    def _both(self) -> tuple[QuasiPolynomial, QuasiPolynomial, QuasiPolynomial]:
        f, c, lag = self.partials, self.vehicle.channel, self.vehicle.lag
        g = {name: f.get(name, 0.0) for name in ("s", "v", "dv", "a", "vl", "al", "v0l", "a0l")}
        top = QuasiPolynomial.of(
            (g["s"], 0, c.s), (g["dv"], 1, c.leader_speed_in_dv), (g["vl"], 1, c.vl), (g["al"], 2, c.al)
        )
        bottom = QuasiPolynomial.of(
            (1.0, 2, 0.0), (lag, 3, 0.0), (g["s"], 0, c.s), (g["dv"], 1, c.own_speed_in_dv), (-g["v"], 1, c.v),
            (-g["a"], 2, c.a),
        )  # fmt: skip
        leader = QuasiPolynomial.of((g["v0l"], 1, c.v0l), (g["a0l"], 2, c.a0l))
        common = min(q.lowest for q in (top, bottom, leader) if q.power.size)
        return top.over(common), bottom.over(common), leader.over(common)

    def transfer(self, p: Any) -> Any:
        """G(p), own speed over the speed of the vehicle ahead, at complex `p` of any shape."""
        return self.numerator(p) / self.characteristic(p)

    def gain(self, omega: Any) -> Any:
        """|G(iω)| at `omega` [rad/s] of any shape."""
        return np.abs(self.transfer(1j * np.asarray(omega, dtype=float)))

    def phase_lag(self, omega: Any) -> Any:
        """Angle [rad] by which own speed lags behind the vehicle ahead, unwrapped from 0 at ω → 0."""
        w = np.atleast_1d(np.asarray(omega, dtype=float))
        fine = np.unique(np.concatenate((np.geomspace(1e-4, max(w.max(), 1e-3), 4000), w)))
        angle = -np.unwrap(np.angle(self.transfer(1j * fine)))
        angle -= 2 * np.pi * np.round(angle[0] / (2 * np.pi))
        return np.interp(w, fine, angle).reshape(np.shape(omega))

    def group_delay(self, omega: Any) -> Any:
        """-d arg G / dω [s]: how much later each vehicle repeats what the one ahead does."""
        p = 1j * np.asarray(omega, dtype=float)
        top, bottom = self.numerator, self.characteristic
        return np.real(-(top.derivative(p) / top(p) - bottom.derivative(p) / bottom(p)))

    def gap_response(self, omega: Any) -> Any:
        """Complex gap amplitude per speed amplitude of the vehicle ahead [s], (1 - G)/p."""
        p = 1j * np.asarray(omega, dtype=float)
        return (1.0 - self.transfer(p)) / p

    def steady_response(self, amplitude: float, omega: float) -> tuple[float, float]:
        """(A, B) [m] of the gap y = A cos ωt + B sin ωt behind a leader with speed `amplitude` · cos ωt."""
        y = complex(self.gap_response(omega)) * amplitude
        return y.real, -y.imag

    # -- local stability -------------------------------------------------------------------------

    @functools.cached_property
    def roots(self) -> Roots:
        """The rightmost characteristic roots, their residual and the number of nodes it took."""
        return rightmost(self.characteristic)

    @property
    def rightmost_root(self) -> complex:
        """The rightmost characteristic root [1/s]."""
        return complex(self.roots.roots[0])

    @property
    def decay_rate(self) -> float:
        """Rate [1/s] at which a small disturbance of one vehicle dies down; negative if it grows."""
        return -self.rightmost_root.real

    @property
    def locally_stable(self) -> bool:
        """Whether a small disturbance of one vehicle dies down."""
        return self.decay_rate > 0.0

    # -- string stability ------------------------------------------------------------------------

    @functools.cached_property
    def peak(self) -> stability.Peak:
        """Supremum of |G(iω)| over all frequencies and where it is."""
        return stability.peak(self.numerator, self.characteristic)

    @property
    def peak_gain(self) -> float:
        """sup |G(iω)|; 1 where no frequency is amplified (G(0) = 1), infinite if locally unstable."""
        return self.peak.gain if self.locally_stable else math.inf

    @property
    def peak_frequency(self) -> float:
        """Frequency [rad/s] of the peak gain; 0 where it is reached in the limit of long waves."""
        return self.peak.frequency

    @property
    def string_stable(self) -> bool:
        """Strictly (L2) string stable: locally stable and |G(iω)| <= 1 at every frequency."""
        return self.locally_stable and self.margin >= -stability.TOLERANCE

    @functools.cached_property
    def margin(self) -> float:
        """min over ω of (|D|² - |N|²)/ω², the long-wave limit included: negative where a frequency is amplified."""
        return stability.margin(self.numerator, self.characteristic)

    @property
    def long_wave(self) -> float:
        """C in |G|^-2 = 1 + ω² C / f_s² + O(ω⁴) [1/s²] (f_dv in the place of f_s where that is 0).

        Negative: long waves grow. Positive is necessary for string stability and not sufficient.
        """
        return stability.long_wave(self.numerator, self.characteristic)

    # -- margins ---------------------------------------------------------------------------------

    def slowed(self, factor: float) -> Linear:
        """The same vehicle with all delays times `factor`; where none is late, all on-board signals by `factor` s."""
        return dataclasses.replace(self, vehicle=dataclasses.replace(self.vehicle, delay=self._pattern(factor)))

    def _pattern(self, factor: float) -> Any:
        delay = self.vehicle.delay
        if isinstance(delay, float):
            return factor * delay if delay > 0 else factor
        if any(t > 0 for _, t in delay):
            return {n: factor * t for n, t in delay}
        return factor

    def critical_delay(self, kind: str) -> float:
        """The first delay [s] at which the verdict `kind` ("local" or "string") is lost.

        The pattern of late signals is kept and scaled; where none is late, all on-board signals are
        made late alike. The answer is the longest delay of the pattern; 0 if the verdict is "unstable"
        without any delay, infinite if no delay changes it.
        """
        if kind not in ("local", "string"):
            raise unknown_name("kind of critical delay", kind, ("local", "string"))
        unit = self.slowed(1.0).vehicle.channel.longest
        return stability.critical_scale(self, kind, unit) * unit

    def critical(self, parameter: str) -> float:
        """The value of a parameter, nearest to the present one, at which the string verdict changes; NaN if none does.

        All other parameters, the delays and the speed stay; the equilibrium gap follows.
        """
        return _critical_parameter(self, parameter)


def head_to_tail(
    vehicles: list[Vehicle] | tuple[Vehicle, ...], speed: float, gap: float | None = None
) -> stability.Chain:
    """Linear theory of a whole string, front to back: what reaches its tail, and its worst vehicle between."""
    known: dict[Vehicle, Linear] = {}
    linears = []
    for vehicle in vehicles:
        if vehicle not in known:
            known[vehicle] = linearize(vehicle, speed, gap)
        linears.append(known[vehicle])
    return stability.Chain(tuple(linears))


def _critical_parameter(linear: Linear, parameter: str) -> float:
    """See `Linear.critical`."""
    from scipy.optimize import brentq

    vehicle, model = linear.vehicle, linear.vehicle.model
    if parameter not in model.law.parameters:
        raise unknown_name(f"parameter of {model.name}", parameter, model.law.parameters)
    # a law that reacts neither to the gap nor to its own speed alone rests at every gap: then the gap stays
    fixed_gap = linear.gap if not linear.partials.get("s") and not linear.partials.get("v") else None

    def least(value: float) -> float:
        try:
            other = linearize(
                dataclasses.replace(vehicle, model=model.replace(**{parameter: value})), linear.speed, fixed_gap
            )
        except HeadwayError:
            return math.nan
        return min(other.margin, other.decay_rate)

    info, now = model.law.parameters[parameter].info, model.parameters[parameter]
    low, high = max(info.low, -1e3), min(info.high, 1e3)
    values = np.unique(np.append(np.linspace(low, high, 200), now))
    if high > 0:
        values = np.union1d(values, np.geomspace(max(low, 1e-3 * high), high, 100))
    verdicts = np.array([least(float(v)) for v in values])
    here = int(np.searchsorted(values, now))
    candidates = []
    for step in (1, -1):
        i = here
        while 0 <= i + step < values.size:
            a, b = verdicts[i], verdicts[i + step]
            if np.isfinite(a) and np.isfinite(b) and (a < 0) != (b < 0):
                lo, hi = sorted((float(values[i]), float(values[i + step])))
                candidates.append(float(brentq(least, lo, hi, xtol=1e-12)))
                break
            i += step
    return min(candidates, key=lambda v: abs(v - now), default=math.nan)
