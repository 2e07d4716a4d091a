"""Verdicts of linear theory as sentences: what `headway stability` prints and the explorer shows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from headway.analysis.linear import Linear
    from headway.analysis.stability import Chain

__all__ = ["of_chain", "times", "verdict"]


def verdict(linear: Linear, critical: Mapping[str, float]) -> str:
    """The answer for one vehicle; `critical` has its critical delays [s] by kind (`Linear.critical_delay`)."""
    late = _pattern(linear)
    if not linear.locally_stable:
        words = f"locally unstable: a disturbance of one vehicle grows at {-linear.decay_rate:.3g} 1/s"
        limit = critical["local"]
        return words + (f"; locally stable for {late} below {limit:.3g} s" if limit > 0 else " without any delay")
    limit = critical["string"]
    if linear.string_stable:
        end = "whatever the delay" if math.isinf(limit) else f"for {late} up to {limit:.3g} s"
        return f"string stable: no disturbance grows from vehicle to vehicle; so it is {end}"
    words = (
        f"string unstable: a {linear.peak_frequency:.2g} rad/s disturbance "
        f"grows {times(linear.peak_gain)} times per vehicle"
        if math.isfinite(linear.peak_frequency)
        else f"string unstable: short waves grow {linear.peak_gain:.3g} times per vehicle"
    )
    return words + (f"; stable for {late} up to {limit:.3g} s" if limit > 0 else "; not even stable without delay")


def of_chain(chain: Chain) -> list[str]:
    """What reaches the tail of a whole string and, where it is more, what happens in between."""
    head = f"head to tail over {len(chain.vehicles)} vehicles"
    if not chain.locally_stable:
        return [f"{head}: unbounded, a vehicle is locally unstable"]
    peak, worst = chain.peak, chain.worst
    if chain.head_to_tail_stable:
        words = [f"{head}: stable, no frequency is larger at the tail than at the head"]
    else:
        words = [f"{head}: a {peak.frequency:.3g} rad/s disturbance grows {peak.gain:.3g} times"]
    if worst.gain > peak.gain * (1 + 1e-6):
        words.append(f"worst in between: {worst.gain:.3g} times at {worst.frequency:.3g} rad/s")
    return words


def times(gain: float) -> str:
    """A gain with as many digits as it takes to tell it from 1."""
    digits = 3 if gain >= 1.01 else 2 + math.ceil(-math.log10(max(gain - 1.0, 1e-12)))
    return f"{gain:.{digits}g}"


def _pattern(linear: Linear) -> str:
    """Which delays are meant."""
    delay = linear.vehicle.delay
    if isinstance(delay, float) or not any(t > 0 for _, t in delay):
        return "delays of all on-board signals"
    return f"delays of {' and '.join(n for n, t in delay if t > 0)}"
