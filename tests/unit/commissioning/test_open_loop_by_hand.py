"""The axis without a position loop, by hand: a drive of a few lines does what is written down."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning.pictures import MotionSample, motion_picture
from gantryctl.commissioning.watch import Halt, StepStopped
from gantryctl.errors import AlarmStop, DeviceError
from gantryctl.image import SAFE_OUTPUT, DriveFeedback, DriveRequest, DriveState, LinkFlag
from gantryctl.machine import with_values
from gantryctl.operation.client import Stop
from unit.commissioning import hand_drive
from unit.commissioning.hand_drive import (
    COUNTS_PER_DEG,
    MACHINE,
    PERIOD_S,
    HandDrive,
    axis_of,
    enabled,
)

pytestmark = pytest.mark.can

ENABLE, S = DriveRequest.ENABLE, DriveState


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_leash_holds_both_ways(direction: float) -> None:
    drive = HandDrive()
    axis = axis_of(drive, 0.05)
    axis.enable()
    with pytest.raises(AlarmStop, match=r"0\.05 deg were allowed"):
        axis.run(1.0, speed_deg_s=direction * 0.2)
    # 0.05 deg at 0.2 deg/s are 0.25 s, and one scan of 4 ms more.
    assert 0.05 < abs(drive.deg) < 0.0518


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize(
    ("what", "words"),
    [
        ({"way": -1.0, "shown": -1.0}, "were commanded|are commanded"),
        ({"way": -1.0, "shown": 1.0}, "were commanded"),
        ({"way": 0.0}, "were commanded|are commanded"),
        ({"way": 1.5, "shown": 1.0}, "were commanded"),
        ({"way": 0.5, "shown": 1.0}, "were commanded"),
    ],
)
def test_an_axis_that_does_not_follow_is_stopped(
    direction: float, what: dict[str, float], words: str
) -> None:
    """0.05 deg and 0.15 s behind are allowed: at 0.3 deg/s 0.095 deg, which half the speed makes within 0.64 s."""
    drive, axis = enabled(**what)
    with pytest.raises(AlarmStop, match=words):
        axis.run(2.0, speed_deg_s=direction * 0.3)
    assert drive.state is S.SWITCH_ON_DISABLED


@pytest.mark.parametrize("shown_deg_s", [0.95, -0.65])
def test_a_speed_outside_of_the_band_is_stopped_on_either_side(shown_deg_s: float) -> None:
    """0.5 deg/s beside the commanded 0.3 deg/s, for five scans (20 ms)."""
    drive, axis = enabled()
    axis.run(0.1, speed_deg_s=0.3)
    vel = math.radians(shown_deg_s) * 1144
    drive.spoil = lambda seen: seen._replace(vel_act_rad_s=vel)
    axis.run(5 * PERIOD_S, speed_deg_s=0.3)
    with pytest.raises(AlarmStop, match=r"0\.300 deg/s are commanded"):
        axis.run(PERIOD_S, speed_deg_s=0.3)


def test_single_readings_outside_of_the_band_do_not_add_up() -> None:
    """Two scans of three, 60 times: the five that are allowed count one after the other."""
    drive, axis = enabled()
    axis.run(0.1, speed_deg_s=0.3)
    number = [0]

    def spoil(seen: DriveFeedback) -> DriveFeedback:
        number[0] += 1
        return seen if number[0] % 3 == 0 else seen._replace(vel_act_rad_s=math.radians(0.95) * 1144)

    drive.spoil = spoil
    axis.run(180 * PERIOD_S, speed_deg_s=0.3)
    assert drive.state is S.OPERATION_ENABLED


@pytest.mark.parametrize(("readings", "stops"), [(1, False), (2, True)])
def test_a_time_shorter_than_a_scan_is_one_scan(
    monkeypatch: pytest.MonkeyPatch, readings: int, stops: bool
) -> None:
    """1 ms at scans of 4 ms: one reading that is off stops nothing."""
    quick = with_values(MACHINE, {"monitors.velocity_deviation_time_ms": 1.0})
    monkeypatch.setattr(hand_drive, "MACHINE", quick)
    drive, axis = enabled()
    axis.run(0.1, speed_deg_s=0.3)
    left = [readings]

    def spoil(seen: DriveFeedback) -> DriveFeedback:
        left[0] -= 1
        return seen._replace(vel_act_rad_s=math.radians(0.95) * 1144) if left[0] >= 0 else seen

    drive.spoil = spoil
    if stops:
        with pytest.raises(AlarmStop, match="the axis turns at"):
            axis.run(0.1, speed_deg_s=0.3)
    else:
        axis.run(0.1, speed_deg_s=0.3)


@pytest.mark.parametrize("scans", [5, 24])
def test_a_fault_that_shows_late_behind_a_silence_is_reset(scans: int) -> None:
    """Also in the last of the 25 scans of 4 ms."""
    drive, axis = enabled()
    drive.wrote.clear()

    def spoil(seen: DriveFeedback) -> DriveFeedback:
        reset = any(output.request is DriveRequest.FAULT_RESET for output in drive.wrote)
        late = len(drive.wrote) > scans and not reset
        return seen._replace(state=S.FAULT if late else S.SWITCH_ON_DISABLED)

    drive.spoil = spoil
    axis.wake()
    assert drive.wrote[-1].request is DriveRequest.FAULT_RESET


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize(
    ("behind_deg", "stops"), [(0.45, False), (0.55, True), (-0.45, False), (-0.55, True)]
)
def test_a_gantry_may_be_as_far_behind_as_0_15_s_of_its_speed_make(
    direction: float, behind_deg: float, stops: bool
) -> None:
    """0.05 deg and 0.45 deg at 3 deg/s, either way, also in the scan in which the command has just become 0."""
    drive, axis = enabled()
    axis.ramp_to(direction * 3.0, 5.0)
    counts = direction * behind_deg * COUNTS_PER_DEG
    drive.spoil = lambda seen: seen._replace(pos_act_counts=round(seen.pos_act_counts - counts))
    if stops:
        with pytest.raises(AlarmStop, match="apart are allowed"):
            axis.scan(ENABLE, direction * 3.0)
    else:
        axis.run(0.1, speed_deg_s=direction * 3.0)
        axis.scan(ENABLE, 0.0)


def test_a_ramp_goes_from_the_speed_that_is_there_to_the_one_that_is_wanted() -> None:
    """1 deg/s2 are 0.004 deg/s in a scan: 0.004 to 0.3 deg/s, then 0.296 to -0.3 deg/s."""
    drive, axis = enabled()
    for wanted, steps in ((0.3, range(1, 76)), (-0.3, range(74, -76, -1))):
        drive.wrote.clear()
        axis.ramp_to(wanted, 1.0)
        told = [math.degrees(output.vel_cmd_rad_s) / 1144 for output in drive.wrote]
        assert told == pytest.approx([0.004 * step for step in steps], abs=1e-9)


def test_the_way_of_a_command_begins_where_the_drive_was_enabled() -> None:
    """It may have been turned by hand before."""
    drive = HandDrive()
    axis = axis_of(drive)
    for turned_deg in (0.3, -0.6):
        drive.deg += turned_deg
        axis.run(0.1, DriveRequest.DISABLE)
        axis.enable()
        axis.run(0.1, speed_deg_s=0.3)


def test_what_the_shaft_did_in_the_scan_in_which_the_drive_became_enabled_is_no_way_of_the_command() -> None:
    """It had no torque before: 0.06 deg, where 0.05 deg from the command are allowed to a drive that stands."""
    drive = HandDrive()
    axis = axis_of(drive)
    drive.deg += 0.06
    axis.run(0.1)
    drive.deg += 0.06
    with pytest.raises(AlarmStop, match=r"turned by \+0\.060 deg"):
        axis.scan(ENABLE)


def test_a_position_that_is_no_number_is_on_no_leash() -> None:
    drive = HandDrive()
    axis = axis_of(drive, following=False)
    drive.spoil = lambda seen: seen._replace(pos_act_counts=math.nan)  # type: ignore[arg-type]
    with pytest.raises(AlarmStop, match=r"the axis moved \+nan deg, 10 deg were allowed"):
        axis.scan(ENABLE)
    assert drive.wrote[-1] == SAFE_OUTPUT


@pytest.mark.parametrize(("start_deg", "shown_deg"), [(90.0, 90.3), (-90.0, -89.7), (math.nan, None)])
def test_people_see_the_angle_of_the_gantry_and_its_speed(start_deg: float, shown_deg: float | None) -> None:
    """A second at 0.3 deg/s from where it stood; without a zero offset nobody knows the angle."""
    axis = axis_of(HandDrive(), start_deg=start_deg)
    axis.enable()
    axis.run(1.0, speed_deg_s=0.3)
    seen = axis._watch.seen
    assert seen is not None
    assert seen.angle_deg == (None if shown_deg is None else pytest.approx(shown_deg, abs=1e-6))
    assert seen.speed_deg_s == pytest.approx(0.3)


def test_an_axis_that_follows_goes_on() -> None:
    _, axis = enabled()
    for speed in (0.3, -0.3):
        axis.ramp_to(speed, 1.0)
        axis.run(1.0, speed_deg_s=speed)
    # 0.3 deg/s for a second, and half of the ramps of 0.3 s up and 0.6 s through 0.
    assert axis.angle_deg == pytest.approx(0.045 + 0.3 + 0.0 - 0.3, abs=0.005)


def test_a_sound_axis_goes_on_behind_a_scan_that_was_held_up() -> None:
    """100 scans of 4 ms are missed: at 0.3 deg/s 0.12 deg, and 0.095 deg beside the command are allowed."""
    drive, axis = enabled()
    axis.run(0.1, speed_deg_s=0.3)
    clock = axis._clock

    def held_up(deadline: int) -> Any:
        axis._clock = clock
        drive.deg += 100 * PERIOD_S * 0.3
        return clock.wait_for(deadline + 100)

    axis._clock = SimpleNamespace(wait_for=held_up)
    axis.run(1.0, speed_deg_s=0.3)
    # The meter of the step knows the time that has passed: 76 scans to be enabled, 25, 250 and the 100 missed ones.
    assert axis._watch.meter.done == pytest.approx(PERIOD_S * (76 + 25 + 250 + 100))
    # One scan of 0.0012 deg.
    assert axis.angle_deg == pytest.approx(0.3 * (0.1 + 0.4 + 1.0), abs=0.0012)


@pytest.mark.parametrize(
    ("changes", "stops"),
    [
        ({}, False),
        ({"link": LinkFlag.LATE, "age_scans": 7}, False),
        ({"age_scans": 8}, True),
        ({"inputs_age_scans": 8}, True),
        ({"link": LinkFlag.SYNC_JITTER}, False),
        # `enable` tells more of it than a disturbed connection.
        ({"link": LinkFlag.NEVER_FOLLOWED}, False),
        ({"link": LinkFlag.IO_LOST}, True),
        ({"link": LinkFlag.OTHER_MASTER}, True),
        ({"link": LinkFlag.TWO_SENDERS}, True),
        ({"pos_act_counts": math.nan}, True),
    ],
)
def test_a_disturbed_connection_ends_a_proof(changes: dict[str, Any], stops: bool) -> None:
    """A telegram is bridged for 30 ms, 7.5 scans."""
    drive, axis = enabled()
    drive.spoil = lambda seen: seen._replace(**changes)
    if stops:
        with pytest.raises(AlarmStop):
            axis.scan(ENABLE)
    else:
        axis.scan(ENABLE)
    assert drive.wrote[-1].request is (DriveRequest.DISABLE if stops else ENABLE)


@pytest.mark.parametrize(
    ("changes", "confirmed"),
    [
        ({}, True),
        ({"brake_open": True}, False),
        ({"state": S.UNKNOWN}, False),
        ({"state": S.OPERATION_ENABLED}, False),
        ({"state": S.FAULT_REACTION_ACTIVE}, False),
        ({"age_scans": 1}, False),
        ({"inputs_age_scans": 1}, False),
        ({"link": LinkFlag.HEARTBEAT_LOST}, False),
    ],
)
def test_torque_off_and_brake_are_confirmed_by_what_the_drive_shows_now(
    changes: dict[str, Any], confirmed: bool
) -> None:
    drive, axis = enabled()
    drive.spoil = lambda seen: seen._replace(**changes)
    text = axis.break_off()
    assert ("press the emergency stop" in text) is not confirmed
    # Said in every scan, not once: a telegram may be lost.
    assert {output.request for output in drive.wrote[-20:]} == {DriveRequest.DISABLE}
    assert not any(output.brake_open for output in drive.wrote[-20:])


@pytest.mark.parametrize(("brake_open", "scans"), [(False, 25), (True, 375)])
def test_a_break_off_looks_for_100_ms_of_rest_and_for_1_5_s_at_the_most(brake_open: bool, scans: int) -> None:
    drive, axis = enabled()
    drive.spoil = lambda seen: seen._replace(brake_open=brake_open)
    drive.wrote.clear()
    axis.break_off()
    # Once before the first scan.
    assert len(drive.wrote) == 1 + scans


def test_the_time_of_a_break_off_ends_when_the_drive_is_off() -> None:
    """The brake closes in the eleventh scan of 4 ms; then it is looked at for 100 ms."""
    drive, axis = enabled()
    begun = len(drive.wrote)
    drive.spoil = lambda seen: seen._replace(brake_open=len(drive.wrote) - begun <= 11)
    assert axis.break_off() == "torque off and brake closed after 40 ms, at +0.000 deg"


def test_a_silence_ends_before_torque_off_is_commanded() -> None:
    """A drive that is silenced sends nothing, also no SAFE_OUTPUT."""
    drive, axis = enabled()
    drive.silent_process_data = drive.silent_heartbeat = True
    silent: list[bool] = []
    write = drive.write

    def heard(output: Any) -> None:
        silent.append(drive.silent_process_data or drive.silent_heartbeat)
        write(output)

    drive.write = heard  # type: ignore[method-assign]
    axis.break_off()
    assert not any(silent)


def test_a_break_off_keeps_its_time_from_the_set_up_of_a_lost_drive_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A set-up takes longer than some scans: those that it has missed are not made up for, the drive needs the time."""
    drive, axis = enabled()
    order: list[str] = []
    drive.lost = True
    monkeypatch.setattr(drive, "resume", lambda: order.append("resumed"))
    monkeypatch.setattr(axis, "begin_time", lambda: order.append("time"))
    monkeypatch.setattr(axis, "wait", lambda: order.append("waited"))
    axis.break_off()
    assert order == ["resumed", "time", *["waited"] * 25]


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize(("speed_deg_s", "off"), [(0.049, True), (0.051, False)])
def test_a_gantry_that_turns_on_is_not_said_to_be_off(direction: int, speed_deg_s: float, off: bool) -> None:
    """0.05 deg/s of swing are rest."""
    drive, axis = enabled()
    turned = [0]

    def turning(seen: DriveFeedback) -> DriveFeedback:
        turned[0] += direction * round(speed_deg_s * PERIOD_S * COUNTS_PER_DEG)
        return seen._replace(pos_act_counts=turned[0])

    drive.spoil = turning
    assert ("press the emergency stop" in axis.break_off()) is not off


