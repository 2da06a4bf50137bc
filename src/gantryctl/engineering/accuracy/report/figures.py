"""The report's figures as inline SVG: light, print-safe, readable without colour.

Everything drawn is text and vectors made of the report's own numbers. matplotlib is imported when a figure
is made.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gantryctl.engineering.accuracy.paper import PAPER_A_DEG
from gantryctl.engineering.accuracy.report.report import (
    SPEED_ERROR_LIMIT_DEG_S,
    Beside,
    FloatArray,
    GearEnsemble,
    SpeedRun,
)
from gantryctl.engineering.accuracy.statistics import column_mean, column_std
from gantryctl.engineering.accuracy.table import Direction, ErrorTable
from gantryctl.engineering.report.figures import GREY, INK, RED
from gantryctl.engineering.report.svg import BLUE, ORANGE, WIDTH_IN, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Points of one curve; longer ones keep the smallest and largest value of every bin.
MAX_POINTS = 1500
COLOURS = {Direction.CCW: BLUE, Direction.CW: ORANGE}
MARKERS = {Direction.CCW: "o", Direction.CW: "s"}


@styled
def chord_errors(table: ErrorTable, beside: Beside) -> Figure:
    """Figure 6: chord errors by base, both directions, those of another table beside them. One panel per base."""
    figure, axes = _panels(len(table.bases_deg), height=2.7)
    for ax, base in zip(axes, table.bases_deg, strict=True):
        for direction in table.directions:
            _own_errors(ax, table, base, direction)
        for direction in table.directions:
            _other_errors(ax, beside, base, direction)
        ax.set_title(f"base {base:g}°".replace("-", "−"))
        ax.set_xlabel("displacement, °")
        ax.set_xticks(table.displacements_deg)
        ax.axhline(0.0, color=INK, lw=0.7)
    axes[0].set_ylabel("chord error, 0.001°")
    _same_height(axes)
    _legend_below(figure, axes[0])
    return figure


@styled
def bands(table: ErrorTable, beside: Beside) -> Figure:
    """X ± 3 S by displacement, ours and another table's, with the two lines whose distance is A."""
    figure, axes = _panels(2, height=2.5)
    for ax, data, title in ((axes[0], table, "here"), (axes[1], beside.table, beside.name)):
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
    _legend_below(figure, axes[0])
    return figure


@styled
def speed_test(run: SpeedRun) -> Figure:
    """Figure 5: speed and speed error of one move, motor side and load side."""
    curves = run.curves
    assert curves is not None
    figure = _figure(3.6)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[1.0, 1.15])
    both = ((curves.load_deg_s, ORANGE, "load side"), (curves.motor_deg_s, BLUE, "motor side"))
    sides = [(values, colour, name) for values, colour, name in both if values is not None]
    for values, colour, name in sides:
        top.plot(*_thinned(curves.time_s, values), color=colour, label=name)
    top.plot(*_thinned(curves.time_s, curves.ref_deg_s), color=INK, lw=0.9, ls=(0, (5, 3)), label="reference")
    for values, colour, name in sides:
        bottom.plot(*_thinned(curves.time_s, values - curves.ref_deg_s), color=colour, lw=0.8, label=name)
    _limit_lines(bottom)
    top.set_ylabel("speed, °/s")
    bottom.set_ylabel("speed error, °/s")
    bottom.set_xlabel("time, s")
    bottom.set_xlim(curves.time_s[0], curves.time_s[-1])
    top.plot([], [], color=RED, lw=0.8, ls=(0, (4, 2)), label="±0.01°/s, motor side")
    _legend_below(figure, top)
    return figure


