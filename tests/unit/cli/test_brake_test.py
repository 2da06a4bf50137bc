"""`gantryctl brake-test`: what it prints, retains and refuses; due dates; real processes are in tests/system."""

from __future__ import annotations

import io
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from gantryctl.cli.axis import move
from gantryctl.machine import configs_folder, default_machine, load_machine, with_values
from gantryctl.operation.brake_policy import TIME_FORMAT, after_test, brake_due
from gantryctl.program import BrakeTestOutcome, BrakeTestResult
from gantryctl.runtime import Retained
from support.command_line import cli, done, machine_file, refused

MACHINE = default_machine()
WEAK = {"plant.brake.torque_share": 0.1}  # 40 N m of 400, and 70 are asked for
NOW = datetime(2026, 11, 20, 12, 0, 0, tzinfo=UTC)


def test_a_sound_brake_passes_and_that_is_retained() -> None:
    answer = done("brake-test")
    assert "hust_gantry: brake test passed: held +70 and -70 N m for 2 s each" in answer.out
    assert "after 100 more power-ups" in answer.out
    kept = done("retain", "show", "--json").json
    assert (kept["brake_tests"], kept["brake_tests_failed"], kept["brake_failed"]) == (1, 0, "")
    # The drive regulates the torque to 5 % of what is asked for before it counts as held.
    assert kept["brake_plus_nm"] == pytest.approx(70.0, rel=0.05)
    assert kept["brake_minus_nm"] == pytest.approx(-70.0, rel=0.05)
    tested = datetime.strptime(kept["brake_tested_at"], TIME_FORMAT).replace(tzinfo=UTC)
    assert abs(datetime.now(UTC) - tested) < timedelta(minutes=5)


def test_a_weak_brake_fails_and_nothing_moves_until_service_resets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = machine_file(tmp_path / "weak.toml", WEAK)
    answer = cli("brake-test", "--config", config)
    assert answer.code == 1
    assert "brake test failed: +4" in answer.out  # 40 N m and some of the motor's friction
    for command in (["move", "3"], ["jog", "+", "--for", "1"]):
        assert "BRK-08 · Brake test failed" in refused(*command, "--config", config)
    assert cli("brake-test", "--config", config).code == 1
    monkeypatch.setattr("sys.stdin", io.StringIO("n\n"))
    assert cli("reset", "--config", config).code == 2
    assert "BRK-08" in refused("move", "3", "--config", config)
    assert "BRK-08 acknowledged" in done("reset", "--yes", "--config", config).out
    done("move", "1", "--config", config)


@pytest.mark.can
def test_a_drive_that_owns_its_brake_is_not_testable_here() -> None:
    answer = refused("brake-test", "--fresh", "--config", configs_folder() / "hust_can.toml")
    assert 'not testable here: [brake] owner = "drive"' in answer


def test_overdue_by_power_ups_only_slow_motion_is_left(tmp_path: Path) -> None:
    config = machine_file(tmp_path / "often.toml", {"brake.test_interval_power_ups": 2})
    for target in ("0.2", "0"):
        done("move", target, "--config", config, "--no-trace")
    assert "BRK-12 · the brake test is overdue" in refused("move", "1", "--config", config)
    assert "BRK-12" in refused("jog", "+", "--speed", "1.1", "--for", "1", "--config", config)
    assert "overdue: nothing moves faster than 1 deg/s" in done("status", "--config", config).out
    done("move", "0.2", "--speed", "1", "--config", config)
    done("brake-test", "--config", config)
    done("move", "1", "--config", config)


# --- due dates -------------------------------------------------------------------------------------------------


def kept(tested_at: str = "", at_power_ups: int = 0) -> Retained:
    return Retained("m", "h", brake_tested_at=tested_at, brake_tested_power_ups=at_power_ups)


@pytest.mark.parametrize(
    ("tested", "power_ups", "overdue", "left"),
    [
        (NOW - timedelta(days=6.9), 0, False, 100),
        (NOW - timedelta(days=7.0), 0, True, 100),
        (NOW - timedelta(days=1.0), 99, False, 1),
        (NOW - timedelta(days=1.0), 100, True, 0),
        (None, 99, False, 1),
        (None, 100, True, 0),
    ],
)
def test_weekly_or_after_a_hundred_power_ups(
    tested: datetime | None, power_ups: int, overdue: bool, left: int
) -> None:
    record = kept(tested.strftime(TIME_FORMAT) if tested else "")
    due = brake_due(MACHINE, "", record, power_ups, NOW)
    assert (due.overdue, due.power_ups_left) == (overdue, left)
    if tested is not None:
        assert due.at == (tested + timedelta(days=7)).strftime(TIME_FORMAT)


def test_a_real_machine_that_was_never_tested_is_overdue() -> None:
    real = with_values(
        load_machine(configs_folder() / "hust_can.toml"),
        {"can.interface": "socketcan", "can.channel": "can0", "brake.owner": "object_60FE"},
    )
    assert brake_due(real, "", kept(), 0, NOW).overdue
    assert not brake_due(real, "the drive owns it", kept(), 0, NOW).overdue


def test_a_date_that_cannot_be_read_counts_as_overdue() -> None:
    assert brake_due(MACHINE, "", kept("yesterday"), 0, NOW).overdue


def test_an_aborted_test_changes_neither_verdict_nor_date() -> None:
    failed = BrakeTestResult(BrakeTestOutcome.FAILED, 30.0, float("nan"), 0.0, "slipped")
    aborted = BrakeTestResult(BrakeTestOutcome.ABORTED, float("nan"), float("nan"), 0.0, "stopped")
    passed = BrakeTestResult(BrakeTestOutcome.PASSED, 65.0, -65.0, 0.0, "held")
    record = after_test(kept(), failed, 5, NOW)
    assert (record.brake_failed, record.brake_minus_nm, record.brake_tests_failed) == ("slipped", None, 1)
    after = after_test(record, aborted, 6, NOW + timedelta(days=1))
    assert (after.brake_failed, after.brake_tested_at) == ("slipped", record.brake_tested_at)
    assert after.brake_test_text == "stopped"
    assert after_test(after, passed, 7, NOW).brake_failed == ""


def test_a_report_that_cannot_be_written_is_told_before_torque_is_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def torque(*_: object) -> None:
        raise AssertionError("torque was given")

    monkeypatch.setattr(move, "guarded", torque)
    (tmp_path / "report").touch()
    assert "report" in refused("brake-test", "--fresh", "--out", tmp_path / "report")
