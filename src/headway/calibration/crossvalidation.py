"""Cross-validation: fitted to one run and vehicle, tested on every other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from headway.calibration.baselines import errors_on
from headway.calibration.fit import Source, opened
from headway.calibration.loop import Loop
from headway.calibration.search import search
from headway.calibration.segments import cut
from headway.calibration.space import Space
from headway.checked import typed
from headway.models import Law, Model
from headway.scenario.vehicle import Vehicle

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["cross_validate"]

_MEANINGS = {
    "gap": ("m", "r.m.s. gap error"),
    "gap_relative": ("1", "r.m.s. gap error over r.m.s. gap"),
    "speed": ("m/s", "r.m.s. speed error"),
}


@typed
def cross_validate(
    model: Vehicle | Model | Law,
    recordings: Sequence[Source],
    vehicles: Sequence[int] | None = None,
    *,
    fit: Sequence[str] | None = None,
    objective: str = "gap",
    bounds: Mapping[str, tuple[float, float]] | None = None,
    seeds: int = 3,
    seed: int = 0,
) -> xr.Dataset:
    """Errors of a law fitted to each (run, vehicle) and driven in the place of each other.

    Args:
        model: a law, a model or a vehicle.
        recordings: runs, as `Recording` or files.
        vehicles: followers of every run; all that every run has if None.
        fit: names of fitted quantities, as of `calibrate`.
        objective: "gap" or "gap+speed", as of `calibrate`.
        bounds: name → (low, high) [SI], as of `calibrate`.
        seeds: searches that start differently.
        seed: the first of their seeds.

    Returns:
        A dataset along trained and tested, whose coordinates name run and vehicle of both; NaN where the fitted law
        collides. The diagonal is the training error.
    """
    import xarray as xr

    records = [opened(r) for r in recordings]
    if vehicles is None:
        vehicles = range(1, min(r.vehicles for r in records))
    space = Space.of(model, fit, bounds)
    places = [(i, n) for i in range(len(records)) for n in vehicles]
    pieces = [cut(records[i], n)[0] for i, n in places]
    results: dict[str, Any] = {name: np.full((len(places), len(places)), np.nan) for name in _MEANINGS}
    values = np.empty((len(places), len(space.names)))
    for row, segments in enumerate(pieces):
        best = search(Loop(space, segments, objective), seeds, seed)[0][:, 0]
        values[row] = space.values(best)
        for column, others in enumerate(pieces):
            errors = errors_on(others, space, best)
            for name in _MEANINGS:
                results[name][row, column] = getattr(errors, name)
    labels = [f"{records[i].source} {n}" for i, n in places]
    data: dict[str, Any] = {
        n: (("trained", "tested"), x, dict(zip(("units", "long_name"), _MEANINGS[n], strict=True)))
        for n, x in results.items()
    }
    data["values"] = (("trained", "quantity"), values)
    return xr.Dataset(data, coords={"trained": labels, "tested": labels, "quantity": list(space.names)})
