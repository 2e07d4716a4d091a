"""Scenario files: TOML in and out without loss, overrides by path, and the JSON schema."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import TypeAdapter

from headway.checked import as_path, typed
from headway.errors import HeadwayError, shorten, unknown_name
from headway.limits import check_size
from headway.models import Law, Model
from headway.models.registry import BUILT_IN, find, with_own
from headway.results import open_results
from headway.scenario.leaders import KINDS, Disturbance, kind_named
from headway.scenario.recorded import Recorded
from headway.scenario.scenario import Scenario
from headway.scenario.toml import parse, read_table, value
from headway.scenario.validation import build, field_names
from headway.scenario.vehicle import Vehicle

__all__ = [
    "FOLLOWER_KEYS", "assemble", "from_table", "from_toml", "load", "override", "read_table", "schema", "to_table",
    "to_toml", "vehicles",
]  # fmt: skip

KINDS[Recorded.kind] = Recorded

FOLLOWER_KEYS = ("model", "parameters", "count", *(n for n in field_names(Vehicle) if n != "model"))
_TOP_KEYS = ("leader", "followers", *(n for n in field_names(Scenario) if n not in ("leader", "followers")))


@typed
def load(path: str | os.PathLike[str], models: Iterable[Law] = ()) -> Scenario:
    """The scenario in a TOML file, or the one that a NetCDF file of results was made from.

    Args:
        path: The file.
        models: Laws of one's own that the file may ask for.

    Raises:
        HeadwayError: That names the place in the file for everything that is not allowed.
    """
    file = as_path(path, "file")
    if file.suffix != ".nc":
        return from_table(read_table(file), models, file.parent)
    text = open_results(file).attrs.get("scenario")
    if not isinstance(text, str):
        raise HeadwayError(f"{file}: the file does not say from which scenario it was made")
    return from_table(parse(text, f"{file}: scenario"), models, file.parent)


@typed
def from_toml(text: str, models: Iterable[Law] = (), folder: str | os.PathLike[str] = ".") -> Scenario:
    """The scenario in a TOML text; relative paths in it start at `folder`."""
    return from_table(parse(text, "scenario"), models, folder)


def from_table(table: Mapping[str, Any], models: Iterable[Law] = (), folder: str | os.PathLike[str] = ".") -> Scenario:
    """The scenario described by a table (see `docs/scenario.md`)."""
    if not isinstance(table, Mapping):
        raise HeadwayError(f"scenario = {shorten(table)} is not a table; a scenario needs a leader and followers")
    for key in table:
        if key not in _TOP_KEYS:
            raise unknown_name("key in the scenario", key, _TOP_KEYS)
    for key in ("leader", "followers"):
        if key not in table:
            raise HeadwayError(f"scenario.{key} is missing; a scenario needs a leader and followers")
    return assemble(table, vehicles(table["followers"], models), folder)


def assemble(table: Mapping[str, Any], followers: list[Vehicle], folder: str | os.PathLike[str] = ".") -> Scenario:
    """The scenario of a table with these followers instead of those described in it."""
    rest = {k: v for k, v in table.items() if k not in ("leader", "followers")}
    return build(Scenario, {"leader": _leader(table["leader"], folder), "followers": followers, **rest}, "scenario")


def _leader(table: Any, folder: str | os.PathLike[str]) -> Disturbance:
    if not isinstance(table, Mapping):
        raise HeadwayError(f"leader = {shorten(table)} is not a table; it needs kind = one of {', '.join(KINDS)}")
    if "kind" not in table:
        raise HeadwayError(f"leader.kind is missing; allowed are {', '.join(KINDS)}")
    kind = kind_named(table["kind"])
    fields = {k: v for k, v in table.items() if k != "kind"}
    _not_above(fields, "leader", field_names(kind))
    if isinstance(fields.get("file"), str) and not os.path.isabs(fields["file"]):
        fields["file"] = os.path.normpath(os.path.join(folder, fields["file"]))
    return build(kind, fields, "leader")


def _not_above(table: Mapping[str, Any], place: str, allowed: Iterable[str]) -> None:
    """Refuse a key of the scenario that stands below the header of a table, where TOML gives it to that table."""
    for key in table:
        if key in _TOP_KEYS and key not in allowed:
            header = "[[followers]]" if place.startswith("followers") else f"[{place}]"
            raise HeadwayError(f"{place}.{key}: {key} belongs to the scenario; write it above the first {header}")


def vehicles(tables: Any, models: Iterable[Law] = (), place_of_one: str | None = None) -> list[Vehicle]:
    """The followers that one or more tables of a file describe, front to back.

    Args:
        tables: one table or a list of them, as `[[followers]]` holds them.
        models: laws of one's own that a table may name.
        place_of_one: where a single table stands in its file, for errors; `followers.0` and so on if not given.
    """
    models = tuple(models)
    if isinstance(tables, Mapping):
        tables = [tables]
    if not isinstance(tables, list) or not tables:
        raise HeadwayError(f"followers must be one or more [[followers]] tables, not {shorten(tables)}")
    check_size("[[followers]]", len(tables), "tables of followers")
    known = with_own(models)
    found: list[Vehicle] = []
    for i, table in enumerate(tables):
        place = place_of_one or f"followers.{i}"
        if not isinstance(table, Mapping):
            raise HeadwayError(f"{place} = {shorten(table)} is not a table")
        _not_above(table, place, FOLLOWER_KEYS)
        for key in table:
            if key not in FOLLOWER_KEYS:
                raise unknown_name(f"key in {place}", key, FOLLOWER_KEYS)
        if "model" not in table:
            raise HeadwayError(f"{place}.model is missing; allowed are {', '.join(sorted(known))}")
        if isinstance(table["model"], list | Mapping):
            raise HeadwayError(f"{place}.model = {shorten(table['model'])} is not the name of a law")
        name = str(table["model"])  # a law may be called nan or inf, which TOML takes for numbers
        law = known.get(name) or find(name, models, f"{place}.model")
        parameters = table.get("parameters", {})
        if not isinstance(parameters, Mapping):
            raise HeadwayError(f"{place}.parameters = {shorten(parameters)} is not a table")
        count = table.get("count", 1)
        if isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= 1_000_000:
            raise HeadwayError(f"{place}.count = {shorten(count)} is not a whole number from 1 to 1000000")
        check_size(f"{place}.count = {count}", len(found) + count, "vehicles")
        try:
            model = law(**{str(name): x for name, x in parameters.items()})
        except HeadwayError as error:
            raise HeadwayError(f"{place}.parameters: {error}") from None
        rest = {k: v for k, v in table.items() if k not in ("model", "parameters", "count")}
        found += [build(Vehicle, {"model": model, **rest}, place)] * count
    return found


def to_table(scenario: Scenario, complete: bool = False) -> dict[str, Any]:
    """The scenario as plain tables; `complete` writes defaults too and adds the code of laws of one's own."""
    table = _fields(scenario, complete, skip=("leader", "followers"))
    for key in ("gap_offsets", "speed_offsets"):
        if key in table:
            table[key] = {str(k): v for k, v in table[key]}
    table["leader"] = {"kind": scenario.leader.kind, **_fields(scenario.leader, complete)}
    for key in ("columns", "units"):
        if key in table["leader"]:
            table["leader"][key] = dict(table["leader"][key])
    followers: list[dict[str, Any]] = []
    last: Vehicle | None = None
    for vehicle in scenario.followers:
        if vehicle == last:
            followers[-1]["count"] = followers[-1].get("count", 1) + 1
            continue
        followers.append(_vehicle(vehicle, complete))
        last = vehicle
    table["followers"] = followers
    return table


