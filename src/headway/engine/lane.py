"""One lane of a batch through one step by itself: exactly onto what happens in it, and past it.

A batch makes its steps together, and in most lanes nothing happens in them. Where a vehicle of a
lane stops, starts, reaches a limit or hits the one ahead, or where that will be felt late, the lane
makes this one step again by itself in pieces that end there (`headway.engine.events` says what
happens). The states between the pieces are noted, so that whoever sees the lane's past sees its
kinks where they are; after the step the lane goes on with the others. So the order of the method
survives standstill and limits, and no stage ever cuts a speed off.
"""

from __future__ import annotations

import functools

import numpy as np
from numba import cfunc

from headway.engine.calls import LANES, PIECE, call_piece
from headway.engine.events import (
    AT_START,
    NOTHING,
    START,
    STOP,
    due,
    first_incident,
    let_happen,
    measure,
    next_due,
    remember,
)
from headway.engine.history import CLOSE, leader_at, see
from headway.engine.layout import NO_ROOM, REFINED, REPETITION, STANDING, WORK
from headway.engine.loops import copy, finish, scale_add, scale_add2, seldom, stage, third
from headway.engine.mesh import AT
from headway.engine.rates import PASSES, accelerate, end_lagged, lagged_or_pure, place_leader

__all__ = ["lanes_address", "piece_address"]

#: length [s] of the piece after an event, in which the vehicle is not watched
_UNWATCHED = 1e-6

#: events of a lane in one step beyond which it is given up: they repeat without end
_MOST_EVENTS = 400

#: pieces of a step beyond which smooth breaking points (of order 3 and 4) no longer end one
_MOST_PIECES = 8

#: trials in the search for the time of an event
_TRIALS = 60

_MIDDLE, _THIRD = AT[1], AT[3]

_compiled = functools.partial(cfunc, cache=True, error_model="numpy", _nrt=False)


@seldom
def _gather(lane, here, platoon, state, alone, B):
    """Copy a lane's numbers and its state at the start of the step."""
    own, few = alone.state, alone.platoon
    ring, one = state.ring, own.ring
    for n in range(one.shape[2]):
        e = n * B + lane
        one[0, 0, n], one[1, 0, n] = ring[0, here, e], ring[1, here, e]
        one[2, 0, n] = ring[2 if state.two[here] else 3, here, e]
        one[3, 0, n] = ring[3, here, e]
    for m in range(own.go.size):
        e = m * B + lane
        few.length[m], few.lag[m] = platoon.length[e], platoon.lag[e]
        few.limits[0, m], few.limits[1, m] = platoon.limits[0, e], platoon.limits[1, e]
        own.go[m], own.watch[m] = state.go[e], state.watch[e]
        own.J[0, m], own.command[0, m] = state.J[0, e], state.command[0, e]
        for i in range(few.parameters.shape[0]):
            few.parameters[i, m] = platoon.parameters[i, e]


@seldom
def _scatter(lane, there, state, alone, B):
    """Put the state at the end of the step back into the batch."""
    own, ring = alone.state, state.ring
    one = own.ring
    for n in range(1, one.shape[2]):
        e = n * B + lane
        ring[0, there, e], ring[1, there, e], ring[3, there, e] = one[0, 0, n], one[1, 0, n], one[3, 0, n]
        state.actual[e] = one[2, 0, n]
    for m in range(own.go.size):
        e = m * B + lane
        state.go[e] = own.go[m]
        state.J[4, e], state.command[1, e] = own.J[0, m], own.command[0, m]


@seldom
def _note(lane, here, last, time, state, alone):
    """Note the start of a piece as a node of the lane, behind node `last` of the same step; its number."""
    own = alone.state
    if state.free[0] == 0:
        state.fault[lane] = NO_ROOM
        return last
    node = state.free[state.free[0]]
    state.free[0] -= 1
    state.node_time[node], state.node_next[node] = time, -1
    for q in range(5):
        copy(state.node[q, node], own.ring[q, 0])
    if last < 0:
        state.first[here, lane] = node
        state.lanes[here] += 1
        state.tally[REFINED] += 1
    else:
        state.node_next[last] = node
    return node


