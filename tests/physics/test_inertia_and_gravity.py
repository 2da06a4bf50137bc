"""Rigid body, two bodies, pendulum: closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ellipj, ellipk

from gantryctl.wiring.simulator import eccentric_moment_nm, plant_params
from physics.plants import DEG, LOCKED, bare, follow, frequency_and_damping, machine, put, released, simulator

# RK4 on polynomials up to the fourth degree is exact: what is left is the rounding of 1e4 additions.
ROUNDING = 1e-11


def test_constants_of_the_reference_machine() -> None:
    """Plant equations S1, to the printed digits."""
    p = plant_params(machine())
    assert p.inertia_motor_kg_m2 == pytest.approx(0.362, rel=1e-12)
    assert p.ratio == 1144.0
    assert p.stiffness_1_nm_per_rad == pytest.approx(5.120313e8, rel=5e-7)
    assert p.stiffness_2_nm_per_rad == pytest.approx(6.284475e8, rel=5e-7)
    assert p.stiffness_3_nm_per_rad == pytest.approx(7.157273e8, rel=5e-7)
    assert (p.torque_1_nm, p.torque_2_nm) == (24050.0, 86840.0)
    assert p.damping_nm_s_per_rad == pytest.approx(1.670500e6, rel=5e-7)
    assert p.half_backlash_rad == pytest.approx(1.056636e-5, rel=5e-7)
    assert p.eccentric_moment_nm == pytest.approx(-15990.3, abs=0.05)
    assert p.base_stiffness_nm_per_rad == pytest.approx(1.160665e9, rel=5e-7)
    assert p.base_damping_nm_s_per_rad == pytest.approx(1.583363e6, rel=5e-7)
    assert p.current_bandwidth_rad_s == pytest.approx(3769.911, abs=5e-4)
    assert p.roller_coulomb_nm / p.roller_presliding_rad == pytest.approx(2e8, rel=1e-12)
    assert p.motor_coulomb_nm / p.motor_presliding_rad == pytest.approx(1100.0, rel=1e-12)


@given(torque=st.floats(-250.0, 250.0), inertia=st.floats(1e5, 5e6))
def test_a_rigid_body_accelerates_by_torque_over_inertia(torque: float, inertia: float) -> None:
    p = bare("rigid", inertia_load_kg_m2=inertia)
    x = follow(released(p), torque, 0.1, 1e-3)
    acc = torque / (inertia / 1144.0**2 + 0.362)
    t = x["t"]
    assert np.allclose(x["vel_motor"], acc * t, rtol=ROUNDING, atol=1e-13)
    assert np.allclose(x["pos_motor"], 0.5 * acc * t**2, rtol=ROUNDING, atol=1e-13)
    assert np.allclose(x["pos_load"], x["pos_motor"] / 1144.0, rtol=ROUNDING, atol=1e-16)
    # of the torque, J/(i^2 Js) goes through the gears
    assert x["torque_mesh"][-1] == pytest.approx(inertia * acc / 1144.0, rel=ROUNDING, abs=1e-9)


def test_the_paper_inertia_leaves_the_wave_generator_out() -> None:
    """With J_wg = 0 the inertia at the motor is the paper's Js = 1.89773 kg m2."""
    p = plant_params(machine({"plant.motor.wave_generator_inertia_kg_m2": 0.0}))
    assert p.inertia_load_kg_m2 / p.ratio**2 + p.inertia_motor_kg_m2 == pytest.approx(1.89773, abs=5e-6)


def test_momentum_of_two_bodies_is_the_impulse_of_the_motor() -> None:
    """J w + i Jm wm = i T t, whatever spring and damper do between them (no gear error: i is i)."""
    p = bare("damping", "three_slopes")
    x = follow(released(p, vel_motor=3.0), 40.0, 1.0)
    momentum = p.inertia_load_kg_m2 * x["vel_load"] + p.ratio * p.inertia_motor_kg_m2 * x["vel_motor"]
    expected = p.ratio * (p.inertia_motor_kg_m2 * 3.0 + 40.0 * x["t"])
    assert np.ptp(x["torque_mesh"]) > 1e4
    assert np.allclose(momentum, expected, rtol=ROUNDING)


def test_two_free_bodies_swing_at_the_frequency_of_their_spring() -> None:
    """f = sqrt(K (1/J + 1/(i^2 Jm))) / 2 pi; the zero crossings of 5 s of undamped RK4 give it to 1e-6."""
    p = bare()
    x = follow(released(p, vel_motor=0.01), 0.0, 5.0)
    twist = x["pos_motor"] / p.ratio - x["pos_load"]
    frequency, damping = frequency_and_damping(x["t"], twist)
    reduced = 1.0 / p.inertia_load_kg_m2 + 1.0 / (p.ratio**2 * p.inertia_motor_kg_m2)
    assert frequency == pytest.approx(math.sqrt(p.stiffness_1_nm_per_rad * reduced) / (2 * math.pi), rel=1e-6)
    assert abs(damping) < 1e-6


