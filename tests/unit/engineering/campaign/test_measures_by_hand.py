"""Figures of a plant from readings that are written down here, and the tables that people read."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.engineering.accuracy.procedure.plan import chord_plan
from gantryctl.engineering.campaign import measures
from gantryctl.engineering.campaign.measures import Output, Subject
from gantryctl.engineering.campaign.report.text import lines, tables
from gantryctl.engineering.campaign.sampling import Design
from gantryctl.engineering.campaign.statistics import (
    PARTS,
    FigureStatistics,
    Population,
    Quantile,
    Sensitivity,
)
from gantryctl.machine import default_machine, with_values

MACHINE = with_values(default_machine(), {"accuracy.tracker_noise_um": 15.0})
OTHER = with_values(default_machine(), {"axis.pos_min_deg": -100.0, "axis.pos_max_deg": 100.0})


def test_of_the_readings_of_a_plant_the_largest_error_counts_and_a_plant_without_numbers_has_no_figures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """0.02 deg too little, 0.01 too much, and one that has broken down; each tracker has the noise of its own row."""
    procedure = chord_plan(MACHINE).procedure("A", 1)
    load = np.tile(procedure.targets_rad, (3, 1))
    load[0, 3] -= math.radians(0.02)
    load[1, 5] += math.radians(0.01)
    load[2, 1] = math.nan
    readings = SimpleNamespace(load_rad=load, vel_err_load_rad_s=np.zeros_like(load))
    monkeypatch.setattr(measures, "run_procedure", lambda *_, **__: readings)
    drawn: list[tuple[float, int]] = []

    def draws(_: object, __: object, ___: float, sigma_m: float, *, seed: int) -> Any:
        drawn.append((sigma_m, seed))
        return np.array([0.1, 0.9, 0.2])

    monkeypatch.setattr(measures, "a_draws", draws)
    rows = [Subject(row, MACHINE) for row in (7, 12, 19)]
    found = measures._chord_figures(rows, procedure, {"a_measured_deg"})
    assert found[2] is None
    assert [each and each["angle_error_deg"] for each in found[:2]] == [
        pytest.approx(0.02),
        pytest.approx(0.01),
    ]
    assert [each and each["a_measured_deg"] for each in found[:2]] == [0.2, 0.2]
    assert [seed for _, seed in drawn] == [7, 12]
    assert [sigma_m for sigma_m, _ in drawn] == pytest.approx([15e-6, 15e-6])


def test_plants_of_two_travels_keep_their_places(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measured in two groups, and told in the order in which they were given."""
    monkeypatch.setattr(
        measures, "_chord_figures", lambda rows, *_: [{"row": float(each.row)} for each in rows]
    )
    settings = SimpleNamespace(chord_test=SimpleNamespace(procedure="A", runs=1))
    rows = [Subject(row, machine) for row, machine in enumerate((MACHINE, OTHER, MACHINE, OTHER))]
    found = measures._chord_test(rows, settings, ())  # type: ignore[arg-type]
    assert found == [{"row": 0.0}, {"row": 1.0}, {"row": 2.0}, {"row": 3.0}]


def test_of_several_speeds_the_worst_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = [
        SimpleNamespace(load_error_deg_s=load, motor_error_deg_s=motor, stick_slip=slips)
        for load, motor, slips in ((0.1, 0.03, False), (0.4, 0.02, True), (None, 0.01, False))
    ]
    monkeypatch.setattr(measures, "speed_tests", lambda *_: [runs])
    settings = SimpleNamespace(speed_test=SimpleNamespace(speeds_r_min=[0.1, 0.5, 1.0]))
    (found,) = measures._speed_test([Subject(0, MACHINE)], settings, ())  # type: ignore[arg-type]
    assert found == {"speed_error_load_deg_s": 0.4, "speed_error_motor_deg_s": 0.03, "stick_slip": 1.0}


def population() -> Population:
    """Quantiles of 1, 2, 3, 4 with intervals of their own, and two factors."""
    quantiles = tuple(
        Quantile(part, float(k), k - 0.25, k + 0.5 if k < 4 else None) for k, part in enumerate(PARTS, 1)
    )
    indices = (
        Sensitivity("first", 0.5, 0.45, 0.55, 0.52, 0.47, 0.57),
        Sensitivity("second", 0.1, 0.05, 0.15, 0.88, 0.83, 0.93),
    )
    figure = FigureStatistics("a_deg", 40, 2.0, 1.0, 0.0, 5.0, quantiles, (), (), indices)
    head: Any = SimpleNamespace(
        name="gears",
        outputs={"a_deg": Output("deg", "A", 2)},
        design=Design("monte_carlo", 40, 1, (1,)),
        required={"a_deg": "the customer", "b_deg": "IEC 60601-2-64", "c_deg": "the customer"},
    )
    return Population(head, 40, 40, {}, (figure,), 8)


def test_the_interval_beside_the_quantiles_is_that_of_the_median_and_what_matters_most_stands_first() -> None:
    quantiles, sensitivity = tables([("", population())])
    assert quantiles.rows == (("a_deg", "deg", "1.00", "2.00", "3.00", "4.00", "1.75 .. 2.50", "40"),)
    assert [row[0] for row in sensitivity.rows] == ["second", "first"]


def test_who_requires_the_limits_is_named_once() -> None:
    assert (
        lines(population())[-1] == "limits of a_deg, b_deg, c_deg: required by the customer, IEC 60601-2-64"
    )
