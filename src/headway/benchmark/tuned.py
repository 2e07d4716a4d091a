"""Tuning: entries with a common equilibrium gap at a common speed."""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise

from headway.benchmark.spec import Entry
from headway.errors import HeadwayError
from headway.theory.scalar import root

__all__ = ["tuned"]


def tuned(entry: Entry, speed: float, gap: float) -> Entry:
    """Return an entry with the parameters named in its `tune` multiplied by the factor that sets its gap.

    Args:
        entry: the entry; one that rests at every gap starts at `gap` instead.
        speed: [m/s] of the equilibrium.
        gap: [m] of the equilibrium.

    Raises:
        HeadwayError: if `tune` is empty, or no factor within the bounds of the parameters gives the gap.
    """
    if entry.start_gap is not None:
        return dataclasses.replace(entry, start_gap=gap)
    if not entry.tune:
        raise HeadwayError(f"{entry.name} says in no `tune` which parameters set its gap")
    now = entry.model.parameters

    def missing(power: float) -> float:
        scaled = {name: now[name] * math.exp(power) for name in entry.tune}
        try:
            return entry.model.replace(**scaled).equilibrium_gap(speed) - gap
        except HeadwayError:
            return math.nan

    samples = [(x, y) for x in (i / 10 for i in range(-50, 51)) if math.isfinite(y := missing(x))]
    for (a, ya), (b, yb) in pairwise(samples):
        if ya <= 0 <= yb or yb <= 0 <= ya:
            factor = math.exp(root(missing, a, b, 1e-13))
            model = entry.model.replace(**{name: now[name] * factor for name in entry.tune})
            return dataclasses.replace(entry, vehicle=dataclasses.replace(entry.vehicle, model=model))
    raise HeadwayError(f"{entry.name}: no factor on {', '.join(entry.tune)} gives a gap of {gap:g} m at {speed:g} m/s")
