"""One connection of the local socket without a socket: who it is, what it gets, and what ends it."""

from __future__ import annotations

import asyncio
import json
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.errors import StateError
from gantryctl.operation.store import SERVICE_SOCKET
from gantryctl.service.clients import local
from gantryctl.service.clients.hub import Flooded
from gantryctl.service.clients.local import LocalServer
from gantryctl.service.protocol.roles import Role

STATUS, REPLY = '{"type":"status","frame":"1-a"}', '{"type":"reply","seq":1}'


class Desk:
    """A server with a hub that writes down what it is asked, and one connection of a user with the number 4711."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.did: list[Any] = []
        self.lines: list[bytes | BaseException] = []
        self.waits: list[float | None] = []
        self.takes: BaseException | None = None
        self.texts = [STATUS, REPLY]
        self.places, self.room, self.breaks, self.tasks = 1, True, 99, 0
        self.patch, self.later = monkeypatch, list[Any]()
        self.client = SimpleNamespace(
            who="who", wake=asyncio.Event(), displaced=False, take=self.take, outgoing=self.outgoing
        )
        self.logins = SimpleNamespace(put=lambda *event: self.did.append(("login", *event)))
        hub: Any = self
        links: Any = SimpleNamespace(give=lambda uid: f"http://page/{uid}")
        self.server = LocalServer(Path("state"), hub, lambda user: f"person of {user}", links)
        monkeypatch.setattr(local, "peer", lambda _: (4711, "anna", Role.OPERATOR))
        monkeypatch.setattr(local.asyncio, "wait_for", self.wait_for)

    # The hub.
    def __len__(self) -> int:
        return self.places

    def make_room(self, user: str, *_: object) -> bool:
        return self.room

    def connect(self, *who: object) -> Any:
        self.did.append(("connected", *who))
        return self.client

    def leave(self, client: object) -> None:
        self.did.append("left")

    def welcome(self, _: object) -> str:
        return "welcome"

    # The client.
    def take(self, line: bytes) -> None:
        self.did.append(line)
        if self.takes is not None:
            raise self.takes

    def outgoing(self) -> list[str]:
        self.client.wake.clear()
        found, self.texts = self.texts, []
        return found

    # The connection.
    async def readline(self) -> bytes:
        await asyncio.sleep(0)  # what is to be sent is sent meanwhile
        await asyncio.sleep(0)
        line = self.lines.pop(0) if self.lines else b""
        if isinstance(line, BaseException):
            raise line
        return line

    async def wait_for(self, what: Any, within_s: float | None) -> Any:
        self.waits.append(within_s)
        return await what

    def serve(self, *lines: bytes | BaseException) -> list[Any]:
        self.lines = list(lines)
        reader: Any = SimpleNamespace(readline=self.readline)

        async def drain() -> None:
            pass

        writer: Any = SimpleNamespace(
            get_extra_info=lambda _: None,
            write=lambda data: self.did.append(("sent", data)),
            close=lambda: self.did.append("closed"),
            drain=drain,
            transport=SimpleNamespace(abort=lambda: self.did.append("aborted"), is_closing=self.is_broken),
        )
        self.client.wake.set()

        async def whole() -> None:
            loop = asyncio.get_running_loop()
            later, at_end = loop.call_later, local._SEND_S
            self.patch.setattr(
                loop,
                "call_later",
                lambda s, do, *how: self.later.append(do) if s == at_end else later(s, do, *how),
            )
            await self.server._serve(reader, writer)
            self.tasks = len(asyncio.all_tasks())

        asyncio.run(whole())
        return self.did

    def is_broken(self) -> bool:
        return len(self.sent()) >= self.breaks

    def sent(self) -> list[bytes]:
        return [each[1] for each in self.did if each[0] == "sent"]


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch) -> Desk:
    return Desk(monkeypatch)


def line(**first: bool) -> bytes:
    return json.dumps(first).encode() + b"\n"


def test_who_comes_is_whom_the_system_names_at_the_machine_with_his_person(desk: Desk) -> None:
    did = desk.serve(line(watch=True), b"one\n")
    assert did[:2] == [
        ("connected", "anna", Role.OPERATOR, "local", "person of anna"),
        ("login", "anna at the local socket", "who"),
    ]
    assert b"one\n" in did
    assert did[-2:] == ["left", "closed"]
    # Who does not read the last replies keeps no handle: five seconds later it is cut off.
    (cut_off,) = desk.later
    cut_off()
    assert did[-1] == "aborted"


def test_a_connection_that_has_ended_is_written_to_no_more(desk: Desk) -> None:
    """Each text would be a line in the log of the service, which any user of the socket could fill."""
    desk.breaks, desk.texts = 2, 9 * [REPLY]
    desk.serve(line(watch=True), b"one\n", b"two\n")
    assert desk.sent() == [b"welcome\n", REPLY.encode() + b"\n"]


def test_nothing_that_sends_is_left_to_the_garbage_collector(desk: Desk) -> None:
    desk.serve(line(watch=True), b"one\n")
    assert desk.tasks == 1


def test_the_link_is_for_the_user_who_asks_and_in_the_journal(desk: Desk) -> None:
    did = desk.serve(line(console=True), b"never read\n")
    assert did[2:] == [
        ("login", "asked for a link to the page as the console", "who"),
        ("sent", b'{"link":"http://page/4711"}\n'),
        "left",
        "closed",
    ]


@pytest.mark.parametrize("watch", [True, False])
def test_only_who_watches_gets_frames_and_may_be_silent(desk: Desk, watch: bool) -> None:
    desk.serve(line(watch=watch), b"one\n", b"two\n")
    frames = [STATUS.encode() + b"\n"] if watch else []
    assert desk.sent() == [b"welcome\n", *frames, REPLY.encode() + b"\n"]
    # The first line has 5 s, each one of a connection that does not watch a minute; so has what is sent 5 s.
    idle = [each for each in desk.waits if each != local._SEND_S]
    assert idle == [None if watch else local._IDLE_S] * 3


@pytest.mark.parametrize(
    "ends", [Flooded(), TimeoutError(), ConnectionResetError(), ValueError("a line without an end")]
)
def test_whatever_ends_it_gives_control_back(desk: Desk, ends: BaseException) -> None:
    desk.takes = ends
    assert desk.serve(line(watch=True), b"one\n", b"two\n")[-2:] == ["left", "closed"]
    assert b"two\n" not in desk.did


def test_one_that_makes_room_is_cut_off(desk: Desk) -> None:
    desk.client.displaced = True
    did = desk.serve(line(watch=True), b"one\n")
    assert did.index("aborted") < did.index(b"one\n")
    assert desk.sent() == [b"welcome\n"]


@pytest.mark.parametrize(("places", "room"), [(local._CONNECTIONS, True), (1, False)])
def test_where_there_is_no_place_nobody_is_connected(desk: Desk, places: int, room: bool) -> None:
    desk.places, desk.room = places, room
    assert desk.serve(line(watch=True)) == ["closed"]


def test_the_socket_is_there_while_the_service_is(tmp_path: Path) -> None:
    """One that a killed service has left is in nobody's way."""
    hub: Any = None
    links: Any = None
    path = tmp_path / SERVICE_SOCKET

    async def once() -> None:
        server = LocalServer(tmp_path, hub, str, links)
        path.write_bytes(b"left over")
        await server.start()
        assert path.is_socket()
        server.close()
        assert not path.exists()

    asyncio.run(once())


