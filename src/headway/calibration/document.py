"""Fits as TOML: `followers` as scenarios have them, and beside them values, intervals and errors of each fit."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from headway.checked import typed
from headway.errors import HeadwayError
from headway.models import Law
from headway.results import writing
from headway.scenario.document import read_table, vehicles
from headway.scenario.vehicle import Vehicle

if TYPE_CHECKING:
    from headway.calibration.fit import Fit

__all__ = ["fits_table", "fits_toml", "load_followers", "save_fits"]


def fits_toml(fits: Sequence[Fit]) -> str:
    """Fits as a TOML text: `[[followers]]` that a scenario accepts, and `[[fits]]`, one for each."""
    import tomli_w

    return tomli_w.dumps(fits_table(fits))


def fits_table(fits: Sequence[Fit]) -> dict[str, Any]:
    """Fits as plain tables: `followers`, and `fits` with values, intervals and errors of each."""
    return {"followers": [_follower(f.vehicle) for f in fits], "fits": [_record(f) for f in fits]}


@typed
def save_fits(fits: Sequence[Fit], path: str | os.PathLike[str]) -> Path:
    """Write fits as TOML that a scenario accepts.

    Args:
        fits: the fits, front to back.
        path: a file that ends in .toml.

    Returns:
        The path.

    Raises:
        HeadwayError: for another suffix, and where the file cannot be written.
    """
    target = Path(path)
    if target.suffix != ".toml":
        raise HeadwayError(f"{target}: a fit is written as .toml, not {target.suffix or 'without suffix'}")
    text = fits_toml(fits)
    with writing(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return target


@typed
def load_followers(path: str | os.PathLike[str], models: Iterable[Law] = ()) -> list[Vehicle]:
    """The vehicles of a file of fits, or of any file with `[[followers]]`.

    Args:
        path: the TOML file.
        models: laws of one's own in it.

    Raises:
        HeadwayError: where it has no followers, or they are not allowed.
    """
    content = read_table(path)
    if "followers" not in content:
        raise HeadwayError(f"{path}: has no [[followers]]; headway calibrate --out writes such a file")
    return vehicles(content["followers"], models)


def _follower(car: Vehicle) -> dict[str, Any]:
    entry: dict[str, Any] = {"model": car.model.name, "parameters": car.model.parameters}
    delay: Any = car.delay
    entry |= {"delay": delay if isinstance(delay, float) else dict(delay), "lag": car.lag, "length": car.length}
    return entry | ({"limits": list(car.limits)} if car.limits else {})


def _record(fit: Fit) -> dict[str, Any]:
    return {
        "vehicle": fit.follower,
        "sources": list(dict.fromkeys(s.source for s in fit.segments)),
        "windows": [[s.begin, s.begin + s.duration] for s in fit.segments],
        "objective": fit.objective,
        "value": fit.value,
        "seeds_agreeing": fit.agreeing,
        "intervals": {n: list(x) for n, x in fit.intervals.items()},
        "identified": {p.name: p.words for p in fit.profiles},
        "train": [_finite(e._asdict()) for e in fit.train],
        "test": [_finite(e._asdict()) for e in fit.test],
        "notes": list(fit.notes),
    }


def _finite(numbers: dict[str, Any]) -> dict[str, Any]:
    """Numbers that are not NaN: TOML leaves out what is missing."""
    return {k: v for k, v in numbers.items() if v == v}
