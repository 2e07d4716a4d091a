"""Words and numbers as a page shows them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from markupsafe import Markup, escape

from headway.report.parts import Cell, Table

__all__ = ["blocks", "cell_digits", "cell_text", "heading", "html", "markdown_cell", "numeric"]

_MARK = re.compile(r"`([^`]+)`|\*\*(.+?)\*\*")


def html(text: str) -> Markup:
    """Return plain words as HTML: `code` and **bold** become elements, all else is escaped."""
    parts: list[str] = []
    at = 0
    for mark in _MARK.finditer(text):
        parts.append(str(escape(text[at : mark.start()])))
        tag, inner = ("code", mark[1]) if mark[1] is not None else ("strong", mark[2])
        parts.append(f"<{tag}>{escape(inner)}</{tag}>")
        at = mark.end()
    return Markup("".join([*parts, str(escape(text[at:]))]))


def blocks(paragraphs: tuple[str, ...]) -> Iterator[tuple[bool, list[str]]]:
    """Yield runs of paragraphs that form a list or do not.

    Args:
        paragraphs: plain words; an item of a list begins with "- ".

    Yields:
        (whether the run is a list, its paragraphs without the leading dash).
    """
    run: list[str] = []
    listed = False
    for paragraph in paragraphs:
        item = paragraph.startswith("- ")
        if run and item != listed:
            yield listed, run
            run = []
        listed = item
        run.append(paragraph[2:] if item else paragraph)
    if run:
        yield listed, run


def cell_text(cell: Cell) -> str:
    """Return a cell for readers: four digits, a dash for NaN, ∞ for infinite numbers."""
    if isinstance(cell, str):
        return cell
    if math.isinf(cell):
        return "∞" if cell > 0 else "−∞"
    if math.isnan(cell):
        return "–"
    if isinstance(cell, int) or (float(cell).is_integer() and abs(cell) < 1e6):
        return f"{int(cell)}".replace("-", "−")
    return f"{cell:.4g}".replace("-", "−")


def cell_digits(cell: Cell) -> str:
    """Return a cell for programs: every digit of a number, nothing for NaN."""
    if isinstance(cell, str):
        return cell
    return "" if math.isnan(cell) else repr(float(cell)) if not isinstance(cell, int) else str(cell)


def heading(table: Table, column: int) -> str:
    """Return the name of a column with its unit.

    Args:
        table: the table.
        column: number of the column, from 0 on.
    """
    unit = table.units[column] if table.units else ""
    return f"{table.columns[column]} [{unit}]" if unit else table.columns[column]


def numeric(table: Table) -> list[bool]:
    """Return of each column whether it holds numbers, perhaps with words among them."""
    return [any(not isinstance(row[i], str) for row in table.rows) for i in range(len(table.columns))]


def markdown_cell(cell: Cell) -> str:
    """Return a cell as it stands in a Markdown table."""
    return cell_text(cell).replace("|", "\\|").replace("\n", " ")
