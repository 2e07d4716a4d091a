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
    ago = np.concatenate(([0.0], plan.delays))
    sides: tuple[tuple[Side, tuple[int, ...]], ...] = (("right", (0, 1, 3) if plan.extra else (0, 1)), ("left", (2,)))
    for side, positions in sides:
        # all times of one side at once: (delay, step, position)
        t = np.stack([end if AT[c] == 1.0 else start + AT[c] * (end - start) for c in positions], axis=-1)
        times = t - ago[:, None, None]
        found = np.stack(at_lanes(plan.motions, times.ravel(), side), axis=1).reshape(*times.shape, 3, -1)
        # before 0 all signals are constant: positions moved alike, so that the gap was what it is at 0
        found[..., 0, :] = np.where(times[..., None] < 0.0, _cruise(plan) * times[..., None], found[..., 0, :])
        lead[:, positions], late[:, :, positions] = found[0], found[1:]
    return lead, late


def _cruise(plan: Plan) -> Array:
    """Speed at which all positions moved before 0, one per motion."""
    return plan.cruise[: len(plan.motions)]


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
        late[d, :, 0, 0] = np.where(past, _cruise(plan) * t[:, None], position[i] + u * (speed[i] + 0.5 * u * slope))
        late[d, :, 0, 1] = np.where(past, before, speed[i] + u * slope)
        late[d, :, 0, 2] = np.where(past, 0.0, acceleration[i])
    return lead, late
