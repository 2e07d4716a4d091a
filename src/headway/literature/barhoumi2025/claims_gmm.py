"""Claims about GMM."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np

from headway import metrics
from headway.literature.barhoumi2025.settings import (
    LATE,
    SHAPES,
    after,
    amplitude_by_vehicle,
    last_over_first,
    nonharmonic,
    peak_by_follower,
    steps,
    trajectories,
)
from headway.literature.barhoumi2025.verdicts import (
    Choices,
    Claim,
    Condition,
    about,
    at_most,
    grows,
    not_amplified,
    shrinks,
    unbounded,
)  # fmt: skip

__all__ = ["CLAIMS"]

_GAPS = (10.0, 5.0, 15.0, 20.0)
_MANY = (4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0, 20.0, 25.0, 30.0)


def _first_pair(c: Choices) -> Sequence[Condition]:
    pairs = peak_by_follower(trajectories("compare-150-gmm", c).spacing_error)
    return (
        about("largest error of Cars 0-1", pairs[0], 3.0, "m"),
        not_amplified("largest ratio of a pair's error to that of the pair ahead", steps(pairs)),
    )


def _windowed(c: Choices) -> Sequence[Condition]:
    dataset = trajectories("gmm-window", c)
    wrong = dataset.spacing_error
    pairs = peak_by_follower(wrong)
    return (
        about("largest error of Cars 0-1", pairs[0], 3.5, "m"),
        at_most("largest error of the others over it", pairs[1:].max() / pairs[0], 1.0),
        at_most("largest error later than 20 s over the largest", after(wrong, 20.0).max() / pairs.max(), 0.1),
        about("highest speed of the leader", dataset.speed[0].max(), 24.75, "m/s", share=0.01),
    )


def _drop(c: Choices) -> Sequence[Condition]:
    dataset = trajectories("compare-real-gmm", c)
    low = float(metrics.least(dataset.spacing_error).min())
    share = low / float(dataset.gap[1, 0])
    return (
        Condition("least spacing error over the first gap", share, high=-0.1),
        unbounded("least spacing error", low, "m"),
        unbounded("collisions", dataset.collision_time.notnull().sum()),
    )


def _almost_constant(c: Choices) -> Sequence[Condition]:
    dataset = trajectories("gmm-1", c)
    speeds = amplitude_by_vehicle(dataset, dataset.speed, c["omega"])
    return (at_most("speed amplitude of vehicle 2 over the leader's", speeds[2] / speeds[0], 0.1),)


def _exponents(c: Choices) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Speed amplitudes of all vehicles for l = 2 and l = 1, and their mean error amplitudes."""
    return _measured(tuple(c.items()))


@functools.lru_cache(maxsize=1)
def _measured(choices: tuple[tuple[str, Any], ...]) -> tuple[np.ndarray, np.ndarray, float, float]:
    c, pairs_by_exponent = dict(choices), []
    for name in ("gmm-2", "gmm-3"):
        data = trajectories(name, c)
        pairs_by_exponent.append(
            (
                amplitude_by_vehicle(data, data.speed, c["omega"]),
                amplitude_by_vehicle(data, data.spacing_error, c["omega"])[1:],
            )
        )
    (two, wide), (one, narrow) = pairs_by_exponent
    return two, one, float(wide.mean()), float(narrow.mean())


def _larger(c: Choices) -> Sequence[Condition]:
    two, one, wide, narrow = _exponents(c)
    return (
        grows("mean error amplitude, l = 2 over l = 1", wide / narrow),
        grows("mean speed amplitude of the followers, l = 2 over l = 1", two[1:].mean() / one[1:].mean()),
        grows("l = 2: largest ratio of a vehicle's speed amplitude to that of the one ahead", steps(two)),
    )


def _attenuated(c: Choices) -> Sequence[Condition]:
    two, *_ = _exponents(c)
    return (shrinks("l = 2: speed amplitude of the last vehicle over the leader's", last_over_first(two)),)


def _bounded(c: Choices) -> Sequence[Condition]:
    dataset = nonharmonic("gmm", c)
    pairs = peak_by_follower(dataset.spacing_error)
    return (
        at_most("highest speed less 23 m/s", float(dataset.speed.max()) - 23.0, 2.0, "m/s"),
        at_most("23 m/s less the lowest speed", 23.0 - float(dataset.speed.min()), 2.0, "m/s"),
        not_amplified("largest ratio of a pair's error to that of the pair ahead", steps(pairs)),
    )


CLAIMS = (
    Claim(
        "C21",
        "With 150 ms GMM's first pair reaches errors up to 3 m; the others stay stable.",
        "fig:cacc_d",
        "compare-150",
        "A = 2 m/s, 0.15 s",
        {"gap": _GAPS, "omega": (0.63, 1.0), "late": tuple(LATE)},
        _first_pair,
        sweep=("gap", _MANY),
    ),
    Claim(
        "C22",
        "Behind a windowed sine GMM's errors peak at 3.5 m for Cars 0-1 and are near zero after 20 s; the leader "
        "peaks at 24.75 m/s.",
        "fig:gm_disc",
        "gmm-window",
        "A = 2 m/s, 5 s window, α = 1.5, l = 2, m = 1, 50 s, from about 23.5 to 23.0 m/s",
        {"gap": (9.0, 5.0, 15.0, 20.0), "speed": (23.5, 23.0), "omega": (0.63, 1.0)},
        _windowed,
        sweep=("gap", _MANY),
    ),
    Claim(
        "C23",
        "With 1.5 s GMM's spacing drops markedly, to negative errors.",
        "fig:cacc_d1",
        "compare-real",
        "A = 2 m/s, 1.5 s",
        {"gap": _GAPS, "omega": (0.63, 1.0), "late": tuple(LATE)},
        _drop,
        sweep=("gap", _MANY),
    ),
    Claim(
        "C24",
        "In GMM's configuration I the vehicles behind the first follower keep an almost constant speed.",
        "fig:gmm_config1",
        "gmm-1",
        "m = 0, l = 1",
        {"gap": _GAPS, "omega": (0.63, 0.3, 1.0)},
        _almost_constant,
        sweep=("gap", _MANY),
    ),
    Claim(
        "C25",
        "GMM with l = 2 has larger errors and speed variations than with l = 1, amplified downstream.",
        "fig:gmm_l1, fig:gmm_l2 (appendix)",
        "gmm-2",
        "m = 1, α = 1.5",
        {"gap": _GAPS, "omega": (0.63, 0.3, 1.0)},
        _larger,
        "The main text says of the same run (fig:gmm_config2) that disturbances are attenuated along the platoon.",
        _attenuated,
        ("gap", _MANY),
    ),
    Claim(
        "C27",
        "Behind a leader that is not harmonic GMM stays bounded, with speeds from 21 to 25 m/s.",
        "fig:gm_nh",
        "gmm-nonharmonic",
        "A = 2 m/s, α = 1.5, l = 2, m = 1",
        {"shape": tuple(SHAPES), "gap": _GAPS, "omega": (0.63, 1.0)},
        _bounded,
        sweep=("gap", _MANY),
    ),
)
