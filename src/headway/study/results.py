"""Values of a study with names: arrays over points become a dataset over axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from headway.errors import HeadwayError
from headway.metrics.sizes import braking_share
from headway.study.axes import Points
from headway.study.paths import ORDER
from headway.study.templates import vehicle_order
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
    groups: Sequence[int] = (),
) -> xr.Dataset:
    """The dataset of a study.

    Args:
        points: Its points.
        values: Arrays (points,) and (points, vehicle) by metric, and `status`.
        messages: Why points are invalid or failed, by number.
        described: Units and meanings by metric.
        attrs: Attributes of the dataset.
        groups: Followers of each table of the scenario, to say who stands where if `order` is an axis.
    """
    import xarray as xr

    dims = tuple(points.dims)
    variables: dict[str, Any] = {}
    for name, array in values.items():
        if name == "status":
            continue
        more = ("vehicle",) if array.ndim == 2 else ()
        unit, meaning = described.get(name, ("", ""))
        note = braking_share(array) if name == "least_acceleration" else ""
        about = {k: v for k, v in (("units", unit), ("long_name", meaning), ("note", note)) if v}
        variables[name] = ((*dims, *more), array.reshape(*points.shape, *array.shape[1:]), about)
    status = np.array(STATUS)[values["status"]].reshape(points.shape)
    texts = np.full(points.count, "", dtype=object)
    for i, text in messages.items():
        texts[i] = text
    meaning = "what became of the point: " + ", ".join(STATUS[:PENDING]) + ", or pending"
    variables["status"] = (dims, status, {"long_name": meaning})
    why = "why a point is invalid or failed, or a metric has no value"
    variables["message"] = (
        dims,
        texts.reshape(points.shape),
        {"long_name": why},
    )
    coords: dict[str, Any] = {}
    if groups and ORDER in points.values:
        variables["original_vehicle"] = _standing(points, groups, [v.shape[1] for v in values.values() if v.ndim == 2])
    for path, array in points.values.items():
        shown = array if array.dtype != object else np.array([_text(v) for v in array])
        coords[path] = (points.along[path], shown)
    wide = [v[1].shape[-1] for v in variables.values() if v[0][-1:] == ("vehicle",)]
    if wide:
        coords["vehicle"] = ("vehicle", np.arange(wide[0]), {"long_name": "vehicle, 0 is the leader"})
    return xr.Dataset(variables, coords=coords, attrs=dict(attrs))


def _standing(
    points: Points, groups: Sequence[int], widths: Sequence[int]
) -> tuple[tuple[str, ...], np.ndarray, dict[str, str]]:
    """Which vehicle of the scenario stands at each place: along the axes that say so, and vehicle."""
    counted = {p: p.split(".")[1] for p in points.values if p.startswith("followers.") and p.endswith(".count")}
    dims = tuple(dict.fromkeys(points.along[p] for p in (ORDER, *counted)))
    shape = tuple(points.dims[d] for d in dims)
    listed = {p: points.values[p].tolist() for p in (ORDER, *counted)}
    lines: dict[tuple[int, ...], list[int]] = {}
    for index in np.ndindex(shape):
        at = dict(zip(dims, index, strict=True))
        here = {p: those[at[points.along[p]]] for p, those in listed.items()}
        sizes = list(groups)
        for path, which in counted.items():
            for i in [int(which)] if which.isdigit() else range(len(sizes)):
                sizes[i] = here[path] if isinstance(here[path], int) and here[path] > 0 else 1
        try:
            lines[index] = vehicle_order(here[ORDER], sum(sizes))
        except HeadwayError:  # such a point is invalid and says so
            lines[index] = []
    width = max([*widths, *(1 + len(line) for line in lines.values())])
    numbers = np.full((*shape, width), -1)
    for index, line in lines.items():
        numbers[index][: 1 + len(line)] = [0, *line]
    meaning = "number in the scenario of the vehicle that stands here; -1 where nobody does"
    return (*dims, "vehicle"), numbers, {"long_name": meaning}


def _text(value: Any) -> str:
    """A value that is no number as a label."""
    if isinstance(value, dict):
        return ", ".join(f"{k}={v:g}" if isinstance(v, float) else f"{k}={v}" for k, v in value.items())
    return " ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
