"""`headway replay`: a recorded platoon and a simulated one behind the same leader."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from headway.cli import parse, show
from headway.cli.calibrate import law_named, window_of
from headway.cli.data import Column, Format, Json, Unit, reading
from headway.cli.run import check_target
from headway.errors import HeadwayError

if TYPE_CHECKING:
    from headway.scenario.vehicle import Vehicle

__all__ = ["replay"]

_COLUMNS = {
    "rms_gap_error": "r.m.s. gap error [m]",
    "nrmse_gap": "relative",
    "rms_speed_error": "r.m.s. speed error [m/s]",
    "recorded_deviation": "recorded std. of speed [m/s]",
    "simulated_deviation": "simulated",
    "recorded_range": "recorded range [m/s]",
    "simulated_range": "simulated",
}


def replay(
    file: Annotated[str, Parameter(help="A file of trajectories of two or more vehicles.")],
    *,
    model: Annotated[
        str | None, Parameter(help="The law of all followers, or of those in the parameters: a name, or my.py:soft.")
    ] = None,
    parameters: Annotated[
        Path | None, Parameter(help="Vehicles that headway calibrate --out wrote: one for all, or one each.")
    ] = None,
    set_: Annotated[list[str] | None, Parameter(name="--set", help="A parameter, e.g. T=1.2; may be repeated.")] = None,
    delay: Annotated[str, Parameter(help="Seconds for all on-board signals, or e.g. s=0.5,dv=0.5.")] = "0",
    lag: Annotated[float, Parameter(help="Time constant of the actuator [s].")] = 0.0,
    window: Annotated[str | None, Parameter(help="Window start:end [s]; all of the record if not given.")] = None,
    format: Format = None,
    column: Column = None,
    unit: Unit = None,
    out: Annotated[Path | None, Parameter(help="Write the simulated trajectories to this .nc or .csv file.")] = None,
    figure: Annotated[Path | None, Parameter(help="Draw the recorded and the simulated platoon on one page.")] = None,
    json: Json = False,
) -> None:
    """Simulate a whole recorded string from its first leader alone, and compare errors and growth."""
    check_target(out, (".nc", ".csv"))
    check_target(figure, (".png", ".svg", ".pdf"))
    from headway.calibration.platoon import replay as replayed
    from headway.calibration.platoon import section
    from headway.calibration.transfer import growth
    from headway.data.compare import compare
    from headway.data.readers import read
    from headway.results import save

    recording = read(Path(file), **reading(format, column, unit))
    span = None if window is None else window_of("--window", window)
    cars = _vehicles(model, parameters, set_ or [], delay, lag, recording.vehicles - 1)
    part = section(recording, span).from_zero()
    with show.working("simulating"):
        run = replayed(recording, cars, span)
    errors = compare(run, part)
    real, made = growth(part.speed), growth(run.speed.values)
    rows: list[dict[str, Any]] = [
        {
            "vehicle": n,
            "model": cars[n - 1].model.name,
            **{name: float(errors[name].sel(vehicle=n)) for name in list(_COLUMNS)[:3]},
            "recorded_deviation": float(real.deviation[n]),
            "simulated_deviation": float(made.deviation[n]),
            "recorded_range": float(real.range[n]),
            "simulated_range": float(made.range[n]),
        }
        for n in range(1, part.vehicles)
    ]
    written = [save(run, out)] if out is not None else []
    if figure is not None:
        from headway import plot

        written.append(plot.save(plot.replayed(part, run), figure))
    if json:
        show.print_json({"file": file, "vehicles": rows, "written": [str(p) for p in written]})
        return
    texts = [(str(r["vehicle"]), r["model"], *(show.number(r[c], 3) for c in _COLUMNS)) for r in rows]
    show.table(f"behind the leader of {file}", ("vehicle", "model", *_COLUMNS.values()), texts, left=2)
    for path in written:
        print(f"wrote {path}")


def _vehicles(
    model: str | None, parameters: Path | None, assignments: list[str], delay: str, lag: float, count: int
) -> list[Vehicle]:
    """One vehicle for each recorded follower."""
    from headway.scenario.vehicle import Vehicle

    law = None if model is None else law_named(model)
    if parameters is None:
        if law is None:
            raise HeadwayError(
                "replay needs --model, a law for all followers, or --parameters, a file of fitted vehicles"
            )
        values = parse.numbers("--set", assignments, parse.PARAMETER)
        return [Vehicle(law(**values), delay=parse.delay(delay), lag=lag)] * count
    if assignments or delay != "0" or lag:
        raise HeadwayError(f"--set, --delay and --lag belong to --model; {parameters} brings its own values")
    from headway.calibration.files import load_followers

    cars = load_followers(parameters, [law] if law is not None and ".py" in str(model) else [])
    for car in cars:
        if law is not None and car.model.law is not law:
            raise HeadwayError(f"{parameters}: holds a vehicle of {car.model.name}, and --model asks for {law.name}")
    if len(cars) not in (1, count):
        raise HeadwayError(
            f"{parameters}: holds {len(cars)} vehicles for {count} recorded followers; one for all or one for each is "
            "needed"
        )
    return cars * count if len(cars) == 1 else cars
