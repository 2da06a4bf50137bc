"""The power sequence on its way up: order, proof, refusals."""

import pytest

from gantryctl.image import DigitalInputs, DriveRequest, DriveState
from gantryctl.program import AxisState
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.permission import why_no_torque
from gantryctl.program.power.phases import Proof
from gantryctl.units import rad
from unit.program.parts import PERIODS, Parts
from unit.program.power_steps import P, record, slip
from unit.program.rig import RATIO, Rig, settings


def test_up_in_order_and_status_last():
    rig = Rig()
    rig.run(0.01)
    assert rig.output.request is DriveRequest.DISABLE
    rig.op(power=True)
    phases = [phase for phase, _ in record(rig, 1.0)]
    assert phases == [P.ENABLING, P.PROVING, P.SETTLING, P.RELEASING, P.SAG_WATCH, P.ON]
    assert rig.program.power.status
    assert rig.axis.state is AxisState.STANDSTILL
    assert rig.axis.power.proof is Proof.PROVEN


def test_the_brake_opens_only_after_torque_was_proven():
    rig = Rig()
    rig.operator = rig.operator._replace(power=True)
    proven = False
    for _ in range(1000):
        rig.step()
        proven = proven or rig.image.drive.torque_act_nm >= 0.8 * 30.0
        assert proven or not rig.output.brake_open
        assert rig.output.vel_cmd_rad_s == 0.0, "no speed on the way up"
    assert rig.output.brake_open


def test_no_power_without_a_rising_edge_after_a_stop():
    rig = Rig()
    rig.power_up()
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.run(0.5)
    rig.drive.inputs = DigitalInputs()
    rig.op(reset=True)
    rig.op(reset=False)
    rig.run(1.0)
    assert rig.axis.state is AxisState.DISABLED, "Enable is still TRUE, and nothing switches on"
    assert rig.output.request is DriveRequest.DISABLE
    rig.op(power=False)
    rig.power_up()


def test_proof_torque_then_preload_which_stays():
    rig = Rig(config=settings(holding_torque_nm=-12.0))
    rig.op(power=True)
    outputs = dict(record(rig, 1.0))
    assert outputs[P.ENABLING].torque_ff_nm in (0.0, -30.0)
    assert outputs[P.PROVING].torque_ff_nm == -30.0, "the proof pushes the way the load is held"
    assert outputs[P.RELEASING].torque_ff_nm == pytest.approx(-12.0)
    rig.run(5.0)
    assert rig.output.torque_ff_nm == pytest.approx(-12.0), "constant while on: no bump"


def test_a_load_above_the_proof_torque_is_proven_with_its_own():
    rig = Rig(config=settings(holding_torque_nm=50.0))
    rig.op(power=True)
    assert dict(record(rig, 1.0))[P.PROVING].torque_ff_nm == pytest.approx(50.0)


@pytest.mark.parametrize("held", [float("nan"), float("inf"), 1e6])
def test_a_retained_torque_that_cannot_be_is_not_given(held):
    rig = Rig(config=settings(holding_torque_nm=held))
    rig.op(power=True)
    for _ in range(1000):
        rig.step()
        assert abs(rig.output.torque_ff_nm) <= 385.0


def test_torque_not_proven_keeps_the_brake_closed():
    rig = Rig()
    rig.spoil = lambda drive: drive._replace(torque_act_nm=10.0)
    rig.op(power=True)
    for _ in range(1500):
        rig.step()
        assert not rig.output.brake_open
    assert rig.codes == ["BRK-07"]
    assert rig.axis.state is AxisState.ERROR_STOP
    assert "Torque 10 N m after 501 ms, at least 24 N m required" in rig.first.text
    assert rig.output.request is DriveRequest.DISABLE


def test_a_brake_that_slips_under_the_proof_is_held():
    rig = Rig()
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.PROVING)
    rig.spoil = lambda drive: drive._replace(torque_act_nm=0.0)
    slip(rig, 0.03)
    rig.run(0.01)
    assert rig.codes == ["BRK-03"]
    assert rig.axis.power.phase is P.TORQUE_HOLD
    assert rig.output.request is DriveRequest.ENABLE
    assert rig.output.vel_cmd_rad_s == 0.0


def test_brake_that_does_not_release():
    rig = Rig()
    rig.spoil = lambda drive: drive._replace(brake_open=False)
    rig.op(power=True)
    rig.run(2.0)
    assert rig.codes == ["BRK-01"]
    assert "limit 400 ms" in rig.first.text, "opening time plus feedback time"
    assert not rig.output.brake_open
    assert rig.output.request is DriveRequest.DISABLE


def test_sag_after_release_closes_again():
    rig = Rig()
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.SAG_WATCH)
    slip(rig, -0.021)
    rig.run(1.0)
    assert rig.codes == ["BRK-10"]
    assert "Moved 0.0210 deg after the brake opened, limit 0.0200 deg" in rig.first.text
    assert not rig.output.brake_open
    assert rig.axis.power.phase is P.OFF


def test_sag_within_the_limit_is_accepted_and_held_where_it_is():
    rig = Rig()
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.SAG_WATCH)
    slip(rig, -0.015)
    rig.run(0.5)
    assert rig.axis.power.phase is P.ON
    assert rig.ref_deg == pytest.approx(-0.015, abs=1e-6), "the set-point begins where the axis is"


