"""What the gateway does at its start and end: keys must not outlive it, and it must not live on half dead."""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.gateway import app as module
from gantryctl.gateway.peers import is_forwarded
from gantryctl.gateway.rest import _numbers
from gantryctl.gateway.routes import API
from gantryctl.gateway.settings import Settings
from gantryctl.program import Code
from gantryctl.program.alarms.words import Words
from gantryctl.service.clients.hub import Hub
from gantryctl.service.memory.memory import SharedMemory, Word
from gantryctl.service.memory.snapshot import FAST, publish_fast
from gantryctl.service.protocol.messages import Identity, MessageRefused
from gantryctl.service.protocol.roles import Role


class Gateway:
    """An application and its hub; `killed` are the signals that it has sent."""

    def __init__(self, folder: Path, memory: SharedMemory, monkeypatch: pytest.MonkeyPatch) -> None:
        self.hubs: list[Hub] = []
        self.killed: list[tuple[int, int]] = []
        monkeypatch.setattr(module, "Hub", self._hub)
        monkeypatch.setattr(module.os, "kill", lambda process, sent: self.killed.append((process, sent)))
        self.app = module.build_app(
            Settings("127.0.0.1", 1, -1, None, None, (), folder, folder), memory, module.Page(folder)
        )

    def _hub(self, *how: Any) -> Hub:
        self.hubs.append(Hub(*how))
        return self.hubs[-1]

    async def live(self, during: Callable[[], Awaitable[None]]) -> None:
        """From its start to its end."""
        asked: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        said: asyncio.Queue[Any] = asyncio.Queue()
        running = asyncio.create_task(self.app({"type": "lifespan", "state": {}}, asked.get, said.put))
        await asked.put({"type": "lifespan.startup"})
        assert (await said.get())["type"] == "lifespan.startup.complete"
        await during()
        await asked.put({"type": "lifespan.shutdown"})
        assert (await said.get())["type"] == "lifespan.shutdown.complete"
        await running


@pytest.fixture
def memory() -> Iterator[SharedMemory]:
    made = SharedMemory.create()
    yield made
    made.close()


def test_at_its_end_nobody_is_connected_any_more(
    tmp_path: Path, memory: SharedMemory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The controller is told of each: a key that nobody renews is let go at once, and not after its lease."""
    gateway = Gateway(tmp_path, memory, monkeypatch)
    (hub,) = gateway.hubs

    async def during() -> None:
        for _ in range(2):
            hub.connect("anna", Role.OPERATOR, "remote", "")
        assert len([*hub.clients()]) == 2
        await asyncio.sleep(0)

    asyncio.run(gateway.live(during))
    assert not [*hub.clients()]
    assert not gateway.killed


def test_what_was_refused_and_counted_is_written_at_the_end(
    tmp_path: Path, memory: SharedMemory, monkeypatch: pytest.MonkeyPatch
) -> None:
    gateway = Gateway(tmp_path, memory, monkeypatch)
    (hub,) = gateway.hubs
    written: list[str] = []
    monkeypatch.setattr(hub.events, "put", lambda kind, text, *_, **values: written.append(text))
    refused = MessageRefused(Code.SEC_01, reason=Words.LOG_IN_FIRST)

    async def during() -> None:
        for _ in range(3):
            hub.refusals.put_text(Identity("", "anna", Role.VIEWER, "remote"), "read", "x", "view", refused)
        for _ in range(202):
            hub.logins.put("connected", Identity("", "ben", Role.VIEWER, "remote"))

    asyncio.run(gateway.live(during))
    assert written[1:201] == ["connected"] * 200
    others = sorted([written[0], *written[201:]])
    assert len(others) == 3
    assert others[0] == "connected; 1 more since the row before"
    assert "2 times in" in "".join(others[1:])


@pytest.mark.parametrize(("place", "name"), [(Hub, "run"), (module, "_beat")], ids=["picture", "beat"])
def test_a_part_that_fails_ends_the_whole(
    place: object, name: str, tmp_path: Path, memory: SharedMemory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A page that shows old states is worse than none: the supervisor starts another gateway."""

    async def fails(_: object) -> None:
        raise RuntimeError("the picture is gone")

    monkeypatch.setattr(place, name, fails)
    gateway = Gateway(tmp_path, memory, monkeypatch)

    async def during() -> None:
        for _ in range(5):
            await asyncio.sleep(0)

    asyncio.run(gateway.live(during))
    assert gateway.killed == [(os.getpid(), signal.SIGTERM)]


def test_it_gives_signs_of_life(
    tmp_path: Path, memory: SharedMemory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the moment: by the age of the last one the supervisor starts another gateway."""
    gateway = Gateway(tmp_path, memory, monkeypatch)
    monkeypatch.setattr(module.time, "monotonic_ns", lambda: 7_000_000_000)

    async def during() -> None:
        await asyncio.sleep(0)
        assert memory.words[Word.GATEWAY_NS] == 7_000_000_000

    asyncio.run(gateway.live(during))


@pytest.mark.parametrize(
    "name", ["Forwarded", "Via", "X-Forwarded-For", "X-Forwarded-Host", "X-Forwarded-Proto", "X-Real-IP"]
)
def test_every_header_of_a_proxy_says_that_a_request_was_carried_here(name: str) -> None:
    """RFC 7239, RFC 9110 section 7.6.3, and what is used beside them: nobody is at the console through one."""
    assert is_forwarded({"headers": [(b"host", b"x"), (name.lower().encode(), b"1.1 proxy")]})
    assert is_forwarded({"headers": [(name.encode(), b"1.1 proxy")]})
    assert not is_forwarded({"headers": [(b"host", name.encode())]})


def test_no_answer_of_the_interface_may_be_kept(
    tmp_path: Path, memory: SharedMemory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A state that a browser or a proxy has kept would be shown as that of now."""
    app = Gateway(tmp_path, memory, monkeypatch).app
    for path in (f"{API}/health", f"{API}/status", "/api/nowhere"):
        said: list[Any] = []
        scope = {
            "type": "http", "method": "GET", "path": path, "raw_path": path.encode(), "query_string": b"",
            "headers": [(b"host", b"127.0.0.1:1")], "client": ("192.0.2.7", 1), "http_version": "1.1",
            "scheme": "http", "root_path": "", "state": {},
        }  # fmt: skip

        async def receive() -> dict[str, Any]:
            return {"type": "http.request", "body": b""}

        async def send(message: Any, said: list[Any] = said) -> None:
            said.append(message)

        asyncio.run(app(scope, receive, send))
        assert dict(said[0]["headers"])[b"cache-control"] == b"no-store", path


@pytest.mark.parametrize("text", ["²", "٣", "1e3", "-1", "+1", " 1", "", "9" * 40])
def test_a_number_of_a_query_is_of_plain_digits(text: str) -> None:
    asked: Any = SimpleNamespace(query_params={"from": text})
    refused = _numbers(asked, [("from", 0)])
    assert getattr(refused, "status_code", None) == 400
    asked.query_params["from"] = "17"
    assert _numbers(asked, [("from", 0)]) == [17]


def test_the_first_page_gets_the_picture_of_now(
    tmp_path: Path, memory: SharedMemory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Though the loop of the pictures has not begun."""

    async def later(_: Hub) -> None:
        await asyncio.Event().wait()

    monkeypatch.setattr(Hub, "run", later)
    gateway = Gateway(tmp_path, memory, monkeypatch)
    publish_fast(memory.fast, dict.fromkeys(FAST, 0.0), 0)

    async def during() -> None:
        assert gateway.hubs[0].fresh

    asyncio.run(gateway.live(during))
