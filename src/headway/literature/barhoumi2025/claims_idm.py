"""Claims about IDM."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from headway import metrics
from headway.literature.barhoumi2025.settings import (
    GAINS,
    IDM_SETS,
    LATE,
    SHAPES,
    amplitude_by_vehicle,
    error,
    far_apart,
    last_over_first,
    nonharmonic,
    peak_by_follower,
    steps,
    trajectories,
)  # fmt: skip
from headway.literature.barhoumi2025.verdicts import (
    ABOUT,
    Choices,
    Claim,
    Condition,
    about,
    at_least,
    grows,
    in_range,
    not_amplified,
    shrinks,
    unbounded,
)  # fmt: skip

__all__ = ["CLAIMS"]

_START = ("equilibrium", "typed in")
_OMEGA = (0.63, 0.3, 1.0)


def _persists(c: Choices) -> Sequence[Condition]:
    dataset = trajectories("idm-1", c)
    speeds = np.asarray(metrics.amplitude(dataset.speed).values, dtype=float)
    early, late = (peak_by_follower(dataset.spacing_error, *span)[-1] for span in ((0.0, 30.0), (30.0, 60.0)))
    return (
        grows("largest error of the last pair over Cars 0-1", last_over_first(peak_by_follower(dataset.spacing_error))),
        grows("half the range of speeds, last vehicle over the leader", last_over_first(speeds)),
        Condition("last pair: largest error in the second half over that in the first", late / early, low=1 - ABOUT),
    )


def _calm(c: Choices) -> Sequence[Condition]:
    dataset = trajectories("idm-2", c)
    speeds = amplitude_by_vehicle(dataset, dataset.speed, c["omega"])
    return (not_amplified("largest ratio of a vehicle's speed amplitude to that of the one ahead", steps(speeds)),)


def _large_first(c: Choices) -> Sequence[Condition]:
    pairs = peak_by_follower(error(dataset := trajectories("compare-150-idm", c), c["error"]))
    return (
        about("largest error of Cars 0-1", pairs[0], 15.0, "m"),
        not_amplified("largest ratio of a pair's error to that of the pair ahead", steps(pairs)),
        unbounded("collisions", metrics.summary(dataset).collision_time.notnull().sum()),
    )


def _late(c: Choices) -> Sequence[Condition]:
    dataset = trajectories("compare-real-idm", c)
    wrong = dataset.spacing_error
    pairs, end = peak_by_follower(wrong), peak_by_follower(wrong, 40.0, 50.0)
    return (
        grows("largest error of the last pair over Cars 0-1", last_over_first(pairs)),
        at_least("largest error of any pair", pairs.max(), 10.0, "m"),
        shrinks("largest error in the last 10 s over the largest", end.max() / pairs.max()),
    )


def _braking(c: Choices, name: str) -> float:
    """Return the deceleration [m/s²] of the follower that the choices name."""
    acceleration = trajectories(name, c).acceleration
    strongest = -np.asarray(metrics.least(acceleration).values[1:], dtype=float)
    return float(strongest[0] if c["vehicle"] == "first" else strongest[-1])


def _steeper(c: Choices) -> Sequence[Condition]:
    idm, cacc = (_braking(c, f"compare-0-{model}") for model in ("idm", "cacc"))
    return (
        in_range(
            "deceleration of IDM over that of CACC, less 1", idm / cacc - 1, 0.15 * (1 - ABOUT), 0.20 * (1 + ABOUT)
        ),
        unbounded("deceleration of IDM", idm, "m/s²"),
        unbounded("deceleration of CACC", cacc, "m/s²"),
    )


def _swings(c: Choices) -> Sequence[Condition]:
    dataset = trajectories("idm-window", c)
    wrong = dataset.spacing_error
    top, bottom = float(wrong.max()), float(wrong.min())
    return (
        about("largest spacing error", top, 15.0, "m"),
        about("least spacing error", -bottom, 5.0, "m below 0"),
        about("highest speed", dataset.speed.max(), 35.0, "m/s", share=0.05),
        about("lowest speed", dataset.speed.min(), 20.0, "m/s", share=0.05),
        grows("largest error of the last pair over Cars 0-1", last_over_first(peak_by_follower(wrong))),
    )


def _bounded(c: Choices) -> Sequence[Condition]:
    dataset = nonharmonic("idm", c)
    speeds = np.asarray(metrics.amplitude(dataset.speed.sel(time=slice(25.0, None))).values, dtype=float)
    return (
        not_amplified("largest ratio of a vehicle's speed amplitude to that of the one ahead", steps(speeds)),
        in_range("least speed amplitude over largest", far_apart(speeds), 1 - ABOUT, 1.0),
    )


def _axes(**more: tuple[Any, ...]) -> dict[str, tuple[Any, ...]]:
    return {**more, "idm": tuple(IDM_SETS)}


_FREQUENCIES = tuple(np.round(np.linspace(0.15, 1.5, 19), 3).tolist())

CLAIMS = (
    Claim(
        "C08",
        "IDM without its free-road and relative-speed terms amplifies disturbances, and they persist.",
        "fig:spac_idm",
        "idm-1",
        "configuration I, 5 vehicles, 27.8 m/s, T = 1.5 s",
        _axes(omega=(0.3, 0.63, 1.0)),
        _persists,
        sweep=("omega", _FREQUENCIES),
    ),
    Claim(
        "C09",
        "Standard IDM does not amplify the oscillations.",
        "fig:idm",
        "idm-2",
        "configuration II, 5 vehicles, 27.8 m/s, T = 1.5 s",
        _axes(omega=_OMEGA, start=_START),
        _calm,
        sweep=("omega", _FREQUENCIES),
    ),
    Claim(
        "C10",
        "With 150 ms, IDM's spacing errors reach up to 15 m at the first follower and decrease downstream.",
        "fig:cacc_d",
        "compare-150",
        "A = 2 m/s, 0.15 s",
        _axes(start=_START, speed=(23.0, 25.0, 27.8), error=("spacing", "s* - s"), omega=_OMEGA),
        _large_first,
        sweep=("speed", (15.0, 17.5, 20.0, 22.5, 25.0, 26.0, 27.0, 27.8, 29.0)),
    ),
    Claim(
        "C11",
        "With 1.5 s, IDM's oscillations amplify downstream beyond 10 m and are then partly damped.",
        "fig:cacc_d1",
        "compare-real",
        "A = 2 m/s, 1.5 s",
        _axes(late=tuple(LATE), start=_START, speed=(23.0, 27.8), omega=_OMEGA),
        _late,
        sweep=("omega", _FREQUENCIES),
    ),
    Claim(
        "C12",
        "IDM's decelerations are 15 to 20 % steeper than CACC's.",
        "fig:mod_vel",
        "compare-0",
        "A = 2 m/s, no delay",
        _axes(gains=tuple(GAINS), vehicle=("first", "last"), start=_START, omega=(0.63, 1.0), h=(1.5, 1.0, 2.0)),
        _steeper,
        sweep=("omega", _FREQUENCIES),
    ),
    Claim(
        "C13",
        "Behind a windowed sine of ±1 m/s IDM's errors range from -5 to +15 m and its speeds from 20 to 35 m/s, "
        "growing downstream.",
        "fig:idm_disc",
        "idm-window",
        "4 vehicles, A = 1 m/s, ω = 1 rad/s, 5 s window, 60 s, 25 m/s, T = 1.5 s, δ = 4",
        _axes(start=_START),
        _swings,
    ),
    Claim(
        "C14",
        "Behind a leader that is not harmonic IDM's oscillations stay bounded, are not amplified and are alike "
        "for all vehicles.",
        "fig:idm_nh",
        "idm-nonharmonic",
        "A = 2 m/s, ω = 0.63 rad/s, T = 1.5 s, δ = 4",
        _axes(shape=tuple(SHAPES), start=_START, speed=(23.0, 27.8)),
        _bounded,
        sweep=("speed", (5.0, 10.0, 15.0, 20.0, 23.0, 25.0, 27.8)),
    ),
)
