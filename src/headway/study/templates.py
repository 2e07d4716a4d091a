"""Scenarios of single points, and where each of their vehicles is described."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from headway.errors import HeadwayError, shorten
from headway.models import Law
from headway.scenario.document import assemble, to_table, vehicles
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle
from headway.study.paths import ORDER, SHARE, Target, assign, in_order

__all__ = ["Template", "TemplateTable", "vehicle_order"]

#: where a vehicle's description stands in the table: a group of followers, or a type
Origin = Target


@dataclass(frozen=True)
class Template:
    """A scenario, and for each follower where it is described.

    Attributes:
        scenario: the scenario.
        origins: for each follower the place in the table of the study.
    """

    scenario: Scenario
    origins: tuple[Origin, ...]


class TemplateTable:
    """The table of a study: its scenario and its types of vehicle, in which the fields of a point are put."""

    def __init__(self, scenario: Scenario, types: Mapping[str, Vehicle]) -> None:
        self.scenario, self.table = scenario, to_table(scenario)
        self.table["types"] = {}
        for name, vehicle in types.items():
            group = to_table(Scenario(scenario.leader, [vehicle], duration=scenario.duration, gaps=1.0))["followers"]
            self.table["types"][name] = group[0]
        everyone = [*scenario.followers, *types.values()]
        self.laws: tuple[Law, ...] = tuple({v.model.law.name: v.model.law for v in everyone}.values())

    def template(self, values: Iterable[tuple[tuple[Target, ...], Any]]) -> Template:
        """The scenario in which each field has its value.

        Args:
            values: fields of an axis, and their value.

        Raises:
            HeadwayError: if a value is not allowed.
        """
        values = list(values)
        if not values:
            groups = enumerate(self.table["followers"])
            return Template(self.scenario, tuple(("followers", i) for i, t in groups for _ in range(t.get("count", 1))))
        table = copy.deepcopy(self.table)
        shares: dict[str, float] = {}
        order: Any = None
        for target, value in in_order(values):
            if target[0] == SHARE:
                shares[str(target[1])] = _share(str(target[1]), value)
            elif target[0] == ORDER:
                order = value
            else:
                assign(table, target, value, self.laws)
        types = table.pop("types")
        described: dict[Origin, dict[str, Any]] = {("followers", i): t for i, t in enumerate(table["followers"])}
        described |= {("types", name): t for name, t in types.items()}
        built = iter(vehicles(list(described.values()), self.laws))
        cars = {origin: [(origin, next(built)) for _ in range(t.get("count", 1))] for origin, t in described.items()}
        everyone = [car for origin, same in cars.items() if origin[0] == "followers" for car in same]
        kinds = {name: cars["types", name][0] for name in types}
        seed = table.get("seed", 0)
        if shares:
            everyone = _mixed(everyone, kinds, shares, seed)
        if order is not None:
            everyone = [everyone[number - 1] for number in vehicle_order(order, len(everyone))]
        scenario = assemble(table, [v for _, v in everyone])
        return Template(scenario, tuple(origin for origin, _ in everyone))


Car = tuple[Origin, Vehicle]


def _share(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 1:
        raise HeadwayError(f"share.{name} = {shorten(value)} is not a number from 0 to 1")
    return float(value)


def _mixed(everyone: list[Car], kinds: dict[str, Car], shares: dict[str, float], seed: int) -> list[Car]:
    """Vehicles of the named types at places drawn by the scenario's seed; more of a type keeps the places it had."""
    named: dict[str, Car] = {}
    for name in shares:
        named[name] = kinds[name] if name in kinds else next(car for car in everyone if car[1].model.name == name)
    if sum(shares.values()) > 1 + 1e-12:
        raise HeadwayError(f"shares of {', '.join(shares)} add up to {sum(shares.values()):g}; at most 1 is allowed")
    ends = np.rint(np.cumsum(list(shares.values())) * len(everyone)).astype(int)
    stream = np.random.default_rng(np.random.SeedSequence(int(seed), spawn_key=(1,)))
    places = stream.permutation(len(everyone))
    taken = {car[0] for car in named.values()}
    others = [car for car in everyone if car[0] not in taken]
    if ends[-1] < len(everyone) and not others:
        raise HeadwayError(
            f"shares of {', '.join(shares)} add up to {sum(shares.values()):g}, and the scenario has no other vehicles"
        )
    result = [car if car[0] not in taken else others[0] if others else car for car in everyone]
    start = 0
    for car, end in zip(named.values(), ends, strict=True):
        for place in places[start:end]:
            result[place] = car
        start = end
    return result


def vehicle_order(order: Any, count: int) -> list[int]:
    """Numbers of vehicles front to back.

    Args:
        order: the numbers 1 to `count` in some order, or the seed of a random one.
        count: how many vehicles there are.

    Raises:
        HeadwayError: for anything else.
    """
    if isinstance(order, int) and not isinstance(order, bool) and order >= 0:
        stream = np.random.default_rng(np.random.SeedSequence(order, spawn_key=(2,)))
        return [int(i) + 1 for i in stream.permutation(count)]
    if not isinstance(order, list | tuple) or sorted(map(str, order)) != sorted(str(n) for n in range(1, count + 1)):
        raise HeadwayError(f"order = {shorten(order)} is neither the numbers 1 to {count} in some order nor a seed")
    return [int(n) for n in order]
