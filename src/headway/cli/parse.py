"""What is typed as `name=value`."""

from __future__ import annotations

from headway.errors import HeadwayError

__all__ = ["PARAMETER", "delay", "numbers"]

#: how a parameter is written
PARAMETER = "parameter=number, e.g. T=1.2"


def numbers(option: str, texts: list[str], hint: str) -> dict[str, float]:
    """Numbers by name of texts such as T=1.2; `HeadwayError` with the hint for any other text."""
    values = {}
    for text in texts:
        name, equals, value = text.partition("=")
        try:
            values[name.strip()] = float(value)
        except ValueError:
            equals = ""
        if not equals:
            raise HeadwayError(f"{option} {text}: write {hint}")
    return values


def delay(text: str) -> float | dict[str, float]:
    """A delay: seconds, or pairs of signal and seconds."""
    try:
        return float(text)
    except ValueError:
        return numbers("--delay", text.split(","), "seconds, or signal=seconds pairs such as s=0.5,dv=0.5")
