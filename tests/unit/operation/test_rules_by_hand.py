"""Rules over the runs of a machine on both sides of their limits: brake test, reference, proofs, memory; by hand."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.errors import AlarmStop, CommandRefused
from gantryctl.image import DriveState, LinkHealth
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.operation import opening
from gantryctl.operation.brake_policy import (
    after_test,
    brake_due,
    last_test,
    locked_code,
    restore_learned,
    still_failed,
    why_brake_failed,
)
from gantryctl.operation.client import BrakeDue, Ending, Stop
from gantryctl.operation.home_reference import RestVerdict, judge_reference
from gantryctl.operation.ledger.acceptance import proven_hash
from gantryctl.operation.opening import new_machine, open_axis, retained_of_new_plant
from gantryctl.operation.proofs import (
    CommissioningRecord,
    SilentMasterProof,
    why_in_fault,
    why_not_commissioned,
    why_silence_not_proven,
)
from gantryctl.operation.run import AxisRun
from gantryctl.operation.run_memory import RunEnd, retained_after
from gantryctl.operation.store import TIME_FORMAT, StateStore
from gantryctl.program import Axis, BrakeTestOutcome, BrakeTestResult, Code
from gantryctl.program.alarms.reason import ClearedBy
from gantryctl.program.alarms.words import Words
from gantryctl.runtime import Retained
from gantryctl.units import deg, rad
from gantryctl.wiring.program import axis_settings

approx = pytest.approx
MACHINE = default_machine()
IDEAL = with_values(MACHINE, {"drive.kind": "ideal"})
REAL = with_values(
    MACHINE,
    {
        "drive.kind": "canopen",
        "control.scan_period_ms": 4.0,
        "can.interface": "socketcan",
        "can.channel": "can0",
    },
)
NEW = Retained(machine=MACHINE.name, config_hash="")
NOW = datetime(2026, 6, 15, 12, 0, 0, tzinfo=UTC)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))
    return tmp_path


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
    due = brake_due(REAL, Words.BRAKE_OPENED_BY_DRIVE, NEW, 1000, NOW)
    assert due == BrakeDue("", None, overdue=False) or (due.power_ups_left is None and not due.overdue)
    assert due.words == "not testable here"


def test_when_it_is_due_is_told() -> None:
    assert brake_due(MACHINE, None, last_tested(1.0), 60, NOW).words == (
        f"due {(NOW + timedelta(days=6)).strftime(TIME_FORMAT)}, or after 90 more power-ups"
    )
    assert brake_due(MACHINE, None, NEW, 60, NOW).words == "due after 40 more power-ups"
    assert "nothing moves faster than 1 deg/s" in brake_due(MACHINE, None, last_tested(8.0), 60, NOW).words


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


def an_axis(machine: Machine = IDEAL) -> Axis:
    return Axis(axis_settings(machine), 0.0)


def test_what_was_learned_is_given_back_and_what_is_no_number_is_not() -> None:
    axis = an_axis()
    restore_learned(axis, replace(NEW, torque_weights="[1.0, 2.0, 3.0, 4.0, 5.0]", emergency_brake_stops=3))
    assert axis.torque_weights == (1.0, 2.0, 3.0, 4.0, 5.0)
    for wrong in ("", "{", "[1.0, 2.0]", '["a", 2.0, 3.0, 4.0, 5.0]', "[NaN, 2.0, 3.0, 4.0, 5.0]", "7"):
        axis = an_axis()
        restore_learned(axis, replace(NEW, torque_weights=wrong, calibration_watch=wrong))
        assert axis.torque_weights == ()


def test_brake_stops_of_all_runs_are_told_together() -> None:
    most = axis_settings(IDEAL).power.brake_stops_max
    for stops, codes in ((most - 1, []), (most, [Code.BRK_09])):
        axis = an_axis()
        restore_learned(axis, replace(NEW, emergency_brake_stops=stops))
        assert list(axis.alarms.active) == codes


def test_a_failure_is_kept_until_a_test_has_passed_or_service_has_reset() -> None:
    axis, kept = an_axis(), replace(NEW, brake_failed="bore 10 N m")
    assert still_failed(axis, kept) == ""
    axis.alarms.raise_(Code.BRK_08, measured="a test")
    assert still_failed(axis, kept) == "bore 10 N m"


# --- the reference ----------------------------------------------------------------------------------------------------

FRESH = new_machine(MACHINE, 20.0)
SCALE, REST = FRESH.scale, FRESH.retained
RAW = FRESH.drive.read().pos_act_counts


@pytest.mark.parametrize(
    ("moved_deg", "verdict"),
    [
        *((sign * moved, verdict) for sign in (1.0, -1.0) for moved, verdict in (
            (0.0499, RestVerdict.OK), (0.0501, RestVerdict.MOVED),
            # 0.31469 deg are a turn of the motor; three are 0.94406.
            (0.2646, RestVerdict.MOVED), (0.2648, RestVerdict.TURNS),
            (0.3646, RestVerdict.TURNS), (0.3648, RestVerdict.MOVED),
            (0.9940, RestVerdict.TURNS), (0.9960, RestVerdict.MOVED),
            (0.9999, RestVerdict.MOVED), (1.0001, RestVerdict.NOT_VALID),
        )),
    ],
)  # fmt: skip
def test_a_way_while_off_is_judged_alike_both_ways(moved_deg: float, verdict: RestVerdict) -> None:
    raw = (RAW + moved_deg / SCALE.deg_per_count) % SCALE.range_counts
    reading = judge_reference(SCALE, raw, REST)
    assert reading.moved_deg == approx(moved_deg, abs=1e-6)
    assert reading.verdict is verdict


@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize(("beyond_deg", "verdict"), [(-0.01, RestVerdict.OK), (0.01, RestVerdict.NOT_VALID)])
def test_no_angle_beyond_a_stop_is_true(end: int, beyond_deg: float, verdict: RestVerdict) -> None:
    angle = SCALE.stops_deg[end] + (beyond_deg if end else -beyond_deg)
    zero = round(RAW - angle / SCALE.deg_per_count)
    reading = judge_reference(SCALE, RAW, replace(REST, zero_offset_counts=zero))
    assert reading.angle_deg == approx(angle, abs=1e-5)
    assert reading.verdict is verdict


@pytest.mark.parametrize("below", [True, False])
@pytest.mark.parametrize(("more_deg", "verdict"), [(0.01, RestVerdict.OK), (-0.01, RestVerdict.WRAP)])
def test_each_margin_to_the_wrap_counts(below: bool, more_deg: float, verdict: RestVerdict) -> None:
    margin = SCALE.wrap_margin_min_deg + more_deg
    low_deg = SCALE.pos_min_deg - margin if below else None
    zero_from_low = -low_deg if low_deg is not None else None
    range_deg = SCALE.range_counts * SCALE.deg_per_count
    zero_deg = zero_from_low if zero_from_low is not None else range_deg - SCALE.pos_max_deg - margin
    zero = round(zero_deg / SCALE.deg_per_count)
    raw = zero + 20.0 / SCALE.deg_per_count
    kept = replace(REST, zero_offset_counts=zero, rest_position_counts=round(raw))
    reading = judge_reference(SCALE, raw, kept)
    assert reading.verdict is verdict
    margins = (reading.margin_minus_deg, reading.margin_plus_deg)
    assert min(each for each in margins if each is not None) == approx(margin, abs=1e-5)


# --- what is kept of a run --------------------------------------------------------------------------------------------


class Left:
    """A drive that was left at a count."""

    def __init__(self, counts: float) -> None:
        self._counts = counts

    def identity(self) -> Any:
        return SCALE.identity

    def read(self) -> Any:
        return SimpleNamespace(pos_act_counts=self._counts)


END = RunEnd("done", None, power_ups=2, moves=5, time_s=9.0)


@pytest.mark.parametrize("way_deg", [90.0, -90.0])
def test_the_way_between_two_rests_is_added_whatever_its_direction(way_deg: float) -> None:
    counts = RAW + way_deg / SCALE.deg_per_count
    before = replace(REST, travelled_rad=1.0, power_ups=10, moves=20)
    after = retained_after(MACHINE, before, an_axis(MACHINE), Left(counts), END)
    assert after.travelled_rad == approx(1.0 + math.pi / 2.0, rel=1e-9)
    assert (after.power_ups, after.moves) == (12, 25)
    assert after.rest_position_counts == int(counts) % SCALE.range_counts
    assert after.last_result == "done"
    nowhere = retained_after(
        MACHINE, replace(before, rest_position_counts=None), an_axis(MACHINE), Left(counts), END
    )
    assert nowhere.travelled_rad == 1.0


def test_what_stopped_the_axis_holds_it_and_is_kept_with_its_angle() -> None:
    axis = an_axis()
    axis.pos_act_rad = rad(30.0)
    quiet = retained_after(MACHINE, REST, axis, Left(RAW), END)
    assert (quiet.error_stop, quiet.alarms, quiet.doubted_by) == ("", (), "")
    left = END._replace(alarm=AlarmStop("SYS-10 STOP · a test", Code.SYS_10))
    held = retained_after(MACHINE, REST, axis, Left(RAW), left)
    assert held.error_stop == "SYS-10"
    assert (held.alarms[-1].code, held.alarms[-1].severity) == ("SYS-10", "STOP")
    assert held.alarms[-1].pos_act_rad == approx(rad(30.0))
    axis.feedback.in_doubt = True
    held = retained_after(MACHINE, REST, axis, Left(RAW), left)
    assert held.doubted_by == "SYS-10"
    assert held.alarms[-1].pos_act_rad is None
    assert (
        retained_after(MACHINE, replace(REST, doubted_by="ENC-01"), axis, Left(RAW), left).doubted_by
        == "ENC-01"
    )
    axis.alarms.raise_(Code.CTL_02, measured="a test")
    first = retained_after(MACHINE, REST, axis, Left(RAW), left)
    assert first.error_stop == "CTL-02", "the first alarm, not what followed from it"


@pytest.mark.parametrize(("scan", "failed_before", "kept"), [(0, "x", 0), (1, "x", 1), (0, "", 1)])
def test_a_failed_brake_of_an_earlier_run_is_not_written_down_again(
    scan: int, failed_before: str, kept: int
) -> None:
    axis = an_axis()
    axis.alarms.scan = scan
    axis.alarms.raise_(Code.BRK_08, measured="a test")
    after = retained_after(MACHINE, replace(REST, brake_failed=failed_before), axis, Left(RAW), END)
    assert len(after.alarms) == kept


# --- opening ----------------------------------------------------------------------------------------------------------


@contextmanager
def kept_machine(machine: Machine = MACHINE, **values: Any) -> Iterator[StateStore]:
    found = new_machine(machine, 10.0)
    with StateStore(machine) as store:
        opening.keep_machine(machine, store, found.drive, replace(found.retained, **values))
        yield store


@pytest.mark.parametrize(
    ("stopped_by", "doubted_by", "cleared"),
    [
        ("CTL-03", "", ClearedBy.RESET),
        ("CTL-03", "ENC-01", ClearedBy.SERVICE),
        ("BRK-03", "", ClearedBy.SERVICE),
    ],
)
def test_a_stop_of_an_earlier_run_is_reset_by_whom_it_is_for(
    stopped_by: str, doubted_by: str, cleared: ClearedBy
) -> None:
    with kept_machine(error_stop=stopped_by, doubted_by=doubted_by) as store:
        opened = open_axis(MACHINE, store)
    assert [reason.cleared_by for reason in opened.reasons] == [cleared]
    assert opened.program.axis.feedback.in_doubt is bool(doubted_by)


@pytest.mark.parametrize("limit_deg_s", [2.5, 99.0])
def test_the_lower_of_machine_file_and_ledger_is_the_highest_speed(
    limit_deg_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(opening, "speed_max_deg_s", lambda _: limit_deg_s)
    with kept_machine() as store:
        opened = open_axis(MACHINE, store)
    assert opened.speed_max_deg_s == min(6.0, limit_deg_s)
    assert deg(opened.program.axis.settings.speed.setting_max_rad_s) == approx(min(6.0, limit_deg_s))


def test_another_plant_has_another_torque_and_another_zero_and_the_counters_of_the_old() -> None:
    old = replace(
        REST, holding_torque_nm=12.0, torque_weights="[1.0]", calibration_watch="{}", power_ups=9, zero_offset_counts=5,
        brake_failed="bore 10 N m",
    )  # fmt: skip
    new = retained_of_new_plant(
        old, replace(NEW, zero_offset_counts=77, rest_position_counts=88, encoder_serial="B")
    )
    assert (new.holding_torque_nm, new.torque_weights, new.calibration_watch) == (None, "", "")
    assert (new.zero_offset_counts, new.previous_offset_counts, new.rest_position_counts) == (77, 5, 88)
    assert (new.power_ups, new.brake_failed, new.encoder_serial) == (9, "bore 10 N m", "B")


@pytest.mark.parametrize("branch", [-1, 0, 1])
def test_the_zero_lies_on_the_branch_of_the_reading(branch: int) -> None:
    """The reading counts on over the wrap of the encoder's range; 20 deg from the zero is where it stands."""
    found = FRESH._replace(feedback=FRESH.feedback._replace(pos_act_counts=RAW + branch * SCALE.range_counts))
    zero = opening._zero_counts(found)
    assert (RAW + branch * SCALE.range_counts - zero) * SCALE.deg_per_count == approx(20.0, abs=0.01)


