"""The compiled, batched integrator.

Arrays are flat `[vehicle][lane]`: a lane is one platoon of the batch, row 0 the leader. All
vehicles advance together, so every loop below is over independent elements and vectorises, and no
element's arithmetic depends on how many lanes there are: a platoon gets the same bits alone and in
a batch. (The loops are functions over whole slices: an index such as `k - B` that may be negative
stops vectorisation.)

`advance` is the classical Runge-Kutta method of order 4 in Nyström form, with the past read from a
ring of nodes through weights that were computed beforehand (`headway.engine.mesh`). Each step ends
by evaluating the acceleration at its end, which is the next step's first stage unless the
acceleration jumps there. `advance_ballistic` is the field's usual scheme.
"""

from __future__ import annotations

from numba import njit

from headway.engine.calls import at_place, call_lanes
from headway.engine.events import collide
from headway.engine.history import CLOSE
from headway.engine.layout import (
    EXACT,
    FLAG_INSIDE,
    FLAG_JUMP,
    FLAG_RECORD,
    LAG,
    LIMITS,
    PURE,
    REFINED,
    STANDING,
    WORK,
)  # fmt: skip
from headway.engine.loops import (
    any_closed,
    any_closed_or_reversing,
    ballistic_step,
    ballistic_stops,
    changed_sides,
    closed,
    copy,
    finish,
    scale_add,
    scale_add2,
    seldom,
    stage,
    third,
)  # fmt: skip
from headway.engine.rates import PASSES, accelerate, end_lagged, lagged_or_pure, look_back, place_leader

__all__ = ["advance", "advance_ballistic"]

#: vehicle-steps of single lanes after which a call returns, so that a run can be cancelled
_PATIENCE = 100_000

_kernel = njit(error_model="numpy", nogil=True, cache=True, _nrt=False)


@seldom
def _record(out, row, x, v, a):
    """Keep a state; the next row."""
    copy(out[0, row], x)
    copy(out[1, row], v)
    copy(out[2, row], a)
    return row + 1


@seldom
def _concerned(k, row0, steps, state):
    """Mark lanes for which something is due in step `k`, or that look back into a step with nodes inside it."""
    R, any_lane = state.time.size, False
    end = steps.time[k + 1] - CLOSE
    if state.earliest[0] < end:
        state.earliest[0] = float("inf")
        for lane in range(state.todo.size):
            for i in range(state.pendings[lane]):
                time = state.pending[lane, i, 0]
                if time < end:
                    state.todo[lane], any_lane = 1, True
                else:
                    state.earliest[0] = min(state.earliest[0], time)
    if state.tally[REFINED] > 0:
        for slot in range(steps.row.shape[0]):
            for c in range(steps.row.shape[2]):
                row = (row0 + steps.row[slot, k, c]) % R
                if state.lanes[row] != 0:
                    for lane in range(state.todo.size):
                        if state.first[row, lane] >= 0:
                            state.todo[lane], any_lane = 1, True
    return any_lane


@seldom
def _forget_nodes(row, state):
    """Free all nodes inside the step that begins at a row of the ring, which leaves the past."""
    for lane in range(state.first.shape[1]):
        node = state.first[row, lane]
        if node < 0:
            continue
        while node >= 0:
            state.free[0] += 1
            state.free[state.free[0]] = node
            node = state.node_next[node]
        state.first[row, lane] = -1
        state.tally[REFINED] -= 1
    state.lanes[row] = 0