def test_the_brake_is_closed_before_the_torque_goes_off() -> None:
    drive, axis = enabled()
    drive.wrote.clear()
    axis.disable()
    told = [(output.request, output.brake_open) for output in drive.wrote]
    assert told[:2] == [(ENABLE, False)] * 2
    assert set(told[2:]) == {(DriveRequest.DISABLE, False)}
    assert len(told) == 2 + 150


def test_a_fault_counts_as_reset_when_the_drive_is_back() -> None:
    drive = HandDrive()
    axis = axis_of(drive)
    drive.spoil = lambda seen: seen._replace(state=S.FAULT, error_code=0x8130)
    with pytest.raises(DeviceError, match="8130h"):
        axis.reset()
    drive.spoil = lambda seen: seen
    axis.reset()


@pytest.mark.parametrize("state", [S.FAULT_REACTION_ACTIVE, S.UNKNOWN, S.READY_TO_SWITCH_ON])
def test_a_fault_that_shows_another_state_on_its_way_is_reset_on(state: DriveState) -> None:
    """Five scans of it, then the drive is ready for the next step."""
    drive = HandDrive()
    axis = axis_of(drive)
    drive.spoil = lambda seen: seen._replace(state=state if len(drive.wrote) <= 5 else S.SWITCH_ON_DISABLED)
    axis.reset()
    assert [output.request for output in drive.wrote] == [DriveRequest.FAULT_RESET] * 6


