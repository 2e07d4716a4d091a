"""A scenario: who follows whom, what disturbs them, for how long. Frozen, hashable, readable."""

from __future__ import annotations

import functools
import hashlib
import itertools
import json
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator

from headway.errors import HeadwayError, shorten
from headway.html import block, paragraph, table
from headway.limits import check_size
from headway.models.signal import OWN
from headway.scenario.leaders import Disturbance
from headway.scenario.motion import Motion
from headway.scenario.validation import Described, Finite, NonNegative, Positive, described, spec, unit
from headway.scenario.vehicle import Vehicle

__all__ = ["MOST_SAMPLES", "Scenario"]


def _leader(value: Any) -> Any:
    if not isinstance(value, Disturbance):
        raise HeadwayError(f"scenario.leader = {shorten(value)} is not a leader; make one, e.g. headway.sine(...)")
    return value


def _followers(value: Any) -> Any:
    if isinstance(value, Vehicle):
        value = (value,)
    if not isinstance(value, list | tuple) or not value:
        raise HeadwayError(f"scenario.followers = {shorten(value)} is not a list of one or more vehicles")
    for i, vehicle in enumerate(value):
        if not isinstance(vehicle, Vehicle):
            raise HeadwayError(f"scenario.followers.{i} = {shorten(vehicle)} is not a Vehicle")
    return tuple(value)


def _by_vehicle(value: Any) -> Any:
    """Offsets by vehicle number, as sorted pairs; keys may be text, as they are in TOML."""
    try:
        pairs = dict(value) if isinstance(value, Mapping | tuple) else None
    except (TypeError, ValueError):
        pairs = None
    if pairs is None:
        raise HeadwayError(f"offsets = {shorten(value)} must map a vehicle number to a number, e.g. {{2: -3.0}}")
    try:
        if any(isinstance(k, float | bool) or len(str(k)) > 9 for k in pairs):
            raise ValueError
        return tuple(sorted((int(k), v) for k, v in pairs.items()))
    except (TypeError, ValueError, OverflowError):
        raise HeadwayError(f"offsets: {shorten(list(pairs))} are not all vehicle numbers") from None


def _gaps(value: Any) -> Any:
    if not isinstance(value, list | tuple | np.ndarray):
        return value
    gaps = tuple(value)
    for n, gap in enumerate(gaps, start=1):
        if not isinstance(gap, int | float | np.number) or isinstance(gap, bool) or not gap > 0:
            raise HeadwayError(f"scenario.gaps: follower {n} has {shorten(gap)}; a gap is a number greater than 0")
    return gaps


Offsets = Annotated[tuple[tuple[int, Finite], ...], BeforeValidator(_by_vehicle)]


#: longest step [s] where a scenario gives none
_STEP = 0.01

#: a run without `output_step` keeps every step, thinned to at most this many steps
MOST_SAMPLES = 10_000


