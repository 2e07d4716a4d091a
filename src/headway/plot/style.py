"""How figures look: sizes, colours that stay apart in grey and for colour-blind eyes, axes, keys.

The leader is black. Followers take a map whose lightness rises evenly down the platoon, so that
their order is readable without colour; speeds take another one. Verdicts are dark where bad and
light where good. Nothing here touches matplotlib's global settings.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from headway.schema import COORDINATES, VARIABLES

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

__all__ = [
    "COLLISION", "CROSS", "KEYED", "LARGE", "LEADER", "POINT", "SERIES", "SMALL", "WIDTH", "axes_style", "axis_label",
    "bar_style", "canvas", "cars_bar", "cars_map", "class_look", "halo", "key_above", "new_figure", "series",
    "speed_map", "wrapped",
]  # fmt: skip

#: width [in] of a figure across two columns of print, and the font sizes [pt] at that width
WIDTH, SMALL, LARGE = 7.2, 8.0, 9.5

#: colours of the leader and of a collision
LEADER, COLLISION = "black", "#d55e00"

#: how a collision is marked
CROSS: dict[str, Any] = {
    "linestyle": "none", "marker": "x", "color": COLLISION, "markersize": 6.0, "markeredgewidth": 1.6,
}  # fmt: skip

#: most followers that get a line of their own in the key; a colour bar serves more
KEYED = 8


#: how a point of interest is marked
POINT: dict[str, Any] = {
    "linestyle": "none", "marker": "*", "markerfacecolor": "white", "markeredgecolor": "black", "markersize": 10.0,
    "markeredgewidth": 1.0,
}  # fmt: skip

#: colours and dashes of few curves, each with its name, dark to light
SERIES: tuple[dict[str, Any], ...] = (
    {"color": "black", "linestyle": "-"},
    {"color": "#0072b2", "linestyle": (0, (5, 1.5))},
    {"color": "#d55e00", "linestyle": (0, (2.5, 1.2))},
    {"color": "#cc79a7", "linestyle": (0, (6, 1.5, 1.2, 1.5))},
    {"color": "#009e73", "linestyle": (0, (1, 1))},
    {"color": "#e69f00", "linestyle": "-"},
)

#: fills of verdicts, worst first; their lightness differs by a quarter and more
_FILLS = ("#44546f", "#e3985a", "#dcecf5")


def class_look(code: int, count: int) -> dict[str, Any]:
    """Return the look of the area of a class of verdicts.

    Args:
        code: of the class; 0 is "no answer", the last one the best.
        count: number of classes.
    """
    if code == 0:
        return {"facecolor": "white", "edgecolor": "0.6", "hatch": "/////", "linewidth": 0.0}
    return {"facecolor": _FILLS[code - count], "edgecolor": "none", "linewidth": 0.0}


def new_figure(height: float, title: str = "", subtitle: str = "") -> Figure:
    """Return an empty figure of the printed width.

    Args:
        height: of the figure [in].
        title: above everything.
        subtitle: small and wrapped, beneath the title.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), layout="constrained", facecolor="white")
    if title and not subtitle:
        figure.suptitle(title, fontsize=LARGE, fontweight="bold")
    elif title:
        # one text cannot be bold in parts: the layout makes room for the second, whose first line is left free
        figure.suptitle("\n" + wrapped(subtitle, WIDTH), fontsize=SMALL, linespacing=1.35)
        figure.text(0.5, 1.0 - 0.04 / height, title, fontsize=LARGE, fontweight="bold", ha="center", va="top")
    return figure


def canvas(ax: Axes | None, height: float, title: str, subtitle: str = "") -> tuple[Figure, Axes]:
    """Return the figure of axes and these axes, or new ones under a title.

    Args:
        ax: the axes; None for a new figure.
        height: of a new figure [in].
        title: of a new figure.
        subtitle: of a new figure.
    """
    if ax is not None:
        return ax.get_figure(root=True), ax  # type: ignore[return-value]  # axes given have a figure
    figure = new_figure(height, title, subtitle)
    return figure, figure.add_subplot()


def series(count: int) -> list[dict[str, Any]]:
    """Return the looks of `count` curves: dashes of their own for few, colours from dark to light for many."""
    if count <= len(SERIES):
        return [{**look, "linewidth": 1.4} for look in SERIES[:count]]
    return [{"color": colour, "linewidth": 1.2} for colour in cars_map()(np.linspace(0.0, 1.0, count))]


def wrapped(text: str, width: float) -> str:
    """Return `text` on lines that fit into `width` [in] in small print."""
    return "\n".join(textwrap.wrap(text, max(int(72.0 * width / (0.52 * SMALL)), 12)))


