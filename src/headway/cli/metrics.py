"""`headway metrics`: what can be measured of a run, from the registry."""

from __future__ import annotations

from headway.cli import show
from headway.cli.options import Json

__all__ = ["metrics"]


def metrics(*, json: Json = False) -> None:
    """List the metrics that `run --metrics` and `study --metrics` take: name, unit and meaning."""
    from headway.metrics import METRICS

    rows = [(m.name, m.unit, m.long_name, m.per) for m in METRICS.values() if m.per in ("vehicle", "run")]
    if json:
        show.print_json([dict(zip(("name", "unit", "meaning", "per"), row, strict=True)) for row in rows])
    else:
        show.print_table("", ("name", "unit", "meaning", "one for each"), rows, left=4)
