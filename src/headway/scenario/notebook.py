"""How a scenario shows itself in a notebook."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

from headway.errors import shorten
from headway.html import block, paragraph, table
from headway.scenario.fields import described

if TYPE_CHECKING:
    from headway.scenario.scenario import Scenario
    from headway.scenario.vehicle import Vehicle

__all__ = ["scenario_html"]

_FIELDS = ("field", "value", "unit", "meaning")


def scenario_html(scenario: Scenario) -> str:
    """Leader, followers front to back with their equilibrium, and how the run is made."""
    leader = scenario.leader
    return block(
        paragraph(": ".join(text for text in (scenario.name, scenario.description) if text)),
        table(f"Leader: {leader.kind}", _FIELDS, [_field(*row) for row in described(leader)]),
        table(
            f"Followers: {len(scenario.followers)}, front to back",
            ("no.", "model", "parameters (SI)", "delay [s]", "lag [s]", "length [m]", "limits [m/s²]", "first gap [m]"),
            _followers(scenario),
        ),
        table("Run", _FIELDS, _run(scenario)),
    )


def _field(name: str, value: Any, unit: str, meaning: str) -> tuple[str, object, str, str]:
    if isinstance(value, tuple) and all(isinstance(pair, tuple) for pair in value):
        value = ", ".join(f"{key}: {entry}" for key, entry in value)
    return name, value if isinstance(value, float | int | str) else shorten(value), unit, meaning


def _followers(scenario: Scenario) -> list[tuple[object, ...]]:
    """A row for each run of equal vehicles that start with the same gap."""
    rows: list[tuple[object, ...]] = []
    numbered = enumerate(zip(scenario.followers, scenario.initial_gaps(), strict=True), start=1)
    for (vehicle, gap), run in itertools.groupby(numbered, key=lambda entry: entry[1]):
        numbers = [number for number, _ in run]
        who = f"{numbers[0]}" if len(numbers) == 1 else f"{numbers[0]} to {numbers[-1]}"
        rows.append((who, *_vehicle(vehicle), gap))
    return rows


def _vehicle(vehicle: Vehicle) -> tuple[object, ...]:
    parameters = ", ".join(f"{name} = {value:g}" for name, value in vehicle.model.parameters.items())
    delay = vehicle.delay
    late = f"{delay:g}" if isinstance(delay, float) else ", ".join(f"{name} {time:g}" for name, time in delay)
    limits = "none" if vehicle.limits is None else f"{vehicle.limits[0]:g} to {vehicle.limits[1]:g}"
    return vehicle.model.name, parameters, late, vehicle.lag, vehicle.length, limits


def _run(scenario: Scenario) -> list[tuple[str, object, str, str]]:
    """Fields that differ from their defaults; the duration and the speed before t = 0 always."""
    known = {"duration": scenario.end, "initial_speed": scenario.cruise}
    skip = ("leader", "followers", "name", "description")
    rows = [(n, known.get(n, value), u, m) for n, value, u, m in described(scenario, every=True) if n not in skip]
    changed = {row[0] for row in described(scenario)}
    return [_field(*row) for row in rows if row[0] in known or row[0] in changed]
