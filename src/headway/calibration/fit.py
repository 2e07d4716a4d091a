"""`calibrate`: the parameters, delay and lag with which a law follows a recorded vehicle best."""

from __future__ import annotations

import functools
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from headway.arrays import Array
from headway.calibration.baselines import Errors, errors_on
from headway.calibration.loop import OBJECTIVES, PENALTY, Loop
from headway.calibration.search import search
from headway.calibration.segments import Segment, Window, cut
from headway.calibration.space import Space
from headway.calibration.uncertainty import Profile, bootstrap, profiles
from headway.checked import typed
from headway.data.readers import read
from headway.data.recording import Recording
from headway.errors import HeadwayError, unknown_name
from headway.models import Law, Model
from headway.scenario.vehicle import Vehicle

__all__ = ["Fit", "calibrate"]

Source = Recording | str | os.PathLike[str]

#: samples needed per fitted quantity
_SAMPLES = 20


@dataclass(frozen=True, eq=False)
class Fit:
    """A calibrated vehicle and what the record says about it; made by `calibrate`. p fitted quantities, R refits.

    Attributes:
        vehicle: ready for a scenario.
        follower: number of the recorded vehicle.
        objective: "gap" or "gap+speed".
        value: the least objective [1].
        values: fitted quantities by name, SI.
        intervals: their 95 % intervals from the refits, by name.
        refits: (p, R) values of the bootstrap.
        seeds: (p, seeds) values by seed, best first.
        objectives: (seeds,) their objectives [1].
        profiles: one for each quantity.
        train: errors in training, by recording.
        test: errors on other stretches, by recording.
        blocks: length of the blocks of the bootstrap [s].
        notes: what a reader must know, in sentences.
        evaluations: how many candidates were driven.
        seconds: how long it took [s].
        space: the quantities and their bounds.
        segments: stretches of training.
        test_segments: stretches of testing.
    """

    vehicle: Vehicle
    follower: int
    objective: str
    value: float
    values: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    refits: Array
    seeds: Array
    objectives: Array
    profiles: tuple[Profile, ...]
    train: tuple[Errors, ...]
    test: tuple[Errors, ...]
    blocks: float
    notes: tuple[str, ...]
    evaluations: int
    seconds: float
    space: Space
    segments: tuple[Segment, ...]
    test_segments: tuple[Segment, ...]

    @property
    def spread(self) -> dict[str, float]:
        """Largest less least value over the seeds whose objective is within 1 % of the best."""
        near = self.seeds[:, self.objectives <= 1.01 * self.value]
        return {n: float(np.ptp(row)) for n, row in zip(self.values, near, strict=True)}

    @property
    def agreeing(self) -> int:
        """How many seeds came within 1 % of the best objective."""
        return int(np.sum(self.objectives <= 1.01 * self.value))

    @property
    def unidentified(self) -> dict[str, str]:
        """Quantities that the record does not bound on both sides, with what it says of them."""
        return {p.name: p.words for p in self.profiles if not p.identified}

    @property
    def draws(self) -> list[Vehicle]:
        """The vehicles of the refits: as likely as the fitted one."""
        return [self.space.make(column) for column in self.refits.T]

    @property
    def speeds(self) -> tuple[float, float, float]:
        """Least, mean and largest recorded speed [m/s] of the vehicle in training."""
        own = np.concatenate([s.speed for s in self.segments])
        return float(np.nanmin(own)), float(np.nanmean(own)), float(np.nanmax(own))

    @property
    def gap(self) -> float:
        """Mean recorded gap [m] in training."""
        return float(np.nanmean(np.concatenate([s.gap for s in self.segments])))

    def path(self, segments: Sequence[Segment]) -> list[tuple[Array, Array]]:
        """The fitted vehicle driven along segments.

        Args:
            segments: stretches of recordings.

        Returns:
            Gaps [m] and speeds [m/s], (n,) each, at the samples of each segment.
        """
        loop = Loop(self.space, segments, self.objective)
        at = self.space.unit(np.array(list(self.values.values()))[:, None])
        path = loop.paths(at)[0][:, :, 0]
        return [(path[0, part], path[1, part]) for part in loop.parts_of]

    @functools.cached_property
    def residuals(self) -> list[tuple[Array, Array, Array]]:
        """Time [s of the recording], gap error [m], speed error [m/s] of each training segment; NaN where missing."""
        return [
            (s.begin + s.time, gap - s.gap, speed - s.speed)
            for s, (gap, speed) in zip(self.segments, self.path(self.segments), strict=True)
        ]

    def report(self) -> str:
        """The fit as text; see `headway.calibration.report`."""
        from headway.calibration.report import report

        return report(self)

    __str__ = report

    def __repr__(self) -> str:
        values = ", ".join(f"{n}={x:.4g}" for n, x in self.values.items())
        of = f"{self.vehicle.model.name} to vehicle {self.follower}"
        return f"<fit of {of}: {values}; {self.objective} {self.value:.4g}>"

    def _repr_html_(self) -> str:
        """The fit in a notebook."""
        from headway.calibration.report import fit_html

        return fit_html(self)

    def to_toml(self) -> str:
        """The fit as TOML whose `followers` a scenario accepts."""
        from headway.calibration.document import fits_toml

        return fits_toml([self])

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write `to_toml` to a file that ends in .toml; returns its path."""
        from headway.calibration.document import save_fits

        return save_fits([self], path)


@typed
def calibrate(
    model: Vehicle | Model | Law,
    recording: Source | Sequence[Source],
    vehicle: int = 1,
    *,
    fit: Sequence[str] | None = None,
    objective: str = "gap",
    bounds: Mapping[str, tuple[float, float]] | None = None,
    train: Window | Sequence[Window] | None = None,
    test: Any = None,
    seeds: int = 5,
    seed: int = 0,
    refits: int = 100,
) -> Fit:
    """Fit a law to a follower of one or more recordings, in closed loop behind the recorded vehicle ahead.

    The initial state of each stretch is the recorded one. A candidate that collides gets a large finite objective.

    Args:
        model: a law, a model or a vehicle; what is not fitted keeps its value, and a pattern of late signals is scaled.
        recording: a `Recording` or a file, or several runs that are fitted together.
        vehicle: number of the follower, from 1.
        fit: names of parameters, "delay" and "lag" [s]; None takes all parameters that are not structural, and the
            delay.
        objective: "gap" minimises sqrt(mean e²)/sqrt(mean gap²); "gap+speed" adds that ratio of the speed.
        bounds: name → (low, high) [SI] instead of the law's own; delays are sought in 0 to 3 s, lags in 0 to 2 s.
        train: windows (start, end) [s of the recording]; all of it if None.
        test: windows of the same recordings, or other recordings; what training leaves, if None.
        seeds: searches that start differently, 1 to 10000; their spread is reported.
        seed: the first of their seeds.
        refits: refits of the bootstrap, 1 to 10000.

    Raises:
        HeadwayError: where the recording cannot serve (see `headway.calibration.segments.cut`), for unknown names, and
            where every candidate collides.

    Source: Punzo and Montanino, Transp. Res. B 91 (2016) 21-33; Treiber and Kesting, Traffic Flow Dynamics, ch. 16.
    """
    begin = time.perf_counter()
    if objective not in OBJECTIVES:
        raise unknown_name("objective", objective, OBJECTIVES)
    for name, number in (("seeds", seeds), ("refits", refits)):
        if isinstance(number, bool) or not isinstance(number, int) or not 1 <= number <= 10_000:
            raise HeadwayError(f"{name} = {number!r} is not a whole number from 1 to 10000")
    space = Space.of(model, fit, bounds)
    several: Sequence[Any] = recording if isinstance(recording, list | tuple) else [recording]
    recordings = [opened(r) for r in several]
    windows = windows_of(train)
    notes: list[str] = []
    segments: list[Segment] = []
    for record in recordings:
        pieces, remarks = cut(record, vehicle, windows)
        segments += pieces
        notes += remarks
    loop = Loop(space, segments, objective)
    if loop.counts[0] < _SAMPLES * len(space.names):
        raise HeadwayError(
            f"{recordings[0].source}: {int(loop.counts[0])} samples of the gap are too few to tell {len(space.names)} "
            f"quantities apart; fit at most {int(loop.counts[0]) // _SAMPLES} (fit), or add runs"
        )
    at, reached = search(loop, seeds, seed)
    if reached[0] >= PENALTY:
        raise HeadwayError(
            f"every candidate of {space.vehicle.model.name} collides behind vehicle {vehicle - 1} of "
            f"{recordings[0].source}; widen the bounds, fit more quantities, or train on a calmer window"
        )
    best = at[:, 0]
    drawn, blocks = bootstrap(loop, best, refits, seed)
    curves = profiles(loop, best, float(reached[0]), drawn)
    values = space.values(best)
    car = space.make(values)
    others = _test_segments(recordings, vehicle, windows, test, notes)
    drawn_values = space.values(drawn)
    low, high = np.quantile(drawn_values, (0.025, 0.975), axis=1)
    notes += _about(car, segments)
    return Fit(
        vehicle=_long(car, recordings[0], vehicle), follower=int(vehicle), objective=objective, value=float(reached[0]),
        values=dict(zip(space.names, map(float, values), strict=True)),
        intervals={n: (float(a), float(b)) for n, a, b in zip(space.names, low, high, strict=True)},
        refits=drawn_values, seeds=space.values(at), objectives=reached, profiles=curves,
        train=_errors(segments, space, best), test=_errors(others, space, best), blocks=blocks,
        notes=tuple(dict.fromkeys(notes)), evaluations=loop.evaluations, seconds=time.perf_counter() - begin,
        space=space, segments=tuple(segments), test_segments=tuple(others),
    )  # fmt: skip


def opened(source: Source) -> Recording:
    """A recording, read if it is a file."""
    return source if isinstance(source, Recording) else read(source)


def windows_of(train: Any) -> list[Window]:
    """Windows from one (start, end) or several; none for None.

    Args:
        train: one pair of times [s], a list of pairs, or None.

    Raises:
        HeadwayError: for anything else.
    """
    if train is None:
        return []
    try:
        pairs = [train] if np.ndim(train[0]) == 0 else list(train)
        return [(float(a), float(b)) for a, b in pairs]
    except (TypeError, ValueError, IndexError):
        raise HeadwayError(f"window {train!r}: write (start, end) in seconds, or a list of such") from None


def _test_segments(
    recordings: Sequence[Recording], vehicle: int, windows: list[Window], test: Any, notes: list[str]
) -> list[Segment]:
    """Stretches to be tested on; a rest that is too short is left out, with a note."""
    if test is None:
        pairs = [(r, _rest(r, windows)) for r in recordings] if windows else []
        explicit = False
    else:
        several = isinstance(test, list | tuple) and not (
            len(test) == 2 and all(np.ndim(x) == 0 and not isinstance(x, str | os.PathLike | Recording) for x in test)
        )
        items = list(test) if several else [test]
        pairs, own = [], []
        for item in items:
            if isinstance(item, Recording | str | os.PathLike):
                pairs.append((opened(item), []))
            else:
                own += windows_of(item)
        pairs += [(r, own) for r in recordings] if own else []
        explicit = True
    segments: list[Segment] = []
    for record, parts in pairs:
        if not parts and not explicit:
            continue
        try:
            segments += cut(record, vehicle, parts, testing=True)[0]
        except HeadwayError as error:
            if explicit:
                raise
            notes.append(f"No test on the rest of the record: {error}.")
    return segments


def _rest(record: Recording, windows: list[Window]) -> list[Window]:
    """What the windows leave of a recording, pieces of ten seconds and more."""
    edges = [float(record.time[0]), *(x for w in sorted(windows) for x in w), float(record.time[-1])]
    gaps = list(zip(edges[::2], edges[1::2], strict=True))
    return [(a, b) for a, b in gaps if b - a >= 10.0]


def _errors(segments: Sequence[Segment], space: Space, best: Array) -> tuple[Errors, ...]:
    """Errors on the stretches of each recording."""
    sources = dict.fromkeys(s.source for s in segments)
    return tuple(errors_on([s for s in segments if s.source == name], space, best) for name in sources)


def _about(car: Vehicle, segments: Sequence[Segment]) -> list[str]:
    """Sentences on what the fitted law cannot do with the record."""
    if car.model.rests_everywhere:
        return [f"{car.model.name} rests at every gap, so it never corrects one: errors of the initial gap stay."]
    speeds = np.concatenate([s.speed for s in segments])
    low, high = float(np.nanmin(speeds)), float(np.nanmax(speeds))
    missing = []
    for speed in (low, high):
        try:
            car.model.equilibrium_gap(speed)
        except HeadwayError as error:
            missing.append(str(error))
    return [
        f"The record drives {low:.3g} to {high:.3g} m/s and the fitted law does not rest at all of them: {m}."
        for m in missing
    ]


def _long(car: Vehicle, record: Recording, vehicle: int) -> Vehicle:
    import dataclasses

    return dataclasses.replace(car, length=record.lengths[vehicle])
