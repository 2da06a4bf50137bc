"""What comes seldom in power, each part in the state that a rare event leaves it in; figures by hand."""

from __future__ import annotations

import math

import pytest

from gantryctl.image import (
    DigitalInputs,
    DriveState,
)
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.axis.command_checks import check_target
from gantryctl.program.blocks import Power
from gantryctl.program.feedback import ENABLED
from gantryctl.program.power.brake_test import BrakeTest, BrakeTestOutcome, BrakeTestPhase
from gantryctl.program.power.hold_watch import HoldWatch
from gantryctl.program.power.ramp_watch import RampWatch
from gantryctl.program.power.rest import RestWatch
from gantryctl.program.power.slip_watch import SlipWatch
from gantryctl.program.power.torque_proof import TorqueProof
from gantryctl.program.power.twist import Twist
from gantryctl.program.power.wear import BrakeWear
from gantryctl.units import rad
from unit.program.parts import BOTH, Parts
from unit.program.power_steps import P, record
from unit.program.rig import Rig, powered, settings
from unit.program.test_parts_of_reset import W
from unit.program.test_torque_proof import proof_of

approx = pytest.approx


def test_a_brake_test_tells_its_largest_way_and_gives_no_torque_when_it_has_ended():
    """0.01 deg and back; ended by an alarm as the torque rises."""
    test = BrakeTest(64.0, rad(0.02), 385.0, 0.001)
    test.prepare(0.0)
    test.begin()
    for pos_deg in (0.0, 0.01, 0.0, 0.0):
        test.scan(0.0, rad(pos_deg))
    assert test.on_brake_nm > 0.0
    result = test.finish()
    assert result.moved_rad == rad(0.01)
    assert test.on_brake_nm == 0.0
    assert not test.under_way


def test_a_brake_test_that_is_over_is_not_taken_up_again():
    """Stopped as the drive is enabled; a second stop, and one behind the last phase."""
    test = BrakeTest(64.0, rad(0.02), 385.0, 0.001)
    test.prepare(0.0)
    for _ in range(2):
        test.end(BrakeTestOutcome.ABORTED, W.STOPPED)
        assert test.phase is BrakeTestPhase.DISABLING
    test.finish()
    test.end(BrakeTestOutcome.ABORTED, W.STOPPED)
    assert not test.under_way


def test_torque_that_is_asked_for_behind_a_torque_off_is_told_as_not_kept():
    """A slip of the closed brake holds the load by torque, but not where the torque has just been taken off."""
    rig = powered()
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.step()
    assert rig.axis.power.phase is P.TORQUE_OFF
    rig.axis.alarms.raise_(Code.BRK_04, measured=0.03, limit=0.02)
    assert rig.axis.alarms.active[Code.BRK_04].steps == (W.TORQUE_KEPT,)
    rig.step()
    assert rig.axis.alarms.active[Code.BRK_04].steps == (W.TORQUE_OFF_COMMANDED,)


def test_power_that_was_turned_back_as_a_drive_opened_its_brake_can_be_asked_for_again():
    rig = Rig(config=settings(brake_by_drive=True))
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCHED_ON)
    rig.op(power=True)
    rig.run(0.01)
    rig.op(power=False)
    rig.step()
    assert rig.axis.power.falling
    rig.spoil = lambda drive: drive._replace(brake_open=drive.state is DriveState.OPERATION_ENABLED)
    rig.until(lambda: rig.axis.is_off, 2.0)
    assert not rig.axis.power.falling
    rig.power_up()


def test_a_drive_that_takes_no_torque_is_disabled_as_its_brake_is_closed():
    rig = Rig(config=settings(torque_preload=False))
    rig.power_up()
    assert rig.axis.liveness.dithers == 0, "an ideal drive is asked nothing, also without a proof"
    rig.op(power=False)
    assert [phase for phase, _ in record(rig, 1.0)] == [P.CLOSING, P.DISABLING, P.OFF]


