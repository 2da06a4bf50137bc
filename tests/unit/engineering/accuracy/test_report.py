"""The report: verdict, comparison, warnings, text, JSON."""

import dataclasses
import json

import numpy as np
import pytest

from gantryctl.engineering.accuracy.noise import Distribution
from gantryctl.engineering.accuracy.paper import PAPER_TABLE
from gantryctl.engineering.accuracy.procedure.procedures import Chord, chord_procedure, evaluate
from gantryctl.engineering.accuracy.report.data import report_data, report_json, table_data
from gantryctl.engineering.accuracy.report.report import AccuracyReport, Beside
from gantryctl.engineering.accuracy.report.text import text_report, text_table
from gantryctl.engineering.accuracy.table import ErrorTable, RowKey, table_from_rows
from gantryctl.engineering.accuracy.verdict import Conformity
from gantryctl.engineering.report.origin import Origin
from gantryctl.machine import Requirement

REQUIRED = Requirement(0.1, "m", "a sheet")
MEASURED = AccuracyReport(
    "m", "hash", "0.1", 0, "tracker.csv", PAPER_TABLE, Origin.MEASURED, required=REQUIRED, of_reference=True
)


def test_a_table_from_a_file_is_enough() -> None:
    text = text_report(MEASURED)
    assert "A = 0.0113 deg, largest X + 3 S minus smallest X - 3 S, 6 rows pooled" in text
    assert "rms by base: 90 deg 0.0015, 0 deg 0.0009, -90 deg 0.0021" in text
    assert "PASS: A as measured 0.0113 deg" in text
    assert "this is the paper's own table" in text
    assert "ISO 230-2:2014: not computable: 1 run" in text
    assert "warning: S pools" in text
    assert "speed test" not in text


def test_the_comparison_is_never_a_criterion(report: AccuracyReport) -> None:
    assert report.statistics.a_deg > 0.0113
    assert report.verdict.passed is True
    assert "fitted" in report.comparison
    assert "not a criterion" in report.comparison
    other = dataclasses.replace(report, phases_fitted=False)
    assert "fitted" not in other.comparison
    assert "not a criterion" in other.comparison


def test_the_requirement_of_the_machine_judges_and_stands_in_the_verdict() -> None:
    """The false PASS of the first version: 0.0113 on a machine that needs 0.01 was "within 0.1 deg"."""
    strict = dataclasses.replace(MEASURED, required=Requirement(0.01, "dish", "tender 4711"))
    assert strict.verdict.passed is False
    assert "0.0113 deg: outside 0.01 deg; required by dish (tender 4711)" in strict.verdict.text
    assert report_data(strict)["verdict"]["required"] == {
        "limit": 0.01,
        "by": "dish",
        "source": "tender 4711",
    }


def test_without_a_requirement_there_is_no_verdict() -> None:
    nobody = dataclasses.replace(MEASURED, required=None)
    assert nobody.verdict.passed is None
    assert nobody.verdict.figures_deg == {}
    assert "NO VERDICT: nothing tells which accuracy is required" in text_report(nobody)


def test_the_paper_stands_beside_the_reference_machine_only(report: AccuracyReport) -> None:
    other = dataclasses.replace(report, of_reference=False, phases_fitted=False)
    assert "paper" in text_report(report)
    assert "paper" not in text_report(other)
    assert report_data(other)["comparison"] is None


def test_the_verdict_names_what_is_outside() -> None:
    wide = table_from_rows([(0.0, "ccw", (0.0, 0.06)), (90.0, "ccw", (0.0, -0.06))], (0.0, 5.0))
    report = dataclasses.replace(MEASURED, measured=wide)
    assert report.verdict.passed is False
    assert "A as measured" in report.verdict.text
    assert "outside 0.1 deg" in report.verdict.text
    assert "largest chord error" not in report.verdict.text  # what is inside is not listed among what is not


