"""Transfer functions against scipy and closed forms."""

import math

import numpy as np
import pytest
import scipy.linalg
import scipy.signal
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.engineering.analysis.models.linear import (
    TransferFunction,
    expm,
    integrator,
    inverse_laplace,
    largest,
    roots,
)
from gantryctl.engineering.analysis.models.rigid import RigidLoop
from gantryctl.engineering.analysis.models.two_mass import TwoMass, TwoMassLoop

PAPER = RigidLoop(1.8977293755195852, 77.6959, 0.01, 10.0, 1.0)
gains = st.builds(
    RigidLoop,
    js_kg_m2=st.floats(0.1, 10.0),
    kvp_nm_s_per_rad=st.floats(20.0, 500.0),
    tvi_s=st.floats(0.005, 0.1),
    kpp_per_s=st.floats(1.0, 30.0),
    kvf=st.sampled_from([0.0, 0.5, 1.0]),
)


@given(gains)
def test_step_responses_agree_with_scipy(loop: RigidLoop) -> None:
    system = scipy.signal.lti(list(loop.position.num), list(loop.position.den))
    times = np.linspace(0.0, 0.5, 11)
    _, expected = scipy.signal.step(system, T=times)
    found = loop.step(times[1:].tolist())
    np.testing.assert_allclose(found, expected[1:], rtol=1e-6, atol=1e-6 * np.abs(expected).max())


@given(gains)
def test_routh_limits_are_where_the_poles_cross(loop: RigidLoop) -> None:
    for factor, stable in ((0.999, False), (1.001, True)):
        changed = RigidLoop(loop.js_kg_m2, loop.kvp_min * factor, loop.tvi_s, loop.kpp_per_s)
        assert bool(changed.position.poles.real.max() < 0.0) is stable
    if math.isfinite(loop.kpp_max):
        at_limit = RigidLoop(loop.js_kg_m2, loop.kvp_nm_s_per_rad, loop.tvi_s, loop.kpp_max)
        assert at_limit.position.poles.real.max() == pytest.approx(0.0, abs=1e-6 * loop.kpp_max)


@given(gains)
def test_gain_reduction_is_the_routh_limit(loop: RigidLoop) -> None:
    assert loop.gain_reduction_margin == pytest.approx(loop.kvp_min / loop.kvp_nm_s_per_rad, rel=1e-9)


@given(gains)
def test_crossings_and_bandwidth_lie_on_the_frequency_response(loop: RigidLoop) -> None:
    margin = loop.velocity_open.phase_margin()
    assert margin is not None
    assert abs(loop.velocity_open(1j * margin.crossover_rad_s)) == pytest.approx(1.0, rel=1e-9)
    bandwidth = loop.position.bandwidth_rad_s()
    assert bandwidth is not None
    assert 20.0 * math.log10(abs(loop.position(1j * bandwidth))) == pytest.approx(-3.0, abs=1e-8)
    s = 1j * np.geomspace(0.01, 1e4, 2000)
    peak = np.abs(np.polyval(loop.position.num, s) / np.polyval(loop.position.den, s)).max()
    assert loop.position.resonance_peak() >= peak * (1.0 - 1e-12)


@given(st.integers(0, 2**32 - 1), st.floats(1e-3, 30.0))
def test_matrix_exponential_agrees_with_scipy(seed: int, size: float) -> None:
    matrix = size * np.random.default_rng(seed).normal(size=(4, 4)) / 4.0
    expected = scipy.linalg.expm(matrix)
    np.testing.assert_allclose(expm(matrix), expected, rtol=1e-8, atol=1e-10 * np.abs(expected).max())


def test_known_transforms() -> None:
    times = [0.1, 1.0, 3.0]
    t = np.array(times)
    np.testing.assert_allclose(inverse_laplace(integrator(3, 2.0), times), t**2)
    np.testing.assert_allclose(inverse_laplace(TransferFunction.of([1], [1, 2, 1]), times), t * np.exp(-t))
    wave = TransferFunction.of([5], [1, 0, 25])
    np.testing.assert_allclose(inverse_laplace(wave, times), np.sin(5 * t), atol=1e-13)
    time, value = largest(TransferFunction.of([1], [1, 2, 1]))
    assert time == pytest.approx(1.0, abs=1e-6)
    assert value == pytest.approx(math.exp(-1.0), rel=1e-12)


def test_common_zeros_and_leading_zeros_are_dropped() -> None:
    assert TransferFunction.of([0, 3, 0, 0], [1, 2, 0]) == TransferFunction((3.0, 0.0), (1.0, 2.0))


def test_an_impulse_at_the_start_is_refused() -> None:
    with pytest.raises(ValueError, match="impulse"):
        inverse_laplace(TransferFunction.of([1, 0], [1, 1]), [1.0])


def test_what_does_not_exist_is_none() -> None:
    flat = TransferFunction.of([1.0], [1.0, 1.0])
    assert TransferFunction.of([0.5], [1.0, 1.0]).phase_margin() is None
    assert TransferFunction.of([1.0, 1.0], [1.0, 2.0]).bandwidth_rad_s() is None
    assert flat.gain_margins().size == 0
    assert flat.resonance_peak() == 1.0
    assert roots([3.0]).size == 0
    np.testing.assert_array_equal(roots([1.0, 0.0, 0.0]), [0.0, 0.0])


def test_no_feed_forward_leaves_the_ramp_error() -> None:
    loop = RigidLoop(PAPER.js_kg_m2, 77.6959, 0.01, 10.0, kvf=0.0)
    assert loop.error_behind(1, 6.0, [20.0])[0] == pytest.approx(0.6, rel=1e-9)
    assert loop.error_behind(1, 0.4, [20.0])[0] == pytest.approx(loop.steady_speed_error(0.4), rel=1e-9)


def test_constant_torque_leaves_no_error_and_a_ramp_does() -> None:
    assert abs(PAPER.torque_step(10.0, [20.0])[0]) < 1e-15
    ramp = inverse_laplace(PAPER.compliance * integrator(2), [20.0])[0]
    assert ramp == pytest.approx(PAPER.torque_ramp_error_rad_per_nm_s, rel=1e-9)
    jerk = inverse_laplace(PAPER.error * integrator(4), [20.0])[0]
    assert jerk == pytest.approx(PAPER.jerk_error_per_jerk, rel=1e-9)


def test_a_stiff_spring_is_the_rigid_loop() -> None:
    plant = TwoMass(2.18e6, 0.232, 1144.0, 1e14, 0.025)
    poles = TwoMassLoop(plant, PAPER).poles
    slow = np.sort_complex(poles[np.abs(poles) < 1e3])
    np.testing.assert_allclose(slow, PAPER.position.poles, rtol=1e-3)


def test_the_loop_takes_damping_away_from_the_load() -> None:
    plant = TwoMass(2.18e6, 0.232, 1144.0, 5e8, 0.025)
    loop = TwoMassLoop(plant, PAPER)
    assert loop.load_mode_zeta < plant.damping_ratio
    assert loop.max_real_part < 0.0
    # the closed forms: the load alone on its spring, and both bodies free
    free = np.polyadd(
        np.polymul([plant.motor_inertia_kg_m2 * plant.ratio**2, 0.0, 0.0], plant.load_polynomial),
        plant.load_inertia_kg_m2
        * np.array([plant.damping_nm_s_per_rad, plant.stiffness_nm_per_rad, 0.0, 0.0]),
    )
    assert np.abs(roots(free)).max() == pytest.approx(2.0 * math.pi * plant.resonance_hz, rel=1e-6)
