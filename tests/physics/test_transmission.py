"""From motor to ring: three-slope spring, damping, modes, wind-up, hysteresis, backlash."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from gantryctl import _core
from gantryctl.wiring.simulator import plant_params
from physics.independent_plant import IndependentPlant
from physics.plants import (
    LOCKED,
    Arrays,
    at_instant,
    bare,
    follow,
    frequency_and_damping,
    machine,
    put,
    released,
)


def full() -> _core.PlantParams:
    return plant_params(machine())


# --- spring ---------------------------------------------------------------------------------------------------


def test_the_spring_has_three_slopes() -> None:
    p = full()
    x1 = p.torque_1_nm / p.stiffness_1_nm_per_rad
    x2 = x1 + (p.torque_2_nm - p.torque_1_nm) / p.stiffness_2_nm_per_rad
    for at, slope in (
        (0.5 * x1, p.stiffness_1_nm_per_rad),
        (0.5 * (x1 + x2), p.stiffness_2_nm_per_rad),
        (2 * x2, p.stiffness_3_nm_per_rad),
    ):
        d = 1e-9
        measured = (_core.spring_torque(p, at + d) - _core.spring_torque(p, at - d)) / (2 * d)
        assert measured == pytest.approx(slope, rel=1e-7)
    for seam, torque in ((x1, p.torque_1_nm), (x2, p.torque_2_nm)):
        for side in (math.nextafter(seam, 0.0), seam, math.nextafter(seam, 1.0)):
            assert _core.spring_torque(p, side) == pytest.approx(torque, rel=1e-14)


@given(st.floats(-2e5, 2e5))
def test_windup_is_the_inverse_of_the_spring(torque: float) -> None:
    p = full()
    # 1e-15 rad at 5e8 N m/rad
    assert _core.spring_torque(p, _core.windup(p, torque)) == pytest.approx(torque, rel=1e-12, abs=1e-6)
    assert _core.windup(p, -torque) == -_core.windup(p, torque)


@given(st.floats(0.0, 5e-4), st.floats(0.0, 5e-4))
def test_the_spring_is_odd_and_rises(a: float, b: float) -> None:
    p = full()
    assert _core.spring_torque(p, -a) == -_core.spring_torque(p, a)
    if a < b:
        assert _core.spring_torque(p, a) < _core.spring_torque(p, b) or b - a < 1e-18


def test_one_slope_is_the_first_one_everywhere() -> None:
    p = bare()
    for windup in (1e-6, 5e-5, 2e-4, -1e-3):
        assert _core.spring_torque(p, windup) == pytest.approx(p.stiffness_1_nm_per_rad * windup, rel=1e-13)


# --- modes with the motor held --------------------------------------------------------------------------------


def test_the_locked_motor_mode_has_its_damping_ratio() -> None:
    """f = sqrt(K1/J) sqrt(1 - zeta^2)/2 pi, zeta = 2.5 % as given; peaks sampled at 8 kHz are good to 1e-4."""
    p = bare("damping", inertia_motor_kg_m2=LOCKED)
    x = follow(released(p, pos_load=1e-5), 0.0, 5.0)
    frequency, damping = frequency_and_damping(x["t"], x["pos_load"])
    natural = math.sqrt(p.stiffness_1_nm_per_rad / p.inertia_load_kg_m2) / (2 * math.pi)
    assert damping == pytest.approx(0.025, rel=1e-3)
    assert frequency == pytest.approx(natural * math.sqrt(1 - 0.025**2), rel=1e-5)


def motor_held(p: _core.PlantParams) -> np.ndarray:
    """x' = A x of (theta, phi, w, phi') with the motor locked, linear."""
    k, c, j, jb = p.stiffness_1_nm_per_rad, p.damping_nm_s_per_rad, p.inertia_load_kg_m2, p.base_inertia_kg_m2
    return np.array(
        [
            [0, 0, 1, 0],
            [0, 0, 0, 1],
            [-k / j, k / j, -c / j, c / j],
            [
                k / jb,
                -(k + p.base_stiffness_nm_per_rad) / jb,
                c / jb,
                -(c + p.base_damping_nm_s_per_rad) / jb,
            ],
        ]
    )


def test_the_motor_held_modes_are_at_2_00_and_8_52_hz() -> None:
    eigenvalues = np.linalg.eigvals(motor_held(bare("damping", "base")))
    frequencies = np.sort(np.abs(eigenvalues[eigenvalues.imag > 0]) / (2 * math.pi))
    assert frequencies == pytest.approx([2.0046, 8.52], abs=0.005)


def test_the_linear_limit_is_the_matrix_exponential() -> None:
    """Load and base released with the motor locked, both modes: the core follows exp(A t) to 1e-9 of the start."""
    p = bare("damping", "base", inertia_motor_kg_m2=LOCKED)
    start = np.array([1e-5, -4e-6, 2e-5, 1e-4])
    sim = released(p, pos_load=start[0], pos_base=start[1], vel_load=start[2], vel_base=start[3])
    x = follow(sim, 0.0, 2.0)
    a = motor_held(p)
    for k in range(0, len(x["t"]), 1600):
        expected = expm(a * x["t"][k]) @ start
        got = [x[name][k] for name in ("pos_load", "pos_base", "vel_load", "vel_base")]
        assert np.allclose(got, expected, rtol=0, atol=[1e-14, 1e-14, 1e-13, 1e-12]), x["t"][k]


# --- static wind-up -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("eccentricity_m", "slope"), [(0.00815, 1), (0.03, 2), (0.08, 3)])
def test_released_onto_the_spring_the_load_comes_to_rest_at_the_static_windup(
    eccentricity_m: float, slope: int
) -> None:
    """Motor locked, strong damper: theta = -S^-1(Tg), Tg = -T_u sin(theta), on each of the slopes."""
    p = bare(
        "three_slopes",
        eccentric_moment_nm=-2e5 * 9.81 * eccentricity_m,
        inertia_motor_kg_m2=LOCKED,
        damping_nm_s_per_rad=3e7,
    )
    x = follow(released(p, math.pi / 2, pos_load=math.pi / 2 + 1e-4), 0.0, 4.0)
    torque = -p.eccentric_moment_nm
    k1, k2, k3, t1, t2 = (
        p.stiffness_1_nm_per_rad,
        p.stiffness_2_nm_per_rad,
        p.stiffness_3_nm_per_rad,
        p.torque_1_nm,
        p.torque_2_nm,
    )
    expected = {
        1: torque / k1,
        2: t1 / k1 + (torque - t1) / k2,
        3: t1 / k1 + (t2 - t1) / k2 + (torque - t2) / k3,
    }
    windup = x["pos_motor"][-1] / p.ratio - x["pos_load"][-1]
    assert windup == pytest.approx(expected[slope], rel=1e-9)
    assert x["torque_mesh"][-1] == pytest.approx(torque, rel=1e-9)
    assert abs(x["vel_load"][-1]) < 1e-11


# --- hysteresis: motor and load locked, the twist driven to and fro -------------------------------------------

STEP_S = 5e-4


def sweep(p: _core.PlantParams, turns: list[float], rate: float = 2e-4) -> Arrays:
    """Twist, spring torque and hysteresis torque on the way to each value of `turns` in turn."""
    p.inertia_motor_kg_m2 = p.inertia_load_kg_m2 = LOCKED
    sim = released(p, steps=4)
    twist, torque, mesh = [0.0], [0.0], [0.0]
    dt = STEP_S * 2e-4 / rate
    for target in turns:
        way = target - twist[-1]
        put(sim, vel_motor=math.copysign(rate, way) * p.ratio)
        x = follow(sim, 0.0, round(abs(way) / (rate * dt)) * dt, dt)
        twist += list(x["pos_motor"][1:] / p.ratio)
        torque += list(x["hysteresis"][1:])
        mesh += list(x["torque_mesh"][1:])
    return {"twist": np.array(twist), "hysteresis": np.array(torque), "mesh": np.array(mesh)}


def of_last_loop(x: Arrays, amplitude: float) -> tuple[Arrays, Arrays]:
    """The way down and the way up of the last loop."""
    count = round(2 * amplitude / (2e-4 * STEP_S))
    up = {name: values[-count - 1 :] for name, values in x.items()}
    down = {name: values[-2 * count - 1 : -count] for name, values in x.items()}
    return down, up


def deficit() -> float:
    """Integral of (1 - a)/(1 - alpha(a) a) from -1 to 1: what rounds the corners of a hysteresis loop."""
    a = np.linspace(-1.0, 1.0, 200001)[:-1]
    alpha = np.where(a <= 0.6, 0.0, 0.5 + 0.5 * np.sin(math.pi * (a - 0.8) / 0.4))
    values = (1 - a) / (1 - alpha * a)
    return float(np.sum(0.5 * (values[1:] + values[:-1])) * 1e-5)


@pytest.mark.parametrize("amplitude", [1e-4, 2e-4])
def test_the_hysteresis_loop_has_its_width_and_its_area(amplitude: float) -> None:
    """No load part: width 2 h in the middle, area 4 h A less the two rounded corners, 2 h z_h x deficit."""
    p = bare("hysteresis", hysteresis_load_ratio=0.0)
    x = sweep(p, [amplitude, -amplitude, amplitude, -amplitude, amplitude])
    down, up = of_last_loop(x, amplitude)
    h, z = p.hysteresis_torque_nm, p.hysteresis_length_rad
    # ten or twenty z_h after the turn the torque is within exp(-8) of h
    assert np.interp(0.0, up["twist"], up["hysteresis"]) == pytest.approx(h, rel=1e-3)
    assert np.interp(0.0, down["twist"][::-1], down["hysteresis"][::-1]) == pytest.approx(-h, rel=1e-3)

    def area(half: Arrays) -> float:
        t, d = half["hysteresis"], half["twist"]
        return float(np.sum(0.5 * (t[1:] + t[:-1]) * np.diff(d)))

    assert area(up) + area(down) == pytest.approx(4 * h * amplitude - 2 * h * z * deficit(), rel=1e-5)


def test_the_hysteresis_is_elastic_at_first() -> None:
    """Up to 0.6 z_h it is a spring of stiffness h/z_h and gives everything back."""
    p = bare("hysteresis", hysteresis_load_ratio=0.0)
    x = sweep(p, [5.9e-6, -5.9e-6, 0.0])
    assert np.allclose(
        x["hysteresis"], p.hysteresis_torque_nm / p.hysteresis_length_rad * x["twist"], atol=1e-6
    )


def test_the_hysteresis_grows_with_the_load() -> None:
    """h = T_h0 + mu_h |Ts|: at the same twist, loading and unloading differ by 2 h.

    z_h is taken small, so that Th lags its growing h by z_h mu K = 5 N m only, once with each sign.
    """
    p = bare("hysteresis", hysteresis_length_rad=1e-7)
    x = sweep(p, [6e-5, -6e-5, 6e-5])
    down, up = of_last_loop(x, 6e-5)
    for twist in (-4e-5, -2e-5, 2e-5, 4e-5):
        h = p.hysteresis_torque_nm + p.hysteresis_load_ratio * p.stiffness_1_nm_per_rad * abs(twist)
        assert np.interp(twist, up["twist"], up["hysteresis"]) == pytest.approx(h, abs=6.0)
        assert np.interp(twist, down["twist"][::-1], down["hysteresis"][::-1]) == pytest.approx(-h, abs=6.0)


def test_the_hysteresis_does_not_depend_on_the_rate() -> None:
    slow, fast = (sweep(bare("hysteresis"), [5e-5, -5e-5, 2e-5], rate) for rate in (2e-4, 2e-3))
    assert np.allclose(slow["hysteresis"], fast["hysteresis"], rtol=0, atol=1e-6)


def test_the_hysteresis_of_the_reference_machine_follows_its_equation() -> None:
    """Against scipy on Th(D) with the load-dependent h, over a loop through both slopes of the spring."""
    p = bare("hysteresis", "three_slopes")
    x = sweep(p, [1e-4, -3e-5, 8e-5])
    plant = IndependentPlant(machine({"plant.transmission.backlash_mm": 0.0}))
    th = 0.0
    for start, end in ((0.0, 1e-4), (1e-4, -3e-5), (-3e-5, 8e-5)):
        side = math.copysign(1.0, end - start)
        solution = solve_ivp(
            lambda d, y, side=side: [plant.mesh(d, side, y[0])[1] * side],
            (start, end),
            [th],
            rtol=1e-10,
            atol=1e-7,
            max_step=1e-6,
        )
        th = float(solution.y[0, -1])
        k = np.flatnonzero(np.abs(x["twist"] - end) < 1e-12)
        assert np.min(np.abs(x["hysteresis"][k] - th)) < 0.1


def test_spring_and_hysteresis_add_up() -> None:
    p = bare("hysteresis", "three_slopes")
    x = sweep(p, [1e-4, -1e-4])
    spring = np.array([_core.spring_torque(p, d) for d in x["twist"]])
    # the mesh torque is that of the last stage of a step, which is its end
    assert np.allclose(x["mesh"][1:], (spring + x["hysteresis"])[1:], atol=1.0)


# --- backlash -------------------------------------------------------------------------------------------------


def twisted(p: _core.PlantParams, twist: float, rate: float = 0.0, hysteresis: float = 0.0) -> float:
    """Mesh torque at a twist and its rate."""
    return at_instant(p, pos_motor=twist * p.ratio, vel_motor=rate * p.ratio, hysteresis=hysteresis)[0]


def test_the_gap_is_as_wide_as_the_backlash() -> None:
    """0.05 mm at a radius of 2.366 m; inside no torque, whatever damper and hysteresis say; beyond, the spring."""
    p = bare("backlash", "damping", "hysteresis", "three_slopes")
    half = 0.5 * 0.05e-3 / 2.366
    for d in (-0.999 * half, -0.3 * half, 0.0, 0.7 * half, 0.999 * half):
        assert twisted(p, d, rate=1e-3, hysteresis=500.0) == 0.0
    for extra in (1e-7, 1e-6, 1e-4):
        assert twisted(p, half + extra) == pytest.approx(_core.spring_torque(p, extra), rel=1e-8)
        assert twisted(p, -half - extra) == pytest.approx(-_core.spring_torque(p, extra), rel=1e-8)


def test_flanks_cannot_pull() -> None:
    """Leaving faster than the spring pushes: no torque. Without backlash there is no clamp."""
    p, tight = bare("backlash", "damping"), bare("damping")
    d, extra = p.half_backlash_rad + 1e-5, 1e-5
    spring, rate = p.stiffness_1_nm_per_rad * extra, 1e-2
    assert p.damping_nm_s_per_rad * rate > 2 * spring
    assert twisted(p, d, -rate) == 0.0
    assert twisted(p, -d, rate) == 0.0
    assert twisted(p, d, rate) == pytest.approx(spring + p.damping_nm_s_per_rad * rate, rel=1e-9)
    assert twisted(p, d, -0.1 * rate) == pytest.approx(spring - 0.1 * p.damping_nm_s_per_rad * rate, rel=1e-9)
    assert twisted(tight, extra, -rate) == pytest.approx(spring - p.damping_nm_s_per_rad * rate, rel=1e-9)


def test_hysteresis_fades_in_the_gap() -> None:
    """Th' = -Th/10 ms; RK4 at 125 us on that is exact to 1e-12."""
    p = bare("backlash", "hysteresis", inertia_motor_kg_m2=LOCKED, inertia_load_kg_m2=LOCKED)
    x = follow(released(p, hysteresis=800.0), 0.0, 0.05)
    assert np.allclose(x["hysteresis"], 800.0 * np.exp(-x["t"] / 0.01), rtol=1e-10)


