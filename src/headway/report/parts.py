"""What a report is made of."""

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

#: what a table holds: words, or a number that is printed with four digits and written out in full
Cell = str | float


def slug(words: str) -> str:
    """`words` as a name for files and anchors: small letters, digits and hyphens, never empty."""
    plain = unicodedata.normalize("NFKD", words).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9]+", "-", plain).strip("-")[:60].rstrip("-") or "part"


@dataclass(frozen=True)
class Text:
    """Paragraphs of plain words, in which `code` and **bold** may be marked; those that begin with "- " form a list."""

    paragraphs: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """Rows under named columns; the first column names its row.

    `units` has one entry for each column or is empty. A number that is not finite is shown as a dash
    (infinite: ∞) and sorted last. Raises `HeadwayError` where a row is longer or shorter than the others.
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
    """A figure under a name of its own, also that of its file; `alt` says what it shows to those who cannot see it."""

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
    """A part of a report under its own title; `collapsed` shows the title only until it is asked for."""

    title: str
    blocks: tuple[Block, ...]
    id: str = ""
    collapsed: bool = False

    @property
    def anchor(self) -> str:
        """Where links to the section point: its id, or one made of its title."""
        return self.id or slug(self.title)


@dataclass(frozen=True)
class Report:
    """A title, what matters most (`summary`), the sections, and what it all rests on.

    `provenance` says name by name what the figures were made with; `data` are files that are written
    beside the page, by name. Raises `HeadwayError` where two sections or two pictures share a name.
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
        """All pictures, in order."""
        return (block for section in self.sections for block in section.blocks if isinstance(block, Illustration))

    def tables(self) -> dict[str, Table]:
        """All tables in order, by the name of their file."""
        found: dict[str, Table] = {}
        for section in self.sections:
            for block in section.blocks:
                if isinstance(block, Table):
                    stem = f"{section.anchor}-{slug(block.caption)}"[:80].rstrip("-")
                    name, count = stem, 2
                    while name in found:
                        name, count = f"{stem}-{count}", count + 1
                    found[name] = block
        return found


def _unique(what: str, names: list[str]) -> None:
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise HeadwayError(f"a report has two {what} called {twice[0]!r}; each needs a name of its own")
