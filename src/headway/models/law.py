"""What a car-following law is: a plain function, read from its signature.

    @headway.model
    def soft(s, v, dv, *, k: Annotated[float, Param("1/s²", 0.01, 1.0)] = 0.2, T: ... = 1.2):
        return k * (s - 2.0 - T * v) + 0.6 * dv

Positional names say which signals the law perceives (`SIGNALS`), keyword-only names are its
parameters; their annotation is the one source of unit, bounds and description. Everything else
(equilibria, exact derivatives, the compiled kernel) follows from the one function.
"""

from __future__ import annotations

import contextlib
import contextvars
import importlib
import inspect
import math
import pickle
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, get_type_hints, overload

import numpy as np

from headway.errors import HeadwayError, HeadwayWarning, shorten, unknown_name
from headway.models import equilibrium
from headway.models.dual import partials
from headway.models.signal import SIGNALS, steady

__all__ = ["Law", "Model", "Param", "Parameter", "model"]


@dataclass(frozen=True)
class Param:
    """Annotation of a parameter: unit, allowed range (inclusive) and a short description.

    `structural=True` marks exponents and switches that select a form of the law: runs that differ
    in one are never put into the same compiled loop, so `power` and `if` on it cost nothing.
    """

    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    text: str = ""
    structural: bool = False


@dataclass(frozen=True)
class Parameter:
    """A parameter of a law: its name, default value and annotation."""

    name: str
    default: float
    info: Param

    def check(self, value: Any, law: str) -> float:
        """`value` as a float, or a `HeadwayError` that says what is allowed."""
        place = f"{law}.{self.name}"
        if isinstance(value, bool | np.bool_ | str | bytes) or not _is_real(value):
            raise HeadwayError(f"{place} = {shorten(value)} is not a number")
        unit = f" {self.info.unit}" if self.info.unit else ""
        if isinstance(value, int) and abs(value) > _LARGEST:
            raise HeadwayError(f"{place} = {shorten(value)} is out of bounds; allowed is {self.range}{unit}")
        number = float(value)
        if not math.isfinite(number):
            raise HeadwayError(f"{place} = {number} is not finite; allowed is {self.range}{unit}")
        if not max(self.info.low, -_LARGEST) <= number <= min(self.info.high, _LARGEST):
            raise HeadwayError(f"{place} = {number:g}{unit} is out of bounds; allowed is {self.range}{unit}")
        return number

    @property
    def range(self) -> str:
        """The allowed range in words."""
        low, high = self.info.low, self.info.high
        if math.isinf(low) and math.isinf(high):
            return f"any number from {-_LARGEST:g} to {_LARGEST:g}"
        if math.isinf(high):
            return f"at least {low:g}"
        if math.isinf(low):
            return f"at most {high:g}"
        return f"{low:g} to {high:g}"


#: largest magnitude of a parameter, also where a law sets no bound: sums of larger ones lose their digits
_LARGEST = 1e12


def _is_real(value: Any) -> bool:
    try:
        float(value)
    except OverflowError:
        return isinstance(value, int)
    except Exception:  # somebody else's __float__ may do anything
        return False
    return not isinstance(value, complex) and np.ndim(value) == 0