def _piece(fresh, lane, k, row0, start, length, platoon, steps, state, alone, B):
    """Make a piece of a step, from row 0 of the lane's ring to row 1, by the method that makes whole steps.

    `fresh`: evaluate the accelerations at its start anew, for their limits from the right. As in the kernel there is
    one place that looks back and one that evaluates, so that there is little to compile.
    """
    few, own = alone.platoon, alone.state
    ring, K, J, h = own.ring, own.K, own.J, length
    x, v, a = ring[0, 0], ring[1, 0], ring[2, 0]
    xn, vn, an = ring[0, 1], ring[1, 1], ring[3, 1]
    groups, whole = few.groups, steps.step[k]
    table = steps.lead[k]
    which = lane if table.shape[2] > 1 else 0
    inside, last = False, 4
    for slot in range(platoon.delays.size):
        inside = inside or platoon.delays[slot] < h - CLOSE
        last = 5 if platoon.needs[slot, 2] else last
    for made in range(PASSES if inside else 1):
        for at in range(0 if fresh and made == 0 else 1, last + 1):
            c = 0 if at == 0 else (1 if at < 3 else (2 if at < 5 else 3))
            share = 0.0 if c == 0 else (_MIDDLE if c == 1 else (1.0 if c == 2 else _THIRD))
            time = start + share * h
            X, V, A = own.stage[0], own.stage[1], K[at]
            if at == 1 and made == 0 and inside:
                scale_add2(xn, x, v, h, a, 0.5 * h * h)
                scale_add(vn, v, a, h)
                copy(an, a)
                copy(ring[4, 0], a)
            if at == 0:
                X, V, A = x, v, a
            elif at == 1:
                stage(X[1:], V[1:], x[1:], v[1:], a[1:], a[1:], 0.5 * h, 0.0, 0.5 * h)
                lagged_or_pure(A[1:], a[1:], J[0], 0.5 * h, a[1:], groups, 1)
            elif at == 2:
                stage(X[1:], V[1:], x[1:], v[1:], a[1:], K[1, 1:], 0.5 * h, 0.25 * h * h, 0.5 * h)
                lagged_or_pure(A[1:], a[1:], J[1], 0.5 * h, K[1, 1:], groups, 1)
            elif at == 3:
                stage(X[1:], V[1:], x[1:], v[1:], K[1, 1:], K[2, 1:], h, 0.5 * h * h, h)
                lagged_or_pure(A[1:], a[1:], J[2], h, a[1:], groups, 1)
            elif at == 4:
                X, V, A = xn, vn, an
                lagged_or_pure(A[1:], a[1:], J[0], 0.0, K[3, 1:], groups, 1)
                end_lagged(A[1:], a[1:], J, h, groups, 1)
            else:
                third(X, x, xn, v, vn, h)
                third(V, v, vn, a, an, h)
                third(A[1:], a[1:], an[1:], J[0], J[4], h)
            if at != 0:
                leader_at(alone.steps.lead[0, c], table, which, (time - steps.time[k]) / whole, whole, False)
                place_leader(X, V, A, alone.steps, 0, c, 1)
            if at != 2 and at != 4:
                see(lane, k, row0, time, c, at == 0, start, h, platoon, steps, state, alone, B)
            command = own.command[0 if at == 0 else (2 if at == 5 else 1)]
            accelerate(0, c, 0, few, alone.steps, own, c & 1, False, X, V, A, J[at], command, True, 1)
            if at == 3:
                finish(xn[1:], vn[1:], x[1:], v[1:], a[1:], K[1, 1:], K[2, 1:], A[1:], h)
                place_leader(xn, vn, an, alone.steps, 0, c, 1)
            elif at == 5:
                copy(ring[4, 0], A)
    state.tally[WORK] += ring.shape[2]