def test_a_short_test_is_judged_by_what_the_whole_one_could_find() -> None:
    """Within 0.1 deg as it stands, and not with what the places that it leaves out may add."""
    short = chord_procedure("E", bases_deg=(0.0,))
    wide = table_from_rows([(0.0, "ccw", (0.0, 0.08)), (0.0, "cw", (0.0, 0.08))], (0.0, 15.0))
    report = dataclasses.replace(MEASURED, measured=wide, procedure=short)
    assert report.verdict.passed is False
    assert "largest chord error of the whole test, at most 0.1120 deg: outside 0.1 deg" in report.verdict.text
    assert any(warning.startswith("short test: 2 series of 1 chord") for warning in report.warnings)
    whole = dataclasses.replace(
        report, procedure=chord_procedure("A", bases_deg=(0.0,), displacements_deg=(15.0,))
    )
    assert whole.verdict.passed is True


def test_a_lost_turn_fails_though_chords_cannot_see_it(report: AccuracyReport) -> None:
    """One motor turn is 0.31 deg at the gantry: the same at every stop, so no chord changes."""
    assert report.procedure is not None
    targets = report.procedure.targets_rad
    shifted = targets + np.radians(360.0 / 1144.0)
    table = evaluate(report.procedure, shifted, 2.5)
    errors = tuple(np.degrees(shifted - targets).tolist())
    lost = dataclasses.replace(MEASURED, measured=table, angle_errors_deg=errors)
    assert lost.statistics.a_deg < 1e-9
    assert lost.verdict.passed is False
    assert "largest angle error at a stop 0.3147 deg" in lost.verdict.text


def test_motor_side_readings_get_no_verdict() -> None:
    report = dataclasses.replace(MEASURED, measures_load=False)
    assert report.verdict.passed is None
    assert report.verdict.figures_deg == {}
    assert "NO VERDICT: the readings are motor side" in text_report(report)
    assert report.warnings[0].startswith("motor side")


def test_noise_that_hides_the_axis_is_a_warning() -> None:
    floor = Distribution(0.008, 0.006, 0.010, 500)
    report = dataclasses.replace(MEASURED, a_floor=floor)
    assert any("more than half" in warning for warning in report.warnings)
    quiet = dataclasses.replace(MEASURED, a_floor=Distribution(0.0024, 0.0017, 0.0033, 500))
    assert not any("more than half" in warning for warning in quiet.warnings)


def test_speed_test(report: AccuracyReport) -> None:
    assert report.speed_passed is True
    slow = dataclasses.replace(report.speed[0], reached_deg_s=0.5)
    wild = dataclasses.replace(report.speed[0], motor_error_deg_s=0.0101)
    assert not slow.passed
    assert not wild.passed
    assert dataclasses.replace(wild, motor_judged=False).passed
    assert not dataclasses.replace(slow, motor_judged=False).passed
    assert dataclasses.replace(report, speed=(slow,)).speed_passed is False
    assert MEASURED.speed_passed is None
    assert "stick-slip at 0.6 deg/s ccw, 0.6 deg/s cw" in report.warnings
    blind = dataclasses.replace(report.speed[0], load_error_deg_s=None)
    assert " - " in text_report(dataclasses.replace(report, speed=(blind,)))
    assert "peaks at 1.40 deg/s and one of 20 deg at 2.80 deg/s" in report.speed_note
    assert "at least 91.5 deg" in report.speed_note
    assert MEASURED.speed_note == ""


def test_text_table_beside_the_paper() -> None:
    lines = text_table(PAPER_TABLE, Beside("paper", PAPER_TABLE)).splitlines()
    assert lines[2] == ("90 ccw      -0.0002  +0.0005  +0.0020  +0.0012   -0.0002  +0.0005  +0.0020  +0.0012")
    assert lines[-1].split() == ["A", "0.0113", "0.0113"]
    assert max(map(len, lines)) <= 100


def test_text_table_of_other_columns_stands_alone() -> None:
    table = table_from_rows([(45.0, "ccw", (0.0, 0.001)), (45.0, "cw", (0.0, -1e-6))], (0.0, 7.5))
    text = text_table(table, Beside("paper", PAPER_TABLE))
    assert "paper" not in text
    assert "7.5" in text
    assert "-0.0000" not in text
    one = ErrorTable((RowKey(*table.rows[0][:2]),), table.displacements_deg, table.errors_deg[:1])
    assert "A" not in text_table(one)


