"""The report's figures as inline SVG: light, print-safe, readable without colour.

Everything drawn is text and vectors made of the report's own numbers. matplotlib is imported when a figure
is made.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from gantryctl.engineering.accuracy.paper import PAPER_A_DEG
from gantryctl.engineering.accuracy.report.report import (
    Beside,
    GearEnsemble,
    SpeedRun,
)
from gantryctl.engineering.accuracy.statistics import column_mean, column_std
from gantryctl.engineering.accuracy.table import Direction, ErrorTable
from gantryctl.engineering.report.figures import GREY, INK, RED, legend_below
from gantryctl.engineering.report.pictures import Panel, Picture, line
from gantryctl.engineering.report.svg import BLUE, ORANGE, new_figure, styled
from gantryctl.units import Dial

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# A third of the page is for one panel.
_SMALL_POINTS: Final = 700
COLOURS = {Direction.CCW: BLUE, Direction.CW: ORANGE}
MARKERS = {Direction.CCW: "o", Direction.CW: "s"}


@styled
def chord_errors(table: ErrorTable, beside: Beside | None, dial: Dial) -> Figure:
    """Chord errors by base, both directions, those of another table beside them. One panel per base."""
    figure, axes = _panels(len(table.bases_deg), height=2.7)
    for ax, base in zip(axes, table.bases_deg, strict=True):
        for direction in table.directions:
            _own_errors(ax, table, base, direction)
        if beside is not None:
            for direction in table.directions:
                _other_errors(ax, beside, base, direction)
        ax.set_title(f"base {dial.text(base)}°".replace("-", "−"))
        ax.set_xlabel("displacement, °")
        ax.set_xticks(table.displacements_deg)
        ax.axhline(0.0, color=INK, lw=0.7)
    axes[0].set_ylabel("chord error, 0.001°")
    _same_height(axes)
    legend_below(figure, axes[0])
    return figure


@styled
def bands(table: ErrorTable, beside: Beside | None) -> Figure:
    """X ± 3 S by displacement, ours and another table's if there is one, with the two lines whose distance is A."""
    shown = [("here", table)] if beside is None else [("here", table), beside]
    figure, axes = _panels(len(shown), height=2.5)
    for ax, (title, data) in zip(axes, shown, strict=True):
        mean, band = 1e3 * column_mean(data.errors_deg), 3e3 * column_std(data.errors_deg)
        x = np.array(data.displacements_deg)
        ax.fill_between(x, mean - band, mean + band, color=BLUE, alpha=0.13, lw=0)
        ax.plot(x, mean, color=BLUE, marker="o", ms=3.5, label="X")
        ax.plot(x, mean + band, color=BLUE, lw=0.8, ls=(0, (4, 2)), label="X ± 3 S")
        ax.plot(x, mean - band, color=BLUE, lw=0.8, ls=(0, (4, 2)))
        high, low = float((mean + band).max()), float((mean - band).min())
        for level in (high, low):
            ax.axhline(level, color=RED, lw=0.8)
        at = 0.04 * x[-1]
        ax.annotate("", (at, high), (at, low), arrowprops={"arrowstyle": "<->", "color": RED, "lw": 0.9})
        ax.set_title(f"{title}: A = {(high - low) / 1e3:.4f}°")
        ax.set_xlabel("displacement, °")
        ax.set_xticks(data.displacements_deg)
    axes[0].set_ylabel("error, 0.001°")
    _same_height(axes)
    legend_below(figure, axes[0])
    return figure


def speed_test(run: SpeedRun) -> Picture:
    """Speed and speed error of one move, motor side and load side."""
    curves = run.curves
    assert curves is not None
    time_s = curves.time_s
    sides = [("motor side", curves.motor_deg_s)]
    if curves.load_deg_s is not None:
        sides.append(("load side", curves.load_deg_s))
    speeds = (("reference", curves.ref_deg_s), *sides)
    return Picture(
        "speed test",
        (
            Panel(
                "time, s",
                "speed, deg/s",
                tuple(line(name, time_s, values) for name, values in speeds),
                followed=True,
            ),
            Panel(
                "time, s",
                "speed error, deg/s",
                tuple(line(name, time_s, values - curves.ref_deg_s) for name, values in sides),
                _limits(run),
            ),
        ),
        columns=1,
    )


