"""Populations as one HTML page, its figures inline."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from gantryctl.engineering.campaign.report import figures
from gantryctl.engineering.campaign.report.text import lines, percent, tables
from gantryctl.engineering.campaign.statistics import Population
from gantryctl.engineering.report.head import Head, Judged, Made, Required, Verdict
from gantryctl.engineering.report.page import Section, render_sections
from gantryctl.engineering.report.recording import ShownFigure, still
from gantryctl.units import behind

# More tiles than fit in a row say less.
_TILES_MOST: Final = 5
# More curves in one figure are not told apart.
_CURVES_MOST: Final = 4


def render_populations(populations: Sequence[tuple[str, Population]], made: Made) -> str:
    """The page of one result, or of several beside each other; each with a name.

    The same results and `made` give the same page, byte for byte.
    """
    first = populations[0][1]
    alone = len(populations) == 1
    # Parts of one result come from the same rows.
    one = all(found.head == first.head for _, found in populations)
    sources = populations[:1] if one else populations
    shown = [("", first)] if alone else list(populations)
    whole = all(found.there == found.rows for _, found in populations)
    name = " and ".join(dict.fromkeys(found.head.name for _, found in populations))
    verdict = Verdict(
        "complete" if whole else "not finished",
        Judged.OPEN,
        "; ".join(line for _, found in sources for line in lines(found)),
    )
    facts = [
        (what if one else f"{result}: {what}", value)
        for result, found in sources
        for what, value in _origin(found)
    ]
    return render_sections(
        Head(name, tuple(facts), made, required_source=_source(sources)),
        verdict,
        [row for result, found in shown for row in _required(result, found)],
        title=f"Campaign {name}",
        subtitle=first.head.description if one else "",
        tiles=_tiles(first) if alone else [],
        sections=[Section("", figures=_figures(shown)), Section("Tables", tables=tables(shown))],
    )


def _required(result: str, found: Population) -> list[Required]:
    """The limits of a campaign, with the part of its plants that keep them."""
    return [
        Required(
            " ".join(filter(None, (result, figure.column))),
            ", ".join(f"{each.limit:g}" for each in figure.passing)
            + behind(found.head.outputs[figure.column].unit),
            f"kept by {', '.join(percent(each.probability) for each in figure.passing)} of {figure.plants} plants",
            Judged.OPEN,
        )
        for figure in found.figures
        if figure.passing
    ]


def _source(results: Sequence[tuple[str, Population]]) -> str:
    """Who requires the limits, where the campaign files do not name them."""
    named = any(set(found.head.limits) - set(found.head.required) for _, found in results)
    by = [origin for _, found in results for origin in found.head.required.values()]
    return ", ".join(dict.fromkeys([*(["the campaign file"] if named else []), *by]))


def _tiles(found: Population) -> list[tuple[str, str, str]]:
    """The figures at the top: value, name, remark."""
    made = [(f"{found.there}", "rows", f"of {found.rows}")]
    # Figures of several controls are compared in the pictures.
    own = [figure for figure in found.figures if "." not in figure.column]
    for figure in own[:_TILES_MOST]:
        output = found.head.outputs[figure.column]
        low, middle, high = (
            f"{each.value:.{output.digits}f}" for each in figure.quantiles if each.part in (0.05, 0.5, 0.95)
        )
        unit = behind(output.unit)
        made.append((f"{middle}{unit}", f"median of {figure.column}", f"{low} .. {high} in 90 % of plants"))
    return made


def _figures(shown: Sequence[tuple[str, Population]]) -> list[ShownFigure]:
    """Each figure over all results and controls, then Sobol indices."""
    found = []
    named = {
        column.rpartition(".")[2]: output for _, each in shown for column, output in each.head.outputs.items()
    }
    for name, output in named.items():
        mine = [
            (result, each, of)
            for result, each in shown
            for of in each.figures
            if of.column.rpartition(".")[2] == name
        ]
        names = [" ".join(filter(None, (result, of.column.rpartition(".")[0]))) for result, _, of in mine]
        limits = sorted({limit for _, each, of in mine for limit in each.head.limits_of(of.column)})
        label = f"{output.meaning}, {output.unit}"
        if len(mine) > _CURVES_MOST:
            rows = [
                figures.Spread(own, *(each.value for each in of.quantiles if each.part in (0.05, 0.5, 0.95)))
                for own, (_, _, of) in zip(names, mine, strict=True)
            ]
            caption = f"{output.meaning}: median, and 5 to 95 % of the plants."
            found.append(still(figures.spreads(rows, limits, label), name, caption))
        else:
            curves = [figures.Curve(own, of.curve) for own, (_, _, of) in zip(names, mine, strict=True)]
            caption = f"{output.meaning}: part of the plants at or below a value."
            found.append(still(figures.distribution(curves, limits, label), name, caption))
    for _, each in shown:
        for of in each.figures:
            if of.sensitivity:
                caption = f"Sobol indices of {of.column}: what makes its variance."
                found.append(still(figures.sensitivity(of.sensitivity), f"sobol-{of.column}", caption))
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
