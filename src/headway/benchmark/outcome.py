"""The outcome of a benchmark in one piece, for reports, tables and programs."""

from __future__ import annotations

import csv
import hashlib
import io
from dataclasses import dataclass, fields
from typing import Any

from headway.benchmark.cells import PUBLISHED, Board, Progress, run_board
from headway.benchmark.guidance import Advice, advise, findings, trade_offs
from headway.benchmark.measures import MEASURES
from headway.benchmark.scores import CRITERIA, Score, held, scoreboard
from headway.benchmark.spec import Benchmark
from headway.benchmark.theory import Mixed, Theory, of_entries, of_platoons

__all__ = ["Outcome", "run_benchmark"]


@dataclass(frozen=True)
class Outcome:
    """The outcome of a benchmark.

    Attributes:
        board: all cells.
        scores: mean ranks at the published parameters, best first.
        theory: of every entry in every case of delays.
        mixed: theory of every mixed platoon in every case of delays.
        advice: for every entry, delay and parameter that it names.
        findings: what matters most, a sentence each.
        trade_offs: where being better at one thing goes with being worse at another, a sentence each.
    """

    board: Board
    scores: tuple[Score, ...]
    theory: tuple[Theory, ...]
    mixed: tuple[Mixed, ...]
    advice: tuple[Advice, ...]
    findings: tuple[str, ...]
    trade_offs: tuple[str, ...]

    @property
    def digest(self) -> str:
        """SHA-256 over the hashes of all scenarios, in order: two boards with the same one ran the same."""
        return hashlib.sha256("\n".join(c.scenario_hash for c in self.board.cells).encode()).hexdigest()

    def held(self) -> dict[str, dict[str, float]]:
        """Return by entry and criterion the largest delay [s] of the sweep at which it holds; NaN if at none."""
        return {s.who: {c.name: held(self.board, s.who, c) for c in CRITERIA} for s in self.scores}

    def table(self) -> str:
        """Return all cells as CSV, one row each, with all digits."""
        names = [f.name for f in fields(self.board.cells[0]) if f.name not in ("values", "reason")]
        heads = [f"{n} [s]" if n in ("onboard", "radio") else n for n in names]
        heads += [f"{n} [{m.unit}]" if m.unit != "1" else n for n, m in MEASURES.items()]
        text = io.StringIO()
        sheet = csv.writer(text, lineterminator="\n")
        sheet.writerow([*heads, "reason"])
        for cell in self.board.cells:
            row = [getattr(cell, n) for n in names]
            sheet.writerow([*row, *(cell.values.get(n, "") for n in MEASURES), cell.reason])
        return text.getvalue()

    def as_json(self) -> dict[str, Any]:
        """Return scores, theory, advice and findings as plain tables for JSON; what does not exist is null or NaN."""
        reached = self.held()
        return {
            "scores": [
                {"model": s.who, "overall": s.overall, "ranks": s.ranks, "holds_to_delay": reached[s.who]}
                for s in self.scores
            ],
            "theory": [{f.name: getattr(t, f.name) for f in fields(t)} for t in self.theory],
            "advice": [
                {
                    "model": a.who, "delay": a.delay, "parameter": a.parameter, "critical": a.critical,
                    "confirmed": a.confirmed, "text": a.sentence,
                }
                for a in self.advice
            ],
            "findings": list(self.findings),
            "cells": len(self.board.cells),
            "failed": [{"model": c.who, "disturbance": c.course, "reason": c.reason} for c in self.board.failed],
            "digest": self.digest,
        }  # fmt: skip


def run_benchmark(benchmark: Benchmark, progress: Progress | None = None) -> Outcome:
    """Run a benchmark and draw all conclusions.

    Args:
        benchmark: what to run, see `headway.benchmark.spec.load_benchmark`.
        progress: called with the number of cells that are done and the number of all.
    """
    board = run_board(benchmark, progress)
    theory = of_entries(board)
    advice = advise(board)
    scores = scoreboard(board, PUBLISHED)
    return Outcome(
        board, scores, theory, of_platoons(board), advice, findings(board, theory, advice),
        trade_offs(board, scores, theory),
    )  # fmt: skip
