"""`Study`: a scenario, axes over any of its fields, and what comes of all points."""

from __future__ import annotations

import functools
import hashlib
import json
import math
import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from headway.checked import typed
from headway.errors import HeadwayError, HeadwayWarning, shorten
from headway.limits import check_size
from headway.metrics.registry import Metric, chosen
from headway.metrics.sizes import COLLISION, DEFAULT
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle
from headway.study.axes import HUGE, Design, Points, points
from headway.study.blocks import own_value
from headway.study.executors import Task, workforce
from headway.study.paths import Target, resolve
from headway.study.results import assembled
from headway.study.store import Store
from headway.study.templates import TemplateTable
from headway.study.verdicts import VERDICTS, TheoryJob
from headway.study.work import PENDING, Job, Worker, batch_size
from headway.version import __version__

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Study", "open_study"]

#: seconds of one core that a piece is to take, and those of one follower and step, about
_PIECE_TIME, _STEP_TIME = 0.4, 7e-9

#: most points of a piece, of one whose trajectories are measured, and of one that is run point by point
_MOST, _MOST_WHOLE, _MOST_OWN = 16_384, 2048, 64

#: raised where stores are laid out or numbers are computed otherwise
_FORMAT = 2

#: a piece is at most this part of a study, so that there is something to share out
_PARTS = 16


