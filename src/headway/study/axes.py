"""Which points a study has: grids, zipped lists, random and low-discrepancy designs."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from headway.checked import typed
from headway.errors import HeadwayError, shorten, unknown_name
from headway.limits import check_size

__all__ = ["HUGE", "Between", "Design", "Points", "between", "points"]

#: counts beyond this are one to a limit
HUGE = 1e18

Design = Literal["grid", "zip", "sobol", "latin", "random"]


@dataclass(frozen=True)
class Between:
    """Numbers between two ends; see `between`.

    Attributes:
        low: the first.
        high: the last.
        count: how many in a grid; None for the range of a design.
        log: whether they are spaced evenly in the logarithm.
    """

    low: float
    high: float
    count: int | None = None
    log: bool = False

    def at(self, share: Any) -> Any:
        """Numbers at shares (…,) of the way, from 0 at `low` to 1 at `high`."""
        if self.log:
            return self.low * (self.high / self.low) ** share
        return self.low + (self.high - self.low) * share


@typed
def between(low: float, high: float, count: int | None = None, *, log: bool = False) -> Between:
    """Values of an axis between two ends, both included.

    Args:
        low: the first; above 0 if `log`.
        high: the last, not below `low`.
        count: how many in a grid, 1 or more; None for the range of a design.
        log: whether they are spaced evenly in the logarithm.

    Raises:
        HeadwayError: for ends that are not finite numbers in order, or a count that is not a whole number of 1 or more.
    """
    return _between("axis", low, high, count, log)


def _between(place: str, low: Any, high: Any, count: Any, log: bool) -> Between:
    """A `Between` of checked ends; errors name `place`."""
    for name, value in (("from", low), ("to", high)):
        if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not -1e300 < value < 1e300:
            raise HeadwayError(f"{place}: {name} = {shorten(value)} is not a finite number")
    if not low <= high:
        raise HeadwayError(f"{place}: from = {low:g} is greater than to = {high:g}")
    if log and low <= 0:
        raise HeadwayError(f"{place}: from = {low:g} is not greater than 0, as a logarithmic scale needs")
    if count is not None and (isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1):
        raise HeadwayError(f"{place}: count = {shorten(count)} is not a whole number of 1 or more")
    if count is not None:
        check_size(f"{place}: count", float(min(count, HUGE)), "values of axes")
    return Between(float(low), float(high), None if count is None else int(count), log)


@dataclass(frozen=True, eq=False)
class Points:
    """All points of a study, without a list of them.

    Attributes:
        dims: dimension → length.
        along: path → the dimension along which it varies.
        values: path → its values, as long as that dimension.
    """

    dims: dict[str, int]
    along: dict[str, str]  # path → dimension
    values: dict[str, np.ndarray]  # path → (size of that dimension,)

    @property
    def count(self) -> int:
        """How many points there are."""
        return math.prod(self.dims.values())

    @property
    def shape(self) -> tuple[int, ...]:
        """Length of each dimension."""
        return tuple(self.dims.values())

    def take(self, numbers: np.ndarray) -> dict[str, np.ndarray]:
        """Values of each path at some points.

        Args:
            numbers: (n,) numbers of points, counted with the last dimension fastest.

        Returns:
            path → values (n,).
        """
        index = dict(zip(self.dims, np.unravel_index(numbers, self.shape), strict=True))
        return {path: values[index[self.along[path]]] for path, values in self.values.items()}


def points(axes: Mapping[Any, Any], design: Design = "grid", count: int | None = None, seed: int = 0) -> Points:
    """The points that axes and a design describe.

    Args:
        axes: path, or paths joined by '+' or in a tuple → values, as of `Study`.
        design: grid, zip, sobol, latin or random.
        count: how many points; only for sobol, latin and random.
        seed: of these designs.

    Raises:
        HeadwayError: for another design, axes that are no mapping or have no values, and a count that is missing or out
            of place.
    """
    if design not in get_args(Design):
        raise unknown_name("design", design, get_args(Design))
    if not isinstance(axes, Mapping):
        raise HeadwayError(f"axes = {shorten(axes)} is not a mapping from a field to its values")
    groups = [_group(paths, values) for paths, values in axes.items()]
    names = [path for group in groups for path in group]
    for name in names:
        if names.count(name) > 1:
            raise HeadwayError(f"axes: {name} is given twice")
    if design in ("grid", "zip"):
        if count is not None:
            raise HeadwayError(f"design: a {design} has as many points as its axes say; count is for the other designs")
        return (_grid if design == "grid" else _zip)(groups)
    if count is None or isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
        raise HeadwayError(f"design: {design} needs count, a whole number of points; it is {shorten(count)}")
    check_size("design: count", float(min(count, HUGE)) * max(1, len(names)), "values of axes")
    return _drawn(groups, design, int(count), seed)


def _group(paths: Any, values: Any) -> dict[str, Any]:
    """One axis, or several that are zipped: a tuple of paths, or paths joined by '+'."""
    parts = tuple(paths) if isinstance(paths, tuple) else tuple(str(paths).split("+"))
    if not all(isinstance(p, str) and p for p in parts):
        raise HeadwayError(f"axes: {shorten(paths)} is not the path of a field, e.g. leader.amplitude")
    if len(parts) == 1:
        return {parts[0]: _values(parts[0], values)}
    if not isinstance(values, list | tuple) or len(values) != len(parts):
        raise HeadwayError(f"axes: {'+'.join(parts)} needs {len(parts)} lists of values, one for each field")
    return {path: _values(path, g) for path, g in zip(parts, values, strict=True)}


def _values(path: str, values: Any) -> Between | np.ndarray:
    """Values as typed: a `Between`, a table with from and to, or a list."""
    place = f"axes.{path}"
    if isinstance(values, Between):
        return values
    if isinstance(values, Mapping):
        return _table(place, values)
    if isinstance(values, str | bytes) or not isinstance(values, Iterable):
        raise HeadwayError(f"{place}: {shorten(values)} is not a list of values; write a list, or from, to and count")
    return _array(place, list(values))


def _table(place: str, table: Mapping[str, Any]) -> Between:
    allowed = ("from", "to", "count", "scale")
    for key in table:
        if key not in allowed:
            raise unknown_name(f"{place}: key", key, allowed)
    for key in ("from", "to"):
        if key not in table:
            raise HeadwayError(f"{place}: {key} is missing; write {{ from = …, to = …, count = … }}")
    scale = table.get("scale", "linear")
    if scale not in ("linear", "log"):
        raise unknown_name(f"{place}: scale", scale, ("linear", "log"))
    return _between(place, table["from"], table["to"], table.get("count"), scale == "log")


def _array(place: str, values: list[Any]) -> np.ndarray:
    if not values:
        raise HeadwayError(f"{place}: there are no values")
    whole = all(isinstance(v, int | np.integer) and not isinstance(v, bool) for v in values)
    real = all(isinstance(v, int | float | np.number) and not isinstance(v, bool) for v in values)
    if whole and all(-(2**63) <= v < 2**63 for v in values):
        return np.array(values, dtype=np.int64)
    if real:
        return np.array(values, dtype=float)
    array = np.empty(len(values), dtype=object)
    for i, value in enumerate(values):
        array[i] = value.item() if isinstance(value, np.generic) else value
    return array


def _listed(path: str, values: Between | np.ndarray) -> np.ndarray:
    if isinstance(values, np.ndarray):
        return values
    if values.count is None:
        raise HeadwayError(f"axes.{path}: count is missing; a grid needs to know how many values lie from end to end")
    if values.count == 1:
        return np.array([values.low])
    listed = np.asarray(values.at(np.arange(values.count) / (values.count - 1)), dtype=float)
    listed[-1] = values.high
    return listed


def _together(group: dict[str, np.ndarray], what: str) -> int:
    sizes = {path: values.size for path, values in group.items()}
    if len(set(sizes.values())) > 1:
        listing = ", ".join(f"{path} has {size}" for path, size in sizes.items())
        raise HeadwayError(f"axes: {what} must be equally long; {listing}")
    return next(iter(sizes.values()))


def _grid(groups: list[dict[str, Any]]) -> Points:
    dims: dict[str, int] = {}
    along: dict[str, str] = {}
    values: dict[str, np.ndarray] = {}
    for group in groups:
        listed = {path: _listed(path, v) for path, v in group.items()}
        name = "+".join(listed)
        dims[name] = _together(listed, "zipped values")
        along |= dict.fromkeys(listed, name)
        values |= listed
    return Points(dims, along, values) if dims else Points({"point": 1}, {}, {})


def _zip(groups: list[dict[str, Any]]) -> Points:
    listed = {path: _listed(path, v) for group in groups for path, v in group.items()}
    size = _together(listed, "zipped axes") if listed else 1
    return Points({"point": size}, dict.fromkeys(listed, "point"), listed)


def _drawn(groups: list[dict[str, Any]], design: str, count: int, seed: int) -> Points:
    """Points of a random or low-discrepancy design, of which each group is one coordinate."""
    shares = _shares(design, len(groups), count, seed)
    values: dict[str, np.ndarray] = {}
    for group, share in zip(groups, shares.T, strict=True):
        lists = {path: v for path, v in group.items() if isinstance(v, np.ndarray)}
        size = _together(lists, "zipped values") if lists else 1
        pick = np.minimum((share * size).astype(np.int64), size - 1)
        values |= {path: v[pick] if path in lists else v.at(share) for path, v in group.items()}
    return Points({"point": count}, dict.fromkeys(values, "point"), values)


def _shares(design: str, dimensions: int, count: int, seed: int) -> np.ndarray:
    """Points (count, dimensions) in the unit cube."""
    random = np.random.default_rng(np.random.SeedSequence(seed))
    if dimensions == 0 or design == "random":
        return random.random((count, dimensions))
    from scipy.stats import qmc

    if design == "latin":
        return np.asarray(qmc.LatinHypercube(dimensions, rng=random).random(count))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # counts that are no power of two are balanced a little less
        return np.asarray(qmc.Sobol(dimensions, rng=random).random(count))
