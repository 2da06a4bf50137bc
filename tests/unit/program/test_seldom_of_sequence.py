"""What comes seldom in the power sequence, on an axis with an ideal drive; times and angles by hand."""

from __future__ import annotations

import math

import pytest

from gantryctl.image import DigitalInputs, DriveRequest, DriveState, LinkFlag
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.units import rad
from unit.program.parts import BOTH, PERIODS
from unit.program.power_steps import P, held_again, record, slip
from unit.program.rig import COUNTS_PER_TURN, RATIO, Rig, moving_rig, powered, settings

approx = pytest.approx
OPEN_CHAIN = DigitalInputs(estop_ok=False)


def own_brake():
    """A drive that opens its brake itself as soon as it is enabled."""
    rig = Rig(config=settings(brake_by_drive=True))
    rig.spoil = lambda drive: drive._replace(brake_open=drive.state is DriveState.OPERATION_ENABLED)
    rig.op(power=True)
    return rig


@BOTH
@PERIODS
def test_a_shaft_that_turns_until_the_torque_comes_is_told_with_its_speed_and_its_time_without_torque(
    period_s, way
):
    """Off for 2.5 s, and three scans more until the drive is enabled; 0.5 deg/s. Nothing is proved against it."""
    rig = Rig(config=settings(period_s=period_s))
    rig.run(2.5)

    def spoil(drive):
        turns = rig.axis.power.phase is P.ENABLING and drive.state is not DriveState.OPERATION_ENABLED
        return drive._replace(vel_act_rad_s=way * rad(0.5) * RATIO) if turns else drive

    rig.spoil = spoil
    rig.op(power=True)
    rig.until(lambda: bool(rig.codes), 0.1)
    assert rig.codes == ["BRK-11"]
    told = rig.axis.alarms.active[Code.BRK_11].values
    assert told["measured"] == approx(0.5)
    assert told["time_s"] == approx(2.5 + 3.0 * period_s, abs=1.1 * period_s)
    assert rig.axis.power.phase is P.TORQUE_HOLD
    assert rig.output.torque_ff_nm == 0.0


def test_a_drive_that_is_enabled_from_the_first_scan_on_has_let_nothing_turn():
    rig = Rig()
    rig.spoil = lambda drive: drive._replace(state=DriveState.OPERATION_ENABLED)
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.PROVING, 0.01)
    assert rig.codes == []


@pytest.mark.parametrize("way_down", ["before the brake opened", "by a stop"])
def test_a_brake_from_which_no_torque_was_taken_in_steps_gives_way_later(way_down):
    """Also behind an earlier power-down in which it was: BRK-04, and not the BRK-03 of a brake that did not hold."""
    rig = powered()
    rig.op(power=False)
    rig.until(lambda: rig.axis.is_off, 1.0)
    rig.run(0.01)
    rig.op(power=True)
    if way_down == "by a stop":
        rig.until(lambda: rig.axis.power.phase is P.ON, 1.0)
        rig.drive.inputs = OPEN_CHAIN
    else:
        rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.OFF, 1.0)
    slip(rig, 0.03)
    assert rig.codes[-1] == "BRK-04"


def test_the_brake_of_a_drive_may_let_its_gear_unwind_only_as_the_drive_is_disabled():
    """0.03 deg behind a stop by torque off and brake is a slip; a gear may unwind by 0.05 deg."""
    rig = own_brake()
    rig.until(lambda: rig.axis.power.phase is P.ON, 5.0)
    rig.drive.inputs = OPEN_CHAIN
    rig.until(lambda: rig.axis.power.phase is P.OFF, 5.0)
    slip(rig, 0.03)
    assert rig.codes == ["INT-03", "BRK-04"]


@BOTH
@pytest.mark.parametrize(("deg_s", "codes"), [(0.019, []), (0.021, ["BRK-11"])])
def test_a_shaft_that_creeps_until_the_torque_comes_does_not_turn(deg_s, codes, way):
    """At rest is slower than 0.02 deg/s."""
    rig = Rig()

    def spoil(drive):
        turns = rig.axis.power.phase is P.ENABLING and drive.state is not DriveState.OPERATION_ENABLED
        return drive._replace(vel_act_rad_s=way * rad(deg_s) * RATIO) if turns else drive

    rig.spoil = spoil
    rig.op(power=True)
    rig.run(0.02)
    assert rig.codes == codes


