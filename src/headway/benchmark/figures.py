"""Figures of a benchmark: ranks, gains, sweeps of delay, and the disturbances themselves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from headway.benchmark.cells import PUBLISHED, SWEEP, Board
from headway.benchmark.scores import Score
from headway.benchmark.theory import Theory, gain_at, linear, steady_course
from headway.plot import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["disturbances", "gain_curves", "ranks", "sweeps"]

#: largest gain and growth that are drawn
_TOP = 2.5


def ranks(scores: dict[str, Sequence[Score]], who: Sequence[str]) -> Figure:
    """Draw mean ranks as fields of numbers, a panel for each key of `scores`.

    Args:
        scores: of all entries, by title of the panel.
        who: names of the entries from top to bottom; criteria go across.
    """
    from matplotlib.colors import Normalize

    count = len(who)
    figure = style.new_figure(0.9 + 0.3 * count)
    axes = figure.subplots(1, len(scores), squeeze=False, sharey=False)[0]
    shade = style.cars_map()
    norm = Normalize(1.0, max(count, 2))
    for i, (ax, (name, board)) in enumerate(zip(axes, scores.items(), strict=True)):
        criteria = list(board[0].ranks)
        scores_of = {s.who: s for s in board}
        values = np.array(
            [[scores_of[w].ranks.get(c, math.nan) if w in scores_of else math.nan for c in criteria] for w in who]
        )
        ax.imshow(values, cmap=shade, norm=norm, aspect="auto")
        for y, x in np.ndindex(values.shape):
            number = values[y, x]
            if math.isfinite(number):
                dark = norm(number) < 0.6
                ax.text(x, y, f"{number:.1f}", ha="center", va="center", fontsize=style.SMALL,
                        color="white" if dark else "black")  # fmt: skip
        ax.set_xticks(range(len(criteria)), [c.replace(" ", "\n", 1) for c in criteria], rotation=90)
        ax.set_yticks(range(len(who)), who if i == 0 else [""] * len(who))
        ax.set_title(name, fontsize=style.SMALL, fontweight="bold")
        ax.tick_params(labelsize=style.SMALL, length=0)
        for spine in ax.spines.values():
            spine.set_visible(False)
    return figure


def gain_curves(board: Board, theory: Sequence[Theory]) -> Figure:
    """Draw |G(iω)| of every entry by theory and the growth simulated behind the sine, a panel for each case of delays.

    Args:
        board: the cells of a benchmark.
        theory: of its entries.
    """
    b = board.benchmark
    figure = style.new_figure(2.9)
    axes = figure.subplots(1, len(b.cases), sharey=True, squeeze=False)[0]
    looks = dict(zip((e.name for e in b.entries), style.series(len(b.entries)), strict=True))
    omega = np.geomspace(0.02, 5.0, 400)
    course = steady_course(b)
    at = course.leader.fundamental if course is not None else None
    for ax, case in zip(axes, b.cases, strict=True):
        for entry in b.entries:
            row = next(t for t in theory if t.who == entry.name and t.delays == case.name)
            if row.reason or not row.locally_stable:
                continue
            there = linear(entry, entry.delay(case.onboard, case.radio), b.speed)
            gain = np.asarray(there.gain(omega))
            ax.plot(omega, np.where(gain <= 2 * _TOP, gain, np.nan), **looks[entry.name])
            if at is not None and math.isfinite(row.measured):
                ax.plot([at], [row.measured], "o", markersize=4.5, markerfacecolor="white",
                        markeredgecolor=looks[entry.name]["color"], zorder=4)  # fmt: skip
        ax.axhline(1.0, color="0.35", linewidth=0.7, zorder=1)
        ax.set(xscale="log", xlim=(omega[0], omega[-1]), ylim=(0.0, _TOP), xlabel="Angular frequency [rad/s]")
        ax.set_title(case.name, fontsize=style.SMALL, fontweight="bold")
        style.axes_style(ax)
    axes[0].set_ylabel("Gain per vehicle |G(iω)|")
    dots = {"simulated": {"marker": "o", "linestyle": "none", "markerfacecolor": "white", "markeredgecolor": "black",
                          "markersize": 4.5}}  # fmt: skip
    figure.legend(
        handles=_handles({**looks, **dots}), loc="outside lower center", ncols=len(looks) + 1, frameon=False,
        fontsize=style.SMALL,
    )  # fmt: skip
    return figure


def sweeps(board: Board) -> Figure:
    """Draw growth per vehicle behind the sine, simulated (dots) and by theory (lines), and least TTC, over the delay.

    Args:
        board: the cells of a benchmark.
    """
    b = board.benchmark
    course = steady_course(b) or next(c for c in b.courses if c.sweep)
    omega = course.leader.fundamental
    figure = style.new_figure(2.9)
    left, right = figure.subplots(1, 2)
    looks = dict(zip((e.name for e in b.entries), style.series(len(b.entries)), strict=True))
    for entry in b.entries:
        look = looks[entry.name]
        cells = [c for c in board.select(PUBLISHED, SWEEP, entry.name) if not c.reason]
        here = [c for c in cells if c.course == course.name]
        growth = [math.nan if c.collided else c.values["growth"] for c in here]
        left.plot([c.onboard for c in here], growth, "o", color=look["color"], markersize=3.5)
        if omega is not None:
            fine = np.linspace(b.sweep[0], b.sweep[-1], 61)
            left.plot(fine, [gain_at(entry, float(t), b.speed, omega) for t in fine], **look)
        least = [min((c.values["ttc"] for c in cells if c.onboard == t), default=math.nan) for t in b.sweep]
        right.plot(b.sweep, np.minimum(least, 50.0), marker="o", markersize=3.5, **look)
    left.axhline(1.0, color="0.35", linewidth=0.7, zorder=1)
    left.set(ylim=(0.0, _TOP), xlabel="Delay [s]", ylabel=f"Growth per vehicle, {course.name}")
    right.axhline(1.5, color="0.35", linewidth=0.7, zorder=1)
    right.set(xlabel="Delay [s]", ylabel="Least time to collision [s]")
    right.set_yscale("symlog", linthresh=1.0)
    right.set_ylim(bottom=-0.05)
    right.set_yticks([0, 0.5, 1, 2, 5, 10, 20], ["0", "0.5", "1", "2", "5", "10", "20"])
    for ax in (left, right):
        style.axes_style(ax)
    figure.legend(
        handles=_handles(looks), loc="outside lower center", ncols=len(looks), frameon=False, fontsize=style.SMALL
    )
    return figure


def disturbances(board: Board) -> Figure:
    """Draw the speed of every leader over time.

    Args:
        board: the cells of a benchmark.
    """
    courses = board.benchmark.courses
    columns = min(4, len(courses))
    rows = math.ceil(len(courses) / columns)
    figure = style.new_figure(0.3 + 1.25 * rows)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax, course in zip(axes, courses, strict=False):
        time = np.linspace(0.0, course.duration, 1201)
        speed = course.leader.motion(0, course.duration).at(time)[1]
        ax.plot(time, speed, color=style.LEADER, linewidth=0.9)
        ax.set_title(course.name, fontsize=style.SMALL, fontweight="bold")
        style.axes_style(ax)
    for ax in axes[len(courses) :]:
        ax.set_visible(False)
    figure.supxlabel("Time [s]", fontsize=style.SMALL)
    figure.supylabel("Speed of the leader [m/s]", fontsize=style.SMALL)
    return figure


def _handles(looks: dict[str, dict[str, Any]]) -> list[Any]:
    from matplotlib.lines import Line2D

    return [Line2D([], [], label=name, **look) for name, look in looks.items()]
