"""Claims about CACC."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np

from headway.literature.barhoumi2025.settings import (
    GAINS,
    SHAPES,
    after,
    amplitude_by_vehicle,
    error,
    far_apart,
    nonharmonic,
    peak_by_follower,
    steps,
    trajectories,
)
from headway.literature.barhoumi2025.verdicts import (
    ABOUT,
    SAME,
    Choices,
    Claim,
    Condition,
    about,
    at_most,
    grows,
    in_range,
    not_amplified,
    shrinks,
    unbounded,
)  # fmt: skip

__all__ = ["CLAIMS"]

_AXES = {"gains": tuple(GAINS), "error": ("policy", "spacing"), "h": (1.5, 1.0, 2.0), "omega": (0.63, 1.0)}
_WITHOUT, _PROMPT, _LATE = "cacc-1", "cacc-2", "cacc-3"
_STATED = "CACC, 6 vehicles, A = 2 m/s"


def _amplitudes(name: str, c: Choices) -> tuple[np.ndarray, np.ndarray]:
    """Steady amplitudes of the error of each pair [m] and of the speed of each follower [m/s]."""
    return _measured(name, tuple(c.items()))


@functools.lru_cache(maxsize=24)
def _measured(name: str, choices: tuple[tuple[str, Any], ...]) -> tuple[np.ndarray, np.ndarray]:
    c = dict(choices)
    dataset = trajectories(name, c)
    pairs = amplitude_by_vehicle(dataset, error(dataset, c["error"]), c["omega"])[1:]
    return pairs, amplitude_by_vehicle(dataset, dataset.speed, c["omega"])[1:]


def _largest(name: str, bound: float, c: Choices) -> Sequence[Condition]:
    dataset = trajectories(name, c)
    return (at_most("largest error of any pair", peak_by_follower(error(dataset, c["error"])).max(), bound, "m"),)


def _alike(c: Choices) -> Sequence[Condition]:
    pairs, _ = _amplitudes("compare-0-cacc", c)
    return (
        not_amplified("largest ratio of a pair's amplitude to that of the pair ahead", steps(pairs)),
        in_range("least amplitude over largest", far_apart(pairs), 1 - ABOUT, 1.0),
    )


def _visible(c: Choices) -> Sequence[Condition]:
    dataset = trajectories(_WITHOUT, c)
    speeds = amplitude_by_vehicle(dataset, dataset.speed, c["omega"])
    return (
        shrinks("speed amplitude of the last vehicle over the leader's", speeds[-1] / speeds[0]),
        Condition("the same, still to be seen", speeds[-1] / speeds[0], "", low=SAME),
    )


def _reduced(c: Choices) -> Sequence[Condition]:
    (plain, _), (prompt, _), (late, _) = (_amplitudes(name, c) for name in (_WITHOUT, _PROMPT, _LATE))
    first = np.array([plain[0], prompt[0], late[0]])
    return (
        shrinks("largest ratio with radio to without, Cars 2-3 and behind", (prompt / plain)[2:].max()),
        Condition("Cars 0-1: largest over least amplitude of the three", first.max() / first.min(), high=1 + SAME),
        unbounded("Cars 0-1: amplitude with radio over without", prompt[0] / plain[0]),
    )


def _delay_helps(c: Choices) -> Sequence[Condition]:
    (plain, slow), (prompt, quick), (late, tardy) = (_amplitudes(name, c) for name in (_WITHOUT, _PROMPT, _LATE))
    best, fast = min(plain.mean(), prompt.mean()), max(slow.mean(), quick.mean())
    return (
        shrinks("mean error amplitude over the lesser of the other two", late.mean() / best),
        grows("mean speed amplitude over the larger of the other two", tardy.mean() / fast),
    )


def _delay_hurts(c: Choices) -> Sequence[Condition]:
    (prompt, _), (late, _) = (_amplitudes(name, c) for name in (_PROMPT, _LATE))
    return (
        grows("mean error amplitude over that without delay", late.mean() / prompt.mean()),
        grows("largest ratio of a pair's amplitude to that of the pair ahead", steps(late)),
    )


def _jagged(c: Choices) -> Sequence[Condition]:
    dataset = nonharmonic("cacc", c)
    pairs = peak_by_follower(error(dataset, c["error"]))[:3]
    return (
        grows("Cars 1-2 over Cars 0-1", pairs[1] / pairs[0]),
        grows("Cars 2-3 over Cars 1-2", pairs[2] / pairs[1]),
        unbounded("Cars 0-1", pairs[0], "m"),
    )


def _window(c: Choices) -> Sequence[Condition]:
    dataset = trajectories("cacc-window", c)
    wrong = error(dataset, c["error"])
    largest = peak_by_follower(wrong).max()
    return (
        at_most("largest error of any pair", largest, 0.6, "m"),
        at_most(
            "largest error from 5 s after the window on, over the largest", after(wrong, 35.0).max() / largest, 0.1
        ),
        about("highest speed of the leader", dataset.speed[0].max(), 24.5, "m/s", share=0.01),
    )


CLAIMS = (
    Claim(
        "C01",
        "Without delay CACC keeps the spacing errors of all pairs within ±0.75 m.",
        "fig:mod_spac",
        "compare-0",
        f"{_STATED}, no delay, 50 s",
        _AXES,
        lambda c: _largest("compare-0-cacc", 0.75, c),
        sweep=("omega", tuple(np.round(np.linspace(0.1, 2.0, 20), 3).tolist())),
    ),
    Claim(
        "C01b",
        "These errors are alike for all pairs and do not grow from Car 0 to 5.",
        "fig:mod_spac",
        "compare-0",
        f"{_STATED}, no delay, 50 s",
        _AXES,
        _alike,
        sweep=("omega", tuple(np.round(np.linspace(0.3, 2.0, 18), 3).tolist())),
    ),
    Claim(
        "C02",
        "With 150 ms of radio delay CACC keeps all errors within ±0.6 m.",
        "fig:cacc_d",
        "compare-150",
        f"{_STATED}, 0.15 s, 50 s",
        _AXES,
        lambda c: _largest("compare-150-cacc", 0.6, c),
        sweep=("omega", tuple(np.round(np.linspace(0.1, 2.0, 20), 3).tolist())),
    ),
    Claim(
        "C03",
        "Without radio, CACC attenuates the oscillations, but they remain visible.",
        "fig:cacc1",
        "cacc-1",
        "no radio",
        {k: v for k, v in _AXES.items() if k != "error"},
        _visible,
        sweep=("omega", tuple(np.round(np.linspace(0.2, 2.0, 19), 3).tolist())),
    ),
    Claim(
        "C04",
        "Radio without delay reduces the errors from vehicle 3 on; those of Cars 0-1 are the same in all "
        "configurations.",
        "fig:cacc2",
        "cacc-2",
        "radio, no delay, against no radio and 1.5 s",
        _AXES,
        _reduced,
        sweep=("omega", tuple(np.round(np.linspace(0.3, 2.0, 18), 3).tolist())),
    ),
    Claim(
        "C05",
        "With 1.5 s of radio delay the spacing errors are smaller than without radio and than without delay; "
        "the speeds of the followers vary more.",
        "fig:cacc3",
        "cacc-3",
        "radio delay 1.5 s",
        _AXES,
        _delay_helps,
        "Elsewhere (appendix, fig:cacc_harm) the same delay makes errors larger and lets them grow downstream.",
        _delay_hurts,
        ("omega", tuple(np.round(np.linspace(0.3, 2.0, 18), 3).tolist())),
    ),
    Claim(
        "C06",
        "Behind a leader that is not harmonic and with 1.5 s of radio delay errors grow from Cars 0-1 to 2-3.",
        "fig:cacc_harm",
        "cacc-nonharmonic",
        "A = 2 m/s, 23 m/s, h = 1.5 s, 1.5 s",
        {
            "gains": tuple(GAINS),
            "error": ("policy", "spacing"),
            "shape": tuple(SHAPES),
            "edge": (0.0, 0.5),
            "omega": (0.63, 1.0),
        },
        _jagged,
        sweep=("h", (0.3, 0.45, 0.6, 0.75, 0.9, 1.05, 1.2, 1.35, 1.5, 1.75, 2.0)),
    ),
    Claim(
        "C07",
        "Behind a windowed sine CACC's errors stay within ±0.6 m and are near zero after 30 s; the leader peaks at "
        "24.5 m/s.",
        "fig:cacc_disc",
        "cacc-window",
        "A = 2 m/s, 25 s window, 50 s, from about 23.5 to 23.0 m/s",
        {
            "gains": tuple(GAINS),
            "error": ("policy", "spacing"),
            "h": (1.5, 1.0, 2.0),
            "radio": (0.15, 0.0, 1.5),
            "omega": (0.63, 1.0),
            "speed": (23.0, 23.5),
        },
        _window,
        sweep=("omega", tuple(np.round(np.linspace(0.2, 2.0, 19), 3).tolist())),
    ),
)