@spec
class Scenario(metaclass=Described):
    """A platoon behind a leader.

    Followers start in their model's exact equilibrium at `initial_speed` with constant history,
    unless `gaps` says otherwise; offsets are then added to the initial gap or speed of single
    vehicles (Type I disturbances). Before t = 0 every signal has its value at t = 0.
    """

    leader: Annotated[Any, BeforeValidator(_leader)]
    followers: Annotated[Any, BeforeValidator(_followers)]
    duration: Annotated[Positive | None, unit("s", "simulated time; the leader's own length if it has one")] = None
    dt: Annotated[Positive | None, unit("s", "longest step; 0.01 s if not given")] = None
    output_step: Annotated[
        Positive | None, unit("s", "distance of the results; every step, thinned to at most 10001, if not given")
    ] = None
    scheme: Literal["rk4", "ballistic"] = "rk4"
    seed: Annotated[int, unit("", "seed of everything random")] = 0
    initial_speed: Annotated[
        NonNegative | None, unit("m/s", "speed of the platoon until t = 0; the leader's if not given")
    ] = None
    gaps: Annotated[
        Positive | tuple[Positive, ...] | None,
        BeforeValidator(_gaps),
        unit("m", "initial gap of every follower, or one for each, instead of the equilibrium"),
    ] = None
    gap_offsets: Annotated[Offsets, unit("m", "added to the initial gap, by vehicle number")] = ()
    speed_offsets: Annotated[Offsets, unit("m/s", "added to the initial speed, by vehicle number")] = ()
    leader_length: Annotated[NonNegative, unit("m", "length of the leader")] = 5.0
    name: Annotated[str, unit("", "a short name")] = ""
    description: Annotated[str, unit("", "what it shows")] = ""

    def __post_init__(self) -> None:
        count = len(self.followers)
        span = self.leader.span
        if self.duration is None and span is None:
            raise HeadwayError(f"scenario.duration is missing; a {self.leader.kind} leader has no end of its own")
        if span is not None and self.end > span + 1e-9:
            raise HeadwayError(
                f"scenario.duration = {self.end:g} s is longer than the leader, which ends at {span:g} s"
            )
        if self.dt is not None and self.dt > self.end:
            raise HeadwayError(f"scenario.dt = {self.dt:g} s is longer than the duration, {self.end:g} s")
        self._check_size()
        for number, vehicle in enumerate(self.followers, 1):
            # an explicit step longer than this makes the actuator's own decay grow
            if 0.0 < vehicle.lag < self.step / 2.0:
                raise HeadwayError(
                    f"follower {number}: lag = {vehicle.lag:g} s is too short for steps of {self.step:g} s; "
                    f"write dt = {2.0 * vehicle.lag:g} or less, or lag = 0"
                )
        if self.output_step is not None and self.output_step > self.end:
            raise HeadwayError(
                f"scenario.output_step = {self.output_step:g} s is longer than the duration, {self.end:g} s"
            )
        if not 0 <= self.seed < 2**63:  # the largest that TOML and NetCDF can hold
            raise HeadwayError(f"scenario.seed = {self.seed} is not allowed; it is a whole number from 0 to 2^63 - 1")
        if isinstance(self.gaps, tuple) and len(self.gaps) != count:
            raise HeadwayError(f"scenario.gaps has {len(self.gaps)} values for {count} followers")
        for field, offsets, first in (("gap_offsets", self.gap_offsets, 1), ("speed_offsets", self.speed_offsets, 1)):
            for vehicle, _ in offsets:
                if not first <= vehicle <= count:
                    raise HeadwayError(
                        f"scenario.{field}: there is no follower {vehicle}; allowed are {first} to {count}"
                        + (" (for the leader give initial_speed)" if vehicle == 0 else "")
                    )
        time, speed = self.motion.lowest_speed(self.end)
        if speed < -1e-9:
            raise HeadwayError(
                f"leader: this {self.leader.kind} would drive backwards, {speed:.3g} m/s at t = {time:.4g} s; "
                "reduce its amplitude or raise its mean"
            )
        self.initial_gaps()

    def _check_size(self) -> None:
        """Refuse what would need more time or memory than anybody means, before anything is allocated."""
        steps, count = self.end / self.step, len(self.followers)
        run = f"scenario: {self.end:g} s in steps of {self.step:g} s"
        check_size(run, steps, "steps")
        check_size(f"{run} with {count} followers", steps * count, "steps of vehicles")
        kept = min(steps, MOST_SAMPLES) if self.output_step is None else self.end / self.output_step
        out = "" if self.output_step is None else f" and output_step = {self.output_step:g} s"
        check_size(f"scenario: {count} followers{out}", kept * (count + 1), "kept values")
        for number, vehicle in enumerate(self.followers, 1):
            # each jump of its own acceleration comes back to it after this delay, again and again
            for source in vehicle.perception.sources:
                if source.whose > number:
                    raise HeadwayError(
                        f"follower {number}: {vehicle.model.name} perceives {source.signal.name} of the vehicle "
                        f"{source.whose} ahead, and there are {number}"
                    )
                if source.whose == OWN and source.signal.order == 2 and source.delay > 0.0:
                    late = f"follower {number}: delay {source.delay:g} s of its own acceleration"
                    check_size(late, self.end / source.delay, "echoes of an acceleration")

    @property
    def end(self) -> float:
        """Simulated time [s]."""
        return float(self.leader.span if self.duration is None else self.duration)

    @property
    def step(self) -> float:
        """Longest step [s] of the integration."""
        return _STEP if self.dt is None else self.dt

    @functools.cached_property
    def motion(self) -> Motion:
        """Exact motion of the leader."""
        return self.leader.motion(self.seed, self.end)

    @property
    def cruise(self) -> float:
        """Speed [m/s] of the platoon before t = 0."""
        return self.motion.before if self.initial_speed is None else self.initial_speed

    def initial_gaps(self) -> tuple[float, ...]:
        """Gap [m] of each follower at t = 0."""
        speed, offsets = self.cruise, dict(self.gap_offsets)
        known: dict[Any, float] = {}
        gaps = []
        for n, vehicle in enumerate(self.followers, start=1):
            if self.gaps is None:
                if vehicle.model not in known:
                    known[vehicle.model] = _equilibrium(vehicle, n, speed)
                gap = known[vehicle.model]
            else:
                gap = self.gaps[n - 1] if isinstance(self.gaps, tuple) else self.gaps
            gap += offsets.get(n, 0.0)
            if gap <= 0:
                raise HeadwayError(f"follower {n} would start with a gap of {gap:g} m; it must be positive")
            gaps.append(float(gap))
        return tuple(gaps)

    def initial_speeds(self) -> tuple[float, ...]:
        """Speed [m/s] of each follower at t = 0."""
        offsets = dict(self.speed_offsets)
        speeds = tuple(self.cruise + offsets.get(n, 0.0) for n in range(1, len(self.followers) + 1))
        for n, speed in enumerate(speeds, start=1):
            if speed < 0:
                raise HeadwayError(f"follower {n} would start with {speed:g} m/s; vehicles drive forwards")
        return speeds

    @property
    def hash(self) -> str:
        """SHA-256 of everything that determines the result: all fields, a recording's samples, a law's own code."""
        from headway.scenario.document import to_table

        table = to_table(self, complete=True)
        for text in ("name", "description"):
            table.pop(text, None)
        if hasattr(self.leader, "digest"):
            table["leader"]["samples"] = self.leader.digest
            table["leader"].pop("file", None)
        return hashlib.sha256(json.dumps(table, sort_keys=True).encode()).hexdigest()

    def to_toml(self) -> str:
        """The scenario as a TOML text from which `headway.load` makes an equal one."""
        from headway.scenario.document import to_toml

        return to_toml(self)

    def _repr_html_(self) -> str:
        leader = self.leader
        return block(
            paragraph(": ".join(text for text in (self.name, self.description) if text)),
            table(f"Leader: {leader.kind}", _FIELDS, [_field(*row) for row in described(leader)]),
            table(f"Followers: {len(self.followers)}, front to back", _COLUMNS, _rows(self)),
            table("Run", _FIELDS, _run(self)),
        )


