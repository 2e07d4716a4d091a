"""Where a platoon settles: steady errors, time gaps, and the flow that its spacing allows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from headway.arrays import Array
from headway.errors import HeadwayError
from headway.metrics.extremes import FROM_ZERO, extreme_of
from headway.metrics.inputs import Signals, checked
from headway.metrics.registry import metric
from headway.models import Model
from headway.sampling import trapezoid
from headway.scenario.vehicle import Vehicle

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["least_time_gap", "steady_error", "throughput", "time_gap"]


@metric(
    "signal",
    "steady {signal}",
    formula="mean over the last tenth of the record, or a `window`",
    says="the error that stays",
)
def steady_error(
    dataset: xr.Dataset, signal: str = "spacing_error", window: tuple[float, float] | None = None
) -> xr.DataArray:
    """Mean of an error over a part of the record, by the trapezoid rule.

    Args:
        dataset: trajectories of a run, or a `Recording`.
        signal: the variable, such as `spacing_error` or `policy_error` [m].
        window: (start, end) [s]; the last tenth of the record if None. Take whole periods of an oscillation.

    Returns:
        One value a vehicle, in the unit of the signal; NaN for vehicles without a value somewhere in the window (after
        a collision).

    Raises:
        HeadwayError: if no follower has values throughout the window.
    """
    signals = Signals(dataset, "steady_error", signal)
    last = signals.time[-1]
    part = slice(-1, None)
    if window is not None or signals.time.size > 1:
        part = signals.within((last - 0.1 * (last - signals.time[0]), last) if window is None else window)
    values, weight = signals[signal][..., part], trapezoid(signals.time[part])
    if not weight.sum() > 0:  # a single sample
        weight = np.ones_like(weight)
    mean = (values * weight).sum(axis=-1) / weight.sum()
    signals.need_follower(np.isfinite(mean), signal, float(signals.time[part][0]), float(signals.time[part][-1]))
    return signals.result(mean)


@metric(
    "s",
    "time gap",
    formula="s / v",
    says="over time; infinite at standstill",
    per="time",
)
def time_gap(dataset: xr.Dataset) -> xr.DataArray:
    """Time gap `s/v` [s], (vehicle, time): infinite at standstill, NaN where there is no gap.

    Args:
        dataset: trajectories of a run, with `gap` and `speed`, or a `Recording`.
    """
    signals = Signals(dataset, "time_gap", "gap", "speed")
    return signals.series(_time_gap(signals))


@metric(
    "s",
    "least time gap",
    formula="min s / v",
    says="how close, in time",
    threshold="< 1 critical",
    whose="least",
)
def least_time_gap(dataset: xr.Dataset) -> xr.DataArray:
    """Least time gap [s] over time, refined between samples; below 1 s is critical.

    Infinite for a vehicle that never moves, NaN for the leader; after a contact (gap <= 0) nothing counts.

    Args:
        dataset: trajectories of a run, with `gap` and `speed`, or a `Recording`.
    """
    signals = Signals(dataset, "least_time_gap", "gap", "speed")
    gap = _time_gap(signals)
    valid = ~np.isnan(gap)
    valid &= ~np.logical_or.accumulate(signals["gap"] <= 0, axis=-1)
    least = extreme_of(signals.time, np.where(valid, gap, np.nan), -1.0, FROM_ZERO)
    least = np.where(valid.any(axis=-1) & np.isnan(least), np.inf, least)
    return signals.result(least)


def _time_gap(signals: Signals) -> Array:
    gap, speed = signals["gap"], signals["speed"]
    moving = speed > 0
    ratio = np.divide(gap, speed, out=np.full_like(gap, np.inf), where=moving)
    return np.where(np.isnan(gap) | np.isnan(speed), np.nan, ratio)


def throughput(vehicle: Vehicle | Model, speed: Any, length: float | None = None, gap: Any = None) -> Any:
    """Flow at equilibrium [vehicles/h] of a lane full of one vehicle, `3600 v / (s_e(v) + length)`.

    Args:
        vehicle: a vehicle or a bare model.
        speed: v [m/s], a number or an array.
        length: length of a vehicle [m] >= 0; the vehicle's own, 5 m for a bare model, if None.
        gap: gap [m], where every gap is an equilibrium (GMM).

    Returns:
        Flow in the shape of `speed`; NaN in an array where there is no equilibrium.

    Raises:
        HeadwayError: if there is no equilibrium at a single speed, or gap and length do not add up to a positive
            number.
    """
    car = vehicle if isinstance(vehicle, Vehicle) else Vehicle(vehicle)
    size = car.length if length is None else checked("throughput", "length", length)
    if size < 0:
        raise HeadwayError(f"throughput: length = {size:g} m is negative")
    v = np.asarray(speed, dtype=float)
    if gap is not None:
        s = np.asarray(gap, dtype=float)
    else:
        s = np.asarray(car.model.equilibrium_gap(float(v)) if v.ndim == 0 else car.model.desired_gap(v))
    if np.any(s + size <= 0):
        raise HeadwayError(f"throughput: gap and length add up to {float(np.min(s + size)):g} m, which is not positive")
    flow = 3600.0 * v / (s + size)
    return float(flow) if flow.ndim == 0 else flow
