"""What a ride costs: energy at the wheels by road load, and fuel by a polynomial.

All is made of the speeds alone: between samples speed and acceleration are their means, `(v0 + v1)/2` and
`(v1 - v0)/h`, so that kinetic energy adds up exactly, also where the acceleration jumps. Intervals of
which an end is not known (after a collision) are left out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from headway.arrays import Array
from headway.errors import HeadwayError, unknown_name
from headway.metrics.inputs import Signals, checked
from headway.metrics.registry import metric

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["RoadLoad", "combustion_energy", "electric_energy", "fuel", "kamal"]

Per = Literal["run", "distance", "leader"]

#: how far the distance of `per = "distance"` is [m], by the unit of what is spent
_FAR = {"MJ": (1e5, "MJ/100 km"), "mL": (1e3, "mL/km")}


def _unit(spent: str) -> Callable[[Mapping[str, Any]], str]:
    """The unit of what is spent `per` a run, a distance, or of what the leader spends."""
    return lambda parameters: {"run": spent, "distance": _FAR[spent][1]}.get(parameters["per"], "1")


def _meaning(what: str) -> Callable[[Mapping[str, Any]], str]:
    compared = {"distance": ", over distance", "leader": ", over that of the leader"}
    return lambda parameters: what.format(**parameters) + compared.get(parameters["per"], "")


@dataclass(frozen=True)
class RoadLoad:
    """Longitudinal forces on a level road; the defaults are a mid-size passenger car, chosen for this program.

    Attributes:
        mass: mass of the vehicle [kg] > 0.
        rotating: share of the mass that rotating parts add to its inertia, >= 0.
        drag_area: drag coefficient times frontal area, c_d A [m²] >= 0.
        rolling: coefficient of rolling resistance [1] >= 0.
        air_density: density of the air [kg/m³] >= 0.
        gravity: acceleration of gravity [m/s²] >= 0.

    Raises:
        HeadwayError: for a number out of its range.
    """

    mass: float = 1500.0
    rotating: float = 0.04
    drag_area: float = 0.66
    rolling: float = 0.010
    air_density: float = 1.2
    gravity: float = 9.81

    def __post_init__(self) -> None:
        for field in fields(self):
            value = checked("RoadLoad", field.name, getattr(self, field.name))
            allowed = "above zero" if field.name == "mass" else "zero or more"
            if value < 0 or (field.name == "mass" and value == 0):
                raise HeadwayError(f"RoadLoad: {field.name} = {value:g} is not allowed; it is {allowed}")

    def force(self, speed: Any, acceleration: Any) -> Any:
        """`F = m (1 + k_r) a + ρ c_d A v²/2 + m g c_r` [N] at the wheels; negative where it takes brakes.

        Args:
            speed: v [m/s], a number or an array.
            acceleration: a [m/s²], of a shape that fits.
        """
        inertia = self.mass * (1.0 + self.rotating) * np.asarray(acceleration)
        drag = 0.5 * self.air_density * self.drag_area * np.square(speed)
        return inertia + drag + self.mass * self.gravity * self.rolling


@metric(
    _unit("MJ"),
    _meaning("energy at the wheels, fuel cut"),
    formula="∫ max(F, 0) v dt",
    says="energy at the wheels, fuel cut while F < 0",
    whose="mean",
)
def combustion_energy(dataset: xr.Dataset, load: RoadLoad | None = None, per: Per = "run") -> xr.DataArray:
    """Energy at the wheels `∫ max(F, 0) v dt` >= 0 of a vehicle whose fuel is cut while F < 0.

    The efficiency of the engine is not in it.

    Args:
        dataset: trajectories of a run, with `speed`, or a `Recording`.
        load: the road load of all vehicles; that of `RoadLoad()` if None.
        per: `run` [MJ], `distance` [MJ/100 km], or `leader` [1], the ratio to what the leader needs while the vehicle
            is in the record.

    Returns:
        One value a vehicle; NaN where there is no distance, or where the leader needs nothing.
    """
    return _total(dataset, "combustion_energy", _propulsion(load, 0.0), per, "MJ")


@metric(
    _unit("MJ"),
    _meaning("energy at the wheels, {regeneration:.0%} of braking recovered"),
    formula="∫ (max(F, 0) + 0.6 min(F, 0)) v dt",
    says="the same with 60 % of braking recovered",
    whose="mean",
)
def electric_energy(
    dataset: xr.Dataset, load: RoadLoad | None = None, per: Per = "run", regeneration: float = 0.6
) -> xr.DataArray:
    """Energy at the wheels less what braking gives back, `∫ (max(F, 0) + η min(F, 0)) v dt`.

    Args:
        dataset: trajectories of a run, with `speed`, or a `Recording`.
        load: the road load of all vehicles; that of `RoadLoad()` if None.
        per: `run` [MJ], `distance` [MJ/100 km] or `leader` [1].
        regeneration: η, the share of the braking energy that is recovered, 0 to 1.

    Returns:
        One value a vehicle, negative for one that only brakes; NaN where there is no distance, or where the leader
        needs nothing.

    Raises:
        HeadwayError: for a share outside 0 to 1.
    """
    if not 0 <= checked("electric_energy", "regeneration", regeneration) <= 1:
        raise HeadwayError(f"electric_energy: regeneration = {regeneration:g} is not a share from 0 to 1")
    return _total(dataset, "electric_energy", _propulsion(load, regeneration), per, "MJ")


@metric(
    _unit("mL"),
    _meaning("fuel"),
    formula="∫ `kamal`(v, a) dt, the rate 0.1569 + 0.0245 v − 7.415e-4 v² + 5.975e-5 v³ "
    "+ max(a, 0)(0.07224 + 0.09681 v + 1.075e-3 v²) mL/s",
    says="fuel of a passenger car; no fuel cut",
    source="Kamal et al. 2011",
    whose="mean",
)
def fuel(dataset: xr.Dataset, per: Per = "run") -> xr.DataArray:
    """Fuel by Kamal's polynomial (see `kamal`), >= 0.

    Args:
        dataset: trajectories of a run, with `speed`, or a `Recording`.
        per: `run` [mL], `distance` [mL/km] or `leader` [1].
    """
    return _total(dataset, "fuel", kamal, per, "mL")


def kamal(speed: Any, acceleration: Any) -> Any:
    """Fuel rate [mL/s] of a passenger car on a level road.

    `0.1569 + 2.450e-2 v - 7.415e-4 v² + 5.975e-5 v³ + max(a, 0) (0.07224 + 9.681e-2 v + 1.075e-3 v²)`; no fuel cut.
    Kamal, Mukai, Murata, Kawabe, IEEE Trans. Intell. Transp. Syst. 12, 783 (2011).

    Args:
        speed: v [m/s], a number or an array.
        acceleration: a [m/s²], of a shape that fits.
    """
    v, a = np.asarray(speed, dtype=float), np.maximum(acceleration, 0.0)
    cruise = 0.1569 + v * (2.450e-2 + v * (-7.415e-4 + v * 5.975e-5))
    return cruise + a * (0.07224 + v * (9.681e-2 + v * 1.075e-3))


def _propulsion(load: RoadLoad | None, regeneration: float) -> Callable[[Array, Array], Array]:
    road = RoadLoad() if load is None else load

    def megawatts(v: Array, a: Array) -> Array:
        force = road.force(v, a)
        return 1e-6 * v * np.where(force < 0, regeneration * force, force)

    return megawatts


def _total(
    dataset: xr.Dataset, measure: str, rate: Callable[[Array, Array], Array], per: str, unit: str
) -> xr.DataArray:
    if per not in get_args(Per):
        raise unknown_name(f"{measure}: per", per, get_args(Per))
    signals = Signals(dataset, measure, "speed")
    step, speed = np.diff(signals.time), signals["speed"]
    v = 0.5 * (speed[..., :-1] + speed[..., 1:])
    spent = rate(v, np.diff(speed, axis=-1) / step) * step
    finite = np.isfinite(spent)

    def total(values: Array) -> Array:
        return np.where(finite.any(axis=-1), np.where(finite, values, 0.0).sum(axis=-1), np.nan)

    own = total(spent)
    if per == "run":
        return signals.result(own)
    if per == "distance":
        compared = total(v * step) / _FAR[unit][0]
    else:
        ahead = signals.reference(spent.swapaxes(-1, -2), "leader").swapaxes(-1, -2)
        compared = total(ahead)
    ratio = np.divide(own, compared, out=np.full_like(own, np.nan), where=compared > 0)
    return signals.result(ratio)
