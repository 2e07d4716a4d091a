"""Values of a study with names: arrays over points become a dataset over axes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from headway.study.axes import Points
from headway.study.work import PENDING, STATUS

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["assembled"]


def assembled(
    points: Points,
    values: Mapping[str, np.ndarray],
    messages: Mapping[int, str],
    described: Mapping[str, tuple[str, str]],
    attrs: Mapping[str, Any],
) -> xr.Dataset:
    """The dataset of arrays (points,) and (points, vehicle); `described` are units and meanings by name."""
    import xarray as xr

    dims = tuple(points.dims)
    variables: dict[str, Any] = {}
    for name, array in values.items():
        if name == "status":
            continue
        more = ("vehicle",) if array.ndim == 2 else ()
        unit, meaning = described.get(name, ("", ""))
        about = {k: v for k, v in (("units", unit), ("long_name", meaning)) if v}
        variables[name] = ((*dims, *more), array.reshape(*points.shape, *array.shape[1:]), about)
    status = np.array(STATUS)[values["status"]].reshape(points.shape)
    told = np.full(points.count, "", dtype=object)
    for i, text in messages.items():
        told[i] = text
    meaning = "what became of the point: " + ", ".join(STATUS[:PENDING]) + ", or pending"
    variables["status"] = (dims, status, {"long_name": meaning})
    why = "why a point is invalid or failed, or a metric has no value"
    variables["message"] = (
        dims,
        told.reshape(points.shape),
        {"long_name": why},
    )
    coords: dict[str, Any] = {}
    for path, array in points.values.items():
        shown = array if array.dtype != object else np.array([_text(v) for v in array])
        coords[path] = (points.along[path], shown)
    if any(v.ndim == 2 for v in values.values()):
        wide = next(v.shape[1] for v in values.values() if v.ndim == 2)
        coords["vehicle"] = ("vehicle", np.arange(wide), {"long_name": "vehicle, 0 is the leader"})
    return xr.Dataset(variables, coords=coords, attrs=dict(attrs))


def _text(value: Any) -> str:
    """A value that is no number as a label."""
    if isinstance(value, dict):
        return ", ".join(f"{k}={v:g}" if isinstance(v, float) else f"{k}={v}" for k, v in value.items())
    return " ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
