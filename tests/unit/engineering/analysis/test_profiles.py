"""Closed forms of trapezoids, and the planner against the reference figures of double-S moves."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.engineering.analysis.models.profiles import (
    shortest_trapezoid_reaching,
    trapezoid_peak_speed,
    trapezoid_time_s,
)
from gantryctl.motion import MotionLimits, SetPoint, plan_move
from gantryctl.units import rad

SECTION = json.loads((Path(__file__).parents[3] / "data" / "expected.json").read_text())["6_profiles"]


@pytest.mark.parametrize(
    ("name", "jerk"),
    [
        ("double_S_180deg_V6_a0.39336_j0.39336_s", 0.39336),
        ("double_S_180deg_V6_a0.39336_j0.7868_s", 0.7868),
    ],
)
def test_double_s_reference(name: str, jerk: float) -> None:
    """The figures use 450/1144 deg/s2 in full and the jerk as their names print it."""
    entry = SECTION[name]
    acc = rad(450.0 / 1144.0)
    plan = plan_move(SetPoint(0.0, 0.0, 0.0), rad(-180.0), MotionLimits(rad(6.0), acc, acc, rad(jerk)))
    assert plan.duration == pytest.approx(entry["value"], rel=entry["rtol"])


@given(st.floats(0.01, 500.0), st.floats(0.1, 10.0), st.floats(0.1, 10.0))
def test_a_trapezoid_covers_its_distance(distance: float, vel: float, acc: float) -> None:
    time, peak = trapezoid_time_s(-distance, vel, acc), trapezoid_peak_speed(-distance, vel, acc)
    assert peak <= vel
    assert peak * (time - peak / acc) == pytest.approx(distance, rel=1e-9)
    at_the_edge = shortest_trapezoid_reaching(vel, acc)
    assert trapezoid_peak_speed(at_the_edge, vel, acc) == pytest.approx(vel)
