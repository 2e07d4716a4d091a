"""What can go wrong, in words.

Every mistake a person can make ends in one `HeadwayError` whose message is one sentence of at most
300 characters that names the place, the value, what is allowed and, where a name was mistyped, the
nearest valid one. The command line prints that sentence and exits with code 2; no traceback reaches
the user.
"""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Iterable
from typing import Any

__all__ = [
    "LONGEST",
    "HeadwayError",
    "HeadwayWarning",
    "LeaderHeardError",
    "NoEquilibriumError",
    "RestsEverywhereError",
    "did_you_mean",
    "shorten",
    "unknown_name",
]

#: most characters of a message
LONGEST = 300

#: a name longer than this is nobody's slip of the pen: the nearest one is not looked for
_LONGEST_NAME = 80

#: allowed names are told as far as they fit into so many characters
_NAMES = 130


class HeadwayError(ValueError):
    """A request that cannot be carried out as it was typed; the message says why and what would do."""

    def __init__(self, message: object = "") -> None:
        super().__init__(_one_sentence(str(message)))


class NoEquilibriumError(HeadwayError):
    """A law has no steady state where one was asked for."""


class RestsEverywhereError(HeadwayError):
    """Every gap (or every speed) is a steady state of the law, so that one has to be given."""


class LeaderHeardError(HeadwayError):
    """A verdict on one vehicle was asked of a law that hears the platoon leader: only a whole platoon has one."""


class HeadwayWarning(UserWarning):
    """Something that runs but is probably not what was meant."""


def did_you_mean(name: object, allowed: Iterable[str]) -> str:
    """`"; did you mean 'x'?"` for the allowed name nearest to `name`, or `""` where none is near."""
    near = _nearest(name, [str(a) for a in allowed])
    return f"; did you mean {near!r}?" if near else ""


def unknown_name(place: str, name: object, allowed: Iterable[str]) -> HeadwayError:
    """The error for a name that is not allowed at a place.

    Args:
        place: Where the name stands, as the message calls it.
        name: What was typed.
        allowed: Names that are allowed; where they are many, the nearest comes first.

    Returns:
        The error, to be raised by the caller.
    """
    names = sorted(str(a) for a in allowed)
    listed, hint = ", ".join(names), did_you_mean(name, names)
    head = f"{place}: {shorten(name)} is not known"
    if len(listed) <= _NAMES:
        return HeadwayError(f"{head}; allowed are {listed}{hint}")
    some = listed[:_NAMES].rpartition(", ")[0]
    more = f"llowed are {some} and {len(names) - some.count(', ') - 1} more"
    return HeadwayError(f"{head}{hint} A{more}" if hint else f"{head}; a{more}")


def shorten(value: Any, limit: int = 60) -> str:
    """`repr(value)`, cut so that a message stays one readable sentence.

    Args:
        value: Anything, also what has no `repr` that ends soon: nesting of any depth, numbers of any length.
        limit: Most characters.
    """
    if isinstance(value, str):
        text = repr(value[: limit + 1])
    elif isinstance(value, int) and not isinstance(value, bool) and abs(value) >= 10**limit:
        return "a whole number of more than 60 digits" if limit >= 60 else "a very large whole number"
    else:
        try:
            text = _plain.repr(value)
        except Exception:  # somebody else's __repr__ may do anything
            text = f"<{type(value).__name__}>"
    text = " ".join(text.split())
    return text if len(text) <= limit else text[: limit - 1] + "…"


class _Plain(reprlib.Repr):
    """`repr` that ends soon."""

    def repr_int(self, x: int, level: int) -> str:
        return "…" if abs(x) >= 10**40 else repr(x)


_plain = _Plain()
_plain.maxlevel, _plain.maxother, _plain.maxstring = 4, 400, 100
_plain.maxlist = _plain.maxtuple = _plain.maxdict = _plain.maxset = _plain.maxarray = 12


def _nearest(name: object, names: list[str]) -> str | None:
    text = str(name).lower() if isinstance(name, str | int | float) and not isinstance(name, bool) else ""
    if not text or len(text) > _LONGEST_NAME:
        return None
    lowered = {n.lower(): n for n in names}
    if text in lowered:
        return lowered[text]
    # a name that is part of the other, e.g. kp of followers.0.parameters.kp, is nearer than letters alone say
    whole = [n for n in names if text in n.lower().replace(":", ".").split(".")]
    # one or two letters are near to everything
    cutoff = 0.5 if len(text) > 2 else 0.66
    near = whole or difflib.get_close_matches(text, list(lowered), n=1, cutoff=cutoff)
    return lowered[near[0].lower()] if near else None


def _one_sentence(text: str) -> str:
    """One line of at most `LONGEST` printable characters; what is too long loses its middle."""
    if not (text.isprintable() and len(text) <= LONGEST):
        text = " ".join("".join(c if c.isprintable() else " " for c in text[: 50 * LONGEST]).split())
        if len(text) > LONGEST:
            end = LONGEST // 3
            text = f"{text[: LONGEST - end - 3]} … {text[-end:]}"
    return text
