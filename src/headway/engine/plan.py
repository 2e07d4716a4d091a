"""From scenarios to the arrays of the kernel. Scenarios of one `structure` run side by side as lanes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from headway.engine.breaking import Jumps, merge, own_order, propagate
from headway.engine.compile import address, structural
from headway.engine.layout import GROUP, SIGNAL_CODES, Platoon
from headway.engine.mesh import Mesh, build_mesh
from headway.models import Law
from headway.scenario.motion import Motion
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle

__all__ = ["DEFAULT_DT", "MOST_SAMPLES", "Plan", "output_times", "structure"]

Array = NDArray[np.float64]

#: longest step [s] where a scenario gives none
DEFAULT_DT = 0.01

#: a run without `output_step` keeps every step, thinned to at most this many steps
MOST_SAMPLES = 10_000

#: with fewer lanes than this a chain of received accelerations is one loop instead of one a vehicle
_FEW_LANES = 16


def output_times(scenario: Scenario) -> Array:
    """Times [s] at which results are kept: multiples of the output step, and the end."""
    step = scenario.output_step
    if step is None:
        dt = scenario.dt or DEFAULT_DT
        step = dt * max(1, math.ceil(scenario.end / dt / MOST_SAMPLES - 1e-9))
    count = math.floor(scenario.end / step * (1.0 + 1e-12) + 1e-9)
    times = np.asarray(np.arange(count + 1) * step, dtype=np.float64)
    return times if scenario.end - times[-1] < 2e-9 * max(1.0, step) else np.append(times, scenario.end)


def structure(scenario: Scenario) -> tuple[Any, ...]:
    """What scenarios must share to run as lanes of one batch: all but numbers that a lane may have for itself."""
    motion = scenario.motion
    time, order = motion.jumps(scenario.end)
    vehicles = tuple(_shape(v) for v in scenario.followers)
    starts = (scenario.gaps is None, tuple(n for n, _ in scenario.speed_offsets))
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
    return vehicle.model.law, structural(vehicle.model), vehicle.channel, vehicle.lag > 0, vehicle.limits is not None


@dataclass
class Plan:
    """Arrays for a batch of scenarios that share a structure."""

    scenarios: Sequence[Scenario]
    platoon: Platoon
    motions: list[Motion]
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
        followers, lanes = len(first.followers), len(scenarios)
        shared = len({(s.leader, s.cruise) for s in scenarios}) == 1 and first.leader.kind != "noise"
        motions = [scenarios[0].motion] if shared else [
            s.motion for s in scenarios
        ]  # fmt: skip
        gaps = np.array([s.initial_gaps() for s in scenarios]).T
        lengths = np.array([[s.leader_length, *(v.length for v in s.followers[:-1])] for s in scenarios]).T
        x = np.zeros((followers + 1, lanes))
        x[1:] = -np.cumsum(gaps + lengths, axis=0)
        v = np.empty((followers + 1, lanes))
        v[0] = [m.at(0.0)[1] for m in motions] if len(motions) > 1 else motions[0].at(0.0)[1]
        v[1:] = np.array([s.initial_speeds() for s in scenarios]).T
        slots = _Slots()
        runs = _runs(first.followers, lanes)
        groups = np.zeros((len(runs), len(GROUP)), dtype=np.int64)
        table = np.full((len(runs), 8, 2), -1, dtype=np.int64)
        for g, (row, rows) in enumerate(runs):
            _fill_group(groups[g], table[g], first.followers[row], row, rows, slots, lanes)
        parameters, varying = _parameters(scenarios, runs)
        addresses = np.array([_addresses(first.followers[row], v) for (row, _), v in zip(runs, varying, strict=True)])
        platoon = Platoon(
            groups=groups,
            slots=table,
            addresses=addresses,
            parameters=parameters,
            length=np.ascontiguousarray(lengths).ravel(),
            lag=_each(scenarios, lambda f: f.lag),
            limits=np.stack([_each(scenarios, lambda f, i=i: (f.limits or (-math.inf, math.inf))[i]) for i in (0, 1)]),
            needs=slots.needs_array(),
            span=slots.span_array(),
        )
        jumps = _jumps(first, motions[0]) if first.scheme == "rk4" else None
        mesh = build_mesh(first.end, first.dt or DEFAULT_DT, output_times(first), jumps)
        delays = np.array(slots.delays, dtype=float)
        return cls(
            scenarios, platoon, motions, delays, mesh, slots.late_accelerations_between(mesh),
            bool(slots.accelerations),
            x, v,
            np.array([s.cruise for s in scenarios]),
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


def _runs(followers: Sequence[Vehicle], lanes: int) -> list[tuple[int, int]]:
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
    """The different delays of a platoon and what is asked of each."""

    def __init__(self) -> None:
        self.delays: list[float] = []
        self.needs: list[set[int]] = []
        self.span: list[tuple[int, int]] = []

    def __call__(self, delay: float, quantity: int, row: int, rows: int) -> int:
        """Slot of `delay`, asked for `quantity` (0 x, 1 v, 2 a) by followers row … row+rows-1; -1 if current."""
        if delay == 0.0:
            return -1
        if delay not in self.delays:
            self.delays.append(delay)
            self.needs.append(set())
            self.span.append((row, row + rows + 1))
        slot = self.delays.index(delay)
        self.needs[slot].add(quantity)
        low, high = self.span[slot]
        self.span[slot] = min(low, row), max(high, row + rows + 1)
        return slot

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


#: the quantity (0 x, 1 v, 2 a) that a signal reads
_QUANTITY = {"s": 0, "v": 1, "dv": 1, "a": 2, "vl": 1, "al": 2, "v0l": 1, "a0l": 2}


def _fill_group(
    group: NDArray[np.int64], slots: NDArray[np.int64], vehicle: Vehicle, row: int, rows: int, slot: _Slots, lanes: int
) -> None:
    law, channel = vehicle.model.law, vehicle.channel
    for i, signal in enumerate(law.signals):
        group[GROUP[f"signal{i}"]] = SIGNAL_CODES[signal]
        halves = (
            (channel.leader_speed_in_dv, channel.own_speed_in_dv) if signal == "dv" else (getattr(channel, signal),) * 2
        )
        slots[i] = [slot(d, _QUANTITY[signal], row, rows) for d in halves]
    plain = vehicle.lag == 0 and vehicle.limits is None
    hears_now = "al" in law.signals and channel.al == 0.0
    group[GROUP["row"]], group[GROUP["rows"]], group[GROUP["count"]] = row, rows, len(law.signals)
    group[GROUP["lag"]] = vehicle.lag > 0
    group[GROUP["limits"]] = vehicle.limits is not None
    group[GROUP["serial"]] = hears_now and vehicle.lag == 0
    group[GROUP["chained"]] = hears_now and plain and lanes < _FEW_LANES
    group[GROUP["pure"]] = vehicle.lag == 0 and bool(np.all(slots[: len(law.signals)] >= 0))


def _implicit(vehicle: Vehicle) -> bool:
    return "a" in vehicle.model.law.signals and vehicle.lag == 0 and vehicle.channel.a == 0.0


def _addresses(vehicle: Vehicle, varying: tuple[str, ...]) -> tuple[int, int]:
    law, channel, fixed = vehicle.model.law, vehicle.channel, structural(vehicle.model)
    plain = address(law, fixed, varying, _implicit(vehicle), False)
    chained = "al" in law.signals and channel.al == 0.0 and vehicle.lag == 0 and vehicle.limits is None
    return plain, address(law, fixed, varying, _implicit(vehicle), True) if chained else 0


def _parameters(scenarios: Sequence[Scenario], runs: list[tuple[int, int]]) -> tuple[Array, list[tuple[str, ...]]]:
    """Parameters (most parameters of a law, M), and for each run those that differ within it (all or none)."""
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
    varying = []
    for row, rows in runs:
        law: Law = scenarios[0].followers[row].model.law
        part = table[: len(law.parameters), row : row + rows]
        differs = bool(np.any(part != part[:, :1, :1]))
        names = tuple(n for n, p in law.parameters.items() if not p.info.structural)
        varying.append(names if differs else ())
    return np.ascontiguousarray(table.reshape(table.shape[0], -1)), varying


def _each(scenarios: Sequence[Scenario], value: Any) -> Array:
    """`value(vehicle)` as (M,) in the order [vehicle][lane]."""
    return np.array([[value(v) for v in s.followers] for s in scenarios], dtype=float).T.ravel().copy()