@pytest.mark.parametrize(
    ("uid", "role"), [(0, Role.SERVICE), (1000, Role.SERVICE), (1, Role.OPERATOR), (1001, Role.OPERATOR)]
)
def test_the_service_role_is_that_of_root_and_of_the_user_of_the_service(
    monkeypatch: pytest.MonkeyPatch, uid: int, role: Role
) -> None:
    monkeypatch.setattr(local, "os", SimpleNamespace(getuid=lambda: 1000))
    connection: Any = SimpleNamespace(getsockopt=lambda *_: struct.pack("3i", 77, uid, 5))
    found = local.peer(connection)
    assert (found[0], found[2]) == (uid, role)


def test_what_sends_to_a_connection_ends_with_it(desk: Desk) -> None:
    serve = desk.server._serve

    async def sends(*_: Any, **__: Any) -> None:
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            desk.did.append("sender ended")
            raise

    async def watched(*ends: Any) -> None:
        await serve(*ends)
        await asyncio.sleep(0)
        desk.did.append("a turn later")

    desk.server._send = sends  # type: ignore[method-assign]
    desk.server._serve = watched  # type: ignore[method-assign]
    assert desk.serve(line(watch=True), b"one\n")[-2:] == ["sender ended", "a turn later"]


def test_a_line_of_the_socket_has_16_kib_and_a_folder_that_is_not_there_is_told(
    desk: Desk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits: list[Any] = []

    async def start(_: Any, *, sock: Any, limit: int) -> Any:
        sock.close()
        limits.append(limit)
        return SimpleNamespace(close=lambda: None)

    monkeypatch.setattr(local.asyncio, "start_unix_server", start)
    desk.server._directory = tmp_path
    asyncio.run(desk.server.start())
    assert limits == [16_384]
    desk.server.close()
    desk.server._directory = tmp_path / "none"
    with pytest.raises(StateError, match=f"{SERVICE_SOCKET}: No such file or directory"):
        asyncio.run(desk.server.start())
