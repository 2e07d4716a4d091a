"""How large a request may be, and how long code of others may take, before it is refused in words.

Sizes are estimated before anything is allocated. Whoever means a larger one says so:
`HEADWAY_LIMIT=10` in the environment allows ten times as much of everything counted here.
"""

from __future__ import annotations

import math
import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from headway.errors import HeadwayError

__all__ = ["LIMITS", "OutOfTime", "check_size", "factor", "time_limit"]

#: what is counted → how many are allowed
LIMITS: dict[str, float] = {
    "steps": 5e6,
    "steps of vehicles": 2e10,
    "kept values": 1e8,
    "knots of the leader": 5e6,
    "echoes of an acceleration": 2e4,
    "points of a map": 4e6,
    "vehicles": 1e6,
    "tables of followers": 2e4,
    "values of axes": 2e7,
    "values of all points": 5e8,
}


class OutOfTime(BaseException):
    """What runs under `time_limit` took too long."""


def factor() -> float:
    """How many times `LIMITS` are allowed: the environment's HEADWAY_LIMIT, 1 if it is not set.

    Raises:
        HeadwayError: If that is no positive number.
    """
    text = os.environ.get("HEADWAY_LIMIT", "1")
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise HeadwayError(f"HEADWAY_LIMIT = {text!r} is not allowed; it is a positive number, e.g. 10")
    return value


def check_size(place: str, count: float, what: str) -> None:
    """Refuse more than the limit of `what` with a sentence that says how it can be raised.

    Args:
        place: The field that asks for so many, with its value.
        count: How many it asks for.
        what: A key of `LIMITS`.

    Raises:
        HeadwayError: If there are too many.
    """
    if count > LIMITS[what] * factor():
        times = 10.0 ** math.ceil(math.log10(count / LIMITS[what])) if math.isfinite(count) else math.inf
        raise HeadwayError(
            f"{place} asks for {count:.3g} {what}; up to {LIMITS[what] * factor():.3g} are allowed "
            f"(HEADWAY_LIMIT={times:.0f} in the environment allows them, if there is memory and time for it)"
        )


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise `OutOfTime` in what runs inside after so many seconds.

    Only the main thread can be stopped, and only where the system has an interval timer; elsewhere
    this does nothing. A timer that runs already goes on afterwards.

    Args:
        seconds: How long [s] what runs inside may take.

    Raises:
        OutOfTime: If it takes longer.
    """
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return

    def stop(*_: Any) -> None:
        raise OutOfTime

    before, began = signal.getitimer(signal.ITIMER_REAL), time.monotonic()
    handler = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds if before[0] == 0.0 else min(seconds, before[0]))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, handler)
        if before[0] > 0.0:
            left = before[0] - (time.monotonic() - began)
            signal.setitimer(signal.ITIMER_REAL, max(left, 1e-3), before[1])
