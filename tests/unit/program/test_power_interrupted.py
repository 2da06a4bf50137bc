"""Stops and orders that come in the middle of the way up or down: what the drive and the brake are told then."""

import itertools

import pytest

from gantryctl.image import DigitalInputs, DriveRequest, DriveState, LinkFlag
from gantryctl.program import AxisState, BrakeTestOutcome
from gantryctl.program.alarms.codes import Reaction
from gantryctl.program.alarms.words import Words
from gantryctl.program.power.phases import Proof
from gantryctl.program.settings import StandstillPolicy
from unit.program.parts import BOTH
from unit.program.power_steps import P, slip
from unit.program.rig import Rig, moving_rig, settings

approx = pytest.approx
HOLDS = {"holding_torque_nm": 12.0}
OPEN_CHAIN = DigitalInputs(estop_ok=False)


def going(phase, **said):
    """Power is switched on, or off where a phase belongs to the way down, as far as a phase."""
    rig = Rig(config=settings(**HOLDS, **said))
    if phase in (P.CLOSING, P.UNLOADING):
        rig.power_up()
        rig.op(power=False)
    else:
        rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is phase, 3.0)
    return rig


class OwnBrake(Rig):
    """A drive that opens its brake itself as soon as it is enabled, and closes it when it is not; it moves."""

    def __init__(self):
        super().__init__(config=settings(brake_by_drive=True))
        self.says = {}
        self.spoil = lambda drive: drive._replace(
            **({"brake_open": drive.state is DriveState.OPERATION_ENABLED} | self.says)
        )
        self.power_up()
        self.move(100.0)
        self.run(2.5)
        self.op(quick_stop=True)
        self.run(0.1)


@pytest.mark.parametrize("phase", [P.CLOSING, P.UNLOADING])
def test_a_quick_stop_while_the_brake_closes_takes_the_drive_from_its_commands(phase):
    """And the way down goes on: the brake first, then the torque."""
    rig = going(phase)
    rig.op(quick_stop=True)
    assert rig.axis.power.phase is phase
    assert rig.output.request is DriveRequest.QUICK_STOP
    assert not rig.output.brake_open
    while rig.axis.power.phase in (P.CLOSING, P.UNLOADING):
        assert rig.output.request is DriveRequest.QUICK_STOP
        rig.step()
    rig.run(0.1)
    assert rig.axis.is_off
    assert rig.codes == ["INT-06"]


@pytest.mark.parametrize(("phase", "least_s"), [(P.PROVING, 0.0), (P.RELEASING, 0.3), (P.UNLOADING, 0.3)])
def test_the_load_has_to_come_to_rest_only_where_the_brake_may_be_on_its_way_open(phase, least_s):
    """The contact still says closed; 300 ms of rest are those of a stop by the brake."""
    rig = going(phase)
    rig.spoil = lambda drive: drive._replace(brake_open=False)
    rig.drive.inputs = OPEN_CHAIN
    rig.step()
    assert rig.axis.power.phase is P.TORQUE_OFF
    start = rig.scan
    rig.until(lambda: rig.axis.is_off, 1.0)
    assert (rig.scan - start) * rig.period_s == approx(least_s, abs=0.005)


def test_a_stop_is_not_over_while_the_drive_still_gives_torque_behind_the_brake():
    rig = going(P.PROVING)
    rig.spoil = lambda drive: drive._replace(state=DriveState.OPERATION_ENABLED)
    rig.drive.inputs = OPEN_CHAIN
    rig.run(0.1)
    assert rig.axis.power.phase is P.TORQUE_OFF
    rig.spoil = None
    rig.run(0.002)
    assert rig.axis.is_off


def test_a_drive_that_drops_its_torque_on_its_ramp_has_not_ended_its_quick_stop():
    """6 deg/s take 1.1 s; after 100 ms it turns with more than 5."""
    rig = OwnBrake()
    rig.says = {"state": DriveState.SWITCH_ON_DISABLED}
    rig.step()
    assert "DRV-04" in rig.codes
    assert rig.axis.power.phase is P.TORQUE_OFF


def test_a_drive_that_has_shut_its_own_brake_at_rest_has_ended_its_quick_stop():
    rig = OwnBrake()
    rig.until(lambda: rig.axis.power.phase is P.CLOSING, 3.0)
    rig.says = {"state": DriveState.SWITCH_ON_DISABLED, "brake_open": False}
    rig.run(0.2)
    assert rig.axis.is_off
    assert rig.codes == ["INT-06"]


def test_a_drive_that_leaves_before_the_brake_of_the_controller_is_shut_is_told():
    rig = moving_rig()
    rig.op(quick_stop=True)
    rig.until(lambda: rig.axis.power.phase is P.CLOSING, 3.0)
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCH_ON_DISABLED)
    rig.step()
    assert "DRV-04" in rig.codes


