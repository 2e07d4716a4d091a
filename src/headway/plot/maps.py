"""Figures of stability maps: verdicts as areas, values as a field, the traced boundary as a line.

Areas are dark where a vehicle is locally unstable, of middle lightness where a string is unstable and
light where it is stable; hatched where there is no equilibrium. The key above names them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from headway.errors import HeadwayError, shorten, unknown_name
from headway.plot import regions, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from headway.literature.barhoumi2025.maps import PaperMap
    from headway.theory.map import StabilityMap

__all__ = ["panels", "paper_map", "stability_map"]

Array = NDArray[np.float64]

#: most planes of a map of three axes that are drawn side by side, and planes of a view in space
_PLANES, _SLICES = 9, 16
#: axes whose label says what they are; others get their symbol
_WORDS = ("approach", "delay", "gap", "lag", "omega", "speed")
_TITLES = {"string": "string stability", "local": "local stability", "printed": "printed condition"}
_LINE: dict[str, Any] = {"color": "black", "linewidth": 1.3}
_SECOND: dict[str, Any] = {"color": "black", "linewidth": 0.9, "linestyle": (0, (3, 1.5))}


def stability_map(verdicts: StabilityMap, point: Mapping[str, float] | None = None, ax: Axes | None = None) -> Figure:
    """Draw a stability map: one axis as a curve over bands, two as a plane, three as up to nine planes of the third.

    Maps of the gain and of the critical delay show it as a field under the boundary, others the classes.

    Args:
        verdicts: the map.
        point: a value for each axis, marked with a star.
        ax: axes to draw on, without a title; a map of three axes needs a figure of its own.

    Raises:
        HeadwayError: for a point that names other axes or lies off the map.
    """
    _check(verdicts, point)
    names = list(verdicts.axes)
    if len(names) == 3 and ax is not None:
        raise HeadwayError("a map of three axes is drawn as several planes; it cannot share given axes")
    if len(names) == 3:
        return _planes(verdicts, point)
    figure, ax = style.canvas(ax, 3.2 if len(names) == 1 else 4.4, _title(verdicts), _facts(verdicts))
    _draw(ax, verdicts, point)
    return figure


def panels(
    maps: Mapping[str, StabilityMap] | Sequence[tuple[str, StabilityMap]], caption: str = "", title: str = ""
) -> Figure:
    """Draw several maps side by side, each under its title; maps of three axes in space.

    Args:
        maps: the maps by title, or pairs of title and map.
        caption: stands under the panels.
        title: stands above the figure.

    Raises:
        HeadwayError: if there is no map.
    """
    pairs = list(maps.items()) if isinstance(maps, Mapping) else list(maps)
    if not pairs or not all(isinstance(pair, tuple) and len(pair) == 2 for pair in pairs):
        raise HeadwayError("panels needs at least one map, each with its title")
    for name, verdicts in pairs:
        try:
            _check(verdicts, None)
        except HeadwayError as error:
            raise HeadwayError(f"{name}: {error}") from None
    columns = len(pairs) if len(pairs) <= 3 else math.ceil(len(pairs) / 2)
    rows = math.ceil(len(pairs) / columns)
    space = any(len(verdicts.axes) == 3 for _, verdicts in pairs)
    text = style.wrapped(caption, style.WIDTH)
    height = 0.4 + rows * (3.2 if space else 2.8) + 0.15 * text.count("\n")
    figure = style.new_figure(height, title)
    for i, (name, verdicts) in enumerate(pairs):
        if len(verdicts.axes) == 3:
            _solid(figure.add_subplot(rows, columns, i + 1, projection="3d"), verdicts, name)
        else:
            _draw(figure.add_subplot(rows, columns, i + 1), verdicts, None, name)
    if caption:
        figure.supxlabel(text, x=0.01, ha="left", fontsize=style.SMALL, linespacing=1.3)
    return figure


def paper_map(paper: PaperMap) -> Figure:
    """Draw a map of `headway.literature.barhoumi2025`: the printed condition beside the true verdicts.

    Args:
        paper: the map, e.g. of `headway.literature.barhoumi2025.maps.reproduced_map`.
    """
    return panels(paper.panels, paper.caption, paper.title)


def _draw(ax: Axes, verdicts: StabilityMap, point: Mapping[str, float] | None, heading: str = "") -> None:
    """Draw a map of one or two axes with everything around it."""
    if len(verdicts.axes) == 1:
        entries = _curve(ax, verdicts, point)
    else:
        entries, field = _plane(ax, verdicts, point, _scale(verdicts))
        _label(ax, verdicts)
        if field is not None:
            _bar(ax.figure.colorbar(field, ax=ax, pad=0.02, aspect=25, extend=_extend(field)), verdicts)
    style.key_above(ax, entries, heading)


def _curve(ax: Axes, verdicts: StabilityMap, point: Mapping[str, float] | None) -> dict[str, Any]:
    """Draw the value over the one axis, on bands of the verdicts, and return the key."""
    ((name, values),) = verdicts.axes.items()
    codes, entries = verdicts.dataset.verdict.values, {}
    for code in map(int, np.unique(codes)):
        look = style.class_look(code, len(verdicts.classes))
        entries[verdicts.classes[code]] = look
        for low, high in regions.intervals(codes, code, values, verdicts.boundary.get(verdicts.classes[code], ())):
            ax.axvspan(low, high, zorder=0, **look)
    for lines in verdicts.boundary.values():
        for line in lines:
            ax.axvline(float(line[0, 0]), zorder=1, **{**_LINE, "linewidth": 0.7})
    style.axes_style(ax)
    ax.grid(False)
    ax.set(xlim=(values[0], values[-1]), xlabel=_axis_label(verdicts, name))
    shown = _value(verdicts)
    if shown is None:
        ax.set_yticks([])
        height = 0.5
    else:
        value = verdicts.dataset[shown].values
        neutral = 1.0 if shown == "gain" else 0.0
        ax.axhline(neutral, color="0.35", linewidth=0.6, zorder=2)
        ax.plot(values, np.where(np.isfinite(value), value, np.nan), path_effects=style.halo(), zorder=3, **_LINE)
        ax.set_ylabel(style.axis_label(verdicts.dataset, shown))
        height = float(np.interp(point[name], values, value)) if point else 0.0
    if point is not None and math.isfinite(height):
        ax.plot([point[name]], [height], **style.POINT, zorder=5, clip_on=False)
        entries[_words(point)] = style.POINT
    return entries


def _plane(
    ax: Axes, verdicts: StabilityMap, point: Mapping[str, float] | None, scale: Any
) -> tuple[dict[str, Any], Any]:
    """Draw areas or a field, and the boundary, over two axes; return the key and the field, if there is one."""
    from matplotlib.patches import PathPatch

    (first, x), (second, y) = verdicts.axes.items()
    codes, classes = verdicts.dataset.verdict.values, verdicts.classes
    entries: dict[str, Any] = {}
    field = None
    # from the first of these on, the classes are covered by the field
    covered = len(classes) if scale is None else (2 if verdicts.what == "gain" else 1)
    for code in map(int, np.unique(codes)):
        patch = PathPatch(
            regions.area(codes, code, (x, y), verdicts.boundary.get(classes[code], ())),
            zorder=0.5, **style.class_look(min(code, covered), len(classes)),
        )  # fmt: skip
        if code < covered:
            ax.add_patch(patch)
            entries[classes[code]] = style.class_look(code, len(classes))
        elif field is None:
            value = verdicts.dataset[_value(verdicts)].values
            field = ax.pcolormesh(
                x, y, np.ma.masked_invalid(np.where(codes >= covered, value, np.nan)).T, norm=scale,
                cmap=style.speed_map(), shading="nearest", rasterized=True, zorder=0.6,
            )  # fmt: skip
    for i, (name, lines) in enumerate(verdicts.boundary.items()):
        look = _LINE if i == len(verdicts.boundary) - 1 else _SECOND
        for line in lines:
            ax.plot(*line.T, zorder=2, path_effects=style.halo() if field is not None else None, **look)
        if field is not None and name not in entries:
            entries[f"edge of '{name}'"] = look
    if point is not None:
        ax.plot([point[first]], [point[second]], **style.POINT, zorder=5, clip_on=False)
        entries[_words(point)] = style.POINT
    style.axes_style(ax)
    ax.grid(False)
    ax.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    return entries, field


def _planes(verdicts: StabilityMap, point: Mapping[str, float] | None) -> Figure:
    """Draw planes of the third axis side by side, on one scale and with one key."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    names = list(verdicts.axes)
    third = verdicts.axes[names[2]]
    chosen = _evenly(third.size, _PLANES)
    if point is not None:
        near = int(np.argmin(np.abs(third - point[names[2]])))
        chosen[int(np.argmin(np.abs(np.array(chosen) - near)))] = near
    columns = min(3, len(chosen))
    rows = math.ceil(len(chosen) / columns)
    figure = style.new_figure(1.1 + 1.75 * rows, _title(verdicts), _facts(verdicts))
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    scale, entries, field = _scale(verdicts), {}, None
    for i, ax in enumerate(axes.flat):
        if i >= len(chosen):
            ax.set_visible(False)
            continue
        here = point if point is not None and chosen[i] == near else None
        added, drawn = _plane(ax, _cut(verdicts, chosen[i]), here, scale)
        entries.update(added)
        field = drawn if drawn is not None else field
        ax.set_title(f"{names[2]} = {third[chosen[i]]:.4g} {_unit(verdicts, names[2])}".rstrip(), fontsize=style.SMALL)
        ax.tick_params(labelbottom=i + columns >= len(chosen))
        if i + columns >= len(chosen):
            ax.set_xlabel(style.wrapped(_axis_label(verdicts, names[0]), 0.7 * style.WIDTH / columns))
    figure.supylabel(_axis_label(verdicts, names[1]), fontsize=style.SMALL)
    if field is not None:
        _bar(figure.colorbar(field, ax=axes, pad=0.02, aspect=35, extend=_extend(field)), verdicts)
    handles = [
        Patch(**{**look, "edgecolor": "0.4", "linewidth": 0.5}) if "facecolor" in look else Line2D([], [], **look)
        for look in entries.values()
    ]
    figure.legend(
        handles, list(entries), loc="outside lower center", ncols=len(entries), fontsize=style.SMALL, frameon=False,
        handlelength=1.6,
    )  # fmt: skip
    return figure