# --- proofs -----------------------------------------------------------------------------------------------------------

RECORD = CommissioningRecord(
    REAL.name, proven_hash(REAL), "A", "1.0", ("5 X", "6 Y"), "2026-01-01", "x", "", ("sign",), (), {}
)
ROW = SimpleNamespace(proof="silence", lacking=True)


@pytest.mark.parametrize(
    ("record", "drive", "nodes", "words"),
    [
        (RECORD, "A", ("5 X", "6 Y"), None),
        (None, "A", ("5 X", "6 Y"), Words.NO_RECORD),
        (RECORD, "B", ("5 X", "6 Y"), Words.OTHER_DRIVE),
        (RECORD, "A", ("5 X", "6 Z"), Words.OTHER_NODES),
        (RECORD, "A", ("5 X",), Words.OTHER_NODES),
        (replace(RECORD, proven_hash="other"), "A", ("5 X", "6 Y"), Words.CONFIGURATION_CHANGED),
    ],
)
def test_a_record_is_of_one_drive_its_nodes_and_one_configuration(
    record: Any, drive: str, nodes: Any, words: Any
) -> None:
    why = why_not_commissioned(REAL, record, drive, (), nodes)
    assert (None if why is None else why.words) is words


@pytest.mark.parametrize(
    ("drive", "marker", "now", "words"),
    [
        ("A", 7, 7, None),
        ("A", 7, 8, Words.RESTARTED_SINCE),
        ("A", 7, None, Words.RESTARTED_SINCE),
        ("A", None, None, None),
        ("A", None, 8, None),
        ("B", 7, 7, Words.SILENCE_NOT_PROVEN),
        ("", None, None, Words.SILENCE_NOT_PROVEN),
    ],
)
def test_a_proof_of_silence_is_of_one_drive_since_its_last_restart(
    drive: str, marker: Any, now: Any, words: Any
) -> None:
    proof = SilentMasterProof(drive, marker, "2026-01-01")
    why = why_silence_not_proven(proof, LinkHealth("A", restart_marker=now))
    assert getattr(why, "words", why) is words


