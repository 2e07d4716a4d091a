"""The reproduced paper as one report: verdicts first, then evidence, figures, methods and parameters."""

from __future__ import annotations

import hashlib
import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from headway.library import library_scenario
from headway.literature.barhoumi2025.claims import GROUPS
from headway.literature.barhoumi2025.experiments import EXPERIMENTS, STATED, Experiment
from headway.literature.barhoumi2025.figures import dependence, experiment_figures
from headway.literature.barhoumi2025.reproduction import (
    Progress,
    bounds_text,
    choice,
    count,
    key_condition,
    number_text,
    reason,
    tables,
)
from headway.literature.barhoumi2025.settings import AXES, GAINS, IDM_SETS
from headway.literature.barhoumi2025.verdicts import THRESHOLDS, ClaimOutcome, Condition, Judgement
from headway.models import BUILT_IN
from headway.report import Illustration, Report, Section, Table, Text
from headway.report.parts import Block
from headway.version import __version__

__all__ = ["PAPER", "paper_report"]

PAPER = (
    "Barhoumi, Farhani, Rahman, Zaki, Tahar: A Comparative Study of Oscillatory Perturbations in Car-Following Models "
    "(preprint, submitted to the IEEE)"
)

_ABOUT = {"cacc": "CACC", "idm": "IDM", "ovm": "OVM", "gmm": "GMM", "all": "all four models"}

_METHODS = (
    "The leader's speed is prescribed, v(t) = v_e + p(t). Followers start in the exact equilibrium of their law unless "
    "a row says otherwise, and have no length, as in the paper's formulas. Before t = 0 every signal has its value at "
    "t = 0. Car 0 is the leader; 'Cars 0-1' is the gap of the first follower.",
    "A delay is applied to all on-board signals (gap, own speed, relative speed) of IDM, OVM and GMM, and to the radio "
    "signals (speed and acceleration of the vehicle ahead) of CACC. Other readings are tried where a claim says so.",
    "CACC has its signs right (policy error = gap - desired gap), keeps the time gap h in its loop, and solves that "
    "loop exactly. Delay equations are integrated by RK4 with steps that end on every breaking point.",
    "A collision ends the run of the vehicle that hits and of all behind it. The paper does not say what happens "
    "there; numbers of such runs are those until the collision.",
    "The paper's figures cannot be compared, only its words. Each claim is a few conditions on measured numbers, "
    "checked in every combination of the values tried for what the paper leaves open:",
    *(f"- {rule}" for rule in THRESHOLDS),
    "'Steady amplitude' is that of the forcing frequency over the last whole periods of the second half of a run, by "
    "least squares; 'largest error' is the largest magnitude in the whole run, refined between samples.",
)  # fmt: skip


def paper_report(
    experiments: Iterable[Experiment], findings: Mapping[str, Judgement], progress: Progress | None = None
) -> Report:
    """Draw all figures and return the report of a reproduction.

    Args:
        experiments: the experiments to show.
        findings: judgements by id of the claim.
        progress: called with (done, total) figures.
    """
    experiments, judgements = tuple(experiments), dict(findings)
    names = tuple(dict.fromkeys(name for e in experiments for name in e.scenarios.values()))
    sections: list[Section] = []
    if judgements:
        sections += [Section("Verdicts", (_verdicts(judgements),), "verdicts"), *_contradictions(judgements)]
        sections += _evidence(judgements)
    sections += _drawn(experiments, progress)
    if names:
        sections.append(Section("Runs", (_runs(names),), "runs"))
    sections.append(Section("Methods", (Text(_METHODS),), "methods"))
    sections.append(Section("Parameters", (_parameters(), _open(), _sets()), "parameters"))
    return Report(
        "A comparative study of oscillatory perturbations, reproduced", _summary(judgements, experiments),
        tuple(sections), _provenance(names), _citations(), _data(judgements, names),
    )  # fmt: skip


# -- summary and verdicts --------------------------------------------------------------------------


def _summary(findings: dict[str, Judgement], experiments: tuple[Experiment, ...]) -> tuple[str, ...]:
    words = ["The experiments of a comparative study of car-following models run again, and its claims checked."]
    if findings:
        counts = count(findings)
        tally = ", ".join(f"{number} {verdict}" for verdict, number in counts.items())
        words.append(f"**{len(findings)} claim{'s' * (len(findings) > 1)}:** {tally}.")
        for verdict, number in counts.items():
            if number:
                ids = ", ".join(f.claim.id for f in findings.values() if f.verdict == verdict)
                words.append(f"- **{verdict}**: {ids}")
        held = sum(f.chosen.holds for f in findings.values())
        words.append(f"With headway's own choices for what is not stated {held} of {len(findings)} claims hold.")
        turns = Counter(AXES[f.decisive[0].axis].meaning for f in findings.values() if f.decisive)
        if turns:
            most = ", ".join(f"{meaning} ({number})" for meaning, number in turns.most_common())
            words.append(f"What verdicts turn on most, and of how many claims: {most}.")
        twice = [f.claim.id for f in findings.values() if f.contrary]
        if twice:
            words.append(f"The text says the opposite of itself on {', '.join(twice)}; both sides are measured.")
    if experiments:
        words.append(f"{len(experiments)} of {len(EXPERIMENTS)} experiments are drawn in the paper's arrangement.")
    return tuple(words)


