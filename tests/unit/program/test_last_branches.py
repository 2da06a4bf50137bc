"""Ways of program, axis and blocks that hardly any machine takes: each once, with what must follow."""

import math
from dataclasses import replace

import pytest

from gantryctl.image import BufferMode, DigitalInputs, DriveRequest, DriveState, EncoderFlag, LinkFlag, Mode
from gantryctl.program import AxisState, Code, Reaction
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.command_checks import check_jerk, check_ramp, check_target
from gantryctl.program.axis.motion_command import CommandStatus
from gantryctl.program.axis.permission import why_no_torque
from gantryctl.program.blocks import (
    MoveAbsolute,
    MoveVelocity,
    ReadAxisError,
    ReadAxisInfo,
    SetOverride,
    Stop,
    TouchProbe,
)
from gantryctl.program.monitors.monitors import Monitors
from gantryctl.program.monitors.site import SiteInterlocks
from gantryctl.program.settings import StandstillPolicy, TravelSettings
from gantryctl.units import deg, rad
from unit.program.block_bench import Bench, call, standing
from unit.program.parts import BOTH, PERIODS, Parts
from unit.program.power_steps import P, slip
from unit.program.rig import RATIO, Rig, moving_rig, powered, press, settings

approx = pytest.approx
PARKS = {"standstill": StandstillPolicy.BRAKE, "hold_brake_after_s": 0.3}


@pytest.fixture
def parked():
    rig = Rig(config=settings(**PARKS))
    rig.power_up()
    rig.until(lambda: rig.axis.power.phase is P.PARKED, 5.0)
    return rig


# --- axis -------------------------------------------------------------------------------------------------------------


def test_a_new_axis_stands_at_no_time_and_commands_nothing():
    axis = Rig().axis
    assert (axis.scan, axis.time_s, axis.vel_cmd_rad_s, axis.pos_err_rad) == (-1, 0.0, 0.0, 0.0)
    assert (axis.state, axis.refusal, axis.refusal_count) == (AxisState.DISABLED, None, 0)
    assert axis.calibration_memory == {}
    assert axis.torque_weights == ()


@pytest.mark.parametrize("phase", [P.CLOSING, P.UNLOADING, P.DISABLING])
def test_power_is_not_asked_for_while_the_axis_goes_off(phase):
    rig = powered()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is phase)
    refused = rig.axis.power_on()
    assert refused is not None
    assert refused.code is Code.PWR_04
    rig.run(1.0)
    assert rig.axis.is_off


def test_power_that_is_switched_off_at_standstill_shows_no_stopping():
    rig = powered()
    rig.op(power=False)
    states = set()
    while not rig.axis.is_off:
        states.add(rig.axis.state)
        rig.step()
    assert AxisState.STOPPING not in states


@pytest.mark.parametrize(
    ("acc_deg_s2", "refused"), [(4.0, False), (2.0, False), (4.01, True), (0.0, True), (math.nan, True)]
)
def test_an_acceleration_is_at_most_the_machines_and_the_ramp_down_goes_with_it(acc_deg_s2, refused):
    rig = Rig(config=settings(acc=4.0, dec=2.0))
    rig.power_up()
    assert (rig.axis.set_acceleration(rad(acc_deg_s2)) is not None) is refused
    if not refused:
        assert deg(rig.axis.virtual.ramps.dec_rad_s2) == approx(0.5 * acc_deg_s2)
    rig.move(50.0)
    rig.run(0.2)
    assert rig.axis.set_acceleration(rad(1.0)) is not None, "at standstill only"


def test_the_ramps_of_the_machine_are_ramps_of_a_motion():
    assert check_ramp(Words.NAME_ACCELERATION, 1.0, 1.0) is None
    assert check_ramp(Words.NAME_ACCELERATION, 1.0001, 1.0) is not None
    assert check_jerk(1.0, 1.0) is None
    assert check_jerk(1.0001, 1.0) is not None
    assert check_jerk(math.inf, math.inf) is None
    for wrong in (0.0, -1.0, math.nan):
        assert check_jerk(wrong, math.inf) is not None
        assert check_ramp(Words.NAME_ACCELERATION, wrong, 1.0) is not None


