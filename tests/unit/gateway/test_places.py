"""Places for connections: by address and in all, who makes room, and whose turn it is in a crowd."""

from __future__ import annotations

import asyncio
import os
import resource
import socket
import sys
import time
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest
from starlette.applications import Starlette
from starlette.requests import HTTPConnection
from websockets.asyncio.client import connect

from gantryctl.gateway import door, server
from gantryctl.gateway.guard import Guard
from gantryctl.gateway.places import Places
from gantryctl.gateway.sessions import Session
from gantryctl.gateway.settings import CONNECTIONS, CONNECTIONS_REMOTE, Settings, is_loopback, neighbourhood
from gantryctl.service.protocol.roles import Role
from support.http_bench import ASK, BIG, PATIENCE_S, run, until_closed

pytestmark = pytest.mark.usefixtures("short_limits")
HOSTILE = Path(__file__).parents[2] / "support" / "hostile.py"


def test_places_are_counted_before_anything_is_done_for_a_connection() -> None:
    async def check(port: int) -> None:
        with ExitStack() as stack:
            made = [
                stack.enter_context(socket.create_connection(("127.0.0.1", port))) for _ in range(CONNECTIONS)
            ]
            await asyncio.sleep(0.1)
            assert await until_closed(port) == b""  # closed at once or in 0.3 s: no answer
            del made

    run(check)


def test_without_handles_it_waits_and_says_so_once(capsys: pytest.CaptureFixture[str]) -> None:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)

    async def check(port: int) -> None:
        waiting = [socket.create_connection(("127.0.0.1", port)) for _ in range(5)]
        resource.setrlimit(resource.RLIMIT_NOFILE, (len(os.listdir("/proc/self/fd")), before[1]))
        await asyncio.sleep(1.0)
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
        for each in waiting:
            each.close()
        assert b"200 OK" in await until_closed(port, ASK)

    try:
        run(check)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("no connection can be taken: [Errno 24] Too many open files")


@pytest.mark.parametrize(
    ("soft", "hard", "after"),
    [
        (1024, 524_288, (4096, 524_288)), (1024, 2048, (2048, 2048)), (1024, resource.RLIM_INFINITY, (4096, -1)),
        (4096, 524_288, None), (8192, 524_288, None), (512, 512, None),
        (resource.RLIM_INFINITY, resource.RLIM_INFINITY, None),
    ],
)  # fmt: skip
def test_the_limit_of_open_files_is_raised_as_far_as_the_system_allows(
    monkeypatch: pytest.MonkeyPatch, soft: int, hard: int, after: tuple[int, int] | None
) -> None:
    raised: list[tuple[int, tuple[int, int]]] = []
    monkeypatch.setattr(server.resource, "getrlimit", lambda what: (soft, hard))
    monkeypatch.setattr(server.resource, "setrlimit", lambda what, limits: raised.append((what, limits)))
    server.raise_handles()
    assert raised == ([] if after is None else [(resource.RLIMIT_NOFILE, after)])


def test_a_websocket_has_no_such_limit_and_leaves_its_place_to_others() -> None:
    async def check(port: int) -> None:
        made = [await connect(f"ws://127.0.0.1:{port}/echo") for _ in range(CONNECTIONS + 1)]
        await asyncio.sleep(0.5)  # 0.3 s for a request
        for each in made:
            await each.send("hello")
            assert await each.recv() == "hello"
            await each.close()

    run(check)


async def answered(port: int) -> bytes:
    """An answer at the second attempt at the latest, as of a browser."""
    for last in (False, True):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        try:
            writer.write(ASK)
            return await reader.readuntil(b"hello")
        except (ConnectionError, asyncio.IncompleteReadError):
            if last:
                raise
        finally:
            writer.close()
    return b""


def test_an_answer_under_way_makes_no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "HEADER_S", PATIENCE_S)
    monkeypatch.setattr(server, "STUCK_S", PATIENCE_S)

    async def check(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port, limit=4096)
        writer.write(BIG.replace(b"\r\n\r\n", b"\r\nConnection: close\r\n\r\n"))
        await reader.readuntil(b"\r\n\r\n")
        with ExitStack() as stack:
            for _ in range(2 * CONNECTIONS):
                stack.enter_context(socket.create_connection(("127.0.0.1", port)))
                await asyncio.sleep(0.005)
            length = 0
            while data := await reader.read(1 << 20):
                length += len(data)
        assert length > 1000 * 65536
        writer.close()

    run(check)