def test_a_drive_that_leaves_while_its_own_brake_opens_is_told():
    """At rest and switched on disabled it looks as if it had ended a quick stop, which nobody asked for."""
    rig = own_brake()
    rig.until(lambda: rig.axis.power.phase is P.SAG_WATCH, 1.0)
    rig.spoil = lambda drive: drive._replace(brake_open=False, state=DriveState.SWITCH_ON_DISABLED)
    rig.step()
    assert rig.codes == ["DRV-04"]


def test_a_drive_that_stands_in_another_state_has_not_ended_its_quick_stop():
    """Only switch-on disabled is the end that a drive comes to by itself."""
    rig = own_brake()
    rig.until(lambda: rig.axis.power.phase is P.ON, 1.0)
    rig.op(quick_stop=True)
    rig.spoil = lambda drive: drive._replace(brake_open=False, state=DriveState.READY_TO_SWITCH_ON)
    rig.step()
    assert rig.codes == ["INT-06", "DRV-04"]


@PERIODS
def test_a_drive_whose_brake_shows_open_late_gets_no_proof_against_it(period_s):
    rig = Rig(config=settings(brake_by_drive=True, period_s=period_s))
    shows_open = 0.05
    rig.spoil = lambda drive: drive._replace(brake_open=rig.scan * period_s > shows_open)
    rig.op(power=True)
    said = record(rig, 1.0)
    assert [phase for phase, _ in said] == [P.ENABLING, P.RELEASING, P.SAG_WATCH, P.ON]


def test_a_drive_that_owns_its_brake_is_disabled_behind_its_quick_stop_without_unloading():
    rig = own_brake()
    rig.until(lambda: rig.axis.power.phase is P.ON, 1.0)
    rig.op(quick_stop=True)
    assert [phase for phase, _ in record(rig, 1.0)] == [P.QUICK_STOPPING, P.CLOSING, P.DISABLING, P.OFF]


@BOTH
@pytest.mark.parametrize(("counts", "codes"), [(0, ["ENC-02"]), (1, [])])
def test_torque_that_is_taken_off_in_steps_turns_the_shaft_or_the_reading_is_frozen(counts, codes, way):
    """40 N m, of which 30 are enough to show; one count is a turn."""
    rig = Rig(config=settings(holding_torque_nm=way * 40.0))
    rig.power_up()
    rig.axis.power._twist._fine = True
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.UNLOADING, 1.0)
    rig.spoil = lambda drive: drive._replace(pos_act_counts=drive.pos_act_counts - counts)
    rig.run(0.5)
    assert rig.codes == codes


@BOTH
def test_what_the_shaft_turns_behind_a_closed_brake_as_the_torque_goes_proves_the_reading(way):
    """In a stop on the way down: 40 N m go, the shaft turns by a count in the second scan and stands from then on."""
    rig = Rig(config=settings(holding_torque_nm=way * 40.0))
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.UNLOADING, 1.0)
    rig.axis.power._twist._fine = True
    stands, begun = rig.image.drive.pos_act_counts, rig.scan
    rig.spoil = lambda drive: drive._replace(pos_act_counts=stands - (1 if rig.scan - begun >= 2 else 0))
    rig.drive.inputs = OPEN_CHAIN
    rig.run(0.02)
    assert (rig.codes, rig.axis.power.phase) == (["INT-03"], P.TORQUE_OFF)


def test_a_stop_on_a_reading_in_doubt_lasts_a_second_and_a_half_however_still_it_reads():
    rig = moving_rig()
    rig.axis.feedback.doubt(Code.ENC_02, measured="a test", time_ms=1.0)
    stands = rig.image.drive.pos_act_counts
    rig.spoil = lambda drive: drive._replace(pos_act_counts=stands, vel_act_rad_s=0.0, brake_open=False)
    rig.step()
    begun = rig.scan
    rig.until(lambda: rig.axis.power.phase is P.OFF, 2.0)
    assert (rig.scan - begun) * rig.period_s == approx(1.5, abs=0.0021)


