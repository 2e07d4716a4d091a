"""`headway data`: recordings, how to get them, what is wrong with them, and how a model compares."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import cyclopts
from cyclopts import App, Parameter

from headway.cli import parse, show
from headway.errors import HeadwayError, unknown_name

if TYPE_CHECKING:
    from headway.data.catalogue import Entry
    from headway.data.recording import Recording

__all__ = ["Column", "Format", "Json", "Unit", "data_app", "reading"]

data_app = App(
    name="data",
    help="Recordings and drive cycles: list, get, check, compare.",
    default_parameter=cyclopts.Parameter(negative=()),
    help_format="plaintext",
)

Format = Annotated[str | None, Parameter(help="File format; found by looking if not given.")]
Column = Annotated[list[str] | None, Parameter(help="Name of a column in the file, e.g. speed=v; may be repeated.")]
Unit = Annotated[list[str] | None, Parameter(help="Unit of a column, e.g. speed=km/h; may be repeated.")]
Json = Annotated[bool, Parameter(help="Print as JSON.")]


@data_app.command(name="list")
def list_(*, json: Json = False) -> None:
    """List the catalogue: recordings that can be fetched and drive cycles that are shipped."""
    from headway.data.catalogue import catalogue

    entries = catalogue()
    if json:
        show.print_json({name: _entry(e) for name, e in entries.items()})
        return
    rows = [
        (e.name, e.kind, e.title, str(e.vehicles or "–"), show.number(e.seconds or float("nan")), e.licence)
        for e in entries.values()
    ]
    show.table("", ("name", "kind", "what", "vehicles", "seconds", "licence"), rows, left=3)


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


@data_app.command
def compare(
    file: Annotated[str, Parameter(help="A file of trajectories of two or more vehicles.")],
    *,
    model: Annotated[
        str, Parameter(help="The law that replaces the followers: a name, or my.py:soft (runs the file).")
    ],
    set_: Annotated[list[str] | None, Parameter(name="--set", help="A parameter, e.g. T=1.2; may be repeated.")] = None,
    delay: Annotated[float, Parameter(help="Delay of all on-board signals [s].")] = 0.0,
    lag: Annotated[float, Parameter(help="Time constant of the actuator [s].")] = 0.0,
    start: Annotated[float, Parameter(help="Start of the section [s].")] = 0.0,
    end: Annotated[float | None, Parameter(help="End of the section [s].")] = None,
    format: Format = None,
    column: Column = None,
    unit: Unit = None,
    out: Annotated[Path | None, Parameter(help="Write the simulated trajectories to this .nc or .csv file.")] = None,
    json: Json = False,
) -> None:
    """Simulate a platoon behind the recorded leader and compare it with the recorded followers."""
    from headway.data.compare import compare as compare_recording
    from headway.engine.simulate import simulate
    from headway.models.own import load_laws
    from headway.models.registry import find
    from headway.results import save
    from headway.scenario.behind import behind
    from headway.scenario.vehicle import Vehicle

    law = load_laws(model)[0] if ".py" in model else find(model)
    follower = Vehicle(law(**parse.numbers("--set", set_ or [], parse.PARAMETER)), delay=delay, lag=lag)
    scenario, section = behind(file, follower, start=start, end=end, reading=reading(format, column, unit))
    with show.working("simulating"):
        results = simulate(scenario)
    errors = compare_recording(results, section)
    if out is not None:
        save(results, out)
    if json:
        rows = errors.reset_coords(drop=True).to_dataframe().reset_index().to_dict("records")
        show.print_json({"file": file, "model": law.name, "vehicles": rows})
        return
    columns = {
        "rms_gap_error": "r.m.s. gap error [m]",
        "max_gap_error": "largest [m]",
        "nrmse_gap": "relative",
        "rms_speed_error": "r.m.s. speed error [m/s]",
        "max_speed_error": "largest [m/s]",
    }
    rows = [
        (str(int(n)), *(show.number(float(errors[c].sel(vehicle=n)), 3) for c in columns))
        for n in errors.vehicle.values
    ]
    show.table(f"{law.name} in the place of the followers of {file}", ("vehicle", *columns.values()), rows)


def reading(form: str | None, columns: list[str] | None, units: list[str] | None) -> dict[str, Any]:
    return {"format": form, "columns": _pairs("--column", columns), "units": _pairs("--unit", units)}


def _pairs(option: str, texts: list[str] | None) -> dict[str, str] | None:
    pairs = {}
    for text in texts or []:
        name, equals, value = text.partition("=")
        if not equals or not name or not value:
            raise HeadwayError(f"{option} {text}: write ours=theirs, e.g. speed=v")
        pairs[name] = value
    return pairs or None


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


def _entry(entry: Entry) -> dict[str, Any]:
    return dict(vars(entry))
