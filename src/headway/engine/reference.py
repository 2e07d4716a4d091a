"""The oracle: an independent, plain and slow integrator that the compiled engine is tested against.

Each vehicle depends only on those ahead and on its own past, so vehicles are integrated one after
the other, each by the method of steps: pieces of time no longer than its own shortest delay and cut
wherever something that it feels may have a kink, each piece by SciPy's DOP853 to near rounding. A
piece of motion is kept as its values at Chebyshev points, which give it back to near rounding too.
Nothing here knows a mesh, a stage or a Hermite cubic.

Standstill, limits and collisions mean what they mean in `headway.engine.events`; the scheme is
always that of exact solutions.
"""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from headway.models.signal import LEADER, OWN
from headway.scenario.motion import Motion
from headway.scenario.reception import Source
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle

__all__ = ["Reference", "simulate_reference"]

Array = NDArray[np.float64]
Kinks = dict[float, int]
Hops = list[tuple[float, int]]

_TOLERANCE = 1e-13

#: longest piece [s], and how long a piece without watching for events is after one has happened [s]
_LONGEST, _QUIET = 0.1, 1e-6

#: kinks closer than this [s] are one; a look-up this close to the end of a piece asks for its side
_SAME, _CLOSE = 1e-10, 3e-10

#: the highest derivative of a position whose jump ends a piece; the step control copes with higher ones
_SMOOTH = 6

#: Chebyshev points of the second kind on [0, 1] and their barycentric weights
_POINTS = 0.5 - 0.5 * np.cos(np.pi * np.arange(14) / 13)
_WEIGHTS = np.where(np.arange(14) % 2, -1.0, 1.0) * np.where(np.arange(14) % 13, 1.0, 0.5)


@dataclass(frozen=True)
class Reference:
    """Exact trajectories of a platoon.

    Attributes:
        time: (T,) [s].
        position: (N+1, T) [m], row 0 the leader.
        speed: (N+1, T) [m/s].
        acceleration: (N+1, T) [m/s²].
        collision_time: (N+1,) [s], NaN if none.
    """

    time: Array
    position: Array
    speed: Array
    acceleration: Array
    collision_time: Array


def simulate_reference(scenario: Scenario, times: ArrayLike) -> Reference:
    """Exact motion of a scenario's vehicles at `times` [s] within its duration.

    Where an acceleration jumps its limit from the right is given (at the very end that from the
    left). A vehicle that collides and all behind it are NaN from then on.
    """
    end, out = scenario.end, np.asarray(times, dtype=float)
    leader = _leader(scenario.motion, scenario.cruise, end)
    tracks, collisions, length, x = [leader], [math.nan], scenario.leader_length, 0.0
    for vehicle, gap, speed in zip(scenario.followers, scenario.initial_gaps(), scenario.initial_speeds(), strict=True):
        x -= gap + length
        follower = _Follower(vehicle, list(tracks), length, _Track(x, scenario.cruise, speed))
        collisions.append(follower.drive())
        tracks.append(follower.track)
        length = vehicle.length
    motion = np.full((3, len(tracks), out.size), np.nan)
    for n, track in enumerate(tracks):
        for i, t in enumerate(out):
            if t < track.end - _SAME or track.end > end - _SAME:
                motion[:, n, i] = track.at(t, "left" if t >= end - _SAME else "right")
    return Reference(out, motion[0], motion[1], motion[2], np.array(collisions))


class _Track:
    """The motion of one vehicle as pieces, and what it was before t = 0."""

    def __init__(self, position: float, cruise: float, speed: float) -> None:
        """`position` [m] and `speed` [m/s] at 0; before 0 the position moved at `cruise`, the speed was as at 0."""
        self.position, self.cruise, self.speed = position, cruise, speed
        self.start: list[float] = []
        self.pieces: list[tuple[float, Array]] = []  # length [s], (3, points) position, speed, acceleration
        self.end = 0.0
        self.kinks: Kinks = {}

    def add(self, start: float, end: float, values: Array) -> None:
        """Append the piece from `start` to `end` with `values` (3, points)."""
        self.start.append(start)
        self.pieces.append((end - start, values))
        self.end = end

    def at(self, time: float, side: str) -> tuple[float, float, float]:
        """Position, speed and acceleration at `time`; `side` says which piece if it is where two meet."""
        nudged = time + (_CLOSE if side == "right" else -_CLOSE)
        if nudged < 0.0 or not self.start:
            return self.position + self.cruise * time, self.speed, 0.0
        i = max(bisect.bisect_right(self.start, nudged) - 1, 0)
        length, values = self.pieces[i]
        away = (time - self.start[i]) / length - _POINTS
        nearest = int(np.argmin(np.abs(away)))
        if away[nearest] == 0.0:
            x, v, a = values[:, nearest]
        else:
            weights = _WEIGHTS / away
            x, v, a = values @ weights / weights.sum()
        return float(x), float(v), float(a)


