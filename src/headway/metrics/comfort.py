"""How a ride feels: jerk and acceleration.

Jerk is the derivative of the sampled acceleration, by central differences of second order. Where the acceleration
jumps (a leader with corners in its speed, a law that switches) there is no jerk: what is sampled there grows as the
samples get denser, and so do peak and r.m.s.; compare such runs at one output step only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from headway.arrays import Array
from headway.errors import HeadwayError
from headway.metrics.extremes import peak_of, rms_of
from headway.metrics.inputs import Signals, positive
from headway.metrics.reduction import FORMS, SQUARE
from headway.metrics.registry import Reduced, metric

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["jerk", "jerk_share", "peak_jerk", "rms_acceleration", "rms_jerk"]


@metric(
    "m/s³",
    "jerk",
    formula="da/dt, central differences",
    says="over time",
    per="time",
)
def jerk(dataset: xr.Dataset) -> xr.DataArray:
    """Jerk [m/s³] over time, positive as the acceleration rises.

    Args:
        dataset: trajectories of a run, with `acceleration`, or a `Recording`.

    Returns:
        Values along vehicle and time; NaN beside and after a collision.
    """
    signals, values = _jerk(dataset, "jerk")
    return signals.series(values)


@metric(
    "m/s³",
    "r.m.s. of jerk",
    formula="sqrt(mean jerk²)",
    says="how rough the ride is",
)
def rms_jerk(dataset: xr.Dataset) -> xr.DataArray:
    """Root of the mean square jerk over time [m/s³] >= 0, until a collision.

    Args:
        dataset: trajectories of a run, with `acceleration`, or a `Recording`.
    """
    signals, values = _jerk(dataset, "rms_jerk")
    return signals.result(rms_of(signals.time, values))


@metric(
    "m/s³",
    "peak of jerk",
    formula="max |jerk|",
    says="the roughest moment",
)
def peak_jerk(dataset: xr.Dataset) -> xr.DataArray:
    """Largest magnitude of jerk [m/s³] >= 0, refined between samples, until a collision.

    Args:
        dataset: trajectories of a run, with `acceleration`, or a `Recording`.
    """
    signals, values = _jerk(dataset, "peak_jerk")
    return signals.result(peak_of(signals.time, values))


@metric(
    "1",
    "share of time with jerk beyond {limit:g} m/s³",
    formula="share of time with |jerk| > 2 m/s³",
    says="how often it is felt",
    threshold="2 m/s³",
)
def jerk_share(dataset: xr.Dataset, limit: float = 2.0) -> xr.DataArray:
    """Share of the time [1], 0 to 1, in which the magnitude of jerk exceeds a limit.

    Crossings of the limit are located between samples.

    Args:
        dataset: trajectories of a run, with `acceleration`, or a `Recording`.
        limit: magnitude of jerk [m/s³] > 0.
    """
    signals, values = _jerk(dataset, "jerk_share")
    positive("jerk_share", limit=limit)
    step = np.diff(signals.time)
    beyond = np.zeros(values.shape[:-1])
    finite = np.isfinite(values[..., :-1]) & np.isfinite(values[..., 1:])
    for sign in (1.0, -1.0):
        beyond += (step * _part_above(sign * values - limit)).sum(axis=-1)
    total = (finite * step).sum(axis=-1)
    share = np.divide(beyond, total, out=np.full_like(beyond, np.nan), where=total > 0)
    return signals.result(share)


@metric(
    "m/s²",
    "r.m.s. of acceleration, unweighted",
    formula="sqrt(mean a²), unweighted",
    reduced=Reduced("acceleration", SQUARE, FORMS["rms_{}"].make),
    says="how lively it is; the weighting of ISO 2631 needs the motion of a vehicle body up to 80 Hz",
)
def rms_acceleration(dataset: xr.Dataset) -> xr.DataArray:
    """Root of the mean square acceleration over time [m/s²] >= 0, unweighted, until a collision.

    Unweighted: the weighting of ISO 2631-1 for motion sickness and vibration needs 0.1 to 80 Hz of a vehicle body,
    which car following does not describe.

    Args:
        dataset: trajectories of a run, with `acceleration`, or a `Recording`.
    """
    signals = Signals(dataset, "rms_acceleration", "acceleration")
    return signals.result(rms_of(signals.time, signals["acceleration"]))


def _jerk(dataset: xr.Dataset, measure: str) -> tuple[Signals, Array]:
    signals = Signals(dataset, measure, "acceleration")
    if signals.time.size < 3:
        raise HeadwayError(f"{measure} needs at least 3 samples in time; this dataset has {signals.time.size}")
    return signals, np.gradient(signals["acceleration"], signals.time, axis=-1, edge_order=2)


def _part_above(values: Array) -> Array:
    """The part of every interval between samples in which `values`, linear there, are positive; 0 beside NaN."""
    y0, y1 = values[..., :-1], values[..., 1:]
    most, least = np.maximum(y0, y1), np.minimum(y0, y1)
    crossed = (most > 0) & (least < 0)
    part = np.where(most > 0, 1.0, 0.0)
    return np.divide(most, most - least, out=np.where(np.isnan(least), 0.0, part), where=crossed)
