"""A reading in doubt on the plant: torque off and brake in every phase, within the angle; what is told is true.

Limits are those of feedback faults, true angle of the motor from the onset of the fault to rest.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

import pytest

from gantryctl.engineering.faults.oracle.taps import Oracle
from gantryctl.image import DriveFeedback, DriveRequest, LinkFlag
from gantryctl.program import Code, PowerPhase
from gantryctl.program.alarms.words import Words
from gantryctl.units import deg, rad
from plant.plant_rig import (
    AT_EVERY_SCAN_MS,
    CHECK_NM,
    FEEDBACK_LIMIT_DEG,
    NOMINAL_NM,
    PlantRig,
    at_scans,
    machine_at,
)

SPEEDS = (6.0, 3.0, 1.0)


def assert_told_as_doubt(rig: PlantRig, way_deg: float, limit_deg: float) -> None:
    """Torque off and brake, position not valid, no angle told, only service resets."""
    feedback = rig.axis.feedback
    assert way_deg <= limit_deg, rig.texts
    assert feedback.in_doubt
    assert not feedback.position_valid
    assert rig.axis.power.request is DriveRequest.DISABLE
    assert not rig.axis.power.brake_open
    assert rig.first_alarm is not None
    assert "axis moved" not in rig.first_alarm.text
    assert "at rest after" not in rig.first_alarm.text
    assert Words.ANGLE_UNKNOWN in rig.first_alarm.steps
    rig.say(power=False, reset=True)
    rig.say(reset=False)
    rig.run(0.1)
    assert feedback.in_doubt, "an operator may not accept the position"
    assert rig.first_alarm is not None


def readings_late(
    rig: PlantRig, late_s: float, oldest: int = 1000
) -> Callable[[DriveFeedback], DriveFeedback]:
    """State, position and torque come late from now on, behind a gap of as long; the speed is of this scan.

    In the gap the driver goes on with the position by the speed, and with the last torque, `oldest` scans old at most.
    """
    gap = late_s / rig.period_s - 1e-9
    last = rig.drive.read()
    sent: deque[DriveFeedback] = deque()
    counts = float(last.pos_act_counts)

    def late(drive: DriveFeedback) -> DriveFeedback:
        nonlocal counts
        sent.append(drive)
        if len(sent) - 1 > gap:
            came = sent.popleft()
            return drive._replace(
                state=came.state, pos_act_counts=came.pos_act_counts, torque_act_nm=came.torque_act_nm
            )
        counts += drive.vel_act_rad_s * rig.period_s * rig.axis.settings.law.counts_per_turn / math.tau
        return drive._replace(
            state=last.state, pos_act_counts=round(counts), torque_act_nm=last.torque_act_nm,
            age_scans=min(len(sent), oldest), link=LinkFlag.LATE,
        )  # fmt: skip

    return late


def cruise_slowly(rig: PlantRig, speed: float, direction: float) -> None:
    """Be in the middle of a long move, also below the least speed setting: by the override."""
    rig.cruise(max(speed, 0.6), direction)
    if speed < 0.6:
        rig.say(override=speed / 0.6)
        rig.run(2.0)


@at_scans(10.0, gain=[0.0, -1.0], speed=SPEEDS, direction=[1.0, -1.0])
def test_encoder_of_the_drive_fails_in_motion(
    gain: float, scan_ms: float, speed: float, direction: float
) -> None:
    rig = PlantRig(machine_at(scan_ms), -90.0 * direction)
    rig.cruise(speed, direction)
    rig.sim.encoder_gain = gain
    assert_told_as_doubt(rig, rig.way_to_rest(), FEEDBACK_LIMIT_DEG[speed])


@pytest.mark.parametrize(("speed", "direction"), [(3.0, 1.0), (0.6, -1.0), (0.2, 1.0)])
@pytest.mark.parametrize("old_torque", [True, False], ids=["torque is old", "torque is new"])
@pytest.mark.parametrize("who", ["encoder", "drive"])
def test_who_is_wrong_about_the_direction(who: str, old_torque: bool, direction: float, speed: float) -> None:
    """Encoder or drive turn round. The torque tells which; where its telegram is missing, nobody knows the angle."""
    rig = PlantRig(machine_at(4.0), -90.0 * direction)
    cruise_slowly(rig, speed, direction)
    if old_torque:
        rig.spoil = readings_late(rig, math.inf, oldest=6)
    if who == "encoder":
        rig.sim.encoder_gain = -1.0
    else:
        rig.inject("drive", "sign")
    assert rig.way_to_rest() <= FEEDBACK_LIMIT_DEG[max(speed, 1.0)]
    assert rig.axis.feedback.in_doubt is (old_torque or who == "encoder"), rig.texts


@pytest.mark.parametrize(
    ("scan_ms", "speed", "direction", "gap_ms"),
    [(1.0, 0.15, 1.0, 10.0), (1.0, 0.3, 1.0, 12.0), (4.0, 0.2, -1.0, 4.0), (10.0, 0.6, 1.0, 20.0)],
)
def test_a_stop_for_another_cause_forgives_no_wrong_sign(
    scan_ms: float, speed: float, direction: float, gap_ms: float
) -> None:
    """Late readings stop the axis some scans after its sign has turned: its speed is off its command already.

    Judged from its own speed a runaway keeps its ramp: 0.6 to 0.7 deg from 0.15 to 0.3 deg/s.
    """
    rig = PlantRig(machine_at(scan_ms, CHECK_NM), 60.0 * direction)
    cruise_slowly(rig, speed, direction)
    rig.spoil = readings_late(rig, 0.040)
    rig.run(gap_ms * 1e-3)
    rig.sim.encoder_gain = -1.0
    # What a fault of the feedback at standstill may take.
    assert rig.way_to_rest() <= 0.35
    assert rig.first == Code.CAN_03
    assert not rig.axis.feedback.position_valid, rig.texts


@at_scans(10.0, share=[0.0, 0.25, 0.5], speed=SPEEDS)
def test_encoder_freezes_in_a_quick_stop(scan_ms: float, speed: float, share: float) -> None:
    rig = PlantRig(machine_at(scan_ms, CHECK_NM), 60.0)
    rig.cruise(speed)
    rig.say(quick_stop=True)
    rig.run(0.004 + share * speed / 5.5)
    rig.sim.encoder_gain = 0.0
    way = rig.way_to_rest()
    assert_told_as_doubt(rig, way, FEEDBACK_LIMIT_DEG[speed])
    assert rig.first_alarm is not None
    assert rig.first_alarm.code is Code.INT_06
    assert {alarm.code for alarm in rig.first_alarm.consequences} & {Code.ENC_02, Code.ENC_14}


# Until it is seen, a reading that stands drives the speed command by the error that seems to grow.
@AT_EVERY_SCAN_MS
@pytest.mark.parametrize(("speed", "share"), [(1.0, 1.0), (1.0, 1.2), (3.0, 0.9)])
def test_a_sign_that_turns_at_the_end_of_a_quick_stop(speed: float, share: float, scan_ms: float) -> None:
    """The drive's own loop runs away with all of its torque, which the reading shows the other way round.

    DRV-07 alone would call the angle valid, 0.37 deg off (matrix, row A20).
    """
    rig = PlantRig(machine_at(scan_ms), 15.0)
    rig.cruise(speed)
    rig.say(quick_stop=True)
    rig.run(0.06 + share * speed / 5.4)
    rig.sim.encoder_gain = -1.0
    # What a fault of the feedback at standstill may take.
    assert rig.way_to_rest() <= 0.35
    assert not rig.axis.feedback.position_valid, rig.texts


@pytest.mark.parametrize(
    ("scan_ms", "speed", "torque"), [(4.0, 1.0, 0.1), (4.0, 6.0, 0.1), (10.0, 3.0, 0.02)]
)
def test_a_quick_stop_with_little_torque_is_no_wrong_sign(
    scan_ms: float, speed: float, torque: float
) -> None:
    """The load swings the shaft against what is left; the gear untwists, 0.36 deg/s in 10 ms with 8 N m (ENC-14)."""
    rig = PlantRig(machine_at(scan_ms, CHECK_NM), -60.0)
    rig.cruise(speed)
    rig.say(quick_stop=True)
    rig.run(0.3 * speed / 5.4)
    rig.inject("drive", "torque_limit", share=torque)
    rig.run(3.0)
    assert rig.first_alarm is not None
    assert Code.DRV_07 in {alarm.code for alarm in rig.first_alarm.consequences}
    assert rig.axis.feedback.position_valid, rig.texts


@pytest.mark.parametrize("gain", [0.0, 0.5, -1.0])
def test_an_encoder_that_is_spoilt_while_the_gear_untwists_is_told(gain: float) -> None:
    """20 ms after the torque has fallen; the drive answers the change by torque, whatever is left of it."""
    rig = PlantRig(machine_at(10.0), -60.0)
    rig.cruise(6.0)
    rig.say(quick_stop=True)
    rig.run(0.1)
    rig.inject("drive", "torque_limit", share=0.02)
    rig.run(0.02)
    assert not rig.axis.feedback.in_doubt
    rig.inject("encoder", "gain", value=gain)
    rig.run(0.03)
    assert rig.axis.feedback.in_doubt


@pytest.mark.parametrize("speed", SPEEDS)
@AT_EVERY_SCAN_MS
@pytest.mark.parametrize("speed_too", [False, True], ids=["position", "position and speed"])
def test_only_the_reading_freezes(speed_too: bool, scan_ms: float, speed: float) -> None:
    """The drive's own loop goes on with a sound encoder: the axis stops, and nobody knows where."""
    rig = PlantRig(machine_at(scan_ms), -60.0)
    rig.cruise(speed)
    held = rig.drive.read()
    rig.spoil = lambda drive: drive._replace(
        pos_act_counts=held.pos_act_counts, vel_act_rad_s=0.0 if speed_too else drive.vel_act_rad_s
    )
    assert_told_as_doubt(rig, rig.way_to_rest(), FEEDBACK_LIMIT_DEG[speed])


