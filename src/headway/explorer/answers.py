"""The slower part of the page, for when the hand rests: verdicts in words, safety and energy, the stability map."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable
from concurrent.futures import CancelledError
from typing import Any

import numpy as np

from headway.engine.run import Result
from headway.engine.trajectories import to_dataset
from headway.errors import HeadwayWarning
from headway.explorer.picture import Picture, linear_in_view
from headway.explorer.state import PageState
from headway.metrics.sizes import UNPHYSICAL
from headway.models import RADIO
from headway.theory import sentences
from headway.theory.map import axis_unit, label, stability_map
from headway.theory.platoon import head_to_tail

__all__ = ["key_figures", "map_key", "map_of", "verdict_sentences"]


def verdict_sentences(state: PageState, stale: Callable[[], bool]) -> list[str]:
    """The sentences of `headway stability` for every different vehicle, and for the whole string.

    Raises:
        CancelledError: When `stale()` turns true.
    """
    scenario = state.scenario
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HeadwayWarning)
        chain = head_to_tail(
            scenario.followers, scenario.cruise, scenario.initial_gaps() if scenario.gaps is not None else None
        )
    lines = []
    for linear in dict.fromkeys(chain.vehicles):
        if stale():
            raise CancelledError
        who = [n for n, other in enumerate(chain.vehicles, start=1) if other == linear]
        name = f"vehicle {who[0]}" + (f" and {len(who) - 1} like it" if len(who) > 1 else "")
        lines.append(
            f"{name}, {linear.vehicle.model.name}: {sentences.vehicle_verdict(linear, linear.critical_delays())}"
        )
    if stale():
        raise CancelledError
    return lines + sentences.chain_verdict(chain)


#: metrics of the table, and what it calls them; the registry says which vehicle speaks for the platoon
_FIGURES = {
    "collisions": "collisions",
    "least_gap": "least gap",
    "ttc": "least time to collision",
    "tet": "longest time with TTC below 3 s",
    "drac": "largest deceleration needed (DRAC)",
    "least_acceleration": "hardest braking (least acceleration)",
    "peak_spacing_error": "peak spacing error",
    "rms_jerk": "r.m.s. jerk",
    "fuel(per=distance)": "fuel of the last vehicle",
    "electric_energy(per=distance)": "electric energy of the last vehicle",
}


def key_figures(state: PageState, result: Result) -> list[dict[str, Any]]:
    """Safety, comfort and energy of a run.

    Returns:
        A table for each figure: `name`, `value` (None if it has none), `unit` and the `vehicle` it is of.
    """
    from headway.metrics.registry import named

    dataset = to_dataset(state.scenario, result)
    # what an unfinished ride cost says nothing of the ride
    finished = bool(np.isfinite(dataset.speed.values[-1, -1]))
    figures: list[dict[str, Any]] = []
    for name, title in _FIGURES.items():
        metric = named(name)
        values = np.asarray(metric.of(dataset).values, dtype=float)
        which: int | None = None
        if values.ndim == 0:
            value: float | None = float(values)
        else:
            row = np.where(np.isfinite(values[1:]), values[1:], np.nan)
            if title.endswith("last vehicle"):
                which = row.size if finished and np.isfinite(row[-1]) else None
            elif np.isfinite(row).any():
                which = 1 + int(np.nanargmin(row) if metric.whose == "least" else np.nanargmax(row))
            value = None if which is None else float(f"{values[which]:.3g}")
        unit = "" if metric.unit == "1" else metric.unit
        figures.append({"name": title, "value": value, "unit": unit, "vehicle": which})
        if name == "least_acceleration" and value is not None and value < -UNPHYSICAL:
            figures[-1]["name"] += ", which no car can"
    return figures


def map_key(state: PageState) -> str:
    """Text that is equal for states with the same map."""
    scenario, axes = state.scenario, [n for n, _, _ in state.axes]
    vehicle = scenario.followers[state.first]
    parameters = {n: x for n, x in vehicle.model.items if n not in axes}
    delay, signals = vehicle.delay, vehicle.model.law.signals
    late = dict.fromkeys((n for n in signals if n not in RADIO), delay) if isinstance(delay, float) else dict(delay)
    pattern: Any = [] if "delay" in axes else sorted(
        (n, t) for n, t in late.items()
        if f"delay.{n}" not in axes and not ("radio_delay" in axes and n in RADIO and n in signals)
    )  # fmt: skip
    speed = None if "speed" in axes else scenario.cruise
    lag = None if "lag" in axes else vehicle.lag
    return json.dumps([vehicle.model.name, parameters, pattern, lag, speed, scenario.gaps, state.axes])


def map_of(state: PageState, points: int) -> Picture:
    """The map of string stability around the vehicle that the page looks at, `points` each way."""
    linear = linear_in_view(state)
    car = linear.vehicle
    gap = linear.gap if car.model.rests_everywhere else None
    axes = {name: (low, high, points) for name, low, high in state.axes}
    speed = None if "speed" in axes else linear.speed
    result = stability_map(car, axes, speed=speed, gap=gap)
    arrays = dict(zip(("x", "y"), result.axes.values(), strict=True))
    arrays["verdict"] = result.dataset.verdict.values.T.astype(float)
    lines = result.boundary.get("string stable", ())
    joined = [piece for line in lines for piece in (line, np.full((1, 2), math.nan))]
    arrays["boundary"] = np.concatenate(joined).T if joined else np.empty((2, 0))
    named = [{"name": n, "unit": axis_unit(car, n), "text": label(car, n)} for n in axes]
    return Picture({"axes": named, "classes": list(result.classes)}, arrays)
