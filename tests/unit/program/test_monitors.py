"""Every monitor: what it sees, how soon, which reaction, in which words. Feedback is spoiled, never the controller."""

import math

import pytest

from gantryctl.image import DigitalInputs, DriveRequest, DriveState, EncoderFlag, LinkFlag
from gantryctl.program import AxisState, PowerPhase, Reaction
from gantryctl.units import rad
from unit.program.rig import COUNTS_PER_DEG, RATIO, Rig, moving_rig, settings

STOP_REQUEST = {
    Reaction.QUICK_STOP: DriveRequest.QUICK_STOP,
    Reaction.TORQUE_OFF: DriveRequest.DISABLE,
}


def counts(degrees):
    return round(degrees * COUNTS_PER_DEG)


def after(scans, change):
    """Spoil the reading from the given number of scans on."""
    state = {"scan": 0}

    def spoil(drive):
        state["scan"] += 1
        return change(drive) if state["scan"] > scans else drive

    return spoil


def expect(rig, code, reaction, within_s, *words):
    """The first-out alarm, its reaction in the same scan, its words, and that the axis ends in ErrorStop."""
    rig.until(lambda: rig.first is not None, within_s + 1.5 * rig.period_s)
    assert str(rig.first.code) == code
    assert rig.first.reaction is reaction
    assert rig.output.request is STOP_REQUEST[reaction]
    assert rig.output.vel_cmd_rad_s == 0.0
    assert rig.output.brake_open == (reaction is Reaction.QUICK_STOP)
    rig.step()
    assert rig.axis.state is AxisState.ERROR_STOP
    for word in words:
        assert word in rig.first.text, rig.first.text


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
    # 30 ms, or the trip of the following error (0.102 deg at 6 deg/s: 17 ms, for 10 ms), whichever is first.
    expect(rig, "ENC-02", Reaction.TORQUE_OFF, 0.030, "unchanged for 26 ms while 6.30")
    rig.run(5.0)
    assert "the angle is not known" in rig.first.text
    assert "gantry moved" not in rig.first.text, "it moved, and nobody knows how far"
    assert "at rest" not in rig.first.text, "the speed is of the same encoder"
    assert abs(rig.drive.pos_rad - held_rad) > rad(0.1)


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
        (LinkFlag.IGNORES_COMMAND, "DRV-05", Reaction.QUICK_STOP),
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


# --- numbers that are none ------------------------------------------------------------------------


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


# --- following error, speed, torque ---------------------------------------------------------------


@pytest.mark.parametrize("speed_deg_s", [0.6, 6.0])
def test_b3_following_error_band_grows_with_speed(speed_deg_s):
    band = 0.03 + 0.012 * speed_deg_s
    rig = moving_rig(speed_deg_s=speed_deg_s)
    lag = {"deg": 0.0}

    def lags(drive):
        lag["deg"] = min(lag["deg"] + 0.001, 0.98 * band)
        return drive._replace(pos_act_counts=drive.pos_act_counts - counts(lag["deg"]))

    rig.spoil = lags
    rig.run(1.0)
    assert "CTL-03" not in rig.codes


def lagging(rig, per_scan_deg):
    """The reading falls behind by more every scan, slowly enough not to be a jump."""
    lag = {"deg": 0.0}

    def spoil(drive):
        lag["deg"] += per_scan_deg
        return drive._replace(pos_act_counts=drive.pos_act_counts - counts(lag["deg"]))

    rig.spoil = spoil


def test_b3_following_error_warns_then_stops():
    rig = moving_rig()
    lagging(rig, 0.004)
    rig.until(lambda: rig.codes, 0.1)
    assert rig.codes == ["CTL-12"], "half the band is the warning"
    assert "warning at 0.051 deg, stop at 0.102 deg" in rig.axis.alarms.active["CTL-12"].text
    rig.until(lambda: rig.first is not None, 0.1)
    assert rig.first.code == "CTL-03"
    assert rig.first.reaction is Reaction.QUICK_STOP, "the drive obeys its speed command"
    assert "limit 0.102 deg at 6.00 deg/s" in rig.first.text


def test_b3_following_error_of_a_drive_that_does_not_obey_is_torque_off():
    rig = moving_rig()
    lagging(rig, 0.01)
    inner = rig.spoil
    rig.spoil = lambda drive: inner(drive)._replace(vel_act_rad_s=drive.vel_act_rad_s - rad(0.7) * RATIO)
    rig.until(lambda: rig.first is not None, 0.1)
    assert rig.first.reaction is Reaction.TORQUE_OFF