@at_scans(
    10.0, 20.0, own_loop=[False, True], jump_deg=[0.05, -0.05, 0.3147, -2.0], speed=[6.0, -6.0, 1.0, -1.0]
)
def test_a_jump_is_seen_with_and_against_the_motion(
    scan_ms: float, speed: float, jump_deg: float, own_loop: bool
) -> None:
    rig = PlantRig(machine_at(scan_ms), -90.0 * math.copysign(1.0, speed))
    rig.cruise(abs(speed), math.copysign(1.0, speed))
    ratio, counts = rig.axis.settings.law.ratio, rig.axis.settings.law.counts_per_turn
    if own_loop:
        rig.sim.jump_encoder(rad(jump_deg) * ratio)
    else:
        shift = round(jump_deg / 360.0 * ratio * counts)
        rig.spoil = lambda drive: drive._replace(pos_act_counts=drive.pos_act_counts + shift)
    before = rig.engine.scan
    rig.until(lambda: rig.first != "", 3 * rig.period_s)
    assert rig.engine.scan - before <= 2
    assert rig.first_alarm is not None
    assert rig.first_alarm.code in (Code.ENC_01, Code.ENC_14)
    assert rig.axis.feedback.in_doubt


@pytest.mark.parametrize("value", [1e300, -1e300, 1e9, math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("moving", [False, True])
def test_an_absurd_speed_is_torque_off_at_once(moving: bool, value: float) -> None:
    rig = PlantRig(machine_at(4.0), -90.0)
    if moving:
        rig.cruise(6.0)
    else:
        rig.power_up()
    rig.spoil = lambda drive: drive._replace(vel_act_rad_s=value)
    rig.step()
    assert rig.first_alarm is not None
    assert rig.first_alarm.code in (Code.CTL_02, Code.ENC_14)
    assert rig.axis.power.request is DriveRequest.DISABLE
    assert rig.axis.feedback.in_doubt
    rig.run(2.0)
    assert math.isfinite(rig.axis.feedback.vel_rad_s)
    assert rig.axis.power.phase is PowerPhase.OFF


@pytest.mark.parametrize("at_deg", [-70.0, 20.0])
@pytest.mark.parametrize("moment_nm", [NOMINAL_NM, CHECK_NM])
@AT_EVERY_SCAN_MS
@pytest.mark.parametrize(
    "stop",
    ["quick stop", "torque off", "brake in motion"],
)
def test_a_sound_encoder_is_never_doubted(stop: str, scan_ms: float, moment_nm: float, at_deg: float) -> None:
    """The hardest stops: up to 10 deg/s2 by the drive, 56 deg/s2 by the brake."""
    rig = PlantRig(machine_at(scan_ms, moment_nm), at_deg)
    rig.cruise(6.0)
    if stop == "quick stop":
        rig.say(quick_stop=True)
    elif stop == "torque off":
        rig.inject("input", "off", name="estop_ok")
    else:
        rig.inject("brake", "stuck", position="closed")
    rig.run(5.0)
    assert not rig.axis.feedback.in_doubt, rig.texts
    assert rig.axis.feedback.position_valid
    assert rig.first_alarm is not None
    assert "axis moved" in rig.first_alarm.text


@pytest.mark.parametrize("frozen", [True, False])
@AT_EVERY_SCAN_MS
def test_an_encoder_that_freezes_while_nothing_holds_a_slow_axis_is_told_as_the_brake_has_it(
    scan_ms: float, frozen: bool
) -> None:
    """At 0.2 deg/s friction might stop the shaft. The load drives it on here until the late brake has it: 0.03 deg."""
    slow = {"virtual_axis.acc_deg_s2": 0.4}
    rig = PlantRig(machine_at(scan_ms, CHECK_NM, **slow), -50.0)
    rig.power_up(0.5)
    rig.say(move=True, target_rad=rad(-20.0), speed_rad_s=rad(3.0))
    rig.until(lambda: rig.motor_deg_s > 0.17)
    rig.inject("input", "off", name="estop_ok")
    rig.inject("brake", "slow", late_s=0.045)
    rig.run(0.052)
    rig.inject("encoder", "gain", value=0.0 if frozen else 1.0)
    told_deg = deg(rig.axis.pos_act_rad)
    rig.until(lambda: rig.phase is PowerPhase.OFF)
    assert rig.axis.feedback.in_doubt is frozen, rig.texts
    assert (Code.ENC_02 in rig.axis.alarms.active) is frozen
    assert rig.first_alarm is not None
    assert (Words.ANGLE_UNKNOWN in rig.first_alarm.steps) is frozen
    if frozen:
        assert abs(rig.motor_deg - told_deg) > 0.03


@pytest.mark.parametrize("turns", [True, False])
@pytest.mark.parametrize(("scan_ms", "speed"), [(1.0, 0.3), (4.0, 0.4), (10.0, 1.0)])
def test_a_sign_that_turns_between_no_torque_and_no_brake_yet_is_seen(
    scan_ms: float, speed: float, turns: bool
) -> None:
    """110 ms before the brake: wrong by more than 0.05 deg, which only the next power-up would tell."""
    rig = PlantRig(machine_at(scan_ms, CHECK_NM), 60.0)
    cruise_slowly(rig, speed, 1.0)
    rig.inject("input", "off", name="mains_ready")
    rig.run(0.04)
    rig.inject("encoder", "gain", value=-1.0 if turns else 1.0)
    rig.until(lambda: rig.phase is PowerPhase.OFF)
    assert (Code.ENC_14 in rig.axis.alarms.active) is turns, rig.texts
    assert rig.axis.feedback.in_doubt is turns
    assert (abs(deg(rig.axis.pos_act_rad) - rig.motor_deg) > 0.05) is turns
    assert rig.first == Code.PWR_01


@pytest.mark.parametrize("frozen", [True, False])
@pytest.mark.parametrize("scan_ms", [4.0, 10.0])
@pytest.mark.parametrize("at_deg", [80.0, -80.0])
def test_an_encoder_that_froze_before_the_way_down_is_seen_as_the_torque_goes(
    at_deg: float, scan_ms: float, frozen: bool
) -> None:
    """34 N m go to a brake that gives way by 20 counts and more (182 sound ways down); before, nothing asked."""
    rig = PlantRig(machine_at(scan_ms, CHECK_NM), at_deg)
    rig.power_up()
    rig.inject("encoder", "gain", value=0.0 if frozen else 1.0)
    rig.run(0.05)
    rig.say(quick_stop=True)
    rig.run(2.0)
    assert rig.phase is PowerPhase.OFF
    assert rig.codes == (["INT-06", "ENC-02"] if frozen else ["INT-06"]), rig.texts
    assert rig.axis.feedback.in_doubt is frozen


@pytest.mark.parametrize("frozen", [True, False])
@AT_EVERY_SCAN_MS
@pytest.mark.parametrize("brake", ["open", "closed"])
def test_an_encoder_that_freezes_as_a_resting_axis_loses_its_torque_is_told(
    brake: str, scan_ms: float, frozen: bool
) -> None:
    """36 N m go by the emergency stop: an open brake lets the shaft run, a closed one gives way by 30 counts.

    Scenario 90176: the shaft still creeps in the scan of the freeze, and a late brake let it go on by 0.1 deg.
    """
    rig = PlantRig(machine_at(scan_ms, CHECK_NM), -80.0)
    rig.power_up()
    if brake == "closed":
        rig.say(quick_stop=True)
        rig.until(lambda: rig.phase is PowerPhase.UNLOADING)
    torque_nm = abs(rig.axis.feedback.torque_nm)
    assert torque_nm > 34.0
    rig.inject("input", "off", name="estop_ok")
    rig.inject("brake", "slow", late_s=0.12)
    rig.inject("encoder", "gain", value=0.0 if frozen else 1.0)
    rig.run(0.08)
    assert rig.axis.feedback.in_doubt is frozen, rig.texts
    assert (Code.ENC_02 in rig.axis.alarms.active) is frozen
    rig.run(3.0)
    assert rig.axis.feedback.in_doubt is frozen
    assert rig.first_alarm is not None
    assert (Words.ANGLE_UNKNOWN in rig.first_alarm.steps) is frozen
    if brake == "open":
        assert (abs(deg(rig.axis.pos_act_rad) - rig.motor_deg) > 0.02) is frozen


def test_a_load_that_sinks_is_told_while_the_speed_is_absurd(oracle: Oracle) -> None:
    """Brake without torque and a speed of 1e300 in one scan: after 1.5 s of a stop without a reading, and 0.02 deg."""
    rig = PlantRig(machine_at(10.0, CHECK_NM), 60.0)
    rig.power_up()
    rig.inject("brake", "torque", share=0.0)
    rig.spoil = lambda drive: drive._replace(vel_act_rad_s=1e300)
    rig.mark()
    rig.until(lambda: Code.BRK_04 in rig.axis.alarms.active, 3.0)
    assert rig.phase is PowerPhase.OFF
    told = rig.axis.alarms.active[Code.BRK_04]
    assert told.time_s - rig.axis.alarms.active[Code.ENC_14].time_s < 1.7
    # Nothing follows from an absurd speed but its own alarm.
    assert rig.codes == ["ENC-14", "BRK-04"]
    oracle.caught("INV-1")
    oracle.caught("INV-2")


def test_an_emergency_stop_with_a_doubtful_reading_tells_no_angle() -> None:
    rig = PlantRig(machine_at(1.0), -90.0)
    rig.cruise(3.0)
    rig.spoil = lambda drive: drive._replace(vel_act_rad_s=1e300)
    rig.step()
    rig.inject("input", "off", name="estop_ok")
    rig.step()
    assert rig.axis.alarms.active[Code.INT_03].values["measured"] is Words.AT_UNKNOWN
    assert "not known" in rig.axis.alarms.active[Code.INT_03].text


def test_before_the_first_reading_no_angle_is_set_and_none_is_asked() -> None:
    rig = PlantRig(machine_at(1.0))
    rig.axis.virtual.pos_ref_rad = math.nan
    assert rig.axis.stopping_angle_rad() == 0.0
    refused = rig.axis._reference.check(0.0, standing=True)
    assert refused is not None
    assert refused.code is Code.CTL_14
