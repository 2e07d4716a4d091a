"""Figures of trajectories: the motion of each car, readable in print and without colour.

Every function draws a dataset of `headway.simulate` (dimensions vehicle and time, units in the
attributes) and returns a `matplotlib.figure.Figure` that belongs to no window, or draws on axes of
a figure, without a title. Collisions are marked with a cross where a car
met the one ahead. `HeadwayError` says which variable a dataset lacks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from headway.arrays import Array
from headway.errors import HeadwayError
from headway.plot import style

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "accelerations", "comparison", "gaps", "overview", "spacing_errors", "speeds", "time_space",
]  # fmt: skip

#: variables between a car and the one ahead: their lines are named after the pair
_OF_PAIRS = ("gap", "relative_speed", "spacing_error", "policy_error")

#: points drawn in all, and least and most points of a line; more is invisible and makes files large
_POINTS, _LEAST, _MOST = 1_000_000, 600, 4000

#: pieces of which coloured trajectories are drawn, in all
_SEGMENTS = 200_000


def speeds(dataset: xr.Dataset, ax: Axes | None = None) -> Figure:
    """Draw the speed [m/s] of every car over time [s].

    Args:
        dataset: trajectories of `headway.simulate`.
        ax: axes to draw on, without a title; a figure of its own if None.
    """
    return _one(dataset, "speed", ax)


def accelerations(dataset: xr.Dataset, ax: Axes | None = None) -> Figure:
    """Draw the acceleration [m/s²] of every car over time [s].

    Args:
        dataset: trajectories of `headway.simulate`.
        ax: axes to draw on, without a title; a figure of its own if None.
    """
    return _one(dataset, "acceleration", ax)


def gaps(dataset: xr.Dataset, ax: Axes | None = None) -> Figure:
    """Draw the gap [m], bumper to bumper, of every pair of cars over time [s].

    Args:
        dataset: trajectories of `headway.simulate`.
        ax: axes to draw on, without a title; a figure of its own if None.
    """
    return _one(dataset, "gap", ax)


def spacing_errors(dataset: xr.Dataset, ax: Axes | None = None) -> Figure:
    """Draw the spacing error [m], gap minus gap at the start, of every pair of cars over time [s].

    Args:
        dataset: trajectories of `headway.simulate`.
        ax: axes to draw on, without a title; a figure of its own if None.
    """
    return _one(dataset, "spacing_error", ax)


def time_space(dataset: xr.Dataset, ax: Axes | None = None, moving: bool | None = None) -> Figure:
    """Draw the position [m] of every car over time [s], coloured by speed [m/s].

    Args:
        dataset: trajectories of `headway.simulate`.
        ax: axes to draw on, without a title; a figure of its own if None.
        moving: whether to subtract the leader's mean speed, which shows waves in a platoon that drives steadily;
            if None, it is subtracted where the leader's speed stays within a quarter of its mean.
    """
    from matplotlib.collections import LineCollection

    _check(dataset, "position", "speed")
    position, speed = _values(dataset, "position"), _values(dataset, "speed")
    time = dataset["time"].values
    front = speed[0]
    mean = float(np.nanmean(front))
    if moving is None:
        moving = bool(np.nanmax(np.abs(front - mean)) <= 0.25 * mean)
    figure, ax = style.canvas(ax, 3.6, _title(dataset))
    count = position.shape[0]
    step = max(1, time.size * count // _SEGMENTS, time.size // 1500)
    shown = np.unique(np.append(np.arange(0, time.size, step), time.size - 1))
    t, x, v = time[shown], position[:, shown], speed[:, shown]
    if moving:
        x = x - mean * (t - time[0])
    points = np.stack(np.broadcast_arrays(t, x), axis=-1)
    segments = np.stack((points[:, :-1], points[:, 1:]), axis=2).reshape(-1, 2, 2)
    colours = (0.5 * (v[:, :-1] + v[:, 1:])).ravel()
    finite = np.isfinite(segments).all(axis=(1, 2)) & np.isfinite(colours)
    lines = LineCollection(
        list(segments[finite]), cmap=style.speed_map(), linewidths=_crowded_width(x), capstyle="round", rasterized=True
    )
    lines.set_array(colours[finite])
    ax.add_collection(lines)
    ax.autoscale_view()
    ax.margins(x=0)
    _mark_collisions(ax, dataset, "position", mean if moving else 0.0)
    style.axes_style(ax)
    style.bar_style(figure.colorbar(lines, ax=ax, pad=0.02, aspect=25), style.axis_label(dataset, "speed"))
    ax.set_xlabel(style.axis_label(dataset, "time"))
    ax.set_ylabel(f"Position − {mean:.4g} m/s · t [m]" if moving else style.axis_label(dataset, "position"))
    return figure


def overview(dataset: xr.Dataset) -> Figure:
    """Draw four views of one run: speeds, spacing errors, gaps, and positions coloured by speed.

    Args:
        dataset: trajectories of `headway.simulate`.
    """
    _check(dataset, "speed", "spacing_error", "gap", "position")
    figure = style.new_figure(5.6, _title(dataset))
    axes = figure.subplots(2, 2, sharex=True)
    speeds(dataset, axes[0, 0])
    spacing_errors(dataset, axes[0, 1])
    gaps(dataset, axes[1, 0])
    time_space(dataset, axes[1, 1])
    for ax in axes[0]:
        ax.set_xlabel("")
    return figure


def comparison(datasets: Mapping[str, xr.Dataset], what: Sequence[str] = ("spacing_error", "speed")) -> Figure:
    """Draw several runs, one row each, with one column for each variable.

    The time axis [s] is shared; values have the scale of their own run, as models differ by orders
    of magnitude.

    Args:
        datasets: trajectories by the name of their row.
        what: names of variables.

    Raises:
        HeadwayError: without a dataset or a variable, or where a dataset lacks one.
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
    sizes = {dataset.sizes["vehicle"] for dataset in datasets.values()}
    for i, dataset in enumerate(datasets.values()):
        for ax, variable in zip(axes[i], what, strict=True):
            # platoons of one size share the key at the top
            _lines(ax, dataset, variable, keyed=len(sizes) > 1)
            if len(sizes) == 1 and i == 0:
                _key(ax, dataset, variable, any(map(_collisions, datasets.values())))
    for ax in axes[:-1].flat:
        ax.set_xlabel("")
    for ax, name in zip(axes[:, 0], datasets, strict=True):
        ax.annotate(
            name, (0, 0.5), xycoords=(ax.yaxis.label, "axes fraction"), xytext=(-3, 0), textcoords="offset points",
            rotation=90, ha="right", va="center", fontsize=style.LARGE, fontweight="bold",
        )  # fmt: skip
    figure.align_ylabels(axes[:, 0])
    return figure