def test_no_torque_stays_on_a_reading_in_doubt_whatever_the_next_alarm_asks_for():
    rig = moving_rig()
    rig.axis.feedback.in_doubt = True
    rig.op(quick_stop=True)
    assert rig.axis.power.phase is P.TORQUE_OFF
    assert rig.output.request is DriveRequest.DISABLE


def test_an_alarm_that_ends_motions_leaves_a_quick_stop_as_it_is():
    rig = moving_rig()
    rig.op(quick_stop=True)
    rig.run(0.1)
    rig.axis.alarms.raise_(Code.INT_07, measured="a test")
    rig.run(0.1)
    assert rig.axis.power.phase is P.QUICK_STOPPING


def test_an_axis_that_moves_is_not_told_as_at_rest():
    rig = moving_rig()
    assert not rig.output.at_rest
    assert not rig.output.in_position
    assert rig.output.lamp
    rig.op(halt=True)
    rig.run(3.0)
    assert rig.output.at_rest
    rig.spoil = lambda drive: drive._replace(vel_act_rad_s=rad(0.021) * RATIO)
    rig.step()
    assert not rig.output.at_rest, "the shaft turns"


def test_an_angle_that_is_not_known_is_not_told():
    rig = moving_rig()
    rig.axis.feedback.in_doubt = True
    rig.drive.inputs = DigitalInputs(mains_ready=False)
    rig.step()
    assert Words.AT_UNKNOWN in rig.axis.alarms.active[Code.PWR_01].values.values()


def test_paused_is_a_motion_that_override_0_holds_back_under_way_or_before_the_brake(parked):
    assert not parked.axis.paused
    parked.op(override=0.0)
    assert not parked.axis.paused, "nothing is under way"
    parked.move(5.0)
    assert parked.axis.paused
    parked.op(override=1.0)
    assert not parked.axis.paused
    parked.until(lambda: abs(parked.vel_deg_s) > 1.0, 5.0)
    parked.op(override=0.0)
    parked.run(2.0)
    assert parked.axis.paused
    assert parked.vel_deg_s == 0.0


# --- commands ---------------------------------------------------------------------------------------------------------


def test_a_key_that_is_released_before_the_brake_is_open_moves_nothing(parked):
    parked.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(6.0))
    press(parked, forward=True)
    assert parked.axis.motion.waiting is not None
    parked.run(0.05)
    press(parked, forward=False)
    assert parked.axis.motion.waiting is None
    parked.run(2.0)
    assert parked.ref_deg == approx(0.0, abs=1e-4)


def test_a_second_stop_takes_over_the_first():
    rig = standing()
    first, second = Stop(rig.axis), Stop(rig.axis)
    call(rig, first, execute=True)
    held = rig.axis.motion.stop_command
    call(rig, second, execute=True)
    assert held is not None
    assert held.status is CommandStatus.ABORTED
    assert rig.axis.motion.stop_command is second.command or second.done
    call(rig, first, execute=False)
    rig.run(0.1)
    assert rig.axis.state is AxisState.STOPPING, "the second one holds it"
    call(rig, second, execute=False)
    rig.run(0.1)
    assert rig.axis.state is AxisState.STANDSTILL


def test_an_end_of_motions_at_standstill_ends_nothing():
    rig = powered()
    rig.axis.stop_by(Code.INT_05, measured=2.0, limit=1.0)
    rig.step()
    assert rig.axis.state is AxisState.STANDSTILL
    assert rig.axis.motion.current is None


def test_a_paused_motion_that_is_ended_is_over_at_once():
    rig = moving_rig()
    rig.op(override=0.0)
    rig.run(3.0)
    rig.axis.stop_by(Code.INT_05, measured=2.0, limit=1.0)
    assert rig.axis.motion.current is None
    assert rig.program.move.command is None or not rig.program.move.command.alive
    rig.op(override=1.0)
    at_deg = rig.ref_deg
    rig.run(1.0)
    assert rig.ref_deg == at_deg