@pytest.mark.parametrize("state", DriveState)
def test_a_drive_that_was_in_fault_before_the_start_is_told(state: DriveState) -> None:
    read = SimpleNamespace(state=state, error_code=0x8611)
    drive: Any = SimpleNamespace(read=lambda: read, identity=lambda: SCALE.identity)
    reason = why_in_fault(drive)
    assert (reason is not None) is (state in (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE))
    if reason is not None:
        assert reason.cleared_by is ClearedBy.RESET


# --- a run ------------------------------------------------------------------------------------------------------------


def test_a_power_up_is_counted_once_and_a_power_down_ends_it() -> None:
    with kept_machine(IDEAL, power_ups=3) as store:
        run = AxisRun(IDEAL, store)
        run.power_up()
        run.power_up()
        run.move(11.0, 6.0)
        run.power_down()
        assert run.axis.is_off
        run.power_down()
        run.move(12.0, 6.0)
        run.close("done")
        kept = store.load_retained()
    assert kept is not None
    assert (kept.power_ups, kept.moves) == (5, 2)


def test_a_halt_is_one_halt_and_the_next_move_goes_on() -> None:
    run = AxisRun(IDEAL)
    run.power_up()
    run.begin_move(50.0, 6.0)
    run.follow(0.5)
    run.halt()
    assert run.axis.virtual.at_rest
    # Half a second of its ramp, and back on it.
    assert run.angle_deg < 5.0
    assert not run.operator.command.halt
    report = run.move(5.0, 6.0)
    assert report.ending is Ending.DONE
    assert report.end_deg == approx(5.0, abs=0.005)
    run.close("done")


