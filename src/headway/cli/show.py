"""How the command line shows things: tables for people, JSON for programs, nothing moving in a pipe."""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

__all__ = ["coloured", "print_json", "print_table", "progress", "rounded", "say", "working"]


#: a word longer than this may be broken to fit a table
_WORD = 30


def rounded(value: float, digits: int = 4) -> str:
    """A number for a table; a dash where there is none."""
    return "–" if value is None or not math.isfinite(value) else f"{value:.{digits}g}"


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], left: int = 1) -> None:
    """Print a table; the first `left` columns are text."""
    from rich import box
    from rich.cells import cell_len
    from rich.console import Console
    from rich.table import Table

    plain: dict[str, Any] = {"markup": False, "emoji": False, "highlight": False}  # "[m]" is a unit, not a style
    console = Console(**plain)
    cells = [[name, *(row[i] for row in rows)] for i, name in enumerate(columns)]
    # in a pipe a table keeps its natural width instead of being folded to 80 columns
    room = console.width - 3 * len(columns) - 1 if console.is_terminal else None
    widths = _widths([[cell_len(text) for text in column] for column in cells], [_longest(c) for c in cells], room)
    sheet = Table(title=title or None, box=box.SIMPLE_HEAD, title_justify="left")
    for i, (name, width) in enumerate(zip(columns, widths, strict=True)):
        sheet.add_column(name, justify="left" if i < left else "right", overflow="fold", width=width)
    for row in rows:
        sheet.add_row(*row)
    total = sum(widths) + 3 * len(columns) + 1
    if console.width < total or not console.is_terminal:
        console = Console(width=total if console.is_terminal else max(80, len(title), total), **plain)
    console.print(sheet)


def _longest(texts: Sequence[str]) -> int:
    """Length of the longest word, or of what a longer one is broken into."""
    return max(min(_WORD, len(word)) for text in texts for word in text.split() or [""])


def _widths(lengths: Sequence[Sequence[int]], words: Sequence[int], room: int | None) -> list[int]:
    """Widths of columns: what each would like, shrunk to the room, but never so far that a word is broken."""
    widths = [max(column, default=0) for column in lengths]
    if room is None:
        return widths
    while sum(widths) > room:
        spare = [width - word for width, word in zip(widths, words, strict=True)]
        widest = max(range(len(widths)), key=lambda i: (spare[i] > 0) * widths[i])
        if spare[widest] <= 0:
            break
        widths[widest] -= 1
    return widths


def say(text: str, lead: str = "", indent: int = 0, good: bool | None = None) -> None:
    """Print a sentence after `lead`: on a terminal broken between words and indented, in a pipe as one line.

    `good` colours it as `coloured` does.
    """
    if not sys.stdout.isatty():
        print(f"{lead}{text}")
        return
    width = max(20, shutil.get_terminal_size().columns - indent)
    lines = textwrap.wrap(text, width, break_on_hyphens=False) or [""]
    print(lead + f"\n{' ' * indent}".join(coloured(line, good) for line in lines))


def coloured(text: str, good: bool | None) -> str:
    """A verdict for people: green or red on a terminal that shows colours, plain elsewhere."""
    if good is None or not sys.stdout.isatty() or os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return text
    return f"\x1b[{32 if good else 31}m{text}\x1b[0m"


def print_json(value: Any) -> None:
    """Print `value` as JSON; numbers that are not finite become null."""
    print(json.dumps(_finite(value), indent=2, ensure_ascii=False))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(k): _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


@contextmanager
def working(what: str) -> Iterator[None]:
    """Show that something is being done, on a terminal only."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console

    with Console(stderr=True).status(what):
        yield


@contextmanager
def progress(what: str) -> Iterator[Callable[[int, int], Any] | None]:
    """A bar with rate and time left, to be told (done, total), on a terminal; nothing elsewhere."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
