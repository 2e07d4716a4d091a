"""What a law can perceive: the table of signals. A new signal is a new row.

Everything that knows signals takes it from here: signatures of laws, delays, breaking points, the
kernel and the independent integrator, transfer functions, calibration, the reference and the
explorer.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

__all__ = ["AHEAD", "LEADER", "OWN", "RADIO", "SIGNALS", "Signal", "steady"]

#: whose motion is looked at: one's own, that of the vehicle ahead (of the k-th ahead: k), the platoon leader's
OWN, AHEAD, LEADER = 0, 1, -1


@dataclass(frozen=True)
class Signal:
    """One thing that a law can perceive.

    Attributes:
        name: the argument of a law's function that asks for it.
        unit: its unit.
        text: what it is, in words.
        order: of which derivative of a position it is made: 0 position, 1 speed, 2 acceleration.
        of: whose motion it is (`OWN`, the k-th vehicle ahead, `LEADER`).
        less: whose is subtracted, or None. A difference of positions is a gap: lengths are left out.
        radio: whether it is received by radio; else it is measured on board.
        also: what else people call it.
    """

    name: str
    unit: str
    text: str
    order: int
    of: int
    less: int | None = None
    radio: bool = False
    also: tuple[str, ...] = ()

    @property
    def slope_unit(self) -> str:
        """Unit of a law's partial derivative by this signal."""
        return ("1/s²", "1/s", "1")[self.order]

    def value(self, motions: Any) -> Any:
        """Its value if `motions[whose]` are position, speed and acceleration of each; lengths are not left out."""
        value = motions[self.of][self.order]
        return value if self.less is None else value - motions[self.less][self.order]

    def steady(self, gap: Any, speed: Any) -> Any:
        """Its value where everybody drives `speed` [m/s] steadily and the gap to the vehicle ahead is `gap` [m]."""
        if self.order == 0:
            return gap
        return 0.0 * speed if self.order == 2 or self.less is not None else speed


#: every signal by name
SIGNALS: dict[str, Signal] = {
    signal.name: signal
    for signal in (
        Signal(
            "s", "m", "gap to the vehicle ahead, bumper to bumper", 0, AHEAD, OWN,
            also=("gap", "spacing", "distance", "headway"),
        ),
        Signal("v", "m/s", "own speed", 1, OWN, also=("speed", "velocity")),
        Signal(
            "dv", "m/s", "relative speed v_ahead - v, positive while the gap opens", 1, AHEAD, OWN,
            also=("relative_speed", "delta_v", "deltav", "approach_rate"),
        ),
        Signal("a", "m/s²", "own acceleration", 2, OWN, also=("acceleration",)),
        Signal(
            "vl", "m/s", "speed of the vehicle ahead, received by radio", 1, AHEAD, radio=True,
            also=("lead_speed", "leader_speed", "v_lead", "v_leader"),
        ),
        Signal(
            "al", "m/s²", "acceleration of the vehicle ahead, received by radio", 2, AHEAD, radio=True,
            also=("lead_acceleration", "a_lead", "a_leader"),
        ),
        Signal("v0l", "m/s", "speed of the platoon leader, received by radio", 1, LEADER, radio=True),
        Signal("a0l", "m/s²", "acceleration of the platoon leader, received by radio", 2, LEADER, radio=True),
    )
}  # fmt: skip

#: names of signals that arrive by radio; the others are measured on board
RADIO: frozenset[str] = frozenset(name for name, signal in SIGNALS.items() if signal.radio)


def steady(names: Iterable[str], gap: Any, speed: Any) -> dict[str, Any]:
    """Values of signals, by name, where everybody drives `speed` [m/s] steadily at `gap` [m]."""
    return {name: SIGNALS[name].steady(gap, speed) for name in names}