def _verdicts(findings: dict[str, Judgement]) -> Table:
    rows = []
    for f in findings.values():
        key = key_condition(f)
        turns = AXES[f.decisive[0].axis].meaning if f.decisive else ""
        share = round(100.0 * f.holding / len(f.outcomes), 1)
        rows.append((f.claim.id, f.claim.sentence, f.verdict, share, _yes(f.chosen.holds), _measured(key), turns))
    return Table(
        ("claim", "what the text says", "verdict", "holds in", "as chosen here", "its weakest figure", "turns on"),
        tuple(rows),
        "Every claim and its verdict", ("", "", "", "%", "", "", ""),
        note="'Holds in' is the share of combinations of what is not stated in which all conditions of the claim hold; "
        "the weakest figure is that of the condition which holds in the fewest, as chosen here.",
    )  # fmt: skip


def _yes(held: bool) -> str:
    return "holds" if held else "does not"


def _measured(c: Condition) -> str:
    return f"{c.name}: {number_text(c.value, c.unit)} (asked: {bounds_text(c)})"


def _contradictions(findings: dict[str, Judgement]) -> list[Section]:
    words = []
    for f in findings.values():
        if f.contrary:
            held, total = sum(o.holds for o in f.contrary), len(f.outcomes)
            words += [
                f"**{f.claim.id}.** {f.claim.sentence} {f.claim.contrary}",
                f"- as claimed: {f.verdict}, holds in {f.holding} of {total} combinations; {_numbers(f.chosen)}",
                f"- the opposite: {f.contrary_verdict}, holds in {held} of {total}; {_numbers(f.contrary[0])}",
            ]
    return [Section("Where the text contradicts itself", (Text(tuple(words)),), "contradictions")] if words else []


def _numbers(outcome: ClaimOutcome) -> str:
    return "; ".join(f"{c.name} {number_text(c.value, c.unit)}" for c in outcome.conditions)


# -- evidence --------------------------------------------------------------------------------------


def _evidence(findings: dict[str, Judgement]) -> list[Section]:
    sections = []
    for about, name in _ABOUT.items():
        entries = [findings[claim.id] for claim in GROUPS[about] if claim.id in findings]
        blocks = [block for finding in entries for block in _entry(finding)]
        if blocks:
            sections.append(Section(f"Claims about {name}", tuple(blocks), f"claims-{about}"))
    return sections


def _entry(finding: Judgement) -> list[Block]:
    claim = finding.claim
    words = [
        f"**{claim.id}: {finding.verdict}.** {claim.sentence}",
        f"{claim.where}; stated: {claim.setting}. {reason(finding)[:1].upper()}{reason(finding)[1:]}",
    ]
    if claim.contrary:
        words.append(claim.contrary)
    rows = []
    for c in finding.chosen.conditions:
        everywhere = finding.condition(c.name)
        values = [o.value for o in everywhere if not math.isnan(o.value)]
        held = f"{sum(o.holds for o in everywhere)} of {len(everywhere)}" if c.bounded else ""
        low, high = min(values, default=math.nan), max(values, default=math.nan)
        rows.append((c.name, c.unit, c.value, bounds_text(c), held, low, high))
    chosen = ", ".join(f"{AXES[a].meaning} {choice(v, AXES[a].unit)}" for a, v in finding.chosen.choices.items())
    blocks: list[Block] = [
        Text(tuple(words)),
        Table(
            ("measured", "unit", "headway's choices", "asked for", "holds in", "least", "largest"), tuple(rows),
            f"{claim.id}: what was measured", sortable=False,
            note=f"headway's choices: {chosen}. Least and largest over all {len(finding.outcomes)} combinations.",
        ),
    ]  # fmt: skip
    if finding.decisive:
        turns = AXES[finding.decisive[0].axis].meaning
        swept = f" Below, the sweep over {AXES[claim.sweep[0]].meaning}, all else as chosen." if claim.sweep else ""
        blocks.append(
            Illustration(
                f"claim-{claim.id.lower()}", dependence(finding),
                f"{claim.id}: its conditions for every combination, over {turns}; they hold in {finding.holding} of "
                f"{len(finding.outcomes)}.",
                f"{claim.id} over what decides it most: {turns}. Each point is one combination of what is not stated, "
                f"the shaded range is what the text asks for.{swept}",
            )
        )  # fmt: skip
    return blocks


# -- experiments -----------------------------------------------------------------------------------


def _drawn(experiments: tuple[Experiment, ...], progress: Progress | None) -> list[Section]:
    sections, done = [], 0
    for about, name in _ABOUT.items():
        blocks: list[Block] = []
        for experiment in (e for e in experiments if e.about == about):
            blocks += _experiment(experiment)
            done += 1
            if progress is not None:
                progress(done, len(experiments))
        if blocks:
            sections.append(Section(f"Experiments with {name}", tuple(blocks), f"experiments-{about}"))
    return sections


