"""Advice in words that the numbers make.

For every entry and delay exact theory gives the value of a parameter at which string stability is won or lost;
two simulations, a little to either side of it, confirm or contradict it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from headway.benchmark.cells import PUBLISHED, TUNED, Board, Cell
from headway.benchmark.scores import CRITERIA, Criterion, Score, criterion_value, held, holds, lost, scoreboard
from headway.benchmark.spec import Entry, Late
from headway.benchmark.theory import Theory, linear
from headway.engine.simulate import simulate
from headway.errors import HeadwayError
from headway.metrics import amplitude_growth
from headway.metrics.sizes import UNPHYSICAL
from headway.scenario.leaders import Sine
from headway.scenario.scenario import Scenario
from headway.study.executors import cores
from headway.theory.linear import Linear

__all__ = ["Advice", "Side", "advise", "findings", "trade_offs"]

#: how far to either side of a critical value it is confirmed, and the amplitude [m/s] of the leader there
_APART, _SMALL = 0.05, 0.05

#: periods that are simulated, and the last ones that are measured
_PERIODS, _MEASURED = 6, 2


@dataclass(frozen=True)
class Side:
    """A value beside the critical one: what theory says there, and what was simulated.

    Attributes:
        value: of the parameter, in its unit.
        stable: whether theory says string stable.
        omega: frequency of the leader [rad/s].
        gain: |G(iω)| by theory.
        measured: growth per vehicle simulated; infinite where followers collide, NaN where nothing could be run.
    """

    value: float
    stable: bool
    omega: float
    gain: float
    measured: float

    @property
    def agrees(self) -> bool:
        """Whether simulation says the same as theory."""
        return (self.measured <= 1.0) == self.stable and not math.isnan(self.measured)


@dataclass(frozen=True)
class Advice:
    """The value of a parameter that string stability needs at a delay.

    Attributes:
        who: name of the entry.
        delay: of its late signals [s].
        by_radio: whether these arrive by radio.
        parameter: name of the parameter.
        unit: of the parameter.
        now: present value.
        stable: whether the entry is string stable with it.
        critical: value at which the verdict changes; NaN where no allowed value does.
        least: whether the critical value is a lower bound of the stable ones, not an upper one.
        sides: a value below and one above, simulated; empty where nothing could be confirmed.
        speed: of everybody [m/s].
    """

    who: str
    delay: float
    by_radio: bool
    parameter: str
    unit: str
    now: float
    stable: bool
    critical: float
    least: bool
    sides: tuple[Side, ...]
    speed: float

    @property
    def confirmed(self) -> bool:
        """Whether simulation agrees on both sides."""
        return bool(self.sides) and all(side.agrees for side in self.sides)

    @property
    def sentence(self) -> str:
        """The advice in words."""
        what = f"{self.delay:g} s {'radio' if self.by_radio else 'reaction'} delay" if self.delay > 0 else "no delay"
        unit = (
            "" if self.unit in ("", "1") or "^(" in self.unit else f" {self.unit}"
        )  # exponents that depend on parameters
        here = f"{self.parameter} = {self.now:.4g}{unit}"
        if math.isnan(self.critical):
            verdict = "string stable" if self.stable else "string unstable"
            return f"At {what} {self.who} is {verdict} with {here}, and no allowed {self.parameter} changes that."
        bound = f"{self.parameter} {'≥' if self.least else '≤'} {_rounded(self.critical, self.least)}{unit}"
        if self.stable:
            text = f"At {what} {self.who} is string stable with {here} and stays so as long as {bound}"
        else:
            text = f"At {what} {self.who} needs {bound} to be string stable ({here} is not enough)"
        return f"{text}; {self._check()}."

    def _check(self) -> str:
        if not self.sides:
            return "not confirmed by simulation"
        outcomes = " and ".join(
            f"{_factor(side.measured)} with {self.parameter} = {side.value:.4g}"
            if math.isfinite(side.measured)
            else f"{'a collision' if side.measured > 0 else 'no answer'} with {self.parameter} = {side.value:.4g}"
            for side in self.sides
        )
        verdict = "confirmed" if self.confirmed else "**not** confirmed"
        return f"{verdict} by simulation, where the growth per vehicle is {outcomes}"


def _factor(growth: float) -> str:
    """Write a growth with as many digits as it takes to tell it from 1."""
    digits = 3 if growth == 1.0 else max(3, 1 - math.floor(math.log10(abs(growth - 1.0))))
    return f"{growth:.{min(digits, 9)}f}" if growth < 100 else f"{growth:.3g}"


def _rounded(number: float, up: bool) -> str:
    """Write three digits, rounded to the safe side."""
    digits = 2 - math.floor(math.log10(abs(number))) if number else 0
    step = 10.0**-digits
    return f"{(math.ceil if up else math.floor)(number / step - (1e-9 if up else -1e-9)) * step:.{max(digits, 0)}f}"


def advise(board: Board) -> tuple[Advice, ...]:
    """Return advice for every entry, every delay that it has in a case, and every parameter of its `adjust`.

    Args:
        board: the cells of a benchmark.

    Returns:
        Advice, confirmed by simulation where that was possible. Entries without an equilibrium or without a verdict
        per vehicle have none.
    """
    b = board.benchmark
    advice: list[Advice] = []
    scenarios: list[Scenario] = []
    for entry in b.entries:
        delays = sorted({entry.delay(case.onboard, case.radio) for case in b.cases})
        for delay, parameter in itertools.product(delays, entry.adjust):
            try:
                advice.append(_advice(entry, delay, parameter, b.speed))
            except HeadwayError:
                continue  # nothing to advise; `findings` and the table of theory give the reason
    for item in advice:
        for side in item.sides:
            scenarios.append(_scenario(b.entry(item.who), item, side, b.speed))
    measured = iter(_growth(scenarios))
    return tuple(
        replace(item, sides=tuple(replace(side, measured=next(measured)) for side in item.sides)) for item in advice
    )


def _advice(entry: Entry, delay: float, parameter: str, speed: float) -> Advice:
    here = linear(entry, delay, speed)
    critical = here.critical(parameter)
    sides: list[Side] = []
    if math.isfinite(critical) and critical != 0.0:
        for value in (critical * (1 - _APART), critical * (1 + _APART)):
            try:
                there = linear(_changed(entry, parameter, value), delay, speed)
            except HeadwayError:
                continue
            sides.append(Side(value, there.string_stable, _frequency(there), 0.0, math.nan))
    # what is measured on the stable side is what would grow on the other
    telling = next((side.omega for side in sides if not side.stable), math.nan)
    if len(sides) != 2 or sides[0].stable == sides[1].stable or not math.isfinite(telling):
        sides = []
    sides = [
        replace(s, omega=telling, gain=float(linear(_changed(entry, parameter, s.value), delay, speed).gain(telling)))
        for s in sides
    ]
    info = entry.model.law.parameters[parameter].info
    now = entry.model.parameters[parameter]
    # the side of the verdict: where both are known, the stable one; else that of the present value
    least = sides[1].stable if sides else (now >= critical) == here.string_stable
    return Advice(
        entry.name, delay, entry.by_radio, parameter, info.unit, now, here.string_stable, critical, least,
        tuple(sides), speed,
    )  # fmt: skip


def _changed(entry: Entry, parameter: str, value: float) -> Entry:
    return replace(entry, vehicle=replace(entry.vehicle, model=entry.model.replace(**{parameter: value})))


def _frequency(there: Linear) -> float:
    """Return a frequency [rad/s] at which growth shows: that of the largest gain, or of the root that grows."""
    if there.locally_stable:
        # a sine so slow that it takes minutes shows nothing that a faster one that also grows does not
        slowest = next((w for w in (0.2, 0.1, 0.05, 0.02) if there.gain(w) > 1.0), 0.0)
        omega = max(there.peak_frequency, slowest)
        return omega if 0 < omega < 20 else math.nan
    return max(abs(there.rightmost_root.imag), 0.05)


def _scenario(entry: Entry, advice: Advice, side: Side, speed: float) -> Scenario:
    car = _changed(entry, advice.parameter, side.value).with_delay(advice.delay)
    leader = Sine(mean=speed, amplitude=_SMALL, omega=side.omega)
    period = 2.0 * math.pi / side.omega
    duration = max(_PERIODS * period, 150.0)
    return Scenario(leader, [car] * 3, duration=duration, gaps=entry.start_gap, dt=0.02, output_step=period / 40)


def _growth(scenarios: Sequence[Scenario]) -> list[float]:
    """Return the largest growth per vehicle at the end of each run; infinite after a collision, NaN without a value."""
    with ThreadPoolExecutor(cores()) as pool:
        return list(pool.map(_growth_of, scenarios))


def _growth_of(scenario: Scenario) -> float:
    omega = scenario.leader.omega
    window = (scenario.end - _MEASURED * 2.0 * math.pi / omega, scenario.end)
    try:
        run = simulate(scenario)
        if np.isfinite(run.collision_time.values).any():
            return math.inf
        return float(amplitude_growth(run, omega=omega, window=window).max())
    except HeadwayError:
        return math.nan


def findings(board: Board, theory: Sequence[Theory], advice: Sequence[Advice]) -> tuple[str, ...]:
    """Return what matters most, a sentence each.

    Args:
        board: the cells of a benchmark.
        theory: of its entries.
        advice: for its entries.
    """
    scores = scoreboard(board, PUBLISHED)
    order = ", ".join(f"{s.who} ({s.overall:.1f})" for s in scores)
    sentences = [
        f"**Order** by the mean rank over {len(scores[0].ranks)} criteria, 1 is best: {order}.{_same_gap(board)}"
    ]
    sentences += [_of_case(board, case, [s.who for s in scores], theory) for case in board.benchmark.cases]
    if any(c.sweep for c in board.benchmark.courses):
        reached = "; ".join(_reach(board, s.who) for s in scores)
        sentences.append(
            f"**The largest delay** at which all criteria still hold in all swept disturbances: {reached}."
        )
    longest = max((a.delay for a in advice if not a.by_radio), default=0.0)
    urgent = [a for a in advice if not a.stable and not math.isnan(a.critical) and a.delay == longest]
    sentences += [f"**{a.who}.** {a.sentence}" for a in urgent[:2]]
    sentences += _without_verdict(theory)
    sentences += _unphysical(board)
    return tuple(sentences)


def _same_gap(board: Board) -> str:
    """Say the order of the entries once all keep the same gap, and who of them collides there."""
    scores = scoreboard(board, TUNED)
    if not scores:
        return ""
    places = []
    for score in scores:
        cells = board.select(TUNED, who=score.who)
        hits = sum(c.collided for c in cells)
        hit = f", collides in {hits} of {len(cells)} runs" if hits else ""
        places.append(f"{score.who} ({score.overall:.1f}{hit})")
    b = board.benchmark
    common = f"all tuned to {b.gap:g} m at {b.speed:g} m/s"
    return f" It depends on the distance that each keeps: {common} it is {', '.join(places)}."


def _without_verdict(theory: Sequence[Theory]) -> list[str]:
    """Say of which entries theory has no string verdict, and why; nothing if it has one of all."""
    reasons = dict.fromkeys((t.who, t.reason) for t in theory if t.reason)
    return [f"**No string verdict on {who}** by theory, so no advice for it: {reason}." for who, reason in reasons]


def _unphysical(board: Board) -> list[str]:
    """Say who brakes harder than any car can, where, and what that means; nothing if nobody does."""
    offenders = []
    for name in dict.fromkeys(c.who for c in board.select(PUBLISHED)):
        cells = [c for c in board.select(PUBLISHED, who=name) if "braking" in c.values]
        beyond = [c.values["braking"] for c in cells if c.values["braking"] < -UNPHYSICAL]
        if beyond:
            offenders.append(f"{name} in {len(beyond)} of {len(cells)} runs, at {-min(beyond):.3g} m/s² at most")
    if not offenders:
        return []
    return [
        f"**Braking beyond any car**, harder than {UNPHYSICAL:g} m/s²: {'; '.join(offenders)}. Accelerations have no "
        "limits here, so that such a run says what the law asks for, not what a car would do."
    ]


def _of_case(board: Board, case: Late, names: Sequence[str], theory: Sequence[Theory]) -> str:
    parts = []
    for name in names:
        cells = board.select(PUBLISHED, case.name, name)
        criteria = [c.name for c in CRITERIA if holds(cells, c)]
        summary = "all criteria" if len(criteria) == len(CRITERIA) else ", ".join(criteria) or "no criterion throughout"
        text = f"{name} holds {summary}"
        for what, hit in (("collides", sum(c.collided for c in cells)), ("cannot be run", sum(map(_absent, cells)))):
            text += f" and {what} behind {hit} of {len(cells)} leaders" if hit else ""
        verdict = next((t for t in theory if t.who == name and t.delays == case.name), None)
        if verdict is not None and verdict.string_stable and "string stability" not in criteria:
            text += ", though by theory small disturbances do not grow"
        parts.append(text)
    late = "" if case.onboard == case.radio == 0 else f" ({case.onboard:g} s on board, {case.radio:g} s by radio)"
    return f"**Delays: {case.name}**{late}: {'; '.join(parts)}."


def _absent(cell: Cell) -> bool:
    return bool(cell.reason)


def _reach(board: Board, who: str) -> str:
    reached = {c.name: held(board, who, c) for c in CRITERIA}
    if any(math.isnan(r) for r in reached.values()):
        return f"{who} holds not all even without delay"
    least = min(reached.values())
    if least == board.benchmark.sweep[-1]:
        return f"{who} at least {least:g} s"
    first = next(c for c in CRITERIA if reached[c.name] == least)
    return f"{who} {least:g} s (then {first.name} is lost behind the leader {lost(board, who, first)[0]})"


def trade_offs(board: Board, scores: Sequence[Score], theory: Sequence[Theory]) -> tuple[str, ...]:
    """Say where being better at one thing goes with being worse at another.

    Args:
        board: the cells of a benchmark.
        scores: of its entries, best first.
        theory: of its entries.

    Returns:
        List items, each a sentence.
    """
    sentences = []
    cases = {case.name for case in board.benchmark.cases}
    cells = [c for c in board.select(PUBLISHED) if c.delays in cases]
    for one, other in itertools.combinations(CRITERIA, 2):
        tau, pairs = _agreement(cells, one, other)
        if pairs >= 10 and tau <= -0.2:
            sentences.append(
                f"- **{one.name} against {other.name}**: of two entries that do not collide, the one better at the "
                f"first is worse at the second in {0.5 * (1.0 - tau):.0%} of {pairs} comparisons."
            )
    for score in scores:
        finite = {n: r for n, r in score.ranks.items() if math.isfinite(r)}
        if not finite:
            continue
        best, worst = min(finite, key=lambda n: finite[n]), max(finite, key=lambda n: finite[n])
        runs = board.select(PUBLISHED, who=score.who)
        hits = sum(c.collided for c in runs)
        if 2 * hits > len(runs):
            sentences.append(
                f"- **{score.who}** collides in {hits} of {len(runs)} runs: it fails all criteria there, and no rank "
                "says that it is good at something."
            )
            continue
        text = f"- **{score.who}** ranks best at {best} ({finite[best]:.1f}) and worst at {worst} ({finite[worst]:.1f})"
        flow = next((t for t in theory if t.who == score.who and math.isfinite(t.flow)), None)
        if flow is not None:
            speed = board.benchmark.speed
            text += f"; its gap of {flow.gap:.3g} m at {speed:g} m/s lets {flow.flow:.0f} vehicles an hour pass"
        sentences.append(f"{text}.")
    return tuple(sentences)


def _agreement(cells: Sequence[Cell], one: Criterion, other: Criterion) -> tuple[float, int]:
    """Return Kendall's τ of two criteria over all pairs of entries in the same cell, and the number of pairs."""
    places: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for cell in cells:
        pair = criterion_value(cell, one), criterion_value(cell, other)
        if not (cell.collided or cell.reason) and all(map(math.isfinite, pair)):
            signed = tuple(-v if c.more else v for v, c in zip(pair, (one, other), strict=True))
            places.setdefault((cell.course, cell.delays), []).append((signed[0], signed[1]))
    agree = against = 0
    for there in places.values():
        for (a, b), (c, d) in itertools.combinations(there, 2):
            product = (a - c) * (b - d)
            agree += product > 0
            against += product < 0
    total = agree + against
    return ((agree - against) / total if total else 0.0), total
