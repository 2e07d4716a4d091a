"""The identity of a function: what it does, not where it stands or what it is called."""

from __future__ import annotations

import hashlib
import types
from collections.abc import Callable
from typing import Any

__all__ = ["fingerprint"]


def fingerprint(function: Callable[..., Any]) -> str:
    """Hexadecimal SHA-256 of a function's code, its constants, and all functions and numbers it refers to."""
    digest = hashlib.sha256()
    _feed(digest, function, set())
    return digest.hexdigest()


def _feed(digest: Any, thing: Any, seen: set[int]) -> None:
    if isinstance(thing, types.FunctionType):
        if id(thing) in seen:
            return
        seen.add(id(thing))
        _feed_code(digest, thing.__code__)
        for default in (thing.__defaults__, tuple(sorted((thing.__kwdefaults__ or {}).items()))):
            digest.update(repr(default).encode())
        for name in _global_names(thing.__code__):
            if name in thing.__globals__:
                digest.update(name.encode())
                _feed(digest, thing.__globals__[name], seen)
        for cell in thing.__closure__ or ():
            _feed(digest, cell.cell_contents, seen)
    elif isinstance(thing, types.ModuleType):
        digest.update(f"module {thing.__name__} {getattr(thing, '__version__', '')}".encode())
    elif hasattr(thing, "__wrapped__") or hasattr(thing, "py_func"):
        _feed(digest, getattr(thing, "py_func", None) or thing.__wrapped__, seen)
    else:
        digest.update(repr(thing).encode())


def _global_names(code: types.CodeType) -> list[str]:
    names = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            names.update(_global_names(constant))
    return sorted(names)


def _feed_code(digest: Any, code: types.CodeType) -> None:
    digest.update(code.co_code)
    digest.update(repr((code.co_varnames, code.co_names, code.co_argcount, code.co_kwonlyargcount)).encode())
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            _feed_code(digest, constant)
        else:
            digest.update(repr(constant).encode())
