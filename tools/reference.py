"""Pages of the documentation that are made of the program itself, so that they cannot differ from it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from types import ModuleType
from typing import Any

import headway
from headway.cli import app
from headway.models.registry import BUILT_IN
from headway.scenario.document import schema

__all__ = ["PAGES"]

#: room of the package → its heading in the page of Python names
_ROOMS = {
    "models": "Laws",
    "maths": "Laws",
    "scenario": "Scenarios and leaders",
    "library": "Ready scenarios",
    "engine": "Simulation",
    "results": "Results",
    "theory": "Theory",
    "metrics": "Metrics",
    "study": "Studies",
    "calibration": "Calibration",
    "data": "Real data",
    "plot": "Figures",
    "explorer": "The explorer",
    "conformance": "Laws",
    "errors": "Errors",
}


#: heading of a room → what it also has to say
_NOTES = {"Scenarios and leaders": "Their fields, with units and bounds: [scenario files, every field](schema.md)."}

#: heading of a room → classes that are got as results rather than by name
_RESULTS = {
    "Theory": (
        "headway.theory.linear.Linear",
        "headway.theory.platoon.Chain",
        "headway.theory.margins.Margins",
        "headway.theory.propagation.Propagation",
    ),
}


def laws() -> str:
    """Every built-in law, from its signature and annotations."""
    parts = ["# Laws", "The same as `headway models NAME`. In Python: `headway.models.IDM(T=1.2)`."]
    for law in BUILT_IN.values():
        parameters = [
            (f"`{name}`", f"{p.default:g}", p.info.unit, p.range, p.info.text) for name, p in law.parameters.items()
        ]
        parts += [
            f"## {law.title}",
            f"`{law.name}`, perceives {', '.join(f'`{s}`' for s in law.signals)}",
            f"    acceleration = {law.formula}" if law.formula else "",
            _table(("parameter", "default", "unit", "allowed", "meaning"), parameters),
            f"{law.source}, doi:{law.doi}" if law.doi else law.source,
        ]
    return "\n\n".join(parts)


def scenario_files() -> str:
    """Every field of a scenario file, from the JSON schema that `headway schema` prints."""
    found = schema()
    top = found["properties"]
    followers = top["followers"]["items"]
    parts = [
        "# Scenario files, every field",
        "The JSON schema of `headway schema` as tables. [Scenario files](../scenario.md) has an example.",
        "## Top level",
        _fields({k: v for k, v in top.items() if k not in ("leader", "followers")}, ()),
        "## Followers",
        "One `[[followers]]` table for each kind of vehicle in a row.",
        _fields(followers["properties"], followers["required"]),
        "## Leaders",
        "The `[leader]` table; its `kind` decides which other keys it has.",
    ]
    for leader in top["leader"]["oneOf"]:
        fields = {k: v for k, v in leader["properties"].items() if k != "kind"}
        parts += [
            f"### {leader['properties']['kind']['const']}",
            leader["description"],
            _fields(fields, leader["required"]),
        ]
    return "\n\n".join(parts)


def _fields(properties: dict[str, Any], required: Iterable[str]) -> str:
    rows = []
    for name, field in properties.items():
        default = "required" if name in required else _value(field.get("default"))
        text = field.get("description", "")
        unit = _UNIT.search(text)
        symbol, text = (unit[1], text[: unit.start()]) if unit else ("", text)
        rows.append((f"`{name}`", symbol, default, _allowed(field), text))
    return _table(("key", "unit", "default", "allowed", "meaning"), rows)


def _value(default: object) -> str:
    return "" if default in (None, "", [], ()) else f"`{default}`"


def _allowed(field: dict[str, Any]) -> str:
    """What a field of a JSON schema may be, in words."""
    if "anyOf" in field:
        return ", or ".join(dict.fromkeys(_allowed(part) for part in field["anyOf"] if part.get("type") != "null"))
    if "enum" in field:
        return ", ".join(f"`{value}`" for value in field["enum"])
    words = {"minimum": "at least", "exclusiveMinimum": "above", "maximum": "at most", "exclusiveMaximum": "below"}
    bounds = [f"{word} {field[key]:g}" for key, word in words.items() if key in field]
    kind = {"string": "text", "integer": "whole number", "array": "list", "object": "table"}
    return " ".join([kind.get(field.get("type", ""), field.get("type", "")), *bounds])


def command_line() -> str:
    """Every command with its options, from the command line itself."""
    _, _, commands = app.generate_docs(heading_level=1).partition("**Commands**:")
    return f"# Command line\n\n```console\nheadway COMMAND --help\n```\n{commands}"


def python() -> str:
    """Every public name, by room; the text is taken from the docstrings when the site is built."""
    rooms: dict[str, list[str]] = {title: [] for title in _ROOMS.values()}
    for name, (module, attribute) in headway._PUBLIC.items():
        title = _ROOMS[module.split(".")[1]]
        if attribute is None:
            rooms[title].append(_module(name, getattr(headway, name)))
        else:
            heading = f"headway.{name}"
            rooms[title].append(f"::: {module}.{attribute}\n    options:\n      heading: {heading}")
    parts = ["# Python", "Everything that `import headway as hw` gives. SI units everywhere."]
    for title, entries in rooms.items():
        results = [f"::: {path}" for path in _RESULTS.get(title, ())]
        parts += [f"## {title}", _NOTES.get(title, ""), *entries, *results]
    return "\n\n".join(parts)


def _module(name: str, module: ModuleType) -> str:
    """A module with the members that are public nowhere else; laws have a page of their own."""
    elsewhere = {attribute for place, attribute in headway._PUBLIC.values() if place.startswith(module.__name__)}
    own = [m for m in module.__all__ if m not in elsewhere and not isinstance(getattr(module, m), headway.Law)]
    members = "".join(f"\n        - {member}" for member in own)
    return f"::: {module.__name__}\n    options:\n      heading: headway.{name}\n      members:{members}"


def _table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


#: the unit at the end of what a field of the schema says of itself
_UNIT = re.compile(r" \[([^\[\]]+)\]$")

#: page of the site → what writes it
PAGES = {
    "reference/laws.md": laws,
    "reference/schema.md": scenario_files,
    "reference/command-line.md": command_line,
    "reference/python.md": python,
}
