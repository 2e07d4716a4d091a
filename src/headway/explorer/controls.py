"""What a page needs to know to make its controls: laws, leaders and vehicles, from their own annotations."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from headway.models import RADIO, SIGNALS, Law, Parameter
from headway.models.registry import with_own
from headway.scenario.document import schema
from headway.scenario.leaders import KINDS

__all__ = ["controls", "map_axes", "slider"]

#: fields of a vehicle and of the run: value to begin with, and the range of a slider (annotations bound them on one
#: side only); those of leaders stand with the leaders, as `usual`
_VEHICLE = {"lag": (0.0, 0.0, 2.0), "length": (5.0, 0.0, 30.0)}
_RUN = {"duration": (60.0, 5.0, 600.0), "gaps": (30.0, 1.0, 100.0), "seed": (0, 0.0, 100.0)}
_DELAY = (0.0, 2.0)

#: sliders that go in steps: an actuator much faster than the engine's steps cannot be integrated
_STEPS = {"lag": {"step": 0.01}}

#: a slider spreads the values around its usual one: there it stands at this share of its way
_USUAL = 0.4


def slider(low: float, high: float, usual: float) -> dict[str, float | str]:
    """How far (0 to 1) a slider stands for values from low to high: by logarithm, or by a power.

    Args:
        low: Least value; bounds that are not finite are taken around the usual value.
        high: Largest value.
        usual: A value that has to lie within easy reach, however wide the bounds are.

    Returns:
        `low`, `high`, `scale` ("log" or "power") and the exponent `p` of value = low + (high - low) way^p.
    """
    size = 10.0 * max(abs(usual), 1.0)
    low = low if math.isfinite(low) else min(-size if usual < 0 else 0.0, usual)
    high = high if math.isfinite(high) else max(size, low + size)
    if low > 0 and high > 1e5 * low:
        return {"low": low, "high": high, "scale": "log", "p": 1.0}
    share = (usual - low) / (high - low)
    power = math.log(share) / math.log(_USUAL) if 0 < share < _USUAL else (3.0 if share <= 0 < high / 5 else 1.0)
    return {"low": low, "high": high, "scale": "power", "p": round(min(max(power, 1.0), 6.0), 3)}


def controls(laws: Iterable[Law] = ()) -> dict[str, Any]:
    """Models, leaders, fields of a vehicle and of a run, with units, bounds, words and ranges of sliders."""
    form = schema()
    vehicle, run = form["properties"]["followers"]["items"]["properties"], form["properties"]
    return {
        "models": {name: _law(law) for name, law in with_own(laws).items()},
        "kinds": {part["properties"]["kind"]["const"]: _kind(part) for part in form["properties"]["leader"]["oneOf"]},
        "signals": {s.name: {"unit": s.unit, "text": s.text, "radio": s.radio} for s in SIGNALS.values()},
        "vehicle": [_field(n, vehicle[n], False, _VEHICLE) for n in _VEHICLE],
        "run": [_field(n, run[n], False, _RUN) for n in _RUN],
        "delay": {"unit": "s", "slider": slider(*_DELAY, 0.3), "text": "delay of all on-board signals"},
    }


def _law(law: Law) -> dict[str, Any]:
    return {
        "title": law.title,
        "formula": law.formula,
        "source": law.source,
        "signals": list(law.signals),
        "parameters": [_parameter(p) for p in law.parameters.values()],
        "axes": {name: list(limits) for name, limits in _axes(law).items()},
        "map": map_axes(law),
        "rests": law().rests_everywhere,
    }


def _parameter(p: Parameter) -> dict[str, Any]:
    low, high = (x if math.isfinite(x) else None for x in (p.info.low, p.info.high))
    return {
        "name": p.name,
        "unit": p.info.unit if p.info.unit != "1" else "",
        "text": p.info.text,
        "start": p.default,
        "low": low,
        "high": high,
        "type": "number",
        "whole": p.info.structural,
        "slider": slider(p.info.low, p.info.high, p.default),
    }


def _axes(law: Law) -> dict[str, tuple[float, float]]:
    """Names a map of this law can have as axes, and the range each begins with."""
    axes: dict[str, tuple[float, float]] = {}
    for p in law.parameters.values():
        if not p.info.structural:
            usual = abs(p.default) or 1.0
            low, high = max(p.info.low, 0.2 * usual), min(p.info.high, 2.5 * usual)
            axes[p.name] = (float(f"{low:.3g}"), float(f"{high:.3g}"))
    axes |= dict.fromkeys(_delays(law), (0.0, 1.5))
    axes |= {f"delay.{signal}": (0.0, 1.5) for signal in law.signals}
    return axes | {"lag": (0.0, 1.0), "speed": (2.0, 32.0)}


def _delays(law: Law) -> list[str]:
    """Axes that make many signals late alike: those measured on board, those heard by radio."""
    on_board, radio = set(law.signals) - RADIO, set(law.signals) & RADIO
    return ["delay"] * bool(on_board) + ["radio_delay"] * bool(radio)


def map_axes(law: Law) -> list[list[Any]]:
    """The axes that a map of this law begins with: its time gap or its first parameter, and the delay.

    The delay is that of the radio where the law hears any, as in the comparative study.
    """
    axes = _axes(law)
    first = next((p.name for p in law.parameters.values() if p.name in axes and p.info.unit == "s"), next(iter(axes)))
    second = _delays(law)[-1]
    return [[first, *axes[first]], [second, *axes[second]]]


def _kind(part: Mapping[str, Any]) -> dict[str, Any]:
    required = part.get("required", ())
    fields = [_field(n, p, n in required, {}) for n, p in part["properties"].items() if n != "kind"]
    random = KINDS[part["properties"]["kind"]["const"]].random
    return {"text": part["description"], "fields": fields, "random": random}


def _field(
    name: str, part: Mapping[str, Any], required: bool, own: Mapping[str, tuple[Any, float, float]]
) -> dict[str, Any]:
    """One field from its JSON schema."""
    forms = [part, *part.get("anyOf", ())]
    types = {f.get("type") for f in forms}
    start, low, high = own.get(name) or next((f["usual"] for f in forms if "usual" in f), (None, 0.0, 1.0))
    unit = next((f["unit"] for f in forms if f.get("unit")), "")
    field: dict[str, Any] = {
        "name": name,
        "unit": unit,
        "text": part.get("description", "").removesuffix(f" [{unit}]"),
        "required": required,
        "default": part.get("default"),
        "start": start if required or part.get("default") is None else part["default"],
    }
    choices = next((f["enum"] for f in forms if "enum" in f), None)
    if choices is not None:
        return {**field, "type": "choice", "choices": choices}
    if types & {"number", "integer"}:
        usual = field["start"] if isinstance(field["start"], int | float) else 0.5 * (low + high)
        spread = slider(low, high, usual) | _STEPS.get(name, {})
        return {**field, "type": "number", "whole": "integer" in types, "slider": spread}
    return {**field, "type": "numbers" if "array" in types else "text"}
