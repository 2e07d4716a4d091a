"""Measures of runs: one number over all followers for each run, many runs at once."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from headway import metrics
from headway.errors import HeadwayError
from headway.metrics.registry import named
from headway.scenario.leaders import Disturbance

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["MEASURES", "Measure", "measures_of"]


@dataclass(frozen=True)
class Measure:
    """A number for each run.

    Attributes:
        unit: of the number.
        meaning: in words.
        of: the numbers (run,) of stacked runs (run, vehicle, time) behind one leader.
    """

    unit: str
    meaning: str
    of: Callable[[xr.Dataset, Disturbance], xr.DataArray]


def _growth(runs: xr.Dataset, leader: Disturbance) -> xr.DataArray:
    return _passed_on(runs, leader, "predecessor").max("vehicle")


def _head_to_tail(runs: xr.Dataset, leader: Disturbance) -> xr.DataArray:
    return _passed_on(runs, leader, "leader").isel(vehicle=-1, drop=True)


def _passed_on(runs: xr.Dataset, leader: Disturbance, to: Literal["predecessor", "leader"]) -> xr.DataArray:
    """Return the ratio of fundamentals where the leader repeats itself, else of L2 norms; NaN after a collision.

    A vehicle that stops for a time, or does not swing steadily, has no fundamental: for it, too, the ratio is that
    of L2 norms.
    """
    ratio = metrics.l2_ratio(runs, to=to)
    if leader.fundamental is not None:
        steady = metrics.amplitude_growth(runs, omega=leader.fundamental, to=to)
        ratio = steady.where(steady.notnull(), ratio)
    return ratio.where(metrics.collisions(runs) == 0)


def _roughness(runs: xr.Dataset, leader: Disturbance) -> xr.DataArray:
    acceleration = metrics.rms_acceleration(runs)
    return _followers(acceleration).max("vehicle") / acceleration.isel(vehicle=0, drop=True)


def _tracking(runs: xr.Dataset, leader: Disturbance) -> xr.DataArray:
    ahead = runs.speed.isel(vehicle=0, drop=True)
    # the leader's mean over time by the trapezoid rule
    mean = ahead.integrate("time") / float(runs.time[-1] - runs.time[0])
    return metrics.rms(runs.relative_speed).mean("vehicle") / metrics.rms(ahead - mean)


def _settling(runs: xr.Dataset, leader: Disturbance) -> xr.DataArray:
    if not leader.settles:
        raise HeadwayError(f"a {leader.kind} leader does not come to rest, so nothing settles behind it")
    return _followers(metrics.settling_time(runs)).max("vehicle", skipna=False)


def _followers(values: xr.DataArray) -> xr.DataArray:
    return values.isel(vehicle=slice(1, None))


def _of(name: str, meaning: str) -> Measure:
    """Return a metric of the registry as a measure, of the follower that speaks for the platoon."""
    metric = named(name)
    return Measure(metric.unit, meaning, lambda runs, _: metric.over_vehicles(metric.of(runs)))


MEASURES: dict[str, Measure] = {
    "collisions": _of("collisions", "number of collisions"),
    "ttc": _of("ttc", "least time to collision of all followers"),
    "drac": _of("drac", "largest deceleration needed to avoid a collision"),
    "braking": _of("least_acceleration", "least acceleration, the hardest braking of all followers"),
    "time_gap": _of("least_time_gap", "least time gap of all followers"),
    "growth": Measure("1", "largest growth of the speed disturbance from one vehicle to the next", _growth),
    "head_to_tail": Measure("1", "speed disturbance of the last vehicle over the leader's", _head_to_tail),
    "peak_error": _of("peak_spacing_error", "largest spacing error"),
    "roughness": Measure("1", "r.m.s. acceleration of the worst follower over the leader's", _roughness),
    "jerk_share": _of("jerk_share", "share of time with jerk beyond 2 m/s³, worst follower"),
    "energy": _of("combustion_energy(per=leader)", "energy at the wheels over the leader's, mean of the followers"),
    "tracking": Measure(
        "1",
        "r.m.s. speed difference to the vehicle ahead over the r.m.s. of the leader's own variation, mean of followers",
        _tracking,
    ),
    "settling": Measure("s", "time until the spacing of all followers has settled", _settling),
}


def measures_of(
    runs: Sequence[xr.Dataset], leader: Disturbance
) -> tuple[dict[str, NDArray[np.float64]], dict[str, str]]:
    """Compute all measures of runs behind one leader.

    Args:
        runs: trajectories with the same vehicles and times.
        leader: their leader.

    Returns:
        Each of `MEASURES` (run,) by name, NaN where a value does not exist, e.g. the growth behind a collision; and
        by name why a measure has no value at all.
    """
    import xarray as xr

    names = ("speed", "acceleration", "gap", "relative_speed", "spacing_error")
    dims = ("run", "vehicle", "time")
    first = runs[0]
    stacked = xr.Dataset(
        {n: (dims, np.stack([r[n].values for r in runs]), first[n].attrs) for n in names}
        | {"collision_time": (dims[:2], np.stack([r.collision_time.values for r in runs]))},
        coords={"vehicle": first.vehicle.values, "time": first.time.values},
    )
    values, reasons = {}, {}
    for name, measure in MEASURES.items():
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore", RuntimeWarning)  # of all-NaN slices
                numbers = measure.of(stacked, leader)
            values[name] = np.asarray(numbers.values, dtype=float)
        except HeadwayError as error:
            values[name] = np.full(len(runs), np.nan)
            reasons[name] = str(error)
    return values, reasons
