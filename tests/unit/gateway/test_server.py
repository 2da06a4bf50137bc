"""Connections that ask for nothing, or half of it, are ended, and cost nobody else his place."""

from __future__ import annotations

import asyncio
import os
import resource
import socket
import ssl
from collections.abc import Awaitable, Callable
from contextlib import ExitStack, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket
from websockets.asyncio.client import connect

from gantryctl.gateway import door, server
from gantryctl.gateway.guard import deny, error
from gantryctl.gateway.places import Places
from gantryctl.gateway.settings import CONNECTIONS, CONNECTIONS_REMOTE, Settings, neighbourhood
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words
from support.certificates import certificate

ASK = b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"
PATIENCE_S = 30.0
"""Until a test gives up; the limits under test are 0.3 s here."""


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (door, server):
        monkeypatch.setattr(module, "HEADER_S", 0.3)


async def hello(request: Request) -> PlainTextResponse:
    await request.body()
    return PlainTextResponse("hello")


async def echo(web: WebSocket) -> None:
    await web.accept()
    await web.send_text(await web.receive_text())


async def refuse(web: WebSocket) -> None:
    await deny(web.scope, web.receive, web.send, error(401, refusal(Code.SEC_01, reason=Words.LOG_IN_FIRST)))


def run(check: Callable[[int], Awaitable[None]], tls: Path | None = None) -> None:
    """A server with limits and a page of one word; `check` gets its port."""

    async def whole() -> None:
        with socket.create_server(("127.0.0.1", 0)) as listener:
            port = listener.getsockname()[1]
            files = [None, None] if tls is None else [str(tls / name) for name in ("cert.pem", "key.pem")]
            settings = Settings("127.0.0.1", port, listener.fileno(), *files, (), Path(), Path())
            app = Starlette(
                routes=[
                    Route("/", hello, methods=["GET", "POST"]),
                    WebSocketRoute("/ws", refuse),
                    WebSocketRoute("/echo", echo),
                ]
            )
            made = server.make_server(app, settings)
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


BODY = b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 60\r\n\r\n{"


@pytest.mark.parametrize(
    "texts", [[b""], [b"GET /"], [BODY], [ASK, b"GET /"], [ASK, b"\r\n"], [ASK, BODY], [ASK]]
)
def test_a_request_that_is_not_finished_in_time_ends_its_connection(texts: list[bytes]) -> None:
    async def check(port: int) -> None:
        answer = await until_closed(port, *texts)
        assert answer.count(b"200 OK") == texts.count(ASK)

    run(check)


def test_a_second_request_has_all_of_its_time() -> None:
    async def check(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        for _ in range(4):  # 0.6 s in all
            writer.write(ASK)
            assert b"200 OK" in await reader.readuntil(b"hello")
            await asyncio.sleep(0.15)
        writer.close()

    run(check)


def test_silent_tls_handshakes_are_ended_and_others_are_served(tmp_path: Path) -> None:
    now = datetime.now(UTC)
    certificate(tmp_path / "cert.pem", now - timedelta(1), now + timedelta(1), key_file=tmp_path / "key.pem")

    async def check(port: int) -> None:
        silent = [asyncio.create_task(until_closed(port)) for _ in range(CONNECTIONS)]
        assert await asyncio.gather(*silent) == [b""] * CONNECTIONS
        trusting = ssl.create_default_context(cafile=str(tmp_path / "cert.pem"))
        reader, writer = await asyncio.open_connection(
            "127.0.0.1", port, ssl=trusting, server_hostname="localhost"
        )
        writer.write(ASK)
        assert b"200 OK" in await reader.readuntil(b"hello")
        writer.close()

    run(check, tmp_path)


def test_places_are_counted_before_anything_is_done_for_a_connection() -> None:
    async def check(port: int) -> None:
        with ExitStack() as stack:
            made = [
                stack.enter_context(socket.create_connection(("127.0.0.1", port))) for _ in range(CONNECTIONS)
            ]
            await asyncio.sleep(0.1)
            assert await until_closed(port) == b""  # closed at once or in 0.3 s: no answer
            del made

    run(check)


def test_without_handles_it_waits_and_says_so_once(capsys: pytest.CaptureFixture[str]) -> None:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)

    async def check(port: int) -> None:
        waiting = [socket.create_connection(("127.0.0.1", port)) for _ in range(5)]
        resource.setrlimit(resource.RLIMIT_NOFILE, (len(os.listdir("/proc/self/fd")), before[1]))
        await asyncio.sleep(1.0)
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
        for each in waiting:
            each.close()
        assert b"200 OK" in await until_closed(port, ASK)

    try:
        run(check)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("no connection can be taken: [Errno 24] Too many open files")


def test_a_refused_websocket_leaves_nothing_in_the_log(capsys: pytest.CaptureFixture[str]) -> None:
    ask = b"GET /ws HTTP/1.1\r\nHost: x\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n" + (
        b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    )

    async def check(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(ask)
        answer = await reader.read()
        assert b" 401 " in answer.splitlines()[0]
        assert b"log in first" in answer
        writer.close()

    run(check)
    assert capsys.readouterr().err == ""


def test_a_websocket_has_no_such_limit_and_leaves_its_place_to_others() -> None:
    async def check(port: int) -> None:
        made = [await connect(f"ws://127.0.0.1:{port}/echo") for _ in range(CONNECTIONS + 1)]
        await asyncio.sleep(0.5)  # 0.3 s for a request
        for each in made:
            await each.send("hello")
            assert await each.recv() == "hello"
            await each.close()

    run(check)


def test_an_address_has_its_places_and_no_more() -> None:
    places = Places(door.WAITING, loopback=CONNECTIONS, remote=CONNECTIONS_REMOTE)
    mine = [places.take("192.0.2.7") for _ in range(CONNECTIONS_REMOTE)]
    assert None not in mine
    assert places.take("192.0.2.7") is None
    assert places.take("192.0.2.8") is not None
    assert mine[0] is not None
    for _ in range(2):
        mine[0].leave()
    assert places.take("192.0.2.7") is not None
    assert places.take("192.0.2.7") is None


def test_all_addresses_together_have_so_many() -> None:
    places = Places(door.WAITING, loopback=CONNECTIONS, remote=CONNECTIONS_REMOTE)
    assert sum(places.take(f"192.0.2.{n // 4}") is not None for n in range(1000)) == door.WAITING


@pytest.mark.parametrize(
    ("address", "key"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("2001:db8:1:2::1", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("", ""),
    ],
)
def test_limits_count_networks_of_ipv6(address: str, key: str) -> None:
    assert neighbourhood(address) == key
