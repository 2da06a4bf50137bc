"""Thermal protection of the motor (G12, G13) and the battery of an encoder (A8)."""

import math
from dataclasses import replace

import pytest

from gantryctl.image import DriveFeedback, EncoderFlag
from gantryctl.program import AxisState, PowerPhase, Reaction
from gantryctl.program.monitors.thermal import MotorThermal
from gantryctl.program.settings import ThermalSettings
from unit.program.parts import Parts
from unit.program.rig import Rig, moving_rig, settings
from unit.program.spoiling import expect

TAU_S = 1800.0
RATED_NM = 257.0


def showing(**values):
    return lambda drive: drive._replace(**values)


def after_minutes(rig: Rig, minutes: float) -> None:
    """Scans that were missed stand for the minutes: the thermal model counts time, not scans."""
    rig.missed = lambda scan: round(minutes * 60.0 / rig.period_s) - 1
    rig.step()
    rig.missed = lambda scan: 0


def winding_c(share: float) -> float:
    """Temperature at which the sensor shows that share: class F, 115 K over 40 C."""
    return 40.0 + 115.0 * share


@pytest.mark.parametrize("period_s", [0.001, 0.004, 0.01])
def test_g12_warning_at_80_refusal_at_95_and_the_move_ends(period_s):
    rig = moving_rig(config=settings(period_s=period_s))
    rig.spoil = showing(motor_temp_c=winding_c(0.79))
    rig.run(0.5)
    assert not rig.codes
    rig.spoil = showing(motor_temp_c=winding_c(0.81))
    rig.run(0.2)
    assert rig.codes == ["THM-01"]
    rig.spoil = showing(motor_temp_c=winding_c(0.96))
    rig.run(0.2)
    assert rig.codes == ["THM-01", "THM-03"]
    # 30 min x ln(0.96 / 0.80) = 5.5 min
    assert "ready again in 6 min" in rig.axis.alarms.active["THM-03"].text
    assert rig.axis.state is AxisState.DISCRETE_MOTION
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL, 30.0)
    assert rig.pos_deg == pytest.approx(100.0, abs=0.005), "the move ends where it was to end"
    rig.move(90.0)
    assert "THM-03 is active" in rig.refused()


def test_g12_a_reset_does_not_open_motion_while_it_is_hot_and_80_percent_does():
    rig = moving_rig(config=replace(settings(), thermal=ThermalSettings(time_constant_s=0.1)))
    rig.spoil = showing(motor_temp_c=winding_c(0.96))
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL, 30.0)
    for share, open_again in ((0.96, False), (0.81, False), (0.79, True)):
        rig.spoil = showing(motor_temp_c=winding_c(share))
        rig.run(2.0)  # the model follows the sensor down only with its own time constant
        rig.op(reset=True)
        rig.op(reset=False)
        rig.run(0.2)
        rig.move(95.0)
        rig.run(0.1)
        assert (rig.axis.state is AxisState.DISCRETE_MOTION) is open_again, share


def test_g12_100_percent_is_a_quick_stop():
    rig = moving_rig()
    rig.spoil = showing(motor_temp_c=winding_c(1.001))
    expect(rig, "THM-04", Reaction.QUICK_STOP, 0.1, "100 % of its thermal limit", "ready again in 7 min")


def test_g12_the_overload_account_of_the_drive_counts_too():
    rig = moving_rig()
    rig.spoil = showing(overload=0.97)
    rig.run(0.2)
    assert rig.codes == ["THM-01", "THM-03"]
    assert "when the drive has recovered" in rig.axis.alarms.active["THM-03"].text
    rig.spoil = showing(overload=1.0)
    expect(rig, "THM-04", Reaction.QUICK_STOP, 0.1)


def test_an_overload_that_is_no_number_stops():
    rig = moving_rig()
    rig.spoil = showing(overload=math.nan)
    expect(rig, "THM-04", Reaction.QUICK_STOP, 0.1)