def _leader(motion: Motion, cruise: float, end: float) -> _Track:
    """The leader's exact motion; each knot of it is taken for a kink of some order."""
    track = _Track(0.0, cruise, motion.before)
    for t in motion.start[motion.start < end]:
        _, speed, acceleration = np.abs(np.subtract(motion.at(t), motion.at(t, "left")))
        track.kinks[float(t)] = 1 if speed > 1e-12 else (2 if acceleration > 1e-12 else 3)
    if cruise != motion.before:
        track.kinks[0.0] = 1  # its position has a corner there
    knots = [*sorted({0.0, *track.kinks}), end]
    for a, b in itertools.pairwise(knots):
        cuts = np.linspace(a, b, math.ceil((b - a) / _LONGEST) + 1)
        for start, stop in itertools.pairwise(cuts):
            times = start + (stop - start) * _POINTS
            right, left = np.array(motion.at(times)), np.array(motion.at(times, "left"))
            track.add(float(start), float(stop), np.where(_POINTS < 0.5, right, left))
    return track


def _spread(seeds: Iterable[tuple[float, int]], hops: Hops, end: float) -> Kinks:
    """All kinks that seeds (time, order) become by any number of hops (delay, orders gained)."""
    found: Kinks = {}
    work = list(seeds)
    while work:
        time, order = work.pop()
        key = round(time, 12)
        if time < end and order <= _SMOOTH and order < found.get(key, _SMOOTH + 1):
            found[key] = order
            work += [(time + delay, order + gained) for delay, gained in hops if delay > 0.0]
    return found


