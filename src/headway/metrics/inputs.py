"""What every measure of a trajectory dataset needs: its signals as arrays (…, vehicle, time), and the way back.

A measure asks for `Signals`, computes on plain arrays whose last two axes are vehicle and time, whatever
dimensions come before, and hands its values to `Signals.result`, which restores order and coordinates.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from headway.arrays import Array
from headway.errors import HeadwayError, unknown_name
from headway.metrics.extremes import FREE, FROM_ZERO, Bounds
from headway.schema import VARIABLES, describe

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "Reference", "Signals", "bounds", "checked", "meaning", "need_dimensions", "need_variable", "positive",
    "trajectories", "unit_of",
]  # fmt: skip

Reference = Literal["predecessor", "leader"]


def trajectories(value: Any, place: str) -> xr.Dataset:
    """The dataset of a run, or that of a `Recording`.

    A recording gets what follows from its gaps: the spacing error, and no time of collision.

    Args:
        value: the dataset or recording.
        place: who needs it, for messages.

    Raises:
        HeadwayError: for anything else.
    """
    import xarray as xr

    from headway.data.recording import Recording

    if isinstance(value, xr.Dataset):
        return value
    if isinstance(value, Recording):
        data = value.to_dataset()
        data["spacing_error"] = data["gap"] - data["gap"].isel(time=0, drop=True)
        data["collision_time"] = ("vehicle", np.full(value.vehicles, np.nan))
        return describe(data)
    kind = "an array of one variable" if isinstance(value, xr.DataArray) else f"a {type(value).__name__}"
    raise HeadwayError(f"{place} needs the dataset of a run (hw.simulate, hw.open_results) or a Recording, not {kind}")


def need_variable(dataset: xr.Dataset, name: str, measure: str) -> None:
    """Refuse a dataset without the variable `name`, which `measure` needs.

    Raises:
        HeadwayError: naming the variables that the dataset has.
    """
    if name not in dataset:
        held = ", ".join(map(str, dataset)) or "none"
        raise HeadwayError(f"{measure} needs the variable {name!r}; this dataset has {held}")


def need_dimensions(array: xr.DataArray, needed: tuple[str, ...], measure: str, place: str) -> None:
    """Refuse an array (called `place`) without one of the dimensions that `measure` needs.

    Raises:
        HeadwayError: naming the first that is missing, and those that the array has.
    """
    for dim in needed:
        if dim not in array.dims:
            dims = ", ".join(map(str, array.dims)) or "none"
            raise HeadwayError(f"{measure} needs the dimension {dim}; {place} has {dims}")


class Signals:
    """Variables of a dataset as arrays (…, vehicle, time) that share all dimensions.

    Args:
        dataset: trajectories of a run.
        measure: name of the metric, for messages.
        *names: variables that it needs.

    Raises:
        HeadwayError: if the dataset lacks one of them, if it has no dimension vehicle or time, if its times do not
            rise, or if no follower has a value of a variable.
    """

    def __init__(self, dataset: xr.Dataset, measure: str, *names: str) -> None:
        import xarray as xr

        self.measure = measure
        for name in names:
            need_variable(dataset, name, measure)
        arrays = xr.broadcast(*(dataset[name] for name in names))
        self._like = arrays[0]
        need_dimensions(self._like, ("vehicle", "time"), measure, repr(names[0]))
        ordered = [a.transpose(..., "vehicle", "time") for a in arrays]
        self._ordered = ordered[0]
        self.time = np.asarray(dataset["time"].values, dtype=float)
        if self.time.size == 0:
            raise HeadwayError(f"{measure}: the dataset has no times")
        if not np.all(np.diff(self.time) > 0):
            raise HeadwayError(f"{measure}: the times of the dataset do not rise from sample to sample")
        self.vehicle = np.asarray(dataset["vehicle"].values)
        self._values = {n: np.asarray(a.values, dtype=float) for n, a in zip(names, ordered, strict=True)}
        for name, values in self._values.items():
            self.need_follower(np.isfinite(values).any(axis=-1), name)

    def __getitem__(self, name: str) -> Array:
        return self._values[name]

    def bounds(self, name: str) -> Bounds:
        """Least and largest value that the variable `name` can have, numbers or arrays (…, vehicle)."""
        return bounds(self._ordered.isel(time=0, drop=True), name)

    def need_follower(self, which: Any, name: str, start: float | None = None, end: float | None = None) -> None:
        """Refuse signals of which no follower has a value; a dataset of a leader alone passes.

        Args:
            which: (…, vehicle) whether each vehicle has one.
            name: the variable.
            start: first time that counts [s]; that of the record if None.
            end: last time that counts [s]; that of the record if None.

        Raises:
            HeadwayError: unless `which` holds for a follower.
        """
        followers = which[..., self.vehicle != 0]
        if followers.size and not followers.any():
            start, end = self.time[0] if start is None else start, self.time[-1] if end is None else end
            why = "they have all collided, or stand behind a collision"
            if name == "policy_error":
                why += ", or their laws have no equilibrium gap"
            raise HeadwayError(f"{self.measure}: {name!r} of no follower is known from {start:g} to {end:g} s; {why}")

    def within(self, window: tuple[float, float]) -> slice:
        """The samples within a window.

        Args:
            window: (start, end) [s].

        Raises:
            HeadwayError: if it is not a part of the record, or has no sample.
        """
        start, end = self._span(window)
        slack = 1e-9 * max(1.0, abs(end))
        first, last = np.searchsorted(self.time, [start - slack, end + slack]).tolist()
        if first == last:
            raise HeadwayError(f"{self.measure}: there is no sample from {start:g} to {end:g} s")
        return slice(first, last)

    def _span(self, window: tuple[float, float]) -> tuple[float, float]:
        try:
            start, end = (float(t) for t in window)
        except (TypeError, ValueError):
            raise HeadwayError(f"{self.measure}: window = {window!r} is not a pair (start, end) of times") from None
        first, last = self.time[0], self.time[-1]
        slack = 1e-9 * max(1.0, abs(last))
        if not (first - slack <= start < end <= last + slack):
            raise HeadwayError(
                f"{self.measure}: the window from {start:g} to {end:g} s is not a part of the record, "
                f"{first:g} to {last:g} s"
            )
        return start, end

    def reference(self, values: NDArray[Any], to: str) -> NDArray[Any]:
        """What each vehicle is compared with: the vehicle ahead, or the first that has a value.

        Args:
            values: (…, vehicle).
            to: `predecessor` or `leader`.

        Returns:
            (…, vehicle), NaN for the first vehicle to its predecessor.

        Raises:
            HeadwayError: for another word, vehicles that do not follow one another, and a leader that is missing.
        """
        if to not in get_args(Reference):
            raise unknown_name(f"{self.measure}: to", to, get_args(Reference))
        if np.any(np.diff(self.vehicle) != 1):
            raise HeadwayError(f"{self.measure} needs vehicles that follow one another; these are {list(self.vehicle)}")
        if to == "leader":
            if self.vehicle[0] != 0:
                raise HeadwayError(f"{self.measure}: the leader, vehicle 0, is not in this dataset")
            first = self.first(values)
            return np.broadcast_to(values[..., first : first + 1], values.shape)
        ahead = np.full_like(values, np.nan)
        ahead[..., 1:] = values[..., :-1]
        return ahead

    @staticmethod
    def first(values: NDArray[Any]) -> int:
        """Number of the first vehicle of `values` (…, vehicle) with a value: 1 for variables that a leader lacks."""
        finite = np.isfinite(values).reshape(-1, values.shape[-1]).any(axis=0)
        return int(np.argmax(finite))

    def result(self, values: Any, note: str = "") -> xr.DataArray:
        """Values of vehicles with dimensions, coordinates and order of the dataset.

        Args:
            values: (…, vehicle).
            note: why some vehicles have none, in a sentence.
        """
        return self._named(self._ordered.isel(time=0, drop=True).copy(data=values), note)

    def series(self, values: Array) -> xr.DataArray:
        """Values (…, vehicle, time) with dimensions, coordinates and order of the dataset."""
        return self._named(self._ordered.copy(data=values), "")

    def _named(self, array: xr.DataArray, note: str) -> xr.DataArray:
        array = array.transpose(*(d for d in self._like.dims if d in array.dims)).rename(self.measure)
        array.attrs = {"note": note} if note else {}
        return array


def bounds(like: xr.DataArray, name: str) -> Bounds:
    """Least and largest value that a variable can have.

    Speeds and gaps do not turn negative; an acceleration stays within the limits of the vehicle, which a dataset of
    a run has in its coordinates.

    Args:
        like: the variable without time.
        name: its name.

    Returns:
        Two numbers, or two arrays of the shape of `like`.
    """
    if name in ("speed", "gap"):
        return FROM_ZERO
    if name != "acceleration" or not {"limit_low", "limit_high"} <= set(like.coords):
        return FREE
    low, high = (like.coords[c].broadcast_like(like).transpose(*like.dims).values for c in ("limit_low", "limit_high"))
    return low, high


def unit_of(dataset: xr.Dataset, name: str) -> str:
    """Unit of a variable of `dataset`."""
    return str(dataset[name].attrs.get("units", "1")) if name in dataset else "1"


def meaning(dataset: xr.Dataset, name: str) -> str:
    """What a variable of `dataset` means, in words."""
    default = VARIABLES[name].long_name if name in VARIABLES else name
    return str(dataset[name].attrs.get("long_name", default)) if name in dataset else default


def positive(measure: str, **values: float) -> None:
    """Refuse numbers that are not positive and finite.

    Args:
        measure: who needs them, for messages.
        **values: the numbers by name.

    Raises:
        HeadwayError: for the first that is not.
    """
    for name, value in values.items():
        if not (checked(measure, name, value) > 0):
            raise HeadwayError(f"{measure}: {name} = {value:g} is not positive")


def checked(measure: str, name: str, value: Any) -> float:
    """A value as a finite number.

    Args:
        measure: who needs it, for messages.
        name: its name, for messages.
        value: the value.

    Raises:
        HeadwayError: if it is none.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise HeadwayError(f"{measure}: {name} = {value!r} is not a finite number")
    return number