def test_a_contact_that_says_open_is_not_a_drive_that_opens_its_brake():
    """Where only the controller opens the brake: nothing is released, and people are told why."""
    rig = Rig(config=settings())
    rig.run(0.1)
    rig.spoil = lambda drive: drive._replace(brake_open=True)
    rig.op(power=True)
    rig.until(lambda: bool(rig.codes), 2.0)
    assert rig.codes == ["BRK-06"]
    # Closing time and 300 ms of the contact.
    assert "Brake feedback says open for 451 ms, commanded closed" in rig.first.text
    rig.run(0.5)
    assert rig.axis.power.phase is P.OFF
    assert not rig.output.brake_open


def test_a_contact_that_is_late_at_power_up_is_waited_for():
    """The torque goes off behind the closed brake, as it does after any other power-up."""
    rig = Rig(config=settings())
    rig.run(0.1)
    rig.spoil = lambda drive: drive._replace(brake_open=True)
    rig.op(power=True)
    rig.run(0.3)
    assert rig.axis.power.phase is P.ENABLING
    rig.spoil = None
    rig.until(lambda: rig.axis.power.phase is P.ON, 2.0)
    assert rig.axis.power.proof is Proof.PROVEN
    rig.op(power=False)
    assert P.UNLOADING in [phase for phase, _ in record(rig, 1.0)]
    assert not rig.codes


@pytest.mark.parametrize(
    ("deg_s", "told"),
    [(-0.08, "ENC-12"), (0.08, "DRV-14"), (0.0, "DRV-14")],
    ids=["against", "with", "stands"],
)
def test_more_torque_than_asked_for_against_the_turn_of_the_shaft_is_no_wrong_torque_reading(deg_s, told):
    """-225 N m where 30 N m are asked for: a slipping brake, and a drive that pushes where it means to brake."""
    rig = Rig()
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.PROVING)
    vel = -rad(deg_s) * RATIO
    rig.spoil = lambda drive: drive._replace(torque_act_nm=-225.0, vel_act_rad_s=vel)
    rig.step()
    assert rig.codes == [told]
    assert rig.axis.feedback.position_valid is (told != "ENC-12")


@PERIODS
def test_drive_that_opens_the_brake_itself(period_s):
    """No proof is possible then; the sequence is accepted, the sag watched, and the report mentions it."""
    rig = Rig(config=settings(brake_by_drive=True, period_s=period_s))

    def own_brake(drive):
        return drive._replace(brake_open=drive.state is DriveState.OPERATION_ENABLED)

    rig.spoil = own_brake
    rig.op(power=True)
    phases = [phase for phase, _ in record(rig, 1.0)]
    assert phases == [P.ENABLING, P.SAG_WATCH, P.ON]
    assert rig.axis.power.proof is Proof.NOT_POSSIBLE
    rig.op(power=False)
    rig.run(1.0)
    assert rig.axis.power.phase is P.OFF
    assert not rig.codes


def test_no_preload_means_no_proof():
    rig = Rig(config=settings(torque_preload=False))
    rig.operator = rig.operator._replace(power=True)
    for _ in range(1000):
        rig.step()
        assert rig.output.torque_ff_nm == 0.0
    assert rig.axis.power.proof is Proof.NOT_POSSIBLE
    assert rig.program.power.status
    rig.op(power=False)
    rig.run(1.0)
    assert rig.axis.power.phase is P.OFF


@pytest.mark.parametrize(
    "stuck", [DriveState.SWITCH_ON_DISABLED, DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON]
)
def test_drive_stuck_on_the_way_up(stuck):
    rig = Rig()
    rig.spoil = lambda drive: drive._replace(state=stuck)
    rig.op(power=True)
    rig.run(3.0)
    assert rig.codes == ["DRV-03"]
    assert f"Drive stuck in {stuck.name.replace('_', ' ').capitalize()} for 2001 ms" in rig.first.text
    assert rig.output.request is DriveRequest.DISABLE


@pytest.mark.parametrize(
    ("inputs", "state", "reason"),
    [
        (DigitalInputs(mains_ready=False), None, "the mains are not ready"),
        (DigitalInputs(estop_ok=False), None, "reset first"),
        (DigitalInputs(), DriveState.UNKNOWN, "its state is unknown"),
        (DigitalInputs(), DriveState.FAULT, "DRV-01 is latched"),
    ],
)
def test_power_is_refused_with_the_reason(inputs, state, reason):
    rig = Rig()
    rig.drive.inputs = inputs
    if state is not None:
        rig.spoil = lambda drive: drive._replace(state=state)
    rig.run(0.01)
    rig.op(power=True)
    assert reason in rig.refused()
    assert rig.program.power.error
    rig.run(1.0)
    assert rig.output.request is not DriveRequest.ENABLE


def test_torque_is_refused_with_an_open_chain_before_an_alarm_says_so():
    parts = Parts()
    parts.feedback.state = DriveState.SWITCH_ON_DISABLED
    assert why_no_torque(parts.feedback, parts.alarms) is None
    parts.feedback.inputs = DigitalInputs(estop_ok_2=False)
    refused = why_no_torque(parts.feedback, parts.alarms)
    assert refused is not None
    assert "emergency" in refused.text


@pytest.mark.parametrize("known", [True, False])
def test_a_brake_without_a_contact_is_not_told_as_open(known):
    rig = Rig()
    rig.spoil = lambda drive: drive._replace(brake_open=True, brake_contact=known)
    rig.run(0.6)
    assert rig.codes == (["BRK-06"] if known else [])


def test_torque_is_refused_on_an_angle_in_doubt():
    parts = Parts()
    parts.feedback.state = DriveState.SWITCH_ON_DISABLED
    parts.feedback.in_doubt = True
    refused = why_no_torque(parts.feedback, parts.alarms)
    assert refused is not None
    assert refused.values["reason"] is Words.POSITION_NOT_VALID
