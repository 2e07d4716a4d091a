"""Study files: a scenario file with a table of axes."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from headway.checked import typed
from headway.errors import HeadwayError, shorten, unknown_name
from headway.models import Law
from headway.scenario.document import from_table, read_table, vehicles
from headway.scenario.scenario import Scenario
from headway.scenario.validation import field_names
from headway.study.study import Study

__all__ = ["load_study", "study_from_table"]

_DESIGN = ("kind", "count", "seed")


@typed
def load_study(path: str | os.PathLike[str], models: Iterable[Law] = ()) -> Study:
    """The study in a TOML file: a scenario with `[axes]` and, optionally, `[design]` and `[types.<name>]`.

    Args:
        path: the file.
        models: laws of one's own in it.

    Raises:
        HeadwayError: for everything that is not allowed, naming the place in the file.
    """
    return study_from_table(read_table(path), models, Path(path).parent)


def study_from_table(
    table: Mapping[str, Any], models: Iterable[Law] = (), folder: str | os.PathLike[str] = "."
) -> Study:
    """The study described by a table (see `docs/scaling.md`).

    Args:
        table: the scenario's keys, and `axes`, `design` and `types`.
        models: laws of one's own in it.
        folder: where relative paths begin.

    Raises:
        HeadwayError: for everything that is not allowed, naming the place in the table.
    """
    models = tuple(models)
    rest = {k: v for k, v in table.items() if k not in ("axes", "design", "types")}
    if "axes" not in table:
        raise HeadwayError("axes is missing; a study file is a scenario file with a table [axes], e.g. T = [1.0, 1.5]")
    design = _table("design", table.get("design", {}))
    for key in design:
        if key not in _DESIGN:
            raise _misplaced("design", key) or unknown_name("key in design", key, _DESIGN)
    seed = design.get("seed", 0)
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise HeadwayError(f"design.seed = {shorten(seed)} is not a whole number of 0 or more")
    for key, value in _table("axes", table["axes"]).items():
        if not isinstance(value, list | Mapping) and (error := _misplaced("axes", key)):
            raise error
    types = {
        name: vehicles([{**_table(f"types.{name}", t), "count": 1}], models, f"types.{name}")[0]
        for name, t in _table("types", table.get("types", {})).items()
    }
    return Study(
        from_table(rest, models, folder), dict(_flat(_table("axes", table["axes"]))), design.get("kind", "grid"),
        design.get("count"), seed, types,
    )  # fmt: skip


def _table(place: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise HeadwayError(f"{place} = {shorten(value)} is not a table")
    return value


def _misplaced(place: str, key: str) -> HeadwayError | None:
    """The error for a field of the scenario that stands below the header of a table, which TOML gives it to."""
    if key not in field_names(Scenario):
        return None
    return HeadwayError(f"{place}.{key}: a field of the scenario with one value stands above the first [table]")


def _flat(axes: Mapping[str, Any], before: str = "") -> Iterable[tuple[str, Any]]:
    """Paths of axes: `leader.amplitude = [...]` is a table in a table to TOML."""
    for key, value in axes.items():
        if isinstance(value, Mapping) and not {"from", "to"} & set(value):
            yield from _flat(value, f"{before}{key}.")
        else:
            yield before + key, value
