"""Exact linear theory of every entry and platoon, beside what was simulated."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

from headway.benchmark.cells import PUBLISHED, Board
from headway.benchmark.spec import Benchmark, Course, Entry, Late
from headway.errors import HeadwayError, LeaderHeardError
from headway.metrics import throughput
from headway.theory.linear import Linear, linearize
from headway.theory.platoon import Chain

__all__ = ["Mixed", "Theory", "gain_at", "linear", "of_entries", "of_platoons", "steady_course"]


@dataclass(frozen=True)
class Theory:
    """Linear theory of an entry with late signals, and the growth measured behind the steady oscillation.

    Numbers that do not exist are NaN, verdicts that do not exist None: without an equilibrium all of them, and the
    string verdict of a law that hears the platoon leader, for which no growth per vehicle is defined.

    Attributes:
        who: name of the entry.
        delays: name of the case of delays.
        gap: equilibrium gap [m].
        flow: of a platoon of such vehicles [vehicles/h].
        locally_stable: whether a disturbance of one vehicle dies down.
        string_stable: whether no frequency grows from vehicle to vehicle.
        peak_gain: sup |G|.
        peak_frequency: [rad/s] where that is.
        gain: |G(iω)| at the frequency of `steady_course`.
        measured: the worst growth simulated there, NaN after a collision.
        critical_local: delay [s] of the late signals at which local stability is lost.
        critical_string: delay [s] of the late signals at which string stability is lost.
        reason: why there is no string verdict; else empty.
    """

    who: str
    delays: str
    gap: float
    flow: float
    locally_stable: bool | None
    string_stable: bool | None
    peak_gain: float
    peak_frequency: float
    gain: float
    measured: float
    critical_local: float
    critical_string: float
    reason: str = ""


@dataclass(frozen=True)
class Mixed:
    """Linear theory of a mixed platoon.

    Attributes:
        who: name of the platoon.
        delays: name of the case of delays.
        strict: whether every vehicle is string stable; None where that is not defined.
        head_to_tail_gain: largest gain from the leader to the last vehicle; NaN without an equilibrium.
        frequency: [rad/s] where that is.
        reason: why there is no verdict; else empty.
    """

    who: str
    delays: str
    strict: bool | None
    head_to_tail_gain: float
    frequency: float
    reason: str = ""


def steady_course(benchmark: Benchmark) -> Course | None:
    """Return the disturbance that one frequency of linear theory describes, the first endless sine; None without one.

    Args:
        benchmark: whose disturbances.
    """
    return next((c for c in benchmark.courses if c.leader.harmonic and c.leader.fundamental is not None), None)


def linear(entry: Entry, seconds: float, speed: float) -> Linear:
    """Return linear theory of an entry with its late signals late.

    Args:
        entry: the entry.
        seconds: delay of its late signals [s].
        speed: of everybody [m/s].

    Raises:
        HeadwayError: without an equilibrium.
    """
    return linearize(entry.with_delay(seconds), speed, entry.start_gap)


def gain_at(entry: Entry, seconds: float, speed: float, omega: float) -> float:
    """Return the gain per vehicle of an entry at one frequency.

    Args:
        entry: the entry.
        seconds: delay of its late signals [s].
        speed: of everybody [m/s].
        omega: frequency [rad/s].

    Returns:
        |G(iω)|; NaN without an equilibrium, if locally unstable, or where no growth per vehicle is defined.
    """
    try:
        vehicle = linear(entry, seconds, speed)
    except HeadwayError:
        return math.nan
    return float(vehicle.gain(omega)) if vehicle.locally_stable and not vehicle.hears_leader else math.nan


def of_entries(board: Board) -> tuple[Theory, ...]:
    """Return theory of every entry in every case of delays.

    Args:
        board: the cells of a benchmark.
    """
    b = board.benchmark
    return tuple(_one(board, entry, case) for entry in b.entries for case in b.cases)


def _one(board: Board, entry: Entry, case: Late) -> Theory:
    b, nothing = board.benchmark, math.nan
    course = steady_course(b)
    measured = nothing
    if course is not None:
        cells = [c for c in board.select(PUBLISHED, case.name, entry.name) if c.course == course.name]
        measured = cells[0].values["growth"] if not cells[0].reason and not cells[0].collided else nothing
    empty = Theory(
        entry.name, case.name, gap=nothing, flow=nothing, locally_stable=None, string_stable=None, peak_gain=nothing,
        peak_frequency=nothing, gain=nothing, measured=measured, critical_local=nothing, critical_string=nothing,
    )  # fmt: skip
    try:
        own = linear(entry, entry.delay(case.onboard, case.radio), b.speed)
        late = linear(entry, 1.0, b.speed)  # the pattern that a critical delay scales
    except HeadwayError as error:
        return dataclasses.replace(empty, reason=str(error))
    local = dataclasses.replace(
        empty, gap=own.gap, flow=throughput(own.vehicle, b.speed, gap=own.gap), locally_stable=own.locally_stable,
        critical_local=float(late.critical_delay("local")),
    )  # fmt: skip
    omega = course.leader.fundamental if course is not None else None
    try:
        return dataclasses.replace(
            local, string_stable=own.string_stable, peak_gain=own.peak_gain, peak_frequency=own.peak_frequency,
            gain=float(own.gain(omega)) if omega is not None and own.locally_stable else nothing,
            critical_string=float(late.critical_delay("string")),
        )  # fmt: skip
    except LeaderHeardError as error:
        return dataclasses.replace(local, reason=str(error))


def of_platoons(board: Board) -> tuple[Mixed, ...]:
    """Return theory of every mixed platoon in every case of delays.

    Args:
        board: the cells of a benchmark.
    """
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
            return Mixed(name, case.name, None, peak.gain, peak.frequency, alone)
        return Mixed(name, case.name, chain.strictly_string_stable, peak.gain, peak.frequency)
    except HeadwayError as error:
        return Mixed(name, case.name, None, math.nan, math.nan, str(error))
