"""Verdicts of linear theory for very many vehicles at once.

A row holds the partial derivatives, the delays and the lag of one vehicle (`rows_of`); compiled theory
judges rows (`judge`), the one place where a margin is compared with `TOLERANCE`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from headway.theory.gain import TOLERANCE, VERDICTS
from headway.theory.rows import COLUMNS, fill_critical_delays, fill_decay_rates, fill_gains, fill_margins, fill_peaks
from headway.theory.transfer import delay_columns

if TYPE_CHECKING:
    from headway.theory.linear import Linear

__all__ = [
    "COLUMNS", "TOLERANCE", "VERDICTS", "Decays", "Peaks", "Verdicts", "critical_of", "decays_of",
    "fill_critical_delays", "fill_decay_rates", "fill_gains", "fill_margins", "fill_peaks", "gain_of", "judge",
    "peaks_of", "rows_of",
]  # fmt: skip

Array = NDArray[np.float64]


class Verdicts(NamedTuple):
    """Verdicts of theory on rows, all (points,).

    Attributes:
        margin: least (|D|² - |N|²)/ω² [1/s²], -inf where the limit of short waves grows.
        growing: number of characteristic roots that grow; 999 and more: an endless chain of them.
    """

    margin: Array
    growing: NDArray[np.int64]

    @property
    def locally_stable(self) -> NDArray[np.bool_]:
        """Whether a disturbance of one vehicle dies down."""
        return self.growing == 0

    @property
    def string_stable(self) -> NDArray[np.bool_]:
        """Whether each is locally stable and no frequency grows from vehicle to vehicle."""
        return self.locally_stable & (self.margin >= -TOLERANCE)

    @property
    def codes(self) -> NDArray[np.int8]:
        """Codes 1 to 3, places in `VERDICTS`."""
        return np.where(self.locally_stable, np.where(self.string_stable, 3, 2), 1).astype(np.int8)

    @property
    def words(self) -> list[str]:
        """The verdict on each in words, one of `VERDICTS`."""
        return [VERDICTS[code] for code in self.codes]


class Peaks(NamedTuple):
    """Peak gains of rows, both (points,).

    Attributes:
        gain: sup |G| [1], infinite if locally unstable.
        frequency: its frequency [rad/s], NaN if locally unstable.
    """

    gain: Array
    frequency: Array


class Decays(NamedTuple):
    """How fast one vehicle of each row settles, both (points,).

    Attributes:
        rate: decay rate [1/s], negative where a disturbance grows.
        oscillates: whether the slowest motion is an oscillation.
    """

    rate: Array
    oscillates: NDArray[np.bool_]


def rows_of(linears: Sequence[Linear], local: bool = False) -> Array:
    """Return the rows (vehicles, columns) of linear vehicles.

    Args:
        linears: the vehicles.
        local: whether the rows are for local stability only, which a law that hears the platoon leader has too.

    Raises:
        LeaderHeardError: for a law that hears the platoon leader, unless `local`.
    """
    rows = np.empty((len(linears), len(COLUMNS)))
    for i, linear in enumerate(linears):
        if not local:
            linear.refuse_without_leader("string stability of one vehicle")
        values = {**linear.partials, **delay_columns(linear.vehicle.perception), "lag": linear.vehicle.lag}
        rows[i] = [values.get(column, 0.0) for column in COLUMNS]
    return rows


def judge(rows: Array) -> Verdicts:
    """Return local and string stability of rows (points, columns)."""
    verdicts = Verdicts(np.empty(len(rows)), np.empty(len(rows), np.int64))
    fill_margins(rows, *verdicts)
    return verdicts


def peaks_of(rows: Array) -> Peaks:
    """Return peak gains of rows (points, columns); above 1 exactly where `judge` says string unstable."""
    result = Peaks(np.empty(len(rows)), np.empty(len(rows)))
    fill_peaks(rows, *result)
    return result


def gain_of(rows: Array, omega: Array) -> Array:
    """Return the gain of each row at a frequency of its own.

    Args:
        rows: vehicles (points, columns).
        omega: frequencies [rad/s] (points,).

    Returns:
        |G(iω)| [1] (points,), infinite if locally unstable.
    """
    gain = np.empty(len(rows))
    fill_gains(rows, omega, gain)
    return gain


def decays_of(rows: Array) -> Decays:
    """Return decay rates of rows (points, columns)."""
    decays = Decays(np.empty(len(rows)), np.empty(len(rows), np.bool_))
    fill_decay_rates(rows, *decays)
    return decays


def critical_of(rows: Array) -> Array:
    """Return critical delays [s] of string stability of rows (points, columns), each with a pattern of delays."""
    delays = np.empty(len(rows))
    fill_critical_delays(rows, delays)
    return delays
