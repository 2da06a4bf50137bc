"""Studies, worst cases and measurements as sentences and tables of text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from gantryctl.engineering.analysis.measured.response import MeasuredResponse
from gantryctl.engineering.analysis.models.linear import FloatArray
from gantryctl.engineering.analysis.models.load_side import DiskMargin, LoadSideFigures
from gantryctl.engineering.analysis.models.mechanics import MOTOR, Friction, PlantKind, Variation
from gantryctl.engineering.analysis.models.modes import SwingMode, least_damped
from gantryctl.engineering.analysis.models.paper_loop import rigid_loop
from gantryctl.engineering.analysis.models.rigid import RigidLoop
from gantryctl.engineering.analysis.models.robust import (
    Bands,
    Case,
    LoadSideCase,
    RobustMargins,
    RobustReport,
)
from gantryctl.engineering.analysis.models.sampled import Cut, LoopSettings
from gantryctl.engineering.analysis.study import FOLLOWING_WITHOUT, SWINGING, CutFigures, Study
from gantryctl.engineering.report.origin import Origin
from gantryctl.engineering.report.text import TextTable, or_dash

_TWO_PI = 2.0 * math.pi

EQUATION_5: Final = (
    "y(s)              Kvf Kvp s^2 + (Kvf Kvp/Tvi + Kvp Kpp) s + Kpp Kvp/Tvi",
    "---- = ----------------------------------------------------------------------------",
    "r(s)   (Js/Kt) s^3 + Kvp s^2 + (Kvp/Tvi + Kvp Kpp) s + Kpp Kvp/Tvi       with Kt = 1",
)
# Position error and speed command are the same cut: only Kpp lies between them.
_CUT_NAMES = {
    Cut.SPEED_COMMAND: "position error = speed command",
    Cut.SPEED_ERROR: "speed error, position loop open",
    Cut.TORQUE: "torque, both loops",
}


def study_name(study: Study) -> str:
    """Machine, plant and friction in a title."""
    friction = "" if study.friction.value == "none" else f", friction {study.friction.value}"
    return (
        f"{study.machine.name}, {study.kind.value} plant{friction}, {Origin.COMPUTED} from the machine file"
    )


def _polynomial(coefficients: Sequence[float]) -> str:
    """A polynomial in s, highest power first: "1.898 s^3 + 77.7 s^2 + 8547 s + 7.77e+04"."""
    order = len(coefficients) - 1
    terms = []
    for power, value in zip(range(order, -1, -1), coefficients, strict=True):
        if value:
            terms.append(f"{value:.6g}" + {0: "", 1: " s"}.get(power, f" s^{power}"))
    return " + ".join(terms).replace("+ -", "- ") or "0"


def equation_5_numbers(loop: RigidLoop) -> tuple[str, str, str]:
    """The fraction with its numbers, three lines."""
    top, bottom = _polynomial(loop.position.num), _polynomial(loop.position.den)
    width = max(len(top), len(bottom))
    return (
        f"y(s)   {top:^{width}}".rstrip(),
        f"---- = {'-' * width}",
        f"r(s)   {bottom:^{width}}".rstrip(),
    )


def sentences(study: Study) -> list[str]:
    """All of them, the most important first."""
    found = [_verdict(study)]
    # Eq. (5) is rigid: beside a flexible plant its margins would be taken for those of the axis.
    if study.kind is PlantKind.RIGID:
        found += _paper(rigid_loop(study.machine), rigid_loop(study.machine, motor_only=True))
    found += _margins(study)
    for mode in study.modes:
        found.append(_mode(mode))
    if study.modes:
        found.append(_swing(study))
    found.append(_following(study))
    if study.load_side is not None:
        found.append(_whole(study.load_side))
    elif study.machine.control.compensation.load_encoder.active and study.machine.calibration is None:
        found.append(
            "The loop through the load-side encoder is not in it: this machine has no calibration yet, `gantryctl "
            "identify` makes it."
        )
    if study.friction is Friction.HOLDING:
        found.append(
            "Friction holds: every friction element is a spring with its damping, as for movements below the "
            "breakaway torque; larger movements make it slide, and then `--friction sliding` is the model."
        )
    if study.machine.drive.speed_loop.feedback == "counts":
        found.append(_coarse(study))
    return found


def timing(settings: LoopSettings) -> str:
    """How the loop runs: periods and delays."""
    delay = ("no dead time", "one drive cycle of dead time")[settings.delay_cycles]
    return (
        f"P every {settings.scan_s * 1e3:g} ms, PI every {settings.cycle_s * 1e6:g} us, {delay}, "
        f"encoder {settings.latency_s * 1e6:g} us late, speed by backward difference"
    )


def _verdict(study: Study) -> str:
    if study.stable:
        slowest = max(study.loop.poles, key=lambda pole: pole.real)
        return f"The loop is stable; its slowest motion dies out with a time constant of {-1.0 / slowest.real:.3g} s."
    worst = max(study.loop.poles, key=lambda pole: pole.real)
    return (
        f"The loop is UNSTABLE: a motion at {abs(worst) / _TWO_PI:.3g} Hz grows by a factor e every "
        f"{1.0 / worst.real:.3g} s."
    )


def _paper(loop: RigidLoop, motor_only: RigidLoop) -> list[str]:
    """Eq. (5): continuous, rigid, without wave generator."""
    total, rotor = loop.velocity_open.phase_margin(), motor_only.velocity_open.phase_margin()
    assert total is not None
    assert rotor is not None
    return [
        f"Rigid loop: the tuned speed loop has {total.margin_deg:.0f} deg phase margin at "
        f"{total.crossover_rad_s / _TWO_PI:.1f} Hz on load and rotor as one body; below "
        f"{loop.gain_reduction_margin:.2f} of its gain the whole loop is unstable, for example in torque saturation.",
        f"On the rotor alone the same gain has {rotor.margin_deg:.0f} deg at {rotor.crossover_rad_s / _TWO_PI:.0f} Hz: "
        "it fits a drive that does not feel the load, so the compliance is the plant, the rigid loop a sketch.",
        f"Routh: stable for Kvp above {loop.kvp_min:.4g} N m s/rad and Kpp below {loop.kpp_max:.4g} /s.",
    ]


def _margins(study: Study) -> list[str]:
    torque, command, speed = (study.at(cut) for cut in (Cut.TORQUE, Cut.SPEED_COMMAND, Cut.SPEED_ERROR))
    parts = [
        f"As it runs, the speed loop alone has {_phase(speed)}, the position loop {_phase(command)}, "
        f"both cut at the torque {_phase(torque)}."
    ]
    if torque.gain_down is not None:
        parts.append(
            f"The loop is conditionally stable: when less than {torque.gain_down:.2f} of the torque it asks for "
            "arrives, as in torque saturation, it is unstable."
        )
    rise = [
        f"{figures.gain_up:.3g} times {what}"
        for figures, what in ((torque, "the torque gain Kvp"), (command, "the position gain Kpp"))
        if figures.gain_up is not None
    ]
    if rise:
        parts.append(f"It becomes unstable at {' and at '.join(rise)}.")
    worst = max(study.cuts, key=lambda figures: figures.sensitivity.value)
    parts.append(
        f"The sensitivity peaks at {worst.sensitivity.value:.2f} ({_db(worst.sensitivity.value):.1f} dB), at "
        f"{worst.sensitivity.w_rad_s / _TWO_PI:.3g} Hz, cut at the {worst.cut.value}"
        + (": below 2 (6 dB) is usual." if worst.sensitivity.value > 2.0 else ".")
    )
    return parts


def _phase(figures: CutFigures) -> str:
    if figures.phase is None:
        return "no gain crossover"
    return f"{figures.phase.margin_deg:.0f} deg at {figures.phase.crossover_rad_s / _TWO_PI:.3g} Hz"


def _mode(mode: SwingMode) -> str:
    held, closed = mode.held, mode.closed
    if not mode.followed:
        return (
            f"The {mode.name} has {held.hz:.2f} Hz and {100.0 * held.zeta:.2f} % damping while the motor is held, and "
            "no swing near it in the closed loop: the loop is slower, and its motor gives way."
        )
    if closed.zeta < 0.0:
        return (
            f"The {mode.name}, {held.hz:.2f} Hz with {100.0 * held.zeta:.2f} % damping while the motor is held, is "
            f"driven by the loop: {100.0 * closed.zeta:.2f} % at {closed.hz:.2f} Hz, it swings up."
        )
    return (
        f"The {mode.name} has {held.hz:.2f} Hz and {100.0 * held.zeta:.2f} % damping while the motor is held, "
        f"{closed.hz:.2f} Hz and {100.0 * closed.zeta:.2f} % in the closed loop: P and PI {_taken(mode)}."
    )


def _taken(mode: SwingMode) -> str:
    change = mode.damping_taken / mode.held.zeta if mode.held.zeta else 0.0
    if abs(change) < 0.01:
        return "leave its damping as it is"
    if change > 0.0:
        return f"take {100.0 * change:.0f} % of its damping away"
    return f"add {-100.0 * change:.0f} % to its damping"


def _swing(study: Study) -> str:
    mode = study.modes[0]
    load = mode.closed if mode.followed else least_damped(study.loop.poles)
    # A tenth, in time constants: ln 10.
    seconds = math.log(10.0) / (abs(load.zeta) * load.hz * _TWO_PI)
    top = study.closed_loop(SWINGING).peak
    fall = "fall to" if load.zeta > 0.0 else "grow from"
    there = study.loop.following(np.array([top.w_rad_s]))
    return (
        f"A set-point component at {top.w_rad_s / _TWO_PI:.2f} Hz moves the load {top.value:.2g} times as far, and the "
        f"motor {float(np.abs(there[MOTOR][0])):.2g} times; a swing takes {seconds:.2g} s to {fall} a tenth."
    )


def _following(study: Study) -> str:
    figures = study.closed_loop(FOLLOWING_WITHOUT)
    width = "no limit" if figures.bandwidth_rad_s is None else f"{figures.bandwidth_rad_s / _TWO_PI:.2f} Hz"
    speed, kpp, kvf = study.machine.speed.setting_max_deg_s, study.settings.kpp_per_s, study.settings.kvf
    left = abs(1.0 - kvf) * speed / kpp
    return (
        f"Without feed-forward the position loop follows up to {width}; with Kvf = {kvf:g} a constant "
        f"{speed:g} deg/s leaves a following error of {left:.3g} deg (without: {speed / kpp:.3g} deg)."
    )


def _whole(figures: LoadSideFigures) -> str:
    """All sentences before are of the loop on the motor alone."""
    state = "stable" if figures.stable else "UNSTABLE"
    least = figures.smallest
    return (
        "Integral of the load-side error and damping of the swing feed the load back; all above is the motor's loop "
        f"without them. With them the loop is {state}, its least damped swing has {100.0 * figures.worst.zeta:.1f} % "
        f"at {figures.worst.hz:.2f} Hz, and at every cut gains may be off by {least.gain_down:.2f} to "
        f"{least.gain_up:.2f}, or phases by {least.phase_deg:.0f} deg. Maps and feed-forward change no margin; the "
        "moment observer is not in it."
    )


def _coarse(study: Study) -> str:
    # 8192 steps: 477 N m through the paper's Kvp at a drive cycle of 125 us.
    counts, s = study.machine.encoder.counts_per_turn, study.settings
    step = _TWO_PI / counts / s.cycle_s * s.kvp_nm_s_per_rad
    return (
        f'With feedback = "counts" one encoder step in a drive cycle is a torque step of {step:.3g} N m: '
        "the linear figures hold only for movements of many steps."
    )


def _db(value: float) -> float:
    return 20.0 * math.log10(value)


def robust_sentences(report: RobustReport) -> list[str]:
    """Where the gains are unstable, and the worst plant."""
    found = []
    for name, by_damping in report.bands.items():
        parts = []
        for zeta, spans in by_damping.items():
            where = f"unstable for k = {bands_text(spans)}" if spans else "stable at every stiffness"
            parts.append(f"{100.0 * zeta:g} % {where}")
        found.append(f"Configured gains on the {name} plant, by structural damping: {'; '.join(parts)}.")
    worst = report.margins.worst_damping
    state = "unstable" if worst.zeta < 0.0 else "stable"
    found.append(
        f"Over the uncertain full plant the worst swing has {100.0 * worst.zeta:.2f} % damping at {worst.hz:.2f} Hz "
        f"({state}; {describe(worst.variation)}); friction is left out."
    )
    if report.load_side:
        found.append(_whole_worst(report.load_side))
    return found


def _whole_worst(cases: Sequence[LoadSideCase]) -> str:
    unstable = sum(not case.figures.stable for case in cases)
    swing = min(cases, key=lambda case: case.figures.worst.zeta)
    margin = min(cases, key=lambda case: case.figures.smallest.alpha)
    least = margin.figures.smallest
    return (
        f"With the load-side laws it is {f'unstable on {unstable}' if unstable else 'stable on all'} of {len(cases)} "
        "plants, "
        f"with {100.0 * swing.figures.worst.zeta:.1f} % damping at {swing.figures.worst.hz:.2f} Hz in the worst "
        f"({describe(swing.variation)}); the smallest disk margin is {least.alpha:.2f}, gains {least.gain_down:.2f} to "
        f"{least.gain_up:.2f} or {least.phase_deg:.0f} deg at every cut ({describe(margin.variation)})."
    )


def bands_text(bands: Bands) -> str:
    """Bands of stiffness: "0.63..1.60e9 N m/rad"."""
    largest = max((high for _, high in bands), default=1e9)
    # Powers of a thousand, 1e9 for stiffnesses of the size of the reference machine's.
    power = 9 if largest >= 1e8 else 3 * math.floor(math.log10(largest) / 3.0)
    unit = 10.0**power
    spans = " and ".join(f"{low / unit:.2f}..{high / unit:.2f}e{power}" for low, high in bands)
    return f"{spans} N m/rad"


def describe(variation: Variation) -> str:
    """A plant in words."""
    parts = (
        f"k {variation.stiffness_nm_per_rad:.3g} N m/rad" if variation.stiffness_nm_per_rad else "",
        f"damping {100.0 * variation.damping_ratio:.3g} %" if variation.damping_ratio is not None else "",
        f"J {variation.load_inertia_kg_m2:.3g} kg m2" if variation.load_inertia_kg_m2 else "",
        f"Jm {variation.motor_inertia_kg_m2:.3g} kg m2" if variation.motor_inertia_kg_m2 else "",
    )
    return ", ".join(part for part in parts if part)


def measured_sentence(result: MeasuredResponse) -> str:
    """Where the measured plant is what the linear model says, and where friction makes it something else."""
    condition, off = result.condition, result.off
    how = (
        f"{condition.name} ({condition.torque_nm:.3g} N m"
        + (f", {condition.vel_deg_s:g} deg/s" if condition.vel_deg_s else "")
        + f", at {result.machine.axis.dial.text(condition.angle_deg)} deg)"
    )
    model = {
        Friction.HOLDING: "the model whose friction holds like springs",
        Friction.SLIDING: "the model whose friction slides",
        Friction.NONE: "the model without friction",
    }[condition.friction]
    on = "on the machine" if result.origin is Origin.MEASURED else "on the simulator"
    agree = (
        f"Measured {on} {how}, the plant is {model}, typically within {100.0 * result.typical_error:.0f} %"
    )
    if not len(off):
        return agree + " and nowhere more than 3 dB or 20 deg away."
    return agree + f"; more than 3 dB or 20 deg away at {_spans(off, result.measured.hz)}: {_why(result)}."


def _why(result: MeasuredResponse) -> str:
    if result.condition.friction is Friction.HOLDING:
        return (
            "there friction slides a little in every cycle instead of holding, or the load on the gears is so small "
            "that backlash opens"
        )
    return (
        "near the modes the swing takes the reducer's hysteresis to its end, and gear error and torque ripple turn "
        "with the motor"
    )


def _spans(chosen: FloatArray, lines: FloatArray) -> str:
    """Frequencies as spans of neighbouring lines: "0.25..1.1, 9.4 Hz"."""
    where = np.searchsorted(lines, chosen)
    groups = np.split(chosen, np.nonzero(np.diff(where) > 1)[0] + 1)
    spans = [f"{g[0]:.3g}" if len(g) == 1 else f"{g[0]:.3g}..{g[-1]:.3g}" for g in groups]
    return ", ".join(spans) + " Hz"


def study_tables(study: Study) -> list[TextTable]:
    """All tables of a study."""
    makers = (
        equation_5_table,
        margins_table,
        closed_table,
        modes_table,
        poles_table,
        load_side_table,
    )
    return [make(study) for make in makers]


def margins_table(study: Study) -> TextTable:
    """Margins at each cut, as it runs."""
    return TextTable.of("Margins, as it runs", [_cut_row(figures) for figures in study.cuts])


def _cut_row(figures: CutFigures) -> dict[str, str]:
    phase = figures.phase
    return {
        "cut at": _CUT_NAMES[figures.cut],
        "crossover\nHz": or_dash(phase and phase.crossover_rad_s / _TWO_PI, ".3g"),
        "phase margin\ndeg": or_dash(phase and phase.margin_deg, ".1f"),
        "= dead time\nms": or_dash(phase and 1e3 * phase.delay_s, ".3g"),
        "gain may rise\ntimes": or_dash(figures.gain_up, ".3g"),
        "gain may fall\nto": or_dash(figures.gain_down, ".3f"),
        "sensitivity\npeak": f"{figures.sensitivity.value:.2f}",
        "at\nHz": f"{figures.sensitivity.w_rad_s / _TWO_PI:.3g}",
    }


def load_side_table(study: Study) -> TextTable:
    """Disk margins of the whole loop; no rows where no compensation feeds back."""
    cuts = {} if study.load_side is None else _disk_cuts(study.load_side)
    rows = [
        {
            "cut at": name,
            "disk\nmargin": f"{margin.alpha:.2f}",
            "gain may\nfall to": f"{margin.gain_down:.2f}",
            "and\nrise to": f"{margin.gain_up:.2f}",
            "or phase\nlose deg": f"{margin.phase_deg:.0f}",
            "at\nHz": f"{margin.w_rad_s / _TWO_PI:.3g}",
        }
        for name, margin in cuts.items()
    ]
    return TextTable.of("Margins of the whole loop, load-side laws included", rows)


def _disk_cuts(figures: LoadSideFigures) -> dict[str, DiskMargin]:
    return {
        "speed command": figures.command,
        "torque": figures.torque,
        "both encoders at once": figures.encoders,
    }


def equation_5_table(study: Study) -> TextTable:
    """Eq. (5): continuous and rigid, on load and rotor, and on the rotor alone."""
    loops = {
        "load and rotor": rigid_loop(study.machine),
        "rotor alone": rigid_loop(study.machine, motor_only=True),
    }
    rows = [_rigid_row(name, loop) for name, loop in loops.items()]
    return TextTable.of("Margins of the rigid loop", rows)


def _rigid_row(name: str, loop: RigidLoop) -> dict[str, str]:
    speed, position, torque = (
        cut.phase_margin() for cut in (loop.velocity_open, loop.position_open, loop.torque_open)
    )
    return {
        "continuous": name,
        "Js\nkg m2": f"{loop.js_kg_m2:.4g}",
        "speed loop\nPM deg": or_dash(speed and speed.margin_deg, ".1f"),
        "at\nrad/s": or_dash(speed and speed.crossover_rad_s, ".4g"),
        "position loop\nGM": or_dash(loop.gain_margin, ".2f"),
        "PM deg": or_dash(position and position.margin_deg, ".1f"),
        "torque cut\nPM deg": or_dash(torque and torque.margin_deg, ".1f"),
        "gain may\nfall to": f"{loop.gain_reduction_margin:.3f}",
        "bandwidth\nrad/s": or_dash(loop.position.bandwidth_rad_s(), ".4g"),
    }


def closed_table(study: Study) -> TextTable:
    """Bandwidths and peaks of the closed loops."""
    rows = [
        {
            "closed loop": figures.name,
            "first -3 dB\nHz": or_dash(figures.bandwidth_rad_s and figures.bandwidth_rad_s / _TWO_PI, ".3g"),
            "last -3 dB\nHz": or_dash(figures.last_rad_s and figures.last_rad_s / _TWO_PI, ".3g"),
            "peak": f"{figures.peak.value:.3g}",
            "at\nHz": f"{figures.peak.w_rad_s / _TWO_PI:.3g}",
        }
        for figures in study.closed
    ]
    return TextTable.of("Closed loops, as they run", rows)


def modes_table(study: Study) -> TextTable:
    """Modes with the motor held (the zeros of torque to motor angle) and in the closed loop."""
    heads = ("mode", "motor held\nHz", "damping\n%", "closed loop\nHz", "damping\n%", "taken away\n%")
    rows = [
        (
            mode.name,
            f"{mode.held.hz:.3f}",
            f"{100.0 * mode.held.zeta:.2f}",
            *(
                (
                    f"{mode.closed.hz:.3f}",
                    f"{100.0 * mode.closed.zeta:.2f}",
                    f"{100.0 * mode.damping_taken:.2f}",
                )
                if mode.followed
                else ("-", "-", "-")
            ),
        )
        for mode in study.modes
    ]
    return TextTable("Swinging modes", heads, tuple(rows))


def poles_table(study: Study) -> TextTable:
    """Poles of the closed loop below half the scan rate."""
    rows = [
        {
            "pole": f"{number}, {number}*" if pole.imag > 0.0 else f"{number}",
            "real\nrad/s": f"{pole.real:.4g}",
            "imaginary\nrad/s": f"{pole.imag:.4g}" if pole.imag > 0.0 else "",
            "frequency\nHz": f"{abs(pole) / _TWO_PI:.4g}",
            "damping": f"{-pole.real / abs(pole):.4f}",
        }
        for number, pole in enumerate(study.shown_poles.tolist(), start=1)
    ]
    return TextTable.of("Poles of the closed loop, as it runs", rows)


def robust_table(margins: RobustMargins) -> TextTable:
    """The worst plants of the uncertain set."""
    cases = {
        "damping": margins.worst_damping,
        "phase margin": margins.worst_phase,
        "sensitivity": margins.worst_sensitivity,
    }
    found = f"unstable on {len(margins.unstable)}" if margins.unstable else "stable on all"
    title = f"Worst case over {len(margins.cases)} plants: {found} (no friction)"
    return TextTable.of(title, [_case_row(name, case) for name, case in cases.items()])


def _case_row(name: str, case: Case) -> dict[str, str]:
    return {
        "worst case of": name,
        "damping\n%": f"{100.0 * case.zeta:.2f}",
        "at\nHz": f"{case.hz:.2f}",
        "phase margin\ndeg": f"{case.phase_margin_deg:.1f}" if case.stable else "unstable",
        "sensitivity": f"{case.sensitivity:.3g}" if case.stable else "unstable",
        "stiffness\nN m/rad": f"{case.variation.stiffness_nm_per_rad:.3g}",
        "structural\ndamping %": f"{100.0 * (case.variation.damping_ratio or 0.0):.3g}",
        "load\nkg m2": f"{case.variation.load_inertia_kg_m2:.3g}",
        "motor\nkg m2": f"{case.variation.motor_inertia_kg_m2:.3g}",
    }
