"""What a tuning found, in plain sentences; where it is not the paper's, why, with what was measured."""

from __future__ import annotations

from dataclasses import replace

from gantryctl.engineering.tuning.gains import PAPER
from gantryctl.engineering.tuning.judge import sentences as verdict_sentences
from gantryctl.engineering.tuning.procedure import PHASES, Tuned
from gantryctl.engineering.tuning.result import WITHIN, Tuning, differences

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
        return [_end(tuning.tuned), *_against_paper(tuning), _CHOICES]
    designed = tuning.designed
    assert designed is not None
    limit = "" if designed.kvp_max is None else f"; one encoder step permits Kvp up to {designed.kvp_max:.0f}"
    return [f"Found on {designed.corners} corner plants and confirmed on the whole uncertain set{limit}."]


def _end(tuned: Tuned) -> str:
    parts = []
    for phase in PHASES:
        trials = tuned.phase(phase)
        stop = next((trial for trial in reversed(trials) if not trial.kept), None)
        kept = [trial for trial in trials if trial.kept][-1]
        why = f"{stop.note or f'{stop.measured:.3g} {stop.measured_unit}'}" if stop else "its end"
        parts.append(f"{phase} {kept.value:.4g} {kept.unit} (stopped by {why})")
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