def _vehicle(vehicle: Vehicle, complete: bool) -> dict[str, Any]:
    model: Model = vehicle.model
    table: dict[str, Any] = {"model": model.name, "parameters": model.parameters}
    table |= _fields(vehicle, complete, skip=("model",))
    if isinstance(table.get("delay"), tuple | list):
        table["delay"] = dict(table["delay"])
    if complete and BUILT_IN.get(model.name) is not model.law:
        from headway.models.fingerprint import fingerprint

        forms = {what: fingerprint(form) for what, form in model.law.forms.items()}
        table["code"] = {"law": fingerprint(model.law.function), **forms}
    return table


def _fields(thing: Any, complete: bool, skip: tuple[str, ...] = ()) -> dict[str, Any]:
    table = {}
    for f in dataclasses.fields(thing):
        if f.name in skip:
            continue
        value = getattr(thing, f.name)
        if complete or value != f.default:
            table[f.name] = list(value) if isinstance(value, tuple) and f.name not in _PAIRS else value
    return table if complete else {k: v for k, v in table.items() if v is not None}


_PAIRS = ("gap_offsets", "speed_offsets", "columns", "units", "delay")


def to_toml(scenario: Scenario) -> str:
    """See `Scenario.to_toml`."""
    import tomli_w

    table = to_table(scenario)
    plain = {k: v for k, v in table.items() if not isinstance(v, dict | list) or k == "gaps"}
    nested = {k: v for k, v in table.items() if k not in plain}
    return tomli_w.dumps({**plain, **nested})


