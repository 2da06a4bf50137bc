"""The loop as it runs: the linear plant, its sampling, and agreement with other ways to the same numbers."""

import dataclasses
import math

import control
import numpy as np
import pytest
import scipy.linalg

from gantryctl.engineering.analysis.models.margins import phase_margins
from gantryctl.engineering.analysis.models.mechanics import (
    IDEAL_BANDWIDTH_RAD_S,
    Friction,
    PlantKind,
    Variation,
    mechanics,
)
from gantryctl.engineering.analysis.models.modes import Oscillation, least_damped, modes, nearest
from gantryctl.engineering.analysis.models.paper_loop import rigid_loop, two_mass_loop
from gantryctl.engineering.analysis.models.responses import SetPointStep, time_response
from gantryctl.engineering.analysis.models.sampled import Cut, Input, LoopSettings, SampledLoop, loop_settings
from gantryctl.engineering.analysis.study import FOLLOWING, cut_figures, grid_of, study
from gantryctl.engineering.analysis.text import modes_table, sentences
from gantryctl.machine import configs_folder, default_machine, load_machine, with_values
from support.control_models import control_models

MACHINE = default_machine()
SETTINGS = loop_settings(MACHINE)
FINE = LoopSettings(77.6959, 0.01, 10.0, 1.0, cycle_s=2e-6, cycles_per_scan=1, delay_cycles=0, latency_s=0.0)
"""So fast that the sampled loop is the continuous one."""
OMEGA = np.geomspace(0.1, 2000.0, 60)


def loop(kind=PlantKind.FULL, friction=Friction.NONE, settings=SETTINGS, **variation):
    return SampledLoop(mechanics(MACHINE, kind, friction, Variation(**variation)), settings)


def continuous(kind, **variation):
    plant = mechanics(MACHINE, kind, variation=Variation(**variation))
    return SampledLoop(dataclasses.replace(plant, current_bandwidth_rad_s=IDEAL_BANDWIDTH_RAD_S), FINE)


def test_motor_held_modes_of_the_full_plant():
    """The reference: 2.00 and 8.52 Hz."""
    held = [Oscillation.of(pole) for pole in loop().plant.held_poles()]
    assert [mode.hz for mode in held] == [pytest.approx(2.00, abs=0.01), pytest.approx(8.52, abs=0.01)]


def test_the_loop_leaves_the_load_nine_tenths_of_a_percent():
    """The reference: 0.9 % on the full plant with base."""
    load, base = modes(loop())
    assert load.closed.zeta == pytest.approx(0.0091, abs=0.0001)
    assert load.held.zeta == pytest.approx(0.0164, abs=0.0001)
    assert load.damping_taken > 0.4 * load.held.zeta
    assert abs(base.damping_taken) < 0.01 * base.held.zeta


def test_sampled_fast_enough_is_equation_5():
    expected = rigid_loop(MACHINE).position.poles
    found = continuous(PlantKind.RIGID, motor_inertia_kg_m2=0.232).poles
    for pole in expected:
        # the eccentric moment's stiffness, 1e-8 of the loop's, and 2 us of sampling remain
        assert abs(nearest(found, pole) - pole) < 1e-3 * abs(pole)


def test_sampled_fast_enough_is_the_two_mass_loop():
    expected = two_mass_loop(MACHINE, 5e8, 0.025).poles
    found = continuous(
        PlantKind.TWO_MASS, stiffness_nm_per_rad=5e8, damping_ratio=0.025, motor_inertia_kg_m2=0.232
    ).poles
    for pole in expected:
        assert abs(nearest(found, pole) - pole) < 2e-3 * abs(pole)


