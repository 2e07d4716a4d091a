"""Verdicts of linear theory as sentences: what `headway stability` prints and the explorer shows.

The command line loads this file at its start, so theory itself is imported for type checkers only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from headway.theory.linear import Linear
    from headway.theory.platoon import Chain

__all__ = ["chain_verdict", "gain_text", "vehicle_verdict"]


def vehicle_verdict(linear: Linear, critical: Mapping[str, float]) -> str:
    """Say in one sentence whether a vehicle is stable, how much it amplifies, and up to which delay that holds.

    Args:
        linear: the vehicle.
        critical: its critical delays [s] by kind, see `Linear.critical_delays`.

    Returns:
        The sentence. For a law that hears the platoon leader it says why there is no verdict on one vehicle.
    """
    if not linear.locally_stable:
        rate = -linear.decay_rate
        grows = f"grows at {rate:.3g} 1/s" if rate > 0 else "does not die down"
        words = f"locally unstable: a disturbance of one vehicle {grows}"
        return words + _until(linear, "local", critical["local"], "locally stable", " without any delay")
    if linear.hears_leader:
        return (
            "locally stable; it hears the platoon leader, so no growth per vehicle is defined, only that of a platoon"
        )
    limit = critical["string"]
    if linear.string_stable:
        words = "string stable: no disturbance grows from vehicle to vehicle"
        if limit == 0.0:
            return f"{words}; {_pattern(linear)[0]}, however short, lose that: {linear.why_none('string')}"
        return f"{words}; so it is " + (
            "whatever the delay" if math.isinf(limit) else f"for {' '.join(_pattern(linear))} up to {limit:.3g} s"
        )
    words = (
        f"string unstable: a {linear.peak_frequency:.2g} rad/s disturbance "
        f"grows {gain_text(linear.peak_gain)} times per vehicle"
        if math.isfinite(linear.peak_frequency)
        else f"string unstable: short waves grow {linear.peak_gain:.3g} times per vehicle"
    )
    return words + _until(linear, "string", limit, "stable", "; not even stable without delay")


def _until(linear: Linear, kind: str, limit: float, stable: str, never: str) -> str:
    """Say up to which delay a verdict holds that is lost now."""
    if limit > 0.0:
        bound = "below" if kind == "local" else "up to"
        return f"; {stable} for {' '.join(_pattern(linear))} {bound} {limit:.3g} s"
    reason = linear.why_none(kind)
    return f"; {stable} only without delay: {reason}" if reason else never


def chain_verdict(chain: Chain) -> list[str]:
    """Say what reaches the tail of a whole string and, where that is more, what happens in between.

    Args:
        chain: the string.

    Returns:
        One or two sentences.
    """
    head = f"head to tail over {len(chain.vehicles)} vehicles"
    if not chain.locally_stable:
        return [f"{head}: unbounded, a vehicle is locally unstable"]
    peak, worst = chain.peak, chain.worst
    if chain.head_to_tail_stable:
        words = [f"{head}: stable, no frequency is larger at the tail than at the head"]
    else:
        words = [f"{head}: a {peak.frequency:.3g} rad/s disturbance grows {gain_text(peak.gain)} times"]
    if worst.gain > peak.gain * (1 + 1e-6):
        words.append(f"worst in between: {gain_text(worst.gain)} times at {worst.frequency:.3g} rad/s")
    return words


def gain_text(gain: float) -> str:
    """Write a gain with as many digits as it takes to tell it from 1."""
    digits = 3 if gain >= 1.01 else 2 + math.ceil(-math.log10(max(gain - 1.0, 1e-12)))
    return f"{gain:.{digits}g}"


def _pattern(linear: Linear) -> tuple[str, str]:
    """Return which delays are meant, and which of them a number is where they differ."""
    delay = linear.vehicle.delay
    late = {} if isinstance(delay, float) else {n: t for n, t in delay if t > 0}
    if not late:
        return "delays of all on-board signals", ""
    longest = linear.slowed(1.0).vehicle.perception.longest
    names = f"delays of {' and '.join(late)}"
    if all(t == longest for t in late.values()):
        return names, ""
    return f"{names} in the ratio {' : '.join(f'{t:g}' for t in late.values())},", "the longest"
