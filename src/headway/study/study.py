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
from headway.study.pieces import PARTS, check_chunk, check_shard, piece_size
from headway.study.results import assembled
from headway.study.store import Store
from headway.study.templates import TemplateTable
from headway.study.verdicts import VERDICTS, TheoryJob
from headway.study.work import PENDING, Job, Worker
from headway.version import __version__

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Study", "open_study"]

#: raised where stores are laid out or numbers are computed otherwise
_FORMAT = 2


@dataclass(frozen=True, eq=False)
class Study:
    """A scenario and axes over any of its fields.

    A path of an axis is that of `--set` in a scenario file (`leader.amplitude`, `followers.0.parameters.T`, `seed`), or
    short for all followers: `T` for a parameter, `delay` (of all that is measured on board, the radio current: what
    `Vehicle(delay=x)` means), `radio_delay` (of all that is heard by radio, the rest as it is), `delay.vl` (of one
    signal), `lag`. `order` is the order of vehicles, front to back (numbers from 1, or the seed of a random order;
    `original_vehicle` in the dataset says who stands where); `share.<type>` the share of followers of a type (one of
    `types`, or the name of a model in the scenario), at places drawn by the scenario's seed. Values are a list or
    `between(low, high, count)`. A key of several paths, `("T", "a")` or `"T+a"`, has one list for each, which are
    zipped.

    Attributes:
        scenario: what every point has but for its axes.
        axes: path → values.
        design: `"grid"`, `"zip"`, or points drawn by `"sobol"`, `"latin"` or `"random"`.
        count: how many points are drawn.
        seed: of the draw, 0 or more.
        types: vehicles by name, for `share` and for axes such as `types.truck.parameters.T`.

    Raises:
        HeadwayError: for axes that name nothing or do not fit together. Points at which a value is not allowed are
            marked when the study runs.
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
        """The scenario of a point, counted from 0 with the last dimension fastest.

        Raises:
            HeadwayError: if there is no such point, or its values are not allowed.
        """
        self._check_point(point)
        return Worker(self._job(())).scenario(self.points.take(np.array([point])), 0)

    @typed
    def trajectories(self, keep: Iterable[int]) -> xr.Dataset:
        """Trajectories of the points numbered in `keep`, along kept, vehicle and time."""
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

        Each point has a `status` (ok, collision, invalid, failed, or pending) and a `message`.

        Args:
            metrics: names such as `peak_spacing_error`, `ttc` or `tet(threshold=4)` (docs/metrics.md lists them all),
                or functions of a dataset of trajectories; those of `headway run` if None.
            executor: `"threads"` (one for each core), `"serial"`, `"processes"`, `"dask://host:port"`, a
                `distributed.Client` or any `concurrent.futures.Executor`. All give identical bits.
            shard: (i, n), do the i-th of n parts (from 1) of the pieces, into a shared `store`.
            store: path of a Zarr store that is written piece by piece; a study that was killed goes on there.
            resume: whether it may go on there.
            chunk: points of a piece; chosen by time and memory if None. It changes no bits.
            keep: numbers of points whose trajectories are kept too, over (kept, vehicle, time).
            progress: called as progress(points done, points to do) after every piece.

        Raises:
            HeadwayError: for a store of another study, a disk that is full, an executor that cannot be had.
        """
        selection = chosen(metrics, DEFAULT)
        job = self._job(selection)
        if shard is not None:
            check_shard(shard, store)
        numbers = list(keep)
        for point in numbers:
            self._check_point(point)
        size = piece_size(self.scenario, selection, self.points.count) if chunk is None else check_chunk(chunk)
        values, messages = self._perform(job, size, executor, shard, store, resume, progress)
        result = assembled(self.points, values, messages, _described(selection), self._attrs(), self._groups)
        if not numbers:
            return result
        runs = self.trajectories(numbers).drop_vars(COLLISION)
        return result.merge(runs, combine_attrs="override", join="outer")

    def stability(self, executor: Any = "threads", *, progress: Callable[[int, int], Any] | None = None) -> xr.Dataset:
        """All points by exact theory, at the speed of the platoon before t = 0.

        Args:
            executor: as of `run`.
            progress: as of `run`.

        Returns:
            A dataset with the dimensions of `run`: `locally_stable`, `string_stable` (strictly, every vehicle) and
            `head_to_tail_stable` (1 or 0), `margin` [1/s²], `decay_rate` [1/s] and `head_to_tail_gain` [1].
        """
        job = TheoryJob(
            self.scenario, tuple(self.types.items()), self._fields, (), tuple((n, False) for n in VERDICTS), 0
        )
        size = max(1, min(256, math.ceil(self.points.count / PARTS)))
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

    @functools.cached_property
    def hash(self) -> str:
        """SHA-256 of scenario, types and points; what is measured is not in it."""
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
    """What a store holds so far, as `Study.run` gives it.

    Args:
        path: the folder of the store.

    Raises:
        HeadwayError: if it is not a store of a study, or is damaged.
    """
    store = Store.open(path)
    about = store.about
    values, messages, damaged = store.read()
    if damaged:
        raise HeadwayError(f"{_damage(store, damaged)}; run the study again with this store to compute them anew")
    grid = Points(about["dims"], about["along"], store.axes())
    described = {n: (unit, meaning) for n, (unit, meaning) in about["described"].items()}
    return assembled(grid, values, messages, described, about["attrs"], about["groups"])


def _intact(store: Store, numbers: Iterable[int]) -> set[int]:
    """Numbers of the pieces that are done; the damaged are warned of and left to be done anew."""
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