@dataclass(frozen=True, eq=False)
class Study:
    """A scenario and axes over any of its fields.

    axes: mapping from the path of a field to its values. A path is that of `--set` in a scenario
        file (`leader.amplitude`, `followers.0.parameters.T`, `seed`), or short for all followers:
        `T` for a parameter, `delay` (of all that is measured on board, the radio current: what
        `Vehicle(delay=x)` means), `radio_delay` (of all that is heard by radio, the rest as it is),
        `delay.vl` (of one signal), `lag`. `order` is the order of vehicles, front to back (numbers
        from 1, or the seed of a random order; `original_vehicle` in the dataset says who stands
        where); `share.<type>` the share of followers of a type (one of `types`, or the name of a
        model in the scenario), at places drawn by the scenario's seed. Values are a list or
        `between(low, high, count)`. A key of several paths, `("T", "a")` or `"T+a"`, has one list
        for each, which are zipped.
    design: `"grid"`, `"zip"`, or `count` points drawn by `"sobol"`, `"latin"` or `"random"` with `seed`.
    types: vehicles by name, for `share` and for axes such as `types.truck.parameters.T`.

    Raises `HeadwayError` for axes that name nothing or do not fit together. Points at which a value
    is not allowed are marked when the study runs.
    """

    scenario: Scenario
    axes: Mapping[Any, Any]
    design: Design = "grid"
    count: int | None = None
    seed: int = 0
    types: Mapping[str, Vehicle] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.scenario, Scenario):
            raise HeadwayError(f"study: {shorten(self.scenario)} is not a Scenario")
        if not isinstance(self.types, Mapping):
            raise HeadwayError(f"study: types = {shorten(self.types)} is not a mapping from a name to a Vehicle")
        if isinstance(self.seed, bool) or not isinstance(self.seed, int | np.integer) or self.seed < 0:
            raise HeadwayError(f"study: seed = {shorten(self.seed)} is not a whole number of 0 or more")
        for name, vehicle in self.types.items():
            if not isinstance(name, str):
                raise HeadwayError(f"study: types has {shorten(name)}, which is not a name")
            if not isinstance(vehicle, Vehicle):
                raise HeadwayError(f"study: types.{name} = {shorten(vehicle)} is not a Vehicle")
        _ = self.points, self._fields

    @functools.cached_property
    def points(self) -> Points:
        """The points: dimensions, and values of each path along them."""
        return points(self.axes, self.design, self.count, self.seed)

    @functools.cached_property
    def _table(self) -> TemplateTable:
        return TemplateTable(self.scenario, self.types)

    @functools.cached_property
    def _fields(self) -> tuple[tuple[str, tuple[Target, ...]], ...]:
        table = self._table
        free = any(path.split(".")[-1] in ("model", "kind") for path in self.points.values)
        fields = [(p, resolve(p, table.table, table.laws, free)) for p in self.points.values]
        for path, targets in fields:
            rivals = {t for other, ts in fields if other != path and len(ts) <= len(targets) for t in ts}
            if rivals.issuperset(targets):
                raise HeadwayError(f"axes.{path} would vary nothing: all its fields are those of other axes")
        # what is of all before what is of one, which has the last word
        return tuple(sorted(fields, key=lambda entry: -len(entry[1])))

    # -- single points ---------------------------------------------------------------------------

    @typed
    def scenario_at(self, point: int) -> Scenario:
        """The scenario of a point, counted from 0 with the last dimension fastest; `HeadwayError` if not allowed."""
        self._check_point(point)
        return Worker(self._job(())).scenario(self.points.take(np.array([point])), 0)

    @typed
    def trajectories(self, keep: Iterable[int]) -> xr.Dataset:
        """Trajectories of some points, with the dimensions (kept, vehicle, time)."""
        import xarray as xr

        from headway.engine.simulate import simulate

        numbers = [int(k) for k in keep]
        parts = [simulate(self.scenario_at(k)).drop_vars(("model", "length")) for k in numbers]
        together = xr.concat(parts, dim="kept", join="outer", combine_attrs="drop")
        return together.assign_coords(kept=("kept", numbers, {"long_name": "number of the point"}))

    def _check_point(self, point: int) -> None:
        if not 0 <= point < self.points.count:
            raise HeadwayError(f"point {point} does not exist; there are points 0 to {self.points.count - 1}")

    # -- running ---------------------------------------------------------------------------------

    @typed
    def run(
        self,
        metrics: str | Iterable[Any] | None = None,
        executor: Any = "threads",
        *,
        shard: tuple[int, int] | None = None,
        store: str | os.PathLike[str] | None = None,
        resume: bool = True,
        chunk: int | None = None,
        keep: Iterable[int] = (),
        progress: Callable[[int, int], Any] | None = None,
    ) -> xr.Dataset:
        """Simulate all points; a dataset with the axes as dimensions (or `point`, for designs).

        metrics: names such as `peak_spacing_error`, `ttc` or `tet(threshold=4)` (docs/metrics.md lists them all),
            or functions of a dataset of trajectories; those of `headway run` if None.
        executor: `"threads"` (one for each core), `"serial"`, `"processes"`, `"dask://host:port"`, a
            `distributed.Client` or any `concurrent.futures.Executor`. All give the same bits.
        shard: (i, n), do the i-th of n parts (from 1) of the pieces, into a shared `store`.
        store: path of a Zarr store that is written piece by piece; a study that was killed goes on
            there, unless `resume` is off.
        chunk: points of a piece; chosen by time and memory if None. It changes no bits.
        keep: numbers of points whose trajectories are kept too, over (kept, vehicle, time).
        progress: called as progress(points done, points to do) after every piece.

        Each point has a `status` (ok, collision, invalid, failed, or pending) and a `message`. Raises
        `HeadwayError` for a store of another study, a disk that is full, an executor that cannot be had.
        """
        selection = chosen(metrics, DEFAULT)
        job = self._job(selection)
        if shard is not None:
            _check_shard(shard, store)
        numbers = list(keep)
        for point in numbers:
            self._check_point(point)
        size = self._piece_size(selection) if chunk is None else _whole(chunk)
        values, messages = self._perform(job, size, executor, shard, store, resume, progress)
        result = assembled(self.points, values, messages, _described(selection), self._attrs(), self._groups)
        if not numbers:
            return result
        runs = self.trajectories(numbers).drop_vars(COLLISION)
        return result.merge(runs, combine_attrs="override", join="outer")

    def stability(self, executor: Any = "threads", *, progress: Callable[[int, int], Any] | None = None) -> xr.Dataset:
        """The same points by exact theory, at the speed of the platoon before t = 0.

        A dataset with the same dimensions: `locally_stable`, `string_stable` (strictly, every
        vehicle) and `head_to_tail_stable` (1 or 0), `margin` [1/s²], `decay_rate` [1/s] and
        `head_to_tail_gain`. `executor` and `progress` as for `run`.
        """
        job = TheoryJob(
            self.scenario, tuple(self.types.items()), self._fields, (), tuple((n, False) for n in VERDICTS), 0
        )
        size = max(1, min(256, math.ceil(self.points.count / _PARTS)))
        values, messages = self._perform(job, size, executor, None, None, True, progress)
        return assembled(self.points, values, messages, VERDICTS, self._attrs())

    def _perform(
        self, job: Job, size: int, executor: Any, shard: tuple[int, int] | None,
        store: str | os.PathLike[str] | None, resume: bool, progress: Callable[[int, int], Any] | None,
    ) -> tuple[dict[str, np.ndarray], dict[int, str]]:  # fmt: skip
        """Do the pieces that are asked for and not done yet; values by metric and messages of all points."""
        count = self.points.count
        each = 1 + sum(job.vehicles if wide else 1 for _, wide in job.shapes)
        check_size(f"the study ({min(count, HUGE):.6g} points)", float(min(count, HUGE)) * each, "values of all points")
        if progress is not None and not callable(progress):
            raise HeadwayError(f"progress = {shorten(progress)} is not a function of points done and points to do")
        # who does the work is there before a store is made
        with workforce(job, executor) as perform:
            disk = None if store is None else Store.join(store, self._about(job, size), self.points.values, resume)
            if disk is not None:
                size = disk.about["chunk"]  # those who share a store cut alike
            mine = [n for n in range(-(-count // size)) if shard is None or n % shard[1] == shard[0] - 1]
            done = set() if disk is None else _intact(disk, mine)
            values = {} if disk else _empty(job, count)
            messages: dict[int, str] = {}
            sizes = {n: min(size, count - n * size) for n in mine}
            total, ready = sum(sizes.values()), sum(sizes[n] for n in mine if n in done)
            if progress is not None and ready:
                progress(ready, total)
            for number, piece in perform(self._tasks((n for n in mine if n not in done), size)):
                start = number * size
                if disk is not None:
                    disk.write(number, piece)
                else:
                    end = start + piece.status.size
                    values["status"][start:end] = piece.status
                    for name, array in piece.values.items():
                        values[name][start:end] = array
                    messages |= {start + i: text for i, text in piece.messages.items()}
                ready += sizes[number]
                if progress is not None:
                    progress(ready, total)
        if disk is None:
            return values, messages
        values, messages, damaged = disk.read()
        if damaged:
            warnings.warn(f"{_damage(disk, damaged)}, not done here and pending; resume the study", HeadwayWarning, 4)
        return values, messages

    def _tasks(self, numbers: Iterable[int], size: int) -> Iterator[Task]:
        for number in numbers:
            members = np.arange(number * size, min((number + 1) * size, self.points.count))
            yield Task(number, self.points.take(members), members.size)

    # -- what it is ------------------------------------------------------------------------------

    def _job(self, metrics: tuple[Metric, ...]) -> Job:
        shapes = []
        for metric in metrics:
            wide = metric.per == "vehicle"
            if metric.own:
                wide = bool(getattr(own_value(metric, self._example), "dims", ()))
            shapes.append((metric.name, wide))
        return Job(
            self.scenario, tuple(self.types.items()), self._fields, metrics, tuple(shapes), 1 + self._most_followers()
        )

    @functools.cached_property
    def _example(self) -> xr.Dataset:
        """Trajectories of the scenario itself, to see what a metric of one's own makes of them."""
        from headway.engine.simulate import simulate

        return simulate(self.scenario)

    @property
    def _groups(self) -> list[int]:
        """Followers of each table of the scenario."""
        return [t.get("count", 1) for t in self._table.table["followers"]]

    def _most_followers(self) -> int:
        """Most followers that a point has; `count` of a group may vary."""
        most = self._groups
        for path, targets in self._fields:
            for target in targets:
                if target[0] == "followers" and target[-1] == "count":
                    values = [v for v in self.points.values[path].tolist() if isinstance(v, int) and v >= 1]
                    most[int(target[1])] = max(values, default=1)
        return sum(most)

    def _piece_size(self, metrics: tuple[Metric, ...]) -> int:
        """Points of a piece, by time; it depends on the study alone."""
        scenario = self.scenario
        work = len(scenario.followers) * scenario.end / scenario.step * _STEP_TIME
        alone = any(m.own for m in metrics)
        most = _MOST if all(m.reduced is not None for m in metrics) else _MOST_OWN if alone else _MOST_WHOLE
        most = min(most, max(1, int(_PIECE_TIME / work)))
        size = max(1, min(most, math.ceil(self.points.count / _PARTS)))
        batch = batch_size(scenario)
        return size if size < batch else -(-size // batch) * batch

    @functools.cached_property
    def hash(self) -> str:
        """SHA-256 of what the study is: its scenario, its types, its points; not of what is measured."""
        digest = hashlib.sha256(self.scenario.hash.encode())
        for name, vehicle in sorted(self.types.items()):
            alone = Scenario(self.scenario.leader, [vehicle], duration=self.scenario.duration, gaps=1.0)
            digest.update(f"\n{name}\n{alone.hash}".encode())
        for path, values in self.points.values.items():
            digest.update(f"\n{path}\n{self.points.along[path]}\n".encode())
            digest.update(repr(values.tolist()).encode() if values.dtype == object else values.tobytes())
        return digest.hexdigest()

    def _about(self, job: Job, size: int) -> dict[str, Any]:
        """What a store says of its study; equal hashes give equal bits."""
        from headway.models.fingerprint import fingerprint

        own = [fingerprint(m.function) for m in job.metrics if m.own]
        names = dict(job.shapes)
        text = json.dumps([_FORMAT, self.hash, names, own, __version__])
        return {
            "hash": hashlib.sha256(text.encode()).hexdigest(),
            "title": self.scenario.name
            or f"{' × '.join(self.points.dims)} behind a {self.scenario.leader.kind} leader",
            "version": __version__,
            "points": self.points.count,
            "chunk": size,
            "vehicles": job.vehicles,
            "metrics": names,
            "groups": self._groups,
            "dims": self.points.dims,
            "along": self.points.along,
            "described": _described(job.metrics),
            "attrs": self._attrs(),
        }

    def _attrs(self) -> dict[str, Any]:
        return {
            "title": self.scenario.name or f"study behind a {self.scenario.leader.kind} leader",
            "scenario": self.scenario.to_toml(),
            "study_hash": self.hash,
            "design": self.design,
            "headway_version": __version__,
        }


@typed
def open_study(path: str | os.PathLike[str]) -> xr.Dataset:
    """What a store holds so far, as `Study.run` gives it; `HeadwayError` if it is not a store of a study."""
    store = Store.open(path)
    about = store.about
    values, messages, damaged = store.read()
    if damaged:
        raise HeadwayError(f"{_damage(store, damaged)}; run the study again with this store to compute them anew")
    grid = Points(about["dims"], about["along"], store.axes())
    described = {n: (unit, meaning) for n, (unit, meaning) in about["described"].items()}
    return assembled(grid, values, messages, described, about["attrs"], about["groups"])


def _intact(store: Store, numbers: Iterable[int]) -> set[int]:
    """Those of the pieces that are done; what is damaged is said and left to be done anew."""
    done = store.complete() & set(numbers)
    damaged = store.damaged(done)
    if damaged:
        warnings.warn(f"{_damage(store, damaged)}, now computed anew", HeadwayWarning, 5)
    return done - damaged


def _damage(store: Store, damaged: set[int]) -> str:
    some = ", ".join(map(str, sorted(damaged)[:5])) + (", …" if len(damaged) > 5 else "")
    return f"{store.path}: {len(damaged)} of {store.pieces} pieces damaged ({some})"


def _described(metrics: Iterable[Metric]) -> dict[str, tuple[str, str]]:
    """Units and meanings by name."""
    return {m.name: (m.unit, m.long_name) for m in metrics if not m.own}


def _empty(job: Job, count: int) -> dict[str, np.ndarray]:
    values = {n: np.full((count, job.vehicles) if wide else (count,), np.nan) for n, wide in job.shapes}
    return values | {"status": np.full(count, PENDING, dtype=np.int8)}


def _whole(chunk: Any) -> int:
    if isinstance(chunk, bool) or not isinstance(chunk, int) or chunk < 1:
        raise HeadwayError(f"chunk = {shorten(chunk)} is not a whole number of points, 1 or more")
    return chunk


def _check_shard(shard: Any, store: Any) -> None:
    try:
        i, n = (int(x) for x in shard)
    except (TypeError, ValueError):
        raise HeadwayError(f"shard = {shorten(shard)} is not a pair (i, n)") from None
    if not 1 <= i <= n:
        raise HeadwayError(f"shard {i}/{n} does not exist; shards are 1/{n} to {n}/{n}")
    if store is None:
        raise HeadwayError(f"shard {i}/{n} needs a store, where the shards meet")