@BOTH
def test_the_torque_is_taken_off_by_what_the_motor_gives_and_not_by_what_was_asked_for(way):
    """12 N m were asked for, the loop adds 9: 21 go off in three steps of 7."""
    rig = Rig(config=settings(holding_torque_nm=way * 12.0))
    rig.power_up()
    rig.spoil = lambda drive: drive._replace(torque_act_nm=way * 21.0)
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.UNLOADING)
    for wanted_nm in (5.0, -2.0, -9.0):
        rig.run(0.048)
        assert rig.output.torque_ff_nm == approx(way * wanted_nm)
        rig.run(0.002)


@pytest.mark.parametrize("phase", [P.CLOSING, P.UNLOADING, P.DISABLING])
def test_power_off_while_the_brake_takes_over_the_axis_is_off_and_no_motion_opens_it(phase):
    rig = Rig(config=settings(standstill=StandstillPolicy.BRAKE, hold_brake_after_s=0.3))
    rig.power_up()
    rig.until(lambda: rig.axis.power.phase is phase, 3.0)
    rig.op(power=False)
    rig.run(1.0)
    assert rig.axis.is_off
    assert rig.axis.state is AxisState.DISABLED
    rig.move(5.0)
    rig.run(0.5)
    assert rig.output.request is DriveRequest.DISABLE


def test_no_torque_is_asked_for_any_more_in_the_scan_that_switches_it_off():
    rig = Rig(config=settings(**HOLDS))
    rig.power_up()
    assert rig.output.torque_ff_nm == approx(12.0)
    rig.drive.inputs = OPEN_CHAIN
    rig.step()
    assert rig.output.request is DriveRequest.DISABLE
    assert rig.output.torque_ff_nm == 0.0


def test_a_contact_that_says_closed_brings_no_torque_against_a_brake_that_the_drive_has_opened():
    """C6 at power-up: the brake may be open. Told after 0.4 s, and the brake closes before the torque goes off."""
    rig = Rig(config=settings(brake_by_drive=True, **HOLDS))
    rig.spoil = lambda drive: drive._replace(brake_open=False)
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.RELEASING)
    start, seen = rig.scan, []
    while not rig.axis.is_off:
        rig.step()
        assert rig.output.torque_ff_nm == 0.0
        if rig.output.request is not DriveRequest.DISABLE:
            seen.append((rig.output.request, rig.output.brake_open))
        if rig.codes == []:
            told = rig.scan
    assert rig.codes == ["BRK-01"]
    assert rig.axis.power.proof is Proof.NOT_POSSIBLE
    assert (told + 1 - start) * rig.period_s == approx(0.4, abs=2.0 * rig.period_s)
    # The drive's own quick stop at rest: its torque holds until it has closed the brake.
    assert (DriveRequest.QUICK_STOP, True) in seen
    assert seen[-1] == (DriveRequest.QUICK_STOP, False)


def test_a_contact_that_says_open_before_the_brake_was_opened_ends_the_way_up():
    """150 ms to close and 300 ms for the contact."""
    rig = Rig()
    rig.spoil = lambda drive: drive._replace(brake_open=drive.state is DriveState.OPERATION_ENABLED)
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is not P.ENABLING, 2.0)
    assert (rig.scan * rig.period_s) == approx(0.45, abs=0.02)
    assert rig.codes == ["BRK-06"]
    assert rig.first is not None
    assert not rig.output.brake_open
    assert rig.output.request is DriveRequest.DISABLE


@BOTH
def test_a_stop_by_the_brake_counts_whichever_way_the_axis_turns(way):
    rig = moving_rig(at_deg=0.0 if way > 0.0 else 60.0)
    assert rig.vel_deg_s * way > 0.0
    rig.drive.inputs = OPEN_CHAIN
    rig.step()
    assert rig.axis.power.wear.stops == 1


@pytest.mark.parametrize("missed", [0, 4])
def test_scans_that_were_missed_are_time_of_a_phase(missed):
    """100 ms to open and 300 ms for the contact, however late the controller is."""
    rig = going(P.RELEASING)
    rig.spoil = lambda drive: drive._replace(brake_open=False)
    rig.missed = lambda scan: missed
    start = rig.scan
    rig.until(lambda: bool(rig.codes), 2.0)
    assert rig.codes == ["BRK-01"]
    assert (rig.scan - start) * rig.period_s == approx(0.4, abs=2.0 * (1 + missed) * rig.period_s)


@BOTH
def test_a_slip_in_the_first_scan_of_the_unloading_counts(way):
    rig = going(P.UNLOADING)
    slip(rig, way * 0.021)
    assert rig.codes == ["BRK-03"]
    assert rig.axis.power.phase is P.TORQUE_HOLD