def test_a_reading_that_is_old_says_nothing_of_torque_that_has_gone():
    rig = Rig()
    rig.power_up()
    sequence = rig.axis.power
    sequence._twist._fine = True
    for old in (True, False):
        rig.axis.feedback._old = old
        sequence._load_nm = 40.0
        assert sequence._stood_as_torque_went() is not old
        assert rig.codes == ([] if old else ["ENC-02"])


def test_scans_that_are_missed_are_time_of_a_brake_test():
    """Every second one: the ramps of 2 s in all take 4 s, but each way is held for 2 s and not for 4."""
    rig = Rig(config=settings(test_torque_nm=65.0, period_s=0.004))
    rig.run(0.05)
    rig.missed = lambda scan: 1
    begun = rig.scan
    rig.op(brake_test=True)
    rig.until(lambda: rig.program.brake_test.done, 12.0)
    assert 8.0 < (rig.scan - begun) * rig.period_s < 9.0


def test_a_brake_test_that_an_alarm_ends_names_it():
    rig = Rig(config=settings(test_torque_nm=65.0))
    rig.step()
    rig.op(brake_test=True)
    rig.until(lambda: rig.axis.power.phase is P.TESTING, 1.0)
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.step()
    assert rig.axis.brake_test.last.words == W.ENDED_BY(code=Code.INT_03)


def test_a_failed_test_forbids_power_and_not_the_next_test():
    rig = Rig(config=settings(test_torque_nm=65.0))
    rig.step()
    rig.axis.alarms.raise_(Code.BRK_08, measured="bore 10 N m")
    assert rig.axis.power_on() is not None
    assert rig.axis.begin_brake_test() is None


def test_the_proof_begins_4_ms_behind_the_scan_that_shows_a_drive_enabled():
    rig = Rig()
    rig.op(power=True)
    rig.until(lambda: rig.axis.feedback.state is DriveState.OPERATION_ENABLED, 1.0)
    begun = rig.scan
    rig.until(lambda: rig.axis.power.phase is P.PROVING, 0.1)
    assert rig.scan - begun == 3, "the first of the four is the one that shows it"


def test_a_drive_that_shows_enabled_and_then_not_has_its_4_ms_anew():
    rig = Rig()
    rig.op(power=True)
    rig.until(lambda: rig.axis.feedback.state is DriveState.OPERATION_ENABLED, 1.0)
    rig.run(0.002)
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCHED_ON)
    rig.step()
    rig.spoil = None
    rig.run(0.003)
    assert rig.axis.power.phase is P.ENABLING
    rig.step()
    assert rig.axis.power.phase is P.PROVING


@BOTH
@pytest.mark.parametrize("drift", [2.0, 0.0, -2.0])
def test_what_the_proof_torque_turns_is_counted_beside_what_the_load_swings_on(drift, way):
    """A swinging load turns the shaft by two counts a scan, either way; as the torque comes, by 5 more."""
    parts = Parts()
    parts.feedback.counts = 1000.0
    proof, _ = proof_of(parts, way * 12.0)
    for scan in range(1, 11):
        parts.feedback.counts = 1000.0 + drift * scan
        assert not proof.given(scan)
    parts.feedback.counts, parts.feedback.torque_nm = 1000.0 + drift * 12 + way * 5.0, way * 30.0
    assert proof.given(12)
    assert proof._turned == approx(5.0)


@BOTH
def test_a_proof_that_is_not_given_is_told_with_its_time(way):
    """24 of 30 N m within 0.5 s."""
    parts = Parts()
    parts.holding.mean_nm = way * 12.0
    parts.holding.preload()
    proof = TorqueProof(parts.settings, parts.feedback, parts.alarms, parts.holding)
    proof.begin()
    parts.feedback.torque_nm = way * 23.0
    assert not proof.given(500)
    assert parts.codes == []
    assert not proof.given(501)
    told = parts.alarms.active[Code.BRK_07].values
    assert told == approx({"measured": 23.0, "limit": 24.0, "time_ms": 501.0})


