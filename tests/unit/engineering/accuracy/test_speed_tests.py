"""Speed tests: their figures from a few rows by hand, how long they take, and several machines side by side."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from gantryctl.engineering.accuracy.report.report import LoadSpeedBy
from gantryctl.engineering.accuracy.speed_test import (
    _by_ring,
    _evaluate,
    _moves,
    _of_log,
    _Speeds,
    run_speed,
    speed_test_on,
    speed_test_s,
    speed_tests,
)
from gantryctl.engineering.accuracy.table import Direction
from gantryctl.errors import UsageError
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.runtime.recorder import MemoryRecorder
from support.improved import improved_machine


def test_machines_side_by_side_have_the_runs_of_each_alone() -> None:
    """One with compensations, one that moves faster than the others may, one whose ramps are shorter."""
    quick = with_values(default_machine(), {"virtual_axis.acc_deg_s2": 1.0, "virtual_axis.dec_deg_s2": 1.0})
    slow = with_values(default_machine(), {"speed.setting_max_deg_s": 4.0})
    machines = [default_machine(), slow, improved_machine(), quick]
    found = speed_tests(machines, (3.0, 6.0))
    assert isinstance(found[1], UsageError)
    for machine, runs in zip(machines, found, strict=True):
        if isinstance(runs, Exception):
            continue
        assert [run.speed_deg_s for run in runs] == [3.0, 3.0, 6.0, 6.0]
        for run in runs:
            alone = run_speed(machine, *run.travel_deg, run.speed_deg_s)
            assert run.load_error_deg_s == alone.load_error_deg_s
            assert run.motor_error_deg_s == alone.motor_error_deg_s
            assert run.curves.load_deg_s is not None
            assert alone.curves.load_deg_s is not None
            assert np.array_equal(run.curves.load_deg_s, alone.curves.load_deg_s)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_move_begins_and_ends_at_rest_where_it_was_asked_for(sign: float) -> None:
    """10 deg at 3 deg/s with ramps of 2 deg/s2: 1.5 + 10 / 3 s, behind one second of rest and before six."""
    machine = with_values(default_machine(), {"virtual_axis.acc_deg_s2": 2.0, "virtual_axis.dec_deg_s2": 2.0})
    found = run_speed(machine, -sign * 5.0, sign * 5.0, 3.0)
    # Rows of 5 ms.
    assert found.curves.time_s[-1] == pytest.approx(11.83, abs=0.006)
    assert found.travel_deg == (-sign * 5.0, sign * 5.0)
    assert found.reached_deg_s == pytest.approx(3.0, abs=0.005)
    assert found.motor_error_deg_s < 0.05
    assert found.load_error_deg_s is not None
    assert found.load_error_deg_s < 0.5
    # The brake is no part of it: the loop holds the motor still to some 1e-5 deg/s.
    for rest in (slice(0, 199), slice(-199, None)):
        assert np.max(np.abs(found.curves.motor_deg_s[rest])) < 1e-3
    way_deg = float(np.sum(found.curves.ref_deg_s)) * 0.005
    assert way_deg == pytest.approx(sign * 10.0, abs=0.02)


def speeds(sign: float, ref: list[float], motor_less: list[float], load_less: list[float] | None) -> _Speeds:
    """One way or the other, a row every half second; what motor and load lack of the set-point."""
    set_point = np.array(ref)
    load = None if load_less is None else sign * (set_point - load_less)
    return _Speeds(0.5, sign * set_point, sign * (set_point - motor_less), load)


def test_a_log_of_the_simulation_has_the_motor_before_the_reducer() -> None:
    """1144 deg/s of the motor are one of the gantry; the load turns at half of it, and twice that was wanted."""
    rows = {"vel_ref_rad_s": 2.0, "vel_motor_rad_s": 1144.0, "vel_load_rad_s": 0.5}

    class Log(dict[str, np.ndarray]):
        period_s = 0.004

    log = Log({name: np.radians([value]) for name, value in rows.items()})
    found = _of_log(default_machine(), log)  # type: ignore[arg-type]
    assert found.load_deg_s is not None
    assert (found.period_s, *found.ref_deg_s, *found.motor_deg_s, *found.load_deg_s) == pytest.approx(
        (0.004, 2.0, 1.0, 0.5)
    )


REF = [0.0, 1.0, 2.0, 2.0, 2.0, 1.0, 0.0]


@pytest.mark.parametrize("sign", [1, -1])
def test_a_run_is_judged_by_its_rows(sign: int) -> None:
    """Mean of the motor in the cruise: 2 - (0.03 - 0.01 + 0.01) / 3. Largest errors, wherever they are."""
    motor_less, load_less = [0.0, -0.05, 0.03, -0.01, 0.01, 0.02, 0.0], [0.0, 0.1, 0.0, 0.3, 0.0, -0.4, 0.0]
    found = _evaluate(
        default_machine(), speeds(sign, REF, motor_less, load_less), (-sign * 2.0, sign * 2.0), 2.0
    )
    assert found.direction is (Direction.CCW if sign > 0 else Direction.CW)
    assert found.reached_deg_s == pytest.approx(1.99)
    assert (found.motor_error_deg_s, found.load_error_deg_s) == pytest.approx((0.05, 0.4))
    assert not found.stick_slip
    assert found.curves.time_s.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0]


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("lacks", "sticks"), [(1.89, False), (1.91, True), (2.5, True)])
@pytest.mark.parametrize("measured", [True, False])
def test_a_load_below_a_twentieth_of_the_speed_has_stuck(
    sign: int, lacks: float, sticks: bool, measured: bool
) -> None:
    """0.1 deg/s of 2, or backwards; without a second encoder the motor is all that can be seen."""
    less = [0.0, 0.0, 0.0, lacks, 0.0, 0.0, 0.0]
    sound = [0.0] * len(REF)
    rows = speeds(sign, REF, sound, less) if measured else speeds(sign, REF, less, None)
    found = _evaluate(default_machine(), rows, (-sign * 2.0, sign * 2.0), 2.0)
    assert found.stick_slip is sticks
    assert (found.load_error_deg_s is None) is not measured


def test_a_load_at_just_a_twentieth_of_the_speed_has_not_stuck() -> None:
    for slowest, sticks in ((0.1, False), (math.nextafter(0.1, 0.0), True)):
        load = np.array([0.0, 2.0, slowest, 2.0, 0.0])
        ref = np.array([0.0, 2.0, 2.0, 2.0, 0.0])
        assert (
            _evaluate(default_machine(), _Speeds(0.5, ref, ref, load), (-2.0, 2.0), 2.0).stick_slip is sticks
        )


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_without_a_cruise_the_top_of_the_profile_counts(sign: float) -> None:
    seen = speeds(sign, REF, [0.0] * 7, None)
    found = _evaluate(default_machine(), seen, (-sign * 2.0, sign * 2.0), 3.0)
    assert found.reached_deg_s == pytest.approx(2.0)


def test_the_speed_of_the_ring_is_its_way_over_40_ms() -> None:
    """Half a t^2: the speed is t. Rows of 4 ms, five to either side; at the ends what there is of them."""
    machine = with_values(
        default_machine(),
        {"drive.kind": "canopen", "control.scan_period_ms": 4.0, "can.load_encoder.source": "60E4"},
    )
    t = 0.004 * np.arange(101)
    trace = {"pos_ring_rad": np.radians(0.5 * t**2)}
    speed = _by_ring(machine, trace, 0.004)  # type: ignore[arg-type]
    assert speed is not None
    assert speed[5:-5] == pytest.approx(t[5:-5])
    assert speed[[0, -1]] == pytest.approx([0.01, 0.39])
    # A scan that is longer than that has its neighbours: half of 0.1^2 in the first 0.1 s.
    slow = {"pos_ring_rad": np.radians(0.5 * (0.1 * np.arange(9)) ** 2)}
    seldom = _by_ring(machine, slow, 0.1)  # type: ignore[arg-type]
    assert seldom is not None
    assert seldom[:2] == pytest.approx([0.05, 0.1])
    trace["pos_ring_rad"][50] = math.nan
    assert _by_ring(machine, trace, 0.004) is None  # type: ignore[arg-type]
    assert _by_ring(default_machine(), {}, 0.004) is None  # type: ignore[arg-type]


class Run:
    """Stands for `AxisRun`: what it was asked for, and rows of a motor that lacks 0.03 deg/s of 2 deg/s one way, and
    0.01 the other.
    """

    def __init__(self, machine: Machine) -> None:
        self.machine, self.asked = machine, list[tuple[object, ...]]()
        self.recorder = MemoryRecorder(["time_s", "vel_ref_rad_s", "vel_act_rad_s"])
        self.engine = SimpleNamespace(recorder=self.recorder, period_s=0.5)

    def move(self, to_deg: float, speed_deg_s: float | None = None) -> None:
        self.asked.append(("move", to_deg, speed_deg_s))
        lacks = 0.03 if to_deg > 0.0 else 0.01
        for ref in REF:
            # Without a speed of the test: on the way there, faster, and no part of it.
            row = (ref, ref - lacks * (ref == 2.0)) if speed_deg_s else (6.0, 3.0)
            self.recorder.record((0.0, *(math.radians(value) for value in row)))

    def follow(self, seconds: float) -> None:
        self.asked.append(("follow", seconds))


def test_on_a_machine_each_way_is_measured_alone() -> None:
    """2 deg/s up and down, from standing still to standing still; what comes before is no part of it."""
    machine = with_values(default_machine(), {"virtual_axis.acc_deg_s2": 0.5, "virtual_axis.dec_deg_s2": 0.5})
    run = Run(machine)
    up, down = speed_test_on(run, (2.0,))  # type: ignore[arg-type]
    # 8 deg of ramps, 30 of cruise.
    low, high = up.travel_deg
    assert (low, high, down.travel_deg) == (-19.0, 19.0, (high, low))
    assert run.asked == [
        ("move", low, None), ("follow", 6.0),
        ("follow", 1.0), ("move", high, 2.0), ("follow", 6.0),
        ("follow", 1.0), ("move", low, 2.0), ("follow", 6.0),
    ]  # fmt: skip
    for each, way, lacks in ((up, Direction.CCW, 0.03), (down, Direction.CW, 0.01)):
        assert (each.direction, each.speed_deg_s, each.load_by) == (way, 2.0, LoadSpeedBy.NOTHING)
        assert (each.reached_deg_s, each.motor_error_deg_s) == pytest.approx((2.0 - lacks, lacks))
        assert each.load_error_deg_s is None


def test_the_test_takes_both_ways_and_the_way_there() -> None:
    """5 deg/s with 0.5 deg/s2: 50 deg of ramps and 75 of cruise, 125 / 5 + 10 s, 7 s of rest; there with 6 deg/s."""
    machine = with_values(default_machine(), {"virtual_axis.acc_deg_s2": 0.5, "virtual_axis.dec_deg_s2": 0.5})
    assert speed_test_s(machine, (5.0,)) == pytest.approx(2.0 * 42.0 + 125.0 / 6.0 + 6.0)
    # 1 deg/s: 2 of ramps and 15 of cruise, 17 + 2 s.
    both = speed_test_s(machine, (5.0, 1.0)) - speed_test_s(machine, (5.0,))
    assert both == pytest.approx(2.0 * 26.0 + 17.0 / 6.0 + 6.0)
    assert [move[1:] for move in _moves(machine, (5.0,))] == [(-62.5, 62.5, 5.0), (62.5, -62.5, 5.0)]


def test_a_motor_that_is_moved_off_its_set_point_for_the_load_is_not_judged_by_it() -> None:
    seen = speeds(1.0, [0.0, 1.0, 1.0, 0.0], [0.0] * 4, None)
    plain, improved = (
        _evaluate(machine, seen, (0.0, 1.0), 1.0) for machine in (default_machine(), improved_machine())
    )
    assert plain.motor_judged
    assert not improved.motor_judged