def test_what_waits_behind_a_motion_that_cannot_begin_is_dropped_with_it(parked):
    """The permit is taken away between the command and the open brake."""
    motion = parked.axis.motion
    first = motion.move_absolute(rad(5.0), rad(6.0))
    second = motion.move_absolute(rad(8.0), rad(6.0), buffer_mode=BufferMode.BUFFERED)
    assert motion.waiting is first
    assert motion.buffered is second
    parked.axis.interlocks.permitted = False
    parked.until(lambda: not first.alive, 3.0)
    assert first.status is CommandStatus.ERROR
    assert second.status is CommandStatus.ABORTED
    parked.run(1.0)
    assert parked.ref_deg == approx(0.0, abs=1e-4)


@BOTH
def test_a_motion_that_cannot_stop_before_the_end_of_travel_is_refused(way):
    """At 6 deg/s, 10 deg before the end, a ramp of 0.5 deg/s2 takes 36 deg."""
    rig = Rig(Bench, at_deg=way * 150.0)
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL, 5.0)
    move = MoveAbsolute(rig.axis)
    call(rig, move, execute=True, position_rad=rad(way * 179.0), velocity_rad_s=rad(6.0))
    rig.until(lambda: way * rig.ref_deg > 170.0, 5.0)
    gentle = MoveAbsolute(rig.axis)
    call(
        rig, gentle, execute=True, position_rad=rad(way * 175.0), velocity_rad_s=rad(6.0),
        deceleration_rad_s2=rad(0.5),
    )  # fmt: skip
    assert gentle.error_id == "CTL-17"
    rig.until(lambda: move.done, 5.0)
    assert rig.pos_deg == approx(way * 179.0, abs=1e-3)


@BOTH
def test_a_stop_that_would_leave_the_travel_is_the_ramp_that_is_under_way(way):
    """From 6 deg/s the motion stops with 5.4 deg/s2 in 3.33 deg, Stop with 5 in 3.75."""
    rig = Rig(at_deg=way * 160.0, config=settings(dec=5.4))
    rig.power_up()
    rig.move(way * 180.0)
    rig.until(lambda: way * rig.ref_deg > 176.6, 6.0)
    rig.op(stop=True)
    rig.run(3.0)
    assert rig.codes == []
    assert rig.ref_deg == approx(way * 180.0, abs=1e-6)
    assert rig.axis.state is AxisState.STOPPING


def test_an_override_that_would_leave_the_travel_stays_what_it_was():
    rig = moving_rig()
    virtual = rig.axis.virtual
    virtual._travel = TravelSettings(rad(-1.0), rad(1.0), rad(-2.0), rad(2.0))
    virtual.pos_ref_rad = rad(0.5)
    refused = rig.axis.set_override(0.5)
    assert refused is not None
    assert virtual.override == 1.0


def test_an_override_that_is_no_number_is_refused_once_and_the_next_one_is_taken():
    rig = Rig()
    override = SetOverride(rig.axis)
    for _ in range(2):
        override(override=math.nan)
    assert rig.axis.refusal_count == 1
    override(override=0.5)
    assert rig.axis.virtual.override == 0.5
    assert not override.error
    override(enable=False, override=1.0)
    assert rig.axis.virtual.override == 0.5


def test_the_speed_is_reached_from_the_scan_on_in_which_it_is():
    rig = standing()
    block = MoveVelocity(rig.axis)
    call(rig, block, execute=True, velocity_rad_s=rad(-2.0))
    for _ in range(1000):
        rig.step()
        assert block.in_velocity is (abs(rig.vel_deg_s) >= 2.0 * (1.0 - 1e-9))
    assert block.in_velocity
    assert block.attention, "it may lose its speed at any time"


