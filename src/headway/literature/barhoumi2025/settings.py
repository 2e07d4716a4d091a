"""The paper's settings with what it leaves open filled in: ready scenarios, changed by named choices, and runs."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from headway import metrics
from headway.arrays import Array
from headway.engine.simulate import simulate
from headway.errors import HeadwayError, unknown_name
from headway.library import library_table
from headway.metrics.growth import fundamental
from headway.scenario.document import from_table
from headway.scenario.scenario import Scenario

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "AXES", "GAINS", "IDM_SETS", "LATE", "SHAPES", "Axis", "after", "amplitude_by_vehicle", "error", "far_apart",
    "last_over_first", "nonharmonic", "peak_by_follower", "scenario", "steps", "trajectories",
]  # fmt: skip

Table = dict[str, Any]


@dataclass(frozen=True)
class Axis:
    """Something that the paper leaves open.

    Attributes:
        meaning: in words.
        unit: of its values; empty for names.
        source: where its values come from.
    """

    meaning: str
    unit: str = ""
    source: str = ""


AXES: dict[str, Axis] = {
    "gains": Axis("gains of CACC", "", "none stated; three sets, see the parameters"),
    "h": Axis("time gap h of CACC", "s", "1 to 2 s named as examples, 1.5 s stated for the non-harmonic case only"),
    "radio": Axis("radio delay of CACC", "s", "0, 0.15 and 1.5 s are the paper's delays"),
    "error": Axis("which spacing error", "", "gap less first gap, gap less desired gap and (IDM) s* - s are defined"),
    "omega": Axis("frequency ω of the disturbance", "rad/s", "0.63 and 1.0 are the only ones stated, each once"),
    "start": Axis("how followers start", "", "the equilibrium of the law, or the gap that an author would type in"),
    "speed": Axis("speed of the platoon", "m/s", "23, 25 and 27.8 m/s stated for other experiments"),
    "gap": Axis("initial gap of GMM", "m", "every gap is an equilibrium of GMM"),
    "late": Axis("which signals are late", "", "a delay of a driver is not said to be of which signals"),
    "alpha": Axis("sensitivity α of OVM", "1/s", "0.1 and 0.5 1/s stated for other experiments"),
    "idm": Axis("a and b of IDM", "", "not stated; headway's and those of Treiber et al. 2000"),
    "shape": Axis("shape of the disturbance", "", "step changes or square waves named as examples; not stated"),
    "edge": Axis("duration of each edge", "s", "not stated; an ideal jump or a ramp"),
    "vehicle": Axis("which follower is meant", "", "not stated"),
    "measure": Axis("measure of safety", "", "not stated"),
    "delay": Axis("delay of the radio for CACC, of all on-board signals for the others", "s", "0 to 1.5 s named"),
    "delays": Axis("delays of the comparison", "", "the paper's three comparisons"),
    "judge": Axis("who says what is stable", "", "the paper's printed conditions, or exact theory"),
}  # fmt: skip


def _gains_of(name: str) -> dict[str, float]:
    parameters = library_table(f"paper:{name}")["followers"][0]["parameters"]
    return {gain: parameters[gain] for gain in ("kp", "kd", "kv", "ka")}


#: gains of CACC by name: two that ready scenarios have, and those of a van Arem type
GAINS: dict[str, dict[str, float]] = {
    "base": _gains_of("compare-0-cacc"),
    "fitted": _gains_of("compare-0-cacc-fitted"),
    "advanced": {"kp": 0.1, "kd": 0.0, "kv": 0.58, "ka": 1.0},
}

#: acceleration and braking of IDM by name
IDM_SETS: dict[str, dict[str, float]] = {
    "a = 1, b = 1.5": {"a": 1.0, "b": 1.5},
    "a = 0.73, b = 1.67": {"a": 0.73, "b": 1.67},
}

#: signals that a delay makes late, by name; None stands for all that are measured on board
LATE: dict[str, tuple[str, ...] | None] = {
    "all on-board signals": None,
    "gap and relative speed": ("s", "dv"),
    "gap and leader's speed": ("s", "vl"),
}

#: shapes that are not harmonic → how the ready scenarios end
SHAPES = {"square": "", "sawtooth": "-sawtooth", "sum of sines": "-multisine"}

_OMEGA = 0.63


def scenario(name: str, **choices: Any) -> Scenario:
    """Return a ready scenario with choices; a choice about another model changes nothing.

    Args:
        name: of the ready scenario, without `paper:`.
        choices: values by axis, see `AXES`.

    Raises:
        HeadwayError: for an axis that changes no scenario.
    """
    table = library_table(f"paper:{name}")
    for axis, value in choices.items():
        if axis in _CHANGES:
            _CHANGES[axis](table, value)
        elif axis not in AXES:
            raise unknown_name("axis", axis, AXES)
    return from_table(table)


def trajectories(name: str, choices: Mapping[str, Any] | None = None, **more: Any) -> xr.Dataset:
    """Simulate `scenario(name, …)`; the last two dozen runs are cached.

    Args:
        name: of the ready scenario, without `paper:`.
        choices: values by axis.
        more: further values by axis, which come before those of `choices`.
    """
    return _trajectories(scenario(name, **{**(choices or {}), **more}))


@functools.lru_cache(maxsize=24)
def _trajectories(case: Scenario) -> xr.Dataset:
    return simulate(case)


def nonharmonic(model: str, choices: Mapping[str, Any]) -> xr.Dataset:
    """Simulate a platoon behind a leader that is not harmonic.

    Args:
        model: "cacc", "idm", "ovm" or "gmm".
        choices: values by axis, `shape` among them.
    """
    return trajectories(f"{model}-nonharmonic{SHAPES[choices['shape']]}", choices)


# -- choices ---------------------------------------------------------------------------------------


def _of(table: Table, *models: str) -> list[Table]:
    return [f for f in table["followers"] if f["model"] in models]


def _gains(table: Table, value: str) -> None:
    for follower in _of(table, "cacc"):
        parameters = follower["parameters"]
        # without radio only the gains on board are open
        heard = parameters["kv"] or parameters["ka"]
        parameters.update({k: g for k, g in GAINS[value].items() if heard or k in ("kp", "kd")})


def _h(table: Table, value: float) -> None:
    for follower in _of(table, "cacc"):
        follower["parameters"]["h"] = value


def _radio(table: Table, value: float) -> None:
    for follower in _of(table, "cacc"):
        follower["delay"] = {"vl": value, "al": value}


def _delay(table: Table, value: float) -> None:
    _radio(table, value)
    for follower in _of(table, "idm", "ovm", "gmm"):
        follower["delay"] = value


def _omega(table: Table, value: float) -> None:
    leader = table["leader"]
    if "omega" in leader:
        leader["omega"] = value
    elif "omegas" in leader:
        leader["omegas"] = [w * value / _OMEGA for w in leader["omegas"]]


def _speed(table: Table, value: float) -> None:
    table["leader"]["mean"] = value


def _start(table: Table, value: str) -> None:
    """Must be applied after the speed."""
    (first, *_) = table["followers"]
    parameters = first["parameters"]
    if first["model"] in ("gmm", "cacc"):
        return
    if value == "equilibrium":
        table.pop("gaps", None)
    elif value == "typed in" and first["model"] == "ovm":
        table["gaps"] = 6.0
    elif value == "typed in":
        table["gaps"] = parameters["s0"] + parameters["T"] * table["leader"]["mean"]
    else:
        raise unknown_name("start", value, ("equilibrium", "typed in"))


def _gap(table: Table, value: float) -> None:
    if _of(table, "gmm"):
        table["gaps"] = value


def _late(table: Table, value: str) -> None:
    for follower in _of(table, "idm", "ovm", "gmm"):
        signals, delay = LATE[value], follower.get("delay", 0.0)
        if signals is not None and delay:
            hears = {"s"} if follower["model"] == "ovm" else {"s", "dv", "vl"}
            follower["delay"] = {name: delay for name in signals if name in hears}


def _alpha(table: Table, value: float) -> None:
    for follower in _of(table, "ovm"):
        follower["parameters"]["alpha"] = value


def _idm(table: Table, value: str) -> None:
    for follower in _of(table, "idm", "idm-spacing"):
        parameters = {k: v for k, v in IDM_SETS[value].items() if k in follower["parameters"]}
        follower["parameters"].update(parameters)


def _edge(table: Table, value: float) -> None:
    if table["leader"]["kind"] in ("square", "sawtooth"):
        table["leader"]["edge"] = value


_CHANGES: dict[str, Callable[[Table, Any], None]] = {
    "gains": _gains, "h": _h, "radio": _radio, "delay": _delay, "omega": _omega, "speed": _speed, "start": _start,
    "gap": _gap, "late": _late, "alpha": _alpha, "idm": _idm, "edge": _edge,
}  # fmt: skip


# -- numbers of a run, one for each follower -------------------------------------------------------


def error(dataset: xr.Dataset, kind: str = "spacing") -> xr.DataArray:
    """Return a spacing error [m] of a run.

    Args:
        dataset: the run.
        kind: "spacing" (gap less first gap), "policy" (gap less desired gap) or "s* - s" (of IDM).
    """
    if kind == "s* - s":
        from headway.literature.barhoumi2025.printed import idm_spacing_error

        return idm_spacing_error(dataset.gap, dataset.speed, -dataset.relative_speed)
    return dataset[f"{kind}_error"]


def peak_by_follower(values: xr.DataArray, start: float = 0.0, end: float = math.inf) -> Array:
    """Return the largest magnitude of each follower (followers,), until a collision.

    Args:
        values: (vehicle, time).
        start: of the window [s].
        end: of the window [s].
    """
    return np.asarray(metrics.peak(values.sel(time=slice(start, end))).values[1:], dtype=float)


def after(values: xr.DataArray, start: float) -> Array:
    """Return the largest magnitude of each follower (followers,) from a time on; NaN after a collision.

    Args:
        values: (vehicle, time).
        start: of the window [s].
    """
    late = values.sel(time=slice(start, None))
    whole = np.isfinite(late.values[1:, -1])
    return np.where(whole, np.asarray(metrics.peak(late).values[1:], dtype=float), np.nan)


def amplitude_by_vehicle(dataset: xr.Dataset, values: xr.DataArray, omega: float) -> Array:
    """Return the amplitude of each vehicle (vehicles,) over the last whole periods; NaN after a collision.

    Args:
        dataset: the run.
        values: (vehicle, time).
        omega: frequency of the leader [rad/s].
    """
    named = dataset[["speed"]].assign(value=values)
    try:
        return np.abs(fundamental(named, "value", omega).values).astype(float)
    except HeadwayError:  # every follower has collided before the last periods
        return np.full(dataset.sizes["vehicle"], np.nan)


def steps(sizes: Array) -> float:
    """Return the largest ratio of a size to that of the vehicle ahead, of `sizes` (vehicles,)."""
    return float(np.max(sizes[1:] / sizes[:-1]))


def last_over_first(sizes: Array) -> float:
    """Return the ratio of the last size to the first, of `sizes` (vehicles,)."""
    return float(sizes[-1] / sizes[0])


def far_apart(sizes: Array) -> float:
    """Return least over greatest size, 1 where all are alike, of `sizes` (vehicles,)."""
    return float(np.min(sizes) / np.max(sizes))
