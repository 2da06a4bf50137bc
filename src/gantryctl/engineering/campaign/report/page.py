"""Populations as one HTML page, its figures inline."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from gantryctl.engineering.campaign.report import figures
from gantryctl.engineering.campaign.report.text import lines, tables
from gantryctl.engineering.campaign.statistics import Population
from gantryctl.engineering.report.page import render_page
from gantryctl.engineering.report.svg import svg

# More tiles than fit in a row say less.
_TILES_MOST: Final = 5
TEMPLATE: Final = Path(__file__).parent / "templates" / "campaign.html.j2"


def render_populations(populations: Sequence[tuple[str, Population]]) -> str:
    """The page of one result, or of several beside each other; each with a name.

    The same results give the same page, byte for byte.
    """
    first = populations[0][1]
    alone = len(populations) == 1
    # Parts of one result come from the same rows.
    one = all(found.head == first.head for _, found in populations)
    sources = populations[:1] if one else populations
    shown = [("", first)] if alone else list(populations)
    whole = all(found.there == found.rows for _, found in populations)
    return render_page(
        TEMPLATE,
        {
            "badge": "complete" if whole else "not finished",
            "badge_class": "none",
            "tiles": _tiles(first) if alone else [],
            "title": " and ".join(dict.fromkeys(found.head.name for _, found in populations)),
            "description": first.head.description if one else "",
            "results": [(name, lines(found), _origin(found)) for name, found in sources],
            "figures": _figures(shown),
            "tables": [(table.title, table.heads, table.rows) for table in tables(shown)],
        },
    )


def _tiles(found: Population) -> list[tuple[str, str, str]]:
    """The figures at the top: value, name, remark."""
    made = [(f"{found.there}", "rows", f"of {found.rows}")]
    for figure in found.figures[:_TILES_MOST]:
        output = found.head.outputs[figure.column]
        low, middle, high = (
            f"{each.value:.{output.digits}f}" for each in figure.quantiles if each.part in (0.05, 0.5, 0.95)
        )
        unit = "" if output.unit == "-" else f" {output.unit}"
        made.append((f"{middle}{unit}", f"median of {figure.column}", f"{low} .. {high} in 90 % of plants"))
    return made


def _figures(shown: Sequence[tuple[str, Population]]) -> list[tuple[str, str]]:
    """Caption and SVG: a distribution for each figure over all results and controls, then Sobol indices."""
    found = []
    named = {
        column.rpartition(".")[2]: output for _, each in shown for column, output in each.head.outputs.items()
    }
    for name, output in named.items():
        columns = list(
            dict.fromkeys(
                column for _, each in shown for column in each.values if column.rpartition(".")[2] == name
            )
        )
        figure = figures.distribution(shown, columns, output.meaning)
        found.append((f"{output.meaning}: part of the plants at or below a value.", svg(figure, name)))
    for _, each in shown:
        for of in each.figures:
            if of.sensitivity:
                caption = f"Sobol indices of {of.column}: what makes its variance."
                found.append((caption, svg(figures.sensitivity(of), f"sobol-{of.column}")))
    return found


def _origin(found: Population) -> list[tuple[str, Any]]:
    head = found.head
    return [
        ("campaign", head.campaign_hash[:12]),
        ("machine", head.machine_hash[:12]),
        ("computed by", ", ".join(f"{name} {value}" for name, value in head.made_by._asdict().items())),
        ("sampling", f"{head.design.sampling.replace('_', ' ')}, seed {head.design.seed}"),
        ("varies", ", ".join(head.factors)),
    ]