class _Follower:
    """One follower's way through its pieces."""

    def __init__(self, vehicle: Vehicle, tracks: list[_Track], length: float, track: _Track) -> None:
        self.vehicle, self.tracks, self.ahead, self.length, self.track = vehicle, tracks, tracks[-1], length, track
        self.law, self.parameters = vehicle.model.law.function, vehicle.model.parameters
        self.signals, self.perception = vehicle.model.law.signals, vehicle.perception
        self.low, self.high = vehicle.limits or (-math.inf, math.inf)
        self.end = self.ahead.end
        self.hops = self._felt(OWN)
        seeds = [(0.0, 1)]
        for whose, source in self._others():
            for delay, gained in self._felt(whose):
                seeds += [(t + delay, order + gained) for t, order in source.kinks.items()]
        track.kinks = _spread(seeds, self.hops, self.end)
        self.cuts = sorted(track.kinks)
        self.own_delay = min((d for d, _ in self.hops if d > 0.0), default=math.inf)

    def _others(self) -> list[tuple[int, _Track]]:
        """Whose motions there are to see, but one's own."""
        return [(LEADER, self.tracks[0]), *enumerate(reversed(self.tracks), start=1)]

    def _felt(self, whose: int) -> Hops:
        return [(s.delay, 2 - s.signal.order) for s in self.perception.sources if s.whose == whose]

    def drive(self) -> float:
        """Integrate to the end; returns the time of a collision, or NaN."""
        t, y = 0.0, np.array([self.track.position, self.track.speed, 0.0])
        standing, quiet = False, False
        while t < self.end - _SAME:
            if y[1] == 0.0 and not quiet:
                standing = self.command(t, "right", y) <= 0.0
                quiet = not standing
            stop = self._piece_end(t)
            if quiet:
                stop = min(stop, t + _QUIET)
            if standing:
                t, starts = self._stand(t, stop, y)
                standing, quiet = not starts, starts
                if starts:
                    self._kink(t, 3)
                continue
            t, y, event = self._move(t, stop, y, watch=not quiet)
            quiet = event is not None
            if event == "gap":
                return t
            if event == "stop":
                y[1:] = 0.0
                quiet = False
                self._kink(t, 2)
            elif event == "limit":
                self._kink(t, 3)
        return math.nan

    def _piece_end(self, t: float) -> float:
        i = bisect.bisect_right(self.cuts, t + _SAME)
        cut = self.cuts[i] if i < len(self.cuts) else self.end
        return min(cut, t + _LONGEST, t + self.own_delay, self.end)

    def _kink(self, t: float, order: int) -> None:
        """An event at `t` is felt again through own delays, and by those behind."""
        for time, level in _spread([(t, order)], self.hops, self.end).items():
            self.track.kinks[time] = min(level, self.track.kinks.get(time, level))
        self.cuts = sorted(self.track.kinks)

    def _stand(self, t: float, stop: float, y: Array) -> tuple[float, bool]:
        """Stand until `stop` or until asked to go: the time and whether it is."""
        mid = 0.5 * (t + stop)

        def asked(time: float) -> float:
            return self.command(time, "right" if time < mid else "left", y)

        times = t + (stop - t) * _POINTS
        positive = np.flatnonzero([asked(time) > 0.0 for time in times])
        starts = positive.size > 0
        if starts:
            i = max(int(positive[0]), 1)
            stop = float(brentq(asked, times[i - 1], times[i], xtol=1e-15)) if positive[0] > 0 else t
        if stop > t:
            self.track.add(t, stop, np.repeat([[y[0]], [0.0], [0.0]], _POINTS.size, axis=1))
        return stop, starts

    def _move(self, t: float, stop: float, y: Array, watch: bool) -> tuple[float, Array, str | None]:
        """Integrate from `t` to `stop` or the first event: the time, the state and the event."""
        mid, lag = 0.5 * (t + stop), self.vehicle.lag

        def command(time: float, y: Array) -> float:
            return self.command(time, "right" if time < mid else "left", y)

        def acceleration(time: float, y: Array) -> float:
            return y[2] if lag else min(max(command(time, y), self.low), self.high)

        def rate(time: float, y: Array) -> list[float]:
            jerk = (min(max(command(time, y), self.low), self.high) - y[2]) / lag if lag else 0.0
            return [y[1], acceleration(time, y), jerk]

        watched: list[tuple[str, Callable[[float, Array], float], float]] = [
            ("gap", lambda time, y: self.ahead.at(time, "left")[0] - self.length - y[0], -1.0),
            ("stop", lambda time, y: y[1], -1.0),
        ]
        if math.isfinite(self.low):
            watched.append(("limit", lambda time, y: command(time, y) - self.low, 0.0))
            watched.append(("limit", lambda time, y: command(time, y) - self.high, 0.0))

        def solve(stop: float, events: list[Any]) -> Any:
            solution: Any = solve_ivp(
                rate, (t, stop), y, method="DOP853", rtol=_TOLERANCE, atol=_TOLERANCE, first_step=stop - t,
                dense_output=True, events=events,
            )  # fmt: skip
            assert solution.status >= 0, solution.message
            return solution

        solution, event = solve(stop, [_terminal(g, direction) for _, g, direction in watched] if watch else []), None
        reached = float(solution.t[-1])
        if solution.status == 1:
            event = next(name for (name, *_), hits in zip(watched, solution.t_events, strict=True) if hits.size)
            # the step that found the event went beyond it, where the law may have a kink: make it anew up to there
            solution = solve(reached, []) if reached > t else solution
        if reached > t:
            times = t + (reached - t) * _POINTS
            states = solution.sol(times)
            states[:, 0], states[:, -1] = y, solution.y[:, -1]
            accelerations = [acceleration(time, states[:, i]) for i, time in enumerate(times)]
            self.track.add(t, reached, np.array([states[0], states[1], accelerations]))
        return reached, solution.y[:, -1].copy(), event

    def command(self, t: float, side: str, y: Array) -> float:
        """What the law asks for at `t`, before limits, in the state `y` (position, speed, acceleration)."""
        now = (float(y[0]), float(y[1]), float(y[2]))
        others = dict(self._others())

        def look(source: Source) -> float:
            if source.whose == OWN:
                motion = self.track.at(t - source.delay, side) if source.delay > 0.0 else now
            else:
                motion = others[source.whose].at(t - source.delay, side)
            return motion[source.signal.order]

        def perceive(name: str) -> float:
            first, second = self.perception.halves(name)
            value = look(first) - self.length if first.signal.order == 0 else look(first)
            return value if first.signal.less is None else value - look(second)

        seen = [perceive(name) for name in self.signals]
        if self.vehicle.lag > 0.0 or not self.perception.at_once("a"):
            return float(self.law(*seen, **self.parameters))
        # own acceleration is what the law returns, and the law is affine in it
        i = self.signals.index("a")
        f0, f1 = (float(self.law(*seen[:i], a, *seen[i + 1 :], **self.parameters)) for a in (0.0, 1.0))
        return f0 / (1.0 - (f1 - f0))


def _terminal(g: Callable[[float, Array], float], direction: float) -> Callable[[float, Array], float]:
    """An event function of SciPy that ends the integration."""

    def event(time: float, y: Array) -> float:
        return g(time, y)

    event.terminal, event.direction = True, direction  # type: ignore[attr-defined]  # how scipy is told
    return event
