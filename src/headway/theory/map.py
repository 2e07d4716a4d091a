"""Stability maps: verdicts over two or three axes, with the boundary traced instead of read off the grid.

Any parameter of the law, the speed, the gap, delays, the lag and the frequency can be axes. Partial
derivatives come exactly from the law (duals over whole arrays), verdicts from the compiled sweep.
"""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from headway.checked import typed
from headway.errors import HeadwayError, shorten, unknown_name
from headway.limits import check_size
from headway.models import Law, Model
from headway.scenario.vehicle import Vehicle
from headway.theory.gain import VERDICTS
from headway.theory.points import OperatingPoints, is_delay

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["CLASSES", "WHAT", "StabilityMap", "axis", "stability_map", "trace"]

Array = NDArray[np.float64]

#: what a map can show
WHAT = ("string", "local", "gain", "critical_delay")

#: the classes of each kind of verdict by code; "frequency" is whether one frequency grows from vehicle to vehicle
CLASSES = {
    "string": VERDICTS,
    "local": ("no equilibrium", "locally unstable", "oscillating", "not oscillating"),
    "frequency": ("no equilibrium", "locally unstable", "grows", "does not grow"),
}

_UNITS = {"speed": "m/s", "gap": "m", "lag": "s", "omega": "rad/s"}
_POINTS = {1: 1000, 2: 200, 3: 60}
_PART = 2048


@dataclass(frozen=True, eq=False)
class StabilityMap:
    """Verdicts over axes.

    Attributes:
        dataset: xarray.Dataset whose dimensions are the axes in their order. `verdict` holds the codes of
            `CLASSES`; beside it `margin` [1/s²] ("string": least (|D|² - |N|²)/ω², negative where a frequency
            grows), `decay_rate` [1/s] ("local"), `gain` [1] ("gain": sup |G|, or |G(iω)| at `omega`;
            infinite if locally unstable) or `critical_delay` [s] ("critical_delay": of the pattern of delays).
        boundary: polylines (points, axes) by class: around where the verdict is that class or a better one. Every point
            lies on a line of the grid and there within 1e-6 of the range of its axis. With three axes a polyline lies
            in a plane of the third. Classes without a boundary on the map are left out.
    """

    dataset: xr.Dataset
    boundary: Mapping[str, tuple[Array, ...]]

    @property
    def axes(self) -> dict[str, Array]:
        """Values (points,) by name of the axis, in its unit."""
        return {str(n): self.dataset[n].values for n in self.dataset.verdict.dims}

    @property
    def what(self) -> str:
        """The kind of map, one of `WHAT`."""
        return str(self.dataset.attrs["what"])

    @property
    def classes(self) -> tuple[str, ...]:
        """Meaning of the codes of `verdict`."""
        return tuple(str(self.dataset.verdict.attrs["flag_meanings"]).split(", "))

    @property
    def shares(self) -> dict[str, float]:
        """Share of the grid's points in each class."""
        codes = self.dataset.verdict.values
        return {name: float(np.mean(codes == code)) for code, name in enumerate(self.classes)}

    def save(self, path: str | Path) -> None:
        """Write the map as NetCDF; the boundary of a class is a variable of its own, NaN between polylines.

        Args:
            path: of the file, which appears complete or not at all.

        Raises:
            HeadwayError: where nothing can be written.
        """
        from headway.results import save

        names = list(self.axes)
        lines = {}
        for k, (name, parts) in enumerate(self.boundary.items()):
            joined = np.concatenate([piece for line in parts for piece in (line, np.full((1, len(names)), np.nan))])
            note = {"long_name": f"around where the verdict is '{name}' or better; NaN between lines"}
            lines[f"boundary_{name.replace(' ', '_')}"] = ((f"point_{k}", "axis"), joined, note)
        save(self.dataset.assign(lines).assign_coords(axis=names), path)