def test_repeated_runs_are_shown_as_means(five_runs: AccuracyReport) -> None:
    text = text_report(five_runs)
    assert "simulated, noise off (mean of 5)" in text
    assert "30 rows pooled" in text
    assert "ISO 230-2:2014, 5 runs in each direction" in text
    assert five_runs.iso.repeatability_up_deg == pytest.approx(0.0, abs=1e-12)
    measured = five_runs.iso_measured.repeatability_up_deg
    assert measured is not None
    assert measured > 1e-4  # the instrument's noise


def test_json_holds_everything_and_nothing_that_is_not_a_number(report: AccuracyReport) -> None:
    data = json.loads(report_json(report))
    assert data["schema"] == "gantryctl.accuracy/2"
    assert data["tables"]["true"]["statistics"]["a_deg"] == report.statistics.a_deg
    assert data["tables"]["measured"]["rows"][0]["direction"] == "ccw"
    assert data["verdict"]["passed"] is True
    assert data["comparison"]["phases_fitted"] is True
    assert data["ensemble"]["distribution"]["draws"] == 8
    assert data["asked"]["procedure"] == {
        "name": "A",
        "bases_deg": [90.0, 0.0, -90.0],
        "displacements_deg": [5.0, 10.0, 15.0, 20.0],
        "runs": 1,
        "chord": "base",
        "stops": 36,
    }
    assert len(data["asked"]["angle_errors_deg"]) == 36
    assert [run["passed"] for run in data["speed_test"]["runs"]] == [True] * 6
    assert data["iso_230_2"]["measured"]["not_computable"].startswith("not computable")


def test_json_of_a_file_and_of_iso_figures(five_runs: AccuracyReport) -> None:
    data = report_data(MEASURED)
    assert data["tables"]["true"] is None
    assert data["iso_230_2"]["true"] is None
    assert data["ensemble"] is None
    assert data["asked"]["procedure"] is None
    assert len(report_data(five_runs)["iso_230_2"]["true"]["positions"]) == 15
    single = table_from_rows([(0.0, "ccw", (0.0, 1e-3))], (0.0, 5.0))
    assert table_data(single)["statistics"] is None
    json.dumps(table_data(PAPER_TABLE), allow_nan=False)


def test_single_steps_are_named(report: AccuracyReport) -> None:
    procedure = chord_procedure("A", chord=Chord.ADJACENT)
    table = evaluate(procedure, procedure.targets_rad, 2.5)
    steps = dataclasses.replace(report, procedure=procedure, measured=table, true=None)
    assert "single steps" in text_report(steps)


@pytest.mark.parametrize(
    ("high_deg", "conformity"),
    [(0.099, Conformity.PASS), (0.101, Conformity.UNDECIDED), (0.12, Conformity.UNDECIDED)],
)
def test_a_simulated_tracker_is_judged_by_the_spread_of_a_not_by_its_median(
    report: AccuracyReport, high_deg: float, conformity: Conformity
) -> None:
    """A median of 0.095 deg within 0.1 deg is no PASS where one draw in ten lies beyond."""
    spread = Distribution(median_deg=0.095, low_deg=0.09, high_deg=high_deg, draws=500)
    judged = dataclasses.replace(report, a_measured=spread).verdict
    assert judged.conformity is conformity
    assert judged.passed is (True if conformity is Conformity.PASS else None)
    # beyond by more than the spread it fails
    failed = dataclasses.replace(spread, median_deg=0.13, high_deg=0.14)
    assert dataclasses.replace(report, a_measured=failed).verdict.conformity is Conformity.FAIL


@pytest.mark.parametrize(("true_deg", "seen_deg"), [(0.12, 0.02), (0.02, 0.12)])
def test_a_chord_counts_as_it_is_and_as_it_is_seen(true_deg: float, seen_deg: float) -> None:
    """A draw of the noise may hide a chord that is too long, or make one of a sound axis."""

    def table(error_deg: float) -> ErrorTable:
        errors = np.zeros_like(PAPER_TABLE.errors_deg)
        errors[1, 2] = -error_deg
        return dataclasses.replace(PAPER_TABLE, errors_deg=errors)

    found = dataclasses.replace(MEASURED, true=table(true_deg), measured=table(seen_deg)).verdict
    assert found.figures_deg["largest chord error"] == pytest.approx(0.12)
    assert found.passed is False
