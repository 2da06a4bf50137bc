"""Elasto-plastic friction on motor and rollers: Stribeck curve, pre-sliding spring, break-away, no drift."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl import _core
from physics.independent_plant import IndependentPlant
from physics.plants import (
    DEG,
    LOCKED,
    SPEED,
    at_instant,
    bare,
    commanded,
    follow,
    frequency_and_damping,
    put,
    released,
    simulator,
)

IDEAL = {"speed_count_rad": 0.0, "position_count_rad": 0.0, "latency_s": 0.0}


def rigid_motor(**fields: float) -> _core.PlantParams:
    """Rigid body with motor friction only, no viscous part and no micro-damping unless asked for."""
    p = bare("rigid", "motor_friction", motor_viscous_nm_s_per_rad=0.0, motor_micro_damping=0.0)
    for name, value in fields.items():
        setattr(p, name, value)
    return p


# --- the gate -------------------------------------------------------------------------------------------------


@given(v=st.floats(-10, 10), a=st.floats(-2, 2), z_ss=st.floats(1e-6, 1e-2))
def test_the_gate_is_dupont_s(v: float, a: float, z_ss: float) -> None:
    """Against the definition with its own branches; the blend turns one rounding of a into 8 of the gate."""
    z = a * z_ss
    assert _core.sliding_gate(v, z, z_ss, 0.6) == pytest.approx(IndependentPlant.gate(v, z, z_ss), abs=1e-14)


# --- steady sliding -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("vel", [0.05, 0.3, 1.0, 2.5, 20.0, 119.8, -0.3, -60.0])
def test_at_constant_speed_the_motor_gives_the_stribeck_curve(vel: float) -> None:
    """Te = Fc + (Fs - Fc) exp(-(v/vs)^2) + Fv v under the speed loop, at rest in every state."""
    p = bare("rigid", "motor_friction")
    sim = simulator(p, "one_evaluation", **IDEAL)
    sim.static_start(0.0, True)
    put(sim, vel_motor=vel)
    log = commanded(sim, SPEED, vel, 4.0, True)
    size = abs(vel)
    expected = 5.5 + 1.0 * math.exp(-(size**2)) + 0.03 * size
    assert log["vel_motor_rad_s"][-1] == pytest.approx(vel, rel=1e-9)
    # the speed is a difference of angles: 1e-14 rad over 125 us, times Kvp
    assert log["torque_act_nm"][-1] == pytest.approx(math.copysign(expected, vel), rel=1e-8)


@pytest.mark.parametrize("vel_deg_s", [0.005, 0.02, 0.6, 6.0, -6.0])
def test_the_rollers_follow_their_own_curve(vel_deg_s: float) -> None:
    """i Te = Fc + (Fs - Fc) exp(-(v/vs)^2) + Fv v, vs given in deg/s."""
    p = bare("rigid", "roller_friction")
    sim = simulator(p, "one_evaluation", **IDEAL)
    sim.static_start(0.0, True)
    vel = vel_deg_s * DEG * p.ratio
    put(sim, vel_motor=vel)
    log = commanded(sim, SPEED, vel, 9.0, True)
    size = abs(vel_deg_s)
    expected = 6000.0 + 800.0 * math.exp(-((size / 0.02) ** 2)) + 2e4 * size * DEG
    assert p.ratio * log["torque_act_nm"][-1] == pytest.approx(math.copysign(expected, vel), rel=1e-7)


def test_motor_friction_grows_with_the_transmitted_torque() -> None:
    """mu_m |Tg|/i on top, whatever the sign of Tg: standing at +-90 deg and turning slowly."""
    p = bare("rigid", "motor_friction", "eccentric_moment")
    extra = []
    for theta in (-90 * DEG, 0.0, 90 * DEG):
        # the speed at which Stribeck's part is gone; 1e18 kg m2 of load keep the angle
        _, rates = at_instant(
            p,
            torque_nm=0.0,
            pos_load=theta,
            pos_motor=theta * p.ratio,
            vel_motor=10.0,
            motor_z=1.0,
        )
        inertia = p.inertia_motor_kg_m2 + p.inertia_load_kg_m2 / p.ratio**2
        gravity = p.eccentric_moment_nm * math.sin(theta) / p.ratio
        # z far beyond z_ss: s0 z is the torque for an instant, but z' shows the level: z' = v (1 - z/z_ss)
        assert rates["vel_motor"] * inertia == pytest.approx(
            gravity - 1100.0 - 0.3 - sigma1(p, 10.0) * rates["motor_z"], rel=1e-6
        )
        z_ss = 10.0 / (10.0 - rates["motor_z"])
        extra.append(z_ss * 1100.0 - 5.5)
    # the exact step over 1 ns shows z' half of v dt / z_ss = 2e-6 later: 1e-6 of a level of 5.5 N m
    assert extra == pytest.approx([0.1 * 15990.3 / 1144, 0.0, 0.1 * 15990.3 / 1144], rel=1e-5, abs=1e-5)


def sigma1(p: _core.PlantParams, v: float) -> float:
    """Micro-damping of the motor at a speed."""
    s0 = p.motor_coulomb_nm / p.motor_presliding_rad
    return (
        p.motor_micro_damping
        * math.sqrt(s0 * p.inertia_motor_kg_m2)
        * math.exp(-((v / (5 * p.motor_stribeck_rad_s)) ** 2))
    )


def test_in_the_elastic_gears_the_mesh_torque_is_what_loads_the_motor() -> None:
    """Locked motor and load, wound up by 20 kN m: z_ss of the motor friction carries mu_m Tg/i."""
    p = bare("motor_friction", inertia_motor_kg_m2=LOCKED, inertia_load_kg_m2=LOCKED)
    windup = 20000.0 / p.stiffness_1_nm_per_rad
    mesh, rates = at_instant(p, pos_motor=windup * p.ratio, vel_motor=-10.0, motor_z=-1.0)
    assert mesh == pytest.approx(20000.0, rel=1e-9)
    z_ss = 10.0 / (10.0 + rates["motor_z"])
    assert z_ss * 1100.0 == pytest.approx(5.5 + 0.1 * 20000.0 / 1144.0, rel=1e-6)


def test_the_rollers_feel_the_speed_against_the_base_not_against_the_earth() -> None:
    p = bare("roller_friction", "base")
    _, rates = at_instant(p, vel_load=2e-3, vel_base=2e-3)
    assert rates["roller_z"] == 0.0
    mesh, rates = at_instant(p, vel_load=0.0, vel_base=-2e-3)
    assert rates["roller_z"] == pytest.approx(2e-3, rel=1e-9)
    force = (
        p.roller_viscous_nm_s_per_rad * 2e-3
        + 0.3
        * math.sqrt(2e8 * p.inertia_load_kg_m2)
        * math.exp(-((2e-3 / (5 * p.roller_stribeck_rad_s)) ** 2))
        * 2e-3
    )
    assert rates["vel_load"] * p.inertia_load_kg_m2 == pytest.approx(mesh - force, rel=1e-6)
    # what the rollers take from the load they give to the base
    assert rates["vel_base"] * p.base_inertia_kg_m2 == pytest.approx(
        -mesh + force + p.base_damping_nm_s_per_rad * 2e-3, rel=1e-6
    )


# --- pre-sliding ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("torque", [1.0, -2.0, 2.8])
def test_below_break_away_the_motor_sits_on_a_spring(torque: float) -> None:
    """Rest at Te/s0 = Te/1100 rad while |Te| < 0.6 Fs; the micro-damping brings it to rest."""
    p = rigid_motor(motor_micro_damping=2.0)
    x = follow(released(p), torque, 4.0)
    assert x["pos_motor"][-1] == pytest.approx(torque / 1100.0, rel=1e-6)
    assert x["motor_z"][-1] == pytest.approx(x["pos_motor"][-1], rel=1e-9)


def test_the_presliding_spring_sets_a_frequency_and_the_micro_damping_its_decay() -> None:
    """f = sqrt(s0/Js)/2 pi, zeta = s1/(2 sqrt(s0 Js)) with s1 = 0.3 sqrt(s0 Jm)."""
    p = rigid_motor(motor_micro_damping=0.3)
    x = follow(released(p, motor_z=1e-4, pos_motor=1e-4), 0.0, 2.0)
    frequency, damping = frequency_and_damping(x["t"], x["motor_z"])
    inertia = p.inertia_motor_kg_m2 + p.inertia_load_kg_m2 / p.ratio**2
    zeta = 0.5 * 0.3 * math.sqrt(p.inertia_motor_kg_m2 / inertia)
    assert damping == pytest.approx(zeta, rel=1e-3)
    assert frequency == pytest.approx(math.sqrt(1100.0 / inertia * (1 - zeta**2)) / (2 * math.pi), rel=1e-4)


def test_the_rollers_have_their_own_presliding_spring() -> None:
    """Fc/z_roll = 2e8 N m/rad: 3 kN m at the gantry turn it by 15 urad."""
    p = bare("rigid", "roller_friction", roller_micro_damping=2.0)
    x = follow(released(p), 3000.0 / 1144.0, 2.0)
    assert x["pos_load"][-1] == pytest.approx(1.5e-5, rel=1e-6)


def ramped(p: _core.PlantParams, top: float) -> float:
    """Motor speed after the torque has risen slowly to `top` and stayed there for 12 s."""
    x = follow(released(p), lambda t: top * min(1.0, t / 3.0), 15.0, 1e-3)
    return float(x["vel_motor"][-1])


def test_it_breaks_away_at_the_breakaway_torque() -> None:
    """2 % below Fs it stands, 2 % above it runs: the ramp is slow, 2 N m/s."""
    p = rigid_motor(motor_micro_damping=1.0)
    assert abs(ramped(p, 0.98 * 6.5)) < 1e-6
    assert ramped(p, 1.02 * 6.5) > 0.1
    # between Fc and Fs it stands, but once turning it goes on
    assert abs(ramped(p, 6.0)) < 1e-6
    moving = follow(released(p, vel_motor=5.0, motor_z=0.005), 6.0, 2.0, 5e-4)
    assert moving["vel_motor"][-1] > 5.0


def swung(ep_ratio: float) -> tuple[float, float]:
    """Position after 40 and after 80 small swings under a bias, as multiples of the swing's amplitude."""
    p = rigid_motor(motor_micro_damping=1.0, friction_ep_ratio=ep_ratio)
    x = follow(
        released(p), lambda t: 1.6 * min(1.0, t / 0.5) + 1.1 * math.sin(2 * math.pi * 2 * t), 40.0, 1e-3
    )
    amplitude = 0.5 * float(np.ptp(x["pos_motor"][-500:]))
    return float(x["pos_motor"][20000] / amplitude), float(x["pos_motor"][-1] / amplitude)


def test_small_oscillations_do_not_make_it_drift() -> None:
    """|z| stays below 0.6 z_ss, so nothing slides: the same place after 80 swings. With an element that slides
    from the first micron on (break-away ratio 0, plain LuGre's fault) it creeps by many amplitudes.
    """
    early, late = swung(0.6)
    assert late == pytest.approx(early, abs=1e-6)
    early, late = swung(0.0)
    assert late - early > 1.0


def test_a_reversal_of_sliding_has_a_loop_as_wide_as_twice_the_level() -> None:
    """Turned to and fro at 0.5 rad/s far beyond z_m: +-g(v), so Coulomb and Stribeck in one loop."""
    p = rigid_motor(inertia_motor_kg_m2=LOCKED)
    for side in (1.0, -1.0):
        sim = released(p, vel_motor=0.5 * side, motor_z=-0.005 * side)
        x = follow(sim, 0.0, 0.2)
        assert x["motor_z"][-1] * 1100.0 == pytest.approx(side * (5.5 + math.exp(-0.25)), rel=1e-6)