@typed
def stability_map(
    vehicle: Vehicle | Model | Law,
    axes: Mapping[str, Any],
    *,
    speed: float | None = None,
    gap: float | None = None,
    omega: float | None = None,
    what: str = "string",
) -> StabilityMap:
    """Compute verdicts of a vehicle over one to three axes.

    Args:
        vehicle: a vehicle, or a law without delays.
        axes: by name, a range (low, high), a range with a number of points (low, high, count), or an array of
            rising values. Names: a parameter of the law; `speed` [m/s]; `gap` [m]; `delay` [s], what
            `Vehicle(delay=x)` says: all on-board signals late by x and the radio current; `radio_delay` [s]: all radio
            signals late by x and those on board as they are; `delay.s`, `delay.vl` … [s] of one signal; `lag` [s];
            `omega` [rad/s] (for "gain").
        speed: of the platoon [m/s], at least 0, where it is no axis.
        gap: of the platoon [m], above 0, where it is no axis. With the gap alone, the speed is the law's equilibrium
            speed at it; both are needed where every gap is an equilibrium (GMM).
        omega: frequency [rad/s] of a map of the gain, where it is no axis; None: the peak over all.
        what: "string", "local", "gain" or "critical_delay", see `StabilityMap`.

    Returns:
        The map; boundaries are traced to 1e-6 of the range of each axis.

    Raises:
        HeadwayError: for names, ranges or combinations that mean nothing.
        LeaderHeardError: for a law that hears the platoon leader, unless `what` is "local".
    """
    if what not in WHAT:
        raise unknown_name("kind of map", what, WHAT)
    if not 1 <= len(axes) <= 3:
        raise HeadwayError(f"a map has one to three axes, not {len(axes)}")
    counts = [_count(choice, len(axes)) for choice in axes.values()]
    check_size(f"a map of {' × '.join(f'{count:.4g}' for count in counts)}", math.prod(counts), "points of a map")
    car = vehicle if isinstance(vehicle, Vehicle) else Vehicle(vehicle)
    values = {name: axis(name, choice, len(axes)) for name, choice in axes.items()}
    points = OperatingPoints(car, tuple(values), speed, gap, omega, what)
    lows = {n: float(v[0]) for n, v in values.items()}
    points.check(lows, {n: float(v[-1]) for n, v in values.items()})
    shape = tuple(v.size for v in values.values())
    mesh = dict(zip(values, np.meshgrid(*values.values(), indexing="ij", sparse=True), strict=True))
    rows, equilibrium, frequency = points.rows(mesh)
    if not equilibrium.any():
        points.explain(mesh)
    fields = _evaluate(points, rows.reshape(-1, rows.shape[-1]), None if frequency is None else frequency.ravel())
    fields = {n: x.reshape(shape) for n, x in fields.items()}
    for name, x in fields.items():
        fields[name] = np.where(equilibrium, x, 0 if name == "verdict" else np.nan)

    def verdict(at: Array) -> NDArray[np.int8]:
        rows, equilibrium, frequency = points.rows({n: at[:, i] for i, n in enumerate(values)})
        return np.where(equilibrium, _evaluate(points, rows, frequency)["verdict"], 0).astype(np.int8)

    codes = fields["verdict"].astype(np.int8)
    dataset = _dataset(car, values, points, what, {**fields, "verdict": codes})
    return StabilityMap(dataset, trace(codes, list(values.values()), verdict, CLASSES[_kind(points)]))


def _count(choice: Any, axes: int) -> float:
    """Return how many values an axis will have; 1 for what `axis` will refuse."""
    if isinstance(choice, tuple) and len(choice) == 3 and isinstance(choice[2], int | float):
        return float(choice[2]) if choice[2] > 0 else 1.0
    if isinstance(choice, tuple) and len(choice) in (2, 3):
        return float(_POINTS[axes])
    return float(np.size(choice)) if isinstance(choice, Sequence | np.ndarray) else 1.0


