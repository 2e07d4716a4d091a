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

from headway.engine.compile import address_of, call_rate
from headway.engine.layout import (
    CHAINED,
    COUNT,
    FLAG_INSIDE,
    FLAG_JUMP,
    FLAG_RECORD,
    IGNORE,
    LAG,
    LIMITS,
    PURE,
    ROW,
    ROWS,
    SERIAL,
    SIGNAL0,
    STOP_AT_EVENT,
    TRIAL,
)  # fmt: skip
from headway.engine.loops import (
    any_closed,
    any_closed_or_reversing,
    ballistic_step,
    ballistic_stops,
    changed_sides,
    clip,
    closed,
    copy,
    fast,
    finish,
    scale_add,
    scale_add2,
    seldom,
    spread,
    stage,
    step_state,
    third,
    times,
    toward,
    weigh4,
    weigh5,
)  # fmt: skip

__all__ = ["advance", "advance_ballistic"]

#: how often a step is made when a delay is shorter than it; each pass gains an order
PASSES = 5

_kernel = njit(error_model="numpy", nogil=True, cache=True, _nrt=False)


@fast
def _past(platoon, steps, state, slot, k, c, buffer, quantity, row0, element):
    """Address of an element of what a slot sees: in the ring where the look-up is a node, else in what was read."""
    node = steps.node[slot, k, c]
    if node == 0:
        return address_of(state.looked[slot, buffer, quantity], element)
    row = (row0 + steps.row[slot, k, c] + node - 1) % state.ring.shape[1]
    return address_of(state.ring[quantity if quantity < 2 else 3, row], element)


@fast
def _look(slot, k, c, buffer, row0, platoon, steps, state, B):
    """Read slot `slot` of the past for position `c` of step `k` into `looked[slot, buffer]`."""
    if steps.node[slot, k, c] != 0:
        return
    ring, out, needs = state.ring, state.looked[slot, buffer], platoon.needs
    r = row0 + steps.row[slot, k, c]
    i, j = r % ring.shape[1], (r + 1) % ring.shape[1]
    lo, hi = platoon.span[slot, 0] * B, platoon.span[slot, 1] * B
    v0, v1 = ring[1, i, lo:hi], ring[1, j, lo:hi]
    a0, a1 = ring[2 if state.two[i] else 3, i, lo:hi], ring[3, j, lo:hi]
    if needs[slot, 0]:
        weigh4(out[0, lo:hi], ring[0, i, lo:hi], ring[0, j, lo:hi], v0, v1, steps.motion[slot, k, c])
    if needs[slot, 1]:
        weigh4(out[1, lo:hi], v0, v1, a0, a1, steps.speed[slot, k, c])
    if needs[slot, 2]:
        weigh5(out[2, lo:hi], v0, v1, a0, a1, ring[4, i, lo:hi], steps.acceleration[slot, k, c])
    for q in range(3):
        if needs[slot, q]:
            spread(out[q, :B], steps.delayed_lead[slot, k, c, q])


@fast
def _aim(g, k, c, row0, platoon, steps, state, buffer, X, V, A, B):
    """Point the sources of group `g` at what its signals are made of.

    In X, V, A and in the past the vehicle ahead of the group's first stands at element a, the first itself at a + B.
    """
    groups, slots, sources = platoon.groups, platoon.slots, state.sources
    rows = groups[g, ROWS]
    a = groups[g, ROW] * B
    for i in range(groups[g, COUNT]):
        code = groups[g, SIGNAL0 + i]
        p, q = slots[g, i, 0], slots[g, i, 1]
        quantity = 0 if code == 0 else (2 if code == 3 or code == 5 or code == 7 else 1)
        now = X if quantity == 0 else (V if quantity == 1 else A)
        # what is looked at first: oneself for v and a, the vehicle ahead for all others
        element = a + B if code == 1 or code == 3 else a
        if code >= 6:
            # the platoon leader, for every follower
            heard = state.leader[i]
            for r in range(rows):
                part = heard[a + r * B : a + (r + 1) * B]
                if p < 0:
                    copy(part, now[:B])
                else:
                    spread(part, steps.delayed_lead[p, k, c, quantity])
            sources[i, 0] = address_of(heard, a)
        elif p >= 0:
            sources[i, 0] = _past(platoon, steps, state, p, k, c, buffer, quantity, row0, element)
        else:
            sources[i, 0] = address_of(now, element)
        if code == 0 or code == 2:
            if q >= 0:
                sources[i, 1] = _past(platoon, steps, state, q, k, c, buffer, quantity, row0, a + B)
            else:
                sources[i, 1] = address_of(now, a + B)
        if code == 0:
            sources[i, 2] = address_of(platoon.length, a)


