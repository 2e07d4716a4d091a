"""Events of a platoon alone: a stop, a start, a limit reached, a collision. Steps end exactly on them.

The mesh is known beforehand but for these. A step in which one happens is made again, shortened
until it ends on the event; the event is then one more breaking point, and where it will be felt
late the mesh gets more nodes. So the order of the method survives standstill, there is no
reversing, and no stage ever cuts a speed off.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from headway.engine import layout
from headway.engine.breaking import Jumps, own_order, propagate
from headway.engine.mesh import TWO_SIDED
from headway.engine.plan import Plan, all_jumps
from headway.engine.run import Result, Run

__all__ = ["RunAlone"]

Array = NDArray[np.float64]

_GAP, _STOP, _START, _LOW, _HIGH = range(5)

#: order (`headway.engine.breaking`) of the jump that an event of each kind is
_ORDER = {_START: 3, _LOW: 3, _HIGH: 3}

#: an event within this share of a step from its start is taken at the start
_AT_START = 1e-9

#: length [s] of the step after an event, in which the vehicle is not watched
_UNWATCHED = 1e-6


class RunAlone(Run):
    """Integration of a plan of one lane."""

    def __init__(self, plan: Plan) -> None:
        super().__init__(plan)
        self.nothing = Jumps.of([], 2)

    def go(self) -> Result:
        mesh = self.mesh
        while self.made < mesh.steps:
            resting = bool(np.any(self.state.watch == 0.0) and not self._all_dead())
            last = min(self.made + (1 if resting else self.chunk), mesh.steps)
            self._ensure_ring(self.made, last)
            self.made, self.out_row = self.advance(self.made, last, layout.STOP_AT_EVENT, mesh.time)
            if self.made < last and self.plan.hears_late_acceleration and not self.plan.extra:
                # an event will put nodes off the grid: begin again with what that takes
                return RunAlone(dataclasses.replace(self.plan, extra=True)).go()
            if self.made < last:
                self._ballistic_event() if self.ballistic else self._event()
            elif resting:
                self._watch_again()
        return self.result()

    def result(self) -> Result:
        """Beyond a collision nothing is known, although laws of late signals would go on answering for a while."""
        result = super().result()
        for vehicle in np.flatnonzero(np.isfinite(self.collision)):
            result.motion[:, result.time >= self.collision[vehicle], vehicle:] = np.nan
        return result

    # -- finding -------------------------------------------------------------------------------

    def _event(self) -> None:
        """Find the first event of the step from node `made`, step onto it and let it happen."""
        start = self._measures(self.made + 1, self.state.command[0])
        end = self._measures(self.made + 2, self.state.command[1])
        # a measure that changed sign; limits are crossed either way
        happening = (end < 0.0) & (self.state.watch != 0.0)
        share = 1.0
        while np.any(happening):
            kinds, vehicles = np.nonzero(happening)
            with np.errstate(all="ignore"):
                guess = start[kinds, vehicles] / (start[kinds, vehicles] - end[kinds, vehicles])
            first = int(np.argmin(np.where(np.isfinite(guess), guess, 0.0)))
            kind, vehicle = int(kinds[first]), int(vehicles[first])
            share = self._share(kind, vehicle, share, start[kind, vehicle])
            if share <= _AT_START:
                break
            end = self._try(share)
            earlier = (end < -1e-12) & (self.state.watch != 0.0)
            earlier[kind, vehicle] = False
            if not np.any(earlier):
                break
            happening = earlier
        if share > _AT_START:
            self._step_to(share)
        self._happen(kind, vehicle)

    def _share(self, kind: int, vehicle: int, most: float, start: float) -> float:
        """Share of the step after which the measure of an event is zero."""
        from scipy.optimize import brentq

        if not start > 0.0:
            return 0.0
        return float(
            brentq(lambda share: self._try(share)[kind, vehicle] if share > 0 else start, 0.0, most, xtol=1e-12)
        )

    def _try(self, share: float) -> Array:
        """Measures after only a share of the step; nothing is committed."""
        k, nodes = self.made, self.mesh.time
        trial = np.append(nodes[: k + 1], nodes[k] + share * (nodes[k + 1] - nodes[k]))
        self.advance(k, k + 1, layout.TRIAL, trial)
        return self._measures(k + 2, self.state.command[1])

    def _measures(self, row: int, command: Array) -> Array:
        """(5, N) numbers that turn negative when an event of each kind happens to each follower."""
        state, platoon = self.state, self.plan.platoon
        row %= state.ring.shape[1]
        x, v = state.ring[0, row], state.ring[1, row]
        moving = state.go != 0.0
        low, high = platoon.limits
        side_low = np.where(state.command[0] < low, -1.0, 1.0)
        side_high = np.where(state.command[0] > high, -1.0, 1.0)
        with np.errstate(all="ignore"):
            measures = np.stack(
                (
                    x[:-1] - x[1:] - platoon.length,
                    np.where(moving, v[1:], np.inf),
                    np.where(moving, np.inf, -command),
                    np.where(np.isfinite(low), side_low * (command - low), np.inf),
                    np.where(np.isfinite(high), side_high * (high - command), np.inf),
                )
            )
        return np.where(np.isnan(measures), np.inf, measures)

    # -- letting it happen -----------------------------------------------------------------------

    def _step_to(self, share: float) -> None:
        """Make the step again so that it ends on the event, which becomes a node."""
        k, nodes = self.made, self.mesh.time
        time = nodes[k] + share * (nodes[k + 1] - nodes[k])
        if nodes[k + 1] - time > 1e-9:
            self.mesh.insert(np.array([time]), np.array([False]))
        self._ensure_ring(k, k + 1)
        self.made, self.out_row = self.advance(k, k + 1, layout.IGNORE, self.mesh.time)

    def _happen(self, kind: int, vehicle: int) -> None:
        state, node = self.state, self.made
        row, element = (node + 1) % state.ring.shape[1], vehicle + 1
        time = float(self.mesh.time[node])
        if kind == _GAP:
            self._collide(vehicle, time)
            return
        if kind == _STOP:
            state.ring[1, row, element] = 0.0
            state.actual[element] = 0.0
            self.mesh.jump[node] = True
            # behind a lag it may stop while it is asked to go already, and then it goes at once
            # (without one, what it is asked is what it does, and commands are not kept)
            lagged = self.plan.scenario.followers[vehicle].lag > 0
            state.go[vehicle] = 1.0 if lagged and state.command[0, vehicle] > 0.0 else 0.0
        elif kind == _START:
            state.go[vehicle] = 1.0
            self.mesh.jump[node] = True
        if state.go[vehicle] != 0.0:
            # it may stay on the edge for the length of rounding: it is not watched during the next, short step
            state.watch[vehicle] = 0.0
            self.mesh.insert(np.array([time + _UNWATCHED]), np.array([False]))
        # a stop ends an acceleration, also one behind a lag
        order = own_order(self.plan.scenario.followers[vehicle], 2) if kind == _STOP else _ORDER[kind]
        self._break(vehicle, time, order)

    def _break(self, vehicle: int, time: float, order: int) -> None:
        """Put nodes where the event will be felt late."""
        scenario = self.plan.scenario
        found = propagate(scenario.followers, self.nothing, {vehicle + 1: Jumps.of(time, order)}, scenario.end)
        jumps = all_jumps(found)
        later = jumps.time > time + 1e-9
        if np.any(later):
            # propagated from the rounded time: shift back onto the exact one
            exact = jumps.time[later] + (time - Jumps.of(time, order).time[0])
            inside = exact < scenario.end
            self.mesh.insert(exact[inside], (jumps.order[later] <= TWO_SIDED)[inside])

    def _collide(self, vehicle: int, time: float) -> None:
        """A collision is data: this vehicle and all behind it are not simulated any further."""
        state = self.state
        self.collision[vehicle + 1] = time
        row = (self.made + 1) % state.ring.shape[1]
        for quantity in (0, 1, 3):
            state.ring[quantity, row, vehicle + 1 :] = np.nan
        state.actual[vehicle + 1 :] = np.nan
        state.go[vehicle:] = 1.0
        state.watch[vehicle:] = 0.0
        if self.made <= self.mesh.steps:
            self.mesh.jump[self.made] = True

    def _ballistic_event(self) -> None:
        """A gap closed within a ballistic step: the step stands, the time is interpolated."""
        k, state = self.made, self.state
        start, end = (self._measures(k + i, state.command[1])[_GAP] for i in (1, 2))
        share = np.where((end <= 0.0) & (state.watch != 0.0), np.maximum(start, 0.0) / (start - end), np.inf)
        vehicle = int(np.argmin(share))
        self.made, self.out_row = self.advance(k, k + 1, layout.IGNORE, self.mesh.time)
        nodes = self.mesh.time
        self._collide(vehicle, float(nodes[k] + share[vehicle] * (nodes[k + 1] - nodes[k])))

    # -- bookkeeping -----------------------------------------------------------------------------

    def _dead_from(self) -> int:
        """The first follower that is not simulated any further."""
        hit = np.flatnonzero(np.isfinite(self.collision[1:]))
        return int(hit.min()) if hit.size else self.rows - 1

    def _all_dead(self) -> bool:
        """Whether the vehicles that are not watched are all beyond a collision."""
        return not np.any(self.state.watch[: self._dead_from()] == 0.0)

    def _watch_again(self) -> None:
        self.state.watch[: self._dead_from()] = 1.0

    def _ensure_ring(self, first: int, last: int) -> None:
        """Grow the ring where events have put more nodes into the span of a delay."""
        need, have = self._ring_size(first, last), self.state.ring.shape[1]
        if need <= have:
            return
        ring, two = np.zeros((5, 2 * need, self.state.ring.shape[2])), np.zeros(2 * need, dtype=np.int64)
        top = self.made + 1
        for row in range(max(0, top - have + 1), top + 1):
            ring[:, row % two.size], two[row % two.size] = self.state.ring[:, row % have], self.state.two[row % have]
        self.state = self.state._replace(ring=ring, two=two)
