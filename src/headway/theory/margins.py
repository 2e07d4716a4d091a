"""Gain, phase and delay margin of a vehicle's own feedback loop, opened at its actuator.

The loop transfer function is L(p) = F(p) / (p² (1 + T_a p)) with the vehicle's reaction to its own
motion, F = f_s e^{-pτ_s} + p f_dv e^{-pτ'} - p f_v e^{-pτ_v} - p² f_a e^{-pτ_a}; the vehicle is locally
stable if no root of 1 + L lies to the right (Åström and Murray, Feedback Systems, ch. 10).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from headway.theory.quasipolynomial import QuasiPolynomial
from headway.theory.scalar import root

__all__ = ["Margins", "margins"]


class Margins(NamedTuple):
    """What the loop of a locally stable vehicle can bear before the vehicle is locally unstable.

    All are NaN for a vehicle that is locally unstable: there is nothing to lose.

    Attributes:
        gain: the factor > 1 by which all its reactions to its own motion may be multiplied, infinite if any may.
        gain_frequency: [rad/s] at which the vehicle then oscillates, NaN if there is none.
        phase: the angle [rad] by which the loop may lag more where |L| = 1, infinite if |L| never is 1.
        phase_frequency: [rad/s] at which |L| = 1.
        delay: the time [s] by which the actuator may act later; infinite if |L| never is 1 or more, 0 if short
            waves come round the loop undiminished (a law that hears its own acceleration with a gain of 1
            or more, without lag).
    """

    gain: float
    gain_frequency: float
    phase: float
    phase_frequency: float
    delay: float


def margins(feedback: QuasiPolynomial, plant: QuasiPolynomial, omega: Any) -> Margins:
    """Return the margins of the loop of a locally stable vehicle.

    Args:
        feedback: the vehicle's reaction F(p) to its own motion.
        plant: from speed to command, p² (1 + T_a p).
        omega: rising frequencies [rad/s] (samples,) that resolve the loop.
    """

    def loop(w: Any) -> Any:
        p = 1j * np.asarray(w, dtype=float)
        return feedback(p) / plant(p)

    def crossings(f: Any) -> list[float]:
        values = f(omega)
        change = np.flatnonzero(np.sign(values[:-1]) != np.sign(values[1:]))
        return [root(lambda w: float(f(w)), float(omega[i]), float(omega[i + 1])) for i in change]

    # the loop at short waves: what passes straight through, early and late
    top = feedback.power == plant.degree
    straight = float(np.sum(feedback.coefficient[top & (feedback.delay == 0.0)]))
    late = float(np.sum(np.abs(feedback.coefficient[top & (feedback.delay > 0.0)])))
    bearable = [(1.0 / (late - straight), math.inf)] if late > straight else []
    for w in crossings(lambda w: loop(w).imag):
        value = loop(w)
        if -1.0 < value.real < 0.0 and abs(value.imag) < 1e-6 * abs(value):
            bearable.append((-1.0 / value.real, w))
    gain, at = min(bearable, default=(math.inf, math.nan))
    turns = [
        ((math.pi + float(np.angle(loop(w)))) % (2.0 * math.pi), w) for w in crossings(lambda w: np.abs(loop(w)) - 1)
    ]
    phase, there = min(turns, default=(math.inf, math.nan))
    delay = min((angle / w for angle, w in turns), default=math.inf)
    return Margins(gain, at, phase, there, 0.0 if abs(straight) + late >= 1.0 else delay)
