"""Delays of what a vehicle perceives, by name of the signal; those of the two halves of `dv` apart."""

from __future__ import annotations

import headway as hw


def late(vehicle: hw.Vehicle) -> dict[str, float]:
    """Delays [s] that are not 0: `s`, `v`, …, and of `dv` `dv ahead` and `dv own`."""
    delays = {}
    for source in vehicle.perception.sources:
        half = "" if source.signal.name != "dv" else " ahead" if source.sign > 0 else " own"
        delays[source.signal.name + half] = source.delay
    return {name: delay for name, delay in delays.items() if delay}
