"""A population as tables and sentences."""

from __future__ import annotations

from collections.abc import Sequence

from gantryctl.engineering.campaign.statistics import (
    LEVEL,
    PARTS,
    FigureStatistics,
    Population,
)
from gantryctl.engineering.report.text import TextTable
from gantryctl.units import behind


def tables(populations: Sequence[tuple[str, Population]]) -> list[TextTable]:
    """Quantiles, probabilities, sensitivity of one result, or of several, each with its name."""
    if len(populations) == 1:
        populations = [("", populations[0][1])]
    made = [_quantile_table(populations)]
    if any(figure.passing for _, found in populations for figure in found.figures):
        made.append(_passing_table(populations))
    return made + [
        _sensitivity_table(name, found, figure)
        for name, found in populations
        for figure in found.figures
        if figure.sensitivity
    ]


def _quantile_table(populations: Sequence[tuple[str, Population]]) -> TextTable:
    """Quantiles of every figure; the median with its interval."""
    rows = []
    for name, found in populations:
        for figure in found.figures:
            output = found.head.outputs[figure.column]
            values = [f"{each.value:.{output.digits}f}" for each in figure.quantiles]
            median = figure.quantiles[PARTS.index(0.5)]
            ends = ["-" if end is None else f"{end:.{output.digits}f}" for end in (median.low, median.high)]
            rows.append(
                (
                    *_places(name),
                    figure.column,
                    output.unit,
                    *values,
                    f"{ends[0]} .. {ends[1]}",
                    f"{figure.plants}",
                )
            )
    heads = tuple("median" if part == 0.5 else f"{100.0 * part:g} %" for part in PARTS)
    result = ("result",) if any(name for name, _ in populations) else ()
    return TextTable(
        "Quantiles",
        (*result, "figure", "", *heads, f"median, {100.0 * LEVEL:g} %", "plants"),
        tuple(rows),
        left=tuple(range(len(result) + 2)),
    )


def _passing_table(populations: Sequence[tuple[str, Population]]) -> TextTable:
    rows = []
    for name, found in populations:
        for figure in found.figures:
            unit = behind(found.head.outputs[figure.column].unit)
            rows += [
                (
                    *_places(name),
                    figure.column,
                    f"{each.limit:g}{unit}",
                    percent(each.probability),
                    f"{percent(each.low)} .. {percent(each.high)}",
                )
                for each in figure.passing
            ]
    result = ("result",) if any(name for name, _ in populations) else ()
    return TextTable(
        "Probability of keeping a limit",
        (*result, "figure", "limit", "probability", f"{100.0 * LEVEL:g} %"),
        tuple(rows),
        left=tuple(range(len(result) + 1)),
    )


def _sensitivity_table(name: str, found: Population, figure: FigureStatistics) -> TextTable:
    rows = tuple(
        (
            each.factor,
            f"{each.first:.3f}",
            f"{each.first_low:.3f} .. {each.first_high:.3f}",
            f"{each.total:.3f}",
            f"{each.total_low:.3f} .. {each.total_high:.3f}",
        )
        for each in sorted(figure.sensitivity, key=lambda each: -each.total)
    )
    interval = f"{100.0 * LEVEL:g} %"
    what = " ".join(filter(None, (figure.column, name)))
    return TextTable(
        f"Sobol indices of {what}, {found.base_points} base points",
        ("factor", "first order", interval, "total", interval),
        rows,
    )


def lines(found: Population) -> list[str]:
    """What a reader must know beside the figures."""
    head = found.head
    made = [
        f"{head.name}: {found.there} of {found.rows} rows, drawn by {head.design.sampling.replace('_', ' ')}"
    ]
    if found.refused:
        total = sum(found.refused.values())
        named = ", ".join(f"{name} ({count})" for name, count in found.refused.items())
        made.append(f"{total} rows have no figures and are left out: {named}")
    if head.design.sampling == "sensitivity" and found.part is None and found.base_points < head.design.size:
        why = "rows are missing" if found.there < found.rows else "rows were refused"
        more = (
            why if found.there < found.rows or found.refused else "more would change no digit that is shown"
        )
        made.append(
            f"Sobol indices by the first {found.base_points} of {head.design.size} base points: {more}"
        )
    if head.design.sampling in ("sobol", "latin_hypercube", "sensitivity"):
        made.append("intervals are those of independent plants; an even sample is closer than they say")
    if head.required:
        origins = ", ".join(dict.fromkeys(head.required.values()))
        made.append(f"limits of {', '.join(head.required)}: required by {origins}")
    return made


def percent(part: float) -> str:
    """A probability; never 0 or 100 % by rounding."""
    for digits in range(1, 7):
        shown = f"{100.0 * part:.{digits}f}"
        if part in (0.0, 1.0) or float(shown) not in (0.0, 100.0):
            return f"{shown} %"
    return f"{100.0 * part:.3g} %"


def _places(name: str) -> tuple[str, ...]:
    return (name,) if name else ()
