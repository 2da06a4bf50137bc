"""The door of the page: who finds no place, whose handshake fails, what is ended for whom; without a network."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
import uvicorn

from gantryctl.gateway import door as module
from gantryctl.gateway.door import Door
from gantryctl.gateway.settings import HEADER_S, STUCK_S


class Connection:
    """A socket that was accepted."""

    def __init__(self, head: bytes = b"") -> None:
        self.closed, self.head, self.blocks = 0, head, True
        self.transport: Any = None

    def close(self) -> None:
        self.closed += 1

    def setblocking(self, blocks: bool) -> None:
        self.blocks = blocks

    def recv(self, _: int, flags: int) -> bytes:
        # What is looked at stays in the kernel.
        assert flags == module.socket.MSG_PEEK
        return self.head

    def getsockname(self) -> tuple[str, int]:
        return ("127.0.0.1", 1)


class Room:
    """Those that wait, in their order."""

    def __init__(self) -> None:
        self.waiting: deque[Any] = deque()
        self.added: list[tuple[Any, str, str]] = []
        self.closed = self.closed_with = 0

    def add(self, connection: Any, address: str, party: str) -> None:
        self.added.append((connection, address, party))
        if address == "broken":
            raise MemoryError
        self.waiting.append(SimpleNamespace(connection=connection, address=address))

    def next(self) -> Any:
        return self.waiting.popleft() if self.waiting else None

    def close(self) -> None:
        self.closed += 1
        self.closed_with = len(self.waiting)


def with_door(check: Callable[[Door, Room], Any], session_of: Callable[[bytes], str] = lambda _: "") -> None:
    """Run a check in an event loop with a door of no network."""

    async def whole() -> None:
        config = uvicorn.Config(lambda: None, lifespan="off", log_level="critical")
        config.load()
        made: Any = Door(config, session_of)
        made._waiting = room = Room()
        made.lifespan = SimpleNamespace(state={})
        await check(made, room)

    asyncio.run(whole())


async def turns(count: int = 5) -> None:
    for _ in range(count):
        await asyncio.sleep(0)


# --- places -------------------------------------------------------------------------------------------


def test_who_finds_no_place_is_closed_and_the_next_one_has_its_turn() -> None:
    async def check(door: Any, room: Room) -> None:
        greeted: list[Any] = []

        async def greet(connection: Any, place: str) -> None:
            greeted.append((connection, place))

        door._greet = greet
        door._places = SimpleNamespace(
            take=lambda address: None if address == "full" else f"place of {address}"
        )
        refused, taken = Connection(), Connection()
        for connection, address in ((refused, "full"), (taken, "free")):
            door._add(connection, (address, 7))
            assert not connection.blocks
        work = asyncio.create_task(door._let_in())
        await turns()
        assert (refused.closed, taken.closed) == (1, 0)
        assert greeted == [(taken, "place of free")]
        # One that comes later wakes it up.
        later = Connection()
        door._add(later, ("free", 8))
        await turns()
        assert greeted[-1] == (later, "place of free")
        work.cancel()

    with_door(check)


def test_one_that_no_memory_is_left_for_is_closed_and_the_next_one_has_its_turn() -> None:
    async def check(door: Any, room: Room) -> None:
        greeted: list[Any] = []

        async def greet(connection: Any, _: str) -> None:
            greeted.append(connection)

        def take(address: str) -> str:
            if address == "large":
                raise MemoryError
            return "a place"

        door._greet, door._places = greet, SimpleNamespace(take=take)
        large, sound = Connection(), Connection()
        for connection, address in ((large, "large"), (sound, "sound")):
            door._add(connection, (address, 7))
        work = asyncio.create_task(door._let_in())
        await turns()
        assert (large.closed, sound.closed, greeted) == (1, 0, [sound])
        work.cancel()

    with_door(check)


def test_one_that_is_broken_is_closed_and_keeps_no_other_away() -> None:
    """Whatever it raises."""

    async def check(door: Any, room: Room) -> None:
        broken, sound = Connection(), Connection()
        door._add(broken, ("broken", 1))
        door._add(sound, ("sound", 2))
        door._sort()
        assert (broken.closed, sound.closed) == (1, 0)
        assert [each.address for each in room.waiting] == ["sound"]

    with_door(check)


def test_a_connection_is_of_its_session_and_else_of_its_peer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "peer_of", lambda ends: f"peer {ends['client'][0]} at {ends['server'][1]}")

    async def check(door: Any, room: Room) -> None:
        for head in (b"cookie", b"nothing"):
            door._add(Connection(head), ("192.0.2.7", 9))
        door._sort()
        assert [party for _, _, party in room.added] == ["session 1", "peer 192.0.2.7 at 1"]

    with_door(check, lambda head: "session 1" if head == b"cookie" else "")


def test_a_client_that_has_left_the_queue_ends_nothing() -> None:
    """The next one is taken."""

    async def check(door: Any, _: Room) -> None:
        taken = Connection()
        found: list[Any] = [ConnectionAbortedError(), (taken, ("192.0.2.7", 1)), asyncio.CancelledError()]

        async def accept(_: object) -> Any:
            each = found.pop(0)
            if isinstance(each, BaseException):
                raise each
            return each

        def no_more() -> Any:
            raise BlockingIOError

        asyncio.get_running_loop().sock_accept = accept  # type: ignore[method-assign, assignment]
        with pytest.raises(asyncio.CancelledError):
            await door._take(SimpleNamespace(accept=no_more))
        assert [connection for connection, _ in door._arrivals] == [taken]

    with_door(check)


def test_a_thousand_wait_for_their_places_and_each_for_5_s() -> None:
    async def whole() -> None:
        made: Any = Door(uvicorn.Config(lambda: None))
        assert (made._waiting._most, made._waiting._patience_s) == (1024, 5.0)

    asyncio.run(whole())


# --- handshakes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fault", "kept"), [(None, True), (OSError("no TLS"), False), (ValueError("?"), False)]
)
@pytest.mark.parametrize("secure", [True, False])
def test_a_handshake_that_fails_gives_back_its_place_and_its_socket(
    fault: Exception | None, kept: bool, secure: bool
) -> None:
    async def check(door: Any, _: Room) -> None:
        left: list[str] = []
        given: dict[str, Any] = {}

        async def accepted(__: Any, ___: Any, **how: Any) -> None:
            given.update(how)
            if fault is not None:
                raise fault

        asyncio.get_running_loop().connect_accepted_socket = accepted  # type: ignore[method-assign, assignment]
        door.config.ssl = "TLS" if secure else None
        connection = Connection()
        task = asyncio.create_task(
            door._greet(connection, SimpleNamespace(leave=lambda: left.append("left")))
        )
        await asyncio.wait([task])
        assert isinstance(task.exception(), ValueError) is isinstance(fault, ValueError)
        assert (left, connection.closed) == (([], 0) if kept else (["left"], 1))
        times = {name: given.get(name) for name in ("ssl_handshake_timeout", "ssl_shutdown_timeout")}
        assert set(times.values()) == {HEADER_S if secure else None}

    with_door(check)


@pytest.mark.parametrize(("cancelled", "closed"), [(True, 1), (False, 0)])
def test_only_a_greeting_that_was_cancelled_closes_its_connection(cancelled: bool, closed: int) -> None:
    connection: Any = Connection()
    module._close_cancelled(connection, SimpleNamespace(cancelled=lambda: cancelled))  # type: ignore[arg-type]
    assert connection.closed == closed


def test_a_door_that_begins_takes_connections_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """Uvicorn gets no socket: it would accept without any limit by address. One that blocks would hold up the loop."""
    did: list[Any] = []

    async def startup(_: object, sockets: list[Any]) -> None:
        did.append(("application", sockets))

    monkeypatch.setattr(uvicorn.Server, "startup", startup)

    def part(name: str) -> Callable[..., Any]:
        async def work(*what: Any) -> None:
            did.append((name, *what))

        return work

    async def check(door: Any, _: Room) -> None:
        door._take, door._let_in, door._tidy = part("takes"), part("lets in"), part("tidies")
        listener = Connection()
        await door.startup([listener])
        await turns()
        assert did == [("application", []), ("takes", listener), ("lets in",), ("tidies",)]
        assert not listener.blocks

    with_door(check)


def test_who_has_said_nothing_yet_is_of_its_peer(monkeypatch: pytest.MonkeyPatch) -> None:
    """And waits as others do; each arrival is sorted once."""
    monkeypatch.setattr(module, "peer_of", lambda _: "peer")

    class Silent(Connection):
        def recv(self, size: int, flags: int) -> bytes:
            raise BlockingIOError

    async def check(door: Any, room: Room) -> None:
        silent = Silent()
        door._add(silent, ("192.0.2.7", 9))
        door._sort()
        door._sort()
        assert (silent.closed, [party for _, _, party in room.added]) == (0, ["peer"])

    with_door(check)


# --- what is ended ------------------------------------------------------------------------------------


def test_only_a_connection_that_has_been_closing_for_5_s_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [100.0]
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now_s[0]))

    real_sleep = asyncio.sleep

    async def no_time(_: float) -> None:
        await real_sleep(0)

    monkeypatch.setattr(module.asyncio, "sleep", no_time)

    async def check(door: Any, _: Room) -> None:
        ended: list[str] = []

        def one(name: str, closing: bool) -> Any:
            made = Connection()
            made.transport = SimpleNamespace(is_closing=lambda: closing, abort=lambda: ended.append(name))
            return made

        door.server_state = SimpleNamespace(connections=[one("stuck", True), one("at work", False)])
        work = asyncio.create_task(door._tidy())
        for passed_s, found in ((0.0, []), (STUCK_S - 1.0, []), (2.0, ["stuck"])):
            now_s[0] += passed_s
            for _ in range(3):
                await real_sleep(0)
            assert sorted(set(ended)) == found
        work.cancel()

    with_door(check)


def test_a_door_that_ends_takes_nobody_more_and_closes_those_that_wait(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def nothing(*_: object) -> None:
        pass

    monkeypatch.setattr(uvicorn.Server, "shutdown", nothing)

    async def check(door: Any, room: Room) -> None:
        work = door._keep(asyncio.sleep(3600.0))
        arrived = Connection()
        door._add(arrived, ("sound", 1))
        await door.shutdown()
        await turns()
        assert work.cancelled()
        assert not door._tasks
        # Those of the last moment are closed with the others.
        assert [each.connection for each in room.waiting] == [arrived]
        assert room.closed == 1
        assert room.closed_with == 1

    with_door(check)


def test_a_door_without_handles_pauses_and_says_so_once_a_minute(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    now_s, slept = [100.0], list[float]()
    real_sleep = asyncio.sleep
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now_s[0]))

    async def sleep(time_s: float) -> None:
        slept.append(time_s)
        now_s[0] += 25.0
        if len(slept) == 4:
            raise asyncio.CancelledError
        await real_sleep(0)

    monkeypatch.setattr(module.asyncio, "sleep", sleep)
    monkeypatch.setattr(module, "_LOG", logging.getLogger("door"))

    async def check(door: Any, _: Room) -> None:
        async def none(__: object) -> None:
            raise OSError("too many open files")

        asyncio.get_running_loop().sock_accept = none  # type: ignore[method-assign, assignment]
        with pytest.raises(asyncio.CancelledError):
            await door._take(SimpleNamespace())

    with_door(check)
    assert slept == [0.2] * 4
    # At 0, 25, 50 and 75 s.
    assert len(caplog.records) == 2
