"""How linear theory shows itself in a notebook."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from headway.html import block, paragraph, table
from headway.models.signal import SIGNALS
from headway.theory import sentences

if TYPE_CHECKING:
    from headway.theory.linear import Linear

__all__ = ["linear_html"]


def linear_html(linear: Linear) -> str:
    """The verdict in words, and the numbers that it rests on."""
    critical = linear.critical_delays()
    root = linear.rightmost_root
    rows = [
        ("speed", linear.speed, "m/s", "of everybody"),
        ("gap", linear.gap, "m", "in equilibrium"),
        ("damping ratio", linear.damping_ratio, "1", f"{linear.damping_class}, without delay and lag"),
        (
            "rightmost root",
            f"{root.real:.5g}" + (f" ± {abs(root.imag):.5g}i" if root.imag else ""),
            "1/s",
            "decays where its real part is negative",
        ),
        ("local critical delay", _delay(critical["local"]), "s", "from there on one vehicle does not settle"),
    ]
    if not linear.hears_leader:
        rows += [
            ("string critical delay", _delay(critical["string"]), "s", "from there on a platoon amplifies"),
            ("peak gain", linear.peak_gain, "1", "largest |G(iω)|; above 1 a frequency grows"),
            ("peak frequency", linear.peak_frequency, "rad/s", "where that is; 0 is the limit of long waves"),
        ]
    slopes = [(f"∂f/∂{name}", value, SIGNALS[name].slope_unit) for name, value in linear.partials.items()]
    return block(
        paragraph(f"{linear.vehicle.model!r}: {sentences.vehicle_verdict(linear, critical)}"),
        table("Linear theory", ("quantity", "value", "unit", "meaning"), rows),
        table("Derivatives of the law", ("derivative", "value", "unit"), slopes),
    )


def _delay(seconds: float) -> str:
    return "none" if math.isinf(seconds) else f"{seconds:.5g}"