def test_a_bit_12_that_is_always_1_is_told() -> None:
    drive = HandDrive()
    drive.settings.follows_bit, drive.process.statusword = True, 0x1240
    axis = axis_of(drive)
    axis.run(4 * PERIOD_S, DriveRequest.DISABLE)
    with pytest.raises(AlarmStop, match="bit 12"):
        axis.run(PERIOD_S, DriveRequest.DISABLE)
    # Not one that is 0 in between, however often.
    axis = axis_of(drive)
    for status in (0x1240, 0x1240, 0x0240) * 5:
        drive.process.statusword = status
        axis.run(PERIOD_S, DriveRequest.DISABLE)
    # Nor where the machine file says that the bit means nothing.
    drive.settings.follows_bit, drive.process.statusword = False, 0x1240
    axis.run(10 * PERIOD_S, DriveRequest.DISABLE)
    # Enabled it is what it should be.
    drive.settings.follows_bit = True
    axis = axis_of(drive)
    axis.enable()
    axis.run(0.1)


@pytest.mark.parametrize(
    ("follows_bit", "status", "hint"), [(True, 0x0237, True), (True, 0x1237, False), (False, 0x0237, False)]
)
def test_a_drive_that_is_not_enabled_is_told_with_the_bit_that_it_lacks(
    follows_bit: bool, status: int, hint: bool
) -> None:
    drive = HandDrive()
    drive.settings.follows_bit, drive.process.statusword = follows_bit, status
    drive.spoil = lambda seen: seen._replace(state=S.SWITCHED_ON, link=LinkFlag.NONE)
    axis = axis_of(drive)
    axis._judge_bit_12 = lambda: None  # type: ignore[method-assign]
    with pytest.raises(DeviceError, match="the drive is in switched on after 2 s") as told:
        axis.enable()
    assert ("bit 12 of 6041 is 0" in str(told.value)) is hint


