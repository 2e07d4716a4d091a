"""How a described thing is declared and checked: pydantic dataclasses whose errors are one sentence each."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import math
from collections.abc import Mapping
from typing import Annotated, Any, TypeVar, dataclass_transform

import numpy as np
from pydantic import BeforeValidator, ConfigDict, Field, ValidationError
from pydantic.dataclasses import dataclass as pydantic_dataclass

from headway.checked import SMALLEST, too_large
from headway.errors import HeadwayError, shorten, unknown_name

__all__ = [
    "Described",
    "Finite",
    "Negative",
    "NonNegative",
    "Numbers",
    "Positive",
    "build",
    "described",
    "field_names",
    "spec",
    "unit",
]

T = TypeVar("T")


def _number(value: Any) -> Any:
    """Accept what is a real number (also NumPy's); refuse what pydantic would convert or cannot name."""
    if isinstance(value, bool | np.bool_ | str | bytes | complex | np.complexfloating):
        raise ValueError("is not a number")
    if isinstance(value, int | float | np.number) or (isinstance(value, np.ndarray) and value.ndim == 0):
        try:
            number = float(value)
            return value if type(value) is int else number  # a sentence names -1 as it was given, not -1.0
        except (OverflowError, TypeError, ValueError):
            raise ValueError("is not a number that a computer can hold") from None
    return value


def _positive(value: Any) -> Any:
    number = _number(value)
    if isinstance(number, float) and 0.0 < number < SMALLEST:
        raise ValueError(f"is too small; allowed is {SMALLEST:g} or more")
    return number


def _numbers(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        value = value.tolist()
    return tuple(_number(v) for v in value) if isinstance(value, list | tuple) else value


# the bounds stand before the validator, so that the JSON schema tells them
Finite = Annotated[float, Field(allow_inf_nan=False), BeforeValidator(_number)]
Positive = Annotated[float, Field(allow_inf_nan=False, gt=0), BeforeValidator(_positive)]
Negative = Annotated[float, Field(allow_inf_nan=False, lt=0), BeforeValidator(_number)]
NonNegative = Annotated[float, Field(allow_inf_nan=False, ge=0), BeforeValidator(_number)]
Numbers = Annotated[tuple[Finite, ...], BeforeValidator(_numbers)]


def unit(symbol: str, description: str, **more: Any) -> Any:
    """Metadata of a field: its unit and meaning, as the schema and the docs show them.

    Args:
        symbol: unit, "" for none.
        description: meaning in a few words.
        **more: further keys of the JSON schema: `usual` = [value to begin with, low, high] is where a slider
            of the explorer stands and how far it goes; `enum` = the names that are allowed.
    """
    text = f"{description} [{symbol}]" if symbol else description
    return Field(description=text, json_schema_extra={"unit": symbol, **more})


@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field,))
def spec(cls: type[T]) -> type[T]:
    """Make `cls` a frozen, validated dataclass that raises `HeadwayError` with one sentence."""
    settings = ConfigDict(extra="forbid", arbitrary_types_allowed=True)
    made: Any = pydantic_dataclass(frozen=True, config=settings)(cls)
    plain = made.__init__

    names = field_names(made)

    @functools.wraps(plain)
    def checked(self: Any, *args: Any, **kwargs: Any) -> None:
        place = getattr(made, "kind", made.__name__)
        _bounded(made, {**dict(zip(names, args, strict=False)), **kwargs}, place)
        try:
            plain(self, *args, **kwargs)
        except ValidationError as error:
            raise _sentence(error, made, place) from None

    made.__init__ = checked
    made.__signature__ = checked.__signature__ = _signature(made)  # type: ignore[attr-defined]  # read by inspect
    return made


class Described(type):
    """Class of described things: `dir` and `help` show their fields, and nothing of how they are checked."""

    def __dir__(cls) -> list[str]:
        hidden = ("pydantic", "dataclass_", "__match_args__", "__signature__", "__replace__")
        return [n for n in super().__dir__() if not any(word in n for word in hidden)]


def _signature(cls: type) -> inspect.Signature:
    """How a described thing is made: its fields and their defaults."""
    kind, empty = inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.empty
    defaults = {f.name: empty if f.default is dataclasses.MISSING else f.default for f in dataclasses.fields(cls)}
    return inspect.Signature([inspect.Parameter(n, kind, default=d) for n, d in defaults.items()])


def _bounded(cls: Any, values: Mapping[str, Any], place: str) -> None:
    """Refuse numbers that are too large to mean anything in the unit of their field."""
    for name, value in values.items():
        field = cls.__pydantic_fields__.get(name)
        if field is not None and not isinstance(value, str | bool | None.__class__):
            _size(value, f"{place}.{name}", str((field.json_schema_extra or {}).get("unit", "")))


#: fields are numbers, lists of numbers, or tables of pairs; what is nested deeper is refused for its kind
_DEPTH = 4


