"""Critical values: the delay at which a verdict is lost, and the value of a parameter at which one changes.

A critical delay keeps the vehicle's pattern of late signals and scales it. The number is the longest
delay of the pattern. It is 0 where any delay, however short, loses the verdict: a law that hears its
own acceleration late with a gain of 1 or more has an endless chain of growing roots at every delay,
and waves shorter than any delay hear its leading terms at any phase.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from headway.errors import HeadwayError, unknown_name
from headway.scenario.vehicle import Vehicle
from headway.theory.gain import TOLERANCE, tail
from headway.theory.quasipolynomial import QuasiPolynomial
from headway.theory.roots import chain_abscissa
from headway.theory.scalar import least_point, root

if TYPE_CHECKING:
    from headway.theory.linear import Linear

__all__ = ["LONGEST", "Kind", "critical_delay", "critical_parameter", "longest_delay", "slowed", "why_none"]

Array = NDArray[np.float64]
Kind = Literal["local", "string"]

#: longest delay [s] up to which a critical one is looked for
LONGEST = 200.0


# -- delays ----------------------------------------------------------------------------------------


def slowed(linear: Linear, factor: float) -> Linear:
    """Return the vehicle with all its delays scaled.

    Args:
        linear: the vehicle.
        factor: what its delays are multiplied by, at least 0; where it has none, the delay [s] of all on-board signals.
    """
    return dataclasses.replace(linear, vehicle=dataclasses.replace(linear.vehicle, delay=_pattern(linear, factor)))


def _pattern(linear: Linear, factor: float) -> Any:
    delay = linear.vehicle.delay
    if isinstance(delay, float):
        return factor * delay if delay > 0 else factor
    if any(t > 0 for _, t in delay):
        return {n: factor * t for n, t in delay}
    return factor


def longest_delay(linear: Linear) -> float:
    """Return the longest delay [s] of the pattern that `slowed` scales, at the factor 1."""
    return slowed(linear, 1.0).vehicle.perception.longest


def critical_delay(linear: Linear, kind: str) -> float:
    """Return the first delay [s] at which a verdict is lost; see `Linear.critical_delay`.

    Args:
        linear: the vehicle, whose pattern of delays is scaled.
        kind: "local" or "string".

    Returns:
        The longest delay of the pattern, from 0 on; infinite where none up to `LONGEST` loses the verdict.

    Raises:
        HeadwayError: for another kind.
        LeaderHeardError: for "string" and a law that hears the platoon leader.
    """
    if kind not in ("local", "string"):
        raise unknown_name("kind of critical delay", kind, ("local", "string"))
    if kind == "string":
        linear.refuse_without_leader("critical delay of string stability")
    unit = longest_delay(linear)
    if unit == 0.0:  # nothing on board to be late
        still = slowed(linear, 0.0)
        return math.inf if (still.locally_stable if kind == "local" else still.string_stable) else 0.0
    return _critical_factor(linear, kind, unit) * unit


def why_none(linear: Linear, kind: str) -> str:
    """Say in words why a critical delay is 0 although the vehicle is stable without delay.

    Args:
        linear: the vehicle.
        kind: "local" or "string".

    Returns:
        The reason; empty where the vehicle is unstable without delay, or the critical delay is not 0.
    """
    still, late = slowed(linear, 0.0), slowed(linear, 1.0)
    if not (still.locally_stable if kind == "local" else still.string_stable):
        return ""
    if chain_abscissa(late.characteristic) >= 0.0:
        gain = abs(linear.partials.get("a", 0.0))
        return f"its own acceleration comes back late with a gain of {gain:.3g}, 1 or more"
    if kind == "string" and (limit := tail(late.numerator, late.characteristic).limit) > 1.0:
        return f"however short the delay, short waves then grow up to {limit:.3g} times per vehicle"
    return ""


def _critical_factor(linear: Linear, kind: str, unit: float) -> float:
    """Return the first factor of the pattern of delays, its longest `unit` [s], at which a verdict is lost."""
    still, late = slowed(linear, 0.0), slowed(linear, 1.0)
    local = _critical_local(linear, still, late, unit)
    if kind == "local":
        return local
    if local == 0.0 or not still.string_stable:
        return 0.0
    # the limit of short waves does not depend on how late signals are, only on whether they are
    if tail(late.numerator, late.characteristic).limit > 1.0:
        return 0.0

    def smallest(factor: float) -> float:
        return slowed(linear, factor).margin

    end = min(local, LONGEST / unit)
    steps = np.unique(np.concatenate((np.geomspace(1e-3 / unit, end, 60), np.linspace(0.0, end, 61)[1:])))
    crossing = _first_sign_change(smallest, steps[steps <= end], TOLERANCE)
    return crossing if crossing is not None else local


def _critical_local(linear: Linear, still: Linear, late: Linear, unit: float) -> float:
    if not still.locally_stable or chain_abscissa(late.characteristic) >= 0.0:
        return 0.0
    characteristic = late.characteristic
    if not characteristic.delays:
        return math.inf
    if len(characteristic.delays) == 1:
        # only a delay of the vehicle's own loop counts, which need not be the longest of the pattern
        return _crossing(characteristic) / characteristic.delays[0]

    def damping(factor: float) -> float:
        return slowed(linear, factor).decay_rate

    crossing = _first_sign_change(damping, np.geomspace(1e-3, LONGEST / unit, 120), 0.0)
    return math.inf if crossing is None else crossing


def _first_sign_change(f: Callable[[float], float], at: Array, slack: float) -> float | None:
    """Return the first root of `f` between rising places where it falls below -slack, or None.

    Dips between the places are refined: a verdict may be lost there and regained.
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
    """Return the place of the least value between `a` and `b`, or None unless that value is less than `below`."""
    value, place = least_point(f, a, b)
    return place if value < below else None


