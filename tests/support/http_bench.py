"""The HTTP server with its limits around a page of one word, in the process of the test."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path

from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import PlainTextResponse, StreamingResponse
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from gantryctl.gateway import door, server
from gantryctl.gateway.guard import Guard, deny, error
from gantryctl.gateway.settings import Settings
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words

ASK = b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"
BIG = b"GET /big HTTP/1.1\r\nHost: x\r\n\r\n"
SERVERS: list[door.Door] = []
PATIENCE_S = 30.0
"""Until a test gives up; the limits under test are 0.3 s here."""


async def hello(request: Request) -> PlainTextResponse:
    with suppress(ClientDisconnect):  # it made room
        await request.body()
    return PlainTextResponse("hello")


async def who(request: Request) -> PlainTextResponse:
    return PlainTextResponse(request.client.host if request.client else "")


async def big(request: Request) -> StreamingResponse:
    return StreamingResponse(b"x" * 65536 for _ in range(1000))


async def echo(web: WebSocket) -> None:
    await web.accept()
    with suppress(WebSocketDisconnect):
        await web.send_text(await web.receive_text())


async def refuse(web: WebSocket) -> None:
    await deny(web.scope, web.receive, web.send, error(401, refusal(Code.SEC_01, reason=Words.LOG_IN_FIRST)))


def session_of(head: bytes) -> str:
    return "session 1" if b"Cookie: mine" in head else ""


def run(check: Callable[[int], Awaitable[None]], tls: Path | None = None, *, guarded: bool = False) -> None:
    """A server with limits and a page of one word; `check` gets its port."""

    async def whole() -> None:
        with socket.create_server(("127.0.0.1", 0), backlog=1024) as listener:
            port = listener.getsockname()[1]
            files = [None, None] if tls is None else [str(tls / name) for name in ("cert.pem", "key.pem")]
            settings = Settings("127.0.0.1", port, listener.fileno(), *files, (), Path(), Path())
            app = Starlette(
                routes=[
                    Route("/", hello, methods=["GET", "POST"]),
                    Route("/big", big),
                    Route("/who", who),
                    WebSocketRoute("/ws", refuse),
                    WebSocketRoute("/echo", echo),
                ]
            )
            made = server.make_server(
                Guard(app, settings, lambda _: None) if guarded else app, settings, session_of
            )
            SERVERS.append(made)
            serving = asyncio.create_task(made.serve(sockets=[listener]))
            try:
                await asyncio.wait_for(check(port), PATIENCE_S)
            finally:
                made.should_exit = True
                await serving

    asyncio.run(whole())


async def until_closed(port: int, *texts: bytes) -> bytes:
    """Everything that comes before the other end closes; the texts are sent one by one, each after an answer."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    answer = b""
    for text in texts:
        writer.write(text)
        if text.endswith(b"\r\n\r\n"):
            answer += await reader.readuntil(b"hello")
    with suppress(ConnectionError):  # ended without ceremony
        answer += await reader.read()
    writer.close()
    return answer


async def until_closed_now(port: int, text: bytes) -> bytes:
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(text)
    answer = b""
    with suppress(ConnectionError):
        while data := await reader.read(1 << 16):
            answer += data
    writer.close()
    return answer
