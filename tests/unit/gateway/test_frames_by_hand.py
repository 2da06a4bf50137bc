"""A WebSocket on a wire that takes everything: how many frames of any kind are taken from it, and how it ends."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import pytest
import uvicorn
from uvicorn.server import ServerState

from gantryctl.gateway import server
from gantryctl.gateway.server import QuietWebSocket
from gantryctl.service.protocol.limits import RateLimiter
from support.gateway_by_hand import Clock
from unit.gateway.test_patience import Wire

TEXT, PING, PONG, CONTINUATION = 1, 9, 10, 0
HANDSHAKE = (
    b"GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
)
CLOSE_4429 = b"\x88\x02\x11\x4d"
"""Unmasked, with the code alone: 17 * 256 + 77 (RFC 6455, section 5.5.1)."""
PONG_EMPTY = b"\x8a\x00"


def frame(opcode: int, *, fin: bool = True) -> bytes:
    """One without data, masked with zeros."""
    return bytes([(0x80 if fin else 0) | opcode, 0x80, 0, 0, 0, 0])


class Deaf(Wire):
    """A wire that says what it has written since it was asked last."""

    def said(self) -> bytes:
        found, self.wrote = self.wrote, b""
        return found


Check = Callable[[QuietWebSocket, Deaf, list[Any], Clock], Awaitable[None]]


def opened(check: Check, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a check with an open WebSocket, what its application was told, and the time of its limits."""
    clock = Clock()
    monkeypatch.setattr(server, "RateLimiter", partial(RateLimiter, now=clock))

    async def whole() -> None:
        told: list[Any] = []

        async def app(_: Any, receive: Any, send: Any) -> None:
            while (message := await receive())["type"] != "websocket.disconnect":
                told.append(message)
                if message["type"] == "websocket.connect":
                    await send({"type": "websocket.accept"})
            told.append(message)

        config = uvicorn.Config(app, lifespan="off", log_level="critical", ws_ping_interval=None)
        config.load()
        made, wire = QuietWebSocket(config, ServerState(), {}), Deaf()
        made.connection_made(wire)
        made.data_received(HANDSHAKE)
        await turns()
        assert wire.said().startswith(b"HTTP/1.1 101 ")
        clock.s += 1.0  # the handshake counts too
        await check(made, wire, told, clock)
        made.connection_lost(None)
        await turns()

    asyncio.run(whole())


async def turns() -> None:
    for _ in range(5):
        await asyncio.sleep(0.0)


@pytest.mark.parametrize("opcode", [PING, PONG, CONTINUATION])
def test_a_flood_of_frames_that_are_no_messages_ends_its_connection(
    monkeypatch: pytest.MonkeyPatch, opcode: int
) -> None:
    """Four of them held the Stop of another page up for 1.6 s: 400 a second are taken, and no read takes more."""

    async def check(made: QuietWebSocket, wire: Deaf, told: list[Any], clock: Clock) -> None:
        if opcode == CONTINUATION:
            made.data_received(frame(TEXT, fin=False))
            clock.s += 1.0
        for _ in range(400):
            made.data_received(frame(opcode, fin=opcode != CONTINUATION))
        assert wire.said() == (400 * PONG_EMPTY if opcode == PING else b"")
        # 256 KiB at once, as TLS gives them. 340 to a piece: what is answered is less than two pieces.
        made.data_received(43_690 * frame(opcode, fin=opcode != CONTINUATION))
        said = wire.said()
        assert said.endswith(CLOSE_4429)
        assert said.count(PONG_EMPTY) <= 342
        made.data_received(frame(PING))
        await turns()
        assert (wire.said(), told[-1]["type"], wire.ended) == (b"", "websocket.disconnect", "")

    opened(check, monkeypatch)


def test_400_frames_come_again_after_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    async def check(made: QuietWebSocket, wire: Deaf, told: list[Any], clock: Clock) -> None:
        for _ in range(3):
            for _ in range(400):
                made.data_received(frame(PING))
            clock.s += 1.0
        assert wire.said() == 1200 * PONG_EMPTY

    opened(check, monkeypatch)


def test_who_floods_may_read_why_and_is_cut_off_after_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the application has closed already too: its close is not waited for while frames go on."""

    async def check(made: QuietWebSocket, wire: Deaf, told: list[Any], clock: Clock) -> None:
        later: list[tuple[float, Any]] = []
        await made.send({"type": "websocket.close", "code": 4401})
        wire.said()
        first, loop = made.close_timer, asyncio.get_running_loop()
        assert first is not None
        monkeypatch.setattr(loop, "call_later", lambda s, work: later.append((s, work)) or first)
        made.data_received(401 * frame(TEXT))
        made.data_received(frame(TEXT))  # it floods on
        monkeypatch.undo()
        assert first.cancelled()
        assert (wire.said(), wire.ended) == (b"", "")
        ((wait_s, cut_off),) = later
        cut_off()
        assert (wait_s, wire.ended) == (1.0, "aborted")

    opened(check, monkeypatch)


def test_a_flood_before_the_handshake_is_answered_is_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    async def check(made: QuietWebSocket, wire: Deaf, told: list[Any], clock: Clock) -> None:
        early, other = QuietWebSocket(made.config, ServerState(), {}), Deaf()
        early.connection_made(other)
        early.data_received(HANDSHAKE + 1000 * frame(PING))
        assert other.ended == "aborted"
        early.connection_lost(None)
        await turns()

    opened(check, monkeypatch)
