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

import cmath
import functools
import math
import warnings
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from headway.checked import typed
from headway.errors import HeadwayError, HeadwayWarning, LeaderHeardError
from headway.models import Law, Model
from headway.scenario.vehicle import Vehicle
from headway.theory import critical as critical_values
from headway.theory import gain as gains
from headway.theory.corners import corner, rests
from headway.theory.margins import Margins, margins
from headway.theory.propagation import Propagation, Saddle, Verdict, classify, growth_rate, saddles
from headway.theory.quasipolynomial import QuasiPolynomial
from headway.theory.response import Response
from headway.theory.roots import Roots, chain_abscissa, rightmost
from headway.theory.transfer import Parts, parts

__all__ = ["Linear", "linearize"]

Damping = Literal["undamped", "underdamped", "critically damped", "overdamped"]


@typed
def linearize(vehicle: Vehicle | Model | Law, speed: float, gap: float | None = None) -> Linear:
    """Linear theory of a vehicle in equilibrium; a `HeadwayWarning` says where its law has a corner or a jump there.

    Args:
        vehicle: a vehicle, or a law or model without delays.
        speed: [m/s] at which everybody drives, at least 0.
        gap: [m] above 0, needed where every gap is an equilibrium (GMM); else it follows from the speed.

    Raises:
        HeadwayError: without an equilibrium there, or without a finite derivative at it.
    """
    car = vehicle if isinstance(vehicle, Vehicle) else Vehicle(vehicle)
    s = car.model.equilibrium_gap(speed) if gap is None else float(gap)
    if s <= 0:
        raise HeadwayError(f"gap = {s:g} m is not positive")
    if gap is not None and not rests(car.model, float(speed), s):
        raise HeadwayError(
            f"{car.model.name} does not rest at {speed:g} m/s and {s:g} m: it accelerates by "
            f"{float(car.model.at_rest(s, float(speed))):.3g} m/s²; leave the gap to it"
        )
    linear = _linear(car, float(speed), s)
    if sentence := corner(car.model, linear.speed, s, linear.partials):
        warnings.warn(sentence, HeadwayWarning, stacklevel=2)
    return linear


def _linear(car: Vehicle, speed: float, s: float) -> Linear:
    slopes = car.model.partials(speed, s)
    for name, value in slopes.items():
        if not math.isfinite(value):
            raise HeadwayError(
                f"{car.model.name} is not differentiable at {speed:g} m/s and {s:g} m: "
                f"its derivative by {name} is {value}"
            )
    if slopes.get("a", 0.0) == 1.0 and car.lag == 0.0 and car.perception.delay("a") == 0.0:
        raise HeadwayError(
            f"{car.model.name} hears its own acceleration at once with a gain of 1: what it commands is not defined; "
            "give the vehicle a lag or delay.a"
        )
    return Linear(car, speed, s, tuple(slopes.items()))


