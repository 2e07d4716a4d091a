"""The past of one lane, read at any time: what a lane sees that makes a step by itself.

The past of a batch is read through weights that are computed beforehand for its mesh
(`headway.engine.mesh`). A lane in which something happens has nodes of its own between those of the
mesh, and sees the past at times that nobody knew beforehand; here the same interpolation is done
for it, over the nodes that it has.
"""

from __future__ import annotations

from headway.engine.loops import fast, seldom
from headway.engine.mesh import CUBIC

__all__ = ["CLOSE", "leader_at", "see"]

#: times closer than this [s] are one
CLOSE = 2e-9

_START, _THIRD, _END, _MEAN = (tuple(float(x) for x in row) for row in CUBIC)


@fast
def _cubic(row, theta):
    return row[0] + theta * (row[1] + theta * (row[2] + theta * row[3]))


@seldom
def leader_at(out, table, lane, share, length, before):
    """Position, speed and acceleration of the leader after `share` of a step, from its exact ones at 0, 1/2 and 1.

    The quintic through the three speeds and accelerations, its derivative and its integral; `table` (c, 3, lanes) is
    that of `Steps.lead`. Before t = 0 (`before`) a position need not be the integral of the speed: it is linear.
    """
    if share <= 0.0 or share >= 1.0:
        c = 0 if share <= 0.0 else 2
        for q in range(3):
            out[q, 0] = table[c, q, lane]
        return
    half = 0.5 * length
    v0, vm, v1 = table[0, 1, lane], table[1, 1, lane], table[2, 1, lane]
    s0, sm, s1 = half * table[0, 2, lane], half * table[1, 2, lane], half * table[2, 2, lane]
    # p(u) = vm + sm u + c2 u² + … + c5 u⁵ with u = -1, 0, 1 at the start, the middle and the end
    even, odd = 0.5 * (v1 + v0) - vm, 0.5 * (v1 - v0) - sm
    c4 = 0.5 * (0.5 * (s1 - s0) - 2.0 * even)
    c2 = even - c4
    c5 = 0.5 * (0.5 * (s1 + s0) - sm - 3.0 * odd)
    c3 = odd - c5
    u = 2.0 * share - 1.0
    out[1, 0] = vm + u * (sm + u * (c2 + u * (c3 + u * (c4 + u * c5))))
    out[2, 0] = (sm + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) / half
    if before:
        out[0, 0] = table[0, 0, lane] + share * (table[2, 0, lane] - table[0, 0, lane])
        return
    integral = u * (vm + u * (sm / 2.0 + u * (c2 / 3.0 + u * (c3 / 4.0 + u * (c4 / 5.0 + u * c5 / 6.0)))))
    at_start = -(vm - sm / 2.0 + c2 / 3.0 - c3 / 4.0 + c4 / 5.0 - c5 / 6.0)
    out[0, 0] = table[0, 0, lane] + half * (integral - at_start)


@seldom
def _from_ring(end, row, lane, state, B, lo, hi):
    """A row of the ring as one end of a step of the past."""
    ring = state.ring
    for q in range(5):
        # at the start of a step the acceleration's limit from the right, which is kept where it has two
        source = 3 if q == 2 and state.two[row] == 0 else q
        for n in range(lo, hi):
            end[q, n] = ring[source, row, n * B + lane]


@seldom
def _from_node(end, node, state, lo, hi):
    for q in range(5):
        for n in range(lo, hi):
            end[q, n] = state.node[q, node, n]


@seldom
def _from_now(ends, own, lo, hi):
    for side in range(2):
        for q in range(5):
            for n in range(lo, hi):
                ends[side, q, n] = own.ring[q, side, n]


@seldom
def see(lane, k, row0, time, c, right, start, length, platoon, steps, state, alone, B):
    """Read all slots of the past as one lane sees them at `time`, for position `c` of the step from `start` it makes.

    `right`: on a node of the past, take the limits from the right. The step that is being made is the last of the past.
    """
    own, ends = alone.state, state.ends
    R = state.ring.shape[1]
    buffer = c & 1
    whole = steps.step[k]
    for slot in range(platoon.delays.size):
        t = time - platoon.delays[slot]
        lo, hi = platoon.span[slot, 0], platoon.span[slot, 1]
        # the step of the mesh; where the step begins, its look-up is a place to search from
        row = row0 + steps.row[slot, k, 0]
        while row < row0 + k:
            mark = state.time[(row + 1) % R]
            if (right and t >= mark - CLOSE) or (not right and t > mark + CLOSE):
                row += 1
            else:
                break
        r, after = row % R, (row + 1) % R
        a, b = state.time[r], state.time[after]
        node = state.first[r, lane]
        if node < 0:
            _from_ring(ends[0], r, lane, state, B, lo, hi)
            _from_ring(ends[1], after, lane, state, B, lo, hi)
        else:
            following = state.node_next[node]
            while following >= 0:
                mark = state.node_time[following]
                if (right and t >= mark - CLOSE) or (not right and t > mark + CLOSE):
                    node, following = following, state.node_next[following]
                else:
                    break
            a = state.node_time[node]
            if following >= 0:
                b = state.node_time[following]
                _from_node(ends[0], node, state, lo, hi)
                _from_node(ends[1], following, state, lo, hi)
            elif row == row0 + k:
                a, b = start, start + length
                _from_now(ends, own, lo, hi)
            else:
                _from_node(ends[0], node, state, lo, hi)
                _from_ring(ends[1], after, lane, state, B, lo, hi)
        h = b - a
        theta = (t - a) / h
        theta = 0.0 if abs(t - a) < CLOSE else (1.0 if abs(t - b) < CLOSE else theta)
        _interpolate(own.looked[slot, buffer], ends, theta, h, row == 0, platoon.needs[slot], lo, hi)
        table, out = steps.delayed_lead[slot, k], alone.steps.delayed_lead[slot, 0, c]
        which = lane if table.shape[2] > 1 else 0
        before = steps.time[k + 1] - platoon.delays[slot] <= CLOSE
        leader_at(out, table, which, (time - steps.time[k]) / whole, whole, before)
        for q in range(3):
            own.looked[slot, buffer, q, 0] = out[q, 0]


@seldom
def _interpolate(out, ends, theta, h, before, needs, lo, hi):
    """Hermite's cubic between two states; `before` t = 0 all is linear."""
    one = 1.0 - theta
    w0, w1 = one * one * (1.0 + 2.0 * theta), theta * theta * (3.0 - 2.0 * theta)
    w2, w3 = h * theta * one * one, -h * theta * theta * one
    if before:
        w0, w1, w2, w3 = one, theta, 0.0, 0.0
    if needs[0]:
        for n in range(lo, hi):
            out[0, n] = w0 * ends[0, 0, n] + w1 * ends[1, 0, n] + w2 * ends[0, 1, n] + w3 * ends[1, 1, n]
    if needs[1]:
        for n in range(lo, hi):
            out[1, n] = w0 * ends[0, 1, n] + w1 * ends[1, 1, n] + w2 * ends[0, 2, n] + w3 * ends[1, 3, n]
    if needs[2]:
        mean = _cubic(_MEAN, theta) / h
        start, end, third = _cubic(_START, theta), _cubic(_END, theta), _cubic(_THIRD, theta)
        if before:
            mean, start, end, third = 0.0, 0.0, 0.0, 0.0
        for n in range(lo, hi):
            out[2, n] = (
                mean * (ends[1, 1, n] - ends[0, 1, n])
                + start * ends[0, 2, n] + end * ends[1, 3, n] + third * ends[0, 4, n]
            )  # fmt: skip
