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

from typing import NamedTuple

import numpy as np
from numba import njit

from headway.engine.compile import call_rate, pointer

__all__ = [
    "FLAG_INSIDE", "FLAG_JUMP", "FLAG_RECORD", "GROUP", "IGNORE", "NOTE", "SIGNAL_CODES", "STOP_AT_EVENT", "TRIAL",
    "Platoon", "State", "Steps", "advance", "advance_ballistic",
]  # fmt: skip

#: columns of the table of groups (consecutive vehicles with one law and one channel)
GROUP = {
    name: i
    for i, name in enumerate(
        ("row", "rows", "count", "lag", "limits", "serial", "chained", "pure", *(f"signal{i}" for i in range(8)))
    )
}
SIGNAL_CODES = {name: i for i, name in enumerate(("s", "v", "dv", "a", "vl", "al", "v0l", "a0l"))}

#: per step: it starts at a jump; a look-up falls inside it; its start is recorded
FLAG_JUMP, FLAG_INSIDE, FLAG_RECORD = 1, 2, 4

#: what to do about events: nothing; return at the first; return after every step without counting it; note them
IGNORE, STOP_AT_EVENT, TRIAL, NOTE = range(4)

#: how often a step is made when a delay is shorter than it; each pass gains an order
PASSES = 5

_ROW, _ROWS, _COUNT, _LAG, _LIMITS, _SERIAL, _CHAINED, _PURE, _SIGNAL0 = range(9)



class Platoon(NamedTuple):
    """What does not change during a run. M = followers × lanes, elements in the order [vehicle][lane]."""

    groups: np.ndarray  # (G, 16) whole numbers, columns GROUP
    slots: np.ndarray  # (G, 8, 2) delay slot of each signal (of both halves of dv), -1 = current
    addresses: np.ndarray  # (G, 2) compiled loops: plain, chained
    parameters: np.ndarray  # (parameters, M)
    length: np.ndarray  # (M,) length of the vehicle ahead [m]
    lag: np.ndarray  # (M,) [s]
    limits: np.ndarray  # (2, M) least and largest command [m/s²]
    needs: np.ndarray  # (S, 3) whether a slot is asked for positions, speeds, accelerations
    span: np.ndarray  # (S, 2) rows that a slot is asked for


class Steps(NamedTuple):
    """The steps of a chunk: their lengths, the leader, and how to read the past. c = position of `mesh.AT`."""

    step: np.ndarray  # (n,) [s]
    flags: np.ndarray  # (n,)
    lead: np.ndarray  # (n, c, 3, 1 or lanes) position, speed, acceleration of the leader
    delayed_lead: np.ndarray  # (S, n, c, 3, 1 or lanes) the same, late by each slot's delay
    row: np.ndarray  # (S, n, c) history row, counted from the row of the chunk's first step
    motion: np.ndarray  # (S, n, c, 4)
    speed: np.ndarray  # (S, n, c, 4)
    acceleration: np.ndarray  # (S, n, c, 5)


class State(NamedTuple):
    """What a run carries from step to step."""

    ring: np.ndarray  # (5, R, (N+1) lanes): position, speed, acceleration from the right, from the left, extra point
    K: np.ndarray  # (6, (N+1) lanes) accelerations of the stages and of the end; K[0] is that of the start
    J: np.ndarray  # (6, M) rates of change of accelerations behind a lag
    signals: np.ndarray  # (8, M)
    looked: np.ndarray  # (S, 2, 3, (N+1) lanes) what was read of the past
    command: np.ndarray  # (3, M) what laws asked for at the start and the end of a step, and a spare row
    go: np.ndarray  # (M,) 0 where a vehicle stands
    watch: np.ndarray  # (M,) 0 where events are ignored
    happened: np.ndarray  # (M,) 1 where an event was noted