def _one(dataset: xr.Dataset, name: str, ax: Axes | None) -> Figure:
    _check(dataset, name)
    figure, ax = style.canvas(ax, 3.2, _title(dataset))
    _lines(ax, dataset, name)
    return figure


def _title(dataset: xr.Dataset) -> str:
    return str(dataset.attrs.get("title", ""))


def _check(dataset: xr.Dataset, *names: str) -> None:
    """Refuse a dataset that cannot be drawn."""
    for name in (*names, "time", "vehicle"):
        if name not in dataset.variables:
            held = ", ".join(str(v) for v in dataset.data_vars) or "no variables"
            raise HeadwayError(f"the dataset has no {name!r} to draw; it holds {held}")
    for name in names:
        if set(dataset[name].dims) != {"vehicle", "time"}:
            dims = ", ".join(str(d) for d in dataset[name].dims) or "none"
            raise HeadwayError(f"{name!r} has the dimensions {dims}; a figure needs vehicle and time")
    if not dataset.sizes["time"]:
        raise HeadwayError("the dataset has no times to draw")


def _values(dataset: xr.Dataset, name: str) -> Array:
    """Return the values (vehicle, time) of a variable."""
    return np.asarray(dataset[name].transpose("vehicle", "time").values, dtype=float)


def _drawn(dataset: xr.Dataset, name: str) -> list[int]:
    """Return the rows to draw: all cars, or those with a car ahead."""
    cars = dataset["vehicle"].values
    return [row for row, car in enumerate(cars) if car != 0 or name not in _OF_PAIRS]


def _colours(dataset: xr.Dataset) -> list[Any]:
    """Return the colour of each row: the leader's, and the followers' from front to back."""
    cars = dataset["vehicle"].values
    first, last = _followers(dataset)
    shade = style.cars_map()
    shades = shade((cars - first) / max(last - first, 1))
    return [style.LEADER if car == 0 else tuple(colour) for car, colour in zip(cars, shades, strict=True)]


def _followers(dataset: xr.Dataset) -> tuple[int, int]:
    """Return the first and the last follower's number."""
    cars = [int(car) for car in dataset["vehicle"].values if car != 0] or [1]
    return min(cars), max(cars)


def _lines(ax: Axes, dataset: xr.Dataset, name: str, keyed: bool = True) -> None:
    """Draw one line for each car or pair over time, with axes, collisions and (if `keyed`) a key."""
    from matplotlib.collections import LineCollection

    rows, colours = _drawn(dataset, name), _colours(dataset)
    time, shown = _thin(dataset["time"].values, _values(dataset, name)[rows])
    keyed_by_name = len(rows) <= style.KEYED + 1
    # the leader is drawn on top of few others and beneath many
    order = sorted(range(len(rows)), key=lambda i: (colours[rows[i]] == style.LEADER) == keyed_by_name)
    width = _line_width(len(rows))
    lines = LineCollection(
        [np.column_stack((time[i], shown[i])) for i in order],
        colors=[colours[rows[i]] for i in order],
        linewidths=[width * (1.2 if colours[rows[i]] == style.LEADER else 1.0) for i in order],
        rasterized=len(rows) > 100,
        zorder=2,
    )
    ax.add_collection(lines)
    if name in ("spacing_error", "policy_error", "relative_speed", "acceleration"):
        ax.axhline(0.0, color="0.6", linewidth=0.6, zorder=1)
    ax.autoscale_view()
    ax.margins(x=0)
    _mark_collisions(ax, dataset, name)
    style.axes_style(ax)
    ax.set_xlabel(style.axis_label(dataset, "time"))
    ax.set_ylabel(style.axis_label(dataset, name))
    if keyed:
        _key(ax, dataset, name, bool(_collisions(dataset)))


