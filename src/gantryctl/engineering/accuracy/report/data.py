"""The report as JSON: every input and every figure, units in the names."""

from __future__ import annotations

import json
from typing import Any

from gantryctl.engineering.accuracy.budget import budget_data
from gantryctl.engineering.accuracy.paper import PAPER_A_DEG, PAPER_NAME
from gantryctl.engineering.accuracy.report.report import AccuracyReport, SpeedRun
from gantryctl.engineering.accuracy.statistics import statistics
from gantryctl.engineering.accuracy.table import ErrorTable
from gantryctl.engineering.accuracy.uncertainty import COVERAGE_K
from gantryctl.engineering.accuracy.verdict import AccuracyVerdict
from gantryctl.engineering.report.data import plain

# Changes when a name disappears or changes its meaning; further names may come.
SCHEMA = "gantryctl.accuracy/2"
_IDENTITY = ("machine", "config_hash", "version", "seed", "created", "source", "origin", "measures_load")
_ASKED = ("radius_m", "sigma_m", "dwell_s", "average_s", "vel_max_deg_s", "acc_deg_s2", "angle_errors_deg")
_PROCEDURE = ("name", "bases_deg", "displacements_deg", "runs", "chord")


def report_json(report: AccuracyReport) -> str:
    """The report as JSON text, two spaces of indent, keys in a fixed order."""
    return json.dumps(report_data(report), indent=2, allow_nan=False) + "\n"


def report_data(report: AccuracyReport) -> dict[str, Any]:
    """The report as plain dicts, lists, numbers and strings."""
    tables = {"measured": report.measured, "true": report.true, "simulated": report.simulated}
    gears = report.ensemble
    return {
        "schema": SCHEMA,
        **{name: getattr(report, name) for name in _IDENTITY},
        "asked": _asked(report),
        "plant_switches": dict(report.switches),
        "tables": {name: None if table is None else table_data(table) for name, table in tables.items()},
        "a_measured": plain(report.a_measured),
        "a_floor": plain(report.a_floor),
        "iso_230_2": {
            "true": None if report.true is None else plain(report.iso),
            "measured": plain(report.iso_measured),
        },
        "verdict": verdict_data(report.verdict),
        "uncertainty": _uncertainty(report),
        "budget": budget_data(report.budget),
        "comparison": _comparison(report),
        "ensemble": None if gears is None else {**plain(gears), "distribution": plain(gears.distribution)},
        "speed_test": {
            "passed": report.speed_passed,
            "required": plain(report.speed[0].required) if report.speed else None,
            "runs": [speed_data(run) for run in report.speed],
        },
        "warnings": list(report.warnings),
    }


def verdict_data(verdict: AccuracyVerdict) -> dict[str, Any]:
    """Verdict with limit, who requires it, figures and their uncertainties."""
    return {"passed": verdict.passed, **plain(verdict)}


def _comparison(report: AccuracyReport) -> dict[str, Any] | None:
    """The paper beside its own machine."""
    if not report.of_reference:
        return None
    return {
        "paper": PAPER_NAME,
        "paper_a_deg": PAPER_A_DEG,
        "phases_fitted": report.phases_fitted,
        "text": report.comparison,
    }


def _uncertainty(report: AccuracyReport) -> dict[str, Any] | None:
    """Expanded uncertainties, k = 2."""
    known = report.uncertainty
    if known is None:
        return None
    return {
        "coverage_factor": COVERAGE_K,
        "a_expanded_deg": COVERAGE_K * known.a_deg,
        "chord_expanded_deg": plain(COVERAGE_K * known.chord_deg),
        "a_floor": plain(known.floor),
    }


def _asked(report: AccuracyReport) -> dict[str, Any]:
    procedure = report.procedure
    return {
        **{name: plain(getattr(report, name)) for name in _ASKED},
        "procedure": procedure
        and {**{name: plain(getattr(procedure, name)) for name in _PROCEDURE}, "stops": len(procedure.stops)},
        "settings": dict(report.settings),
    }


def table_data(table: ErrorTable) -> dict[str, Any]:
    """One table with its statistics: what `accuracy stats --json` prints."""
    figures = statistics(table) if len(table.rows) > 1 else None
    return {
        "layout": table.layout.value,
        "displacements_deg": list(table.displacements_deg),
        "rows": [
            {"base_deg": row.base_deg, "direction": row.direction.value, "run": row.run, "errors_deg": errors}
            for row, errors in zip(table.rows, table.errors_deg.tolist(), strict=True)
        ],
        "statistics": figures and {**plain(figures), "warnings": list(figures.warnings)},
    }


def speed_data(run: SpeedRun) -> dict[str, Any]:
    """One run of the speed test without its curves; its angles are signed, as everywhere in JSON."""
    figures = {
        name: plain(value) for name, value in vars(run).items() if name not in ("direction", "curves", "dial")
    }
    return {"direction": run.direction.value, **figures, "passed": run.passed}
