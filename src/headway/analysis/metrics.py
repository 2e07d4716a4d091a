"""Measures of trajectories: DataArray in, DataArray out, any extra dimensions kept.

Extremes are refined between samples, see `headway.analysis.extremes`. Measures that take a whole dataset live in
files of their own, one a subject, and are found here too.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from headway.analysis.comfort import jerk, jerk_share, peak_jerk, rms_acceleration, rms_jerk
from headway.analysis.decay import l2_ratio, linf_ratio, logarithmic_decrement, overshoot, settling_time
from headway.analysis.energy import RoadLoad, combustion_energy, electric_energy, fuel, kamal
from headway.analysis.extremes import Array, Bounds, amplitude_of, extreme_of, peak_of, rms_of
from headway.analysis.growth import (
    amplitude_growth,
    describing_function,
    fundamental,
    harmonic_distortion,
    phase_lag,
    time_lag,
)
from headway.analysis.measuring import bounds
from headway.analysis.safety import (
    collided,
    collisions,
    cpi,
    drac,
    least_gap,
    mdrac,
    picud,
    rss_margin,
    tet,
    time_to_collision,
    tit,
    ttc,
)
from headway.analysis.spacing import least_time_gap, steady_error, throughput, time_gap
from headway.errors import HeadwayError

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "RoadLoad", "amplitude", "amplitude_growth", "amplitude_ratio", "collided", "collisions", "combustion_energy",
    "cpi", "describing_function", "drac", "electric_energy", "fuel", "fundamental", "harmonic_distortion", "jerk",
    "jerk_share", "kamal", "l2_ratio", "least", "least_gap", "least_time_gap", "linf_ratio", "logarithmic_decrement",
    "mdrac", "overshoot", "peak", "peak_jerk", "phase_lag", "picud", "rms", "rms_acceleration", "rms_jerk",
    "rss_margin", "settling_time", "steady_error", "summary", "tet", "throughput", "time_gap", "time_lag",
    "time_to_collision", "tit", "ttc",
]  # fmt: skip


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