@pytest.mark.parametrize("phase", [P.ENABLING, P.PROVING])
def test_a_brake_test_that_is_not_under_way_is_not_aborted(phase):
    """The way up goes on."""
    rig = Rig(config=settings(**HOLDS))
    rig.run(0.01)
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCHED_ON)
    rig.op(power=True)
    if phase is P.PROVING:
        rig.spoil = None
        rig.until(lambda: rig.axis.power.phase is P.PROVING, 2.0)
    rig.axis.abort_brake_test(Words.STOPPED)
    assert rig.axis.power.phase is phase
    assert rig.axis.brake_test.outcome is BrakeTestOutcome.NONE
    rig.spoil = None
    rig.until(lambda: rig.axis.power.phase is P.ON, 3.0)


def test_a_quick_stop_as_the_drive_opens_its_brake_lets_the_drive_close_it_first():
    """It shows Switched on and is enabled by then: its own quick stop closes the brake, then the torque goes off."""
    rig = Rig(config=settings(brake_by_drive=True, **HOLDS))
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCHED_ON, brake_open=True)
    rig.op(power=True)
    rig.step()
    rig.op(quick_stop=True)
    rig.spoil = lambda drive: drive._replace(state=DriveState.QUICK_STOP_ACTIVE, brake_open=True)
    for _ in range(150):
        assert rig.output.request is DriveRequest.QUICK_STOP
        rig.step()
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCH_ON_DISABLED, brake_open=False)
    rig.run(0.01)
    assert rig.axis.is_off
    assert rig.codes == ["INT-06"]


@pytest.mark.parametrize("owned", [True, False])
def test_a_silence_as_the_drive_opens_its_brake_lets_the_drive_close_it_first(owned):
    """Nobody sees whether it has opened it: its own quick stop for the 150 ms of the brake and 200 ms, then torque off.

    Disabled at once, a crane moved with 0.13 deg/s until its brake had closed (seed 9042 of other axes on the bus).
    """
    rig = Rig(config=settings(brake_by_drive=owned, **HOLDS))
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCHED_ON, brake_open=False)
    rig.op(power=True)
    rig.step()
    ages = itertools.count(1)

    def silent(drive):
        age = next(ages)
        return drive._replace(
            state=DriveState.SWITCHED_ON,
            brake_open=False,
            age_scans=age,
            speed_age_scans=age,
            link=LinkFlag.LATE,
        )

    rig.spoil = silent
    rig.until(lambda: bool(rig.codes), 0.1)
    assert rig.codes == ["CAN-03"]
    asked = 0
    while not rig.axis.is_off:
        rig.step()
        asked += rig.output.request is DriveRequest.QUICK_STOP
    assert rig.output.request is DriveRequest.DISABLE
    assert asked * rig.period_s == approx(0.35 if owned else 0.0, abs=2.0 * rig.period_s)


@pytest.mark.parametrize(("brake_open", "told"), [(True, Reaction.TORQUE_OFF), (False, Reaction.QUICK_STOP)])
def test_a_drive_that_is_stopped_as_it_opens_its_brake_is_told_as_without_torque(brake_open, told):
    """Before Operation enabled it has no ramp whose end closes the brake first: its torque has gone."""
    says = {"state": DriveState.SWITCHED_ON}
    rig = Rig(config=settings(brake_by_drive=True))
    rig.spoil = lambda drive: drive._replace(**says)
    rig.op(power=True)
    rig.run(0.05)
    rig.op(quick_stop=True)
    rig.step()
    assert (rig.axis.power.phase, rig.output.request) == (P.DISABLING, DriveRequest.QUICK_STOP)
    says |= {"state": DriveState.SWITCH_ON_DISABLED, "brake_open": brake_open}
    rig.run(0.02)
    first = rig.axis.alarms.first_out
    assert (first.code, first.reaction) == ("INT-06", told)
    assert rig.output.request is DriveRequest.DISABLE


@pytest.mark.parametrize(("contact", "told"), [(False, Reaction.TORQUE_OFF), (True, Reaction.QUICK_STOP)])
def test_a_drive_that_does_not_end_its_quick_stop_and_shows_no_brake_is_told_as_without_torque(contact, told):
    """The torque goes 0.2 s and the time of the contact behind the closing time, whether its brake holds or not."""
    rig, says = Rig(config=settings(brake_by_drive=True)), {"brake_open": True, "brake_contact": contact}
    rig.spoil = lambda drive: drive._replace(**says)
    rig.power_up()
    rig.op(quick_stop=True)
    says |= {"state": DriveState.QUICK_STOP_ACTIVE, "brake_open": not contact}
    rig.step()
    rig.until(lambda: rig.axis.power.phase not in (P.QUICK_STOPPING, P.CLOSING), 5.0)
    rig.step()
    first = rig.axis.alarms.first_out
    assert (first.code, first.reaction) == ("INT-06", told)
    assert rig.output.request is DriveRequest.DISABLE
