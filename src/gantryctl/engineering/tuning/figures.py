"""Figures of a tuning: the trials, the steps before and after, damping over stiffness."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from gantryctl.engineering.analysis.figures import draw_damping
from gantryctl.engineering.analysis.models.robust import (
    DAMPINGS,
    STIFFNESS_NM_PER_RAD,
    running_damping,
    sketch_damping,
)
from gantryctl.engineering.report.figures import BLUE, GREEN, GREY, INK, ORANGE, RED, png_figure
from gantryctl.engineering.tuning.gains import machine_with, settings_with
from gantryctl.engineering.tuning.procedure import PHASES, Trial, Tuned
from gantryctl.engineering.tuning.result import Candidate, Tuning

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS: Final = {"configured": GREY, "proposal": BLUE, "paper": ORANGE}
_DAMPING_COLOURS: Final = dict(zip(DAMPINGS, (RED, ORANGE, GREEN), strict=True))
_LOW, _HIGH, _POINTS = 1e8, 4e9, 90


def tuning_figures(tuning: Tuning, folder: Path) -> list[Path]:
    """All of them."""
    made = [steps(tuning, folder), damping(tuning, folder)]
    return [trials(tuning.tuned, folder), *made] if tuning.tuned else made


def trials(tuned: Tuned, folder: Path) -> Path:
    """What every trial measured, phase by phase."""
    path = folder / "trials.png"
    with png_figure(
        path, "The paper's procedure, trial by trial", 1, len(PHASES), figsize=(13.0, 3.4)
    ) as all_axes:
        for axis, phase in zip(all_axes, PHASES, strict=True):
            _phase(axis, tuned.phase(phase))
    return path


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
    axis.legend(loc="best")


def steps(tuning: Tuning, folder: Path) -> Path:
    """Speed step, position step at motor and load."""
    path = folder / "steps.png"
    with png_figure(path, "Steps before and after", 1, 3, figsize=(12.0, 3.6)) as (speed, motor, load):
        for candidate in tuning.candidates:
            _steps_of(tuning, candidate, speed, motor, load)
        speed.set(
            title="motor speed behind a step of its command", xlabel="time in ms", ylabel="1 = the step"
        )
        motor.set(title="motor angle behind a small step", xlabel="time in s", xlim=(0.0, 2.0))
        load.set(title="load angle behind the same step", xlabel="time in s", xlim=(0.0, 2.0))
        for axis in (speed, motor, load):
            axis.axhline(1.0, color=INK, linewidth=0.8, linestyle=":")
        speed.legend(loc="lower right")
    return path


def _steps_of(tuning: Tuning, candidate: Candidate, speed: Axes, motor: Axes, load: Axes) -> None:
    colour = _COLOURS[candidate.name]
    fast, slow = tuning.bench.speed_step(candidate.gains), tuning.bench.position_step(candidate.gains)
    speed.plot(1e3 * fast.time_s, fast.response, color=colour, label=candidate.name)
    motor.plot(slow.time_s, slow.motor, color=colour)
    load.plot(slow.time_s, slow.load, color=colour)


def damping(tuning: Tuning, folder: Path) -> Path:
    """Damping that the loop leaves the load, over the stiffness."""
    path = folder / "damping.png"
    k = np.geomspace(_LOW, _HIGH, _POINTS)
    shown = tuning.candidates
    title = "Damping that the loop leaves the load"
    with png_figure(path, title, 2, len(shown), figsize=(4.6 * len(shown), 6.4), sharex=True) as grid:
        for column, candidate in enumerate(shown):
            for row, running in enumerate((False, True)):
                axis = grid[row][column]
                draw_damping(axis, k, _model(tuning, candidate, running), _DAMPING_COLOURS)
                axis.axhline(0.0, color=INK, linewidth=0.8)
                axis.axvspan(*STIFFNESS_NM_PER_RAD, color=GREY, alpha=0.12, linewidth=0.0)
                axis.set_ylim(-1.0, 4.0)
                name = "full plant, as it runs" if running else "two masses, continuous"
                axis.set_title(f"{candidate.name}: {name}")
            grid[1][column].set_xlabel("stiffness in N m/rad")
        for row in (0, 1):
            grid[row][0].set_ylabel("damping of the load in %")
        grid[0][0].legend(loc="upper left")
    return path


def _model(
    tuning: Tuning, candidate: Candidate, running: bool
) -> Callable[[float], Callable[[float], float]]:
    machine = tuning.bench.linear_machine
    if running:
        return partial(running_damping, machine, settings=settings_with(machine, candidate.gains))
    return partial(sketch_damping, machine_with(machine, candidate.gains))