def test_before_the_first_power_up_no_torque_is_asked_for_and_no_brake_has_worked():
    parts = Parts()
    assert parts.holding.preload_nm == parts.holding.proof_nm == 0.0
    wear = BrakeWear(parts.settings, parts.feedback, parts.alarms)
    assert (wear.stops, wear.energy_j) == (0, 0.0)


@pytest.mark.parametrize(("learn_time_s", "share"), [(0.5, 0.002), (2.0, 0.0005), (0.0005, 1.0)])
def test_the_holding_torque_is_learned_with_its_time_and_never_beyond_what_is_read(learn_time_s, share):
    """1 ms; of a time that is shorter than a scan the whole torque."""
    parts = Parts(learn_time_s=learn_time_s)
    parts.holding.learn(10.0)
    assert parts.holding.mean_nm == approx(10.0 * share)


def test_rest_and_a_ramp_that_is_left_are_judged_after_50_scans_of_a_millisecond():
    parts = Parts()
    rest, ramp = RestWatch(parts.settings, parts.feedback), RampWatch(parts.settings, parts.feedback)
    for _ in range(2):  # also of a second phase
        rest.begin()
        parts.turn(1.0)
        assert not rest.scan()
        parts.turn(0.0)
        assert [rest.scan() for _ in range(51)].index(True) == 49
        ramp.begin()
        parts.turn(0.6)
        assert [ramp.obeyed(0.1) for _ in range(51)].index(False) == 49


def test_one_count_is_a_turn():
    parts = Parts(monitors={"encoder_shows_twist": True})
    twist = Twist(parts.settings, parts.feedback)
    twist.begin(30.0)
    parts.feedback.counts += 1.0
    twist.scan()
    assert twist.shown(30.0)
    proof = TorqueProof(parts.settings, parts.feedback, parts.alarms, parts.holding)
    proof.begin()
    proof._turned = 1.0
    assert proof.settled(100)
    assert parts.codes == []


def test_a_swing_that_was_seen_for_one_scan_alone_is_taken_off_as_well():
    """Two counts a scan; the torque comes in the second and turns the shaft by 5 more."""
    parts = Parts()
    parts.holding.preload()
    proof = TorqueProof(parts.settings, parts.feedback, parts.alarms, parts.holding)
    parts.feedback.counts = 1000.0
    proof.begin()
    parts.feedback.counts = 1002.0
    assert not proof.given(1)
    parts.feedback.counts, parts.feedback.torque_nm = 1009.0, 30.0
    assert proof.given(2)
    assert proof._turned == approx(5.0)


@BOTH
@pytest.mark.parametrize(("share", "turned"), [(0.0999, 3.0), (0.1001, 9.0)])
def test_less_than_a_tenth_of_the_proof_has_turned_nothing_yet(share, turned, way):
    """Of 24 N m: 4 counts until the second scan are a swing of 2 a scan, which leaves 3 of the 5 of the third."""
    parts = Parts()
    parts.feedback.counts = 1000.0
    proof, _ = proof_of(parts, way * 12.0)
    parts.feedback.torque_nm = 0.0
    assert not proof.given(1)
    parts.feedback.counts, parts.feedback.torque_nm = 1000.0 + way * 4.0, way * share * 24.0
    assert not proof.given(2)
    parts.feedback.counts, parts.feedback.torque_nm = 1000.0 + way * 9.0, way * 30.0
    assert proof.given(3)
    assert proof._turned == approx(turned)


@BOTH
def test_torque_beyond_the_proof_that_turns_the_shaft_the_other_way_is_told_with_speed_and_torque(way):
    parts = Parts()
    parts.holding.preload()
    proof = TorqueProof(parts.settings, parts.feedback, parts.alarms, parts.holding)
    proof.begin()
    parts.feedback.torque_nm = way * 100.0
    parts.turn(-way * 1.0)
    assert not proof.given(1)
    measured = parts.alarms.active[Code.ENC_12].values["measured"]
    assert measured.values == approx({"speed": 1.0, "torque": way * 100.0})


