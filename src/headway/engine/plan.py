"""From scenarios to the arrays of the kernel. Scenarios of one `structure` run side by side as lanes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from headway.engine.breaking import Jumps, hops, merge, own_order, propagate
from headway.engine.compile import address, structural
from headway.engine.layout import GROUP, HOPS, MOST_SIGNALS, SIGNAL_CODES, Platoon
from headway.engine.mesh import Mesh, build_mesh
from headway.models import Law
from headway.models.signal import AHEAD, OWN
from headway.scenario.motion import Motion
from headway.scenario.reception import Reception, Source
from headway.scenario.scenario import MOST_SAMPLES, Scenario
from headway.scenario.vehicle import Vehicle

__all__ = ["MOST_SAMPLES", "Frame", "Lanes", "Plan", "output_times", "structure"]

Array = NDArray[np.float64]

#: with fewer lanes than this a chain of received accelerations is one loop instead of one a vehicle
_FEW_LANES = 16


def output_times(scenario: Scenario) -> Array:
    """Times [s] at which results are kept: multiples of the output step, and the end."""
    step = scenario.output_step
    if step is None:
        step = scenario.step * max(1, math.ceil(scenario.end / scenario.step / MOST_SAMPLES - 1e-9))
    count = math.floor(scenario.end / step * (1.0 + 1e-12) + 1e-9)
    times = np.asarray(np.arange(count + 1) * step, dtype=np.float64)
    return times if scenario.end - times[-1] < 2e-9 * max(1.0, step) else np.append(times, scenario.end)


def structure(scenario: Scenario) -> tuple[Any, ...]:
    """What scenarios must share to run as lanes of one batch: all but numbers that a lane may have for itself."""
    motion = scenario.motion
    time, order = motion.jumps(scenario.end)
    vehicles = tuple(_shape(v) for v in scenario.followers)
    starts = (scenario.gaps is None, tuple(n for n, _ in scenario.speed_offsets), scenario.cruise != motion.before)
    return (
        vehicles,
        time.tobytes(),
        order.tobytes(),
        scenario.end,
        scenario.dt,
        scenario.output_step,
        scenario.scheme,
        starts,
    )


def _shape(vehicle: Vehicle) -> tuple[Any, ...]:
    return vehicle.model.law, structural(vehicle.model), vehicle.perception, vehicle.lag > 0, vehicle.limits is not None


@dataclass(frozen=True)
class Lanes:
    """The numbers that each lane has for itself. N followers, B lanes."""

    gaps: Array  # (N, B) [m] at t = 0
    lengths: Array  # (N, B) [m] of the vehicle ahead
    speeds: Array  # (N, B) [m/s] at t = 0
    cruise: Array  # (B,) [m/s] speed at which positions move before 0
    lead: Array  # (B,) [m/s] speed of the leader at t = 0
    parameters: Array  # (most parameters of a law, N, B)
    lag: Array  # (N, B) [s]
    limits: Array  # (2, N, B) [m/s²] least and largest command, infinite where there is none

    @classmethod
    def of(cls, scenarios: Sequence[Scenario], motions: Sequence[Motion]) -> Lanes:
        """Of scenarios that share a `structure`, behind one motion or one each."""
        infinite = (-math.inf, math.inf)
        return cls(
            gaps=np.array([s.initial_gaps() for s in scenarios]).T,
            lengths=np.array([[s.leader_length, *(v.length for v in s.followers[:-1])] for s in scenarios]).T,
            speeds=np.array([s.initial_speeds() for s in scenarios]).T,
            cruise=np.array([s.cruise for s in scenarios]),
            lead=np.array([float(m.at(0.0)[1]) for m in motions] * (len(scenarios) // len(motions))),
            parameters=_parameters(scenarios),
            lag=np.array([[v.lag for v in s.followers] for s in scenarios], dtype=float).T,
            limits=np.array([[v.limits or infinite for v in s.followers] for s in scenarios], dtype=float).T,
        )


@dataclass(frozen=True)
class Frame:
    """What lanes of one structure share, beside their leader's motion: made once for any number of batches."""

    scenario: Scenario
    runs: list[tuple[int, int]]
    groups: NDArray[np.int64]
    slots: NDArray[np.int64]
    needs: NDArray[np.bool_]
    span: NDArray[np.int64]
    delays: Array
    hops: Array  # (G, 2, HOPS, 2), see `layout.Platoon`
    mesh: Mesh
    extra: bool
    hears_late_acceleration: bool

    @classmethod
    def of(cls, scenario: Scenario) -> Frame:
        """The frame of a scenario and all that share its `structure`."""
        slots = _Slots()
        runs = _runs(scenario.followers)
        groups = np.zeros((len(runs), len(GROUP)), dtype=np.int64)
        table = np.full((len(runs), MOST_SIGNALS, 2), -1, dtype=np.int64)
        for g, (row, rows) in enumerate(runs):
            _fill_group(groups[g], table[g], scenario.followers[row], row, rows, slots)
        jumps = _jumps(scenario, scenario.motion) if scenario.scheme == "rk4" else None
        mesh = build_mesh(scenario.end, scenario.step, output_times(scenario), jumps)
        return cls(
            scenario, runs, groups, table, slots.needs_array(), slots.span_array(), np.array(slots.delays, dtype=float),
            np.stack([_hops(scenario.followers[row]) for row, _ in runs]), mesh,
            slots.late_accelerations_between(mesh), bool(slots.accelerations),
        )  # fmt: skip


