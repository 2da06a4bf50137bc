"""The reference page of alarms and refusals: `python -m gantryctl.program.alarms.alarms_page FILE` writes it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

from gantryctl.program.alarms.codes import Definition
from gantryctl.program.alarms.table import ALARMS, describe_reaction

_HEAD: Final = """\
# Alarms and refusals

Written by `python -m gantryctl.program.alarms.alarms_page docs/reference/alarms.md`; do not edit, a test compares.
`gantryctl explain CODE` prints one entry.

A code never changes its meaning: one cause, one code. An alarm says, in one line: code and severity, what was
measured against which limit, what was done about it (with times, and how far the axis moved), what to do.
The first alarm that stops the axis is latched as *first out*; whatever follows is folded under it. A refused
command changes nothing.

## Reactions

| class | what the axis does |
|---|---|
| W | nothing: warning or note |
| REF | refuses the command, with the reason |
| HLT | stops on the jog-release ramp; power stays on |
| QUICK_STOP | the drive's quick-stop ramp, then brake, then torque off: ErrorStop |
| TORQUE_OFF | torque off and brake at once: ErrorStop |
| HOLD | torque at zero speed, because the brake is not trusted: ErrorStop |
| LOCK | beside one of the above: only the service role may reset |

QUICK_STOP is for what leaves the feedback believable and the drive obedient. Whatever puts either in doubt is
TORQUE_OFF: with a frozen or wrong encoder the drive's own ramp runs away. A reading in doubt stays so, in every
phase, until service has compared the angle: the alarm says that the angle is not known. A quick stop that the drive
does not obey becomes TORQUE_OFF (DRV-07); a load that a brake does not stop or hold becomes HOLD where the drive can
give torque, the reading is believed and the emergency-stop chain is closed. A load that moves all the same is BRK-13:
the horn sounds, and everybody leaves.

Times in the machine file are turned into scans: at least two, so that one reading alone never trips them. These
act on the first scan: emergency stop, collision, room door, mains, limit switches, over-travel, stop point beyond
travel, drive state and drive fault, encoder jump, encoder alarm, anything that is not a finite number. Frozen
encoder and old readings take at least three.

Reset clears what is latched when its cause is gone. It never enables, never shortens a stop, and leads from
ErrorStop to Disabled when power is off. Power then needs a new rising edge, every motion a new command.
"""


def reference_page() -> str:
    """The whole page."""
    return "\n".join([_HEAD, *(_entry(row) for row in ALARMS.values())])


def _entry(row: Definition) -> str:
    english, chinese = row.english, row.chinese
    message = english.message.replace("|", "\\|")
    return (
        f"## {row.code} {english.title}\n\n"
        f"- Severity: {row.severity.value}\n"
        f"- Message: `{message}`\n"
        f"- Cause: {english.cause}\n"
        f"- Reaction: {describe_reaction(row)}\n"
        f"- What to do: {english.to_do}\n"
        f"- 中文：{chinese.title}。`{chinese.message}` 原因：{chinese.cause} 处理方法：{chinese.to_do}\n"
    )


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(reference_page(), encoding="utf-8")