@_kernel
def advance(first, last, row0, detect, extra, lanes, platoon, steps, state, alone, out, out_row, B):
    """Make steps `first` … `last`-1 of a chunk whose first step has history row `row0`.

    Returns (number of the next step, next row of `out`): it may return before `last` is reached. `detect` says what
    to do about events: with `EXACT` lanes in which something happens make the step again by themselves (by the
    function at address `lanes`, with `alone` for room), with `NOTE` they are only noted.

    Stages: 0 the start, only where the acceleration jumps there (else it is known from the step
    before); 1 to 3 the other stages of the Runge-Kutta method; 4 the end of the step, from the left;
    5 the extra point. There is one place that evaluates, so that there is little to compile. Where
    all vehicles see only the past, stages 1 and 2 are one and so are 3 and 4.
    """
    groups, ring, K, J = platoon.groups, state.ring, state.K, state.J
    R, M1 = ring.shape[1], ring.shape[2]
    own, ahead = slice(B, M1), slice(0, M1 - B)
    slots = platoon.span.shape[0]
    pure, lagged, limited = True, False, False
    for g in range(groups.shape[0]):
        pure = pure and groups[g, PURE] != 0
        lagged = lagged or groups[g, LAG] != 0
        limited = limited or groups[g, LIMITS] != 0
    final = 5 if extra else 4
    for k in range(first, last):
        if state.tally[WORK] > _PATIENCE or state.free[0] < alone.reserve:
            return k, out_row
        h = steps.step[k]
        here, there = (row0 + k) % R, (row0 + k + 1) % R
        x, v, xn, vn = ring[0, here], ring[1, here], ring[0, there], ring[1, there]
        state.time[there] = steps.time[k + 1]
        if state.lanes[there] != 0:
            _forget_nodes(there, state)
        stops = state.tally[STANDING] > 0
        jump = steps.flags[k] & FLAG_JUMP != 0
        state.two[here] = jump
        start, end = ring[2 if jump else 3, here], ring[3, there]
        place_leader(x, v, start, steps, k, 0, B)
        if jump and lagged:
            copy(start[own], state.actual[own])
        # a step with look-ups inside itself starts from a guess of its end and is made again and again
        passes = PASSES if steps.flags[k] & FLAG_INSIDE else 1
        at = 0 if jump else 1
        made = 0
        while made < passes:
            c = 0 if at == 0 else (1 if at < 3 else (2 if at < 5 else 3))
            buffer = c & 1
            X, V = state.stage[0], state.stage[1]
            A = K[at]
            if at == 0:
                X, V, A = x, v, start
            elif at == 4 or (pure and at == 3):
                # with nothing but the past to see, the end of the step is not needed to know its acceleration
                X, V, A = xn, vn, end
            if at == 1 and made == 0 and passes > 1:
                scale_add2(xn, x, v, h, start, 0.5 * h * h)
                scale_add(vn, v, start, h)
                copy(end, start)
                copy(ring[4, here], start)
            if not pure:
                if at == 1:
                    stage(X[own], V[own], x[own], v[own], start[own], start[own], 0.5 * h, 0.0, 0.5 * h)
                    lagged_or_pure(A[own], start[own], J[0], 0.5 * h, start[own], groups, B)
                elif at == 2:
                    stage(X[own], V[own], x[own], v[own], start[own], K[1, own], 0.5 * h, 0.25 * h * h, 0.5 * h)
                    lagged_or_pure(A[own], start[own], J[1], 0.5 * h, K[1, own], groups, B)
                elif at == 3:
                    stage(X[own], V[own], x[own], v[own], K[1, own], K[2, own], h, 0.5 * h * h, h)
                    lagged_or_pure(A[own], start[own], J[2], h, start[own], groups, B)
                elif at == 4:
                    lagged_or_pure(A[own], start[own], J[0], 0.0, K[3, own], groups, B)
                    end_lagged(A[own], start[own], J, h, groups, B)
            if at == 5:
                third(X, x, xn, v, vn, h)
                third(V, v, vn, start, end, h)
                third(A[own], start[own], end[own], J[0], J[4], h)
            current = at == 2 or at == 4
            place_leader(X, V, A, steps, k, c, B)
            if not current:
                for d in range(slots):
                    look_back(d, k, c, buffer, row0, platoon, steps, state, B)
            command = state.command[0 if at == 0 else (2 if at == 5 else 1)]
            accelerate(k, c, row0, platoon, steps, state, buffer, current, X, V, A, J[at], command, stops, B)
            if at == 3:
                k2 = K[1 if pure else 2, own]
                finish(xn[own], vn[own], x[own], v[own], start[own], K[1, own], k2, A[own], h)
                place_leader(xn, vn, end, steps, k, 2, B)
            elif at == 5:
                copy(ring[4, here], A)
            # the next stage
            at = at + 2 if pure and (at == 1 or (at == 3 and extra)) else at + 1
            if at > final or (pure and at == 4):
                made += 1
                at = 1
        happened = limited or stops or any_closed_or_reversing(xn[ahead], xn[own], vn[own], platoon.length)
        if happened:
            happened = changed_sides(
                state.command[0], state.command[1], platoon.limits[0], platoon.limits[1], state.go, vn[own],
                xn[ahead], xn[own], platoon.length, state.watch, state.happened,
            )  # fmt: skip
        if detect == EXACT:
            if state.tally[REFINED] > 0 or state.earliest[0] < steps.time[k + 1] - CLOSE:
                happened = _concerned(k, row0, steps, state) or happened
            if happened and lanes == 0:
                return k, out_row
        if steps.flags[k] & FLAG_RECORD:
            out_row = _record(out, out_row, x, v, start)
        if detect == EXACT and happened:
            call_lanes(
                lanes, k, row0, B, at_place(platoon), at_place(steps), at_place(state), at_place(alone)
            )  # fmt: skip
            if steps.flags[k] & FLAG_RECORD:
                copy(out[2, out_row - 1], ring[2 if state.two[here] else 3, here])
        if lagged:
            copy(state.actual, end)
            copy(J[0], J[4])
        if limited or stops or state.tally[STANDING] > 0:
            copy(state.command[0], state.command[1])
    return last, out_row


