"""Figures of the reproduced paper, in its arrangement: error and speed side by side, four panels, maps, sweeps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from headway.literature.barhoumi2025.delays import CLASSES, DELAYS, Answer, delay_sweep
from headway.literature.barhoumi2025.experiments import Experiment
from headway.literature.barhoumi2025.reproduction import choice
from headway.literature.barhoumi2025.settings import AXES
from headway.literature.barhoumi2025.verdicts import Condition, Judgement
from headway.plot import maps, style, theory, trajectories

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["delays", "dependence", "experiment_figures", "four_panels"]

#: what is drawn side by side
_PAIR: tuple[str, ...] = ("spacing_error", "speed")
_CACC: tuple[str, ...] = ("spacing_error", "policy_error", "speed")

#: most panels side by side
_COLUMNS = 3
#: how a combination looks in which a condition holds, and in which it does not
_HELD: dict[str, Any] = {"marker": "o", "color": "#0072b2", "linestyle": "none", "markersize": 4.5, "alpha": 0.75}
_FAILED: dict[str, Any] = {"marker": "o", "markerfacecolor": "white", "markeredgecolor": "#d55e00", "linestyle": "none",
                           "markersize": 4.5, "alpha": 0.9}  # fmt: skip
_BAND: dict[str, Any] = {"facecolor": "#dcecf5", "edgecolor": "none", "linewidth": 0.0}


def experiment_figures(experiment: Experiment) -> Iterator[tuple[str, Figure, str, str]]:
    """Draw everything that an experiment shows.

    Args:
        experiment: the experiment.

    Yields:
        (name, figure, what it shows in words, caption) of each figure.
    """
    name, title = experiment.id, experiment.title
    caption = f"{title} ({experiment.figure})"
    match experiment.kind:
        case "schematic":
            words = "Three curves of a gap that returns to equilibrium, by damping ratio."
            yield name, theory.damping(), words, caption
        case "map":
            from headway.literature.barhoumi2025.maps import reproduced_map

            page = reproduced_map(experiment.map)
            panels = ", ".join(panel for panel, _ in page.panels)
            yield name, maps.paper_map(page), f"{title}: areas of verdicts over parameters; panels: {panels}.", caption
        case "platoon":
            data = experiment.datasets()
            # the paper gives CACC an error of its own, the gap less the desired one
            beside = _CACC if experiment.about == "cacc" else _PAIR
            words = f"{title}: {', '.join(w.replace('_', ' ') for w in beside)} of all cars over time, side by side"
            drawn = trajectories.comparison(data, beside)
            yield name, drawn, f"{words}; rows: {', '.join(data)}.{_collided(data)}", caption
        case "comparison":
            data = experiment.datasets()
            four, rest = dict(list(data.items())[:4]), dict(list(data.items())[4:])
            for variable, what in (("spacing_error", "spacing errors of all pairs"), ("speed", "speeds of all cars")):
                words = f"{title}: {what} over time, a panel each for {', '.join(four)}.{_collided(four)}"
                place = f"{name}-{variable.replace('_', '-')}"
                yield place, four_panels(four, variable), words, f"{caption}: {what}"
            if rest:
                rows = {"base gains": data["CACC"], "fitted gains": next(iter(rest.values()))}
                words = f"{title}: CACC with two sets of gains (rows), its spacing error, policy error and speed."
                yield f"{name}-cacc", trajectories.comparison(rows, _CACC), words, f"{caption}: CACC, two sets of gains"
        case "sweep":
            answers = {label: delay_sweep(label.lower()) for label in experiment.scenarios}
            words = "Peak spacing error, growth down the platoon and exact verdict against the delay, by model."
            yield name, delays(answers), words, caption


def four_panels(datasets: Mapping[str, xr.Dataset], variable: str) -> Figure:
    """One variable of four runs over time [s] in 2 × 2 panels, each with the scale of its own run."""
    figure = style.new_figure(4.6)
    axes = figure.subplots(2, 2, sharex=True)
    draw = {"spacing_error": trajectories.spacing_errors, "speed": trajectories.speeds}[variable]
    for ax, (name, dataset) in zip(axes.flat, datasets.items(), strict=True):
        draw(dataset, ax)
        ax.text(
            0.985, 0.97, name, transform=ax.transAxes, ha="right", va="top", fontsize=style.LARGE, fontweight="bold",
            path_effects=style.halo(), zorder=6,
        )  # fmt: skip
    for ax in axes[0]:
        ax.set_xlabel("")
    return figure


def _collided(datasets: Mapping[str, xr.Dataset]) -> str:
    """Say who collides, for readers who cannot see the crosses."""
    hit = [
        f"{name}: car {int(car)} at {float(t):.1f} s"
        for name, data in datasets.items()
        for car, t in zip(data.vehicle.values, data.collision_time.values, strict=True)
        if math.isfinite(t)
    ]
    return f" Collisions ({'; '.join(hit)})." if hit else ""


# -- the sweep over delays -------------------------------------------------------------------------


def delays(answers: Mapping[str, Answer]) -> Figure:
    """Draw peak error [m], growth and exact verdict over the delay [s] for each model of `delay_sweep`."""
    figure = style.new_figure(6.2)
    peak, growth, verdict = figure.subplots(3, 1, sharex=True, height_ratios=(3, 3, 2))
    entries: dict[str, Any] = {}
    for (name, answer), look in zip(answers.items(), style.series(len(answers)), strict=True):
        hit = answer.collisions > 0
        entries[name] = look
        peak.plot(DELAYS, answer.peak, zorder=3, **look)
        peak.plot(DELAYS[hit], answer.peak[hit], zorder=4, **{**style.CROSS, "markersize": 4.0, "markeredgewidth": 1.0})
        # pairs that were broken off at different times cannot be compared
        growth.plot(DELAYS, np.where(hit, np.nan, answer.growth), zorder=3, **look)
    if any((a.collisions > 0).any() for a in answers.values()):
        entries["somebody collides: peak until then, no growth"] = style.CROSS
    growth.axhline(1.0, color="0.35", linewidth=0.8, linestyle=(0, (4, 2)))
    peak.set(yscale="log", ylabel="Largest spacing\nerror [m]")
    growth.set(yscale="log", ylabel="Largest error,\nlast pair over first")
    _bands(verdict, answers)
    for ax in (peak, growth, verdict):
        style.axes_style(ax)
    verdict.grid(False)
    verdict.set_xlabel("Delay τ [s]: of the radio for CACC, of all on-board signals for the others")
    style.key_above(peak, entries)
    style.key_above(verdict, {word: style.class_look(code + 1, len(CLASSES) + 1) for code, word in enumerate(CLASSES)})
    return figure


def _bands(ax: Axes, answers: Mapping[str, Answer]) -> None:
    from matplotlib.patches import Rectangle

    half = 0.5 * float(DELAYS[1] - DELAYS[0])
    for row, answer in enumerate(answers.values()):
        for delay, code in zip(DELAYS, answer.verdict, strict=True):
            look = style.class_look(int(code) + 1, len(CLASSES) + 1)
            ax.add_patch(Rectangle((delay - half, row - 0.38), 2 * half, 0.76, **look))
    ax.set(xlim=(0.0, float(DELAYS[-1])), ylim=(len(answers) - 0.5, -0.5))
    ax.set_yticks(range(len(answers)), list(answers))


# -- what a verdict depends on ---------------------------------------------------------------------


def dependence(finding: Judgement) -> Figure:
    """Draw every condition of a claim over the axis that its verdict turns on most, and along the claim's sweep.

    Above, a point for each combination of what is not stated, filled where the condition holds; the shaded range
    is what the text asks for, the star headway's own choice. Below, the sweep, all else as chosen.
    """
    bounded = [c for c in finding.chosen.conditions if c.bounded][:_COLUMNS]
    axis = finding.decisive[0].axis if finding.decisive else next(iter(finding.claim.axes))
    rows = 2 if finding.sweep else 1
    figure = style.new_figure(0.5 + 2.15 * rows)
    axes = figure.subplots(rows, len(bounded), squeeze=False)
    for column, condition in enumerate(bounded):
        _combinations(axes[0, column], finding, condition, axis)
        if finding.sweep:
            _along(axes[1, column], finding, condition)
    key = {"holds": _HELD, "does not": _FAILED, "asked for": _BAND, "as chosen": style.POINT}
    style.key_above(axes[0, 0], key)
    return figure


def _combinations(ax: Axes, finding: Judgement, condition: Condition, axis: str) -> None:
    values = list(finding.claim.axes[axis])
    if all(isinstance(value, float) for value in values):
        values.sort()
    points: dict[bool, list[tuple[float, float]]] = {True: [], False: []}
    for i, outcome in enumerate(finding.outcomes):
        here = next((c for c in outcome.conditions if c.name == condition.name), None)
        if here is not None and math.isfinite(here.value):
            # combinations stand beside each other so that all are seen
            place = values.index(outcome.choices[axis]) + 0.5 * (i / max(len(finding.outcomes) - 1, 1) - 0.5)
            points[here.holds].append((place, here.value))
    for held, look in ((True, _HELD), (False, _FAILED)):
        if points[held]:
            ax.plot(*np.array(points[held]).T, zorder=3, **look)
    if math.isfinite(condition.value):
        ax.plot([values.index(finding.chosen.choices[axis]) - 0.25], [condition.value], zorder=5, **style.POINT)
    _frame(ax, condition, [y for held in points.values() for _, y in held])
    width = 6.0 / ax.get_gridspec().ncols / len(values)  # type: ignore[union-attr]  # subplots have one
    ax.set_xlim(-0.6, len(values) - 0.4)
    labels = [style.wrapped(choice(v), width) for v in values]
    ax.set_xticks(range(len(values)), labels)
    ax.set_xlabel(_axis_words(axis))


def _along(ax: Axes, finding: Judgement, condition: Condition) -> None:
    axis = finding.claim.sweep[0]  # type: ignore[index]  # there is one where this is called
    x = [o.choices[axis] for o in finding.sweep]
    conditions = [{c.name: c for c in o.conditions}[condition.name] for o in finding.sweep]
    y = [c.value for c in conditions]
    ax.plot(x, y, color="0.4", linewidth=1.0, zorder=2)
    for held, look in ((True, _HELD), (False, _FAILED)):
        chosen = [
            (a, c.value) for a, c in zip(x, conditions, strict=True) if c.holds == held and math.isfinite(c.value)
        ]
        if chosen:
            ax.plot(*np.array(chosen).T, zorder=3, **look)
    _frame(ax, condition, y)
    ax.set_xlabel(_axis_words(axis))


def _frame(ax: Axes, condition: Condition, values: Sequence[float]) -> None:
    """Scale, the range asked for, and the condition's name."""
    finite = np.array([v for v in values if math.isfinite(v)])
    above = finite[finite > 0]
    if above.size and finite.min() >= 0 and above.max() > 30 * above.min():
        ax.set_yscale("log") if finite.min() > 0 else ax.set_yscale("symlog", linthresh=float(above.min()))
    style.axes_style(ax)
    low, high = ax.get_ylim()
    for bound in (condition.low, condition.high):
        if math.isfinite(bound) and (bound > 0 or ax.get_yscale() != "log"):
            low, high = min(low, bound), max(high, bound)
    ax.axhspan(max(low, condition.low), min(high, condition.high), zorder=0, **_BAND)
    ax.set_ylim(low, high)
    unit = f" [{condition.unit}]" if condition.unit else ""
    ax.set_ylabel(style.wrapped(f"{condition.name[:1].upper()}{condition.name[1:]}{unit}", 1.75))


def _axis_words(axis: str) -> str:
    unit = f" [{AXES[axis].unit}]" if AXES[axis].unit else ""
    return f"{AXES[axis].meaning[:1].upper()}{AXES[axis].meaning[1:]}{unit}"
