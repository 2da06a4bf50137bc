"""Scan by scan in Python, the compiled loop and the batch give the same bits for any machine and plan."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gantryctl import _core
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.wiring.program import position_law
from gantryctl.wiring.simulator import gantry_sim
from parity.machines import compiled, leg_figures, machines, plans, scan_by_scan, standing

SCANS = 60


@settings(max_examples=150)
@given(machine=machines(), plan=plans())
def test_scan_by_scan_equals_the_compiled_loop(machine: Machine, plan: _core.Segments) -> None:
    first, second = standing(machine, plan.sample(0.0)[0]), standing(machine, plan.sample(0.0)[0])
    by_scan, by_loop = scan_by_scan(first, plan, SCANS), compiled(second, plan, SCANS)
    assert np.array_equal(by_scan, by_loop)
    assert first.sim.state == second.sim.state
    assert np.isfinite(by_loop).all()


@settings(max_examples=60)
@given(machine=machines(), plan=plans(), average=st.integers(1, SCANS))
def test_legs_are_the_figures_of_the_compiled_loop(
    machine: Machine, plan: _core.Segments, average: int
) -> None:
    logged, summed = standing(machine, plan.sample(0.0)[0]), standing(machine, plan.sample(0.0)[0])
    result = _core.run_legs(
        [summed.sim], [summed.law], [[(plan, SCANS, average, 1, True, 0, [])]], [summed.zero_counts], 1
    )
    figures = leg_figures(compiled(logged, plan, SCANS), logged.law, average)
    assert dict(zip(_core.LEG_COLUMNS, result[0, 0].tolist(), strict=True)) == figures
    assert logged.sim.state == summed.sim.state


@settings(max_examples=15)
@given(plants=st.lists(machines(), min_size=2, max_size=5), legs=st.lists(plans(), min_size=1, max_size=3))
def test_the_number_of_threads_changes_nothing(plants: list[Machine], legs: list[_core.Segments]) -> None:
    period = plants[0].control.scan_period_ms
    plants = [with_values(m, {"control.scan_period_ms": period, "control.kpp_per_s": 5.0}) for m in plants]
    law = position_law(plants[0])

    def run(threads: int) -> np.ndarray:
        runs = [standing(m, legs[0].sample(0.0)[0]) for m in plants]
        native = [(plan, SCANS, 10, 1, True, 0, []) for plan in legs]
        return _core.run_legs([r.sim for r in runs], [law], [native], [r.zero_counts for r in runs], threads)

    one = run(1)
    assert one.shape == (len(plants), len(legs), len(_core.LEG_COLUMNS))
    for threads in (2, 3, 7, 64):
        assert np.array_equal(one, run(threads))


@settings(max_examples=60)
@given(machine=machines(), plan=plans(), at=st.integers(0, SCANS))
def test_a_state_through_json_goes_on_with_the_same_bits(
    machine: Machine, plan: _core.Segments, at: int
) -> None:
    whole = standing(machine, plan.sample(0.0)[0])
    expected = scan_by_scan(whole, plan, SCANS)
    first = standing(machine, plan.sample(0.0)[0])
    scan_by_scan(first, plan, at)
    restored = standing(machine, 0.0)
    restored.zero_counts = first.zero_counts
    restored.sim.state = json.loads(json.dumps(first.sim.state))
    rest = scan_by_scan(restored, plan, SCANS - at, first=at)
    assert np.array_equal(expected[:, at:], rest)
    assert restored.sim.state == whole.sim.state


# Off, speed and quick stop, with the brake opened and closed: what the compiled loop never does.
_STEPS = st.lists(
    st.tuples(st.sampled_from([0, 1, 2]), st.floats(-60.0, 60.0), st.floats(-30.0, 30.0), st.booleans()),
    min_size=4,
    max_size=12,
)


@settings(max_examples=60)
@given(machine=machines(), steps=_STEPS, at=st.integers(0, 11), servo_on=st.booleans())
def test_a_state_saved_while_the_brake_moves_goes_on_with_the_same_bits(
    machine: Machine, steps: list[tuple[int, float, float, bool]], at: int, servo_on: bool
) -> None:
    machine = with_values(machine, {"brake.close_time_ms": 100.0, "brake.open_time_ms": 60.0})
    first, second = gantry_sim(machine), gantry_sim(machine)
    first.static_start(0.3, servo_on)
    for index, step in enumerate(steps):
        if index == min(at, len(steps) - 1):
            second.state = json.loads(json.dumps(first.state))
        for _ in range(20):
            first.scan(*step)
            if index >= min(at, len(steps) - 1):
                second.scan(*step)
                assert first.feedback(1.5e-6) == second.feedback(1.5e-6)
                assert first.truth() == second.truth()
    assert first.state == second.state


def test_a_state_restored_shows_what_the_saved_one_showed() -> None:
    machine = default_machine()
    first, second = gantry_sim(machine), gantry_sim(machine)
    first.static_start(0.3, True)
    first.scan(1, 100.0, 0.0, True)
    second.state = first.state
    assert first.feedback(1.0)[4]
    assert first.feedback(1.0) == second.feedback(1.0)
    assert first.truth() == second.truth()


@pytest.mark.parametrize("spoilt", ["pos_motor", "drive_integral", "brake_countdown", "count_offset"])
def test_a_state_that_lacks_something_or_is_not_finite_is_refused_whole(spoilt: str) -> None:
    sim = gantry_sim(default_machine())
    sim.static_start(0.3, True)
    before = sim.state
    other = {name: value + 1.0 for name, value in before.items()}
    with pytest.raises(ValueError, match=spoilt):
        sim.state = {name: value for name, value in other.items() if name != spoilt}
    with pytest.raises(ValueError, match=spoilt):
        sim.state = other | {spoilt: math.nan}
    assert sim.state == before


def test_a_copy_is_independent_and_equal() -> None:
    run = standing(default_machine(), 0.3)
    copy = run.sim.copy()
    for sim in (run.sim, copy):
        sim.scan(1, 0.5, 0.0, True)
    assert run.sim.state == copy.state
    copy.scan(1, 0.5, 0.0, True)
    assert run.sim.state != copy.state


@pytest.mark.parametrize(
    ("cycle_us", "scan_ms"), [(125.0, 1.0), (125.0, 4.0), (25.0, 1.0), (62.5, 1.5), (100.0, 0.7)]
)
def test_the_loop_counts_time_in_periods_of_the_machine_file(cycle_us: float, scan_ms: float) -> None:
    """period = cycles x cycle time would differ by a rounding error, and with it every time stamp."""
    changes = {"drive.speed_loop.cycle_us": cycle_us, "control.scan_period_ms": scan_ms}
    machine = with_values(default_machine(), changes)
    assert gantry_sim(machine).scan_period_s == scan_ms * 1e-3


def test_one_plant_twice_in_a_batch_is_refused() -> None:
    run = standing(default_machine(), 0.0)
    plan = _core.Segments([], [], [], [], [], 0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="twice"):
        _core.run_legs([run.sim, run.sim], [run.law], [[(plan, 5, 1, 1, True, 0, [])]], [0.0, 0.0], 2)


def test_a_run_in_pieces_is_the_run_in_one_piece() -> None:
    """Nothing hides between two calls of the compiled loop: the plant carries everything."""
    start = 0.2
    hold = _core.Segments([], [], [], [], [], 0.0, start, 0.0)
    whole, pieces = standing(default_machine(), start), standing(default_machine(), start)
    expected = compiled(whole, hold, 500)
    parts = [compiled(pieces, hold, n) for n in (1, 7, 200, 292)]
    assert np.array_equal(expected, np.concatenate(parts, axis=1))
