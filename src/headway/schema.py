"""Every variable of a trajectory dataset: its dimensions, unit, symbol and meaning, said once.

Signs and meanings are contracts (see docs/contract.md): the gap is bumper to bumper, the
relative speed is positive while the gap opens, vehicle 0 is the leader and has no gap.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["COORDINATES", "VARIABLES", "Variable", "describe"]


@dataclass(frozen=True)
class Variable:
    """One variable of a trajectory dataset."""

    dims: tuple[str, ...]
    unit: str
    symbol: str
    long_name: str


_VT = ("vehicle", "time")

VARIABLES: dict[str, Variable] = {
    "position": Variable(_VT, "m", "x", "front bumper position"),
    "speed": Variable(_VT, "m/s", "v", "speed"),
    "acceleration": Variable(_VT, "m/s²", "a", "acceleration"),
    "gap": Variable(_VT, "m", "s", "gap, bumper to bumper"),
    "relative_speed": Variable(_VT, "m/s", "Δv", "relative speed, positive while the gap opens"),
    "spacing_error": Variable(_VT, "m", "s − s(0)", "spacing error: gap minus gap at the start"),
    "policy_error": Variable(_VT, "m", "s − s_e(v)", "policy error: gap minus desired gap at own speed"),
    "collision_time": Variable(("vehicle",), "s", "t_c", "time of collision with the vehicle ahead, NaN if none"),
}

COORDINATES: dict[str, Variable] = {
    "time": Variable(("time",), "s", "t", "time"),
    "vehicle": Variable(("vehicle",), "", "n", "vehicle, 0 is the leader"),
    "limit_low": Variable(("vehicle",), "m/s²", "a_min", "least acceleration that can be commanded"),
    "limit_high": Variable(("vehicle",), "m/s²", "a_max", "largest acceleration that can be commanded"),
}


def describe(dataset: xr.Dataset) -> xr.Dataset:
    """Give each known variable and coordinate of `dataset` its `units`, `long_name` and `symbol` (in place)."""
    for name, variable in {**VARIABLES, **COORDINATES}.items():
        if name in dataset.variables:
            dataset[name].attrs.update(long_name=variable.long_name, symbol=variable.symbol)
            dataset[name].attrs["units"] = variable.unit or "1"
    return dataset
