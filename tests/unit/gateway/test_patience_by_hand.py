"""Connections that pause, drip or storm, by hand."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.gateway import server
from gantryctl.gateway.places import Place
from gantryctl.gateway.server import PatientProtocol
from unit.gateway import test_patience
from unit.gateway.test_door_by_hand import Connection, with_door
from unit.gateway.test_patience import GET, Wire, connected


def test_a_second_pause_of_an_answer_has_its_whole_time_and_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "STUCK_S", 0.03)

    async def check(made: PatientProtocol, wire: Wire, place: Place) -> None:
        made.data_received(GET)
        made.pause_writing()
        made.pause_writing()
        made.resume_writing()
        await asyncio.sleep(0.05)
        assert wire.ended == ""
        made.pause_writing()
        await asyncio.sleep(0.05)
        assert wire.ended == "aborted"

    connected(check, [])


def test_the_time_of_the_first_request_begins_with_its_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever says nothing for four seconds has one left."""
    monkeypatch.setattr(server, "HEADER_S", 0.04)

    async def check(made: PatientProtocol, wire: Wire, place: Place) -> None:
        await asyncio.sleep(0.03)
        made.data_received(GET[:5])
        await asyncio.sleep(0.02)
        assert wire.ended == "aborted"

    connected(check, [])


def test_who_waits_for_a_body_that_is_no_http_is_told_that_it_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """A chunk without a length: the application gets no more of it, and must not wait."""
    got: list[str] = []

    async def app(_: Any, receive: Any, send: Any) -> None:
        while not got or got[-1] == "http.request":
            got.append((await receive())["type"])

    monkeypatch.setattr(test_patience, "app", app)

    async def check(made: PatientProtocol, wire: Wire, place: Place) -> None:
        made.data_received(b"POST / HTTP/1.1\r\nhost: x\r\ntransfer-encoding: chunked\r\n\r\n3\r\nabc\r\n")
        for _ in range(3):
            await asyncio.sleep(0)
        assert got == ["http.request"]
        made.data_received(b"no length\r\n")
        for _ in range(3):
            await asyncio.sleep(0)
        assert got == ["http.request", "http.disconnect"]
        assert b" 400 " in wire.wrote.partition(b"\r\n")[0]

    connected(check, [])


def test_a_storm_of_connections_leaves_the_loop_to_others_after_sixteen() -> None:
    async def check(door: Any, _: Any) -> None:
        taken: list[int] = []

        def accept() -> tuple[Any, tuple[str, int]]:
            if len(taken) >= 200:
                raise asyncio.CancelledError
            taken.append(1)
            return Connection(), ("192.0.2.7", 1)

        async def sock_accept(listener: Any) -> Any:
            return listener.accept()

        asyncio.get_running_loop().sock_accept = sock_accept  # type: ignore[method-assign, assignment]
        work = asyncio.create_task(door._take(SimpleNamespace(accept=accept)))
        for turn in (1, 2):
            await asyncio.sleep(0)
            assert len(taken) == 16 * turn
        work.cancel()

    with_door(check)


def test_a_cookie_behind_long_headers_names_the_party() -> None:
    """4 KiB of a request are looked at."""

    class Head(Connection):
        def recv(self, size: int, flags: int) -> bytes:
            return super().recv(size, flags)[:size]

    async def check(door: Any, room: Any) -> None:
        for length in (4090, 4100):
            door._add(Head(b"x" * length + b"cookie"), ("192.0.2.7", 9))
        door._sort()
        assert [party for _, _, party in room.added] == ["session 1", "192.0.2.7"]

    with_door(check, lambda head: "session 1" if head.endswith(b"cookie") else "")


def test_a_connection_is_read_16_kib_at_a_time() -> None:
    """As much as a message may have: between two of them others have their turn."""

    async def check(made: PatientProtocol, wire: Any, place: Place) -> None:
        assert wire.max_size == 16_384

    connected(check, [])
