"""The registry of metrics: whatever can be measured of a run, by name, with its unit and meaning.

`headway run`, studies, the benchmark, the explorer and the table in docs/metrics.md choose from here. A metric is a
function of a dataset of trajectories that stands below the decorator `metric` in a file of this room; nothing else
has to be told of it.
"""

from __future__ import annotations

import functools
import inspect
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeVar

from headway.arrays import Array
from headway.errors import HeadwayError, did_you_mean, shorten, unknown_name
from headway.metrics.inputs import meaning, trajectories, unit_of
from headway.schema import VARIABLES

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["METRICS", "Extremes", "Metric", "Reduced", "Whose", "chosen", "metric", "named", "register", "split"]

Function = TypeVar("Function", bound=Callable[..., Any])

#: which follower speaks for a platoon: the one with the least value, the one with the largest, all, or the last
Whose = Literal["least", "largest", "mean", "last"]


#: what there is a value for: a vehicle, a run, every time of a vehicle, or a vehicle, with amplitude and phase
Per = Literal["vehicle", "run", "time", "phasor"]


class Extremes(NamedTuple):
    """What a run leaves of one signal without its trajectories: arrays (vehicle, …), NaN where there is no sample.

    Attributes:
        highest: largest value.
        least: least value.
        rms: root of the mean square.
        collision: when the vehicle hit the one ahead [s], NaN if it did not.
        whole: whether its record runs to the end of the run.
    """

    highest: Array
    least: Array
    rms: Array
    collision: Any = math.nan
    whole: Any = True


class Reduced(NamedTuple):
    """How a metric is made of what the kernel keeps of one signal, so that a study needs no trajectories for it.

    Attributes:
        signal: the signal; "" for the times of collisions.
        mode: what is kept of it, EXTREMES or SQUARE.
        make: values (vehicle, …) from its extremes.
    """

    signal: str
    mode: int
    make: Callable[[Extremes], Array]


@dataclass(frozen=True, eq=False)
class Metric:
    """One metric: `of(dataset)` gives its values with unit and meaning in the attributes.

    Attributes:
        name: its name, with parameters where they are not the default ones.
        unit: unit of its values.
        long_name: meaning of its values.
        function: a function of a dataset of trajectories.
        per: `vehicle`, `run` (one number), `time` (a value at every time of every vehicle) or `phasor`.
        whose: the follower that speaks for a platoon.
        reduced: how it is made without trajectories, if it can be.
        parameters: arguments of the function beside the dataset.
        own: whether it is a function of a user, and none of the registry.
        family: the subject, for its row in a table.
        formula: how it is made, for its row in a table.
        threshold: values that matter, for its row in a table.
        source: where it comes from, for its row in a table.
        says: what one learns from it, for its row in a table.
        about: unit and meaning under other parameters.
    """

    name: str
    unit: str
    long_name: str
    function: Callable[..., Any]
    per: Per = "vehicle"
    whose: Whose = "largest"
    reduced: Reduced | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    own: bool = False
    family: str = ""
    formula: str = ""
    threshold: str = "–"
    source: str = "–"
    says: str = ""
    about: Callable[[Mapping[str, Any]], tuple[str, str]] | None = None

    def of(self, dataset: Any) -> Any:
        """Values of a run or of several: an array over `vehicle` (but for a metric per run) and all else but time.

        Args:
            dataset: trajectories of runs, or a `Recording`.
        """
        return self.function(dataset, **self.parameters)

    def over_vehicles(self, values: xr.DataArray) -> xr.DataArray:
        """One number for a platoon, made of the values of its followers that have one.

        Args:
            values: (…, vehicle), the leader first; without the dimension vehicle they are returned as they are.
        """
        if "vehicle" not in values.dims:
            return values
        followers = values.isel(vehicle=slice(1, None))
        if self.whose == "last":
            return followers.isel(vehicle=-1, drop=True)
        ways = {"least": followers.min, "largest": followers.max, "mean": followers.mean}
        return ways[self.whose]("vehicle", keep_attrs=True)

    def __reduce__(self) -> tuple[Any, ...]:
        # another process finds it by name
        return (_own, (self.function,)) if self.own else (named, (self.name,))


#: all metrics by name
METRICS: dict[str, Metric] = {}


def register(entry: Metric) -> None:
    """Add a metric; the first of a name stands."""
    METRICS.setdefault(entry.name, entry)


def metric(
    unit: str | Callable[[Mapping[str, Any]], str],
    long_name: str | Callable[[Mapping[str, Any]], str],
    *,
    formula: str,
    says: str,
    threshold: str = "–",
    source: str = "–",
    per: Per = "vehicle",
    whose: Whose = "largest",
    reduced: Reduced | None = None,
) -> Callable[[Function], Function]:
    """Register a function of a dataset under its name.

    Args:
        unit: unit of its values, or a function of its parameters; `signal` for that of the parameter of this name.
        long_name: meaning of its values; `{threshold:g}` stands for a parameter, `{signal}` for what the signal means.
            Or a function of its parameters.
        formula: how it is made, for the table of metrics; so are `says`, `threshold` and `source`.
        says: what one learns from it.
        threshold: values that matter.
        source: where it comes from.
        per: what there is a value for.
        whose: the follower that speaks for a platoon.
        reduced: how it is made without trajectories, if it can be.

    Returns:
        The function, which now takes a `Recording` too, refuses all that are no trajectories in a sentence, and
        whose result carries name, unit and meaning.
    """

    def registered(function: Function) -> Function:
        signature = inspect.signature(function)
        name = function.__name__

        @functools.wraps(function)
        def measure(dataset: Any, *args: Any, **options: Any) -> Any:
            data = trajectories(dataset, name)
            call = signature.bind(data, *args, **options)
            call.apply_defaults()
            values = function(*call.args, **call.kwargs)
            units, title = _described(unit, long_name, call.arguments, data)
            values.attrs = {"units": units, "long_name": title, **values.attrs}
            return values.rename(name)

        defaults = {n: p.default for n, p in list(signature.parameters.items())[1:]}
        family = function.__module__.rpartition(".")[2].capitalize()
        about = functools.partial(_described, unit, long_name, data=None)
        register(Metric(
            name, *about(defaults), measure, per, whose, reduced, family=family,
            formula=formula, threshold=threshold, source=source, says=says, about=about,
        ))  # fmt: skip
        return measure  # type: ignore[return-value]

    return registered


