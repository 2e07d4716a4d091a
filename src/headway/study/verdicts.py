"""A study by exact linear theory instead of simulation."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from headway.errors import HeadwayError
from headway.study.paths import Target
from headway.study.templates import TemplateTable
from headway.study.work import INVALID, Job, Piece, plain
from headway.theory.platoon import Chain, gain_power, head_to_tail

__all__ = ["VERDICTS", "StudyTheory", "TheoryJob"]

#: what theory says of a point: unit and meaning
VERDICTS = {
    "locally_stable": ("1", "every vehicle is locally stable (1) or not (0)"),
    "string_stable": ("1", "every vehicle is strictly string stable (1) or not (0); NaN if one hears the leader"),
    "head_to_tail_stable": ("1", "no frequency is larger at the tail than at the head (1), or one is (0)"),
    "margin": ("1/s²", "least margin of strict string stability, negative where it is lost; NaN as above"),
    "decay_rate": ("1/s", "least decay rate of a vehicle, negative where it grows"),
    "head_to_tail_gain": ("1", "supremum of the head-to-tail gain"),
}


@dataclass(frozen=True)
class TheoryJob(Job):
    """A study by linear theory: its points have `VERDICTS` instead of metrics."""

    def worker(self) -> Any:
        """A worker by theory, called as a `Worker`."""
        return StudyTheory(self)


@dataclass
class StudyTheory:
    """Does pieces of one job by theory; strings that many points share are analysed once.

    Attributes:
        job: the study without its points.
        chains: verdicts of strings, by what they are.
        stop: set where nobody waits for answers any more.
    """

    job: Job
    chains: dict[Any, dict[str, float]] = field(default_factory=dict)
    stop: threading.Event = field(default_factory=threading.Event)

    def __post_init__(self) -> None:
        self.table = TemplateTable(self.job.scenario, dict(self.job.types))
        self.lock = threading.Lock()

    def __call__(self, columns: Mapping[str, np.ndarray], count: int) -> Piece:
        """Values of `count` points with these values of each path (points,)."""
        piece = Piece({n: np.full(count, np.nan) for n in VERDICTS}, np.zeros(count, dtype=np.int8), {})
        for i in range(count):
            if self.stop.is_set():
                raise CancelledError
            values: list[tuple[tuple[Target, ...], Any]] = [(t, plain(columns[p][i])) for p, t in self.job.fields]
            try:
                for name, value in self._point(values).items():
                    piece.values[name][i] = value
            except HeadwayError as error:
                piece.status[i] = INVALID
                piece.messages[i] = str(error)
        return piece

    def _point(self, values: list[tuple[tuple[Target, ...], Any]]) -> dict[str, float]:
        scenario = self.table.template(values).scenario
        gaps = None if scenario.gaps is None else tuple(scenario.initial_gaps())
        key = (scenario.followers, scenario.cruise, gaps)
        with self.lock:
            if key in self.chains:
                return self.chains[key]
            if len(self.chains) > 10_000:
                self.chains.clear()
        result = string_verdicts(head_to_tail(scenario.followers, scenario.cruise, gaps))
        with self.lock:
            self.chains[key] = result
        return result


def string_verdicts(chain: Chain) -> dict[str, float]:
    """Verdicts of theory on a string, by name of `VERDICTS`: its vehicles by the compiled sweep, as maps do."""
    from headway.theory import sweep

    rows = sweep.rows_of(list(dict.fromkeys(chain.vehicles)), local=True)
    verdict = sweep.judge(rows)
    local, least = bool(verdict.locally_stable.all()), float(verdict.margin.min())
    # no vehicle has a verdict of its own where one hears the platoon leader; the whole platoon has
    strict = {
        "string_stable": local and bool(verdict.string_stable.all()),
        "margin": least if local else min(least, 0.0),
    }
    alone = len(rows) == 1 and not chain.hears_leader
    gain = float("inf")
    if local:
        # a string of equal vehicles has a power of their gain
        gain = gain_power(float(sweep.peaks_of(rows).gain[0]), len(chain.vehicles)) if alone else chain.peak.gain
    return {
        "locally_stable": local,
        "head_to_tail_stable": strict["string_stable"] if alone else local and gain <= 1.0 + 1e-9,
        "decay_rate": float(sweep.decays_of(rows).rate.min()),
        "head_to_tail_gain": gain,
        **(dict.fromkeys(strict, math.nan) if chain.hears_leader else strict),
    }
