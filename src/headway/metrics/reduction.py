"""The metrics of a study: which signals each needs and what it makes of their extremes.

Names are those of `headway.metrics`, whose values these are to the last bit: `peak_`, `rms_`, `least_` and
`largest_` before a signal, `_amplitude` and `_amplitude_ratio` after it, and `collision_time`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from headway.engine.measured import ABOUT_GAPS, EXTREMES, QUANTITIES, SQUARE, Reduction
from headway.errors import HeadwayError, shorten, unknown_name
from headway.metrics.extremes import FREE, FROM_ZERO, Bounds, extreme_of, refined, rms_of
from headway.schema import VARIABLES

__all__ = ["COLLISION", "DEFAULT", "Extremes", "Measure", "Own", "chosen", "from_batches", "from_trajectories"]

Array = NDArray[np.float64]

COLLISION = "collision_time"

#: what is kept of each point if nothing is asked for: what `headway.metrics.summary` gives
DEFAULT = (
    "peak_spacing_error", "rms_spacing_error", "speed_amplitude", "speed_amplitude_ratio", "least_gap", COLLISION,
)  # fmt: skip


class Extremes(NamedTuple):
    """What is known of one signal: arrays (vehicle, …) of its highest and least value and its mean square's root."""

    highest: Array
    least: Array
    rms: Array


@dataclass(frozen=True)
class Measure:
    """A metric that is made of extremes of one signal."""

    name: str
    signal: str
    mode: int
    make: Callable[[Extremes], Array]
    unit: str
    long_name: str

    def __reduce__(self) -> tuple[Any, ...]:
        return _named, (self.name,)


def _named(name: str) -> Measure:
    """The built-in metric of this name, as another process finds it."""
    return _BUILT_IN[name]


@dataclass(frozen=True)
class Own:
    """A metric of one's own: a function of the trajectories of a point."""

    name: str
    function: Callable[[Any], Any]


def _ratio(e: Extremes) -> Array:
    own = 0.5 * (e.highest - e.least)
    ratio = np.full_like(own, np.nan)
    with np.errstate(all="ignore"):
        ratio[1:] = own[1:] / np.where(own[:-1] > 1e-12, own[:-1], np.nan)
    return ratio


_FORMS: dict[str, tuple[int, Callable[[Extremes], Array], str]] = {
    "peak_{}": (EXTREMES, lambda e: np.fmax(np.abs(e.highest), np.abs(e.least)), "peak of {}"),
    "rms_{}": (SQUARE, lambda e: e.rms, "r.m.s. of {}"),
    "least_{}": (EXTREMES, lambda e: e.least, "least {}"),
    "largest_{}": (EXTREMES, lambda e: e.highest, "largest {}"),
    "{}_amplitude": (EXTREMES, lambda e: 0.5 * (e.highest - e.least), "amplitude of {}"),
    "{}_amplitude_ratio": (EXTREMES, _ratio, "amplitude of {} over that of the vehicle ahead"),
}


def _built_in() -> dict[str, Measure]:
    found = {}
    for signal in QUANTITIES:
        variable = VARIABLES[signal]
        for form, (mode, make, what) in _FORMS.items():
            unit = "1" if form.endswith("ratio") else variable.unit
            name = form.format(signal)
            found[name] = Measure(name, signal, mode, make, unit, what.format(variable.long_name))
    return found


_BUILT_IN = _built_in()


def chosen(metrics: Iterable[Any] | None) -> tuple[Measure | Own | str, ...]:
    """The metrics asked for: names, or functions of a dataset of trajectories; `HeadwayError` for others."""
    if isinstance(metrics, str):
        metrics = (metrics,)
    found: list[Measure | Own | str] = []
    for metric in DEFAULT if metrics is None else metrics:
        if callable(metric):
            found.append(Own(getattr(metric, "__name__", "own"), metric))
        elif metric == COLLISION:
            found.append(COLLISION)
        elif metric in _BUILT_IN:
            found.append(_BUILT_IN[metric])
        elif isinstance(metric, str):
            raise unknown_name("metric", metric, [*_BUILT_IN, COLLISION])
        else:
            raise HeadwayError(f"metric {shorten(metric)} is neither a name nor a function of trajectories")
    names = [m if isinstance(m, str) else m.name for m in found]
    for name in names:
        if names.count(name) > 1:
            raise HeadwayError(f"metrics: {name} is given twice")
    return tuple(found)


def _within(signal: str, limits: Bounds) -> Bounds:
    return {"acceleration": limits, "speed": FROM_ZERO, "gap": FROM_ZERO}.get(signal, FREE)


def from_batches(time: Array, batches: list[dict[str, Reduction]], limits: Bounds) -> dict[str, Extremes]:
    """Extremes (vehicle, lane) of batches of one structure, side by side; `limits` (vehicle, lane) of accelerations."""
    found = {}
    for signal in batches[0]:
        parts = [batch[signal] for batch in batches]
        best = np.concatenate([p.best for p in parts], axis=2)
        place = np.concatenate([p.place for p in parts], axis=2)
        around = np.concatenate([p.around for p in parts], axis=3)
        front = 1 if signal in ABOUT_GAPS else 0  # the leader has none
        high, low = np.full(best.shape, np.nan)
        least, most = _within(signal, limits)
        for found_side, side, bound in ((high, 0, most), (low, 1, np.negative(least))):
            of = (side, slice(front, None))
            far = np.broadcast_to(bound, best.shape[1:])[front:].ravel()
            values = refined(time, best[of].ravel(), place[of].ravel(), around[side, :, front:].reshape(5, -1), far)
            found_side[front:] = values.reshape(found_side[front:].shape)
        square = np.concatenate([p.mean_square for p in parts], axis=1)
        found[signal] = Extremes(high, -low, np.sqrt(square))
    return found


def from_trajectories(
    time: Array, variables: Mapping[str, Array], needs: Mapping[str, int], limits: Bounds
) -> dict[str, Extremes]:
    """The same (vehicle,) of the trajectories (vehicle, time) of one run."""
    found = {}
    for signal, mode in needs.items():
        values = variables[signal]
        none = np.full(values.shape[0], np.nan)
        within = _within(signal, limits)
        high, low = (extreme_of(time, values, s, within) for s in (1.0, -1.0)) if mode & EXTREMES else (none, none)
        found[signal] = Extremes(high, low, rms_of(time, values) if mode & SQUARE else none)
    return found
