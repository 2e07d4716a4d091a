"""The paper reproduced: experiments and claims chosen by id, measured, and as plain tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from concurrent.futures import BrokenExecutor, Executor, as_completed
from typing import Any

from headway.errors import HeadwayError, unknown_name
from headway.literature.barhoumi2025.claims import CLAIMS
from headway.literature.barhoumi2025.experiments import EXPERIMENTS, Experiment
from headway.literature.barhoumi2025.settings import AXES
from headway.literature.barhoumi2025.verdicts import VERDICTS, ClaimOutcome, Condition, Judgement, judge_claim

__all__ = [
    "bounds_text", "choice", "choose", "count", "key_condition", "number_text", "reason", "reproduce", "tables",
    "verdict_table",
]  # fmt: skip

Progress = Callable[[int, int], Any]


def choose(only: Iterable[str] = ()) -> tuple[tuple[Experiment, ...], tuple[str, ...]]:
    """Select experiments and claims.

    Args:
        only: ids; that of an experiment stands for it and for the claims about it. All if empty.

    Returns:
        Experiments, and ids of claims.

    Raises:
        HeadwayError: naming the nearest id, for one that is neither.
    """
    names = list(only)
    allowed = (*EXPERIMENTS, *CLAIMS)
    exact = {name.lower(): name for name in allowed}
    chosen = set()
    for name in names:
        if name.lower() not in exact:
            raise unknown_name("experiment or claim of the paper", name, allowed)
        chosen.add(exact[name.lower()])
    experiments = tuple(e for e in EXPERIMENTS.values() if not names or e.id in chosen)
    claims = tuple(c.id for c in CLAIMS.values() if not names or {c.id, c.experiment} & chosen)
    return experiments, claims


def reproduce(
    claims: Iterable[str] | None = None, executor: Executor | None = None, progress: Progress | None = None
) -> dict[str, Judgement]:
    """Measure and judge claims.

    Args:
        claims: ids; all claims if None.
        executor: where to measure; this thread if None.
        progress: called with (done, total).

    Returns:
        Judgements by id, in the order of `claims`.

    Raises:
        HeadwayError: for an unknown id, or where a process ends.
    """
    ids = tuple(CLAIMS if claims is None else claims)
    for name in ids:
        if name not in CLAIMS:
            raise unknown_name("claim of the paper", name, CLAIMS)
    judgements: dict[str, Judgement] = {}
    if executor is None:
        for name in ids:
            judgements[name] = judge_claim(CLAIMS[name])
            _tell(progress, len(judgements), len(ids))
        return judgements
    # a claim holds functions and stays here; what is measured for it travels
    waiting = {executor.submit(_measured, name): name for name in ids}
    for future in as_completed(waiting):
        name = waiting[future]
        try:
            judgements[name] = Judgement(CLAIMS[name], *future.result())
        except BrokenExecutor:
            raise HeadwayError(f"{name} could not be measured: the process that was at it has been ended") from None
        _tell(progress, len(judgements), len(ids))
    return {name: judgements[name] for name in ids}


def _measured(name: str) -> tuple[tuple[ClaimOutcome, ...], ...]:
    finding = judge_claim(CLAIMS[name])
    return finding.outcomes, finding.contrary, finding.sweep


def _tell(progress: Progress | None, done: int, total: int) -> None:
    if progress is not None:
        progress(done, total)


# -- words -----------------------------------------------------------------------------------------


def number_text(value: float, unit: str = "") -> str:
    """Write a number with its unit for a sentence; a dash for NaN.

    Args:
        value: the number.
        unit: its unit; none if empty.
    """
    if math.isnan(value):
        return "–"
    text = "∞" if math.isinf(value) else f"{value:.3g}"
    return f"{text} {unit}".rstrip()


def bounds_text(condition: Condition) -> str:
    """Write the range of a condition; nothing where it has no bounds."""
    low, high = (number_text(b) for b in (condition.low, condition.high))
    if math.isfinite(condition.low) and math.isfinite(condition.high):
        return f"{low} to {high}" if condition.low != condition.high else low
    if math.isfinite(condition.low):
        return f"≥ {low}"
    return f"≤ {high}" if math.isfinite(condition.high) else ""


def key_condition(finding: Judgement) -> Condition:
    """Return the condition, for headway's own choices, that holds in the fewest combinations."""
    conditions = [c for c in finding.chosen.conditions if c.bounded]
    return min(conditions, key=lambda c: sum(other.holds for other in finding.condition(c.name)))


