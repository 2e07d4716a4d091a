"""What can happen to a vehicle between two nodes of the mesh, when it does, what follows, and where it is felt.

A gap closes, a vehicle stops, a standing one is asked to go, a command crosses a limit. Each has a
measure that turns negative when it happens. It is a breaking point (`headway.engine.breaking`) like
those known before the run, and what is felt of it later, by the vehicle itself and by those behind,
are breaking points to come of its lane.
"""

from __future__ import annotations

import numpy as np

from headway.engine.history import CLOSE
from headway.engine.layout import HOPS, LAG, ROW, ROWS, STANDING
from headway.engine.loops import seldom
from headway.scenario.motion import HIGHEST_ORDER

__all__ = [
    "AT_START", "HIGH", "LOW", "NOTHING", "START", "STOP", "collide", "due", "first_incident", "let_happen", "measure",
    "next_due", "remember",
]  # fmt: skip

NOTHING = -1
GAP, STOP, START, LOW, HIGH = range(5)

#: an event within this share of a piece from its start is taken at the start
AT_START = 1e-9

#: the order from which on a breaking point is smooth
_SMOOTH = 3

#: breaking points closer than this [s] are one
_SAME = 1e-10


@seldom
def measure(kind, who, row, alone):
    """A number that turns negative when an event happens to a follower: at row 0 or 1 of the lane's ring and commands.

    These are the start and the end of the piece.
    """
    own, few = alone.state, alone.platoon
    if kind == GAP:
        return own.ring[0, row, who] - own.ring[0, row, who + 1] - few.length[who]
    if kind == STOP:
        return own.ring[1, row, who + 1]
    command, before = own.command[row, who], own.command[0, who]
    if kind == START:
        return -command
    if kind == LOW:
        low = few.limits[0, who]
        return low - command if before < low else command - low
    high = few.limits[1, who]
    return command - high if before > high else high - command


@seldom
def _can_happen(kind, who, alone):
    own, few = alone.state, alone.platoon
    if own.watch[who] == 0.0:
        return False
    if kind == GAP:
        return True
    if kind == START:
        return own.go[who] == 0.0
    # to a standing vehicle a limit is nothing: whatever is asked of it, it stands until it is asked to go
    if own.go[who] == 0.0:
        return False
    return kind == STOP or (np.isfinite(few.limits[0, who]) if kind == LOW else np.isfinite(few.limits[1, who]))


@seldom
def first_incident(alone, below, but_kind, but_who):
    """Which event of a piece happens first if all measures are straight lines, as (kind, follower), leaving one out."""
    rows = (np.int64(0), np.int64(1))
    best, first, whom = 2.0, np.int64(NOTHING), np.int64(0)
    for who in range(alone.state.go.size):
        for kind in range(5):
            if (kind == but_kind and who == but_who) or not _can_happen(kind, who, alone):
                continue
            end = measure(kind, who, rows[1], alone)
            if not end < below:
                continue
            start = measure(kind, who, rows[0], alone)
            guess = start / (start - end)
            if not guess > 0.0:
                guess = 0.0
            if guess < best:
                best, first, whom = guess, kind, who
    return first, whom


@seldom
def let_happen(kind, who, lane, time, platoon, state, alone, B):
    """Let an event happen at the start of a piece; whether the vehicle is not watched for a moment after it."""
    own = alone.state
    if kind == GAP:
        collide(who, lane, time, state, B)
        for m in range(who, own.go.size):
            state.tally[STANDING] -= own.go[m] == 0.0
            own.go[m], own.watch[m] = 1.0, 0.0
            for q in range(5):
                own.ring[q, 0, m + 1] = np.nan
        return False
    lagged = alone.platoon.lag[who] > 0.0
    order = 3
    if kind == STOP:
        own.ring[1, 0, who + 1] = 0.0
        own.ring[2, 0, who + 1] = 0.0
        # behind a lag it may stop while it is asked to go already, and then it goes at once
        # (without one, what it is asked is what it does)
        if not (lagged and own.command[0, who] > 0.0):
            own.go[who] = 0.0
            state.tally[STANDING] += 1
        # a stop ends an acceleration, also one behind a lag
        order = 1 if lagged else 2
    elif kind == START:
        own.go[who] = 1.0
        state.tally[STANDING] -= 1
    _feel(who, lane, time, order, platoon, state)
    if own.go[who] == 0.0:
        return False
    # it may stay on the edge for the length of rounding
    own.watch[who] = 0.0
    return True