def speed_errors(runs: Sequence[SpeedRun]) -> Picture:
    """Speed errors of all runs as small multiples: one row per direction, one column per speed."""
    shown = sorted((run for run in runs if run.curves is not None), key=_place)
    return Picture(
        "speed errors",
        tuple(_error_panel(run) for run in shown),
        columns=len({run.speed_deg_s for run in shown}),
    )


def _place(run: SpeedRun) -> tuple[int, float]:
    return list(Direction).index(run.direction), run.speed_deg_s


def _error_panel(run: SpeedRun) -> Panel:
    curves = run.curves
    assert curves is not None
    lines = [line("motor side", curves.time_s, curves.motor_error_deg_s, _SMALL_POINTS)]
    if curves.load_error_deg_s is not None:
        lines.append(line("load side", curves.time_s, curves.load_error_deg_s, _SMALL_POINTS))
    title = f"{run.speed_deg_s:g} deg/s {run.direction.value}"
    return Panel("time, s", "error, deg/s", tuple(lines), _limits(run), title)


def _limits(run: SpeedRun) -> tuple[float, float]:
    return -run.required.limit, run.required.limit


@styled
def ensemble(gears: GearEnsemble, fitted_a_deg: float | None, *, with_paper: bool) -> Figure:
    """A of gears with random phases on one line, with their median, the fitted gear, the paper."""
    figure = new_figure(1.35)
    ax = figure.subplots()
    a = 1e3 * np.sort(np.array(gears.a_deg))
    height = 0.12 * ((np.arange(a.size) % 3) - 1.0)
    ax.scatter(
        a, height, s=26, color=GREY, alpha=0.75, lw=0, label=f"{a.size} gears with random phases", zorder=3
    )
    ax.axvline(float(np.median(a)), color=INK, lw=1.2, label="their median")
    if fitted_a_deg is not None:
        ax.axvline(1e3 * fitted_a_deg, color=BLUE, lw=1.2, label="the fitted gear")
    if with_paper:
        ax.axvline(1e3 * PAPER_A_DEG, color=RED, lw=1.0, ls=(0, (4, 2)), label="paper")
    ax.set_ylim(-0.25, 0.25)
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    lines = [
        1e3 * value for value in (fitted_a_deg, PAPER_A_DEG if with_paper else None) if value is not None
    ]
    low, high = min([a[0], *lines]), max([a[-1], *lines])
    room = 0.06 * max(high - low, 1e-3 * high)
    ax.set_xlim(low - room, high + room)
    ax.set_xlabel("A, 0.001°")
    legend_below(figure, ax)
    return figure


def _panels(count: int, height: float) -> tuple[Figure, list[Axes]]:
    figure = new_figure(height)
    axes = figure.subplots(1, count, sharey=True, squeeze=False)
    return figure, list(axes[0])


def _own_errors(ax: Axes, table: ErrorTable, base: float, direction: Direction) -> None:
    errors = 1e3 * table.select([base], direction)
    if not len(errors):
        return
    colour, x = COLOURS[direction], np.array(table.displacements_deg)
    if len(errors) > 1:
        for run in errors:
            ax.plot(x, run, color=colour, lw=0.5, alpha=0.35)
    label = f"here, {direction.value}" + (f" (mean of {len(errors)})" if len(errors) > 1 else "")
    ax.plot(x, errors.mean(axis=0), color=colour, marker=MARKERS[direction], ms=4.0, label=label, zorder=3)


def _other_errors(ax: Axes, beside: Beside, base: float, direction: Direction) -> None:
    reference = beside.table.mean_of_runs()
    errors = 1e3 * reference.select([base], direction)
    if not len(errors):
        return
    colour, label = COLOURS[direction], f"{beside.name}, {direction.value}"
    (line,) = ax.plot(reference.displacements_deg, errors[0], color=colour, lw=0.9, alpha=0.65, label=label)
    line.set(
        linestyle=(0, (3, 2)), marker=MARKERS[direction], markersize=4.0, markerfacecolor="white", zorder=2
    )


def _same_height(axes: Sequence[Axes]) -> None:
    low, high = axes[0].get_ylim()
    reach = max(abs(low), abs(high), 1.0)
    axes[0].set_ylim(min(low, -0.3 * reach), max(high, 0.3 * reach))
