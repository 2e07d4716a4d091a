"""TOML as people write it: read with one sentence for whatever is wrong, and in a time that ends."""

from __future__ import annotations

import os
import re
import tomllib
from typing import Any

from headway.checked import as_path
from headway.errors import HeadwayError

__all__ = ["parse", "read_table", "value"]

#: most bytes of a file of scenarios, and most parts of a dotted key
_BYTES, _PARTS = 50_000_000, 32

_DEEP = "it is nested too deeply"


def read_table(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The raw table of a TOML file; `HeadwayError` if it cannot be read or is none."""
    file = as_path(path, "file")
    try:
        with file.open("rb") as stream:
            data = stream.read(_BYTES + 1)
        if len(data) > _BYTES:
            raise HeadwayError(f"{file}: is larger than {_BYTES / 1e6:g} MB; no scenario is")
        text = data.decode("utf-8-sig")  # some editors of Windows begin a file with a mark
    except UnicodeDecodeError:
        raise HeadwayError(f"{file}: cannot be read (it is not UTF-8 text)") from None
    except OSError as error:
        raise HeadwayError(f"{file}: cannot be read ({error.strerror or error})") from None
    return parse(text, str(file))


def parse(text: str, place: str) -> dict[str, Any]:
    """The table of a TOML text."""
    if not isinstance(text, str):
        raise HeadwayError(f"{place}: a TOML text is needed, not a {type(text).__name__}")
    text = text.removeprefix("\ufeff").replace("\r\n", "\n")
    for run in re.split(r"[,=\[\]{}\n#]", text):
        # the parser's time grows with the square of a key's parts
        if run.count(".") > _PARTS and re.fullmatch(r"[^\s.]+(\.[^\s.]+)*", re.sub(r"\s*\.\s*", ".", run.strip())):
            raise HeadwayError(f"{place}: a key of {run.count('.') + 1} parts is not a scenario's ({_DEEP})")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise HeadwayError(f"{place}: not a TOML file ({error})") from None
    except RecursionError:
        raise HeadwayError(f"{place}: not a TOML file ({_DEEP})") from None
    except (ValueError, OverflowError):  # digits without end, a day that no calendar has
        raise HeadwayError(f"{place}: not a TOML file (a number or date in it is beyond what can be held)") from None


def value(text: str) -> Any:
    """What is typed behind an equals sign: a value as TOML has it, or else the text itself."""
    try:
        return tomllib.loads(f"x = {text.strip()}")["x"]
    except (ValueError, OverflowError, RecursionError):
        return text.strip()
