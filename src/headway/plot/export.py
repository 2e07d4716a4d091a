"""Figures as files: PNG, SVG or PDF."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from headway.errors import HeadwayError
from headway.results import writing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["save"]

_SUFFIXES = (".png", ".svg", ".pdf")
_DPI = 200


def save(figure: Figure, path: str | os.PathLike[str]) -> Path:
    """Write a figure as PNG (200 dots an inch), SVG or PDF.

    Args:
        figure: the figure.
        path: of the file, whose suffix says the format; the file appears complete or not at all.

    Returns:
        The path.

    Raises:
        HeadwayError: for another suffix, or where nothing can be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES:
        kind = suffix or "a file without suffix"
        raise HeadwayError(f"{path}: a figure cannot be written as {kind}; allowed are {', '.join(_SUFFIXES)}")
    # without a date the same figure gives the same file
    stamp = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(suffix)
    with writing(path) as unfinished:
        figure.savefig(unfinished, format=suffix[1:], dpi=_DPI, metadata=stamp)
    return path
