"""A fit in words, as text and as tables for a notebook: how it went, values, intervals, what is open, errors, notes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from headway.html import block, paragraph, table

if TYPE_CHECKING:
    from headway.calibration.baselines import Errors
    from headway.calibration.fit import Fit

__all__ = ["fit_html", "quantity_unit", "report"]


def quantity_unit(fit: Fit, name: str) -> str:
    """Unit of the fitted quantity `name`."""
    parameter = fit.vehicle.model.law.parameters.get(name)
    return "s" if parameter is None else parameter.info.unit


def report(fit: Fit) -> str:
    """The whole report of a fit, in lines of at most about 110 characters."""
    law = fit.vehicle.model.law
    sources = dict.fromkeys(s.source for s in fit.segments)
    stretches = ", ".join(f"{s.begin:g} to {s.begin + s.duration:g} s" for s in fit.segments)
    fixed = {n: x for n, x in fit.vehicle.model.items if n not in fit.values}
    lines = [
        "[[Model]]",
        f"    {law.name}: {law.title}",
        *([f"    {law.formula}"] if law.formula else []),
        f"    vehicle {fit.follower} behind vehicle {fit.follower - 1} of {', '.join(sources)}",
        "[[Fit]]",
        f"    trained on        = {stretches}; {sum(s.gap.size for s in fit.segments)} samples",
        f"    objective         = {fit.value:.6g} ({_objective(fit.objective)})",
        f"    seeds             = {fit.agreeing} of {fit.objectives.size} within 1 % of the best objective"
        + (f", the worst {fit.objectives[-1]:.4g}" if fit.agreeing < fit.objectives.size else ""),
        f"    evaluations       = {fit.evaluations} in {fit.seconds:.2g} s",
        f"    intervals         = 95 %, {fit.refits.shape[1]} refits, blocks of {fit.blocks:.3g} s",
        "[[Variables]]",
        *_variables(fit),
    ]
    if fixed:
        lines.append(f"    fixed: {', '.join(f'{n} = {x:g}' for n, x in fixed.items())}")
    lines += ["[[Errors]]", *_table(fit)]
    if fit.notes:
        lines += ["[[Notes]]", *(f"    - {n}" for n in fit.notes)]
    return "\n".join(lines)


def _objective(name: str) -> str:
    return "r.m.s. gap error over r.m.s. gap" + (", plus the same of speed" if name == "gap+speed" else "")


def _variables(fit: Fit) -> list[str]:
    cells = []
    spread = fit.spread
    for i, (name, x) in enumerate(fit.values.items()):
        low, high = fit.intervals[name]
        cells.append(
            (
                f"{name}:", f"{x:.5g} {quantity_unit(fit, name)}", f"[{low:.4g}, {high:.4g}]",
                f"seeds ±{0.5 * spread[name]:.1g}", f"in {fit.space.low[i]:g} to {fit.space.high[i]:g}",
                fit.profiles[i].words,
            )
        )  # fmt: skip
    return _columns(cells)


def _table(fit: Fit) -> list[str]:
    head = ("", "gap [m]", "relative", "speed [m/s]", "constant speed: gap", "copy leader: gap", "seconds")
    rows: list[tuple[str, ...]] = [head]
    for label, errors in (("train", fit.train), ("test", fit.test)):
        rows += [_row(label, e, len(errors) > 1 or label == "test") for e in errors]
    if not fit.test:
        rows.append(("test", "none", "", "", "", "", ""))
    return _columns(rows)


def _row(label: str, e: Errors, named: bool) -> tuple[str, ...]:
    numbers = (e.gap, e.gap_relative, e.speed, e.constant_gap, e.copy_gap)
    texts = [f"{x:.3g}" if x == x else "collides" for x in numbers]
    return (f"{label} {e.source}" if named else label, *texts, f"{e.seconds:.4g}")


def _columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows as left-aligned columns."""
    widths = [max(len(r[i]) for r in rows) for i in range(len(rows[0]))]
    return ["    " + "  ".join(c.ljust(w) for c, w in zip(r, widths, strict=True)).rstrip() for r in rows]


def fit_html(fit: Fit) -> str:
    """A fit as HTML tables: values with intervals, what the record says of each, errors in train and test, notes."""
    law = fit.vehicle.model.law
    quantities = []
    for i, (name, x) in enumerate(fit.values.items()):
        low, high = fit.intervals[name]
        bounds = f"{fit.space.low[i]:g} to {fit.space.high[i]:g}"
        quantities.append(
            (name, x, quantity_unit(fit, name), f"{low:.4g} to {high:.4g}", bounds, fit.profiles[i].words)
        )
    errors = [
        (label, e.source, e.gap, e.gap_relative, e.speed, e.constant_gap, e.copy_gap)
        for label, several in (("train", fit.train), ("test", fit.test))
        for e in several
    ]
    return block(
        table(
            f"{law.title} fitted to vehicle {fit.follower}",
            ("quantity", "value", "unit", "95 % interval", "searched", "the record says"),
            quantities,
        ),
        table(
            "Errors (r.m.s.)",
            ("", "record", "gap [m]", "relative", "speed [m/s]", "constant speed: gap [m]", "copy leader: gap [m]"),
            errors,
        ),
        *(paragraph(note) for note in fit.notes),
    )
