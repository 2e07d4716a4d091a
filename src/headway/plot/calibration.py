"""Figures of real platoons: a fit, a replay, growth down a string, measured and fitted gains, mixed strings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from headway.arrays import Array
from headway.data.recording import Recording
from headway.errors import HeadwayError
from headway.plot import style

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from headway.calibration.fit import Fit

__all__ = ["calibrated", "gains", "growth", "penetration", "replayed"]

#: looks of recorded and of fitted values, and of stretches that were only tested
_RECORDED: dict[str, Any] = {"color": "black", "linewidth": 1.1}
_FITTED: dict[str, Any] = {"color": "#d55e00", "linewidth": 1.1, "linestyle": (0, (4, 1.2))}
_TESTED: dict[str, Any] = {"facecolor": "#dcecf5", "edgecolor": "none"}


def calibrated(fit: Fit) -> Figure:
    """Draw a fit on one page: recorded and fitted gap and speed, the gap error, and the profile of every quantity.

    Stretches that were tested and not trained on are shaded. Of several recordings the first one is drawn. A profile
    shows the least objective with its quantity held; values below the line fit as well with 95 % confidence.

    Args:
        fit: a fit of `headway.calibrate`.
    """
    law = fit.vehicle.model.law
    source = fit.segments[0].source
    rows = -(-len(fit.profiles) // 4)
    figure = style.new_figure(5.2 + 1.25 * rows, f"{law.name} fitted to vehicle {fit.follower} of {source}")
    above, below = _two(figure, 4.6, 1.35 * rows + 0.2)
    axes = above.subplots(3, 1, sharex=True, height_ratios=(3, 3, 2))
    for segments, shaded in ((fit.segments, False), (fit.test_segments, True)):
        mine = [s for s in segments if s.source == source]
        for s, (gap, speed) in zip(mine, fit.path(mine) if mine else [], strict=True):
            t = s.begin + s.time
            for ax, recorded, fitted in ((axes[0], s.gap, gap), (axes[1], s.speed, speed)):
                ax.plot(t, recorded, zorder=3, **_RECORDED)
                ax.plot(t, fitted, zorder=4, **_FITTED)
            axes[2].plot(t, gap - s.gap, color=_FITTED["color"], linewidth=0.9, zorder=3)
            if shaded:
                for ax in axes:
                    ax.axvspan(t[0], t[-1], zorder=0, **_TESTED)
    axes[2].axhline(0.0, color="0.35", linewidth=0.7, zorder=2)
    for ax, words in zip(axes, ("Gap [m]", "Speed [m/s]", "Gap error [m]"), strict=True):
        style.axes_style(ax)
        ax.set_ylabel(words)
        ax.margins(x=0)
    axes[2].set_xlabel("Time [s]")
    figure.align_ylabels(axes)
    errors = f"r.m.s. gap error {fit.train[0].gap:.3g} m in training"
    tested = [e for e in fit.test if e.source == source]
    entries = {"recorded": _RECORDED, f"fitted, {errors}": _FITTED}
    if tested:
        entries[f"tested only, {tested[0].gap:.3g} m"] = _TESTED
    style.key_above(axes[0], entries)
    _profiles(below, fit, rows)
    return figure


def _two(figure: Figure, above: float, below: float) -> Any:
    """Return two parts of a figure, one above the other, of these relative heights."""
    return figure.subfigures(2, 1, height_ratios=(above, below))


def _profiles(figure: Any, fit: Fit, rows: int) -> None:
    """Draw the profile of each quantity near its best value."""
    from headway.calibration.report import quantity_unit

    axes = figure.subplots(rows, 4, squeeze=False).ravel()
    for ax in axes[len(fit.profiles) :]:
        ax.set_axis_off()
    for i, (profile, ax) in enumerate(zip(fit.profiles, axes, strict=False)):
        top = max(1.35 * fit.value, 1.05 * profile.limit)
        inside = profile.objective <= top
        near = inside | np.append(inside[1:], False) | np.append(False, inside[:-1])
        low, high = profile.values[inside].min(), profile.values[inside].max()
        ax.plot(profile.values[near], profile.objective[near], color="black", linewidth=1.0, marker=".", markersize=3.0)
        ax.axhline(profile.limit, color="0.35", linewidth=0.7, linestyle=(0, (4, 2)))
        ax.plot([fit.values[profile.name]], [fit.value], marker="o", color=_FITTED["color"], markersize=4.0)
        ax.set_ylim(0.97 * fit.value, top)
        room = 0.15 * max(high - low, 1e-3 * (fit.space.high[i] - fit.space.low[i]))
        ax.set_xlim(low - room, high + room)
        style.axes_style(ax)
        unit = quantity_unit(fit, profile.name)
        ax.set_xlabel(f"{profile.name} [{unit}]" if unit not in ("", "1") else profile.name)
        if i % 4 == 0:
            ax.set_ylabel("Objective")


def replayed(recording: Recording, simulated: xr.Dataset, title: str = "") -> Figure:
    """Draw a recorded and a simulated platoon on one page: speeds, gaps, and how deviations grow down the string.

    Args:
        recording: the recording, times from 0.
        simulated: a `headway.calibration.replay` with as many vehicles.
        title: of the figure; one that names the recording if empty.

    Raises:
        HeadwayError: for different numbers of vehicles.
    """
    from headway.calibration.measured_transfer import measured_growth

    runs = {"recorded": (recording.time, recording.speed, recording.gap)}
    runs["simulated"] = (simulated.time.values, simulated.speed.values, simulated.gap.values)
    count = recording.vehicles
    if runs["simulated"][1].shape[0] != count:
        raise HeadwayError(f"the recording has {count} vehicles and the simulation {runs['simulated'][1].shape[0]}")
    heading = title or f"{recording.source}: recorded and simulated behind its leader"
    figure = style.new_figure(6.6, heading, "The leader is black; followers go from dark to light, front to back.")
    above, below = _two(figure, 2.1, 1.0)
    axes = above.subplots(2, 2, sharex=True, sharey="row")
    looks = style.cars_map()(np.linspace(0.0, 1.0, count - 1))
    for column, (name, (time, speed, gap)) in enumerate(runs.items()):
        for n in range(count):
            look = {"color": style.LEADER if n == 0 else looks[n - 1], "linewidth": 1.0 if n else 1.3}
            axes[0, column].plot(time, speed[n], zorder=4 if n == 0 else 3, **look)
            if n:
                axes[1, column].plot(time, gap[n], zorder=3, **look)
        axes[0, column].set_title(name, fontsize=style.SMALL, fontweight="bold")
        axes[1, column].set_xlabel("Time [s]")
    axes[0, 0].set_ylabel("Speed [m/s]")
    axes[1, 0].set_ylabel("Gap [m]")
    for ax in axes.ravel():
        style.axes_style(ax)
        ax.margins(x=0)
    left, right = below.subplots(1, 2)
    whole = np.isfinite(runs["simulated"][1]).all()
    _grown(
        left,
        measured_growth(recording.speed),
        {"simulated": measured_growth(runs["simulated"][1])} if whole else {},
        "deviation",
    )
    _grown(
        right,
        measured_growth(recording.speed),
        {"simulated": measured_growth(runs["simulated"][1])} if whole else {},
        "range",
    )
    entries: dict[str, Any] = {"recorded": {**_RECORDED, "marker": "o", "markersize": 4.0}}
    if whole:
        entries["simulated"] = {**style.SERIES[2], "marker": "s", "markersize": 4.0}
    style.key_above(left, entries)
    return figure


def growth(recording: Recording, simulated: Mapping[str, xr.Dataset], title: str = "") -> Figure:
    """Draw the growth of speed deviations down a string, measured and predicted.

    Two panels have the standard deviation and the range of speed by vehicle; the third has the amplitude spectrum of
    the last vehicle over that of the leader, where the leader has power.

    Args:
        recording: the recording, times from 0.
        simulated: replays by name.
        title: of the figure; one that names the recording if empty.
    """
    from headway.calibration.measured_transfer import measured_growth, spectra

    figure = style.new_figure(2.9, title or f"{recording.source}: growth down the string")
    axes = figure.subplots(1, 3)
    measured = measured_growth(recording.speed)
    predicted = {
        n: measured_growth(run.speed.values) for n, run in simulated.items() if np.isfinite(run.speed.values).all()
    }
    collided = [n for n in simulated if n not in predicted]
    looks = dict(zip(simulated, style.series(len(simulated) + 1)[1:], strict=True))
    for ax, what in zip(axes, ("deviation", "range"), strict=False):
        _grown(ax, measured, predicted, what, looks)
    w, power = spectra(recording.speed, recording.time)
    strong = (w > 0) & (w < 1.6) & (power[0] > 1e-3 * power[0].max())
    axes[2].plot(w[strong], np.sqrt(power[-1] / power[0])[strong], **_RECORDED)
    for name in predicted:
        run = simulated[name]
        w, power = spectra(run.speed.values, run.time.values)
        strong = (w > 0) & (w < 1.6) & (power[0] > 1e-3 * power[0].max())
        axes[2].plot(w[strong], np.sqrt(power[-1] / power[0])[strong], **looks[name])
    axes[2].axhline(1.0, color="0.35", linewidth=0.7, zorder=1)
    axes[2].set_ylim(bottom=0.0)
    axes[2].set(xlabel="Frequency ω [rad/s]", ylabel="Amplitude, last over leader")
    style.axes_style(axes[2])
    entries: dict[str, Any] = {"recorded": {**_RECORDED, "marker": "o", "markersize": 3.5}}
    entries |= {n: {**looks[n], "linewidth": 1.4} for n in predicted}
    entries |= {f"{n} (collides)": None for n in collided}
    _key_below(figure, entries)
    return figure


def _key_below(figure: Figure, entries: Mapping[str, Any]) -> None:
    """Draw one key across the foot of the figure."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], **look) if look else Line2D([], [], linestyle="none") for look in entries.values()]
    figure.legend(
        handles, list(entries), loc="outside lower center", ncols=min(len(entries), 6), fontsize=style.SMALL,
        frameon=False, handlelength=2.4, columnspacing=1.4,
    )  # fmt: skip


