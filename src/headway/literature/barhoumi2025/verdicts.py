"""How claims of the text are judged: conditions on measured numbers, over every way to fill in what is not stated.

A claim names a few conditions (a measured number and the range that the sentence asks for). They are
checked for every combination of what the paper leaves open. The verdict follows from in how many of
these combinations all conditions hold, and from nothing else.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

__all__ = [
    "ABOUT",
    "READ",
    "SAME",
    "THRESHOLDS",
    "VERDICTS",
    "Choices",
    "Claim",
    "ClaimOutcome",
    "Condition",
    "Decisive",
    "Judgement",
    "Verdict",
    "about",
    "at_least",
    "at_most",
    "grows",
    "in_range",
    "judge_claim",
    "not_amplified",
    "shrinks",
    "unbounded",
]  # fmt: skip

Verdict = Literal["reproduced", "depends on what is not stated", "contradicted", "not testable"]
Choices = Mapping[str, Any]

#: all verdicts, best first
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)

#: a bound that was read off a figure is right to this share
READ = 0.10
#: "about", "up to", "peaks around": right to this share
ABOUT = 0.25
#: sizes whose ratio differs from 1 by no more than this are the same
SAME = 0.05

#: the rules in words, for reports
THRESHOLDS = (
    f"A bound ('within', 'beyond', 'reaching') is taken as read off a figure: it may be missed by {READ:.0%}.",
    f"'About', 'up to' and 'peaks at' hold if the number lies within {ABOUT:.0%} of the one in the text.",
    f"'Grows', 'amplifies' ask for a ratio above {1 + SAME:g}, 'attenuated', 'reduced' for one below {1 - SAME:g}; "
    f"'not amplified' allows up to {1 + SAME:g} from each vehicle to the next.",
    "A claim is reproduced if all its conditions hold in every combination of what the paper leaves open, "
    "contradicted if they hold together in none, dependent on what is not stated otherwise. It is not testable if "
    "it holds in none, and in none a number exists that is not as the text says.",
    "A vehicle that collides has no values from then on. What asks for a later value does not hold.",
)


@dataclass(frozen=True)
class Condition:
    """A measured number and the range that the text states for it.

    Attributes:
        name: of the number.
        value: measured; NaN where it does not exist.
        unit: of the number.
        low: least value that the text allows.
        high: largest value that the text allows; without any bound the number only informs.
    """

    name: str
    value: float
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", float(self.value))  # a plain number

    @property
    def bounded(self) -> bool:
        """Whether the text states a bound for this number."""
        return math.isfinite(self.low) or math.isfinite(self.high)

    @property
    def holds(self) -> bool:
        """Whether the number is as the text says; one that does not exist is not."""
        return not self.bounded or self.low <= self.value <= self.high

    @property
    def margin(self) -> float:
        """Distance to the nearer bound as a share of that bound, negative outside; infinite without bounds."""
        if not self.bounded:
            return math.inf
        return min((s * (self.value - b) / (abs(b) or 1.0) for s, b in self._bounds()), default=math.inf)

    def _bounds(self) -> Iterator[tuple[float, float]]:
        if math.isfinite(self.low):
            yield 1.0, self.low
        if math.isfinite(self.high):
            yield -1.0, self.high


def unbounded(name: str, value: Any, unit: str = "") -> Condition:
    """Return a number that only informs."""
    return Condition(name, value, unit)


def at_most(name: str, value: Any, bound: float, unit: str = "") -> Condition:
    """Return the condition that a number is at most `bound`, which was read off a figure."""
    return Condition(name, value, unit, high=bound * (1 + READ))


def at_least(name: str, value: Any, bound: float, unit: str = "") -> Condition:
    """Return the condition that a number is at least `bound`, which was read off a figure."""
    return Condition(name, value, unit, low=bound * (1 - READ))


def about(name: str, value: Any, size: float, unit: str = "", share: float = ABOUT) -> Condition:
    """Return the condition that a number is `size`, named with 'about' or 'up to', give or take a `share`."""
    return Condition(name, value, unit, size * (1 - share), size * (1 + share))


def in_range(name: str, value: Any, low: float, high: float, unit: str = "") -> Condition:
    """Return the condition that a number lies from `low` to `high` exactly."""
    return Condition(name, value, unit, low, high)


def grows(name: str, ratio: Any) -> Condition:
    """Return the condition that a ratio is clearly above 1."""
    return Condition(name, ratio, "", low=1 + SAME)


def shrinks(name: str, ratio: Any) -> Condition:
    """Return the condition that a ratio is clearly below 1."""
    return Condition(name, ratio, "", high=1 - SAME)


def not_amplified(name: str, ratio: Any) -> Condition:
    """Return the condition that a ratio from one vehicle to the next is not above 1."""
    return Condition(name, ratio, "", high=1 + SAME)


@dataclass(frozen=True)
class ClaimOutcome:
    """The measurements for one combination of choices.

    Attributes:
        choices: values by axis.
        conditions: measured numbers with their ranges.
    """

    choices: Choices
    conditions: tuple[Condition, ...]

    @property
    def measured(self) -> dict[str, float]:
        """The numbers by name."""
        return {c.name: c.value for c in self.conditions}

    @property
    def holds(self) -> bool:
        """Whether all conditions hold."""
        return all(c.holds for c in self.conditions)

    @property
    def margin(self) -> float:
        """The least margin of the conditions."""
        return min((c.margin for c in self.conditions), default=math.inf)

    @property
    def refuted(self) -> bool:
        """Whether a number that exists is not as the text says."""
        return any(not c.holds and not math.isnan(c.value) for c in self.conditions)


#: measures a combination of choices
Check = Callable[[Choices], Sequence[Condition]]


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper, in words of our own.

    Attributes:
        id: of the claim.
        sentence: the claim.
        where: place in the paper.
        experiment: id of the experiment that it is about.
        setting: what the paper states.
        axes: what it does not state, each with the values tried; the first of each is headway's own choice.
        check: the conditions for one combination.
        contrary: a sentence of the text that says the opposite; else empty.
        against: the conditions of `contrary`.
        sweep: an axis of numbers with its values, varied alone, all else as chosen.
    """

    id: str
    sentence: str
    where: str
    experiment: str
    setting: str
    axes: Mapping[str, tuple[Any, ...]]
    check: Check
    contrary: str = ""
    against: Check | None = None
    sweep: tuple[str, tuple[float, ...]] | None = None

    @property
    def chosen(self) -> dict[str, Any]:
        """headway's own choice on each axis."""
        return {name: values[0] for name, values in self.axes.items()}

    def combinations(self) -> Iterator[dict[str, Any]]:
        """Yield every combination of the values of the axes, headway's own first."""
        for values in itertools.product(*self.axes.values()):
            yield dict(zip(self.axes, values, strict=True))


