"""What every request passes first: host, rate, size; and the headers that every answer carries."""

from __future__ import annotations

import json
import math
from typing import Any, Final

from starlette.datastructures import MutableHeaders
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from gantryctl.gateway.settings import BODY_MAX, REQUESTS_PER_S, REQUESTS_RESERVE, Settings, neighbourhood
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import Refusal, refusal
from gantryctl.program.alarms.words import Words
from gantryctl.service.protocol.limits import RateLimiter

CSP: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "font-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
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
    """The outermost layer of the application."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app, self._settings = app, settings
        self._hosts, self._limit = settings.hosts, RateLimiter(REQUESTS_PER_S, REQUESTS_RESERVE)

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

    def _refuse(self, scope: Scope) -> Response | None:
        headers = dict(scope["headers"])
        if headers.get(b"host", b"").decode("latin-1").lower() not in self._hosts:
            return error(403, refusal(Code.SEC_04, reason=Words.FOREIGN_HOST))
        wait_s = self._limit.wait_s(neighbourhood(address_of(scope)))
        if wait_s > 0.0:
            busy = refusal(Code.SEC_06, reason=Words.TOO_MANY_REQUESTS)
            return error(429, busy, retry_after=str(math.ceil(wait_s)))
        length = headers.get(b"content-length", b"0")
        if not length.isdigit() or len(length) > 9 or int(length) > BODY_MAX:
            return error(413, refusal(Code.SEC_05, reason=Words.BODY_TOO_LONG(limit=BODY_MAX)))
        return None

    def _with_headers(self, send: Send) -> Send:
        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers[name] = value
                if self._settings.secure:
                    headers["strict-transport-security"] = "max-age=31536000"
                if "cache-control" not in headers:
                    headers["cache-control"] = "no-store"
            await send(message)

        return sending


def _limited(receive: Receive) -> Receive:
    """Bodies without a length are cut off as well."""
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
    if "websocket.http.response" not in scope.get("extensions", {}):
        await send({"type": "websocket.close", "code": 1008})
        return

    async def sending(message: Message) -> None:
        await send({**message, "type": f"websocket.{message['type']}"})

    await response({**scope, "type": "http"}, receive, sending)


def address_of(scope: Scope) -> str:
    """Address of whoever asks."""
    client: Any = scope.get("client")
    return str(client[0]) if client else ""