@dataclass
class Plan:
    """Arrays for a batch of lanes that share a structure."""

    scenario: Scenario  # one of them, for what they share
    platoon: Platoon
    motions: list[Motion]  # one for all lanes, or one for each
    delays: Array
    mesh: Mesh
    extra: bool  # whether late accelerations are read where only the extra point makes them fourth order
    hears_late_acceleration: bool
    x: Array  # (N+1, B) initial positions, row 0 the leader
    v: Array
    cruise: Array  # (B,) speed at which positions move before 0

    @classmethod
    def of(cls, scenarios: Sequence[Scenario]) -> Plan:
        """The plan of scenarios that share a `structure`."""
        first = scenarios[0]
        shared = len({(s.leader, s.cruise) for s in scenarios}) == 1 and not first.leader.random
        motions = [first.motion] if shared else [s.motion for s in scenarios]
        return cls.of_lanes(Frame.of(first), motions, Lanes.of(scenarios, motions))

    @property
    def settled(self) -> bool:
        """Whether events can be stepped on: a late acceleration read off the nodes takes the extra point."""
        return self.extra or not self.hears_late_acceleration

    @classmethod
    def of_lanes(cls, frame: Frame, motions: list[Motion], lanes: Lanes) -> Plan:
        """The plan of lanes behind one leader's motion, or one for each."""
        followers, count = lanes.gaps.shape
        x = np.zeros((followers + 1, count))
        x[1:] = -np.cumsum(lanes.gaps + lanes.lengths, axis=0)
        v = np.empty((followers + 1, count))
        v[0], v[1:] = lanes.lead, lanes.speeds
        groups = frame.groups.copy()
        groups[:, GROUP["chained"]] &= count < _FEW_LANES
        platoon = Platoon(
            groups=groups,
            slots=frame.slots,
            addresses=np.array(
                [
                    _addresses(frame.scenario.followers[row], v)
                    for (row, _), v in zip(frame.runs, _varying(frame, lanes.parameters), strict=True)
                ]
            ),
            parameters=np.ascontiguousarray(lanes.parameters.reshape(lanes.parameters.shape[0], -1)),
            length=np.ascontiguousarray(lanes.lengths).ravel(),
            lag=np.ascontiguousarray(lanes.lag).ravel(),
            limits=np.ascontiguousarray(lanes.limits).reshape(2, -1),
            needs=frame.needs,
            span=frame.span,
            delays=frame.delays,
            hops=frame.hops,
            end=frame.scenario.end,
        )
        return cls(
            frame.scenario, platoon, motions, frame.delays, frame.mesh, frame.extra, frame.hears_late_acceleration,
            x, v, lanes.cruise,
        )  # fmt: skip


def _jumps(scenario: Scenario, motion: Motion) -> Jumps:
    """Breaking points of the whole platoon, those of the initial state included."""
    time, order = motion.jumps(scenario.end)
    moved = {n for n, _ in scenario.speed_offsets}
    own = {
        n: Jumps.of(0.0, own_order(vehicle, 1) if n in moved else 2)
        for n, vehicle in enumerate(scenario.followers, start=1)
    }
    leader = Jumps.of(time, order)
    if scenario.cruise != motion.before:
        leader = merge([leader, Jumps.of(0.0, 1)])  # before 0 positions moved at another speed than it drives
    return all_jumps(propagate(scenario.followers, leader, own, scenario.end))


def all_jumps(found: Sequence[Jumps]) -> Jumps:
    """The union over vehicles; a platoon of equal vehicles has few different sets."""
    unique = {(j.tick.tobytes(), j.order.tobytes()): j for j in found}
    return merge(list(unique.values()))


def _runs(followers: Sequence[Vehicle]) -> list[tuple[int, int]]:
    """Consecutive followers (first row, rows) that one compiled loop can serve."""
    runs: list[tuple[int, int]] = []
    last: tuple[Any, ...] | None = None
    for row, vehicle in enumerate(followers):
        shape = _shape(vehicle)
        if shape == last:
            runs[-1] = (runs[-1][0], runs[-1][1] + 1)
        else:
            runs.append((row, 1))
        last = shape
    return runs


