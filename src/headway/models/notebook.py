"""How laws and models show themselves in a notebook."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from headway.html import block, paragraph, table
from headway.models.signal import SIGNALS

if TYPE_CHECKING:
    from headway.models.law import Law, Model

__all__ = ["law_html", "model_html"]


def law_html(law: Law) -> str:
    """Formula, parameters with defaults, signals and source of a law."""
    return _html(law, f"{law.title} ({law.name})", "default", {n: p.default for n, p in law.parameters.items()})


def model_html(model: Model) -> str:
    """Formula, parameters with their values, signals and source of a model."""
    return _html(model.law, f"{model.law.title} ({model.name})", "value", model.parameters)


def _html(law: Law, caption: str, kind: str, values: Mapping[str, float]) -> str:
    signals = [SIGNALS[name] for name in law.signals]
    parameters = [(name, values[name], p.info.unit, p.range, p.info.text) for name, p in law.parameters.items()]
    return block(
        table(caption, ("parameter", kind, "unit", "allowed", "meaning"), parameters),
        table("It perceives", ("signal", "unit", "meaning"), [(s.name, s.unit, s.text) for s in signals]),
        paragraph(f"acceleration = {law.formula}" if law.formula else ""),
        paragraph(law.source + (f", doi:{law.doi}" if law.doi else "")),
    )
