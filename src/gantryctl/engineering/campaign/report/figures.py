"""Figures of populations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from gantryctl.engineering.campaign.statistics import FigureStatistics, Population
from gantryctl.engineering.report.svg import BLUE, ORANGE, WIDTH_IN, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Results differ by colour and by line: the page is printed in grey, too.
_LINES: Final = ("-", "--", "-.", ":")
_COLOURS: Final = (BLUE, ORANGE, "#00715a", "#7a3e9d")
# Points of a curve; more are no use at this size.
_POINTS: Final = 400


@styled
def distribution(populations: Sequence[tuple[str, Population]], columns: Sequence[str], title: str) -> Figure:
    """Part of the plants at or below a value: one curve for each result and column, limits as lines."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH_IN, 3.2), layout="constrained")
    axes = figure.subplots()
    curves = [
        (name, column, found) for name, found in populations for column in columns if column in found.values
    ]
    for k, (name, column, found) in enumerate(curves):
        ordered = np.sort(found.values[column])
        rank = np.unique(np.linspace(0, len(ordered) - 1, _POINTS).round().astype(int))
        label = " ".join(part for part in (name, column.rpartition(".")[0]) if part)
        colour, line = _COLOURS[k % len(_COLOURS)], _LINES[k // len(_COLOURS) % len(_LINES)]
        axes.plot(
            ordered[rank],
            100.0 * (rank + 1) / len(ordered),
            line,
            color=colour,
            label=label,
            drawstyle="steps-post",
        )
    limits = sorted({limit for _, column, found in curves for limit in found.head.limits_of(column)})
    for limit in limits:
        axes.axvline(limit, color="#b3261e", linewidth=0.9, linestyle=":")
        axes.annotate(
            f"{limit:g}", (limit, 1.0), xycoords=("data", "axes fraction"), color="#b3261e", va="bottom"
        )
    _, column, found = curves[0]
    values = np.concatenate([found.values[column] for _, column, found in curves])
    if float(values.min()) > 0.0 and float(values.max()) > 30.0 * float(values.min()):
        axes.set_xscale("log")
    axes.set_xlabel(f"{title}, {found.head.outputs[column].unit}")
    axes.set_ylabel("plants at or below, %")
    axes.set_ylim(0.0, 100.0)
    if len(curves) > 1:
        axes.legend(loc="lower right")
    return figure


@styled
def sensitivity(figure_of: FigureStatistics) -> Figure:
    """First-order and total Sobol indices of one figure, with their intervals."""
    from matplotlib.figure import Figure

    rows = sorted(figure_of.sensitivity, key=lambda each: each.total)
    figure = Figure(figsize=(WIDTH_IN, 0.9 + 0.34 * len(rows)), layout="constrained")
    axes = figure.subplots()
    place = np.arange(len(rows))
    for shift, colour, name, of in (
        (0.18, BLUE, "total", [(r.total, r.total_low, r.total_high) for r in rows]),
        (-0.18, ORANGE, "first order", [(r.first, r.first_low, r.first_high) for r in rows]),
    ):
        value, low, high = np.array(of).T
        axes.barh(place + shift, value, 0.34, color=colour, label=name)
        axes.hlines(place + shift, low, high, color="#20242b", linewidth=1.0)
    axes.set_yticks(place, [row.factor for row in rows])
    axes.set_xlabel("part of the variance")
    axes.legend(loc="lower right")
    return figure
