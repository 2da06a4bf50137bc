"""Monitors of the encoder and of numbers: what they see, how soon, which reaction, in which words."""

import math

import pytest

from gantryctl.image import DriveRequest, EncoderFlag, LinkFlag
from gantryctl.program import AxisState, Reaction
from gantryctl.program.monitors.monitors import Monitors
from gantryctl.units import rad
from unit.program.parts import Parts
from unit.program.rig import Rig, moving_rig, settings
from unit.program.spoiling import counts, expect

# --- encoder: feedback in doubt is TORQUE OFF (F2) ------------------------------------------------


@pytest.mark.parametrize("jump_deg", [0.05, -0.05, 0.5, -30.0])
@pytest.mark.parametrize("for_scans", [1, 10_000])
def test_a1_jump(jump_deg, for_scans):
    rig = moving_rig()
    left = {"scans": for_scans}

    def jump(drive):
        left["scans"] -= 1
        return (
            drive._replace(pos_act_counts=drive.pos_act_counts + counts(jump_deg))
            if left["scans"] >= 0
            else drive
        )

    rig.spoil = jump
    expect(rig, "ENC-01", Reaction.TORQUE_OFF, 0.0, "Position jumped", "in one scan", "Do not reset")
    assert not rig.axis.feedback.position_valid


def test_a1_the_step_of_a_fast_axis_is_no_jump():
    rig = moving_rig()
    rig.run(1.0)
    assert not rig.codes
    rig.spoil = lambda drive: drive._replace(pos_act_counts=drive.pos_act_counts + counts(0.02))
    rig.step()
    assert "ENC-01" not in rig.codes, "0.02 deg is within the band; the following error monitor looks at it"


def test_a2_frozen_in_motion():
    rig = moving_rig()
    held, held_rad = rig.drive.read().pos_act_counts, rig.drive.pos_rad
    rig.spoil = lambda drive: drive._replace(pos_act_counts=held)
    # The speed goes on: 0.045 deg of it without a count are reached in 8 ms at 6 deg/s.
    expect(rig, "ENC-02", Reaction.TORQUE_OFF, 0.030, "unchanged for 7 ms while 6.30")
    rig.run(5.0)
    assert "the angle is not known" in rig.first.text
    assert "axis moved" not in rig.first.text, "it moved, and nobody knows how far"
    assert "at rest" not in rig.first.text, "the speed is of the same encoder"
    assert abs(rig.drive.pos_rad - held_rad) > rad(0.045)


def test_a2_frozen_at_a_low_speed():
    rig = moving_rig(speed_deg_s=0.6)
    held = rig.drive.read().pos_act_counts
    rig.spoil = lambda drive: drive._replace(pos_act_counts=held)
    expect(rig, "ENC-02", Reaction.TORQUE_OFF, 0.031, "unchanged for 30 ms while 0.77")


def test_a3_frozen_before_the_first_move():
    rig = Rig()
    rig.power_up()
    held = rig.drive.read().pos_act_counts
    rig.spoil = lambda drive: drive._replace(pos_act_counts=held)
    start = rig.drive.pos_rad
    rig.move(50.0)
    expect(rig, "ENC-02", Reaction.TORQUE_OFF, 1.0)
    assert abs(rig.drive.pos_rad - start) < rad(0.35), "class M-0"


def test_frozen_is_judged_in_time_not_in_scans():
    rig = moving_rig(speed_deg_s=0.6, config=settings(period_s=0.004))
    held = rig.drive.read().pos_act_counts
    rig.spoil = lambda drive: drive._replace(pos_act_counts=held)
    expect(rig, "ENC-02", Reaction.TORQUE_OFF, 0.036, "unchanged for 32 ms")


def test_a4_one_bad_reading_is_bridged():
    rig = moving_rig()
    rig.run(0.01)
    left = {"scans": 1}

    def bad(drive):
        if left["scans"] == 0:
            return drive
        left["scans"] = 0
        return drive._replace(encoder=EncoderFlag.CRC_ERROR, pos_act_counts=12345)

    rig.spoil = bad
    rig.step()
    assert rig.codes == ["ENC-03"]
    assert abs(rig.axis.pos_err_rad) < rad(0.001), "the prediction is good to 0.001 deg"
    rig.run(0.5)
    assert rig.first is None
    assert rig.axis.state is AxisState.DISCRETE_MOTION


