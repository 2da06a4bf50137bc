"""The lease of a held key: begun once, renewed by newer frames of its own page only, ended in time."""

from __future__ import annotations

import math

import pytest

from gantryctl.program.alarms.words import Words
from gantryctl.service.command import lease
from gantryctl.service.command.frame_clock import FrameClock
from gantryctl.service.command.lease import HoldToRun
from gantryctl.service.protocol.frames import mark_of
from gantryctl.service.protocol.limits import HELD_S

# A lease of 250 ms at a scan of 10 ms: the last scan in which the key is held begins less than 240 ms after the frame.
LEASE_S, SCAN_S = 0.25, 0.01


def held(*, forward: bool = True) -> HoldToRun:
    hold = HoldToRun(LEASE_S, SCAN_S)
    assert hold.begin("a", "page", forward, 100.0, 100.1) is None
    return hold


@pytest.mark.parametrize("forward", [True, False])
def test_a_key_gives_its_direction(forward: bool) -> None:
    hold = held(forward=forward)
    assert (hold.forward, hold.reverse, hold.alive, hold.client) == (forward, not forward, True, "page")
    hold.end()
    assert (hold.forward, hold.reverse, hold.alive, hold.client) == (False, False, False, "")


def test_it_ends_in_the_scan_before_its_time_so_that_the_ramp_has_begun() -> None:
    hold = held()
    assert hold.left_s(100.2) == pytest.approx(0.05)
    assert not hold.check(100.239)
    assert hold.check(100.2401)
    assert hold.ended is Words.LEASE_RAN_OUT
    assert not hold.too_long
    assert hold.left_s(100.2) == 0.0
    assert not hold.check(100.25)


def test_the_second_key_stops_the_first() -> None:
    hold = held()
    assert hold.begin("b", "page", False, 100.1, 100.12) is Words.OTHER_KEY
    assert (hold.forward, hold.reverse, hold.alive) == (False, False, False)
    # Neither of them is pressed again without a hand.
    assert hold.begin("a", "page", True, 100.1, 100.13) is Words.LEASE_USED
    assert hold.begin("b", "page", True, 100.1, 100.14) is Words.LEASE_USED


def test_only_a_newer_frame_renews_and_the_lease_counts_from_its_issue() -> None:
    hold = held()
    before = hold.count
    assert hold.renew("a", "page", 100.0, 100.15) is None
    assert hold.renew("a", "page", 99.9, 100.15) is None
    assert (hold.count, hold.issued_s) == (before, 100.0)
    assert hold.renew("a", "page", 100.1, 100.2) is None
    assert (hold.count, hold.issued_s) == (before + 1, 100.1)
    assert not hold.check(100.33)
    assert hold.check(100.341)


@pytest.mark.parametrize(("name", "client"), [("a", "other"), ("b", "page")])
def test_another_page_or_lease_renews_nothing(name: str, client: str) -> None:
    hold = held()
    assert hold.renew(name, client, 100.2, 100.21) is not None
    assert hold.issued_s == 100.0


def test_a_renewal_that_comes_too_late_finds_the_lease_dead() -> None:
    hold = held()
    # No scan has looked in between.
    assert hold.renew("a", "page", 100.3, 100.3) is not None
    assert not hold.alive


@pytest.mark.parametrize(
    ("name", "client", "released"), [("a", "page", True), ("a", "other", False), ("b", "page", False)]
)
def test_a_release_ends_its_own_key(name: str, client: str, released: bool) -> None:
    hold = held()
    assert hold.release(name, client) is released
    assert hold.alive is not released


def test_a_release_before_its_press_kills_it() -> None:
    hold = HoldToRun(LEASE_S, SCAN_S)
    assert not hold.release("a", "page")
    assert hold.begin("a", "page", True, 100.0, 100.1) is Words.LEASE_USED
    assert not hold.alive


def test_no_renewal_holds_a_key_for_longer_than_its_longest_time() -> None:
    hold = held()
    ended_s = None
    for step in range(1, 4000):
        now_s = 100.1 + 0.01 * step
        if hold.renew("a", "page", now_s - 0.02, now_s) is not None:
            ended_s = now_s
            break
    assert ended_s == pytest.approx(100.1 + HELD_S, abs=0.011)
    assert hold.too_long
    # The next press counts anew.
    assert hold.begin("b", "page", True, ended_s, ended_s) is None
    assert not hold.too_long
    assert hold.ended is None


def test_used_leases_are_remembered_within_a_bound() -> None:
    hold = HoldToRun(LEASE_S, SCAN_S)
    for n in range(lease._REMEMBERED + 1):
        hold.release(f"{n:016x}", "page")
    assert len(hold._used) == lease._REMEMBERED
    assert hold.begin(f"{lease._REMEMBERED:016x}", "page", True, 100.0, 100.0) is Words.LEASE_USED


def test_a_press_that_comes_again_after_it_was_forgotten_ends_in_its_scan() -> None:
    """It names the frame that the person saw then."""
    hold = HoldToRun(LEASE_S, SCAN_S)
    assert hold.begin("a", "page", True, 100.0, 100.0 + LEASE_S) is None
    assert hold.check(100.0 + LEASE_S)
    assert not hold.forward
    assert not hold.reverse


def test_a_dead_key_is_told_why_it_has_ended() -> None:
    never = HoldToRun(LEASE_S, SCAN_S)
    assert str(Words.LEASE_ENDED) in str(never.renew("a", "page", 100.2, 100.21))
    late = held()
    assert str(Words.LEASE_RAN_OUT) in str(late.renew("a", "page", 100.3, 100.3))
    # Also afterwards, whoever asks.
    assert str(Words.LEASE_RAN_OUT) in str(late.renew("a", "page", 100.4, 100.41))


def test_at_the_start_no_key_is_held_and_none_was_renewed() -> None:
    hold = HoldToRun(LEASE_S, SCAN_S)
    assert (hold.alive, hold.forward, hold.reverse, hold.client, hold.count) == (False, False, False, "", 0)
    assert (hold.ended, hold.too_long, hold.left_s(100.0)) == (None, False, 0.0)


def test_each_press_and_each_renewal_is_one_of_the_count() -> None:
    hold = held()
    assert hold.count == 1
    hold.renew("a", "page", 100.05, 100.15)
    assert hold.count == 2


def test_without_a_key_nothing_is_renewed() -> None:
    hold = HoldToRun(LEASE_S, SCAN_S)
    assert hold.renew("", "", 100.0, 100.0) is not None
    assert hold.count == 0


def test_a_status_frame_is_as_old_as_its_scan_by_the_clock_of_the_controller() -> None:
    """The count begins at 5 s: a quarter of a second later the frame has 250 ms, and whoever names it saw 5.25 s."""
    clock = FrameClock(5.0)
    assert clock.issued_ms == 0
    clock.tick(5.2509)
    assert clock.issued_ms == 250
    mark = mark_of(250, clock.key, "page")
    assert clock.issued_s(mark, "page") == pytest.approx(5.25)
    assert math.isnan(clock.issued_s(mark, "other"))


def test_a_key_ends_in_the_scan_in_which_its_longest_time_is_over() -> None:
    hold = HoldToRun(LEASE_S, SCAN_S)
    hold.begin("a", "page", True, 0.0, 0.0)
    hold.issued_s = HELD_S - 0.0625  # renewed all the time
    assert hold.check(HELD_S)
    assert hold.too_long