_fast = njit(error_model="numpy", nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
_kernel = njit(error_model="numpy", nogil=True, cache=True)


@_fast
def _scale_add(out, x, y, c):
    for i in range(out.size):
        out[i] = x[i] + c * y[i]


@_fast
def _scale_add2(out, x, y, c, z, d):
    for i in range(out.size):
        out[i] = x[i] + c * y[i] + d * z[i]


@_fast
def _weigh4(out, a, b, c, d, w):
    w0, w1, w2, w3 = w[0], w[1], w[2], w[3]
    for i in range(out.size):
        out[i] = w0 * a[i] + w1 * b[i] + w2 * c[i] + w3 * d[i]


@_fast
def _weigh5(out, a, b, c, d, e, w):
    w0, w1, w2, w3, w4 = w[0], w[1], w[2], w[3], w[4]
    for i in range(out.size):
        out[i] = w0 * a[i] + w1 * b[i] + w2 * c[i] + w3 * d[i] + w4 * e[i]


@_fast
def _gap(out, ahead, own, length):
    for i in range(out.size):
        out[i] = ahead[i] - own[i] - length[i]


@_fast
def _difference(out, ahead, own):
    for i in range(out.size):
        out[i] = ahead[i] - own[i]


@_fast
def _clip(out, low, high):
    for i in range(out.size):
        u = out[i]
        u = low[i] if u < low[i] else u
        out[i] = high[i] if u > high[i] else u


@_fast
def _times(out, factor):
    for i in range(out.size):
        out[i] *= factor[i]


@_fast
def _toward(out, command, actual, lag):
    for i in range(out.size):
        out[i] = (command[i] - actual[i]) / lag[i]


@_fast
def _step_speed(out, v, k1, k2, k3, k4, h):
    sixth = h / 6.0
    for i in range(out.size):
        out[i] = v[i] + sixth * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])


@_fast
def _step_position(out, x, v, k1, k2, k3, h):
    sixth = h * h / 6.0
    for i in range(out.size):
        out[i] = x[i] + h * v[i] + sixth * (k1[i] + k2[i] + k3[i])


@_fast
def _copy(out, a):
    for i in range(out.size):
        out[i] = a[i]


@_fast
def _spread(out, a):
    """Copy one lane to all, or lane by lane."""
    if a.size == 1:
        out[:] = a[0]
    else:
        for i in range(out.size):
            out[i] = a[i]


@_fast
def _ballistic_step(xn, vn, x, v, a, h):
    for i in range(xn.size):
        u = v[i] + h * a[i]
        # a vehicle that would reverse stops within the step, after v²/(2|a|)
        stops = u < 0.0
        stopped_x = x[i] - 0.5 * v[i] * v[i] / (a[i] if stops else -1.0)
        xn[i] = stopped_x if stops else x[i] + 0.5 * h * (v[i] + u)
        vn[i] = 0.0 if stops else u


@_fast
def _lagged_or_pure(out, start, rate, c, before, groups, B):
    """Accelerations that are not a law's immediate answer: behind a lag `start + c rate`; of the past only, as before."""
    for g in range(groups.shape[0]):
        a = groups[g, _ROW] * B
        b = a + groups[g, _ROWS] * B
        if groups[g, _LAG]:
            _scale_add(out[a:b], start[a:b], rate[a:b], c)
        elif groups[g, _PURE]:
            _copy(out[a:b], before[a:b])


@_fast
def _end_lagged(out, start, J, h, groups, B):
    for g in range(groups.shape[0]):
        if groups[g, _LAG]:
            a = groups[g, _ROW] * B
            b = a + groups[g, _ROWS] * B
            _step_speed(out[a:b], start[a:b], J[0, a:b], J[1, a:b], J[2, a:b], J[3, a:b], h)


@_fast
def _third(out, a, b, slope_a, slope_b, h):
    """Hermite cubic one third into the step."""
    for i in range(out.size):
        out[i] = (20.0 * a[i] + 7.0 * b[i] + h * (4.0 * slope_a[i] - 2.0 * slope_b[i])) / 27.0


@_fast
def _happened(ahead, own, speed, platoon, state):
    """Whether a gap closed, a speed turned negative, a standing vehicle is asked to go, or a limit changed sides."""
    length, start, end, go = platoon.length, state.command[0], state.command[1], state.go
    low, high, watch = platoon.limits[0], platoon.limits[1], state.watch
    happened = state.happened
    found = 0
    for i in range(own.size):
        event = ahead[i] - own[i] <= length[i]
        event |= (speed[i] < 0.0) & (go[i] != 0.0)
        event |= (end[i] > 0.0) & (go[i] == 0.0)
        event |= ((start[i] < low[i]) != (end[i] < low[i])) | ((start[i] > high[i]) != (end[i] > high[i]))
        event &= watch[i] != 0.0
        happened[i] = 1.0 if event else happened[i]
        found |= event
    return found != 0


