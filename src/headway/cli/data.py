"""`headway data`: recordings, how to get them, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import cyclopts
from cyclopts import App, Parameter

from headway.cli import show
from headway.cli.options import Column, Format, Json, Unit, reading
from headway.errors import unknown_name

if TYPE_CHECKING:
    from headway.data.catalogue import CatalogueEntry
    from headway.data.recording import Recording

__all__ = ["data_app"]

data_app = App(
    name="data",
    help="Recordings and drive cycles: list, get, check.",
    default_parameter=cyclopts.Parameter(negative=()),
    help_format="plaintext",
)


@data_app.command(name="list")
def list_(*, json: Json = False) -> None:
    """List the catalogue: recordings that can be fetched and drive cycles that are shipped."""
    from headway.data.catalogue import catalogue

    entries = catalogue()
    if json:
        show.print_json({name: _entry(e) for name, e in entries.items()})
        return
    rows = [
        (e.name, e.kind, e.title, str(e.vehicles or "–"), show.rounded(e.seconds or float("nan")), e.licence)
        for e in entries.values()
    ]
    show.print_table("", ("name", "kind", "what", "vehicles", "seconds", "licence"), rows, left=3)


@data_app.command
def info(
    name: Annotated[str, Parameter(help="A catalogue name or a file.")],
    *,
    format: Format = None,
    column: Column = None,
    unit: Unit = None,
    json: Json = False,
) -> None:
    """Describe a catalogue entry (provenance, licence), or a file and what is doubtful about it."""
    from headway.data.catalogue import catalogue

    entries = catalogue()
    if name in entries:
        fields = _entry(entries[name])
        if json:
            show.print_json(fields)
        else:
            for key, value in fields.items():
                print(f"{key:>12}: {value if value is not None else '–'}")
        return
    if not Path(name).exists():
        raise unknown_name("catalogue name or file", name, entries)
    _describe_file(_read(name, format, column, unit), json)


@data_app.command
def fetch(
    name: Annotated[str, Parameter(help="A catalogue name.")],
    *,
    directory: Annotated[Path | None, Parameter(help="Where to put it; a cache folder if not given.")] = None,
    base_url: Annotated[str | None, Parameter(help="A mirror to take it from.")] = None,
) -> None:
    """Download a recording, check its SHA-256 and say where it is."""
    from headway.data.catalogue import fetch as fetch_entry

    with show.working(f"fetching {name}"):
        path = fetch_entry(name, base_url=base_url, directory=directory)
    print(path)


def _read(name: str, form: str | None, columns: list[str] | None, units: list[str] | None) -> Recording:
    from headway.data.readers import read

    return read(Path(name), **reading(form, columns, units))


def _describe_file(recording: Recording, json: bool) -> None:
    from headway.data.checks import check

    findings = check(recording)
    if json:
        show.print_json(
            {
                "source": recording.source,
                "vehicles": recording.vehicles,
                "seconds": recording.duration,
                "samples": int(recording.time.size),
                "names": list(recording.names),
                "notes": list(recording.notes),
                "findings": [dict(vars(f)) for f in findings],
            }
        )
        return
    print(f"{recording.source}: {recording.vehicles} vehicles, {recording.duration:g} s, {recording.time.size} samples")
    for note in recording.notes:
        print(f"  note     {note}")
    for finding in findings:
        print(f"  {finding.severity:<8} {finding.message}")


def _entry(entry: CatalogueEntry) -> dict[str, Any]:
    return dict(vars(entry))
