"""The basis of a benchmark: its rules, its entries with every parameter, and the sources."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

from headway.benchmark.cells import Board
from headway.benchmark.measures import MEASURES
from headway.benchmark.outcome import Outcome
from headway.benchmark.scores import CRITERIA, ENERGY_TOLERANCE, OWN, TOLERANCE
from headway.report import Section, Table, Text
from headway.scenario.leaders import Disturbance
from headway.version import __version__

__all__ = ["citations", "methods", "parameters", "provenance"]

Row = tuple[str | float, ...]

_PLATOONS = (
    "Each platoon has a leader, whose motion is prescribed exactly, and {b.followers} followers of one kind (mixed "
    "platoons as listed). Followers start in their exact equilibrium at the leader's first speed; an entry that rests "
    "at every gap starts at the gap of its row below. Late are all on-board signals of an entry without radio, and the "
    "received ones alone of an entry with radio, unless its row says otherwise."
)
_NUMBERS = (
    "Trajectories are integrated by a Runge-Kutta method of order 4 with steps of at most {b.dt:g} s that end on every "
    "breaking point of the delays; stops and starts are found as events; a collision ends the run of that follower and "
    "of all behind it. Measures use samples every {b.output_step:g} s, extremes refined between them."
)
_MEASURED = (
    "Growth is that of the worst vehicle: behind leaders that repeat themselves the ratio of fundamentals in the last "
    "whole periods (of L2 norms for a vehicle that stops), behind all others the ratio of L2 norms of speed "
    "deviations; a run with a collision has none. Energy is at the wheels of a mid-size car by road load, with no fuel "
    "where it brakes."
)


def methods(outcome: Outcome) -> Section:
    """Return the rules and methods of a benchmark: criteria, delays, disturbances and measures."""
    b = outcome.board.benchmark
    criteria = Table(
        ("criterion", "holds if", "measure", "after"),
        tuple((c.name, c.rule, MEASURES[c.measure].meaning, c.source) for c in CRITERIA),
        "Criteria",
        sortable=False,
        note=f"Ratios may exceed 1 by {TOLERANCE:g}, that of energy by {ENERGY_TOLERANCE:g}, as records end and are "
        "sampled.",
    )
    delays = Table(
        ("case", "on board", "radio"),
        tuple((c.name, c.onboard, c.radio) for c in b.cases),
        "Cases of delays",
        ("", "s", "s"),
        sortable=False,
    )
    leaders = Table(
        ("disturbance", "leader", "parameters", "length", "swept"),
        tuple((c.name, c.leader.kind, _fields_of(c.leader), c.duration, "yes" if c.sweep else "no") for c in b.courses),
        "Disturbances",
        ("", "", "SI units", "s", ""),
        sortable=False,
    )
    meanings = Table(
        ("measure", "meaning", "unit"),
        tuple((n.replace("_", " "), m.meaning, m.unit) for n, m in MEASURES.items()),
        "Measures",
        sortable=False,
    )
    words = Text((_PLATOONS.format(b=b), _NUMBERS.format(b=b), _MEASURED))
    return Section("Rules and methods", (words, criteria, delays, leaders, meanings), "methods")


def _fields_of(leader: Disturbance) -> str:
    """Write the parameters of a leader in one line; a file by its name alone."""
    described: Any = leader  # all kinds are dataclasses
    values = {f.name: getattr(described, f.name) for f in fields(described)}
    settings = {n: Path(v).name if n == "file" and v else v for n, v in values.items() if v not in (None, ())}
    return ", ".join(f"{n} = {v:.6g}" if isinstance(v, float) else f"{n} = {v}" for n, v in settings.items())


def parameters(outcome: Outcome) -> Section:
    """Return the entries of a benchmark with all their parameters and where these come from."""
    rows: list[Row] = []
    for entry in outcome.board.benchmark.entries:
        for name, number in entry.model.items:
            info = entry.model.law.parameters[name].info
            rows.append((entry.name, name, number, info.unit if info.unit != "1" else "", info.text))
        if entry.start_gap is not None:
            rows.append((entry.name, "start gap", entry.start_gap, "m", "gap at the start"))
        rows.append((entry.name, "length", entry.vehicle.length, "m", "length of the vehicle"))
        rows.append((entry.name, "lag", entry.vehicle.lag, "s", "time constant of the actuator"))
    table = Table(
        ("model", "parameter", "value", "unit", "meaning"), tuple(rows), "Every parameter at its published set"
    )
    entries = Table(
        ("model", "law", "late signals", "where its values come from"),
        tuple(
            (e.name, f"`{e.model.name}`: {e.model.law.formula}", ", ".join(e.late), e.note)
            for e in outcome.board.benchmark.entries
        ),
        "Entries",
        sortable=False,
    )
    return Section("Entries and parameters", (entries, table), "parameters")


def provenance(outcome: Outcome) -> dict[str, str]:
    """Return versions, hashes and settings that reproduce a benchmark, by name."""
    b = outcome.board.benchmark
    return {
        "headway": __version__,
        "cells": f"{len(outcome.board.cells)}, of which {len(outcome.board.failed)} could not be run",
        "scenarios (SHA-256 over their hashes)": outcome.digest,
        "seed": "0; nothing in this benchmark is random unless a random leader takes part",
        "integration": f"rk4, steps of at most {b.dt:g} s",
    }


def citations(board: Board) -> tuple[str, ...]:
    """Return the publications that laws, criteria and disturbances of a benchmark come from."""
    laws = [e.model.law for e in board.benchmark.entries]
    sources = [law.source + (f", doi:{law.doi}" if law.doi else "") for law in laws if law.source]
    sources += [c.source for c in CRITERIA if c.source != OWN]
    sources += [c.leader.source for c in board.benchmark.courses if c.leader.source]
    return tuple(dict.fromkeys(sources))
