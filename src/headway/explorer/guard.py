"""Who may speak to the explorer: this machine's browser, at the page that was opened with the token.

A page of another site can make a browser send requests to 127.0.0.1. It does not know the token, which is the
first part of every path; its `Origin` is another; and a name of its own that it points at 127.0.0.1 shows in `Host`.
"""

from __future__ import annotations

import secrets
from typing import Any

from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send

__all__ = ["HEADERS", "Guard"]

#: sent with every answer: nothing from elsewhere is loaded, and the address (with its token) is told to nobody.
#: Plotly writes style elements and attributes of its own; scripts come from files only.
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}


class Guard:
    """Refuses what has not the token, or comes under another name or from another page."""

    def __init__(self, app: ASGIApp, token: str) -> None:
        self.app, self.token = app, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Hand a request on to the application, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        reason = self._refusal(scope)
        if reason is None:
            await self.app(scope, receive, _with_headers(send))
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008, "reason": reason})
        else:
            await PlainTextResponse(f"{reason}\n", 403, HEADERS)(scope, receive, send)

    def _refusal(self, scope: Scope) -> str | None:
        """Why a request is refused, or None."""
        headers = {k.decode("latin-1").lower(): v.decode("latin-1") for k, v in scope["headers"]}
        port = (scope.get("server") or (None, None))[1]
        hosts = {f"{name}:{port}" for name in ("127.0.0.1", "localhost")}
        host, origin = headers.get("host", ""), headers.get("origin")
        if host not in hosts:
            return "the explorer answers only to the name 127.0.0.1 or localhost"
        if origin is None and scope["type"] == "websocket":
            return "the explorer speaks only to its own page"
        if origin is not None and origin != f"http://{host}":
            return "the explorer speaks only to its own page"
        token = scope["path"].split("/")[1] if "/" in scope["path"] else ""
        if not secrets.compare_digest(token.encode(), self.token.encode()):
            return "the token is missing or wrong; open the address that headway explore printed"
        return None


def _with_headers(send: Send) -> Send:
    async def sending(message: Any) -> None:
        if message["type"] == "http.response.start":
            names = {name for name, _ in message["headers"]}
            extra = [(k.lower().encode(), v.encode()) for k, v in HEADERS.items() if k.lower().encode() not in names]
            message = {**message, "headers": [*message["headers"], *extra]}
        await send(message)

    return sending