@_fast
def _look(slot, k, c, buffer, row0, platoon, steps, state, B):
    """Read slot `slot` of the past for position `c` of step `k` into `looked[slot, buffer]`."""
    ring, out = state.ring, state.looked[slot, buffer]
    r = row0 + steps.row[slot, k, c]
    i, j = r % ring.shape[1], (r + 1) % ring.shape[1]
    lo, hi = platoon.span[slot, 0] * B, platoon.span[slot, 1] * B
    x0, x1, v0, v1 = ring[0, i, lo:hi], ring[0, j, lo:hi], ring[1, i, lo:hi], ring[1, j, lo:hi]
    a0, a1 = ring[2, i, lo:hi], ring[3, j, lo:hi]
    if platoon.needs[slot, 0]:
        _weigh4(out[0, lo:hi], x0, x1, v0, v1, steps.motion[slot, k, c])
    if platoon.needs[slot, 1]:
        _weigh4(out[1, lo:hi], v0, v1, a0, a1, steps.speed[slot, k, c])
    if platoon.needs[slot, 2]:
        _weigh5(out[2, lo:hi], v0, v1, a0, a1, ring[4, i, lo:hi], steps.acceleration[slot, k, c])
    for q in range(3):
        _spread(out[q, :B], steps.delayed_lead[slot, k, c, q])


@_fast
def _signals(g, platoon, state, buffer, only_current, X, V, A, B):
    """Fill the rows of signals of group `g`; those of the past are kept if `only_current`."""
    groups, looked = platoon.groups, state.looked
    rows = groups[g, _ROWS]
    a = groups[g, _ROW] * B
    b = a + rows * B
    # elements of followers; in X, V, A the vehicle ahead stands one row earlier
    own, ahead = slice(a + B, b + B), slice(a, b)
    for i in range(groups[g, _COUNT]):
        code = groups[g, _SIGNAL0 + i]
        p, q = platoon.slots[g, i, 0], platoon.slots[g, i, 1]
        if only_current and p >= 0 and q >= 0:
            continue
        out = state.signals[i, a:b]
        quantity = 1 if code == 1 or code == 4 or code == 6 else 2
        now = V if quantity == 1 else A
        if code == 0:
            position = looked[p, buffer, 0] if p >= 0 else X
            _gap(out, position[ahead], position[own], platoon.length[a:b])
        elif code == 2:
            theirs = looked[p, buffer, 1] if p >= 0 else V
            mine = looked[q, buffer, 1] if q >= 0 else V
            _difference(out, theirs[ahead], mine[own])
        elif code == 1 or code == 3:
            _copy(out, looked[p, buffer, quantity, own] if p >= 0 else now[own])
        elif code == 4 or code == 5:
            _copy(out, looked[p, buffer, quantity, ahead] if p >= 0 else now[ahead])
        else:
            leader = looked[p, buffer, quantity, :B] if p >= 0 else now[:B]
            for r in range(rows):
                _copy(out[r * B : (r + 1) * B], leader)


