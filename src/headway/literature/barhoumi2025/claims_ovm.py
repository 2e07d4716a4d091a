"""Claims about OVM. In most of its runs somebody collides; numbers are then those until the collision."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from headway import metrics
from headway.literature.barhoumi2025.settings import (
    SHAPES,
    after,
    last_over_first,
    nonharmonic,
    peak_by_follower,
    scenario,
    trajectories,
)
from headway.literature.barhoumi2025.verdicts import (
    Choices,
    Claim,
    Condition,
    about,
    at_least,
    at_most,
    grows,
    in_range,
    shrinks,
    unbounded,
)  # fmt: skip
from headway.theory.linear import linearize

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["CLAIMS"]

_AXES = {"alpha": (0.5, 0.1, 1.0, 2.0), "start": ("equilibrium", "typed in"), "omega": (0.63, 1.0)}
_SENSITIVITIES = (0.1, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 40.0, 50.0)


def _collisions(dataset: xr.Dataset) -> Condition:
    return unbounded("collisions", dataset.collision_time.notnull().sum())


def _over_time(c: Choices) -> Sequence[Condition]:
    dataset = trajectories("ovm-equilibrium", c)
    wrong = dataset.spacing_error
    known_until = float(wrong.time[np.isfinite(wrong.values[-1])][-1])
    half = 0.5 * known_until
    early, late = (peak_by_follower(wrong, *span)[-1] for span in ((0.0, half), (half, known_until)))
    return (
        grows("largest error of the last pair over Cars 0-1", last_over_first(peak_by_follower(wrong))),
        grows("last pair: largest error in the second half of its run over the first", late / early),
        _collisions(dataset),
    )


def _trailing(c: Choices) -> Sequence[Condition]:
    dataset = trajectories("compare-0-ovm", c)
    speeds = np.asarray(metrics.amplitude(dataset.speed).values[3:], dtype=float)
    return (
        about("mean speed amplitude of vehicles 3 to 5", speeds.mean(), 2.5, "m/s"),
        _collisions(dataset),
    )


def _calming(c: Choices) -> Sequence[Condition]:
    dataset = trajectories("compare-150-ovm", c)
    wrong = dataset.spacing_error
    return (
        at_least("largest error of any pair", peak_by_follower(wrong).max(), 75.0, "m"),
        about(
            "largest error in the first two periods",
            peak_by_follower(wrong, 0.0, 4 * np.pi / c["omega"]).max(),
            25.0,
            "m",
        ),
        at_most("largest error in the last period", after(wrong, 50.0 - 2 * np.pi / c["omega"]).max(), 2.0, "m"),
        _collisions(dataset),
    )


def _severe(c: Choices) -> Sequence[Condition]:
    case = scenario("compare-real-ovm", **c)
    dataset = trajectories("compare-real-ovm", c)
    decay = linearize(case.followers[0], case.cruise).decay_rate
    size = peak_by_follower(dataset.spacing_error).max() / float(dataset.gap[1:, 0].max())
    hit = int(dataset.collision_time.notnull().sum())
    return (
        Condition("rate at which one vehicle's disturbance dies", decay, "1/s", high=0.0),
        Condition("collisions, or errors as large as the first gap", hit + (size >= 1.0), low=1.0),
        unbounded("collisions", hit),
    )


def _windowed(c: Choices) -> Sequence[Condition]:
    dataset = trajectories("ovm-window", c)
    wrong = dataset.spacing_error
    pairs = peak_by_follower(wrong)
    worst = set(np.argsort(pairs)[-2:].tolist())
    return (
        about("largest error of any pair", pairs.max(), 20.0, "m"),
        at_most("largest error later than 35 s over the largest", after(wrong, 35.0).max() / pairs.max(), 0.1),
        Condition("how many of Cars 0-1 and 3-4 are the worst two", len(worst & {0, 3}), low=2.0),
        _collisions(dataset),
    )


def _damping(c: Choices) -> Sequence[Condition]:
    dataset = nonharmonic("ovm", c)
    pairs = peak_by_follower(dataset.spacing_error)
    return (
        about("largest error of any pair", pairs.max(), 8.0, "m"),
        about("highest speed", dataset.speed.max(), 35.0, "m/s", share=0.1),
        shrinks("largest error of the last pair over Cars 0-1", last_over_first(pairs)),
        in_range("collisions", dataset.collision_time.notnull().sum(), 0.0, 0.0),
    )


CLAIMS = (
    Claim(
        "C15",
        "OVM's errors grow along the platoon and over time.",
        "fig:ovm_0.5",
        "ovm",
        "5 vehicles, 6 m, 23 m/s, v0 = 22 m/s, h = 4 m",
        _AXES,
        _over_time,
        sweep=("alpha", _SENSITIVITIES),
    ),
    Claim(
        "C16",
        "Without delay OVM's trailing vehicles swing by ±2.5 m/s, the leader by ±2.0.",
        "fig:mod_vel",
        "compare-0",
        "A = 2 m/s, no delay",
        _AXES,
        _trailing,
        sweep=("alpha", _SENSITIVITIES),
    ),
    Claim(
        "C17",
        "With 150 ms OVM's errors exceed 75 m at first, reach ±25 m in the first cycles and end at ±1 to 2 m.",
        "fig:cacc_d",
        "compare-150",
        "A = 2 m/s, 0.15 s",
        {**_AXES, "late": ("all on-board signals", "gap and relative speed")},
        _calming,
        sweep=("alpha", _SENSITIVITIES),
    ),
    Claim(
        "C18",
        "With 1.5 s OVM is severely unstable.",
        "fig:cacc_d1",
        "compare-real",
        "A = 2 m/s, 1.5 s",
        {**_AXES, "late": ("all on-board signals", "gap and relative speed")},
        _severe,
        sweep=("alpha", _SENSITIVITIES),
    ),
    Claim(
        "C19",
        "Behind a windowed sine OVM's errors reach ±20 m, worst for Cars 0-1 and 3-4, and are damped out after 30 s.",
        "fig:ovm_disc",
        "ovm-window",
        "A = 2 m/s, 5 s window, α = 0.1, 60 s, 25 m/s",
        {"start": _AXES["start"], "omega": _AXES["omega"]},
        _windowed,
    ),
    Claim(
        "C20",
        "Behind a leader that is not harmonic OVM damps effectively: errors of about ±4 m with a peak of 8 m, "
        "speeds up to 35 m/s.",
        "fig:ovm_nh",
        "ovm-nonharmonic",
        "A = 2 m/s, α = 0.5, 25 m/s",
        {"shape": tuple(SHAPES), "start": _AXES["start"], "omega": _AXES["omega"]},
        _damping,
    ),
)