@pytest.mark.parametrize("count", [300, pytest.param(1000, marks=pytest.mark.slow)])
def test_a_crowd_that_holds_connections_keeps_nobody_out(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    for module in (door, server):
        monkeypatch.setattr(module, "HEADER_S", PATIENCE_S)  # nothing ends by itself here

    async def check(port: int) -> None:
        crowd = await asyncio.create_subprocess_exec(
            sys.executable, HOSTILE, str(port), str(count), "x", stdout=asyncio.subprocess.PIPE
        )
        try:
            assert crowd.stdout is not None
            assert await crowd.stdout.readline() == b"holding\n"
            begin_s = time.monotonic()
            for _ in range(5):
                assert b"200 OK" in await answered(port)
            assert time.monotonic() - begin_s < PATIENCE_S / 2
        finally:
            crowd.kill()
            await crowd.wait()
        assert b"200 OK" in await answered(port)

    run(check)


def test_who_has_a_session_does_not_wait_behind_a_crowd(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(door, "HEADER_S", PATIENCE_S)

    async def check(port: int) -> None:
        with ExitStack() as stack:
            # All of them are there before the server has a turn.
            crowd = [stack.enter_context(socket.create_connection(("127.0.0.1", port))) for _ in range(401)]
            mine = crowd.pop(200)
            mine.sendall(ASK.replace(b"\r\n\r\n", b"\r\nCookie: mine\r\n\r\n"))
            for each in crowd:
                each.sendall(ASK)
                each.setblocking(False)
            mine.setblocking(False)
            assert b"200 OK" in await asyncio.get_running_loop().sock_recv(mine, 4096)
            # 64 are accepted in one turn, and so many have a turn each before the one with the session is seen.
            assert sum(map(answered_already, crowd)) < 50

    run(check)


def answered_already(client: socket.socket) -> bool:
    with suppress(BlockingIOError, ConnectionError):  # nothing yet, or it made room
        return b"200 OK" in client.recv(4096)
    return False


def test_the_session_is_found_in_what_a_connection_says_first(tmp_path: Path) -> None:
    settings = Settings("127.0.0.1", 1, -1, None, None, (), tmp_path, tmp_path)
    living = Session("f" * 32, "anna", Role.VIEWER, "anna", "", "", 0.0, 0.0)

    def session(request: HTTPConnection) -> Session | None:
        return living if request.cookies.get("session") == living.token else None

    found = Guard(Starlette(), settings, session).session_of
    said = f"GET / HTTP/1.1\r\nHost: x\r\ncookie: a=b; session={living.token}\r\n\r\n".encode()
    assert found(said) == f"session {living.token}"
    for other in (b"", ASK, b"\x16\x03\x01", said.replace(b"f", b"0"), said.replace(b"cookie", b"cake")):
        assert found(other) == ""


def test_an_address_has_its_places_and_no_more() -> None:
    places = Places(door.WAITING, loopback=CONNECTIONS, remote=CONNECTIONS_REMOTE)
    mine = [places.take("192.0.2.7") for _ in range(CONNECTIONS_REMOTE)]
    assert None not in mine
    assert places.take("192.0.2.7") is None
    assert places.take("192.0.2.8") is not None
    assert mine[0] is not None
    for _ in range(2):
        mine[0].leave()
    assert places.take("192.0.2.7") is not None
    assert places.take("192.0.2.7") is None


def test_who_has_been_idle_for_longest_makes_room() -> None:
    places, closed = Places(4, loopback=3, remote=2), []
    first, second = places.take("192.0.2.7"), places.take("192.0.2.7")
    assert first is not None
    assert second is not None
    for name, each in (("second", second), ("first", first)):
        each.rest(lambda name=name: closed.append(name))  # type: ignore[misc]
    third = places.take("192.0.2.7")
    assert (third is not None, closed, second.mine) == (True, ["second"], False)
    first.work()
    assert places.take("192.0.2.7") is None  # both are in use
    # All together: the address with the most.
    assert [places.take("127.0.0.1") is not None for _ in range(3)] == [True, True, False]
    first.rest(lambda: closed.append("first"))
    assert places.take("198.51.100.1") is not None
    assert closed == ["second", "first"]


def test_an_address_without_a_place_takes_none_of_another_one() -> None:
    places, closed = Places(9, loopback=3, remote=2), []
    idle = places.take("192.0.2.7")
    assert idle is not None
    idle.rest(lambda: closed.append("idle"))
    assert [places.take("192.0.2.8") is not None for _ in range(3)] == [True, True, False]
    assert (closed, idle.mine) == ([], True)


def test_where_no_place_is_left_at_all_the_largest_crowd_makes_room() -> None:
    """Two of one address and one of another, all idle: whoever comes takes the place of the two."""
    places = Places(3, loopback=3, remote=3)
    closed: list[str] = []
    for address in ("192.0.2.1", "192.0.2.2", "192.0.2.2"):
        place = places.take(address)
        assert place is not None
        place.rest(lambda address=address: closed.append(address))  # type: ignore[misc]
    assert places.take("192.0.2.3") is not None
    assert closed == ["192.0.2.2"]


def test_all_addresses_together_have_so_many() -> None:
    places = Places(door.WAITING, loopback=CONNECTIONS, remote=CONNECTIONS_REMOTE)
    assert sum(places.take(f"192.0.2.{n // 4}") is not None for n in range(1000)) == door.WAITING


@pytest.mark.parametrize(
    ("address", "key"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("2001:db8:1:2::1", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("", ""),
    ],
)
def test_limits_count_networks_of_ipv6(address: str, key: str) -> None:
    assert neighbourhood(address) == key


@pytest.mark.parametrize(
    ("host", "ours"),
    [
        ("127.0.0.1", True), ("127.8.9.10", True), ("::1", True), ("localhost", True), ("::ffff:127.0.0.1", True),
        ("192.0.2.7", False), ("::ffff:192.0.2.7", False), ("2001:db8::1", False), ("::", False),
        ("localhost.example", False), ("", False),
    ],
)  # fmt: skip
def test_which_addresses_are_of_this_machine(host: str, ours: bool) -> None:
    """A listener of IPv6 sees this machine as ::ffff:127.0.0.1."""
    assert is_loopback(host) is ours


def test_the_process_gets_its_settings_as_they_were_written() -> None:
    text = (
        '{"host": "192.0.2.7", "port": 8443, "listener": 5, "certificate": "c.pem", "key": "k.pem", '
        '"names": ["gantry"], "root": "/r", "directory": "/d"}'
    )
    found = Settings.from_json(text)
    assert found == ("192.0.2.7", 8443, 5, "c.pem", "k.pem", ("gantry",), Path("/r"), Path("/d"))
    assert found.hosts == {"192.0.2.7:8443", "gantry:8443"}
    assert found.origins == {"https://192.0.2.7:8443", "https://gantry:8443"}
    # Browsers leave the default port out.
    assert found._replace(port=443).hosts == {"192.0.2.7:443", "gantry:443", "192.0.2.7", "gantry"}
