"""What the environment may say to the compiler, checked before the compiler reads it, and disks that are full."""

from __future__ import annotations

import functools
import importlib
import os
import pickle
import sys
import warnings
from typing import Any

from headway.errors import HeadwayError, HeadwayWarning

__all__ = ["check_compiler", "check_figures", "compile_without_disk"]


def check_compiler(needed: bool = True) -> None:
    """Refuse settings under which numba cannot be imported or, if it is `needed`, does not compile.

    Args:
        needed: Whether whoever asks cannot do without compiled code.

    Raises:
        HeadwayError: If there are such settings.
    """
    threads = os.environ.get("NUMBA_NUM_THREADS")
    if threads is not None and not (threads.strip().isdecimal() and 1 <= int(threads) <= 4096):
        raise HeadwayError(f"NUMBA_NUM_THREADS = {threads!r} in the environment is not a number of threads, 1 or more")
    if needed and os.environ.get("NUMBA_DISABLE_JIT", "0").strip() not in ("", "0"):
        raise HeadwayError("NUMBA_DISABLE_JIT is set in the environment, and headway needs the compiler; unset it")


def check_figures() -> None:
    """Refuse a backend of matplotlib that it does not know, before it is imported in the middle of a figure.

    Raises:
        HeadwayError: If the environment names one.
    """
    backend = os.environ.get("MPLBACKEND")
    if backend and "matplotlib" not in sys.modules:
        try:
            import matplotlib  # noqa: F401  imported for what it refuses
        except ValueError:
            raise HeadwayError(
                f"MPLBACKEND = {backend!r} in the environment is no backend of matplotlib; unset it"
            ) from None


class _Nowhere:
    """numba's last resort where no folder can be written to: a place that keeps nothing."""

    @classmethod
    def from_function(cls, function: Any, file: str) -> _Nowhere:
        return cls()

    def ensure_cache_path(self) -> None:
        raise OSError("no folder for compiled code can be written to")

    def get_cache_path(self) -> str:
        return os.path.join(os.devnull, "headway")

    def get_source_stamp(self) -> tuple[()]:
        return ()

    def get_disambiguator(self) -> str:
        return ""


#: what reading a pickle raises that is torn, or of another version whose names were others
_UNREADABLE = (AttributeError, ImportError, EOFError, IndexError, ValueError, pickle.UnpicklingError)


@functools.cache
def compile_without_disk() -> None:
    """Let numba go on where compiled code cannot be read from disk or kept on it, as on one that is full.

    By itself it fails, though the code that it was asked for is there. Compiling anew at the next start is all that
    is lost, and one warning says so. What is kept is of use as long as none of the sources of compiled code has
    changed: numba itself looks at one file alone, and not at those whose functions were put in place.
    """
    caching: Any = importlib.import_module("numba.core.caching")  # its types say less than what is done here
    load, save = caching.Cache.load_overload, caching.Cache.save_overload

    @functools.wraps(load)
    def load_if_possible(self: Any, *arguments: Any) -> Any:
        try:
            return load(self, *arguments)
        except (OSError, *_UNREADABLE):
            # unreadable, or of another version whose names were others: it is compiled anew
            return None

    @functools.wraps(save)
    def save_if_possible(self: Any, *arguments: Any) -> None:
        try:
            save(self, *arguments)
        except OSError as error:
            self.disable()
            _warn_of_disk(f"{error.strerror or error}: {error.filename or self.cache_path}")

    index = caching.IndexDataCacheFile._load_index

    @functools.wraps(index)
    def index_if_readable(self: Any) -> Any:
        try:
            return index(self)
        except _UNREADABLE:
            return {}  # so that it is written anew: numba would read it first, and fail

    caching.IndexDataCacheFile._load_index = index_if_readable
    stamp = caching._SourceFileBackedLocatorMixin.get_source_stamp

    @functools.wraps(stamp)
    def stamp_of_all(self: Any) -> Any:
        return stamp(self), *_sources()

    caching._SourceFileBackedLocatorMixin.get_source_stamp = stamp_of_all
    caching.Cache.load_overload, caching.Cache.save_overload = load_if_possible, save_if_possible
    caching.CacheImpl._locator_classes.append(_Nowhere)


@functools.cache
def _sources() -> tuple[float, int]:
    """Latest change and whole size of the files that hold compiled code or what it is made of."""
    package = os.path.dirname(__file__)
    folders = (os.path.join(package, name) for name in ("engine", "models"))
    states = [e.stat() for folder in folders for e in os.scandir(folder) if e.name.endswith(".py")]
    return max(s.st_mtime for s in states), sum(s.st_size for s in states)


@functools.cache
def _warn_of_disk(reason: str) -> None:
    sentence = f"compiled code cannot be kept and is compiled anew at the next start ({reason})"
    warnings.warn(sentence, HeadwayWarning, stacklevel=2)
