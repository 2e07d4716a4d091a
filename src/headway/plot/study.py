"""Figures of studies: heat maps with the exact stability boundary, lines with bands, small multiples."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from headway.errors import HeadwayError, HeadwayWarning, shorten, unknown_name
from headway.plot import style

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["picture", "study_lines", "study_map"]

#: most panels of a third axis, and panels side by side
_PANELS, _COLUMNS = 9, 3

#: parts into which a range is cut for the bands of a design
_BINS = 24


def picture(dataset: xr.Dataset, metric: str | None = None, stability: xr.Dataset | None = None) -> Figure:
    """Draw a study: a map over two or three axes, else lines; see `study_map` and `study_lines`.

    Args:
        dataset: of `Study.run`.
        metric: name of a metric; the first one if None.
        stability: of `Study.stability`, for a map.
    """
    axes = _axes(dataset)
    gridded = [a for a in axes if a in dataset.dims and dataset[a].dtype.kind in "fi"]
    return study_map(dataset, metric, stability=stability) if len(gridded) >= 2 else study_lines(dataset, metric)


def study_map(
    dataset: xr.Dataset,
    metric: str | None = None,
    x: str | None = None,
    y: str | None = None,
    *,
    panel: str | None = None,
    at: Mapping[str, Any] | None = None,
    vehicle: int = -1,
    stability: xr.Dataset | None = None,
) -> Figure:
    """Draw a metric as a heat map over two axes of a grid, one panel for each value of a third.

    Args:
        dataset: Of `Study.run` over a grid.
        metric: Name of a metric; the first one if None.
        x: Axis to the right; the first one with numbers if None.
        y: Axis upwards; the next one with numbers if None.
        panel: Axis of the panels; the first other one if None. Nine panels fit: of more values, nine
            are drawn evenly.
        at: Values of axes that are not drawn, or a list of values of `panel`. Other axes count at
            their first value.
        vehicle: Number of the vehicle, -1 the last.
        stability: Of `Study.stability` for the same study: its boundaries of string stability
            (line) and local stability (dashes) are drawn over the map.

    Returns:
        A figure. Crosses mark points with a collision, grey ones without a value. Where it shows a part
        of the study only, its title says which and a `HeadwayWarning` how to choose.

    Raises:
        HeadwayError: For names and values that the dataset does not have, or fewer than two axes.
    """
    dataset, chosen = _selected(dataset, at)
    if stability is not None:
        stability, _ = _selected(stability, at)
    metric, values = _values(dataset, metric, vehicle)
    numeric = [a for a in _axes(dataset) if a in dataset.dims and dataset[a].dtype.kind in "fi"]
    for name in (x, y, panel):
        if name is not None and name not in dataset.dims:
            raise unknown_name("axis", name, dataset.status.dims)
    free = [a for a in numeric if a not in (x, y, panel)]
    x = x or (free.pop(0) if free else None)
    y = y or (free.pop(0) if free else None)
    if x is None or y is None:
        raise HeadwayError(f"a map needs two axes with numbers; this study has {', '.join(numeric) or 'none'}")
    others = [d for d in dataset.status.dims if d not in (x, y)]
    panel = panel or next((str(d) for d in others if dataset.sizes[d] > 1), None)
    rest = {d: 0 for d in others if d != panel}
    count = min(dataset.sizes[panel], _PANELS) if panel else 1
    shown_at = np.linspace(0, dataset.sizes[panel] - 1, count).round().astype(int) if panel else np.zeros(1, int)
    parts = [f"{d} = {_number(dataset[d].values[0])}" for d in rest if d in dataset.coords and dataset.sizes[d] > 1]
    if panel and count < dataset.sizes[panel]:
        parts.append(f"{count} of {dataset.sizes[panel]} values of {panel}")
    if parts:
        words = ", ".join(parts)
        warnings.warn(f"the map shows {words} only; choose others with study_map(…, at={{…}})", HeadwayWarning, 2)
    columns = min(count, _COLUMNS)
    rows = math.ceil(count / columns)
    figure = style.new_figure(0.6 + 2.9 * rows if count > 1 else 4.4, _title(dataset, [*chosen, *parts]))
    cells = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    shown = values.isel(rest)
    finite = shown.values[np.isfinite(shown.values)]
    low, high = (float(finite.min()), float(np.quantile(finite, 0.98))) if finite.size else (0.0, 1.0)
    image: Any = None
    for i, ax in enumerate(cells.ravel()):
        if i >= count:
            ax.set_visible(False)
            continue
        here = {**rest, **({panel: int(shown_at[i])} if panel else {})}
        image = _heat(ax, dataset.isel(here), values.isel(here), x, y, low, max(high, low + 1e-12))
        if stability is not None:
            _boundaries(ax, stability.isel(here), x, y)
        if panel:
            ax.set_title(f"{panel} = {_number(dataset[panel].values[shown_at[i]])}", fontsize=style.SMALL)
        style.axes_style(ax)
        ax.grid(False)
        if i % columns == 0:
            ax.set_ylabel(_label(y), fontsize=style.SMALL)
        if i + columns >= count:
            ax.set_xlabel(_label(x), fontsize=style.SMALL)
            ax.tick_params(labelbottom=True)
    above = finite.size > 0 and finite.max() > high
    extend = "max" if above else "neither"
    bar = figure.colorbar(image, ax=list(cells.ravel()[:count]), aspect=30, pad=0.02, extend=extend)
    style.bar_style(bar, _meaning(dataset, metric, vehicle))
    return figure


def study_lines(dataset: xr.Dataset, metric: str | None = None, x: str | None = None, *, vehicle: int = -1) -> Figure:
    """Draw a metric along one axis; every other variation becomes a band of 5 to 95 % around the median.

    Points of a design are gathered in equal parts of the range of `x`; those of a grid at its values.

    Args:
        dataset: Of `Study.run`.
        metric: Name of a metric; the first one if None.
        x: Axis to the right; the longest one with numbers if None.
        vehicle: Number of the vehicle, -1 the last.

    Raises:
        HeadwayError: For names that the dataset does not have, or without an axis with numbers.
    """
    metric, values = _values(dataset, metric, vehicle)
    numeric = [a for a in _axes(dataset) if dataset[a].dtype.kind in "fi"]
    if x is None:
        if not numeric:
            raise HeadwayError("lines need an axis with numbers; this study has none")
        x = max((a for a in numeric if a in dataset.dims), key=lambda a: dataset.sizes[a], default=numeric[0])
    if x not in numeric:
        raise unknown_name("axis", x, numeric)
    at, y = _paired(dataset, x, values)
    figure = style.new_figure(3.6, _title(dataset, []))
    ax = figure.subplots()
    places = np.unique(at)
    if places.size > 2 * _BINS and places.size > at.size / 4:
        ends = np.linspace(at.min(), at.max(), _BINS + 1)
        part = np.clip(np.searchsorted(ends, at, side="right") - 1, 0, _BINS - 1)
        middle = 0.5 * (ends[1:] + ends[:-1])
        ax.plot(at, y, ".", color="0.7", markersize=2.0, zorder=1)
    else:
        part, middle = np.searchsorted(places, at), places
    groups = [y[(part == i) & np.isfinite(y)] for i in range(middle.size)]
    filled = [i for i, g in enumerate(groups) if g.size]
    lines = np.array([np.quantile(groups[i], (0.05, 0.5, 0.95)) for i in filled]).T.reshape(3, -1)
    band = any(groups[i].size > 1 for i in filled)
    if band:
        ax.fill_between(middle[filled], lines[0], lines[2], color="#9ecae1", alpha=0.7, linewidth=0, zorder=2)
    ax.plot(middle[filled], lines[1], color="#08519c", linewidth=1.4, zorder=3)
    style.axes_style(ax)
    ax.set_xlabel(_label(x), fontsize=style.SMALL)
    ax.set_ylabel(_meaning(dataset, metric, vehicle), fontsize=style.SMALL)
    if band:
        style.key_above(
            ax, {"median": {"color": "#08519c", "linewidth": 1.4}, "5 to 95 %": {"color": "#9ecae1", "linewidth": 6.0}}
        )
    return figure


def _paired(dataset: xr.Dataset, x: str, values: xr.DataArray) -> tuple[np.ndarray, np.ndarray]:
    """Return places and values of all points, side by side."""
    import xarray as xr

    at, y = xr.broadcast(dataset[x], values)
    return at.values.ravel().astype(float), y.transpose(*at.dims).values.ravel()


def _axes(dataset: xr.Dataset) -> list[str]:
    if "status" not in dataset:
        raise HeadwayError("this dataset is not of a study: it has no status")
    return [str(n) for n, c in dataset.coords.items() if set(c.dims) <= set(dataset.status.dims)]


def _values(dataset: xr.Dataset, metric: str | None, vehicle: int) -> tuple[str, xr.DataArray]:
    """Return the metric and its values over the points, of one vehicle."""
    points = set(dataset["status"].dims) if "status" in dataset else set()
    allowed = [
        str(n) for n, v in dataset.data_vars.items()
        if v.dtype.kind == "f" and points and points <= set(v.dims) <= points | {"vehicle"}
    ]  # fmt: skip
    if not allowed:
        raise HeadwayError("this dataset has no metric over the points of a study")
    name = metric or allowed[0]
    if name not in allowed:
        raise unknown_name("metric", name, allowed)
    values = dataset[name]
    return name, values.isel(vehicle=vehicle) if "vehicle" in values.dims else values


def _heat(ax: Axes, dataset: xr.Dataset, values: xr.DataArray, x: str, y: str, low: float, high: float) -> Any:
    ax.set_facecolor("0.85")
    grid = values.transpose(y, x).values
    image = ax.pcolormesh(
        dataset[x].values, dataset[y].values, np.ma.masked_invalid(grid), shading="nearest", cmap=style.cars_map(),
        vmin=low, vmax=high, rasterized=True,
    )  # fmt: skip
    row, column = np.nonzero(dataset.status.transpose(y, x).values == "collision")
    ax.plot(
        dataset[x].values[column], dataset[y].values[row], **{**style.CROSS, "markersize": 2.0, "markeredgewidth": 0.8}
    )
    return image


def _boundaries(ax: Axes, theory: xr.Dataset, x: str, y: str) -> None:
    """Draw the lines on which margins are zero."""
    for name, dashes in (("margin", "solid"), ("decay_rate", "dashed")):
        margin = theory[name].transpose(y, x).values
        finite = margin[np.isfinite(margin)]
        if finite.size and finite.min() < 0 < finite.max() and min(margin.shape) > 1:
            lines = ax.contour(
                theory[x].values, theory[y].values, margin, levels=[0.0], colors="white", linewidths=1.6,
                linestyles=dashes,
            )  # fmt: skip
            lines.set_path_effects(_rim())


def _rim() -> list[Any]:
    from matplotlib.patheffects import Normal, Stroke

    return [Stroke(linewidth=2.8, foreground="black"), Normal()]


def _selected(dataset: xr.Dataset, at: Mapping[str, Any] | None) -> tuple[xr.Dataset, list[str]]:
    """Return the part of a dataset at some values of its axes, and these values in words."""
    words = []
    for name, choice in (at or {}).items():
        if name not in dataset.status.dims or name not in dataset.coords:
            raise unknown_name("at: axis", name, [str(d) for d in dataset.status.dims if d in dataset.coords])
        values = dataset[name].values
        several = isinstance(choice, list | tuple | np.ndarray)
        places: list[int] = []
        for value in choice if several else [choice]:
            places += np.flatnonzero(values == value)[:1].tolist() or [_missing(name, value, values)]
        dataset = dataset.isel({name: places if several else places[0]})
        if not several:
            words.append(f"{name} = {_number(values[places[0]])}")
    return dataset, words


def _missing(name: str, value: Any, values: np.ndarray) -> int:
    some = ", ".join(_number(v) for v in values[:12].tolist()) + (", …" if values.size > 12 else "")
    raise HeadwayError(f"at: {name} = {shorten(value)} is none of its values; they are {some}")


def _title(dataset: xr.Dataset, parts: list[str]) -> str:
    return ", ".join([str(dataset.attrs.get("title", "")), *parts])


def _number(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float | np.floating) else str(value)


def _label(path: str) -> str:
    return "delay [s]" if path == "delay" else path


def _meaning(dataset: xr.Dataset, metric: str, vehicle: int) -> str:
    attrs = dataset[metric].attrs
    unit = attrs.get("units", "1")
    words = str(attrs.get("long_name", metric)).split(":")[0]
    who = "" if "vehicle" not in dataset[metric].dims else f", vehicle {int(dataset['vehicle'].values[vehicle])}"
    return f"{words[:1].upper()}{words[1:]}{who}" + (f" [{unit}]" if unit not in ("", "1") else "")
