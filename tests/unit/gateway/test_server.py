"""Connections that ask for nothing, or half of it, are ended, and cost nobody else his place."""

from __future__ import annotations

import asyncio
import os
import resource
import socket
import ssl
import sys
import time
from collections.abc import Awaitable, Callable
from contextlib import ExitStack, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, HTTPConnection, Request
from starlette.responses import PlainTextResponse, StreamingResponse
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosedError

from gantryctl.gateway import door, server
from gantryctl.gateway.guard import Guard, deny, error
from gantryctl.gateway.places import Places
from gantryctl.gateway.sessions import Session
from gantryctl.gateway.settings import CONNECTIONS, CONNECTIONS_REMOTE, Settings, neighbourhood
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words
from gantryctl.service.protocol.limits import MESSAGE_MAX
from gantryctl.service.protocol.roles import Role
from support.certificates import certificate

ASK = b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"
HOSTILE = Path(__file__).parents[2] / "support" / "hostile.py"
SERVERS: list[door.Door] = []
PATIENCE_S = 30.0
"""Until a test gives up; the limits under test are 0.3 s here."""


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (door, server):
        monkeypatch.setattr(module, "HEADER_S", 0.3)
        monkeypatch.setattr(module, "STUCK_S", 0.3)


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


@pytest.mark.parametrize(
    "sent",
    [
        b"GET / HTTP/1.1\r\nHost: x\r\nX: \x00\r\n\r\n",
        b"\x16\x03\x01\x02\x00\r\n\r\n",
        ASK.replace(b"\r\n\r\n", b"\r\nConnection: Upgrade\r\nUpgrade: h2c\r\n\r\n"),
        ASK.replace(b"GET / ", b"GET /ws ").replace(
            b"\r\n\r\n", b"\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 1\r\n\r\n"
        ),
    ],
)
def test_what_is_no_http_leaves_nothing_in_the_log(sent: bytes, capsys: pytest.CaptureFixture[str]) -> None:
    async def check(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(sent)
        assert (await reader.read()).startswith(b"HTTP/1.1 ")
        writer.close()

    run(check)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("later", [False, True])
def test_a_chunk_that_is_none_leaves_one_answer_and_nothing_in_the_log(
    later: bool, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    """Found by `python -m support.fuzz`: an answer before the body ends, and a body that ends wrongly."""

    async def check(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        # The route is for GET: it is answered, and the body is not waited for.
        writer.write(b"POST /big HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n5\r\nabcde\r\n")
        said = await reader.readuntil(b"\r\n\r\n") if later else b""
        writer.write(b"zz\r\n")
        with suppress(ConnectionError):
            said += await reader.read()
        assert said.count(b"HTTP/1.1 ") == 1
        assert said.startswith(b"HTTP/1.1 4")
        writer.close()

    run(check)
    assert capsys.readouterr().err == ""
    assert not [row for row in caplog.records if row.name == "asyncio"]


def test_text_that_is_no_utf_8_ends_its_websocket_and_leaves_nothing_in_the_log(
    capsys: pytest.CaptureFixture[str],
) -> None:
    async def check(port: int) -> None:
        async with connect(f"ws://127.0.0.1:{port}/echo") as web:
            await web.send(b"\xff\xfe", text=True)
            with pytest.raises(ConnectionClosedError) as closed:
                await web.recv()
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == 1007

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


BIG = b"GET /big HTTP/1.1\r\nHost: x\r\n\r\n"


async def open_deaf(port: int, text: bytes) -> socket.socket:
    """A connection that asks and never reads."""
    made = socket.socket()
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    made.setblocking(False)
    loop = asyncio.get_running_loop()
    await loop.sock_connect(made, ("127.0.0.1", port))
    await loop.sock_sendall(made, text)
    return made


@pytest.mark.parametrize("text", [BIG, 2 * BIG, ASK + BIG])
def test_answers_that_are_never_read_are_given_up(text: bytes) -> None:
    async def check(port: int) -> None:
        with ExitStack() as stack:
            for _ in range(20):
                stack.enter_context(await open_deaf(port, text))
            await asyncio.sleep(0.05)
            connections = SERVERS[-1].server_state.connections
            # The other end sees nothing of it: what it does not read is in the system.
            for _ in range(100):
                await asyncio.sleep(0.05)
                if not connections:
                    break
            assert not connections

    run(check)


def test_a_slow_reader_that_goes_on_gets_its_whole_answer() -> None:
    async def check(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port, limit=4096)
        writer.write(BIG.replace(b"\r\n\r\n", b"\r\nConnection: close\r\n\r\n"))
        length, begin_s = 0, time.monotonic()
        while data := await reader.read(1 << 20):
            length += len(data)
            if time.monotonic() - begin_s < 1.0:  # three times the limit
                await asyncio.sleep(0.01)
        assert length > 1000 * 65536
        writer.close()

    run(check)


def test_what_is_closed_but_for_answers_that_nobody_takes_is_ended() -> None:
    class Transport:
        closing, aborted = False, 0

        def is_closing(self) -> bool:
            return self.closing

        def abort(self) -> None:
            self.aborted += 1

    class Connection:
        def __init__(self) -> None:
            self.transport = Transport()

    async def check() -> None:
        made = server.make_server(Starlette(), Settings("127.0.0.1", 1, -1, None, None, (), Path(), Path()))
        open_, closing = Connection(), Connection()
        closing.transport.closing = True
        made.server_state.connections |= {open_, closing}  # type: ignore[arg-type]
        task = asyncio.create_task(made._tidy())
        await asyncio.sleep(0.2)
        assert not closing.transport.aborted
        await asyncio.sleep(0.4)
        task.cancel()
        assert closing.transport.aborted
        assert not open_.transport.aborted

    asyncio.run(check())


@pytest.mark.parametrize("together", [True, False])
def test_requests_before_the_answer_to_the_last_one_are_not_taken(together: bool) -> None:
    async def check(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        if together:
            writer.write(50 * ASK)
        else:
            writer.write(BIG)
            await reader.readuntil(b"\r\n\r\n")
            for _ in range(50):
                writer.write(ASK)
        answers = 0
        with suppress(ConnectionError):  # what was not taken is thrown away
            while data := await reader.read(1 << 20):
                answers += data.count(b"200 OK")
        assert answers == (1 if together else 0)  # the head of the big one has been read
        writer.close()

    run(check)


def test_two_lengths_end_the_connection() -> None:
    async def check(port: int) -> None:
        smuggling = f"POST / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Length: 6\r\n"
        smuggling += "Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n"
        answer = await until_closed_now(port, smuggling.encode() + ASK)
        assert answer.startswith(b"HTTP/1.1 400 ")
        assert answer.count(b"HTTP/1.1") == 1
        assert b"not both" in answer
        assert b"\r\nconnection: close\r\n" in answer.lower()  # alone, too: nothing after it is read

    run(check, guarded=True)


async def until_closed_now(port: int, text: bytes) -> bytes:
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(text)
    answer = b""
    with suppress(ConnectionError):
        while data := await reader.read(1 << 16):
            answer += data
    writer.close()
    return answer


async def answered(port: int) -> bytes:
    """An answer at the second attempt at the latest, as of a browser."""
    for last in (False, True):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        try:
            writer.write(ASK)
            return await reader.readuntil(b"hello")
        except (ConnectionError, asyncio.IncompleteReadError):
            if last:
                raise
        finally:
            writer.close()
    return b""


def test_an_answer_under_way_makes_no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "HEADER_S", PATIENCE_S)
    monkeypatch.setattr(server, "STUCK_S", PATIENCE_S)

    async def check(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port, limit=4096)
        writer.write(BIG.replace(b"\r\n\r\n", b"\r\nConnection: close\r\n\r\n"))
        await reader.readuntil(b"\r\n\r\n")
        with ExitStack() as stack:
            for _ in range(2 * CONNECTIONS):
                stack.enter_context(socket.create_connection(("127.0.0.1", port)))
                await asyncio.sleep(0.005)
            length = 0
            while data := await reader.read(1 << 20):
                length += len(data)
        assert length > 1000 * 65536
        writer.close()

    run(check)


@pytest.mark.parametrize("count", [300, pytest.param(1000, marks=pytest.mark.slow)])
def test_a_crowd_that_holds_connections_keeps_nobody_out(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    for module in (door, server):
        monkeypatch.setattr(module, "HEADER_S", PATIENCE_S)  # nothing ends by itself here

    async def check(port: int) -> None:
        crowd = await asyncio.create_subprocess_exec(
            sys.executable, HOSTILE, str(port), str(count), "x", stdout=asyncio.subprocess.PIPE
        )
        try:
            assert crowd.stdout is not None
            assert await crowd.stdout.readline() == b"holding\n"
            begin_s = time.monotonic()
            for _ in range(5):
                assert b"200 OK" in await answered(port)
            assert time.monotonic() - begin_s < PATIENCE_S / 2
        finally:
            crowd.kill()
            await crowd.wait()
        assert b"200 OK" in await answered(port)

    run(check)


def test_who_has_a_session_does_not_wait_behind_a_crowd(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(door, "HEADER_S", PATIENCE_S)

    async def check(port: int) -> None:
        with ExitStack() as stack:
            # All of them are there before the server has a turn.
            crowd = [stack.enter_context(socket.create_connection(("127.0.0.1", port))) for _ in range(401)]
            mine = crowd.pop(200)
            mine.sendall(ASK.replace(b"\r\n\r\n", b"\r\nCookie: mine\r\n\r\n"))
            for each in crowd:
                each.sendall(ASK)
                each.setblocking(False)
            mine.setblocking(False)
            assert b"200 OK" in await asyncio.get_running_loop().sock_recv(mine, 4096)
            # 64 are accepted in one turn, and so many have a turn each before the one with the session is seen.
            assert sum(map(answered_already, crowd)) < 50

    run(check)


def answered_already(client: socket.socket) -> bool:
    with suppress(BlockingIOError, ConnectionError):  # nothing yet, or it made room
        return b"200 OK" in client.recv(4096)
    return False


def test_the_session_is_found_in_what_a_connection_says_first(tmp_path: Path) -> None:
    settings = Settings("127.0.0.1", 1, -1, None, None, (), tmp_path, tmp_path)
    living = Session("f" * 32, "anna", Role.VIEWER, "anna", "", "", 0.0, 0.0)

    def session(request: HTTPConnection) -> Session | None:
        return living if request.cookies.get("session") == living.token else None

    found = Guard(Starlette(), settings, session).session_of
    said = f"GET / HTTP/1.1\r\nHost: x\r\ncookie: a=b; session={living.token}\r\n\r\n".encode()
    assert found(said) == f"session {living.token}"
    for other in (b"", ASK, b"\x16\x03\x01", said.replace(b"f", b"0"), said.replace(b"cookie", b"cake")):
        assert found(other) == ""


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


def test_what_a_client_says_of_its_address_is_not_believed() -> None:
    """Limits and the journal go by the address of the connection: anybody can write the header of a proxy."""

    async def check(port: int) -> None:
        for header in ("X-Forwarded-For: 192.0.2.9", "Forwarded: for=192.0.2.9", "X-Real-IP: 192.0.2.9"):
            asked = f"GET /who HTTP/1.1\r\nHost: x\r\n{header}\r\nConnection: close\r\n\r\n"
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(asked.encode())
            assert (await reader.read()).endswith(b"127.0.0.1")
            writer.close()

    run(check)


def test_a_head_without_an_end_ends_its_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    """16 KiB of it are kept, whatever comes behind them; the time of a request would be over much later."""
    for module in (door, server):
        monkeypatch.setattr(module, "HEADER_S", 1000.0)

    async def check(port: int) -> None:
        await until_closed(port, b"GET / HTTP/1.1\r\nHost: x\r\nX-Long: " + b"a" * 40_000)

    run(check)


@pytest.mark.parametrize(("size", "taken"), [(MESSAGE_MAX, True), (MESSAGE_MAX + 1, False)])
def test_a_message_of_a_websocket_has_a_longest_length(size: int, taken: bool) -> None:
    async def check(port: int) -> None:
        async with connect(f"ws://127.0.0.1:{port}/echo") as web:
            await web.send("x" * size)
            if taken:
                assert await web.recv() == "x" * size
            else:
                with pytest.raises(ConnectionClosedError) as closed:
                    await web.recv()
                assert closed.value.rcvd is not None
                assert closed.value.rcvd.code == 1009

    run(check)


def test_who_has_been_idle_for_longest_makes_room() -> None:
    places, closed = Places(4, loopback=3, remote=2), []
    first, second = places.take("192.0.2.7"), places.take("192.0.2.7")
    assert first is not None
    assert second is not None
    for name, each in (("second", second), ("first", first)):
        each.rest(lambda name=name: closed.append(name))  # type: ignore[misc]
    third = places.take("192.0.2.7")
    assert (third is not None, closed, second.mine) == (True, ["second"], False)
    first.work()
    assert places.take("192.0.2.7") is None  # both are in use
    # All together: the address with the most.
    assert [places.take("127.0.0.1") is not None for _ in range(3)] == [True, True, False]
    first.rest(lambda: closed.append("first"))
    assert places.take("198.51.100.1") is not None
    assert closed == ["second", "first"]


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
