"""Sessions of the page, by hand: when they end, and who makes room."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from gantryctl.gateway.access import person
from gantryctl.gateway.sessions import SESSIONS_OF_USER, Session, Sessions
from gantryctl.service.protocol.roles import Role
from gantryctl.service.supervisor.users import User
from support.gateway_by_hand import ANNA, BEN, Clock


def sessions(*users: User) -> tuple[Sessions, Clock, dict[str, User]]:
    """Sessions of users whose file is read in every request."""
    known, clock = {each.name: each for each in users}, Clock()
    stamps = iter(range(10**6))
    path = SimpleNamespace(stat=lambda: SimpleNamespace(st_mtime_ns=next(stamps), st_ino=1))
    return Sessions(SimpleNamespace(path=path, all=lambda: dict(known)), clock), clock, known  # type: ignore[arg-type]


def test_a_session_that_has_ended_does_not_come_back_with_its_role() -> None:
    made, _, known = sessions(ANNA)
    session = made.open(ANNA, "here")
    known["anna"] = ANNA._replace(role=Role.VIEWER)
    assert made.find(session.token) is None
    known["anna"] = ANNA
    assert made.find(session.token) is None


def test_a_session_that_was_idle_for_a_quarter_of_an_hour_has_ended() -> None:
    made, clock, _ = sessions(ANNA)
    session = made.open(ANNA, "here")
    clock.s += 899.5
    assert made.lives(session)
    clock.s += 0.5
    assert not made.lives(session)


def test_a_session_ends_with_its_eighth_hour() -> None:
    made, clock, _ = sessions(ANNA)
    session = made.open(ANNA, "here")
    clock.s += 28_799.5
    made.use(session)
    assert made.lives(session)
    clock.s += 0.5
    made.use(session)
    assert not made.lives(session)


def test_sessions_that_have_ended_take_no_room() -> None:
    """Fifteen, each of another peer; the one that lives has its place beside the next one."""
    made, clock, _ = sessions(ANNA)
    for n in range(SESSIONS_OF_USER - 1):
        made.open(ANNA, f"192.0.2.{n}")
    clock.s += 900.0
    own = made.open(ANNA, "here")
    made.open(ANNA, "here")
    assert made.lives(own)


def test_the_peer_that_has_most_sessions_makes_room_and_the_newcomer_counts_once() -> None:
    """Seven older ones of the newcomer are eight with the new one: fewer than the nine of the other peer."""
    made, clock, _ = sessions(ANNA)
    opened = []
    for peer in (*["here"] * 7, *["there"] * 9):
        clock.s += 1.0
        opened.append((peer, made.open(ANNA, peer)))
    made.open(ANNA, "here")
    ended = [(peer, n) for n, (peer, each) in enumerate(opened) if not made.lives(each)]
    assert ended == [("there", 7)]


def test_sixteen_sessions_of_one_user_end_none_of_another() -> None:
    made, clock, _ = sessions(ANNA, BEN)
    own = []
    for _ in range(SESSIONS_OF_USER):
        clock.s += 1.0
        own.append(made.open(ANNA, "here"))
    made.open(BEN, "here")
    assert all(map(made.lives, own))
    made.open(ANNA, "here")
    assert [made.lives(each) for each in own] == [False] + [True] * (SESSIONS_OF_USER - 1)


def test_the_file_of_users_is_read_when_it_has_changed() -> None:
    made, _, _ = sessions(ANNA)
    reads: list[int] = []
    stamp = SimpleNamespace(st_mtime_ns=7, st_ino=1)
    path: Any = SimpleNamespace(stat=lambda: stamp)
    made._users = SimpleNamespace(path=path, all=lambda: reads.append(1) or {"anna": ANNA})  # type: ignore[assignment, func-returns-value]
    session = made.open(ANNA, "here")
    for inode, count in ((1, 1), (1, 1), (2, 2), (2, 2)):
        stamp.st_ino = inode
        assert made.lives(session)
        assert len(reads) == count


def test_a_session_names_its_person_and_not_its_account() -> None:
    session = Session("t", "op1", Role.OPERATOR, "Anna", "k", "here", 0.0, 0.0)
    assert {key: person(session)[key] for key in ("user", "person", "role")} == {
        "user": "op1", "person": "Anna", "role": "operator",
    }  # fmt: skip


def test_nobody_can_guess_a_session() -> None:
    """Of 128 bits, and another one each time."""
    made, _, _ = sessions(ANNA)
    tokens = {made.open(ANNA, "here").token for _ in range(3)}
    assert [len(each) for each in tokens] == [32] * 3
