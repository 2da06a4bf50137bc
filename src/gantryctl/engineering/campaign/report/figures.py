"""Figures of populations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from gantryctl.engineering.campaign.statistics import CURVE, Sensitivity
from gantryctl.engineering.report.figures import legend_below
from gantryctl.engineering.report.svg import BLUE, ORANGE, WIDTH_IN, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Results differ by colour and by line: the page is printed in grey, too.
_LINES: Final = ("-", "--", "-.", ":")
_COLOURS: Final = (BLUE, ORANGE, "#00715a", "#7a3e9d")
_LIMIT: Final = "#b3261e"
# A limit beyond so many times the largest value is not drawn.
_FAR: Final = 1.5
# From here on values lie on a scale of powers of ten.
_WIDE: Final = 30.0


class Curve(NamedTuple):
    """Distribution of a figure over one population.

    Attributes:
        values: below which 0, 1, ... 100 % of the plants are.
    """

    name: str
    values: Sequence[float]


@styled
def distribution(curves: Sequence[Curve], limits: Sequence[float], label: str) -> Figure:
    """Part of the plants at or below a value: one curve for each population, limits as lines."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH_IN, 3.2), layout="constrained")
    axes = figure.subplots()
    for k, curve in enumerate(curves):
        colour, line = _COLOURS[k % len(_COLOURS)], _LINES[k // len(_COLOURS) % len(_LINES)]
        axes.plot(curve.values, [100.0 * part for part in CURVE], line, color=colour, label=curve.name)
    values = [value for curve in curves for value in curve.values]
    _draw_limits(axes, limits, max(values))
    _scale(axes, values)
    axes.set_xlabel(label)
    axes.set_ylabel("plants at or below, %")
    axes.set_ylim(0.0, 100.0)
    if len(curves) > 1:
        legend_below(figure, axes)
    return figure


class Spread(NamedTuple):
    """Figure of one population: its 5 %, 50 % and 95 % quantiles."""

    name: str
    low: float
    median: float
    high: float


@styled
def spreads(rows: Sequence[Spread], limits: Sequence[float], label: str) -> Figure:
    """Medians below each other, with the middle 90 % of the plants as bars."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH_IN, 0.9 + 0.24 * len(rows)), layout="constrained")
    axes = figure.subplots()
    place = np.arange(len(rows))
    axes.hlines(
        place, [row.low for row in rows], [row.high for row in rows], color=BLUE, linewidth=3.5, alpha=0.55
    )
    axes.plot([row.median for row in rows], place, "o", color=BLUE, markersize=5.0)
    values = [value for row in rows for value in (row.low, row.high)]
    _draw_limits(axes, limits, max(values))
    _scale(axes, values)
    axes.set_yticks(place, [row.name for row in rows])
    axes.invert_yaxis()
    axes.set_xlabel(f"{label}: median, and 5 .. 95 % of the plants")
    return figure


def _draw_limits(axes: Axes, limits: Sequence[float], largest: float) -> None:
    """Limits as lines; one that is far beyond the largest value is named at the edge, or nothing else would be seen."""
    for limit in (limit for limit in limits if limit <= _FAR * largest):
        axes.axvline(limit, color=_LIMIT, linewidth=0.9, linestyle=":")
        place = (limit, 1.0)
        axes.annotate(
            f"{limit:g}", place, xycoords=("data", "axes fraction"), color=_LIMIT, va="bottom", ha="center"
        )
    far = ", ".join(f"{limit:g}" for limit in limits if limit > _FAR * largest)
    if far:
        axes.annotate(
            f"{far} \N{RIGHTWARDS ARROW}",
            (1.0, 1.0),
            xycoords="axes fraction",
            # Above a limit that lies at the edge.
            xytext=(0.0, 9.0),
            textcoords="offset points",
            color=_LIMIT,
            va="bottom",
            ha="right",
        )


def _scale(axes: Axes, values: Sequence[float]) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    if min(values) > 0.0 and max(values) > _WIDE * min(values):
        axes.set_xscale("log")
        decades = max(values) / min(values)
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if decades < _WIDE**2 else (1.0,)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())


@styled
def sensitivity(indices: Sequence[Sensitivity]) -> Figure:
    """First-order and total Sobol indices of one figure, with their intervals."""
    from matplotlib.figure import Figure

    rows = sorted(indices, key=lambda each: each.total)
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
    legend_below(figure, axes)
    return figure