def test_a5_three_bad_readings_in_100_ms():
    rig = moving_rig()
    state = {"scan": 0}

    def every_tenth(drive):
        state["scan"] += 1
        return drive._replace(encoder=EncoderFlag.CRC_ERROR) if state["scan"] % 40 == 0 else drive

    rig.spoil = every_tenth
    expect(rig, "ENC-04", Reaction.TORQUE_OFF, 0.120, "3 bad encoder readings within 81 ms, limit 3")


def test_a5_rare_bad_readings_go_on():
    rig = moving_rig()
    state = {"scan": 0}

    def rare(drive):
        state["scan"] += 1
        return drive._replace(encoder=EncoderFlag.CRC_ERROR) if state["scan"] % 60 == 0 else drive

    rig.spoil = rare
    rig.run(1.0)
    assert rig.codes == ["ENC-03"]


def test_a6_encoder_alarm_and_its_lock():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(encoder=EncoderFlag.ALARM)
    expect(rig, "ENC-05", Reaction.TORQUE_OFF, 0.0)
    rig.run(3.0)
    rig.op(reset=True)
    assert "service role only" in rig.refused()
    rig.program.service = True
    rig.op(reset=False)
    rig.op(reset=True)
    assert "still reports its alarm" in rig.refused()
    rig.spoil = None
    rig.op(reset=False)
    rig.op(reset=True)
    rig.step()
    assert not rig.codes
    assert rig.axis.feedback.position_valid


def test_a7_encoder_warning_goes_on():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(encoder=EncoderFlag.WARNING)
    rig.run(0.5)
    assert rig.codes == ["ENC-06"]
    assert rig.axis.state is AxisState.DISCRETE_MOTION


def test_a16_old_readings():
    rig = moving_rig(speed_deg_s=0.6)
    frozen = rig.drive.read()
    state = {"age": 0}

    def old(drive):
        state["age"] += 1
        return frozen._replace(age_scans=state["age"])

    rig.spoil = old
    expect(rig, "CAN-07", Reaction.QUICK_STOP, 0.030, "30 ms old, limit 30 ms")


@pytest.mark.parametrize(
    ("flag", "code", "reaction"),
    [
        (LinkFlag.BUS_DOWN, "CAN-08", Reaction.TORQUE_OFF),
        (LinkFlag.RESTARTED, "DRV-11", Reaction.TORQUE_OFF),
        (LinkFlag.HEARTBEAT_LOST, "CAN-06", Reaction.TORQUE_OFF),
        (LinkFlag.NOT_OPERATIONAL, "CAN-13", Reaction.TORQUE_OFF),
        (LinkFlag.OTHER_MASTER, "CAN-12", Reaction.QUICK_STOP),
        (LinkFlag.IGNORES_COMMAND, "DRV-05", Reaction.TORQUE_OFF),
        (LinkFlag.RESTARTED | LinkFlag.NOT_OPERATIONAL, "DRV-11", Reaction.TORQUE_OFF),
    ],
)
def test_what_is_wrong_with_the_bus_acts_on_the_first_scan(flag, code, reaction):
    rig = moving_rig(speed_deg_s=0.6)
    rig.spoil = lambda drive: drive._replace(link=flag)
    expect(rig, code, reaction, rig.period_s)


def test_one_old_reading_is_nothing():
    rig = moving_rig()
    last = {"drive": rig.drive.read(), "scan": 0}

    def sometimes(drive):
        last["scan"] += 1
        if last["scan"] % 7 == 0:
            return last["drive"]._replace(age_scans=1)
        last["drive"] = drive
        return drive

    rig.spoil = sometimes
    rig.run(1.0)
    assert not rig.codes


