"""Laws of one's own from a Python file, by the name a person gives on the command line: `my.py:soft`."""

from __future__ import annotations

import contextlib
import importlib.util
import sys
import traceback
import types
import warnings
from pathlib import Path

from headway.checked import as_path
from headway.errors import HeadwayError, HeadwayWarning, shorten, unknown_name
from headway.limits import OutOfTime, time_limit
from headway.models.law import Law, collecting, model
from headway.models.signs import wrong_sign

__all__ = ["laws_and_faults", "load_laws"]


#: seconds after which a file of laws that is still being run is given up
_PATIENCE = 20.0


def load_laws(reference: str, allow_wrong_sign: bool = False) -> list[Law]:
    """The laws that `file.py:name` refers to, or all laws of `file.py`. This runs the file.

    What the file prints goes to standard error.

    Raises:
        HeadwayError: If the file cannot be read or run, does not end within 20 s, holds no such law, or
            holds one whose relative speed has the wrong sign (unless `allow_wrong_sign`).
    """
    laws, faults = laws_and_faults(reference, allow_wrong_sign)
    if faults:
        raise next(iter(faults.values()))
    return laws


def laws_and_faults(reference: str, allow_wrong_sign: bool = False) -> tuple[list[Law], dict[str, HeadwayError]]:
    """The laws of a file, and by name what is wrong with each function that was to be one.

    Raises:
        HeadwayError: If the file itself cannot be read or run, or holds no such law.
    """
    if not isinstance(reference, str):
        raise HeadwayError(f"--model {shorten(reference)}: write a Python file and a law in it, e.g. my.py:soft")
    path, _, name = reference.partition(".py:")
    file = as_path(path + ".py" if name else reference, "--model")
    if file.suffix != ".py":
        raise HeadwayError(f"--model {reference}: write a Python file and a law in it, e.g. my.py:soft")
    faults: dict[str, HeadwayError] = {}
    try:
        with time_limit(_PATIENCE):
            module = _run(file, faults)
            laws = _chosen(module, file, name, faults)
            wrong = {} if allow_wrong_sign else {law.name: wrong_sign(law) for law in laws}
    except OutOfTime:
        raise HeadwayError(
            f"{file}: the file or a law in it still runs after {_PATIENCE:g} s; a file of laws is run to read it, so "
            "it may hold definitions only"
        ) from None
    faults |= {law: HeadwayError(f"{file}: {sentence}") for law, sentence in wrong.items() if sentence}
    return laws, {n: fault for n, fault in faults.items() if not name or n == name or n in wrong}


def _chosen(module: types.ModuleType, file: Path, name: str, faults: dict[str, HeadwayError]) -> list[Law]:
    """The law called `name`, or all of a module."""
    known = {law.name: law for law in vars(module).values() if isinstance(law, Law) and _own(law, module)}
    if not name:
        if not known and not faults:
            raise HeadwayError(f"{file}: holds no law; put @headway.model above a function")
        return list(known.values())
    if name in faults:
        return []
    thing = vars(module).get(name, known.get(name))
    if isinstance(thing, types.FunctionType):
        thing = model(thing)
    if not isinstance(thing, Law):
        raise unknown_name(f"law in {file}", name, known or [n for n, f in vars(module).items() if callable(f)])
    return [thing]


def _own(law: Law, module: types.ModuleType) -> bool:
    return law.function.__module__ == module.__name__


def _run(file: Path, faults: dict[str, HeadwayError]) -> types.ModuleType:
    """Run a file; functions that cannot be laws go to `faults` and do not end it."""
    name = f"headway_own_{file.stem}"
    spec = importlib.util.spec_from_file_location(name, file)
    try:
        there = file.is_file()
    except OSError as error:
        raise HeadwayError(f"{file}: cannot be read ({error.strerror or error})") from None
    if not there or spec is None or spec.loader is None:
        raise HeadwayError(f"{file}: there is no such file of laws")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # compiled laws are found again by the name of their module
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(sys.stderr), collecting(faults, str(file)):
            warnings.simplefilter("ignore", HeadwayWarning)  # a wrong sign is refused below, or reported by a check
            spec.loader.exec_module(module)
    except HeadwayError as error:
        raise HeadwayError(f"{file}: {error}") from None
    except (KeyboardInterrupt, OutOfTime):
        raise
    except OSError as error:
        if error.filename in (str(file), None):
            raise HeadwayError(f"{file}: cannot be read ({error.strerror or error})") from None
        raise HeadwayError(f"{_where(file, error)}: the file cannot be run ({type(error).__name__}: {error})") from None
    except BaseException as error:
        raise HeadwayError(f"{_where(file, error)}: the file cannot be run ({type(error).__name__}: {error})") from None
    return module


def _where(file: Path, error: BaseException) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    line = next((f.lineno for f in reversed(frames) if f.filename == str(file)), None)
    line = line or getattr(error, "lineno", None)
    return f"{file}, line {line}" if line else str(file)