@pytest.mark.parametrize("backlash_mm", [0.0, 0.05, 0.4])
def test_lost_motion_is_the_gap_and_twice_the_windup_of_the_friction(backlash_mm: float) -> None:
    """Motor driven slowly forth and back against dry rollers: D = +-(b/2 + F/K), so the load lags by b + 2F/K."""
    half = 0.5e-3 * backlash_mm / 2.366
    p = bare(
        "roller_friction", "damping", inertia_motor_kg_m2=LOCKED, half_backlash_rad=half, backlash=half > 0.0
    )
    p.roller_breakaway_nm, p.roller_viscous_nm_s_per_rad, p.damping_nm_s_per_rad = (
        p.roller_coulomb_nm,
        0.0,
        2e7,
    )
    sim = released(p)
    lag = []
    for side in (1.0, -1.0):
        put(sim, vel_motor=side * 2e-4 * p.ratio)
        x = follow(sim, 0.0, 4.0)
        assert x["vel_load"][-1] == pytest.approx(side * 2e-4, rel=1e-5)
        lag.append(x["pos_motor"][-1] / p.ratio - x["pos_load"][-1])
    lost = backlash_mm * 1e-3 / 2.366 + 2 * p.roller_coulomb_nm / p.stiffness_1_nm_per_rad
    assert lag[0] - lag[1] == pytest.approx(lost, rel=1e-5)
