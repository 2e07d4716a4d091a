"""The transfer functions of one vehicle as quasi-polynomials, from its partial derivatives, delays and lag."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from headway.errors import HeadwayError
from headway.models.signal import AHEAD, LEADER, OWN
from headway.scenario.reception import Perception
from headway.theory.quasipolynomial import QuasiPolynomial

__all__ = ["Parts", "delay_columns", "parts"]


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


def parts(partials: Mapping[str, float], perception: Perception, lag: float) -> Parts:
    """Return the parts of the transfer functions of one vehicle; see `headway.theory.linear`.

    Args:
        partials: partial derivatives of the law by signal; signals that are left out count as 0.
        perception: what the law perceives, and how late.
        lag: time constant [s] of the actuator, at least 0.

    Raises:
        HeadwayError: for a law that perceives more than itself, the vehicle ahead and the platoon leader.
    """
    terms: dict[int, list[tuple[float, int, float]]] = {OWN: [], AHEAD: [], LEADER: []}
    for source in perception.sources:
        if source.whose not in terms:
            raise HeadwayError(
                f"linear theory of {source.signal.name}: it treats what a law perceives of itself, of the vehicle "
                "ahead and of the platoon leader"
            )
        # what a vehicle perceives of itself stands on the other side
        weight = -source.sign if source.whose == OWN else source.sign
        slope = partials.get(source.signal.name, 0.0)
        terms[source.whose].append((weight * slope, source.signal.order, source.delay))
    top, leader = QuasiPolynomial.of(*terms[AHEAD]), QuasiPolynomial.of(*terms[LEADER])
    plant = QuasiPolynomial.of((1.0, 2, 0.0), (lag, 3, 0.0))
    feedback = QuasiPolynomial.of(*terms[OWN])
    bottom = QuasiPolynomial.of(*plant.terms, *feedback.terms)
    # one factor p is the gap of a law that rests at every gap; a second one is a speed that nothing corrects
    common = min(1, *(q.lowest for q in (top, bottom, leader) if q.power.size))
    return Parts(top.over(common), bottom.over(common), leader.over(common), plant, feedback)


def delay_columns(perception: Perception) -> dict[str, float]:
    """Delays [s] by column of a row of the compiled sweep: of a signal, and of `dv` of its two halves."""
    columns = {}
    for source in perception.sources:
        halves = source.signal.order == 1 and source.signal.less is not None
        name = ("own" if source.whose == OWN else "leader") if halves else source.signal.name
        columns[f"delay.{name}"] = source.delay
    return columns
