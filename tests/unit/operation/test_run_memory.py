"""What is kept of a run: its way, its counters, what stopped it; by hand."""

from __future__ import annotations

import gc
import math
import sys
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.errors import AlarmStop
from gantryctl.operation.opening import new_machine
from gantryctl.operation.run_memory import RunEnd, RunMemory, retained_after
from gantryctl.program import BrakeTestOutcome, BrakeTestResult, Code
from gantryctl.program.alarms.words import Words
from gantryctl.runtime import AlarmEntry, Retained
from gantryctl.units import rad

from .kept_bench import MACHINE, REAL, an_axis

approx = pytest.approx
FRESH = new_machine(MACHINE, 20.0)
SCALE, REST = FRESH.scale, FRESH.retained
RAW = FRESH.drive.read().pos_act_counts
END = RunEnd("done", None, power_ups=2, moves=5, time_s=9.0)


class Left:
    """A drive that was left at a count."""

    def __init__(self, counts: float) -> None:
        self._counts = counts

    def identity(self) -> Any:
        return SCALE.identity

    def read(self) -> Any:
        return SimpleNamespace(pos_act_counts=self._counts)


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
    # What else was there in the first scan is new.
    axis.alarms.raise_(Code.ENC_06)
    after = retained_after(MACHINE, replace(REST, brake_failed=failed_before), axis, Left(RAW), END)
    assert [alarm.code for alarm in after.alarms] == ["BRK-08"] * kept + ["ENC-06"]


def test_what_the_brake_took_in_stops_of_a_run_is_added() -> None:
    axis = an_axis()
    axis.power.wear.stops, axis.power.wear.energy_j = 2, 750.0
    before = replace(REST, emergency_brake_stops=3, emergency_brake_energy_j=100.0)
    after = retained_after(MACHINE, before, axis, Left(RAW), END)
    assert (after.emergency_brake_stops, after.emergency_brake_energy_j) == (5, 850.0)


def test_a_run_that_learned_nothing_leaves_what_was_learned() -> None:
    before = replace(REST, torque_weights="[1.0, 2.0]", calibration_watch='{"found": {}}')
    after = retained_after(MACHINE, before, an_axis(), Left(RAW), END)
    assert (after.torque_weights, after.calibration_watch) == ("[1.0, 2.0]", '{"found": {}}')


def test_what_ended_a_run_is_kept_behind_its_warnings() -> None:
    """A drive that left, a power-up that did not end: the program has raised no alarm that holds the axis."""
    axis = an_axis()
    axis.alarms.raise_(Code.ENC_06)
    left = END._replace(alarm=AlarmStop("SYS-10 STOP · a test", Code.SYS_10))
    after = retained_after(MACHINE, REST, axis, Left(RAW), left)
    assert [alarm.code for alarm in after.alarms] == ["ENC-06", "SYS-10"]
    assert after.error_stop == "SYS-10"


def test_a_warning_is_kept_as_a_warning() -> None:
    axis = an_axis()
    axis.alarms.raise_(Code.ENC_06)
    axis.alarms.raise_(Code.CTL_02, measured="a test")
    after = retained_after(MACHINE, REST, axis, Left(RAW), END)
    assert [(alarm.code, alarm.severity, alarm.follows) for alarm in after.alarms] == [
        ("ENC-06", "WARNING", ""),
        ("CTL-02", "STOP", ""),
    ]


def test_an_alarm_that_follows_from_another_is_kept_with_it() -> None:
    axis = an_axis()
    axis.alarms.raise_(Code.CTL_02, measured="a test")
    axis.alarms.raise_(Code.DRV_06)
    first, second = retained_after(MACHINE, REST, axis, Left(RAW), END).alarms
    assert (first.follows, second.follows) == ("", "CTL-02")


def test_a_rest_lies_within_the_range_of_the_encoder() -> None:
    after = retained_after(MACHINE, REST, an_axis(), Left(SCALE.range_counts + 7.0), END)
    assert after.rest_position_counts == 7


@pytest.mark.parametrize(("pos_rad", "kept"), [(0.25, 0.25), (math.nan, None), (math.inf, None)])
def test_an_alarm_is_kept_with_the_angle_where_it_was_known(pos_rad: float, kept: float | None) -> None:
    axis = an_axis()
    axis.alarms.pos_rad = pos_rad
    axis.alarms.raise_(Code.CTL_02, measured="a test")
    (alarm,) = retained_after(MACHINE, REST, axis, Left(RAW), END).alarms
    assert alarm.pos_act_rad == kept


def test_a_linear_axis_on_a_bus_keeps_its_rest_also_under_power() -> None:
    """Between its ends the encoder does not wrap: the reading tells how far it went meanwhile."""
    axis, kept = an_axis(REAL), list[Retained]()
    store: Any = SimpleNamespace(store_retained=kept.append)
    RunMemory(REAL, axis, REST, store).forget_rest()
    assert kept == []
    axis.power.switch_on()
    assert not axis.is_off
    assert retained_after(REAL, REST, axis, Left(RAW), END).rest_position_counts == int(RAW)


def test_a_zero_lies_within_the_range_of_the_encoder() -> None:
    """The axis counts on over the wrap, and so does its zero."""
    axis = an_axis()
    for beyond in (SCALE.range_counts + 7.0, 7.0 - SCALE.range_counts):
        axis.zero_counts = beyond
        assert retained_after(MACHINE, REST, axis, Left(RAW), END).zero_offset_counts == 7


def test_what_a_run_leaves_behind_stands_beside_what_was_kept_before() -> None:
    """An alarm of an earlier run and one of this; a doubt that no alarm explains."""
    before = replace(REST, alarms=(AlarmEntry("ENC-09", "moved", "2026-01-01"),))
    axis = an_axis(MACHINE)
    axis.feedback.in_doubt = True
    axis.alarms.note(Code.CTL_15, measured=300.0, limit=250.0)
    after = retained_after(MACHINE, before, axis, Left(RAW), END)
    assert [entry.code for entry in after.alarms] == ["ENC-09", "CTL-15"]
    assert (after.doubted_by, after.error_stop) == ("-", "")


def test_what_is_kept_at_each_power_off_leaves_nothing_behind() -> None:
    """A hash of the machine file left five free tuples each time; CPython keeps 2,000 of each length."""
    axis, left = an_axis(MACHINE), Left(RAW)
    gc.collect()  # forgets the free tuples of the tests before
    blocks = 0
    for _ in range(2):  # the first time CPython keeps 80 freed lists, too
        blocks = sys.getallocatedblocks()
        for _ in range(100):
            retained_after(MACHINE, REST, axis, left, END)
    assert sys.getallocatedblocks() - blocks < 50


def test_a_brake_that_was_tested_is_due_after_all_of_its_power_ups_again() -> None:
    """The third power-up of a run behind 50 of before: 100 are left."""
    memory = RunMemory(MACHINE, an_axis(MACHINE), replace(REST, power_ups=50), None)
    memory.power_ups = 3
    memory.brake_tested(BrakeTestResult(BrakeTestOutcome.PASSED, 70.0, -70.0, 0.0, Words.STOPPED))
    assert memory.retained.brake_tested_power_ups == 53
    assert memory.brake_due.power_ups_left == 100
