"""Clients that ask for nothing, or half of it, or never read their answer, are ended in time, and no others."""

from __future__ import annotations

import asyncio
import socket
import ssl
import time
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from starlette.applications import Starlette

from gantryctl.gateway import server
from gantryctl.gateway.settings import CONNECTIONS, Settings
from support.certificates import certificate
from support.http_bench import ASK, BIG, SERVERS, run, until_closed

pytestmark = pytest.mark.usefixtures("short_limits")
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
