"""How laws and models show themselves in a notebook."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from headway.html import block, paragraph, table

if TYPE_CHECKING:
    from headway.models.law import Law, Model

__all__ = ["law_html", "model_html"]

Signals = Mapping[str, tuple[str, str]]


def law_html(law: Law, signals: Signals) -> str:
    """Formula, parameters with defaults, signals (name → unit, meaning) and source of a law."""
    return _html(
        law, signals, f"{law.title} ({law.name})", "default", {n: p.default for n, p in law.parameters.items()}
    )


def model_html(model: Model, signals: Signals) -> str:
    """Formula, parameters with their values, signals and source of a model."""
    return _html(model.law, signals, f"{model.law.title} ({model.name})", "value", model.parameters)


def _html(law: Law, signals: Signals, caption: str, kind: str, values: Mapping[str, float]) -> str:
    parameters = [(name, values[name], p.info.unit, p.range, p.info.text) for name, p in law.parameters.items()]
    return block(
        table(caption, ("parameter", kind, "unit", "allowed", "meaning"), parameters),
        table("It perceives", ("signal", "unit", "meaning"), [(name, *signals[name]) for name in law.signals]),
        paragraph(f"acceleration = {law.formula}" if law.formula else ""),
        paragraph(law.source + (f", doi:{law.doi}" if law.doi else "")),
    )
