"""The figures of a study as tables of text: heads and rows, for a terminal or a page."""

from __future__ import annotations

import math
from typing import NamedTuple

from gantryctl.engineering.analysis.models.paper_loop import rigid_loop
from gantryctl.engineering.analysis.models.rigid import RigidLoop
from gantryctl.engineering.analysis.models.robust import Case, RobustMargins
from gantryctl.engineering.analysis.models.sampled import Cut
from gantryctl.engineering.analysis.study import CutFigures, Study

_TWO_PI = 2.0 * math.pi
_CUT_NAMES = {
    Cut.SPEED_COMMAND: "position error = speed command",
    Cut.SPEED_ERROR: "speed error, position loop open",
    Cut.TORQUE: "torque, both loops",
}
"""Position error and speed command are the same cut: only Kpp lies between them."""


class TextTable(NamedTuple):
    """A table; the first column is text, the others are numbers."""

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def margins_table(study: Study) -> TextTable:
    """Margins at each cut, as it runs."""
    heads = (
        "cut at",
        "crossover\nHz",
        "phase margin\ndeg",
        "= dead time\nms",
        "gain may rise\ntimes",
        "gain may fall\nto",
        "sensitivity\npeak",
        "at\nHz",
    )
    return TextTable("Margins, as it runs", heads, tuple(_cut_row(figures) for figures in study.cuts))


def _cut_row(figures: CutFigures) -> tuple[str, ...]:
    phase = figures.phase
    return (
        _CUT_NAMES[figures.cut],
        "-" if phase is None else f"{phase.crossover_rad_s / _TWO_PI:.3g}",
        "-" if phase is None else f"{phase.margin_deg:.1f}",
        "-" if phase is None else f"{1e3 * phase.delay_s:.3g}",
        "-" if figures.gain_up is None else f"{figures.gain_up:.3g}",
        "-" if figures.gain_down is None else f"{figures.gain_down:.3f}",
        f"{figures.sensitivity.value:.2f}",
        f"{figures.sensitivity.w_rad_s / _TWO_PI:.3g}",
    )


def equation_5_table(study: Study) -> TextTable:
    """Eq. (5): continuous and rigid, on load and rotor, and on the rotor alone."""
    heads = (
        "eq. (5), continuous",
        "Js\nkg m2",
        "speed loop\nPM deg",
        "at\nrad/s",
        "position loop\nGM",
        "PM deg",
        "torque cut\nPM deg",
        "gain may\nfall to",
        "bandwidth\nrad/s",
    )
    loops = (
        ("load and rotor", rigid_loop(study.machine)),
        ("rotor alone", rigid_loop(study.machine, motor_only=True)),
    )
    return TextTable(
        "Margins of the paper's loop", heads, tuple(_rigid_row(name, loop) for name, loop in loops)
    )


def _rigid_row(name: str, loop: RigidLoop) -> tuple[str, ...]:
    speed, position, torque = (
        cut.phase_margin() for cut in (loop.velocity_open, loop.position_open, loop.torque_open)
    )
    bandwidth = loop.position.bandwidth_rad_s()
    return (
        name,
        f"{loop.js_kg_m2:.4g}",
        "-" if speed is None else f"{speed.margin_deg:.1f}",
        "-" if speed is None else f"{speed.crossover_rad_s:.4g}",
        "-" if loop.gain_margin is None else f"{loop.gain_margin:.2f}",
        "-" if position is None else f"{position.margin_deg:.1f}",
        "-" if torque is None else f"{torque.margin_deg:.1f}",
        f"{loop.gain_reduction_margin:.3f}",
        "-" if bandwidth is None else f"{bandwidth:.4g}",
    )


def closed_table(study: Study) -> TextTable:
    """Bandwidths and peaks of the closed loops."""
    heads = ("closed loop", "first -3 dB\nHz", "last -3 dB\nHz", "peak", "at\nHz")
    rows = [
        (
            figures.name,
            "-" if figures.bandwidth_rad_s is None else f"{figures.bandwidth_rad_s / _TWO_PI:.3g}",
            "-" if figures.last_rad_s is None else f"{figures.last_rad_s / _TWO_PI:.3g}",
            f"{figures.peak.value:.3g}",
            f"{figures.peak.w_rad_s / _TWO_PI:.3g}",
        )
        for figures in study.closed
    ]
    return TextTable("Closed loops, as they run", heads, tuple(rows))


def modes_table(study: Study) -> TextTable:
    """Modes with the motor held (the zeros of torque to motor angle) and in the closed loop."""
    heads = ("mode", "motor held\nHz", "damping\n%", "closed loop\nHz", "damping\n%", "taken away\n%")
    rows = [
        (
            mode.name,
            f"{mode.held.hz:.3f}",
            f"{100.0 * mode.held.zeta:.2f}",
            f"{mode.closed.hz:.3f}",
            f"{100.0 * mode.closed.zeta:.2f}",
            f"{100.0 * mode.damping_taken:.2f}",
        )
        for mode in study.modes
    ]
    return TextTable("Swinging modes", heads, tuple(rows))


def poles_table(study: Study) -> TextTable:
    """Poles of the closed loop below half the scan rate."""
    heads = ("pole", "real\nrad/s", "imaginary\nrad/s", "frequency\nHz", "damping")
    rows = []
    for number, pole in enumerate(study.shown_poles.tolist(), start=1):
        swings = pole.imag > 0.0
        rows.append(
            (
                f"{number}{', ' + str(number) + '*' if swings else ''}",
                f"{pole.real:.4g}",
                f"{pole.imag:.4g}" if swings else "",
                f"{abs(pole) / _TWO_PI:.4g}",
                f"{-pole.real / abs(pole):.4f}",
            )
        )
    return TextTable("Poles of the closed loop, as it runs", heads, tuple(rows))


def robust_table(margins: RobustMargins) -> TextTable:
    """The worst plants of the uncertain set."""
    heads = (
        "worst case of",
        "damping\n%",
        "at\nHz",
        "phase margin\ndeg",
        "sensitivity",
        "stiffness\nN m/rad",
        "structural\ndamping %",
        "load\nkg m2",
        "motor\nkg m2",
    )
    cases = {
        "damping": margins.worst_damping,
        "phase margin": margins.worst_phase,
        "sensitivity": margins.worst_sensitivity,
    }
    title = (
        f"Worst case over {len(margins.cases)} plants: "
        + (f"unstable on {len(margins.unstable)}" if margins.unstable else "stable on all")
        + " (no friction)"
    )
    return TextTable(title, heads, tuple(_case_row(name, case) for name, case in cases.items()))


def _case_row(name: str, case: Case) -> tuple[str, ...]:
    return (
        name,
        f"{100.0 * case.zeta:.2f}",
        f"{case.hz:.2f}",
        f"{case.phase_margin_deg:.1f}" if case.stable else "unstable",
        f"{case.sensitivity:.3g}" if case.stable else "unstable",
        f"{case.variation.stiffness_nm_per_rad:.3g}",
        f"{100.0 * (case.variation.damping_ratio or 0.0):.3g}",
        f"{case.variation.load_inertia_kg_m2:.3g}",
        f"{case.variation.motor_inertia_kg_m2:.3g}",
    )
