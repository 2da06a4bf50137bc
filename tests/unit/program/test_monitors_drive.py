"""Monitors of brake, drive and inputs, and the latch of alarms. Feedback is spoiled, never the controller."""

import math

import pytest

from gantryctl.image import DigitalInputs, DriveRequest, DriveState, EncoderFlag, LinkFlag
from gantryctl.program import AxisState, Code, PowerPhase, Reaction
from gantryctl.program.alarms.words import Words
from gantryctl.program.monitors.interlocks import Interlocks
from gantryctl.units import rad
from unit.program.parts import Parts
from unit.program.rig import COUNTS_PER_DEG, Rig, moving_rig, settings
from unit.program.spoiling import POSITION_ALONE, counts, expect

# --- brake, drive, inputs -------------------------------------------------------------------------


def test_c5_brake_closes_in_motion_and_the_axis_feels_it():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(brake_open=False, torque_limited=True)
    expect(rig, "BRK-05", Reaction.TORQUE_OFF, 0.0, "Brake feedback says closed at 6.00 deg/s")


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
    monitors = {"following_error_base_rad": 1.0, "standstill_time_s": 10.0} | POSITION_ALONE
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


def test_an_error_code_that_comes_later_is_told_in_the_same_alarm():
    rig = moving_rig()
    code = 0
    rig.spoil = lambda drive: drive._replace(state=DriveState.FAULT, error_code=code)
    rig.step()
    assert rig.first.code == "DRV-01"
    assert "without an error code" in rig.first.text
    code = 0x7305
    rig.step()
    assert "hexadecimal 7305" in rig.first.text
    assert rig.codes.count("DRV-01") == 1


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


@pytest.mark.parametrize("flag", [LinkFlag.NONE, LinkFlag.LATE])
def test_a_connection_without_a_fault_raises_nothing(flag):
    rig = moving_rig(speed_deg_s=0.6)
    rig.spoil = lambda drive: drive._replace(link=flag)
    rig.run(0.1)
    assert rig.codes == []


@pytest.mark.parametrize(
    ("error_code", "code"),
    [(0x3210, "DRV-10"), (0x8250, "CAN-05"), (0x8130, "CAN-05"), (0x8611, "DRV-01"), (0, "DRV-01")],
)
@pytest.mark.parametrize("state", [DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE])
def test_a_fault_of_the_drive_has_the_alarm_of_its_cause(error_code, code, state):
    parts = Parts()
    interlocks = Interlocks(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.state, parts.feedback.error_code = state, error_code
    interlocks.scan(0.0, powered=True)
    assert parts.codes == [code]
    interlocks.scan(0.0, powered=True)
    assert parts.codes == [code], "the same fault is told once"


LIMITS = {
    "plus": ([(False, True)], {"LIM-03": Words.PLUS}),
    "minus": ([(True, False)], {"LIM-03": Words.MINUS}),
    "both": ([(False, False)], {"LIM-04": None}),
    "one after the other": ([(False, True), (False, False)], {"LIM-03": Words.PLUS, "LIM-04": None}),
    "back and the other": ([(False, True), (True, True), (True, False)], {"LIM-03": Words.PLUS}),
}


@pytest.mark.parametrize("name", LIMITS)
def test_a_limit_switch_that_opens_is_told_with_its_side_and_both_are_a_wire(name):
    opened, told = LIMITS[name]
    parts = Parts()
    interlocks = Interlocks(parts.settings, parts.feedback, parts.alarms)
    for plus, minus in [(True, True), *opened]:
        parts.feedback.inputs = DigitalInputs(limit_plus_ok=plus, limit_minus_ok=minus)
        interlocks.scan(0.0, powered=True)
        assert (interlocks.plus_open, interlocks.minus_open) == (plus, minus)
    sides = {str(code): alarm.values.get("side") for code, alarm in parts.alarms.active.items()}
    assert sides == told


@pytest.mark.parametrize(
    ("plus", "minus", "codes"),
    [(False, True, []), (True, False, []), (False, False, ["LIM-04"]), (True, True, [])],
)
def test_one_limit_switch_that_is_open_in_the_first_scan_is_where_the_axis_stands(plus, minus, codes):
    parts = Parts()
    interlocks = Interlocks(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.inputs = DigitalInputs(limit_plus_ok=plus, limit_minus_ok=minus)
    interlocks.scan(0.0, powered=True)
    assert parts.codes == codes


def test_a_fault_keeps_the_first_code_that_the_drive_has_shown_for_it():
    """None at first, then one, then none again."""
    parts = Parts()
    interlocks = Interlocks(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.state = DriveState.FAULT
    told = []
    for code in (0, 0x8611, 0, 0):
        parts.feedback.error_code = code
        interlocks.scan(0.0, powered=True)
        told.append(str(parts.alarms.active[Code.DRV_01].values["measured"]))
    assert told[0] != told[1] == told[2] == told[3]