def _solid(ax: Any, verdicts: StabilityMap, heading: str) -> None:
    """Draw the best class of a map of three axes in space: its area and outline in planes of the third."""
    from matplotlib.ticker import MaxNLocator
    from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection  # type: ignore[import-untyped]

    # planes are drawn from the lowest to the highest, as they cover each other seen from above
    ax.computed_zorder = False
    (first, x), (second, y), (third, z) = verdicts.axes.items()
    code = len(verdicts.classes) - 1
    name = verdicts.classes[code]
    shade = style.cars_map()
    for k in _evenly(z.size, _SLICES):
        cut = _cut(verdicts, k)
        colour, order = shade(k / (z.size - 1)), k / z.size
        path = regions.area(cut.dataset.verdict.values, code, (x, y), cut.boundary.get(name, ()))
        pieces = [np.column_stack((p, np.full(len(p), z[k]))) for p in map(np.asarray, path.to_polygons())]
        if pieces:
            ax.add_collection3d(Poly3DCollection(pieces, facecolor=colour, alpha=0.13, edgecolor="none", zorder=order))
        lines = [np.column_stack((line, np.full(len(line), z[k]))) for line in cut.boundary.get(name, ())]
        if lines:
            ax.add_collection3d(Line3DCollection(lines, colors=[colour], linewidths=1.4, zorder=order))
    ax.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]), zlim=(z[0], z[-1]))
    for axis, named in zip((ax.xaxis, ax.yaxis, ax.zaxis), (first, second, third), strict=True):
        axis.set_label_text(f"{named} [{_unit(verdicts, named)}]".replace(" []", ""), fontsize=style.SMALL)
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.set_major_locator(MaxNLocator(4, prune="both"))
    ax.tick_params(labelsize=style.SMALL, pad=0)
    ax.set_box_aspect((1.0, 1.0, 0.9), zoom=0.85)
    ax.view_init(elev=24, azim=-60)
    look = {"color": shade(0.5), "linewidth": 1.4}
    style.key_above(ax, {f"edge of '{name}' in planes of {third}": look}, heading)


