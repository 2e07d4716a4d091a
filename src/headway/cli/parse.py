"""What is typed as text: `name=value`, seconds or a pattern of delays, windows."""

from __future__ import annotations

import math
from collections.abc import Iterable

from headway.errors import HeadwayError

__all__ = ["PARAMETER", "delay", "is_window", "numbers", "pairs", "window"]

#: how a parameter is written
PARAMETER = "parameter=number, e.g. T=1.2"


def numbers(option: str, texts: Iterable[str], hint: str) -> dict[str, float]:
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
    return numbers("--delay", text.split(","), "seconds, or signal=seconds pairs such as s=0.5,dv=0.5")


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


def pairs(option: str, texts: list[str] | None, hint: str = "ours=theirs, e.g. speed=v") -> dict[str, str] | None:
    """Texts by name of texts such as speed=v; None if there are none."""
    found: dict[str, str] = {}
    for text in texts or []:
        name, equals, value = text.partition("=")
        if not equals or not name.strip() or not value:
            raise HeadwayError(f"{option} {_short(text)}: write {hint}")
        found[name.strip()] = value
    return found or None


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
