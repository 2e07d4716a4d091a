"""The trap of the sign of the relative speed.

The signal `dv` is v_ahead - v, positive while the gap opens. Books often write the approach rate
Δv = v - v_ahead; a law pasted from there accelerates towards whom it approaches.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from headway.models.dual import partials
from headway.models.signal import steady

if TYPE_CHECKING:
    from headway.models.law import Law

__all__ = ["wrong_sign"]


def wrong_sign(law: Law) -> str | None:
    """A sentence if the law reacts to `dv` the wrong way round at plausible states, else None."""
    if "dv" not in law.signals:
        return None
    slopes = []
    for gap, speed in ((15.0, 8.0), (30.0, 20.0), (60.0, 25.0)):
        at = steady(law.signals, gap, speed)
        try:
            slopes.append(partials(law(), at)["dv"])
        except Exception:  # a person's law may raise anything, also because its helpers stand below it
            return None
    if all(math.isfinite(x) and x < -1e-12 for x in slopes):
        return (
            f"law {law.name} slows down the more the gap opens (its derivative by dv is {slopes[1]:.3g} 1/s); "
            "dv is v_ahead - v, positive while the gap opens, so turn its sign round"
        )
    return None
