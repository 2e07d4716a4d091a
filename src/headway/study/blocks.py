"""Metrics that need trajectories, of many runs at once: runs behind one leader are lanes of one dataset."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from headway.arrays import Array
from headway.engine.plan import Lanes
from headway.errors import HeadwayError
from headway.metrics.registry import Metric
from headway.scenario.scenario import Scenario
from headway.schema import describe

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["MOST_SAMPLES", "metric_values", "own_value", "stacked"]


#: samples × vehicles × lanes of one dataset
MOST_SAMPLES = 1_000_000


def stacked(scenario: Scenario, time: Array, motion: Array, collision: Array, lanes: Lanes) -> xr.Dataset:
    """Trajectories (lane, vehicle, time) of lanes behind the leader of `scenario`.

    Args:
        scenario: one of them.
        time: (T,) [s].
        motion: (3, T, N+1, B) positions, speeds and accelerations.
        collision: (N+1, B) [s], NaN if none.
        lanes: what each lane has for itself.
    """
    import xarray as xr

    x, v, a = np.moveaxis(motion, (3, 2), (1, 2))  # (B, N+1, T)
    gap, relative = np.full_like(x, np.nan), np.full_like(x, np.nan)
    gap[:, 1:] = x[:, :-1] - lanes.lengths.T[..., None] - x[:, 1:]
    relative[:, 1:] = v[:, :-1] - v[:, 1:]
    values = {
        "position": x, "speed": v, "acceleration": a, "gap": gap, "relative_speed": relative,
        "spacing_error": gap - gap[..., :1],
    }  # fmt: skip
    free = np.full((x.shape[0], 1), np.inf)
    return describe(xr.Dataset(
        {name: (("lane", "vehicle", "time"), array) for name, array in values.items()}
        | {"collision_time": (("lane", "vehicle"), collision.T)},
        coords={
            "vehicle": np.arange(x.shape[1]), "time": time,
            "limit_low": (("lane", "vehicle"), np.hstack((-free, lanes.limits[0].T))),
            "limit_high": (("lane", "vehicle"), np.hstack((free, lanes.limits[1].T))),
        },
        attrs={"scenario": scenario.to_toml()},
    ))  # fmt: skip


def metric_values(metrics: Iterable[Metric], runs: xr.Dataset) -> tuple[dict[str, Array], dict[int, str]]:
    """Values of metrics of many runs at once.

    Args:
        metrics: metrics of the registry.
        runs: trajectories along lane, vehicle and time.

    Returns:
        Values (lane, …) by name of the metric, and by lane why one has none.
    """
    values: dict[str, Array] = {}
    reasons: dict[int, str] = {}
    count = runs.sizes["lane"]
    for metric in metrics:
        try:
            result = metric.of(runs)
            array = np.array(result.transpose("lane", ...).values, dtype=float)
            # a lane by itself may have no value where others have one, and says why
            lost = np.isnan(array[:, 1:] if array.ndim > 1 else array[:, None])
            single = np.flatnonzero(lost.any(axis=1) if "note" in result.attrs else lost.all(axis=1))
        except HeadwayError:
            array = np.full((count, runs.sizes["vehicle"]) if metric.per == "vehicle" else (count,), np.nan)
            single = np.arange(count)
        for lane in map(int, single):
            array[lane], reason = alone(metric, runs.isel(lane=lane))
            if reason:
                reasons.setdefault(lane, reason)
        values[metric.name] = array
    return values, reasons


def alone(metric: Metric, run: xr.Dataset) -> tuple[Any, str]:
    """The values of a single run, NaN with a reason where there are none.

    Args:
        metric: a metric of the registry.
        run: trajectories along vehicle and time.

    Returns:
        The values, and a sentence that is empty where nothing is amiss.
    """
    try:
        result = metric.of(run)
    except HeadwayError as error:
        return np.nan, str(error)
    note = result.attrs.get("note", "")
    return np.asarray(result.values, dtype=float), f"{metric.name}: {note}" if note else ""


def own_value(metric: Metric, dataset: Any) -> Any:
    """What a metric of one's own makes of trajectories.

    Args:
        metric: the metric, a function of the user.
        dataset: trajectories of a run.

    Raises:
        HeadwayError: if the function fails, or its result is neither a number nor along vehicle.
    """
    try:
        result = metric.function(dataset)
        dims = tuple(getattr(result, "dims", ()))
        if dims not in ((), ("vehicle",)):
            raise HeadwayError(f"metric {metric.name} has the dimensions {dims}; allowed are vehicle, or none")
        return result
    except HeadwayError:
        raise
    except Exception as error:
        raise HeadwayError(f"metric {metric.name} failed ({type(error).__name__}: {error})") from None
