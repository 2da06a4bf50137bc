"""One WebSocket of a page, by hand: its turns, its room and its end."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest
from starlette.websockets import WebSocket

from gantryctl.gateway.access import Access
from gantryctl.gateway.live import Live
from gantryctl.gateway.sessions import Session
from gantryctl.service.protocol.roles import Role
from support.gateway_by_hand import ANNA, HERE, JSON, Headers, scope


def test_a_page_that_was_unused_for_a_minute_makes_room_for_the_seventeenth(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(access.hub, "make_room", lambda *what: asked.append(what))
    session = access.sessions.open(ANNA, "here")
    monkeypatch.setattr(access, "session", lambda _: session)

    async def nothing(*_: Any) -> Any:
        return None

    headers: Headers = [(b"host", HERE), (b"origin", b"http://127.0.0.1:1"), JSON]
    socket = WebSocket({**scope(headers=headers), "type": "websocket", "extensions": {}}, nothing, nothing)
    asyncio.run(Live(access, access.hub).serve(socket))
    assert asked == [("anna", 16, 60.0)]


def test_between_two_messages_of_a_page_others_have_their_turn(access: Access) -> None:
    """All of them are there already."""
    taken: list[str] = []

    async def receive() -> dict[str, str]:
        if len(taken) >= 100:
            return {"type": "websocket.disconnect"}
        return {"type": "websocket.receive", "text": "x"}

    socket, client = SimpleNamespace(receive=receive), SimpleNamespace(take=taken.append)

    async def whole() -> None:
        work = asyncio.create_task(Live(access, access.hub)._receive(socket, client))  # type: ignore[arg-type]
        for turn in range(1, 5):
            await asyncio.sleep(0)
            assert len(taken) == turn
        work.cancel()

    asyncio.run(whole())


def test_a_connection_whose_parts_have_failed_is_closed_without_a_code(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    live = Live(access, access.hub)

    async def fails(*_: Any) -> int:
        raise RuntimeError("gone")

    monkeypatch.setattr(live, "_receive", fails)
    monkeypatch.setattr(live, "_send", fails)
    monkeypatch.setattr(access, "place", lambda _: "remote")
    session = Session("t", "anna", Role.OPERATOR, "", "", "here", 0.0, 0.0)
    assert asyncio.run(live._run(SimpleNamespace(), session)) is None  # type: ignore[arg-type]
    assert not access.hub.clients()
