"""A report on disk: the page, its figures at print size, its tables as CSV and its data beside it."""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from headway.errors import HeadwayError, unknown_name
from headway.report import drawing, formats
from headway.report.markdown import markdown
from headway.report.parts import Illustration, Report, Table, Text
from headway.results import writing

__all__ = ["write"]


def write(
    report: Report,
    folder: str | os.PathLike[str],
    *,
    format: Literal["html", "md"] = "html",
    figures: Literal["svg", "png", "pdf"] = "svg",
) -> Path:
    """Write a report into a folder.

    `report.html` needs no other file; `report.md` shows the figures beside it (as SVG where `figures` is
    "pdf"). Beside either are `figures/` at print size, `tables/` as CSV with all digits, and `data/`. Every file
    appears complete or not at all, the page last. Equal reports give equal bytes.

    Args:
        report: the report.
        folder: where to write it; created if it does not exist.
        format: of the page, "html" or "md".
        figures: format of the figures beside it, "svg", "png" or "pdf".

    Returns:
        The path of the page.

    Raises:
        HeadwayError: for an unknown format, or where nothing can be written.
    """
    if format not in ("html", "md"):
        raise unknown_name("format of a report", format, ("html", "md"))
    if figures not in ("svg", "png", "pdf"):
        raise unknown_name("format of figures", figures, ("svg", "png", "pdf"))
    place = Path(folder)
    for part in ("figures", "tables", "data"):
        _folder(place / part)
    tables = report.tables()
    for name, table in tables.items():
        _put(place / "tables" / f"{name}.csv", _csv(table))
    for name, content in report.data.items():
        _put(place / "data" / name, content)
    shown = "svg" if figures == "pdf" else figures
    drawn = {}
    for picture in report.pictures():
        file = place / "figures" / picture.name
        if format == "html" or shown == "svg":
            drawn[picture.name] = drawing.svg(picture)
        for kind in {figures, shown} if format == "md" else {figures}:
            if kind == "svg":
                _put(file.with_suffix(".svg"), drawn[picture.name])
            else:
                drawing.print_size(picture, file.with_suffix(f".{kind}"))
    page = place / f"report.{format}"
    named = {id(table): f"tables/{name}.csv" for name, table in tables.items()}
    _put(page, _page(report, named, figures, drawn) if format == "html" else markdown(report, named, shown))
    return page


def _folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise HeadwayError(f"{path}: the folder cannot be made ({error.strerror or error})") from None


def _put(path: Path, content: str | bytes) -> None:
    with writing(path) as unfinished:
        unfinished.write_bytes(content.encode() if isinstance(content, str) else content)


def _csv(table: Table) -> str:
    text = io.StringIO()
    sheet = csv.writer(text, lineterminator="\n")
    sheet.writerow([formats.heading(table, i) for i in range(len(table.columns))])
    sheet.writerows([formats.cell_digits(cell) for cell in row] for row in table.rows)
    return text.getvalue()


def _page(report: Report, tables: dict[int, str], figures: str, drawn: dict[str, str]) -> str:
    import jinja2

    home = jinja2.Environment(
        loader=jinja2.PackageLoader("headway.report", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    home.filters.update(
        ident=id, words=formats.html, runs=formats.blocks, shown=formats.cell_text, value=formats.cell_digits
    )
    home.tests.update({kind.__name__.lower(): _is(kind) for kind in (Text, Table, Illustration)})
    script = home.get_template("page.js").render()
    return home.get_template("page.html").render(
        report=report,
        tables=tables,
        figures=figures,
        script=script,
        digest=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        drawn=lambda picture: drawing.inline(picture, drawn[picture.name]),
        heading=formats.heading,
        numeric=formats.numeric,
    )


def _is(kind: type) -> Callable[[object], bool]:
    return lambda block: isinstance(block, kind)
