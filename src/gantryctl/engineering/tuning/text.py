"""A tuning as sentences and tables of text, with the reasons where it differs from the paper's."""

from __future__ import annotations

from dataclasses import replace

from gantryctl.engineering.analysis.text import bands_text, describe
from gantryctl.engineering.report.text import TextTable, figure
from gantryctl.engineering.tuning.bench import TrialMove
from gantryctl.engineering.tuning.gains import PAPER, Gains
from gantryctl.engineering.tuning.judge import GainsVerdict
from gantryctl.engineering.tuning.procedure import PHASES, Tuned
from gantryctl.engineering.tuning.result import WITHIN, Candidate, Tuning, differences
from gantryctl.units import behind

_CHOICES = (
    "The stop criteria are choices made with the paper's gains in sight; with neighbouring ones Tvi and Kpp leave the "
    "20 % (docs/explanation/tuning.md)."
)


def sentences(tuning: Tuning) -> list[str]:
    """The most important first."""
    found = _method(tuning)
    for candidate in tuning.candidates:
        found += verdict_sentences(candidate.name, candidate.verdict)
    return found


def _method(tuning: Tuning) -> list[str]:
    if tuning.tuned is not None:
        reasons = [*_against_paper(tuning), _CHOICES] if tuning.paper is not None else []
        return [_end(tuning.tuned), *reasons]
    designed = tuning.designed
    assert designed is not None
    # Without interpolation one encoder step limits Kvp before any margin does.
    limit = "" if designed.kvp_max is None else f"; one encoder step permits Kvp up to {designed.kvp_max:.4g}"
    return [f"Found on {designed.corners} corner plants and confirmed on the whole uncertain set{limit}."]


def _end(tuned: Tuned) -> str:
    parts = []
    for phase in PHASES:
        trials = tuned.phase(phase)
        stop = next((trial for trial in reversed(trials) if not trial.kept), None)
        kept = [trial for trial in trials if trial.kept][-1]
        why = f"{stop.note or f'{stop.measured:.3g} {stop.measured_unit}'}" if stop else "its end"
        parts.append(f"{phase} {kept.value:.4g}{behind(kept.unit)} (stopped by {why})")
    return f"{len(tuned.log)} trials: {', '.join(parts)}."


def _against_paper(tuning: Tuning) -> list[str]:
    off = {name for name, difference in differences(tuning).items() if abs(difference) > WITHIN}
    return [
        *([_why_inner(tuning)] if off & {"Kvp", "Tvi"} else []),
        *([_why_kpp(tuning)] if "Kpp" in off else []),
    ]


def _why_inner(tuning: Tuning) -> str:
    bench, kvp = tuning.bench, PAPER.kvp_nm_s_per_rad
    delays, inertia = bench.small_delays_s, bench.fast_inertia_kg_m2
    rotor = tuning.machine.motor.inertia_kg_m2
    # Amplitude optimum: Kvp = J/(2 x sum of the small delays) is where a rotor alone just does not vibrate.
    here, theirs = inertia / (2.0 * delays), rotor / (2.0 * kvp)
    return (
        "Kvp and Tvi depend on the drive: just no vibration means Kvp = J/(2 x sum of the small delays), here "
        f"{inertia:.3f} kg m2/(2 x {1e3 * delays:.2f} ms) = {here:.0f}. The paper's {kvp:.4g} belongs to its rotor "
        f"alone ({rotor:.3f} kg m2) and {1e3 * theirs:.2f} ms: a drive that averages its speed over some 2 ms, as 8192 "
        "encoder steps demand. This one interpolates its encoder. `--plant paper-drive` tunes the axis that the "
        "paper's drive saw."
    )


def _why_kpp(tuning: Tuning) -> str:
    bench, found, theirs = tuning.bench, tuning.proposal.gains, PAPER.kpp_per_s
    ours, paper = bench.position_step(found), bench.position_step(replace(found, kpp_per_s=theirs))
    return (
        f"Kpp: with {theirs:g} /s the load overshoots a small step by {100.0 * paper.load_overshoot:.0f} %, with "
        f"{found.kpp_per_s:.3g} /s by {100.0 * ours.load_overshoot:.0f} %; the motor, all that the loop sees, by "
        f"{100.0 * paper.motor_overshoot:.1f} % and {100.0 * ours.motor_overshoot:.1f} %. The paper gives no measure "
        "of vibration, and no value of Kpp stands out: the swing grows steadily with it. Permitting that overshoot "
        "instead of a quarter ends at the paper's value."
    )


