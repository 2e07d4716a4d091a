"""Where a growing disturbance goes: its growth along rays, and the wedge it fills in time and space."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from headway.arrays import Array
from headway.errors import HeadwayError, shorten
from headway.plot import style
from headway.plot.theory import vehicle_title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from headway.theory.linear import Linear
    from headway.theory.propagation import Propagation

__all__ = ["propagation"]

#: how much the fastest growing part has grown at the end of the picture, and its length [s] where nothing grows
_GROWN, _STABLE = 10.0, 120.0
_RAYS = 241
_FASTEST: dict[str, Any] = {"color": "black", "linewidth": 1.3}
_EDGE: dict[str, Any] = {"color": "black", "linewidth": 1.0, "linestyle": (0, (3, 1.5))}
_ROADSIDE: dict[str, Any] = {"color": "#0072b2", "linewidth": 1.6, "linestyle": (0, (1, 1))}
_CAR: dict[str, Any] = {"color": "0.62", "linewidth": 0.6}


def propagation(linear: Linear) -> Figure:
    """Draw whether a disturbance of a long string is carried away or stays, and where it grows.

    Left: growth rate σ [1/s] along rays of constant velocity [m/s] on the road. Right: the growing packet of a
    disturbance at time 0 and position 0, shaded by how often it has grown, with cars and the observer
    at the roadside: growth of the packet on the observer's line is absolute instability, growth only
    beside it convective.

    Args:
        linear: of `headway.linearize`.

    Raises:
        HeadwayError: for a vehicle that is locally unstable.
    """
    from headway.theory.linear import Linear

    if not isinstance(linear, Linear):
        raise HeadwayError(f"a figure of propagation needs what headway.linearize returns, not {shorten(linear)}")
    wave = linear.propagation()
    name = vehicle_title(linear)
    if wave.kind == "locally unstable":
        raise HeadwayError(
            f"{name} is locally unstable: its disturbances grow without travelling, there is no wave to draw"
        )
    spacing = linear.gap + linear.vehicle.length
    velocity = _velocities(wave, linear.speed)
    rate = np.asarray(linear.growth((linear.speed - velocity) / spacing))
    figure = style.new_figure(3.7, f"{name}: {wave.kind}")
    left, right = figure.subplots(1, 2, width_ratios=(4, 5))
    _along_rays(left, wave, velocity, rate, linear.speed, spacing)
    _on_the_road(right, wave, velocity, rate, linear.speed, spacing)
    spread = {"fastest": _FASTEST, "edges": _EDGE} if wave.growth > 0 else {"kinematic wave": _FASTEST}
    style.key_above(right, {"roadside": _ROADSIDE, **spread, "cars": _CAR})
    return figure


def _velocities(wave: Propagation, speed: float) -> Array:
    """Return velocities [m/s] on the road over which growth is drawn: the packet and the roadside, with room around."""
    marks = [v for v in (0.0, wave.velocity, wave.upstream_edge, wave.downstream_edge) if math.isfinite(v)]
    room = max(0.35 * (max(marks) - min(marks)), 0.03 * speed)
    # a ray at the cars' own speed passes none of them
    return np.linspace(min(marks) - room, min(max(marks) + room, 0.98 * speed), _RAYS)


def _along_rays(ax: Axes, wave: Propagation, velocity: Array, rate: Array, speed: float, spacing: float) -> None:
    """Draw σ over the velocity of a ray; on top the number of cars that it passes."""
    ax.plot(velocity, rate, color="black", linewidth=1.3, zorder=3)
    if np.any(rate > 0):
        fill = style.class_look(2, 4)["facecolor"]
        ax.fill_between(velocity, rate, 0.0, where=rate > 0, color=fill, linewidth=0, zorder=2)
    ax.axhline(0.0, color="0.35", linewidth=0.7, zorder=2)
    ax.axvline(0.0, zorder=2, **_ROADSIDE)
    for v, look in ((wave.velocity, _FASTEST), (wave.upstream_edge, _EDGE), (wave.downstream_edge, _EDGE)):
        if math.isfinite(v):
            ax.axvline(v, zorder=1, **{**look, "linewidth": 0.7})
    # what decays fast would press what grows flat
    top = max(float(np.nanmax(rate)), 0.0)
    least = float(np.nanmin(rate))
    bottom = max(least, -3.0 * top) if top > 0 else least
    if math.isfinite(wave.roadside_growth) and top > 0:
        bottom = min(bottom, max(1.2 * wave.roadside_growth, -8.0 * top))
    ax.set(xlim=(velocity[0], velocity[-1]), ylim=(bottom, max(1.15 * top, -0.08 * bottom)))
    ax.set(xlabel="Velocity of the ray on the road [m/s]", ylabel="Growth rate σ [1/s]")
    style.axes_style(ax)
    cars = ax.secondary_xaxis(
        "top", functions=(lambda v: (speed - np.asarray(v)) / spacing, lambda r: speed - np.asarray(r) * spacing)
    )
    cars.tick_params(labelsize=style.SMALL, color="0.4", width=0.6, length=2.5)
    cars.set_xlabel("Cars passed per second", fontsize=style.SMALL)
    cars.spines["top"].set(color="0.4", linewidth=0.6)


def _on_the_road(ax: Axes, wave: Propagation, velocity: Array, rate: Array, speed: float, spacing: float) -> None:
    """Draw the wedge that the growing packet fills, in time and position."""
    end = _length(wave)
    low, high = float(velocity[0]) * end, float(velocity[-1]) * end
    t, x = np.linspace(0.0, end, 161)[1:], np.linspace(low, high, 321)
    ray = x[:, None] / t[None, :]
    exponent = (
        np.interp(ray, velocity, np.nan_to_num(rate, nan=-math.inf), left=-math.inf, right=-math.inf) * t[None, :]
    )
    if wave.growth > 0:
        grown = np.ma.masked_less_equal(np.exp(exponent), 1.0)
        field = ax.pcolormesh(t, x, grown, cmap=style.speed_map(), shading="nearest", rasterized=True, zorder=2)
        style.bar_style(ax.figure.colorbar(field, ax=ax, pad=0.02, aspect=25), "Grown by a factor of")
    # few enough cars to be seen apart
    every = max(1, math.ceil((high - low + speed * end) / spacing / 24.0))
    count = math.ceil((speed * end - low) / spacing / every)
    ahead = math.ceil(high / spacing / every)
    for n in range(-count, ahead + 1):
        start = n * every * spacing
        ax.plot([0.0, end], [start, start + speed * end], zorder=1, **_CAR)
    ax.plot([0.0, end], [0.0, 0.0], zorder=4, **_ROADSIDE)
    for v, look in ((wave.velocity, _FASTEST), (wave.upstream_edge, _EDGE), (wave.downstream_edge, _EDGE)):
        if math.isfinite(v):
            ax.plot([0.0, end], [0.0, v * end], zorder=3, **look)
    ax.set(xlim=(0.0, end), ylim=(low, high), xlabel="Time [s]", ylabel="Position on the road [m]")
    style.axes_style(ax)
    ax.grid(False)


def _length(wave: Propagation) -> float:
    """Return the length [s] of the picture: until the fastest growing part is ten times as large."""
    return math.log(_GROWN) / wave.growth if 0 < wave.growth < math.inf else _STABLE
