"""Cogging, errors of the motor encoder, moment of the cables: each by its closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl import _core
from gantryctl.units import rad
from gantryctl.wiring.simulator import drive_params, gantry_sim, plant_params
from physics.plants import at_instant, bare, controlled, follow, hold, machine, put, released, simulator

CABLE = {
    "plant.switches.cable": True,
    "plant.cable.moment_nm": 400.0,
    "plant.cable.moment_2_nm_per_rad2": 300.0,
    "plant.cable.moment_3_nm_per_rad3": -200.0,
}


def test_cogging_is_a_wave_of_the_motor_angle() -> None:
    p = bare("rigid", cogging_torque_nm=2.0, cogging_order=72, cogging_phase_rad=0.4)
    p.cogging = True
    inertia = p.inertia_motor_kg_m2 + p.inertia_load_kg_m2 / p.ratio**2
    for motor in (0.0, 0.01, 1.0, -2.3, 900.0):
        found = at_instant(p, pos_motor=motor, pos_load=motor / p.ratio, torque_motor=0.0)[1]["vel_motor"]
        # 72 x an angle of some hundred rad: its last bits.
        assert found * inertia == pytest.approx(2.0 * math.sin(72 * motor + 0.4), abs=1e-9)


def test_cogging_keeps_the_energy() -> None:
    """A free motor over many periods: 1/2 J w^2 + a/n cos(n thm + p) stays."""
    p = bare("rigid", cogging_torque_nm=20.0, cogging_order=72)
    p.cogging = True
    x = follow(released(p, steps=8, vel_motor=1.5, vel_load=1.5 / p.ratio), 0.0, 0.5)
    inertia = p.inertia_motor_kg_m2 + p.inertia_load_kg_m2 / p.ratio**2
    energy = 0.5 * inertia * x["vel_motor"] ** 2 + 20.0 / 72 * np.cos(72 * x["pos_motor"])
    assert np.ptp(np.cos(72 * x["pos_motor"])) > 1.9
    assert np.max(np.abs(energy - energy[0])) < 1e-6 * 20.0 / 72


def test_a_motor_gives_its_own_torque_constant_times_the_current() -> None:
    """Te is what the drive believes; on the shaft are 0.97 Te, also when it is warm: 0.97 (1 - 0.001 x 50)."""
    changes = {"plant.motor.torque_constant_ratio": 0.97, "drive.current_loop.ideal": True}
    rigid = dict.fromkeys(
        (
            f"plant.switches.{name}"
            for name in ("motor_friction", "roller_friction", "eccentric_moment", "torque_ripple")
        ),
        False,
    ) | {"plant.switches.rigid": True}
    warm = {
        "plant.switches.thermal": True,
        "plant.thermal.motor_start_k": 50.0,
        "plant.thermal.motor_end_k": 50.0,
    }
    for more, factor in (({}, 0.97), (warm, 0.97 * 0.95)):
        p = plant_params(machine(changes | rigid | more))
        inertia = p.inertia_motor_kg_m2 + p.inertia_load_kg_m2 / p.ratio**2
        found = at_instant(p, 100.0)[1]["vel_motor"]
        assert found * inertia == pytest.approx(100.0 * factor, rel=1e-9)
    assert not plant_params(machine()).torque_constant


def test_a_weak_motor_moves_as_one_whose_drive_has_less_gain_limits_and_feed_forward() -> None:
    """The same motion, whichever of the two is 3 % less; but the drive reports the torque it believes in.

    The ripple goes with what the drive asks for, so it is off.
    """
    off = {"plant.switches.torque_ripple": False, "virtual_axis.profile": "jerk_limited"}
    weak = machine(off | {"plant.motor.torque_constant_ratio": 0.97})
    usual = machine(off)
    less = drive_params(usual)
    for name in ("kvp_nm_s_per_rad", "torque_max_nm", "torque_rated_nm"):
        setattr(less, name, 0.97 * getattr(less, name))
    a, b = gantry_sim(weak), gantry_sim(usual, drive=less)
    for sim in (a, b):
        sim.static_start(rad(40.0), True)
    for k in range(400):
        # A speed that rises within 0.2 s, fed forward; 2000 N m are beyond the limit of the drive.
        speed, ff = 40.0 * min(1.0, k / 200.0), 2000.0 if 250 <= k < 270 else 60.0 * (k < 200)
        a.scan(1, speed, ff, True)
        b.scan(1, speed, 0.97 * ff, True)
    for name in ("pos_motor", "vel_motor", "pos_load", "vel_load", "pos_base"):
        assert a.state[name] == pytest.approx(b.state[name], rel=1e-9, abs=1e-12), name
    assert 0.97 * a.state["torque_motor"] == pytest.approx(b.state["torque_motor"], rel=1e-6)
    assert a.state["vel_motor"] > 5.0


def test_a_weak_motor_starts_in_balance() -> None:
    m = machine({"plant.motor.torque_constant_ratio": 0.9})
    held = controlled(m, hold(rad(70.0)), 0.5, gantry_sim(m))
    # As with the torque constant that the drive knows: steps of the encoder, 7.5e-8 deg at the load.
    assert np.max(np.abs(held["pos_load_rad"] - held["pos_load_rad"][0])) < rad(1e-5)


def test_the_encoder_errs_within_its_period_and_its_turn() -> None:
    d = drive_params(
        machine({"plant.switches.encoder_errors": True, "plant.encoder.eccentricity_phase_rad": 0.3})
    )
    turn = 2.0 * math.pi
    for motor in (0.0, 1e-4, 0.7, -3.0, 3594.0):
        wanted = (
            8e-5 * math.sin(math.fmod(motor, turn) + 0.3)
            + 1.5e-5 * math.sin(2048 * math.fmod(motor, turn))
            + 1.5e-5 * math.sin(2 * 2048 * math.fmod(motor, turn))
        )
        # 2048 periods of an angle of 3594 rad: rounding of 5e-13 rad in it.
        assert _core.encoder_error(d, motor) == pytest.approx(wanted, abs=1e-12)
    assert _core.encoder_error(drive_params(machine()), 0.7) == 0.0


def test_drive_and_reading_see_the_encoder_s_error() -> None:
    """An ideal encoder with errors: the reading is angle + error, and at rest the drive holds what it sees."""
    m = machine({"plant.switches.encoder_errors": True, "drive.speed_loop.feedback": "ideal"})
    sim, count = gantry_sim(m), 2.0 * math.pi / 2**22
    sim.static_start(0.4, True)
    motor = sim.state["pos_motor"]
    read = (sim.feedback(count)[0] - sim.count_offset) * count
    # The count offset of 2048 turns takes digits.
    assert read - motor == pytest.approx(_core.encoder_error(drive_params(m), motor), abs=1e-9)
    assert sim.state["drive_pos_last"] == pytest.approx(
        motor + _core.encoder_error(drive_params(m), motor), abs=1e-12
    )


def test_cables_pull_by_their_polynomial_and_hold_by_their_hysteresis() -> None:
    m = machine(
        CABLE
        | {
            "plant.switches.base": False,
            "plant.switches.eccentric_moment": False,
            "plant.switches.gear_error": False,
        }
    )
    p, sim = plant_params(m), gantry_sim(m)
    for theta in (-3.0, 0.0, 0.5, 2.0):
        sim.static_start(theta, True)
        moment = 400.0 - 800.0 * theta + 300.0 * theta**2 - 200.0 * theta**3
        assert sim.state["torque_motor"] == pytest.approx(-moment / p.ratio, rel=1e-12)
    bent = [
        at_instant(p, cable_z=side * p.cable_presliding_rad, pos_load=0.0)[1]["vel_load"] for side in (1, -1)
    ]
    assert (bent[1] - bent[0]) * p.inertia_load_kg_m2 == pytest.approx(2 * 600.0, rel=1e-6)


def test_cables_without_hysteresis_keep_the_energy() -> None:
    p = bare(
        "rigid", cable_moment_1_nm=-5e4, cable_moment_2_nm=1e4, cable_moment_3_nm=-2e4, cable_moment_nm=3e3
    )
    p.cable, p.cable_friction_nm = True, 1e-9
    x = follow(released(p, steps=8, vel_motor=60.0, vel_load=60.0 / p.ratio), 0.0, 3.0)
    inertia = p.inertia_motor_kg_m2 * p.ratio**2 + p.inertia_load_kg_m2
    a = x["pos_load"]
    energy = 0.5 * inertia * x["vel_load"] ** 2 - (3e3 * a - 2.5e4 * a**2 + 1e4 / 3 * a**3 - 5e3 * a**4)
    assert np.ptp(0.5 * inertia * x["vel_load"] ** 2) > 100.0
    assert np.max(np.abs(energy - energy[0])) < 1e-6 * np.ptp(0.5 * inertia * x["vel_load"] ** 2)


def test_a_turn_over_of_the_cables_takes_their_hysteresis_twice() -> None:
    """Pulled back and forth at a constant speed the loop encloses 2 x friction x way, once it slides."""
    p = bare(
        "rigid", "damping", cable_friction_nm=600.0, cable_presliding_rad=rad(0.05), inertia_motor_kg_m2=1e12
    )
    p.cable = True
    torques = []
    for side in (1.0, -1.0):
        sim = simulator(p)
        sim.static_start(0.0, True)
        x = follow(put(sim, vel_motor=side * 0.02 * p.ratio, vel_load=side * 0.02), 0.0, 0.2, 1e-3)
        torques.append(x["cable_z"][-1] / p.cable_presliding_rad * 600.0)
    # After 4.6 pre-sliding lengths: the sine of the gate comes to its level slowly.
    assert torques == pytest.approx([600.0, -600.0], rel=5e-3)


@pytest.mark.parametrize(
    "changes", [CABLE, {"plant.switches.cogging": True}, {"plant.switches.encoder_errors": True}]
)
def test_with_them_an_axis_starts_in_balance(changes: dict[str, object]) -> None:
    m = machine(changes)
    held = controlled(m, hold(rad(70.0)), 0.5, gantry_sim(m))
    assert np.max(np.abs(held["pos_load_rad"] - held["pos_load_rad"][0])) < rad(1e-5)
