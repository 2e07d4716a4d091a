"""The size of any variable over time: peak, root mean square, amplitude, least; and a summary of a run.

DataArray in, DataArray out, any extra dimensions kept. Extremes are refined between samples, see
`headway.metrics.extremes`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from headway.errors import HeadwayError
from headway.metrics.dataset import bounds
from headway.metrics.extremes import Array, Bounds, amplitude_of, extreme_of, peak_of, rms_of

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["amplitude", "amplitude_ratio", "least", "peak", "rms", "summary"]


def peak(values: xr.DataArray) -> xr.DataArray:
    """Largest magnitude over time, in the unit of `values`; NaN samples are left out."""
    return _over_time(values, peak_of, "peak of")


def rms(values: xr.DataArray) -> xr.DataArray:
    """Root of the mean square over time (trapezoid rule), in the unit of `values`; NaN samples are left out."""
    return _over_time(values, lambda time, v, _: rms_of(time, v), "r.m.s. of")


def amplitude(values: xr.DataArray) -> xr.DataArray:
    """Half the range over time, in the unit of `values`."""
    return _over_time(values, amplitude_of, "amplitude of")


def least(values: xr.DataArray) -> xr.DataArray:
    """Least value over time, in the unit of `values`."""
    return _over_time(values, lambda time, v, within: extreme_of(time, v, -1.0, within), "least")


def amplitude_ratio(values: xr.DataArray) -> xr.DataArray:
    """Amplitude of each vehicle over that of the vehicle ahead; NaN for the leader and behind a steady vehicle."""
    if "vehicle" not in values.dims:
        raise HeadwayError(f"amplitude_ratio needs the dimension vehicle; this array has {_dims(values)}")
    own = amplitude(values)
    ahead = own.shift(vehicle=1)
    meaning = f"amplitude of {_meaning(values)} over that of the vehicle ahead"
    return (own / ahead.where(ahead > 1e-12)).assign_attrs(units="1", long_name=meaning)


def summary(dataset: xr.Dataset) -> xr.Dataset:
    """Per vehicle: peak and r.m.s. spacing error [m], speed amplitude [m/s], its ratio to the vehicle ahead,
    least gap [m], time of collision [s]."""
    import xarray as xr

    for name in ("spacing_error", "speed", "gap", "collision_time"):
        if name not in dataset:
            raise HeadwayError(f"summary needs the variable {name!r}; this dataset has {', '.join(map(str, dataset))}")
    return xr.Dataset(
        {
            "peak_spacing_error": peak(dataset.spacing_error),
            "rms_spacing_error": rms(dataset.spacing_error),
            "speed_amplitude": amplitude(dataset.speed),
            "speed_amplitude_ratio": amplitude_ratio(dataset.speed),
            "least_gap": least(dataset.gap),
            "collision_time": dataset.collision_time,
        }
    )


def _over_time(values: xr.DataArray, measure: Callable[[Array, Array, Bounds], Array], what: str) -> xr.DataArray:
    if "time" not in values.dims:
        raise HeadwayError(f"a measure over time needs the dimension time; this array has {_dims(values)}")
    ordered = values.transpose(..., "time")
    like = ordered.isel(time=0, drop=True)
    within = bounds(like, str(values.name))
    found = measure(np.asarray(ordered["time"].values, dtype=float), np.asarray(ordered.values, dtype=float), within)
    result = like.copy(data=found)
    result.attrs = {"units": values.attrs.get("units", "1"), "long_name": f"{what} {_meaning(values)}"}
    return result


def _dims(values: xr.DataArray) -> str:
    return ", ".join(map(str, values.dims)) or "none"


def _meaning(values: xr.DataArray) -> str:
    return str(values.attrs.get("long_name", values.name or "values"))
