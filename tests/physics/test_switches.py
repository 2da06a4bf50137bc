"""Every switch: off, the effect is exactly absent; on, it is there.

Exactly: bit for bit the plant whose parameter is zero, over a run that passes through everything (servo, move, torque
limit, quick stop, emergency stop, brake).
"""

from __future__ import annotations

import numpy as np
import pytest

from gantryctl.wiring.simulator import gantry_sim, plant_params
from physics.plants import (
    OFF,
    QUICK_STOP,
    SPEED,
    Arrays,
    bare,
    commanded,
    controlled,
    follow,
    machine,
    released,
    trapezoid,
)

ZERO = {
    "gear_error": {"plant.gear_error.scale": 0.0},
    "backlash": {"plant.transmission.backlash_mm": 0.0},
    "hysteresis": {
        "plant.transmission.hysteresis_torque_nm": 0.0,
        "plant.transmission.hysteresis_load_ratio": 0.0,
    },
    "eccentric_moment": {"plant.load.eccentricity_m": 0.0},
    "torque_ripple": {"plant.motor.torque_ripple_nm": 0.0},
    "three_slopes": {
        "plant.transmission.reducer_stiffness_2_nm_per_rad": 4.6e6,
        "plant.transmission.reducer_stiffness_3_nm_per_rad": 4.6e6,
    },
}
PRESENT = [
    "gear_error", "backlash", "hysteresis", "roller_friction", "motor_friction", "eccentric_moment", "base",
    "torque_ripple", "three_slopes",
]  # fmt: skip


def day(changes: dict[str, object]) -> Arrays:
    """A move, a saturated swing, a quick stop, an emergency stop."""
    m = machine(changes)
    sim = gantry_sim(m)
    parts = [controlled(m, trapezoid(20.0, 20.5, rest_s=0.1), 1.5, sim)]
    parts.append(commanded(sim, SPEED, 60.0, 0.6, True))
    parts.append(commanded(sim, QUICK_STOP, 0.0, 0.4, True))
    parts.append(commanded(sim, OFF, 0.0, 0.5, False))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def same(a: Arrays, b: Arrays) -> bool:
    return all(np.array_equal(a[name], b[name]) for name in a)


def test_the_run_reaches_everything() -> None:
    """Or the comparisons below would prove little."""
    log = day({})
    assert np.max(np.abs(log["torque_mesh_nm"])) > 90e3  # beyond T2, the third slope
    assert np.any(log["torque_limited"] == 1.0)
    assert np.any(log["torque_mesh_nm"] == 0.0)  # in the gap
    assert np.isfinite(np.array(list(log.values()))).all()


@pytest.mark.parametrize("switch", list(ZERO))
def test_switched_off_it_is_the_plant_with_the_parameter_zero(switch: str) -> None:
    assert same(day({f"plant.switches.{switch}": False}), day(ZERO[switch]))


@pytest.mark.parametrize("switch", PRESENT)
def test_switched_on_it_makes_a_difference(switch: str) -> None:
    assert not same(day({f"plant.switches.{switch}": False}), day({}))


@pytest.mark.parametrize(
    ("switch", "state"),
    [("roller_friction", "roller_z"), ("motor_friction", "motor_z"), ("hysteresis", "hysteresis")],
)
def test_switched_off_its_state_does_not_exist(switch: str, state: str) -> None:
    m = machine({f"plant.switches.{switch}": False})
    sim = gantry_sim(m)
    controlled(m, trapezoid(20.0, 21.0), 0.5, sim)
    assert sim.state[state] == 0.0
    m = machine()
    sim = gantry_sim(m)
    controlled(m, trapezoid(20.0, 21.0), 0.5, sim)
    assert sim.state[state] != 0.0


@pytest.mark.parametrize(
    ("switch", "others"),
    [
        (
            "roller_friction",
            {"plant.roller_friction.presliding_rad": 1e-4, "plant.roller_friction.micro_damping": 1.0},
        ),
        (
            "motor_friction",
            {"plant.motor_friction.presliding_rad": 0.01, "plant.motor_friction.load_ratio": 0.5},
        ),
        ("gear_error", {"plant.gear_error.mesh_um": 20.0}),
        ("torque_ripple", {"plant.motor.torque_ripple_order": 6}),
        ("base", {"plant.base.frequency_hz": 11.0, "plant.base.damping_ratio": 0.1}),
        ("backlash", {"plant.transmission.backlash_mm": 0.4}),
        ("hysteresis", {"plant.transmission.hysteresis_length_rad": 3e-5}),
        ("three_slopes", {"plant.transmission.reducer_stiffness_3_nm_per_rad": 9e6}),
        ("eccentric_moment", {"plant.load.eccentric_angle_deg": 33.0}),
    ],
)
def test_switched_off_its_parameters_say_nothing(switch: str, others: dict[str, object]) -> None:
    off = {f"plant.switches.{switch}": False}
    assert same(day(off), day(off | others))