def test_b3_a_short_excess_is_no_alarm():
    """10 ms of it are: nine readings above the band are not, eleven are."""
    for scans, stops in ((9, False), (11, True)):
        rig = moving_rig()
        law = rig.axis._law
        rig.axis._law = shifted(law, rad(0.11))
        rig.run(scans * 0.001)
        rig.axis._law = law
        rig.run(0.05)
        assert ("CTL-03" in rig.codes) == stops


def test_b4_overspeed():
    rig = moving_rig(config=settings(monitors={"velocity_deviation_rad_s": 10.0}))  # else that is first
    rig.spoil = lambda drive: drive._replace(vel_act_rad_s=rad(6.65) * RATIO)
    expect(rig, "CTL-04", Reaction.QUICK_STOP, 0.021, "Speed 6.65 deg/s, limit 6.60 deg/s")


def test_b4_far_too_fast_is_torque_off():
    rig = moving_rig(config=settings(monitors={"velocity_deviation_rad_s": 10.0}))
    rig.spoil = lambda drive: drive._replace(vel_act_rad_s=-rad(7.3) * RATIO)
    expect(rig, "CTL-04", Reaction.TORQUE_OFF, 0.021)


def test_b5_moves_against_command():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(vel_act_rad_s=-drive.vel_act_rad_s)
    expect(rig, "CTL-05", Reaction.TORQUE_OFF, 0.021, "Speed -6.00 deg/s while 6.00 deg/s was commanded")


def test_b5_from_standstill_within_class_m0():
    rig = Rig()
    rig.power_up()
    start = rig.drive.pos_rad
    write = rig.drive.write
    rig.drive.write = lambda out: write(
        out._replace(vel_cmd_rad_s=-out.vel_cmd_rad_s)
    )  # the drive's sign is wrong
    rig.move(50.0)
    rig.until(lambda: rig.first is not None, 2.0)
    assert rig.first.reaction is Reaction.TORQUE_OFF
    assert abs(rig.drive.pos_rad - start) < rad(0.35)


def test_velocity_deviation_for_a_moment_is_nothing():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(vel_act_rad_s=drive.vel_act_rad_s + rad(0.55) * RATIO)
    rig.run(0.019)
    rig.spoil = None
    rig.run(0.1)
    assert not rig.codes


def test_b8_torque_saturated_while_the_error_grows():
    rig = moving_rig()
    lagging(rig, 0.0002)
    inner = rig.spoil
    rig.spoil = lambda drive: inner(drive)._replace(torque_limited=True)
    expect(rig, "CTL-07", Reaction.QUICK_STOP, 0.201, "Torque limit reached for 200 ms", "grew to 0.0")


def test_torque_limit_alone_is_no_fault():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(torque_limited=True)
    rig.run(1.0)
    assert not rig.codes


def test_overload_warns():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(overload=0.93)
    rig.run(0.1)
    assert rig.codes == ["THM-01"]
    assert "93 % of the drive's overload budget used" in rig.axis.alarms.active["THM-01"].text


# --- standing -------------------------------------------------------------------------------------


def test_standstill_lost():
    rig = Rig()
    rig.power_up()
    offset = {"deg": 0.0}

    def creeps(drive):
        offset["deg"] += 0.0005
        return drive._replace(pos_act_counts=drive.pos_act_counts + counts(offset["deg"]))

    rig.spoil = creeps
    rig.until(lambda: rig.first is not None, 0.5)
    assert rig.first.code == "CTL-13"
    assert "window 0.0200 deg" in rig.first.text
    assert rig.output.request is DriveRequest.QUICK_STOP


def test_in_position_after_dwell_and_done_with_it():
    rig = Rig()
    rig.power_up()
    rig.move(5.0)
    rig.until(lambda: rig.axis.virtual.at_rest)
    arrived = rig.scan
    assert rig.program.move.busy
    rig.until(lambda: rig.program.move.done)
    assert (rig.scan - arrived) * rig.period_s == pytest.approx(0.2, abs=0.0021)
    assert rig.axis.in_position


