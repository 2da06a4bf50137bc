"""The report of a tuning."""

from __future__ import annotations

from gantryctl.engineering.report.head import Head, Judged, Required, Verdict, judged_as
from gantryctl.engineering.report.page import Section, render_sections
from gantryctl.engineering.report.recording import recorded, still
from gantryctl.engineering.tuning import figures, text
from gantryctl.engineering.tuning.result import Tuning


def render_tuning(tuning: Tuning, head: Head) -> str:
    """The page: the proposal, before and after, and the damping that it leaves."""
    proposal = tuning.proposal.verdict
    margins = proposal.margins
    wrong, count = len(margins.unstable), len(margins.cases)
    verdict = Verdict(
        "STABLE" if proposal.stable else "UNSTABLE",
        judged_as(proposal.stable),
        f"the proposal is stable on {count - wrong} of {count} uncertain plants",
    )
    required = [
        Required(
            "stability on the uncertain plants", f"all {count}", f"{count - wrong}", judged_as(not wrong)
        ),
        Required(
            "sensitivity, worst",
            "reported",
            f"{margins.worst_sensitivity.sensitivity:.2f}" if proposal.stable else "unstable",
            Judged.OPEN,
        ),
    ]
    tables = [text.before_after_table(tuning)]
    if tuning.tuned is not None and tuning.paper is not None:
        tables.insert(0, text.paper_table(tuning))
    sections = [
        Section("Proposal", text.sentences(tuning), tables),
        Section(
            "Steps before and after",
            figures=[recorded(figures.steps(tuning), "steps")],
        ),
        Section(
            "Damping",
            figures=[
                still(
                    figures.damping(tuning),
                    "damping",
                    "Damping that the loop leaves the load, over the stiffness; grey: the uncertain stiffness; "
                    "filled: the swing grows.",
                )
            ],
        ),
    ]
    if tuning.tuned is not None:
        trials = still(figures.trials(tuning.tuned), "trials", "What every trial measured, phase by phase.")
        sections.append(Section("Trials", (), [text.log_table(tuning.tuned)._replace(title="")], [trials]))
    return render_sections(
        head,
        verdict,
        required,
        title=f"Tuning of {head.machine}",
        subtitle=f"A proposal by the method {tuning.method!r}, on the simulated axis".replace("'", ""),
        sections=sections,
    )
