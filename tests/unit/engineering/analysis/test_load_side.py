"""The whole loop: against the law of the core, against python-control, and against a knock in time."""

import math
from pathlib import Path

import control
import numpy as np
import pytest

from gantryctl import _core
from gantryctl.engineering.analysis.models.load_side import (
    DiskMargin,
    LoadSideFigures,
    WholeLoop,
    disk_margin,
    disk_margin_of_both,
    load_side_figures,
    load_side_law,
)
from gantryctl.engineering.analysis.models.mechanics import LOAD, PlantKind, mechanics
from gantryctl.engineering.analysis.models.modes import Oscillation
from gantryctl.engineering.analysis.models.sampled import Cut, SampledLoop, loop_settings
from gantryctl.engineering.analysis.study import grid_of, study
from gantryctl.engineering.analysis.text import sentences, study_tables
from gantryctl.engineering.batch import ClosedLoop
from gantryctl.machine import configs_folder, default_machine, load_machine, with_values
from gantryctl.motion import hold
from gantryctl.wiring.compensation import compensation
from gantryctl.wiring.program import position_law
from gantryctl.wiring.simulator import gantry_sim

IMPROVED = load_machine(configs_folder() / "hust_improved.toml")
LAW = load_side_law(IMPROVED)
assert LAW is not None
LOOP = SampledLoop(mechanics(IMPROVED, PlantKind.FULL), loop_settings(IMPROVED))
WHOLE = WholeLoop(LOOP, LAW)
W = grid_of(LOOP, Cut.SPEED_COMMAND)
LINEAR = {
    f"plant.switches.{name}": False
    for name in (
        "gear_error", "backlash", "hysteresis", "roller_friction", "motor_friction", "eccentric_moment",
        "torque_ripple", "three_slopes",
    )
}  # fmt: skip
RNG = np.random.default_rng(5)


def test_with_the_laws_off_it_is_the_loop_on_the_motor() -> None:
    off = WholeLoop(LOOP, LAW._replace(integral_per_s=0.0, damping_gain=0.0))
    # the same products in another order: rounding
    assert off.at_command(W) == pytest.approx(LOOP.open_loop(Cut.SPEED_COMMAND, W), rel=1e-9)
    assert off.at_torque(W) == pytest.approx(LOOP.open_loop(Cut.TORQUE, W), rel=1e-9)
    for pole in LOOP.poles:
        assert np.min(np.abs(off.poles - pole)) < 1e-6 * max(1.0, abs(pole))


def test_the_controller_is_the_law_that_runs() -> None:
    """The core's law on small readings about a set-point at rest, maps and limits out of the way."""
    s, ratio = LOOP.settings, LOOP.plant.ratio
    switches = dict.fromkeys(
        ("torque_eccentric", "torque_acceleration", "gear_map", "windup", "reversal", "scale_map"), False
    ) | {"load_encoder": True, "damping": True, "moment_observer": False}
    numbers = {
        "period_s": s.scan_s,
        "encoder_gain_per_s": LAW.integral_per_s,
        "encoder_limit_rad": 1.0,
        "damping_gain": LAW.damping_gain,
        "swing_rad_s": LAW.swing_rad_s,
        "damping_filter": LAW.filter_share,
        "damping_slow": LAW.slow_share,
    }
    laws, law = _core.Compensation(switches, numbers), _core.PositionLaw(s.kpp_per_s, s.kvf, ratio, 1.0, 1e9)
    laws.scan(law, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    a, b, c, d = WHOLE.controller
    state = np.zeros(4)
    for _ in range(200):
        motor, ring = RNG.normal(0.0, 1e-4, 2)
        counts = motor * ratio / law.rad_per_count
        told = laws.scan(law, 0.0, 0.0, 0.0, counts, ring, 0.0)[0]
        reading = np.array([motor, ring])
        assert told == pytest.approx(float(c @ state + d @ reading), rel=1e-9, abs=1e-12)
        state = a @ state + b @ reading


def test_disk_margins_at_one_cut_are_those_of_python_control() -> None:
    m, command, _ = LOOP.scan()
    a, b, c, d = WHOLE.controller
    dt = LOOP.settings.scan_s
    plant = control.ss(m, command[:, None], WHOLE.readings, np.zeros((2, 1)), dt)
    loop = control.ss(a, b, -c[None, :], -d[None, :], dt) * plant
    found = disk_margin(WHOLE.at_command(W), W)
    alpha, gain_db, phase_deg = (float(np.squeeze(each)) for each in control.disk_margins(loop, W))
    assert found.alpha == pytest.approx(alpha, rel=1e-6)
    assert 20.0 * math.log10(found.gain_up) == pytest.approx(gain_db, rel=1e-6)
    assert found.phase_deg == pytest.approx(phase_deg, rel=1e-6)


def test_two_cuts_at_once_by_the_other_bound() -> None:
    """For two blocks mu is also the largest spectral radius of M U over diagonal unitary U (Doyle 1982): a search over
    one phase, from below, where the product searches a scaling from above.
    """
    loops = RNG.normal(size=(60, 2, 2)) + 1j * RNG.normal(size=(60, 2, 2))
    phases = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 721))
    for loop in loops:
        s = np.linalg.inv(np.eye(2) + loop)
        m = 0.5 * (s - loop @ s)
        turned = m[None] * np.stack([np.ones_like(phases), phases], axis=-1)[:, None, :]
        radius = np.max(np.abs(np.linalg.eigvals(turned)))
        # steps of half a degree: 1e-5 of the radius
        alpha = disk_margin_of_both(loop[None], np.array([1.0])).alpha
        assert alpha == pytest.approx(min(2.0, 1.0 / radius), rel=1e-4)