def test_b12_not_in_position_is_told():
    rig = Rig()
    rig.power_up()
    rig.move(5.0)
    rig.until(lambda: rig.axis.virtual.vel_ref_rad_s > 0.0)
    rig.axis._law = shifted(rig.axis._law, rad(0.008))
    rig.until(lambda: not rig.program.move.busy, 10.0)
    assert rig.program.move.error
    assert rig.program.move.error_id == "CTL-11"
    assert "Not in position 3.0 s after" in rig.axis.alarms.active["CTL-11"].text
    assert "error 0.0080 deg, window 0.0050 deg" in rig.axis.alarms.active["CTL-11"].text
    assert not rig.axis.in_position
    assert rig.axis.state is AxisState.STANDSTILL, "a warning: power stays on"


def shifted(law, error_rad):
    """The position law with a following error that stays."""

    def scan(pos, vel, c):
        vel_cmd, act, _ = law(pos, vel, c)
        return vel_cmd, act, error_rad

    return scan


# --- brake, drive, inputs -------------------------------------------------------------------------


def test_c5_brake_closes_in_motion_and_the_axis_feels_it():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(brake_open=False, torque_limited=True)
    expect(rig, "BRK-05", Reaction.QUICK_STOP, 0.0, "Brake feedback says closed at 6.00 deg/s")


def test_c6_brake_feedback_alone_waits_its_time():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(brake_open=False)
    rig.run(0.29)
    assert not rig.codes
    expect(rig, "BRK-05", Reaction.QUICK_STOP, 0.02)


def test_c6_brake_feedback_at_rest_is_a_warning_that_blocks():
    rig = Rig()
    rig.power_up()
    rig.spoil = lambda drive: drive._replace(brake_open=False)
    rig.run(0.31)
    assert rig.codes == ["BRK-06"]
    assert rig.axis.state is AxisState.STANDSTILL
    rig.move(5.0)
    assert "BRK-06 is active" in rig.refused()
    rig.run(0.1)
    assert rig.ref_deg == pytest.approx(0.0, abs=1e-6)


def test_d1_drive_fault():
    rig = moving_rig()
    rig.drive.error_code = 0x8611
    expect(rig, "DRV-01", Reaction.TORQUE_OFF, 0.001, "error 34321 (hexadecimal 8611)")
    assert rig.codes == ["DRV-01"]
    rig.run(0.5)
    rig.op(reset=True)
    rig.run(0.01)
    assert rig.drive.state is DriveState.SWITCH_ON_DISABLED, "Reset clears the drive's fault"
    assert rig.axis.state is AxisState.DISABLED
    assert rig.program.reset.done


def test_a_fault_that_stays_is_told():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(state=DriveState.FAULT, error_code=7)
    rig.run(2.0)
    rig.op(reset=True)
    assert rig.program.reset.busy
    rig.run(1.1)
    assert rig.program.reset.error
    assert "keeps its fault" in rig.refused()
    assert rig.codes[0] == "DRV-01"


def test_d2_drive_warning():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(warning=True)
    rig.run(0.1)
    assert rig.codes == ["DRV-02"]
    assert rig.axis.state is AxisState.DISCRETE_MOTION


@pytest.mark.parametrize("state", [state for state in DriveState if state not in (5, 7, 8)])
def test_d4_drive_leaves_enabled_unasked(state):
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(state=state)
    expect(rig, "DRV-04", Reaction.TORQUE_OFF, 0.0, "without being asked")


def test_g9_emergency_stop_in_every_phase():
    for seconds in (0.0, 0.002, 0.02, 0.09, 0.15, 0.4, 1.0):
        rig = Rig()
        rig.op(power=True)
        rig.run(seconds)
        rig.drive.inputs = DigitalInputs(estop_ok=False)
        rig.step()
        assert rig.first.code == "INT-03"
        assert rig.output.request is DriveRequest.DISABLE
        assert not rig.output.brake_open
        rig.drive.inputs = DigitalInputs()
        rig.run(1.0)
        assert rig.axis.state is AxisState.ERROR_STOP, "release of the button alone does nothing"
        assert rig.output.request is DriveRequest.DISABLE


def test_emergency_stop_still_pressed_cannot_be_reset():
    rig = moving_rig()
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.run(3.0)
    rig.op(reset=True)
    assert "still open" in rig.refused()
    assert rig.axis.state is AxisState.ERROR_STOP


