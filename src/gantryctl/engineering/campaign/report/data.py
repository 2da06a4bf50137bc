"""A population as plain data for JSON."""

from __future__ import annotations

from typing import Any

from gantryctl.engineering.campaign.statistics import LEVEL, FigureStatistics, Population


def population_data(found: Population) -> dict[str, Any]:
    """Everything `campaign show --json` prints."""
    head = found.head
    return {
        "name": head.name,
        "description": head.description,
        "campaign_hash": head.campaign_hash,
        "machine_hash": head.machine_hash,
        "made_by": head.made_by._asdict(),
        "sampling": head.design.sampling,
        "seed": head.design.seed,
        "part": None if found.part is None else dict(zip(("key", "value"), found.part, strict=True)),
        "rows": found.rows,
        "rows_there": found.there,
        "complete": found.there == found.rows,
        "base_points": found.base_points,
        "refused": found.refused,
        "level": LEVEL,
        "figures": {figure.column: _figure(found, figure) for figure in found.figures},
    }


def _figure(found: Population, figure: FigureStatistics) -> dict[str, Any]:
    output = found.head.outputs[figure.column]
    return {
        "unit": output.unit,
        "meaning": output.meaning,
        "plants": figure.plants,
        "mean": figure.mean,
        "deviation": figure.deviation,
        "smallest": figure.smallest,
        "largest": figure.largest,
        "quantiles": [each._asdict() for each in figure.quantiles],
        "curve": list(figure.curve),
        "passing": [each._asdict() for each in figure.passing],
        "sensitivity": [each._asdict() for each in figure.sensitivity],
    }
