"""Control authority: who takes it from whom, what begins an epoch, what is a sign of life, which round trip counts."""

from __future__ import annotations

import math

import pytest

from gantryctl.service.command.authority import Authority
from gantryctl.service.command.round_trip import RoundTrip
from gantryctl.service.protocol.messages import Identity
from gantryctl.service.protocol.roles import Role

PAGE, OTHER, CONSOLE = (
    Identity(name, name, Role.OPERATOR, place)
    for name, place in (("page", "remote"), ("other", "remote"), ("shell", "local"))
)


def held_by(holder: Identity | None) -> Authority:
    authority = Authority(7)
    if holder is not None:
        authority.take(holder, over=False, at_rest=True, now_s=100.0)
    authority.epoch = 7
    return authority


# Holder, who asks, over, at rest; the refusal, "" for control that is given.
CELLS = [
    (None, PAGE, False, False, ""),
    (PAGE, PAGE, False, False, ""),
    (PAGE, OTHER, False, True, "SEC-07"),
    (PAGE, OTHER, False, False, "SEC-07"),
    (PAGE, OTHER, True, False, "SEC-08"),
    (PAGE, OTHER, True, True, ""),
    (CONSOLE, PAGE, False, True, "SEC-07"),
    (CONSOLE, PAGE, True, False, "SEC-08"),
    (CONSOLE, PAGE, True, True, "SEC-08"),
    (PAGE, CONSOLE, False, False, ""),
    (PAGE, CONSOLE, False, True, ""),
]


@pytest.mark.parametrize(("holder", "who", "over", "at_rest", "code"), CELLS)
def test_every_cell_of_who_takes_control_from_whom(
    holder: Identity | None, who: Identity, over: bool, at_rest: bool, code: str
) -> None:
    authority = held_by(holder)
    refused = authority.take(who, over, at_rest, 101.0)
    assert ("" if refused is None else refused.code) == code
    assert authority.holder is (who if not code else holder)
    # Another holder begins another epoch, once; the same one keeps it.
    assert authority.epoch == (8 if not code and holder is not who else 7)


def test_another_screen_of_the_same_user_begins_another_epoch() -> None:
    """What the first screen has sent before is void."""
    authority, second = held_by(PAGE), PAGE._replace(client="second")
    assert authority.take(second, over=True, at_rest=True, now_s=101.0) is None
    assert (authority.holder, authority.epoch) == (second, 8)


def test_only_the_holder_gives_control_back_and_that_begins_an_epoch() -> None:
    authority = held_by(PAGE)
    assert not authority.give("other")
    assert (authority.holder, authority.epoch) == (PAGE, 7)
    assert authority.give("page")
    assert (authority.holder, authority.epoch) == (None, 8)
    assert not authority.give("page")
    assert authority.epoch == 8


def test_the_holder_is_silent_after_more_than_two_seconds_whatever_others_send() -> None:
    authority = held_by(PAGE)
    authority.alive(OTHER, 101.0)
    assert not authority.silent(102.0)
    assert authority.silent(102.001)
    authority.alive(PAGE, 102.0)
    assert not authority.silent(104.0)
    assert authority.silent(104.001)
    assert not held_by(None).silent(200.0)


def test_another_holder_begins_without_a_round_trip() -> None:
    authority = held_by(PAGE)
    authority.round_trip.take(0.02, 100.0)
    authority.take(PAGE, over=True, at_rest=True, now_s=100.1)
    assert authority.round_trip.shortest_s(100.2) == 0.02
    authority.take(OTHER, over=True, at_rest=True, now_s=100.3)
    assert authority.round_trip.shortest_s(100.3) == math.inf
    authority.round_trip.take(0.03, 100.4)
    authority.give("other")
    assert authority.round_trip.shortest_s(100.4) == math.inf


def test_the_round_trip_is_the_shortest_of_the_last_two_seconds() -> None:
    trip = RoundTrip()
    for age_s, now_s in ((0.05, 10.0), (0.02, 10.5), (0.08, 11.0), (0.06, 11.5)):
        trip.take(age_s, now_s)
    assert trip.shortest_s(12.5) == 0.02
    assert trip.shortest_s(12.501) == 0.06
    assert trip.shortest_s(13.501) == math.inf


@pytest.mark.parametrize("age_s", [-0.001, -math.inf, math.nan])
def test_a_frame_of_the_future_or_an_unknown_one_measures_nothing(age_s: float) -> None:
    trip = RoundTrip()
    trip.take(age_s, 10.0)
    assert trip.shortest_s(10.0) == math.inf


def test_before_anybody_has_control_no_round_trip_is_known() -> None:
    fresh = Authority(7)
    assert fresh.round_trip.shortest_s(100.0) == math.inf
    assert not fresh.silent(1e9)


def test_two_screens_of_one_person_are_two() -> None:
    """Control is that of a connection: what the other screen shows may be old, and nobody stands before it."""
    authority = held_by(PAGE)
    second = PAGE._replace(client="second")
    assert authority.holds(PAGE)
    assert not authority.holds(second)
    authority.alive(second, 110.0)
    assert authority.silent(110.0)
    refused = authority.take(second, over=False, at_rest=True, now_s=110.0)
    assert refused is not None
    assert refused.code == "SEC-07"