def test_g14_mains_lost():
    rig = moving_rig()
    rig.drive.inputs = DigitalInputs(mains_ready=False)
    expect(rig, "PWR-01", Reaction.TORQUE_OFF, 0.0, "Mains no longer ready at")


def test_mains_off_while_switched_off_is_no_alarm():
    rig = Rig()
    rig.drive.inputs = DigitalInputs(mains_ready=False)
    rig.run(0.5)
    assert not rig.codes


@pytest.mark.parametrize(("side", "target_deg"), [("plus", 100.0), ("minus", -100.0)])
def test_g3_limit_switch(side, target_deg):
    rig = Rig()
    rig.power_up()
    rig.move(target_deg)
    rig.run(3.0)
    rig.drive.inputs = DigitalInputs(**{f"limit_{side}_ok": False})
    expect(rig, "LIM-03", Reaction.QUICK_STOP, 0.0, f"The {side} limit switch opened at")


def test_g4_both_limit_switches():
    rig = moving_rig()
    rig.drive.inputs = DigitalInputs(limit_minus_ok=False, limit_plus_ok=False)
    expect(rig, "LIM-04", Reaction.QUICK_STOP, 0.0)


def test_g2_over_travel():
    # A wide band of following error and a slow standstill monitor: they would be first.
    monitors = {"following_error_base_rad": 1.0, "standstill_time_s": 10.0}
    rig = Rig(at_deg=179.9, config=settings(monitors=monitors))
    rig.power_up()
    pushed = {"deg": 0.0}

    def push(drive):
        pushed["deg"] += 0.01
        return drive._replace(pos_act_counts=drive.pos_act_counts + counts(pushed["deg"]))

    rig.spoil = push
    rig.until(lambda: rig.first is not None, 0.1)
    assert rig.first.code == "LIM-02"
    assert "Angle 180.5" in rig.first.text
    assert "limit 180.50 deg" in rig.first.text


def test_b11_stop_point_of_the_measured_motion():
    """The actual axis runs ahead towards the end: stopped before it can pass over-travel."""
    monitors = {"following_error_base_rad": 10.0, "velocity_deviation_rad_s": 10.0}
    rig = moving_rig(at_deg=40.0, config=settings(monitors=monitors))
    pos = rad(178.0) * COUNTS_PER_DEG * 180.0 / math.pi
    rig.axis.feedback.counts = rig.axis.zero_counts + pos  # no jump: the reading was there before
    rig.spoil = lambda drive: drive._replace(pos_act_counts=rig.axis.zero_counts + pos)
    rig.until(lambda: rig.first is not None, 0.01)
    assert rig.first.code == "CTL-10"
    assert "would come to rest at 181.27 deg, limit 180.50 deg" in rig.first.text


# --- latch ----------------------------------------------------------------------------------------


def test_first_out_and_what_follows_is_folded():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(encoder=EncoderFlag.ALARM)
    rig.step()
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.run(0.5)
    assert rig.first.code == "ENC-05"
    folded = {alarm.code: alarm for alarm in rig.first.consequences}
    assert "(follows ENC-05)" in folded["INT-03"].text
    assert len(rig.axis.alarms.history) == len(rig.codes)


def test_a_stronger_reaction_follows_the_weaker():
    rig = moving_rig()
    rig.op(quick_stop=True)
    assert rig.output.request is DriveRequest.QUICK_STOP
    rig.run(0.1)
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.step()
    assert rig.output.request is DriveRequest.DISABLE
    assert rig.first.code == "INT-06", "what was first stays first"


def test_reset_never_shortens_a_stop():
    rig = moving_rig()
    rig.op(quick_stop=True)
    rig.op(quick_stop=False, reset=True)
    assert "still stopping" in rig.refused()
    assert rig.axis.power.phase is PowerPhase.QUICK_STOPPING


def test_nothing_moves_after_reset_without_a_new_command():
    rig = Rig()
    rig.power_up()
    rig.op(move=True, target_rad=rad(50.0), speed_rad_s=rad(6.0))
    rig.run(1.0)
    rig.op(quick_stop=True)
    rig.run(4.0)
    rig.op(quick_stop=False, reset=True)
    rig.op(reset=False, power=False)
    rig.op(power=True)
    rig.run(2.0)
    assert rig.axis.state is AxisState.STANDSTILL
    before = rig.ref_deg
    rig.run(1.0)
    assert rig.ref_deg == before, "move is still TRUE, but has no edge"
