"""The explorer's server: a page, its scripts, one websocket and the exports. See `guard` for who may use it."""

from __future__ import annotations

import asyncio
import contextlib
import importlib.util
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.types import ASGIApp
from starlette.websockets import WebSocket, WebSocketDisconnect

from headway.errors import HeadwayError
from headway.explorer import state as states
from headway.explorer.controls import controls
from headway.explorer.exports import FORMS, export
from headway.explorer.guard import Guard
from headway.explorer.session import Session
from headway.models import Law
from headway.version import __version__

__all__ = ["make_app", "plotly_script"]

_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}


def make_app(
    token: str,
    state: Mapping[str, Any],
    laws: Iterable[Law] = (),
    references: Mapping[str, str] | None = None,
    limits: states.Limits = states.LIMITS,
) -> ASGIApp:
    """The application, guarded by `token`, whose page begins with `state`.

    Args:
        token: First part of every path that is answered.
        state: What the page shows first; a recording that its leader names may be used, and no other file.
        laws: Laws of one's own that the page may choose.
        references: By name, where they are, for the Python lines.
        limits: How much a page may ask for.
    """
    laws = tuple(laws)
    file = state["scenario"].get("leader", {}).get("file")
    files = () if file is None else (file,)
    static = {entry.name: entry.read_bytes() for entry in resources.files(__package__).joinpath("static").iterdir()}

    async def asset(request: Request) -> Response:
        name = request.path_params.get("name") or "index.html"
        if name == "plotly.min.js":
            return FileResponse(plotly_script(), 200, {"cache-control": "private, max-age=86400"}, "text/javascript")
        if name not in static:
            return PlainTextResponse("there is no such page\n", 404)
        return Response(static[name], media_type=_TYPES[Path(name).suffix])

    async def hello(_: Request) -> Response:
        content = {"version": __version__, "state": state, "limits": vars(limits), **controls(laws)}
        return JSONResponse(content)

    async def give(request: Request) -> Response:
        form = request.path_params["form"]
        if form not in FORMS:
            return PlainTextResponse(f"there is no export {form!r}; there are {', '.join(FORMS)}\n", 404)
        try:
            checked = states.checked_state(
                states.finite_json(await _body(request, limits.message)), laws, files, limits
            )
            text = await run_in_threadpool(export, checked, form, references or {})
        except HeadwayError as error:
            return PlainTextResponse(f"{error}\n", 400)
        return PlainTextResponse(text)

    async def talk(socket: WebSocket) -> None:
        await socket.accept()

        async def send(message: str | bytes) -> None:
            await (socket.send_text(message) if isinstance(message, str) else socket.send_bytes(message))

        session = Session(send, laws, files, limits)
        work = asyncio.create_task(session.work())
        try:
            while True:
                message = await socket.receive()
                if message["type"] == "websocket.disconnect":
                    break
                await session.hear(message.get("text") or message.get("bytes") or "")
        except (WebSocketDisconnect, RuntimeError):
            pass  # the page has gone while it was being answered
        finally:
            work.cancel()
            with contextlib.suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
                await work

    inside = [
        WebSocketRoute("/ws", talk),
        Route("/hello", hello),
        Route("/export/{form}", give, methods=["POST"]),
        Route("/", asset),
        Route("/{name}", asset),
    ]
    return Guard(Starlette(routes=[Mount(f"/{token}", routes=inside)]), token)


async def _body(request: Request, most: int) -> str:
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > most:
            raise HeadwayError(f"the request is longer than {most} characters")
    try:
        return body.decode()
    except UnicodeDecodeError:
        raise HeadwayError("the request is not UTF-8 text") from None


def plotly_script() -> Path:
    """Plotly's bundled script in the installed package, which is not imported for it.

    Raises:
        HeadwayError: If plotly is not installed.
    """
    package = importlib.util.find_spec("plotly")
    if package is None or not package.submodule_search_locations:
        raise HeadwayError("the explorer needs plotly; install headway[explorer]")
    return Path(package.submodule_search_locations[0]) / "package_data" / "plotly.min.js"