def test_a_person_ends_it_and_a_drive_that_was_lost_is_started_to_be_told() -> None:
    halt, drive = Halt(), HandDrive()
    axis = axis_of(drive, halt=halt)
    axis.enable()
    drive.lost = True
    halt.ask(Stop.RAMP, "stopped by anna")
    with pytest.raises(StepStopped, match="stopped by anna"):
        axis.scan(ENABLE)
    assert not drive.lost
    assert drive.state is S.SWITCH_ON_DISABLED


def test_a_copy_that_is_to_be_killed_hears_nobody() -> None:
    halt = Halt()
    axis = axis_of(HandDrive(), halt=halt)
    halt.ask(Stop.RAMP, "stopped by anna")
    assert axis.halted
    axis.hear_nobody()
    assert not axis.halted


@pytest.mark.parametrize(("count", "drawn"), [(0, False), (1, False), (2, True)])
def test_two_readings_make_a_picture(count: int, drawn: bool) -> None:
    samples = [MotionSample(0.004 * k, 0.0, 0.0, 0.0, 0.0) for k in range(count)]
    assert (motion_picture("there", samples) is not None) is drawn


def test_a_stop_ends_also_what_is_only_shown() -> None:
    """A lamp that a person looks at, with the drive off."""
    halt, drive = Halt(), HandDrive()
    axis = axis_of(drive, halt=halt)
    lamp = SAFE_OUTPUT._replace(lamp=True)
    axis.show(lamp, 0.1)
    assert drive.wrote == [lamp] * 25
    # Each for a scan.
    assert axis._deadline == 25
    drive.wrote.clear()
    halt.ask(Stop.RAMP, "stopped by anna")
    with pytest.raises(StepStopped, match="stopped by anna"):
        axis.show(lamp, 0.1)
    assert not any(output.lamp for output in drive.wrote)


