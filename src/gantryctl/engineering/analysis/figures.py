"""Pictures of a loop in the frequency domain: Bode, Nyquist, closed loops. PNG by matplotlib, no window."""

from __future__ import annotations

import math
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from gantryctl.engineering.analysis.models.linear import MINUS_3_DB, ComplexArray, FloatArray
from gantryctl.engineering.analysis.models.mechanics import LOAD, MOTOR
from gantryctl.engineering.analysis.models.sampled import Cut
from gantryctl.engineering.analysis.study import Study, grid_of
from gantryctl.errors import DeviceError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLUE, ORANGE, GREEN, RED, GREY, INK = "#0072b2", "#d55e00", "#009e73", "#b3261e", "#8a8f98", "#20242b"
STYLE: Final[dict[Any, Any]] = {
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e7eb",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.3,
    "figure.constrained_layout.use": True,
}
_DPI: Final = 130
CUTS: Final = (
    (Cut.TORQUE, BLUE, "cut at the torque (both loops)"),
    (Cut.SPEED_COMMAND, ORANGE, "cut at the speed command (position loop)"),
    (Cut.SPEED_ERROR, GREEN, "cut at the speed error (speed loop alone)"),
)
_LOWEST_HZ: Final = 0.1


@contextmanager
def figure(path: Path, title: str, rows: int, columns: int, **options: Any) -> Iterator[Any]:
    """A figure with its axes, saved when the block ends.

    Raises:
        DeviceError: the file cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        sheet: Figure = Figure(figsize=options.pop("figsize", (8.6, 6.0)))
        axes = sheet.subplots(rows, columns, **options)
        sheet.suptitle(title, fontsize=10.5, fontweight="bold", x=0.01, ha="left")
        yield axes
        try:
            sheet.savefig(path, dpi=_DPI)
        except OSError as fault:
            raise DeviceError(f"{path}: cannot be written: {fault.strerror or fault}") from None


def name_of(study: Study) -> str:
    """Machine, plant and friction in a title."""
    friction = "" if study.friction.value == "none" else f", friction {study.friction.value}"
    return f"{study.machine.name}, {study.kind.value} plant{friction}"


def frequency_plots(study: Study, folder: Path) -> list[Path]:
    """All of them: bode.png, nyquist.png, closed_loops.png."""
    return [bode(study, folder), nyquist(study, folder), closed_loops(study, folder)]


def bode(study: Study, folder: Path) -> Path:
    """Magnitude and phase at the three cuts, with crossovers and phase margins."""
    path = folder / "bode.png"
    with figure(path, f"Open loops as they run: {name_of(study)}", 2, 1, sharex=True) as (top, bottom):
        for cut, colour, label in CUTS:
            _bode_curve(top, bottom, study, cut, colour, label)
        top.axhline(0.0, color=INK, linewidth=0.8)
        bottom.axhline(-180.0, color=INK, linewidth=0.8)
        _mark_modes(study, top, bottom)
        top.set(ylabel="|L| in dB", ylim=(-60.0, 80.0))
        bottom.set(ylabel="phase of L in deg", xlabel="frequency in Hz", ylim=(-450.0, 0.0))
        bottom.set_yticks(np.arange(-450.0, 1.0, 90.0))
        bottom.set_xlim(_LOWEST_HZ, 0.5 / study.settings.cycle_s)
        top.legend(loc="upper right")
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
        phase -= 360.0 * np.round((np.interp(at, hz, phase) - there) / 360.0)
        top.plot([at], [0.0], "o", color=colour, markersize=5)
        bottom.plot([at, at], [-180.0, there], color=colour, linewidth=2.4, alpha=0.6)
        bottom.plot([at], [there], "o", color=colour, markersize=5)
        words: dict[str, Any] = {
            "xytext": (6, -12 if cut is Cut.SPEED_ERROR else 5),
            "textcoords": "offset points",
        }
        bottom.annotate(f"{figures.margin_deg:.0f}°", (at, there), color=colour, fontweight="bold", **words)
    top.semilogx(hz, 20.0 * np.log10(np.abs(response)), color=colour, label=label, **wide)
    bottom.semilogx(hz, phase, color=colour, **wide)


def nyquist(study: Study, folder: Path) -> Path:
    """The curves around -1: distance to it is 1/sensitivity; the crossing beyond it is the conditional stability."""
    path = folder / "nyquist.png"
    titles = ("torque", "speed command", "speed error")
    with figure(path, f"Nyquist: {name_of(study)}", 1, 3, figsize=(11.0, 4.5)) as axes:
        for axis, (cut, colour, _), title in zip(axes, CUTS, titles, strict=True):
            _, response = _open_loop(study, cut)
            figures = study.at(cut)
            axis.plot(response.real, response.imag, color=colour)
            axis.plot(response.real, -response.imag, color=colour, linewidth=0.7, alpha=0.5)
            _unit_circle(axis, figures.sensitivity.value)
            peak = figures.sensitivity.value
            words = f"cut at the {title}\nstays {1.0 / peak:.2f} away from −1: sensitivity {peak:.2f}"
            left = -1.6
            if figures.gain_down is not None:
                words += f"\nunstable below {figures.gain_down:.2f} of the gain (square)"
                left = -1.2 / figures.gain_down
                axis.plot([-1.0 / figures.gain_down], [0.0], "s", color=RED, markersize=5)
            axis.set_title(words, fontweight="normal", fontsize=8.5)
            axis.set(xlim=(left, 1.4), ylim=(-0.5 * (1.4 - left), 0.5 * (1.4 - left)), aspect="equal")
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
    hz = grid / (2.0 * math.pi)
    following, without = loop.following(grid), loop.following(grid, kvf=0.0)
    curves: Sequence[tuple[str, ComplexArray, str, str]] = (
        ("set-point to load", following[LOAD], RED, "-"),
        (f"set-point to motor, Kvf = {study.settings.kvf:g}", following[MOTOR], BLUE, "-"),
        ("set-point to motor, Kvf = 0", without[MOTOR], BLUE, "--"),
        ("speed command to motor speed", loop.speed_loop(grid), GREEN, "-"),
    )
    with figure(path, f"Closed loops as they run: {name_of(study)}", 1, 1, figsize=(8.6, 4.2)) as axis:
        for label, response, colour, line in curves:
            axis.semilogx(hz, 20.0 * np.log10(np.abs(response)), color=colour, linestyle=line, label=label)
        axis.axhline(20.0 * math.log10(MINUS_3_DB), color=INK, linewidth=0.8, linestyle=":")
        axis.text(0.105, -2.6, "−3 dB", fontsize=8, va="bottom")
        _mark_modes(study, axis)
        axis.set(xlim=(_LOWEST_HZ, 0.5 / study.settings.scan_s), ylim=(-40.0, 42.0))
        axis.set(xlabel="frequency in Hz", ylabel="magnitude in dB")
        axis.legend(loc="upper right")
    return path


def _open_loop(study: Study, cut: Cut) -> tuple[FloatArray, ComplexArray]:
    grid = grid_of(study.loop, cut)
    return grid / (2.0 * math.pi), study.loop.open_loop(cut, grid)


def _mark_modes(study: Study, *axes: Axes) -> None:
    """Thin vertical lines at the motor-held modes, named on the first axis."""
    for mode in study.modes:
        for axis in axes:
            axis.axvline(mode.held.hz, color=GREY, linewidth=0.8, linestyle=":")
        axes[0].text(
            mode.held.hz,
            0.02,
            f"{mode.name}, {mode.held.hz:.2f} Hz",
            transform=axes[0].get_xaxis_transform(),
            fontsize=7.5,
            color=INK,
            va="bottom",
            rotation=90.0,
            ha="right",
        )
