"""Laws of one's own from a Python file, by the name a person gives on the command line: `my.py:soft`."""

from __future__ import annotations

import importlib.util
import sys
import traceback
import types
from pathlib import Path

from headway.errors import HeadwayError, unknown_name
from headway.models.law import Law, model
from headway.models.signs import wrong_sign

__all__ = ["load_laws"]


def load_laws(reference: str, allow_wrong_sign: bool = False) -> list[Law]:
    """The laws that `file.py:name` refers to, or all laws of `file.py`. This runs the file.

    Raises `HeadwayError` if the file cannot be read or run, holds no such law, or holds one whose
    relative speed has the wrong sign (unless `allow_wrong_sign`).
    """
    path, _, name = reference.partition(".py:")
    file = Path(path + ".py" if name else reference)
    if file.suffix != ".py":
        raise HeadwayError(f"--model {reference}: write a Python file and a law in it, e.g. my.py:soft")
    module = _run(file)
    known = {law.name: law for law in vars(module).values() if isinstance(law, Law) and _own(law, module)}
    if name:
        thing = vars(module).get(name, known.get(name))
        if isinstance(thing, types.FunctionType):
            thing = model(thing)
        if not isinstance(thing, Law):
            raise unknown_name(f"law in {file}", name, known or [n for n, f in vars(module).items() if callable(f)])
        laws = [thing]
    else:
        laws = list(known.values())
        if not laws:
            raise HeadwayError(f"{file}: holds no law; put @headway.model above a function")
    for law in laws:
        if not allow_wrong_sign and (sentence := wrong_sign(law)):
            raise HeadwayError(f"{file}: {sentence}")
    return laws


def _own(law: Law, module: types.ModuleType) -> bool:
    return law.function.__module__ == module.__name__


def _run(file: Path) -> types.ModuleType:
    name = f"headway_own_{file.stem}"
    spec = importlib.util.spec_from_file_location(name, file)
    if not file.is_file() or spec is None or spec.loader is None:
        raise HeadwayError(f"{file}: there is no such file of laws")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # compiled laws are found again by the name of their module
    try:
        spec.loader.exec_module(module)
    except HeadwayError as error:
        raise HeadwayError(f"{file}: {error}") from None
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        line = next(
            (f.lineno for f in reversed(traceback.extract_tb(error.__traceback__)) if f.filename == str(file)), None
        )
        line = line or getattr(error, "lineno", None)
        where = f"{file}, line {line}" if line else str(file)
        raise HeadwayError(f"{where}: the file cannot be run ({type(error).__name__}: {error})") from None
    return module
