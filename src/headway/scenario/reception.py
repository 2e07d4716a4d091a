"""How what a driver or controller perceives reaches it.

A person gives delays; a `Perception` turns them into one `Source` for each thing that the signals
of a law are made of: whose motion is looked at, and by which `Reception` it arrives. How something
is received lives here and in the stepper, never in a law.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from headway.checked import SMALLEST, number
from headway.errors import HeadwayError, shorten, unknown_name
from headway.models.signal import AHEAD, RADIO, SIGNALS, Signal

__all__ = ["Perception", "Reception", "Source", "normalize_delay"]

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
class Reception:
    """How something reaches a law.

    Attributes:
        delay: how late [s], 0 or more.
    """

    delay: float = 0.0


NOW = Reception()


class Source(NamedTuple):
    """One thing that a signal is made of.

    Attributes:
        signal: the signal.
        whose: whose motion is looked at (`models.signal.OWN`, the k-th vehicle ahead, `LEADER`).
        sign: 1, or -1 for what is subtracted.
        reception: how it arrives.
    """

    signal: Signal
    whose: int
    sign: float
    reception: Reception

    @property
    def delay(self) -> float:
        """How late it is [s]."""
        return self.reception.delay


@dataclass(frozen=True)
class Perception:
    """What a law perceives and how it arrives.

    Attributes:
        sources: what its signals are made of, in the order of its signature; of a difference first what is not
            subtracted.
    """

    sources: tuple[Source, ...]

    @classmethod
    def of(cls, law: str, signals: tuple[str, ...], delay: Delay) -> Perception:
        """The perception of a law with these signals.

        A number delays all on-board signals. A mapping gives each signal its own; `vl` on a law
        that asks for `dv` but not for `vl` makes the leader's speed late and leaves own speed as
        the law's `v` has it.

        Args:
            law: name of the law.
            signals: names of its signals.
            delay: as it was given, see `normalize_delay`.

        Raises:
            HeadwayError: for a signal that the law does not perceive.
        """
        if isinstance(delay, float):
            return cls.received(signals, {n: Reception(delay) for n in signals if n not in RADIO})
        composed = any(n == "vl" for n, _ in delay) and "vl" not in signals and "dv" in signals
        allowed = {*signals, "vl"} if composed else set(signals)
        for name, _ in delay:
            if name not in allowed:
                extra = " (and vl for the leader's speed alone)" if "dv" in signals and "vl" not in signals else ""
                raise HeadwayError(
                    f"delay.{name}: {law} does not perceive {name!r}; its signals are {', '.join(signals)}{extra}"
                )
        if composed and any(n == "dv" for n, _ in delay):
            raise HeadwayError(f"delay: give {law} either dv (late as a whole) or vl (leader's speed late), not both")
        return cls.received(signals, {n: Reception(seconds) for n, seconds in delay})

    @classmethod
    def received(cls, signals: tuple[str, ...], receptions: Mapping[str, Reception]) -> Perception:
        """The perception where these signals arrive by these receptions, and all others at once."""
        sources = []
        for name in signals:
            signal = SIGNALS[name]
            first = second = receptions.get(name, NOW)
            if name == "dv" and "vl" in receptions and "vl" not in signals:
                # the speed ahead arrives by itself; one's own is as the law's `v` has it
                first, second = receptions["vl"], receptions.get("v", NOW)
            sources.append(Source(signal, signal.of, 1.0, first))
            if signal.less is not None:
                sources.append(Source(signal, signal.less, -1.0, second))
        return cls(tuple(sources))

    def halves(self, name: str) -> tuple[Source, Source]:
        """What a signal is made of: what is not subtracted, and what is (twice the same where nothing is)."""
        parts = [s for s in self.sources if s.signal.name == name]
        return parts[0], parts[-1]

    def delay(self, name: str) -> float:
        """How late a signal is [s], of a difference what is not subtracted; 0 for one that is not perceived."""
        return next((s.delay for s in self.sources if s.signal.name == name), 0.0)

    def at_once(self, name: str) -> bool:
        """Whether a signal is perceived, and without delay."""
        return any(s.signal.name == name for s in self.sources) and self.delay(name) == 0.0

    @functools.cached_property
    def longest(self) -> float:
        """The longest delay [s]."""
        return max((s.delay for s in self.sources), default=0.0)

    @functools.cached_property
    def farthest(self) -> int:
        """The most vehicles ahead that it looks, at least 1."""
        return max([AHEAD, *(s.whose for s in self.sources)])
