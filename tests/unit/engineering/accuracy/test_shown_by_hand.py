"""What the figures of accuracy look like to people and to programs: each number in its place, unit and digits."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from gantryctl.engineering.accuracy.budget import (
    Budget,
    Contribution,
    budget_data,
    budget_rows,
    budget_text,
    freedom_text,
)
from gantryctl.engineering.accuracy.gear import (
    GearStudy,
    Place,
    Prediction,
    study_data,
    study_text,
    worth_of_the_fit,
)
from gantryctl.engineering.accuracy.isocentre import Isocentre, isocentre_data, isocentre_text
from gantryctl.engineering.accuracy.report.page import render_speed_test
from gantryctl.engineering.accuracy.report.report import SpeedRun
from gantryctl.engineering.accuracy.report.text import speed_lines
from gantryctl.engineering.accuracy.table import Direction, RowKey
from gantryctl.machine import Requirement, config_hash, default_machine
from gantryctl.units import SIGNED
from support.reports import HEAD

BUDGET = Budget(
    "tracker",
    (
        Contribution("noise of a reading", "normal", "each reading", 0.0001234, "deg", 3.5, 0.0004319, 8.0),
        Contribution("scale", "rectangular", "all readings", 0.00025, "-", 12.0, 0.003, math.inf),
    ),
    combined_deg=0.00303,
    degrees_of_freedom=19_000.0,
    low_deg=-0.0049,
    high_deg=0.0071,
    draws=2000,
)


def test_a_budget_for_a_terminal() -> None:
    assert budget_text(BUDGET).splitlines() == [
        "uncertainty of A, tracker (GUM; 2000 draws beside it)",
        "                                                                  value  deg a unit  u(A), deg   dof",
        "  noise of a reading                            normal     0.000123 deg    3.50e+00    0.00043     8",
        "  scale                                         uniform         0.00025    1.20e+01    0.00300   inf",
        "  combined                                                                             0.00303   inf",
        "  expanded, k = 2: 0.0061 deg; 95 % of the draws: A -0.0049 .. +0.0071 deg",
    ]
    assert [row[2] for row in budget_rows(BUDGET)] == ["each reading", "all readings"]


@pytest.mark.parametrize(("value", "text"), [(999.4, "999"), (1000.0, "inf"), (math.inf, "inf"), (7.6, "8")])
def test_degrees_of_freedom_beyond_a_thousand_are_as_good_as_infinite(value: float, text: str) -> None:
    assert freedom_text(value) == text


def test_a_budget_for_a_program() -> None:
    data = budget_data(BUDGET)
    assert data is not None
    first, second = data.pop("contributions")
    assert data == {
        "instrument": "tracker", "combined_deg": 0.00303, "degrees_of_freedom": 19_000.0, "coverage_factor": 2.0,
        "expanded_deg": 0.00606, "monte_carlo": {"draws": 2000, "low_deg": -0.0049, "high_deg": 0.0071},
    }  # fmt: skip
    assert first == {
        "name": "noise of a reading", "distribution": "normal", "acting": "each reading", "value": 0.0001234,
        "unit": "deg", "sensitivity": 3.5, "contribution_deg": 0.0004319, "degrees_of_freedom": 8.0,
    }  # fmt: skip
    assert second["degrees_of_freedom"] is None
    assert budget_data(None) is None


SPEED_RUN = SpeedRun(
    6.0, Direction.CCW, (-90.0, 90.0), 5.998, 0.018, 0.02, Requirement(0.01, "m"), motor_judged=False
)


def required_rows(*runs: SpeedRun) -> list[tuple[str, ...]]:
    """Cells of the table of required values on the page of these runs."""
    table = re.search(r'<table class="required">.*?</table>', render_speed_test(runs, HEAD), re.DOTALL)
    assert table is not None
    rows = re.findall(r"<tr>(<td.*?)</tr>", table.group(), re.DOTALL)
    return [tuple(re.findall(r"<td[^>]*>(.*?)</td>", row)) for row in rows]


def test_the_worst_run_stands_beside_what_is_required_of_all_of_them() -> None:
    """Of 0.012 and 0.004 deg/s the first, of 99.95 and 99.5 % the second."""
    runs = (
        replace(SPEED_RUN, motor_judged=True, motor_error_deg_s=0.012, reached_deg_s=5.997),
        replace(SPEED_RUN, motor_judged=True, motor_error_deg_s=0.004, reached_deg_s=5.97),
    )
    for order in (runs, runs[::-1]):
        reached, motor = required_rows(*order)
        assert reached[2:] == ("99.50 %", "FAIL")
        assert motor[1:] == ("at most 0.01°/s", "0.0120°/s", "FAIL")


def test_a_motor_that_leads_on_purpose_is_no_pass_of_its_limit() -> None:
    """0.018 deg/s beside "at most 0.01" has no verdict; the speed was reached to 5.998 / 6 = 99.97 %."""
    reached, motor = required_rows(SPEED_RUN)
    assert reached == ("Part of each speed that is reached", "at least 99.9 %", "99.97 %", "pass")
    assert motor[1:] == ("at most 0.01°/s", "0.0180°/s", "no verdict")
    page = render_speed_test([SPEED_RUN], HEAD)
    assert "very speed is reached, motor side not judged" in page
    assert "within the limit" not in page


def test_a_speed_test_says_which_of_its_two_criteria_failed() -> None:
    slow = replace(SPEED_RUN, reached_deg_s=5.99, motor_error_deg_s=0.009, motor_judged=True)
    assert [row[-1] for row in required_rows(slow)] == ["FAIL", "pass"]
    assert "ccw: speed not reached" in render_speed_test([slow], HEAD)
    wild = replace(SPEED_RUN, motor_judged=True)
    assert [row[-1] for row in required_rows(wild)] == ["pass", "FAIL"]
    assert "ccw: motor side above the limit" in render_speed_test([wild], HEAD)


def test_a_load_that_nothing_measures_has_no_error_rather_than_none() -> None:
    bus = replace(SPEED_RUN, load_error_deg_s=None)
    seen, unseen = (speed_lines([run]).splitlines()[2].split() for run in (SPEED_RUN, bus))
    assert (seen[-2:], unseen[-2:]) == (["0.0180", "0.0200"], ["0.0180", "-"])


def test_the_speed_asked_has_the_decimals_of_the_speed_reached() -> None:
    """0.999 deg/s of a telescope: "1.00" beside 0.999 reached looked like a speed that was missed."""
    run = replace(SPEED_RUN, speed_deg_s=0.999, reached_deg_s=0.999)
    assert speed_lines([run]).splitlines()[2].split()[2:4] == ["0.999", "0.999"]


ROW, BACK = RowKey(0.0, Direction.CCW), RowKey(-90.0, Direction.CW, 2)
CHORDS = Prediction(
    (Place(ROW, 5.0), Place(BACK, 10.0)),
    np.array([0.0010, -0.0020]),
    np.array([0.0004, -0.0001]),
    np.array([-0.0011, -0.0013]),
    np.array([0.0019, 0.0011]),
)
"""About their mean of -0.0005 the chords are 0.0015 off, 4.5e-6 in squares; 0.36e-6 and 3.61e-6 are left."""


def test_a_study_of_a_gear_for_people_and_for_programs() -> None:
    study = GearStudy("paper", 0.75, CHORDS, (CHORDS,), {8.0: 0.25, 9.0: 0.75})
    assert study_text(study, SIGNED).splitlines()[:5] == [
        "every base predicted from the others, deg",
        "base, way      chord   measured  predicted   95 % interval",
        "0 ccw              5    +0.0010    +0.0004   -0.0011 .. +0.0019",
        "-90 cw            10    -0.0020    -0.0001   -0.0013 .. +0.0011   outside",
        "grade of ISO 1328-1, by the evidence of the table: 8: 25 %, 9: 75 %",
    ]
    assert worth_of_the_fit(study) == (
        "A gear that is fitted to the 2 chords explains them with R2 0.75; what is left out it predicts with R2 0.12 "
        "(a row) and 0.12 (a base; below 0 the mean would be nearer). 1 of 2 then lie in their 95 % intervals, "
        "+-0.0014 deg in the mean (`gantryctl accuracy gear`)"
    )
    data = study_data(study)
    assert (data["table"], data["in_sample_r2"], data["grades"]) == ("paper", 0.75, {"8": 0.25, "9": 0.75})
    assert data["row_left_out"] == data["base_left_out"]
    found = data["row_left_out"]
    assert found["r2"] == pytest.approx(1.0 - 3.97 / 4.5)
    assert found["covered"] == 1
    assert found["chords"][1] == {
        "base_deg": -90.0, "direction": "cw", "run": 2, "displacement_deg": 10.0, "measured_deg": -0.0020,
        "predicted_deg": -0.0001, "low_deg": -0.0013, "high_deg": 0.0011,
    }  # fmt: skip


def test_a_chord_on_the_end_of_its_interval_is_within() -> None:
    ends = Prediction(
        CHORDS.places, np.array([-1.0, 2.0]), np.zeros(2), np.array([-1.0, -2.0]), np.array([1.0, 2.0])
    )
    assert ends.covered == 2
    study = GearStudy("t", 0.0, ends, (ends,), {})
    assert "outside" not in study_text(study, SIGNED)


def test_a_way_of_the_isocentre_for_people_and_for_programs() -> None:
    way = Isocentre(
        np.array([-90.0, 0.0, 90.0]),
        np.array([[0.1, 0.2, 0.3], [-0.4, 0.5, 0.6], [0.7, -0.8, 0.9]]),
        np.array([[1.1, 1.2, 1.3], [1.4, 1.5, 1.6], [1.7, 1.8, -1.9]]),
        np.array([0.011, -0.022, 0.033]),
        (0.25, -0.75),
        0.125,
    )
    assert isocentre_text(way).splitlines() == [
        "Isocentre over the angle: shift in mm, tilt in mrad, shift of the beam across itself in mm",
        "   angle       x       y       z   about u_t       y     u_r   beam",
        "   -90.0   0.100   0.200   0.300       1.100   1.200   1.300  0.011",
        "     0.0  -0.400   0.500   0.600       1.400   1.500   1.600 -0.022",
        "    90.0   0.700  -0.800   0.900       1.700   1.800  -1.900  0.033",
        "Range of the shift: 1.100 x 1.300 x 0.600 mm",
        "Star shot: circle of 0.125 mm radius about x = 0.250, z = -0.750 mm",
        "By the weight and the tracks of [plant.structure], estimates until somebody has measured them.",
    ]
    machine = default_machine()
    data = isocentre_data(way, machine)
    assert data.pop("span_mm") == pytest.approx([1.1, 1.3, 0.6])
    assert data == {
        "machine": machine.name, "hash": config_hash(machine), "angles_deg": [-90.0, 0.0, 90.0],
        "shift_mm": [[0.1, 0.2, 0.3], [-0.4, 0.5, 0.6], [0.7, -0.8, 0.9]],
        "tilt_mrad": [[1.1, 1.2, 1.3], [1.4, 1.5, 1.6], [1.7, 1.8, -1.9]], "lateral_mm": [0.011, -0.022, 0.033],
        "star_centre_mm": [0.25, -0.75], "star_radius_mm": 0.125,
    }  # fmt: skip
