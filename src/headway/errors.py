"""What can go wrong, in words.

Every mistake a person can make ends in one `HeadwayError` whose message is one sentence that
names the place, the value, what is allowed and, where a name was mistyped, the nearest valid one.
The command line prints that sentence and exits with code 2; no traceback reaches the user.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

__all__ = [
    "HeadwayError",
    "HeadwayWarning",
    "NoEquilibriumError",
    "RestsEverywhereError",
    "did_you_mean",
    "shorten",
    "unknown_name",
]


class HeadwayError(ValueError):
    """A request that cannot be carried out as it was typed; the message says why and what would do."""


class NoEquilibriumError(HeadwayError):
    """A law has no steady state where one was asked for."""


class RestsEverywhereError(HeadwayError):
    """Every gap (or every speed) is a steady state of the law, so that one has to be given."""


class HeadwayWarning(UserWarning):
    """Something that runs but is probably not what was meant."""


def did_you_mean(name: object, allowed: Iterable[str]) -> str:
    """`"; did you mean 'x'?"` for the allowed name nearest to `name`, or `""` where none is near."""
    names = [str(a) for a in allowed]
    lowered = {a.lower(): a for a in names}
    near = difflib.get_close_matches(str(name).lower(), list(lowered), n=1, cutoff=0.5)
    return f"; did you mean {lowered[near[0]]!r}?" if near else ""


def unknown_name(place: str, name: object, allowed: Iterable[str]) -> HeadwayError:
    """The error for a name that is not among `allowed` at `place`."""
    names = sorted(str(a) for a in allowed)
    return HeadwayError(f"{place}: {name!r} is not known; allowed are {', '.join(names)}{did_you_mean(name, names)}")


def shorten(value: Any, limit: int = 60) -> str:
    """`repr(value)`, cut to `limit` characters so that a message stays one readable sentence."""
    text = repr(value)
    return text if len(text) <= limit else text[: limit - 1] + "…"
