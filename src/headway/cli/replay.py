"""`headway replay`: a recorded platoon and a simulated one behind the same leader."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from headway.cli import parse, show
from headway.cli.options import (
    FIGURES,
    Column,
    Delay,
    Figure,
    Format,
    Json,
    Lag,
    Out,
    SetParameter,
    Unit,
    check_target,
    law_named,
    reading,
    vehicle_of,
)
from headway.errors import HeadwayError

if TYPE_CHECKING:
    from headway.scenario.vehicle import Vehicle

__all__ = ["replay"]

_ERRORS = ("rms_gap_error", "max_gap_error", "nrmse_gap", "rms_speed_error", "max_speed_error", "nrmse_speed")

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
    set_: SetParameter = None,
    delay: Delay = "0",
    lag: Lag = 0.0,
    window: Annotated[str | None, Parameter(help="Window start:end [s]; all of the record if not given.")] = None,
    format: Format = None,
    column: Column = None,
    unit: Unit = None,
    out: Out = None,
    figure: Figure = None,
    json: Json = False,
) -> None:
    """Simulate a whole recorded string from its first leader alone, and compare errors and growth."""
    check_target(out, (".nc", ".csv"))
    check_target(figure, FIGURES)
    from headway.calibration.measured_transfer import measured_growth
    from headway.data.compare import compare
    from headway.data.readers import read
    from headway.engine.simulate import simulate
    from headway.results import save
    from headway.scenario.behind import behind

    options = reading(format, column, unit)
    count = read(file, **options).vehicles - 1
    if count < 1:
        raise HeadwayError(f"{file}: has no followers to compare with")
    cars = _vehicles(model, parameters, set_ or [], delay, lag, count)
    span = None if window is None else parse.window("--window", window)
    scenario, part = behind(file, cars, window=span, reading=options)
    with show.working("simulating"):
        run = simulate(scenario)
    errors = compare(run, part)
    recorded, simulated = measured_growth(part.speed), measured_growth(run.speed.values)
    rows: list[dict[str, Any]] = [
        {
            "vehicle": n,
            "model": cars[n - 1].model.name,
            **{name: float(errors[name].sel(vehicle=n)) for name in _ERRORS},
            "recorded_deviation": float(recorded.deviation[n]),
            "simulated_deviation": float(simulated.deviation[n]),
            "recorded_range": float(recorded.range[n]),
            "simulated_range": float(simulated.range[n]),
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
    texts = [(str(r["vehicle"]), r["model"], *(show.rounded(r[c], 3) for c in _COLUMNS)) for r in rows]
    show.print_table(f"behind the leader of {file}", ("vehicle", "model", *_COLUMNS.values()), texts, left=2)
    for path in written:
        print(f"wrote {path}")


def _vehicles(
    model: str | None, parameters: Path | None, assignments: list[str], delay: str, lag: float, count: int
) -> list[Vehicle]:
    """One vehicle for each recorded follower."""
    law = None if model is None else law_named(model)
    if parameters is None:
        if law is None:
            raise HeadwayError(
                "replay needs --model, a law for all followers, or --parameters, a file of fitted vehicles"
            )
        return [vehicle_of(law, assignments, delay, lag)] * count
    if assignments or delay != "0" or lag:
        raise HeadwayError(f"--set, --delay and --lag belong to --model; {parameters} brings its own values")
    from headway.calibration.document import load_followers

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