@_fast
def _evaluate(platoon, state, buffer, only_current, X, V, A, jerk, command, stops, B):
    """Accelerations of all followers into A (rows from 1 on); behind a lag, their rate of change into `jerk`.

    `command` keeps what the laws asked for, before limits and standstill. Groups are evaluated from
    front to back, so that an acceleration received without delay is known.
    """
    groups, sig, par = platoon.groups, state.signals, platoon.parameters
    total = command.size
    for g in range(groups.shape[0]):
        if only_current and groups[g, _PURE]:
            continue
        row, rows = groups[g, _ROW], groups[g, _ROWS]
        _signals(g, platoon, state, buffer, only_current, X, V, A, B)
        if groups[g, _CHAINED] and not stops:
            a, b = row * B, (row + rows) * B
            call_rate(
                platoon.addresses[g, 1], pointer(sig, a), pointer(par, a), pointer(A, a), b - a, total, par.shape[1], B
            )
            _copy(command[a:b], A[a + B : b + B])
            continue
        pieces = rows if groups[g, _SERIAL] else 1
        size = rows // pieces * B
        for piece in range(pieces):
            a = row * B + piece * size
            b = a + size
            if pieces > 1:
                for i in range(groups[g, _COUNT]):
                    if groups[g, _SIGNAL0 + i] == 5:
                        _copy(sig[i, a:b], A[a:b])
            call_rate(
                platoon.addresses[g, 0], pointer(sig, a), pointer(par, a), pointer(command, a), size, total, par.shape[1], 0
            )
            out = jerk[a:b] if groups[g, _LAG] else A[a + B : b + B]
            _copy(out, command[a:b])
            if groups[g, _LIMITS]:
                _clip(out, platoon.limits[0, a:b], platoon.limits[1, a:b])
            if groups[g, _LAG]:
                _toward(out, out, A[a + B : b + B], platoon.lag[a:b])
            if stops:
                _times(out, state.go[a:b])


@_fast
def _lead(X, V, A, steps, k, c, B):
    """Put the leader into row 0 of a stage."""
    _spread(X[:B], steps.lead[k, c, 0])
    _spread(V[:B], steps.lead[k, c, 1])
    _spread(A[:B], steps.lead[k, c, 2])


@_kernel
def advance(first, last, row0, detect, stops, extra, platoon, steps, state, out, out_row, B):
    """Make steps `first` … `last`-1 of a chunk whose first step has history row `row0`.

    Returns (number of the next step, next row of `out`). `detect` says what to do about events
    (`STOP_AT_EVENT`, …). Where it returns early the end of the last step is in the ring, but the step
    is not counted nor its start recorded, and it may be made again with another length.

    Stages: 0 the start, only where the acceleration jumps there (else it is known from the step
    before); 1 to 3 the other stages of the Runge-Kutta method; 4 the end of the step, from the left;
    5 the extra point. There is one place that evaluates, so that there is little to compile.
    """
    groups, ring, K, J = platoon.groups, state.ring, state.K, state.J
    R, M1 = ring.shape[1], ring.shape[2]
    own, ahead = slice(B, M1), slice(0, M1 - B)
    slots = platoon.span.shape[0]
    X, V = np.empty(M1), np.empty(M1)
    final = 5 if extra else 4
    for k in range(first, last):
        h = steps.step[k]
        here, there = (row0 + k) % R, (row0 + k + 1) % R
        x, v, xn, vn = ring[0, here], ring[1, here], ring[0, there], ring[1, there]
        _lead(x, v, K[0], steps, k, 0, B)
        jump = steps.flags[k] & FLAG_JUMP
        # a step with look-ups inside itself starts from a guess of its end and is made again and again
        passes = PASSES if steps.flags[k] & FLAG_INSIDE else 1
        stage = 0 if jump else 1
        made = 0
        while made < passes:
            position = 0 if stage == 0 else (1 if stage < 3 else (2 if stage < 5 else 3))
            buffer = 1 if position & 1 else 0
            a = K[stage, own]
            if stage == 0:
                _copy(X, x)
                _copy(V, v)
            elif stage == 1:
                _scale_add(X[own], x[own], v[own], 0.5 * h)
                _scale_add(V[own], v[own], K[0, own], 0.5 * h)
                _lagged_or_pure(a, K[0, own], J[0], 0.5 * h, K[0, own], groups, B)
            elif stage == 2:
                _scale_add2(X[own], x[own], v[own], 0.5 * h, K[0, own], 0.25 * h * h)
                _scale_add(V[own], v[own], K[1, own], 0.5 * h)
                _lagged_or_pure(a, K[0, own], J[1], 0.5 * h, K[1, own], groups, B)
            elif stage == 3:
                _scale_add2(X[own], x[own], v[own], h, K[1, own], 0.5 * h * h)
                _scale_add(V[own], v[own], K[2, own], h)
                _lagged_or_pure(a, K[0, own], J[2], h, K[0, own], groups, B)
            elif stage == 4:
                _copy(X, xn)
                _copy(V, vn)
                _lagged_or_pure(a, K[0, own], J[0], 0.0, K[3, own], groups, B)
                _end_lagged(a, K[0, own], J, h, groups, B)
            else:
                _third(X, x, xn, v, vn, h)
                _third(V, v, vn, K[0], K[4], h)
                _third(a, K[0, own], K[4, own], J[0], J[4], h)
            if stage == 1 and made == 0:
                _copy(ring[2, here], K[0])
                if passes > 1:
                    _scale_add2(xn, x, v, h, K[0], 0.5 * h * h)
                    _scale_add(vn, v, K[0], h)
                    _copy(ring[3, there], K[0])
                    _copy(ring[4, here], K[0])
            current = stage == 2 or stage == 4
            _lead(X, V, K[stage], steps, k, position, B)
            if not current:
                for d in range(slots):
                    _look(d, k, position, buffer, row0, platoon, steps, state, B)
            command = state.command[0 if stage == 0 else (2 if stage == 5 else 1)]
            _evaluate(platoon, state, buffer, current, X, V, K[stage], J[stage], command, stops, B)
            if stage == 3:
                _step_position(xn[own], x[own], v[own], K[0, own], K[1, own], K[2, own], h)
                _step_speed(vn[own], v[own], K[0, own], K[1, own], K[2, own], K[3, own], h)
                _lead(xn, vn, K[4], steps, k, 2, B)
            elif stage == 4:
                _copy(ring[3, there], K[4])
            elif stage == 5:
                _copy(ring[4, here], K[5])
            if stage == final:
                made += 1
                stage = 1
            else:
                stage += 1
        if detect == TRIAL:
            return k, out_row
        if detect != IGNORE and _happened(xn[ahead], xn[own], vn[own], platoon, state) and detect == STOP_AT_EVENT:
            return k, out_row
        if steps.flags[k] & FLAG_RECORD:
            _copy(out[0, out_row], x)
            _copy(out[1, out_row], v)
            _copy(out[2, out_row], K[0])
            out_row += 1
        _copy(K[0], K[4])
        _copy(J[0], J[4])
        _copy(state.command[0], state.command[1])
    return last, out_row


