"""The Python lines that reproduce a scenario exactly."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from itertools import groupby
from typing import Any

from headway import models
from headway.models import Law, Model
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle

__all__ = ["python_lines"]


def python_lines(scenario: Scenario, references: Mapping[str, str] | None = None) -> str:
    """A program that makes this scenario, simulates it and asks for its stability.

    Args:
        scenario: Its numbers are written so that they are read back with the same bits.
        references: By name of a law of one's own, where it is, e.g. {"soft": "my.py:soft"}.
    """
    files = dict(references or {})
    lines = ["import headway as hw", ""]
    parts: list[str] = []
    names: dict[Vehicle, str] = {}
    for vehicle, group in groupby(scenario.followers):
        if vehicle not in names:
            names[vehicle] = f"car_{len(names) + 1}"
            lines.append(
                f"{names[vehicle]} = hw.Vehicle({_arguments(vehicle, [_model(vehicle.model, files)], 'model')})"
            )
        count = len(list(group))
        parts.append(f"[{names[vehicle]}] * {count}" if count > 1 else f"[{names[vehicle]}]")
    leader = scenario.leader
    lines.append(f"leader = hw.{leader.kind}({_arguments(leader, [])})")
    rest = _arguments(scenario, ["leader", " + ".join(parts)], "leader", "followers")
    lines += [f"sc = hw.Scenario({rest})", "tr = hw.simulate(sc)", ""]
    if scenario.gaps is None:
        lines.append(f"lin = hw.head_to_tail(sc.followers, {scenario.cruise!r})")
    else:
        lines.append(f"lin = hw.head_to_tail(sc.followers, {scenario.cruise!r}, sc.initial_gaps())")
    lines.append("print(hw.metrics.summary(tr), lin.peak)")
    return "\n".join(lines) + "\n"


def _model(model: Model, references: Mapping[str, str]) -> str:
    values = ", ".join(f"{n}={x!r}" for n, x in model.items)
    return f"{_law(model.law, references)}({values})"


def _law(law: Law, references: Mapping[str, str]) -> str:
    for name in models.__all__:
        if getattr(models, name) is law:
            return f"hw.models.{name}"
    reference = references.get(law.name, f"{law.function.__module__}.py:{law.name}")
    return f"hw.load_laws({reference!r})[0]"


def _arguments(thing: Any, first: list[str], *skip: str) -> str:
    """The arguments that make a described thing: all fields but those that have their default."""
    arguments = [
        f"{f.name}={_literal(f.name, getattr(thing, f.name))}"
        for f in dataclasses.fields(thing)
        if f.name not in skip and getattr(thing, f.name) != f.default
    ]
    return ", ".join([*first, *arguments])


def _literal(name: str, value: Any) -> str:
    pairs = ("delay", "gap_offsets", "speed_offsets", "columns", "units")
    return repr(dict(value)) if name in pairs and isinstance(value, tuple) else repr(value)