@pytest.mark.parametrize("amplitude_deg", [5.0, 60.0, 150.0])
def test_the_rigid_gantry_is_a_pendulum(amplitude_deg: float) -> None:
    """Restoring moment: theta = 2 asin(k sn(K - w0 t, k)), w0^2 = |T_u|/(J + i^2 Jm), a swing of 80 s and more."""
    p = bare("rigid", "eccentric_moment")
    start = amplitude_deg * DEG
    x = follow(released(p, start), 0.0, 60.0, 5e-3)
    k = math.sin(start / 2)
    w0 = math.sqrt(-p.eccentric_moment_nm / (p.inertia_load_kg_m2 + p.ratio**2 * p.inertia_motor_kg_m2))
    sn = ellipj(ellipk(k * k) - w0 * x["t"], k * k)[0]
    # RK4 with 5 ms steps on a swing of 80 s is exact to rounding
    assert np.allclose(x["pos_load"], 2 * np.arcsin(k * sn), atol=1e-10)
    assert np.min(x["pos_load"]) < -0.5 * start


def test_a_falling_moment_drives_away_from_its_angle() -> None:
    """Sign +1: theta grows like cosh(w0 t)."""
    p = plant_params(machine({"plant.load.eccentric_sign": 1.0}))
    assert p.eccentric_moment_nm == pytest.approx(15990.3, abs=0.05)
    q = bare("rigid", eccentric_moment_nm=p.eccentric_moment_nm)
    x = follow(released(q, 1e-4), 0.0, 10.0, 5e-3)
    w0 = math.sqrt(q.eccentric_moment_nm / (q.inertia_load_kg_m2 + q.ratio**2 * q.inertia_motor_kg_m2))
    # sin(theta) = theta to 2e-9 of it while theta < 1.3e-4
    assert np.allclose(x["pos_load"], 1e-4 * np.cosh(w0 * x["t"]), rtol=1e-8)


@given(theta=st.floats(-3.1, 3.1), angle=st.floats(-180.0, 180.0), ecc=st.floats(1e-4, 0.02))
def test_holding_torque_balances_the_eccentric_moment(theta: float, angle: float, ecc: float) -> None:
    """Te = -T_u sin(theta - theta_u0)/i, and the load feels no acceleration."""
    m = machine({"plant.load.eccentric_angle_deg": angle, "plant.load.eccentricity_m": ecc})
    p = plant_params(m)
    moment = -2.0e5 * 9.81 * ecc
    assert eccentric_moment_nm(m) == pytest.approx(moment, rel=1e-14)
    q = bare("rigid", eccentric_moment_nm=p.eccentric_moment_nm, eccentric_angle_rad=p.eccentric_angle_rad)
    sim = released(q, theta)
    assert sim.state["torque_motor"] == pytest.approx(
        -moment * math.sin(theta - angle * DEG) / 1144.0, abs=1e-12
    )
    x = follow(sim, sim.state["torque_motor"], 0.01)
    assert np.max(np.abs(x["vel_load"])) < 1e-17


def test_a_locked_load_lets_the_motor_swing_on_the_spring() -> None:
    """f = sqrt(K/(i^2 Jm))/2 pi: the motor's own mode, without damping."""
    p = bare(inertia_load_kg_m2=LOCKED)
    x = follow(released(p, vel_motor=0.02), 0.0, 3.0)
    frequency, _ = frequency_and_damping(x["t"], x["pos_motor"])
    assert frequency == pytest.approx(
        math.sqrt(p.stiffness_1_nm_per_rad / p.inertia_motor_kg_m2) / p.ratio / (2 * math.pi), rel=1e-6
    )


def test_positions_are_the_integral_of_speeds_in_both_schemes() -> None:
    for scheme in ("rk4", "one_evaluation"):
        p = bare("damping", "base")
        sim = simulator(p, scheme)
        sim.static_start(0.0, True)
        x = follow(put(sim, vel_motor=1.0), 5.0, 0.5)
        for pos, vel in (("pos_motor", "vel_motor"), ("pos_load", "vel_load"), ("pos_base", "vel_base")):
            way = np.sum(0.5 * (x[vel][1:] + x[vel][:-1])) * x["t"][1]
            assert x[pos][-1] - x[pos][0] == pytest.approx(way, rel=2e-3), (scheme, pos)
