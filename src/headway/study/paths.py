"""What the name of an axis stands for: fields in the table of a scenario."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from typing import Any

from headway.errors import HeadwayError, did_you_mean, unknown_name
from headway.models import RADIO, SIGNALS, Law
from headway.models.registry import find
from headway.scenario.document import FOLLOWER_KEYS
from headway.scenario.leaders import KINDS
from headway.scenario.scenario import Scenario
from headway.scenario.validation import field_names
from headway.scenario.vehicle import Vehicle

__all__ = ["ORDER", "RADIO_DELAY", "SHARE", "Target", "assign", "in_order", "parameter_of", "resolve"]

#: keys that lead to a field, e.g. ("followers", 0, "parameters", "T")
Target = tuple[str | int, ...]

ORDER, SHARE = "order", "share"

#: delay of all that a law hears by radio; no field of a vehicle, which has one delay for each signal
RADIO_DELAY = "radio_delay"

_TOP = tuple(n for n in field_names(Scenario) if n not in ("leader", "followers", "name", "description"))
_VEHICLE = (*(n for n in field_names(Vehicle) if n != "model"), RADIO_DELAY)


def resolve(path: str, table: Mapping[str, Any], laws: tuple[Law, ...], free: bool = False) -> tuple[Target, ...]:
    """The fields that the name of an axis stands for.

    Args:
        path: the name, such as `T`, `leader.amplitude` or `followers.0.delay.vl`.
        table: the scenario as a table, and its types of vehicles.
        laws: the laws in it.
        free: whether models or the leader's kind vary too, so that their fields cannot be checked beforehand.

    Raises:
        HeadwayError: if it names nothing, with the nearest name.
    """
    head, *rest = path.split(".")
    if head == ORDER and not rest:
        return ((ORDER,),)
    if head == SHARE:
        return (_share(path, rest, table, laws),)
    if head == "leader" and len(rest) == 1:
        allowed = ("kind", *field_names(KINDS[table["leader"]["kind"]]))
        if not free and rest[0] not in allowed:
            raise unknown_name(f"axes.{path}: field of a {table['leader']['kind']} leader", rest[0], allowed)
        return (("leader", rest[0]),)
    if head == "types" and len(rest) >= 2:
        if rest[0] not in table["types"]:
            raise unknown_name(f"axes.{path}: type", rest[0], table["types"])
        return _of_vehicle(path, ("types", rest[0]), rest[1:], table["types"][rest[0]], laws, free)
    if head == "followers" and rest and rest[0].isdigit():
        if int(rest[0]) >= len(table["followers"]) or len(rest) == 1:
            last = len(table["followers"]) - 1
            raise HeadwayError(f"axes.{path} is not a field of a [[followers]] table; they are followers.0 to {last}")
        i = int(rest[0])
        return _of_vehicle(path, ("followers", i), rest[1:], table["followers"][i], laws, free)
    if head == "followers" and rest:
        return _of_all(path, rest, table, laws, free)
    if head in _TOP and len(rest) <= 1:
        if rest and head not in ("gap_offsets", "speed_offsets", "gaps"):
            raise HeadwayError(f"axes.{path}: {head} is a single number")
        return ((head, *rest),)
    if head in _VEHICLE:
        return _of_all(path, [head, *rest], table, laws, free)
    parameters = {p for t in _tables(table).values() for p in _law(t, laws).parameters}
    if not rest and (head in parameters or free):
        return _of_all(path, ["parameters", head], table, laws, free)
    near = did_you_mean(path, [*parameters, *_TOP, *_VEHICLE, "order"]).rstrip("?")
    names = ", ".join((*sorted(parameters), *_VEHICLE, *_TOP, "order", "share.…", "leader.…", "followers.…"))
    raise HeadwayError(f"axes.{path} names no field of the scenario{near}; allowed are {names}")


def _share(path: str, rest: list[str], table: Mapping[str, Any], laws: tuple[Law, ...]) -> Target:
    models = [_law(t, laws).name for t in table["followers"]]
    allowed = [*table["types"], *dict.fromkeys(models)]
    if len(rest) != 1 or rest[0] not in allowed:
        raise unknown_name(f"axes.{path}: type of vehicle", ".".join(rest), allowed)
    return SHARE, rest[0]


def _tables(table: Mapping[str, Any]) -> dict[Target, dict[str, Any]]:
    """Tables of all vehicles: groups of followers, then types."""
    groups: dict[Target, dict[str, Any]] = {("followers", i): t for i, t in enumerate(table["followers"])}
    return groups | {("types", name): t for name, t in table["types"].items()}


def _law(table: Mapping[str, Any], laws: tuple[Law, ...]) -> Law:
    return find(str(table["model"]), laws, "model")


def _of_all(
    path: str, rest: list[str], table: Mapping[str, Any], laws: tuple[Law, ...], free: bool
) -> tuple[Target, ...]:
    """The field of every vehicle; of a parameter, of those whose law has it."""
    tables = _tables(table)
    if rest[0] == "parameters" and len(rest) == 2 and not free:
        chosen = {t: v for t, v in tables.items() if rest[1] in _law(v, laws).parameters}
        if not chosen:
            parameters = sorted({p for v in tables.values() for p in _law(v, laws).parameters})
            raise unknown_name(f"axes.{path}: parameter", rest[1], parameters)
        tables = chosen
    if rest == [RADIO_DELAY] and not free:
        tables = {t: v for t, v in tables.items() if RADIO & set(_law(v, laws).signals)}
        if not tables:
            raise HeadwayError(f"axes.{path}: no vehicle hears radio; delay is that of what is measured on board")
    return tuple(field for t, v in tables.items() for field in _of_vehicle(path, t, rest, v, laws, free))


def _of_vehicle(
    path: str, target: Target, rest: list[str], table: Mapping[str, Any], laws: tuple[Law, ...], free: bool
) -> tuple[Target, ...]:
    if rest[0] not in (*FOLLOWER_KEYS, RADIO_DELAY):
        raise unknown_name(f"axes.{path}: field of followers", rest[0], (*FOLLOWER_KEYS, RADIO_DELAY))
    if len(rest) > (2 if rest[0] in ("parameters", "delay", "limits") else 1) or rest == ["parameters"]:
        raise HeadwayError(f"axes.{path} leads nowhere; write e.g. {'.'.join(map(str, target))}.parameters.T")
    law = None if free else _law(table, laws)
    if law and rest[0] == "parameters" and rest[1] not in law.parameters:
        raise unknown_name(f"axes.{path}: parameter of {law.name}", rest[1], law.parameters)
    if law and rest[0] == "delay" and len(rest) == 2 and rest[1] not in SIGNALS:
        raise unknown_name(f"axes.{path}: signal", rest[1], law.signals)
    if law and rest[0] == RADIO_DELAY and not RADIO & set(law.signals):
        raise HeadwayError(f"axes.{path}: {law.name} hears no radio; delay is that of what is measured on board")
    return ((*target, *rest),)


def in_order(fields: Iterable[tuple[tuple[Target, ...], Any]]) -> list[tuple[Target, Any]]:
    """Fields and their values in the order of assignment, so that axes may be given in any order.

    A field of all vehicles comes before that of one, a whole before its parts: `delay`, then `radio_delay`, then
    `delay.vl`. What decides about others, a model or a kind, comes first.

    Args:
        fields: the fields that an axis stands for, and its value.
    """
    single = [(target, value, len(targets)) for targets, value in fields for target in targets]

    def rank(entry: tuple[Target, Any, int]) -> tuple[int, int, int]:
        target, _, together = entry
        whole = (
            0 if target[-1] in ("model", "kind") else 2 if target[-1] == RADIO_DELAY else 1 if len(target) < 4 else 3
        )
        return whole, -together, len(target)

    return [(target, value) for target, value, _ in sorted(single, key=rank)]


def parameter_of(target: Target) -> str | None:
    """The parameter of a law that a field is, if it is one."""
    return str(target[3]) if len(target) == 4 and target[2] == "parameters" else None


def assign(table: dict[str, Any], target: Target, value: Any, laws: tuple[Law, ...]) -> None:
    """Put a value into the table of one point.

    Args:
        table: the scenario as a table, which is changed.
        target: the field.
        value: its value.
        laws: the laws in the table.

    Raises:
        HeadwayError: if the scenario has no such entry.
    """
    place: Any = table
    for i, key in enumerate(target[:-1]):
        if key == "delay":
            _split_delay(place, laws)
            if target[-1] == "vl" and "vl" not in _law(place, laws).signals:
                place["delay"].pop("dv", None)  # the leader's speed alone is late, instead of the whole
        elif isinstance(place, dict) and key not in place:
            place[key] = {}
        elif isinstance(place, dict) and isinstance(place[key], tuple):
            place[key] = list(place[key])
        place = place[key]
        if i == 0 and key == "gaps" and not isinstance(place, list):
            raise HeadwayError(f"axes.{'.'.join(map(str, target))}: the scenario has no list of gaps")
    if target[-1] == RADIO_DELAY:
        _split_delay(place, laws)
        place["delay"] |= {name: value for name in _law(place, laws).signals if name in RADIO}
        return
    last = target[-1]
    if isinstance(place, list):
        if not str(last).isdigit() or int(last) >= len(place):
            raise HeadwayError(f"axes.{'.'.join(map(str, target))}: entries are 0 to {len(place) - 1}")
        place[int(last)] = value
    else:
        place[last] = copy.copy(value)  # a list or table of an axis is many points'


def _split_delay(vehicle: dict[str, Any], laws: tuple[Law, ...]) -> None:
    """Make one delay of all on-board signals one of each, so that single ones can be changed."""
    seconds = vehicle.get("delay", 0.0)
    if not isinstance(seconds, dict):
        on_board = (n for n in _law(vehicle, laws).signals if n not in RADIO)
        vehicle["delay"] = dict.fromkeys(on_board, seconds) if seconds else {}
