"""The sweep over delays that the paper's introduction promises: 0 to 1.5 s for every model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from headway.literature.barhoumi2025.settings import last_over_first, peak_by_follower, scenario, trajectories
from headway.theory.linear import linearize

__all__ = ["CLASSES", "DELAYS", "Answer", "delay_sweep"]

#: [s]
DELAYS: NDArray[np.float64] = np.linspace(0.0, 1.5, 31)

#: verdicts of exact theory, worst first
CLASSES = ("locally unstable", "string unstable", "string stable")


@dataclass(frozen=True)
class Answer:
    """What delays do to one model; every array has one entry for each of `DELAYS`.

    Attributes:
        peak: largest spacing error of any pair [m], until a collision.
        growth: largest spacing error of the last pair over that of Cars 0-1.
        collisions: number of collisions.
        verdict: index into `CLASSES` of exact theory at 23 m/s.
    """

    peak: NDArray[np.float64]
    growth: NDArray[np.float64]
    collisions: NDArray[np.int64]
    verdict: NDArray[np.int64]


def delay_sweep(model: str) -> Answer:
    """Simulate one model with every delay: of radio signals for CACC, of all on-board signals for others.

    Args:
        model: "cacc", "idm", "ovm" or "gmm".
    """
    rows = [_point(f"delay-sweep-{model}", float(delay)) for delay in DELAYS]
    peak, growth, hit, verdict = (np.array(column) for column in zip(*rows, strict=True))
    return Answer(peak, growth, hit, verdict)


def _point(name: str, delay: float) -> tuple[float, float, int, int]:
    dataset = trajectories(name, delay=delay)
    pairs = peak_by_follower(dataset.spacing_error)
    case = scenario(name, delay=delay)
    linear = linearize(case.followers[0], case.cruise, case.initial_gaps()[0])
    verdict = 0 if not linear.locally_stable else 2 if linear.string_stable else 1
    hit = int(dataset.collision_time.notnull().sum())
    return float(np.nanmax(pairs)), last_over_first(pairs), hit, verdict
