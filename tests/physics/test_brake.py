"""The holding brake: holds, slips at its torque, closes and opens after its times, and what an emergency stop does."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl import _core
from gantryctl.wiring.simulator import gantry_sim
from physics.plants import (
    DEG,
    OFF,
    QUICK_STOP,
    SPEED,
    Arrays,
    bare,
    commanded,
    controlled,
    follow,
    machine,
    put,
    simulator,
    trapezoid,
)

# One cycle = one scan, so that times can be seen to the cycle.
CYCLE = 125e-6


@pytest.mark.parametrize("theta_deg", [90.0, -90.0, 80.0])
def test_the_closed_brake_holds_the_load_when_the_drive_is_off(theta_deg: float) -> None:
    """All the eccentric moment on the lining: its spring gives T/(T_b/z_b) at the motor, and then nothing moves."""
    sim = gantry_sim(machine())
    sim.static_start(theta_deg * DEG, False)
    holding = 15990.3 * math.sin(theta_deg * DEG) / 1144.0
    assert sim.state["brake_z"] * 400.0 / 5e-4 == pytest.approx(-holding, rel=1e-6)
    log = commanded(sim, OFF, 0.0, 5.0, False)
    assert not np.any(log["torque_act_nm"])
    # the start leaves the slope of the gear error out, 1 % of the torque: it settles by 6e-9 rad, 4e-7 deg
    assert np.ptp(log["pos_load_rad"]) < 2e-8
    assert abs(log["vel_motor_rad_s"][-1]) < 1e-8


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_brake_slips_at_its_torque(side: float) -> None:
    """2 % below 400 N m it holds, 2 % above it slips with the difference as acceleration."""
    p = bare("rigid")
    inertia = p.inertia_motor_kg_m2 + p.inertia_load_kg_m2 / p.ratio**2
    sim = simulator(p, "one_evaluation")
    for factor in (0.55, 0.98, 1.02):
        sim.static_start(0.0, False)
        x = follow(sim, lambda t, top=side * factor * 400.0: top * min(1.0, 4.0 * t), 1.0)
        if factor < 0.6:  # the spring of the lining, s0 = T_b/z_b
            assert x["pos_motor"][-1] == pytest.approx(side * factor * 5e-4, rel=1e-6)
        elif factor < 1.0:  # it has crept a few z_b and holds
            assert abs(x["pos_motor"][-1]) < 5 * 5e-4
            assert abs(x["vel_motor"][-1]) < 1e-6
        else:
            late = slice(-2000, None)
            acc = np.polyfit(x["t"][late], x["vel_motor"][late], 1)[0]
            assert acc == pytest.approx(side * 0.02 * 400.0 / inertia, rel=1e-6)


def test_a_turning_shaft_is_braked_with_the_brake_torque() -> None:
    p = bare("rigid")
    sim = simulator(p, "one_evaluation")
    sim.static_start(0.0, False)
    put(sim, vel_motor=100.0, brake_z=5e-4)
    x = follow(sim, 0.0, 0.4)
    inertia = p.inertia_motor_kg_m2 + p.inertia_load_kg_m2 / p.ratio**2
    assert np.polyfit(x["t"][10:], x["vel_motor"][10:], 1)[0] == pytest.approx(-400.0 / inertia, rel=1e-9)


def brake_seen(open_first: bool) -> tuple[float, float]:
    """When the feedback shows the other position, and when the torque comes or goes, after the command."""
    p = bare("rigid")
    inertia = p.inertia_motor_kg_m2 + p.inertia_load_kg_m2 / p.ratio**2
    sim = simulator(p, "one_evaluation", scan_s=CYCLE, speed_count_rad=0.0)
    sim.static_start(0.0, open_first)
    if open_first:
        put(sim, vel_motor=50.0)
    shown, braked = math.nan, []
    for k in range(1600):
        before = sim.state["vel_motor"]
        sim.scan(OFF if open_first else SPEED, 5.0, 0.0, not open_first)
        after = sim.state
        if math.isnan(shown) and sim.feedback(1.0)[3] is not open_first:
            shown = (k + 1) * CYCLE
        brake = after["torque_motor"] - inertia * (after["vel_motor"] - before) / CYCLE
        if abs(brake) > 1.0:
            braked.append(k * CYCLE)
    return shown, braked[0] if open_first else braked[-1] + CYCLE


def test_the_brake_closes_150_ms_after_its_command() -> None:
    """The cycle that begins at 150 ms is the first with brake torque, and feedback at 150 ms says closed."""
    shown, acted = brake_seen(open_first=True)
    assert shown == pytest.approx(0.150, abs=1e-9)
    assert acted == pytest.approx(0.150, abs=1e-9)


def test_the_brake_opens_100_ms_after_its_command() -> None:
    """The drive pulls at it all the time; the cycle before 100 ms is the last with brake torque."""
    shown, acted = brake_seen(open_first=False)
    assert shown == pytest.approx(0.100, abs=1e-9)
    assert acted == pytest.approx(0.100, abs=1e-9)


def test_opened_it_is_gone() -> None:
    """An open brake changes no bit: the same run with another brake torque."""
    runs = []
    for torque in (400.0, 900.0):
        sim = simulator(bare("rigid", brake_torque_nm=torque), "one_evaluation")
        sim.static_start(0.0, True)
        runs.append(commanded(sim, SPEED, 7.0, 0.2, True))
    assert all(np.array_equal(runs[0][name], runs[1][name]) for name in runs[0])


def emergency_stop(scheme: str, start: float, end: float) -> tuple[Arrays, _core.GantrySim]:
    """At 6 deg/s under the paper's controller, then drive off and brake commanded, 10 s."""
    m = machine({"plant.integration.scheme": scheme})
    sim = gantry_sim(m)
    log = controlled(m, trapezoid(start, end), 22.0, sim)
    assert abs(log["vel_load_rad_s"][-1]) == pytest.approx(6.0 * DEG, rel=1e-3)
    return commanded(sim, OFF, 0.0, 10.0, False), sim


