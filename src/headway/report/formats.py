"""Words and numbers as a page shows them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from markupsafe import Markup, escape

from headway.report.parts import Cell, Table

__all__ = ["blocks", "heading", "html", "markdown_cell", "numeric", "shown", "value"]

_MARK = re.compile(r"`([^`]+)`|\*\*(.+?)\*\*")


def html(text: str) -> Markup:
    """Plain words as HTML; `code` and **bold** become elements, all else is escaped."""
    parts: list[str] = []
    at = 0
    for mark in _MARK.finditer(text):
        parts.append(str(escape(text[at : mark.start()])))
        tag, inner = ("code", mark[1]) if mark[1] is not None else ("strong", mark[2])
        parts.append(f"<{tag}>{escape(inner)}</{tag}>")
        at = mark.end()
    return Markup("".join([*parts, str(escape(text[at:]))]))


def blocks(paragraphs: tuple[str, ...]) -> Iterator[tuple[bool, list[str]]]:
    """Runs of paragraphs: (whether they form a list, their words without the leading dash)."""
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


def shown(cell: Cell) -> str:
    """A cell for the eye: four digits, a dash for no number."""
    if isinstance(cell, str):
        return cell
    if math.isinf(cell):
        return "∞" if cell > 0 else "−∞"
    if math.isnan(cell):
        return "–"
    if isinstance(cell, int) or (float(cell).is_integer() and abs(cell) < 1e6):
        return f"{int(cell)}".replace("-", "−")
    return f"{cell:.4g}".replace("-", "−")


def value(cell: Cell) -> str:
    """A cell for a program: every digit of a number, nothing where there is none."""
    if isinstance(cell, str):
        return cell
    return "" if math.isnan(cell) else repr(float(cell)) if not isinstance(cell, int) else str(cell)


def heading(table: Table, column: int) -> str:
    """The name of a column with its unit."""
    unit = table.units[column] if table.units else ""
    return f"{table.columns[column]} [{unit}]" if unit else table.columns[column]


def numeric(table: Table) -> list[bool]:
    """Which columns hold numbers (and perhaps words beside them)."""
    return [any(not isinstance(row[i], str) for row in table.rows) for i in range(len(table.columns))]


def markdown_cell(cell: Cell) -> str:
    """A cell of a Markdown table."""
    return shown(cell).replace("|", "\\|").replace("\n", " ")