def reason(finding: Judgement) -> str:
    """Say the reason of a verdict in words that the numbers make."""
    total = len(finding.outcomes)
    held = f"all conditions hold in {finding.holding} of {total} combinations of what is not stated"
    if finding.verdict == "depends on what is not stated":
        on = "; ".join(_turns(d.axis, d.counts) for d in finding.decisive[:3])
        return f"{held}. It turns on {on}."
    if finding.verdict == "reproduced":
        return f"{held}."
    failing = [
        f"'{c.name}' in {sum(other.holds for other in finding.condition(c.name))} of {len(finding.condition(c.name))}"
        for c in finding.chosen.conditions
        if c.bounded
    ]
    return f"{held}; each by itself: {', '.join(failing)}."


def choice(value: Any, unit: str = "") -> str:
    """Write a value on an axis of what the paper does not state.

    Args:
        value: a number or a name.
        unit: of a number; none if empty.
    """
    return f"{value:g} {unit}".rstrip() if isinstance(value, float) else str(value)


def _turns(axis: str, counts: Any) -> str:
    parts = ", ".join(f"{choice(v, AXES[axis].unit)}: {held} of {tried}" for v, (held, tried) in counts.items())
    return f"{AXES[axis].meaning} ({parts})"


def verdict_table(findings: Iterable[Judgement]) -> str:
    """Return the verdicts as a table in Markdown, one row for each claim."""
    rows = ["| claim | what the text says | verdict | holds in | turns on |", "|---|---|---|---|---|"]
    for f in findings:
        turns = AXES[f.decisive[0].axis].meaning if f.decisive else ""
        held = f"{f.holding} of {len(f.outcomes)}"
        rows.append(f"| {f.claim.id} | {f.claim.sentence} | {f.verdict} | {held} | {turns} |")
    return "\n".join(rows)


# -- tables ----------------------------------------------------------------------------------------


def count(findings: dict[str, Judgement]) -> dict[str, int]:
    """Return the number of claims by verdict."""
    return {verdict: sum(f.verdict == verdict for f in findings.values()) for verdict in VERDICTS}


def tables(findings: dict[str, Judgement]) -> dict[str, Any]:
    """Return everything as plain tables: counts, and for each claim verdict, numbers and outcomes."""
    return {"verdicts": count(findings), "claims": [_claim(f) for f in findings.values()]}


def _claim(finding: Judgement) -> dict[str, Any]:
    claim = finding.claim
    table: dict[str, Any] = {
        "id": claim.id, "sentence": claim.sentence, "where": claim.where, "experiment": claim.experiment,
        "stated": claim.setting, "verdict": finding.verdict, "holds": finding.holding,
        "combinations": len(finding.outcomes), "reason": reason(finding), "chosen": dict(finding.chosen.choices),
        "measured": [_condition(c, finding) for c in finding.chosen.conditions], "margin": finding.chosen.margin,
        "depends_on": [
            {"axis": d.axis, "meaning": AXES[d.axis].meaning, "unit": AXES[d.axis].unit, "share": d.share,
             "holds": {str(v): list(n) for v, n in d.counts.items()}}
            for d in finding.decisive
        ],
        "outcomes": [_outcome(o) for o in finding.outcomes],
    }  # fmt: skip
    if finding.sweep and claim.sweep is not None:
        table["sweep"] = {"axis": claim.sweep[0], "outcomes": [_outcome(o) for o in finding.sweep]}
    if finding.contrary:
        table["contrary"] = {
            "sentence": claim.contrary, "verdict": finding.contrary_verdict,
            "holds": sum(o.holds for o in finding.contrary),
            "measured": {c.name: c.value for c in finding.contrary[0].conditions},
            "outcomes": [_outcome(o) for o in finding.contrary],
        }  # fmt: skip
    return table


def _condition(condition: Condition, finding: Judgement) -> dict[str, Any]:
    everywhere = finding.condition(condition.name)
    values = [c.value for c in everywhere if not math.isnan(c.value)]
    return {
        "name": condition.name, "unit": condition.unit, "value": condition.value, "low": condition.low,
        "high": condition.high, "holds": condition.holds, "least": min(values, default=math.nan),
        "largest": max(values, default=math.nan), "holds_in": sum(c.holds for c in everywhere),
    }  # fmt: skip


def _outcome(outcome: ClaimOutcome) -> dict[str, Any]:
    return {
        "choices": dict(outcome.choices), "measured": outcome.measured, "holds": outcome.holds,
        "margin": outcome.margin,
    }  # fmt: skip
