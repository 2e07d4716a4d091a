"""Verdicts of linear theory for very many vehicles at once.

A row holds the partial derivatives, the delays and the lag of one vehicle (`rows_of`); compiled theory
judges rows (`judge`), the one place where a margin is compared with what is tolerated.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from headway.theory.gain import TOLERANCE, VERDICTS
from headway.theory.rows import COLUMNS, critical_delays, decay_rates, gains, margins, peaks

if TYPE_CHECKING:
    from headway.theory.linear import Linear

__all__ = [
    "COLUMNS", "TOLERANCE", "VERDICTS", "Decays", "Peaks", "Verdicts", "critical_delays", "critical_of", "decay_rates",
    "decays_of", "gain_of", "gains", "judge", "margins", "peaks", "peaks_of", "rows_of",
]  # fmt: skip

Array = NDArray[np.float64]


class Verdicts(NamedTuple):
    """What theory says of rows, all (points,).

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
        """Places in `VERDICTS`."""
        return np.where(self.locally_stable, np.where(self.string_stable, 3, 2), 1).astype(np.int8)

    @property
    def words(self) -> list[str]:
        """The verdict on each."""
        return [VERDICTS[code] for code in self.codes]


class Peaks(NamedTuple):
    """sup |G| [1] (infinite if locally unstable) and its frequency [rad/s], both (points,)."""

    gain: Array
    frequency: Array


class Decays(NamedTuple):
    """Decay rate [1/s] of one vehicle and whether its slowest motion oscillates, both (points,)."""

    rate: Array
    oscillates: NDArray[np.bool_]


def rows_of(linears: Sequence[Linear], local: bool = False) -> Array:
    """The rows (vehicles, columns) of linear vehicles.

    Args:
        linears: the vehicles.
        local: whether only local stability is asked for, which a law that hears the platoon leader has too.

    Raises:
        LeaderHeardError: for a law that hears the platoon leader, unless `local`.
    """
    rows = np.empty((len(linears), len(COLUMNS)))
    for i, linear in enumerate(linears):
        if not local:
            linear.refuse_without_leader("string stability of one vehicle")
        f, c = linear.partials, linear.vehicle.channel
        slopes = [f.get(n, 0.0) for n in COLUMNS[:6]]
        late = (c.s, c.v, c.leader_speed_in_dv, c.own_speed_in_dv, c.a, c.vl, c.al)
        rows[i] = (*slopes, *late, linear.vehicle.lag)
    return rows


def judge(rows: Array) -> Verdicts:
    """Local and string stability of rows (points, columns)."""
    found = Verdicts(np.empty(len(rows)), np.empty(len(rows), np.int64))
    margins(rows, *found)
    return found


def peaks_of(rows: Array) -> Peaks:
    """Peak gains of rows (points, columns); above 1 exactly where `judge` says string unstable."""
    found = Peaks(np.empty(len(rows)), np.empty(len(rows)))
    peaks(rows, *found)
    return found


def gain_of(rows: Array, omega: Array) -> Array:
    """|G(iω)| of rows (points, columns), each at its own frequency [rad/s]; infinite if locally unstable."""
    found = np.empty(len(rows))
    gains(rows, omega, found)
    return found


def decays_of(rows: Array) -> Decays:
    """Decay rates of rows (points, columns)."""
    found = Decays(np.empty(len(rows)), np.empty(len(rows), np.bool_))
    decay_rates(rows, *found)
    return found


def critical_of(rows: Array) -> Array:
    """Critical delays [s] of string stability of rows (points, columns) that have a pattern of delays."""
    found = np.empty(len(rows))
    critical_delays(rows, found)
    return found
