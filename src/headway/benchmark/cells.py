"""Running a benchmark: every cell of the board, side by side in lanes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

from headway.benchmark.measures import MEASURES, measures_of
from headway.benchmark.spec import Benchmark, Course, Entry
from headway.benchmark.tuned import tuned
from headway.engine.simulate import simulate, simulate_many
from headway.errors import HeadwayError
from headway.scenario.scenario import Scenario
from headway.study.executors import cores

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["MIXED", "PUBLISHED", "SWEEP", "TUNED", "Board", "Cell", "run_board"]

#: views of the board: the published sets, the same tuned to a common gap, and mixed platoons
PUBLISHED, TUNED, MIXED = "published", "tuned", "mixed"

#: name of the delays of a sweep
SWEEP = "sweep"

#: most samples × vehicles that are in memory at once for measuring
_KEPT = 400_000

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Cell:
    """One run of the board and its measures.

    Attributes:
        view: `PUBLISHED`, `TUNED` or `MIXED`.
        who: name of an entry or of a mixed platoon.
        course: name of the disturbance.
        delays: name of a case of delays, or `SWEEP`.
        onboard: delay of on-board signals [s].
        radio: delay of radio signals [s].
        values: measures by name; empty where the cell could not be run.
        scenario_hash: of the scenario; empty where it could not be run.
        reason: why it could not be run; else empty.
    """

    view: str
    who: str
    course: str
    delays: str
    onboard: float
    radio: float
    values: dict[str, float]
    scenario_hash: str = ""
    reason: str = ""

    @property
    def collided(self) -> bool:
        """Whether followers collided."""
        return self.values.get("collisions", 0.0) > 0


@dataclass(frozen=True)
class Board:
    """All cells of a benchmark.

    Attributes:
        benchmark: what was run.
        cells: one for each run.
        drawn: trajectories of those that are drawn, by (course, who).
        tuned: entries tuned to the common gap, by name.
        untuned: why an entry could not be tuned, by name.
    """

    benchmark: Benchmark
    cells: tuple[Cell, ...]
    drawn: dict[tuple[str, str], xr.Dataset]
    tuned: dict[str, Entry]
    untuned: dict[str, str]

    def select(self, view: str, delays: str | None = None, who: str | None = None) -> list[Cell]:
        """Return the cells of a view.

        Args:
            view: `PUBLISHED`, `TUNED` or `MIXED`.
            delays: name of a case of delays; all if None.
            who: name of an entry or a mixed platoon; all if None.
        """
        return [c for c in self.cells if c.view == view and delays in (None, c.delays) and who in (None, c.who)]

    @property
    def failed(self) -> list[Cell]:
        """Cells that could not be run."""
        return [c for c in self.cells if c.reason]


@dataclass(frozen=True)
class _Job:
    view: str
    who: str
    course: Course
    delays: str
    onboard: float
    radio: float
    entries: tuple[Entry, ...]

    def scenario(self, benchmark: Benchmark) -> Scenario:
        vehicles = [entry.behind(self.onboard, self.radio) for entry in self.entries]
        gaps: tuple[float, ...] | None = None
        if any(entry.start_gap is not None for entry in self.entries):
            start = self.course.leader.motion(0, self.course.duration).before
            gaps = tuple(
                e.start_gap if e.start_gap is not None else e.model.equilibrium_gap(start) for e in self.entries
            )
        duration = None if self.course.leader.span is not None else self.course.duration
        return Scenario(
            self.course.leader, vehicles, duration=duration, gaps=gaps, dt=min(benchmark.dt, self.course.duration),
            output_step=_output_step(benchmark, self.course),
        )  # fmt: skip


def run_board(benchmark: Benchmark, progress: Progress | None = None) -> Board:
    """Run all cells of a benchmark; one that fails is recorded with its reason and does not affect the others.

    Args:
        benchmark: what to run.
        progress: called with the number of cells that are done and the number of all.
    """
    competitors, untuned = {}, {}
    for entry in benchmark.entries:
        try:
            competitors[entry.name] = tuned(entry, benchmark.speed, benchmark.gap)
        except HeadwayError as error:
            untuned[entry.name] = str(error)
    drawn_case = benchmark.cases[-1].name
    blocks = list(_blocks(benchmark, list(_jobs(benchmark, competitors))))
    total = sum(map(len, blocks))
    cells: list[Cell] = []
    drawn: dict[tuple[str, str], xr.Dataset] = {}
    with ThreadPoolExecutor(cores()) as pool:
        for block, (block_cells, runs) in zip(
            blocks, pool.map(lambda b: _measure(benchmark, b, drawn_case), blocks), strict=True
        ):
            cells += block_cells
            drawn.update({(job.course.name, job.who): runs[i] for i, job in enumerate(block) if i in runs})
            if progress is not None:
                progress(len(cells), total)
    return Board(benchmark, tuple(cells), drawn, competitors, untuned)


def _jobs(benchmark: Benchmark, competitors: dict[str, Entry]) -> Iterator[_Job]:
    """Yield everything to be run; entries of one law stand together where they can share a batch."""
    count = benchmark.followers
    for course in benchmark.courses:
        for case in benchmark.cases:
            times = (case.name, case.onboard, case.radio)
            for entry in benchmark.entries:
                yield _Job(PUBLISHED, entry.name, course, *times, (entry,) * count)
                if entry.name in competitors:
                    yield _Job(TUNED, entry.name, course, *times, (competitors[entry.name],) * count)
            for platoon in benchmark.platoons:
                mixed = tuple(map(benchmark.entry, platoon.order))
                yield _Job(MIXED, platoon.name, course, *times, mixed)
        for delay in benchmark.sweep if course.sweep else ():
            for entry in benchmark.entries:
                yield _Job(PUBLISHED, entry.name, course, SWEEP, delay, delay, (entry,) * count)


def _output_step(benchmark: Benchmark, course: Course) -> float:
    """Return the distance of the samples [s], at least fifty of them."""
    return min(benchmark.output_step, course.duration / 50)


def _blocks(benchmark: Benchmark, jobs: list[_Job]) -> Iterator[list[_Job]]:
    """Yield jobs behind one leader with platoons of one length, so few that measuring them takes little memory."""
    groups: dict[tuple[str, int], list[_Job]] = {}
    for job in jobs:
        groups.setdefault((job.course.name, len(job.entries)), []).append(job)
    for (_, count), members in groups.items():
        samples = members[0].course.duration / _output_step(benchmark, members[0].course)
        size = max(1, int(_KEPT / (samples * (count + 1))))
        for at in range(0, len(members), size):
            yield members[at : at + size]


def _measure(benchmark: Benchmark, jobs: Sequence[_Job], drawn: str) -> tuple[list[Cell], dict[int, xr.Dataset]]:
    """Return the cells of a block, and by number those of its runs that are drawn."""
    scenarios: dict[int, Scenario] = {}
    reasons: dict[int, str] = {}
    for i, job in enumerate(jobs):
        try:
            scenarios[i] = job.scenario(benchmark)
        except HeadwayError as error:
            reasons[i] = str(error)
    runs, failed = _simulate(scenarios)
    reasons |= failed
    values: dict[int, dict[str, float]] = {}
    if runs:
        numbers, _ = measures_of(list(runs.values()), jobs[0].course.leader)
        values = {i: {name: float(numbers[name][n]) for name in MEASURES} for n, i in enumerate(runs)}
    cells = [
        Cell(
            job.view, job.who, job.course.name, job.delays, job.onboard, job.radio, values.get(i, {}),
            runs[i].attrs["scenario_hash"] if i in runs else "", reasons.get(i, ""),
        )
        for i, job in enumerate(jobs)
    ]  # fmt: skip
    keep = {i: r for i, r in runs.items() if jobs[i].delays == drawn and jobs[i].view in (PUBLISHED, MIXED)}
    return cells, keep


def _simulate(scenarios: dict[int, Scenario]) -> tuple[dict[int, xr.Dataset], dict[int, str]]:
    """Return trajectories, and reasons for missing ones, by number: all at once, one by one if something fails."""
    try:
        return dict(zip(scenarios, simulate_many(list(scenarios.values())), strict=True)), {}
    except Exception:
        runs, reasons = {}, {}
        for i, scenario in scenarios.items():
            try:
                runs[i] = simulate(scenario)
            except HeadwayError as error:
                reasons[i] = str(error)
            except Exception as error:  # a law of one's own may raise anything: the board must not fall with it
                reasons[i] = f"{type(error).__name__}: {error}"
        return runs, reasons
