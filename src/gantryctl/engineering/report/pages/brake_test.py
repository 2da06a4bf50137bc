"""The report of a brake test."""

from __future__ import annotations

import math

from gantryctl.engineering.report.head import Head, Judged, MeasuredBy, Required, Verdict, judged_as
from gantryctl.engineering.report.origin import Origin
from gantryctl.engineering.report.page import Section, render_sections
from gantryctl.operation.client import BrakeTestReport


def render_brake_test(found: BrakeTestReport, ended_by: str, origin: Origin, head: Head) -> str:
    """The page: torque that the closed brake bore both ways, and how far anything moved.

    Args:
        ended_by: what ended the test before its verdict; "" where it ran to its end.
    """
    judged = Judged.FAIL if ended_by else judged_as(found.done)
    verdict = Verdict(
        "NOT TESTED" if ended_by else "PASS" if found.done else "FAIL",
        judged,
        ended_by or f"{found.text}: {found.detail}",
    )
    both = ((name, value) for name, value in (("plus", found.plus_nm), ("minus", found.minus_nm)))
    required = [
        Required(
            f"torque held, {name}",
            f"{found.level_nm:.4g} N m at the motor for 2 s",
            f"{abs(value):.4g} N m" if math.isfinite(value) else "not held",
            judged_as(math.isfinite(value)),
        )
        for name, value in both
    ]
    within = found.moved_deg <= found.limit_deg
    required.append(
        Required(
            "movement against the closed brake",
            f"at most {found.limit_deg:.4f} deg",
            f"{found.moved_deg:.4f} deg",
            # Of a test that did not come to its end a small movement proves nothing.
            judged_as(None if ended_by and within else within),
        )
    )
    instrument = MeasuredBy(f"the drive's torque and motor encoder ({origin})", "none: the machine's own")
    return render_sections(
        Head(head.machine, head.facts, head.made, instrument, head.required_source),
        verdict,
        required,
        title=f"Brake test of {head.machine}",
        subtitle="Torque both ways against the closed brake, power on",
        sections=[Section("Next test", [found.due.words])],
    )
