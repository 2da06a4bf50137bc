"""The first checks of every request: host, rate, size; and the headers of every answer."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from typing import Any, Final

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from gantryctl.gateway.peers import peer_of
from gantryctl.gateway.routes import API
from gantryctl.gateway.sessions import Session
from gantryctl.gateway.settings import (
    BODY_MAX,
    LOGINS_PER_S,
    LOGINS_RESERVE,
    REQUESTS_PER_S,
    REQUESTS_RESERVE,
    Settings,
    is_loopback,
)
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import Refusal, refusal
from gantryctl.program.alarms.words import Words
from gantryctl.service.protocol.limits import RateLimiter

# Only files of this page run, and no other page may frame it (docs/explanation/security.md).
CSP: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "font-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_COOKIES: Final = re.compile(rb"\r\ncookie:([^\r\n]*)", re.IGNORECASE)
_HEADERS: Final = {
    "content-security-policy": CSP,
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), microphone=(), geolocation=()",
}


def error(status: int, reason: Refusal, **headers: str) -> Response:
    """An error in the one form that the routes use; REST is English (decision 0013)."""
    body = json.dumps({"error": {"code": reason.code, "text": reason.text}}, ensure_ascii=False)
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    return Response(body, status, named, media_type="application/json")


class Guard:
    """The outermost layer of the application.

    Args:
        session: finds the living session of a connection.
    """

    def __init__(
        self, app: ASGIApp, settings: Settings, session: Callable[[HTTPConnection], Session | None]
    ) -> None:
        self._app, self._settings, self._session = app, settings, session
        self._hosts = settings.hosts
        self._sessions, self._others = (RateLimiter(REQUESTS_PER_S, REQUESTS_RESERVE) for _ in range(2))
        self._logins = RateLimiter(LOGINS_PER_S, LOGINS_RESERVE)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request or WebSocket."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        refused = self._refuse(scope)
        if refused is not None and scope["type"] == "http":
            await refused(scope, receive, self._with_headers(send))
        elif refused is not None:
            await deny(scope, receive, send, refused)
        else:
            await self._app(scope, _limited(receive), self._with_headers(send))

    def session_of(self, head: bytes) -> str:
        """Key of the living session that the first bytes of a connection name, "" for none."""
        found = _COOKIES.search(head)
        if found is None:
            return ""
        session = self._session(HTTPConnection({"type": "http", "headers": [(b"cookie", found[1])]}))
        return "" if session is None else f"session {session.token}"

    def _refuse(self, scope: Scope) -> Response | None:
        headers = dict(scope["headers"])
        # A name that is not ours is DNS rebinding: another page reaching this address by its own name.
        if headers.get(b"host", b"").decode("latin-1").lower() not in self._hosts:
            return error(403, refusal(Code.SEC_04, reason=Words.FOREIGN_HOST))
        if b"transfer-encoding" in headers and b"content-length" in headers:
            # Two lengths: what one of us reads as a body is the next request for another (RFC 9112, section 6.3).
            return error(400, refusal(Code.SEC_05, reason=Words.TWO_LENGTHS), connection="close")
        wait_s = self._wait_s(scope)
        if wait_s > 0.0:
            busy = refusal(Code.SEC_06, reason=Words.TOO_MANY_REQUESTS)
            return error(429, busy, retry_after=str(math.ceil(wait_s)))
        # Nine digits: int() of a longer text costs time before it is refused.
        length = headers.get(b"content-length", b"0")
        if not length.isdigit() or len(length) > 9 or int(length) > BODY_MAX:
            return error(413, refusal(Code.SEC_05, reason=Words.BODY_TOO_LONG(limit=BODY_MAX)))
        return None

    def _wait_s(self, scope: Scope) -> float:
        """How long a request must wait; strangers take nothing from whoever is logged in, nor from a login."""
        session = self._session(HTTPConnection(scope))
        if session is not None:
            return self._sessions.wait_s(session.token)
        path, peer = str(scope["path"]), peer_of(scope)
        if path == f"{API}/login":
            return self._logins.wait_s(peer)
        # Files of the page are in memory: on this machine a flood must not keep a new page away.
        if not path.startswith("/api") and is_loopback(address_of(scope)):
            return 0.0
        return self._others.wait_s(peer)

    def _with_headers(self, send: Send) -> Send:
        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.update(_HEADERS)
                if self._settings.secure:
                    headers["strict-transport-security"] = "max-age=31536000"
                if "cache-control" not in headers:
                    headers["cache-control"] = "no-store"
            await send(message)

        return sending


def _limited(receive: Receive) -> Receive:
    """Cut off a body that is too long though it announced no length."""
    taken = 0

    async def receiving() -> Message:
        nonlocal taken
        message = await receive()
        if message["type"] == "http.request":
            taken += len(message.get("body", b""))
            if taken > BODY_MAX:
                return {"type": "http.disconnect"}
        return message

    return receiving


async def deny(scope: Scope, receive: Receive, send: Send, response: Response) -> None:
    """Refuse a WebSocket before it opens, with an HTTP status."""
    # The ASGI extension is optional: a server without it can only close.
    if "websocket.http.response" not in scope.get("extensions", {}):
        await send({"type": "websocket.close", "code": 1008})
        return

    async def sending(message: Message) -> None:
        await send({**message, "type": f"websocket.{message['type']}"})

    await response({**scope, "type": "http"}, receive, sending)


def address_of(scope: Scope) -> str:
    """Address of the other end."""
    client: Any = scope.get("client")
    return str(client[0]) if client else ""
