"""The size of any variable over time: peak, root mean square, amplitude, least; and a summary of a run.

DataArray in, DataArray out, any extra dimensions kept. Extremes are refined between samples, see
`headway.metrics.extremes`. Of the signals that a study can keep without their trajectories, each size is a
metric by name, such as `peak_spacing_error`.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import numpy as np

from headway.arrays import Array
from headway.engine.measured import QUANTITIES
from headway.errors import HeadwayError, shorten
from headway.metrics.inputs import bounds, need_dimensions, need_variable, trajectories
from headway.metrics.reduction import FORMS, extremes
from headway.metrics.registry import METRICS, Metric, Reduced, register
from headway.schema import VARIABLES

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "COLLISION", "DEFAULT", "UNPHYSICAL", "amplitude", "amplitude_ratio", "braking_note", "braking_share",
    "least", "peak", "rms", "summary",
]  # fmt: skip

COLLISION = "collision_time"

#: what is measured of a run if nothing is asked for
DEFAULT = (
    "peak_spacing_error", "rms_spacing_error", "speed_amplitude", "speed_amplitude_ratio", "least_gap",
    "least_acceleration", COLLISION,
)  # fmt: skip

#: decelerations [m/s²] above this are beyond the brakes and tyres of any car on the road
UNPHYSICAL = 10.0


def peak(values: xr.DataArray) -> xr.DataArray:
    """Largest magnitude over time, in the unit of the values, >= 0.

    Args:
        values: one variable of a run, with the dimension time; NaN samples are left out.
    """
    return _over_time(values, "peak_{}")


def rms(values: xr.DataArray) -> xr.DataArray:
    """Root of the mean square over time (trapezoid rule), in the unit of the values, >= 0.

    Args:
        values: one variable of a run, with the dimension time; NaN samples are left out.
    """
    return _over_time(values, "rms_{}")


def amplitude(values: xr.DataArray) -> xr.DataArray:
    """Half the range over time, in the unit of the values, >= 0.

    Args:
        values: one variable of a run, with the dimension time; NaN samples are left out.
    """
    return _over_time(values, "{}_amplitude")


def least(values: xr.DataArray) -> xr.DataArray:
    """Least value over time, in the unit of the values.

    Args:
        values: one variable of a run, with the dimension time; NaN samples are left out.
    """
    return _over_time(values, "least_{}")


def amplitude_ratio(values: xr.DataArray) -> xr.DataArray:
    """Amplitude of each vehicle over that of the vehicle ahead [1] >= 0.

    Args:
        values: one variable of a run, with the dimensions vehicle and time.

    Returns:
        One value a vehicle; NaN for the leader, behind a steady vehicle, and for vehicles whose record ends early
        (after a collision).
    """
    return _over_time(values, "{}_amplitude_ratio")


def summary(dataset: xr.Dataset) -> xr.Dataset:
    """The metrics of `headway run`, one value a vehicle.

    Args:
        dataset: trajectories of a run, or a `Recording`.

    Returns:
        Peak and r.m.s. spacing error [m], speed amplitude [m/s] and its ratio to the vehicle ahead, least acceleration
        (the hardest braking) [m/s²], least gap [m], time of collision [s].
    """
    import xarray as xr

    data = trajectories(dataset, "summary")
    return xr.Dataset({name: METRICS[name].of(data) for name in DEFAULT})


def braking_note(least_acceleration: Any) -> str:
    """A sentence if vehicles brake harder than any car can, else an empty one.

    Args:
        least_acceleration: least acceleration (vehicle,) [m/s²], negative while braking.
    """
    values = np.asarray(least_acceleration, dtype=float)
    beyond = np.flatnonzero(values < -UNPHYSICAL)
    if not beyond.size:
        return ""
    worst = int(np.nanargmin(values))
    count = f"{beyond.size} vehicles brake" if beyond.size > 1 else f"vehicle {worst} brakes"
    hardest = f", vehicle {worst} at {-values[worst]:.3g}" if beyond.size > 1 else f" (at {-values[worst]:.3g})"
    return (
        f"unphysical: {count} harder than {UNPHYSICAL:g} m/s²{hardest}, which no car can; "
        f"what follows from it would not happen so, and limits of the vehicles would say what does"
    )


def braking_share(least_acceleration: Any) -> str:
    """A sentence on how many points brake harder than any car can, else an empty one.

    Args:
        least_acceleration: least acceleration (…, vehicle) [m/s²], negative while braking.
    """
    values = np.asarray(least_acceleration, dtype=float)
    beyond = (values < -UNPHYSICAL).any(axis=-1)
    if not beyond.any():
        return ""
    return (
        f"unphysical: in {int(beyond.sum())} of {beyond.size} points a vehicle brakes harder than {UNPHYSICAL:g} m/s² "
        f"(at {-float(np.nanmin(values)):.3g} at most), which no car can"
    )


def _over_time(values: xr.DataArray, form: str) -> xr.DataArray:
    import xarray as xr

    name = form.format("").strip("_")
    if not isinstance(values, xr.DataArray):
        raise HeadwayError(
            f"{name} needs one variable of a run, such as run.speed; {shorten(values, 40)} is a {type(values).__name__}"
        )
    needed = ("vehicle", "time") if form.endswith("ratio") else ("time",)
    need_dimensions(values, needed, name, "this array")
    return _sized(values, form)


def _sized(values: xr.DataArray, form: str) -> xr.DataArray:
    """One size of an array over its dimension time, by the form of its name."""
    entry = FORMS[form]
    first = ["vehicle"] if "vehicle" in values.dims else []
    ordered = values.transpose(*first, ..., "time")
    like = ordered.isel(time=0, drop=True)
    time = np.asarray(ordered["time"].values, dtype=float)
    array: Array = np.asarray(ordered.values, dtype=float)
    sizes = entry.make(extremes(time, array, entry.mode, bounds(like, str(values.name))))
    result = like.copy(data=sizes).transpose(*(d for d in values.dims if d != "time"))
    title = str(values.attrs.get("long_name", values.name or "values"))
    unit = "1" if form.endswith("ratio") else values.attrs.get("units", "1")
    result.attrs = {"units": unit, "long_name": entry.meaning.format(title)}
    return result


def _of_signal(dataset: Any, signal: str, form: str) -> xr.DataArray:
    name = form.format(signal)
    return _sized(_variable(dataset, signal, name), form).rename(name)


def _collision_time(dataset: Any) -> xr.DataArray:
    return _variable(dataset, COLLISION, COLLISION)


def _variable(dataset: Any, variable: str, metric: str) -> xr.DataArray:
    data = trajectories(dataset, metric)
    need_variable(data, variable, metric)
    return data[variable]


for _signal in QUANTITIES:
    for _name, _form in FORMS.items():
        _variable_of = VARIABLES[_signal]
        register(Metric(
            _name.format(_signal), "1" if _name.endswith("ratio") else _variable_of.unit,
            _form.meaning.format(_variable_of.long_name), functools.partial(_of_signal, signal=_signal, form=_name),
            whose=_form.whose, reduced=Reduced(_signal, _form.mode, _form.make), family="Size",
        ))  # fmt: skip
register(Metric(
    COLLISION, VARIABLES[COLLISION].unit, VARIABLES[COLLISION].long_name, _collision_time, whose="least",
    reduced=Reduced("", 0, lambda e: e.collision), family="Size",
))  # fmt: skip
