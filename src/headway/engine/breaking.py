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

import heapq
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from headway.models.signal import LEADER, OWN
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
    result, lags = [leader], [False]
    sets: dict[tuple, Jumps] = {}
    for n, vehicle in enumerate(vehicles, start=1):
        seen = range(n - 1, max(n - 1 - vehicle.perception.farthest, -1), -1)
        ahead, begun = [(result[k], lags[k]) for k in seen], own.get(n, NONE)
        bits = tuple(a.tobytes() for jumps in (*(j for j, _ in ahead), begun) for a in jumps)
        key = (vehicle.perception, vehicle.lag > 0, *(lag for _, lag in ahead), bits)
        if key not in sets:
            sets[key] = _of_follower(vehicle, ahead, leader, begun, end)
        result.append(sets[key])
        lags.append(vehicle.lag > 0)
    return result


def hops(vehicle: Vehicle, whose: int) -> list[tuple[float, int]]:
    """(delay [s], orders gained) of everything that a vehicle perceives of `whose` motion."""
    sources = (s for s in vehicle.perception.sources if s.whose == whose)
    # an acceleration that is known at once is an algebraic loop or a state: neither breaks anything anew
    return [(s.delay, 2 - s.signal.order) for s in sources if whose != OWN or s.signal.order < 2 or s.delay > 0.0]


def _of_follower(
    vehicle: Vehicle, ahead: Sequence[tuple[Jumps, bool]], leader: Jumps, begun: Jumps, end: float
) -> Jumps:
    """`ahead`: breaking points of the vehicles ahead, the next one first, and whether each has a lag."""
    limit = int(end / TICK)

    def shifted(jumps: Jumps, delay: float, smoother: int, lag: bool) -> Jumps:
        tick = jumps.tick + round(delay / TICK)
        inside = tick <= limit
        return Jumps(tick[inside], jumps.order[inside] + smoother + lag)

    found = merge(
        [begun]
        + [shifted(j, d, q, lag) for k, (j, lag) in enumerate(ahead, start=1) for d, q in hops(vehicle, k)]
        + [shifted(leader, d, q, False) for d, q in hops(vehicle, LEADER)]
    )
    own, lag = hops(vehicle, OWN), vehicle.lag > 0
    least = min((round(d / TICK) for d, q in own if q + lag == 0), default=0)
    if least and limit > least * found.tick.size:
        return _echoes(found, [(round(d / TICK), q + lag) for d, q in own], limit)
    while True:
        more = merge([found] + [shifted(found, d, q, lag) for d, q in own])
        if np.array_equal(more.tick, found.tick) and np.array_equal(more.order, found.order):
            return found
        found = more


def _echoes(jumps: Jumps, hops: Sequence[tuple[int, int]], limit: int) -> Jumps:
    """All echoes up to `limit` [ticks], one after another: of an acceleration they never end, and are many.

    Args:
        jumps: What is echoed.
        hops: Delay [ticks] and orders gained; those without delay never lower an order and are passed over.
        limit: The last tick.
    """
    waiting = list(zip(jumps.tick.tolist(), jumps.order.tolist(), strict=True))
    heapq.heapify(waiting)
    late = [(delay, gain) for delay, gain in hops if delay > 1]
    ticks: list[int] = []
    orders: list[int] = []
    while waiting:
        tick, order = heapq.heappop(waiting)
        last = tick
        while waiting and waiting[0][0] - last <= 1:  # neighbours within a tick are one, of the lowest order
            last, other = heapq.heappop(waiting)
            order = min(order, other)
        ticks.append(tick)
        orders.append(order)
        for delay, gain in late:
            if tick + delay <= limit and order + gain <= HIGHEST_ORDER:
                heapq.heappush(waiting, (tick + delay, order + gain))
    return Jumps(np.array(ticks, dtype=np.int64), np.array(orders, dtype=np.int64))
