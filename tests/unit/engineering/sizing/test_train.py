"""The rigid drive train against hand calculation and against the simulated rigid plant."""

import math

import numpy as np
import pytest

from gantryctl.engineering.batch import ClosedLoop
from gantryctl.engineering.sizing import equations as eq
from gantryctl.engineering.sizing.duty import cycle_time_s, duty, legs_deg
from gantryctl.engineering.sizing.train import Train, over_angle
from gantryctl.machine import default_machine, with_values
from gantryctl.motion import MotionLimits, SetPoint, plan_velocity
from gantryctl.units import deg, rad
from gantryctl.wiring.program import position_law
from gantryctl.wiring.simulator import gantry_sim


@pytest.fixture
def train(sheet, paper_motor):
    return Train(sheet, paper_motor.motor.inertia_kg_m2)


def test_without_losses_it_is_the_paper_s_equation_with_the_rotor(sheet):
    bare = sheet.model_copy(
        update={
            "load": sheet.load.model_copy(
                update={
                    "eccentric_check_moment_nm": 0.0,
                    "friction_coulomb_nm": 0.0,
                    "friction_viscous_nm_s_per_rad": 0.0,
                }
            ),
            "gears": sheet.gears.model_copy(
                update={
                    "input_inertia_kg_m2": 0.0,
                    "load_loss_ratio": 0.0,
                    "friction_coulomb_nm": 0.0,
                    "friction_viscous_nm_s_per_rad": 0.0,
                }
            ),
        }
    )
    acc = eq.mean_acceleration_rad_s2(1.0, 1.0)
    # eq. (2), then eq. (2) with the rotor; floating point only
    assert Train(bare, 0.0).largest_nm(acc) == pytest.approx(199.5533795, rel=1e-9)
    assert Train(bare, 0.232).largest_nm(acc) == pytest.approx(227.34684, rel=1e-7)
    assert Train(bare, 0.232).efficiency(acc) == pytest.approx(1.0)


def test_the_parts_are_the_whole(train):
    for acc in (train.sizing_acc_rad_s2, train.normal_acc_rad_s2):
        whole = train.motor_nm(acc, train.speed_rad_s, train.sheet.load.eccentric_check_moment_nm)
        assert train.largest_nm(acc) == pytest.approx(float(whole), rel=1e-12)


def test_hand_calculation_of_the_sizing_case(train):
    # 2.18e6 x 0.10472 + 5e4 + 6000 + 2e4 x 0.10472 = 286.4 kN m; / 1144 x 1.1 = 275.4; rotor and input 43.4; 9.09
    assert train.largest_nm(train.sizing_acc_rad_s2) == pytest.approx(275.4 + 43.4 + 9.1, abs=0.2)


def test_losses_help_while_braking(train):
    """Power flows back through the gears: less arrives at the motor than the load gives."""
    w = train.speed_rad_s
    braking = float(train.motor_nm(-train.sizing_acc_rad_s2, w, 0.0))
    lossless = -train.inertia_kg_m2 * train.sizing_acc_rad_s2 * train.ratio
    assert lossless < braking < 0.0


def test_standing_takes_no_friction(train):
    assert float(train.motor_nm(0.0, 0.0, 16e3)) == pytest.approx(16e3 / 1144.0)


def test_eccentric_moment_over_the_angle(train):
    rows = {row.angle_deg: row for row in over_angle(train)}
    assert rows[90.0].against_knm == pytest.approx(16.0, abs=0.02)
    assert rows[0.0].against_knm == pytest.approx(0.0, abs=1e-9)
    assert rows[45.0].against_knm == pytest.approx(16.0 / math.sqrt(2.0), abs=0.02)
    assert max(rows.values(), key=lambda row: row.sizing).angle_deg == 90.0
    for row in rows.values():
        assert row.hold < row.steady < row.normal < row.sizing