@pytest.mark.parametrize(("start", "end"), [(-90.0, 90.0), (90.0, -90.0), (-45.0, 135.0)])
def test_an_emergency_stop_from_full_speed_has_the_known_figures(start: float, end: float) -> None:
    """Plant equations S5: 2.4..2.7 deg, motor at rest after 0.9 s, the load swings for 6 s with up to 0.9 deg/s,
    52 kN m at the reducer output (the mesh torque over 13).
    """
    log, _ = emergency_stop("one_evaluation", start, end)
    t, load, motor = log["t"], log["vel_load_rad_s"] / DEG, log["vel_motor_rad_s"]
    way = np.abs(log["pos_load_rad"] - log["pos_load_rad"][0]) / DEG
    assert 2.35 < way[-1] < 2.7
    at_rest = t[np.flatnonzero(np.abs(motor) > 0.05)[-1]]
    assert at_rest == pytest.approx(0.9, abs=0.1)
    swing = np.abs(load[t > at_rest])
    assert 0.6 < np.max(swing) < 0.95
    assert 5.0 < t[np.flatnonzero(np.abs(load) > 0.01)[-1]] < 7.0
    assert np.max(np.abs(log["torque_mesh_nm"])) / 13.0 == pytest.approx(52e3, rel=0.02)
    # the torque is gone with the drive: three time constants of the current loop in the first millisecond
    assert abs(log["torque_act_nm"][2]) < 1e-3 * abs(log["torque_act_nm"][0])


def test_both_schemes_stop_alike() -> None:
    """The slipping brake turns its state over in 4 us: no explicit method follows, both take the exact step."""
    one, _ = emergency_stop("one_evaluation", -90.0, 90.0)
    rk4, _ = emergency_stop("rk4", -90.0, 90.0)
    assert np.isfinite(rk4["pos_load_rad"]).all()
    # measured 4e-4 deg of 2.4 deg
    assert np.max(np.abs(one["pos_load_rad"] - rk4["pos_load_rad"])) < 2e-3 * DEG


def test_a_quick_stop_of_the_drive_follows_its_ramp() -> None:
    """Motor speed falls by quick_dec; the feedback's ramp shows it; then it holds zero speed."""
    m = machine()
    sim = gantry_sim(m)
    controlled(m, trapezoid(-90, 90), 22.0, sim)
    dec = m.virtual_axis.quick_dec_deg_s2
    ramp = []
    for _ in range(2000):
        sim.scan(QUICK_STOP, 0.0, 0.0, True)
        ramp.append(sim.feedback(1.0)[6] / 1144.0 / DEG)
    start = 6.0 + dec * 1e-3
    expected = np.maximum(0.0, start - dec * 1e-3 * np.arange(1, 2001))
    # the ramp begins at the last speed command, which is 6 deg/s and what the position loop adds
    assert np.max(np.abs(np.array(ramp) - expected)) < 0.02
    assert ramp[-1] == 0.0
    assert abs(sim.truth()[3]) < 0.01 * 119.8