def _equilibrium(vehicle: Vehicle, n: int, speed: float) -> float:
    try:
        gap = vehicle.model.equilibrium_gap(speed)
    except HeadwayError as error:
        raise HeadwayError(f"follower {n} cannot start in equilibrium: {error}") from None
    if gap <= 0:
        raise HeadwayError(f"follower {n}: the equilibrium gap of {vehicle.model.name} at {speed:g} m/s is {gap:g} m")
    return gap


#: columns of the tables by which a scenario shows itself in a notebook
_FIELDS = ("field", "value", "unit", "meaning")
_COLUMNS = ("no.", "model", "parameters (SI)", "delay [s]", "lag [s]", "length [m]", "limits [m/s²]", "first gap [m]")


def _field(name: str, value: Any, unit: str, meaning: str) -> tuple[str, object, str, str]:
    if isinstance(value, tuple) and all(isinstance(pair, tuple) for pair in value):
        value = ", ".join(f"{key}: {entry}" for key, entry in value)
    return name, value if isinstance(value, float | int | str) else shorten(value), unit, meaning


def _rows(scenario: Scenario) -> list[tuple[object, ...]]:
    """A row for each run of equal vehicles that start with the same gap."""
    rows: list[tuple[object, ...]] = []
    numbered = enumerate(zip(scenario.followers, scenario.initial_gaps(), strict=True), start=1)
    for (vehicle, gap), run in itertools.groupby(numbered, key=lambda entry: entry[1]):
        numbers = [number for number, _ in run]
        who = f"{numbers[0]}" if len(numbers) == 1 else f"{numbers[0]} to {numbers[-1]}"
        rows.append((who, *_vehicle(vehicle), gap))
    return rows


def _vehicle(vehicle: Vehicle) -> tuple[object, ...]:
    parameters = ", ".join(f"{name} = {value:g}" for name, value in vehicle.model.parameters.items())
    delay = vehicle.delay
    late = f"{delay:g}" if isinstance(delay, float) else ", ".join(f"{name} {time:g}" for name, time in delay)
    limits = "none" if vehicle.limits is None else f"{vehicle.limits[0]:g} to {vehicle.limits[1]:g}"
    return vehicle.model.name, parameters, late, vehicle.lag, vehicle.length, limits


def _run(scenario: Scenario) -> list[tuple[str, object, str, str]]:
    """Fields that differ from their defaults; the duration and the speed before t = 0 always."""
    known = {"duration": scenario.end, "initial_speed": scenario.cruise}
    skip = ("leader", "followers", "name", "description")
    rows = [(n, known.get(n, value), u, m) for n, value, u, m in described(scenario, every=True) if n not in skip]
    changed = {row[0] for row in described(scenario)}
    return [_field(*row) for row in rows if row[0] in known or row[0] in changed]
