"""The table of all codes, and what it says of one. The reference page and the page's table are written from it."""

from __future__ import annotations

import difflib
import re
from typing import Final, NamedTuple

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
        f"Reaction   {describe_reaction(row).english}",
        f"What to do {row.english.to_do}",
    ]
    return "\n".join(lines)


class ReactionWords(NamedTuple):
    """What an axis does about an alarm, in both languages."""

    english: str
    chinese: str


_REACTIONS: Final = {
    Reaction.W: ReactionWords("none, the axis goes on", "无，轴继续运行"),
    Reaction.REF: ReactionWords("the command is refused, nothing moves", "命令被拒绝，没有任何运动"),
    Reaction.HLT: ReactionWords(
        "stop on the jog-release ramp, power stays on", "按松键斜坡停止，动力保持接通"
    ),
    Reaction.QUICK_STOP: ReactionWords(
        "QUICK STOP: the drive's quick-stop ramp, then brake, then torque off",
        "快速停止：按驱动器的快速停止斜坡停下，然后抱紧制动器，再切断转矩",
    ),
    Reaction.TORQUE_OFF: ReactionWords("TORQUE OFF and brake at once", "立即切断转矩并抱紧制动器"),
    Reaction.HOLD: ReactionWords(
        "HOLD: torque at zero speed, because the brake is not trusted",
        "保持：制动器不可信，电机以零速转矩保持",
    ),
}
_LOCK: Final = ReactionWords("; LOCK: only the service role may reset", "；锁定：只有维修角色可以复位")
_BLOCK: Final = ReactionWords("; no motion until reset", "；复位之前不能运动")
_LOCK_AND_BLOCK: Final = ReactionWords("; no motion until then", "；在此之前不能运动")


def describe_reaction(row: Definition) -> ReactionWords:
    """What the axis does, in words."""
    parts = [_REACTIONS[row.reaction]]
    if row.lock:
        parts.append(_LOCK)
    if row.blocks_motion:
        parts.append(_LOCK_AND_BLOCK if row.lock else _BLOCK)
    return ReactionWords("".join(each.english for each in parts), "".join(each.chinese for each in parts))