def test_the_held_plant_is_the_matrix_exponential():
    plant = loop().plant
    block = np.zeros((plant.size + 1, plant.size + 1))
    block[:-1, :-1], block[:-1, -1] = plant.a, plant.b
    expected = scipy.linalg.expm(block * 125e-6)
    ad, bd = loop().held
    np.testing.assert_allclose(ad, expected[:-1, :-1], rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(bd, expected[:-1, -1], rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize("kind", list(PlantKind))
def test_python_control_gets_the_same_open_loops(kind):
    """Built with its own algebra of sampled transfer functions, not with our matrices."""
    subject = loop(kind)
    models = control_models(subject)
    for system, cut in ((models.speed_open, Cut.SPEED_ERROR), (models.command_open, Cut.SPEED_COMMAND)):
        theirs = np.asarray(system(np.exp(1j * OMEGA * system.dt))).squeeze()
        np.testing.assert_allclose(theirs, subject.open_loop(cut, OMEGA), rtol=1e-6)


def test_python_control_gets_the_same_margins_and_poles():
    subject = loop()
    models = control_models(subject)
    grid = grid_of(subject, Cut.SPEED_ERROR)
    sampled = control.frd(models.speed_open(np.exp(1j * grid * SETTINGS.cycle_s)).squeeze(), grid)
    theirs = control.stability_margins(sampled)
    ours = cut_figures(subject, Cut.SPEED_ERROR)
    assert theirs[1] == pytest.approx(ours.phase.margin_deg, abs=0.05)
    assert theirs[4] == pytest.approx(ours.phase.crossover_rad_s, rel=1e-3)
    assert theirs[0] == pytest.approx(ours.gain_up, rel=1e-3)
    closed = np.sort_complex(np.log(models.closed.poles()[np.abs(models.closed.poles()) > 1e-6]) / 1e-3)
    np.testing.assert_allclose(closed, subject.poles, rtol=1e-5)


@pytest.mark.parametrize("reference", list(SetPointStep))
def test_python_control_gets_the_same_time_responses(reference):
    subject = loop()
    found = time_response(subject, reference, 1e-3, 0.5)
    pos = {
        SetPointStep.STEP: 1.0,
        SetPointStep.RAMP: found.time_s,
        SetPointStep.PARABOLA: found.time_s**2 / 2.0,
    }
    vel = {SetPointStep.STEP: 0.0, SetPointStep.RAMP: 1.0, SetPointStep.PARABOLA: found.time_s}
    inputs = [1e-3 * part[reference] * np.ones_like(found.time_s) for part in (pos, vel)]
    theirs = control.forced_response(control_models(subject).closed, found.time_s, inputs).outputs
    for row, ours in ((0, found.pos_err_motor_rad), (1, found.pos_err_load_rad)):
        np.testing.assert_allclose(inputs[0] - theirs[row], ours, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize(("cut", "where"), [(Cut.TORQUE, "torque_gain"), (Cut.SPEED_COMMAND, "command_gain")])
def test_a_gain_limit_is_where_the_poles_cross(cut, where):
    subject = loop()
    figures = cut_figures(subject, cut)
    for limit, inside, outside in ((figures.gain_down, 1.01, 0.99), (figures.gain_up, 0.99, 1.01)):
        if limit is None:
            continue
        assert subject.stable(**{where: limit * inside})
        assert not subject.stable(**{where: limit * outside})


def test_the_torque_cut_crosses_180_deg_at_the_gain_limit():
    """The exact limit and the frequency response of the drive cycle tell the same story."""
    figures = cut_figures(loop(), Cut.TORQUE)
    for factor in (figures.gain_down, figures.gain_up):
        changed = loop(
            settings=dataclasses.replace(SETTINGS, kvp_nm_s_per_rad=SETTINGS.kvp_nm_s_per_rad * factor)
        )
        grid = grid_of(changed, Cut.TORQUE)
        margins = phase_margins(lambda w, changed=changed: changed.open_loop(Cut.TORQUE, w), grid)
        assert min(abs(margin.margin_deg) for margin in margins) < 0.05


def test_the_rigid_loop_is_conditionally_stable_as_it_runs():
    subject = loop(PlantKind.RIGID, motor_inertia_kg_m2=0.232)
    figures = cut_figures(subject, Cut.TORQUE)
    assert figures.gain_down == pytest.approx(0.222, rel=0.1)
    assert figures.phase.margin_deg == pytest.approx(27.5, abs=3.0)


def test_a_weak_motor_is_a_loop_of_less_torque_gain():
    """Te itself is another number then; poles do not depend on what a state is called."""
    weak = with_values(default_machine(), {"plant.motor.torque_constant_ratio": 0.9})
    poles = [
        np.sort_complex(
            np.linalg.eigvals(SampledLoop(mechanics(m, PlantKind.FULL), loop_settings(m)).cycle(gain)[0])
        )
        for m, gain in ((weak, 1.0), (default_machine(), 0.9), (default_machine(), 1.0))
    ]
    # Eigenvalues of a matrix with entries from 1e-5 to 1e4: eight digits.
    assert poles[0] == pytest.approx(poles[1], abs=1e-8)
    assert np.max(np.abs(poles[0] - poles[2])) > 1e-4


def test_delay_and_latency_cost_phase():
    quick = dataclasses.replace(SETTINGS, delay_cycles=0, latency_s=0.0)
    w = np.array([200.0])
    slow_phase = np.angle(loop().open_loop(Cut.SPEED_ERROR, w))
    quick_phase = np.angle(loop(settings=quick).open_loop(Cut.SPEED_ERROR, w))
    assert (quick_phase - slow_phase)[0] == pytest.approx(200.0 * (125e-6 + 62.5e-6), rel=1e-3)


def test_friction_that_holds_stiffens_and_damps():
    free, sliding, holding = (loop(friction=friction) for friction in Friction)
    load = [modes(subject)[0].held for subject in (free, sliding, holding)]
    assert load[0].hz < load[1].hz < load[2].hz
    assert load[2].zeta > 2.0 * load[0].zeta
    # rollers and motor slide, the hysteresis still holds: h/z_h, h = 2 kN m + 0.1 x 6 kN m, z_h = 10 urad
    extra = sliding.plant.stiffness[1, 1] - free.plant.stiffness[1, 1]
    assert extra == pytest.approx(2e8 + 0.6e8, rel=1e-6)


def test_switches_take_effects_away():
    still = with_values(
        MACHINE,
        {
            "plant.switches.base": False,
            "plant.switches.roller_friction": False,
            "plant.switches.motor_friction": False,
            "plant.switches.hysteresis": False,
            "plant.switches.eccentric_moment": False,
        },
    )
    held = mechanics(still, PlantKind.FULL, Friction.HOLDING)
    np.testing.assert_array_equal(held.stiffness, mechanics(still, PlantKind.TWO_MASS).stiffness)
    assert held.coordinates == ("motor", "load")


def test_position_follows_at_rest_and_falls_off():
    following = loop().following(np.array([1e-3, 2000.0]))
    assert abs(following["motor"][0]) == pytest.approx(1.0, abs=1e-6)
    assert abs(following["load"][0]) == pytest.approx(1.0, abs=1e-4)
    assert abs(following["load"][1]) < 1e-3


def test_injection_at_the_command_shows_the_open_loop():
    """-law / total is L at the cut: what a measurement on the running axis uses."""
    reply = loop().injected(Input.SPEED, OMEGA)
    np.testing.assert_allclose(
        -reply["vel_law_rad_s"] / reply["vel_cmd_rad_s"],
        loop().open_loop(Cut.SPEED_COMMAND, OMEGA),
        rtol=1e-8,
    )


def test_torque_that_is_added_meets_the_whole_loop():
    """y = P z^-1 T_ff / (1 + L): the exact scan against the responses of the drive cycle."""
    slow = np.geomspace(1.0, 300.0, 40)
    subject = loop()
    z = np.exp(1j * slow * SETTINGS.cycle_s)
    hold = sum(z**-k for k in range(8)) / 8.0
    expected = subject.angle_per_torque(slow) / z * hold / (1.0 + subject.open_loop(Cut.TORQUE, slow))
    np.testing.assert_allclose(subject.injected(Input.TORQUE, slow)["pos_act_rad"], expected, rtol=5e-3)


def test_nothing_swings_in_a_rigid_loop_on_paper():
    assert modes(loop(PlantKind.RIGID)) == []
    assert least_damped(np.array([-1.0 + 0j])) == Oscillation(0.0, 1.0)


def test_an_unstable_loop_has_no_gain_limits():
    wild = loop(settings=dataclasses.replace(SETTINGS, kpp_per_s=900.0))
    assert not wild.stable()
    figures = cut_figures(wild, Cut.SPEED_COMMAND)
    assert (figures.gain_down, figures.gain_up) == (None, None)
    assert math.isfinite(figures.sensitivity.value)


def test_a_loop_that_is_slower_than_a_mode_has_no_swing_near_it():
    """A rotary table whose load swings at 30 Hz behind a held motor, in a loop of 7 Hz: no pole lies from 15 to 60 Hz.

    What it follows with overshoot is its own loop, which moves the motor as far as the load.
    """
    found = study(load_machine(configs_folder() / "rotary_table.toml"), PlantKind.FULL)
    load, base = found.modes
    assert load.held.hz == pytest.approx(29.9, abs=0.1)
    swings_hz = np.abs(found.loop.poles[found.loop.poles.imag > 0.0]) / (2.0 * np.pi)
    assert not np.any((swings_hz > 15.0) & (swings_hz < 60.0))
    assert (load.followed, base.followed) == (False, True)
    words = " ".join(sentences(found))
    assert "load mode has 29.93 Hz and 1.91 % damping while the motor is held, and no swing near it" in words
    assert modes_table(found).rows[0][3:] == ("-", "-", "-")
    assert found.closed_loop(FOLLOWING).peak.value == pytest.approx(1.9, abs=0.05)
    assert "moves the load 2 times as far, and the motor 1.9 times" in words