def test_a_way_round_that_meets_another_sector_is_none():
    """From 340 to 20 deg there is a sector both ways."""
    sectors = ((rad(350.0), rad(370.0)), (rad(170.0), rad(190.0)))
    travel = TravelSettings(-math.inf, math.inf, -math.inf, math.inf, 0.0, no_go_rad=sectors)
    refused = check_target(rad(340.0), rad(380.0), travel)
    assert refused is not None
    assert refused.text.endswith("there is no way round")


def test_torque_is_refused_with_an_open_chain_before_an_alarm_says_so():
    parts = Parts()
    parts.feedback.state = DriveState.SWITCH_ON_DISABLED
    assert why_no_torque(parts.feedback, parts.alarms) is None
    parts.feedback.inputs = DigitalInputs(estop_ok_2=False)
    refused = why_no_torque(parts.feedback, parts.alarms)
    assert refused is not None
    assert "emergency" in refused.text


# --- power ------------------------------------------------------------------------------------------------------------


def test_power_takes_no_order_that_does_not_belong_to_its_phase():
    rig = powered()
    power = rig.axis.power
    for order in (power.switch_on, power.wake, power.begin_test, power.release_hold):
        order()
        assert power.phase is P.ON
    power.abort_test(Words.STOPPED)
    assert power.brake_test.count == 0
    rig.op(power=False)
    rig.until(lambda: power.phase is P.UNLOADING)
    for order in (power.switch_off, power.park, power.switch_on):
        order()
        assert power.phase is P.UNLOADING
    slip(rig, 0.021)
    rig.step()
    power.switch_off()
    assert power.phase is P.TORQUE_HOLD


def test_a_drive_that_does_not_give_the_torque_back_is_told_and_the_brake_is_all_there_is():
    """2 s to be enabled."""
    rig = Rig(config=settings(holding_torque_nm=12.0))
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.is_off)
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCH_ON_DISABLED)
    slip(rig, 0.021)
    rig.run(0.01)
    assert rig.axis.power.phase is P.TORQUE_HOLD
    start = rig.scan
    rig.until(lambda: rig.axis.power.phase is not P.TORQUE_HOLD, 3.0)
    assert (rig.scan - start) * rig.period_s == approx(2.0, abs=0.02)
    assert "DRV-03" in rig.codes
    assert rig.output.request is DriveRequest.DISABLE
    assert rig.output.torque_ff_nm == 0.0


def test_a_drive_that_leaves_hold_is_not_asked_again():
    rig = Rig(config=settings(holding_torque_nm=12.0))
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.UNLOADING)
    slip(rig, 0.021)
    rig.run(0.05)
    assert rig.axis.power.phase is P.TORQUE_HOLD
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCH_ON_DISABLED)
    rig.run(0.01)
    assert "DRV-04" in rig.codes
    assert rig.axis.power.phase in (P.TORQUE_OFF, P.OFF)
    assert rig.output.request is DriveRequest.DISABLE


def test_a_stop_by_the_brake_ends_without_its_contact_when_the_axis_rests_and_the_time_is_over():
    """150 ms to close and 300 ms for the contact; until then nobody says that it is shut."""
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(brake_open=True)
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    start = rig.scan
    rig.until(lambda: rig.axis.is_off, 2.0)
    assert (rig.scan - start) * rig.period_s == approx(0.450, abs=0.005)
    rig.run(0.5)
    assert "BRK-06" in rig.codes


@BOTH
def test_a_load_that_the_brake_does_not_stop_is_told_with_a_speed_without_a_sign(way):
    rig = moving_rig(at_deg=0.0 if way > 0.0 else 60.0)
    assert math.copysign(1.0, rig.vel_deg_s) == way
    speed = rig.drive.vel_rad_s

    def slides(drive):
        rig.drive.pos_motor_rad += speed * rig.period_s
        return drive._replace(vel_act_rad_s=speed)

    rig.spoil = slides
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.run(3.1)
    assert rig.axis.alarms.active[Code.BRK_11].values["measured"] == approx(6.0, abs=0.01)