@pytest.mark.parametrize("forward", [True, False])
def test_an_increment_is_one_increment_in_its_direction(forward: bool) -> None:
    run = AxisRun(IDEAL)
    for number in (1, 2):
        report = run.increment(2.0, forward, 6.0)
        assert report.ending is Ending.DONE
        assert report.end_deg == approx((2.0 if forward else -2.0) * number, abs=0.005)
    run.close("done")


@pytest.mark.parametrize(("speed_deg_s", "refused"), [(1.0, False), (1.01, True)])
def test_with_an_overdue_brake_nothing_is_asked_for_above_1_deg_s(speed_deg_s: float, refused: bool) -> None:
    with kept_machine(IDEAL, brake_tested_at="2000-01-01T00:00:00Z") as store:
        run = AxisRun(IDEAL, store)
        assert run.brake_due.overdue
        if refused:
            with pytest.raises(CommandRefused, match="BRK-12"):
                run.move(10.5, speed_deg_s)
            assert run.axis.is_off
        else:
            assert run.move(10.5, speed_deg_s).done
        run.close("done")


@pytest.mark.parametrize("urgency", [Stop.RAMP, Stop.QUICK])
def test_a_motion_that_was_stopped_is_told_as_that(urgency: Stop) -> None:
    run = AxisRun(IDEAL)
    run.power_up()
    run.begin_move(50.0, 6.0)
    run.stop = urgency
    with pytest.raises(AlarmStop):
        run.follow(2.0)
    assert run.axis.virtual.at_rest
    assert deg(run.axis.pos_act_rad) < 10.0
    run.close("stopped")


