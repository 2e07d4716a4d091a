"""Linear theory of a whole platoon: what reaches its tail, and its worst vehicle between.

Behind a leader with the speed V_0 the vehicles answer one after the other,

    V_n = G_n V_{n-1} + R_n V_0,

with R_n the answer to the platoon leader of a law that hears it by radio, 0 for all others. Where it
is not 0 there is no growth per vehicle: V_n/V_{n-1} differs from vehicle to vehicle even if they are
all alike. What is defined is the gain from the leader to each vehicle, and its largest one.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from headway.checked import typed
from headway.errors import HeadwayError
from headway.scenario.vehicle import Vehicle
from headway.theory.corners import rests
from headway.theory.gain import Peak, grid, smallest
from headway.theory.linear import Linear, linearize
from headway.theory.quasipolynomial import QuasiPolynomial

__all__ = ["Chain", "gain_power", "head_to_tail"]


@dataclass(frozen=True)
class Chain:
    """Linear theory of a string of different vehicles, front to back, behind one leader.

    Attributes:
        vehicles: linear theory of every vehicle, the one behind the leader first.
    """

    vehicles: tuple[Linear, ...]

    def responses(self, omega: Any) -> Any:
        """Return the complex speed of every follower per speed of the leader.

        Args:
            omega: frequencies [rad/s] of any shape.

        Returns:
            An array (vehicles, *shape).
        """
        p = 1j * np.asarray(omega, dtype=float)
        speed = np.ones_like(p)
        speeds = []
        for v in self.vehicles:
            speed = (v.numerator(p) * speed + v.leader_numerator(p)) / v.characteristic(p)
            speeds.append(speed)
        return np.array(speeds)

    def gain(self, omega: Any) -> Any:
        """Return the gain [1] from the leader to the last vehicle at `omega` [rad/s] of any shape."""
        return np.abs(self.responses(omega)[-1])

    @property
    def locally_stable(self) -> bool:
        """Whether every vehicle is locally stable."""
        return all(v.locally_stable for v in self.vehicles)

    @property
    def strictly_string_stable(self) -> bool:
        """Whether |G_n| <= 1 at every frequency for every vehicle (Ploeg et al. 2014).

        Raises:
            LeaderHeardError: where one of them hears the platoon leader.
        """
        for v in self.vehicles:
            v.refuse_without_leader("string stability of every vehicle")
        return all(v.string_stable for v in dict.fromkeys(self.vehicles))

    @property
    def hears_leader(self) -> bool:
        """Whether a vehicle reacts to the platoon leader, so that no verdict on single vehicles exists."""
        return any(v.hears_leader for v in self.vehicles)

    @functools.cached_property
    def _alike(self) -> Linear | None:
        """The vehicle, where all are alike and none hears the leader: then the chain is a power of it."""
        first = self.vehicles[0]
        return first if not first.hears_leader and all(v == first for v in self.vehicles) else None

    @functools.cached_property
    def peak(self) -> Peak:
        """The largest gain from the leader to the last vehicle, and where."""
        if self._alike is not None and self.locally_stable:
            gain, frequency, certified = self._alike.peak
            return Peak(gain_power(gain, len(self.vehicles)), frequency, certified)
        return self._sup(lambda w: self.gain(w))

    @functools.cached_property
    def worst(self) -> Peak:
        """The largest gain from the leader to any vehicle, and where."""
        if self._alike is not None and self.locally_stable:
            return self.peak if self.peak.gain > 1.0 else self._alike.peak
        return self._sup(lambda w: np.abs(self.responses(w)).max(axis=0))

    @property
    def head_to_tail_stable(self) -> bool:
        """Whether no frequency is larger at the tail than at the head."""
        if self._alike is not None:
            return self._alike.string_stable
        return self.locally_stable and self.peak.gain <= 1.0 + 1e-9

    def _sup(self, gain: Callable[[Any], Any]) -> Peak:
        if not self.locally_stable:
            return Peak(math.inf, math.nan, False)
        omega = np.unique(np.concatenate([grid(_heard(v), v.characteristic) for v in dict.fromkeys(self.vehicles)]))
        value, where = smallest(lambda w: -gain(w), omega, -1.0)
        # the sweep ends where every vehicle calms its predecessor, or else among waves as short as any
        if where == omega[-1]:
            where = math.inf
        return Peak(1.0, 0.0, False) if -value <= 1.0 + 1e-12 else Peak(-value, where, False)


def _heard(v: Linear) -> QuasiPolynomial:
    """Terms of the answers to the vehicle ahead and to the leader, side by side, so that sizes add."""
    top, leader = v.numerator, v.leader_numerator
    return QuasiPolynomial(*(np.concatenate((getattr(top, n), getattr(leader, n)))
                             for n in ("coefficient", "power", "delay")))  # fmt: skip


def gain_power(gain: float, count: int) -> float:
    """Return gain**count, infinite where it is larger than any float."""
    with np.errstate(over="ignore"):
        return float(np.float64(gain) ** count)


@typed
def head_to_tail(vehicles: Sequence[Vehicle], speed: float, gap: float | Sequence[float] | None = None) -> Chain:
    """Linear theory of a whole string, front to back: what reaches its tail, and its worst vehicle between.

    Args:
        vehicles: the followers; a law that hears the platoon leader hears the one ahead of the first of them.
        speed: of everybody [m/s].
        gap: [m], one or one for each vehicle, of the vehicles that rest at every gap; the others take their
            own equilibrium.

    Raises:
        HeadwayError: without vehicles, with another number of gaps, or where one has no equilibrium.
    """
    if not vehicles:
        raise HeadwayError("a string has at least one vehicle")
    if gap is not None and not isinstance(gap, int | float) and len(gap) != len(vehicles):
        raise HeadwayError(f"gap: {len(gap)} gaps are given for {len(vehicles)} vehicles; give one, or one for each")
    gaps = [gap] * len(vehicles) if gap is None or isinstance(gap, int | float) else list(gap)
    theories: dict[tuple[Vehicle, float | None], Linear] = {}
    linears = []
    for vehicle, s in zip(vehicles, gaps, strict=True):
        if (vehicle, s) not in theories:
            needed = s is not None and s > 0 and rests(vehicle.model, speed, s)
            theories[vehicle, s] = linearize(vehicle, speed, s if needed else None)
        linears.append(theories[vehicle, s])
    return Chain(tuple(linears))