def _key(ax: Axes, dataset: xr.Dataset, name: str, crosses: bool) -> None:
    """Draw the key of the lines, by name for few cars, a colour bar for many; and of the crosses."""
    rows, cars, colours = _drawn(dataset, name), dataset["vehicle"].values, _colours(dataset)
    pairs = name in _OF_PAIRS
    entries: dict[str, Any] = {}
    if len(rows) <= style.KEYED + 1:
        entries["Cars" if pairs else "Car"] = None
        for row in rows:
            label = f"{cars[row] - 1}-{cars[row]}" if pairs else f"{cars[row]}"
            entries[label] = {"color": colours[row], "linewidth": 2.0}
    else:
        style.cars_bar(ax, *_followers(dataset))
        if not pairs and 0 in cars:
            entries["leader"] = {"color": style.LEADER, "linewidth": 2.0}
    if crosses:
        entries["collision"] = style.CROSS
    if entries:
        style.key_above(ax, entries)


def _line_width(count: int) -> float:
    """Return the width [pt] of `count` lines."""
    return float(np.clip(6.0 / count**0.5, 0.35, 1.3))


def _crowded_width(position: Array) -> float:
    """Return the width [pt] of trajectories in a panel about 150 points high, so that neighbours stay apart."""
    extent = float(np.nanmax(position) - np.nanmin(position))
    spacing = np.abs(np.diff(position, axis=0))
    if not extent > 0 or not np.isfinite(spacing).any():
        return 1.5
    return float(np.clip(0.6 * 150.0 * float(np.nanmedian(spacing)) / extent, 0.35, 1.6))


def _thin(time: Array, values: Array) -> tuple[Array, Array]:
    """Return fewer times and values (line, point) that draw the same picture: extremes stay."""
    size = int(np.clip(_POINTS // max(len(values), 1), _LEAST, _MOST))
    if time.size <= size:
        return np.broadcast_to(time, values.shape), values
    # in each of size/2 stretches of time: its least and its greatest value, in order of time
    stretch = -(-time.size * 2 // size)
    count = -(-time.size // stretch)
    padded = np.full((len(values), count * stretch), np.nan)
    padded[:, : time.size] = values
    blocks = padded.reshape(len(values), count, stretch)
    low = np.where(np.isnan(blocks), np.inf, blocks).argmin(axis=2)
    high = np.where(np.isnan(blocks), -np.inf, blocks).argmax(axis=2)
    pick = np.sort(np.stack((low, high), axis=2), axis=2) + stretch * np.arange(count)[:, None]
    pick = np.minimum(pick.reshape(len(values), -1), time.size - 1)
    pick[:, 0], pick[:, -1] = 0, time.size - 1
    return time[pick], np.take_along_axis(values, pick, axis=1)


def _collisions(dataset: xr.Dataset) -> list[tuple[int, float]]:
    """Return row and time [s] of every collision within the times of the dataset."""
    if "collision_time" not in dataset.variables:
        return []
    moments = np.atleast_1d(np.asarray(dataset["collision_time"].values, dtype=float))
    first, last = dataset["time"].values[[0, -1]]
    return [(row, float(t)) for row, t in enumerate(moments) if first <= t <= last]


def _mark_collisions(ax: Axes, dataset: xr.Dataset, name: str, frame_speed: float = 0.0) -> None:
    """Draw a cross where a car met the one ahead, at its last value; few have the pair as label."""
    from matplotlib.patheffects import withStroke

    collisions = _collisions(dataset)
    if not collisions:
        return
    time, values, cars = dataset["time"].values, _values(dataset, name), dataset["vehicle"].values
    for row, moment in collisions:
        finite = np.flatnonzero(np.isfinite(values[row]) & (time <= moment))
        if not finite.size:
            continue
        value = values[row, finite[-1]] - frame_speed * (time[finite[-1]] - time[0])
        ax.plot([moment], [value], **style.CROSS, zorder=4, clip_on=False)
        if len(collisions) <= style.KEYED:
            late = moment > 0.9 * time[-1] + 0.1 * time[0]
            ax.annotate(
                f"{cars[row] - 1}-{cars[row]}", (moment, value), xytext=(-4 if late else 4, 6),
                textcoords="offset points", ha="right" if late else "left", va="center", fontsize=style.SMALL,
                color=style.COLLISION, path_effects=[withStroke(linewidth=2, foreground="white")], zorder=5,
            )  # fmt: skip
