"""What a driver or controller knows, and how late.

A channel turns the delays a person gives into one *source* for each signal that a law perceives:
whose motion is looked at, and how long ago. Delay lives here and in the stepper, never in a law.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from headway.checked import SMALLEST, number
from headway.errors import HeadwayError, shorten, unknown_name
from headway.models import RADIO, SIGNALS

__all__ = ["Channel", "normalize_delay"]

#: A delay as it was given: one number for all on-board signals, or pairs (signal, seconds).
Delay = float | tuple[tuple[str, float], ...]


def normalize_delay(value: Any) -> Delay:
    """A delay as typed (number or mapping) in hashable form; `HeadwayError` if it is neither or negative."""
    if isinstance(value, Mapping):
        pairs = []
        for name, seconds in value.items():
            if name not in SIGNALS:
                raise unknown_name("signal in delay", name, SIGNALS)
            pairs.append((str(name), _seconds(f"delay.{name}", seconds)))
        return tuple(sorted(pairs))
    if isinstance(value, tuple):
        if not all(isinstance(pair, tuple) and len(pair) == 2 and isinstance(pair[0], str) for pair in value):
            raise HeadwayError(f"delay = {shorten(value)} is neither a number of seconds nor seconds by signal")
        return normalize_delay(dict(value))
    return _seconds("delay", value)


def _seconds(place: str, value: Any) -> float:
    seconds = number(value, place, "s", "a number of seconds")
    if seconds < 0:
        raise HeadwayError(f"{place} = {seconds:g} s is not allowed; a delay is a finite number of seconds, 0 or more")
    return seconds if seconds >= SMALLEST else 0.0


@dataclass(frozen=True)
class Channel:
    """Delay [s] of each thing a law's signals are made of.

    `own_speed_in_dv` and `leader_speed_in_dv` are the two halves of `dv`: equal where the relative
    speed is measured as a whole, different where the leader's speed arrives by itself.
    """

    s: float = 0.0
    v: float = 0.0
    leader_speed_in_dv: float = 0.0
    own_speed_in_dv: float = 0.0
    a: float = 0.0
    vl: float = 0.0
    al: float = 0.0
    v0l: float = 0.0
    a0l: float = 0.0

    @classmethod
    def of(cls, law: str, signals: tuple[str, ...], delay: Delay) -> Channel:
        """The channel of a law with these signals.

        A number delays all on-board signals. A mapping gives each signal its own; `vl` on a law
        that asks for `dv` but not for `vl` makes the leader's speed late and leaves own speed as
        the law's `v` has it. Raises `HeadwayError` for a signal the law does not perceive.
        """
        if isinstance(delay, float):
            given = {n: delay for n in signals if n not in RADIO}
        else:
            given = dict(delay)
            composed = "vl" in given and "vl" not in signals and "dv" in signals
            allowed = {*signals, "vl"} if composed else set(signals)
            for name in given:
                if name not in allowed:
                    extra = " (and vl for the leader's speed alone)" if "dv" in signals and "vl" not in signals else ""
                    raise HeadwayError(
                        f"delay.{name}: {law} does not perceive {name!r}; its signals are {', '.join(signals)}{extra}"
                    )
            if composed and "dv" in given:
                raise HeadwayError(
                    f"delay: give {law} either dv (late as a whole) or vl (leader's speed late), not both"
                )
        composed = "vl" in given and "vl" not in signals
        own = given.get("v", 0.0)
        return cls(
            s=given.get("s", 0.0),
            v=own,
            leader_speed_in_dv=given["vl"] if composed else given.get("dv", 0.0),
            own_speed_in_dv=own if composed else given.get("dv", 0.0),
            a=given.get("a", 0.0),
            vl=0.0 if composed else given.get("vl", 0.0),
            al=given.get("al", 0.0),
            v0l=given.get("v0l", 0.0),
            a0l=given.get("a0l", 0.0),
        )

    @property
    def longest(self) -> float:
        """The longest delay [s]."""
        return max(vars(self).values())
