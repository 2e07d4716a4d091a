"""What the command line stands on: an environment that may be strange, and streams that may be narrow, full or gone."""

from __future__ import annotations

import codecs
import os
import sys
import unicodedata
import warnings
from typing import TextIO

from headway.errors import HeadwayError, HeadwayWarning

__all__ = ["flush", "hush", "prepare", "tell"]

#: what stands for a character that an encoding lacks
_PLAIN = {
    "–": "-", "—": "-", "−": "-", "…": "...", "≤": "<=", "≥": ">=", "≠": "!=", "±": "+-", "×": "x", "·": "*", "²": "2",
    "³": "3", "⁻": "-", "¹": "1", "½": "1/2", "→": "->", "←": "<-", "√": "sqrt", "∞": "inf", "Σ": "sum ", "∫": "int ",
    "∂": "d", "Δ": "d", "α": "alpha", "β": "beta", "γ": "gamma", "δ": "delta", "ε": "eps", "ζ": "zeta", "η": "eta",
    "θ": "theta", "κ": "kappa", "λ": "lambda", "μ": "mu", "π": "pi", "σ": "sigma", "τ": "tau", "φ": "phi", "ω": "omega",
    "‹": "<", "›": ">", "„": '"', "“": '"', "”": '"', "‘": "'", "’": "'", "′": "'", "″": '"', "─": "-", "━": "-",
    "│": "|", "•": "*", "°": " deg", "\u2009": " ", "\u202f": " ", "\u00a0": " ",
}  # fmt: skip

#: widths of a terminal that are believed
_COLUMNS = range(20, 1001)


def _plain(error: UnicodeError) -> tuple[str, int]:
    """Error handler of the streams: the nearest plain characters, or question marks."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = []
    for character in error.object[error.start : error.end]:
        bare = _PLAIN.get(character) or unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode()
        text.append(bare or "?")
    return "".join(text), error.end


def prepare() -> None:
    """Make streams that can print everything, and set right or refuse what the environment asks for.

    Raises:
        HeadwayError: If the environment makes the compiler useless.
    """
    codecs.register_error("headway-plain", _plain)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="headway-plain")
    columns = os.environ.get("COLUMNS", "80")
    if not (columns.isascii() and columns.isdecimal() and len(columns) < 6 and int(columns) in _COLUMNS):
        del os.environ["COLUMNS"]
    os.environ.pop("MPLBACKEND", None)  # figures are written to files and need no window
    warnings.showwarning = _tell_once
    warnings.simplefilter("ignore")
    warnings.simplefilter("default", HeadwayWarning)


def _tell_once(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
    if issubclass(category, HeadwayWarning):
        tell(f"note: {message}")


def tell(sentence: str) -> None:
    """Say a sentence on standard error, if that can be written to."""
    try:
        print(f"headway: {sentence}", file=sys.stderr, flush=True)
    except (OSError, ValueError, AttributeError):
        hush(sys.stderr)


def flush() -> None:
    """Write what is still to be written now, so that a full disk or a closed pipe shows before the end.

    Raises:
        BrokenPipeError: If nobody reads any more.
        HeadwayError: If nothing can be written.
    """
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        hush(sys.stdout)
        raise HeadwayError(f"standard output cannot be written ({error.strerror or error})") from None


def hush(stream: TextIO | None) -> None:
    """Let what is left in a stream that failed go nowhere, so that Python does not complain at its end."""
    try:
        if stream is not None:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    except (OSError, ValueError):  # a stream without a number has no end that could complain
        return
