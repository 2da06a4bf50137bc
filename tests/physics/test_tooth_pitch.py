"""Single teeth: drawn within their grade, each felt while it carries, handed over smoothly, without own work."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl import _core
from gantryctl.wiring.simulator import gantry_sim, plant_params
from gantryctl.wiring.teeth import pitch_deviation_um, ring_deviations_um, single_pitch_um
from physics.plants import bare, follow, machine, put, released, simulator

ON = {"plant.switches.tooth_pitch": True}
PITCH = 2.0 * math.pi / 338.0


def test_the_teeth_are_the_worst_that_pass_their_grade() -> None:
    """Largest step between neighbours f_pt or range F_p, never more; run-out and ovality are left to other keys."""
    for grade, seed in ((8.0, 1), (6.0, 2), (8.0, 3)):
        teeth = np.array(ring_deviations_um(338, 14.0, grade, seed))
        step = np.max(np.abs(np.diff(teeth, append=teeth[0])))
        limits = single_pitch_um(14.0, 14.0 * 338, grade), pitch_deviation_um(14.0, 14.0 * 338, grade)
        used = step / limits[0], np.ptp(teeth) / limits[1]
        assert max(used) == pytest.approx(1.0, rel=1e-12)
        waves = np.abs(np.fft.rfft(teeth))
        assert np.max(waves[:13]) < 1e-9 * np.max(waves)
    assert ring_deviations_um(338, 14.0, 8.0, 1) != ring_deviations_um(338, 14.0, 8.0, 4)
    # f_pt and F_p of grade 8 by the formulas of the standard, by hand: sqrt(4732) = 68.79.
    assert single_pitch_um(14.0, 4732.0, 8.0) == pytest.approx(
        (0.3 * (14 + 0.4 * 68.79) + 4) * 2.8284, rel=1e-4
    )


def test_a_tooth_is_felt_while_it_carries_and_the_mean_of_two_in_the_middle_of_the_handover() -> None:
    p = plant_params(machine(ON | {"plant.tooth_pitch.contact_ratio": 1.6}))
    teeth, pinion = np.array(p.ring_pitch_rad), np.array(p.pinion_pitch_rad)
    assert (len(teeth), len(pinion)) == (338, 26)
    for tooth in (0, 1, 100, 337, 338 + 5, -1, -339):
        for part, weight in ((0.05, 0.0), (0.35, 0.0), (0.7, 0.5), (0.9999999, 1.0)):
            one, other = teeth[tooth % 338], teeth[(tooth + 1) % 338]
            found = _core.pitch_error(p, (tooth + part) * PITCH, 0.0)[0]
            assert found == pytest.approx((1 - weight) * one + weight * other, abs=1e-15)
            motor = (tooth + part) * 2.0 * math.pi / 26 * p.reducer_ratio
            one, other = pinion[tooth % 26], pinion[(tooth + 1) % 26]
            found = _core.pitch_error(p, 0.0, motor)[3]
            assert found == pytest.approx((1 - weight) * one + weight * other, abs=1e-15)


def test_slope_and_curvature_are_those_of_the_error() -> None:
    p = plant_params(machine(ON))
    h = 1e-4 * PITCH
    for at in np.linspace(3.1, 3.99, 40) * PITCH:
        low, here, high = (
            np.array(_core.pitch_error(p, at + k * h, (at + k * h) * p.ratio)) for k in (-1, 0, 1)
        )
        size = np.max(np.abs(p.ring_pitch_rad))
        assert (high[0] - low[0]) / (2 * h) == pytest.approx(here[1], abs=1e-6 * size / PITCH)
        assert (high[1] - low[1]) / (2 * h) == pytest.approx(here[2], abs=1e-4 * size / PITCH**2)
        assert (high[3] - low[3]) / (2 * h * p.ratio) == pytest.approx(
            here[4], abs=1e-6 * size / PITCH / p.ratio
        )
        assert (high[4] - low[4]) / (2 * h * p.ratio) == pytest.approx(
            here[5], abs=1e-4 * size / (PITCH * p.ratio) ** 2
        )


def test_a_standing_load_is_where_its_teeth_put_it() -> None:
    """Without moment: thm = i (theta - e_r - e_m), the pinion's error at that angle."""
    m = machine(ON | {"plant.switches.eccentric_moment": False, "plant.switches.gear_error": False})
    p, sim = plant_params(m), gantry_sim(m)
    for theta in (0.0, 0.3, -1.0, 2.2):
        sim.static_start(theta, True)
        motor = sim.state["pos_motor"]
        errors = _core.pitch_error(p, theta, motor)
        assert motor == pytest.approx(p.ratio * (theta - errors[0] - errors[3]), abs=1e-9)
        assert abs(errors[0]) > 1e-7


def test_they_do_no_work() -> None:
    """Free swings over 30 teeth: the energy of masses and spring stays, although the teeth push.

    The rest of 1e-7 is that of the continuation from an anchor; slopes left out of the torques would cost 1e-4.
    """
    p = bare()
    p.tooth_pitch = True
    like = plant_params(machine(ON | {"plant.tooth_pitch.scale": 3.0}))
    p.ring_pitch_rad, p.pinion_pitch_rad, p.contact_ratio = (
        like.ring_pitch_rad, like.pinion_pitch_rad, like.contact_ratio,
    )  # fmt: skip
    sim = simulator(p, steps=4)
    sim.static_start(0.0, True)
    speed = 6.0 * math.pi / 180.0
    x = follow(put(sim, vel_motor=speed * p.ratio, vel_load=speed), 0.0, 3.0)
    errors = np.array(
        [_core.pitch_error(p, a, b) for a, b in zip(x["pos_load"], x["pos_motor"], strict=True)]
    )
    twist = x["pos_motor"] / p.ratio + errors[:, 0] + errors[:, 3] - x["pos_load"]
    spring = 0.5 * p.stiffness_1_nm_per_rad * twist**2
    masses = (
        0.5 * p.inertia_motor_kg_m2 * x["vel_motor"] ** 2 + 0.5 * p.inertia_load_kg_m2 * x["vel_load"] ** 2
    )
    energy = spring + masses
    assert x["pos_load"][-1] > 15 * PITCH
    assert np.max(spring) > 1e-2
    assert np.max(np.abs(energy - energy[0])) < 1e-2 * np.max(spring)


def test_teeth_for_which_there_is_no_room_are_refused() -> None:
    p = plant_params(machine(ON))
    with pytest.raises(ValueError, match="1024"):
        p.ring_pitch_rad = [0.0] * 1025
    with pytest.raises(ValueError, match="finite"):
        p.pinion_pitch_rad = [math.nan] * 26
    p.ring_teeth = 0
    with pytest.raises(ValueError, match="teeth"):
        released(p)