@fast
def _evaluate(k, c, row0, platoon, steps, state, buffer, only_current, X, V, A, jerk, command, stops, B):
    """Accelerations of all followers into A (rows from 1 on); behind a lag, their rate of change into `jerk`.

    `command` keeps what laws asked for where that is more than what is done (lag, limits, standstill).
    Groups are evaluated from front to back, so that an acceleration received without delay is known.
    """
    groups, par = platoon.groups, platoon.parameters
    sources, stride = address_of(state.sources, 0), par.shape[1]
    for g in range(groups.shape[0]):
        if only_current and groups[g, PURE]:
            continue
        row, rows, lagged, limited = groups[g, ROW], groups[g, ROWS], groups[g, LAG], groups[g, LIMITS]
        _aim(g, k, c, row0, platoon, steps, state, buffer, X, V, A, B)
        a = row * B
        if groups[g, CHAINED] and not stops:
            call_rate(platoon.addresses[g, 1], sources, address_of(par, a), address_of(A, a), rows * B, 0, stride, B)
            continue
        pieces = rows if groups[g, SERIAL] else 1
        size = rows // pieces * B
        for piece in range(pieces):
            a = row * B + piece * size
            b = a + size
            direct = not (stops or lagged or limited)
            target = address_of(A, a + B) if direct else address_of(command, a)
            call_rate(platoon.addresses[g, 0], sources, address_of(par, a), target, size, piece * size, stride, 0)
            if direct:
                continue
            out = jerk[a:b] if lagged else A[a + B : b + B]
            copy(out, command[a:b])
            if limited:
                clip(out, platoon.limits[0, a:b], platoon.limits[1, a:b])
            if lagged:
                toward(out, out, A[a + B : b + B], platoon.lag[a:b])
            if stops:
                times(out, state.go[a:b])


@seldom
def _lagged_or_pure(out, start, rate, c, before, groups, B):
    """Accelerations that are no law's immediate answer: behind a lag `start + c rate`; of the past only, as before."""
    for g in range(groups.shape[0]):
        a = groups[g, ROW] * B
        b = a + groups[g, ROWS] * B
        if groups[g, LAG]:
            scale_add(out[a:b], start[a:b], rate[a:b], c)
        elif groups[g, PURE]:
            copy(out[a:b], before[a:b])


@seldom
def _end_lagged(out, start, J, h, groups, B):
    for g in range(groups.shape[0]):
        if groups[g, LAG]:
            a = groups[g, ROW] * B
            b = a + groups[g, ROWS] * B
            step_state(out[a:b], start[a:b], J[0, a:b], J[1, a:b], J[2, a:b], J[3, a:b], h)


@fast
def _lead(X, V, A, steps, k, c, B):
    """Put the leader into row 0 of a stage."""
    spread(X[:B], steps.lead[k, c, 0])
    spread(V[:B], steps.lead[k, c, 1])
    spread(A[:B], steps.lead[k, c, 2])


@seldom
def _record(out, row, x, v, a):
    """Keep a state; the next row."""
    copy(out[0, row], x)
    copy(out[1, row], v)
    copy(out[2, row], a)
    return row + 1


