"""The table of all codes, and what it says of one. The reference page and the page's table are written from it."""

from __future__ import annotations

import difflib
import re
from typing import Final

from gantryctl.errors import CommandRefused
from gantryctl.program.alarms.bus import BUS
from gantryctl.program.alarms.codes import Code, Definition, Reaction
from gantryctl.program.alarms.control import CONTROL
from gantryctl.program.alarms.encoder import ENCODER
from gantryctl.program.alarms.power import POWER
from gantryctl.program.alarms.refusals import REFUSALS
from gantryctl.program.alarms.service import SERVICE
from gantryctl.program.alarms.start import START

# In the order of the reference page.
ALARMS: Final[dict[Code, Definition]] = {
    row.code: row for row in (*ENCODER, *BUS, *CONTROL, *POWER, *REFUSALS, *SERVICE, *START)
}


def all_codes() -> list[tuple[str, str, str]]:
    """Code, severity and title of every row, sorted."""
    return sorted((str(row.code), row.severity.value, row.english.title) for row in ALARMS.values())


def explain(code: str) -> str:
    """The entry of one code: message, cause, reaction, what to do.

    Raises:
        CommandRefused: no such code; the message lists similar ones.
    """
    wanted = code.strip().upper()
    known = [str(each) for each in ALARMS]
    if wanted not in known:
        group = sorted(each for each in known if wanted and each.startswith(wanted[:3]))
        near = group if len(wanted) <= 4 else difflib.get_close_matches(wanted, group or known, n=5)
        hint = f"; did you mean {', '.join(near)}?" if near else "; `gantryctl explain` lists them all"
        raise CommandRefused(f"unknown code {code!r}{hint}")
    row = ALARMS[Code(wanted)]
    # Number formats mean nothing to a reader of the manual.
    message = re.sub(r"\{\w+(:[^}]*)?\}", "...", row.english.message)
    lines = [
        f"{row.code} {row.english.title} ({row.severity.value})",
        "",
        f"Message    {message}",
        f"Cause      {row.english.cause}",
        f"Reaction   {describe_reaction(row)}",
        f"What to do {row.english.to_do}",
    ]
    return "\n".join(lines)


def describe_reaction(row: Definition) -> str:
    """What the axis does, in words."""
    words = {
        Reaction.W: "none, the axis goes on",
        Reaction.REF: "the command is refused, nothing moves",
        Reaction.HLT: "stop on the jog-release ramp, power stays on",
        Reaction.QUICK_STOP: "QUICK STOP: the drive's quick-stop ramp, then brake, then torque off",
        Reaction.TORQUE_OFF: "TORQUE OFF and brake at once",
        Reaction.HOLD: "HOLD: torque at zero speed, because the brake is not trusted",
    }[row.reaction]
    if row.lock:
        words += "; LOCK: only the service role may reset"
    if row.blocks_motion:
        words += "; no motion until then" if row.lock else "; no motion until reset"
    return words
