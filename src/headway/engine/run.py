"""A run: the kernel driven over the mesh in chunks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from headway.engine import kernel, layout
from headway.engine.leading import lead_ballistic, lead_exact
from headway.engine.mesh import Lookup, look_up
from headway.engine.plan import Plan

__all__ = ["Prepared", "Result", "Run"]

Array = NDArray[np.float64]

#: most steps made between two returns to Python, and most leader values prepared at once
_CHUNK, _PREPARED = 4096, 2_000_000


class Result(NamedTuple):
    """What a run leaves: `motion` (3, outputs, N+1, lanes) of x, v, a at `time` (outputs,), and what happened.

    `collision_time` (N+1,) is of a run alone; `disturbed` (lanes,) marks lanes of a batch in which
    something happened that has to be stepped on exactly.
    """

    time: Array
    motion: Array
    collision_time: Array
    disturbed: NDArray[np.bool_]


#: steps by their first and last: of one frame and one leader's motion, or of one frame where every lane has its own
Prepared = dict[tuple[int, int], layout.Steps]


class Run:
    """Integration of one plan. `go()` does it; `headway.engine.events` extends it for platoons alone.

    `prepared` is handed from batch to batch, so that they share what is prepared for the steps.
    """

    def __init__(self, plan: Plan, prepared: Prepared | None = None) -> None:
        self.plan, self.mesh = plan, plan.mesh
        self.prepared = prepared
        self.rows, self.lanes = plan.x.shape
        self.ballistic = plan.scenario.scheme == "ballistic"
        self.before = float(plan.delays.max(initial=0.0)) + 1.0
        self.outputs = np.empty((3, self._rows_kept(), self.rows * self.lanes))
        self.out_row = 0
        self.collision = np.full(self.rows, np.nan)
        self.made = 0  # steps made, which is also the node that has been reached
        self.chunk = int(np.clip(_PREPARED // (12 * len(plan.motions) * (1 + plan.delays.size)), 16, _CHUNK))
        self.state = self._initial_state(self._ring_size(0, self.mesh.steps))

    def _rows_kept(self) -> int:
        return int(self.mesh.record.sum())

    def go(self) -> Result:
        """Integrate to the end."""
        while self.made < self.mesh.steps:
            last = min(self.made + self.chunk, self.mesh.steps)
            self.made, self.out_row = self.advance(self.made, last, layout.NOTE, self.mesh.time)
        return self.result()

    def result(self) -> Result:
        """The kernel records starts of steps; the last node, which starts none, is added here."""
        ring, row = self.state.ring, (self.mesh.steps + 1) % self.state.ring.shape[1]
        self.outputs[0, -1], self.outputs[1, -1], self.outputs[2, -1] = ring[0, row], ring[1, row], ring[3, row]
        motion = self.outputs.reshape(3, -1, self.rows, self.lanes)
        disturbed = np.any(self.state.happened.reshape(-1, self.lanes) != 0.0, axis=0)
        return Result(self.mesh.time[self.mesh.record], motion, self.collision, disturbed)

    def advance(self, first: int, last: int, detect: int, nodes: Array) -> tuple[int, int]:
        """Make steps `first` … `last`-1 between `nodes`; (next step, next output row) as of the kernel."""
        steps = self._steps(first, last, nodes)
        state, platoon, count = self.state, self.plan.platoon, last - first
        if self.ballistic:
            done, out_row = kernel.advance_ballistic(
                0, count, first + 1, detect, platoon, steps, state, self.outputs, self.out_row, self.lanes
            )
        else:
            stops = bool(np.any(state.go == 0.0))
            done, out_row = kernel.advance(
                0, count, first + 1, detect, stops, self.plan.extra, platoon, steps, state,
                self.outputs, self.out_row, self.lanes,
            )  # fmt: skip
        return first + done, out_row

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
        return layout.Steps(
            np.diff(nodes[first : last + 1]), flags, none, none[None], look.row, look.motion, look.speed,
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

    def _initial_state(self, ring_size: int) -> layout.State:
        p, elements = self.plan, self.rows * self.lanes
        followers = elements - self.lanes
        state = layout.State(
            ring=np.empty((5, ring_size, elements)),
            two=np.empty(ring_size, dtype=np.int64),
            K=np.empty((6, elements)),
            J=np.empty((6, followers)),
            actual=np.empty(elements),
            stage=np.empty((2, elements)),
            leader=np.empty((8, followers)),
            looked=np.empty((p.delays.size, 2, 3, elements)),
            command=np.empty((3, followers)),
            sources=np.empty((8, 3), dtype=np.int64),
            go=np.empty(followers),
            watch=np.empty(followers),
            happened=np.empty(followers),
        )
        self._begin(state)
        return state

    def _begin(self, state: layout.State) -> None:
        """Set a state to the start of the plan."""
        p, ring = self.plan, state.ring
        for array in state:
            array.fill(0)
        # history row 0 stands `before` seconds back: positions moved at the common speed, speeds were as now
        ring[0, 0] = (p.x - self.before * p.cruise).ravel()
        ring[0, 1], ring[1, 0], ring[1, 1] = p.x.ravel(), p.v.ravel(), p.v.ravel()
        state.go.fill(1.0)
        state.watch.fill(1.0)

    def _ring_size(self, first: int, last: int) -> int:
        """Rows that steps `first` … `last`-1 need: their own and all that the longest delay looks back over."""
        if self.plan.delays.size == 0:
            return 4
        time, ends = self.mesh.time, np.arange(first, last)
        behind = np.searchsorted(time, time[ends] - self.plan.delays.max() - 1e-8)
        return int(np.max(ends - behind)) + 8
