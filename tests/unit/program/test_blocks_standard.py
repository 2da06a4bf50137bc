"""IEC 61131-3 standard blocks, against the timing diagrams of the standard drawn as text: one column a scan."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.program.blocks import CTU, F_TRIG, R_TRIG, RS, SR, TOF, TON, TP


def drawn(signal: str) -> list[bool]:
    return [mark == "#" for mark in signal]


def times(timer: TON | TOF | TP, signal: str, pt_s: float, period_s: float = 1.0) -> tuple[str, list[float]]:
    """Outputs of a timer over a drawn input: Q drawn, and ET."""
    q, et = "", []
    for scan, level in enumerate(drawn(signal)):
        timer(in_=level, pt_s=pt_s, time_s=scan * period_s)
        q += "#" if timer.q else "."
        et.append(timer.et_s)
    return q, et


@pytest.mark.parametrize(
    ("timer", "signal", "q", "et"),
    [
        (TON, ".######..##.####", "....###........#", [0, 0, 1, 2, 3, 3, 3, 0, 0, 0, 1, 0, 0, 1, 2, 3]),
        (TOF, "..##.....#..##..", "..#####..#######", [0, 0, 0, 0, 0, 1, 2, 3, 3, 0, 0, 1, 0, 0, 0, 1]),
        (TP, ".#......#.#.####", ".###....###.###.", [0, 0, 1, 2, 0, 0, 0, 0, 0, 1, 2, 0, 0, 1, 2, 3]),
    ],
)
def test_timers_follow_the_diagrams_of_the_standard(
    timer: Callable[[], TON | TOF | TP], signal: str, q: str, et: list[float]
) -> None:
    assert times(timer(), signal, 3.0) == (q, et)


@pytest.mark.parametrize("period_s", [0.001, 0.004, 0.01])
def test_a_timer_ends_in_the_scan_of_its_time_whatever_rounding_does(period_s: float) -> None:
    """5 s are 500 scans of 10 ms from every start; without the tolerance some starts give 501."""
    scans = round(5.0 / period_s)
    for start in range(0, 40 * 7, 7):
        timer = TON()
        timer(in_=True, pt_s=5.0, time_s=start * period_s)
        timer(in_=True, pt_s=5.0, time_s=(start + scans - 1) * period_s)
        assert not timer.q
        timer(in_=True, pt_s=5.0, time_s=(start + scans) * period_s)
        assert timer.q
        assert timer.et_s == 5.0


@pytest.mark.parametrize("pt_s", [math.nan, math.inf, -1.0])
def test_a_timer_without_a_time_shows_an_error_and_never_switches_on_by_itself(pt_s: float) -> None:
    on, pulse, off = TON(), TP(), TOF()
    for scan in range(5):
        for timer in (on, pulse, off):
            timer(in_=scan > 0, pt_s=pt_s, time_s=float(scan))
    assert on.error
    assert pulse.error
    assert off.error
    assert (on.q, pulse.q, off.q) == (False, False, True)
    off(in_=False, pt_s=pt_s, time_s=6.0)
    assert not off.q


def test_a_time_of_zero() -> None:
    assert times(TON(), ".##.", 0.0)[0] == ".##."
    assert times(TOF(), ".##.", 0.0)[0] == ".##."
    assert times(TP(), ".##.", 0.0)[0] == "...."


@given(st.lists(st.booleans(), max_size=40))
def test_edges_are_where_the_signal_changes(levels: list[bool]) -> None:
    rising, falling = R_TRIG(), F_TRIG()
    before = False
    for level in levels:
        rising(clk=level)
        falling(clk=level)
        assert rising.q == (level > before)
        assert falling.q == (level < before)
        before = level


def test_a_falling_edge_needs_an_edge() -> None:
    edge = F_TRIG()
    edge(clk=False)
    assert not edge.q


def test_set_and_reset_together() -> None:
    set_first, reset_first = SR(), RS()
    seen = []
    for s, r in ((False, False), (True, False), (False, False), (True, True), (False, True), (False, False)):
        set_first(s1=s, r=r)
        reset_first(s=s, r1=r)
        seen.append((set_first.q1, reset_first.q1))
    assert seen == [
        (False, False), (True, True), (True, True), (True, False), (False, False), (False, False),
    ]  # fmt: skip


def test_the_counter_counts_edges_until_the_largest_int() -> None:
    counter = CTU()
    for level in drawn("#.##.#"):
        counter(cu=level, r=False, pv=3)
    assert counter.cv == 3
    assert counter.q
    counter(cu=False, r=True, pv=3)
    assert counter.cv == 0
    assert not counter.q
    counter(cu=True, r=True, pv=3)
    counter(cu=True, r=False, pv=3)
    assert counter.cv == 0, "an edge under reset is lost, as the standard has it"
    counter.cv = 32767
    for level in (False, True):
        counter(cu=level, r=False, pv=3)
    assert counter.cv == 32767


@pytest.mark.parametrize("timer", [TON, TOF, TP])
def test_a_new_timer_shows_nothing_and_no_time_at_all_is_one(timer: Callable[[], TON | TOF | TP]) -> None:
    new = timer()
    assert (new.q, new.et_s, new.error) == (False, 0.0, False)
    new(in_=True, pt_s=0.0, time_s=0.0)
    assert not new.error


def test_a_pulse_that_an_impossible_time_has_ended_begins_with_an_edge_only() -> None:
    pulse = TP()
    for time_s, pt_s, q, error in (
        (0.0, 9.0, True, False),
        (1.0, math.nan, False, True),
        (2.0, 9.0, False, False),
        (3.0, 9.0, False, False),
    ):
        pulse(in_=True, pt_s=pt_s, time_s=time_s)
        assert (pulse.q, pulse.error) == (q, error)


def test_a_counter_counts_edges_alone() -> None:
    counter = CTU()
    for cu, count in ((False, 0), (False, 0), (True, 1), (True, 1), (False, 1), (False, 1), (True, 2)):
        counter(cu=cu, r=False, pv=2)
        assert (counter.cv, counter.q) == (count, count == 2)