def test_gains_of_both_encoders_may_be_anywhere_inside_the_margin() -> None:
    """And the margin is no wild guess: some gains a little beyond twice of it do make the loop swing up."""
    margin = load_side_figures(WHOLE, grid_of(LOOP, Cut.TORQUE)).encoders
    for motor in np.linspace(margin.gain_down, margin.gain_up, 7):
        for ring in np.linspace(margin.gain_down, margin.gain_up, 7):
            assert np.max(np.abs(np.linalg.eigvals(WHOLE.closed(1.0, (motor, ring))))) < 1.0, (motor, ring)
    wide = DiskMargin(min(1.9, 3.0 * margin.alpha), 0.0)
    gains = np.geomspace(wide.gain_down, wide.gain_up, 15)
    grown = [np.max(np.abs(np.linalg.eigvals(WHOLE.closed(1.0, (m, r))))) for m in gains for r in gains]
    assert max(grown) > 1.0


@pytest.mark.parametrize("least", ["command", "torque", "encoders"])
def test_the_margin_that_is_told_is_the_smallest_of_all_three(least: str) -> None:
    margins = {
        cut: DiskMargin(0.4 if cut == least else 0.9, 1.0) for cut in ("command", "torque", "encoders")
    }
    worst = Oscillation(2.0, 0.1)
    assert LoadSideFigures(stable=True, worst=worst, **margins).smallest.alpha == 0.4


def test_a_knock_dies_out_in_the_simulator_as_the_model_says() -> None:
    """Load speed after a knock of 1 mrad/s on the plant without friction, gap and gear error, scan by scan."""
    machine = with_values(IMPROVED, LINEAR)
    loop = ClosedLoop.standing_at(gantry_sim(machine), position_law(machine), 0.0, compensation(machine))
    loop.sim.state = loop.sim.state | {"vel_load": 1e-3}
    seen = loop.run(hold(0.0), 2.0)["vel_load_rad_s"]
    whole = WholeLoop(SampledLoop(mechanics(machine, PlantKind.FULL), loop_settings(machine)), LAW)
    closed, row = whole.closed(), np.zeros(len(whole.closed()))
    row[: whole.loop.plant.size] = whole.loop.plant.velocity(LOAD)
    state = np.zeros(len(closed))
    state[: whole.loop.plant.size] = 1e-3 * whole.loop.plant.velocity(LOAD)
    told = []
    for _ in range(len(seen)):
        told.append(float(row @ state))
        state = closed @ state
    # steps of both encoders and the integral's dead band of 0.0001 deg, which the model leaves out
    assert seen == pytest.approx(np.array(told), abs=0.02e-3)
    assert np.max(np.abs(seen)) == pytest.approx(1e-3, rel=0.01)
    # an opponent: without the law the same knock is far off
    off = WholeLoop(whole.loop, LAW._replace(damping_gain=0.0))
    assert max(abs(np.linalg.eigvals(off.closed()))) > max(abs(np.linalg.eigvals(closed)))


def test_it_is_told_where_the_laws_are_on_and_only_there(tmp_path: Path) -> None:
    told = study(IMPROVED, PlantKind.FULL)
    assert told.load_side is not None
    assert told.load_side.stable
    # the laws damp the swing that P and PI of the motor's loop leave with 0.9 %
    assert told.load_side.worst.zeta > 5.0 * told.modes[0].closed.zeta
    assert any("With them the loop is stable" in line for line in sentences(told))
    assert any(table.rows for table in study_tables(told) if "whole loop" in table.title)
    assert study(default_machine(), PlantKind.FULL).load_side is None
    # a machine that is not identified yet is analysed too
    file = tmp_path / "unknown.toml"
    file.write_text((configs_folder() / "hust_improved.toml").read_text())
    unknown = load_machine(file)
    assert load_side_law(unknown) is None
    assert any("no calibration yet" in line for line in sentences(study(unknown, PlantKind.FULL)))


def test_a_damping_of_the_wrong_sign_is_found_unstable() -> None:
    whole = WholeLoop(LOOP, LAW._replace(damping_gain=-LAW.damping_gain))
    assert not whole.stable
    assert load_side_figures(whole, W).worst.zeta < 0.0
