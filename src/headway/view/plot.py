"""Figures of trajectories: what each car did, readable in print and without colour.

Every function draws a dataset of `headway.simulate` (dimensions vehicle and time, units in the
attributes) and returns a `matplotlib.figure.Figure` that belongs to no window; `save` writes it.
Given axes are drawn on instead, without a title. Collisions are marked with a cross where a car
met the one ahead. `HeadwayError` says which variable a dataset lacks.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from headway.errors import HeadwayError
from headway.view import style

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "accelerations", "comparison", "gaps", "overview", "save", "spacing_errors", "speeds", "time_space",
]  # fmt: skip

Array = NDArray[np.float64]

#: variables between a car and the one ahead: their lines are named after the pair
_OF_PAIRS = ("gap", "relative_speed", "spacing_error", "policy_error")

#: points drawn in all, and least and most points of a line; more is invisible and makes files large
_POINTS, _LEAST, _MOST = 1_000_000, 600, 4000

_SUFFIXES = (".png", ".svg", ".pdf")
_DPI = 200


def speeds(dataset: xr.Dataset, ax: Axes | None = None) -> Figure:
    """Speed [m/s] of every car over time [s]."""
    return _one(dataset, "speed", ax)


def accelerations(dataset: xr.Dataset, ax: Axes | None = None) -> Figure:
    """Acceleration [m/s²] of every car over time [s]."""
    return _one(dataset, "acceleration", ax)


def gaps(dataset: xr.Dataset, ax: Axes | None = None) -> Figure:
    """Gap [m], bumper to bumper, of every pair of cars over time [s]."""
    return _one(dataset, "gap", ax)


def spacing_errors(dataset: xr.Dataset, ax: Axes | None = None) -> Figure:
    """Spacing error [m], gap minus gap at the start, of every pair of cars over time [s]."""
    return _one(dataset, "spacing_error", ax)


def time_space(dataset: xr.Dataset, ax: Axes | None = None, moving: bool | None = None) -> Figure:
    """Position [m] of every car over time [s], coloured by speed [m/s].

    `moving` subtracts the leader's mean speed, which shows waves in a platoon that drives steadily;
    if None that is done where the leader's speed stays within a quarter of its mean.
    """
    from matplotlib.collections import LineCollection

    position, speed = _values(dataset, "position"), _values(dataset, "speed")
    time = dataset["time"].values
    front = speed[0]
    mean = float(np.nanmean(front))
    if moving is None:
        moving = bool(np.nanmax(np.abs(front - mean)) <= 0.25 * mean)
    figure, ax = _canvas(dataset, ax, 3.6)
    count = position.shape[0]
    step = max(1, time.size * count // 400_000, time.size // 1500)
    t, x, v = time[::step], position[:, ::step], speed[:, ::step]
    if moving:
        x = x - mean * (t - time[0])
    points = np.stack(np.broadcast_arrays(t, x), axis=-1)
    segments = np.stack((points[:, :-1], points[:, 1:]), axis=2).reshape(-1, 2, 2)
    colours = (0.5 * (v[:, :-1] + v[:, 1:])).ravel()
    known = np.isfinite(segments).all(axis=(1, 2)) & np.isfinite(colours)
    lines = LineCollection(
        list(segments[known]), cmap=style.speed_map(), linewidths=_line_width(count), capstyle="round", rasterized=True
    )
    lines.set_array(colours[known])
    ax.add_collection(lines)
    ax.autoscale_view()
    ax.margins(x=0)
    _mark_collisions(ax, dataset, "position", mean if moving else 0.0)
    style.axes_style(ax)
    style.bar_style(figure.colorbar(lines, ax=ax, pad=0.02, aspect=25), style.axis_label(dataset, "speed"))
    ax.set_xlabel(style.axis_label(dataset, "time"))
    label = "Position [m]"
    ax.set_ylabel(f"Position − {mean:.4g} m/s · t [m]" if moving else label)
    return figure


def overview(dataset: xr.Dataset) -> Figure:
    """Four views of one run: speeds, spacing errors, gaps, and positions coloured by speed."""
    _check(dataset, "speed", "spacing_error", "gap", "position")
    figure = style.new_figure(5.6, str(dataset.attrs.get("title", "")))
    axes = figure.subplots(2, 2, sharex=True)
    speeds(dataset, axes[0, 0])
    spacing_errors(dataset, axes[0, 1])
    gaps(dataset, axes[1, 0])
    time_space(dataset, axes[1, 1])
    for ax in axes[0]:
        ax.set_xlabel("")
    return figure


def comparison(datasets: Mapping[str, xr.Dataset], what: Sequence[str] = ("spacing_error", "speed")) -> Figure:
    """One row for each of `datasets`, named by its key, and one column for each variable in `what`.

    The time axis [s] is shared; values keep the scale of their own run, as models differ by orders
    of magnitude.
    """
    if not datasets or not what:
        raise HeadwayError("comparison needs at least one dataset and one variable")
    for name, dataset in datasets.items():
        try:
            _check(dataset, *what)
        except HeadwayError as error:
            raise HeadwayError(f"{name}: {error}") from None
    figure = style.new_figure(0.5 + 1.55 * len(datasets))
    axes = figure.subplots(len(datasets), len(what), sharex=True, squeeze=False)
    longest = max(datasets, key=lambda name: datasets[name].sizes["vehicle"])
    for row, (name, dataset) in zip(axes, datasets.items(), strict=True):
        for ax, variable in zip(row, what, strict=True):
            _lines(ax, dataset, variable, keyed=False)
            if ax is not axes[-1, list(row).index(ax)]:
                ax.set_xlabel("")
        row[0].set_title(name, loc="left", fontsize=style.LARGE, fontweight="bold")
    for ax, variable in zip(axes[0], what, strict=True):
        _key(ax, datasets[longest], variable)
    figure.align_ylabels()
    return figure


def save(figure: Figure, path: str | os.PathLike[str]) -> Path:
    """Write a figure as PNG (200 dots an inch), SVG or PDF, by the suffix of `path`; returns the path.

    The file appears complete or not at all. Raises `HeadwayError` for another suffix or where
    nothing can be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES:
        raise HeadwayError(f"{path}: a figure cannot be written as {suffix or 'a file without suffix'!r}; allowed are {', '.join(_SUFFIXES)}")
    temporary = ""
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.stem}.", suffix=suffix, delete=False) as file:
            temporary = file.name
            # without a date the same figure gives the same file
            stamp = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(suffix)
            figure.savefig(file, format=suffix[1:], dpi=_DPI, metadata=stamp)
        os.replace(temporary, path)
    except OSError as error:
        raise HeadwayError(f"{path}: the figure cannot be written ({error.strerror or error})") from None
    finally:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
    return path
