"""A report as Markdown."""

from __future__ import annotations

from collections.abc import Iterator

from headway.report import formats
from headway.report.parts import Illustration, Report, Table, Text

__all__ = ["markdown"]


def markdown(report: Report, tables: dict[int, str], figures: str) -> str:
    """Return a report as Markdown with tables in pipes.

    Args:
        report: the report.
        tables: path of the CSV file by `id` of the table.
        figures: suffix of the figures' files.
    """
    return "\n\n".join(_parts(report, tables, figures)) + "\n"


def _parts(report: Report, tables: dict[int, str], figures: str) -> Iterator[str]:
    yield f"# {report.title}"
    yield from _text(report.summary)
    for section in report.sections:
        yield f"## {section.title}"
        for block in section.blocks:
            match block:
                case Text():
                    yield from _text(block.paragraphs)
                case Table():
                    yield f"**{block.caption}** ([CSV]({tables[id(block)]}))"
                    yield _table(block)
                    if block.note:
                        yield block.note
                case Illustration():
                    alt = block.alt.replace("[", "(").replace("]", ")")
                    yield f"![{alt}](figures/{block.name}.{figures})"
                    if block.caption:
                        yield f"*{block.caption}*"
    if report.citations:
        yield "## Sources"
        yield "\n".join(f"- {source}" for source in report.citations)
    if report.provenance:
        yield "## Provenance"
        yield "\n".join(f"- {name}: {what}" for name, what in report.provenance.items())
    if report.data:
        yield "## Data"
        yield "\n".join(f"- [{name}](<data/{name}>)" for name in report.data)


def _text(paragraphs: tuple[str, ...]) -> Iterator[str]:
    for listed, run in formats.blocks(paragraphs):
        if listed:
            yield "\n".join(f"- {item}" for item in run)
        else:
            yield from run


def _table(table: Table) -> str:
    columns = range(len(table.columns))
    numbers = formats.numeric(table)
    lines = [
        [formats.markdown_cell(formats.heading(table, i)) for i in columns],
        ["---:" if numbers[i] else "---" for i in columns],
        *([formats.markdown_cell(cell) for cell in row] for row in table.rows),
    ]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