@pytest.mark.parametrize(("at_deg", "direction"), [(90.0, 1.0), (90.0, -1.0), (0.0, 1.0)])
def test_the_simulated_rigid_plant_takes_the_same_torque(train, at_deg, direction):
    """Turning steadily: the torque of the simulated motor is what the sheet says, with the same losses."""
    machine = with_values(
        default_machine(), {"plant.switches.rigid": True, "plant.switches.torque_ripple": False}
    )
    speed = direction * rad(6.0)
    limits = MotionLimits(abs(speed), rad(1.0), rad(1.0), math.inf)
    start = rad(at_deg) - direction * rad(18.0 + 6.0)
    plan = plan_velocity(SetPoint(start, 0.0, 0.0), speed, limits)
    loop = ClosedLoop.standing_at(gantry_sim(machine), position_law(machine), start)
    log = loop.run(plan, 8.0)
    near = np.abs(log["pos_load_rad"] - rad(at_deg)) < rad(0.5)
    assert near.any()
    measured = float(np.mean(log["torque_act_nm"][near]))
    against = float(train.against_nm(rad(at_deg)))
    # the rigid plant takes its load-dependent loss from the friction of motor and gears as well: within 4 %
    assert measured == pytest.approx(float(train.motor_nm(0.0, speed, against)), rel=0.04, abs=0.3)


def test_quick_stop_ends_within_the_permitted_angle(train):
    v, a = deg(train.speed_rad_s), deg(train.quick_dec_rad_s2)
    assert v * 0.06 + v**2 / (2.0 * a) == pytest.approx(4.0)


def test_energy_of_motion(train):
    # 0.5 x 2.18e6 x 0.10472^2 + 0.5 x 0.362 x 119.8^2
    assert train.kinetic_energy_j == pytest.approx(11953.0 + 2598.0, rel=1e-3)


def test_a_cycle(train, sheet):
    assert legs_deg(sheet) == [(0.0, 90.0), (90.0, 180.0), (180.0, -90.0), (-90.0, 0.0)]
    day = duty(train)
    # three trapezoids of 90 deg, one of 270 deg (60.25 s) at 0.393 deg/s2
    assert day.moving_s == pytest.approx(3 * 30.252 + 60.253, abs=0.01)
    assert day.cycle_s == pytest.approx(cycle_time_s(sheet))
    assert day.cycle_rms_nm > day.day_rms_nm > 0.0
    # never above what an acceleration against the eccentric moment takes
    assert day.largest_nm <= float(
        train.motor_nm(train.normal_acc_rad_s2, train.speed_rad_s, train.eccentric_nm)
    )


def test_r_m_s_of_holding_alone(sheet, paper_motor):
    """A cycle that stays where it is: the torque of the eccentric moment at 90 deg, all day."""
    duty_of = sheet.duty.model_copy(
        update={"stops_deg": (90.0,), "cycles": 1, "hours": 1.0, "hold_s": 3600.0}
    )
    train = Train(sheet.model_copy(update={"duty": duty_of}), paper_motor.motor.inertia_kg_m2)
    day = duty(train)
    assert day.moving_s == 0.0
    assert day.cycle_rms_nm == pytest.approx(train.eccentric_nm / 1144.0)
    assert day.day_rms_nm == pytest.approx(day.cycle_rms_nm)
    assert day.returned_j == 0.0


def test_no_more_energy_comes_back_than_went_in(train):
    """A round trip gives back less than the kinetic energy of every move and the way down of the centre of mass."""
    day = duty(train)
    most = len(legs_deg(train.sheet)) * train.kinetic_energy_j + 4.0 * train.eccentric_nm
    assert 0.0 < day.returned_j < most


def test_a_swinging_load_doubles_the_accelerating_part(train):
    acc = train.sizing_acc_rad_s2
    inertia = train.sheet.load.inertia_kg_m2 * acc / 13.0
    assert train.reducer_nm(acc, 2.0) - train.reducer_nm(acc) == pytest.approx(inertia)
    assert inertia == pytest.approx(17560.7, rel=1e-4)