@seldom
def _hit(time, h, x, xn, vn, platoon, state, B):
    """Gaps closed in a ballistic step, which stands up to the vehicle that hits first; times are interpolated."""
    followers = state.happened.size // B
    for lane in range(B):
        while True:
            least, who = 2.0, -1
            for m in range(followers):
                e = m * B + lane
                if state.happened[e] != 0.0 and state.watch[e] != 0.0:
                    start = max(x[e] - x[e + B] - platoon.length[e], 0.0)
                    end = xn[e] - xn[e + B] - platoon.length[e]
                    share = start / (start - end) if start > end else 0.0
                    if share < least:
                        least, who = share, m
            if who < 0:
                break
            collide(who, lane, time + least * h, state, B)
            for m in range(who, followers):
                e = (m + 1) * B + lane
                xn[e], vn[e] = float("nan"), float("nan")
    for e in range(state.happened.size):
        state.happened[e] = 0.0


@_kernel
def advance_ballistic(first, last, row0, platoon, steps, state, out, out_row, B):
    """The same for the ballistic scheme: v += a h, x += (v + v_new) h/2, with all signals from the start of the step.

    The leader moves by the same rule along its exact speeds, as in simulators of this kind.
    """
    groups, ring, J = platoon.groups, state.ring, state.J
    R, M1 = ring.shape[1], ring.shape[2]
    own, ahead = slice(B, M1), slice(0, M1 - B)
    slots = platoon.span.shape[0]
    lagged = False
    for g in range(groups.shape[0]):
        lagged = lagged or groups[g, LAG] != 0
    for k in range(first, last):
        h = steps.step[k]
        here, there = (row0 + k) % R, (row0 + k + 1) % R
        x, v, xn, vn = ring[0, here], ring[1, here], ring[0, there], ring[1, there]
        start = ring[3, here]
        if lagged:
            copy(start[own], state.actual[own])
        place_leader(x, v, start, steps, k, 0, B)
        for d in range(slots):
            look_back(d, k, 0, 0, row0, platoon, steps, state, B)
        accelerate(k, 0, row0, platoon, steps, state, 0, False, x, v, start, J[0], state.command[1], False, B)
        if ballistic_step(xn[own], vn[own], x[own], v[own], start[own], h):
            ballistic_stops(xn[own], vn[own], x[own], v[own], start[own])
        place_leader(xn, vn, ring[3, there], steps, k, 2, B)
        closing = any_closed(xn[ahead], xn[own], platoon.length)
        if closing and closed(xn[ahead], xn[own], platoon.length, state.watch, state.happened):
            _hit(steps.time[k], h, x, xn, vn, platoon, state, B)
        if steps.flags[k] & FLAG_RECORD:
            out_row = _record(out, out_row, x, v, start)
        if lagged:
            copy(state.actual, start)
            lagged_or_pure(state.actual[own], start[own], J[0], h, start[own], groups, B)
        if k == last - 1:
            # the last node of a run starts no step: it shows the acceleration that led to it
            copy(ring[3, there, B:], start[own])
    return last, out_row