@styled
def speed_errors(runs: Sequence[SpeedRun]) -> Figure:
    """Speed errors of all runs as small multiples: one row per direction, one column per speed."""
    shown = [run for run in runs if run.curves is not None]
    speeds = sorted({run.speed_deg_s for run in shown})
    ways = [way for way in Direction if any(run.direction is way for run in shown)]
    figure = _figure(0.5 + 1.35 * len(ways))
    grid = figure.subplots(len(ways), len(speeds), sharey=True, squeeze=False)
    for run in shown:
        assert run.curves is not None
        ax = grid[ways.index(run.direction), speeds.index(run.speed_deg_s)]
        curves = run.curves
        if curves.load_error_deg_s is not None:
            ax.plot(
                *_thinned(curves.time_s, curves.load_error_deg_s, 600),
                color=ORANGE,
                lw=0.7,
                label="load side",
            )
        ax.plot(
            *_thinned(curves.time_s, curves.motor_error_deg_s, 600), color=BLUE, lw=0.7, label="motor side"
        )
        _limit_lines(ax)
        ax.set_title(f"{run.speed_deg_s:g}°/s {run.direction.value}")
        ax.set_xlim(curves.time_s[0], curves.time_s[-1])
    for ax in grid[:, 0]:
        ax.set_ylabel("error, °/s")
    for ax in grid[-1]:
        ax.set_xlabel("time, s")
    _legend_below(figure, grid[0, 0])
    return figure


@styled
def ensemble(gears: GearEnsemble, fitted_a_deg: float | None) -> Figure:
    """A of gears with random phases on one line, with their median, the fitted gear, the paper."""
    figure = _figure(1.35)
    ax = figure.subplots()
    a = 1e3 * np.sort(np.array(gears.a_deg))
    height = 0.12 * ((np.arange(a.size) % 3) - 1.0)
    ax.scatter(
        a, height, s=26, color=GREY, alpha=0.75, lw=0, label=f"{a.size} gears with random phases", zorder=3
    )
    ax.axvline(float(np.median(a)), color=INK, lw=1.2, label="their median")
    if fitted_a_deg is not None:
        ax.axvline(1e3 * fitted_a_deg, color=BLUE, lw=1.2, label="the fitted gear")
    ax.axvline(1e3 * PAPER_A_DEG, color=RED, lw=1.0, ls=(0, (4, 2)), label="paper")
    ax.set_ylim(-0.4, 0.4)
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    ax.set_xlim(left=0.0, right=1.12 * max(a[-1], 1e3 * PAPER_A_DEG))
    ax.set_xlabel("A, 0.001°")
    _legend_below(figure, ax)
    return figure


def _figure(height_in: float) -> Figure:
    from matplotlib.figure import Figure as NewFigure

    return NewFigure(figsize=(WIDTH_IN, height_in), layout="constrained")


def _panels(count: int, height: float) -> tuple[Figure, list[Axes]]:
    figure = _figure(height)
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


def _limit_lines(ax: Axes) -> None:
    for level in (-SPEED_ERROR_LIMIT_DEG_S, SPEED_ERROR_LIMIT_DEG_S):
        ax.axhline(level, color=RED, lw=0.7, ls=(0, (4, 2)))


def _same_height(axes: Sequence[Axes]) -> None:
    low, high = axes[0].get_ylim()
    reach = max(abs(low), abs(high), 1.0)
    axes[0].set_ylim(min(low, -0.3 * reach), max(high, 0.3 * reach))


def _legend_below(figure: Figure, ax: Axes) -> None:
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), handlelength=2.4)


def _thinned(x: FloatArray, y: FloatArray, points: int = MAX_POINTS) -> tuple[FloatArray, FloatArray]:
    """At most `points` of a curve, keeping the smallest and the largest value of every bin in their order."""
    if len(x) <= points:
        return x, y
    # Plain thinning would drop the peaks, and the peaks are what the speed test judges.
    bins = np.array_split(np.arange(len(x)), points // 2)
    keep = np.unique([index for part in bins for index in (part[y[part].argmin()], part[y[part].argmax()])])
    keep = np.union1d(keep, [0, len(x) - 1])
    return x[keep], y[keep]