@seldom
def collide(who, lane, time, state, B):
    """A collision is data: this follower and all behind it are not simulated any further."""
    state.collision[who + 1, lane] = time
    for m in range(who, state.go.size // B):
        state.watch[m * B + lane] = 0.0
    if who == 0:
        state.pendings[lane] = 0


# -- breaking points to come ---------------------------------------------------------------------


@seldom
def due(lane, time, state):
    """Whether a breaking point has been reached; it is one to come no longer."""
    reached, i = False, 0
    while i < state.pendings[lane]:
        if state.pending[lane, i, 0] <= time + CLOSE:
            state.pendings[lane] -= 1
            last = state.pendings[lane]
            for j in range(2):
                state.pending[lane, i, j] = state.pending[lane, last, j]
            reached = True
        else:
            i += 1
    return reached


@seldom
def next_due(lane, time, end, only_sharp, state):
    """The next breaking point before `end`, or that; `only_sharp`: smooth ones are passed over."""
    for i in range(state.pendings[lane]):
        t = state.pending[lane, i, 0]
        if time < t < end - CLOSE and not (only_sharp and state.pending[lane, i, 1] >= _SMOOTH):
            end = t
    return end


@seldom
def remember(lane, time, order, state):
    """Note a breaking point to come. Where there is no room, a smooth one is left out: it costs an order there."""
    count = state.pendings[lane]
    for i in range(count):
        if abs(state.pending[lane, i, 0] - time) < _SAME:
            state.pending[lane, i, 1] = min(state.pending[lane, i, 1], order)
            return
    if count == state.pending.shape[1]:
        for i in range(count):
            if state.pending[lane, i, 1] > order:
                count = i
                break
        if count == state.pending.shape[1]:
            return
    else:
        state.pendings[lane] += 1
    state.pending[lane, count, 0], state.pending[lane, count, 1] = time, order
    state.earliest[0] = min(state.earliest[0], time)


@seldom
def _group_of(who, groups):
    g = 0
    while who >= groups[g, ROW] + groups[g, ROWS]:
        g += 1
    return g


@seldom
def _join(front, side, count, time, order):
    """Put (time, order) into a front unless it is there; (how many there are, which was sharpened or added)."""
    for i in range(count):
        if abs(front[side, i, 0] - time) < _SAME:
            if order < front[side, i, 1]:
                front[side, i, 1] = order
                return count, i
            return count, count
    if count < front.shape[1]:
        front[side, count, 0], front[side, count, 1] = time, order
        return count + 1, count
    return count, count


@seldom
def _feel(who, lane, time, order, platoon, state):
    """Note where an event of a follower is felt later, by itself and by those behind: see `breaking.propagate`."""
    front, groups, hops = state.front, platoon.groups, platoon.hops
    side, count, none = np.int64(0), np.int64(1), np.int64(0)
    front[0, 0, 0], front[0, 0, 1] = time, order
    while count > 0 and who < state.go.size // state.pendings.size:
        g = _group_of(who, groups)
        lag = 1 if groups[g, LAG] else 0
        # what it feels of itself, again and again
        i = 0
        while i < count:
            t, q = front[side, i, 0], front[side, i, 1]
            if t > time + CLOSE:
                remember(lane, t, q, state)
            back = count
            for j in range(HOPS):
                delay, gain = hops[g, 1, j, 0], hops[g, 1, j, 1]
                if gain < 0:
                    break
                if delay > 0.0 and q + gain + lag <= HIGHEST_ORDER and t + delay < platoon.end:
                    count, changed = _join(front, side, count, t + delay, q + gain + lag)
                    back = min(back, changed)
            i = min(i + 1, back)
        # what the next one feels of it
        who += 1
        if who == state.go.size // state.pendings.size:
            break
        g = _group_of(who, groups)
        following = none
        for i in range(count):
            t, q = front[side, i, 0], front[side, i, 1]
            for j in range(HOPS):
                delay, gain = hops[g, 0, j, 0], hops[g, 0, j, 1]
                if gain < 0:
                    break
                if q + gain + lag <= HIGHEST_ORDER and t + delay < platoon.end:
                    following, _ = _join(front, 1 - side, following, t + delay, q + gain + lag)
        side, count = 1 - side, following
