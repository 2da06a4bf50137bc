"""Breakaway that grows at rest: its age by closed forms, and stick-slip where the theory of stability puts it."""

from __future__ import annotations

import numpy as np
import pytest

from gantryctl import _core
from physics.plants import LOCKED, bare, follow, put, simulator

TIME_S, LENGTH = 0.05, 1e-5


def released(p: _core.PlantParams, **state: float) -> _core.GantrySim:
    """Standing at 0 but for the states given. One evaluation: its exact step bears a contact that slides at once."""
    sim = simulator(p, "one_evaluation")
    sim.static_start(0.0, True)
    return put(sim, **state)


def sliding(**fields: float) -> _core.PlantParams:
    """Rollers of one level and a very short pre-sliding way, pulled over the first slope by a motor without end."""
    p = bare("roller_friction", inertia_motor_kg_m2=LOCKED, roller_presliding_rad=1e-8)
    p.roller_breakaway_nm = p.roller_coulomb_nm
    p.ageing, p.roller_ageing_time_s, p.roller_ageing_length_rad = True, TIME_S, LENGTH
    for name, value in fields.items():
        setattr(p, name, value)
    return p


def test_at_rest_the_age_goes_to_one_with_its_time_constant() -> None:
    p = sliding(roller_ageing_time_s=2.0)
    x = follow(released(p, roller_age=0.0), 0.0, 1.0)
    assert np.allclose(x["roller_age"], 1.0 - np.exp(-x["t"] / 2.0), atol=1e-9)


@pytest.mark.parametrize("speed", [2e-5, 1e-4, 1e-3])
def test_steady_sliding_has_the_age_and_the_friction_of_its_speed(speed: float) -> None:
    """a = 1 / (1 + v T / L), friction Fc + growth x a + Fv v: what the spring carries."""
    p = sliding(roller_ageing_nm=1000.0, roller_viscous_nm_s_per_rad=1e8)
    age = 1.0 / (1.0 + speed * TIME_S / LENGTH)
    friction = p.roller_coulomb_nm + 1000.0 * age + p.roller_viscous_nm_s_per_rad * speed
    wound = friction / p.stiffness_1_nm_per_rad
    sim = released(
        p,
        vel_motor=speed * p.ratio,
        vel_load=speed,
        pos_motor=wound * p.ratio,
        roller_age=age,
        roller_z=1e-8,
    )
    x = follow(sim, 0.0, 1.0, 62.5e-6)
    assert x["roller_age"][-1] == pytest.approx(age, rel=1e-3)
    assert x["torque_mesh"][-1] == pytest.approx(friction, rel=1e-3)


def growth(p: _core.PlantParams, speed: float) -> complex:
    """Fastest root of m s^3 + (F + m l) s^2 + (k + F l - D a / L) s + k l, l = 1/T + v/L: 1/s."""
    m, k, f = p.inertia_load_kg_m2, p.stiffness_1_nm_per_rad, p.roller_viscous_nm_s_per_rad
    rate = 1.0 / TIME_S + speed / LENGTH
    age = 1.0 / (1.0 + speed * TIME_S / LENGTH)
    fall = p.roller_ageing_nm * age / LENGTH
    roots = np.roots([m, f + m * rate, k + f * rate - fall, k * rate])
    return complex(max(roots, key=lambda s: (abs(s.imag) > 1.0, s.real)))


@pytest.mark.parametrize(("viscous", "grows"), [(1e6, True), (2e7, False)])
def test_small_swings_of_a_sliding_load_grow_or_die_as_the_linear_theory_says(
    viscous: float, grows: bool
) -> None:
    """With the growth of the theory taken out, the swing is as large late as early: within 15 % over half a second."""
    speed = 1e-4
    p = sliding(roller_ageing_nm=800.0, roller_viscous_nm_s_per_rad=viscous)
    root = growth(p, speed)
    assert (root.real > 0.0) == grows
    age = 1.0 / (1.0 + speed * TIME_S / LENGTH)
    wound = (p.roller_coulomb_nm + 800.0 * age + viscous * speed) / p.stiffness_1_nm_per_rad
    sim = released(
        p, vel_motor=speed * p.ratio, vel_load=1.02 * speed, pos_motor=wound * p.ratio, roller_age=age,
        roller_z=1e-8,
    )  # fmt: skip
    x = follow(sim, 0.0, 1.0, 62.5e-6)
    swing = (x["vel_load"] - speed) * np.exp(-root.real * x["t"])
    late, early = swing[x["t"] > 0.6], swing[(x["t"] > 0.1) & (x["t"] < 0.5)]
    assert np.max(np.abs(late)) == pytest.approx(np.max(np.abs(early)), rel=0.15)


def test_pulled_slowly_the_load_sticks_and_slips_and_faster_it_slides() -> None:
    """Below the speed where the swings grow the load stands most of the time; far above it never does."""

    def standing(speed: float) -> float:
        p = sliding(roller_ageing_nm=3000.0, roller_viscous_nm_s_per_rad=1e6)
        x = follow(released(p, vel_motor=speed * p.ratio), 0.0, 4.0)
        late = x["vel_load"][x["t"] > 1.5]
        return float(np.mean(np.abs(late) < 0.05 * speed))

    assert standing(5e-6) > 0.5
    assert growth(sliding(roller_ageing_nm=3000.0, roller_viscous_nm_s_per_rad=1e6), 5e-6).real > 0.0
    fast = 5e-2
    assert growth(sliding(roller_ageing_nm=3000.0, roller_viscous_nm_s_per_rad=1e6), fast).real < 0.0
    assert standing(fast) == 0.0


def test_growth_of_breakaway_holds_an_axis_that_turned_a_moment_ago_less() -> None:
    """A torque between fresh and aged breakaway moves the axis that has just moved and not the one that has stood."""
    p = bare(
        "rigid", "motor_friction", motor_ageing_nm=3.0, motor_ageing_time_s=10.0, motor_ageing_length_rad=0.05
    )
    p.ageing = True
    p.motor_viscous_nm_s_per_rad, torque = 0.0, 8.0
    assert p.motor_breakaway_nm < torque < p.motor_breakaway_nm + 3.0
    moved = [follow(released(p, motor_age=age), torque, 1.0)["pos_motor"][-1] for age in (0.0, 1.0)]
    assert moved[0] > 0.1
    assert 0.0 < moved[1] < 0.1 * moved[0]