def halo() -> list[Any]:
    """Return a white rim that keeps lines and words readable on any ground."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=2.5, foreground="white")]


def axes_style(ax: Axes) -> None:
    """Give axes a thin grid behind the lines, two spines and small labels."""
    ax.grid(True, color="0.88", linewidth=0.5)
    ax.set_axisbelow(True)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        ax.spines[side].set(color="0.4", linewidth=0.6)
    ax.tick_params(labelsize=SMALL, color="0.4", width=0.6, length=2.5)
    for label in (ax.xaxis.label, ax.yaxis.label):
        label.set_fontsize(SMALL)


def axis_label(dataset: xr.Dataset, name: str) -> str:
    """Return name and unit of a variable, e.g. `Spacing error [m]`, by its attributes or else by the schema.

    Args:
        dataset: holds the variable.
        name: of the variable.
    """
    attrs = dataset[name].attrs
    entry = {**VARIABLES, **COORDINATES}.get(name)
    meaning = attrs.get("long_name") or (entry.long_name if entry else name)
    units = attrs.get("units", entry.unit if entry else "")
    words = re.split("[:,;]", str(meaning))[0]
    return f"{words[:1].upper()}{words[1:]}" + (f" [{units}]" if units not in ("", "1") else "")


def cars_map() -> Colormap:
    """Return the colours of followers, dark ahead and light behind, without ends that look black or white."""
    return _part_of("viridis", 0.1, 0.87)


def speed_map() -> Colormap:
    """Return the colours of speeds, light where slow and dark where fast."""
    return _part_of("plasma_r", 0.12, 1.0)


def _part_of(name: str, low: float, high: float) -> Colormap:
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps[name](np.linspace(low, high, 256)), name=f"{name} {low:g} to {high:g}")


def key_above(ax: Axes, entries: Mapping[str, Any], heading: str = "") -> None:
    """Draw a key above axes, on as many rows as the width needs.

    Args:
        ax: the axes.
        entries: the look of a line or an area by label; None for a mere word.
        heading: stands on a row of its own above.
    """
    from matplotlib.lines import Line2D
    from matplotlib.offsetbox import AnchoredOffsetbox, DrawingArea, HPacker, TextArea, VPacker
    from matplotlib.patches import Rectangle

    subplot = ax.get_subplotspec()
    share = 1.0 / subplot.get_gridspec().ncols if subplot is not None else ax.get_position().width
    room = max(72.0 * (share * float(ax.get_figure(root=True).get_figwidth()) - 1.0), 72.0)  # type: ignore[union-attr]  # drawn axes have one
    rows: list[list[Any]] = [[]]
    used = 0.0
    for label, look in entries.items():
        need = (12.0 if look else 0.0) + 0.62 * SMALL * len(label) + 4.0
        if used + need > room and rows[-1]:
            rows.append([])
            used = 0.0
        used += need
        parts: list[Any] = [TextArea(label, textprops={"fontsize": SMALL})]
        if look:
            area = DrawingArea(9.0, 6.0)
            middle = "marker" in look
            if "facecolor" in look:
                area.add_artist(Rectangle((0.5, -0.5), 8.0, 7.0, **{**look, "edgecolor": "0.4", "linewidth": 0.5}))
            else:
                area.add_artist(Line2D([4.5] if middle else [0.5, 8.5], [3.0] if middle else [3.0, 3.0], **look))
            parts.insert(0, area)
        rows[-1].append(HPacker(children=parts, align="center", pad=0, sep=2.5))
    lines: list[Any] = [HPacker(children=row, align="center", pad=0, sep=5.0) for row in rows if row]
    for line in reversed(wrapped(heading, room / 72.0).splitlines()):
        lines.insert(0, TextArea(line, textprops={"fontsize": SMALL, "fontweight": "bold"}))
    key = AnchoredOffsetbox(
        "lower left", pad=0, borderpad=0.3, frameon=False, bbox_to_anchor=(0.0, 1.0), bbox_transform=ax.transAxes,
        child=VPacker(children=lines, align="left", pad=0, sep=2.0),
    )  # fmt: skip
    key.set_clip_on(False)
    ax.add_artist(key)


def cars_bar(ax: Axes, first: int, last: int) -> None:
    """Draw a colour bar instead of a key, for cars `first` … `last`."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.ticker import MaxNLocator

    mappable = ScalarMappable(Normalize(first, last), cars_map())
    bar = ax.figure.colorbar(mappable, ax=ax, pad=0.02, aspect=25)
    bar.locator = MaxNLocator(6, integer=True)
    bar_style(bar, "Car")


def bar_style(bar: Any, label: str) -> None:
    """Give a colour bar its label, small ticks and a thin frame."""
    bar.set_label(label, fontsize=SMALL)
    bar.ax.tick_params(labelsize=SMALL, color="0.4", width=0.6, length=2.5)
    bar.outline.set(edgecolor="0.4", linewidth=0.5)