@seldom
def _step_lane(lane, k, row0, platoon, steps, state, alone, B):
    """Make step `k` of a chunk again for one lane, whose start is in the ring; its end replaces that of the batch.

    A piece ends on the next breaking point. Where something happens in it, it is made again and again, shorter, until
    it ends there (by false position); then it is looked whether something else has happened earlier.
    """
    R = state.ring.shape[1]
    here, there = (row0 + k) % R, (row0 + k + 1) % R
    own, late = alone.state, platoon.delays.size > 0
    time, end = steps.time[k], steps.time[k + 1]
    _gather(lane, here, platoon, state, alone, B)
    # a helper is compiled once for each type: a constant has one of its own, a number of 64 bits has not
    rows, node = (np.int64(0), np.int64(1)), np.int64(-1)
    if late:
        node = _note(lane, here, node, time, state, alone)
    fresh = due(lane, time, state)
    moment = False  # whether the piece is the one after an event
    events, pieces = 0, 0
    while time < end and state.fault[lane] == 0:
        stop = next_due(lane, time, end, pieces >= _MOST_PIECES, state)
        if moment and time + _UNWATCHED < stop:
            stop = time + _UNWATCHED
        length = stop - time
        kind, who, share = np.int64(NOTHING), np.int64(0), 1.0
        low, at_low, high, at_high, side, trials = 0.0, 0.0, 0.0, 0.0, 0, 0
        whole = False
        while True:
            call_piece(alone.piece, fresh, lane, k, row0, time, share * length, platoon, steps, state, alone, B)
            if fresh:
                if pieces == 0:
                    _keep_both_limits(lane, here, state, alone, B)
                fresh = False
            if whole:
                break
            if kind != NOTHING:
                value = measure(kind, who, rows[1], alone)
                trials += 1
                near = high - low
                if value < 0.0:
                    near, high, at_high = high - share, share, value
                    at_low = 0.5 * at_low if side < 0 else at_low
                    side = -1
                else:
                    near, low, at_low = share - low, share, value
                    at_high = 0.5 * at_high if side > 0 else at_high
                    side = 1
                if not (value == 0.0 or near < 1e-13 or high - low < 1e-12 or trials == _TRIALS):
                    share = _between(low, at_low, high, at_high)
                    continue
            other, another = first_incident(alone, 0.0 if kind == NOTHING else -1e-12, kind, who)
            if other == NOTHING:
                if kind == NOTHING or share == 1.0 or (1.0 - share) * length > AT_START:
                    break
                # what is left of the piece is no longer than rounding
                share, whole = 1.0, True
                continue
            kind, who = other, another
            low, at_low, side, trials = 0.0, measure(kind, who, rows[0], alone), 0, 0
            high, at_high = share, measure(kind, who, rows[1], alone)
            if not at_low > 0.0:
                share = 0.0
                break
            share = _between(low, at_low, high, at_high)
            if share <= AT_START:
                break
        if late:
            # the limits from the right at the start, and how it goes on
            copy(state.node[1, node], own.ring[1, 0])
            copy(state.node[2, node], own.ring[2, 0])
        if share > AT_START:
            # the end becomes the start
            if late:
                copy(state.node[4, node], own.ring[4, 0])
            for q in range(2):
                copy(own.ring[q, 0], own.ring[q, 1])
            copy(own.ring[2, 0], own.ring[3, 1])
            copy(own.ring[3, 0], own.ring[3, 1])
            copy(own.J[0], own.J[4])
            copy(own.command[0], own.command[1])
            if moment:
                for m in range(own.watch.size):
                    own.watch[m] = state.watch[m * B + lane]
                moment = False
            time, pieces = stop if share == 1.0 else time + share * length, pieces + 1
            if late and time < end:
                node = _note(lane, here, node, time, state, alone)
            fresh = time < end and due(lane, time, state)
        if kind == NOTHING:
            continue
        events += 1
        if events > _MOST_EVENTS:
            state.fault[lane] = REPETITION
            break
        moment = let_happen(kind, who, lane, time, platoon, state, alone, B)
        jumps = share <= AT_START or kind in (STOP, START)
        if jumps and time >= end:
            remember(lane, time, 2.0, state)
        fresh = fresh or (jumps and time < end)
    if state.fault[lane] != 0:
        _give_up(lane, state, alone, B)
    _scatter(lane, there, state, alone, B)


@seldom
def _between(low, at_low, high, at_high):
    """Where the straight line through the measures at two shares is zero, strictly between them."""
    share = (low * at_high - high * at_low) / (at_high - at_low)
    return share if low < share < high else 0.5 * (low + high)


@seldom
def _keep_both_limits(lane, here, state, alone, B):
    """The acceleration of a lane jumps at the start of the step: from here on the row has two limits, in all lanes."""
    own = alone.state
    if state.two[here] == 0:
        copy(state.ring[2, here], state.ring[3, here])
        state.two[here] = 1
    for n in range(own.actual.size):
        state.ring[2, here, n * B + lane] = own.ring[2, 0, n]


@seldom
def _give_up(lane, state, alone, B):
    """A lane that cannot be continued: nothing of it is known any more, and it is not watched."""
    own = alone.state
    for q in range(4):
        own.ring[q, 0, 1:] = float("nan")
    for m in range(own.watch.size):
        state.tally[STANDING] -= own.go[m] == 0.0
        own.go[m] = 1.0
        state.watch[m * B + lane] = 0.0
    state.pendings[lane] = 0


@functools.cache
def lanes_address() -> int:
    """Address of the compiled `_step_lanes`."""
    return int(_compiled(LANES)(_step_lanes).address)


@functools.cache
def piece_address() -> int:
    """Address of the compiled `_piece`."""
    return int(_compiled(PIECE)(_piece).address)


def _step_lanes(k, row0, B, platoon, steps, state, alone):
    """Let every lane that is marked, or in which something happened, make step `k` by itself."""
    for e in range(state.happened.size):
        if state.happened[e] != 0.0:
            state.todo[e % B], state.happened[e] = 1, 0.0
    for lane in range(B):
        if state.todo[lane] != 0:
            state.todo[lane] = 0
            _step_lane(lane, k, row0, platoon, steps, state, alone, B)
            for i in range(state.pendings[lane]):
                state.earliest[0] = min(state.earliest[0], state.pending[lane, i, 0])