def axis(name: str, choice: Any, axes: int = 2) -> Array:
    """Return the values of an axis of a map.

    Args:
        name: of the axis, for messages.
        choice: (low, high), (low, high, count), or rising values.
        axes: number of axes of the map, on which the number of points of a mere range depends.

    Returns:
        At least two rising values (points,).

    Raises:
        HeadwayError: for values that are not numbers, not finite or do not rise.
    """
    if isinstance(choice, tuple) and len(choice) in (2, 3):
        try:
            low, high = float(choice[0]), float(choice[1])
            count = int(choice[2]) if len(choice) == 3 else _POINTS[axes]
        except (TypeError, ValueError, OverflowError):
            raise HeadwayError(
                f"axis {name}: {shorten(choice)} is no range; write (low, high) or (low, high, count) in numbers"
            ) from None
        if not (math.isfinite(low) and math.isfinite(high)):
            raise HeadwayError(f"axis {name}: {low:g} to {high:g} is not a finite range")
        if low == high:
            raise HeadwayError(f"axis {name}: {low:g} to {high:g} is an empty range")
        if low > high:
            raise HeadwayError(f"axis {name}: {low:g} to {high:g} is reversed; write {high:g} to {low:g}")
        if count < 2:
            raise HeadwayError(f"axis {name}: {count} points make no axis; at least 2 are needed")
        return np.linspace(low, high, count)
    try:
        values = np.asarray(choice, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise HeadwayError(
            f"axis {name}: {shorten(choice)} is neither a range (low, high) nor an array of numbers"
        ) from None
    if values.ndim != 1 or values.size < 2 or not np.all(np.isfinite(values)) or not np.all(np.diff(values) > 0):
        raise HeadwayError(f"axis {name}: values must be at least two finite numbers that rise")
    return values


def _evaluate(points: OperatingPoints, rows: Array, frequency: Array | None) -> dict[str, Any]:
    """Return the variables of a map for rows of `sweep.COLUMNS`; all cores share the parts."""
    from headway.theory import sweep

    what, count = points.what, rows.shape[0]
    rows = np.ascontiguousarray(rows)
    judged = rows
    if what == "critical_delay" and points.on_time:
        # the rows carry the pattern whose scale is looked for; the vehicle itself is not late
        judged = rows.copy()
        judged[:, [n.startswith("delay") for n in sweep.COLUMNS]] = 0.0

    def work(part: slice) -> dict[str, Any]:
        r = rows[part]
        if what == "local":
            rate, oscillates = sweep.decays_of(r)
            return {"verdict": np.where(rate > 0, np.where(oscillates, 2, 3), 1), "decay_rate": rate}
        verdicts = sweep.judge(judged[part])
        if what == "string":
            return {"verdict": verdicts.codes, "margin": verdicts.margin}
        if what == "critical_delay":
            return {"verdict": verdicts.codes, what: sweep.critical_of(r)}
        if frequency is None:
            return {"verdict": verdicts.codes, what: sweep.peaks_of(r).gain}
        gain = sweep.gain_of(r, frequency[part])
        return {"verdict": np.where(verdicts.locally_stable, np.where(gain <= 1.0 + 1e-9, 3, 2), 1), what: gain}

    parts = [slice(i, min(i + _PART, count)) for i in range(0, count, _PART)]
    if len(parts) > 1:
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            done = list(pool.map(work, parts))
    else:
        done = [work(part) for part in parts]
    return {name: np.concatenate([piece[name] for piece in done]) for name in done[0]}


def trace(
    codes: NDArray[np.int8], axes: list[Array], verdict: Callable[[Array], Any], classes: Sequence[str]
) -> dict[str, tuple[Array, ...]]:
    """Trace the boundaries of classes: polylines where codes change, each point bisected along its line of the grid.

    Codes over one axis change at points (1, 1); over three, every plane of the third axis is traced by itself.

    Args:
        codes: verdicts on the grid, one dimension for each axis.
        axes: rising values of each axis.
        verdict: codes of values (points, axes), (points,).
        classes: name of each code.

    Returns:
        Polylines (points, axes) by class; a class without a boundary is left out.
    """
    polylines: dict[str, list[Array]] = {}
    for code in np.unique(codes)[1:]:

        def inside(at: Array, code: int = code) -> NDArray[np.bool_]:
            return np.asarray(np.asarray(verdict(at)) >= code)

        outlines: list[Array] = []
        if codes.ndim == 1:
            changes = np.flatnonzero(np.diff(codes >= code))
            outlines = [np.array([[i + 0.5]]) for i in changes]
        elif codes.ndim == 2:
            outlines = _outline(codes >= code)
        else:
            for k in range(codes.shape[2]):
                outlines += [np.column_stack((x, np.full(len(x), k))) for x in _outline(codes[:, :, k] >= code)]
        if outlines:
            polylines[classes[code]] = _refined(outlines, axes, inside)
    return {n: tuple(lines) for n, lines in polylines.items()}


def _outline(inside: NDArray[np.bool_]) -> list[Array]:
    """Return polylines in grid indices around a set of grid points; every vertex halves an edge of the grid."""
    import contourpy

    generator = contourpy.contour_generator(z=inside.astype(float).T, name="serial")
    return [np.asarray(line) for line in generator.lines(0.5)]


def _refined(lines: list[Array], axes: list[Array], inside: Callable[[Array], NDArray[np.bool_]]) -> list[Array]:
    """Move vertices along their edges of the grid to where the verdict changes."""
    vertex = np.concatenate(lines)
    low = np.column_stack([a[np.floor(vertex[:, i]).astype(int)] for i, a in enumerate(axes)])
    high = np.column_stack([a[np.ceil(vertex[:, i]).astype(int)] for i, a in enumerate(axes)])
    at_low = inside(low)
    span = np.array([a[-1] - a[0] for a in axes])
    while np.max(np.abs(high - low) / span) > 1e-7:
        middle = 0.5 * (low + high)
        same = (inside(middle) == at_low)[:, None]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return np.split(0.5 * (low + high), np.cumsum([len(line) for line in lines])[:-1])


def _dataset(
    car: Vehicle, axes: dict[str, Array], points: OperatingPoints, what: str, fields: dict[str, Any]
) -> xr.Dataset:
    import xarray as xr

    from headway.version import __version__

    names = tuple(axes)
    verdicts = _kind(points)
    meanings = ", ".join(CLASSES[verdicts])
    attributes = {
        "verdict": {"long_name": f"{verdicts} verdict", "flag_values": list(range(4)), "flag_meanings": meanings},
        "margin": {"long_name": "least (|D|² - |N|²)/ω²", "units": "1/s²"},
        "decay_rate": {"long_name": "decay rate of one vehicle", "units": "1/s"},
        "gain": {"long_name": "gain |G|" if points.has_frequency else "peak gain sup |G|", "units": "1"},
        "critical_delay": {"long_name": "critical delay of string stability", "units": "s"},
    }  # fmt: skip
    delay = car.delay
    return xr.Dataset(
        {n: (names, x, attributes[n]) for n, x in fields.items()},
        coords={n: (n, v, {"units": axis_unit(car, n), "long_name": label(car, n)}) for n, v in axes.items()},
        attrs={
            "what": what,
            "model": car.model.name,
            "parameters": ", ".join(f"{n} = {x:g}" for n, x in car.model.items if n not in axes),
            "delay": f"{delay:g} s" if isinstance(delay, float) else ", ".join(f"{n} {t:g} s" for n, t in delay),
            "lag": car.lag,
            **{n: x for n, x in dataclasses.asdict(points).items() if n in ("speed", "gap", "omega") and x is not None},
            "version": __version__,
        },
    )


def _kind(points: OperatingPoints) -> str:
    """Return which of `CLASSES` the verdicts of a map belong to."""
    if points.has_frequency:
        return "frequency"
    return "local" if points.what == "local" else "string"


def axis_unit(car: Vehicle, name: str) -> str:
    """Return the unit of an axis of a map.

    Args:
        car: the vehicle of the map.
        name: of the axis.
    """
    if name in car.model.law.parameters:
        return car.model.law.parameters[name].info.unit
    return "s" if is_delay(name) else _UNITS[name]


def label(car: Vehicle, name: str) -> str:
    """Say in words what an axis of a map is.

    Args:
        car: the vehicle of the map.
        name: of the axis.
    """
    if name in car.model.law.parameters:
        return car.model.law.parameters[name].info.text or name
    words = {
        "delay": "delay",
        "radio_delay": "radio delay",
        "lag": "actuator lag",
        "speed": "speed",
        "gap": "gap",
        "omega": "frequency",
    }
    return words.get(name) or f"delay of {name.partition('.')[2]}"