def _cut(verdicts: StabilityMap, k: int) -> StabilityMap:
    """Return the plane of a map of three axes at value `k` of the third."""
    from headway.theory.map import StabilityMap

    third = list(verdicts.axes)[2]
    value = verdicts.axes[third][k]
    lines = {
        name: tuple(line[:, :2] for line in parts if line[0, 2] == value) for name, parts in verdicts.boundary.items()
    }
    return StabilityMap(verdicts.dataset.isel({third: k}), {name: parts for name, parts in lines.items() if parts})


def _evenly(size: int, most: int) -> list[int]:
    """Return at most `most` of `size` places, evenly chosen, the ends among them."""
    return [round(i) for i in np.linspace(0, size - 1, min(size, most))]


# -- values and words ------------------------------------------------------------------------------


def _value(verdicts: StabilityMap) -> str | None:
    """Return the variable beside the verdict."""
    return next((str(name) for name in verdicts.dataset.data_vars if name != "verdict"), None)


def _scale(verdicts: StabilityMap) -> Any:
    """Return the scale of a field without its rare extremes, logarithmic where a gain spans much; None for classes."""
    from matplotlib.colors import LogNorm, Normalize

    if verdicts.what not in ("gain", "critical_delay"):
        return None
    value = verdicts.dataset[verdicts.what].values
    value = value[np.isfinite(value)]
    if not value.size:
        return None
    low, high = (float(q) for q in np.percentile(value, (2, 98) if verdicts.what == "gain" else (0, 98)))
    high = max(high, low + 1e-6 * (1.0 + abs(low)))
    return (
        LogNorm(max(low, 1e-3 * high), high) if verdicts.what == "gain" and high > 5.0 * low else Normalize(low, high)
    )


