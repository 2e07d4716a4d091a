"""`headway run` and `headway schema`."""

from __future__ import annotations

import math
import sys
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from headway.cli import show
from headway.errors import HeadwayError
from headway.version import __version__

if TYPE_CHECKING:
    from headway.engine.run import Result
    from headway.scenario.scenario import Scenario

__all__ = ["check_target", "import_numba_without_blas", "read_scenario", "run", "schema"]


def run(
    scenario: Annotated[str | None, Parameter(help="A scenario file, or the name of a ready one (see --list).")] = None,
    *,
    set_: Annotated[
        list[str] | None,
        Parameter(name="--set", help="Override any field, e.g. followers.0.parameters.T=1.1; may be repeated."),
    ] = None,
    model: Annotated[
        list[str] | None,
        Parameter(help="Allow a law from a file, e.g. my.py:soft; this runs the file. May be repeated."),
    ] = None,
    out: Annotated[Path | None, Parameter(help="Write the trajectories to this NetCDF file.")] = None,
    csv: Annotated[Path | None, Parameter(help="Write the trajectories to this CSV file.")] = None,
    figure: Annotated[Path | None, Parameter(help="Draw speeds, errors, gaps and the time-space diagram.")] = None,
    json: Annotated[bool, Parameter(help="Print the table as JSON.")] = False,
    toml: Annotated[bool, Parameter(help="Print the scenario as it would be run, and do not run it.")] = False,
    list_: Annotated[bool, Parameter(name="--list", help="List the ready scenarios.")] = False,
) -> None:
    """Simulate a platoon and print a table, one row a vehicle."""
    if list_:
        _list(json)
        return
    if scenario is None:
        raise HeadwayError("run needs a scenario: a TOML file, or a name that headway run --list shows")
    for path, kinds in ((out, (".nc",)), (csv, (".csv",)), (figure, (".png", ".svg", ".pdf"))):
        check_target(path, kinds)
    description = read_scenario(scenario, set_ or [], model or [])
    if toml:
        print(description.to_toml(), end="")
        return
    with show.working("simulating (the first run after installation compiles the engine)"):
        import_numba_without_blas()
        from headway.engine.simulate import solve

        result = solve(description)
    written = _write(description, result, out, csv, figure)
    rows = _rows(description, result)
    if json:
        show.print_json(_as_json(description, rows, written))
        return
    _print(description, rows)
    for path in written:
        print(f"wrote {path}")


def schema() -> None:
    """Print the JSON schema of scenario files, for editors."""
    from headway.scenario.files import schema as scenario_schema

    show.print_json(scenario_schema())


def _list(json: bool) -> None:
    from headway.library import library

    ready = library()
    if json:
        show.print_json(ready)
    else:
        show.table("", ("name", "what it is"), list(ready.items()), left=2)


def check_target(path: Path | None, kinds: tuple[str, ...]) -> None:
    """Refuse a target before anything is computed."""
    if path is None:
        return
    if path.suffix not in kinds:
        raise HeadwayError(f"{path}: allowed here are files ending in {', '.join(kinds)}")
    if not path.parent.is_dir():
        raise HeadwayError(f"{path}: the folder {path.parent} does not exist")


def read_scenario(name: str, assignments: list[str], references: list[str]) -> Scenario:
    """The scenario of a file or of the library, with overrides and laws of one's own."""
    from headway.models.own import load_laws
    from headway.scenario.files import from_table, override, read_table

    laws = [law for reference in references for law in load_laws(reference)]
    prefix = name.partition(":")[0]
    if prefix in ("paper", "example"):
        from headway.library import library_table

        table, folder = library_table(name), Path(".")
    else:
        table, folder = read_table(name), Path(name).parent
    for assignment in assignments:
        override(table, assignment)
    return from_table(table, laws, folder)


def import_numba_without_blas() -> None:
    """Import numba's array functions while scipy.linalg, which they look for, cannot be found.

    The kernel does no linear algebra and need not wait a third of a second for it. Only the command
    line does this: it owns the process, and nobody else compiles in it.
    """
    if "scipy.linalg" in sys.modules:
        return
    sys.modules["scipy.linalg"] = None  # type: ignore[assignment]  # the documented way to hide one
    try:
        import numba.np.arraymath  # noqa: F401  imported for what it looks for
    finally:
        del sys.modules["scipy.linalg"]


def _write(scenario: Scenario, result: Result, out: Path | None, csv: Path | None, figure: Path | None) -> list[Path]:
    if out is None and csv is None and figure is None:
        return []
    from headway.engine.trajectories import to_dataset
    from headway.results import save

    dataset = to_dataset(scenario, result)
    written = [save(dataset, path) for path in (out, csv) if path is not None]
    if figure is not None:
        from headway import plot

        plot.save(plot.overview(dataset), figure)
        written.append(figure)
    return written


_COLUMNS = {
    "peak_spacing_error": "peak error [m]",
    "rms_spacing_error": "r.m.s. error [m]",
    "speed_amplitude": "speed amplitude [m/s]",
    "speed_amplitude_ratio": "ratio to the one ahead",
    "least_gap": "least gap [m]",
    "collision_time": "collision [s]",
}


def _rows(scenario: Scenario, result: Result) -> list[dict[str, Any]]:
    """One row a vehicle: what `headway.metrics.summary` gives, without waiting for xarray."""
    from headway.engine.trajectories import variables
    from headway.metrics.extremes import FROM_ZERO, amplitude_of, extreme_of, peak_of, rms_of

    found, time = variables(scenario, result), result.time
    amplitude = amplitude_of(time, found["speed"], FROM_ZERO)
    columns: dict[str, Any] = {
        "peak_spacing_error": peak_of(time, found["spacing_error"]),
        "rms_spacing_error": rms_of(time, found["spacing_error"]),
        "speed_amplitude": amplitude,
        "speed_amplitude_ratio": [float("nan")]
        + [b / a if a > 1e-12 else float("nan") for a, b in pairwise(amplitude)],
        "least_gap": extreme_of(time, found["gap"], -1.0, FROM_ZERO),
        "collision_time": result.collision_time,
    }
    names = ["leader", *(f.model.name for f in scenario.followers)]
    return [{"vehicle": n, "model": m, **{c: float(v[n]) for c, v in columns.items()}} for n, m in enumerate(names)]


def _print(scenario: Scenario, rows: list[dict[str, Any]]) -> None:
    hit = [row for row in rows if math.isfinite(row["collision_time"])]
    columns = {k: v for k, v in _COLUMNS.items() if k != "collision_time" or hit}
    lines = [(str(row["vehicle"]), row["model"], *(show.number(row[c]) for c in columns)) for row in rows]
    title = f"{scenario.name or scenario.leader.kind + ' leader'}: {len(rows) - 1} followers, {scenario.end:g} s"
    show.table(title, ("vehicle", "model", *columns.values()), lines, left=2)
    if hit:
        print(f"vehicle {hit[0]['vehicle']} collides; it and all behind it are not simulated any further")


def _as_json(scenario: Scenario, rows: list[dict[str, Any]], written: list[Path]) -> dict[str, Any]:
    return {
        "name": scenario.name,
        "duration": scenario.end,
        "scenario_hash": scenario.hash,
        "headway_version": __version__,
        "vehicles": rows,
        "written": [str(p) for p in written],
    }
