"""Alarms as values: raised inside the scan, latched first-out, explained on demand."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from gantryctl.program.alarms.codes import Code, Definition, Reaction, Severity
from gantryctl.program.alarms.reason import Reason
from gantryctl.program.alarms.table import ALARMS
from gantryctl.program.alarms.words import Clauses, Said, Words, filled

HISTORY_LENGTH: Final = 200


# Made in the scan as values; the text is made by whoever reads it, in the language of the reader.
class Refusal(NamedTuple):
    """The reason why a command was refused: a code with the values of its message."""

    code: Code
    values: Mapping[str, object]

    @property
    def text(self) -> str:
        """The message of the code with its values."""
        return filled(ALARMS[self.code].english.message, self.values)

    @property
    def line(self) -> str:
        """Code and message, as the journal keeps them."""
        return f"{self.code} {self.text}"

    def __str__(self) -> str:
        return self.text


@dataclass(slots=True, eq=False, repr=False)
class Alarm:
    """One alarm: what was measured, when and where; what was done about it grows while it is being done."""

    code: Code
    time_s: float
    values: Mapping[str, object]
    """What was measured against which limit, in the units of the message."""
    reaction: Reaction
    scan: int = 0
    pos_rad: float = 0.0
    """Angle of the axis; NaN where the reading is in doubt."""
    steps: tuple[Words | Said, ...] = field(init=False)
    """What gantryctl has commanded; when the stop is over, what the drive has shown, one by one."""
    follows: Code | None = None
    """Code of the latched alarm that came before it."""
    consequences: list[Alarm] = field(default_factory=list)
    """Alarms that came after this one, while it was latched."""

    def __post_init__(self) -> None:
        self.steps = _STEPS[self.reaction]

    @property
    def definition(self) -> Definition:
        """Its row in the table."""
        return ALARMS[self.code]

    @property
    def severity(self) -> Severity:
        """That of its row; a warning that had to become a stop is one."""
        return Severity.STOP if self.reaction >= Reaction.QUICK_STOP else self.definition.severity

    @property
    def refusal(self) -> Refusal:
        """The same code and values as the reason of a refusal."""
        return Refusal(self.code, self.values)

    @property
    def active_words(self) -> Said:
        """Why it forbids motion, for the refusal of a command."""
        first = self.definition.before_motion
        return Words.ACTIVE(code=self.code, measured=self.refusal, first=first)

    @property
    def measured(self) -> str:
        """What was measured against which limit, with units."""
        return filled(ALARMS[self.code].english.message, self.values)

    @property
    def done(self) -> str:
        """What gantryctl did about it."""
        steps = ", ".join(map(str, self.steps))
        follows = f"(follows {self.follows})" if self.follows else ""
        return f"{steps[:1].upper()}{steps[1:]} {follows}".strip()

    @property
    def text(self) -> str:
        """Code, severity, what was measured, what was done, what to do: one line."""
        row = self.definition
        parts = [f"{self.code} {self.severity.value}", self.measured, self.done, row.english.to_do]
        return " · ".join(part for part in parts if part)

    def __repr__(self) -> str:
        return f"Alarm({self.text})"


_STEPS: Final[dict[Reaction, tuple[Words | Said, ...]]] = {
    Reaction.W: (),
    Reaction.REF: (),
    Reaction.HLT: (Words.STOPPING,),
    Reaction.QUICK_STOP: (Words.QUICK_STOP_COMMANDED,),
    Reaction.TORQUE_OFF: (Words.TORQUE_OFF_COMMANDED,),
    Reaction.HOLD: (Words.TORQUE_KEPT,),
}


class AlarmLog:
    """Active alarms, the first-out alarm, and the history.

    The first alarm of a stop class is latched as `first_out` until `clear`; whatever follows is folded
    under it.

    Attributes:
        active: alarms by code since the last `clear`.
        first_out: the alarm that stopped the axis, or None.
        history: the last alarms and notes, oldest first.
        pending: the strongest reaction that the axis has not taken yet.
        horn: an active alarm sounds the horn.
    """

    __slots__ = ("active", "first_out", "history", "horn", "pending", "pos_rad", "scan", "time_s")

    def __init__(self) -> None:
        self.active: dict[Code, Alarm] = {}
        self.first_out: Alarm | None = None
        self.history: deque[Alarm] = deque(maxlen=HISTORY_LENGTH)
        self.pending = Reaction.W
        self.horn = False
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
        # A cause that lasts is raised in every scan; only a stronger reaction counts again.
        row = ALARMS[code]
        reaction = row.reaction if reaction is None else max(reaction, row.reaction)
        known = self.active.get(code)
        if known is not None and reaction <= known.reaction:
            return
        self.pending = max(self.pending, reaction)
        # A warning that becomes a stop, on whatever ramp, is told anew, with the time and the values of the stop.
        if known is not None and (known.reaction >= Reaction.QUICK_STOP or reaction < Reaction.HLT):
            known.reaction = reaction
            return
        alarm = Alarm(code, self.time_s, values, reaction, self.scan, self.pos_rad)
        self.history.append(alarm)
        self.active[code] = alarm
        self.horn = self.horn or row.horn
        # First out: a stop raises others (following error, drive states) that would hide its cause.
        if self.first_out is not None:
            self.first_out.consequences.append(alarm)
            alarm.follows = self.first_out.code
        elif reaction >= Reaction.QUICK_STOP:
            self.first_out = alarm

    def locate(self, pos_rad: float) -> None:
        """Give the alarms of this scan its angle, NaN where it is not known: some are raised before it is computed."""
        for alarm in reversed(self.history):
            if alarm.scan != self.scan:
                return
            alarm.pos_rad = pos_rad

    def complete(self, code: Code, /, **values: object) -> None:
        """Complete an alarm, active in this scan, with values that were not known when it was raised."""
        self.active[code].values = values

    def note(self, code: Code, /, **values: object) -> Refusal:
        """Put a note into the history; nothing is latched."""
        self.history.append(Alarm(code, self.time_s, values, ALARMS[code].reaction, self.scan, self.pos_rad))
        return Refusal(code, values)

    def clear(self) -> None:
        """Forget what is active; the history stays."""
        self.active.clear()
        self.first_out = None
        self.pending = Reaction.W
        self.horn = False

    def torque_not_kept(self) -> None:
        """Correct the alarms that say that torque is kept: it could not be given, or had to go."""
        for alarm in self.active.values():
            if Words.TORQUE_KEPT in alarm.steps:
                alarm.steps = (Words.TORQUE_OFF_COMMANDED,)

    def blocking(self, but: Code | None = None) -> Alarm | None:
        """An active alarm that forbids motion without having stopped the axis, or None; `but` does not count."""
        for alarm in self.active.values():
            blocks = alarm.definition.blocks_motion or alarm.reaction is Reaction.HLT
            if blocks and alarm.code is not but:
                return alarm
        return None


def messages_to_wire(*messages: object) -> list[object]:
    """What a tag of kind `messages` shows: words, reasons, refusals, and texts that have no values."""
    return [_wire(message) for message in messages]


def to_wire(values: Mapping[str, object]) -> dict[str, object]:
    """Values as JSON: words, refusals and what they hold as a key with values, numbers and names as they are."""
    return {name: _wire(value) for name, value in values.items()}


def _wire(value: object) -> object:
    match value:
        case Refusal():
            return {"code": str(value.code), "values": to_wire(value.values)}
        case Reason():
            return {"reason": str(value.code), "values": to_wire(value.values)}
        case Said():
            return {"words": value.words.name, "values": to_wire(value.values)}
        case Words():
            return {"words": value.name, "values": {}}
        case tuple():
            return [_wire(each) for each in value]
        case float() if not math.isfinite(value):
            # JSON has no nan and no infinity (RFC 8259).
            return str(value)
        case int() | float():
            return value
    return str(value)


def from_wire(value: object) -> object:
    """Restore words from the wire; names, numbers and words of another version stay as they are."""
    match value:
        case {"words": str(name), "values": dict(values)} if name in Words.__members__:
            return Words[name](**{key: from_wire(each) for key, each in values.items()})
        case list():
            return Clauses(map(from_wire, value))
    return value


def refusal(code: Code, /, **values: object) -> Refusal:
    """The refusal `code` with the values of its message."""
    return Refusal(code, values)