@dataclass(frozen=True)
class Linear:
    """Linear theory at an equilibrium, as `linearize` returns it: SI units, angular frequencies in rad/s.

    Attributes:
        vehicle: the vehicle with its law, delays and lag.
        speed: of the equilibrium [m/s].
        gap: of the equilibrium [m].
        slopes: (signal, partial derivative) of the law, as `partials` by name.
    """

    vehicle: Vehicle
    speed: float
    gap: float
    slopes: tuple[tuple[str, float], ...]

    @property
    def partials(self) -> dict[str, float]:
        """Partial derivatives of the law by signal: `s` [1/s²]; `v dv vl v0l` [1/s]; `a al a0l` [1]."""
        return dict(self.slopes)

    @functools.cached_property
    def _loop(self) -> float:
        """1 - f_a, by which a law that hears its own acceleration is divided; NaN where that is 0."""
        return 1.0 - self.partials.get("a", 0.0) or math.nan

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
    def eigenvalues(self) -> tuple[complex, complex]:
        """λ1, λ2 = ω0 (-ξ ± sqrt(ξ² - 1)) [1/s] of the law without delay and lag (the paper's eq. sol-lambda)."""
        f = self.partials
        half = -0.5 * (f.get("dv", 0.0) - f.get("v", 0.0)) / self._loop
        spread = cmath.sqrt(half * half - f.get("s", 0.0) / self._loop)
        return half + spread, half - spread

    @property
    def damping_class(self) -> Damping:
        """Class of damping of the law without delay and lag."""
        xi = self.damping_ratio
        if xi <= 0:
            return "undamped"
        if abs(xi - 1.0) < 1e-9:
            return "critically damped"
        return "underdamped" if xi < 1 else "overdamped"

    # -- transfer functions ----------------------------------------------------------------------

    @functools.cached_property
    def parts(self) -> Parts:
        """Numerators, denominator and the two halves of the vehicle's own loop."""
        return parts(self.partials, self.vehicle.perception, self.vehicle.lag)

    @property
    def characteristic(self) -> QuasiPolynomial:
        """D(p), without the factor p that a law has which rests at every gap."""
        return self.parts.bottom

    @property
    def numerator(self) -> QuasiPolynomial:
        """N(p), without the same factor p."""
        return self.parts.top

    @property
    def leader_numerator(self) -> QuasiPolynomial:
        """Numerator of the answer to the platoon leader's speed; empty for laws that do not hear it."""
        return self.parts.leader

    def transfer(self, p: Any) -> Any:
        """Return G(p), own speed over the speed of the vehicle ahead, at complex `p` [1/s] of any shape."""
        return self.numerator(p) / self.characteristic(p)

    def gain(self, omega: Any) -> Any:
        """Return |G(iω)| [1] at `omega` [rad/s] of any shape."""
        return np.abs(self.transfer(1j * np.asarray(omega, dtype=float)))

    def phase_lag(self, omega: Any) -> Any:
        """Return the angle [rad] by which own speed lags, unwrapped from 0 at ω → 0; `omega` [rad/s] of any shape."""
        w = np.atleast_1d(np.asarray(omega, dtype=float))
        fine = np.unique(np.concatenate((np.geomspace(1e-4, max(w.max(), 1e-3), 4000), w)))
        angle = -np.unwrap(np.angle(self.transfer(1j * fine)))
        angle -= 2 * np.pi * np.round(angle[0] / (2 * np.pi))
        return np.interp(w, fine, angle).reshape(np.shape(omega))

    def group_delay(self, omega: Any) -> Any:
        """Return -d arg G / dω [s], how much later a vehicle repeats the one ahead, at `omega` [rad/s] of any shape."""
        p = 1j * np.asarray(omega, dtype=float)
        top, bottom = self.numerator, self.characteristic
        return np.real(-(top.derivative(p) / top(p) - bottom.derivative(p) / bottom(p)))

    def gap_response(self, omega: Any) -> Any:
        """Return the complex gap amplitude per speed amplitude ahead, (1 - G)/p [s]; `omega` [rad/s] of any shape."""
        p = 1j * np.asarray(omega, dtype=float)
        return (1.0 - self.transfer(p)) / p

    def steady_response(self, amplitude: float, omega: float) -> tuple[float, float]:
        """Return (A, B) [m] of the gap A cos ωt + B sin ωt behind a leader with speed `amplitude` [m/s] · cos ωt."""
        y = complex(self.gap_response(omega)) * amplitude
        return y.real, -y.imag

    @functools.cached_property
    def roots(self) -> Roots:
        """The rightmost characteristic roots [1/s], their residual and the number of collocation nodes."""
        return rightmost(self.characteristic)

    @property
    def rightmost_root(self) -> complex:
        """The rightmost characteristic root [1/s]; -inf where there are no roots."""
        return complex(self.roots.roots[0]) if self.roots.roots.size else complex(-math.inf)

    @functools.cached_property
    def decay_rate(self) -> float:
        """Rate [1/s] at which a small disturbance of one vehicle dies down; negative if it grows, 0 if it stays.

        It belongs to the rightmost root, or to the chain of roots of a law that hears its own acceleration late.
        """
        return -max(self.rightmost_root.real, chain_abscissa(self.characteristic))

    @property
    def locally_stable(self) -> bool:
        """Whether a small disturbance of one vehicle dies down."""
        return self.decay_rate > 0.0

    # -- string stability ------------------------------------------------------------------------

    @property
    def hears_leader(self) -> bool:
        """Whether the law reacts to the platoon leader, so that growth from vehicle to vehicle is not one number."""
        return self.leader_numerator.power.size > 0

    def refuse_without_leader(self, what: str) -> None:
        """Raise `LeaderHeardError` where `what` is no property of one vehicle, because it hears the platoon leader."""
        if self.hears_leader:
            raise LeaderHeardError(
                f"{what}: {self.vehicle.model.name} hears the platoon leader, so no growth per vehicle is defined; "
                "ask head_to_tail([vehicle] * n, speed) for a platoon"
            )

    @functools.cached_property
    def spectrum(self) -> gains.Spectrum:
        """Margin and peak gain of G from one sweep; `LeaderHeardError` for a law that hears the platoon leader."""
        self.refuse_without_leader("string stability of one vehicle")
        return gains.spectrum(self.numerator, self.characteristic)

    @property
    def peak(self) -> gains.Peak:
        """The largest |G(iω)| over all frequencies and where it is."""
        return self.spectrum.peak

    @property
    def peak_gain(self) -> float:
        """sup |G(iω)|; 1 where no frequency is amplified (G(0) = 1), infinite if locally unstable.

        It is at most 1 exactly where the vehicle, if locally stable, is `string_stable`.
        """
        peak = self.peak
        return peak.gain if self.locally_stable else math.inf

    @property
    def peak_frequency(self) -> float:
        """Frequency [rad/s] of the peak gain; 0 where that is the limit of long waves, inf where of short ones."""
        return self.peak.frequency

    @property
    def string_stable(self) -> bool:
        """Strictly (L2) string stable: locally stable and |G(iω)| <= 1 at every frequency."""
        stable = self.spectrum.stable
        return stable and self.locally_stable

    @property
    def margin(self) -> float:
        """min over ω of (|D|² - |N|²)/ω², both limits included: negative where a frequency is amplified.

        -inf where waves shorter than any delay and lag are.
        """
        return self.spectrum.margin

    @property
    def long_wave(self) -> float:
        """C in |G|^-2 = 1 + ω² C / f_s² + O(ω⁴) [1/s²] (f_dv in the place of f_s where that is 0).

        Negative: long waves grow. Positive is necessary for string stability and not sufficient.
        """
        self.refuse_without_leader("long waves from vehicle to vehicle")
        return gains.long_wave(self.numerator, self.characteristic)

    @functools.cached_property
    def response(self) -> Response:
        """Response in time to the speed of the vehicle ahead."""
        return Response(self.numerator, self.characteristic)

    def impulse_response(self, t: Any) -> Any:
        """Return g(t) [1/s] at times `t` [s] of any shape: speed after a unit impulse of the speed ahead, 0 for t < 0.

        Dirac impulses, which G passes on at infinite frequency, are left out; `direct` has them.
        """
        return self.response.impulse(t)

    def step_response(self, t: Any) -> Any:
        """Return the speed [1] at times `t` [s] of any shape after a unit step of the speed ahead at t = 0."""
        return self.response.step(t)

    @property
    def direct(self) -> tuple[tuple[float, float], ...]:
        """(delay [s], weight) of the Dirac impulses in the impulse response; of echoes the first 200."""
        return self.response.direct

    @functools.cached_property
    def impulse_norm(self) -> float:
        """‖g‖₁, `direct` included: how much larger the largest speed deviation can become per vehicle (>= G(0) = 1).

        It is the total variation of the step response, to about 1e-9; infinite if locally unstable.
        """
        self.refuse_without_leader("growth of a peak from vehicle to vehicle")
        return self.response.variation() if self.locally_stable else math.inf

    @property
    def peak_stable(self) -> bool:
        """L∞ string stable: no peak of speed grows from vehicle to vehicle, ‖g‖₁ <= 1 + 1e-8 (so g >= 0).

        Stricter than `string_stable`: a follower that swings through may amplify no frequency and still a peak.
        """
        return self.impulse_norm <= 1.0 + 1e-8

    @functools.cached_property
    def _saddles(self) -> tuple[Saddle, ...]:
        peaks = [] if self.string_stable else gains.amplified(self.numerator, self.characteristic)
        omega = gains.grid(self.numerator, self.characteristic)
        return saddles(self.numerator, self.characteristic, peaks, self.peak_gain, self.long_wave, omega)

    def propagation(self) -> Propagation:
        """Return whether and where a disturbance of a long string of such vehicles grows: convective or absolute."""
        self.refuse_without_leader("the spread of a wave")
        verdict: Verdict = (
            "locally unstable" if not self.locally_stable else "stable" if self.string_stable else "unstable"
        )
        branches = self._saddles if self.locally_stable else ()
        return classify(branches, self.speed, self.gap + self.vehicle.length, verdict)

    def growth(self, ray: Any) -> Any:
        """Return the growth rate σ [1/s] on rays of `ray` vehicles per second of any shape (`Propagation`).

        -inf on rays on which nothing arrives, NaN if locally unstable or where no saddle can be followed.
        """
        if not self.locally_stable:
            return np.full(np.shape(ray), np.nan)[()]
        return growth_rate(self._saddles, ray)

    @functools.cached_property
    def margins(self) -> Margins:
        """Gain, phase and delay margin of the vehicle's own loop, with their frequencies."""
        if not self.locally_stable:
            return Margins(*[math.nan] * len(Margins._fields))
        return margins(self.parts.feedback, self.parts.plant, gains.grid(self.numerator, self.characteristic))

    @property
    def gain_margin(self) -> float:
        """Factor by which all reactions may grow before local stability is lost (`Margins.gain`)."""
        return self.margins.gain

    @property
    def phase_margin(self) -> float:
        """Angle [rad] by which the loop may lag more (`Margins.phase`)."""
        return self.margins.phase

    @property
    def delay_margin(self) -> float:
        """Time [s] by which the actuator may act later (`Margins.delay`)."""
        return self.margins.delay

    def slowed(self, factor: float) -> Linear:
        """Return the vehicle with all delays times `factor`; if it has none, all on-board signals `factor` s late."""
        return critical_values.slowed(self, factor)

    def critical_delay(self, kind: str) -> float:
        """Return the first delay [s] at which the verdict `kind` ("local" or "string") is lost.

        The pattern of late signals is scaled; where none is late, all on-board signals become late alike. The
        value is the longest delay of the pattern: 0 if no delay, however short, is borne; infinite if 200 s are.
        """
        return critical_values.critical_delay(self, kind)

    def critical_delays(self) -> dict[str, float]:
        """Return the critical delays [s] by kind; "string" is NaN for a law that hears the platoon leader."""
        return {
            "local": self.critical_delay("local"),
            "string": math.nan if self.hears_leader else self.critical_delay("string"),
        }

    def why_none(self, kind: str) -> str:
        """Say why the critical delay `kind` is 0 for a vehicle that is stable without delay; else empty."""
        return critical_values.why_none(self, kind)

    def critical(self, parameter: str) -> float:
        """Return the value of a parameter, nearest to the present one, at which the string verdict changes; else NaN.

        All other parameters, the delays and the speed stay; the equilibrium gap follows.
        """
        return critical_values.critical_parameter(self, parameter, _linear)

    def _repr_html_(self) -> str:
        from headway.theory.notebook import linear_html

        return linear_html(self)
