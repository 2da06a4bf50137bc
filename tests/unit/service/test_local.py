"""The local socket: nobody holds places there that others need."""

from __future__ import annotations

import asyncio
import json
import os
import pwd
import socket
import struct
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from gantryctl.operation.store import SERVICE_SOCKET
from gantryctl.service.clients import local
from gantryctl.service.clients.console_link import PATH, LinkGiver, LinkTaker
from gantryctl.service.clients.hub import Hub
from gantryctl.service.clients.local import LocalServer
from gantryctl.service.memory.memory import SharedMemory, Source
from gantryctl.service.protocol.limits import LINK_S
from gantryctl.service.protocol.roles import Role

PAGE = "http://127.0.0.1:8650/"
OF_USER = local._CONNECTIONS_OF_USER


@asynccontextmanager
async def serving(folder: Path) -> AsyncIterator[Hub]:
    memory = SharedMemory.create()
    hub = Hub(memory, Source.LOCAL)
    server = LocalServer(folder, hub, str, LinkGiver(memory.words, PAGE))
    await server.start()
    task = asyncio.create_task(hub.run())
    yield hub
    task.cancel()
    server.close()
    for client in hub.clients():
        hub.leave(client)
    await asyncio.sleep(0.05)
    memory.close()


def run(folder: Path, check: Callable[[Hub, Path], Awaitable[None]]) -> None:
    async def whole() -> None:
        async with serving(folder) as hub:
            await asyncio.wait_for(check(hub, folder / SERVICE_SOCKET), 30.0)

    asyncio.run(whole())


async def connect(path: Path, *, watch: bool) -> tuple[asyncio.StreamReader, asyncio.StreamWriter, str]:
    reader, writer = await asyncio.open_unix_connection(path)
    writer.write(json.dumps({"watch": watch}).encode() + b"\n")
    with suppress(ConnectionError):
        line = await asyncio.wait_for(reader.readline(), 5.0)
        return reader, writer, json.loads(line)["client"] if line else ""
    return reader, writer, ""


async def ended(reader: asyncio.StreamReader, within_s: float = 5.0) -> bool:
    with suppress(ConnectionError, TimeoutError):
        async with asyncio.timeout(within_s):
            while await reader.read(65536):
                pass
        return True
    return reader.at_eof() or reader.exception() is not None


def test_who_was_unused_for_longest_makes_room_and_who_has_control_does_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def check(hub: Hub, path: Path) -> None:
        made = [await connect(path, watch=True) for _ in range(OF_USER)]
        _, writer, name = await connect(path, watch=True)
        assert name == ""  # all are in use
        writer.close()
        monkeypatch.setattr(local, "_UNUSED_S", 0.0)
        hub.look = lambda: None  # type: ignore[method-assign]
        hub._slow["authority_client"] = made[0][2]
        more = await connect(path, watch=True)
        assert more[2] != ""
        assert await ended(made[1][0])
        assert not await ended(made[0][0], 0.3)
        for _, each, _ in (*made, more):
            each.close()

    run(tmp_path, check)


def test_a_connection_that_neither_watches_nor_says_anything_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(local, "_IDLE_S", 0.3)

    async def check(_: Hub, path: Path) -> None:
        idle, watching = await connect(path, watch=False), await connect(path, watch=True)
        assert await ended(idle[0])
        assert not await ended(watching[0], 0.6)
        for _, writer, _ in (idle, watching):
            writer.close()

    run(tmp_path, check)


def test_a_first_line_of_brackets_ends_the_connection_and_nothing_else(tmp_path: Path) -> None:
    """Deeper than JSON is read: an exception that nobody takes would be a traceback in the log of the service."""
    told: list[object] = []

    async def check(hub: Hub, path: Path) -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: told.append(context))
        reader, writer = await asyncio.open_unix_connection(path)
        writer.write(b"[" * 8000 + b"\n")
        assert await ended(reader)
        assert len(hub) == 0
        writer.close()

    run(tmp_path, check)
    assert told == []


def test_a_watcher_that_reads_nothing_is_closed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local, "_SEND_S", 0.3)
    monkeypatch.setattr(Hub, "status_text", lambda *_, **__: "x" * 100_000)

    async def check(hub: Hub, path: Path) -> None:
        _, writer, name = await connect(path, watch=True)
        assert name
        for _ in range(200):
            await asyncio.sleep(0.02)
            if not hub.clients():
                break
        assert not hub.clients()
        writer.close()

    run(tmp_path, check)


@pytest.mark.parametrize(
    ("uid", "name", "role"),
    [
        (0, "root", Role.SERVICE),
        (4242, "uid 4242", Role.OPERATOR),
        (os.getuid(), pwd.getpwuid(os.getuid()).pw_name, Role.SERVICE),
    ],
)
def test_name_and_role_are_what_the_system_says_of_the_other_end(uid: int, name: str, role: Role) -> None:
    class Connection:
        def getsockopt(self, level: int, option: int, size: int) -> bytes:
            assert (level, option) == (socket.SOL_SOCKET, socket.SO_PEERCRED)
            return struct.pack("3i", 1, uid, 1)[:size]

    connection: Any = Connection()
    assert local.peer(connection) == (uid, name, role)


def test_a_link_to_the_console_is_for_whoever_asked_once_and_for_a_minute() -> None:
    words, now = memoryview(bytearray(512)).cast("Q"), [1_000]
    giver = LinkGiver(words, PAGE, lambda: now[0])
    taker = LinkTaker(words, lambda: now[0])

    def given(uid: int) -> str:
        now[0] += 1
        link = giver.give(uid)
        assert link.startswith(PAGE.rstrip("/") + PATH)
        return link.removeprefix(PAGE.rstrip("/") + PATH)

    assert not taker.take("0" * 16, 0)  # before the first link
    first = given(1000)
    for wrong in ("", "0" * 16, first[:-1], first.upper() + " ", "\u00e9", first[::-1] + "0"):
        assert not taker.take(wrong, 1000)
    assert not taker.take(first, 1001)  # opened by another user: a proxy, say
    assert taker.take(first, 1000)
    assert not taker.take(first, 1000)
    older, newer = given(1000), given(1000)
    assert not taker.take(older, 1000)
    assert taker.take(newer, 1000)
    late = given(1000)
    now[0] += round(LINK_S * 1e9)
    assert not taker.take(late, 1000)
    # A gateway that is started again does not know what was used: nothing from before it is good.
    used = given(1000)
    assert taker.take(used, 1000)
    now[0] += 1
    again = LinkTaker(words, lambda: now[0])
    assert not again.take(used, 1000)
    assert again.take(given(1000), 1000)
    assert LinkGiver(words, "").give(1000) == ""


def test_who_comes_to_the_console_is_in_the_journal(tmp_path: Path) -> None:
    async def check(hub: Hub, path: Path) -> None:
        _, writer, client = await connect(path, watch=False)
        event = json.loads(hub.events._ring.peek(1)[0] or b"{}")
        me = pwd.getpwuid(os.getuid()).pw_name
        found = (event["kind"], event["user"], event["place"], event["client"])
        assert found == ("login", me, "local", client)
        writer.close()

    run(tmp_path, check)
