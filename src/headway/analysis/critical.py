"""The value of a parameter at which the string verdict changes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from headway.analysis.search import root
from headway.errors import HeadwayError, unknown_name
from headway.scenario.vehicle import Vehicle

if TYPE_CHECKING:
    from headway.analysis.linear import Linear

__all__ = ["critical_parameter"]


def critical_parameter(linear: Linear, parameter: str, linearized: Callable[[Vehicle, float, float], Linear]) -> float:
    """See `Linear.critical`; `linearized` makes the theory of a vehicle at a speed and a gap."""
    vehicle, model = linear.vehicle, linear.vehicle.model
    if parameter not in model.law.parameters:
        raise unknown_name(f"parameter of {model.name}", parameter, model.law.parameters)
    fixed_gap = linear.gap if model.rests_everywhere else None

    def least(value: float) -> float:
        try:
            changed = dataclasses.replace(vehicle, model=model.replace(**{parameter: value}))
            gap = fixed_gap if fixed_gap is not None else changed.model.equilibrium_gap(linear.speed)
            other = linearized(changed, linear.speed, gap)
        except HeadwayError:
            return math.nan
        return other.margin if other.margin < 0.0 else min(other.margin, other.decay_rate)

    info, now = model.law.parameters[parameter].info, model.parameters[parameter]
    low, high = max(info.low, -1e3), min(info.high, 1e3)
    values = np.unique(np.append(np.linspace(low, high, 200), now))
    if high > 0:
        values = np.union1d(values, np.geomspace(max(low, 1e-3 * high), high, 100))
    here = int(np.searchsorted(values, now))
    candidates = []
    for side in (values[here:], values[here::-1]):
        known = [(float(side[0]), least(float(side[0])))]
        for value in side[1:].tolist():
            known.append((value, least(value)))
            (a, fa), (b, fb) = known[-2:]
            if math.isfinite(fa) and math.isfinite(fb) and (fa < 0) != (fb < 0):
                candidates.append(root(least, a, b, 1e-12))
                break
    return min(candidates, key=lambda v: abs(v - now), default=math.nan)