@pytest.mark.parametrize("contact", [True, False])
def test_a_stop_before_the_brake_was_opened_waits_for_a_load_that_nobody_knows_to_be_held(contact):
    """Stopped while the contact still says open, or without one; then it says closed, and the load turns on."""
    rig = Rig()
    rig.spoil = lambda drive: drive._replace(brake_open=contact, brake_contact=contact)
    rig.op(power=True)
    rig.drive.inputs = OPEN_CHAIN
    rig.step()
    assert rig.axis.power.phase is P.TORQUE_OFF
    rig.spoil = lambda drive: drive._replace(
        brake_open=False, brake_contact=contact, vel_act_rad_s=rad(0.1) * RATIO
    )
    rig.run(0.1)
    assert rig.axis.power.phase is P.TORQUE_OFF


def test_every_stop_by_the_brake_has_its_own_300_ms_of_rest():
    rig = powered()
    for _ in range(2):
        rig.drive.inputs = OPEN_CHAIN
        rig.step()
        begun = rig.scan
        rig.until(lambda: rig.axis.power.phase is P.OFF, 1.0)
        assert (rig.scan - begun) * rig.period_s == approx(0.3, abs=0.0021)
        rig.drive.inputs = DigitalInputs()
        rig.op(power=False, reset=True)
        rig.op(reset=False)
        rig.power_up()


def test_power_that_goes_off_is_no_test_of_the_brake():
    rig = powered()
    rig.op(power=False)
    rig.until(lambda: rig.axis.is_off, 1.0)
    assert (rig.axis.brake_test.count, rig.axis.brake_test.last) == (0, None)


@BOTH
def test_a_speed_that_grows_against_its_torque_is_a_wrong_sign_once_the_drive_has_left_its_ramp(way):
    """A quick stop from 3 deg/s that gains 20 deg/s2 against 350 N m; what it may be beside its ramp is 0.5 deg/s."""
    rig = moving_rig(at_deg=-way * 40.0, speed_deg_s=3.0)
    rig.op(quick_stop=True)
    counts, vel_rad_s = rig.image.drive.pos_act_counts, way * rad(3.0) * RATIO

    def spoil(drive):
        nonlocal counts, vel_rad_s
        vel_rad_s += way * rad(0.02) * RATIO
        counts += vel_rad_s * rig.period_s / math.tau * COUNTS_PER_TURN
        return drive._replace(
            pos_act_counts=round(counts), vel_act_rad_s=vel_rad_s, torque_act_nm=-way * 350.0
        )

    rig.spoil = spoil
    rig.until(lambda: "ENC-12" in rig.codes, 0.1)
    assert rig.axis.alarms.active[Code.ENC_12].values["measured"].values["speed"] == approx(3.51, abs=0.02)


@BOTH
def test_a_speed_may_leap_as_the_brake_opens_and_lets_go_what_its_gear_was_twisted_by(way):
    """By 0.3 deg/s in the scan in which it shows open; the drive alone can take 0.21 deg/s, and the brake 0.37."""
    config = settings(monitors={"speed_change_max_rad_s2": rad(169.0), "speed_change_per_torque": rad(0.08)})

    def leaps(rig):
        rig.spoil = lambda drive: drive._replace(vel_act_rad_s=way * rad(0.3) * RATIO)
        rig.step()
        rig.spoil = None
        return rig.codes

    rig = Rig(config=config)
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.SAG_WATCH, 1.0)
    assert leaps(rig) == []
    rig = Rig(config=config)
    rig.power_up()
    assert leaps(rig) == ["ENC-14"]