def _grown(
    ax: Axes, measured: Any, predicted: Mapping[str, Any], what: str, looks: Mapping[str, Any] | None = None
) -> None:
    """Draw the deviation or the range of speed by vehicle."""
    words = {"deviation": "Std. deviation of speed [m/s]", "range": "Range of speed [m/s]"}[what]
    vehicles = np.arange(getattr(measured, what).size)
    highest = float(getattr(measured, what).max())
    for name, prediction in predicted.items():
        look = (looks or {}).get(name, style.SERIES[2])
        ax.plot(vehicles, getattr(prediction, what), marker="s", markersize=2.8, zorder=3, **{**look, "linewidth": 1.2})
    ax.plot(vehicles, getattr(measured, what), marker="o", markersize=3.6, zorder=4, **_RECORDED)
    ax.set_ylim(
        0.0, min(1.5 * highest, 1.08 * max([highest, *(float(getattr(p, what).max()) for p in predicted.values())]))
    )
    ax.set(xlabel="Vehicle", ylabel=words)
    ax.locator_params(axis="x", integer=True)
    style.axes_style(ax)


def gains(recording: Recording, fits: Sequence[Fit], title: str = "") -> Figure:
    """Draw the measured gain between neighbours with its 95 % interval, over exact |G| of fitted laws with theirs.

    Grey dots are frequencies at which the two speeds are hardly coherent. |G| is that at the mean speed of training.

    Args:
        recording: the recording.
        fits: of any of its followers, one or more laws each; every follower gets a panel.
        title: of the figure; one that names the recording if empty.

    Raises:
        HeadwayError: without a fit.
    """
    from headway.calibration.measured_transfer import measured_transfer

    if not fits:
        raise HeadwayError("gains needs at least one fit")
    followers = sorted({f.follower for f in fits})
    names = list(dict.fromkeys(f.vehicle.model.name for f in fits))
    looks = dict(zip(names, style.series(len(names) + 1)[1:], strict=True))
    columns = min(len(followers), 4)
    rows = -(-len(followers) // columns)
    figure = style.new_figure(0.9 + 2.1 * rows, title or f"{recording.source}: gain between neighbours")
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    w = np.linspace(0.02, 1.6, 250)
    highest = 1.5
    for ax, n in zip(axes, followers, strict=False):
        transfer = measured_transfer(recording, n, highest=1.6)
        good = transfer.coherent
        ax.errorbar(
            transfer.frequency[good], transfer.gain[good],
            np.abs(np.stack((transfer.low, transfer.high))[:, good] - transfer.gain[good]), color="black",
            linestyle="none", marker="o", markersize=3.2, linewidth=0.8, zorder=4,
        )  # fmt: skip
        ax.plot(
            transfer.frequency[~good],
            transfer.gain[~good],
            color="0.7",
            linestyle="none",
            marker=".",
            markersize=3.0,
            zorder=2,
        )
        highest = max(highest, float(transfer.gain[good].max(initial=1.0)))
        for fit in (f for f in fits if f.follower == n):
            look = looks[fit.vehicle.model.name]
            best, low, high = _band(fit, w)
            if best is not None:
                ax.plot(w, best, zorder=3, **look)
                highest = max(highest, float(best.max()))
            if low is not None:
                ax.fill_between(w, low, high, color=look["color"], alpha=0.18, linewidth=0.0, zorder=1)
        ax.axhline(1.0, color="0.35", linewidth=0.7, zorder=1)
        ax.set_title(f"vehicle {n}", fontsize=style.SMALL)
        style.axes_style(ax)
    for ax in axes[len(followers) :]:
        ax.set_axis_off()
    axes[0].set_ylim(0.0, min(1.15 * highest, 4.0))
    for i, ax in enumerate(axes[: len(followers)]):
        if i % columns == 0:
            ax.set_ylabel("Gain |G(iω)|")
        if i >= len(followers) - columns:
            ax.set_xlabel("Frequency ω [rad/s]")
            ax.tick_params(labelbottom=True)
    entries: dict[str, Any] = {
        "measured": {"color": "black", "marker": "o", "markersize": 3.5, "linestyle": "none"},
        "not coherent": {"color": "0.7", "marker": ".", "linestyle": "none"},
        **looks,
    }
    _key_below(figure, entries)
    return figure


def _band(fit: Fit, w: Array) -> tuple[Array | None, Array | None, Array | None]:
    """Return |G| of a fit and its 95 % band over the refits; None where the law has no equilibrium."""
    from headway.calibration.verdict import theory_of

    speed = fit.speeds[1]
    own = theory_of(fit, fit.vehicle, speed)
    drawn = [lin.gain(w) for car in fit.draws if (lin := theory_of(fit, car, speed)) is not None]
    low, high = np.quantile(drawn, (0.025, 0.975), axis=0) if drawn else (None, None)
    return None if own is None else own.gain(w), low, high


def penetration(replays: xr.Dataset, title: str = "") -> Figure:
    """Draw the growth of speed deviations and the least gap over the share of other cars in a platoon.

    Args:
        replays: a dataset of `headway.calibration.one_in`.
        title: of the figure; one that names the recording if empty.

    Raises:
        HeadwayError: for another dataset.
    """
    if "every" not in replays.coords or "source" not in replays.attrs:
        raise HeadwayError("penetration draws what headway.calibration.one_in gives, and this dataset is another")
    figure = style.new_figure(2.7, title or f"One car in n is another, behind the leader of {replays.attrs['source']}")
    left, right = figure.subplots(1, 2)
    share = np.array([100.0 / n if n else 0.0 for n in replays.every.values])
    order = np.argsort(share)
    for ax, name, words in (
        (left, "growth", "Std. deviation of speed, last over leader"),
        (right, "least_gap", "Least gap [m]"),
    ):
        ax.plot(share[order], replays[name].values[order], marker="o", markersize=4.0, **_RECORDED)
        ax.set(xlabel="Share of other cars [%]", ylabel=words)
        style.axes_style(ax)
        for x, y in zip(share[order], replays[name].values[order], strict=True):
            if not np.isfinite(y):
                ax.plot([x], [0.0], clip_on=False, **style.CROSS)
        ax.set_ylim(bottom=0.0)
    left.axhline(1.0, color="0.35", linewidth=0.7)
    if not np.isfinite(replays.growth.values).all():
        style.key_above(left, {"collision": style.CROSS})
    return figure
