"""Closed forms of move times against integration of the profile and the reference figures."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.engineering.analysis.models.profiles import (
    double_s_time_s,
    shortest_trapezoid_reaching,
    trapezoid_peak_speed,
    trapezoid_time_s,
)
from gantryctl.errors import UsageError

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
    assert double_s_time_s(-180.0, 6.0, 450.0 / 1144.0, jerk) == pytest.approx(
        entry["value"], rel=entry["rtol"]
    )


@given(st.floats(0.01, 500.0), st.floats(0.1, 10.0), st.floats(0.1, 10.0))
def test_a_trapezoid_covers_its_distance(distance: float, vel: float, acc: float) -> None:
    time, peak = trapezoid_time_s(-distance, vel, acc), trapezoid_peak_speed(-distance, vel, acc)
    assert peak <= vel
    assert peak * (time - peak / acc) == pytest.approx(distance, rel=1e-9)
    at_the_edge = shortest_trapezoid_reaching(vel, acc)
    assert trapezoid_peak_speed(at_the_edge, vel, acc) == pytest.approx(vel)


@pytest.mark.parametrize(("distance", "jerk"), [(5.0, 0.8), (180.0, 0.001)])
def test_the_closed_form_says_where_it_ends(distance: float, jerk: float) -> None:
    with pytest.raises(UsageError, match="does not reach"):
        double_s_time_s(distance, 6.0, 0.39336, jerk)
