"""Who comes and goes: so many rows of the journal for an account, and all of them add up."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from gantryctl.service.clients.logins import LoginLog
from gantryctl.service.protocol.messages import Identity
from gantryctl.service.protocol.roles import Role

ANNA = Identity("a1", "anna", Role.OPERATOR, "local", "anna")
BEN = Identity("b1", "ben", Role.OPERATOR, "local", "ben")


class Door:
    """A log of logins at a time that the test sets, and what was written: text, user, count."""

    def __init__(self) -> None:
        self.s, self.rows = 0.0, list[Any]()
        events: Any = SimpleNamespace(put=self.put)
        self.log = LoginLog(events, lambda: self.s)

    def put(self, kind: str, text: str, who: Identity, **values: int) -> None:
        assert kind == "login"
        self.rows.append((text, who.user, values.get("count", 1)))


def test_who_comes_and_goes_all_day_has_200_rows_and_one_every_two_seconds() -> None:
    """13 871 connections in 9 s of one user wrote 28 000 rows: 500 MB, all there is, in eight minutes."""
    door = Door()
    for n in range(10_000):  # in 100 s, which are 50 rows more
        door.s = 0.01 * n
        door.log.put("at the local socket", ANNA)
    assert len(door.rows) == 200 + 49
    assert door.rows[:200] == [("at the local socket", "anna", 1)] * 200
    # The next one has all of the 2 s that have filled up again, the 200 rows taken with them.
    assert door.rows[201] == ("at the local socket; 199 more since the row before", "anna", 200)
    door.log.close()
    assert sum(count for _, _, count in door.rows) == 10_000


def test_nobody_takes_rows_from_another() -> None:
    door = Door()
    for _ in range(300):
        door.log.put("connected", ANNA)
    door.log.put("connected", BEN)
    assert door.rows[-1] == ("connected", "ben", 1)


def test_what_was_counted_is_written_at_the_end_once_with_who_came_last() -> None:
    door = Door()
    for n in range(203):
        door.log.put("connected", ANNA._replace(client=f"a{n}"))
    assert len(door.rows) == 200
    door.log.close()
    door.log.close()
    assert door.rows[200:] == [("connected; 2 more since the row before", "anna", 3)]


def test_one_that_was_counted_alone_is_a_row_like_any_other() -> None:
    door = Door()
    for _ in range(201):
        door.log.put("disconnected", BEN)
    door.log.close()
    assert door.rows[200:] == [("disconnected", "ben", 1)]
