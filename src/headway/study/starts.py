"""Equilibrium gaps of many lanes at once, with the bits that `Model.equilibrium_gap` gives for each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from headway.arrays import Array
from headway.models import Law

__all__ = ["equilibrium_gaps"]


class _Exact(np.ndarray):
    """Numbers whose powers are rounded as Python's are; NumPy's differ in the last bit, all else is alike."""

    def __pow__(self, other: Any) -> Any:  # type: ignore[override]  # of what it is asked for only
        return _powers(self, other)

    def __rpow__(self, other: Any) -> Any:  # type: ignore[override]
        return _powers(other, self)


def _powers(base: Any, exponent: Any) -> Any:
    b, e = np.broadcast_arrays(np.asarray(base), np.asarray(exponent))
    with np.errstate(all="ignore"):
        try:
            powers = [x**y for x, y in zip(b.ravel().tolist(), e.ravel().tolist(), strict=True)]
            return np.array(powers, dtype=float).reshape(b.shape).view(_Exact)
        except (OverflowError, ZeroDivisionError, TypeError):
            return np.power(b, e).view(_Exact)


def equilibrium_gaps(law: Law, parameters: Mapping[str, Any], speed: float, lanes: int) -> Array:
    """Equilibrium gaps of many lanes, by the closed form of the law.

    Args:
        law: the law.
        parameters: its parameters, numbers or arrays (lanes,).
        speed: [m/s].
        lanes: how many lanes there are.

    Returns:
        (lanes,) [m]; NaN where the closed form does not answer: such a lane has to be computed by itself.
    """
    form, bounds = law.forms.get("equilibrium_gap"), law.forms.get("speed_range")
    none = np.full(lanes, np.nan)
    if form is None:
        return none
    arguments = {n: x.view(_Exact) if isinstance(x, np.ndarray) else float(x) for n, x in parameters.items()}
    try:
        with np.errstate(all="ignore"):
            low, high = (0.0, np.inf) if bounds is None else bounds(**arguments)
            gaps = np.broadcast_to(np.asarray(form(float(speed), **arguments), dtype=float), lanes)
            inside = (speed >= np.maximum(np.asarray(low), 0.0)) & (speed <= np.asarray(high))
            return np.where(inside & np.isfinite(gaps), gaps, np.nan)
    except (TypeError, ValueError):
        return none  # a form that branches on its parameters
