"""Sessions, lock-out and rate limit on a clock of the test's own."""

from __future__ import annotations

from pathlib import Path

import pytest

from gantryctl.gateway import sessions
from gantryctl.gateway.sessions import (
    FAILURES,
    SESSIONS_OF_USER,
    LockOut,
    Sessions,
    worth_writing,
)
from gantryctl.service.protocol.limits import RateLimiter
from gantryctl.service.protocol.roles import Role
from gantryctl.service.supervisor.users import Users
from support.gateway_by_hand import Clock

PASSWORD = "correct horse battery"


def made(root: Path) -> tuple[Sessions, Users, Clock]:
    users, clock = Users(root), Clock()
    users.add("anna", Role.OPERATOR, PASSWORD)
    return Sessions(users, clock), users, clock


def test_a_session_ends_when_idle_when_old_and_when_closed(tmp_path: Path) -> None:
    """15 min idle, 8 h in all."""
    sessions, users, clock = made(tmp_path)
    session = sessions.open(users.all()["anna"], "here")
    assert sessions.find(session.token) is session
    clock.s += 15 * 60.0 - 1.0
    sessions.use(session)
    clock.s += 15 * 60.0 - 1.0
    assert sessions.find(session.token) is session
    clock.s += 2.0
    assert sessions.find(session.token) is None
    other = sessions.open(users.all()["anna"], "here")
    for _ in range(47):
        clock.s += 600.0
        sessions.use(other)
    clock.s += 599.0
    assert sessions.find(other.token) is other
    clock.s += 2.0
    assert sessions.find(other.token) is None
    third = sessions.open(users.all()["anna"], "here")
    sessions.close(third)
    for token in (third.token, None, "", "0" * 32):
        assert sessions.find(token) is None


def test_another_password_another_role_or_no_user_end_the_session(tmp_path: Path) -> None:
    sessions, users, _ = made(tmp_path)
    changes = (
        lambda: users.set_password("anna", PASSWORD + "!"),
        lambda: (users.remove("anna"), users.add("anna", Role.SERVICE, PASSWORD)),
        lambda: users.set_person("anna", "bela"),
        lambda: users.remove("anna"),
    )
    for change in changes:
        session = sessions.open(users.all()["anna"], "here")
        assert sessions.lives(session)
        change()
        assert not sessions.lives(session)


def test_a_flood_of_logins_ends_only_sessions_of_its_own_user_and_peer(tmp_path: Path) -> None:
    sessions, users, clock = made(tmp_path)
    users.add("ben", Role.OPERATOR, PASSWORD)
    both = users.all()
    ben, console = sessions.open(both["ben"], "uid 1000"), sessions.open(both["anna"], "uid 1000")
    flood = []
    for n in range(1000):
        clock.s += 0.01
        flood.append(sessions.open(both["anna"], "192.0.2.7"))
        assert sessions.lives(flood[-1])
        assert sum(map(sessions.lives, [console, *flood[-SESSIONS_OF_USER:]])) == min(n + 2, SESSIONS_OF_USER)
    assert sessions.lives(ben)
    assert sessions.lives(console)
    # Of its own, the one that was used last stays.
    sessions.use(kept := flood[-SESSIONS_OF_USER + 1])
    clock.s += 0.01
    sessions.open(both["anna"], "192.0.2.7")
    assert sessions.lives(kept)
    # Of a crowd of peers with one session each, the one that was used longest ago goes.
    for n in range(100):
        clock.s += 0.01
        sessions.open(both["anna"], f"192.0.2.{n}")
        sessions.use(console)
    assert sessions.lives(ben)
    assert sessions.lives(console)


def test_failures_double_the_wait_for_this_account_and_address_only() -> None:
    clock = Clock()
    locks = LockOut(clock)
    for _ in range(FAILURES - 1):
        locks.failed("anna", "here")
        assert locks.wait_s("anna", "here") == 0.0
    waits = []
    for _ in range(14):
        locks.failed("anna", "here")
        waits.append(locks.wait_s("anna", "here"))
        clock.s += waits[-1]
        assert locks.wait_s("anna", "here") == 0.0
    assert waits == [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0, 900.0, 900.0, 900.0, 900.0]
    locks.failed("anna", "here")
    assert locks.wait_s("anna", "elsewhere") == locks.wait_s("ben", "here") == 0.0
    locks.passed("anna", "here")
    assert locks.wait_s("anna", "here") == 0.0


def test_a_long_run_of_failures_ends_no_account() -> None:
    """Ten days of guesses, one every 15 minutes, are 960 and more: afterwards the right password still counts."""
    clock = Clock()
    locks = LockOut(clock)
    for _ in range(2000):
        locks.failed("anna", "here")
        clock.s += locks.wait_s("anna", "here")
    assert locks.wait_s("anna", "here") == 0.0
    locks.failed("anna", "here")
    assert locks.wait_s("anna", "here") == 900.0


def test_a_flood_of_names_does_not_fill_the_memory() -> None:
    locks = LockOut(Clock())
    for n in range(20_000):
        locks.failed(f"name{n}", "here")
    assert len(locks._failures) == 10_000


def test_the_journal_has_the_first_five_failures_and_every_tenth() -> None:
    assert [count for count in range(1, 31) if worth_writing(count)] == [1, 2, 3, 4, 5, 10, 20, 30]


def test_a_flood_of_names_frees_nobody_who_guessed_a_moment_ago() -> None:
    """Who failed longest ago is forgotten; each failure makes a pair the newest again."""
    locks = LockOut(Clock())
    for name in ("old", "kept"):
        for _ in range(FAILURES):
            locks.failed(name, "here")
    for n in range(9_999):
        locks.failed(f"name{n}", "here")
        if n == 5_000:
            locks.failed("kept", "here")
    assert locks.wait_s("old", "here") == 0.0
    assert locks.wait_s("kept", "here") == 2.0


def test_who_guesses_again_is_remembered_from_then_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three are remembered: of anna, bert, anna again, carl and dora it is bert who is forgotten."""
    monkeypatch.setattr(sessions, "_REMEMBERED", 3)
    locks = LockOut()
    for name in ("anna", "bert", "anna", "carl", "dora"):
        locks.failed(name, "here")
    assert [locks.failed(name, "here") for name in ("anna", "bert")] == [3, 1]


def test_the_rate_limit_gives_its_reserve_then_its_rate_to_each_address() -> None:
    clock = Clock()
    limit = RateLimiter(10.0, 40.0, clock)
    assert [limit.wait_s("a") for _ in range(40)] == [0.0] * 40
    assert limit.wait_s("a") == 0.1
    assert limit.wait_s("b") == 0.0
    allowed = 0
    for _ in range(1280):
        clock.s += 1.0 / 128.0  # exact in binary
        allowed += limit.wait_s("a") == 0.0
    assert allowed == 100  # 10 s at 10 a second


def test_who_logs_in_counts_to_the_crowd_of_its_peer(tmp_path: Path) -> None:
    """Eight sessions of each of two peers: the ninth of one ends its own that was unused for longest, no other."""
    sessions, users, clock = made(tmp_path)
    anna, opened = users.all()["anna"], []
    for n in range(SESSIONS_OF_USER):
        clock.s += 1.0
        opened.append(sessions.open(anna, ("there", "here")[n % 2]))
    for peer in ("here", "there"):
        oldest = next(each for each in opened if each.peer == peer)
        new = sessions.open(anna, peer)
        assert [each for each in opened if not sessions.lives(each)] == [oldest]
        opened = [*(each for each in opened if each is not oldest), new]
