"""What is typed as text: `name=value`, delays, windows `start:end`, axes `name=low:high`, parts `3/16`, lists."""

from __future__ import annotations

import math
from collections.abc import Iterable

from headway.errors import HeadwayError

__all__ = [
    "PARAMETER",
    "assignments",
    "axis_range",
    "delay",
    "is_window",
    "names",
    "pairs",
    "ranges",
    "shard",
    "window",
]

#: how a parameter is written
PARAMETER = "parameter=number, e.g. T=1.2"


def assignments(option: str, texts: Iterable[str], hint: str) -> dict[str, float]:
    """Finite numbers by name of texts such as T=1.2; `HeadwayError` with the hint for any other text."""
    values: dict[str, float] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        number = _float(value)
        if not equals or not name.strip() or number is None:
            raise HeadwayError(f"{option} {_short(text)}: write {hint}")
        if name.strip() in values:
            raise HeadwayError(f"{option} {_short(text)}: {name.strip()} is given twice")
        values[name.strip()] = number
    return values


def delay(text: str) -> float | dict[str, float]:
    """A delay: seconds, or pairs of signal and seconds."""
    seconds = _float(text)
    if seconds is not None:
        return seconds
    return assignments("--delay", text.split(","), "seconds, or signal=seconds pairs such as s=0.5,dv=0.5")


def window(option: str, text: str) -> tuple[float, float]:
    """Two finite numbers of a text such as 0:200."""
    if not is_window(text):
        raise HeadwayError(f"{option} {_short(text)}: write two numbers with a colon between, e.g. 0:200")
    a, b = (float(part) for part in text.split(":"))
    return a, b


def is_window(text: str) -> bool:
    """Whether a text is two finite numbers and a colon, and no file."""
    parts = [_float(part) for part in text.split(":")]
    return len(parts) == 2 and all(x is not None and math.isfinite(x) for x in parts)


def axis_range(option: str, text: str) -> tuple[str, tuple[float, ...]]:
    """Name and range of an axis of a text such as T=0.5:2.5, or T=0.5:2.5:100 with a number of points.

    Args:
        option: The option that the text belongs to, for the sentence.
        text: What was typed.

    Returns:
        The name, and (low, high) or (low, high, number of points).

    Raises:
        HeadwayError: If the text is none.
    """
    name, _, limits = text.partition("=")
    values = [_float(part) for part in limits.split(":")]
    numbers = tuple(x for x in values if x is not None)
    whole = len(numbers) < 3 or numbers[2].is_integer()
    if len(numbers) not in (2, 3) or len(numbers) < len(values) or not whole:
        raise HeadwayError(f"{option} {_short(text)}: write name=low:high or name=low:high:count, e.g. T=0.5:2.5")
    return name.strip(), numbers


def ranges(option: str, texts: list[str] | None) -> dict[str, tuple[float, float]]:
    """Two numbers by name of texts such as T=0.5:3."""
    typed = pairs(option, texts, "name=low:high, e.g. T=0.5:3") or {}
    return {name: window(option, text) for name, text in typed.items()}


def shard(text: str) -> tuple[int, int] | None:
    """Part and number of parts of a text such as 3/16; None of an empty one."""
    if not text:
        return None
    part, _, parts = text.partition("/")
    if not (part.isascii() and part.isdecimal() and parts.isascii() and parts.isdecimal() and len(text) < 40):
        raise HeadwayError(f"--shard {_short(text)}: write the part and how many there are, e.g. 3/16")
    return int(part), int(parts)


def names(*texts: str) -> list[str]:
    """Names of texts such as C05,idm-1."""
    return [name.strip() for text in texts for name in text.split(",") if name.strip()]


def pairs(option: str, texts: list[str] | None, hint: str = "ours=theirs, e.g. speed=v") -> dict[str, str] | None:
    """Texts by name of texts such as speed=v; None if there are none."""
    values: dict[str, str] = {}
    for text in texts or []:
        name, equals, value = text.partition("=")
        if not equals or not name.strip() or not value:
            raise HeadwayError(f"{option} {_short(text)}: write {hint}")
        values[name.strip()] = value
    return values or None


def _float(text: str) -> float | None:
    """The number that a text is, or None; infinity and NaN are left to whoever knows what is allowed."""
    if "_" in text or not text.isascii():
        return None
    try:
        return float(text)
    except ValueError:
        return None


def _short(text: str) -> str:
    return text if len(text) <= 60 else f"{text[:59]}…"