@pytest.mark.parametrize("known", [True, False])
def test_a_brake_without_a_contact_is_not_told_as_open(known):
    rig = Rig()
    rig.spoil = lambda drive: drive._replace(brake_open=True, brake_contact=known)
    rig.run(0.6)
    assert rig.codes == (["BRK-06"] if known else [])


# --- monitors ---------------------------------------------------------------------------------------------------------


def test_a_brake_contact_that_opens_again_counts_anew():
    rig = moving_rig()
    for _ in range(3):
        rig.spoil = lambda drive: drive._replace(brake_open=False)
        rig.run(0.25)
        rig.spoil = None
        rig.run(0.01)
    assert rig.codes == []


@BOTH
@pytest.mark.parametrize("sides", [(True, False), (False, True), (True, True)])
def test_a_sector_trips_a_margin_before_it_and_the_end_of_travel_where_it_is(way, sides):
    """Sectors at +-60 deg with 0.03 deg of margin; 180.5 deg is the end."""
    parts = Parts()
    below, above = ((rad(-120.0), rad(-60.0)), (rad(60.0), rad(120.0)))
    sectors = tuple(sector for sector, there in zip((below, above), sides, strict=True) if there)
    travel = replace(parts.settings.travel, no_go_rad=sectors, no_go_margin_rad=rad(0.03))
    config = replace(parts.settings, travel=travel)
    there = sides[1] if way > 0.0 else sides[0]
    edge = 59.97 if there else 180.5
    for off, trips in ((-0.005, False), (0.005, True)):
        parts.alarms.clear()
        monitors = Monitors(config, parts.feedback, parts.virtual, parts.holding, parts.alarms)
        monitors.open_the_way_back(0.0)
        parts.virtual.at_rest = False
        monitors.scan(rad(way * (edge + off)), 0.0, 0.0)
        assert parts.codes == ((["LIM-06"] if there else ["LIM-02"]) if trips else [])


def test_a_following_error_on_a_count_that_stands_is_a_frozen_encoder():
    parts = Parts()
    monitors = Monitors(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)
    parts.virtual.at_rest = False
    parts.feedback.unchanged_scans = 5
    parts.after(lambda: monitors.scan(0.0, rad(0.2), 0.0), most_s=0.02)
    assert parts.codes[-1] == "ENC-02"
    assert "CTL-03" not in parts.codes


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_torque_against_the_motion_is_asked_about_at_rest_only(way):
    """In motion the resonance of the load may turn the shaft against it."""
    parts = {"velocity_deviation_rad_s": math.inf, "following_error_base_rad": math.inf}
    rig = moving_rig(at_deg=0.0 if way > 0.0 else 60.0, speed_deg_s=3.0, config=settings(monitors=parts))
    sign = math.copysign(1.0, rig.vel_deg_s)
    more = 0.0

    def swings(drive):
        nonlocal more
        more += 0.01
        return drive._replace(
            vel_act_rad_s=drive.vel_act_rad_s + sign * rad(min(more, 0.3)) * RATIO,
            torque_act_nm=-sign * 340.0,
        )

    rig.spoil = swings
    rig.run(0.1)
    assert "ENC-12" not in rig.codes


def test_a_fault_code_that_is_withdrawn_adds_nothing_to_the_alarm_that_it_made():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(state=DriveState.FAULT, error_code=0x8250)
    rig.step()
    assert rig.codes[0] == "CAN-05"
    rig.spoil = lambda drive: drive._replace(state=DriveState.FAULT, error_code=0)
    rig.run(0.01)
    assert "DRV-01" not in rig.codes


def test_a_parameter_that_has_changed_is_told():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(changed="6065 is 5, was 6")
    rig.step()
    assert "DRV-09" in rig.codes
    assert "6065 is 5, was 6" in rig.axis.alarms.active[Code.DRV_09].text


