"""Parts of a report: text, tables, illustrations and sections."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from headway.errors import HeadwayError, shorten

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Block", "Cell", "Illustration", "Report", "Section", "Table", "Text", "slug"]

#: a cell of a table: words, or a number, with four digits on the page and all of them in the CSV file
Cell = str | float


def slug(words: str) -> str:
    """Return `words` as a name for files and anchors: small letters, digits and hyphens, never empty."""
    plain = unicodedata.normalize("NFKD", words).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9]+", "-", plain).strip("-")[:60].rstrip("-") or "part"


@dataclass(frozen=True)
class Text:
    """Paragraphs of plain words.

    Attributes:
        paragraphs: in which `code` and **bold** may be marked; those that begin with "- " form a list.
    """

    paragraphs: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """Rows under named columns; a number that is NaN is shown as a dash (infinite: ∞) and sorted last.

    Attributes:
        columns: names of the columns; the first column names its row.
        rows: cells, as many in each row as there are columns.
        caption: of the table, and of its CSV file.
        units: one for each column, or none at all.
        sortable: whether readers of the page can sort the rows.
        note: words beneath.

    Raises:
        HeadwayError: where a row or `units` is longer or shorter than `columns`.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    caption: str
    units: tuple[str, ...] = ()
    sortable: bool = True
    note: str = ""

    def __post_init__(self) -> None:
        for what, entries in (("units", self.units), *(("a row", row) for row in self.rows)):
            if entries and len(entries) != len(self.columns):
                raise HeadwayError(
                    f"table {shorten(self.caption)}: {what} has {len(entries)} entries for {len(self.columns)} columns"
                )


@dataclass(frozen=True)
class Illustration:
    """A figure under a name of its own.

    Attributes:
        name: of small letters, digits and hyphens, also that of its file.
        figure: the figure.
        alt: what it shows, for those who cannot see it.
        caption: words beneath.

    Raises:
        HeadwayError: for another name, or without `alt`.
    """

    name: str
    figure: Figure
    alt: str
    caption: str = ""

    def __post_init__(self) -> None:
        if not self.alt.strip():
            raise HeadwayError(f"picture {self.name!r} has no alt text; say in words what it shows")
        if self.name != slug(self.name):
            raise HeadwayError(f"picture {self.name!r}: a name is made of small letters, digits and hyphens")


Block = Text | Table | Illustration


@dataclass(frozen=True)
class Section:
    """A part of a report under its own title.

    Attributes:
        title: of the section.
        blocks: texts, tables and illustrations.
        id: where links to the section point; one made of its title if empty.
        collapsed: whether the page shows the title only until a reader opens it.
    """

    title: str
    blocks: tuple[Block, ...]
    id: str = ""
    collapsed: bool = False

    @property
    def anchor(self) -> str:
        """The anchor of links to the section: its id, or one made of its title."""
        return self.id or slug(self.title)


@dataclass(frozen=True)
class Report:
    """A report: what matters most, the sections, and their basis.

    Attributes:
        title: of the report.
        summary: what matters most, in paragraphs.
        sections: in their order.
        provenance: versions and settings that reproduce it, by name.
        citations: sources.
        data: contents of files beside the page, by name.

    Raises:
        HeadwayError: where two sections or two pictures share a name, or a file of data has no plain one.
    """

    title: str
    summary: tuple[str, ...]
    sections: tuple[Section, ...]
    provenance: Mapping[str, str] = field(default_factory=dict)
    citations: tuple[str, ...] = ()
    data: Mapping[str, bytes | str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _unique("sections", [section.anchor for section in self.sections])
        _unique("pictures", [picture.name for picture in self.pictures()])
        for name in self.data:
            if not re.fullmatch(r"[\w][\w. +-]*", name):
                raise HeadwayError(f"data {name!r}: a file beside the report has a plain name without folders")

    def pictures(self) -> Iterator[Illustration]:
        """Return all pictures, in order."""
        return (block for section in self.sections for block in section.blocks if isinstance(block, Illustration))

    def tables(self) -> dict[str, Table]:
        """Return all tables in order, by the name of their file."""
        tables: dict[str, Table] = {}
        for section in self.sections:
            for block in section.blocks:
                if isinstance(block, Table):
                    stem = f"{section.anchor}-{slug(block.caption)}"[:80].rstrip("-")
                    name, count = stem, 2
                    while name in tables:
                        name, count = f"{stem}-{count}", count + 1
                    tables[name] = block
        return tables


def _unique(what: str, names: list[str]) -> None:
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise HeadwayError(f"a report has two {what} called {twice[0]!r}; each needs a name of its own")
