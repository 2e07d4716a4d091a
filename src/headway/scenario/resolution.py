"""Whether a step is fine enough for what happens within it: the leader's swings and the laws' own rates."""

from __future__ import annotations

import functools
import math
import warnings

import numpy as np

from headway.errors import HeadwayWarning
from headway.models import Model
from headway.scenario.scenario import Scenario

__all__ = ["coarse_step", "warn_of_coarse_step"]

#: largest angle [rad] of the leader's fastest swing within a step: twelve steps a period, an error of 1e-4
_ANGLE = 0.5

#: largest product of a step and a law's fastest rate: a fourth-order step then errs by 1 %, and grows above 2.8
_RATE = 1.0


def coarse_step(scenario: Scenario) -> str | None:
    """A sentence if the longest step is too coarse for the leader or for a law, else None.

    Cheap: frequencies that the leader names, and partial derivatives of each different vehicle at rest.
    """
    step = scenario.step
    fastest = max(scenario.leader.frequencies, default=0.0)
    if fastest * step > _ANGLE:
        return (
            f"steps of {step:g} s are too coarse for the leader's {fastest:g} rad/s, of which they see "
            f"{2 * math.pi / (fastest * step):.2g} points a period; write dt = {_ANGLE / fastest:.2g} or less"
        )
    if scenario.scheme == "ballistic":
        # the fourth-order scheme ends its steps on every knot, this one steps over them
        knots = np.diff(scenario.motion.start[scenario.motion.start <= scenario.end])
        if knots.size and (least := float(knots.min())) < 0.5 * step and np.count_nonzero(knots < 0.5 * step) > 2:
            return (
                f"ballistic steps of {step:g} s step over the leader's corners, up to {least:g} s apart; write "
                f"dt = {least:.2g} or less"
            )
    speed, seen = scenario.cruise, set()
    for number, (vehicle, gap) in enumerate(zip(scenario.followers, scenario.initial_gaps(), strict=True), start=1):
        if vehicle.model in seen:
            continue
        seen.add(vehicle.model)
        rate = _rate(vehicle.model, speed, gap)
        if rate * step > _RATE:
            return (
                f"steps of {step:g} s are too coarse for follower {number}: {vehicle.model.name} answers within "
                f"{1.0 / rate:.2g} s at {speed:g} m/s; write dt = {_RATE / rate:.2g} or less"
            )
    return None


def warn_of_coarse_step(scenario: Scenario, level: int = 4) -> None:
    """Give a `HeadwayWarning` if the step is too coarse; `level` frames up is who asked for it."""
    if (sentence := coarse_step(scenario)) is not None:
        warnings.warn(sentence, HeadwayWarning, stacklevel=level)


@functools.lru_cache(maxsize=1024)
def _rate(model: Model, speed: float, gap: float) -> float:
    """The fastest rate [1/s] with which a law answers at rest; 0 where it has no derivatives there.

    `gap` [m] is that of laws which rest at any. Where others begin too close, they are steeper for a moment.
    """
    try:
        slopes = model.partials(speed, gap if model.rests_everywhere else None)
    except Exception:  # a law of one's own may raise anything; the simulation says what
        return 0.0
    damping = abs(slopes.get("v", 0.0)) + abs(slopes.get("dv", 0.0))
    rate = max(damping, math.sqrt(abs(slopes.get("s", 0.0))))
    return rate if math.isfinite(rate) else 0.0
