"""Figures of an analysis: Bode, Nyquist, closed loops, time responses, damping, measured frequency responses."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from gantryctl.engineering.analysis.measured.response import MeasuredResponse
from gantryctl.engineering.analysis.models.linear import MINUS_3_DB, ComplexArray, FloatArray
from gantryctl.engineering.analysis.models.mechanics import LOAD, MOTOR, PlantKind
from gantryctl.engineering.analysis.models.paper_loop import rigid_loop
from gantryctl.engineering.analysis.models.responses import SetPointStep, TimeResponse, time_response
from gantryctl.engineering.analysis.models.robust import (
    DAMPINGS,
    SEARCHED_PARTS,
    STIFFNESS_PARTS,
    running_damping,
    sketch_damping,
    stiffness_range,
)
from gantryctl.engineering.analysis.models.sampled import Cut
from gantryctl.engineering.analysis.study import Study, grid_of
from gantryctl.engineering.analysis.text import study_name
from gantryctl.engineering.report.figures import BLUE, GREEN, GREY, INK, ORANGE, RED, legend_below, png_figure
from gantryctl.machine import Machine
from gantryctl.units import deg, rad

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CUTS: Final = (
    (Cut.TORQUE, BLUE, "cut at the torque (both loops)"),
    (Cut.SPEED_COMMAND, ORANGE, "cut at the speed command (position loop)"),
    (Cut.SPEED_ERROR, GREEN, "cut at the speed error (speed loop alone)"),
)
_DAMPING_COLOURS: Final = dict(zip(DAMPINGS, (RED, ORANGE, BLUE), strict=True))
_DAMPING_POINTS: Final = 120
_LOWEST_HZ: Final = 0.1
_LOWEST_DB: Final = -60.0
_QUARTER_DEG: Final = 90.0
# The window around -1 and the unit circle; half its height is a quarter of a wide one's width, so that labels fit.
_NYQUIST_RIGHT: Final = 1.4
_NYQUIST_HALF: Final = 1.5
_NYQUIST_SHAPE: Final = 0.25
# A crossing of the real axis further out lies outside the window, where the unit circle would be a dot otherwise: at
# this one it still has two fifths of the height.
_NYQUIST_LEFT: Final = -8.0
STEP_DEG: Final = 0.01
_SWING_S: Final = 4.0
_SHORT_S: Final = 0.5


def frequency_plots(study: Study, folder: Path) -> list[Path]:
    """All of them: bode.png, nyquist.png, closed_loops.png."""
    return [bode(study, folder), nyquist(study, folder), closed_loops(study, folder)]


def bode(study: Study, folder: Path) -> Path:
    """Magnitude and phase at the three cuts, with crossovers and phase margins."""
    from matplotlib.ticker import MultipleLocator

    path = folder / "bode.png"
    with png_figure(path, f"Open loops as they run: {study_name(study)}", 2, 1, sharex=True) as (top, bottom):
        for cut, colour, label in CUTS:
            _bode_curve(top, bottom, study, cut, colour, label)
        top.axhline(0.0, color=INK, linewidth=0.8)
        bottom.axhline(-180.0, color=INK, linewidth=0.8)
        _mark_modes(study, top, bottom)
        top.set(ylabel="|L| in dB")
        bottom.set(ylabel="phase of L in deg", xlabel="frequency in Hz")
        bottom.yaxis.set_major_locator(MultipleLocator(_QUARTER_DEG))
        bottom.set_xlim(_LOWEST_HZ, 0.5 / study.settings.cycle_s)
        legend_below(top.figure, top)
    return path


def _bode_curve(top: Axes, bottom: Axes, study: Study, cut: Cut, colour: str, label: str) -> None:
    hz, response = _open_loop(study, cut)
    # torque and speed error differ at low frequencies only: the wide pale line lies under the thin one
    wide: dict[str, Any] = {"linewidth": 4.0, "alpha": 0.45, "zorder": 1.5} if cut is Cut.SPEED_ERROR else {}
    phase = np.degrees(np.unwrap(np.angle(response)))
    figures = study.at(cut).phase
    if figures is None:
        phase -= 360.0 * np.round((np.interp(1.0, hz, phase) + 90.0) / 360.0)
    else:
        at = figures.crossover_rad_s / (2.0 * math.pi)
        there = figures.margin_deg - 180.0
        # Unwrapped phase is known up to whole turns: the curve is moved to the margin that is stated.
        phase -= 360.0 * np.round((np.interp(at, hz, phase) - there) / 360.0)
        top.plot([at], [0.0], "o", color=colour, markersize=5)
        bottom.plot([at, at], [-180.0, there], color=colour, linewidth=2.4, alpha=0.6)
        bottom.plot([at], [there], "o", color=colour, markersize=5)
        words: dict[str, Any] = {
            "xytext": (6, -12 if cut is Cut.SPEED_ERROR else 5),
            "textcoords": "offset points",
        }
        bottom.annotate(f"{figures.margin_deg:.0f}°", (at, there), color=colour, fontweight="bold", **words)
    seen = hz >= _LOWEST_HZ
    top.semilogx(hz[seen], _db(response[seen]), color=colour, label=label, **wide)
    bottom.semilogx(hz[seen], phase[seen], color=colour, **wide)


def nyquist(study: Study, folder: Path) -> Path:
    """The curves around -1: distance to it is 1/sensitivity; the crossing beyond it is the conditional stability."""
    path = folder / "nyquist.png"
    titles = ("torque", "speed command", "speed error")
    with png_figure(path, f"Nyquist: {study_name(study)}", 1, 3, figsize=(11.0, 4.5)) as axes:
        for axis, (cut, colour, _), title in zip(axes, CUTS, titles, strict=True):
            _, response = _open_loop(study, cut)
            figures = study.at(cut)
            _unit_circle(axis, figures.sensitivity.value)
            peak = figures.sensitivity.value
            words = f"cut at the {title}\nstays {1.0 / peak:.2f} away from −1: sensitivity {peak:.2f}"
            # The circle of the sensitivity lies around -1.
            left = min(-1.6, -1.05 - 1.0 / peak)
            if figures.gain_down is not None:
                crossing = -1.0 / figures.gain_down
                seen = 1.2 * crossing >= _NYQUIST_LEFT
                words += f"\nunstable below {figures.gain_down:.2f} of the gain "
                words += "(square)" if seen else f"(crossing at {crossing:.0f})".replace("-", "−")
                if seen:
                    left = min(left, 1.2 * crossing)
                    axis.plot([crossing], [0.0], "s", color=RED, markersize=5)
            axis.set_title(words, fontweight="normal", fontsize=8.5)
            # Conditional stability crosses the axis left of -1: the window reaches there, and its height with it.
            # The curve comes from infinity.
            half = max(_NYQUIST_HALF, (_NYQUIST_RIGHT - left) * _NYQUIST_SHAPE)
            within = (response.real >= left) & (response.real <= _NYQUIST_RIGHT)
            inside = within & (np.abs(response.imag) <= half)
            shown = np.where(inside, response, complex(math.nan, math.nan))
            axis.plot(shown.real, shown.imag, color=colour)
            axis.plot(shown.real, -shown.imag, color=colour, linewidth=0.7, alpha=0.5)
            axis.set(xlim=(left, _NYQUIST_RIGHT), ylim=(-half, half), aspect="equal")
            axis.set_xlabel("real part of L")
        axes[0].set_ylabel("imaginary part of L")
    return path


def _unit_circle(axis: Axes, sensitivity: float) -> None:
    around = np.linspace(0.0, 2.0 * math.pi, 200)
    radius = 1.0 / sensitivity
    axis.plot(np.cos(around), np.sin(around), color=GREY, linewidth=0.8, linestyle=":")
    axis.plot(
        -1.0 + radius * np.cos(around), radius * np.sin(around), color=RED, linewidth=0.8, linestyle="--"
    )
    axis.plot([-1.0], [0.0], "+", color=RED, markersize=11, markeredgewidth=2)


def closed_loops(study: Study, folder: Path) -> Path:
    """Set-point to motor and to load, with and without feed-forward, and the speed loop."""
    path = folder / "closed_loops.png"
    loop, grid = study.loop, grid_of(study.loop)
    hz, highest_hz = grid / (2.0 * math.pi), 0.5 / study.settings.scan_s
    following, without = loop.following(grid), loop.following(grid, kvf=0.0)
    curves: Sequence[tuple[str, ComplexArray, str, str]] = (
        ("set-point to load", following[LOAD], RED, "-"),
        (f"set-point to motor, Kvf = {study.settings.kvf:g}", following[MOTOR], BLUE, "-"),
        ("set-point to motor, Kvf = 0", without[MOTOR], BLUE, "--"),
        ("speed command to motor speed", loop.speed_loop(grid), GREEN, "-"),
    )
    with png_figure(path, f"Closed loops as they run: {study_name(study)}", 1, 1, figsize=(8.6, 4.2)) as axis:
        for label, response, colour, line in curves:
            level = _db(response)
            # Below, nothing of the set-point is left that anybody could measure.
            seen = (hz >= _LOWEST_HZ) & (hz <= highest_hz) & (level >= _LOWEST_DB)
            axis.semilogx(hz[seen], level[seen], color=colour, linestyle=line, label=label)
        axis.axhline(20.0 * math.log10(MINUS_3_DB), color=INK, linewidth=0.8, linestyle=":")
        beside = axis.get_yaxis_transform()
        axis.text(1.005, 20.0 * math.log10(MINUS_3_DB), "−3 dB", transform=beside, fontsize=8, va="center")
        _mark_modes(study, axis)
        axis.set_xlim(_LOWEST_HZ, highest_hz)
        axis.set(xlabel="frequency in Hz", ylabel="magnitude in dB")
        legend_below(axis.figure, axis)
    return path


def _open_loop(study: Study, cut: Cut) -> tuple[FloatArray, ComplexArray]:
    grid = grid_of(study.loop, cut)
    return grid / (2.0 * math.pi), study.loop.open_loop(cut, grid)


def _mark_modes(study: Study, *axes: Axes) -> None:
    """Thin vertical lines at the motor-held modes, named above the first axis: words inside lie over a curve."""
    # Away from one another, however near the modes are.
    sides = ("right", "left") if len(study.modes) > 1 else ("center",)
    for mode, side in zip(study.modes, sides, strict=False):
        for axis in axes:
            axis.axvline(mode.held.hz, color=GREY, linewidth=0.8, linestyle=":")
        axes[0].text(
            mode.held.hz,
            1.01,
            f" {mode.name}, {mode.held.hz:.2f} Hz ",
            transform=axes[0].get_xaxis_transform(),
            fontsize=7.5,
            color=INK,
            va="bottom",
            ha=side,
        )


def time_responses(study: Study, folder: Path) -> Path:
    """Errors at motor and load behind a step of angle, speed and acceleration, with eq. (5) beside a rigid plant."""
    path = folder / "responses.png"
    machine = study.machine
    acc_deg_s2 = machine.virtual_axis.acc_deg_s2
    sizes = {
        SetPointStep.STEP: rad(STEP_DEG),
        SetPointStep.RAMP: rad(machine.speed.setting_min_deg_s),
        SetPointStep.PARABOLA: rad(acc_deg_s2),
    }
    duration = _SHORT_S if study.kind is PlantKind.RIGID else _SWING_S
    titles = {
        SetPointStep.STEP: f"angle jumps by {STEP_DEG:g} deg (no set-point speed)",
        SetPointStep.RAMP: f"speed jumps to {machine.speed.setting_min_deg_s:g} deg/s, the lowest setting",
        SetPointStep.PARABOLA: f"acceleration jumps to {acc_deg_s2:.3g} deg/s2: a profile's corner",
    }
    with png_figure(path, f"Following error: {study_name(study)}", 3, 1, figsize=(8.6, 7.4)) as axes:
        for axis, reference in zip(axes, SetPointStep, strict=True):
            response = time_response(study.loop, reference, sizes[reference], duration)
            time = response.time_s
            axis.plot(time, 1e3 * deg(1.0) * response.pos_err_load_rad, color=ORANGE, label="load")
            axis.plot(
                time, 1e3 * deg(1.0) * response.pos_err_motor_rad, color=BLUE, label="motor, as measured"
            )
            if study.kind is PlantKind.RIGID:
                _equation_5(axis, machine, response)
            axis.axhline(0.0, color=INK, linewidth=0.7)
            axis.set_title(titles[reference])
            axis.set(ylabel="error in mdeg", xlim=(0.0, duration))
        axes[-1].set_xlabel("time in s")
        legend_below(axes[0].figure, axes[0])
    return path


def _equation_5(axis: Axes, machine: Machine, response: TimeResponse) -> None:
    """The continuous rigid loop of the paper under the same reference."""
    times = response.time_s[1::5].tolist()
    size = response.size
    if response.reference is SetPointStep.STEP:
        values = size * (1.0 - rigid_loop(machine, kvf=0.0).step(times))
    elif response.reference is SetPointStep.RAMP:
        values = rigid_loop(machine).error_behind(1, size, times)
    else:
        values = rigid_loop(machine).error_behind(2, size, times)
    axis.plot(times, 1e3 * deg(1.0) * values, color=GREY, linestyle="--", label="rigid loop")


def damping_over_stiffness(machine: Machine, folder: Path) -> Path:
    """Damping of the load mode over the uncertain stiffness, for three structural dampings; unstable below 0."""
    path = folder / "damping.png"
    models = {
        "two masses, continuous (the sketch)": partial(sketch_damping, machine),
        "full plant with base, as it runs": partial(running_damping, machine),
    }
    title = f"Damping that the loop leaves the load: {machine.name}, configured gains"
    with png_figure(path, title, 1, 2, figsize=(9.6, 4.2), sharey=True) as axes:
        for axis, (name, model) in zip(axes, models.items(), strict=True):
            draw_damping(axis, machine, model)
            axis.set_title(name)
            axis.set_xlabel("stiffness at the load in N m/rad")
        axes[0].set_ylabel("damping of the load mode in %\n(below 0 the swing grows)")
        legend_below(axes[1].figure, axes[1])
    return path


def draw_damping(axis: Axes, machine: Machine, model: Callable[[float], Callable[[float], float]]) -> None:
    """Curves of damping over stiffness by structural damping, filled where the swing grows; the uncertain stiffness."""
    from matplotlib.ticker import LogFormatterSciNotation, LogLocator, NullFormatter

    low, high = stiffness_range(machine, SEARCHED_PARTS)
    stiffness = np.geomspace(low, high, _DAMPING_POINTS)
    for zeta, colour in _DAMPING_COLOURS.items():
        damping = model(zeta)
        percent = 100.0 * np.array([damping(float(k)) for k in stiffness])
        axis.semilogx(stiffness, percent, color=colour, label=f"{100.0 * zeta:g} % structural")
        grows: Any = percent < 0.0
        axis.fill_between(stiffness, percent, 0.0, where=grows, color=colour, alpha=0.25, linewidth=0.0)
    axis.axhline(0.0, color=INK, linewidth=0.8)
    uncertain = stiffness_range(machine, STIFFNESS_PARTS)
    axis.axvspan(*uncertain, color=GREY, alpha=0.13, linewidth=0.0, label="uncertain stiffness")
    axis.set_xlim(low, high)
    # Two labels a decade, whatever the decade: with more they lie over one another in half a page's width.
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
    axis.xaxis.set_major_formatter(LogFormatterSciNotation(minor_thresholds=(10.0, 10.0)))
    axis.xaxis.set_minor_formatter(NullFormatter())


def measured_response(results: Sequence[MeasuredResponse], folder: Path) -> Path:
    """The plant and the position loop, measured (dots) and of the linear model (lines), one column a condition."""
    path = folder / "measured.png"
    count = len(results)
    title = (
        "Frequency response measured on the running axis (dots) and the linear model (lines)\n"
        "hollow: noise, gear error or resolution; shaded: more than 3 dB or 20 deg apart"
    )
    options: dict[str, Any] = {"sharex": True, "sharey": "row", "squeeze": False}
    with png_figure(path, title, 3, count, figsize=(3.9 * count, 8.4), **options) as axes:
        for column, result in enumerate(results):
            _measured_column(axes[:, column], result)
        axes[0, 0].set_ylabel("plant: speed per torque\n|.| in dB (rad/s per N m)")
        axes[1, 0].set_ylabel("phase of the plant in deg")
        axes[2, 0].set_ylabel("position loop, cut at the\nspeed command: |L| in dB")
        for axis in axes[-1]:
            axis.set_xlabel("frequency in Hz")
    return path


def _measured_column(axes: Sequence[Axes], result: MeasuredResponse) -> None:
    condition, dots = result.condition, result.measured
    fine = np.geomspace(dots.hz[0], dots.hz[-1], 800)
    model = result.model_at(fine)
    good = result.trusted > 0.0
    rows = (
        (_db(dots.plant), _db(model.plant)),
        (np.angle(dots.plant, deg=True), np.angle(model.plant, deg=True)),
        (_db(dots.position_open), _db(model.position_open)),
    )
    for axis, (points, line) in zip(axes, rows, strict=True):
        _shade(axis, result.off)
        axis.semilogx(fine, line, color=BLUE, linewidth=1.2)
        axis.semilogx(dots.hz[good], points[good], "o", color=ORANGE, markersize=3.2)
        axis.semilogx(dots.hz[~good], points[~good], "o", color=ORANGE, markersize=3.2, fillstyle="none")
    axes[1].set_yticks(np.arange(-180.0, 181.0, 90.0))
    axes[2].axhline(0.0, color=INK, linewidth=0.7)
    how = f"{condition.torque_nm:.3g} N m" + (
        f", {condition.vel_deg_s:g} deg/s" if condition.vel_deg_s else ""
    )
    axes[0].set_title(f"{condition.name}: {how}\nmodel: friction {condition.friction.value}")


def _db(values: ComplexArray) -> FloatArray:
    return np.asarray(20.0 * np.log10(np.abs(values)))


def _shade(axis: Axes, hz: FloatArray) -> None:
    for value in hz.tolist():
        axis.axvspan(value / 1.05, value * 1.05, color=GREEN, alpha=0.16, linewidth=0.0)
