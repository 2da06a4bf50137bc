"""One connection of HTTP on a wire that takes everything: its place, its patience, and when both are given back."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from itertools import count
from typing import Any

import pytest
import uvicorn
from uvicorn.server import ServerState

from gantryctl.gateway import server
from gantryctl.gateway.places import Place
from gantryctl.gateway.server import PatientProtocol


class Wire(asyncio.Transport):
    """The transport of a connection: what was written, and whether it was ended."""

    def __init__(self) -> None:
        super().__init__({"peername": ("192.0.2.7", 1), "sockname": ("127.0.0.1", 2)})
        self.wrote, self.ended = b"", ""

    def write(self, data: Any) -> None:
        self.wrote += data

    def is_closing(self) -> bool:
        return bool(self.ended)

    def close(self) -> None:
        self.ended = self.ended or "closed"

    def abort(self) -> None:
        self.ended = self.ended or "aborted"

    def pause_reading(self) -> None:
        pass

    def resume_reading(self) -> None:
        pass


async def app(scope: Any, receive: Any, send: Any) -> None:
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"2")]})
    await send({"type": "http.response.body", "body": b"ok"})


GET = b"GET / HTTP/1.1\r\nhost: x\r\n\r\n"


def connected(check: Callable[[PatientProtocol, Wire, Place], Any], given: list[Place]) -> None:
    """Run a check in an event loop with a new connection; `given` has the places that came back."""

    async def whole() -> None:
        config = uvicorn.Config(app, lifespan="off", log_level="critical")
        config.load()
        place, wire = Place(given.append, "here", count(7)), Wire()
        made = PatientProtocol(config=config, server_state=ServerState(), app_state={}, place=place)
        made.connection_made(wire)
        try:
            await check(made, wire, place)
        finally:
            made.connection_lost(None)  # the application waits for nobody
            await asyncio.sleep(0.0)

    asyncio.run(whole())


@pytest.fixture
def given() -> list[Place]:
    return []


def test_a_connection_that_ends_gives_its_place_back_once(given: list[Place]) -> None:
    async def check(made: PatientProtocol, wire: Wire, place: Place) -> None:
        assert not given
        made.connection_lost(None)
        made.connection_lost(None)

    connected(check, given)
    assert len(given) == 1


def test_drops_of_a_request_do_not_make_a_connection_less_idle(given: list[Place]) -> None:
    """Who has been idle for longest makes room: from when it came until its request is whole, and behind its answer."""

    async def check(made: PatientProtocol, wire: Wire, place: Place) -> None:
        assert place.idle == 7
        for part in (GET[:5], GET[5:9]):
            made.data_received(part)
            assert place.idle == 7
        made.data_received(GET[9:])
        assert place.idle is None
        await asyncio.sleep(0.01)
        assert wire.wrote.endswith(b"ok")
        assert place.idle == 8
        made.data_received(GET)
        assert place.idle is None

    connected(check, given)


def test_who_makes_room_is_cut_off(given: list[Place]) -> None:
    async def check(made: PatientProtocol, wire: Wire, place: Place) -> None:
        place.end()
        assert wire.ended == "aborted"

    connected(check, given)
    assert len(given) == 1


@pytest.mark.parametrize(
    "asks", [b"", GET[:9], b"POST / HTTP/1.1\r\nhost: x\r\ncontent-length: 9\r\n\r\nhal"]
)
def test_a_request_that_is_not_whole_in_time_is_cut_off(
    monkeypatch: pytest.MonkeyPatch, given: list[Place], asks: bytes
) -> None:
    monkeypatch.setattr(server, "HEADER_S", 0.02)

    async def check(made: PatientProtocol, wire: Wire, place: Place) -> None:
        if asks:
            made.data_received(asks)
        await asyncio.sleep(0.015)
        # A second drop gives it no second time.
        if asks:
            made.data_received(b"x")
        await asyncio.sleep(0.01)
        assert wire.ended == "aborted"

    connected(check, given)


def test_a_request_that_is_whole_has_all_the_time_for_its_answer(
    monkeypatch: pytest.MonkeyPatch, given: list[Place]
) -> None:
    monkeypatch.setattr(server, "HEADER_S", 0.02)

    async def check(made: PatientProtocol, wire: Wire, place: Place) -> None:
        made.pause_writing()  # nobody takes the answer yet
        made.data_received(GET)
        await asyncio.sleep(0.05)
        assert wire.ended == ""

    connected(check, given)


@pytest.mark.parametrize("goes_on", [True, False])
def test_an_answer_that_nobody_takes_is_cut_off(
    monkeypatch: pytest.MonkeyPatch, given: list[Place], goes_on: bool
) -> None:
    monkeypatch.setattr(server, "STUCK_S", 0.02)

    async def check(made: PatientProtocol, wire: Wire, place: Place) -> None:
        made.data_received(GET)
        made.pause_writing()
        if goes_on:
            made.resume_writing()
        await asyncio.sleep(0.05)
        assert wire.ended == ("" if goes_on else "aborted")

    connected(check, given)
