"""A comparison as plain data for JSON."""

from __future__ import annotations

from typing import Any

from gantryctl.engineering.accuracy.report.data import verdict_data
from gantryctl.engineering.comparison.key_figures import KEY_FIGURES
from gantryctl.engineering.comparison.report import CompareReport


def comparison_data(report: CompareReport) -> dict[str, Any]:
    """Everything `compare --json` prints."""
    plants = report.ensemble
    return {
        "first": report.first,
        "second": report.second,
        "short_deg": list(report.short_deg),
        "long_deg": list(report.long_deg),
        "verdict": verdict_data(report.verdict),
        "figures": {name: {"meaning": f.meaning, "unit": f.unit} for name, f in KEY_FIGURES.items()},
        "rows": {name: row._asdict() for name, row in report.rows},
        "identified": [row._asdict() for row in report.identified],
        "profiles_at_equal_base_motion": [
            row._asdict() | {"move": row.move._asdict()} for row in report.profiles
        ],
        "ensemble": plants
        and {
            "plants": len(plants.seeds),
            "first_seed": plants.seeds[0],
            "quantiles_5_50_95": {row: plants.quantiles(row) for row in plants.rows},
        },
    }
