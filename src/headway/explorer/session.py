"""One page's conversation with the engine.

A page sends its whole state whenever something moves. The newest state counts: it gets a draft of the curves
at once, and when nothing newer has come for a moment the exact run, figures, verdicts and the map. Whatever is
computed for an older state is given up. A message that cannot be read gets a sentence and changes nothing.
"""

from __future__ import annotations

import asyncio
import json
import logging
import struct
import time
from collections.abc import Awaitable, Callable, Iterable
from concurrent.futures import CancelledError, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from headway.errors import HeadwayError, shorten
from headway.explorer import state as states
from headway.explorer.answers import key_figures, map_key, map_of, verdict_sentences
from headway.explorer.picture import Picture, Quick, draw
from headway.models import Law

__all__ = ["Session", "frame"]

_log = logging.getLogger("headway.explorer")

#: how long [s] nothing new may come before the exact answers are computed
_REST = 0.12

#: how long [s] a draft may take though a newer state has come
_PATIENCE = 0.2

#: points of the map each way, first and then
_COARSE, _FINE = 40, 110

#: least and most times of a curve that a page may ask for
_POINTS = (50, 1200)


class _StaleError(Exception):
    """What was being computed is for a state that is not the newest any more."""


@dataclass(frozen=True)
class _Request:
    id: int
    state: Any
    points: int
    pinned: bool


def frame(kind: str, number: int, picture: Picture) -> bytes:
    """A binary message: length of the header, header (JSON, padded to four), then every array in 32 bits.

    The header's `arrays` lists name and shape in the order in which they follow, little-endian.
    """
    shapes = [[name, list(np.shape(values))] for name, values in picture.arrays.items()]
    header = json.dumps({"kind": kind, "id": number, **picture.header, "arrays": shapes}, ensure_ascii=False).encode()
    header += b" " * (-len(header) % 4)
    body = b"".join(np.ascontiguousarray(v, dtype="<f4").tobytes() for v in picture.arrays.values())
    return struct.pack("<I", len(header)) + header + body


class Session:
    """`hear` takes messages as they come; `work` answers them until it is cancelled."""

    def __init__(
        self,
        send: Callable[[str | bytes], Awaitable[None]],
        laws: Iterable[Law] = (),
        files: Iterable[str] = (),
        limits: states.Limits = states.LIMITS,
    ) -> None:
        self._send, self._laws, self._files, self.limits = send, tuple(laws), tuple(files), limits
        self._newest: _Request | None = None
        self._pin: _Request | None = None
        self._something = asyncio.Event()
        self._quick = Quick()
        self._map = ""
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="explorer")

    async def hear(self, text: str | bytes) -> None:
        """Take one message; what cannot be read is answered with a sentence."""
        number = -1
        try:
            if not isinstance(text, str):
                raise HeadwayError("the message is binary; the explorer takes JSON")
            if len(text) > self.limits.message:
                raise HeadwayError(f"the message has {len(text)} characters; the explorer takes {self.limits.message}")
            message = states.finite_json(text)
            if not isinstance(message, dict):
                raise HeadwayError(f"the message is {shorten(message)}, not a table")
            number = _whole(message, "id", 0, 2**53)
            what = message.get("do")
            if what not in ("show", "pin"):
                raise HeadwayError(f"do = {shorten(what)} is not known; allowed are pin, show")
            request = _Request(number, message.get("state"), _whole(message, "points", *_POINTS), what == "pin")
        except HeadwayError as error:
            await self._say("error", number, text=str(error))
            return
        if request.pinned:
            self._pin = request
        else:
            self._newest = request
        self._something.set()

    async def work(self) -> None:
        """Answer what is heard, newest first, until this task is cancelled."""
        try:
            while True:
                await self._something.wait()
                self._something.clear()
                if self._pin is not None:
                    pin, self._pin = self._pin, None
                    await self._answer(pin, lambda: False)
                request, self._newest = self._newest, None
                if request is not None:
                    await self._answer(request, lambda: self._newest is not None)
        finally:
            self._pool.shutdown(wait=False, cancel_futures=True)

    async def _answer(self, request: _Request, stale: Callable[[], bool]) -> None:
        try:
            await self._answers(request, stale)
        except _StaleError:
            pass
        except HeadwayError as error:
            await self._say("error", request.id, text=str(error))
        except Exception as error:
            # a law of one's own may raise anything; the page is told and the server goes on
            _log.exception("a state could not be computed")
            await self._say("error", request.id, text=f"this cannot be computed ({type(error).__name__}: {error})")

    async def _answers(self, request: _Request, stale: Callable[[], bool]) -> None:
        begun = time.perf_counter()
        state = states.checked_state(request.state, self._laws, self._files, self.limits)

        def too_late() -> bool:
            # a hand that moves sends states faster than they are drawn: a draft is only given up if it takes long
            return stale() and time.perf_counter() - begun > _PATIENCE

        picture, _ = await self._compute(draw, state, self._quick, request.points, True, too_late)
        picture.header["server_ms"] = round(1e3 * (time.perf_counter() - begun), 3)
        await self._send(frame("pinned" if request.pinned else "curves", request.id, picture))
        if request.pinned:
            *_, result = await self._compute(draw, state, Quick(), request.points, False, stale)
            await self._say("pinned figures", request.id, figures=await self._compute(key_figures, state, result))
            return
        try:
            await asyncio.wait_for(self._something.wait(), _REST)
            self._newest = self._newest or request  # only a pin came in between
            return  # the hand is still moving
        except TimeoutError:
            pass
        exact, result = await self._compute(draw, state, self._quick, request.points, False, stale)
        await self._send(frame("curves", request.id, exact))
        await self._say("figures", request.id, figures=await self._compute(key_figures, state, result))
        if stale():
            return
        await self._theory(request.id, state, stale)

    async def _theory(self, number: int, state: states.PageState, stale: Callable[[], bool]) -> None:
        """Verdicts and the map; a law without an equilibrium here has neither, and still drives."""
        try:
            await self._say("verdict", number, sentences=await self._compute(verdict_sentences, state, stale))
        except HeadwayError as error:
            await self._say("verdict", number, sentences=[str(error)])
        key = map_key(state)
        if not state.axes or key == self._map:
            return
        try:
            for points in (_COARSE, _FINE):
                if stale():
                    return
                picture = await self._compute(map_of, state, points)
                await self._send(frame("map", number, picture))
            self._map = key
        except HeadwayError as error:
            await self._say("no map", number, text=str(error))

    async def _compute(self, function: Callable[..., Any], *arguments: Any) -> Any:
        return await asyncio.get_running_loop().run_in_executor(self._pool, _computed, function, *arguments)

    async def _say(self, kind: str, number: int, **what: Any) -> None:
        await self._send(json.dumps({"kind": kind, "id": number, **what}, ensure_ascii=False))


def _computed(function: Callable[..., Any], *arguments: Any) -> Any:
    """What the function gives. asyncio takes a `CancelledError` out of a thread for its own, which would end `work`."""
    try:
        return function(*arguments)
    except CancelledError as error:
        raise _StaleError from error


def _whole(message: dict[str, Any], name: str, low: int, high: int) -> int:
    value = message.get(name)
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise HeadwayError(f"{name} = {shorten(value)} is not a whole number from {low} to {high}")
    return value
