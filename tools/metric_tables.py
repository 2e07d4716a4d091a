"""The tables of docs/metrics.md, made of the registry: `python tools/metric_tables.py` writes them anew."""

from __future__ import annotations

import re
from pathlib import Path

from headway.metrics import METRICS

__all__ = ["PAGE", "written"]

PAGE = Path(__file__).parents[1] / "docs" / "metrics.md"

_HEADS = ("function", "formula", "unit", "threshold", "source", "says")
_MARK = re.compile(r"(<!-- metrics: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def _table(family: str) -> str:
    """The metrics of a family, one row each; columns in which all is empty are left out."""
    rows = [
        (f"`{m.name}`", m.formula, m.unit if m.unit != "1" else "1", m.threshold, m.source, m.says)
        for m in METRICS.values()
        if m.family == family
    ]
    kept = [i for i, _ in enumerate(_HEADS) if any(row[i] not in ("", "–") for row in rows)]
    lines = [
        [_HEADS[i] for i in kept],
        ["---"] * len(kept),
        *([row[i].replace("|", "\\|") for i in kept] for row in rows),
    ]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def written(page: str) -> str:
    """The page with its tables as the registry has them."""
    return _MARK.sub(lambda found: f"{found[1]}{_table(found[2])}{found[3]}", page)


if __name__ == "__main__":
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