def _size(value: Any, place: str, symbol: str, depth: int = 0) -> None:
    if isinstance(value, Mapping):
        for key, entry in value.items():
            _size(entry, f"{place}.{shorten(key)}", symbol, depth + 1)
    elif isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim > 0):
        if depth < _DEPTH and not _all_within(value, symbol):
            for i, entry in enumerate(value):
                _size(entry, f"{place}.{i}", symbol, depth + 1)
    elif isinstance(value, int | float | np.number) and not isinstance(value, bool | np.complexfloating):
        if isinstance(value, int) and abs(value) >= 2**63:
            raise HeadwayError(f"{place} = {shorten(value)} is too large; whole numbers are below 2^63")
        if isinstance(value, int) and not symbol:
            return  # a seed or a number of a vehicle, no quantity
        # what is not finite is named by the field's own check
        if math.isfinite(value) and (sentence := too_large(float(value), place, symbol)):
            raise HeadwayError(sentence)


def _all_within(values: Any, symbol: str) -> bool:
    """Whether a list is made of numbers of a good size; looked at as one array, for lists may be long."""
    try:
        sizes = np.abs(np.asarray(values, dtype=float))
    except (TypeError, ValueError, OverflowError):
        return False
    return too_large(float(sizes.max(where=np.isfinite(sizes), initial=0.0)), "", symbol) is None


def field_names(cls: type) -> tuple[str, ...]:
    """Names of the fields of a described thing, in order."""
    return tuple(f.name for f in dataclasses.fields(cls))


def described(thing: Any, every: bool = False) -> list[tuple[str, Any, str, str]]:
    """(name, value, unit, meaning) of each field that differs from its default, or of `every` one."""
    rows = []
    for name, field in type(thing).__pydantic_fields__.items():
        value, extra = getattr(thing, name), field.json_schema_extra or {}
        if every or value != field.default:
            symbol = str(extra.get("unit", ""))
            rows.append((name, value, symbol, (field.description or "").removesuffix(f" [{symbol}]")))
    return rows


def build(cls: type[T], table: Mapping[str, Any], place: str) -> T:
    """Make a `cls` of a table read from a file; errors name `place`."""
    if not isinstance(table, Mapping):
        raise HeadwayError(f"{place} = {shorten(table)} is not a table; allowed keys are {', '.join(field_names(cls))}")
    _bounded(cls, table, place)
    for key in table:
        if key not in field_names(cls):
            raise unknown_name(f"key in {place}", key, field_names(cls))
    try:
        return cls.__pydantic_validator__.validate_python(dict(table))  # type: ignore[attr-defined]  # `spec` put it there
    except ValidationError as error:
        raise _sentence(error, cls, place) from None


_WORDS = {
    "greater_than": "is not greater than {gt:g}",
    "greater_than_equal": "is less than {ge:g}",
    "less_than": "is not less than {lt:g}",
    "less_than_equal": "is greater than {le:g}",
    "finite_number": "is not a finite number",
    "float_type": "is not a number",
    "float_parsing": "is not a number",
    "int_type": "is not a whole number",
    "int_parsing": "is not a whole number",
    "int_from_float": "is not a whole number",
    "tuple_type": "is not a list of numbers",
    "dict_type": "is not a table",
    "string_type": "is not text",
}


def _sentence(error: ValidationError, cls: type, place: str) -> HeadwayError:
    """The first finding of a pydantic error as one sentence of ours."""
    first = error.errors(include_url=False)[0]
    kind, ctx, given = first["type"], first.get("ctx", {}), first["input"]
    location = ".".join(str(p) for p in first["loc"] if not str(p).startswith(("function-", "float", "tuple", "dict")))
    where = f"{place}.{location}" if location else place
    if isinstance(ctx.get("error"), HeadwayError):
        # a sentence of ours: it names its field, and a place in a file goes in front
        text = str(ctx["error"])
        return HeadwayError(f"{place}: {text}" if "." in place and not text.startswith(place) else text)
    if kind in ("missing", "missing_argument"):
        return HeadwayError(f"{where} is missing; {place} needs {', '.join(_required(cls))}")
    if kind in ("unexpected_keyword_argument", "extra_forbidden"):
        return unknown_name(f"argument of {place}", first["loc"][-1], field_names(cls))
    if kind == "unexpected_positional_argument":
        return HeadwayError(f"{place} takes at most {len(field_names(cls))} values: {', '.join(field_names(cls))}")
    if kind == "literal_error":
        allowed = [a.strip("' ") for a in str(ctx["expected"]).replace(" or ", ", ").split(",")]
        return unknown_name(where, given, allowed)
    if kind == "value_error":
        return HeadwayError(f"{where} = {shorten(given)} {ctx['error']}")
    if isinstance(given, float) and not math.isfinite(given):
        return HeadwayError(f"{where} = {given} is not a finite number")
    words = _WORDS.get(kind)
    text = words.format(**ctx) if words else f"is not allowed ({first['msg'].lower()})"
    return HeadwayError(f"{where} = {shorten(given)} {text}")


def _required(cls: type) -> list[str]:
    missing = dataclasses.MISSING
    return [f.name for f in dataclasses.fields(cls) if f.default is missing and f.default_factory is missing]
