"""What is fitted: parameters of a law, reaction delay and actuator lag, between bounds."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from headway.arrays import Array
from headway.errors import HeadwayError, unknown_name
from headway.models import Law, Model
from headway.scenario.reception import Perception
from headway.scenario.vehicle import Vehicle

__all__ = ["OWN_BOUNDS", "Space"]

#: bounds [s] of what is no parameter of the law
OWN_BOUNDS = {"delay": (0.0, 3.0), "lag": (0.0, 2.0)}

#: a positive range wider than this is searched by its logarithm
_WIDE = 100.0


@dataclass(frozen=True)
class Space:
    """The p quantities of a vehicle that are fitted, between bounds; candidates are points of the unit cube.

    Attributes:
        vehicle: the vehicle, whose other values stay.
        names: (p,) names of the quantities.
        low: (p,) lower bounds, SI.
        high: (p,) upper bounds, SI.
    """

    vehicle: Vehicle
    names: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]

    @classmethod
    def of(
        cls,
        model: Vehicle | Model | Law,
        fit: Sequence[str] | None = None,
        bounds: Mapping[str, tuple[float, float]] | None = None,
    ) -> Space:
        """The fitted quantities of a law, bounded as it annotates them.

        Args:
            model: a law, a model or a vehicle.
            fit: names of the quantities; if None all parameters but structural ones, and the delay.
            bounds: name → (low, high) [SI] instead of the law's own.

        Raises:
            HeadwayError: for a name that is not there, twice or unbounded, and for bounds outside the law's.
        """
        car = model if isinstance(model, Vehicle) else Vehicle(model)
        law: Law = car.model.law
        if fit is None:
            fit = (*(n for n, p in law.parameters.items() if not p.info.structural), "delay")
        names = tuple(fit)
        allowed = [*law.parameters, *(n for n in OWN_BOUNDS if n not in law.parameters)]
        for name in names:
            if name not in allowed:
                raise unknown_name(f"quantity to fit of {law.name}", name, allowed)
        if not names or len(set(names)) < len(names):
            raise HeadwayError(f"fit = {', '.join(names) or 'nothing'}: name one or more different quantities")
        for name in bounds or {}:
            if name not in names:
                raise unknown_name("bounds of a quantity that is fitted", name, names)
        limits = [_bounds(law, name, (bounds or {}).get(name)) for name in names]
        return cls(car, names, tuple(a for a, _ in limits), tuple(b for _, b in limits))

    @functools.cached_property
    def logarithmic(self) -> NDArray[np.bool_]:
        """Which quantities are searched by their logarithm: positive ones over more than two decades."""
        return np.array([a > 0 and b / a >= _WIDE for a, b in zip(self.low, self.high, strict=True)])

    def values(self, unit: Array) -> Array:
        """Quantities (p, …) at points (p, …) of the unit cube."""
        low, high, log = (
            np.array(x).reshape(-1, *([1] * (unit.ndim - 1))) for x in (self.low, self.high, self.logarithmic)
        )
        with np.errstate(all="ignore"):
            return np.clip(np.where(log, low * (high / low) ** unit, low + (high - low) * unit), low, high)

    def unit(self, values: Array) -> Array:
        """Points (p, …) of the unit cube for quantities (p, …)."""
        low, high, log = (
            np.array(x).reshape(-1, *([1] * (values.ndim - 1))) for x in (self.low, self.high, self.logarithmic)
        )
        with np.errstate(all="ignore"):
            return np.clip(
                np.where(log, np.log(values / low) / np.log(high / low), (values - low) / (high - low)), 0, 1
            )

    @functools.cached_property
    def pattern(self) -> dict[str, tuple[float, float]]:
        """Delays of both halves of each signal per second of fitted delay: the vehicle's pattern, or all alike."""
        law, own = self.vehicle.model.law, self.vehicle.perception
        perception = own if own.longest > 0 else Perception.of(law.name, law.signals, 1.0)
        unit = own.longest if own.longest > 0 else 1.0
        halves = {name: perception.halves(name) for name in law.signals}
        return {name: (first.delay / unit, second.delay / unit) for name, (first, second) in halves.items()}

    def make(self, values: Sequence[float] | Array) -> Vehicle:
        """The vehicle with these values (p,) of the fitted quantities."""
        quantities = {n: float(x) for n, x in zip(self.names, values, strict=True)}
        own = {
            n: quantities.pop(n) for n in OWN_BOUNDS if n in quantities and n not in self.vehicle.model.law.parameters
        }
        changes: dict[str, Any] = {"model": self.vehicle.model.replace(**quantities)}
        if "lag" in own:
            changes["lag"] = own["lag"]
        if "delay" in own:
            changes["delay"] = self._delay(own["delay"])
        return dataclasses.replace(self.vehicle, **changes)

    def _delay(self, seconds: float) -> Any:
        delay = self.vehicle.delay
        longest = self.vehicle.perception.longest
        if isinstance(delay, float) or longest == 0:
            return seconds
        return {n: seconds * t / longest for n, t in delay}


def _bounds(law: Law, name: str, bounds: tuple[float, float] | None) -> tuple[float, float]:
    own = law.parameters.get(name)
    low, high = OWN_BOUNDS[name] if own is None else (own.info.low, own.info.high)
    if bounds is None:
        if not (math.isfinite(low) and math.isfinite(high)):
            raise HeadwayError(
                f"{law.name}.{name} has no finite bounds ({own.range if own else ''}); give some, e.g. "
                f"bounds={{{name!r}: (0, 10)}}"
            )
        return low, high
    a, b = (float(x) for x in bounds)
    least, most = (0.0, math.inf) if own is None else (low, high)
    if not (math.isfinite(a) and math.isfinite(b) and least <= a < b <= most):
        raise HeadwayError(
            f"bounds of {name} = {a:g} to {b:g} are not allowed; a range within {least:g} to {most:g} is"
        )
    return a, b
