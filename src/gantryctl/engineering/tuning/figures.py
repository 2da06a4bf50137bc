"""Figures of a tuning: the trials, the steps before and after, damping over stiffness."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Final

from gantryctl.engineering.analysis.figures import draw_damping
from gantryctl.engineering.analysis.models.robust import running_damping, sketch_damping
from gantryctl.engineering.report.figures import INK, RED, legend_below
from gantryctl.engineering.report.pictures import Panel, Picture, line
from gantryctl.engineering.report.svg import BLUE, new_figure, styled
from gantryctl.engineering.tuning.gains import machine_with, settings_with
from gantryctl.engineering.tuning.procedure import PHASES, Trial, Tuned
from gantryctl.engineering.tuning.result import Candidate, Tuning

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# A third of the page is for one panel.
_POINTS: Final = 700
# The swing of a step has died out.
_STEP_S: Final = 2.0


@styled
def trials(tuned: Tuned) -> Figure:
    """What every trial measured, phase by phase."""
    figure = new_figure(2.2 * 2 + 0.3)
    grid = figure.subplots(2, 3)
    for axis, phase in zip(grid.flat, PHASES, strict=False):
        _phase(axis, tuned.phase(phase))
    for axis in grid.flat[len(PHASES) :]:
        axis.set_axis_off()
    legend_below(figure, *grid.flat[: len(PHASES)])
    return figure


def _phase(axis: Axes, log: list[Trial]) -> None:
    first = log[0]
    kept, stopped = [t for t in log if t.kept], [t for t in log if not t.kept]
    for trials, marker, colour, size, label in (
        (kept, "o", BLUE, 4, "kept"),
        (stopped, "x", RED, 6, "too much"),
    ):
        if trials:
            values, measured = [t.value for t in trials], [t.measured for t in trials]
            axis.plot(values, measured, marker, color=colour, markersize=size, label=label)
    axis.axhline(first.limit, color=INK, linewidth=0.8, linestyle="--")
    if first.phase != "Kvf":
        axis.set_xscale("log")
        ends = [first.value, math.sqrt(first.value * kept[-1].value), kept[-1].value]
        axis.set_xticks(ends, [f"{value:.2g}" for value in ends])
        axis.set_xticks([], minor=True)
    if first.phase == "Tvi":
        axis.invert_xaxis()
    axis.set(
        title=f"{first.phase} = {kept[-1].value:.4g} {first.unit}", xlabel=f"{first.phase}, {first.unit}"
    )
    axis.set_ylabel(first.measured_unit)


def steps(tuning: Tuning) -> Picture:
    """Speed step, position step at motor and load."""
    speed, motor, load = [], [], []
    for candidate in tuning.candidates:
        fast, slow = (
            tuning.bench.speed_step(candidate.gains),
            tuning.bench.position_step(candidate.gains),
        )
        shown = slow.time_s <= _STEP_S
        speed.append(line(candidate.name, 1e3 * fast.time_s, fast.response, _POINTS))
        motor.append(line(candidate.name, slow.time_s[shown], slow.motor[shown], _POINTS))
        load.append(line(candidate.name, slow.time_s[shown], slow.load[shown], _POINTS))
    return Picture(
        "Motor speed behind a step of its command; motor and load angle behind a small step of the set-point. 1 = the "
        "step.",
        (
            Panel("time, ms", "motor speed", tuple(speed)),
            Panel("time, s", "motor angle", tuple(motor)),
            Panel("time, s", "load angle", tuple(load)),
        ),
    )


@styled
def damping(tuning: Tuning) -> Figure:
    """Damping that the loop leaves the load, over the stiffness: sketch above, full plant below."""
    shown = tuning.candidates
    figure = new_figure(5.0)
    grid = figure.subplots(2, len(shown), sharex=True, sharey="row", squeeze=False)
    for column, candidate in enumerate(shown):
        for row, running in enumerate((False, True)):
            axis = grid[row, column]
            draw_damping(axis, tuning.bench.linear_machine, _model(tuning, candidate, running))
            axis.set_title(f"{candidate.name}: {'as it runs' if running else 'two masses'}")
        grid[1, column].set_xlabel("stiffness, N m/rad")
    for row in (0, 1):
        grid[row, 0].set_ylabel("damping of the load, %")
    legend_below(figure, grid[0, 0])
    return figure


def _model(
    tuning: Tuning, candidate: Candidate, running: bool
) -> Callable[[float], Callable[[float], float]]:
    machine = tuning.bench.linear_machine
    if running:
        return partial(running_damping, machine, settings=settings_with(machine, candidate.gains))
    return partial(sketch_damping, machine_with(machine, candidate.gains))