def test_a_key_that_is_refused_moves_nothing_and_is_told() -> None:
    """BRK-06 forbids motion until it is reset."""
    run = AxisRun(IDEAL)
    run.power_up()
    run.axis.alarms.raise_(Code.BRK_06, measured=Words.OPEN, command=Words.CLOSED, time_ms=400.0)
    with pytest.raises(CommandRefused, match="BRK-06 is active"):
        run.jog(True, 6.0, 0.5)
    assert run.angle_deg == approx(0.0, abs=1e-6)
    assert not run.operator.command.forward or run.axis.motion.current is None
    run.close("refused")


@pytest.mark.parametrize("forward", [True, False])
def test_a_key_lasts_its_time_and_then_the_ramp(forward: bool) -> None:
    """0.6 deg/s for 3 s are 1.8 deg, less 0.46 of the way up with 0.39 deg/s2; the ramp adds 0.09 and its ends 0.03."""
    run = AxisRun(IDEAL)
    report = run.jog(forward, 0.6, 3.0)
    assert abs(report.end_deg) == approx(1.46, abs=0.03)
    assert (report.end_deg > 0.0) is forward
    assert report.done
    assert (report.settled_s, report.asked_deg_s) == (None, None)
    run.close("done")


def test_a_failed_brake_refuses_every_run_but_its_test() -> None:
    with kept_machine(IDEAL, brake_failed="bore 10 N m") as store:
        with pytest.raises(CommandRefused, match="BRK-08"):
            AxisRun(IDEAL, store)
        run = AxisRun(IDEAL, store, brake_test=True)
        report = run.test_brake()
        assert report.done
        assert report.level_nm == run.axis.brake_test.level_nm
        assert report.moved_deg == approx(deg(run.axis.brake_test.moved_rad))
        assert report.limit_deg == approx(0.02)
        run.close("tested")
        kept = store.load_retained()
    assert kept is not None
    assert kept.brake_failed == ""


def test_an_observer_is_told_from_when_it_came_on() -> None:
    run = AxisRun(IDEAL)
    run.power_up()
    seen: list[float] = []
    run.observe(lambda snapshot: seen.append(snapshot.time_s))
    run.follow(0.5)
    assert len(seen) == 5
    run.close("done")


def test_margins_are_those_of_the_travel_wherever_0_deg_lies() -> None:
    """From 100 to 300 deg: 0 deg lies 95 deg below the range, so that the travel begins 5 deg above its end."""
    scale = SCALE._replace(pos_min_deg=100.0, pos_max_deg=300.0, stops_deg=(90.0, 310.0))
    zero = round((5.0 - 100.0) / scale.deg_per_count) % scale.range_counts
    raw = round(25.0 / scale.deg_per_count)
    kept = replace(REST, zero_offset_counts=zero, rest_position_counts=raw)
    reading = judge_reference(scale, raw, kept)
    assert reading.angle_deg == approx(120.0, abs=1e-5)
    range_deg = scale.range_counts * scale.deg_per_count
    assert (reading.margin_minus_deg, reading.margin_plus_deg) == approx((5.0, range_deg - 205.0), abs=1e-5)


@pytest.mark.parametrize(
    ("moved_deg", "noted"), [(0.0009, False), (0.0011, True), (-0.0011, True), (0.0499, True)]
)
def test_a_way_while_off_is_noted_from_a_thousandth_of_a_degree_on(moved_deg: float, noted: bool) -> None:
    found = new_machine(MACHINE, 10.0)
    assert found.retained.rest_position_counts is not None
    rest = round(found.retained.rest_position_counts - moved_deg / SCALE.deg_per_count)
    with kept_machine(rest_position_counts=rest) as store:
        opened = open_axis(MACHINE, store)
    assert any("ENC-09" in note for note in opened.notes) is noted
    assert [alarm.code for alarm in opened.retained.alarms] == (["ENC-09"] if noted else [])
    assert opened.reasons == ()


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