BEYOND: dict[str, dict[str, object]] = {
    "tooth_pitch": {"plant.tooth_pitch.scale": 2.0},
    "thermal": {"plant.thermal.gears_start_k": -5.0, "plant.thermal.motor_start_k": 40.0},
    "ageing": {"plant.ageing.roller_nm": 3000.0},
    "cogging": {"plant.motor.cogging_torque_nm": 5.0},
    "encoder_errors": {"plant.encoder.eccentricity_rad": 1e-3},
    "cable": {"plant.cable.moment_nm": 900.0},
    "second_pinion": {"plant.second_pinion.preload_nm": 40.0, "plant.second_pinion.lost": "second"},
}


@pytest.mark.parametrize("switch", list(BEYOND))
def test_effects_beyond_the_reference_machine_are_off_absent_and_on_there(switch: str) -> None:
    usual, on = day({}), {f"plant.switches.{switch}": True}
    assert same(usual, day(BEYOND[switch]))
    assert not same(usual, day(BEYOND[switch] | on))
    assert np.isfinite(np.array(list(day(BEYOND[switch] | on).values()))).all()


def test_friction_without_levels_is_friction_switched_off() -> None:
    """Fc = Fs = Fv = 0, friction still "present": no torque, and no NaN."""
    for name, levels in (
        ("roller_friction", ("roller_coulomb_nm", "roller_breakaway_nm", "roller_viscous_nm_s_per_rad")),
        (
            "motor_friction",
            ("motor_coulomb_nm", "motor_breakaway_nm", "motor_viscous_nm_s_per_rad", "motor_load_ratio"),
        ),
    ):
        weak, none = bare(name, "damping"), bare("damping")
        for level in levels:
            setattr(weak, level, 0.0)
        a, b = (follow(released(p, vel_motor=2.0), 10.0, 0.2) for p in (weak, none))
        assert np.array_equal(a["pos_load"], b["pos_load"])
        assert np.array_equal(a["vel_motor"], b["vel_motor"])


def test_viscous_friction_alone_is_possible() -> None:
    """Fc = 0, Fv > 0 on the rollers: a rigid body slows down as exp(-Fv t/(J + i^2 Jm))."""
    p = bare(
        "rigid",
        "roller_friction",
        roller_coulomb_nm=0.0,
        roller_breakaway_nm=0.0,
        roller_viscous_nm_s_per_rad=2e6,
    )
    x = follow(released(p, vel_motor=50.0, vel_load=50.0 / p.ratio), 0.0, 2.0, 1e-3)
    rate = p.roller_viscous_nm_s_per_rad / (p.inertia_load_kg_m2 + p.ratio**2 * p.inertia_motor_kg_m2)
    assert np.allclose(x["vel_motor"], 50.0 * np.exp(-rate * x["t"]), rtol=1e-9)


def test_rigid_leaves_all_compliance_out() -> None:
    """theta = thm/i to the last bit, base at rest; parameters of gears and base say nothing."""
    rigid = {"plant.switches.rigid": True}
    log = day(rigid)
    assert np.array_equal(log["pos_load_rad"], log["pos_motor_rad"] * (1.0 / 1144.0))
    assert not np.any(log["pos_base_rad"])
    other = {
        "plant.transmission.backlash_mm": 0.4,
        "plant.gear_error.scale": 3.0,
        "plant.base.frequency_hz": 11.0,
        "plant.transmission.rest_stiffness_nm_per_rad": 5e8,
    }
    assert same(log, day(rigid | other))


def test_very_stiff_gears_are_the_rigid_plant() -> None:
    """K x 1e4, no other effect: the same acceleration to the ratio of the spring's way to the way."""
    stiff = bare("damping")
    for name in ("stiffness_1_nm_per_rad", "stiffness_2_nm_per_rad", "stiffness_3_nm_per_rad"):
        setattr(stiff, name, 1e4 * getattr(stiff, name))
    stiff.damping_nm_s_per_rad *= 100.0
    a = follow(released(stiff, steps=32), 50.0, 0.5)
    b = follow(released(bare("rigid")), 50.0, 0.5)
    assert np.allclose(a["pos_motor"], b["pos_motor"], rtol=0, atol=1e-5 * b["pos_motor"][-1])


@pytest.mark.parametrize(
    ("key", "value", "field", "expected"),
    [
        ("drive.current_loop.ideal", True, "current_bandwidth_rad_s", 0.0),
        ("plant.switches.backlash", False, "half_backlash_rad", 0.0),
        ("plant.switches.base", False, "base", False),
        ("plant.switches.rigid", True, "rigid", True),
    ],
)
def test_the_machine_file_reaches_the_kernel(key: str, value: bool, field: str, expected: object) -> None:
    assert getattr(plant_params(machine()), field) != expected
    assert getattr(plant_params(machine({key: value})), field) == expected
