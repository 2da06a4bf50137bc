"""The rocking base: its own mode, static deflection, and that it takes exactly what the load gives."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl.wiring.simulator import plant_params
from physics.plants import DEG, LOCKED, bare, follow, frequency_and_damping, machine, put, released, simulator


def test_the_base_alone_rocks_at_seven_hertz() -> None:
    """Transmission without stiffness: 7 Hz, 3 %."""
    p = bare(
        "base",
        "damping",
        damping_nm_s_per_rad=0.0,
        stiffness_1_nm_per_rad=1e-3,
        stiffness_2_nm_per_rad=1e-3,
        stiffness_3_nm_per_rad=1e-3,
    )
    x = follow(released(p, pos_base=1e-5), 0.0, 2.0)
    frequency, damping = frequency_and_damping(x["t"], x["pos_base"])
    assert damping == pytest.approx(0.03, rel=1e-3)
    assert frequency == pytest.approx(7.0 * math.sqrt(1 - 0.03**2), rel=1e-5)


def test_load_and_motor_locked_the_transmission_stiffens_the_base() -> None:
    """f = sqrt((kb + K1)/Jb)/2 pi: the ring angle is theta - phi, so the spring holds the base too."""
    p = bare("base", inertia_motor_kg_m2=LOCKED, inertia_load_kg_m2=LOCKED)
    x = follow(released(p, pos_base=1e-6), 0.0, 2.0)
    frequency, _ = frequency_and_damping(x["t"], x["pos_base"])
    expected = math.sqrt((p.base_stiffness_nm_per_rad + p.stiffness_1_nm_per_rad) / p.base_inertia_kg_m2) / (
        2 * math.pi
    )
    assert frequency == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("theta_deg", [90.0, -90.0, 30.0])
def test_the_base_gives_way_under_the_eccentric_moment(theta_deg: float) -> None:
    """phi = T_u sin(theta)/kb; -13.77684 urad at 90 deg (plant equations S8). Released from 0 it gets there."""
    p = bare(
        "base",
        "eccentric_moment",
        "damping",
        inertia_motor_kg_m2=LOCKED,
        damping_nm_s_per_rad=2e7,
        base_damping_nm_s_per_rad=5e7,
    )
    theta = theta_deg * DEG
    sim = released(p, theta)
    deflection = p.eccentric_moment_nm * math.sin(theta) / p.base_stiffness_nm_per_rad
    assert sim.state["pos_base"] == pytest.approx(deflection, rel=1e-12)
    x = follow(put(sim, pos_base=0.0), 0.0, 6.0)
    # the load settles where its own angle says: both within 1e-5 rad of the start
    final = p.eccentric_moment_nm * math.sin(float(x["pos_load"][-1])) / p.base_stiffness_nm_per_rad
    assert x["pos_base"][-1] == pytest.approx(final, rel=1e-8)
    if theta_deg == 90.0:
        assert deflection == pytest.approx(-13.77684e-6, rel=5e-6)


def test_the_load_and_the_base_only_exchange_momentum() -> None:
    """Without anchor J w + Jb phi' stays what it was, whatever motor, gears, damper and rollers do."""
    effects = ("base", "damping", "roller_friction", "hysteresis", "backlash", "three_slopes", "gear_error")
    p = bare(*effects, base_stiffness_nm_per_rad=1e-6, base_damping_nm_s_per_rad=0.0)
    x = follow(released(p, vel_base=1e-3), lambda t: 60.0 * math.sin(9 * t), 1.0)
    momentum = p.inertia_load_kg_m2 * x["vel_load"] + p.base_inertia_kg_m2 * x["vel_base"]
    assert np.ptp(p.inertia_load_kg_m2 * x["vel_load"]) > 1e3
    assert np.allclose(momentum, momentum[0], rtol=1e-10)


def test_a_switched_off_base_does_not_move_at_all() -> None:
    m = machine({"plant.switches.base": False})
    sim = simulator(plant_params(m))
    sim.static_start(1.0, True)
    x = follow(sim, 50.0, 0.3)
    assert not np.any(x["pos_base"])
    assert not np.any(x["vel_base"])


def test_a_very_stiff_base_is_a_plant_without_base() -> None:
    """kb x 1e6: phi shrinks by as much, the load follows the plant without base to 1e-6 of the way."""
    stiff = bare("base", "damping")
    stiff.base_stiffness_nm_per_rad, stiff.base_damping_nm_s_per_rad = (
        stiff.base_stiffness_nm_per_rad * 1e4,
        stiff.base_damping_nm_s_per_rad * 1e3,
    )
    a = follow(released(stiff, steps=8), 40.0, 0.3)
    b = follow(released(bare("damping"), steps=8), 40.0, 0.3)
    assert np.max(np.abs(a["pos_base"])) > 0.0
    assert np.allclose(a["pos_load"], b["pos_load"], rtol=0, atol=2e-4 * abs(b["pos_load"][-1]))
