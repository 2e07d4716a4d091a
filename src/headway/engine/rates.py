"""What laws are shown and what they answer: the accelerations of a batch at one position of a step."""

from __future__ import annotations

from headway.engine.compile import address_of, call_rate
from headway.engine.layout import CHAINED, COUNT, LAG, LIMITS, NOTHING, PURE, ROW, ROWS, SERIAL, SIGNAL0, SIGNAL_TABLE
from headway.engine.loops import clip, copy, fast, scale_add, seldom, spread, step_state, times, toward, weigh4, weigh5
from headway.models.signal import LEADER

__all__ = ["PASSES", "accelerate", "end_lagged", "lagged_or_pure", "look_back", "place_leader"]

#: how often a step is made when a delay is shorter than it; each pass gains an order
PASSES = 5


@fast
def _past(platoon, steps, state, slot, k, c, buffer, quantity, row0, element):
    """Address of an element of what a slot sees: in the ring where the look-up is a node, else in what was read."""
    node = steps.node[slot, k, c]
    if node == 0:
        return address_of(state.looked[slot, buffer, quantity], element)
    row = (row0 + steps.row[slot, k, c] + node - 1) % state.ring.shape[1]
    return address_of(state.ring[quantity if quantity < 2 else 3, row], element)


@fast
def look_back(slot, k, c, buffer, row0, platoon, steps, state, B):
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
        quantity, of, less = SIGNAL_TABLE[code, 0], SIGNAL_TABLE[code, 1], SIGNAL_TABLE[code, 2]
        p, q = slots[g, i, 0], slots[g, i, 1]
        now = X if quantity == 0 else (V if quantity == 1 else A)
        element = a + (1 - of) * B
        if of == LEADER:
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
        if less != NOTHING:
            taken = a + (1 - less) * B
            if q >= 0:
                sources[i, 1] = _past(platoon, steps, state, q, k, c, buffer, quantity, row0, taken)
            else:
                sources[i, 1] = address_of(now, taken)
        if quantity == 0:
            sources[i, 2] = address_of(platoon.length, a)


@fast
def accelerate(k, c, row0, platoon, steps, state, buffer, only_current, X, V, A, jerk, command, stops, B):
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
def lagged_or_pure(out, start, rate, c, before, groups, B):
    """Accelerations that are no law's immediate answer: behind a lag `start + c rate`; of the past only, as before."""
    for g in range(groups.shape[0]):
        a = groups[g, ROW] * B
        b = a + groups[g, ROWS] * B
        if groups[g, LAG]:
            scale_add(out[a:b], start[a:b], rate[a:b], c)
        elif groups[g, PURE]:
            copy(out[a:b], before[a:b])


@seldom
def end_lagged(out, start, J, h, groups, B):
    """Accelerations behind a lag at the end of a step, from their rates at its stages."""
    for g in range(groups.shape[0]):
        if groups[g, LAG]:
            a = groups[g, ROW] * B
            b = a + groups[g, ROWS] * B
            step_state(out[a:b], start[a:b], J[0, a:b], J[1, a:b], J[2, a:b], J[3, a:b], h)


@fast
def place_leader(X, V, A, steps, k, c, B):
    """Put the leader into row 0 of a stage."""
    spread(X[:B], steps.lead[k, c, 0])
    spread(V[:B], steps.lead[k, c, 1])
    spread(A[:B], steps.lead[k, c, 2])