@pytest.mark.parametrize(("state", "resets"), [(S.FAULT, True), (S.SWITCH_ON_DISABLED, False)])
def test_after_a_silence_the_fault_that_it_caused_is_cleared(state: DriveState, resets: bool) -> None:
    drive = HandDrive()
    axis = axis_of(drive)
    drive.state = state
    axis.wake()
    assert drive.state is S.SWITCH_ON_DISABLED
    assert any(output.request is DriveRequest.FAULT_RESET for output in drive.wrote) is resets
    # Nothing is asked for before.
    assert {output.request for output in drive.wrote[:25]} == {DriveRequest.DISABLE}


def test_a_ramp_begins_at_the_speed_of_the_axis_and_not_at_the_one_commanded() -> None:
    """A drive that turns at 0.95 of 0.3 deg/s: down from 0.285 in 72 scans, 0.0039583 deg/s in each."""
    drive, axis = enabled(way=0.95, shown=0.95)
    axis.run(0.2, speed_deg_s=0.3)
    drive.wrote.clear()
    axis.ramp_to(0.0, 1.0)
    told = [math.degrees(output.vel_cmd_rad_s) / 1144 for output in drive.wrote]
    assert told == pytest.approx([0.285 * (71 - k) / 72 for k in range(72)], abs=1e-9)


