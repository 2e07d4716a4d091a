"""`headway calibrate`: fit a law to recorded followers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from headway.cli import parse, show
from headway.cli.options import (
    FIGURES,
    Column,
    Format,
    Json,
    Lag,
    SetParameter,
    Unit,
    check_target,
    law_named,
    reading,
    vehicle_of,
)
from headway.errors import HeadwayError

if TYPE_CHECKING:
    from headway.calibration.fit import Fit

__all__ = ["calibrate"]


def calibrate(
    model: Annotated[str, Parameter(help="A law: a name, or my.py:soft (runs the file).")],
    file: Annotated[str, Parameter(help="A file of trajectories of two or more vehicles.")],
    *,
    vehicle: Annotated[
        list[int] | None, Parameter(help="A follower, 1 is the first; may be repeated; all if not given.")
    ] = None,
    fit: Annotated[
        str | None, Parameter(help="What is fitted, e.g. T,a,delay,lag; all parameters and the delay if not given.")
    ] = None,
    objective: Annotated[str, Parameter(help="gap, or gap+speed.")] = "gap",
    bound: Annotated[
        list[str] | None, Parameter(help="Bounds of what is fitted, e.g. T=0.5:3; may be repeated.")
    ] = None,
    set_: SetParameter = None,
    delay: Annotated[str, Parameter(help="Delay [s], or a pattern e.g. s=1,vl=1, which a fitted delay scales.")] = "0",
    lag: Lag = 0.0,
    train: Annotated[list[str] | None, Parameter(help="Window start:end [s] to fit; may be repeated.")] = None,
    test: Annotated[
        list[str] | None,
        Parameter(help="Window start:end [s], or another file, to test on; the rest of the record if not given."),
    ] = None,
    seeds: Annotated[int, Parameter(help="How many searches start differently.")] = 5,
    format: Format = None,
    column: Column = None,
    unit: Unit = None,
    out: Annotated[Path | None, Parameter(help="Write the fitted vehicles to this TOML file.")] = None,
    figure: Annotated[
        Path | None, Parameter(help="Draw the fit; of several vehicles, one file each, numbered.")
    ] = None,
    json: Json = False,
) -> None:
    """Fit a law to recorded followers, each behind the recorded vehicle ahead, and say how sure that is."""
    check_target(out, (".toml",))
    check_target(figure, FIGURES)
    law = law_named(model)
    windows = [parse.window("--train", text) for text in train or []]
    tests = [parse.window("--test", text) if parse.is_window(text) else text for text in test or []]
    bounds = parse.ranges("--bound", bound)

    from headway.calibration.document import save_fits
    from headway.calibration.fit import calibrate as fit_vehicle
    from headway.data.readers import read

    options = reading(format, column, unit)
    recording = read(Path(file), **options)
    others = [read(Path(t), **options) if isinstance(t, str) else t for t in tests]
    car = vehicle_of(law, set_, delay, lag)
    names = parse.names(fit) if fit is not None else None
    fits: list[Fit] = []
    followers = vehicle or list(range(1, recording.vehicles))
    if not followers:
        raise HeadwayError(f"{file}: has no followers to fit a law to")
    for n in followers:
        with show.working(f"fitting vehicle {n}"):
            fits.append(
                fit_vehicle(
                    car, recording, n, fit=names, objective=objective, bounds=bounds, train=windows or None,
                    test=others or None, seeds=seeds,
                )
            )  # fmt: skip
        if not json:
            print(fits[-1].report(), end="\n\n" if n != followers[-1] else "\n")
    written = [save_fits(fits, out)] if out is not None else []
    if figure is not None:
        written += _draw(fits, figure)
    if json:
        from headway.calibration.document import fits_table

        show.print_json({"file": file, **fits_table(fits), "written": [str(p) for p in written]})
        return
    for path in written:
        print(f"wrote {path}")


def _draw(fits: list[Fit], path: Path) -> list[Any]:
    from headway import plot

    written = []
    for fit in fits:
        target = path if len(fits) == 1 else path.with_stem(f"{path.stem}-{fit.follower}")
        written.append(plot.save(plot.calibrated(fit), target))
    return written