@_kernel
def advance(first, last, row0, detect, stops, extra, platoon, steps, state, out, out_row, B):
    """Make steps `first` … `last`-1 of a chunk whose first step has history row `row0`.

    Returns (number of the next step, next row of `out`). `detect` says what to do about events
    (`STOP_AT_EVENT`, …). Where it returns early the end of the last step is in the ring, but the step
    is not counted nor its start recorded, and it may be made again with another length.

    Stages: 0 the start, only where the acceleration jumps there (else it is known from the step
    before); 1 to 3 the other stages of the Runge-Kutta method; 4 the end of the step, from the left;
    5 the extra point. There is one place that evaluates, so that there is little to compile. Where
    all vehicles see only the past, stages 1 and 2 are one and so are 3 and 4.
    """
    groups, ring, K, J = platoon.groups, state.ring, state.K, state.J
    R, M1 = ring.shape[1], ring.shape[2]
    own, ahead = slice(B, M1), slice(0, M1 - B)
    slots = platoon.span.shape[0]
    pure, lagged, full = True, False, stops
    for g in range(groups.shape[0]):
        pure = pure and groups[g, PURE] != 0
        lagged = lagged or groups[g, LAG] != 0
        full = full or groups[g, LIMITS] != 0
    final = 5 if extra else 4
    for k in range(first, last):
        h = steps.step[k]
        here, there = (row0 + k) % R, (row0 + k + 1) % R
        x, v, xn, vn = ring[0, here], ring[1, here], ring[0, there], ring[1, there]
        jump = steps.flags[k] & FLAG_JUMP != 0
        state.two[here] = jump
        start, end = ring[2 if jump else 3, here], ring[3, there]
        _lead(x, v, start, steps, k, 0, B)
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
                    _lagged_or_pure(A[own], start[own], J[0], 0.5 * h, start[own], groups, B)
                elif at == 2:
                    stage(X[own], V[own], x[own], v[own], start[own], K[1, own], 0.5 * h, 0.25 * h * h, 0.5 * h)
                    _lagged_or_pure(A[own], start[own], J[1], 0.5 * h, K[1, own], groups, B)
                elif at == 3:
                    stage(X[own], V[own], x[own], v[own], K[1, own], K[2, own], h, 0.5 * h * h, h)
                    _lagged_or_pure(A[own], start[own], J[2], h, start[own], groups, B)
                elif at == 4:
                    _lagged_or_pure(A[own], start[own], J[0], 0.0, K[3, own], groups, B)
                    _end_lagged(A[own], start[own], J, h, groups, B)
            if at == 5:
                third(X, x, xn, v, vn, h)
                third(V, v, vn, start, end, h)
                third(A[own], start[own], end[own], J[0], J[4], h)
            current = at == 2 or at == 4
            _lead(X, V, A, steps, k, c, B)
            if not current:
                for d in range(slots):
                    _look(d, k, c, buffer, row0, platoon, steps, state, B)
            command = state.command[0 if at == 0 else (2 if at == 5 else 1)]
            _evaluate(k, c, row0, platoon, steps, state, buffer, current, X, V, A, J[at], command, stops, B)
            if at == 3:
                k2 = K[1 if pure else 2, own]
                finish(xn[own], vn[own], x[own], v[own], start[own], K[1, own], k2, A[own], h)
                _lead(xn, vn, end, steps, k, 2, B)
            elif at == 5:
                copy(ring[4, here], A)
            # the next stage
            at = at + 2 if pure and (at == 1 or (at == 3 and extra)) else at + 1
            if at > final or (pure and at == 4):
                made += 1
                at = 1
        if detect == TRIAL:
            return k, out_row
        if detect != IGNORE:
            happened = full or any_closed_or_reversing(xn[ahead], xn[own], vn[own], platoon.length)
            if happened:
                happened = changed_sides(
                    state.command[0], state.command[1], platoon.limits[0], platoon.limits[1], state.go, vn[own],
                    xn[ahead], xn[own], platoon.length, state.watch, state.happened,
                )  # fmt: skip
            if happened and detect == STOP_AT_EVENT:
                return k, out_row
        if steps.flags[k] & FLAG_RECORD:
            out_row = _record(out, out_row, x, v, start)
        if lagged:
            copy(state.actual, end)
            copy(J[0], J[4])
        if full or lagged:
            copy(state.command[0], state.command[1])
    return last, out_row


@_kernel
def advance_ballistic(first, last, row0, detect, platoon, steps, state, out, out_row, B):
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
        _lead(x, v, start, steps, k, 0, B)
        for d in range(slots):
            _look(d, k, 0, 0, row0, platoon, steps, state, B)
        _evaluate(k, 0, row0, platoon, steps, state, 0, False, x, v, start, J[0], state.command[1], False, B)
        if ballistic_step(xn[own], vn[own], x[own], v[own], start[own], h):
            ballistic_stops(xn[own], vn[own], x[own], v[own], start[own])
        _lead(xn, vn, ring[3, there], steps, k, 2, B)
        if detect != IGNORE:
            happened = any_closed(xn[ahead], xn[own], platoon.length)
            if happened:
                happened = closed(xn[ahead], xn[own], platoon.length, state.watch, state.happened)
            if happened and detect == STOP_AT_EVENT:
                return k, out_row
        if steps.flags[k] & FLAG_RECORD:
            out_row = _record(out, out_row, x, v, start)
        if lagged:
            copy(state.actual, start)
            _lagged_or_pure(state.actual[own], start[own], J[0], h, start[own], groups, B)
        if k == last - 1:
            # the last node of a run starts no step: it shows the acceleration that led to it
            copy(ring[3, there, B:], start[own])
    return last, out_row