@pytest.mark.parametrize("share_of_torque", [0.5, 1.0, 1.2])
def test_the_model_follows_the_square_of_the_torque(share_of_torque):
    rig = Rig(config=settings(period_s=0.01))
    rig.spoil = showing(torque_act_nm=share_of_torque * RATED_NM)
    rig.run(0.2)
    for _ in range(60):
        after_minutes(rig, 1.0)
        rig.step()
    # First-order rise towards the square; the first tenth of a second is all that a look may be late.
    expected = share_of_torque**2 * (1.0 - math.exp(-60.0 * 60.0 / TAU_S))
    assert rig.axis.thermal.share == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("torque_nm", [math.nan, math.inf, -1e300])
def test_an_absurd_torque_does_not_heat_the_model(torque_nm):
    rig = Rig()
    rig.spoil = showing(torque_act_nm=torque_nm)
    rig.run(1.0)
    assert rig.axis.thermal.share == 0.0


def test_a_load_that_only_the_motor_holds_keeps_its_torque_when_it_is_too_hot():
    rig = moving_rig()
    rig.drive.error_code = 0x8611
    rig.run(0.1)
    rig.spoil = showing(overload=1.0)
    rig.run(0.5)
    assert rig.codes[0] == "DRV-01"
    assert "THM-04" not in rig.codes


@pytest.mark.parametrize("reading_c", [999.0, -200.0, math.nan, math.inf])
def test_g13_a_broken_sensor_warns_after_a_second_and_the_axis_goes_on_with_half_of_the_limit(reading_c):
    rig = moving_rig()
    rig.spoil = showing(motor_temp_c=reading_c)
    rig.run(0.9)
    assert not rig.codes, "a single disturbed reading is no fault"
    rig.run(0.3)
    assert rig.codes == ["THM-02"]
    assert rig.axis.state is AxisState.DISCRETE_MOTION
    before = rig.axis.thermal.share
    rig.spoil = None
    rig.run(0.2)
    assert rig.axis.thermal.share == pytest.approx(before / 2.0, rel=1e-2)


def test_a_machine_without_a_sensor_is_not_watched_for_one():
    rig = moving_rig()
    rig.run(2.0)
    assert not rig.codes


# --- the battery of an encoder ---------------------------------------------------------------------


def battery(drive: DriveFeedback) -> DriveFeedback:
    return drive._replace(encoder=EncoderFlag.BATTERY)


def test_a8_at_the_start_the_angle_is_not_valid_and_nothing_is_enabled():
    rig = Rig(config=settings(monitors={"encoder_battery": True}))
    rig.spoil = battery
    rig.op(power=True)
    rig.run(0.5)
    assert rig.codes == ["ENC-13"]
    assert not rig.axis.feedback.position_valid
    assert rig.axis.power.phase is PowerPhase.OFF
    assert "service role only" in str(rig.axis.reset())
    # Service compares the angle; while the battery is bad it comes again.
    assert rig.axis.reset(service=True) is None
    rig.run(0.1)
    assert rig.codes == ["ENC-13"]
    rig.spoil = None
    assert rig.axis.reset(service=True) is None
    rig.run(0.1)
    assert rig.axis.feedback.position_valid
    assert not rig.codes


def test_a8_in_motion_the_move_ends_and_no_other_begins():
    rig = moving_rig(config=settings(monitors={"encoder_battery": True}))
    rig.spoil = battery
    rig.run(0.1)
    assert rig.codes == ["ENC-13"]
    assert rig.axis.feedback.position_valid, "with its supply on the encoder counts on"
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL, 30.0)
    rig.move(90.0)
    assert "ENC-13 is active" in rig.refused()


def test_a_geared_encoder_has_no_battery():
    rig = moving_rig()
    rig.spoil = battery
    rig.run(0.5)
    assert not rig.codes


@pytest.mark.parametrize("way", [1.0, -1.0], ids=["plus", "minus"])
def test_a_motor_without_its_sensor_may_be_half_as_warm(way):
    """Ten time constants of 0.7 of the rated torque: 0.49 of the limit, of a half 98 %; either way of the torque."""
    rig = Rig(config=replace(settings(period_s=0.01), thermal=ThermalSettings(time_constant_s=0.2)))
    rig.spoil = showing(torque_act_nm=way * 0.7 * RATED_NM)
    rig.run(2.0)
    assert rig.axis.thermal.share == pytest.approx(0.49, abs=1e-3)
    rig.spoil = showing(torque_act_nm=way * 0.7 * RATED_NM, motor_temp_c=999.0)
    rig.run(1.2)
    assert rig.axis.thermal.share == pytest.approx(0.98, abs=2e-3)
    assert "THM-03" in rig.codes


