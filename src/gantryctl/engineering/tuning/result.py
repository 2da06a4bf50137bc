"""One tuning from beginning to end: gains before and after, what they do on the axis, and on the uncertain plant."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from gantryctl.engineering.analysis.models.robust import uncertain_plants
from gantryctl.engineering.report.meter import Watch, nobody
from gantryctl.engineering.tuning.bench import Bench, TrialMove, bench_of_paper
from gantryctl.engineering.tuning.by_margins import STATED, Conditions, Designed, by_margins
from gantryctl.engineering.tuning.gains import PAPER, POOR, Gains, configured, poor
from gantryctl.engineering.tuning.judge import GainsVerdict, judge_gains
from gantryctl.engineering.tuning.procedure import QUARTERS, Criteria, Tuned, paper_procedure
from gantryctl.machine import Machine, is_reference_machine

TRIALS_METHOD, MARGINS_METHOD = "trials", "margins"
# Difference to the paper's gains that counts as the same.
# Reached by a procedure that was fitted with the paper's gains in sight; no independent confirmation.
WITHIN: Final = 0.2
# Part of the time that the search for gains takes, about, before the candidates are judged: 2 of 3 s.
_SEARCH: Final = 0.65


@dataclass(frozen=True)
class Candidate:
    """One set of gains with its move and its verdict."""

    name: str
    gains: Gains
    move: TrialMove
    verdict: GainsVerdict


@dataclass(frozen=True)
class Tuning:
    """The result.

    Attributes:
        machine: of the user; the proposal is it with other gains. bench: the axis that was tuned.
        tuned: log of the paper's procedure. designed: of the method by margins; one of the two.
        configured, proposal, paper: the candidates compared; the paper's gains on the reference machine only.
    """

    machine: Machine
    method: str
    bench: Bench
    tuned: Tuned | None
    designed: Designed | None
    configured: Candidate
    proposal: Candidate
    paper: Candidate | None

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Candidates to show: the paper's gains once, when they are configured already."""
        if self.paper is None:
            return (self.configured, self.proposal)
        if replace(self.configured.gains, acc_deg_s2=0.0) == replace(PAPER, acc_deg_s2=0.0):
            return (self.configured, self.proposal)
        return (self.configured, self.proposal, self.paper)


def tune(
    machine: Machine,
    method: str,
    *,
    as_paper: bool = False,
    start: Gains | None = None,
    criteria: Criteria = QUARTERS,
    conditions: Conditions = STATED,
    watch: Watch = nobody,
) -> Tuning:
    """Tune the axis of a machine file.

    Args:
        machine: see `Tuning`. method: "trials" or "margins".
        as_paper: on the axis that the paper's drive saw, `bench_of_paper`.
        start, criteria: of the paper's procedure; poor gains for this axis when no start is given.
        conditions: of the method by margins.
        watch: is told the part that is done, about.

    Raises:
        UsageError: the axis does not bear the start, or no gains meet the conditions.
    """
    bench = bench_of_paper(machine) if as_paper else Bench(machine)
    linear = bench.linear_machine
    plants = uncertain_plants(linear)
    known = is_reference_machine(machine)
    begin = start or (POOR if known else poor(bench.fast_inertia_kg_m2, machine.virtual_axis.acc_deg_s2))

    def searched(part: float) -> None:
        watch(_SEARCH * part)

    tuned = paper_procedure(bench, begin, criteria, searched) if method == TRIALS_METHOD else None
    designed = None if tuned else by_margins(linear, conditions, plants, watch=searched)
    found = tuned or designed
    assert found is not None
    judged = 0

    def candidate(name: str, gains: Gains) -> Candidate:
        nonlocal judged
        made = Candidate(name, gains, bench.move(gains), judge_gains(linear, gains, plants))
        judged += 1
        watch(_SEARCH + (1.0 - _SEARCH) * judged / (3 if known else 2))
        return made

    present = configured(machine)
    # The acceleration is the user's: the paper's gains are compared at the same one.
    paper = replace(PAPER, acc_deg_s2=present.acc_deg_s2)
    return Tuning(
        machine,
        method,
        bench,
        tuned,
        designed,
        candidate("configured", present),
        candidate("proposal", found.gains),
        candidate("paper", paper) if known else None,
    )


def differences(tuning: Tuning) -> dict[str, float]:
    """Relative difference of the proposal to the paper's Kvp, Tvi, Kpp; nothing on another machine."""
    if tuning.paper is None:
        return {}
    found = tuning.proposal.gains
    return {
        "Kvp": found.kvp_nm_s_per_rad / PAPER.kvp_nm_s_per_rad - 1.0,
        "Tvi": found.tvi_s / PAPER.tvi_s - 1.0,
        "Kpp": found.kpp_per_s / PAPER.kpp_per_s - 1.0,
    }