@BOTH
def test_a_speed_may_leap_in_the_telegram_that_shows_a_drive_s_own_brake_open(way):
    """By 0.3 deg/s, as above: nothing else of the way up tells that it opens. With power on it may not."""
    config = settings(
        brake_by_drive=True,
        monitors={"speed_change_max_rad_s2": rad(169.0), "speed_change_per_torque": rad(0.08)},
    )

    def shown(drive, vel_rad_s=0.0):
        enabled = drive.state is DriveState.OPERATION_ENABLED
        return drive._replace(brake_open=enabled, vel_act_rad_s=vel_rad_s if enabled else 0.0)

    leap_rad_s = way * rad(0.3) * RATIO
    rig = Rig(config=config)
    rig.spoil = lambda drive: shown(drive, leap_rad_s)
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.SAG_WATCH, 1.0)
    assert rig.codes == []
    rig = Rig(config=config)
    rig.spoil = shown
    rig.power_up()
    rig.spoil = lambda drive: shown(drive, leap_rad_s)
    rig.step()
    assert rig.codes == ["ENC-14"]


def test_power_that_was_taken_back_does_not_come_on_where_the_brake_shows_open_as_it_is_closed_again():
    """A drive that is about to open its own brake goes on to the end, then closes it."""
    rig = Rig(config=settings(brake_by_drive=True))
    rig.spoil = lambda drive: drive._replace(brake_open=rig.axis.power.phase is P.RELEASING)
    rig.op(power=True)
    rig.until(lambda: rig.axis.feedback.state is DriveState.READY_TO_SWITCH_ON, 1.0)
    rig.op(power=False)  # in the scan that shows it switched on
    phases = [phase for phase, _ in record(rig, 1.0)]
    assert phases == [P.RELEASING, P.CLOSING, P.DISABLING, P.OFF]


def test_a_drive_that_enables_itself_while_power_is_off_is_told():
    rig = Rig()
    rig.run(0.3)
    rig.spoil = lambda drive: drive._replace(state=DriveState.OPERATION_ENABLED)
    rig.step()
    assert rig.codes == ["DRV-03"]


def test_a_stop_behind_a_closed_brake_is_not_over_where_its_contact_opens():
    """Stopped in the proof; the load turns on and the contact says open."""
    rig = Rig()
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.PROVING, 1.0)
    rig.drive.inputs = OPEN_CHAIN
    rig.step()
    rig.spoil = lambda drive: drive._replace(brake_open=True, vel_act_rad_s=rad(0.1) * RATIO)
    rig.run(0.1)
    assert rig.axis.power.phase is P.TORQUE_OFF


@pytest.mark.parametrize("reaction", [Reaction.QUICK_STOP, Reaction.HOLD])
def test_torque_that_holds_a_load_is_not_taken_off_by_a_weaker_stop(reaction):
    """12 N m behind a brake that has slipped."""
    rig = held_again()
    rig.axis.power.react(reaction)
    rig.run(0.05)
    assert rig.axis.power.phase is P.TORQUE_HOLD
    assert rig.output.torque_ff_nm == approx(12.0)
    assert rig.drive.state is DriveState.OPERATION_ENABLED


def test_a_drive_that_ends_its_quick_stop_by_itself_is_disabled_and_nothing_else():
    """It owns its brake; disabled in the scan that shows it, and off in the next."""
    rig = own_brake()
    rig.until(lambda: rig.axis.power.phase is P.ON, 1.0)
    rig.op(quick_stop=True)
    rig.spoil = lambda drive: drive._replace(brake_open=False, state=DriveState.SWITCH_ON_DISABLED)
    rig.step()
    assert (rig.axis.power.phase, rig.codes) == (P.DISABLING, ["INT-06"])
    rig.step()
    assert (rig.axis.power.phase, rig.codes) == (P.OFF, ["INT-06"])


@BOTH
def test_what_the_brake_takes_in_a_stop_is_counted(way):
    """400 N m for 0.5 s at 6 deg/s: 3 x 1144 deg of the motor are 59.9 rad, 23.96 kJ."""
    rig = moving_rig(at_deg=-way * 40.0)
    counts, vel_rad_s = rig.image.drive.pos_act_counts, way * rad(6.0) * RATIO

    def spoil(drive):
        nonlocal counts
        counts += vel_rad_s * rig.period_s / math.tau * COUNTS_PER_TURN
        return drive._replace(pos_act_counts=round(counts), vel_act_rad_s=vel_rad_s, brake_open=False)

    rig.drive.inputs = OPEN_CHAIN
    rig.step()
    rig.spoil = spoil
    rig.run(0.5)
    assert rig.axis.power.phase is P.TORQUE_OFF
    assert rig.axis.power.wear.energy_j == approx(23.96e3, rel=0.01)


