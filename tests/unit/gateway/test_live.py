"""The WebSocket by hand: when a connection is ended, with which code, and what it takes with it."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.websockets import WebSocket

from gantryctl.gateway import live
from gantryctl.gateway.access import COOKIE, Access
from gantryctl.gateway.live import NOT_UNDERSTOOD, SESSION_ENDED, TOO_MANY, TOO_SLOW, Live
from gantryctl.gateway.sessions import IDLE_S, WHOLE_S, Session
from gantryctl.gateway.settings import Settings
from gantryctl.service.clients.console_link import LinkTaker
from gantryctl.service.clients.hub import Hub
from gantryctl.service.memory.memory import SharedMemory, Source
from gantryctl.service.protocol.limits import FLOOD_PER_S
from gantryctl.service.protocol.messages import from_record
from gantryctl.service.protocol.roles import Role
from gantryctl.service.supervisor import users

PATIENCE_S = 2.0
"""Until a test gives up; what is to end ends at once."""
ALIVE, STOP = ({"type": kind, "seq": 1, "frame": "1-0000000000000000"} for kind in ("alive", "stop"))


@pytest.fixture
def access(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Access]:
    monkeypatch.setattr(users, "_N", 2)  # what a password costs is tested elsewhere
    memory = SharedMemory.create()
    made = Access(
        Settings("127.0.0.1", 1, -1, None, None, (), tmp_path, tmp_path),
        Hub(memory, Source.WEB),
        LinkTaker(memory.words),
    )
    made.users.add("anna", Role.OPERATOR, "correct horse battery")
    yield made
    memory.close()


class Page:
    """The other end of a WebSocket that is connected.

    Attributes:
        session: of its user. sent: what it was sent.
        takes: whether it takes anything more.
    """

    def __init__(self, access: Access) -> None:
        self.session: Session = access.sessions.open(access.users.all()["anna"], "here")
        self.sent: list[dict[str, Any]] = []
        self.takes = True
        self._access, self._coming = access, asyncio.Queue[dict[str, Any]]()

    async def __aenter__(self) -> Page:
        self._coming.put_nowait({"type": "websocket.connect"})
        cookie = f"{COOKIE}={self.session.token}".encode()
        headers = [(b"cookie", cookie), (b"origin", b"http://127.0.0.1:1")]
        scope = {"type": "websocket", "client": ("127.0.0.1", 1), "headers": headers}
        serving = Live(self._access, self._access.hub).serve(WebSocket(scope, self._coming.get, self._send))
        self._served = asyncio.create_task(serving)
        while len(self.sent) < 2:  # the acceptance and the welcome
            await asyncio.sleep(0)
        (self.client,) = self._access.hub.clients()
        return self

    async def __aexit__(self, *_: object) -> None:
        self._served.cancel()
        await asyncio.gather(self._served, return_exceptions=True)

    async def _send(self, message: Any) -> None:
        if not self.takes and message["type"] == "websocket.send":
            await asyncio.Event().wait()
        self.sent.append(message)

    def says(self, **message: Any) -> None:
        self._coming.put_nowait({"type": "websocket.receive", **message})

    async def code(self) -> int | None:
        """The code with which it is closed; None when it goes on."""
        await asyncio.wait([self._served], timeout=PATIENCE_S)
        return next((each["code"] for each in self.sent if each["type"] == "websocket.close"), None)


def gone(access: Access) -> list[str]:
    """Clients whose end the controller is told."""
    records = [from_record(each) for each in access.hub._commands.peek(4096) if each is not None]
    return [who.client for who, raw in records if raw["type"] == "gone"]


def ending(access: Access, check: Callable[[Page], None]) -> int | None:
    """The code of a connection to which something happens."""

    async def whole() -> int | None:
        async with Page(access) as page:
            check(page)
            found = await page.code()
            # Its control and its key end with it.
            assert (page.client in access.hub.clients()) is (found is None)
            assert (page.client.who.client in gone(access)) is (found is not None)
            return found

    return asyncio.run(whole())


@pytest.mark.parametrize("how", ["logged out", "removed", "another password", "idle", "old"])
def test_what_ends_a_session_ends_its_websocket(access: Access, how: str) -> None:
    def end(page: Page) -> None:
        session = page.session
        match how:
            case "logged out":
                access.sessions.close(session)
            case "removed":
                access.users.remove("anna")
            case "another password":
                access.users.set_password("anna", "another horse battery")
            case "idle":
                session.used_s -= IDLE_S
                page.client.used_s -= IDLE_S
            case _:
                session.since_s -= WHOLE_S
        page.client.show()  # the next status frame

    assert ending(access, end) == SESSION_ENDED


def test_signs_of_life_do_not_keep_a_session(access: Access) -> None:
    """A page that was left open gives them; commands of a person restart the idle time."""

    async def check() -> None:
        for message, restarts in ((ALIVE, False), (STOP, True)):
            async with Page(access) as page:
                page.session.used_s -= 0.5 * IDLE_S
                page.client.used_s -= 0.5 * IDLE_S
                before_s, sent = page.session.used_s, len(page.sent)
                page.says(text=json.dumps(message))
                await asyncio.sleep(0.01)
                page.client.show()
                while len(page.sent) == sent:
                    await asyncio.sleep(0)
                assert (page.session.used_s > before_s + 1.0) is restarts

    asyncio.run(check())


def test_a_page_that_asks_nothing_takes_no_time_from_its_session(access: Access) -> None:
    """Another page of the same session, or REST, was used since."""

    async def check() -> None:
        async with Page(access) as page:
            page.client.used_s -= 0.9 * IDLE_S
            used_s, sent = page.session.used_s, len(page.sent)
            page.client.show()
            while len(page.sent) == sent:
                await asyncio.sleep(0)
            assert page.session.used_s == used_s

    asyncio.run(check())


def test_who_comes_and_goes_stands_in_the_journal(access: Access) -> None:
    told: list[Any] = []
    access.hub.events.put = lambda kind, text, who, **_: told.append((kind, text, who.user))  # type: ignore[method-assign]
    ending(access, lambda page: page.says(bytes=b"binary"))
    assert told == [("login", "connected", "anna"), ("login", "disconnected", "anna")]


def test_a_flood_ends_its_connection_and_an_ordinary_page_does_not(access: Access) -> None:
    def flood(count: int) -> Callable[[Page], None]:
        def send(page: Page) -> None:
            for _ in range(count):
                page.says(text=json.dumps(ALIVE))

        return send

    assert ending(access, flood(4 * round(FLOOD_PER_S))) == TOO_MANY


def test_what_is_no_text_is_not_understood(access: Access) -> None:
    assert ending(access, lambda page: page.says(bytes=b"binary")) == NOT_UNDERSTOOD


def test_a_page_that_takes_nothing_is_closed(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    """And so its control ends: it shows nobody what the machine does."""
    monkeypatch.setattr(live, "_STUCK_S", 0.05)

    def stuck(page: Page) -> None:
        page.takes = False
        page.client.show()

    assert ending(access, stuck) == TOO_SLOW


def test_a_connection_that_made_room_is_told_so(access: Access) -> None:
    def displaced(page: Page) -> None:
        page.client.displaced = True
        page.client.wake.set()

    assert ending(access, displaced) == TOO_MANY


def test_an_open_page_goes_on(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(globals(), "PATIENCE_S", 0.05)
    assert ending(access, lambda page: page.client.show()) is None
