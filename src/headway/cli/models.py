"""`headway models` and `headway check`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from headway.cli import show
from headway.cli.options import Json, ModelFile, laws_of

if TYPE_CHECKING:
    from headway.models.law import Law

__all__ = ["check", "models"]


def models(
    name: Annotated[str | None, Parameter(help="Only this one.")] = None,
    *,
    model: ModelFile = None,
    json: Json = False,
) -> None:
    """List the car-following laws: formula, signals, parameters with unit and bounds, source."""
    from headway.models.registry import find, with_own

    own = laws_of(model)
    laws = [find(name, own)] if name else list(with_own(own).values())
    if json:
        show.print_json([_as_json(law) for law in laws])
        return
    for law in laws:
        _print(law)


def _print(law: Law) -> None:
    print(f"{law.name}: {law.title}")
    if law.formula:
        print(f"  a = {law.formula}")
    print(f"  signals: {', '.join(law.signals)}")
    for p in law.parameters.values():
        unit = f" {p.info.unit}" if p.info.unit not in ("", "1") else ""
        print(f"  {p.name:>6} = {f'{p.default:g}{unit}':<16} {f'[{p.range}]':<16} {p.info.text}".rstrip())
    if law.source:
        print(f"  {law.source}" + (f", doi:{law.doi}" if law.doi else ""))
    print()


def _as_json(law: Law) -> dict[str, Any]:
    return {
        "name": law.name,
        "title": law.title,
        "formula": law.formula,
        "signals": list(law.signals),
        "parameters": {
            p.name: {
                "default": p.default,
                "unit": p.info.unit,
                "low": p.info.low,
                "high": p.info.high,
                "text": p.info.text,
                "structural": p.info.structural,
            }
            for p in law.parameters.values()
        },
        "source": law.source,
        "doi": law.doi,
    }


def check(
    file: Annotated[str, Parameter(help="A Python file of laws, my.py or my.py:soft; this runs the file.")],
    *,
    json: Json = False,
) -> int:
    """Check laws of your own against what every law must be, and explain each failure. Exit code 1 if one fails."""
    from headway.conformance import Check, check_model
    from headway.models.own import laws_and_faults

    laws, faults = laws_and_faults(file, allow_wrong_sign=True)
    # a function that is no law does not keep the others from being checked
    reports: dict[str, tuple[Check, ...]] = {
        name: (Check("is a law", False, str(fault)),) for name, fault in faults.items()
    }
    with show.working("checking (this compiles the law)"):
        reports |= {law.name: check_model(law) for law in laws}
    if json:
        show.print_json({name: [vars(c) for c in checks] for name, checks in reports.items()})
    else:
        for name, checks in reports.items():
            print(f"{name}:")
            for c in checks:
                mark = "ok  " if c.passed else ("FAIL" if c.required else "note")
                show.say(c.name + ("" if c.passed else f": {c.message}"), f"  {show.coloured(mark, c.passed)}  ", 8)
    failed = any(not c.passed and c.required for checks in reports.values() for c in checks)
    return 1 if failed else 0
