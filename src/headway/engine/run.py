"""A run: the kernel driven over the mesh in chunks."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import CancelledError
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from headway.engine import kernel, layout
from headway.engine.lane import lanes_address, piece_address
from headway.engine.leading import lead_ballistic, lead_exact
from headway.engine.mesh import AT, Lookup, look_up
from headway.engine.plan import Plan

__all__ = ["Prepared", "Result", "Run"]

Array = NDArray[np.float64]

#: most steps made between two returns to Python, and most leader values prepared at once
_CHUNK, _PREPARED = 4096, 2_000_000

#: vehicle-steps of a batch, and of a platoon alone, that take about a twentieth of a second
_MOMENT_BATCH, _MOMENT_ALONE = 2_500_000, 500_000

#: nodes inside steps that there must be room for before a step: of each lane, and besides
_RESERVE_LANE, _RESERVE = 32, 1000

#: breaking points to come that a lane has room for, and times at which one event is felt by one vehicle
_PENDING, _FRONT = 256, 256


class Result(NamedTuple):
    """What a run leaves: `motion` (3, outputs, N+1, lanes) of x, v, a at `time` (outputs,), and what happened.

    `collision` (N+1, lanes) [s], NaN if none; a vehicle that collides and all behind it are NaN in `motion` from then
    on. `unsettled` (lanes,) marks lanes that have to be run again by a plan that reads late accelerations anywhere,
    `fault` (lanes,) is not 0 where a lane was given up (`layout.REPETITION`, …).
    """

    time: Array
    motion: Array
    collision: Array
    unsettled: NDArray[np.bool_]
    fault: NDArray[np.int64]

    @property
    def unsound(self) -> NDArray[np.bool_]:
        """(lanes,) whether a law answered something that is no number, or the lane was given up."""
        simulated = ~np.logical_or.accumulate(np.isfinite(self.collision), axis=0)
        return np.asarray((~np.isfinite(self.motion).all(axis=(0, 1)) & simulated).any(axis=0))

    @property
    def collision_time(self) -> Array:
        """(N+1,) [s] of the first lane, NaN if none."""
        return self.collision[:, 0]

    def lane(self, number: int) -> Result:
        """The result of one lane as of a run alone."""
        one = slice(number, number + 1)
        return Result(
            self.time,
            np.ascontiguousarray(self.motion[..., one]),
            np.ascontiguousarray(self.collision[:, one]),
            self.unsettled[one],
            self.fault[one],
        )


#: steps by their first and last: of one frame and one leader's motion, or of one frame where every lane has its own
Prepared = dict[tuple[int, int], layout.Steps]


class Run:
    """Integration of one plan by `go()`.

    `prepared` is handed from batch to batch, so that they share what is prepared for the steps. `cancelled` is asked
    several times a second whether the run is to end; then it raises `CancelledError`.
    """

    def __init__(
        self, plan: Plan, prepared: Prepared | None = None, cancelled: Callable[[], bool] | None = None
    ) -> None:
        self.plan, self.mesh = plan, plan.mesh
        self.prepared, self.cancelled = prepared, cancelled
        self.rows, self.lanes = plan.x.shape
        self.ballistic = plan.scenario.scheme == "ballistic"
        self.before = float(plan.delays.max(initial=0.0)) + 1.0
        self.outputs = np.empty((3, self._rows_kept(), self.rows * self.lanes))
        self.out_row = 0
        self.made = 0  # steps made, which is also the node that has been reached
        moment = _MOMENT_ALONE if self.lanes == 1 else _MOMENT_BATCH
        most = min(_PREPARED // (12 * len(plan.motions) * (1 + plan.delays.size)), moment // plan.x.size)
        self.chunk = int(np.clip(most, 16, _CHUNK))
        self.detect = layout.EXACT if plan.settled else layout.NOTE
        self.state = _state(plan, self.lanes, self._ring_size(0, self.mesh.steps))
        self.alone = _alone(plan) if not self.ballistic else None
        self.stepper = 0
        self._begin(self.state)

    def _rows_kept(self) -> int:
        return int(self.mesh.record.sum())

    def go(self) -> Result:
        """Integrate to the end."""
        self._integrate()
        return self.result()

    def _integrate(self) -> None:
        while self.made < self.mesh.steps:
            first, last = self.made, min(self.made + self.chunk, self.mesh.steps)
            steps = self._steps(first, last, self.mesh.time)
            done = 0
            while done < last - first:
                if self.cancelled is not None and self.cancelled():
                    raise CancelledError
                self._make_room()
                self.state.tally[layout.WORK] = 0
                before = done
                done = self.advance(done, last - first, first + 1, steps)
                if done == before:
                    # something happened for the first time: only now is needed what steps single lanes
                    self.stepper = lanes_address()
                    if self.alone is not None:
                        self.alone = self.alone._replace(piece=piece_address())
            self.made = last

    def result(self) -> Result:
        """The kernel records starts of steps; the last node, which starts none, is added here."""
        ring, row = self.state.ring, (self.mesh.steps + 1) % self.state.ring.shape[1]
        self.outputs[0, -1], self.outputs[1, -1], self.outputs[2, -1] = ring[0, row], ring[1, row], ring[3, row]
        motion = self.outputs.reshape(3, -1, self.rows, self.lanes)
        time, collision = self.mesh.time[self.mesh.record], self.state.collision.copy()
        # laws of late signals would go on answering for a while
        for vehicle, lane in np.argwhere(np.isfinite(collision)):
            motion[:, time >= collision[vehicle, lane], vehicle:, lane] = np.nan
        return Result(time, motion, collision, self.unsettled, self.state.fault.copy())

    @property
    def unsettled(self) -> NDArray[np.bool_]:
        """Lanes (lanes,) in which something happened that could only be noted."""
        return np.any(self.state.happened.reshape(-1, self.lanes) != 0.0, axis=0)

    def advance(self, first: int, last: int, row0: int, steps: layout.Steps) -> int:
        """Make steps `first` … `last`-1 of a chunk that begins at history row `row0`; the step that was reached."""
        platoon, state = self.plan.platoon, self.state
        if self.ballistic:
            done, self.out_row = kernel.advance_ballistic(
                first, last, row0, platoon, steps, state, self.outputs, self.out_row, self.lanes
            )
        else:
            done, self.out_row = kernel.advance(
                first, last, row0, self.detect, self.plan.extra, self.stepper, platoon, steps,
                state, self.alone, self.outputs, self.out_row, self.lanes,
            )  # fmt: skip
        return int(done)

    def _steps(self, first: int, last: int, nodes: Array) -> layout.Steps:
        """What the kernel needs to know of steps `first` … `last`-1; what batches share is prepared once."""
        steps = None if self.prepared is None else self.prepared.get((first, last))
        if steps is None:
            steps = self._past(first, last, nodes)
            if len(self.plan.motions) == 1:
                steps = self._led(steps, first, last, nodes)
            if self.prepared is not None:
                self.prepared[first, last] = steps
        return steps if steps.lead.size else self._led(steps, first, last, nodes)

    def _led(self, steps: layout.Steps, first: int, last: int, nodes: Array) -> layout.Steps:
        """Steps with the motion of their leaders."""
        lead, late = (lead_ballistic if self.ballistic else lead_exact)(self.plan, nodes, first, last)
        return steps._replace(lead=lead, delayed_lead=late)

    def _past(self, first: int, last: int, nodes: Array) -> layout.Steps:
        """Steps without their leaders."""
        mesh, plan = self.mesh, self.plan
        look = look_up(nodes, first, last, plan.delays, self.before, plan.extra, self.ballistic)
        flags = np.zeros(last - first, dtype=np.int64)
        flags[mesh.jump[first:last]] |= layout.FLAG_JUMP
        flags[mesh.record[first:last]] |= layout.FLAG_RECORD
        flags[look.inside] |= layout.FLAG_INSIDE
        if first == 0:
            flags[0] |= layout.FLAG_JUMP
        none = np.empty((0, 0, 0, 0))
        time = np.ascontiguousarray(nodes[first : last + 1])
        return layout.Steps(
            time, np.diff(time), flags, none, none[None], look.row, look.motion, look.speed,
            look.acceleration, self._nodes(look, first),
        )  # fmt: skip

    def _nodes(self, look: Lookup, first: int) -> NDArray[np.int64]:
        """1 or 2 where a look-up is the first or second node of its step and nothing is two-sided there."""
        node = np.where(look.share == 0.0, 1, np.where(look.share == 1.0, 2, 0))
        if node.size:
            # history row r stands for node r - 1; the time before 0 and its end are read, not pointed at
            number = look.row + first + node - 1
            inside = (number > 0) & (number < self.mesh.steps)
            node[~inside | self.mesh.jump[np.clip(number, 0, self.mesh.steps)]] = 0
            # the step that is being made has no end yet
            node[look.row + node - 1 > np.arange(look.row.shape[1])[None, :, None]] = 0
        return node

    def _begin(self, state: layout.State) -> None:
        """Set a state to the start of the plan."""
        p, ring = self.plan, state.ring
        for array in state:
            if array is not state.node:
                array.fill(0)
        # history row 0 stands `before` seconds back: positions moved at the common speed, speeds were as now
        ring[0, 0] = (p.x - self.before * p.cruise).ravel()
        ring[0, 1], ring[1, 0], ring[1, 1] = p.x.ravel(), p.v.ravel(), p.v.ravel()
        state.time[0] = -self.before
        state.go.fill(1.0)
        state.watch.fill(1.0)
        state.first.fill(-1)
        state.collision.fill(np.nan)
        state.earliest[0] = np.inf
        _free_all(state, 0)

    def _make_room(self) -> None:
        """Room for more nodes inside steps, where a step might need more than there is."""
        if self.alone is None or self.state.free[0] >= self.alone.reserve:
            return
        size = self.state.node_time.size
        self.state = _with_room(self.state, 2 * size)

    def _ring_size(self, first: int, last: int) -> int:
        """Rows that steps `first` … `last`-1 need: their own and all that the longest delay looks back over."""
        if self.plan.delays.size == 0:
            return 4
        time, ends = self.mesh.time, np.arange(first, last)
        behind = np.searchsorted(time, time[ends] - self.plan.delays.max() - 1e-8)
        return int(np.max(ends - behind)) + 8


def _free_all(state: layout.State, first: int) -> None:
    """Put the nodes from number `first` on among those that are free, the lowest on top."""
    more = np.arange(state.node_time.size - 1, first - 1, -1)
    count = state.free[0]
    state.free[1 + count : 1 + count + more.size] = more
    state.free[0] = count + more.size


def _with_room(state: layout.State, size: int) -> layout.State:
    """The state with room for `size` nodes inside steps."""
    had = state.node_time.size
    rows = {
        "node": np.empty((5, size, state.node.shape[2])),
        "node_time": np.empty(size),
        "node_next": np.empty(size, dtype=np.int64),
        "free": np.empty(size + 1, dtype=np.int64),
    }
    rows["node"][:, :had] = state.node
    for name in ("node_time", "node_next"):
        rows[name][:had] = getattr(state, name)
    rows["free"][: had + 1] = state.free
    state = state._replace(**rows)
    _free_all(state, had)
    return state


def _reserve(plan: Plan) -> int:
    """Nodes inside steps that must be free before a step; without delays nobody looks back on them."""
    return _RESERVE_LANE * plan.x.shape[1] + _RESERVE if plan.delays.size and plan.settled else 0


def _state(plan: Plan, lanes: int, ring_rows: int) -> layout.State:
    """Room for the state of so many lanes of a plan."""
    rows = plan.x.shape[0]
    elements, followers = rows * lanes, (rows - 1) * lanes
    whole = np.int64
    nodes = 2 * _reserve(plan) if ring_rows > 2 else 0
    return layout.State(
        ring=np.empty((5, ring_rows, elements)),
        two=np.empty(ring_rows, dtype=whole),
        K=np.empty((6, elements)),
        J=np.empty((6, followers)),
        actual=np.empty(elements),
        stage=np.empty((2, elements)),
        leader=np.empty((layout.MOST_SIGNALS, followers)),
        looked=np.empty((plan.delays.size, 2, 3, elements)),
        command=np.empty((3, followers)),
        sources=np.empty((layout.MOST_SIGNALS, 3), dtype=whole),
        go=np.empty(followers),
        watch=np.empty(followers),
        happened=np.empty(followers),
        todo=np.empty(lanes, dtype=whole),
        time=np.empty(ring_rows),
        first=np.empty((ring_rows, lanes), dtype=whole),
        lanes=np.empty(ring_rows, dtype=whole),
        node=np.empty((5, nodes, rows)),
        node_time=np.empty(nodes),
        node_next=np.empty(nodes, dtype=whole),
        free=np.empty(nodes + 1, dtype=whole),
        pending=np.empty((lanes, _PENDING, 2)),
        pendings=np.empty(lanes, dtype=whole),
        earliest=np.empty(1),
        front=np.empty((2, _FRONT, 2)),
        ends=np.empty((2, 5, rows)),
        collision=np.empty((rows, lanes)),
        fault=np.empty(lanes, dtype=whole),
        tally=np.empty(3, dtype=whole),
    )


def _alone(plan: Plan) -> layout.Alone:
    """Room for one lane of a plan to make a step by itself."""
    p, followers, slots = plan.platoon, plan.x.shape[0] - 1, plan.delays.size
    platoon = p._replace(
        parameters=np.zeros((p.parameters.shape[0], followers)),
        length=np.zeros(followers),
        lag=np.zeros(followers),
        limits=np.zeros((2, followers)),
    )
    whole = np.zeros((slots, 1, len(AT)), dtype=np.int64)
    steps = layout.Steps(
        time=np.zeros(2), step=np.zeros(1), flags=np.zeros(1, dtype=np.int64), lead=np.zeros((1, len(AT), 3, 1)),
        delayed_lead=np.zeros((slots, 1, len(AT), 3, 1)), row=whole, motion=np.zeros((slots, 1, len(AT), 4)),
        speed=np.zeros((slots, 1, len(AT), 4)), acceleration=np.zeros((slots, 1, len(AT), 5)), node=whole.copy(),
    )  # fmt: skip
    state = _state(plan, 1, 2)
    for array in state:
        array.fill(0)
    return layout.Alone(platoon, steps, state, _reserve(plan), 0)