def test_the_way_commanded_counts_from_the_first_command_on() -> None:
    """0.3 deg/s are 0.0012 deg in a scan, and 0.095 deg apart are allowed: the 80th is one too many."""
    drive, axis = enabled()
    drive.spoil = lambda seen: seen._replace(pos_act_counts=0)
    axis.run(79 * PERIOD_S, speed_deg_s=0.3)
    with pytest.raises(AlarmStop, match=r"\+0\.000 deg, \+0\.096 deg were commanded, 0\.095 deg apart"):
        axis.scan(ENABLE, 0.3)


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("late_scans", [0, 3])
def test_a_drive_that_follows_at_once_is_in_the_band_as_one_that_follows_four_scans_later(
    monkeypatch: pytest.MonkeyPatch, direction: float, late_scans: int
) -> None:
    """From 1 deg/s to 0 in a scan, where 0.5 deg/s beside the command are allowed for a scan."""
    quick = with_values(MACHINE, {"monitors.velocity_deviation_time_ms": 1.0})
    monkeypatch.setattr(hand_drive, "MACHINE", quick)
    drive, axis = enabled()
    axis.ramp_to(direction, 5.0)
    begun, before = len(drive.wrote), math.radians(direction) * 1144

    def spoil(seen: DriveFeedback) -> DriveFeedback:
        late = len(drive.wrote) - begun <= late_scans
        return seen._replace(vel_act_rad_s=before) if late else seen

    drive.spoil = spoil
    axis.run(0.1)


def test_a_time_of_one_scan_and_a_part_is_two_scans() -> None:
    """Whatever is commanded, and what is only shown with the drive off."""
    drive, axis = enabled()
    for what in (lambda: axis.run(1.4 * PERIOD_S), lambda: axis.show(SAFE_OUTPUT, 1.4 * PERIOD_S)):
        drive.wrote.clear()
        what()
        assert len(drive.wrote) == 2


def test_scans_that_a_silence_has_taken_are_not_made_up_for(monkeypatch: pytest.MonkeyPatch) -> None:
    drive, axis = enabled()
    order: list[str] = []
    monkeypatch.setattr(drive, "resume", lambda: order.append("resumed"))
    monkeypatch.setattr(axis, "begin_time", lambda: order.append("time"))
    drive.write(SAFE_OUTPUT)
    axis.wake()
    assert order == ["resumed", "time"]


def test_an_axis_is_enabled_with_its_brake_open_and_people_see_the_drive() -> None:
    drive, axis = enabled()
    assert drive.wrote[-1].brake_open
    seen = axis._watch.seen
    assert seen is not None
    assert seen.drive is axis.feedback