@dataclass(frozen=True)
class Decisive:
    """An axis on which the verdict turns.

    Attributes:
        axis: name of the axis.
        share: of pairs of combinations that differ in it alone, the share in which only one side holds.
        counts: for each value in how many combinations the claim holds, and of how many.
    """

    axis: str
    share: float
    counts: Mapping[Any, tuple[int, int]]


@dataclass(frozen=True)
class Judgement:
    """A claim with all its measurements.

    Attributes:
        claim: the claim.
        outcomes: of all combinations, headway's own first.
        contrary: outcomes of the opposite sentence, if the text has one.
        sweep: outcomes along the axis of the sweep, if there is one.
        verdict: on the claim.
    """

    claim: Claim
    outcomes: tuple[ClaimOutcome, ...]
    contrary: tuple[ClaimOutcome, ...] = ()
    sweep: tuple[ClaimOutcome, ...] = ()
    verdict: Verdict = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "verdict", _verdict(self.outcomes))

    @property
    def chosen(self) -> ClaimOutcome:
        """The outcome for headway's own choices."""
        return self.outcomes[0]

    @property
    def holding(self) -> int:
        """Number of combinations in which the claim holds."""
        return sum(o.holds for o in self.outcomes)

    @property
    def contrary_verdict(self) -> Verdict | None:
        """The verdict on the opposite sentence, None where the text has none."""
        return _verdict(self.contrary) if self.contrary else None

    def condition(self, name: str) -> list[Condition]:
        """Return the condition of this name in all combinations."""
        return [c for o in self.outcomes for c in o.conditions if c.name == name]

    @property
    def decisive(self) -> tuple[Decisive, ...]:
        """The axes on which the verdict turns, the most decisive first; empty if it does not depend."""
        if self.verdict != "depends on what is not stated":
            return ()
        axes = [d for axis in self.claim.axes if (d := _decisive(axis, self.outcomes)).share > 0]
        return tuple(sorted(axes, key=lambda d: -d.share))


def judge_claim(claim: Claim) -> Judgement:
    """Measure a claim in every combination of what the paper does not state."""
    outcomes, contrary, sweep = [], [], []
    for choices in claim.combinations():
        outcomes.append(ClaimOutcome(choices, tuple(claim.check(choices))))
        # at once, while the runs are at hand
        if claim.against is not None:
            contrary.append(ClaimOutcome(choices, tuple(claim.against(choices))))
    if claim.sweep is not None:
        axis, values = claim.sweep
        for value in values:
            choices = {**claim.chosen, axis: value}
            sweep.append(ClaimOutcome(choices, tuple(claim.check(choices))))
    return Judgement(claim, tuple(outcomes), tuple(contrary), tuple(sweep))


def _verdict(outcomes: Sequence[ClaimOutcome]) -> Verdict:
    holding = sum(o.holds for o in outcomes)
    if holding == len(outcomes):
        return "reproduced"
    if holding:
        return "depends on what is not stated"
    return "contradicted" if any(o.refuted for o in outcomes) else "not testable"


def _decisive(axis: str, outcomes: Sequence[ClaimOutcome]) -> Decisive:
    groups: dict[tuple[Any, ...], list[bool]] = {}
    counts: dict[Any, tuple[int, int]] = {}
    for outcome in outcomes:
        rest = tuple(value for name, value in outcome.choices.items() if name != axis)
        groups.setdefault(rest, []).append(outcome.holds)
        held, tried = counts.get(outcome.choices[axis], (0, 0))
        counts[outcome.choices[axis]] = (held + outcome.holds, tried + 1)
    pairs = [a != b for held in groups.values() for a, b in itertools.combinations(held, 2)]
    return Decisive(axis, sum(pairs) / len(pairs) if pairs else 0.0, counts)
