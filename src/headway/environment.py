"""What the environment may say to the compiler, checked before the compiler reads it."""

from __future__ import annotations

import os
import sys

from headway.errors import HeadwayError

__all__ = ["check_compiler", "check_figures"]


def check_compiler(needed: bool = True) -> None:
    """Refuse settings under which numba cannot be imported or, if it is `needed`, does not compile."""
    threads = os.environ.get("NUMBA_NUM_THREADS")
    if threads is not None and not (threads.strip().isdecimal() and 1 <= int(threads) <= 4096):
        raise HeadwayError(f"NUMBA_NUM_THREADS = {threads!r} in the environment is not a number of threads, 1 or more")
    if needed and os.environ.get("NUMBA_DISABLE_JIT", "0").strip() not in ("", "0"):
        raise HeadwayError("NUMBA_DISABLE_JIT is set in the environment, and headway needs the compiler; unset it")


def check_figures() -> None:
    """Refuse a backend of matplotlib that it does not know, before it is imported in the middle of a figure."""
    backend = os.environ.get("MPLBACKEND")
    if backend and "matplotlib" not in sys.modules:
        try:
            import matplotlib  # noqa: F401  imported for what it refuses
        except ValueError:
            raise HeadwayError(
                f"MPLBACKEND = {backend!r} in the environment is no backend of matplotlib; unset it"
            ) from None
