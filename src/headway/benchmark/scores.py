"""Criteria of a good follower: how each is measured, when it holds, and who ranks where.

Ranks are given within each cell of (disturbance, delays) and averaged, so that no disturbance weighs more
because its numbers are larger. Who collides is last in every criterion of that cell, and so is who could not
be run there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from headway.benchmark.cells import PUBLISHED, SWEEP, Board, Cell

__all__ = [
    "CRITERIA",
    "ENERGY_TOLERANCE",
    "ROBUSTNESS",
    "Criterion",
    "Score",
    "criterion_value",
    "held",
    "holds",
    "lost",
    "robustness",
    "scoreboard",
    "worst",
]

#: what a ratio may exceed 1 by: records end and are sampled
TOLERANCE = 1e-3

#: tolerance of energies, which are good to two thousandths of their size at the samples of a board
ENERGY_TOLERANCE = 5e-3

#: source of a rule that is this program's
OWN = "own rule"

#: the criterion that is made of the others, over a sweep of delays
ROBUSTNESS = "robustness to delay"


@dataclass(frozen=True)
class Criterion:
    """A property of a good follower: how it is measured and when it holds.

    Attributes:
        name: of the criterion.
        short: name of its measure in tables.
        measure: key of `headway.benchmark.measures.MEASURES`.
        bound: of the measure, in its unit.
        more: whether more of it is better, so that the bound is a lower one.
        rule: the criterion in words.
        source: publication of the rule, or `OWN`.
        tolerance: what the measure may exceed an upper bound by.
    """

    name: str
    short: str
    measure: str
    bound: float
    more: bool
    rule: str
    source: str
    tolerance: float = TOLERANCE

    def meets(self, number: float) -> bool:
        """Whether a measured number, in the unit of the measure, is within the bound."""
        return number >= self.bound if self.more else number <= self.bound + self.tolerance


CRITERIA: tuple[Criterion, ...] = (
    Criterion(
        "safety",
        "least TTC",
        "ttc",
        1.5,
        True,
        "no collision, and time to collision never below 1.5 s",
        "Hayward, Highw. Res. Rec. 384, 24 (1972); Minderhoud and Bovy, Accid. Anal. Prev. 33, 89 (2001)",
    ),
    Criterion(
        "string stability",
        "growth per vehicle",
        "growth",
        1.0,
        False,
        "no vehicle passes on more than it receives",
        "Ploeg, van de Wouw, Nijmeijer, IEEE Trans. Control Syst. Technol. 22, 786 (2014)",
    ),
    Criterion(
        "comfort",
        "acceleration ratio",
        "roughness",
        1.0,
        False,
        "no follower's r.m.s. acceleration is above the leader's",
        OWN,
    ),
    Criterion(
        "energy",
        "energy ratio",
        "energy",
        1.0,
        False,
        "followers need no more energy than the leader on average",
        OWN,
        ENERGY_TOLERANCE,
    ),
    Criterion(
        "responsiveness",
        "speed difference",
        "tracking",
        1.0,
        False,
        "speed differences between vehicles stay smaller than the disturbance itself",
        OWN,
    ),
)


@dataclass(frozen=True)
class Score:
    """Mean ranks of one entry.

    Attributes:
        who: name of the entry.
        ranks: mean rank by criterion, 1 is best; NaN where it has none. Robustness is among them where delays
            were swept.
    """

    who: str
    ranks: dict[str, float]

    @property
    def overall(self) -> float:
        """Mean over the criteria, each with the same weight; NaN without ranks."""
        finite = [r for r in self.ranks.values() if math.isfinite(r)]
        return sum(finite) / len(finite) if finite else math.nan


def criterion_value(cell: Cell, criterion: Criterion) -> float:
    """Return the value of a cell that counts for a criterion.

    Args:
        cell: the cell.
        criterion: the criterion.

    Returns:
        The measure; infinitely bad (0 where more is better) after a collision or where the cell could not be run.
    """
    if cell.reason or cell.collided:
        return 0.0 if criterion.more else math.inf
    return cell.values[criterion.measure]


def holds(cells: Iterable[Cell], criterion: Criterion) -> bool:
    """Whether a criterion holds in all cells that have a value for it, and at least one has.

    Args:
        cells: the cells.
        criterion: the criterion.
    """
    values = [v for c in cells if not math.isnan(v := criterion_value(c, criterion))]
    return bool(values) and all(map(criterion.meets, values))


def worst(cells: Iterable[Cell], criterion: Criterion) -> float:
    """Return the worst value of a criterion among cells that were run without a collision; NaN without such cells.

    Args:
        cells: the cells.
        criterion: the criterion.
    """
    values = [
        v for c in cells if not c.reason and not c.collided and not math.isnan(v := criterion_value(c, criterion))
    ]
    if not values:
        return math.nan
    return min(values) if criterion.more else max(values)


def held(board: Board, who: str, criterion: Criterion) -> float:
    """Return the largest delay [s] of the sweep up to which a criterion holds in all swept disturbances.

    Args:
        board: the cells of a benchmark.
        who: name of an entry.
        criterion: the criterion.

    Returns:
        The delay; NaN where the criterion does not hold even at the first one.
    """
    longest = math.nan
    cells = board.select(PUBLISHED, SWEEP, who)
    for delay in board.benchmark.sweep:
        there = [c for c in cells if c.onboard == delay]
        if not holds(there, criterion):
            break
        longest = delay
    return longest


def lost(board: Board, who: str, criterion: Criterion) -> list[str]:
    """Return the disturbances behind which a criterion is lost first as the delay grows.

    Args:
        board: the cells of a benchmark.
        who: name of an entry.
        criterion: the criterion.

    Returns:
        Names of disturbances at the first delay at which the criterion does not hold in all of them.
    """
    reached = held(board, who, criterion)
    later = [t for t in board.benchmark.sweep if math.isnan(reached) or t > reached]
    cells = [c for c in board.select(PUBLISHED, SWEEP, who) if later and c.onboard == later[0]]
    return [c.course for c in cells if not holds([c], criterion)]


def scoreboard(board: Board, view: str, delays: Sequence[str] | None = None) -> tuple[Score, ...]:
    """Return the mean ranks of all entries of a view, best first.

    Args:
        board: the cells of a benchmark.
        view: one of the views of `headway.benchmark.cells`.
        delays: names of the cases of delays that count; all cases if None.
    """
    cases = [c.name for c in board.benchmark.cases] if delays is None else list(delays)
    cells = [c for c in board.cells if c.view == view and c.delays in cases]
    names = list(dict.fromkeys(c.who for c in cells))
    means: dict[str, dict[str, float]] = {name: {} for name in names}
    places: dict[tuple[str, str], list[Cell]] = {}
    for cell in cells:
        places.setdefault((cell.course, cell.delays), []).append(cell)
    for criterion in CRITERIA:
        collected: dict[str, list[float]] = {name: [] for name in names}
        for there in places.values():
            numbers = [criterion_value(c, criterion) for c in there]
            for cell, rank in zip(there, _ranks(numbers, criterion.more), strict=True):
                collected[cell.who].append(rank)
        for name, ranks in collected.items():
            finite = [r for r in ranks if math.isfinite(r)]
            means[name][criterion.name] = sum(finite) / len(finite) if finite else math.nan
    if view == PUBLISHED and delays is None and any(c.delays == SWEEP for c in board.cells):
        reached = [robustness(board, name) for name in names]
        for name, rank in zip(names, _ranks(reached, more=True), strict=True):
            means[name][ROBUSTNESS] = rank
    scores = [Score(name, ranks) for name, ranks in means.items()]
    return tuple(sorted(scores, key=lambda s: (math.isnan(s.overall), s.overall)))


def robustness(board: Board, who: str) -> float:
    """Return the mean over the criteria of the delay [s] up to which each holds.

    Args:
        board: the cells of a benchmark.
        who: name of an entry.

    Returns:
        The delay; a criterion that never holds counts as 0.
    """
    reached = [held(board, who, c) for c in CRITERIA]
    return float(np.mean(np.nan_to_num(reached)))


def _ranks(numbers: Sequence[float], more: bool) -> list[float]:
    """Return ranks from 1, for equals the mean of their places; NaN for what is not a number."""
    from scipy.stats import rankdata

    array = np.asarray(numbers, dtype=float)
    present = ~np.isnan(array)
    # what differs by rounding only is equal
    with np.errstate(all="ignore"):
        rounded = np.where(np.isfinite(array), np.round(array, 9), array)
    ranks = np.full(array.size, np.nan)
    if present.any():
        ranks[present] = rankdata(-rounded[present] if more else rounded[present])
    return ranks.tolist()
