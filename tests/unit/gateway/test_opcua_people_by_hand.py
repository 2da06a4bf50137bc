"""Who logs in over OPC UA, by hand: tries, locks, names, and what the journal has of them."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua.crypto.permission_rules import UserRole  # noqa: E402

from gantryctl.errors import StateError  # noqa: E402
from gantryctl.gateway.opcua import people as people_module  # noqa: E402
from gantryctl.gateway.opcua.people import People, Reader  # noqa: E402
from gantryctl.service.protocol.roles import Role  # noqa: E402
from gantryctl.service.supervisor.users import User  # noqa: E402
from support.opcua_by_hand import ANNA  # noqa: E402


class Door:
    """People with one user, whose password is "right", at a time that the test sets."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.written: list[tuple[str, str]] = []
        users: Any = SimpleNamespace(check=lambda name, password: ANNA if password == "right" else None)
        events: Any = SimpleNamespace(put=lambda kind, text, who=None, **_: self.written.append((kind, text)))

        async def here(work: Any, *values: Any) -> Any:
            return work(*values)

        monkeypatch.setattr(people_module.asyncio, "to_thread", here)
        self.people, self.now_s = People(users, events), 100.0
        self.people._rate._now = self.people._locks._now = lambda: self.now_s

    def admit(self, password: str, client: str = "c", name: str = "anna") -> bool:
        return asyncio.run(self.people.admit(name, password, b"certificate", client, "192.0.2.7"))


@pytest.fixture
def door(monkeypatch: pytest.MonkeyPatch) -> Door:
    return Door(monkeypatch)


def test_a_client_has_ten_tries_and_one_more_a_second_and_takes_none_from_others(door: Door) -> None:
    assert [door.admit("right") for _ in range(11)] == [True] * 10 + [False]
    assert door.admit("right", "other")
    door.now_s += 1.0
    assert [door.admit("right") for _ in range(2)] == [True, False]
    assert not door.admit("right", "third", name="")


def test_a_right_password_is_no_failure_and_forgets_those_before(door: Door) -> None:
    tries = [*["wrong"] * 4, "right", *["wrong"] * 4, "right"]
    assert [door.admit(each) for each in tries] == [each == "right" for each in tries]
    door.now_s += 20.0
    # Five wrong ones lock, also for the right one.
    assert [door.admit(each) for each in [*["wrong"] * 5, "right"]] == [False] * 6
    assert door.admit("right", "other")


def test_of_an_account_64_letters_are_remembered(door: Door) -> None:
    """Names from outside must not fill the memory."""
    assert not door.admit("wrong", name="v" * 1000)
    assert list(door.people._locks._failures) == [("v" * 64, "c")]


def test_whoever_is_let_in_reads_as_the_user_of_now(door: Door) -> None:
    assert door.admit("right")
    reader = door.people.get_user(None, "anna", "right", b"certificate")
    assert reader == Reader(UserRole.User, "anna", ANNA)
    assert door.written == [("login", "OPC UA session")]


def test_of_wrong_passwords_and_refused_clients_some_are_written(door: Door) -> None:
    for count in range(1, 13):
        door.people.refused("192.0.2.7", count, "a stranger")
    assert [text.partition(" times")[0].rpartition(" ")[2] for _, text in door.written] == [*"12345", "10"]


def test_without_a_file_of_users_there_are_none() -> None:
    def damaged() -> None:
        raise StateError("users.json")

    users: Any = SimpleNamespace(all=damaged)
    assert People(users, None).all() == {}  # type: ignore[arg-type]


@pytest.mark.parametrize(("known", "name"), [(ANNA, "anna"), (None, None)])
def test_the_journal_names_whose_session_has_ended(
    door: Door, monkeypatch: pytest.MonkeyPatch, known: User | None, name: str | None
) -> None:
    whose: list[Any] = []
    monkeypatch.setattr(door.people._events, "put", lambda kind, text, who: whose.append((text, who)))
    door.people.ended(Reader(UserRole.User, "anna", known), "the user has changed")
    ((text, who),) = whose
    assert text == "OPC UA session ended: the user has changed"
    assert (who and who.user) == name


def test_one_password_is_checked_at_a_time(door: Door, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each takes 32 MB and a tenth of a second of a processor, whoever asks."""
    under_way, most = [0], [0]

    async def check(*_: Any) -> None:
        under_way[0] += 1
        most[0] = max(most[0], under_way[0])
        await asyncio.sleep(0)
        under_way[0] -= 1

    monkeypatch.setattr(people_module.asyncio, "to_thread", check)

    async def all_at_once() -> None:
        clients = (door.people.admit("anna", "guess", b"", f"client {n}", "192.0.2.7") for n in range(4))
        assert await asyncio.gather(*clients) == [False] * 4

    asyncio.run(all_at_once())
    assert most == [1]


def test_a_file_that_is_damaged_for_a_moment_counts_as_no_failure(
    door: Door, monkeypatch: pytest.MonkeyPatch
) -> None:
    def damaged(*_: str) -> None:
        raise StateError("users.json")

    with monkeypatch.context() as patch:
        patch.setattr(door.people._users, "check", damaged)
        assert [door.admit("right") for _ in range(6)] == [False] * 6
    assert door.admit("right")
    assert door.written == [("login", "OPC UA session")]


def test_the_journal_has_address_and_certificate_of_who_logs_in_or_tries(
    door: Door, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[Any] = []
    monkeypatch.setattr(
        door.people._events, "put", lambda kind, text, who=None, **more: told.append((who, more))
    )
    door.admit("right", "16 digits")
    door.admit("wrong", "16 digits", "eve")
    # Whoever could not log in has no role but that of everybody.
    assert [(who.user, who.role, who.place, more) for who, more in told] == [
        (name, Role.VIEWER, "opcua", {"address": "192.0.2.7", "client": "16 digits"})
        for name in ("anna", "eve")
    ]


def test_the_journal_has_the_address_of_a_refused_client_and_why(
    door: Door, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[Any] = []
    monkeypatch.setattr(door.people._events, "put", lambda *what, **more: told.append((what, more)))
    door.people.refused("192.0.2.7", 3, "a stranger")
    text = "OPC UA: a client was refused, 3 times: a stranger"
    assert told == [(("login", text), {"address": "192.0.2.7"})]


def test_no_password_is_an_empty_one_for_the_library(door: Door, monkeypatch: pytest.MonkeyPatch) -> None:
    """It asks with None for what a client has sent empty."""
    monkeypatch.setattr(door.people._users, "check", lambda *_: ANNA)
    assert door.admit("")
    assert door.people.get_user(None, "anna", None, b"certificate") == Reader(UserRole.User, "anna", ANNA)
    assert door.people.get_user(None, "anna", None, b"certificate") is None
