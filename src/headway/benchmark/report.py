"""The benchmark as a report: outcome, rules, parameters and sources."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from headway.benchmark import figures, rules
from headway.benchmark.cells import MIXED, PUBLISHED, TUNED, Board, Cell
from headway.benchmark.measures import MEASURES
from headway.benchmark.outcome import Outcome
from headway.benchmark.scores import (
    CRITERIA,
    ROBUSTNESS,
    Criterion,
    Score,
    held,
    holds,
    lost,
    scoreboard,
    worst,
)
from headway.benchmark.spec import Entry
from headway.errors import HeadwayError
from headway.plot.trajectories import comparison
from headway.report import Block, Illustration, Report, Section, Table, Text
from headway.report.parts import slug

__all__ = ["benchmark_report"]

Row = tuple[str | float, ...]


def benchmark_report(outcome: Outcome, files: dict[str, bytes | str] | None = None) -> Report:
    """Return the report of a benchmark.

    Args:
        outcome: the outcome of the benchmark.
        files: contents by name of files that are put beside the report.
    """
    sections = [
        _scoreboard(outcome),
        _advice(outcome),
        _theory(outcome),
        _robustness(outcome),
        *_mixed(outcome),
        _fairness(outcome),
        *_courses(outcome),
        *_failed(outcome),
        rules.methods(outcome),
        rules.parameters(outcome),
    ]
    return Report(
        "Car-following models under the same disturbances and delays",
        tuple(f"- {text}" for text in outcome.findings),
        tuple(sections),
        rules.provenance(outcome),
        rules.citations(outcome.board),
        {"cells.csv": outcome.table(), **(files or {})},
    )


def _scoreboard(outcome: Outcome) -> Section:
    board = outcome.board
    cases = board.benchmark.cases
    views: dict[str, Sequence[Score]] = {case.name: scoreboard(board, PUBLISHED, [case.name]) for case in cases}
    text = Text(
        (
            f"Every entry drives behind the same {len(board.benchmark.courses)} leaders with the same delays. It is "
            "ranked within each pair of disturbance and delays, 1 is best, and the ranks are averaged; the last column "
            "is the mean over all criteria. Whoever collides or cannot be run is last in that pair.",
        )
    )
    blocks: list[Block] = [text, _ranks(outcome.scores, "Mean ranks at the published parameters, all delays")]
    picture = Illustration(
        "ranks",
        figures.ranks(views, [s.who for s in outcome.scores]),
        f"Mean ranks of {len(outcome.scores)} models in {len(CRITERIA)} criteria, a panel for each case of delays",
        "Mean ranks for each case of delays; dark is better.",
    )
    return Section("Scoreboard", (*blocks, picture, _holding(board, PUBLISHED), _worst(board, PUBLISHED)), "scoreboard")


def _ranks(scores: Sequence[Score], caption: str) -> Table:
    names = list(scores[0].ranks) if scores else []
    rows: list[Row] = [(s.who, *(round(s.ranks[n], 2) for n in names), round(s.overall, 2)) for s in scores]
    return Table(("model", *names, "mean"), tuple(rows), caption)


def _groups(board: Board, view: str) -> Iterator[tuple[str, str, list[Cell]]]:
    """Yield (entry, delays, cells) of a view."""
    for name in dict.fromkeys(c.who for c in board.select(view)):
        for case in board.benchmark.cases:
            yield name, case.name, board.select(view, case.name, name)


def _holding(board: Board, view: str) -> Table:
    """Return the table in how many disturbances each criterion holds."""
    rows: list[Row] = []
    for name, delays, cells in _groups(board, view):
        counts = [sum(bool(holds([c], criterion)) for c in cells) for criterion in CRITERIA]
        rows.append((name, delays, *map(float, counts), float(sum(c.collided for c in cells))))
    return Table(
        ("model", "delays", *(c.name for c in CRITERIA), "collides"),
        tuple(rows),
        f"In how many of {len(board.benchmark.courses)} disturbances each criterion holds",
    )


def _worst(board: Board, view: str) -> Table:
    """Return the table of the worst value of each criterion over all disturbances."""
    rows: list[Row] = []
    for name, delays, cells in _groups(board, view):
        clear = [c for c in cells if not c.reason and not c.collided]
        hardest = min((c.values["braking"] for c in clear if "braking" in c.values), default=math.nan)
        share = f"{len(clear)} of {len(cells)}"
        rows.append((name, delays, share, *(worst(cells, criterion) for criterion in CRITERIA), hardest))
    return Table(
        ("model", "delays", "over runs", *(c.short for c in CRITERIA), "least acceleration"),
        tuple(rows),
        "Worst values of the runs without a collision",
        ("", "", "", *(_unit(c.measure) for c in CRITERIA), "m/s²"),
        note="Who collides is measured on fewer and easier runs: compare only rows over as many. Bounds: "
        + "; ".join(f"{c.short} {'≥' if c.more else '≤'} {c.bound:g}" for c in CRITERIA)
        + ".",
    )


def _unit(measure: str) -> str:
    unit = MEASURES[measure].unit
    return "" if unit == "1" else unit


def _advice(outcome: Outcome) -> Section:
    wanting = [f"- {a.sentence}" for a in outcome.advice if not a.stable]
    holding = [f"- {a.sentence}" for a in outcome.advice if a.stable]
    how = (
        "Exact theory gives the value of a parameter at which string stability is won or lost at "
        f"{outcome.board.benchmark.speed:g} m/s; a platoon is then simulated behind a small sine 5 % to either side of "
        "it. Words and numbers are made by the program."
    )
    blocks: list[Block] = [Text((how,) if outcome.advice else (how, "No entry names a parameter to adjust."))]
    for heading, lines in (
        ("What is not enough, and what would be", wanting),
        ("What is enough, and how far", holding),
    ):
        if lines:
            blocks.append(Text((f"**{heading}**", *lines)))
    if outcome.trade_offs:
        blocks.append(Text(("**Trade-offs**", *outcome.trade_offs)))
    return Section("Guidance", tuple(blocks), "guidance")


def _theory(outcome: Outcome) -> Section:
    rows: list[Row] = []
    for t in outcome.theory:
        cells = outcome.board.select(PUBLISHED, t.delays, t.who)
        string = next(c for c in CRITERIA if c.measure == "growth")
        hit = sum(c.collided for c in cells)
        simulated = worst(cells, string)
        if t.locally_stable is False:
            verdict = "locally unstable"
        else:
            verdict = t.reason or ("string stable" if t.string_stable else "string unstable")
        rows.append(
            (
                t.who,
                t.delays,
                verdict,
                t.peak_gain,
                t.peak_frequency,
                t.gain,
                t.measured,
                simulated,
                f"{hit} of {len(cells)}",
                t.critical_string,
                t.critical_local,
            )
        )
    table = Table(
        (
            "model",
            "delays",
            "theory says",
            "largest gain",
            "at frequency",
            "gain at the sine",
            "simulated there",
            "worst growth simulated",
            "collides",
            "critical delay, string",
            "critical delay, local",
        ),
        tuple(rows),
        "Exact linear theory beside nonlinear simulation",
        ("", "", "", "", "rad/s", "", "", "", "", "s", "s"),
        note="Theory describes small disturbances of a long drive at one speed. What is simulated is large: a gain "
        "below 1 can turn into growth or a collision where a law is nonlinear, and transients can grow that no sine "
        "shows. Critical delays belong to the signals that are late for the entry.",
    )
    picture = Illustration(
        "gains",
        figures.gain_curves(outcome.board, outcome.theory),
        "Gain per vehicle against frequency for each model by theory, with the simulated growth at one frequency",
        "Lines: |G(iω)| by exact theory (none where a model is locally unstable). Circles: the growth simulated behind "
        "the sine, where nobody collides.",
    )
    return Section("Theory and simulation", (table, picture), "theory")


def _robustness(outcome: Outcome) -> Section:
    board = outcome.board
    if not any(c.sweep for c in board.benchmark.courses):
        return Section("Robustness to delay", (Text(("No disturbance of this benchmark is swept over delays.",)),))
    rows: list[Row] = []
    for score in outcome.scores:
        theory = next(t for t in outcome.theory if t.who == score.who)
        rows.append((score.who, *(_until(board, score.who, c) for c in CRITERIA), theory.critical_string))
    table = Table(
        ("model", *(c.name for c in CRITERIA), "string stability by theory"),
        tuple(rows),
        "The largest delay at which each criterion still holds",
        ("", *["s"] * (len(CRITERIA) + 1)),
        note="In brackets the disturbances behind which it is lost next. Delays are swept in steps, the same for "
        "everybody: of what is perceived on board, or by radio for entries that hear any. A criterion holds at a delay "
        f"if it does in all {sum(c.sweep for c in board.benchmark.courses)} swept disturbances, there and at all "
        "shorter delays.",
    )
    picture = Illustration(
        "delays",
        figures.sweeps(board),
        "Growth per vehicle and least time to collision of each model against the delay",
        "Left: dots are simulated, lines are theory. Right: the least time to collision in all swept disturbances; "
        "0 is a collision.",
    )
    return Section("Robustness to delay", (table, picture), "robustness")


def _until(board: Board, who: str, criterion: Criterion) -> str:
    """Say how far a criterion holds, and behind which leaders it is lost."""
    reached, gone = held(board, who, criterion), lost(board, who, criterion)
    if not gone:
        return f"≥ {reached:g}"
    names = ", ".join(gone) if len(gone) <= 3 else f"{gone[0]} and {len(gone) - 1} more"
    return f"{'not even 0' if math.isnan(reached) else format(reached, 'g')} ({names})"


def _mixed(outcome: Outcome) -> Iterator[Section]:
    board = outcome.board
    if not board.benchmark.platoons:
        return
    rows: list[Row] = []
    for m in outcome.mixed:
        cells = board.select(MIXED, m.delays, m.who)
        hit = sum(c.collided for c in cells)
        tail = max((c.values["head_to_tail"] for c in cells if not c.reason and not c.collided), default=math.nan)
        strict = m.reason or ("yes" if m.strict else "no")
        rows.append((m.who, m.delays, strict, m.head_to_tail_gain, tail, f"{hit} of {len(cells)}"))
    table = Table(
        (
            "platoon",
            "delays",
            "every vehicle string stable",
            "largest gain, head to tail",
            "worst simulated",
            "collides",
        ),
        tuple(rows),
        "Mixed platoons: theory and simulation",
    )
    orders = [f"- **{p.name}**: leader, {', '.join(p.order)}." for p in board.benchmark.platoons]
    blocks: list[Block] = [Text(tuple(orders)), table, _ranks(scoreboard(board, MIXED), "Mean ranks of mixed platoons")]
    yield Section("Mixed platoons", tuple(blocks), "mixed")


def _fairness(outcome: Outcome) -> Section:
    board, b = outcome.board, outcome.board.benchmark
    gaps = [t.gap for t in outcome.theory if math.isfinite(t.gap)]
    distances = f", here from {min(gaps):.3g} to {max(gaps):.3g} m," if gaps else ""
    paragraphs = [
        f"Published parameters were fitted for different purposes and keep different distances{distances} and who "
        "keeps more has an easier life. In this second view every entry is tuned to the same equilibrium gap, "
        f"{b.gap:g} m at {b.speed:g} m/s, by one common factor on the parameters that set its gap; all else stays as "
        "published.",
        *(f"- **{name}** could not be tuned: {why}" for name, why in board.untuned.items()),
    ]
    rows = tuple((name, _changes(b.entry(name), entry)) for name, entry in board.tuned.items())
    blocks: list[Block] = [
        Text(tuple(paragraphs)),
        Table(("model", "changed"), rows, "What tuning changed", sortable=False),
    ]
    scores = scoreboard(board, TUNED)
    if scores:
        blocks.append(_ranks(scores, "Mean ranks at the same gap and speed, all delays"))
        blocks += [_holding(board, TUNED), _worst(board, TUNED)]
        orders = [", ".join(s.who for s in group) for group in (_without_robustness(outcome), scores)]
        same = (
            "the order of the entries stays the same"
            if orders[0] == orders[1]
            else (f"the order of the entries changes from {orders[0]} to {orders[1]}")
        )
        blocks.insert(1, Text((f"Over the criteria that both views share {same}.",)))
    return Section("Fairness: the same gap for everybody", tuple(blocks), "fairness")


def _without_robustness(outcome: Outcome) -> list[Score]:
    bare = [Score(s.who, {n: r for n, r in s.ranks.items() if n != ROBUSTNESS}) for s in outcome.scores]
    return sorted(bare, key=lambda s: (math.isnan(s.overall), s.overall))


def _changes(before: Entry, after: Entry) -> str:
    now = after.model.parameters
    changed = [f"{n} {v:.4g} → {now[n]:.4g}" for n, v in before.model.parameters.items() if now[n] != v]
    if before.start_gap != after.start_gap:
        changed.append(f"gap at the start {before.start_gap:g} → {after.start_gap:g} m")
    return ", ".join(changed) or "nothing: it has this gap already"


def _courses(outcome: Outcome) -> Iterator[Section]:
    board = outcome.board
    drawn = board.benchmark.cases[-1].name
    leaders = Illustration(
        "leaders",
        figures.disturbances(board),
        "The leader's speed over time in each disturbance",
        "What every platoon has to follow.",
    )
    text = Text(
        (
            "A part for each disturbance follows, with what was measured of every entry in every case of delays, and "
            f"how cars drive with delays: {drawn}.",
        )
    )
    yield Section("Disturbances", (text, leaders), "disturbances")
    for course in board.benchmark.courses:
        cells = [c for c in board.cells if c.course == course.name and c.view == PUBLISHED]
        cases = [case.name for case in board.benchmark.cases]
        blocks: list[Block] = [_measures([c for c in cells if c.delays in cases], course.name)]
        runs = {
            e.name: board.drawn[course.name, e.name]
            for e in board.benchmark.entries
            if (course.name, e.name) in board.drawn
        }
        if runs:
            try:
                figure = comparison(runs)
            except HeadwayError as error:
                blocks.append(Text((f"Nothing can be drawn: {error}.",)))
            else:
                blocks.append(
                    Illustration(
                        f"course-{slug(course.name)}",
                        figure,
                        f"Spacing errors and speeds over time of {', '.join(runs)} behind the leader {course.name}",
                        f"Behind the leader “{course.name}”, delays: {drawn}.",
                    )
                )
        yield Section(f"Leader: {course.name}", tuple(blocks), f"behind-{slug(course.name)}", collapsed=True)


def _measures(cells: Sequence[Cell], course: str) -> Table:
    shown = [n for n in MEASURES if any(math.isfinite(c.values.get(n, math.nan)) for c in cells)]
    rows: list[Row] = [(c.who, c.delays, *(c.values.get(n, math.nan) for n in shown)) for c in cells]
    heads = tuple(n.replace("_", " ") for n in shown)
    units = ("", "", *(_unit(n) for n in shown))
    return Table(("model", "delays", *heads), tuple(rows), f"What was measured behind the leader {course}", units)


def _failed(outcome: Outcome) -> Iterator[Section]:
    places: dict[tuple[str, str, str], list[Cell]] = {}
    for cell in outcome.board.failed:
        places.setdefault((cell.who, cell.view, cell.reason), []).append(cell)
    if places:
        rows = tuple(
            (who, view, ", ".join(dict.fromkeys(c.course for c in cells)), float(len(cells)), reason)
            for (who, view, reason), cells in places.items()
        )
        table = Table(("model", "view", "disturbances", "cells", "reason"), rows, "Cells that could not be run")
        yield Section("What could not be run", (table,), "failed")