def test_a_motor_that_was_warm_when_its_sensor_failed_is_warm():
    """90 C are 50 of 115 K: 0.435, which is 0.87 of a half."""
    rig = Rig()
    rig.spoil = showing(motor_temp_c=90.0)
    rig.run(0.3)
    rig.spoil = showing(motor_temp_c=-200.0)
    rig.run(1.3)
    assert rig.axis.thermal.share == pytest.approx(0.8696, abs=2e-3)
    assert set(rig.codes) == {"THM-01", "THM-02"}


def test_what_is_too_hot_is_told_again_in_the_scan_after_a_reset():
    parts = Parts()
    thermal = MotorThermal(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.overload = 0.96
    thermal.scan(1.0)
    assert "THM-03" in parts.codes
    parts.alarms.clear()
    thermal.scan(1.001)
    assert "THM-03" in parts.codes


def test_a_motor_that_is_warm_is_looked_at_ten_times_a_second():
    parts = Parts()
    thermal = MotorThermal(parts.settings, parts.feedback, parts.alarms)
    thermal.scan(1.0)
    parts.feedback.overload = 0.81
    thermal.scan(1.099)
    assert parts.codes == []
    thermal.scan(1.1)
    assert parts.codes == ["THM-01"]


def test_a_winding_that_the_model_knows_to_be_warm_is_not_cooled_by_a_sensor_that_shows_less():
    """Ten time constants of 0.7 of the rated torque are 0.49; 40 C is no rise at all."""
    parts = Parts()
    thermal = MotorThermal(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.torque_nm = 0.7 * RATED_NM
    thermal.scan(10.0 * TAU_S)
    parts.feedback.motor_temp_c = 40.0
    for look in (0.2, 0.4, 0.6):
        thermal.scan(10.0 * TAU_S + look)
    assert thermal.share == pytest.approx(0.49, abs=1e-3)


def test_a_motor_that_has_cooled_is_kept_back_at_95_percent_again_and_not_at_80():
    rig = Rig(config=replace(settings(), thermal=ThermalSettings(time_constant_s=0.1)))
    found = []
    for share in (0.96, 0.79, 0.90, 0.96):
        rig.spoil = showing(motor_temp_c=winding_c(share))
        rig.run(0.5)
        rig.op(reset=True)
        rig.op(reset=False)
        rig.run(0.2)
        found.append(rig.codes)
    assert found == [["THM-01", "THM-03"], [], ["THM-01"], ["THM-01", "THM-03"]]


@pytest.mark.parametrize("way", [1.0, -1.0], ids=["plus", "minus"])
def test_torque_of_either_direction_warms_alike(way: float) -> None:
    """Rated torque for one time constant: 1 - 1/e of the limit."""
    parts = Parts()
    thermal = MotorThermal(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.torque_nm = way * RATED_NM
    thermal.scan(0.0)
    thermal.scan(TAU_S)
    assert thermal.share == pytest.approx(1.0 - math.exp(-1.0))


def test_a_sensor_that_comes_back_gives_the_whole_limit_back():
    """0.49 of the limit by ten time constants, 0.98 of a half while nobody knows the winding; 60 C are 0.17."""
    rig = Rig(config=replace(settings(period_s=0.01), thermal=ThermalSettings(time_constant_s=0.2)))
    rig.spoil = showing(torque_act_nm=0.7 * RATED_NM, motor_temp_c=999.0)
    rig.run(2.0)
    assert rig.axis.thermal.share == pytest.approx(0.98, abs=2e-3)
    rig.spoil = showing(torque_act_nm=0.7 * RATED_NM, motor_temp_c=60.0)
    rig.run(0.3)
    assert rig.axis.thermal.share == pytest.approx(0.49, abs=1e-3)
