"""What is no HTTP, or says two things at once, or has no end, ends its connection and fills no log."""

from __future__ import annotations

import asyncio
from contextlib import suppress

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosedError

from gantryctl.gateway import door, server
from gantryctl.service.protocol.limits import MESSAGE_MAX
from support.http_bench import ASK, BIG, run, until_closed, until_closed_now

pytestmark = pytest.mark.usefixtures("short_limits")


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
