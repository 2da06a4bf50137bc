"""Codes from outside the scan: the engine, the run. `explain` knows them beside the alarms."""

from __future__ import annotations

import difflib
import re
from typing import Final, NamedTuple

from gantryctl.errors import CommandRefused
from gantryctl.program import ALARMS
from gantryctl.program import explain as explain_alarm


class Notice(NamedTuple):
    """One code: what it means, what is done about it and what to do."""

    code: str
    severity: str
    title: str
    message: str
    cause: str
    reaction: str
    to_do: str


NOTICES: Final = {
    row[0]: Notice(*row)
    for row in (
        (
            "SYS-02", "STOP", "Scans late", "scan ... ms late, or too many overruns within a second",
            "Something kept the processor from the controller.",
            "QUICK STOP", "Find what kept the processor busy, then start again.",
        ),
        (
            "SYS-03", "STOP", "Controller frozen", "controller frozen for ... s",
            "The controller did not run at all for some time.",
            "QUICK STOP", "Find what kept the processor busy, then start again.",
        ),
        (
            "SYS-09", "STOP", "Fault in the program", "an exception in a scan, with its line",
            "A program of one's own, or gantryctl, has a fault.",
            "QUICK STOP, then brake, then torque off", "Correct the program, or report it; then reset.",
        ),
        (
            "SYS-10", "STOP", "Power-up did not end", "power-up did not end within 10 s",
            "A program of one's own that does not switch power on when the operator wants it.",
            "torque off, brake closed", "Call a Power block with the operator's `power`; then reset.",
        ),
    )
}  # fmt: skip


def explain(code: str) -> str:
    """The page of one code.

    Raises:
        CommandRefused: no such code; the message lists those that look like it.
    """
    wanted = code.strip().upper()
    notice = NOTICES.get(wanted)
    if notice is not None:
        return "\n".join(
            [
                f"{notice.code} {notice.title} ({notice.severity})",
                "",
                f"Message    {notice.message}",
                f"Cause      {notice.cause}",
                f"Reaction   {notice.reaction}",
                f"What to do {notice.to_do}",
            ]
        )
    known = {str(each) for each in ALARMS} | set(NOTICES)
    if wanted not in known:
        group = sorted(each for each in known if wanted and each.startswith(wanted[:3]))
        near = group if len(wanted) <= 4 else difflib.get_close_matches(wanted, group or sorted(known), n=5)
        hint = f"; did you mean {', '.join(near)}?" if near else "; `gantryctl explain` lists them all"
        raise CommandRefused(f"unknown code {code!r}{hint}")
    return re.sub(r"\{\w+(:[^}]*)?\}", "...", explain_alarm(wanted))


def all_codes() -> list[tuple[str, str, str]]:
    """Code, severity and title of everything that can be said, sorted."""
    rows = [(str(row.code), row.severity.value, row.title) for row in ALARMS.values()]
    rows += [(notice.code, notice.severity, notice.title) for notice in NOTICES.values()]
    return sorted(rows)
