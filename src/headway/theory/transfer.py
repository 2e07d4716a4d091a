"""The transfer functions of one vehicle as quasi-polynomials, from its partial derivatives, delays and lag."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from headway.scenario.channel import Channel
from headway.theory.quasipolynomial import QuasiPolynomial

__all__ = ["Parts", "parts"]


class Parts(NamedTuple):
    """The parts of V = (top V_ahead + leader V_0) / bottom, without the factor p of a law that rests at every gap.

    Attributes:
        top: answer to the vehicle ahead.
        bottom: the characteristic function.
        leader: answer to the platoon leader, empty for a law that does not hear it.
        plant: from speed to command, p² (1 + T_a p), undivided.
        feedback: reaction to the vehicle's own motion, p times the command per speed; `plant` and `feedback` add up
            to the undivided `bottom`.
    """

    top: QuasiPolynomial
    bottom: QuasiPolynomial
    leader: QuasiPolynomial
    plant: QuasiPolynomial
    feedback: QuasiPolynomial


def parts(partials: Mapping[str, float], c: Channel, lag: float) -> Parts:
    """Return the parts of the transfer functions of one vehicle; see `headway.theory.linear`.

    Args:
        partials: partial derivatives of the law by signal; signals that are left out count as 0.
        c: delays [s] by signal.
        lag: time constant [s] of the actuator, at least 0.
    """
    f = {n: partials.get(n, 0.0) for n in ("s", "v", "dv", "a", "vl", "al", "v0l", "a0l")}
    top = QuasiPolynomial.of(
        (f["s"], 0, c.s), (f["dv"], 1, c.leader_speed_in_dv), (f["vl"], 1, c.vl), (f["al"], 2, c.al)
    )
    leader = QuasiPolynomial.of((f["v0l"], 1, c.v0l), (f["a0l"], 2, c.a0l))
    plant = QuasiPolynomial.of((1.0, 2, 0.0), (lag, 3, 0.0))
    feedback = QuasiPolynomial.of(
        (f["s"], 0, c.s), (f["dv"], 1, c.own_speed_in_dv), (-f["v"], 1, c.v), (-f["a"], 2, c.a)
    )
    bottom = QuasiPolynomial.of(*plant.terms, *feedback.terms)
    # one factor p is the gap of a law that rests at every gap; a second one is a speed that nothing corrects
    common = min(1, *(q.lowest for q in (top, bottom, leader) if q.power.size))
    return Parts(top.over(common), bottom.over(common), leader.over(common), plant, feedback)
