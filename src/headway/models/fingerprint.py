"""The identity of a function: what it does, not where it stands or what it is called."""

from __future__ import annotations

import hashlib
import sys
import types
from collections.abc import Callable
from typing import Any

import numpy as np

__all__ = ["fingerprint"]


#: what these bring is identified by its name and their version
_LIBRARIES = frozenset({"numpy", "scipy"})


def fingerprint(function: Callable[..., Any]) -> str:
    """Hexadecimal SHA-256 of a function's code, its constants, and all functions and numbers it refers to."""
    digest = hashlib.sha256()
    _feed(digest, function, set())
    return digest.hexdigest()


def _feed(digest: Any, thing: Any, seen: set[Any], names: tuple[str, ...] = ()) -> None:
    """Add `thing` to the digest; `names` are those that the function which refers to it looks up."""
    if _library(thing) is not None:
        digest.update(f"{_library(thing)} {getattr(thing, '__name__', '')}".encode())
    elif isinstance(thing, types.FunctionType):
        if id(thing) in seen:
            return
        seen.add(id(thing))
        _feed_code(digest, thing.__code__, thing.__doc__)
        for default in (thing.__defaults__, tuple(sorted((thing.__kwdefaults__ or {}).items()))):
            digest.update(repr(default).encode())
        used = tuple(_global_names(thing.__code__))
        for name in used:
            if name in thing.__globals__:
                digest.update(name.encode())
                _feed(digest, thing.__globals__[name], seen, used)
        for cell in thing.__closure__ or ():
            _feed(digest, cell.cell_contents, seen, used)
    elif isinstance(thing, types.ModuleType):
        digest.update(f"module {thing.__name__} {getattr(thing, '__version__', '')}".encode())
        if (id(thing), names) in seen:
            return
        seen.add((id(thing), names))
        for name in names:
            if name in vars(thing):
                digest.update(name.encode())
                _feed(digest, vars(thing)[name], seen, names)
    elif hasattr(thing, "__wrapped__") or hasattr(thing, "py_func"):
        _feed(digest, getattr(thing, "py_func", None) or thing.__wrapped__, seen)
    elif isinstance(thing, np.ndarray):
        digest.update(f"array {thing.dtype} {thing.shape}".encode() + thing.tobytes())
    elif isinstance(thing, tuple | list):
        digest.update(f"{type(thing).__name__} {len(thing)}".encode())
        for item in thing:
            _feed(digest, item, seen, names)
    elif isinstance(thing, frozenset | set):
        digest.update(repr(sorted(map(repr, thing))).encode())
    elif getattr(type(thing), "__repr__", None) is object.__repr__:  # which would tell an address
        digest.update(type(thing).__qualname__.encode())
    else:
        digest.update(repr(thing).encode())


def _library(thing: Any) -> str | None:
    """Name and version of the library that a module or function belongs to, if it is one that is not looked into."""
    home = thing.__name__ if isinstance(thing, types.ModuleType) else getattr(thing, "__module__", None)
    if not isinstance(home, str) or not (callable(thing) or isinstance(thing, types.ModuleType)):
        return None
    top = home.partition(".")[0]
    return f"{home} {sys.modules[top].__version__}" if top in _LIBRARIES else None


def _global_names(code: types.CodeType) -> list[str]:
    names = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            names.update(_global_names(constant))
    return sorted(names)


def _feed_code(digest: Any, code: types.CodeType, doc: str | None = None) -> None:
    digest.update(code.co_code)
    digest.update(repr((code.co_varnames, code.co_names, code.co_argcount, code.co_kwonlyargcount)).encode())
    for i, constant in enumerate(code.co_consts):
        if isinstance(constant, types.CodeType):
            _feed_code(digest, constant)
        elif i == 0 and doc is not None and isinstance(constant, str):
            digest.update(b"None")  # what a function says of itself does not change what it does
        else:
            _feed(digest, constant, set())
