"""Each number, flag and word that the controller publishes, of a state in which no two of them are alike, by hand.

The parts of the axis are set as no motion ever has them at once: a value that came from another part, in another unit
or with another sign, is another figure.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.image import DigitalInputs, DriveState, LinkHealth, Mode, NodeHealth
from gantryctl.machine import with_values
from gantryctl.motion import MotionLimits, SetPoint, cruise, hold, plan_move
from gantryctl.operation.store import TIME_FORMAT
from gantryctl.program import AxisState, BrakeTestOutcome, BrakeTestResult, Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.reason import ClearedBy, Reason
from gantryctl.program.alarms.words import Words
from gantryctl.program.power.brake_test import BrakeTestPhase
from gantryctl.program.power.phases import PowerPhase
from gantryctl.service.command.arming import Armed
from gantryctl.service.controller.brake_watch import BrakeWatch
from gantryctl.service.controller.publisher import machine_tags
from gantryctl.service.memory.memory import JournalState, Source, Word
from gantryctl.service.memory.snapshot import FAST, Snapshot
from gantryctl.service.protocol.messages import Identity
from gantryctl.service.protocol.roles import Action, Role
from support.modulo_machine import modulo_machine
from unit.service.test_controller import MACHINE, Desk, delivered, opened, published, publisher_of

DEG = 0.017453292519943295  # rad
NOW_S = 50.0
PETRA = Identity("c7", "petra", Role.OPERATOR, "web", person="p-petra")
SERENA = Identity("c8", "serena", Role.SERVICE, "console", person="p-serena")


@pytest.fixture(autouse=True)
def _own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))


@pytest.fixture
def desk() -> Iterator[Desk]:
    delivered()
    with opened() as made:
        made.scans(3)
        set_apart(made)
        yield made


def set_apart(desk: Desk) -> None:
    """Give every part of the axis a value of its own."""
    axis, operator, engine = desk.axis, desk.operator, desk.engine
    feedback, virtual, power = axis.feedback, axis.virtual, axis.power
    axis.pos_act_rad, axis.pos_err_rad = 41.0 * DEG, -0.07 * DEG
    # 1144 turns of the motor are one of the gantry.
    axis.vel_cmd_rad_s = 3.3 * DEG * 1144.0
    axis.state, axis.refusal_count = AxisState.CONTINUOUS_MOTION, 13
    axis.refusal = refusal(Code.CTL_14, reason=Words.NO_JOURNAL)
    virtual.following, virtual.at_rest = True, False
    virtual.pos_ref_rad, virtual.vel_ref_rad_s, virtual.acc_ref_rad_s2 = 42.0 * DEG, -3.0 * DEG, 0.2 * DEG
    # 59 deg take 11.8 s at 5 deg/s and 10 s more for two ramps of 0.5 deg/s2.
    ramps = MotionLimits(5.0 * DEG, 0.5 * DEG, 0.5 * DEG)
    virtual.plan = plan_move(SetPoint(42.0 * DEG, 0.0, 0.0), -17.0 * DEG, ramps)
    virtual.start_scan = engine.scan + round((9.5 - virtual.plan.duration) / engine.period_s)
    virtual.override, desk.operator.program._speed = 0.8, 5.0 * DEG
    virtual.ramps = replace(virtual.ramps, acc_rad_s2=0.3 * DEG)
    feedback.vel_rad_s, feedback.torque_nm, feedback.overload = -2.5 * DEG, -77.0, 0.25
    feedback.state, feedback.brake_open, feedback.torque_limited = DriveState.QUICK_STOP_ACTIVE, True, True
    power.phase, power.brake_open = PowerPhase.SAG_WATCH, False
    axis.alarms.horn = True
    operator.now = lambda: NOW_S
    hold_, unheld = operator.hold, operator.unheld
    hold_._lease, hold_.issued_s = "a key", NOW_S - 0.05  # of 0.25 s
    unheld.limit_s, unheld._since_s = 600.0, NOW_S - 45.0
    operator.authority.holder, operator.authority.epoch = PETRA, 4711
    operator.authority.round_trip.take(0.031, NOW_S)
    operator.arming._armed = Armed(Action.BRAKE_TEST, SERENA, 4711, NOW_S + 7.0)
    operator.frames.issued_ms = 49987
    operator.levels = operator.levels._replace(speed_rad_s=2.0 * DEG, increment_rad=5.0 * DEG, override=0.6)
    test = axis.brake_test
    test.phase, test.moved_rad, test.on_brake_nm = BrakeTestPhase.MINUS_HELD, 0.011 * DEG, -44.0
    axis.monitors.drag.model.restore((10.0, 20.0, 3.0, 4.0, 5.0))
    desk.memory.words[Word.JOURNAL_STATE] = JournalState.SLOW
    desk.controller._recorder.number = 3


FAST_BY_HAND: dict[str, Any] = {
    "pos_act_deg": 41.0,
    "vel_act_deg_s": -2.5,
    "pos_ref_deg": 42.0,
    "vel_ref_deg_s": -3.0,
    "acc_ref_deg_s2": 0.2,
    "vel_cmd_deg_s": 3.3,
    "pos_err_deg": -0.07,
    "torque_act_nm": -77.0,
    # 10 sin 41 deg + 20 cos 41 deg - 3 - 4 x 0.523599 + 5 x 3.490659: the model's units are 0.1 rad/s and 1e-3 rad/s2.
    "torque_expected_nm": 34.013679,
    "overload": 0.25,
    "target_deg": -17.0,
    "time_left_s": 9.5,
    # Released now, from -3 deg/s and 0.2 deg/s2, with 2 deg/s2 and 20 deg/s3: 0.26676 + 2.10145 + 0.00333 deg.
    "stopping_angle_deg": 2.371544,
    # 0.25 s at 0.8 x 5 deg/s, then the ramp from 0.3 deg/s2 the wrong way: 1 + 0.456914 + 3.804389 + 0.003333 deg.
    "key_lost_angle_deg": 5.264636,
    # (2.5 deg/s)^2 / 2 / 5.4 deg/s2
    "quick_stop_angle_deg": 0.578704,
    # To +-180 deg.
    "travel_left_minus_deg": 221.0,
    "travel_left_plus_deg": 139.0,
    "reach_min_deg": -180.0,
    "reach_max_deg": 180.0,
    # 0.03 deg and 0.012 s at 3 deg/s
    "following_error_trip_deg": 0.066,
    "axis_state": "continuous_motion",
    "drive_state": "quick_stop_active",
    "power_phase": "sag_watch",
    "power": False,
    "brake_open": True,
    "brake_open_cmd": False,
    "horn": True,
    "at_rest": False,
    "in_position": False,
    "torque_limited": True,
    "position_valid": True,
    "issued_ms": 49987,
    "epoch": 4711,
    "lease_left_ms": 200.0,
    "round_trip_ms": 31.0,
    "armed_left_s": 7.0,
    "commissioning_left_s": None,
    "unheld_power_left_s": 555.0,
    "alarm_count": 0,
    "refusal_count": 13,
    "heartbeat_age_ms": None,
    "journal_committed": 0,
    "journal_state": "slow",
    "recording": True,
    "brake_test_phase": "minus_held",
    "brake_test_torque_nm": -44.0,
    "brake_test_moved_deg": 0.011,
}


# Time, which goes on, has figures of its own; inputs have each its turn.
LATER = {
    "scan", "time_s", "journal_sequence", "feedback_age_ms", "brake_test_left_s", "estop_ok", "enabling_switch",
    "limit_minus_ok", "limit_plus_ok", "mains_ready", "collision_ok", "door_ok", "motion_permit", "estop_ok_2",
}  # fmt: skip


def test_every_fast_tag_shows_its_own_part_of_the_axis(desk: Desk) -> None:
    shown = published(desk)
    assert set(FAST) == set(FAST_BY_HAND) | LATER
    check(shown, FAST_BY_HAND)


def check(shown: dict[str, Any], by_hand: dict[str, Any]) -> None:
    """Compare tags; six decimals are sent."""
    assert {name: shown[name] for name in by_hand} == {
        name: pytest.approx(value, abs=1e-6) if isinstance(value, float) else value
        for name, value in by_hand.items()
    }


def test_each_input_has_its_own_tag(desk: Desk) -> None:
    """Closed alone, and open alone; one that is not fitted is neither."""
    feedback = desk.axis.feedback
    fitted = ("estop_ok", "enabling_switch", "limit_minus_ok", "limit_plus_ok", "mains_ready")
    others = ("collision_ok", "door_ok", "motion_permit", "estop_ok_2")
    for name in (*fitted, *others):
        for value in (True, False):
            feedback.inputs = DigitalInputs(**dict.fromkeys((*fitted, *others), not value) | {name: value})
            shown = published(desk)
            assert [each for each in (*fitted, *others) if shown[each] is value] == [name]
    feedback.inputs = DigitalInputs()
    assert [published(desk)[each] for each in others] == [None] * 4


def test_each_flag_of_the_axis_has_its_own_tag(desk: Desk) -> None:
    """True alone, and false alone."""
    axis = desk.axis
    setters: dict[str, Callable[[bool], None]] = {
        "brake_open": lambda on: setattr(axis.feedback, "brake_open", on),
        "brake_open_cmd": lambda on: setattr(axis.power, "brake_open", on),
        "horn": lambda on: setattr(axis.alarms, "horn", on),
        "torque_limited": lambda on: setattr(axis.feedback, "torque_limited", on),
        "in_position": lambda on: setattr(axis.monitors, "in_position", on),
        # A motion that waits for the brake, and a set-point at rest.
        "at_rest": lambda on: setattr(axis.motion, "waiting", None if on else SimpleNamespace()),
    }
    axis.virtual.at_rest = True
    for name in setters:
        for value in (True, False):
            for each, put in setters.items():
                put(value if each == name else not value)
            shown = published(desk)
            assert [each for each in setters if shown[each] is value] == [name]


def test_alarms_that_are_gone_are_not_counted(desk: Desk) -> None:
    alarms = desk.axis.alarms
    alarms.raise_(Code.INT_06, measured=5.0, speed=-6.0)
    alarms.clear()
    alarms.raise_(Code.PWR_01, measured=Words.AT_UNKNOWN)
    assert published(desk)["alarm_count"] == 1


def test_counts_of_a_scan_are_those_of_the_engine(desk: Desk) -> None:
    engine = desk.engine
    engine.scan = 12345
    engine.image = engine.image._replace(drive=engine.image.drive._replace(age_scans=3))
    engine.period_s = 0.002
    desk.controller.events.put("service", "something")
    shown = published(desk)
    assert shown["scan"] == 12345
    assert shown["time_s"] == pytest.approx(engine.time_s)
    assert shown["feedback_age_ms"] == pytest.approx(6.0)
    written = desk.memory.events[Source.CONTROLLER].written
    assert shown["journal_sequence"] == written == 1


def test_each_phase_of_power_is_told_by_its_name(desk: Desk) -> None:
    told = []
    for phase in PowerPhase:
        desk.axis.power.phase = phase
        told.append(published(desk)["power_phase"])
    assert told == [phase.name.lower() for phase in PowerPhase]


SLOW_BY_HAND: dict[str, Any] = {
    "version": "test",
    "real_time": False,
    "authority_user": "petra",
    "authority_client": "c7",
    "authority_local": False,
    "armed_action": "brake_test",
    "armed_step": "",
    "armed_by": "serena",
    "armed_person": "p-serena",
    "armed_client": "c8",
    "second_person": False,
    "mode": "incremental",
    "speed_setting_deg_s": 2.0,
    "increment_deg": 5.0,
    "override_percent": 60.0,
    "acc_setting_deg_s2": 0.3,
    "speed_min_deg_s": 0.6,
    "speed_max_deg_s": 6.0,
    "speed_cap_deg_s": 1.0,
    "quick_dec_deg_s2": 5.4,
    # A tenth of the machine's, and the machine's: 450 deg/s2 at the motor.
    "acc_min_deg_s2": 0.039336,
    "acc_max_deg_s2": 0.393357,
    "increment_max_deg": 360.0,
    "torque_rated_nm": 257.0,
    "torque_max_nm": 385.0,
    "moment_max_nm": 440_440.0,  # 1144 times that
    "reset_locked": False,
    "blocked_by": "",
    "blocked_by_messages": [],
    # 1144 times the root of 10^2 + 20^2 N m, which comes to rest where 10 sin + 20 cos goes through 0 upwards.
    "eccentric_moment_nm": 25580.617663,
    "eccentric_angle_deg": -63.434949,
    "commissioning_available": False,
    "commissioning": "none",
    "commissioning_step": "",
    "commissioning_results": 0,
    "machine": MACHINE.name,
    "axis_kind": "linear",
    "display": "-180..180",
    "no_go_deg": (),
    "drawing": "couch",
    "drive_kind": "sim",
    "pos_min_deg": -180.0,
    "pos_max_deg": 180.0,
    "over_travel_min_deg": -180.5,
    "over_travel_max_deg": 180.5,
    "limit_switch_min_deg": -182.0,
    "limit_switch_max_deg": 182.0,
    "mechanical_stop_min_deg": -187.0,
    "mechanical_stop_max_deg": 187.0,
    "scan_period_ms": 1.0,
    "scan_overruns": 21,
    "scan_skipped": 22,
    "trace_rows_lost": 23,
    "events_lost": 24,
    "bus_missed": None,
}


def test_every_slow_tag_shows_its_own_part(desk: Desk) -> None:
    engine, operator = desk.engine, desk.operator
    operator.program.mode = Mode.INCREMENTAL
    engine.statistics.overruns, engine.statistics.skipped = 21, 22
    desk.controller._recorder.lost, operator.events.lost = 23, 24
    shown = publisher_of(desk).slow()
    check(shown, SLOW_BY_HAND)
    assert shown["refusal_text"].startswith("CTL-14 · ")
    assert shown["refusal_messages"] == [
        {"code": "CTL-14", "values": {"reason": {"words": "NO_JOURNAL", "values": {}}}}
    ]
    desk.axis.refusal = None
    shown = publisher_of(desk).slow()
    assert (shown["refusal_text"], shown["refusal_messages"]) == ("", [])


def test_what_the_program_has_against_power_is_told_with_its_words(desk: Desk) -> None:
    """As `power` would be refused: where this is empty, a page offers the button and says that power can come."""
    axis = desk.axis
    assert publisher_of(desk).slow()["blocked_by"] == ""
    axis.feedback.inputs = axis.feedback.inputs._replace(mains_ready=False)
    shown = publisher_of(desk).slow()
    assert shown["blocked_by"] == "the mains are not ready"
    assert shown["blocked_by_messages"] == [{"words": "MAINS_NOT_READY", "values": {}}]
    # A latched alarm is named before the input that caused it, and a reason of this run before both.
    axis.alarms.raise_(Code.INT_06, measured=Words.AT_SPEED(value=12.0, speed=3.0))
    shown = publisher_of(desk).slow()
    assert shown["blocked_by"] == (
        "INT-06 is latched (Quick stop by the operator at 12.00 deg, 3.00 deg/s): reset first"
    )
    assert shown["blocked_by_messages"][0]["words"] == "LATCHED"
    desk.permit.reasons = (Reason(Code.SYS_12, {"stopped_by": "BRK-04"}, ClearedBy.SERVICE),)
    assert publisher_of(desk).slow()["blocked_by"].startswith("SYS-12 · ")


def test_the_way_of_a_quick_stop_under_way_is_told_as_the_stopping_angle(desk: Desk) -> None:
    """It has left the set-point, which stands: 2.5 deg/s at 5.4 deg/s2 are 0.5787 deg, and 0 would be untrue."""
    axis = desk.axis
    axis.virtual.following, axis.virtual.at_rest = False, True
    axis.feedback.vel_rad_s = -2.5 * DEG
    assert published(desk)["stopping_angle_deg"] == pytest.approx(0.578704, abs=1e-6)
    axis.feedback.vel_rad_s = 0.0
    assert published(desk)["stopping_angle_deg"] == 0.0


def test_limits_are_those_in_force_and_not_of_the_file(desk: Desk) -> None:
    """A drive with a ramp of its own, a machine that was not proven faster, sectors."""
    axis, ranges = desk.axis, desk.operator.ranges
    axis.settings = replace(axis.settings, ramps=replace(axis.settings.ramps, quick_dec_rad_s2=4.4 * DEG))
    ranges["speed_setting_deg_s"] = ranges["speed_setting_deg_s"]._replace(high=3.0)
    shown = publisher_of(desk).slow()
    assert (shown["quick_dec_deg_s2"], shown["speed_max_deg_s"]) == (pytest.approx(4.4), 3.0)
    assert shown["acc_setting_deg_s2"] == pytest.approx(0.3)
    fitted = MACHINE.model_copy(
        update={"axis": MACHINE.axis.model_copy(update={"no_go_deg": ((30.0, 35.0),)})}
    )
    assert machine_tags(fitted)["no_go_deg"] == ((30.0, 35.0),)


def test_who_has_control_and_why_power_stays_off(desk: Desk) -> None:
    operator = desk.operator
    operator.authority.holder = Identity("c9", "paul", Role.OPERATOR, "local", person="p-paul")
    operator.arming.second_person = True
    desk.permit.reasons = (Reason(Code.SYS_12, {"stopped_by": "BRK-04"}, ClearedBy.SERVICE),)
    shown = publisher_of(desk).slow()
    assert (shown["authority_user"], shown["authority_local"], shown["second_person"]) == ("paul", True, True)
    assert shown["reset_locked"] is True
    assert shown["blocked_by"].startswith("SYS-12 · BRK-04 stopped the axis")
    assert shown["blocked_by_messages"] == [{"reason": "SYS-12", "values": {"stopped_by": "BRK-04"}}]
    operator.authority.holder = operator.arming._armed = None
    shown = publisher_of(desk).slow()
    assert [shown[name] for name in ("authority_user", "authority_client", "authority_local")] == [
        "",
        "",
        False,
    ]
    assert [shown[f"armed_{name}"] for name in ("action", "by", "person", "client")] == ["none", "", "", ""]


# --- what is not known ------------------------------------------------------------------------------


def test_an_axis_whose_power_is_off_has_no_target_and_nothing_expected_of_its_motor(desk: Desk) -> None:
    desk.axis.virtual.following = False
    shown = published(desk)
    assert (shown["target_deg"], shown["time_left_s"], shown["torque_expected_nm"]) == (
        pytest.approx(41.0),
        0.0,
        None,
    )


def test_a_motion_without_an_end_has_no_target_and_no_time(desk: Desk) -> None:
    desk.axis.virtual.plan = cruise(42.0 * DEG, 3.0 * DEG)
    shown = published(desk)
    assert (shown["target_deg"], shown["time_left_s"]) == (None, None)


def test_a_motion_that_is_over_has_no_time_left(desk: Desk) -> None:
    desk.axis.virtual.start_scan = desk.engine.scan - round(21.9 / desk.engine.period_s)
    assert published(desk)["time_left_s"] == 0.0


def test_a_speed_that_is_too_old_is_not_told_nor_what_follows_from_it(desk: Desk) -> None:
    # Without one of the drive the speed is told from the position.
    feedback = desk.axis.feedback
    feedback._speed_age, feedback.age = 10**6, 2
    assert published(desk)["vel_act_deg_s"] == pytest.approx(-2.5)
    feedback.age = 10**6
    shown = published(desk)
    assert (shown["vel_act_deg_s"], shown["quick_stop_angle_deg"]) == (None, None)
    assert shown["pos_act_deg"] == pytest.approx(41.0)


def test_a_speed_of_a_reading_in_doubt_is_not_told(desk: Desk) -> None:
    desk.axis.feedback.in_doubt = True
    assert published(desk)["vel_act_deg_s"] is None


def test_a_brake_without_a_contact_shows_what_it_must_have_done(desk: Desk) -> None:
    feedback = desk.axis.feedback
    feedback.brake_contact = False
    for open_ in (True, False):
        feedback.brake_open = open_
        assert published(desk)["brake_open"] is open_


def test_nothing_is_recorded_without_a_number(desk: Desk) -> None:
    for number in (0, 1):
        desk.controller._recorder.number = number
        assert published(desk)["recording"] is bool(number)
    # The recorder has given it up.
    desk.memory.words[Word.RECORDING_STOPPED] = 1
    assert published(desk)["recording"] is False


# --- other axes -------------------------------------------------------------------------------------


def test_between_sectors_the_reach_ends_where_the_set_point_must_stop(desk: Desk) -> None:
    """Sectors 30..35 and 60..70 deg with 2 deg of clearance: from the set-point of 42 deg it goes from 37 to 58."""
    axis = desk.axis
    sectors = ((30.0 * DEG, 35.0 * DEG), (60.0 * DEG, 70.0 * DEG))
    travel = replace(axis.settings.travel, no_go_rad=sectors, no_go_clearance_rad=2.0 * DEG)
    axis.settings = replace(axis.settings, travel=travel)
    check(
        published(desk),
        {
            "reach_min_deg": 37.0,
            "reach_max_deg": 58.0,
            "travel_left_minus_deg": 4.0,
            "travel_left_plus_deg": 17.0,
        },
    )


def test_an_axis_without_ends_shows_angles_of_its_turn_and_no_ends(desk: Desk) -> None:
    """A turn from -90 deg: 41 + 360, 42 - 360 and 343 deg read as 41, 42 and -17 deg."""
    axis = desk.axis
    endless = replace(
        axis.settings.travel,
        pos_min_rad=-math.inf,
        pos_max_rad=math.inf,
        over_travel_min_rad=-math.inf,
        over_travel_max_rad=math.inf,
        turn_from_rad=-90.0 * DEG,
    )
    axis.settings = replace(axis.settings, travel=endless)
    axis.pos_act_rad, axis.virtual.pos_ref_rad = 401.0 * DEG, -318.0 * DEG
    axis.virtual.plan = hold(343.0 * DEG)
    check(published(desk), {"pos_act_deg": 41.0, "pos_ref_deg": 42.0, "target_deg": -17.0})
    shown = published(desk)
    names = ("reach_min_deg", "reach_max_deg", "travel_left_minus_deg", "travel_left_plus_deg")
    assert [shown[name] for name in names] == [None] * 4


def test_a_modulo_machine_says_its_turn_and_has_no_ends() -> None:
    machine = modulo_machine({"axis.pos_min_deg": -90.0, "axis.pos_max_deg": 270.0})
    with opened(machine) as desk:
        shown = publisher_of(desk).slow()
    axis = machine.axis
    assert (shown["axis_kind"], shown["drawing"], shown["display"]) == ("modulo", "axis", axis.display)
    assert (shown["pos_min_deg"], shown["pos_max_deg"]) == (axis.pos_min_deg, axis.pos_max_deg)
    ends = ("over_travel", "limit_switch", "mechanical_stop")
    assert [shown[f"{end}_{side}_deg"] for end in ends for side in ("min", "max")] == [None] * 6


# --- bus and scan -----------------------------------------------------------------------------------


def test_telegrams_of_a_bus_are_counted_each_kind_alone(desk: Desk) -> None:
    """Four telegrams with counts of their own; the age of the heartbeat in scans of 2 ms."""
    health = LinkHealth(
        drive_key="",
        heartbeat_age_scans=37,
        received=(1000, 1000),
        missed=(1, 2),
        late=(10, 20),
        duplicated=(100, 200),
        wrong_length=(4, 5),
        contradicted=(7, 9),
        longest_age_scans=(3, 3),
        foreign=81,
        unknown=82,
        refused=83,
        queue_full=84,
        nodes=(NodeHealth(3, "", 1, 85, 86),),
    )
    desk.engine.drive.health = lambda: health
    shown = publisher_of(desk).slow()
    names = ("missed", "late", "duplicated", "wrong_length", "contradicted", "refused", "others")
    assert [shown[f"bus_{name}"] for name in names] == [3, 30, 300, 9, 16, 83, 82]
    desk.engine.period_s = 0.002
    assert published(desk)["heartbeat_age_ms"] == pytest.approx(74.0)


def test_lateness_is_that_of_the_last_ten_seconds_but_its_worst_that_of_the_run(desk: Desk) -> None:
    """100 scans of 100 us late by 4 ms long ago; since then 60 by 100 us, 39 by 300 us, one by 2 ms, of 50 or 80 us."""
    publisher, found = publisher_of(desk), desk.engine.statistics
    for scan in range(100):
        found.add(scan, 4e-3, 100e-6)
    for _ in range(10):
        publisher._timing()
    for late_s, count in ((100e-6, 60), (300e-6, 39), (2e-3, 1)):
        for number in range(count):
            # Two in five take longer: neither the longest nor three quarters of them are half.
            found.add(0, late_s, 80e-6 if number % 5 > 2 else 50e-6)
    shown = publisher._timing()
    # Bins of 5 %, rounded up.
    names = ("lateness_p50_us", "lateness_p99_us", "lateness_max_us", "run_p50_us", "run_p99_us")
    assert [shown[f"scan_{name}"] for name in names] == [
        pytest.approx(100.0, rel=0.05),
        pytest.approx(300.0, rel=0.05),
        pytest.approx(4000.0),
        pytest.approx(50.0, rel=0.05),
        pytest.approx(80.0, rel=0.05),
    ]
    # At 6 deg/s.
    assert shown["scan_lateness_p99_deg"] == pytest.approx(1800e-6, rel=0.05)
    assert shown["scan_lateness_max_deg"] == pytest.approx(24e-3)


# --- when -------------------------------------------------------------------------------------------


CHANGES: dict[str, Any] = {
    "holder": lambda desk: setattr(desk.operator.authority, "holder", SERENA),
    "mode": lambda desk: setattr(desk.operator.program, "mode", Mode.CONTINUOUS),
    "speed": lambda desk: set_levels(desk, speed_rad_s=1.0 * DEG),
    "increment": lambda desk: set_levels(desk, increment_rad=1.0 * DEG),
    "override": lambda desk: set_levels(desk, override=0.1),
    "acceleration": lambda desk: setattr(
        desk.axis.virtual, "ramps", replace(desk.axis.virtual.ramps, acc_rad_s2=0.1 * DEG)
    ),
    "blocked": lambda desk: setattr(
        desk.permit, "reasons", (Reason(Code.SYS_12, {"stopped_by": "CTL-02"}, ClearedBy.RESET),)
    ),
    "refusal": lambda desk: setattr(desk.axis, "refusal_count", 14),
    "armed": lambda desk: setattr(desk.operator.arming, "_armed", None),
    "locked": lambda desk: desk.axis.feedback.doubt(Code.ENC_05),
    "brake": lambda desk: setattr(desk.controller.brake, "changed", 99),
}


def set_levels(desk: Desk, **levels: float) -> None:
    desk.operator.levels = desk.operator.levels._replace(**levels)


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_is_published_with_the_next_frame_and_marks_the_recording(desk: Desk, change: str) -> None:
    publisher, engine, slow = publisher_of(desk), desk.engine, desk.memory.slow
    # A frame each 50 ms.
    engine.scan = 1050
    publisher.scan()
    engine.scan = 1100
    publisher.scan()
    before, mark = slow.version, publisher._changes
    engine.scan = 1150
    publisher.scan()
    assert (slow.version, publisher._changes) == (before, mark)
    CHANGES[change](desk)
    engine.scan = 1190
    publisher.scan()
    assert slow.version == before
    engine.scan = 1200
    publisher.scan()
    assert slow.version > before
    assert publisher._changes > mark


def test_new_rows_of_alarms_are_published_once_in_the_scan_behind_a_frame(desk: Desk) -> None:
    publisher, engine, rows = publisher_of(desk), desk.engine, desk.memory.alarms
    engine.scan = 1050
    publisher.scan()
    engine.scan = 1051
    publisher.scan()
    found = []
    for scan in range(1060, 1210):
        if scan == 1070:
            desk.axis.alarms.raise_(Code.INT_06, measured=5.0, speed=-6.0)
        engine.scan, before = scan, rows.version
        publisher.scan()
        if rows.version != before:
            found.append(scan)
    assert found == [1101]


def test_statistics_are_published_each_second(desk: Desk) -> None:
    publisher, engine, slow = publisher_of(desk), desk.engine, desk.memory.slow
    found = []
    for scan in range(950, 3050, 50):
        engine.scan, before = scan, slow.version
        publisher.scan()
        if slow.version != before:
            found.append(scan)
    # The first frame shows everything.
    assert found == [950, 1000, 2000, 3000]
    # And with it what has been counted since: a change between them brings the figures of the last second again.
    counted = []
    for scan, skipped in ((3500, 7), (4000, 9)):
        engine.statistics.skipped, engine.scan = skipped, scan
        desk.axis.refusal_count += 1
        publisher.scan()
        counted.append(Snapshot(desk.memory).slow()["scan_skipped"])
    assert counted == [0, 9]


def test_at_scans_of_10_ms_fast_tags_come_with_each_of_them() -> None:
    slow_scans = with_values(MACHINE, {"control.scan_period_ms": 10.0})
    with opened(slow_scans) as made:
        publisher = publisher_of(made)
        assert (publisher._fast_scans, publisher._frame_scans, publisher._slow_scans) == (1, 5, 100)


def test_a_flag_that_changes_marks_the_recording_and_a_number_does_not(desk: Desk) -> None:
    publisher, engine = publisher_of(desk), desk.engine
    marks = []
    # Scans without a slow frame between them.
    values = ((77.0, True), (77.0, True), (78.0, True), (78.0, False), (79.0, False))
    for scan, (torque_nm, horn) in zip((1200, 1210, 1220, 1230, 1240), values, strict=True):
        desk.axis.feedback.torque_nm, desk.axis.alarms.horn, engine.scan = torque_nm, horn, scan
        publisher.scan()
        marks.append(desk.controller._recorder.mark)
    assert [b - a for a, b in pairwise(marks[1:])] == [0, 1, 0]
    desk.controller.events.put("service", "something")
    engine.scan += 10
    publisher.scan()
    assert desk.controller._recorder.mark == marks[-1] + 1


# --- brake tests --------------------------------------------------------------------------------------


TESTED = BrakeTestResult(BrakeTestOutcome.FAILED, 61.0, 59.0, 0.012 * DEG, Words.AT_UNKNOWN)


def test_a_brake_test_is_told_with_its_torques_by_direction(desk: Desk) -> None:
    """In tags and journal; it is due again 7 days or 100 power-ups later."""
    brake, test = desk.controller.brake, desk.axis.brake_test
    before = brake.changed
    kept = desk.controller.retainer.retained
    assert brake.slow()["brake_test_result"] == "none"
    test.last, test.count, test.level_nm, test.moved_max_rad = TESTED, 1, 60.0, 0.03 * DEG
    kept = brake.scan(kept, 40, 0.0)
    assert (kept.brake_plus_nm, kept.brake_minus_nm) == (61.0, 59.0)
    shown = brake.slow()
    tested_at = datetime.strptime(shown["brake_tested_at"], TIME_FORMAT)
    due_at = datetime.strptime(shown["brake_test_due_at"], TIME_FORMAT)
    assert due_at - tested_at == timedelta(days=7)
    assert [shown[f"brake_test_{name}"] for name in ("result", "plus_nm", "minus_nm", "cycles_left")] == [
        "failed", 61.0, 59.0, 100,
    ]  # fmt: skip
    assert (shown["brake_test_level_nm"], shown["brake_test_limit_deg"]) == (60.0, pytest.approx(0.03))
    assert (shown["brake_tests"], shown["brake_test_overdue"]) == (1, False)
    assert brake.changed > before
    values = journal(desk)[-1]["values"]
    assert values["level_nm"] == 60.0
    assert (values["plus_nm"], values["minus_nm"], values["moved_deg"]) == (61.0, 59.0, pytest.approx(0.012))
    assert values["due_at"] == shown["brake_test_due_at"]
    # The same test is told once; a direction that was not held has no torque.
    told = len(journal(desk))
    assert brake.scan(kept, 40, 0.0) is kept
    assert len(journal(desk)) == told
    test.last, test.count = TESTED._replace(plus_nm=math.nan), 2
    brake.scan(kept, 40, 0.0)
    assert (brake.slow()["brake_test_plus_nm"], brake.slow()["brake_test_minus_nm"]) == (None, 59.0)


def test_a_brake_test_is_due_after_so_many_power_ups(desk: Desk) -> None:
    brake, kept = desk.controller.brake, desk.controller.retainer.retained
    kept = replace(kept, brake_tested_at="2100-01-01T00:00:00Z", brake_tested_power_ups=7)
    for power_ups, left, overdue in ((7, 100, False), (106, 1, False), (107, 0, True), (120, 0, True)):
        brake.judge(kept, power_ups)
        shown = brake.slow()
        assert (shown["brake_test_cycles_left"], shown["brake_test_overdue"]) == (left, overdue)


def test_a_brake_test_that_is_overdue_at_the_start_is_in_the_journal(desk: Desk) -> None:
    """Once, as it is found so."""
    kept = replace(desk.controller.retainer.retained, brake_tested_at="2000-01-01T00:00:00Z")
    told = len(journal(desk))
    brake = BrakeWatch(desk.controller.machine, desk.axis, desk.controller.events, kept)
    brake.judge(kept, kept.power_ups)
    assert [event["kind"] for event in journal(desk)[told:]] == ["brake_test"]


def test_a_brake_that_cannot_be_tested_here_says_why(desk: Desk) -> None:
    brake = desk.controller.brake
    brake._untestable = Words.NO_TORQUE_INPUT
    shown = brake.slow()
    assert shown["brake_test_available"] is False
    assert shown["brake_test_blocked"] == str(Words.NO_TORQUE_INPUT)
    assert shown["brake_test_blocked_messages"] == [{"words": "NO_TORQUE_INPUT", "values": {}}]
    brake._untestable = None
    shown = brake.slow()
    assert (shown["brake_test_blocked"], shown["brake_test_blocked_messages"]) == ("", [])


def journal(desk: Desk) -> list[dict[str, Any]]:
    records = desk.memory.events[Source.CONTROLLER].peek(1000)
    return [json.loads(record) for record in records if record is not None]
