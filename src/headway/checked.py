"""The gate at every border: what a file, a command line or a call brings becomes a checked value or one sentence.

Numbers are finite and of a size that means something here and nowhere deeper; paths can be paths; an
argument is of the kind that its annotation says. `typed` puts the last at the door of a public function.
"""

from __future__ import annotations

import functools
import inspect
import math
import numbers
import os
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from headway.errors import HeadwayError, shorten

__all__ = ["LARGEST", "SMALLEST", "as_path", "is_truth", "number", "too_large", "typed"]

F = TypeVar("F", bound=Callable[..., Any])

#: largest magnitude that a value of a unit may have: beyond it nothing is a vehicle, sums lose their digits, and the
#: picoseconds in which breaking points are counted overflow
LARGEST: dict[str, float] = {
    "s": 4e6, "m": 1e7, "m/s": 1e4, "m/s²": 1e6, "rad/s": 1e6, "rad": 1e9,
}  # fmt: skip
_LARGEST_OF_ANY = 1e15

#: smallest number, in SI, where a positive one is needed: times closer than this are one time
SMALLEST = 1e-9


def number(value: Any, place: str, unit: str = "", kind: str = "a number") -> float:
    """`value` as a finite float.

    Args:
        value: Anything. Text and truth values are no numbers here.
        place: What the value is, as the message calls it.
        unit: Its unit; bounds its size by `LARGEST`.
        kind: What is needed, in words.

    Raises:
        HeadwayError: If `value` is not a real finite number or of a size that means nothing.
    """
    if is_truth(value) or isinstance(value, str | bytes | complex) or value is None:
        raise HeadwayError(f"{place} = {shorten(value)} is not {kind}")
    try:
        result = float(value)
    except OverflowError:
        raise HeadwayError(f"{place} = {shorten(value)} is too large; {_limits(unit)}") from None
    except (TypeError, ValueError, RecursionError):
        raise HeadwayError(f"{place} = {shorten(value)} is not {kind}") from None
    if not math.isfinite(result):
        raise HeadwayError(f"{place} = {result} is not finite; {_limits(unit)}")
    if (sentence := too_large(result, place, unit)) is not None:
        raise HeadwayError(sentence)
    return result


def is_truth(value: Any) -> bool:
    """Whether a value is true or false, also NumPy's, without importing that."""
    return isinstance(value, bool) or type(value).__name__ in ("bool_", "bool")


def too_large(value: float, place: str, unit: str) -> str | None:
    """A sentence if a finite number is too large to mean anything in `unit`, else None."""
    if abs(value) > LARGEST.get(unit, _LARGEST_OF_ANY):
        return f"{place} = {value:g}{_space(unit)} is too large; {_limits(unit)}"
    return None


def _space(unit: str) -> str:
    return f" {unit}" if unit not in ("", "1") else ""


def _limits(unit: str) -> str:
    return f"allowed are numbers up to {LARGEST.get(unit, _LARGEST_OF_ANY):g}{_space(unit)} in magnitude"


def as_path(value: Any, place: str = "path") -> Path:
    """`value` as a path that a file system can be asked about.

    Args:
        value: Anything.
        place: What the value is, as the message calls it.

    Raises:
        HeadwayError: For all that is no path.
    """
    if not isinstance(value, str | os.PathLike) or not (text := os.fspath(value)) or isinstance(text, bytes):
        raise HeadwayError(f"{place} = {shorten(value)} is not a path of a file")
    if "\0" in text:
        raise HeadwayError(f"{place}: {shorten(text)} has a null character, which no file's name can have")
    if len(text) > 4095 or any(len(os.fsencode(part)) > 255 for part in re.split(r"[/\\]", text)):
        raise HeadwayError(f"{place}: {shorten(text)} is too long for a file's name; 255 bytes between slashes are")
    return Path(text)


# -- arguments of public functions --------------------------------------------------------------------------------

#: name of a class in an annotation → (whether a value is one, what to call it)
_KINDS: dict[str, tuple[Callable[[Any], bool], str]] = {
    "str": (lambda x: isinstance(x, str), "text"),
    "PathLike": (lambda x: isinstance(x, os.PathLike), "a path"),
    "Path": (lambda x: isinstance(x, os.PathLike | str), "a path"),
    "bool": (lambda x: is_truth(x), "True or False"),
    "int": (lambda x: isinstance(x, numbers.Integral) and not is_truth(x), "a whole number"),
    "float": (lambda x: isinstance(x, numbers.Real) and not is_truth(x), "a number"),
    "None": (lambda x: x is None, "None"),
    "Mapping": (lambda x: isinstance(x, Mapping), "a mapping"),
    "dict": (lambda x: isinstance(x, Mapping), "a mapping"),
    "Sequence": (lambda x: _is_many(x), "a list"),
    "Iterable": (lambda x: _is_many(x), "a list"),
    "list": (lambda x: isinstance(x, list), "a list"),
    "Array": (lambda x: _is_array(x), "an array of numbers"),
    "Floats": (lambda x: _is_array(x), "an array of numbers"),
}

