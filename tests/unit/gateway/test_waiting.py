"""Connections that wait: every party has turns of its own, nobody waits behind the whole crowd of another one."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from itertools import repeat

import pytest

from gantryctl.gateway.places import Waiting

MOST, PATIENCE_S = 40, 5.0


class Hall:
    """The room under test, with a clock; connections are named in the order of their coming."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.room = Waiting(MOST, PATIENCE_S, lambda: self.now_s)
        self.made: list[socket.socket] = []

    def come(self, *parties: str) -> None:
        for party in parties:
            self.made.append(socket.socket())
            self.room.add(self.made[-1], "", party)

    def next(self) -> int | None:
        found = self.room.next()
        return None if found is None else self.made.index(found.connection)

    def ended(self) -> list[int]:
        return [n for n, each in enumerate(self.made) if each.fileno() < 0]


@pytest.fixture
def hall() -> Iterator[Hall]:
    made = Hall()
    yield made
    for each in made.made:
        each.close()


def test_a_crowd_of_one_party_delays_no_other(hall: Hall) -> None:
    hall.come(*repeat("crowd", 20), "one", "other")
    assert hall.next() in range(20)
    assert [hall.next(), hall.next()] == [20, 21]
    hall.come("one")
    assert 22 in (hall.next(), hall.next())


def test_of_one_party_the_newest_and_the_oldest_are_next_in_turn(hall: Hall) -> None:
    hall.come(*repeat("crowd", 4))
    assert [hall.next() for _ in range(5)] == [3, 0, 2, 1, None]
    assert len(hall.room) == 0


def test_beyond_the_most_the_oldest_of_the_largest_party_is_ended(hall: Hall) -> None:
    hall.come("one", *repeat("crowd", MOST - 1))
    assert hall.ended() == []
    hall.come("other", "other")
    assert hall.ended() == [1, 2]
    assert len(hall.room) == MOST


def test_who_has_waited_for_too_long_is_ended(hall: Hall) -> None:
    hall.come("crowd", "crowd", "other")
    hall.now_s = PATIENCE_S
    hall.come("crowd")
    hall.now_s += 0.1
    assert [hall.next(), hall.next()] == [3, None]
    assert hall.ended() == [0, 1, 2]


def test_the_oldest_has_waited_for_too_long_though_others_of_its_party_have_not(hall: Hall) -> None:
    hall.come("crowd")
    hall.now_s = PATIENCE_S
    hall.come("crowd", "crowd")
    hall.now_s += 0.1
    assert [hall.next(), hall.next(), hall.next()] == [2, 1, None]
    assert hall.ended() == [0]


def test_at_the_end_nobody_waits(hall: Hall) -> None:
    hall.come("crowd", "crowd", "other")
    hall.room.close()
    assert hall.next() is None
    assert hall.ended() == [0, 1, 2]
