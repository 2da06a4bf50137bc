"""What the figures mean, in plain sentences."""

from __future__ import annotations

import math

from gantryctl.engineering.analysis.models.mechanics import Friction, PlantKind
from gantryctl.engineering.analysis.models.modes import Mode
from gantryctl.engineering.analysis.models.paper_loop import rigid_loop
from gantryctl.engineering.analysis.models.rigid import RigidLoop
from gantryctl.engineering.analysis.models.sampled import Cut, LoopSettings
from gantryctl.engineering.analysis.study import FOLLOWING_WITHOUT, SWINGING, CutFigures, Study

_TWO_PI = 2.0 * math.pi


def sentences(study: Study) -> list[str]:
    """All of them, the most important first."""
    found = [_verdict(study)]
    if study.kind is PlantKind.RIGID:
        found += _paper(rigid_loop(study.machine), rigid_loop(study.machine, motor_only=True))
    found += _margins(study)
    for mode in study.modes:
        found.append(_mode(mode))
    if study.modes:
        found.append(_swing(study))
    found.append(_following(study))
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
        f"Eq. (5): the tuned speed loop has {total.margin_deg:.0f} deg phase margin at "
        f"{total.crossover_rad_s / _TWO_PI:.1f} Hz on load and rotor as one body; below "
        f"{loop.gain_reduction_margin:.2f} of its gain the whole loop is unstable, for example in torque saturation.",
        f"On the rotor alone the same gain has {rotor.margin_deg:.0f} deg at {rotor.crossover_rad_s / _TWO_PI:.0f} Hz: "
        "it fits a drive that does not feel the load, so the compliance is the plant and eq. (5) a first sketch.",
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


def _mode(mode: Mode) -> str:
    held, closed = mode.held, mode.closed
    if closed.zeta < 0.0:
        return (
            f"The {mode.name}, {held.hz:.2f} Hz with {100.0 * held.zeta:.2f} % damping while the motor is held, is "
            f"driven by the loop: {100.0 * closed.zeta:.2f} % at {closed.hz:.2f} Hz, it swings up."
        )
    return (
        f"The {mode.name} has {held.hz:.2f} Hz and {100.0 * held.zeta:.2f} % damping while the motor is held, "
        f"{closed.hz:.2f} Hz and {100.0 * closed.zeta:.2f} % in the closed loop: P and PI {_taken(mode)}."
    )


def _taken(mode: Mode) -> str:
    change = mode.damping_taken / mode.held.zeta if mode.held.zeta else 0.0
    if abs(change) < 0.01:
        return "leave its damping as it is"
    if change > 0.0:
        return f"take {100.0 * change:.0f} % of its damping away"
    return f"add {-100.0 * change:.0f} % to its damping"


def _swing(study: Study) -> str:
    load = study.modes[0].closed
    seconds = math.log(10.0) / (abs(load.zeta) * load.hz * _TWO_PI)
    top = study.closed_loop(SWINGING).peak
    fall = "fall to" if load.zeta > 0.0 else "grow from"
    return (
        f"A set-point component at {top.w_rad_s / _TWO_PI:.2f} Hz moves the load {top.value:.0f} times as far; "
        f"a swing takes {seconds:.1f} s to {fall} a tenth. The motor encoder hardly sees it."
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


def _coarse(study: Study) -> str:
    counts, s = study.machine.encoder.counts_per_turn, study.settings
    step = _TWO_PI / counts / s.cycle_s * s.kvp_nm_s_per_rad
    return (
        f'With feedback = "counts" one encoder step in a drive cycle is a torque step of {step:.0f} N m: '
        "the linear figures hold only for movements of many steps."
    )


def _db(value: float) -> float:
    return 20.0 * math.log10(value)
