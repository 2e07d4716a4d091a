"""Breaking points: where a derivative of some vehicle's motion jumps, so that a step must end there.

A jump of the q-th derivative of a position (q = 1 speed, 2 acceleration, …) reaches whoever looks
at it after his delay, smoother by two derivatives through a gap, by one through a speed, by none
through an acceleration, and by one more behind an actuator lag. A follower's jumps are counted as
those of what it is commanded, which its own integration has to see: q = 2 is a jump of the command,
and behind a lag the position's jump is of order q + 1. A Runge-Kutta method of order 4 does not see
jumps above the fourth. (Bellen and Zennaro, Numerical Methods for Delay
Differential Equations, 2003, ch. 2; theory: Σ m_i τ_i.)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from headway.scenario.motion import HIGHEST_ORDER
from headway.scenario.vehicle import Vehicle

__all__ = ["TICK", "Jumps", "hops", "merge", "own_order", "propagate"]

#: times closer than this [s] are one breaking point; a step that ends this far from a jump of an
#: acceleration makes an error of their product in the speed
TICK = 1e-12


class Jumps(NamedTuple):
    """Breaking points as sorted whole ticks and the lowest order that jumps at each."""

    tick: NDArray[np.int64]
    order: NDArray[np.int64]

    @classmethod
    def of(cls, time: object, order: object) -> Jumps:
        """From times [s] and orders of any length."""
        ticks = np.rint(np.atleast_1d(np.asarray(time, dtype=float)) / TICK).astype(np.int64)
        return merge([cls(ticks, np.broadcast_to(np.asarray(order, dtype=np.int64), ticks.shape))])

    @property
    def time(self) -> NDArray[np.float64]:
        """Times [s]."""
        return np.asarray(self.tick * TICK, dtype=np.float64)


NONE = Jumps(np.empty(0, np.int64), np.empty(0, np.int64))


def merge(parts: Sequence[Jumps]) -> Jumps:
    """One sorted set of all parts; neighbours within a tick become one of the lowest order."""
    tick = np.concatenate([p.tick for p in parts])
    order = np.concatenate([p.order for p in parts])
    keep = order <= HIGHEST_ORDER
    tick, order = tick[keep], order[keep]
    if tick.size == 0:
        return NONE
    rank = np.lexsort((order, tick))
    tick, order = tick[rank], order[rank]
    first = np.concatenate(([True], np.diff(tick) > 1))
    return Jumps(tick[first], np.minimum.reduceat(order, np.flatnonzero(first)))


def own_order(vehicle: Vehicle, order: int) -> int:
    """The order, as counted here, of a jump in the `order`-th derivative of the vehicle's own position."""
    return order - (vehicle.lag > 0)


def propagate(vehicles: Sequence[Vehicle], leader: Jumps, own: dict[int, Jumps], end: float) -> list[Jumps]:
    """Breaking points of the leader and of every follower up to `end` [s].

    `own` holds those that begin at a vehicle itself (1 is the first follower): its initial state,
    a stop, a limit that is reached.
    """
    result, lagged = [leader], False
    known: dict[tuple, Jumps] = {}
    for n, vehicle in enumerate(vehicles, start=1):
        ahead, begun = result[-1], own.get(n, NONE)
        key = (vehicle.channel, vehicle.model.law, vehicle.lag > 0, lagged, *(a.tobytes() for a in (*ahead, *begun)))
        if key not in known:
            known[key] = _of_follower(vehicle, ahead, lagged, leader, begun, end)
        result.append(known[key])
        lagged = vehicle.lag > 0
    return result


def hops(vehicle: Vehicle) -> tuple[list[tuple[float, int]], list[tuple[float, int]]]:
    """(delay [s], orders gained) of everything that a vehicle perceives of the one ahead, and of itself."""
    c, signals = vehicle.channel, set(vehicle.model.law.signals)
    from_ahead = [(c.s, 2, "s"), (c.leader_speed_in_dv, 1, "dv"), (c.vl, 1, "vl"), (c.al, 0, "al")]
    # an acceleration that is known at once is an algebraic loop or a state: neither breaks anything anew
    from_self = [(c.s, 2, "s"), (c.v, 1, "v"), (c.own_speed_in_dv, 1, "dv")] + ([(c.a, 0, "a")] if c.a > 0 else [])
    ahead, own = ([(d, q) for d, q, name in rows if name in signals] for rows in (from_ahead, from_self))
    return ahead, own


def _of_follower(vehicle: Vehicle, ahead: Jumps, lagged: bool, leader: Jumps, begun: Jumps, end: float) -> Jumps:
    c, signals = vehicle.channel, set(vehicle.model.law.signals)
    from_leader = [(c.v0l, 1, "v0l"), (c.a0l, 0, "a0l")]
    from_ahead, from_self = hops(vehicle)
    limit = int(end / TICK)

    def shifted(jumps: Jumps, delay: float, smoother: int, lag: bool) -> Jumps:
        tick = jumps.tick + round(delay / TICK)
        inside = tick <= limit
        return Jumps(tick[inside], jumps.order[inside] + smoother + lag)

    found = merge(
        [begun]
        + [shifted(ahead, d, q, lagged) for d, q in from_ahead]
        + [shifted(leader, d, q, False) for d, q, name in from_leader if name in signals]
    )
    while True:
        more = merge([found] + [shifted(found, d, q, vehicle.lag > 0) for d, q in from_self])
        if np.array_equal(more.tick, found.tick) and np.array_equal(more.order, found.order):
            return found
        found = more
