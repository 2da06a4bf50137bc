"""What the doors write into the journal, and what they tell who must wait; no password is computed here."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.requests import Request
from starlette.responses import Response

from gantryctl.gateway import peers
from gantryctl.gateway.access import COOKIE, Access
from gantryctl.gateway.settings import Settings
from gantryctl.service.clients.console_link import LinkTaker
from gantryctl.service.clients.hub import Hub
from gantryctl.service.memory.memory import SharedMemory, Source
from gantryctl.service.protocol.messages import Identity
from gantryctl.service.protocol.roles import Action, Role
from gantryctl.service.supervisor.users import User

ANNA = User("anna", Role.VIEWER, "Anna", "", "", 1, 1, 1, "")
Written = list[tuple[str, str, str]]


class Bench:
    """The doors with a file of one user, whose password is "right"."""

    def __init__(self, access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
        self.access, self.written = access, Written()

        async def check(name: str, password: str) -> User | None:
            return ANNA if (name, password) == ("anna", "right") else None

        def put(kind: str, text: str, who: Identity | None = None, **_: Any) -> int:
            self.written.append((kind, text, "" if who is None else who.user))
            return 1

        monkeypatch.setattr(access, "_check", check)
        monkeypatch.setattr(access.users, "all", lambda: {"anna": ANNA})
        monkeypatch.setattr(access.hub.events, "put", put)

    def log_in(self, password: str, cookie: str = "") -> Response:
        return asyncio.run(self.access.log_in(asking(cookie), "anna", password))


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    memory = SharedMemory.create()
    settings = Settings("127.0.0.1", 1, -1, None, None, (), tmp_path, tmp_path)
    access = Access(settings, Hub(memory, Source.WEB), LinkTaker(memory.words))
    access.sessions._stamp = (0, 0)  # the file is read once, and never there
    yield Bench(access, monkeypatch)
    memory.close()


def asking(cookie: str = "", path: str = "/api/v1/traces") -> Request:
    headers = [(b"cookie", f"{COOKIE}={cookie}".encode())] if cookie else []
    return Request(
        {"type": "http", "method": "GET", "path": path, "client": ("192.0.2.7", 1), "headers": headers}
    )


def test_a_wrong_password_is_written_five_times_and_then_every_tenth(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench.access.locks, "wait_s", lambda *_: 0.0)
    assert {bench.log_in("wrong").status_code for _ in range(21)} == {401}
    assert [text.rpartition(", ")[2] for _, text, _ in bench.written] == [
        f"{count} times" for count in (1, 2, 3, 4, 5, 10, 20)
    ]
    assert {(kind, user) for kind, _, user in bench.written} == {("login", "anna")}


@pytest.mark.parametrize(("wait_s", "told"), [(0.2, "1"), (1.0, "1"), (1.01, "2"), (900.0, "900")])
def test_who_must_wait_is_told_whole_seconds_that_are_enough(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, wait_s: float, told: str
) -> None:
    monkeypatch.setattr(bench.access.locks, "wait_s", lambda *_: wait_s)
    answer = bench.log_in("right")
    assert (answer.status_code, answer.headers["retry-after"]) == (429, told)
    assert not bench.written


def test_a_login_from_a_browser_that_is_logged_in_ends_the_session_before(bench: Bench) -> None:
    bench.log_in("right")
    (first,) = bench.access.sessions._sessions
    bench.log_in("right", first)
    assert first not in bench.access.sessions._sessions
    assert [text for _, text, _ in bench.written] == [
        "logged in",
        "logged out: anna logs in from the same browser",
        "logged in",
    ]


def test_a_role_that_may_not_is_refused_and_written(bench: Bench) -> None:
    bench.log_in("right")
    (token,) = bench.access.sessions._sessions
    bench.written.clear()
    answer = bench.access.refuse(asking(token), Action.TRACES)
    assert answer is not None
    assert answer.status_code == 403
    ((kind, text, user),) = bench.written
    assert (kind, user) == ("read", "anna")
    assert text.startswith("GET /api/v1/traces: refused: SEC-01")
    # Strangers are not: a journal that they can fill is no journal.
    bench.written.clear()
    assert bench.access.refuse(asking(), Action.TRACES) is not None
    assert not bench.written


def test_of_65_consoles_the_first_has_to_prove_itself_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "local_user", lambda _: 1000)
    consoles = peers.Consoles()
    scope: dict[str, Any] = {"headers": []}
    first, *others = (consoles.open(1000) for _ in range(65))
    assert not consoles.proves(scope, first)
    assert all(consoles.proves(scope, each) for each in others)
