"""Temperatures: backlash by the growth of the gears, viscous friction, torque of the motor; each by its closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl.units import rad
from gantryctl.wiring.simulator import gantry_sim, plant_params
from physics.plants import at_instant, bare, controlled, follow, hold, machine, put, released

ON = {"plant.switches.thermal": True}


def warm(gears_k: float, motor_k: float = 0.0) -> dict[str, object]:
    return ON | {
        f"plant.thermal.{part}_{when}_k": value
        for part, value in (("gears", gears_k), ("motor", motor_k))
        for when in ("start", "end")
    }


def gap_mm(changes: dict[str, object]) -> float:
    """Width of the gap: where the mesh torque of the first slope begins, on both sides, at the ring."""
    m = machine(changes | {"plant.switches.gear_error": False, "plant.switches.hysteresis": False})
    p = plant_params(m)
    twist = 1e-4
    torques = [
        at_instant(p, pos_motor=side * twist * p.ratio, pos_load=0.0, pos_base=0.0)[0] for side in (1, -1)
    ]
    x1, t1 = p.torque_1_nm / p.stiffness_1_nm_per_rad, p.torque_1_nm
    assert min(torques[0], -torques[1]) > t1  # on the second slope
    wound = [x1 + (abs(torque) - t1) / p.stiffness_2_nm_per_rad for torque in torques]
    return sum(twist - each for each in wound) * m.plant.gear_error.ring_radius_m * 1e3


def test_five_kelvin_are_a_tenth_of_a_millimetre_of_backlash() -> None:
    """2 tan(20 deg) x (2.366 + 2.366/13) m x 11.5e-6 /K x 5 K = 0.1067 mm: cold gears open, warm ones close the gap."""
    grown = 2e3 * math.tan(rad(20.0)) * 2.366 * (1 + 1 / 13) * 1.15e-5 * 5.0
    assert grown == pytest.approx(0.1067, abs=1e-4)
    assert gap_mm({}) == pytest.approx(0.05, abs=1e-9)
    assert gap_mm(warm(0.0)) == pytest.approx(0.05, abs=1e-9)
    assert gap_mm(warm(-5.0)) == pytest.approx(0.05 + grown, abs=1e-9)
    assert gap_mm(warm(2.0)) == pytest.approx(0.05 - 0.4 * grown, abs=1e-9)
    assert gap_mm(warm(5.0)) == pytest.approx(0.0, abs=1e-9)
    assert gap_mm(warm(-5.0) | {"plant.thermal.support_share": 1.0}) == pytest.approx(0.05, abs=1e-9)


def test_after_a_time_constant_a_temperature_has_gone_1_less_1_over_e_of_its_way() -> None:
    """Seen in the acceleration that a motor torque gives: 1 + c T(t)."""
    off = ("motor_friction", "roller_friction", "eccentric_moment", "torque_ripple")
    changes: dict[str, object] = {f"plant.switches.{name}": False for name in off}
    changes |= {"plant.switches.rigid": True, "drive.current_loop.ideal": True}
    m = machine(
        warm(0.0) | changes | {"plant.thermal.motor_end_k": 100.0, "plant.thermal.motor_time_s": 50.0}
    )
    p, sim = plant_params(m), gantry_sim(m)
    inertia = p.inertia_load_kg_m2 / p.ratio**2 + p.inertia_motor_kg_m2
    for time_s in (0.0, 50.0, 500.0):
        sim.static_start(0.0, True)
        put(sim, scans_done=time_s / 1e-3)
        sim.advance(100.0, 1e-3)
        factor = sim.state["vel_motor"] * inertia / (100.0 * 1e-3)
        assert factor == pytest.approx(1.0 - 0.1 * (1.0 - math.exp(-time_s / 50.0)), rel=1e-9)


def test_viscous_friction_goes_with_the_exponential_of_the_temperature() -> None:
    """Rollers and motor, rigid: what slows them beyond the plant at alignment is Fv v (exp(-0.05 x -10) - 1)."""
    cold = machine(warm(-10.0) | {"plant.switches.rigid": True})
    usual = machine({"plant.switches.rigid": True})
    speed = 0.1
    rates = [
        at_instant(plant_params(m), vel_motor=speed * 1144.0, vel_load=speed)[1]["vel_motor"]
        for m in (cold, usual)
    ]
    p = plant_params(usual)
    more = (math.exp(0.5) - 1.0) * (
        p.roller_viscous_nm_s_per_rad * speed / p.ratio + p.motor_viscous_nm_s_per_rad * speed * p.ratio
    )
    # A tenth of the rollers' part: the motor's friction goes with the torque that it carries.
    inertia = p.inertia_load_kg_m2 / p.ratio**2 + p.inertia_motor_kg_m2
    assert (rates[1] - rates[0]) * inertia == pytest.approx(more, rel=0.15)


def test_a_warm_and_a_cold_axis_start_in_balance() -> None:
    for changes in (warm(-8.0, 80.0), warm(3.0, -20.0)):
        m = machine(changes)
        sim = gantry_sim(m)
        held = controlled(m, hold(rad(70.0)), 0.5, sim)
        # As without temperatures: steps of the encoder, 7.5e-8 deg at the load.
        assert np.max(np.abs(held["pos_load_rad"] - held["pos_load_rad"][0])) < rad(1e-5)


def test_at_the_temperature_of_alignment_it_is_the_plant_without() -> None:
    p, q = bare("backlash", "damping"), bare("backlash", "damping")
    q.thermal = True
    a, b = (follow(released(each, vel_motor=1.0), 5.0, 0.2) for each in (p, q))
    assert np.array_equal(a["pos_load"], b["pos_load"])
