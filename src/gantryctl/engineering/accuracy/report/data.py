"""The report as JSON: every input and every figure, units in the names."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from gantryctl.engineering.accuracy.paper import PAPER_A_DEG, PAPER_NAME
from gantryctl.engineering.accuracy.procedure.procedures import Procedure
from gantryctl.engineering.accuracy.report.report import (
    SPEED_ERROR_LIMIT_DEG_S,
    AccuracyReport,
    Ensemble,
    SpeedRun,
)
from gantryctl.engineering.accuracy.statistics import TableStatistics, statistics
from gantryctl.engineering.accuracy.table import ErrorTable

SCHEMA = "gantryctl.accuracy/1"
"""Changes when a name disappears or changes its meaning; further names may come."""


def to_json(report: AccuracyReport) -> str:
    """The report as JSON text, two spaces of indent, keys in a fixed order."""
    return json.dumps(to_dict(report), indent=2, allow_nan=False) + "\n"


def to_dict(report: AccuracyReport) -> dict[str, Any]:
    """The report as plain dicts, lists, numbers and strings."""
    tables = {"measured": report.measured, "true": report.true}
    return {
        "schema": SCHEMA,
        **{name: getattr(report, name) for name in _IDENTITY},
        "asked": _asked(report),
        "plant_switches": dict(report.switches),
        "tables": {name: None if table is None else _table(table) for name, table in tables.items()},
        "a_measured": _plain(report.a_measured),
        "a_floor": _plain(report.a_floor),
        "iso_230_2": {
            "true": None if report.true is None else _plain(report.iso),
            "measured": _plain(report.iso_measured),
        },
        "verdict": _plain(report.verdict),
        "comparison": {
            "paper": PAPER_NAME,
            "paper_a_deg": PAPER_A_DEG,
            "phases_fitted": report.phases_fitted,
            "text": report.comparison,
        },
        "ensemble": None if report.ensemble is None else _ensemble(report.ensemble),
        "speed_test": {
            "passed": report.speed_passed,
            "limit_motor_deg_s": SPEED_ERROR_LIMIT_DEG_S,
            "runs": [speed_to_dict(run) for run in report.speed],
        },
        "warnings": list(report.warnings),
    }


_IDENTITY = ("machine", "config_hash", "version", "seed", "created", "source", "measures_load")
_ASKED = ("radius_m", "sigma_m", "dwell_s", "average_s", "vel_max_deg_s", "acc_deg_s2", "angle_errors_deg")


def _asked(report: AccuracyReport) -> dict[str, Any]:
    return {
        **{name: _plain(getattr(report, name)) for name in _ASKED},
        "procedure": None if report.procedure is None else _procedure(report.procedure),
        "settings": dict(report.settings),
    }


def _ensemble(gears: Ensemble) -> dict[str, Any]:
    return {**_plain(gears), "distribution": _plain(gears.distribution)}


def table_to_dict(table: ErrorTable) -> dict[str, Any]:
    """One table with its statistics: what `accuracy stats --json` prints."""
    return _table(table)


def _table(table: ErrorTable) -> dict[str, Any]:
    rows = [
        {"base_deg": row.base_deg, "direction": row.direction.value, "run": row.run, "errors_deg": errors}
        for row, errors in zip(table.rows, table.errors_deg.tolist(), strict=True)
    ]
    return {
        "layout": table.layout.value,
        "displacements_deg": list(table.displacements_deg),
        "rows": rows,
        "statistics": _statistics(statistics(table)) if len(rows) > 1 else None,
    }


def _statistics(figures: TableStatistics) -> dict[str, Any]:
    return {**_plain(figures), "warnings": list(figures.warnings)}


def _procedure(procedure: Procedure) -> dict[str, Any]:
    return {
        "name": procedure.name,
        "bases_deg": list(procedure.bases_deg),
        "displacements_deg": list(procedure.displacements_deg),
        "runs": procedure.runs,
        "chord": procedure.chord.value,
        "stops": len(procedure.stops),
    }


def speed_to_dict(run: SpeedRun) -> dict[str, Any]:
    """One run of the speed test as plain values."""
    names = (
        "speed_deg_s",
        "travel_deg",
        "reached_deg_s",
        "motor_error_deg_s",
        "load_error_deg_s",
        "stick_slip",
        "motor_judged",
    )
    return {
        "direction": run.direction.value,
        **{name: _plain(getattr(run, name)) for name in names},
        "passed": run.passed,
    }


def _plain(value: Any) -> Any:
    """Dataclasses, enums, arrays and tuples as JSON knows them; what is not finite becomes null."""
    if is_dataclass(value) and not isinstance(value, type):
        return {name: _plain(part) for name, part in asdict(value).items()}
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, Mapping):
        return {
            f"{key:g}" if isinstance(key, float) else str(key): _plain(part) for key, part in value.items()
        }
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
