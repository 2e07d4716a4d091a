"""How a fit shows itself in a notebook."""

from __future__ import annotations

from typing import TYPE_CHECKING

from headway.calibration.report import unit_of
from headway.html import block, paragraph, table

if TYPE_CHECKING:
    from headway.calibration.fit import Fit

__all__ = ["fit_html"]


def fit_html(fit: Fit) -> str:
    """Values with intervals and what the record says of each, errors in train and test, notes."""
    law = fit.vehicle.model.law
    quantities = []
    for i, (name, x) in enumerate(fit.values.items()):
        low, high = fit.intervals[name]
        bounds = f"{fit.space.low[i]:g} to {fit.space.high[i]:g}"
        quantities.append((name, x, unit_of(fit, name), f"{low:.4g} to {high:.4g}", bounds, fit.profiles[i].words))
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
