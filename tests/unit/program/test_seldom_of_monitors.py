"""What comes seldom in the monitors, each in the state that a rare event leaves it in; figures by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from gantryctl.image import (
    DigitalInputs,
    DriveState,
)
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.monitors.drag import DragWatch
from gantryctl.program.monitors.interlocks import Interlocks
from gantryctl.program.monitors.liveness import Liveness
from gantryctl.program.monitors.monitors import Monitors
from gantryctl.program.monitors.oscillation import Oscillation
from gantryctl.program.monitors.recovery import Recovery
from gantryctl.program.monitors.running_fit import RunningFit
from gantryctl.program.monitors.site import SiteInterlocks
from gantryctl.program.monitors.thermal import MotorThermal
from gantryctl.program.monitors.torque import TorqueWatch
from gantryctl.program.monitors.torque_model import TorqueModel
from gantryctl.program.power.phases import PowerPhase
from gantryctl.program.power.ramp_watch import RampWatch
from gantryctl.units import deg, rad
from unit.program.parts import BOTH, Parts
from unit.program.rig import RATIO
from unit.program.test_parts_of_load_side import load_side
from unit.program.test_parts_of_reset import OFF, Stop, W, power

approx = pytest.approx


@pytest.mark.parametrize("code", [Code.BRK_06, Code.BRK_14])
def test_a_contact_that_was_wrong_shows_a_closed_brake_and_not_since_when(code):
    stop = Stop()
    stop.parts.alarms.active[code] = stop.alarm
    stop.scan(2, state=OFF, brake_open=False, deg_s=0.0)
    stop.scan(3, over=True)
    assert W.BRAKE_CLOSED_SEEN in stop.steps
    assert W.BRAKE_CLOSED_AFTER not in stop.steps


def test_torque_that_was_off_behind_a_state_that_nobody_knew_has_no_time():
    """The drive had torque, was not heard for a scan, and then shows that it has none."""
    stop = Stop()
    stop.parts.feedback._was_energised = True
    stop.scan(1, state=DriveState.UNKNOWN, deg_s=0.0)
    stop.scan(2, state=OFF, brake_open=False)
    stop.scan(3, over=True)
    assert W.TORQUE_OFF_SEEN in stop.steps
    assert W.TORQUE_OFF_AFTER not in stop.steps


@BOTH
def test_of_an_axis_that_was_off_and_turns_nothing_but_its_speed_is_told(way):
    """Neither torque nor brake had anything to do."""
    stop = Stop(before={"state": OFF, "brake_open": False}, phase=PowerPhase.OFF, brake_open=False)
    stop.scan(0)
    stop.scan(1, over=True, deg_s=way * 0.7)
    assert stop.steps == [W.STILL_TURNING, W.MOVED_TO]
    assert stop.value(W.STILL_TURNING, "speed") == approx(0.7)


def test_the_time_of_a_stop_counts_from_its_alarm():
    """A drive that has torque 0.5 s after a stop of the third second, and not three seconds before."""
    stop = Stop(at_scan=3000)
    before = stop.alarm.steps
    assert stop.scan(3499) is before
    assert stop.scan(3501) is not before
    assert stop.steps == [W.STOP_UNCONFIRMED]
    stop = Stop(at_scan=3000)
    stop.scan(3002, state=OFF)
    stop.scan(3040, brake_open=False)
    stop.scan(3400, deg_s=0.0)
    stop.scan(3500, over=True)
    times = [stop.value(words, "time_ms") for words in stop.steps[:3]]
    assert times == approx([2.0, 40.0, 400.0])


def test_the_record_of_a_stop_is_written_to_its_end_and_no_further():
    parts = Parts()
    stand_in = power(brake_open=False)
    recovery = Recovery(parts.settings, parts.feedback, stand_in, parts.alarms)
    parts.alarms.raise_(Code.CTL_02, Reaction.TORQUE_OFF, measured="a test")
    alarm = parts.alarms.first_out
    recovery.stop_begun(alarm)
    parts.feedback.state, parts.feedback.brake_open, stand_in.falling = OFF, False, False
    recovery.scan(1, rad(1.0))
    steps = alarm.steps
    assert W.MOVED_TO in [getattr(step, "words", step) for step in steps]
    recovery.scan(2, rad(5.0))
    assert alarm.steps is steps


def test_a_reading_that_came_to_stand_in_a_stop_of_the_first_scan_is_told():
    stop = Stop()
    stop.scan(0, state=OFF, counts=100)
    stop.scan(3, counts=101, deg_s=-2.5)
    stop.scan(4, deg_s=0.0)
    stop.scan(200, brake_open=False)
    stop.scan(300, over=True)
    assert Code.ENC_02 in stop.parts.alarms.active


@BOTH
@pytest.mark.parametrize(("scans", "codes"), [(499, []), (500, ["BRK-14"])])
def test_torque_of_both_ways_within_half_a_second_is_a_load_that_swings(scans, codes, way):
    parts = Parts()
    watch = TorqueWatch(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)
    parts.alarms.scan = 1000
    watch._effort(-way * 200.0, 0.0, way * rad(3.0))
    watch._pulled, watch._missing = True, 1.0
    parts.alarms.scan += scans
    watch._effort(way * 200.0, 0.0, way * rad(3.0))
    assert parts.codes == codes


@BOTH
def test_a_torque_that_jumps_as_the_count_begins_to_stand_is_one_jump(way):
    parts = Parts(monitors={"encoder_still_time_s": 0.5, "torque_still_max_nm": 15.0})
    watch = Liveness(parts.settings, parts.feedback, parts.holding, parts.alarms)
    for counts, torque_nm in ((100.0, 0.0), (101.0, 0.0), *[(101.0, way * 300.0)] * 50):
        parts.alarms.scan += 1
        parts.feedback.counts, parts.feedback.torque_nm = counts, torque_nm
        watch.stand(proven=True)
    assert watch.dithers == 0


@BOTH
@pytest.mark.parametrize(
    ("held_ms", "lives_on", "turns", "told"),
    [
        (250, True, False, []), (150, True, False, ["ENC-02"]), (250, False, False, ["ENC-02"]),
        (250, True, True, ["ENC-02"]),
    ],
)  # fmt: skip
def test_a_load_that_has_hung_on_a_torque_at_rest_may_hang_on_it_as_its_brake_closes(
    held_ms, lives_on, turns, told, way
):
    """56 N m that nobody has learned, 15 permitted: no wind where the reading froze, or what a ramp before has left."""
    parts = Parts(monitors={"encoder_still_time_s": 5.0, "torque_still_max_nm": 15.0})
    watch = Liveness(parts.settings, parts.feedback, parts.holding, parts.alarms)
    parts.feedback.torque_nm = way * 56.0
    for scan in range(held_ms + 40):
        parts.alarms.scan += 1
        if scan < held_ms:
            parts.feedback.counts = 100.0 + (scan // 10 % 2 if lives_on else 0.0)
            watch.stand(proven=True)
        else:
            parts.feedback.torque_nm = way * (75.0 if turns else 56.0)
            watch.stop()
    assert parts.codes == told


def test_a_drive_above_its_ramp_for_a_scan_has_left_it():
    parts = Parts()
    watch = RampWatch(parts.settings, parts.feedback)
    for deg_s, left in ((0.49, False), (0.51, True), (0.49, False)):
        parts.turn(deg_s)
        assert watch.obeyed(0.1)
        assert watch.left is left


def test_a_reading_that_never_turned_did_not_come_to_stand():
    """At rest from before the stop; the contact is 98 ms behind the torque."""
    stop = Stop(before={"brake_open": True, "vel_rad_s": 0.0, "counts": 100.0})
    for scan in range(101):
        stop.scan(
            scan, deg_s=0.0, state=OFF if scan > 1 else DriveState.OPERATION_ENABLED, brake_open=scan < 100
        )
    stop.scan(101, over=True)
    assert not stop.parts.feedback.in_doubt


def test_a_motor_that_the_model_knows_to_be_warm_is_not_cooled_by_its_sensor():
    """83 % by the torque so far; 60 C are 17 % of the rise of 115 K."""
    parts = Parts()
    thermal = MotorThermal(parts.settings, parts.feedback, parts.alarms)
    thermal._model, parts.feedback.motor_temp_c = 0.83, 60.0
    thermal.scan(0.0)
    assert thermal.share == approx(0.83)
    assert parts.codes == ["THM-01"]


def test_a_ring_that_is_no_number_adds_no_turn():
    parts, _, side = load_side(load_encoder=True)
    parts.feedback.pos_ring_rad = math.nan
    side.resting(0.0)
    assert side._turn_rad == 0.0


def lives():
    parts = Parts()
    return parts, Liveness(parts.settings, parts.feedback, parts.holding, parts.alarms)


@BOTH
@pytest.mark.parametrize(("left", "told"), [(True, ["ENC-12"]), (False, [])])
def test_a_speed_that_grows_against_the_torque_is_told_of_a_drive_that_has_left_its_ramp(left, told, way):
    """From 3 deg/s by 0.16, 0.15 are permitted, with more than 0.8 of 385 N m."""
    parts, watch = lives()
    parts.feedback.torque_nm = -way * 310.0
    for speed in (3.0, 3.16):
        parts.alarms.scan += 1
        parts.turn(way * speed)
        watch.ramp_against(left=left)
    assert parts.codes == told


@BOTH
@pytest.mark.parametrize(("periods", "told"), [(5, ["ENC-12"]), (4, [])])
def test_a_speed_grows_on_over_scans_that_were_missed_and_anew_behind_a_pause(periods, told, way):
    parts, watch = lives()
    parts.feedback.torque_nm = -way * 310.0
    for speed in (3.0, 3.16):
        parts.alarms.scan += 5
        parts.feedback.periods = periods
        parts.turn(way * speed)
        watch.drive_against()
    assert parts.codes == told


@BOTH
@pytest.mark.parametrize(("at_deg", "codes"), [(177.0, []), (177.5, ["CTL-10"])])
def test_the_end_of_travel_is_foreseen_from_the_speed_of_the_shaft(at_deg, codes, way):
    """The set-point rests, the shaft runs away with 6 deg/s: 3.27 deg to rest by 5.5 deg/s2; the end lies at 180.5."""
    parts = Parts()
    watch = Monitors(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)
    parts.turn(way * 6.0)
    watch.scan(way * rad(at_deg), 0.0, 0.0)
    assert [code for code in parts.codes if code == "CTL-10"] == codes


@BOTH
def test_the_acceleration_in_which_the_axis_is_watched_anew_explains_no_brake(way):
    """A reset on a ramp of 1 deg/s2: its 70 N m were there before, so 205 N m more are the brake."""
    parts = Parts()
    parts.virtual.acc_ref_rad_s2 = rad(way * 1.0)
    watch = TorqueWatch(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)
    parts.turn(way * 2.9)
    off = rad(-way * 0.06)
    watch.scan(off, 0.0)
    parts.feedback.torque_nm = way * 205.0
    parts.after(lambda: watch.scan(off, 0.0), most_s=0.031)
    assert parts.codes == ["BRK-14"]


@BOTH
def test_a_shaft_that_is_back_at_its_command_was_held_back_and_is_no_more(way):
    """One scan 0.06 deg/s off, one at its command; 203 N m more that come then are a load, and no brake."""
    parts = Parts()
    parts.feedback.torque_nm = way * 20.0
    watch = TorqueWatch(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)
    parts.turn(way * 3.0)
    watch.scan(rad(-way * 0.06), 0.0)
    watch.scan(0.0, 0.0)
    parts.feedback.torque_nm = way * 223.0
    parts.after(lambda: watch.scan(0.0, 0.0), most_s=0.1)
    assert parts.codes == []


def test_sums_that_are_no_numbers_are_no_memory_of_a_fit():
    fit = RunningFit(1, 0.0, 1.0, 1.0)
    for sums in ([1.0, math.nan, 2.0, 3.0], [1.0, math.inf, 2.0, 3.0], [1.0, 2.0]):
        assert not fit.fits(sums)
    assert fit.fits([1.0, 2.0, 3.0, 4.0])


@BOTH
def test_a_drag_ends_the_motion_after_a_second_in_a_row_above_its_level(way):
    """Twice 0.6 s at 0.31 of 257 N m, between them 0.1 s at 0.2: a warning; a second at 0.31 ends the motion."""
    for shares, reaction in (((0.31, 0.2, 0.31), Reaction.W), ((0.31, 0.31, 0.31), Reaction.HLT)):
        parts = Parts()
        watch = DragWatch(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)
        watch._mean_share = 0.0
        parts.virtual.vel_ref_rad_s = way * rad(3.0)
        for share, scans in zip(shares, (600, 100, 600), strict=True):
            watch._mean_nm = share * 257.0
            for _ in range(scans):
                watch.scan(0.0)
        assert parts.reaction("BRK-02") is reaction


def swung(*sides_s):
    """Codes after a swing to either side in turn, each for so long; a pause is a side of 0 deg/s."""
    parts = Parts()
    watch = Oscillation(parts.settings, parts.alarms)
    for side, time_s in sides_s:
        for _ in range(round(time_s / parts.period_s)):
            parts.alarms.scan += 1
            if side:
                watch.scan(side * rad(0.3))
    return parts.codes


@BOTH
def test_a_swing_there_and_back_is_a_shock_and_four_sides_of_a_second_are_an_oscillation(way):
    assert swung((way, 1.1), (-way, 0.1)) == []
    assert swung((way, 0.6), (-way, 0.6), (way, 0.1)) == []
    assert swung((way, 0.4), (-way, 0.4), (way, 0.4), (-way, 0.1)) == ["CTL-08"]


@BOTH
def test_swings_before_a_pause_of_half_a_second_count_no_more(way):
    before = ((way, 0.2), (-way, 0.2), (way, 0.2), (-way, 0.2))
    assert swung(*before, (0.0, 0.6), (way, 1.1), (-way, 0.1)) == []
    # Nor does the time since then: what follows is half a second of swings.
    assert swung(*before, (0.0, 2.0), *((way, 0.1), (-way, 0.1)) * 2, (way, 0.1)) == []


@pytest.mark.parametrize("first", ["plus", "minus"])
def test_the_second_limit_switch_that_opens_is_a_broken_wire_whichever_it_is(first):
    parts = Parts()
    interlocks = Interlocks(parts.settings, parts.feedback, parts.alarms)
    for open_ones in ([], [first], ["plus", "minus"]):
        said = {f"limit_{side}_ok": side not in open_ones for side in ("plus", "minus")}
        parts.feedback.inputs = DigitalInputs(**said)
        interlocks.scan(0.0, powered=True)
    assert parts.codes == ["LIM-03", "LIM-04"]


@pytest.mark.parametrize(("code", "codes"), [(0x7300, ["CAN-05", "DRV-01"]), (0, ["CAN-05"])])
def test_a_fault_behind_one_with_a_row_of_its_own_is_told_where_it_has_a_code(code, codes):
    """The drive has missed its commands, and then its sensor fails; or it has withdrawn its code."""
    parts = Parts()
    interlocks = Interlocks(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.state = DriveState.FAULT
    for each in (0x8250, code):
        parts.feedback.error_code = each
        interlocks.scan(0.0, powered=True)
    assert parts.codes == codes


def test_limit_switches_that_stay_open_are_told_once():
    """Both, and a reset: nothing moves either way, and nothing new is told."""
    parts = Parts()
    interlocks = Interlocks(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.inputs = DigitalInputs(limit_plus_ok=False, limit_minus_ok=False)
    interlocks.scan(0.0, powered=True)
    assert parts.codes == ["LIM-04"]
    parts.alarms.clear()
    interlocks.scan(0.0, powered=True)
    assert parts.codes == []
    assert (interlocks.plus_open, interlocks.minus_open) == (False, False)


@pytest.mark.parametrize(("permit", "permitted"), [(None, True), (True, True), (False, False)])
def test_motion_is_permitted_by_a_room_that_has_no_such_input(permit, permitted):
    parts = Parts()
    interlocks = Interlocks(parts.settings, parts.feedback, parts.alarms)
    for inputs in (DigitalInputs(motion_permit=permit), DigitalInputs(), DigitalInputs(motion_permit=permit)):
        parts.feedback.inputs = inputs
        interlocks.scan(0.0, powered=False)
        assert interlocks.permitted is (permitted or inputs.motion_permit is None)


@pytest.mark.parametrize(("last_s", "codes"), [(60.0, ["INT-07", "INT-02"]), (60.001, ["INT-07"])])
def test_a_door_that_opens_six_times_within_a_minute_is_a_loose_wire(last_s, codes):
    parts = Parts()
    site = SiteInterlocks(parts.settings, parts.feedback, parts.alarms)
    for time_s in (0.0, 12.0, 24.0, 36.0, 48.0, last_s):
        parts.alarms.time_s = time_s
        for door_ok in (False, True):
            parts.feedback.inputs = DigitalInputs(door_ok=door_ok)
            site.scan(0.0, powered=True, moving=False)
    assert parts.codes == codes


def test_two_channels_of_the_chain_may_differ_for_half_a_second():
    parts = Parts()
    site = SiteInterlocks(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.inputs = DigitalInputs(estop_ok=True, estop_ok_2=False)
    for _ in range(499):
        site.scan(0.0, powered=True, moving=False)
    assert parts.codes == []
    site.scan(0.0, powered=True, moving=False)
    assert parts.alarms.active[Code.INT_04].values == approx({"time_ms": 500.0, "limit": 500.0})


def test_a_second_fault_of_the_drive_is_told_with_its_code_where_nobody_has_reset_the_first():
    parts = Parts()
    interlocks = Interlocks(parts.settings, parts.feedback, parts.alarms)

    def scan(state, code):
        parts.feedback.state, parts.feedback.error_code = state, code
        interlocks.scan(0.0, powered=True)
        return parts.alarms.active[Code.DRV_01].values["measured"]

    first = scan(DriveState.FAULT, 0x7300)
    assert scan(DriveState.SWITCH_ON_DISABLED, 0) is first
    second = scan(DriveState.FAULT, 0x4310)
    assert second != first
    assert scan(DriveState.FAULT, 0x5000) is second, "the code that a fault has shown first stays"


def test_bad_readings_of_the_motors_sensor_are_told_after_a_second_in_a_row():
    """0.6 s of a broken wire, twice; then 1.1 s."""
    parts = Parts()
    thermal = MotorThermal(parts.settings, parts.feedback, parts.alarms)
    look = 0
    for reading_c, looks, codes in ((400.0, 6, []), (30.0, 1, []), (400.0, 6, []), (400.0, 5, ["THM-02"])):
        parts.feedback.motor_temp_c = reading_c
        for _ in range(looks):
            look += 1
            thermal.scan(0.11 * look)
        assert parts.codes == codes


def test_no_friction_is_expected_of_an_axis_that_stands():
    """12 N m of it in motion, which is more than 0.05 deg/s; 50 N m s per rad are 0.04 N m there."""
    model = TorqueModel(RATIO, 257.0)
    model.restore([0.0, 0.0, 12.0, 5.0, 0.0])
    for way in (1.0, -1.0):
        assert model.expected_nm(0.0, way * rad(0.049), 0.0) == 0.0
        assert model.expected_nm(0.0, way * rad(0.051), 0.0) == approx(way * 12.04, abs=0.01)


@pytest.mark.parametrize(("growth", "told"), [(0.0, []), (math.ulp(0.15), ["ENC-12"])])
def test_a_speed_may_grow_by_0_15_deg_s_to_the_bit(growth, told):
    parts, watch = lives()
    parts.feedback.torque_nm = -310.0
    for speed in (0.0, rad(0.15) + growth):
        parts.alarms.scan += 1
        parts.feedback.vel_rad_s = speed
        watch.drive_against()
    assert parts.codes == told


def test_a_standing_shaft_is_moved_forth_and_after_a_scan_of_nothing_back():
    """By 8 counts of 2^22 in 8 scans of 1 ms, each way."""
    parts = Parts(monitors={"encoder_still_time_s": 0.5, "torque_still_max_nm": 15.0})
    watch = Liveness(parts.settings, parts.feedback, parts.holding, parts.alarms)
    speeds = []
    while not speeds or len(speeds) < 25:
        parts.alarms.scan += 1
        watch.stand(proven=True)
        if speeds or watch.vel_rad_s:
            speeds.append(watch.vel_rad_s)
    speed = 8.0 * math.tau / 2**22 / 0.008
    assert speeds[:21] == approx([speed] * 8 + [0.0] + [-speed] * 8 + [0.0] * 4)


def test_a_drive_that_passes_switched_on_on_its_way_down_has_no_torque_any_more():
    stop = Stop()
    stop.scan(2, state=DriveState.SWITCHED_ON)
    stop.scan(40, state=OFF, brake_open=False, deg_s=0.0)
    stop.scan(41, over=True)
    assert stop.value(W.TORQUE_OFF_AFTER, "time_ms") == approx(2.0)


@BOTH
def test_a_stop_before_a_sector_is_told_in_degrees(way):
    """At 59.5 deg, 62 deg at the end of a stop; the sector begins at 60."""
    parts = Parts()
    sector = (rad(60.0), rad(120.0)) if way > 0.0 else (rad(-120.0), rad(-60.0))
    config = replace(parts.settings, travel=replace(parts.settings.travel, no_go_rad=(sector,)))
    monitors = Monitors(config, parts.feedback, parts.virtual, parts.holding, parts.alarms)
    monitors.open_the_way_back(0.0)
    monitors._beyond_travel(way * rad(59.5), way * rad(62.0), way * rad(3.0))
    values = parts.alarms.active[Code.LIM_06].values
    told = {"measured": way * 59.5, "position": way * 62.0, "begin": deg(sector[0]), "end": deg(sector[1])}
    assert values == approx(told)


def test_a_running_fit_is_least_squares_with_its_deviations():
    """0.8 + 2.3 x through 1, 3, 5, 8: squares of 0.2, 0.1, 0.4 and 0.3 are left, 0.075 for each of four samples, of
    which 1.5 say the same once. Of it an intercept has 0.7 (1/4 + 1.5^2/5) and a slope 0.2 (1/5).
    """
    fit = RunningFit(2, 0.0, 1.0, 1.5)
    for x, y in enumerate((1.0, 3.0, 5.0, 8.0)):
        fit.add((1.0, float(x)), y)
    fitted = fit.solved()
    assert fitted.values == approx([0.8, 2.3])
    assert fitted.deviations == approx([math.sqrt(1.5 * 0.075 * 0.7), math.sqrt(1.5 * 0.075 * 0.2)])