def after_late_telegrams(jump_scan, jump_deg):
    """Three telegrams are missing, the fourth is still an old one; so many scans later the position jumps."""
    rig = moving_rig(config=settings(period_s=0.004))
    state = {"scan": 0, "old": rig.drive.read()}

    def spoil(drive):
        state["scan"] += 1
        if state["scan"] <= 3:
            return state["old"]._replace(age_scans=state["scan"])
        if state["scan"] == 4:
            return state["old"]
        return (
            drive
            if state["scan"] < jump_scan
            else drive._replace(pos_act_counts=drive.pos_act_counts + counts(jump_deg))
        )

    rig.spoil = spoil
    return rig


def test_a_telegram_that_is_older_than_it_looks_is_no_jump():
    rig = after_late_telegrams(10_000, 0.0)
    rig.run(0.5)
    assert "ENC-01" not in rig.codes
    assert rig.first is None


def test_a_jump_soon_after_late_telegrams_is_caught():
    rig = after_late_telegrams(8, 0.05)
    rig.run(9 * 0.004)
    assert rig.first.code == "ENC-01"


# --- NaN and infinity -----------------------------------------------------------------------------


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", ["vel_act_rad_s", "torque_act_nm", "pos_act_counts"])
@pytest.mark.parametrize("moving", [True, False])
def test_a_reading_that_is_no_number(bad, field, moving):
    if moving:
        rig = moving_rig()
    else:
        rig = Rig()
        rig.power_up()
    rig.spoil = lambda drive: drive._replace(**{field: bad})
    rig.until(lambda: rig.first is not None, 0.05)
    assert rig.first.code in ("CTL-02", "CTL-04", "CTL-05")
    assert rig.first.reaction is Reaction.TORQUE_OFF
    for _ in range(100):
        rig.step()
        assert rig.output.vel_cmd_rad_s == 0.0
        assert math.isfinite(rig.output.torque_ff_nm)


def test_the_output_guard_stops_what_is_no_number():
    rig = moving_rig()
    rig.axis._law = lambda *_: (math.nan, rig.axis.pos_act_rad, 0.0)
    rig.step()
    assert rig.first.code == "CTL-02"
    assert rig.output.vel_cmd_rad_s == 0.0
    assert rig.output.request is DriveRequest.QUICK_STOP
    assert "speed command nan is not a finite number" in rig.first.text


def test_a_following_error_on_a_count_that_stands_is_a_frozen_encoder():
    parts = Parts()
    monitors = Monitors(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)
    parts.virtual.at_rest = False
    parts.feedback.unchanged_scans = 5
    parts.after(lambda: monitors.scan(0.0, rad(0.2), 0.0), most_s=0.02)
    assert parts.codes[-1] == "ENC-02"
    assert "CTL-03" not in parts.codes


def test_a_bad_reading_before_any_other_is_the_first_one():
    rig = Rig()
    rig.spoil = lambda drive: drive._replace(encoder=EncoderFlag.CRC_ERROR)
    rig.step()
    assert rig.codes == ["ENC-03"]
    assert math.isfinite(rig.axis.feedback.counts)


def test_a_bad_reading_without_a_speed_is_the_reading_before():
    """A speed whose telegram is too old, and is no number."""
    rig = Rig()
    rig.run(0.1)
    before = rig.axis.feedback.counts
    rig.spoil = lambda drive: drive._replace(
        speed_age_scans=40, vel_act_rad_s=math.nan, encoder=EncoderFlag.CRC_ERROR, pos_act_counts=7
    )
    rig.run(0.002)
    assert rig.axis.feedback.counts == before


def test_the_speed_that_was_told_stands_in_for_one_that_is_late():
    rig = moving_rig()
    told = rig.axis.feedback.vel_rad_s
    rig.spoil = lambda drive: drive._replace(speed_age_scans=5, vel_act_rad_s=0.0)
    rig.step()
    assert rig.axis.feedback.vel_rad_s == told
    rig.spoil = lambda drive: drive._replace(speed_age_scans=31, vel_act_rad_s=0.0)
    rig.step()
    assert rig.axis.feedback.vel_rad_s == 0.0