class _Slots:
    """The different receptions of a platoon and what is asked of each: derivatives (0 x, 1 v, 2 a) and vehicles."""

    def __init__(self) -> None:
        self.receptions: list[Reception] = []
        self.needs: list[set[int]] = []
        self.span: list[tuple[int, int]] = []

    def __call__(self, source: Source, row: int, rows: int) -> int:
        """Slot of a source that followers row … row+rows-1 look at; -1 if it is received at once."""
        reception, order = source.reception, source.signal.order
        if reception.delay == 0.0:
            return -1
        first = row + 1 - max(source.whose, AHEAD)
        if reception not in self.receptions:
            self.receptions.append(reception)
            self.needs.append(set())
            self.span.append((first, row + rows + 1))
        slot = self.receptions.index(reception)
        self.needs[slot].add(order)
        low, high = self.span[slot]
        self.span[slot] = min(low, first), max(high, row + rows + 1)
        return slot

    @property
    def delays(self) -> list[float]:
        """Delays [s] by slot."""
        return [reception.delay for reception in self.receptions]

    @property
    def accelerations(self) -> list[float]:
        """Delays of late accelerations."""
        return [d for d, n in zip(self.delays, self.needs, strict=True) if 2 in n]

    def late_accelerations_between(self, mesh: Mesh) -> bool:
        """Whether late accelerations are read anywhere but at nodes and in the middle between them."""
        length = np.diff(mesh.time)
        if not self.accelerations or np.ptp(length) > 1e-9:
            return bool(self.accelerations)
        halves = 2.0 * np.array(self.accelerations) / length[0]
        return bool(np.any(np.abs(halves - np.rint(halves)) * length[0] > 1e-9))

    def needs_array(self) -> NDArray[np.bool_]:
        return np.array([[q in n for q in range(3)] for n in self.needs], dtype=bool).reshape(-1, 3)

    def span_array(self) -> NDArray[np.int64]:
        return np.array(self.span, dtype=np.int64).reshape(-1, 2)


def _fill_group(
    group: NDArray[np.int64], slots: NDArray[np.int64], vehicle: Vehicle, row: int, rows: int, slot: _Slots
) -> None:
    law, perception = vehicle.model.law, vehicle.perception
    for i, signal in enumerate(law.signals):
        group[GROUP[f"signal{i}"]] = SIGNAL_CODES[signal]
        slots[i] = [slot(source, row, rows) for source in perception.halves(signal)]
    plain = vehicle.lag == 0 and vehicle.limits is None
    hears_now = perception.at_once("al")
    ahead_now = any(s.signal.order == 2 and s.whose >= AHEAD and s.delay == 0.0 for s in perception.sources)
    group[GROUP["row"]], group[GROUP["rows"]], group[GROUP["count"]] = row, rows, len(law.signals)
    group[GROUP["lag"]] = vehicle.lag > 0
    group[GROUP["limits"]] = vehicle.limits is not None
    group[GROUP["serial"]] = ahead_now and vehicle.lag == 0
    group[GROUP["chained"]] = hears_now and plain
    group[GROUP["pure"]] = vehicle.lag == 0 and bool(np.all(slots[: len(law.signals)] >= 0))


def _hops(vehicle: Vehicle) -> Array:
    """What a vehicle perceives of the one ahead and of itself: rows (delay, orders gained), -1 behind the last."""
    table = np.full((2, HOPS, 2), -1.0)
    for side, rows in enumerate((hops(vehicle, AHEAD), hops(vehicle, OWN))):
        table[side, : len(rows)] = np.array(rows, dtype=float).reshape(-1, 2)
    return table


def _implicit(vehicle: Vehicle) -> bool:
    return vehicle.lag == 0 and vehicle.perception.at_once("a")


def _addresses(vehicle: Vehicle, varying: tuple[str, ...]) -> tuple[int, int]:
    law, fixed = vehicle.model.law, structural(vehicle.model)
    plain = address(law, fixed, varying, _implicit(vehicle), False)
    chained = vehicle.perception.at_once("al") and vehicle.lag == 0 and vehicle.limits is None
    return plain, address(law, fixed, varying, _implicit(vehicle), True) if chained else 0


def _parameters(scenarios: Sequence[Scenario]) -> Array:
    """Parameters (most parameters of a law, N, B)."""
    followers, lanes = len(scenarios[0].followers), len(scenarios)
    most = max(len(v.model.items) for v in scenarios[0].followers)
    table = np.zeros((max(most, 1), followers, lanes))
    for b, scenario in enumerate(scenarios):
        last: Vehicle | None = None
        for n, vehicle in enumerate(scenario.followers):
            if vehicle is last:
                table[:, n, b] = table[:, n - 1, b]
                continue
            for i, (_, x) in enumerate(vehicle.model.items):
                table[i, n, b] = x
            last = vehicle
    return table


def _varying(frame: Frame, table: Array) -> list[tuple[str, ...]]:
    """For each run of vehicles the parameters that differ within it (all or none)."""
    varying = []
    for row, rows in frame.runs:
        law: Law = frame.scenario.followers[row].model.law
        part = table[: len(law.parameters), row : row + rows]
        differs = bool(np.any(part != part[:, :1, :1]))
        names = tuple(n for n, p in law.parameters.items() if not p.info.structural)
        varying.append(names if differs else ())
    return varying
