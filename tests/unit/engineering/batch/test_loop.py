"""Logs and leg statistics of the compiled closed loop."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl import _core
from gantryctl.engineering.batch import ClosedLoop, Leg, log_legs, run_legs
from gantryctl.engineering.batch.loop import scans
from gantryctl.machine import default_machine
from gantryctl.motion import SetPoint, hold, plan_move
from gantryctl.units import rad
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import gantry_sim

MACHINE = default_machine()


def standing(angle_deg: float = 0.0) -> ClosedLoop:
    return ClosedLoop.standing_at(gantry_sim(MACHINE), position_law(MACHINE), rad(angle_deg))


def test_a_standing_axis_stands() -> None:
    log = standing(30.0).rest(rad(30.0), 1.0)
    assert len(log) == 1000
    assert np.degrees(log["pos_load_rad"]) == pytest.approx(30.0, abs=1e-3)
    assert np.abs(log["pos_err_rad"]).max() < rad(1e-3)


def test_a_log_has_every_column_and_its_time() -> None:
    log = standing().rest(0.0, 0.01)
    assert log.columns == tuple(_core.LOG_COLUMNS)
    assert np.array_equal(log.time_s, np.arange(10) * 1e-3)
    assert all(len(log[column]) == 10 for column in log.columns)
    with pytest.raises(ValueError, match="not in"):
        _ = log["no_such_column"]


def test_a_move_ends_where_its_plan_ends() -> None:
    plan = plan_move(SetPoint(0.0, 0.0, 0.0), rad(2.0), motion_limits(MACHINE))
    log = standing().run(plan, plan.duration + 2.0)
    assert np.degrees(log["pos_act_rad"][-1]) == pytest.approx(2.0, abs=1e-3)
    assert np.degrees(log["vel_ref_rad_s"]).max() == pytest.approx(math.sqrt(0.39336 * 2.0), rel=1e-3)


def test_commands_without_the_position_loop() -> None:
    loop = standing(45.0)
    log = loop.command(0, 2.0, brake_open=False)  # torque off, brake closes
    assert np.degrees(log["pos_motor_rad"][-1] - log["pos_motor_rad"][0]) / 1144.0 == pytest.approx(
        0, abs=0.02
    )
    assert log["torque_act_nm"][-1] == 0.0


def test_legs_are_figures_of_the_log() -> None:
    plan = plan_move(SetPoint(0.0, 0.0, 0.0), rad(1.0), motion_limits(MACHINE))
    legs = [Leg(plan, plan.duration, 0.1), Leg(hold(rad(1.0)), 1.0, 0.5)]
    first, second = run_legs([standing()], legs)
    loop = standing()
    log = loop.run(plan, plan.duration)
    assert first.max_pos_err_motor_rad[0] == np.abs(log["pos_err_rad"]).max()
    assert first.max_torque_motor_nm[0] == np.abs(log["torque_act_nm"]).max()
    rest = loop.rest(rad(1.0), 1.0)
    assert second.mean_pos_load_rad[0] == pytest.approx(
        float(np.mean(rest["pos_load_rad"][-500:])), abs=1e-15
    )


@pytest.mark.parametrize(("mode", "brake_open"), [(2, True), (0, False)])
def test_a_leg_may_be_a_stop_whose_angle_is_that_of_the_log(mode: int, brake_open: bool) -> None:
    plan = plan_move(SetPoint(0.0, 0.0, 0.0), rad(5.0), motion_limits(MACHINE))
    legs = [Leg(plan, 2.0, 0.1), Leg(hold(0.0), 1.5, 0.1, mode, brake_open)]
    stop = run_legs([standing(), standing()], legs)[1]
    loop = standing()
    loop.run(plan, 2.0)
    log = loop.command(mode, 1.5, brake_open=brake_open)
    way = np.abs(log["pos_load_rad"] - log["pos_load_rad"][0]).max()
    assert rad(0.1) < way < rad(5.0)
    assert stop.max_travel_load_rad.tolist() == [way, way]
    way_motor = np.abs((log["pos_motor_rad"] - log["pos_motor_rad"][0]) / loop.law.ratio).max()
    assert stop.max_travel_motor_rad.tolist() == [way_motor, way_motor]
    assert stop.max_torque_mesh_nm[0] == np.abs(log["torque_mesh_nm"]).max()
    assert stop.max_vel_err_load_rad_s[0] == np.abs(log["vel_load_rad_s"]).max()


def test_many_plants_have_one_figure_each_whatever_the_threads() -> None:
    legs = [Leg(hold(0.0), 0.2, 0.1)]
    one = run_legs([standing() for _ in range(3)], legs, threads=1)[0]
    two = run_legs([standing() for _ in range(3)], legs, threads=2)[0]
    assert one.mean_pos_load_rad.shape == (3,)
    assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))


def test_a_run_of_no_plant_is_refused() -> None:
    """The compiled functions looked at the legs of the first plant: the interpreter ended."""
    with pytest.raises(ValueError, match="no plant is given"):
        run_legs([], [Leg(hold(0.0), 0.1)])
    with pytest.raises(ValueError, match="no plant is given"):
        log_legs([], [Leg(hold(0.0), 0.1)], ["pos_load_rad"])
    law, leg = position_law(MACHINE), (hold(0.0), 1, 1, 1, True, 0, [])
    with pytest.raises(ValueError, match="a plant of the list is None"):
        _core.run_legs([None], [law], [[leg]], [0.0])  # type: ignore[list-item]


@pytest.mark.parametrize(
    ("duration_s", "period_s", "count"),
    [(1.0, 1e-3, 1000), (0.3, 0.1, 3), (0.0, 1e-3, 1), (1.0004, 1e-3, 1001), (6.0, 4e-3, 1500)],
)
def test_a_rounding_error_makes_no_scan(duration_s: float, period_s: float, count: int) -> None:
    assert scans(duration_s, period_s) == count
