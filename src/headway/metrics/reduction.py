"""Extremes of signals as plain arrays, and what metrics are made of them: with or without trajectories.

A study keeps highest and least values and mean squares of signals while the kernel runs; the command line and
`Study` points of their own have the arrays of a run; `headway.metrics` has datasets. All meet in `Extremes`,
from which each form makes its metric, to the same last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from headway.arrays import Array
from headway.engine.measured import ABOUT_GAPS, EXTREMES, SQUARE, Reduction
from headway.metrics.extremes import FREE, FROM_ZERO, Bounds, extreme_of, refined, rms_of
from headway.metrics.registry import Extremes, Whose

__all__ = ["FORMS", "Form", "closest", "extremes", "from_batches", "of_run", "ratio_to_ahead", "signal_bounds"]


#: amplitudes below this are nothing to compare with, in the unit of the signal
_NOTHING = 1e-12


class Form(NamedTuple):
    """A metric that any signal can have.

    Attributes:
        mode: what the kernel keeps for it, EXTREMES or SQUARE.
        make: its values from the extremes of the signal.
        meaning: its meaning, where the braces stand for the signal.
        whose: the follower that speaks for a platoon.
    """

    mode: int
    make: Callable[[Extremes], Array]
    meaning: str
    whose: Whose


def ratio_to_ahead(e: Extremes) -> Array:
    """Amplitude over that of the vehicle ahead; NaN for the leader, behind a steady vehicle, and in a broken run."""
    own = 0.5 * (e.highest - e.least)
    ratio = np.full_like(own, np.nan)
    with np.errstate(all="ignore"):
        ratio[1:] = own[1:] / np.where(own[:-1] > _NOTHING, own[:-1], np.nan)
    return np.where(e.whole, ratio, np.nan)


def closest(e: Extremes) -> Array:
    """Least gap: 0 for a pair that collided."""
    return np.where(np.isfinite(e.collision), 0.0, np.maximum(e.least, 0.0))


#: name of a metric, where the braces stand for the signal → what it is
FORMS: dict[str, Form] = {
    "peak_{}": Form(EXTREMES, lambda e: np.fmax(np.abs(e.highest), np.abs(e.least)), "peak of {}", "largest"),
    "rms_{}": Form(SQUARE, lambda e: e.rms, "r.m.s. of {}", "largest"),
    "least_{}": Form(EXTREMES, lambda e: e.least, "least {}", "least"),
    "largest_{}": Form(EXTREMES, lambda e: e.highest, "largest {}", "largest"),
    "{}_amplitude": Form(EXTREMES, lambda e: 0.5 * (e.highest - e.least), "amplitude of {}", "largest"),
    "{}_amplitude_ratio": Form(EXTREMES, ratio_to_ahead, "amplitude of {} over that of the vehicle ahead", "largest"),
}


def signal_bounds(signal: str, limits: Bounds = FREE) -> Bounds:
    """Least and largest value that a signal can have.

    Args:
        signal: its name.
        limits: least and largest acceleration [m/s²].
    """
    return {"acceleration": limits, "speed": FROM_ZERO, "gap": FROM_ZERO}.get(signal, FREE)


def extremes(time: Array, values: Array, mode: int, bounds: Bounds, collision: Any = np.nan) -> Extremes:
    """Extremes (vehicle, …) of one signal.

    Args:
        time: (T,) [s].
        values: (vehicle, …, T).
        mode: what is needed, EXTREMES or SQUARE or both.
        bounds: least and largest value that the signal can have.
        collision: when vehicles collided [s], NaN where they did not.
    """
    none = np.full(values.shape[:-1], np.nan)
    high, low = (extreme_of(time, values, s, bounds) for s in (1.0, -1.0)) if mode & EXTREMES else (none, none)
    square = rms_of(time, values) if mode & SQUARE else none
    return Extremes(high, low, square, collision, np.isfinite(values[..., -1]))


def from_batches(
    time: Array, batches: list[dict[str, Reduction]], limits: Bounds, collision: Array
) -> dict[str, Extremes]:
    """Extremes (vehicle, lane) of batches of one structure, side by side.

    Args:
        time: (T,) [s].
        batches: what the kernel kept of each batch, by signal.
        limits: least and largest acceleration (vehicle, lane) [m/s²].
        collision: (vehicle, lane) [s], NaN where there is none.
    """
    result = {}
    to_the_end = ~np.logical_or.accumulate(np.isfinite(collision), axis=0)
    for signal in batches[0]:
        parts: list[Reduction] = [batch[signal] for batch in batches]
        best = np.concatenate([p.best for p in parts], axis=2)
        place = np.concatenate([p.place for p in parts], axis=2)
        around = np.concatenate([p.around for p in parts], axis=3)
        front = 1 if signal in ABOUT_GAPS else 0  # the leader has none
        high, low = np.full(best.shape, np.nan)
        least, most = signal_bounds(signal, limits)
        for target, side, bound in ((high, 0, most), (low, 1, np.negative(least))):
            of = (side, slice(front, None))
            far = np.broadcast_to(bound, best.shape[1:])[front:].ravel()
            values = refined(time, best[of].ravel(), place[of].ravel(), around[side, :, front:].reshape(5, -1), far)
            target[front:] = values.reshape(target[front:].shape)
        square = np.concatenate([p.mean_square for p in parts], axis=1)
        has_value = (np.arange(best.shape[1]) >= front)[:, None]
        result[signal] = Extremes(high, -low, np.sqrt(square), collision, to_the_end & has_value)
    return result


def of_run(
    time: Array, variables: Mapping[str, Array], needs: Mapping[str, int], limits: Bounds, collision: Any
) -> dict[str, Extremes]:
    """Extremes (vehicle,) of signals from the trajectories of one run.

    Args:
        time: (T,) [s].
        variables: (vehicle, T) by name.
        needs: signal → what is needed of it, EXTREMES or SQUARE or both.
        limits: least and largest acceleration (vehicle,) [m/s²].
        collision: (vehicle,) [s], NaN where there is none.
    """
    return {s: extremes(time, variables[s], mode, signal_bounds(s, limits), collision) for s, mode in needs.items()}