@_kernel
def advance_ballistic(first, last, row0, detect, platoon, steps, state, out, out_row, B):
    """The same for the ballistic scheme: v += a h, x += (v + v_new) h/2, with all signals from the start of the step.

    The leader moves by the same rule along its exact speeds, as in simulators of this kind.
    """
    groups, ring, K, J = platoon.groups, state.ring, state.K, state.J
    R, M1 = ring.shape[1], ring.shape[2]
    own, ahead = slice(B, M1), slice(0, M1 - B)
    slots = platoon.span.shape[0]
    for k in range(first, last):
        h = steps.step[k]
        here, there = (row0 + k) % R, (row0 + k + 1) % R
        x, v, xn, vn = ring[0, here], ring[1, here], ring[0, there], ring[1, there]
        _lead(x, v, K[0], steps, k, 0, B)
        for d in range(slots):
            _look(d, k, 0, 0, row0, platoon, steps, state, B)
        _evaluate(platoon, state, 0, False, x, v, K[0], J[0], state.command[1], False, B)
        _copy(ring[2, here], K[0])
        _ballistic_step(xn[own], vn[own], x[own], v[own], K[0, own], h)
        _lead(xn, vn, K[4], steps, k, 2, B)
        _copy(K[4, own], K[0, own])
        _lagged_or_pure(K[4, own], K[0, own], J[0], h, K[0, own], groups, B)
        _copy(ring[3, there], K[4])
        if detect != IGNORE and _closed(xn[ahead], xn[own], platoon, state) and detect == STOP_AT_EVENT:
            return k, out_row
        if steps.flags[k] & FLAG_RECORD:
            _copy(out[0, out_row], x)
            _copy(out[1, out_row], v)
            _copy(out[2, out_row], K[0])
            out_row += 1
        _copy(K[0], K[4])
    return last, out_row


@_fast
def _closed(ahead, own, platoon, state):
    """Whether a gap closed."""
    length, watch, happened = platoon.length, state.watch, state.happened
    found = 0
    for i in range(own.size):
        event = (ahead[i] - own[i] <= length[i]) & (watch[i] != 0.0)
        happened[i] = 1.0 if event else happened[i]
        found |= event
    return found != 0