@BOTH
def test_a_gear_that_has_unwound_by_all_that_it_may_counts_from_there(way):
    """0.02 deg of a slip and 0.03 of the gear to the bit, for longer than 0.3 s; back at 0 it has slipped by 0.05."""
    parts = Parts()
    watch = SlipWatch(parts.settings, parts.feedback, parts.alarms)
    watch.begin(0.0, unwinds=True)
    limit = rad(0.02) + rad(0.03)
    assert not watch.slipped_without_torque(way * limit, 0.301, Code.BRK_04)
    assert watch.slipped_without_torque(0.0, 0.302, Code.BRK_04)


def test_a_drive_has_held_from_its_first_scan_with_torque_on():
    parts = Parts()
    watch = HoldWatch(parts.settings, parts.feedback, parts.alarms)
    assert not watch.has_held
    watch.scan(0.0)
    assert watch.has_held


def in_hold(torque_nm, speeds_deg_s):
    """Scans of HOLD with these speeds; in which the torque was taken off, and whether the reading is in doubt."""
    parts = Parts()
    watch = HoldWatch(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.torque_nm = torque_nm
    for scan, deg_s in enumerate(speeds_deg_s, 1):
        parts.turn(deg_s)
        watch.scan(0.0)
        if Code.BRK_13 in parts.alarms.active:
            return scan, parts.feedback.in_doubt
    return None, parts.feedback.in_doubt


@BOTH
def test_a_drive_drives_the_load_for_50_scans_in_a_row(way):
    """5 N m along with 0.2 deg/s; a scan at rest, or a slower one, ends it, and 80 N m along are no wrong reading."""
    fast, slow = way * 0.2, way * 0.19
    assert in_hold(way * 5.0, [fast] * 60) == (50, False)
    assert in_hold(way * 80.0, [fast] * 60) == (50, False)
    assert in_hold(way * 5.0, [fast] * 40 + [0.0] + [fast] * 60) == (91, False)
    assert in_hold(way * 5.0, [fast] * 40 + [slow] + [fast] * 60) == (91, False)
    assert in_hold(way * 5.0, [fast] + [slow] * 60) == (52, False)
    assert in_hold(-way * 80.0, [fast] * 60) == (50, True)


def test_the_phases_of_a_brake_test_have_their_numbers():
    """What is published and recorded."""
    names = [
        "IDLE",
        "ENABLING",
        "PLUS_RISING",
        "PLUS_HELD",
        "MINUS_RISING",
        "MINUS_HELD",
        "RELIEVING",
        "DISABLING",
    ]
    assert [(phase.name, phase.value) for phase in BrakeTestPhase] == [(n, k) for k, n in enumerate(names)]


def test_a_slip_without_torque_is_believed_of_a_doubted_reading_that_turns_for_50_ms():
    parts = Parts()
    watch = SlipWatch(parts.settings, parts.feedback, parts.alarms)
    for _ in range(2):  # also of a second phase
        watch.begin(0.0, unwinds=False)
        parts.alarms.clear()
        parts.feedback.in_doubt = True
        parts.turn(1.0)
        assert parts.after(lambda: watch.slipped_without_torque(rad(0.03), 1.0, Code.BRK_04)) == approx(0.050)


def test_a_contact_that_stays_open_behind_a_closed_brake_is_told_after_0_45_s():
    """0.15 s to close and 0.3 s for its contact."""
    rig = Rig()
    rig.spoil = lambda drive: drive._replace(brake_open=True)
    rig.run(0.450)
    assert rig.codes == []
    rig.step()
    assert rig.codes == ["BRK-06"]


@pytest.mark.parametrize("phase", [P.RELEASING, P.SAG_WATCH])
@pytest.mark.parametrize(("scans", "kept"), [(0, True), (1, False)])
def test_power_off_in_the_scan_in_which_a_drive_opens_its_brake_waits_for_it(phase, scans, kept):
    """Disabled now it would take its torque off before it holds; a scan later it closes its brake first."""
    rig = Rig(config=settings(brake_by_drive=True))
    if phase is P.SAG_WATCH:
        rig.spoil = lambda drive: drive._replace(brake_open=drive.state is DriveState.OPERATION_ENABLED)
    else:
        rig.spoil = lambda drive: drive._replace(brake_open=False)
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is phase, 1.0)
    rig.run(scans * rig.period_s)
    rig.axis.power.switch_off()
    assert (rig.axis.power.phase is phase) is kept
    assert rig.axis.power.falling


