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
    "held",
    "holds",
    "lost",
    "robustness",
    "scoreboard",
    "value",
    "worst",
]

#: what a ratio may exceed 1 by: records end, and measures are made of samples
TOLERANCE = 1e-3

#: the same of energies, which are good to two thousandths of their size at the samples of a board
ENERGY_TOLERANCE = 5e-3

#: source of a rule that is this program's
OWN = "own rule"

#: the criterion that is made of the others, over a sweep of delays
ROBUSTNESS = "robustness to delay"


@dataclass(frozen=True)
class Criterion:
    """What is asked of a follower: its measure (`short` names it), the bound, and whether more of it is better."""

    name: str
    short: str
    measure: str
    bound: float
    more: bool
    rule: str
    source: str
    tolerance: float = TOLERANCE

    def meets(self, number: float) -> bool:
        """Whether a measured number is within the bound."""
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
    """Mean rank by criterion (1 is best; robustness included where delays were swept) and their mean."""

    who: str
    ranks: dict[str, float]

    @property
    def overall(self) -> float:
        """Mean over the criteria, each of the same weight."""
        known = [r for r in self.ranks.values() if math.isfinite(r)]
        return sum(known) / len(known) if known else math.nan


def value(cell: Cell, criterion: Criterion) -> float:
    """What counts for a criterion: its measure, infinitely bad after a collision or where the cell could not be run."""
    if cell.reason or cell.collided:
        return 0.0 if criterion.more else math.inf
    return cell.values[criterion.measure]


def holds(cells: Iterable[Cell], criterion: Criterion) -> bool:
    """Whether a criterion holds in all cells that have a value for it, and there is one."""
    known = [v for c in cells if not math.isnan(v := value(c, criterion))]
    return bool(known) and all(map(criterion.meets, known))


def worst(cells: Iterable[Cell], criterion: Criterion) -> float:
    """The worst value among cells that were run without a collision; NaN if there is none."""
    known = [v for c in cells if not c.reason and not c.collided and not math.isnan(v := value(c, criterion))]
    if not known:
        return math.nan
    return min(known) if criterion.more else max(known)


def held(board: Board, who: str, criterion: Criterion) -> float:
    """The largest delay [s] of the sweep up to which a criterion holds in all swept disturbances; NaN if not even 0."""
    longest = math.nan
    cells = board.select(PUBLISHED, SWEEP, who)
    for delay in board.benchmark.sweep:
        there = [c for c in cells if c.onboard == delay]
        if not holds(there, criterion):
            break
        longest = delay
    return longest


def lost(board: Board, who: str, criterion: Criterion) -> list[str]:
    """The disturbances behind which a criterion is lost at the first delay of the sweep at which it does not hold."""
    reached = held(board, who, criterion)
    later = [t for t in board.benchmark.sweep if math.isnan(reached) or t > reached]
    cells = [c for c in board.select(PUBLISHED, SWEEP, who) if later and c.onboard == later[0]]
    return [c.course for c in cells if not holds([c], criterion)]


def scoreboard(board: Board, view: str, delays: Sequence[str] | None = None) -> tuple[Score, ...]:
    """Mean ranks of all entries of a view, over all its cells or those of some cases of delays; best first."""
    cases = [c.name for c in board.benchmark.cases] if delays is None else list(delays)
    cells = [c for c in board.cells if c.view == view and c.delays in cases]
    names = list(dict.fromkeys(c.who for c in cells))
    found: dict[str, dict[str, float]] = {name: {} for name in names}
    places: dict[tuple[str, str], list[Cell]] = {}
    for cell in cells:
        places.setdefault((cell.course, cell.delays), []).append(cell)
    for criterion in CRITERIA:
        collected: dict[str, list[float]] = {name: [] for name in names}
        for there in places.values():
            numbers = [value(c, criterion) for c in there]
            for cell, rank in zip(there, _ranks(numbers, criterion.more), strict=True):
                collected[cell.who].append(rank)
        for name, ranks in collected.items():
            known = [r for r in ranks if math.isfinite(r)]
            found[name][criterion.name] = sum(known) / len(known) if known else math.nan
    if view == PUBLISHED and delays is None and any(c.delays == SWEEP for c in board.cells):
        reached = [robustness(board, name) for name in names]
        for name, rank in zip(names, _ranks(reached, more=True), strict=True):
            found[name][ROBUSTNESS] = rank
    scores = [Score(name, ranks) for name, ranks in found.items()]
    return tuple(sorted(scores, key=lambda s: (math.isnan(s.overall), s.overall)))


def robustness(board: Board, who: str) -> float:
    """Mean over the criteria of the delay [s] up to which each holds; a criterion that never holds counts as 0."""
    reached = [held(board, who, c) for c in CRITERIA]
    return float(np.mean(np.nan_to_num(reached)))


def _ranks(numbers: Sequence[float], more: bool) -> list[float]:
    """Ranks from 1, the mean of their places for equals; NaN for what is not a number."""
    from scipy.stats import rankdata

    array = np.asarray(numbers, dtype=float)
    known = ~np.isnan(array)
    # what differs by rounding only is equal
    with np.errstate(all="ignore"):
        kept = np.where(np.isfinite(array), np.round(array, 9), array)
    ranks = np.full(array.size, np.nan)
    if known.any():
        ranks[known] = rankdata(-kept[known] if more else kept[known])
    return ranks.tolist()
