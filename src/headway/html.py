"""Small HTML, for notebooks: escaped text, and tables that a screen reader can follow."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

__all__ = ["block", "paragraph", "table"]

_LEFT = 'style="text-align:left"'


def table(caption: str, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table with a caption, a head and a name in front of each row. All text is escaped, floats get 5 digits."""
    head = "".join(f'<th scope="col" {_LEFT}>{escape(name)}</th>' for name in columns)
    body = "".join(f"<tr>{_row(row)}</tr>" for row in rows)
    return (
        f'<table><caption style="text-align:left;font-weight:bold">{escape(caption)}</caption>'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    )


def _row(row: Sequence[object]) -> str:
    name, *cells = (escape(f"{cell:.5g}" if isinstance(cell, float) else str(cell)) for cell in row)
    return f'<th scope="row" {_LEFT}>{name}</th>' + "".join(f"<td {_LEFT}>{cell}</td>" for cell in cells)


def paragraph(text: str) -> str:
    """A paragraph of plain text; empty for an empty one."""
    return f"<p>{escape(text)}</p>" if text else ""


def block(*parts: str) -> str:
    """What a thing shows of itself, as one piece."""
    return f"<div>{''.join(parts)}</div>"
