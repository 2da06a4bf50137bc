"""A tuning as tables of text."""

from __future__ import annotations

from gantryctl.engineering.analysis.tables import TextTable
from gantryctl.engineering.tuning.bench import MoveResult
from gantryctl.engineering.tuning.gains import PAPER, Gains
from gantryctl.engineering.tuning.judge import Verdict
from gantryctl.engineering.tuning.procedure import Tuned
from gantryctl.engineering.tuning.result import WITHIN, Candidate, Tuning, differences


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


def move_rows(move: MoveResult) -> dict[str, str]:
    """A simulated move of 90 deg."""
    return {
        "time of 90 deg, s": f"{move.time_s:.2f}",
        "speed error motor, deg/s": f"{move.motor_error_deg_s:.4f}",
        "speed error load, deg/s": f"{move.load_error_deg_s:.4f}",
        "following error in cruise, mdeg": f"{1e3 * move.cruise_error_deg:.3g}",
        "base motion, um p-p": f"{move.base_um:.0f}",
        "residual base motion, um p-p": f"{move.residual_um:.0f}",
        "settled to 0.001 deg after, s": f"{move.settle_s:.2f}",
        "largest torque, N m": f"{move.torque_nm:.1f}",
    }


def verdict_rows(verdict: Verdict) -> dict[str, str]:
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
            f"{trial.value:.4g} {trial.unit}",
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
