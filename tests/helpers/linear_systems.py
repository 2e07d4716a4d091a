"""Short names for tests of linear theory."""

from __future__ import annotations

from typing import Any

import headway as hw

#: the three ways in which a driver's signals can be late, and that of a radio; scaled by `critical_delay`
ALL_LATE = 1.0
LEADER_LATE = {"s": 1.0, "vl": 1.0}  # own speed current everywhere
MEASURED_LATE = {"s": 1.0, "dv": 1.0}  # relative speed late as a whole
RADIO_LATE = {"vl": 1.0, "al": 1.0}


def linear(model: Any, speed: float = 23.0, gap: float | None = None, **vehicle: Any) -> Any:
    """Linear theory of a vehicle with this model."""
    return hw.linearize(hw.Vehicle(model, **vehicle), speed, gap)
