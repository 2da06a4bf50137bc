"""Brake tests over the runs of a machine: when the next one is due, what a failed one forbids; on both sides."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.operation.brake_policy import (
    after_test,
    brake_due,
    judge_due,
    last_test,
    locked_code,
    restore_learned,
    still_failed,
    why_brake_failed,
)
from gantryctl.operation.client import BrakeDue
from gantryctl.operation.opening import open_axis
from gantryctl.operation.store import TIME_FORMAT
from gantryctl.program import BrakeTestOutcome, BrakeTestResult, Code
from gantryctl.program.alarms.reason import ClearedBy
from gantryctl.program.alarms.words import Words
from gantryctl.runtime import Retained
from gantryctl.wiring.program import axis_settings

from .kept_bench import IDEAL, MACHINE, NEW, REAL, an_axis, kept_machine

approx = pytest.approx
NOW = datetime(2026, 6, 15, 12, 0, 0, tzinfo=UTC)

# --- the next brake test: seven days or 100 power-ups -----------------------------------------------------------------


def last_tested(days_ago: float, power_ups: int = 50, **more: Any) -> Retained:
    at = (NOW - timedelta(days=days_ago)).strftime(TIME_FORMAT)
    return replace(NEW, brake_tested_at=at, brake_tested_power_ups=power_ups, **more)


@pytest.mark.parametrize(
    ("retained", "power_ups", "left", "overdue"),
    [
        (last_tested(6.99), 50, 100, False),
        (last_tested(7.0), 50, 100, True),
        (last_tested(0.0), 149, 1, False),
        (last_tested(0.0), 150, 0, True),
        (last_tested(0.0), 151, 0, True),
        # A new simulated machine was delivered with a tested brake; a date that cannot be read is no date.
        (NEW, 99, 1, False),
        (NEW, 100, 0, True),
        (replace(NEW, brake_tested_at="yesterday"), 0, 100, True),
    ],
)
def test_a_brake_test_is_due_by_its_date_or_its_power_ups(
    retained: Retained, power_ups: int, left: int, overdue: bool
) -> None:
    due = brake_due(MACHINE, None, retained, power_ups, NOW)
    assert (due.power_ups_left, due.overdue) == (left, overdue)
    assert due.overdue_deg_s == approx(1.0)


def test_a_real_machine_that_was_never_tested_is_overdue() -> None:
    assert brake_due(REAL, None, NEW, 0, NOW).overdue
    assert not brake_due(REAL, None, last_tested(1.0), 50, NOW).overdue


def test_a_brake_that_cannot_be_tested_is_never_due() -> None:
    due = brake_due(REAL, Words.NO_TORQUE_INPUT, NEW, 1000, NOW)
    assert due == BrakeDue("", None, overdue=False) or (due.power_ups_left is None and not due.overdue)
    assert due.words == "not testable here"


def test_when_it_is_due_is_told() -> None:
    assert brake_due(MACHINE, None, last_tested(1.0), 60, NOW).words == (
        f"due {(NOW + timedelta(days=6)).strftime(TIME_FORMAT)}, or after 90 more power-ups"
    )
    assert brake_due(MACHINE, None, NEW, 60, NOW).words == "due after 40 more power-ups"
    assert "nothing moves faster than 1 deg/s" in brake_due(MACHINE, None, last_tested(8.0), 60, NOW).words


# --- what a test leaves behind ----------------------------------------------------------------------------------------

FAILED, PASSED, ABORTED = BrakeTestOutcome.FAILED, BrakeTestOutcome.PASSED, BrakeTestOutcome.ABORTED


def result(outcome: BrakeTestOutcome, plus_nm: float = 65.5, minus_nm: float = -66.0) -> BrakeTestResult:
    return BrakeTestResult(outcome, plus_nm, minus_nm, 1e-5, Words.STOPPED)


@pytest.mark.parametrize(
    ("outcome", "dated", "failed", "counts"),
    [(PASSED, True, False, (4, 1)), (FAILED, True, True, (4, 2)), (ABORTED, False, None, (3, 1))],
)
@pytest.mark.parametrize("failed_before", ["", "bore 10 N m"])
def test_a_test_that_ended_has_a_date_and_a_verdict_and_an_aborted_one_changes_neither(
    failed_before: str, outcome: BrakeTestOutcome, dated: bool, failed: bool | None, counts: tuple[int, int]
) -> None:
    before = last_tested(8.0, 7, brake_failed=failed_before, brake_tests=3, brake_tests_failed=1)
    after = after_test(before, result(outcome), 61, NOW)
    assert after.brake_test_outcome == outcome.name.lower()
    assert (after.brake_plus_nm, after.brake_minus_nm) == (65.5, -66.0)
    assert (after.brake_tests, after.brake_tests_failed) == counts
    assert (after.brake_tested_at == NOW.strftime(TIME_FORMAT)) is dated
    assert after.brake_tested_power_ups == (61 if dated else 7)
    assert bool(after.brake_failed) is (bool(failed_before) if failed is None else failed)
    assert last_test(after) == [{"words": "STOPPED", "values": {}}]


def test_a_direction_that_was_not_held_has_no_torque() -> None:
    after = after_test(NEW, result(FAILED, math.nan, math.inf), 1, NOW)
    assert (after.brake_plus_nm, after.brake_minus_nm) == (None, None)


def test_only_service_opens_a_failed_brake_and_a_locked_alarm() -> None:
    assert locked_code(None) == ""
    assert locked_code(NEW) == ""
    assert locked_code(replace(NEW, error_stop="CTL-03")) == ""
    assert locked_code(replace(NEW, error_stop="BRK-03")) == "BRK-03"
    assert locked_code(replace(NEW, brake_failed="bore 10 N m")) == "BRK-08"
    assert locked_code(replace(NEW, brake_failed="bore 10 N m", error_stop="CTL-03")) == "BRK-08"
    assert why_brake_failed(NEW) is None
    # Of an older version, or before the first test, there are no words.
    assert last_test(NEW) == []
    reason = why_brake_failed(replace(NEW, brake_failed="bore 10 N m"))
    assert reason is not None
    assert (reason.code, reason.cleared_by) == (Code.BRK_08, ClearedBy.SERVICE)
    assert "bore 10 N m" in reason.text


@pytest.mark.parametrize("outcome", ["failed", "aborted"])
def test_a_failure_is_told_in_the_words_of_its_own_test(outcome: str) -> None:
    """An aborted test leaves the verdict of the one before, and has words of its own."""
    kept = replace(
        NEW, brake_failed="bore 10 N m", brake_test_outcome=outcome,
        brake_test_words=json.dumps([{"words": "STOPPED", "values": {}}]),
    )  # fmt: skip
    reason = why_brake_failed(kept)
    assert reason is not None
    assert ("bore 10 N m" in reason.text) is (outcome == "aborted")


def test_a_failure_is_kept_until_a_test_has_passed_or_service_has_reset() -> None:
    axis, kept = an_axis(), replace(NEW, brake_failed="bore 10 N m")
    assert still_failed(axis, kept) == ""
    axis.alarms.raise_(Code.BRK_08, measured="a test")
    assert still_failed(axis, kept) == "bore 10 N m"


# --- what earlier runs have learned -----------------------------------------------------------------------------------


def test_what_was_learned_is_given_back_and_what_is_no_number_is_not() -> None:
    axis = an_axis()
    restore_learned(axis, replace(NEW, torque_weights="[1.0, 2.0, 3.0, 4.0, 5.0]", emergency_brake_stops=3))
    assert axis.torque_weights == (1.0, 2.0, 3.0, 4.0, 5.0)
    for wrong in ("", "{", "[1.0, 2.0]", '["a", 2.0, 3.0, 4.0, 5.0]', "[NaN, 2.0, 3.0, 4.0, 5.0]", "7"):
        axis = an_axis()
        restore_learned(axis, replace(NEW, torque_weights=wrong, calibration_watch=wrong))
        assert axis.torque_weights == ()


def test_what_was_seen_of_a_calibration_is_given_back_and_told() -> None:
    given: list[object] = []
    watch = SimpleNamespace(restore=given.append)
    axis: Any = an_axis()
    stand_in: Any = SimpleNamespace(
        monitors=axis.monitors, power=axis.power,
        load_side=SimpleNamespace(watch=watch, warn_stale=lambda: given.append("told")),
    )  # fmt: skip
    restore_learned(stand_in, replace(NEW, calibration_watch='{"found": {}}'))
    assert given == [{"found": {}}, "told"]
    for nothing in ("", "[]", "{"):
        restore_learned(stand_in, replace(NEW, calibration_watch=nothing))
    stand_in.load_side.watch = None
    restore_learned(stand_in, replace(NEW, calibration_watch='{"found": {}}'))
    assert len(given) == 2
    # Nor is it asked of a machine without compensations.
    assert axis.load_side is None
    restore_learned(axis, replace(NEW, calibration_watch='{"found": {}}'))


def test_brake_stops_of_all_runs_are_told_together() -> None:
    most = axis_settings(IDEAL).power.brake_stops_max
    for stops, codes in ((most - 1, []), (most, [Code.BRK_09])):
        axis = an_axis()
        restore_learned(axis, replace(NEW, emergency_brake_stops=stops))
        assert list(axis.alarms.active) == codes


@pytest.mark.parametrize(("days_ago", "overdue"), [(1.0, False), (8.0, True)])
def test_the_axis_is_told_whether_its_brake_test_is_overdue(days_ago: float, overdue: bool) -> None:
    told: list[bool] = []
    axis: Any = SimpleNamespace(
        settings=SimpleNamespace(power=SimpleNamespace(untestable=None)),
        judge_brake=lambda *, overdue: told.append(overdue),
    )
    at = (datetime.now(UTC) - timedelta(days=days_ago)).strftime(TIME_FORMAT)
    judge_due(MACHINE, axis, replace(NEW, brake_tested_at=at), 0)
    assert told == [overdue]


def test_a_machine_whose_brake_has_failed_opens_with_that_alarm() -> None:
    """Before any scan: what asks the axis itself must not find it sound."""
    with kept_machine(IDEAL, brake_failed="bore 10 N m") as store:
        opened = open_axis(IDEAL, store)
    assert Code.BRK_08 in opened.program.axis.alarms.active
