"""Stops by the brake on the true plant of each template: who is told to press the emergency stop, and when."""

from __future__ import annotations

import math

import pytest

from gantryctl.drives.simulated import SimDrive
from gantryctl.engineering.faults.oracle.taps import Oracle
from gantryctl.image import OperatorCommand
from gantryctl.machine import Machine, configs_folder, default_machine, load_machine, with_values
from gantryctl.operation.opening import new_machine
from gantryctl.program.alarms.words import Words
from gantryctl.program.gantry import GantryProgram
from gantryctl.runtime import FixedOperator
from gantryctl.units import deg, rad
from gantryctl.wiring.engine import build_engine
from gantryctl.wiring.program import axis_settings
from support.delivered_axes import DRAFTS, axis_of

HUST = "hust_gantry"
CRANE = "draft of crane_slew"


def machine_of(name: str) -> Machine:
    return with_values(default_machine() if name == HUST else axis_of(name), {"control.scan_period_ms": 4.0})


def emergency_stop(machine: Machine, brake_nm: float | None = None) -> tuple[float | None, float]:
    """Pressed in cruise: when people are told to press it once more, and when the axis rests, s behind the alarm.

    3 s at most: from then on torque catches what the brake does not.
    """
    top = machine.speed.setting_max_deg_s
    ramp_s = top / machine.virtual_axis.acc_deg_s2
    made = new_machine(machine, max(machine.axis.pos_min_deg, -top * ramp_s))
    drive = made.drive
    assert isinstance(drive, SimDrive)
    runs = build_engine(machine, drive)
    operator, program = runs.operator, runs.program
    assert isinstance(operator, FixedOperator)
    assert isinstance(program, GantryProgram)
    axis = program.axis
    operator.command = OperatorCommand(power=True)
    runs.run_for(1.5)
    operator.command = OperatorCommand(
        power=True, move=True, target_rad=rad(machine.axis.pos_max_deg), speed_rad_s=rad(top)
    )
    runs.run_for(1.2 * ramp_s + 0.3)
    assert deg(axis.feedback.vel_rad_s) > 0.75 * top
    if brake_nm is not None:
        drive.change_plant("brake_torque_nm", brake_nm)
    drive.faults.estop_ok = False
    runs.run_until(lambda _: axis.alarms.first_out is not None, 0.1)
    first = axis.alarms.first_out
    assert first is not None
    begin_s = runs.time_s
    told_s: float | None = None
    while axis.power.falling and runs.time_s < begin_s + 2.9:
        runs.step()
        if told_s is None and Words.STOP_UNCONFIRMED in first.steps:
            told_s = runs.time_s - begin_s
    return told_s, runs.time_s - begin_s


@pytest.mark.parametrize("name", [HUST, *DRAFTS])
def test_a_stop_by_a_brake_with_a_fifth_less_torque_alarms_nobody(name: str, oracle: Oracle) -> None:
    """It keeps the permitted angle; that of a crane rests 2.2 s after the alarm."""
    machine = with_values(machine_of(name), {"plant.brake.torque_share": 0.8})
    told_s, rests_s = emergency_stop(machine)
    oracle.caught("INV-1")  # by the way of a reference gantry with all of its brake
    assert told_s is None
    assert rests_s < 2.5


# Brake, a swing of the load (0.65 Hz of a crane), 0.3 s of rest. Friction alone slows each a little in that time.
@pytest.mark.parametrize(("name", "least_s"), [(HUST, 0.15 + 0.5 + 0.3), (CRANE, 0.15 + 1.54 + 0.3)])
def test_a_brake_that_slows_nothing_is_told_when_a_sound_one_would_have_slowed_the_axis(
    name: str, least_s: float, oracle: Oracle
) -> None:
    told_s, _ = emergency_stop(machine_of(name), 0.02)
    assert told_s is not None
    assert least_s < told_s < least_s + 0.15
    assert oracle.caught("INV-1")
    oracle.caught("INV-3")  # a crane in the wind


@pytest.mark.parametrize(
    ("name", "changes", "dec_deg_s2"),
    [
        # 6^2 / 2 (4 - 6 x 0.15), 3.6^2 / 2 (10 - 3.6 x 0.15), 0.48^2 / 2 (2 - 0.48 x 0.15)
        (HUST, {}, 5.8065),
        (HUST, {"required.stopping_angle_deg": 5.0}, 4.3902),
        (HUST, {"brake.close_time_ms": 50.0}, 4.8649),
        (CRANE, {}, 0.68499),
        ("draft of wind_turbine_yaw", {}, 0.059751),
    ],
)
def test_the_slowest_braking_is_that_of_the_permitted_angle(
    name: str, changes: dict[str, object], dec_deg_s2: float
) -> None:
    power = axis_settings(with_values(machine_of(name), changes)).power
    assert deg(power.brake_dec_least_rad_s2) == pytest.approx(dec_deg_s2, rel=1e-4)


@pytest.mark.parametrize(("owner", "left_s"), [("drive", math.inf), ("object_60FE", 0.0)])
def test_the_brake_ends_a_ramp_that_nobody_sees_where_it_needs_no_torque_off(owner, left_s):
    """A drive that owns its brake takes its torque off first: how long the load needs then is in [plant]."""
    machine = load_machine(configs_folder() / "hust_can.toml")
    brake = machine.brake.model_copy(update={"owner": owner})
    assert axis_settings(machine.model_copy(update={"brake": brake})).power.unseen_ramp_s == left_s
