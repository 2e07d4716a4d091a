"""Whether a law rests and is differentiable at a steady state; where not, which side linear theory speaks of."""

from __future__ import annotations

import math

from headway.models import Model
from headway.models.dual import partials
from headway.models.signal import SIGNALS, steady

__all__ = ["RESTS", "corner", "rests"]

#: what a steady state may accelerate [m/s²] and still count as one
RESTS = 1e-6

#: distances, relative to a signal (or to 1): what a smooth law changes by shrinks with them, a corner does not
_NEAR, _NEARER = 1e-7, 1e-9


def rests(model: Model, speed: float, gap: float) -> bool:
    """Whether a model keeps a speed [m/s] at a gap [m], to `RESTS`."""
    return abs(float(model.at_rest(gap, speed))) <= RESTS


def corner(model: Model, speed: float, gap: float, used: dict[str, float]) -> str | None:
    """Say where a law has a corner or a jump at an equilibrium.

    Args:
        model: the law with its parameters.
        speed: of the equilibrium [m/s].
        gap: of the equilibrium [m].
        used: the partial derivatives by signal that linear theory uses there.

    Returns:
        One sentence, or None where the law is differentiable.
    """
    names = model.law.signals
    at = steady(names, gap, speed)
    # first both sides along one direction that no corner of an ordinary law is parallel to
    if not any(_breaks(model, at, used, {n: side * (1.0 + 0.37 * i) for i, n in enumerate(names)}) for side in (1, -1)):
        return None
    where = f"{model.name} at {speed:g} m/s and {gap:g} m"
    for n in names:
        below, above = (partials(model, _moved(at, {n: side}, _NEARER)) for side in (-1.0, 1.0))
        for other in names:
            if _differs(below[other], above[other]):
                signal = f"its derivative by {other} is" if other == n else f"its derivative by {other} is, in {n},"
                return (
                    f"{where} has a corner: {signal} {below[other]:.6g} just below and {above[other]:.6g} just above; "
                    f"linear theory takes {used[other]:.6g}, the branch that the law takes there"
                )
        low, high = (float(model(*_moved(at, {n: side}, _NEARER).values())) for side in (-1.0, 1.0))
        if abs(high - low) > 1e-6 * (1.0 + abs(used[n])):
            return (
                f"{where} jumps from {low:.6g} to {high:.6g} m/s² as {n} grows; "
                "linear theory takes the branch that the law takes there"
            )
    return f"{where} has a corner; linear theory takes the branch that the law takes there"


def _breaks(model: Model, at: dict[str, float], used: dict[str, float], move: dict[str, float]) -> bool:
    """Whether the law changes by more than a smooth one between here and a point very near."""
    near = _moved(at, move, _NEARER)
    slopes = partials(model, near)
    if not any(_differs(slopes[n], used[n]) for n in at):
        return abs(float(model(*near.values())) - float(model(*at.values()))) > 1e-6 * (
            1.0 + max(map(abs, used.values()))
        )
    farther = partials(model, _moved(at, move, _NEAR))
    return any(_differs(slopes[n], used[n]) and abs(slopes[n] - used[n]) > 0.5 * abs(farther[n] - used[n]) for n in at)


def _moved(at: dict[str, float], along: dict[str, float], distance: float) -> dict[str, float]:
    moved = {n: x + along.get(n, 0.0) * distance * max(1.0, abs(x)) for n, x in at.items()}
    # nobody drives backwards: at standstill only speeds above it count
    return {n: max(x, 0.0) if SIGNALS[n].order == 1 and SIGNALS[n].less is None else x for n, x in moved.items()}


def _differs(a: float, b: float) -> bool:
    return math.isfinite(a) and math.isfinite(b) and abs(a - b) > 1e-6 * max(abs(a), abs(b), 1e-9)
