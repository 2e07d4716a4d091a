"""`headway calibrate`: fit a law to recorded followers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from headway.cli import parse, show
from headway.cli.data import Column, Format, Json, Unit, reading
from headway.cli.run import check_target
from headway.errors import HeadwayError

if TYPE_CHECKING:
    from headway.calibration.fit import Fit
    from headway.models.law import Law

__all__ = ["calibrate", "law_named", "window_of"]


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
    set_: Annotated[
        list[str] | None, Parameter(name="--set", help="Value of a parameter, e.g. v0=33; may be repeated.")
    ] = None,
    delay: Annotated[str, Parameter(help="Delay [s], or a pattern e.g. s=1,vl=1, which a fitted delay scales.")] = "0",
    lag: Annotated[float, Parameter(help="Time constant of the actuator [s].")] = 0.0,
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
    check_target(figure, (".png", ".svg", ".pdf"))
    law = law_named(model)
    windows = [window_of("--train", text) for text in train or []]
    tests = [window_of("--test", text) if _iswindow_of(text) else text for text in test or []]
    bounds = {name: window_of("--bound", value) for name, value in (_pair(text) for text in bound or [])}

    from headway.calibration.files import save
    from headway.calibration.fit import calibrate as fit_vehicle
    from headway.data.readers import read
    from headway.scenario.vehicle import Vehicle

    options = reading(format, column, unit)
    recording = read(Path(file), **options)
    others = [read(Path(t), **options) if isinstance(t, str) else t for t in tests]
    car = Vehicle(law(**parse.numbers("--set", set_ or [], parse.PARAMETER)), delay=parse.delay(delay), lag=lag)
    names = [n.strip() for n in fit.split(",") if n.strip()] if fit is not None else None
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
    written = [save(fits, out)] if out is not None else []
    if figure is not None:
        written += _draw(fits, figure)
    if json:
        from headway.calibration.files import table

        show.print_json({"file": file, **table(fits), "written": [str(p) for p in written]})
        return
    for path in written:
        print(f"wrote {path}")


def law_named(reference: str) -> Law:
    """The law of a name, or in a Python file."""
    from headway.models.own import load_laws
    from headway.models.registry import find

    return load_laws(reference)[0] if ".py" in reference else find(reference)


def _iswindow_of(text: str) -> bool:
    """Whether a text is two numbers and a colon, and no file."""
    try:
        return len([float(x) for x in text.split(":")]) == 2
    except ValueError:
        return False


def window_of(option: str, text: str) -> tuple[float, float]:
    """Two numbers of a text such as 0:200."""
    if not _iswindow_of(text):
        raise HeadwayError(f"{option} {text}: write two numbers with a colon between, e.g. 0:200")
    a, b = text.split(":")
    return float(a), float(b)


def _pair(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise HeadwayError(f"--bound {text}: write name=low:high, e.g. T=0.5:3")
    return name.strip(), value


def _draw(fits: list[Fit], path: Path) -> list[Any]:
    from headway import plot

    written = []
    for fit in fits:
        target = path if len(fits) == 1 else path.with_stem(f"{path.stem}-{fit.follower}")
        written.append(plot.save(plot.calibrated(fit), target))
    return written
