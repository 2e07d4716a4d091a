"""`headway run` and `headway schema`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from headway.cli import show
from headway.cli.options import (
    FIGURES,
    Json,
    MetricNames,
    ModelFile,
    SetField,
    check_target,
    import_numba_without_blas,
    read_scenario,
)
from headway.errors import HeadwayError
from headway.version import __version__

if TYPE_CHECKING:
    from headway.engine.run import Result
    from headway.metrics.registry import Metric
    from headway.scenario.scenario import Scenario

__all__ = ["run", "schema"]


def run(
    scenario: Annotated[str | None, Parameter(help="A scenario file, or the name of a ready one (see --list).")] = None,
    *,
    set_: SetField = None,
    model: ModelFile = None,
    out: Annotated[Path | None, Parameter(help="Write the trajectories to this NetCDF file.")] = None,
    csv: Annotated[Path | None, Parameter(help="Write the trajectories to this CSV file.")] = None,
    figure: Annotated[Path | None, Parameter(help="Draw speeds, errors, gaps and the time-space diagram.")] = None,
    metrics: MetricNames = "",
    json: Json = False,
    toml: Annotated[bool, Parameter(help="Print the scenario as it would be run, and do not run it.")] = False,
    list_: Annotated[bool, Parameter(name="--list", help="List the ready scenarios.")] = False,
) -> None:
    """Simulate a platoon and print a table, one row a vehicle."""
    if list_:
        _list(json)
        return
    if scenario is None:
        raise HeadwayError("run needs a scenario: a TOML file, or a name that headway run --list shows")
    for path, kinds in ((out, (".nc",)), (csv, (".csv",)), (figure, FIGURES)):
        check_target(path, kinds)
    description = read_scenario(scenario, set_ or [], model or [])
    if toml:
        print(description.to_toml(), end="")
        return
    from headway.scenario.resolution import warn_of_coarse_step

    warn_of_coarse_step(description, level=2)
    with show.working("simulating (the first run after installation compiles the engine)"):
        import_numba_without_blas()
        from headway.engine.simulate import solve
        from headway.metrics.registry import chosen, split
        from headway.metrics.sizes import DEFAULT

        columns = chosen(split(metrics) or None, DEFAULT)
        result = solve(description)
    values, notes = _values(description, result, columns)
    written = _write(description, result, out, csv, figure)
    rows, sentences = _rows(description, values), _sentences(result, values, notes)
    until = _until(description, result)
    if json:
        show.print_json(_as_json(description, rows, values, sentences, until, written))
        return
    _print(description, rows, columns, values, until)
    for line in sentences:
        print(line)
    for path in written:
        print(f"wrote {path}")


def schema() -> None:
    """Print the JSON schema of scenario files, for editors."""
    from headway.scenario.document import schema as scenario_schema

    show.print_json(scenario_schema())


def _list(json: bool) -> None:
    from headway.library import library

    ready = library()
    if json:
        show.print_json(ready)
    else:
        show.print_table("", ("name", "what it is"), list(ready.items()), left=2)


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


#: headings of the columns that are shown if nothing is asked for
_COLUMNS = {
    "peak_spacing_error": "peak error [m]",
    "rms_spacing_error": "r.m.s. error [m]",
    "speed_amplitude": "speed amplitude [m/s]",
    "speed_amplitude_ratio": "ratio to the one ahead",
    "least_acceleration": "least accel. [m/s²]",
    "least_gap": "least gap [m]",
    "collision_time": "collision [s]",
}


def _values(scenario: Scenario, result: Result, metrics: Sequence[Metric]) -> tuple[dict[str, Any], list[str]]:
    """Values by metric, (vehicle,) or one number, and what is to be said of them; without xarray if none needs it."""
    from headway.engine.trajectories import limits, to_dataset, variables
    from headway.metrics.reduction import of_run

    needs: dict[str, int] = {}
    for metric in metrics:
        if metric.reduced is not None and metric.reduced.signal:
            needs[metric.reduced.signal] = needs.get(metric.reduced.signal, 0) | metric.reduced.mode
    hit = result.collision_time
    reduced = of_run(result.time, variables(scenario, result), needs, limits(scenario), hit)
    dataset = to_dataset(scenario, result) if any(m.reduced is None for m in metrics) else None
    values: dict[str, Any] = {}
    notes = []
    for metric in metrics:
        if metric.reduced is None:
            array = metric.of(dataset)
            values[metric.name] = array.values.astype(float)
            notes += [f"{metric.name}: {array.attrs['note']}"] if "note" in array.attrs else []
        else:
            signal = metric.reduced.signal
            values[metric.name] = metric.reduced.make(reduced[signal]) if signal else hit
    return values, notes


def _rows(scenario: Scenario, values: Mapping[str, Any]) -> list[dict[str, Any]]:
    """One row a vehicle."""
    names = ["leader", *(f.model.name for f in scenario.followers)]
    return [
        {"vehicle": n, "model": m, **{c: float(v[n]) for c, v in values.items() if v.ndim}} for n, m in enumerate(names)
    ]


def _until(scenario: Scenario, result: Result) -> list[float]:
    """Until when [s] each vehicle is known: the end, or a collision of it or further ahead."""
    times = (t if math.isfinite(t) else scenario.end for t in result.collision_time.tolist())
    return list(accumulate(times, min))


def _sentences(result: Result, values: Mapping[str, Any], notes: list[str]) -> list[str]:
    """What a reader of the table has to know: who collides first, what cannot be, what has no value."""
    from headway.metrics.sizes import braking_note

    sentences = []
    hits = sorted((float(t), n) for n, t in enumerate(result.collision_time) if math.isfinite(t))
    if hits:
        first = f"vehicle {hits[0][1]} collides at {hits[0][0]:.4g} s"
        more = "".join(f", then vehicle {n} at {t:.4g} s" for t, n in hits[1:4]) + (", …" if len(hits) > 4 else "")
        end = "it and all behind it are not simulated any further, and their rows tell of the time before"
        sentences.append(f"{first}{more}; {end}")
    if "least_acceleration" in values:
        sentences += filter(None, [braking_note(values["least_acceleration"])])
    return sentences + notes


def _print(
    scenario: Scenario, rows: list[dict[str, Any]], metrics: Sequence[Metric], values: Mapping[str, Any],
    until: list[float],
) -> None:  # fmt: skip
    broken = min(until) < scenario.end
    shown = [m for m in metrics if values[m.name].ndim and (broken or m.name != "collision_time")]
    heads = [_COLUMNS.get(m.name, f"{m.name.replace('_', ' ')}" + f" [{m.unit}]" * (m.unit != "1")) for m in shown]
    lines = [[str(row["vehicle"]), row["model"], *(show.rounded(row[m.name]) for m in shown)] for row in rows]
    if broken:
        heads.append("known until [s]")
        for line, time in zip(lines, until, strict=True):
            line.append(show.rounded(time))
    title = f"{scenario.name or scenario.leader.kind + ' leader'}: {len(rows) - 1} followers, {scenario.end:g} s"
    show.print_table(title, ("vehicle", "model", *heads), lines, left=2)
    for metric in metrics:
        if not values[metric.name].ndim:
            unit = "" if metric.unit == "1" else f" {metric.unit}"
            print(f"{metric.long_name}: {show.rounded(float(values[metric.name]))}{unit}")


def _as_json(
    scenario: Scenario, rows: list[dict[str, Any]], values: Mapping[str, Any], sentences: list[str],
    until: list[float], written: list[Path],
) -> dict[str, Any]:  # fmt: skip
    return {
        "name": scenario.name,
        "duration": scenario.end,
        "scenario_hash": scenario.hash,
        "headway_version": __version__,
        "vehicles": rows,
        "run": {name: float(v) for name, v in values.items() if not v.ndim},
        "known_until": until,
        "notes": sentences,
        "written": [str(p) for p in written],
    }
