"""Trajectories made by hand, to which every measure is known."""

from __future__ import annotations

import numpy as np
import xarray as xr

from headway.schema import describe


def made(time, attrs=None, **variables):
    """A dataset (vehicle, time) of arrays; missing gaps and relative speeds follow from position and speed."""
    time = np.asarray(time, dtype=float)
    held = {name: np.asarray(values, dtype=float) for name, values in variables.items()}
    count = next(iter(held.values())).shape[0]
    data = {name: (("vehicle", "time") if v.ndim == 2 else ("vehicle",), v) for name, v in held.items()}
    return describe(xr.Dataset(data, coords={"vehicle": np.arange(count), "time": time}, attrs=attrs or {}))


def encounter(time, gap, speed, ahead):
    """A pair: gap [m], speed of the follower and of the leader [m/s], numbers or arrays over time."""
    gap, speed, ahead = (np.broadcast_to(np.asarray(y, dtype=float), np.shape(time)) for y in (gap, speed, ahead))
    none = np.full_like(gap, np.nan)
    return made(
        time,
        gap=[none, gap],
        speed=[ahead, speed],
        relative_speed=[none, ahead - speed],
        spacing_error=[none, gap - gap[0]],
        acceleration=[np.gradient(ahead, time), np.gradient(speed, time)],
    )
