"""What is done for a piece of a study: points in, values out. Any process can do it; nothing else is shared."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from headway.arrays import Array
from headway.engine.measured import Measured, Measurement
from headway.engine.plan import Lanes, Plan
from headway.engine.run import Prepared, Run
from headway.engine.simulate import solve
from headway.engine.trajectories import limits, to_dataset, variables
from headway.errors import HeadwayError
from headway.metrics.reduction import from_batches, of_run
from headway.metrics.registry import Extremes, Metric
from headway.metrics.sizes import COLLISION
from headway.models import Law
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle
from headway.study.blocks import MOST_SAMPLES, alone, metric_values, own_value, stacked
from headway.study.lanes import Fast, Kind, Pool, chosen_lanes, joined, lanes_of, out_of_bounds
from headway.study.paths import ORDER, SHARE, Target, parameter_of
from headway.study.templates import TemplateTable

__all__ = ["COLLIDED", "FAILED", "INVALID", "OK", "STATUS", "Job", "Piece", "Worker", "plain"]


#: what became of a point
STATUS = ("ok", "collision", "invalid", "failed", "pending")
OK, COLLIDED, INVALID, FAILED, PENDING = range(5)

#: followers × lanes of one batch: what is prepared for its steps is shared, so it may be small enough for the caches
_ELEMENTS = {"rk4": 800, "ballistic": 384}

#: templates that are kept, the latest used
_TEMPLATES = 4096


@dataclass(frozen=True)
class Job:
    """A study without its points: what every worker gets once.

    Attributes:
        scenario: what every point has but for its axes.
        types: vehicles by name.
        fields: path → fields that it stands for.
        metrics: what is measured.
        shapes: metric → whether it has a value for each vehicle.
        vehicles: most vehicles of a point, the leader included.
    """

    scenario: Scenario
    types: tuple[tuple[str, Vehicle], ...]
    fields: tuple[tuple[str, tuple[Target, ...]], ...]  # path → fields
    metrics: tuple[Metric, ...]
    shapes: tuple[tuple[str, bool], ...]  # metric → whether it has a value for each vehicle
    vehicles: int  # most vehicles of a point, the leader included

    def worker(self) -> Any:
        """A worker for the job: called with values of each path and the number of points, it gives a `Piece`."""
        return Worker(self)


class Piece(NamedTuple):
    """What a worker answers.

    Attributes:
        values: by metric, (points, vehicles) or (points,).
        status: (points,) index in `STATUS` of what became of each point.
        messages: why, by number of the point in the piece.
    """

    values: dict[str, Array]
    status: NDArray[np.int8]
    messages: dict[int, str]


@dataclass
class Worker:
    """Does pieces of one job. Threads may share it; whoever sets `stop` ends what is under way."""

    job: Job
    pool: Pool = field(default_factory=Pool)

    def __post_init__(self) -> None:
        job = self.job
        self.table = TemplateTable(job.scenario, dict(job.types))
        laws: dict[str, Law] = {law.name: law for law in self.table.laws}
        free = any(t[-1] in ("model", "kind") for _, targets in job.fields for t in targets)
        self.fast = {p for p, targets in job.fields if not free and _is_fast(targets, self.table.table, laws)}
        self.needs: dict[str, int] = {}
        for metric in job.metrics:
            if metric.reduced is not None and metric.reduced.signal:
                self.needs[metric.reduced.signal] = self.needs.get(metric.reduced.signal, 0) | metric.reduced.mode
        #: those that need trajectories: of the registry, and of one's own, which get every run with all that is known
        self.whole = [m for m in job.metrics if m.reduced is None and not m.own]
        self.own = [m for m in job.metrics if m.own]
        self.kinds: OrderedDict[Any, Kind | str] = OrderedDict()
        self.lock, self.last = threading.Lock(), threading.local()

    # -- single points ---------------------------------------------------------------------------

    def scenario(self, columns: Mapping[str, np.ndarray], i: int) -> Scenario:
        """The scenario of a point.

        Args:
            columns: path → values.
            i: number of the point among them.

        Raises:
            HeadwayError: if a value is not allowed.
        """
        self.pool.go_on()
        return self.table.template([(t, plain(columns[p][i])) for p, t in self.job.fields]).scenario

    @property
    def stop(self) -> threading.Event:
        """Set where nobody waits for answers any more."""
        return self.pool.stop

    # -- pieces ----------------------------------------------------------------------------------

    def __call__(self, columns: Mapping[str, np.ndarray], count: int) -> Piece:
        """Values of `count` points with these values of each path (points,)."""
        job = self.job
        shape = {n: (count, job.vehicles) if wide else (count,) for n, wide in job.shapes}
        piece = Piece({n: np.full(s, np.nan) for n, s in shape.items()}, np.zeros(count, dtype=np.int8), {})
        groups: dict[Any, list[tuple[Kind, NDArray[np.int64]]]] = {}
        for kind, numbers in self._by_template(columns, count, piece):
            groups.setdefault(kind.structure, []).append((kind, numbers))
        for parts in groups.values():
            self._group(parts, columns, piece)
        return piece

    def _by_template(
        self, columns: Mapping[str, np.ndarray], count: int, piece: Piece
    ) -> list[tuple[Kind, NDArray[np.int64]]]:
        """Group points by their values beside parameters of laws; refuse those that are not allowed."""
        slow = [(p, t) for p, t in self.job.fields if p not in self.fast]
        if not slow:
            kind = self._kind([])
            if isinstance(kind, Kind):
                return [(kind, np.arange(count))]
        codes = np.zeros(count, dtype=np.int64)
        for path, _ in slow:
            code = _codes(columns[path])
            _, codes = np.unique(codes * (int(code.max(initial=0)) + 1) + code, return_inverse=True)
        order = np.argsort(codes, kind="stable")
        groups = []
        for numbers in np.split(order, np.flatnonzero(np.diff(codes[order])) + 1):
            if not numbers.size:
                continue
            first = int(numbers[0])
            kind = self._kind([(t, plain(columns[p][first])) for p, t in slow])
            if isinstance(kind, Kind):
                groups.append((kind, numbers))
                continue
            for i in numbers:
                # with other parameters of laws it may be allowed after all
                whole = self._whole(columns, int(i)) if self.fast else kind
                if isinstance(whole, Kind):
                    groups.append((whole, np.array([i])))
                else:
                    self._refuse(piece, int(i), whole)
        return groups

    def _kind(self, values: list[tuple[tuple[Target, ...], Any]]) -> Kind | str:
        """The template of these values, or why there is none."""
        self.pool.go_on()
        key = repr([v for _, v in values])
        with self.lock:
            if key in self.kinds:
                self.kinds.move_to_end(key)
                return self.kinds[key]
        try:
            kind: Kind | str = Kind.of(self.table.template(values))
        except HeadwayError as error:
            kind = str(error)
        with self.lock:
            kind = self.kinds.setdefault(key, kind)
            while len(self.kinds) > _TEMPLATES:
                self.kinds.popitem(last=False)
        return kind

    def _whole(self, columns: Mapping[str, np.ndarray], i: int) -> Kind | str:
        """The template of a single point with all its values, or why there is none."""
        try:
            return Kind.of(self.table.template([(t, plain(columns[p][i])) for p, t in self.job.fields]))
        except HeadwayError as error:
            return str(error)

    def _refuse(self, piece: Piece, i: int, why: str, status: int = INVALID) -> None:
        piece.status[i] = status
        piece.messages[i] = why

    def _group(
        self, parts: list[tuple[Kind, NDArray[np.int64]]], columns: Mapping[str, np.ndarray], piece: Piece
    ) -> None:
        """Run points of one structure."""
        kinds: list[Kind] = []
        which: list[NDArray[np.int64]] = []
        numbers: list[NDArray[np.int64]] = []
        lanes: list[Lanes] = []
        for kind, members in parts:
            fast = [
                Fast(p, t, np.asarray(columns[p][members], dtype=float)) for p, t in self.job.fields if p in self.fast
            ]
            bad = out_of_bounds(kind, fast, members.size)
            for lane, why in bad.items():
                self._refuse(piece, int(members[lane]), why)
            block = lanes_of(kind, fast, members.size)
            missing = np.flatnonzero(np.isnan(block.gaps).any(axis=0))
            for lane in map(int, missing):
                if lane in bad:
                    continue
                whole = self._whole(columns, int(members[lane]))
                if isinstance(whole, Kind):
                    block.gaps[:, lane] = whole.base.gaps[:, 0]
                else:
                    bad[lane] = whole
                    self._refuse(piece, int(members[lane]), whole)
            good = np.setdiff1d(np.arange(members.size), list(bad))
            if good.size:
                which.append(np.full(good.size, len(kinds)))
                kinds.append(kind)
                numbers.append(members[good])
                lanes.append(block if good.size == members.size else chosen_lanes(block, good))
        if not numbers:
            return
        points, together = np.concatenate(numbers), joined(lanes)
        if self.own:
            for i in points:
                self._alone(columns, int(i), piece)
        elif self.whole:
            self._blocks(kinds, np.concatenate(which), points, together, columns, piece)
        else:
            self._batches(kinds, np.concatenate(which), points, together, columns, piece)

    def _batches(
        self, kinds: list[Kind], which: NDArray[np.int64], points: NDArray[np.int64], lanes: Lanes,
        columns: Mapping[str, np.ndarray], piece: Piece, extra: bool = False,
    ) -> None:  # fmt: skip
        """Run lanes of one structure in batches; `extra`: with what events and late accelerations take together."""
        frame = self.pool.frame(kinds[0], extra)
        size = batch_size(frame.scenario)
        parts: list[Measurement] = []
        time = frame.mesh.time[frame.mesh.record]
        for start in range(0, points.size, size):
            block = slice(start, min(start + size, points.size))
            first, last = int(which[block][0]), int(which[block][-1])  # rising
            shared = all(k.leader == kinds[first].leader for k in kinds[first + 1 : last + 1])
            leaders = [kinds[first]] if shared else [kinds[k] for k in which[block]]
            motions = [k.template.scenario.motion for k in leaders]
            plan = Plan.of_lanes(frame, motions, chosen_lanes(lanes, block))
            parts.append(self._run(plan, self.pool.steps(kinds[first], shared, extra)).measure())
        vehicles = lanes.gaps.shape[0] + 1
        free = np.full((1, points.size), np.inf)  # the leader's
        within = np.vstack((-free, lanes.limits[0])), np.vstack((free, lanes.limits[1]))
        collision = np.concatenate([part.collision for part in parts], axis=1)
        extremes = from_batches(time, [part.reductions for part in parts], within, collision) if self.needs else {}
        each = points[:, None], np.arange(vehicles)
        for metric in self.job.metrics:
            if metric.reduced is not None:
                array = metric.reduced.make(extremes[metric.reduced.signal]) if metric.reduced.signal else collision
                piece.values[metric.name][each] = array.T
        piece.status[points[np.isfinite(collision).any(axis=0)]] = COLLIDED
        again = np.flatnonzero(np.concatenate([part.unsettled for part in parts]))
        if again.size:
            self._batches(kinds, which[again], points[again], chosen_lanes(lanes, again), columns, piece, extra=True)
        # a law that answers something that is no number is asked by itself, which says who, where and when
        for i in points[np.concatenate([part.unsound for part in parts])]:
            self._alone(columns, int(i), piece)

    def _blocks(
        self, kinds: list[Kind], which: NDArray[np.int64], points: NDArray[np.int64], lanes: Lanes,
        columns: Mapping[str, np.ndarray], piece: Piece, extra: bool = False,
    ) -> None:  # fmt: skip
        """Run lanes of one structure with their trajectories, as many at once as fit; a block has one leader."""
        frame = self.pool.frame(kinds[0], extra)
        vehicles = lanes.gaps.shape[0] + 1
        size = max(1, min(batch_size(frame.scenario), MOST_SAMPLES // (int(frame.mesh.record.sum()) * vehicles)))
        breaks = [n for n in range(1, points.size) if kinds[which[n]].leader != kinds[which[n - 1]].leader]
        for begin, end in pairwise([0, *breaks, points.size]):
            for start in range(begin, end, size):
                block = slice(start, min(start + size, end))
                kind, some = kinds[which[start]], chosen_lanes(lanes, block)
                scenario = kind.template.scenario
                plan = Plan.of_lanes(frame, [scenario.motion], some)
                result = Run(plan, self.pool.steps(kind, True, extra), self.pool.stop.is_set).go()
                again = np.flatnonzero(result.unsettled)
                if again.size:
                    lanes_again = chosen_lanes(some, again)
                    self._blocks(kinds, which[block][again], points[block][again], lanes_again, columns, piece, True)
                for i in points[block][result.unsound & ~result.unsettled]:
                    self._alone(columns, int(i), piece)
                good = np.flatnonzero(~(result.unsettled | result.unsound))
                if good.size:
                    collision = result.collision[:, good]
                    piece.status[points[block][good][np.isfinite(collision).any(axis=0)]] = COLLIDED
                    runs = stacked(scenario, result.time, result.motion[..., good], collision, chosen_lanes(some, good))
                    self._take(*metric_values(self.job.metrics, runs), points[block][good], piece)

    def _take(
        self, values: Mapping[str, Array], reasons: Mapping[int, str], points: NDArray[np.int64], piece: Piece
    ) -> None:
        for name, array in values.items():
            if array.ndim > 1:
                piece.values[name][points[:, None], np.arange(array.shape[1])] = array
            else:
                piece.values[name][points] = array
        piece.messages.update({int(points[lane]): text for lane, text in reasons.items()})

    def _run(self, plan: Plan, prepared: Prepared) -> Measured:
        """Run a plan, in the memory of this thread's last run where that fits."""
        last: Measured | None = getattr(self.last, "run", None)
        if (
            last is not None
            and last.mesh is plan.mesh
            and last.plan.extra == plan.extra
            and last.plan.x.shape == plan.x.shape
            and len(last.plan.motions) == len(plan.motions)
        ):
            last.again(plan, prepared)
            return last
        self.last.run = Measured(plan, self.needs, prepared, self.pool.stop.is_set)
        return self.last.run

    def _alone(self, columns: Mapping[str, np.ndarray], i: int, piece: Piece) -> None:
        """Run a point by itself, with its events and its trajectories."""
        for values in piece.values.values():
            values[i] = np.nan
        try:
            scenario = self.scenario(columns, i)
        except HeadwayError as error:
            return self._refuse(piece, i, str(error))
        try:
            result = solve(scenario, self.pool.stop.is_set)
            signals = variables(scenario, result)
            hit = result.collision_time
            extremes: dict[str, Extremes] = of_run(result.time, signals, self.needs, limits(scenario), hit)
            dataset: Any = to_dataset(scenario, result) if self.own or self.whole else None
            if np.isfinite(hit).any():
                piece.status[i] = COLLIDED
            for metric in self.job.metrics:
                if metric.name == COLLISION:
                    values = hit
                elif metric.reduced is not None:
                    values = metric.reduced.make(extremes[metric.reduced.signal])
                elif metric.own:
                    values = np.asarray(own_value(metric, dataset))
                else:
                    values, reason = alone(metric, dataset)
                    if reason:
                        piece.messages.setdefault(i, reason)
                wide = piece.values[metric.name].ndim > 1
                piece.values[metric.name][(i, slice(hit.size)) if wide else i] = values
        except HeadwayError as error:
            self._refuse(piece, i, str(error), FAILED)
        return None


def batch_size(scenario: Scenario) -> int:
    """How many lanes are integrated side by side."""
    return max(1, _ELEMENTS[scenario.scheme] // len(scenario.followers))


def _is_fast(targets: tuple[Target, ...], table: Mapping[str, Any], laws: Mapping[str, Law]) -> bool:
    """Whether a field is a parameter that lanes of one batch may have for themselves."""
    for target in targets:
        name = parameter_of(target)
        if name is None or target[0] in (ORDER, SHARE):
            return False
        law = laws[table[str(target[0])][target[1]]["model"]]
        if law.parameters[name].info.structural:
            return False
    return True


def _codes(values: np.ndarray) -> NDArray[np.int64]:
    """A number for each different value."""
    if values.dtype != object:
        return np.unique(values, return_inverse=True)[1]
    seen: dict[str, int] = {}
    return np.array([seen.setdefault(repr(v), len(seen)) for v in values], dtype=np.int64)


def plain(value: Any) -> Any:
    """A NumPy scalar as a Python number; anything else as it is."""
    return value.item() if isinstance(value, np.generic) else value