def _described(unit: Any, long_name: Any, parameters: Mapping[str, Any], data: xr.Dataset | None) -> tuple[str, str]:
    """Unit and meaning under these parameters."""
    words = dict(parameters)
    signal = words.get("signal")
    if signal is not None:
        words["signal"] = VARIABLES[signal].long_name if data is None else meaning(data, signal)
    if callable(unit):
        unit = unit(parameters)
    elif unit == "signal":
        unit = VARIABLES[str(signal)].unit if data is None else unit_of(data, str(signal))
    return unit, long_name(words) if callable(long_name) else long_name.format(**words)


# -- choosing -------------------------------------------------------------------------------------


def named(text: str, place: str = "metric") -> Metric:
    """The metric of a name, `ttc`, or of one with parameters, `tet(threshold=4)`.

    Args:
        text: the name.
        place: who asks, for messages.

    Raises:
        HeadwayError: if there is none, or a parameter is not one of its own.
    """
    name, _, inside = text.strip().partition("(")
    entry = METRICS.get(name.strip())
    if entry is None:
        near = did_you_mean(name.strip(), METRICS)
        raise HeadwayError(f"{place}: {shorten(name.strip())} is not known{near}; headway metrics lists them all")
    if not inside:
        return entry
    if not inside.endswith(")"):
        raise HeadwayError(f"{place} {shorten(text)}: the parenthesis is not closed; write e.g. tet(threshold=4)")
    allowed = list(inspect.signature(entry.function).parameters.items())[1:]
    defaults = {n: p.default for n, p in allowed}
    parameters: dict[str, Any] = {}
    for part in filter(None, (p.strip() for p in inside[:-1].split(","))):
        key, equals, value = (p.strip() for p in part.partition("="))
        if not equals or not value:
            raise HeadwayError(f"{place} {shorten(text)}: {part!r} is not of the form parameter=value")
        if key not in defaults:
            raise unknown_name(f"{place} {name}, parameter", key, defaults)
        parameters[key] = _value(value)
    if "signal" in parameters and parameters["signal"] not in VARIABLES:
        raise unknown_name(f"{place} {name}, signal", parameters["signal"], VARIABLES)
    unit, long_name = entry.about({**defaults, **parameters}) if entry.about else (entry.unit, entry.long_name)
    values = (f"{k}={v:g}" if isinstance(v, float) else f"{k}={v}" for k, v in parameters.items())
    bound = f"{entry.name}({', '.join(values)})"
    return replace(entry, name=bound, unit=unit, long_name=long_name, parameters=parameters, reduced=None)


def _value(text: str) -> Any:
    try:
        return float(text)
    except ValueError:
        return text


def split(text: str) -> list[str]:
    """Names with commas between, as on the command line; commas in parentheses separate parameters."""
    return [name.strip() for name in re.split(r",(?![^(]*\))", text)] if text.strip() else []


def _own(function: Callable[[Any], Any]) -> Metric:
    """A metric of one's own: a function of the trajectories of a run."""
    entry = next((m for m in METRICS.values() if m.function is function), None)
    return entry or Metric(getattr(function, "__name__", "own"), "", "", function, own=True)


def chosen(metrics: Any, default: Iterable[str]) -> tuple[Metric, ...]:
    """The metrics that are asked for, each once.

    Args:
        metrics: names, or functions of trajectories; a single name; or None.
        default: names that stand for None.

    Raises:
        HeadwayError: for what is neither, for a name given twice, and for metrics with more than one number a vehicle
            or a run.
    """
    if isinstance(metrics, str):
        metrics = (metrics,)
    try:
        requests = list(default if metrics is None else metrics)
    except TypeError:
        raise HeadwayError(f"metrics: {shorten(metrics)} is not a list of names or functions") from None
    result: list[Metric] = []
    for entry in requests:
        if isinstance(entry, Metric):
            result.append(entry)
        elif isinstance(entry, str):
            result.append(named(entry))
        elif callable(entry):
            result.append(_own(entry))
        else:
            raise HeadwayError(f"metric {shorten(entry)} is neither a name nor a function of trajectories")
    names = [m.name for m in result]
    for one in result:
        if names.count(one.name) > 1:
            raise HeadwayError(f"metrics: {one.name} is given twice")
        if one.per in ("time", "phasor"):
            what = "a value at every time" if one.per == "time" else "amplitude and phase"
            raise HeadwayError(f"metric {one.name} has {what}; what is chosen needs one number a vehicle or a run")
    return tuple(result)