def test_torque_that_was_taken_off_is_not_given_back_by_a_brake_that_slips_behind_it():
    """Whatever began the stop may be a drive that must not push: the brake alone ends it."""
    rig = moving_rig()
    rig.axis.power.react(Reaction.TORQUE_OFF)
    rig.axis.power.react(Reaction.HOLD)
    rig.step()
    assert rig.axis.power.phase is P.TORQUE_OFF
    assert rig.drive.state is not DriveState.OPERATION_ENABLED


def test_behind_a_reset_of_hold_the_brake_takes_the_load_step_by_step():
    """12 N m: all of it until the brake is closed, then a third less at each step."""
    rig = held_again()
    rig.program.service = True
    rig.op(reset=True)
    seen = record(rig, 1.0)
    assert [phase for phase, _ in seen] == [P.CLOSING, P.UNLOADING, P.DISABLING, P.OFF]
    assert seen[0][1].torque_ff_nm == approx(12.0)
    assert seen[1][1].torque_ff_nm == approx(0.0, abs=0.1)


def test_a_drive_that_is_silent_is_not_taken_for_one_that_has_let_the_load_go():
    """HOLD, and half a second without telegrams: the torque stays commanded, for nothing else holds the load."""
    rig = held_again()
    rig.run(0.3)
    rig.spoil = lambda drive: drive._replace(age_scans=200, link=LinkFlag.LATE)
    for _ in range(500):
        rig.step()
        assert rig.axis.power.phase is P.TORQUE_HOLD
        assert (rig.output.request, rig.output.torque_ff_nm) == (DriveRequest.ENABLE, approx(12.0))
    assert rig.codes == ["BRK-03", "CAN-03"]


def test_a_drive_that_may_be_opening_its_brake_is_told_to_stop_until_it_has_shown_what_it_is():
    """A quick stop as it switches on: shown enabled or not within three scans, it has not been disabled before."""
    rig = own_brake()
    rig.until(lambda: rig.image.drive.state is DriveState.SWITCHED_ON, 1.0)
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCHED_ON, brake_open=False)
    rig.op(quick_stop=True)
    said = [(rig.axis.power.phase, rig.output.request)]
    for _ in range(4):
        rig.step()
        said.append((rig.axis.power.phase, rig.output.request))
    assert said == [(P.DISABLING, DriveRequest.QUICK_STOP)] * 4 + [(P.OFF, DriveRequest.DISABLE)]


@BOTH
@pytest.mark.parametrize("phase", [P.RELEASING, P.SAG_WATCH])
def test_a_wrong_sign_as_the_brake_opens_is_told_before_the_way_that_it_has_moved(phase, way):
    """Nine scans of 2 deg/s and one of 2.2: 0.0202 of 0.02 deg, in the scan that gains 0.2 of 0.15 deg/s against it.

    What people read first is what they mend: "check the learned holding torque" sends them to a sound brake.
    """
    rig = Rig()
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is phase, 5.0)
    speeds = [2.0] * 9 + [2.2] * 50
    counts = rig.image.drive.pos_act_counts

    def spoil(drive):
        nonlocal counts
        vel_rad_s = way * rad(speeds.pop(0)) * RATIO
        counts += vel_rad_s * rig.period_s / math.tau * COUNTS_PER_TURN
        return drive._replace(
            pos_act_counts=round(counts), vel_act_rad_s=vel_rad_s, torque_act_nm=-way * 350.0
        )

    rig.spoil = spoil
    rig.run(9 * rig.period_s)
    assert rig.codes == []
    rig.step()
    assert rig.codes == ["ENC-12", "BRK-10"]
    assert (rig.first.code, rig.first.reaction) == (Code.ENC_12, Reaction.TORQUE_OFF)
    assert rig.axis.alarms.active[Code.BRK_10].follows is Code.ENC_12
