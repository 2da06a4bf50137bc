"""Summary of a motion, figure by figure, from a recording written by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl.machine import default_machine
from gantryctl.operation.summary import MotionSummary, summarise
from gantryctl.trace.table import Trace

AXIS = default_machine().axis
COLUMNS = (
    "time_s", "pos_ref_rad", "vel_ref_rad_s", "pos_act_rad", "vel_act_rad_s", "pos_err_rad", "torque_act_nm",
    "pos_load_rad", "vel_load_rad_s", "vel_motor_rad_s",
)  # fmt: skip
# In degrees at the gantry, but for the torque: set-point, its speed, angle, speed as read, error, torque, load, its
# speed, speed of the motor at the gantry.
ROWS = (
    (0.0, 10.0, 0.0, 10.0, 9.0, 0.0, -3.0, 370.0, 0.0, 0.0),
    (0.1, 10.5, 4.0, 10.49, 9.0, 0.01, -20.0, 370.52, 3.7, 3.9),
    (0.6, 12.0, -5.0, 12.0, 9.0, -0.004, 8.0, 372.0, -5.0, -5.2),
    (0.7, 12.0, 0.0, 11.98, 9.0, 0.0, 8.0, 372.0, 0.0, 0.0),
)


def recording(*rows: tuple[float, ...]) -> Trace:
    table = np.array(rows or ROWS)
    table[:, [1, 2, 3, 4, 5, 7, 8]] = np.radians(table[:, [1, 2, 3, 4, 5, 7, 8]])
    table[:, 9] = np.radians(table[:, 9]) * 1144.0
    return Trace.from_rows(COLUMNS, table, {})


def summary(trace: Trace) -> MotionSummary:
    found = summarise(trace, 0.0, 1.0, AXIS)
    assert found is not None
    return found


def test_each_figure_is_the_largest_of_its_column_whatever_its_sign() -> None:
    """The load is a whole turn further, as of a modulo axis; the motor's own speed counts, not the drive's reading."""
    found = summary(recording())
    assert (found.start_deg, found.end_deg) == (pytest.approx(10.0), pytest.approx(11.98))
    assert found.duration_s == pytest.approx(0.5)  # of the set-point's motion alone
    on_the_way = (0.3, *ROWS[1][1:])
    assert summary(recording(*ROWS[:2], on_the_way, *ROWS[2:])).duration_s == pytest.approx(0.5)
    assert (found.peak_deg_s, found.torque_max_nm) == (pytest.approx(5.0), 20.0)
    assert found.following_error_motor_deg == pytest.approx(0.01)
    assert found.following_error_load_deg == pytest.approx(0.02)
    assert found.speed_error_motor_deg_s == pytest.approx(0.2)
    assert found.speed_error_load_deg_s == pytest.approx(0.3)


def test_rows_of_a_program_that_failed_are_left_out() -> None:
    failed = (0.8, math.nan, 0.0, 30.0, 0.0, 5.0, 300.0, 0.0, 0.0, 0.0)
    assert summary(recording(*ROWS, failed)) == summary(recording())
    assert summarise(recording(failed), 0.0, 1.0, AXIS) is None
    assert summarise(recording(), 2.0, 3.0, AXIS) is None


def test_a_set_point_that_never_moved_lasted_no_time() -> None:
    assert summary(recording(ROWS[0], ROWS[3])).duration_s == 0.0
