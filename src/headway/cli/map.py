"""`headway map`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from headway.cli import parse, show
from headway.cli.equilibrium import SPEED, check_gap
from headway.cli.options import (
    FIGURES,
    Delay,
    Figure,
    Gap,
    Json,
    Lag,
    ModelFile,
    SetParameter,
    check_target,
    laws_of,
    vehicle_of,
)
from headway.errors import HeadwayError

if TYPE_CHECKING:
    from headway.scenario.vehicle import Vehicle
    from headway.theory.map import StabilityMap

__all__ = ["map_"]

_ROWS = 9


def map_(
    subject: Annotated[
        str, Parameter(help="A model (with --x), or one of the paper's maps: idm, ovm, gmm, cacc, cacc-3d.")
    ] = "idm",
    *,
    x: Annotated[str | None, Parameter(help="First axis, e.g. T=0.5:2.5, or with a number of points T=0.5:2.5:100.")]
    = None,
    y: Annotated[str | None, Parameter(help="Second axis: delay=0:1.5, radio_delay=0:1, delay.s=0:1, speed=5:30, …")]
    = None,
    z: Annotated[str | None, Parameter(help="Third axis, e.g. omega=0.1:3 for a map of the gain.")] = None,
    what: Annotated[str, Parameter(help="string, local, gain or critical_delay.")] = "string",
    speed: Annotated[float | None, Parameter(help="Speed of the platoon [m/s]; 23 if neither it nor a gap tells it.")]
    = None,
    gap: Gap = None,
    omega: Annotated[float | None, Parameter(help="One frequency [rad/s] for a map of the gain.")] = None,
    set_: SetParameter = None,
    delay: Delay = "0",
    lag: Lag = 0.0,
    model: ModelFile = None,
    point: Annotated[str | None, Parameter(help="Mark a point in the figure, e.g. T=1.5,delay=0.4.")] = None,
    out: Annotated[Path | None, Parameter(help="Write the map and its boundary to this NetCDF file.")] = None,
    figure: Figure = None,
    json: Json = False,
) -> None:  # fmt: skip
    """Stability map over two or three axes, with exact theory and a traced boundary."""
    check_target(out, (".nc",))
    check_target(figure, FIGURES)
    typed = [(option, text) for option, text in (("--x", x), ("--y", y), ("--z", z)) if text is not None]
    axes = dict(parse.axis_range(option, text) for option, text in typed)
    if len(axes) < len(typed):
        raise HeadwayError("an axis is given twice; the axes of a map differ")
    if not axes:
        options = [n for n, value in (("--speed", speed), ("--gap", gap), ("--set", set_), ("--point", point)) if value]
        _paper(subject.removeprefix("paper:"), options, out, figure, json)
        return
    if point is not None and figure is None:
        raise HeadwayError(f"--point {point}: marks a place in a figure, so name one with --figure")
    marked = None if point is None else parse.assignments("--point", point.split(","), "T=1.5,delay=0.4")
    if x is None:
        raise HeadwayError(f"{'--y' if y else '--z'} is given without --x; name the first axis")
    from headway.models.registry import find

    car = vehicle_of(find(subject, laws_of(model)), set_, delay, lag)
    if speed is None and not {"speed", "gap"} & set(axes) and (gap is None or car.model.rests_everywhere):
        speed = SPEED
    if "gap" not in axes:
        check_gap(car.model, gap)
    with show.working("computing the map (the first one after installation compiles)"):
        from headway.theory.map import stability_map

        result = stability_map(car, axes, speed=speed, gap=gap, omega=omega, what=what)
    if figure is not None:
        from headway import plot

        plot.save(plot.stability_map(result, point=marked), figure)
    if out is not None:
        result.save(out)
    if json:
        show.print_json({"model": car.model.name, **_as_json(result), "files": [str(p) for p in (out, figure) if p]})
        return
    print(_sentence(car, result))
    _boundary(result)
    for path in (out, figure):
        if path:
            print(f"wrote {path}")


def _paper(name: str, options: list[str], out: Path | None, figure: Path | None, json: bool) -> None:
    """One of the paper's maps: each panel's shares, the caption, and the figure."""
    from headway.models.registry import BUILT_IN

    if options:
        raise HeadwayError(f"{options[0]} belongs to a map of one's own; name its first axis, e.g. --x T=0.5:2.5")
    with show.working("computing the maps (the first one after installation compiles)"):
        from headway.literature.barhoumi2025.maps import NAMES, reproduced_map

        if name in BUILT_IN and name not in NAMES:
            raise HeadwayError(f"a map of {name} needs an axis, e.g. --x delay=0:1.5; the paper has {', '.join(NAMES)}")
        maps = reproduced_map(name)
    if out is not None:
        raise HeadwayError(f"--out {out}: the paper's maps are figures of several panels; use --figure or --json")
    if figure is not None:
        from headway import plot

        plot.save(plot.paper_map(maps), figure)
    if json:
        show.print_json(
            {
                "name": maps.name, "title": maps.title, "caption": maps.caption,
                "panels": [{"title": title, **_as_json(panel)} for title, panel in maps.panels],
            }
        )  # fmt: skip
        return
    print(maps.title)
    for title, panel in maps.panels:
        print(f"  {title}: {_shares(panel)}")
    print(maps.caption)
    if figure is not None:
        print(f"wrote {figure}")


def _shares(result: StabilityMap) -> str:
    """How much of the map each class covers."""
    shares = result.shares
    return ", ".join(f"{share:.1%} {name}" for name, share in reversed(shares.items()) if share > 0)


def _sentence(car: Vehicle, result: StabilityMap) -> str:
    """What was mapped, and the answer in short."""
    from headway.theory.points import is_delay

    where = " and ".join(
        f"{n} {v[0]:g} to {v[-1]:g} {result.dataset[n].attrs['units']}".rstrip() for n, v in result.axes.items()
    )
    fixed = [f"{n} {result.dataset.attrs[n]:g} {u}" for n, u in (("speed", "m/s"), ("gap", "m"), ("omega", "rad/s"))
             if n in result.dataset.attrs]  # fmt: skip
    late = f", delay {result.dataset.attrs['delay']}" if not any(map(is_delay, result.axes)) else ""
    return f"{car.model.name} over {where}{''.join(f', {f}' for f in fixed)}{late}: {_shares(result)}"


def _boundary(result: StabilityMap) -> None:
    """Where the best class ends, on a few lines of the grid of a map of two axes."""
    if len(result.axes) != 2 or not result.boundary:
        return
    name, lines = list(result.boundary.items())[-1]
    (first, values), (second, _) = result.axes.items()
    chosen = values[[round(i * (len(values) - 1) / (_ROWS - 1)) for i in range(_ROWS)]]
    rows = []
    for value in dict.fromkeys(map(float, chosen)):
        crossings = sorted({f"{q:.6g}" for line in lines for p, q in line if p == value}, key=float)
        rows.append([f"{value:.4g}", ", ".join(crossings) or "–"])
    units = {n: result.dataset[n].attrs["units"] for n in result.axes}
    print(f"boundary of '{name}':")
    show.print_table("", [f"{first} [{units[first]}]", f"{second} [{units[second]}]"], rows, left=0)


def _as_json(result: StabilityMap) -> dict[str, Any]:
    return {
        "what": result.what,
        "axes": {n: [float(v[0]), float(v[-1]), len(v)] for n, v in result.axes.items()},
        **{n: result.dataset.attrs[n] for n in ("speed", "gap", "omega", "delay", "lag") if n in result.dataset.attrs},
        "shares": result.shares,
        "boundary": {n: [line.tolist() for line in lines] for n, lines in result.boundary.items()},
    }