@dataclass(frozen=True, eq=False)
class Law:
    """A car-following law `a = f(signals; parameters)` [m/s²]. Call it with parameters to get a `Model`."""

    name: str
    function: Callable[..., Any]
    signals: tuple[str, ...]
    parameters: Mapping[str, Parameter]
    title: str
    formula: str = ""
    source: str = ""
    doi: str = ""
    forms: dict[str, Callable[..., Any]] = field(default_factory=dict)

    def __call__(self, **values: float) -> Model:
        """An instance of the law with the given parameters (SI); the others keep their defaults.

        Raises `HeadwayError` for an unknown name or a value that is not finite or out of bounds.
        """
        for name in values:
            if name not in self.parameters:
                raise unknown_name(f"parameter of {self.name}", name, self.parameters)
        full = {n: p.check(values.get(n, p.default), self.name) for n, p in self.parameters.items()}
        return Model(self, tuple(full.items()))

    def __repr__(self) -> str:
        arguments = ", ".join(f"{p.name}={p.default:g}" for p in self.parameters.values())
        return f"<law {self.name}({', '.join(self.signals)}; {arguments})>"

    def _repr_html_(self) -> str:
        from headway.models.notebook import law_html

        return law_html(self)

    def __copy__(self) -> Law:
        return self

    def __deepcopy__(self, memo: object) -> Law:
        return self  # equal models share their law

    def __reduce__(self) -> tuple[Callable[[str, str], Law], tuple[str, str]]:
        place = self.function.__module__, self.function.__qualname__
        if getattr(sys.modules.get(place[0]), place[1], None) is not self:
            raise pickle.PicklingError(f"law {self.name} cannot be sent elsewhere: it is not a name of its module")
        return _named, place

    def closed_form(self, what: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
        """Decorator: attach a closed form to the law.

        `what` is `"equilibrium_gap"` (of v), `"equilibrium_speed"` (of s) or `"speed_range"` (no
        signal; the open interval of speeds that have an equilibrium); the function takes the law's
        parameters by keyword and may ignore some with `**_`.
        """

        def attach(function: Callable[..., Any]) -> Callable[..., Any]:
            self.forms[what] = function
            return function

        return attach


def _named(module: str, name: str) -> Law:
    """The law of this name in a module, as another process finds it."""
    law: Law = getattr(importlib.import_module(module), name)
    return law


@dataclass(frozen=True)
class Model:
    """A law with values for all its parameters; hashable and immutable."""

    law: Law
    items: tuple[tuple[str, float], ...]

    @property
    def name(self) -> str:
        """Name of the law."""
        return self.law.name

    @property
    def parameters(self) -> dict[str, float]:
        """Parameter values by name (SI)."""
        return dict(self.items)

    def __getattr__(self, name: str) -> float:
        for key, number in object.__getattribute__(self, "items"):
            if key == name:
                return number
        raise AttributeError(f"{self.law.name} has no parameter or attribute {name!r}")

    def __repr__(self) -> str:
        return f"{self.law.name}({', '.join(f'{k}={v:g}' for k, v in self.items)})"

    def _repr_html_(self) -> str:
        from headway.models.notebook import model_html

        return model_html(self)

    def replace(self, **values: float) -> Model:
        """The same law with some parameters changed."""
        return self.law(**{**self.parameters, **values})

    def acceleration(self, **signals: Any) -> Any:
        """Acceleration [m/s²] for the signals the law asks for, given by name (SI)."""
        for name in signals:
            if name not in self.law.signals:
                raise unknown_name(f"signal of {self.name}", name, self.law.signals)
        missing = [n for n in self.law.signals if n not in signals]
        if missing:
            raise HeadwayError(f"{self.name} needs the signal {', '.join(missing)} as well")
        return self(*(signals[n] for n in self.law.signals))

    def __call__(self, *signals: Any) -> Any:
        """Acceleration [m/s²] for the law's signals in the order of its signature."""
        return self.law.function(*signals, **self.parameters)

    def at_rest(self, gap: Any, speed: Any) -> Any:
        """Acceleration [m/s²] where everybody drives `speed` steadily and the gap is `gap`."""
        return self(*steady(self.law.signals, gap, speed).values())

    def equilibrium_gap(self, speed: float) -> float:
        """Gap [m] at which a follower keeps `speed` [m/s] behind a leader of the same speed.

        Raises `NoEquilibriumError` where there is none, `RestsEverywhereError` where every gap is one (GMM).
        """
        return equilibrium.gap_at(self, speed)

    @property
    def rests_everywhere(self) -> bool:
        """Whether every gap is an equilibrium at every speed, so that a scenario has to say the gap (GMM)."""
        return equilibrium.rests_everywhere(self)

    def equilibrium_speed(self, gap: float) -> float:
        """Speed [m/s] that a follower keeps at `gap` [m]; `HeadwayError` where there is none or any would do."""
        return equilibrium.speed_at(self, gap)

    def desired_gap(self, speed: Any) -> Any:
        """The law's own spacing policy: its equilibrium gap [m] at each speed, NaN where it has none.

        `speed` is a number or an array of any shape; the result has its shape.
        """
        return equilibrium.policy(self, speed)

    def partials(self, speed: float, gap: float | None = None) -> dict[str, float]:
        """Exact partial derivatives of the law at equilibrium, by signal name.

        `f_s` [1/s²], `f_v f_dv f_vl f_v0l` [1/s], `f_a f_al f_a0l` [1]; keys are the signal names.
        `gap` is needed where every gap is an equilibrium. Raises `HeadwayError` if there is none.
        """
        s = self.equilibrium_gap(speed) if gap is None else float(gap)
        return partials(self, steady(self.law.signals, s, float(speed)))


@overload
def model(function: Callable[..., Any], /) -> Law: ...
@overload
def model(
    *, name: str | None = None, title: str | None = None, formula: str = "", source: str = "", doi: str = ""
) -> Callable[[Callable[..., Any]], Law]: ...
def model(
    function: Callable[..., Any] | None = None,
    /,
    *,
    name: str | None = None,
    title: str | None = None,
    formula: str = "",
    source: str = "",
    doi: str = "",
) -> Any:
    """Make a law of a function (decorator, with or without arguments).

    The function's positional arguments must be among `SIGNALS`; its keyword-only arguments are
    parameters with a default and, preferably, `Annotated[float, Param(unit, low, high, text)]`.
    `title` defaults to the first line of the docstring. Raises `HeadwayError` if the signature
    cannot be read as a law.
    """
    if function is None:
        return lambda f: _read_or_collect(f, name, title, formula, source, doi)
    return _read_or_collect(function, name, title, formula, source, doi)


#: where the errors of functions that cannot be laws go while a file is run for all that it holds, and its name
_faults: contextvars.ContextVar[tuple[dict[str, HeadwayError], str] | None] = contextvars.ContextVar(
    "faults", default=None
)


@contextlib.contextmanager
def collecting(faults: dict[str, HeadwayError], file: str) -> Iterator[None]:
    """Within this, a function that cannot be a law puts its error into `faults` and stays a function."""
    token = _faults.set((faults, file))
    try:
        yield
    finally:
        _faults.reset(token)


def _read_or_collect(
    function: Callable[..., Any], name: str | None, title: str | None, formula: str, source: str, doi: str
) -> Any:
    faults = _faults.get()
    if faults is None:
        return _read(function, name, title, formula, source, doi)
    try:
        return _read(function, name, title, formula, source, doi)
    except HeadwayError as error:
        faults[0][name or function.__name__] = HeadwayError(f"{faults[1]}: {error}")
        return function


def _read(
    function: Callable[..., Any], name: str | None, title: str | None, formula: str, source: str, doi: str
) -> Law:
    own = name or str(getattr(function, "__name__", shorten(function)))
    if not inspect.isfunction(function):
        raise HeadwayError(f"law {own}: {shorten(function)} is not a plain Python function, of which a law is made")
    try:
        hints = get_type_hints(function, include_extras=True)
    except Exception as error:  # an annotation is code of the law's author
        raise HeadwayError(f"law {own}: an annotation cannot be read ({error})") from None
    signals: list[str] = []
    parameters: dict[str, Parameter] = {}
    for p in inspect.signature(function).parameters.values():
        if p.kind is p.KEYWORD_ONLY:
            parameters[p.name] = _parameter(own, p, hints.get(p.name))
        elif p.kind in (p.VAR_POSITIONAL, p.VAR_KEYWORD):
            raise HeadwayError(f"law {own}: *{p.name} is not allowed; name each signal and each parameter")
        else:
            if p.name not in SIGNALS:
                raise _no_signal(own, p, hints.get(p.name))
            if p.default is not p.empty:
                raise HeadwayError(
                    f"law {own}: signal {p.name} has a default value; parameters go after a '*', signals have none"
                )
            signals.append(p.name)
    if not signals:
        raise HeadwayError(f"law {own} perceives no signal; its positional arguments say which, e.g. (s, v, dv)")
    text = title or (inspect.getdoc(function) or own).strip().splitlines()[0].rstrip(".")
    law = Law(own, function, tuple(signals), parameters, text, formula, source, doi)
    from headway.models.signs import wrong_sign

    if sentence := wrong_sign(law):
        warnings.warn(sentence, HeadwayWarning, stacklevel=4)
    return law


def _no_signal(law: str, p: inspect.Parameter, hint: Any) -> HeadwayError:
    """The error for a positional argument that is no signal: a parameter that lost its '*', or another name."""
    if p.default is not p.empty or hint is not None:
        return HeadwayError(
            f"law {law}: {p.name} is no signal but looks like a parameter; put a '*' before the first parameter, "
            f"e.g. ({', '.join(('s', 'v', 'dv'))}, *, {p.name}=…)"
        )
    meant = next((s for s in SIGNALS.values() if p.name.lower() in s.also), None)
    if meant is not None:
        return HeadwayError(
            f"signal of law {law}: {p.name!r} is not known; did you mean {meant.name!r}, {meant.text}? "
            f"Signals are {', '.join(SIGNALS)}"
        )
    return unknown_name(f"signal of law {law}", p.name, SIGNALS)


def _parameter(law: str, p: inspect.Parameter, hint: Any) -> Parameter:
    info = next((m for m in getattr(hint, "__metadata__", ()) if isinstance(m, Param)), Param())
    if p.default is p.empty:
        raise HeadwayError(f"law {law}: parameter {p.name} needs a default value")
    if not _is_real(p.default) or isinstance(p.default, bool):
        raise HeadwayError(f"law {law}: the default of parameter {p.name} is {shorten(p.default)}, not a number")
    if not all(_is_real(x) for x in (info.low, info.high)):
        raise HeadwayError(f"law {law}: bounds of parameter {p.name} are {shorten((info.low, info.high))}, not numbers")
    if not info.low < info.high:
        raise HeadwayError(f"law {law}: bounds of parameter {p.name} are {info.low:g} to {info.high:g}, an empty range")
    parameter = Parameter(p.name, float(p.default), info)
    parameter.check(p.default, law)
    return parameter
