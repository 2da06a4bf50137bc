"""Alarms as values: raised inside the scan, latched first-out, explained on demand."""

from __future__ import annotations

import difflib
from collections import deque
from collections.abc import Mapping
from typing import Final, NamedTuple

from gantryctl.errors import CommandRefused
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.definition import Definition
from gantryctl.program.alarms.encoder_and_control import ALARMS

HISTORY_LENGTH: Final = 200


class Refusal(NamedTuple):
    """The reason why a command was refused: a code with the values of its message."""

    code: Code
    values: Mapping[str, object]

    @property
    def text(self) -> str:
        """The message of the code with its values."""
        return ALARMS[self.code].message.format(**self.values)

    def __str__(self) -> str:
        return self.text


class Alarm:
    """One alarm: what was measured, when and where; what was done about it grows while it is being done."""

    __slots__ = ("code", "consequences", "done", "pos_rad", "reaction", "scan", "time_s", "values")

    def __init__(
        self,
        code: Code,
        time_s: float,
        values: Mapping[str, object],
        reaction: Reaction,
        scan: int = 0,
        pos_rad: float = 0.0,
    ) -> None:
        self.code = code
        self.time_s = time_s
        self.values = values
        """What was measured against which limit, in the units of the message."""
        self.reaction = reaction
        self.scan = scan
        self.pos_rad = pos_rad
        self.done = _DOING[reaction]
        """What gantryctl did."""
        self.consequences: list[Alarm] = []
        """Alarms that came after this one, while it was latched."""

    @property
    def definition(self) -> Definition:
        """Its row in the table."""
        return ALARMS[self.code]

    @property
    def refusal(self) -> Refusal:
        """The same code and values as the reason of a refusal."""
        return Refusal(self.code, self.values)

    @property
    def measured(self) -> str:
        """What was measured against which limit, with units."""
        return ALARMS[self.code].message.format(**self.values)

    @property
    def text(self) -> str:
        """Code, severity, what was measured, what was done, what to do: one line."""
        row = self.definition
        parts = [f"{self.code} {row.severity.value}", self.measured, self.done, row.to_do]
        return " · ".join(part for part in parts if part)

    def __repr__(self) -> str:
        return f"Alarm({self.text})"


_DOING: Final = {
    Reaction.W: "",
    Reaction.REF: "",
    Reaction.HLT: "Stopping on the jog-release ramp",
    Reaction.QUICK_STOP: "Quick stop",
    Reaction.TORQUE_OFF: "Torque off and brake",
    Reaction.HOLD: "Torque kept at zero speed",
}


class AlarmLog:
    """What is wrong now, what was wrong first, and what has been wrong.

    The first alarm of a stop class is latched as `first_out` until `clear`; whatever follows is folded
    under it.

    Attributes:
        active: alarms by code since the last `clear`.
        first_out: the alarm that stopped the axis, or None.
        history: the last alarms and notes, oldest first.
        pending: the strongest reaction that the axis has not taken yet.
    """

    __slots__ = ("active", "first_out", "history", "pending", "pos_rad", "scan", "time_s")

    def __init__(self) -> None:
        self.active: dict[Code, Alarm] = {}
        self.first_out: Alarm | None = None
        self.history: deque[Alarm] = deque(maxlen=HISTORY_LENGTH)
        self.pending = Reaction.W
        self.scan = 0
        self.time_s = 0.0
        self.pos_rad = 0.0

    def raise_(self, code: Code, /, reaction: Reaction | None = None, **values: object) -> None:
        """Raise an alarm; one that is already active stays as it is, but a stronger reaction still counts.

        Args:
            code: which.
            reaction: stronger than the table's, where the case asks for it.
            values: numbers for the message.
        """
        row = ALARMS[code]
        reaction = row.reaction if reaction is None else max(reaction, row.reaction)
        known = self.active.get(code)
        if known is not None and reaction <= known.reaction:
            return
        self.pending = max(self.pending, reaction)
        if known is not None:
            known.reaction = reaction
            return
        alarm = Alarm(code, self.time_s, values, reaction, self.scan, self.pos_rad)
        self.history.append(alarm)
        self.active[code] = alarm
        if self.first_out is not None:
            self.first_out.consequences.append(alarm)
            alarm.done = f"{alarm.done} (follows {self.first_out.code})".strip()
        elif reaction >= Reaction.QUICK_STOP:
            self.first_out = alarm

    def complete(self, code: Code, /, **values: object) -> None:
        """Say of an active alarm what was not known yet when it was raised."""
        alarm = self.active.get(code)
        if alarm is not None:
            alarm.values = values

    def note(self, code: Code, /, **values: object) -> Refusal:
        """Put something worth knowing into the history; nothing is latched."""
        self.history.append(Alarm(code, self.time_s, values, ALARMS[code].reaction, self.scan, self.pos_rad))
        return Refusal(code, values)

    def clear(self) -> None:
        """Forget what is active; the history stays."""
        self.active.clear()
        self.first_out = None
        self.pending = Reaction.W

    def blocking(self, but: Code | None = None) -> Alarm | None:
        """An active alarm that forbids motion without having stopped the axis, or None; `but` does not count."""
        for alarm in self.active.values():
            if alarm.definition.blocks_motion and alarm.code is not but:
                return alarm
        return None


def refusal(code: Code, /, **values: object) -> Refusal:
    """The refusal `code` with the values of its message."""
    return Refusal(code, values)


def all_codes() -> tuple[str, ...]:
    """Every code with its title, one line each."""
    return tuple(f"{row.code} {row.title}" for row in ALARMS.values())


def explain(code: str) -> str:
    """The page of one code: what it means, what is done, what to do.

    Raises:
        CommandRefused: no such code; the message lists those that look like it.
    """
    wanted = code.strip().upper()
    known = {str(each): each for each in ALARMS}
    if wanted not in known:
        group = [each for each in known if each[:3] == wanted[:3]]
        near = (
            group if len(wanted) <= 4 else difflib.get_close_matches(wanted, group or known, n=5, cutoff=0.4)
        )
        hint = f"; did you mean {', '.join(near)}?" if near else f"; there are {', '.join(known)}"
        raise CommandRefused(f"unknown code {code!r}{hint}")
    row = ALARMS[known[wanted]]
    lines = [
        f"{row.code} {row.title} ({row.severity.value})",
        "",
        f"Message    {row.message}",
        f"Cause      {row.cause}",
        f"Reaction   {describe_reaction(row)}",
        f"What to do {row.to_do}",
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