def _crossing(characteristic: QuasiPolynomial) -> float:
    """Return the least delay [s] with P(iω) + Q(iω) e^{-iωτ} = 0, exactly: |P|² = |Q|² is a polynomial in ω."""
    (delay,) = characteristic.delays
    now, late = characteristic.polynomial(0.0), characteristic.polynomial(delay)

    def squared(c: Array) -> Array:
        turned = c * 1j ** np.arange(c.size - 1, -1, -1)
        return np.real(np.polymul(turned, np.conj(turned)))

    roots = np.roots(np.trim_zeros(np.polysub(squared(now), squared(late)), "f"))
    crossings = roots[(np.abs(roots.imag) < 1e-9 * (1.0 + np.abs(roots))) & (roots.real > 1e-12)].real
    delays = [float(np.angle(-np.polyval(late, 1j * w) / np.polyval(now, 1j * w)) % (2 * np.pi)) / w for w in crossings]
    return min(delays, default=math.inf)


# -- parameters ------------------------------------------------------------------------------------


def critical_parameter(linear: Linear, parameter: str, linearized: Callable[[Vehicle, float, float], Linear]) -> float:
    """Return the value of a parameter, nearest to the present one, at which the string verdict changes.

    Args:
        linear: the vehicle.
        parameter: name of a parameter of its law.
        linearized: the linear theory of a vehicle at a speed [m/s] and a gap [m].

    Returns:
        The value in the parameter's unit; NaN where no allowed value changes the verdict.

    Raises:
        HeadwayError: for an unknown parameter.
        LeaderHeardError: for a law that hears the platoon leader.
    """
    vehicle, model = linear.vehicle, linear.vehicle.model
    if parameter not in model.law.parameters:
        raise unknown_name(f"parameter of {model.name}", parameter, model.law.parameters)
    linear.refuse_without_leader(f"critical {parameter}")
    fixed_gap = linear.gap if model.rests_everywhere else None

    def decision(value: float) -> float:
        try:
            changed = dataclasses.replace(vehicle, model=model.replace(**{parameter: value}))
            gap = fixed_gap if fixed_gap is not None else changed.model.equilibrium_gap(linear.speed)
            other = linearized(changed, linear.speed, gap)
        except HeadwayError:
            return math.nan
        # where short waves grow the margin has no bound; its sign is what is looked for
        return max(other.margin, -1e6) if other.margin < 0.0 else min(other.margin, other.decay_rate)

    info, now = model.law.parameters[parameter].info, model.parameters[parameter]
    low, high = max(info.low, -1e3), min(info.high, 1e3)
    values = np.unique(np.append(np.linspace(low, high, 200), now))
    if high > 0:
        values = np.union1d(values, np.geomspace(max(low, 1e-3 * high), high, 100))
    here = int(np.searchsorted(values, now))
    candidates = []
    for side in (values[here:], values[here::-1]):
        samples = [(float(side[0]), decision(float(side[0])))]
        for value in side[1:].tolist():
            samples.append((value, decision(value)))
            (a, fa), (b, fb) = samples[-2:]
            if math.isfinite(fa) and math.isfinite(fb) and (fa < 0) != (fb < 0):
                candidates.append(root(decision, a, b, 1e-12))
                break
    return min(candidates, key=lambda v: abs(v - now), default=math.nan)
