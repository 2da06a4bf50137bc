"""The gear-error map (plant equations S2): printed values, slopes, harmonics, and what the load makes of it."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl import _core
from gantryctl.wiring.simulator import plant_params
from physics.independent_plant import IndependentPlant
from physics.plants import CYCLE_S, DEG, bare, follow, machine, put, released


@functools.cache
def full(scale: float = 1.2) -> _core.PlantParams:
    return plant_params(machine({"plant.gear_error.scale": scale}))


@pytest.mark.parametrize(
    ("function", "at_rad", "error", "slope"),
    [
        (_core.ring_error, 0.0, -2.02896e-5, 8.4273e-5),
        (_core.ring_error, 90 * DEG, 5.09537e-5, 3.0215e-5),
        (_core.motor_error, 0.0, 1.192045e-5, -3.26374e-6),
        (_core.motor_error, 1.0, 1.564600e-5, None),
    ],
)
def test_values_of_the_reference_machine(
    function: object, at_rad: float, error: float, slope: float | None
) -> None:
    """Printed with six or seven digits; half a unit of the last."""
    value, derivative = function(full(), at_rad)
    assert value == pytest.approx(error, abs=5e-11)
    if slope is not None:
        assert derivative == pytest.approx(slope, abs=5e-10)


def test_the_ring_is_289_um_from_peak_to_peak() -> None:
    um = [_core.ring_error(full(), r)[0] * 2.366e6 for r in np.linspace(-math.pi, math.pi, 20001)]
    assert np.ptp(um) == pytest.approx(289.3, abs=0.05)


# Differences over 2h: rounding 1e-20/h and curvature n^3 A h^2 (338^3 of the mesh at the gantry) are below 1e-9.
@given(st.floats(-3.2, 3.2))
def test_the_ring_slope_is_the_derivative(rho: float) -> None:
    p, h = full(), 1e-5
    numeric = (_core.ring_error(p, rho + h)[0] - _core.ring_error(p, rho - h)[0]) / (2 * h)
    assert _core.ring_error(p, rho)[1] == pytest.approx(numeric, abs=2e-10)


@given(st.floats(-3600.0, 3600.0))
def test_the_motor_slope_is_the_derivative(pos: float) -> None:
    p, h = full(), 1e-4
    numeric = (_core.motor_error(p, pos + h)[0] - _core.motor_error(p, pos - h)[0]) / (2 * h)
    assert _core.motor_error(p, pos)[1] == pytest.approx(numeric, abs=2e-12)


@given(
    pos=st.floats(-3600.0, 3600.0), rho=st.floats(-3.2, 3.2), phases=st.tuples(*[st.floats(0.0, 6.28)] * 18)
)
def test_any_phases_agree_with_the_equation_written_out(
    pos: float, rho: float, phases: tuple[float, ...]
) -> None:
    """Recurrence and angle doubling against one sine per term: twelve roundings of 1e-4."""
    m = machine({"plant.gear_error.phases_rad": phases})
    p = plant_params(m)
    er, der, em, dem = IndependentPlant(m).gear_error(pos, rho)
    assert _core.ring_error(p, rho) == pytest.approx((er, der), abs=1e-17)
    assert _core.motor_error(p, pos) == pytest.approx((em, dem), abs=1e-17)


def test_the_ring_has_its_twelve_harmonics_and_nothing_else() -> None:
    n = 256
    values = np.array([_core.ring_error(full(), 2 * math.pi * k / n)[0] for k in range(n)])
    spectrum = 2.0 / n * np.abs(np.fft.rfft(values))
    um = [60, 32, 22, 17, 13, 11, 9, 8, 7, 6, 5, 5]
    assert spectrum[1:13] == pytest.approx([1.2e-6 * a / 2.366 for a in um], rel=1e-11)
    assert np.max(np.r_[spectrum[0], spectrum[13:]]) < 1e-18


def test_the_motor_side_has_its_five_cycles() -> None:
    """Over one pinion turn, 88 motor turns: 1 (pinion and output), 26 (teeth), 88, 176 and 352 cycles."""
    n = 1024
    turn = 2 * math.pi * 88
    values = np.array([_core.motor_error(full(), turn * k / n)[0] for k in range(n)])
    spectrum = 2.0 / n * np.abs(np.fft.rfft(values))
    expected = {
        1: 9e-5 / 13 + 20e-6 / 2.366, 26: 8e-6 / 2.366, 88: 1.5e-5 / 13, 176: 4e-5 / 13, 352: 1e-5 / 13
    }  # fmt: skip
    for cycles, amplitude in expected.items():
        assert spectrum[cycles] == pytest.approx(1.2 * amplitude, rel=1e-10), cycles
    assert np.max(np.delete(spectrum, list(expected))) < 1e-17


def test_everything_scales_with_the_scale() -> None:
    one, three = full(1.0), full(3.0)
    for at in (-1.0, 0.4, 2.0):
        for function in (_core.ring_error, _core.motor_error):
            assert function(three, at) == pytest.approx([3 * v for v in function(one, at)], rel=1e-12)


def test_a_free_load_goes_where_the_gears_put_it() -> None:
    """No load torque, motor turned by hand over 20 turns: rho = thm/i + e_m(thm) + e_r(rho), the spring unstrained.

    In motion the spring only carries J e'' w^2, which at 5 rad/s of the motor is below 1e-8 rad.
    """
    p = bare("gear_error", inertia_motor_kg_m2=1e18, inertia_load_kg_m2=1e3, damping_nm_s_per_rad=1e5)
    sim = put(released(p), vel_motor=5.0)
    x = follow(sim, 0.0, 4 * math.pi * 2, 2 * CYCLE_S)
    for k in range(1000, len(x["t"]), 997):
        rho, pos = x["pos_load"][k], x["pos_motor"][k]
        expected = pos / p.ratio + _core.motor_error(p, pos)[0] + _core.ring_error(p, rho)[0]
        assert rho == pytest.approx(expected, abs=1e-8)
    assert np.ptp(x["pos_load"] - x["pos_motor"] / p.ratio) > 1e-5


def test_the_slope_changes_the_torque_not_only_the_angle() -> None:
    """Virtual work: the motor feels Tg (1/i + e_m'), the load Tg (1 - e_r')."""
    p = bare("gear_error")
    at = dict(pos_load=0.4, pos_motor=0.4 * p.ratio + 0.3)
    sim = released(p, 0.4)
    put(sim, **at)
    before = sim.state
    dt = 1e-9
    sim.advance(0.0, dt)
    after, mesh = sim.state, sim.truth()[6]
    em, er = _core.motor_error(p, at["pos_motor"])[1], _core.ring_error(p, at["pos_load"])[1]
    motor = (after["vel_motor"] - before["vel_motor"]) / dt
    load = (after["vel_load"] - before["vel_load"]) / dt
    assert abs(mesh) > 1e5
    # differences of speeds over 1 ns: 12 digits of 1e5 N m are left
    assert motor == pytest.approx(-mesh * (1 / p.ratio + em) / p.inertia_motor_kg_m2, rel=1e-9)
    assert load == pytest.approx(mesh * (1 - er) / p.inertia_load_kg_m2, rel=1e-9)
    assert abs(er) > 1e-5
    assert abs(em * p.ratio) > 1e-4
