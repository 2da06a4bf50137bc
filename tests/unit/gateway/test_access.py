"""Logging in: how often one may guess, and what happens when the file of users is damaged."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.requests import Request
from starlette.responses import Response
from starlette.websockets import WebSocket

from gantryctl.gateway import peers
from gantryctl.gateway.access import COOKIE, Access
from gantryctl.gateway.app import build_app
from gantryctl.gateway.live import Live
from gantryctl.gateway.sessions import FAILURES
from gantryctl.gateway.settings import CONNECTIONS, CONNECTIONS_OF_USER, UNUSED_S, Settings
from gantryctl.service.clients.console_link import LinkTaker
from gantryctl.service.clients.hub import Hub
from gantryctl.service.memory.memory import SharedMemory, Source
from gantryctl.service.protocol.roles import Role

PASSWORD = "correct horse battery"


@pytest.fixture
def access(tmp_path: Path) -> Iterator[Access]:
    memory = SharedMemory.create()
    found = Access(
        Settings("127.0.0.1", 1, -1, None, None, (), tmp_path, tmp_path),
        Hub(memory, Source.WEB),
        LinkTaker(memory.words),
    )
    found.users.add("anna", Role.OPERATOR, PASSWORD)
    yield found
    memory.close()


def asking(address: str = "192.0.2.7", cookie: str = "") -> Request:
    headers = [(b"cookie", f"{COOKIE}={cookie}".encode())] if cookie else []
    return Request({"type": "http", "method": "GET", "client": (address, 1), "headers": headers})


def test_guesses_at_the_same_time_count_one_after_the_other(access: Access) -> None:
    async def guesses() -> list[Response]:
        tries = (access.log_in(asking(), "anna", f"wrong {n}") for n in range(36))
        return list(await asyncio.gather(*tries))

    found = Counter(answer.status_code for answer in asyncio.run(guesses()))
    assert found[401] == FAILURES  # the sixth must wait a second: longer than it takes to say no to the rest
    assert found == {401: FAILURES, 429: 36 - FAILURES}


def test_guesses_of_one_peer_keep_no_other_one_waiting(access: Access) -> None:
    """Each of another account, so that none is locked out: 0.1 s of a processor for every one."""
    done: list[str] = []

    async def log_in(address: str, name: str, password: str) -> None:
        await access.log_in(asking(address), name, password)
        done.append(address)

    async def all_at_once() -> None:
        crowd = [log_in("192.0.2.7", f"name{n}", "wrong") for n in range(8)]
        await asyncio.gather(*crowd, log_in("192.0.2.8", "anna", PASSWORD))

    asyncio.run(all_at_once())
    assert done.index("192.0.2.8") <= 1
    assert len(done) == 9


def test_a_whole_network_of_ipv6_is_one_guesser(access: Access) -> None:
    async def guesses() -> list[int]:
        tries = [asking(f"2001:db8::{n}") for n in range(1, FAILURES + 2)]
        return [(await access.log_in(each, "anna", "wrong")).status_code for each in tries]

    assert asyncio.run(guesses())[-1] == 429


def test_a_damaged_file_of_users_lets_nobody_in_and_is_named(access: Access) -> None:
    async def log_in() -> Response:
        return await access.log_in(asking(), "anna", PASSWORD)

    answer = asyncio.run(log_in())
    cookie = answer.headers["set-cookie"].partition("=")[2].partition(";")[0]
    assert access.session(asking(cookie=cookie)) is not None
    access.users.path.write_text("{", encoding="utf-8")
    assert access.session(asking(cookie=cookie)) is None
    answer = asyncio.run(log_in())
    assert answer.status_code == 503
    assert b"users.json cannot be read" in bytes(answer.body)


async def opened(access: Access, cookie: str) -> str:
    """What a WebSocket of this session gets first."""
    sent: list[Any] = []
    ended = asyncio.Event()

    async def receive() -> Any:
        if sent:
            await ended.wait()
        return {"type": "websocket.connect" if not sent else "websocket.disconnect"}

    async def send(message: Any) -> None:
        sent.append(message)
        ended.set()

    headers = [(b"cookie", f"{COOKIE}={cookie}".encode()), (b"origin", b"http://127.0.0.1:1")]
    scope = {"type": "websocket", "client": ("127.0.0.1", 1), "headers": headers}
    await Live(access, access.hub).serve(WebSocket(scope, receive, send))
    return str(sent[0]["type"])


def test_one_user_has_so_many_connections_and_others_have_theirs(access: Access) -> None:
    access.users.add("eve", Role.VIEWER, PASSWORD)

    async def check() -> None:
        users = access.users.all()
        anna, eve = (access.sessions.open(users[name], "here").token for name in ("anna", "eve"))
        for _ in range(CONNECTIONS_OF_USER - 1):
            access.hub.connect("eve", Role.VIEWER, "console")
        assert await opened(access, eve) == "websocket.accept"
        access.hub.connect("eve", Role.VIEWER, "console")
        assert await opened(access, eve) == "websocket.close"
        assert await opened(access, anna) == "websocket.accept"
        # The one that was unused for longest makes room, after a minute; who has control never does.
        first, second, *_ = access.hub.clients()
        access.hub._slow["authority_client"] = first.who.client
        first.used_s -= 2 * UNUSED_S
        assert await opened(access, eve) == "websocket.close"
        second.used_s -= 1.01 * UNUSED_S
        assert await opened(access, eve) == "websocket.accept"
        assert [client.displaced for client in access.hub.clients()] == [False, True, *[False] * 14]

    asyncio.run(check())


def test_those_that_are_being_closed_have_no_places(access: Access) -> None:
    """Found by a crowd: who floods one WebSocket after the other had all places with those that were being closed."""

    async def check() -> None:
        anna = access.sessions.open(access.users.all()["anna"], "here").token
        live, closing = Live(access, access.hub), asyncio.Event()
        headers = [(b"cookie", f"{COOKIE}={anna}".encode()), (b"origin", b"http://127.0.0.1:1")]
        scope = {"type": "websocket", "client": ("127.0.0.1", 1), "headers": headers}
        said: list[str] = []

        async def send(message: Any) -> None:
            said.append(message["type"])
            if message["type"] == "websocket.close":
                await closing.wait()

        def rude() -> Any:
            messages = iter(
                [{"type": "websocket.connect"}, {"type": "websocket.receive", "bytes": b"binary"}]
            )

            async def receive() -> Any:
                return next(messages)

            return receive

        async with asyncio.TaskGroup() as group:
            for n in range(CONNECTIONS + 1):
                group.create_task(live.serve(WebSocket(dict(scope), rude(), send)))
                while len(said) < 3 * (n + 1):  # accepted, welcome, close
                    await asyncio.sleep(0)
            closing.set()
        assert said.count("websocket.accept") == CONNECTIONS + 1

    asyncio.run(check())


def test_a_connection_that_ends_leaves_no_task_behind(access: Access) -> None:
    """Whatever was being sent: its end may fall into any turn of the event loop."""
    cookie = access.sessions.open(access.users.all()["anna"], "here").token

    async def check(turns: int) -> None:
        taken, ended = asyncio.Event(), asyncio.Event()
        received, sent = 0, 0

        async def receive() -> Any:
            nonlocal received
            received += 1
            if received > 1:
                await ended.wait()
            return {"type": "websocket.connect" if received == 1 else "websocket.disconnect"}

        async def send(_: Any) -> None:
            nonlocal sent
            sent += 1
            if sent == 3:  # after the acceptance and the welcome
                await taken.wait()

        headers = [(b"cookie", f"{COOKIE}={cookie}".encode()), (b"origin", b"http://127.0.0.1:1")]
        scope = {"type": "websocket", "client": ("127.0.0.1", 1), "headers": headers}
        before = asyncio.all_tasks()
        serving = Live(access, access.hub).serve(WebSocket(scope, receive, send))
        served = asyncio.create_task(serving)
        while sent < 2:
            await asyncio.sleep(0)
        (client,) = access.hub.clients()
        client.answer({"seq": 1, "epoch": None})
        while sent < 3:
            await asyncio.sleep(0)
        ended.set()
        for _ in range(turns):
            await asyncio.sleep(0)
        taken.set()
        await asyncio.wait([served], timeout=10.0)
        assert served.done(), f"it does not end when the sending does {turns} turns later"
        assert asyncio.all_tasks() == before

    for turns in range(8):
        asyncio.run(check(turns))


@pytest.mark.parametrize("here", ["127.0.0.1", "::1", "::ffff:127.0.0.1"])
def test_a_lock_on_this_machine_is_for_the_local_user_who_guessed(
    access: Access, monkeypatch: pytest.MonkeyPatch, here: str
) -> None:
    uids = {1: 1000, 2: 1001, 3: None}
    monkeypatch.setattr(peers, "user_of", lambda client, _: uids[client[1]])

    async def tries(port: int, password: str) -> int:
        request = asking(here)
        request.scope.update(client=(here, port), server=(here, 80))
        return (await access.log_in(request, "anna", password)).status_code

    async def check() -> None:
        assert [await tries(1, "wrong") for _ in range(FAILURES + 1)] == [401] * FAILURES + [429]
        assert await tries(1, PASSWORD) == 429
        assert await tries(2, PASSWORD) == 200
        assert await tries(3, PASSWORD) == 200  # of whom the system says nothing

    asyncio.run(check())


def test_the_system_knows_the_user_of_a_local_connection() -> None:
    for host in ("127.0.0.1", "::1"):
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            listener = socket.create_server((host, 0), family=family)
        except OSError:
            pytest.skip("no IPv6 here")
        port = listener.getsockname()[1]
        with listener, socket.create_connection((host, port)) as made:
            scope = {"client": made.getsockname()[:2], "server": (host, port)}
            assert peers.peer_of(scope) == f"uid {os.getuid()}"
            assert peers.user_of((host, 1), (host, port)) is None  # nobody is there
    # A listener of IPv6 sees a client of IPv4 as a mapped address.
    with socket.create_server(("", 0), family=socket.AF_INET6, dualstack_ipv6=True) as listener:
        port = listener.getsockname()[1]
        with socket.create_connection(("127.0.0.1", port)), listener.accept()[0] as taken:
            ends = {"client": taken.getpeername()[:2], "server": taken.getsockname()[:2]}
            assert ends["client"][0] == "::ffff:127.0.0.1"
            assert peers.local_user(ends) == os.getuid()
        # Another machine whose port is that of a listener here: the system finds the listener, and it is not the peer.
        for far in ("192.0.2.7", "2001:db8::7"):
            near = "192.0.2.1" if "." in far else "2001:db8::1"
            assert peers.local_user({"client": (far, port), "server": (near, port)}) is None
    assert peers.peer_of({"client": ("192.0.2.7", 5), "server": ("192.0.2.1", 80)}) == "192.0.2.7"
    assert peers.peer_of({"client": None}) == ""


def test_a_gateway_whose_pictures_end_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def fail(_: Hub) -> None:
        raise ValueError("no picture")

    killed: list[tuple[int, int]] = []
    monkeypatch.setattr(Hub, "run", fail)
    monkeypatch.setattr(os, "kill", lambda *what: killed.append(what))
    memory = SharedMemory.create()
    settings = Settings("127.0.0.1", 1, -1, None, None, (), tmp_path, tmp_path)

    async def run() -> None:
        app = build_app(settings, memory)
        begun = asyncio.Event()

        async def receive() -> Any:
            if begun.is_set():
                await asyncio.sleep(0.05)
                return {"type": "lifespan.shutdown"}
            begun.set()
            return {"type": "lifespan.startup"}

        async def send(_: Any) -> None:
            pass

        await app({"type": "lifespan", "state": {}}, receive, send)

    asyncio.run(run())
    memory.close()
    assert killed == [(os.getpid(), signal.SIGTERM)]
