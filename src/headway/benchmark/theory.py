"""Exact linear theory of every entry and platoon, beside what was simulated."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

from headway.benchmark.cells import PUBLISHED, Board
from headway.benchmark.spec import Benchmark, Course, Entry, Late
from headway.errors import HeadwayError
from headway.metrics import throughput
from headway.theory.linear import Linear, linearize
from headway.theory.platoon import Chain

__all__ = ["Mixed", "Theory", "gain_at", "linear", "of_entries", "of_platoons", "steady"]


@dataclass(frozen=True)
class Theory:
    """What linear theory says of an entry with late signals, and the growth measured behind the steady oscillation.

    gain: |G(iω)| at the frequency of `steady`; measured: the worst growth simulated there, NaN after a
    collision; critical delays in seconds of the entry's own late signals; flow in vehicles per hour.
    """

    who: str
    delays: str
    gap: float
    flow: float
    locally_stable: bool
    string_stable: bool
    peak_gain: float
    peak_frequency: float
    gain: float
    measured: float
    critical_local: float
    critical_string: float
    reason: str = ""


@dataclass(frozen=True)
class Mixed:
    """The same of a mixed platoon: strict verdict and the gain from the leader to the last vehicle."""

    who: str
    delays: str
    strict: bool
    head_to_tail_gain: float
    frequency: float
    reason: str = ""


def steady(benchmark: Benchmark) -> Course | None:
    """The disturbance that one frequency of linear theory describes: the first that is a sine for ever."""
    return next((c for c in benchmark.courses if c.leader.harmonic and c.leader.fundamental is not None), None)


def linear(entry: Entry, seconds: float, speed: float) -> Linear:
    """Linear theory of an entry with its late signals `seconds` late, at `speed` [m/s]."""
    return linearize(entry.with_delay(seconds), speed, entry.start_gap)


def gain_at(entry: Entry, seconds: float, speed: float, omega: float) -> float:
    """|G(iω)| of an entry; NaN if it has no equilibrium at `speed` or is locally unstable."""
    try:
        found = linear(entry, seconds, speed)
    except HeadwayError:
        return math.nan
    return float(found.gain(omega)) if found.locally_stable else math.nan


def of_entries(board: Board) -> tuple[Theory, ...]:
    """Theory of every entry in every case of delays."""
    b = board.benchmark
    return tuple(_one(board, entry, case) for entry in b.entries for case in b.cases)


def _one(board: Board, entry: Entry, case: Late) -> Theory:
    b, nothing = board.benchmark, math.nan
    course = steady(b)
    measured = nothing
    if course is not None:
        cells = [c for c in board.select(PUBLISHED, case.name, entry.name) if c.course == course.name]
        measured = cells[0].values["growth"] if not cells[0].reason and not cells[0].collided else nothing
    try:
        found = linear(entry, entry.delay(case.onboard, case.radio), b.speed)
        late = linear(entry, 1.0, b.speed)  # the pattern whose critical delay is asked
        omega = course.leader.fundamental if course is not None else None
        return Theory(
            who=entry.name,
            delays=case.name,
            gap=found.gap,
            flow=throughput(found.vehicle, b.speed, gap=found.gap),
            locally_stable=found.locally_stable,
            string_stable=found.string_stable,
            peak_gain=found.peak_gain,
            peak_frequency=found.peak_frequency,
            gain=float(found.gain(omega)) if omega is not None and found.locally_stable else nothing,
            measured=measured,
            critical_local=float(late.critical_delay("local")),
            critical_string=float(late.critical_delay("string")),
        )
    except HeadwayError as error:
        numbers = dict.fromkeys((f.name for f in dataclasses.fields(Theory) if f.type == "float"), nothing)
        return Theory(
            **{**numbers, "measured": measured}, who=entry.name, delays=case.name,
            locally_stable=False, string_stable=False, reason=str(error),
        )  # fmt: skip


def of_platoons(board: Board) -> tuple[Mixed, ...]:
    """Theory of every mixed platoon in every case of delays."""
    b = board.benchmark
    return tuple(
        _mixed(platoon.name, [b.entry(n) for n in platoon.order], case, b.speed)
        for platoon in b.platoons
        for case in b.cases
    )


def _mixed(name: str, entries: Sequence[Entry], case: Late, speed: float) -> Mixed:
    try:
        chain = Chain(tuple(linear(e, e.delay(case.onboard, case.radio), speed) for e in entries))
        peak = chain.peak
        if chain.hears_leader:
            alone = "no verdict on single vehicles, one hears the platoon leader"
            return Mixed(name, case.name, False, peak.gain, peak.frequency, alone)
        return Mixed(name, case.name, chain.strictly_string_stable, peak.gain, peak.frequency)
    except HeadwayError as error:
        return Mixed(name, case.name, False, math.nan, math.nan, str(error))