def verdict_sentences(name: str, verdict: GainsVerdict) -> list[str]:
    """Sentences on one set of gains."""
    margins = verdict.margins
    count, wrong = len(margins.cases), len(margins.unstable)
    where = "stable on all" if not wrong else f"UNSTABLE on {wrong}"
    worst = margins.worst_damping
    found = [
        f"{name}: {where} of {count} uncertain plants; the least damped swing has {100.0 * worst.zeta:.2f} % at "
        f"{worst.hz:.2f} Hz ({describe(worst.variation)}); the loop leaves {100.0 * verdict.damping_left:.0f} % of the "
        f"load's own damping there where it leaves least."
    ]
    if not wrong:
        found.append(
            f"{name}: margins over all of them: sensitivity at most {margins.worst_sensitivity.sensitivity:.2f}, "
            f"phase margin at least {margins.worst_phase.phase_margin_deg:.0f} deg."
        )
    for model, by_damping in verdict.bands.items():
        bad = {zeta: bands for zeta, bands in by_damping.items() if bands}
        if bad:
            parts = [f"{100.0 * zeta:g} % damping: k = {bands_text(bands)}" for zeta, bands in bad.items()]
            found.append(f"{name}: unstable on the {model} model with {'; '.join(parts)}.")
    return found


def gain_rows(gains: Gains) -> dict[str, str]:
    """The gains."""
    return {
        "Kvp, N m s/rad": f"{gains.kvp_nm_s_per_rad:.4g}",
        "Tvi, ms": f"{1e3 * gains.tvi_s:.4g}",
        "Kpp, 1/s": f"{gains.kpp_per_s:.4g}",
        "Kvf, %": f"{100.0 * gains.kvf:.4g}",
        "acceleration, deg/s2": f"{gains.acc_deg_s2:.4g}",
        "stiffness Kvp Kpp/Tvi, N m/(rad s)": f"{gains.stiffness:.3g}",
    }


def move_rows(move: TrialMove) -> dict[str, str]:
    """A simulated move, of 90 deg where travel has them."""
    return {
        "time of the move, s": f"{move.time_s:.2f}",
        "speed error motor, deg/s": f"{move.motor_error_deg_s:.4f}",
        "speed error load, deg/s": f"{move.load_error_deg_s:.4f}",
        "following error in cruise, mdeg": f"{1e3 * move.cruise_error_deg:.3g}",
        "base motion, um p-p": figure(move.base_um, 0),
        "residual base motion, um p-p": figure(move.residual_um, 0),
        "settled to 0.001 deg after, s": f"{move.settle_s:.2f}",
        "largest torque, N m": figure(move.torque_nm, 1),
    }


def verdict_rows(verdict: GainsVerdict) -> dict[str, str]:
    """The uncertain plant."""
    margins = verdict.margins
    stated = {
        "worst sensitivity": f"{margins.worst_sensitivity.sensitivity:.2f}",
        "worst phase margin, deg": f"{margins.worst_phase.phase_margin_deg:.0f}",
    }
    return {
        "uncertain plants, unstable of all": f"{len(margins.unstable)} of {len(margins.cases)}",
        "worst damping of a swing, %": f"{100.0 * margins.worst_damping.zeta:.2f}",
        "left of the load's damping, worst, %": f"{100.0 * verdict.damping_left:.0f}",
        **(stated if verdict.stable else dict.fromkeys(stated, "unstable")),
    }


def _rows(candidate: Candidate) -> dict[str, str]:
    return gain_rows(candidate.gains) | move_rows(candidate.move) | verdict_rows(candidate.verdict)


def before_after_table(tuning: Tuning) -> TextTable:
    """Gains, a simulated move of 90 deg, and the worst case, side by side."""
    shown = {candidate.name: _rows(candidate) for candidate in tuning.candidates}
    names = next(iter(shown.values()))
    rows = tuple((name, *(column[name] for column in shown.values())) for name in names)
    return TextTable("Before and after", ("", *shown), rows)


def log_table(tuned: Tuned) -> TextTable:
    """Every trial."""
    rows = tuple(
        (
            trial.phase,
            f"{trial.value:.4g}{behind(trial.unit)}",
            f"{trial.measured:.3g}",
            f"{trial.limit:.3g} {trial.measured_unit}",
            "kept" if trial.kept else "too much",
            trial.note,
        )
        for trial in tuned.log
    )
    return TextTable("Trials", ("", "value", "measured", "limit", "", ""), rows)


def paper_table(tuning: Tuning) -> TextTable:
    """The proposal beside the paper's gains."""
    found = tuning.proposal.gains
    values = {
        "Kvp": (f"{found.kvp_nm_s_per_rad:.4g}", f"{PAPER.kvp_nm_s_per_rad:.4g}", "N m s/rad"),
        "Tvi": (f"{1e3 * found.tvi_s:.4g}", f"{1e3 * PAPER.tvi_s:.4g}", "ms"),
        "Kpp": (f"{found.kpp_per_s:.4g}", f"{PAPER.kpp_per_s:.4g}", "1/s"),
    }
    rows = tuple(
        (
            f"{name}, {unit}",
            here,
            paper,
            f"{100.0 * differences(tuning)[name]:+.0f}",
            "yes" if abs(differences(tuning)[name]) <= WITHIN else "no, see below",
        )
        for name, (here, paper, unit) in values.items()
    )
    return TextTable("Against the paper", ("", "found", "paper", "difference %", "within 20 %"), rows)
