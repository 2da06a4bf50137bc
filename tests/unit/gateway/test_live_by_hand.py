"""One WebSocket of a page, by hand: its turns, its room and its end."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest
from starlette.websockets import WebSocket

from gantryctl.gateway import live as live_module
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

    headers: Headers = [(b"host", HERE), (b"origin", b"HTTP://127.0.0.1:1"), JSON]
    socket = WebSocket({**scope(headers=headers), "type": "websocket", "extensions": {}}, nothing, nothing)
    asyncio.run(Live(access, access.hub).serve(socket))
    assert asked == [("anna", 16, 60.0)]


def test_a_page_that_is_gone_before_it_was_let_in_leaves_its_place(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else 64 of them would keep every later page of this machine out."""
    left: list[str] = []
    session = access.sessions.open(ANNA, "here")
    monkeypatch.setattr(access, "session", lambda _: session)
    monkeypatch.setattr(access.hub, "make_room", lambda *_: True)
    live = Live(access, access.hub)
    place = SimpleNamespace(leave=lambda: left.append("left"))
    monkeypatch.setattr(live, "_places", SimpleNamespace(take=lambda _: place))

    async def gone(*_: Any) -> Any:
        raise OSError("gone")

    headers: Headers = [(b"host", HERE), (b"origin", b"http://127.0.0.1:1"), JSON]
    socket = WebSocket({**scope(headers=headers), "type": "websocket", "extensions": {}}, gone, gone)
    with pytest.raises(OSError, match="gone"):
        asyncio.run(live.serve(socket))
    assert left == ["left"]


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


def test_each_end_has_the_code_that_the_page_knows() -> None:
    """`CLOSED` of hmi/src/lib/protocol.ts, and "policy violation" of RFC 6455."""
    codes = {name: getattr(live_module, name) for name in ("SESSION_ENDED", "TOO_SLOW", "TOO_MANY")}
    assert codes == {"SESSION_ENDED": 4401, "TOO_SLOW": 4408, "TOO_MANY": 4429}
    assert live_module.NOT_UNDERSTOOD == 1008


def test_a_close_that_nobody_takes_ends_after_a_second(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    waited: list[float] = []

    async def wait_for(work: Any, within_s: float) -> None:
        work.close()
        waited.append(within_s)
        raise TimeoutError

    async def ends(*_: Any) -> int:
        return 4401

    monkeypatch.setattr(live_module.asyncio, "wait_for", wait_for)
    live, session = Live(access, access.hub), access.sessions.open(ANNA, "here")
    monkeypatch.setattr(access, "session", lambda _: session)
    monkeypatch.setattr(live, "_run", ends)

    async def nothing(*_: Any) -> Any:
        return {"type": "websocket.connect"}

    headers: Headers = [(b"host", HERE), (b"origin", b"http://127.0.0.1:1")]
    asyncio.run(live.serve(WebSocket({**scope(headers=headers), "type": "websocket"}, nothing, nothing)))
    assert waited == [1.0]


def test_seventeen_pages_of_one_user_are_one_too_many(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where none of them may make room."""
    sent: list[Any] = []
    session = access.sessions.open(ANNA, "here")
    monkeypatch.setattr(access, "session", lambda _: session)
    for _ in range(16):
        access.hub.connect("anna", Role.OPERATOR, "console")

    async def nothing(*_: Any) -> Any:
        return {"type": "websocket.connect"}

    async def send(message: Any) -> None:
        sent.append(message)

    headers: Headers = [(b"host", HERE), (b"origin", b"http://127.0.0.1:1")]
    asked = {**scope(headers=headers), "type": "websocket", "extensions": {"websocket.http.response": {}}}
    asyncio.run(Live(access, access.hub).serve(WebSocket(asked, nothing, send)))
    assert (sent[0]["type"], sent[0]["status"]) == ("websocket.http.response.start", 429)


def test_a_message_without_letters_is_one(access: Access) -> None:
    """It is refused as any other that is no JSON; what is binary ends the connection."""
    taken: list[str] = []
    coming = [{"type": "websocket.receive", "text": ""}, {"type": "websocket.receive", "bytes": b"x"}]

    async def receive() -> dict[str, Any]:
        return coming.pop(0)

    socket, client = SimpleNamespace(receive=receive), SimpleNamespace(take=taken.append)
    code = asyncio.run(Live(access, access.hub)._receive(socket, client))  # type: ignore[arg-type]
    assert (taken, code) == ([""], 1008)


def test_a_page_that_was_used_a_moment_ago_is_in_use_when_its_session_is_judged(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else a page that only commands would end with the time in which nothing was read."""
    judged: list[float] = []
    session = access.sessions.open(ANNA, "here")
    client = access.hub.connect("anna", Role.OPERATOR, "console")
    client.used_s = session.used_s + 5.0
    client.show()

    async def send_text(_: str) -> None:
        pass

    monkeypatch.setattr(access.sessions, "lives", lambda each: judged.append(each.used_s))
    socket: Any = SimpleNamespace(send_text=send_text)
    assert asyncio.run(Live(access, access.hub)._send(socket, client, session)) == 4401
    assert judged == [client.used_s]