def override(table: dict[str, Any], assignment: str, more: tuple[str, ...] = ()) -> None:
    """Apply `path=value` to a raw table in place, e.g. `followers.0.parameters.T=1.1` or `leader.omega=0.3`.

    The value is read as TOML, or as text where it is none. Raises `HeadwayError` for a path that
    leads nowhere. `more` are top-level keys that a scenario has not.
    """
    path, equals, text = assignment.partition("=")
    keys = path.strip().split(".")
    shown = assignment if len(assignment) <= 80 else f"{assignment[:79]}…"
    if not equals or not all(keys) or len(keys) > _DEPTH:
        raise HeadwayError(f"--set {shown}: write path=value, e.g. followers.0.parameters.T=1.1")
    if len(keys) == 1 and keys[0] not in (*_TOP_KEYS, *more) and (near := _below(table, keys[0])):
        raise HeadwayError(f"--set {shown}: {keys[0]!r} is not known; did you mean {near}={text.strip()[:20]}?")
    given, assignment = value(text), shown
    place: Any = table
    for i, key in enumerate(keys[:-1]):
        place = _step(place, key, keys[: i + 1], assignment, more)
    last = keys[-1]
    if isinstance(place, list):
        _step(place, last, keys, assignment, more)
        place[int(last)] = given
    elif isinstance(place, dict):
        place[last] = given
    else:
        raise HeadwayError(f"--set {assignment}: {'.'.join(keys[:-1])} is not a table")


#: most parts of a path of `--set`
_DEPTH = 16


def _below(table: Mapping[str, Any], key: str) -> str | None:
    """The path of a field or parameter called `key` further down in a table, or None."""
    followers = table.get("followers")
    for i, follower in enumerate(followers if isinstance(followers, list) else [followers]):
        if isinstance(follower, Mapping):
            law = BUILT_IN.get(str(follower.get("model")))
            given = follower.get("parameters", {})
            if (law is not None and key in law.parameters) or (isinstance(given, Mapping) and key in given):
                return f"followers.{i}.parameters.{key}"
            if key in FOLLOWER_KEYS:
                return f"followers.{i}.{key}"
    leader = table.get("leader")
    kind = KINDS.get(str(leader.get("kind"))) if isinstance(leader, Mapping) else None
    return f"leader.{key}" if kind is not None and key in field_names(kind) else None


def _step(place: Any, key: str, path: list[str], assignment: str, more: tuple[str, ...]) -> Any:
    here = ".".join(path)
    if isinstance(place, list):
        if not (key.isascii() and key.isdecimal() and len(key) < 9) or int(key) >= len(place):
            raise HeadwayError(f"--set {assignment}: {here} does not exist; entries are 0 to {len(place) - 1}")
        return place[int(key)]
    if isinstance(place, dict):
        allowed = (*_TOP_KEYS, *more)
        if len(path) == 1 and key not in allowed:
            raise unknown_name(f"--set {assignment}", key, allowed)
        return place.setdefault(key, {})
    raise HeadwayError(f"--set {assignment}: {'.'.join(path[:-1])} is not a table")


def schema() -> dict[str, Any]:
    """JSON schema of scenario files, for editors."""
    leaders = []
    for kind, cls in KINDS.items():
        part = TypeAdapter(cls).json_schema()
        part["properties"] = {"kind": {"const": kind}, **part.get("properties", {})}
        for key in ("columns", "units"):
            if key in part["properties"]:
                text = part["properties"][key].get("description", "")
                part["properties"][key] = {
                    "description": text, "type": "object", "additionalProperties": {"type": "string"},
                }  # fmt: skip
        part["required"] = ["kind", *part.get("required", [])]
        part["description"] = (cls.__doc__ or "").strip().splitlines()[0]
        leaders.append(part)
    top = _schema_of(Scenario)
    vehicle = _schema_of(Vehicle)
    number = {"type": "number", "minimum": 0}
    vehicle["properties"]["delay"] |= {
        "anyOf": [number, {"type": "object", "additionalProperties": number}],
        "default": 0.0,
    }
    vehicle["properties"] |= {
        "model": {"type": "string", "description": f"name of the law: {', '.join(BUILT_IN)} or one of your own"},
        "parameters": {"type": "object", "additionalProperties": {"type": "number"}},
        "count": {"type": "integer", "minimum": 1, "default": 1, "description": "how many of this kind in a row"},
    }
    vehicle["required"] = ["model"]
    top["properties"] |= {
        "leader": {"oneOf": leaders},
        "followers": {"type": "array", "minItems": 1, "items": vehicle},
    }
    offsets = {"type": "object", "additionalProperties": {"type": "number"}}
    for key in ("gap_offsets", "speed_offsets"):
        top["properties"][key] = {"description": top["properties"][key].get("description", ""), **offsets}
    top["required"] = ["leader", "followers"]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "headway scenario", **top}


def _schema_of(cls: type) -> dict[str, Any]:
    part = TypeAdapter(cls).json_schema()
    return {k: part[k] for k in ("type", "properties", "additionalProperties", "$defs") if k in part}