def _experiment(experiment: Experiment) -> list[Block]:
    place = (
        f"the paper's {experiment.figure}"
        if experiment.figure.startswith("fig:")
        else f"figure in the paper: {experiment.figure}"
    )
    words = (
        f"**{experiment.id}: {experiment.title}** ({place}).",
        f"Stated: {experiment.stated}. Not stated, chosen here: {experiment.chosen}.",
    )
    blocks: list[Block] = [Text(words)]
    blocks += [
        Illustration(name, figure, alt, caption) for name, figure, alt, caption in experiment_figures(experiment)
    ]
    return blocks


def _runs(names: Iterable[str]) -> Table:
    from headway.literature.barhoumi2025.settings import trajectories
    from headway.metrics import summary

    rows = []
    for name in names:
        dataset = trajectories(name)
        s = summary(dataset)
        first, last = (float(s.peak_spacing_error[i]) for i in (1, -1))
        hit = int(s.collision_time.notnull().sum())
        amplitudes = [float(s.speed_amplitude[i]) for i in (0, -1)]
        rows.append(
            (name, first, last, *amplitudes, float(s.least_gap[1:].min()), hit, dataset.attrs["scenario_hash"][:12])
        )
    return Table(
        ("scenario", "largest error, Cars 0-1", "largest error, last pair", "half speed range, leader",
         "half speed range, last", "least gap", "collisions", "scenario hash"), tuple(rows),
        "Every run, by its ready scenario", ("", "m", "m", "m/s", "m/s", "m", "", ""),
        note="headway run paper:NAME repeats one of them. After a collision there are no values.",
    )  # fmt: skip


# -- parameters, sources, data ---------------------------------------------------------------------


def _parameters() -> Table:
    rows = []
    for model, stated in STATED.items():
        law = BUILT_IN[model]
        values: dict[str, set[float]] = {}
        for e in EXPERIMENTS.values():
            for name in e.scenarios.values():
                for vehicle in library_scenario(f"paper:{name}").followers:
                    if vehicle.model.name == model:
                        for k, v in vehicle.model.parameters.items():
                            values.setdefault(k, set()).add(v)
        for name, parameter in law.parameters.items():
            used = ", ".join(f"{v:g}" for v in sorted(values.get(name, ())))
            source = stated.get(name, "headway's choice")
            rows.append((model, name, parameter.info.unit or "1", parameter.info.text, used, source))
    return Table(
        ("model", "parameter", "unit", "meaning", "values", "source"),
        tuple(rows),
        "Every parameter of the ready scenarios",
    )


def _open() -> Table:
    rows = tuple((a.meaning, a.unit or "–", a.source) for a in AXES.values())
    return Table(
        ("left open", "unit", "what the paper says of it"), rows, "What the paper leaves open, tried for claims"
    )


def _sets() -> Table:
    rows = []
    for model, unit, sets in (("CACC", "", GAINS), ("IDM", " m/s²", IDM_SETS)):
        for name, values in sets.items():
            words = ", ".join(f"{k} = {v:g}{unit}" for k, v in values.items())
            rows.append((f"{model}, {name}", words, _ORIGIN[name]))
    caption = "Sets of gains and parameters (kp in 1/s², kd and kv in 1/s, ka in 1)"
    return Table(("set", "values", "source"), tuple(rows), caption)


_ORIGIN = {
    "base": "headway's choice: of the size that CACC in the literature has",
    "fitted": "found by a search for gains with which the text's bounds hold; from no source",
    "advanced": "of the type of van Arem, van Driel, Visser 2006, received acceleration in full; not copied",
    "a = 1, b = 1.5": "headway's choice, common in later literature",
    "a = 0.73, b = 1.67": "Treiber, Hennecke, Helbing 2000",
}


def _provenance(names: Iterable[str]) -> dict[str, str]:
    scenarios = [library_scenario(f"paper:{name}") for name in names]
    hashes, longest = [s.hash for s in scenarios], max((s.step for s in scenarios), default=0.0)
    return {
        "headway": __version__,
        "command": "headway paper",
        "scheme": f"rk4, steps of at most {longest:g} s that end on breaking points",
        "randomness": "none",
        "scenarios": f"{len(hashes)}, SHA-256 of their hashes {hashlib.sha256(''.join(hashes).encode()).hexdigest()}",
    }


def _citations() -> tuple[str, ...]:
    laws = (BUILT_IN[model] for model in STATED)
    sources = [law.source + (f", doi:{law.doi}" if law.doi else "") for law in laws]
    return (PAPER, *dict.fromkeys(sources))


def _data(findings: dict[str, Judgement], names: Iterable[str]) -> dict[str, str]:
    data = {f"{name}.toml": library_scenario(f"paper:{name}").to_toml() for name in names}
    if findings:
        data["claims.json"] = json.dumps(_plain(tables(findings)), indent=1, ensure_ascii=False)
    return data


def _plain(value: Any) -> Any:
    """Numbers that are not finite become null, as JSON has none."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_plain(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
