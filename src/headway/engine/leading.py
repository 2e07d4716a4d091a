"""The leader at every position of every step of a chunk, now and as late as each delay."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from headway.engine.mesh import AT
from headway.engine.plan import Plan
from headway.scenario.motion import Side, at_lanes

__all__ = ["lead_ballistic", "lead_exact"]

Array = NDArray[np.float64]


def lead_exact(plan: Plan, nodes: Array, first: int, last: int) -> tuple[Array, Array]:
    """Exact motion: (steps, position, 3, lanes) now and (slots, steps, position, 3, lanes) late.

    The start of a step takes limits from the right, its end those from the left.
    """
    start, end = nodes[first:last], nodes[first + 1 : last + 1]
    lead = np.zeros((start.size, len(AT), 3, len(plan.motions)))
    late = np.zeros((plan.delays.size, *lead.shape))
    for c, at in enumerate(AT):
        if at == AT[3] and not plan.extra:
            continue
        t = end if at == 1.0 else start + at * (end - start)
        side: Side = "left" if at == 1.0 else "right"
        lead[:, c] = np.stack(at_lanes(plan.motions, t, side), axis=1)
        for d, delay in enumerate(plan.delays):
            late[d, :, c] = np.stack(at_lanes(plan.motions, t - delay, side), axis=1)
    return lead, late


def lead_ballistic(plan: Plan, nodes: Array, first: int, last: int) -> tuple[Array, Array]:
    """The leader's exact speeds at the nodes, with positions by the trapezoid rule that followers obey too."""
    lead = np.zeros((last - first, len(AT), 3, len(plan.motions)))
    late = np.zeros((plan.delays.size, *lead.shape))
    _, speed, acceleration = at_lanes(plan.motions, nodes[: last + 1])
    length = np.diff(nodes[: last + 1])[:, None]
    position = np.concatenate((0.0 * speed[:1], np.cumsum(0.5 * length * (speed[1:] + speed[:-1]), axis=0)))
    for c, (a, b) in ((0, (first, last)), (2, (first + 1, last + 1))):
        lead[:, c] = np.stack((position[a:b], speed[a:b], acceleration[a:b]), axis=1)
    before = np.array([m.before for m in plan.motions])
    for d, delay in enumerate(plan.delays):
        t = nodes[first:last] - delay
        i = np.clip(np.searchsorted(nodes, t + 2e-9, side="right") - 1, 0, last - 1)
        u, slope = (t - nodes[i])[:, None], (speed[i + 1] - speed[i]) / length[i]
        past = t[:, None] < 0.0
        late[d, :, 0, 0] = np.where(past, before * t[:, None], position[i] + u * (speed[i] + 0.5 * u * slope))
        late[d, :, 0, 1] = np.where(past, before, speed[i] + u * slope)
        late[d, :, 0, 2] = np.where(past, 0.0, acceleration[i])
    return lead, late