def test_a_brake_test_under_way_has_no_sentence():
    test = BrakeTest(64.0, rad(0.02), 385.0, 0.001)
    test.prepare(0.0)
    assert test.result.text == ""


def unloading():
    """12 N m are about to go by the second of three steps."""
    rig = Rig(config=settings(holding_torque_nm=12.0))
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.UNLOADING, 1.0)
    while rig.axis.power._count < 49:
        rig.step()
    return rig


def test_a_brake_that_slips_as_the_next_step_is_due_loses_no_more_torque():
    rig = unloading()
    rig.axis.power._slip._from_rad = rig.axis.pos_act_rad - rad(0.03)
    before = rig.output.torque_ff_nm
    rig.step()
    assert rig.codes == ["BRK-03"]
    assert rig.output.torque_ff_nm == before > 0.0
    rig = unloading()
    rig.step()
    assert rig.output.torque_ff_nm < before


def test_power_is_off_in_the_scan_in_which_the_drive_shows_it():
    rig = powered()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.DISABLING, 1.0)
    rig.until(lambda: rig.axis.feedback.state not in ENABLED, 0.1)
    assert rig.axis.is_off


@BOTH
@pytest.mark.parametrize(("left_nm", "codes"), [(0.0, ["INT-03", "ENC-02"]), (15.0, ["INT-03"])])
def test_torque_that_stays_need_not_have_turned_the_shaft(left_nm, codes, way):
    """Of 40 N m 40 have gone, or 25; 30 are enough to show."""
    rig = Rig()
    rig.power_up()
    rig.axis.power._twist._fine = True
    held = rig.scan
    rig.spoil = lambda drive: drive._replace(torque_act_nm=way * (40.0 if rig.scan <= held else left_nm))
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.run(0.02)
    assert rig.codes == codes


def test_a_motion_without_power_is_refused_for_that_and_not_for_a_warning():
    rig = Rig()
    rig.step()
    rig.axis.alarms.raise_(Code.BRK_02, Reaction.HLT, measured=80.0, share=31.0)
    refused = rig.axis.motion.move_absolute(rad(5.0), rad(6.0)).refusal
    assert refused is not None
    assert refused.code is Code.PWR_03


@BOTH
def test_beyond_the_end_of_travel_the_angle_where_the_axis_stands_is_no_way_back(way):
    travel = settings().travel
    at = way * rad(180.3)
    assert check_target(at, at, travel) is not None
    assert check_target(at, math.nextafter(at, 0.0), travel) is None


def test_a_refusal_of_power_is_shown_as_long_as_it_is_asked_for():
    rig = Rig()
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.run(0.1)
    power = Power(rig.axis)
    power(enable=True)
    assert power.error
    power(enable=False)
    assert not power.error
    assert power.error_id is None


@BOTH
@pytest.mark.parametrize(
    ("turns_in", "codes"), [(None, ["INT-03", "ENC-02"]), (2, ["INT-03", "ENC-02"]), (5, ["INT-03"])]
)
def test_torque_that_goes_in_a_stop_turns_the_shaft_or_the_reading_is_frozen(turns_in, codes, way):
    """40 N m at rest, 30 are enough to show; what the load turns within three scans, behind the open brake, proves
    nothing of the torque.
    """
    rig = Rig()
    rig.power_up()
    rig.axis.power._twist._fine = True
    held = rig.scan

    def spoil(drive):
        scans = rig.scan - held
        counts = drive.pos_act_counts - (way if turns_in is not None and scans >= turns_in else 0.0)
        return drive._replace(
            torque_act_nm=way * 40.0 if scans <= 0 else 0.0, brake_open=scans < 50, pos_act_counts=counts
        )

    rig.spoil = spoil
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.run(0.02)
    assert rig.codes == codes
    assert rig.axis.power.phase is P.TORQUE_OFF