#: classes of ours and of xarray's that are told by their name, so that nothing is imported to look at a value
_CLASSES = {
    "Dataset": "a dataset, as headway.simulate returns", "Scenario": "a headway.Scenario",
    "Vehicle": "a headway.Vehicle",
    "Recording": "a recording, as headway.data.read returns", "Linear": "what headway.linearize returns",
    "StabilityMap": "a StabilityMap", "PaperMap": "a map of the paper",
    "Fit": "what headway.calibrate returns", "Law": "a law of headway.models",
    "Model": "a model, e.g. headway.models.IDM()", "Figure": "a figure of matplotlib",
    "Axes": "axes of matplotlib", "Study": "a headway.Study",
    "Chain": "what headway.head_to_tail returns",
}  # fmt: skip


def _is_many(value: Any) -> bool:
    return isinstance(value, Iterable) and not isinstance(value, str | bytes | Mapping)


def _is_array(value: Any) -> bool:
    if isinstance(value, list | tuple):
        return all(_is_array(x) or (isinstance(x, numbers.Real) and not is_truth(x)) for x in value)
    return getattr(getattr(value, "dtype", None), "kind", "") in ("f", "i", "u")


def typed(function: F, name: str | None = None) -> F:
    """Make a function refuse arguments of another kind than its annotations say, with one sentence.

    Kinds are told by their names, so that an annotation costs no import; what is not in the table
    above is let through. Entries of `Sequence[X]` and values of `Mapping[str, X]` are looked at too.

    Args:
        function: A function whose annotations are text (`from __future__ import annotations`).
        name: What a message calls it; its own name if not given.

    Returns:
        The function behind its gate, which raises `HeadwayError`.
    """
    signature = inspect.signature(function)
    tests = {n: _alternatives(str(p.annotation)) for n, p in signature.parameters.items()}
    tests = {n: t for n, t in tests.items() if t}
    called = name or function.__name__

    @functools.wraps(function)
    def gate(*args: Any, **kwargs: Any) -> Any:
        try:
            bound = signature.bind(*args, **kwargs).arguments
        except TypeError as error:
            raise HeadwayError(f"{called}: {error}; it is called as {called}{_written(signature)}") from None
        for parameter, alternatives in tests.items():
            if parameter in bound:
                _check(bound[parameter], f"{called}: {parameter}", alternatives)
        return function(*args, **kwargs)

    return gate  # type: ignore[return-value]  # it is called as the function is


def _written(signature: inspect.Signature) -> str:
    return f"({', '.join(signature.parameters)})"


def _alternatives(annotation: str) -> list[tuple[str, str]]:
    """(class, class of its entries or "") of each alternative of an annotation; empty if one is not in the tables."""
    alternatives = []
    for part in re.split(r"\|(?![^\[]*\])", annotation):
        match = re.fullmatch(r"\s*(?:\w+\.)*(\w+)(?:\[(.*)\])?\s*", part)
        if match is None or (match[1] not in _KINDS and match[1] not in _CLASSES):
            return []
        inner = re.fullmatch(r"(?:str, )?(?:\w+\.)*(\w+)", match[2] or "")
        of = inner[1] if inner and match[1] in ("Sequence", "Iterable", "list", "Mapping") else ""
        alternatives.append((match[1], of if of in _KINDS or of in _CLASSES else ""))
    return alternatives


def _is(value: Any, name: str) -> bool:
    if name in _KINDS:
        return _KINDS[name][0](value)
    return any(c.__name__ == name for c in type(value).__mro__)


def _called(name: str) -> str:
    return _CLASSES.get(name) or _KINDS[name][1]


def _check(value: Any, place: str, alternatives: list[tuple[str, str]]) -> None:
    for name, of in alternatives:
        if _is(value, name):
            if of and not hasattr(value, "__next__"):
                entries = value.items() if isinstance(value, Mapping) else enumerate(value)
                for key, entry in entries:
                    if not _is(entry, of):
                        raise HeadwayError(f"{place}[{key!r}] needs {_called(of)}, not {_short(entry)}")
            return
    words = dict.fromkeys(_needed(name, of) for name, of in alternatives if name != "None")
    raise HeadwayError(f"{place} needs {' or '.join(words)}, not {_short(value)}")


def _needed(name: str, of: str) -> str:
    return f"a list, each {_called(of)}" if of and name in ("Sequence", "Iterable") else _called(name)


def _short(value: Any) -> str:
    """The value in few characters, or its class where its text would run over many lines."""
    if isinstance(value, bool | int | float | str | None.__class__):
        return shorten(value)
    if isinstance(value, list | tuple | dict) and len(value) <= 4:
        return shorten(value, 40)
    return f"a {type(value).__name__}"