@pytest.mark.parametrize("name", ["collision_ok", "door_ok", "motion_permit"])
@PERIODS
@pytest.mark.parametrize(("lasts_s", "loose"), [(59.0, True), (61.0, False)])
def test_six_openings_within_a_minute_are_a_loose_wire_at_any_time_of_the_day(name, period_s, lasts_s, loose):
    parts = Parts(period_s)
    site = SiteInterlocks(parts.settings, parts.feedback, parts.alarms)
    for opening in range(6):
        parts.alarms.time_s = 5000.0 + opening * lasts_s / 5.0
        for closed in (True, False):
            parts.feedback.inputs = DigitalInputs(**{name: closed})
            site.scan(0.0, powered=False, moving=False)
    assert parts.codes == (["INT-02"] if loose else [])
    assert parts.alarms.horn is False


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


# --- keys and blocks --------------------------------------------------------------------------------------------------


def test_a_remote_key_that_was_let_go_is_not_stopped_once_more_by_the_switch():
    rig = powered()
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(6.0), remote=True)
    press(rig, forward=True)
    rig.hold_key(1.5)
    press(rig, forward=False)
    rig.drive.inputs = DigitalInputs(enabling_switch=False)
    rig.run(2.0)
    # Nor by its lease, which runs out on the ramp.
    assert not {"INT-05", "CTL-15"} & {str(alarm.code) for alarm in rig.axis.alarms.history}
    assert rig.vel_deg_s == 0.0


def test_both_keys_at_once_are_no_increment():
    rig = powered()
    rig.op(mode=Mode.INCREMENTAL, speed_rad_s=rad(6.0), increment_rad=rad(1.0))
    rig.op(forward=True, reverse=True)
    assert "both" in rig.refused()
    rig.run(0.5)
    assert rig.ref_deg == approx(0.0, abs=1e-6)


def test_a_probe_shows_its_end_while_execute_is_true_and_takes_no_angle_in_doubt():
    rig = standing()
    probe = TouchProbe(rig.axis)
    call(rig, probe, execute=True, trigger=False)
    rig.axis.feedback.in_doubt = True
    probe(execute=True, trigger=True)
    assert probe.busy, "the angle is not known"
    rig.axis.feedback.in_doubt = False
    probe(execute=True, trigger=False)
    probe(execute=True, trigger=True)
    assert probe.done
    probe(execute=False, trigger=False)
    assert not probe.done


def test_a_reader_that_is_not_enabled_keeps_what_it_has_read():
    rig = moving_rig()
    rig.axis.alarms.raise_(Code.CTL_02, Reaction.TORQUE_OFF, measured="a test")
    error, info = ReadAxisError(rig.axis), ReadAxisInfo(rig.axis)
    info(enable=True)
    error(enable=True)
    assert error.axis_error_id == "CTL-02"
    assert info.power_on
    rig.axis.alarms.clear()
    for block in (error, info):
        block(enable=False)
        assert not block.valid
    assert error.axis_error_id == "CTL-02"


@pytest.mark.parametrize("flag", [LinkFlag.NONE, LinkFlag.LATE])
def test_a_connection_without_a_fault_raises_nothing(flag):
    rig = moving_rig(speed_deg_s=0.6)
    rig.spoil = lambda drive: drive._replace(link=flag)
    rig.run(0.1)
    assert rig.codes == []


@pytest.mark.parametrize("key", ["forward", "reverse"])
def test_a_key_that_is_pressed_in_a_mode_that_was_refused_is_refused(key):
    rig = powered()
    rig.op(mode=Mode.INCREMENTAL, speed_rad_s=rad(6.0), increment_rad=rad(1.0))
    rig.op(**{key: True})
    rig.op(mode=Mode.CONTINUOUS)
    rig.op(**{key: False})
    rig.run(3.0)
    at_deg, refusals = rig.ref_deg, rig.axis.refusal_count
    assert abs(at_deg) == approx(1.0, abs=1e-5)
    press(rig, **{key: True})
    assert rig.axis.refusal_count == refusals + 1
    rig.hold_key(0.5)
    assert rig.ref_deg == at_deg


def test_no_motion_is_taken_while_power_goes_off():
    rig = moving_rig()
    rig.op(power=False)
    rig.move(10.0)
    assert rig.refused()
    rig.run(4.0)
    assert rig.axis.is_off