def _extend(field: Any) -> str:
    """Return at which ends of the bar values go on."""
    value = field.get_array().compressed()
    below, above = value.min(initial=field.norm.vmin) < field.norm.vmin, value.max(initial=0.0) > field.norm.vmax
    return {(True, True): "both", (True, False): "min", (False, True): "max", (False, False): "neither"}[below, above]


def _bar(bar: Any, verdicts: StabilityMap) -> None:
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import LogLocator, NullLocator, ScalarFormatter

    style.bar_style(bar, style.axis_label(verdicts.dataset, verdicts.what))
    if isinstance(bar.norm, LogNorm):
        bar.ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        bar.ax.yaxis.set_major_formatter(ScalarFormatter())
        bar.ax.yaxis.set_minor_locator(NullLocator())


def _label(ax: Axes, verdicts: StabilityMap) -> None:
    """Label the axes on as many lines as the room along them takes."""
    first, second = verdicts.axes
    # before they are laid out, without what stands around them
    width, height = ax.get_position().size * ax.get_figure(root=True).get_size_inches()  # type: ignore[union-attr]
    ax.set_xlabel(style.wrapped(_axis_label(verdicts, first), 0.85 * width))
    ax.set_ylabel(style.wrapped(_axis_label(verdicts, second), 0.75 * height))


def _axis_label(verdicts: StabilityMap, name: str) -> str:
    label = style.axis_label(verdicts.dataset, name)
    words, bracket, unit = label.partition(" [")
    symbol = words.split()[-1]
    # some words end in a symbol themselves
    named = name in _WORDS or name.startswith("delay.") or symbol.lower() == name.lower() or not symbol.isascii()
    return label if named else f"{words} {name}{bracket}{unit}"


def _unit(verdicts: StabilityMap, name: str) -> str:
    unit = str(verdicts.dataset[name].attrs.get("units", ""))
    return "" if unit == "1" else unit


def _title(verdicts: StabilityMap) -> str:
    words = _TITLES.get(verdicts.what) or str(verdicts.dataset[verdicts.what].attrs.get("long_name", verdicts.what))
    return ": ".join(part for part in (str(verdicts.dataset.attrs.get("model", "")), words) if part)


def _facts(verdicts: StabilityMap) -> str:
    """Write what the map holds fixed."""
    attrs = verdicts.dataset.attrs
    parts = [str(attrs["parameters"])] if attrs.get("parameters") else []
    parts += [f"{n} {attrs[n]:g} {u}" for n, u in (("speed", "m/s"), ("gap", "m"), ("omega", "rad/s")) if n in attrs]
    delay = str(attrs.get("delay", ""))
    if delay and "delay" in verdicts.axes:
        parts.append("all on-board signals late alike, the radio current")
    elif delay and verdicts.what == "critical_delay":
        # a pattern is scaled; where there is none, all on-board signals are late alike
        parts.append(f"delays in the ratio of {delay}" if delay[0].isalpha() else "all on-board signals late alike")
    elif delay:
        other = any(n.startswith(("delay.", "radio_delay")) for n in verdicts.axes)
        parts.append(f"other signals late by {delay}" if other else
                     f"delay {delay}")  # fmt: skip
    if attrs.get("lag") and "lag" not in verdicts.axes:
        parts.append(f"lag {attrs['lag']:g} s")
    return "; ".join(parts)


def _words(point: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {value:.4g}" for name, value in point.items())


def _check(verdicts: Any, point: Mapping[str, float] | None) -> None:
    """Refuse what is no map, and points off it."""
    from headway.theory.map import StabilityMap

    if not isinstance(verdicts, StabilityMap):
        raise HeadwayError(f"a figure of a map needs a StabilityMap, not {shorten(verdicts)}")
    if point is None:
        return
    for name in point:
        if name not in verdicts.axes:
            raise unknown_name("axis of the map", name, verdicts.axes)
    for name, values in verdicts.axes.items():
        if name not in point:
            raise HeadwayError(f"the point to be marked has no value for the axis {name}")
        if not values[0] <= point[name] <= values[-1]:
            raise HeadwayError(
                f"the point {name} = {point[name]:g} is not on the map, which reaches from "
                f"{values[0]:g} to {values[-1]:g}"
            )
