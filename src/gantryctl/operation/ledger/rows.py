"""A row of the ledger, and what the rows are judged by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import reduce
from typing import Final, NamedTuple, TypeAlias

from gantryctl.drives.od.facts import DriveFacts
from gantryctl.drives.od.verdicts import ParameterRow, ParameterVerdict
from gantryctl.drives.profiles import DriveProfile
from gantryctl.machine import Machine
from gantryctl.program.alarms.words import Clauses, Said, Words

_NOTHING_TO_SAY: Final = Clauses()


class Standing(StrEnum):
    """How a machine stands to a safety property."""

    OBJECT = "has it by"
    PROVEN = "proven by"
    MADE_UP = "made up for by"
    ACCEPTED = "accepted by"
    LACKING = "lacking"


Spoken: TypeAlias = Words | Said | str
"""Words of a language, or the name of an object, a key or a person, which has none."""


class LedgerRow(NamedTuple):
    """One safety property.

    Attributes:
        what: key of the property; of an input the key of [can.inputs].
        by: the object, the step, what makes up for it, or the person's name; "" where it is lacking.
        detail: the cost of what makes up, why it is lacking, or the person's reason; one clause after the other.
        proof: step of commissioning that would show it, "" for none; a row that lacks it keeps power off, except for
            that step.
        acceptable: a person may take the lack upon himself.
        speed_max_deg_s: nothing moves faster because of this row; None without such a limit.
        by_file: a key of the machine file, as the detail names it, ends the lack.
    """

    what: str
    standing: Standing
    by: Spoken = ""
    detail: Clauses = _NOTHING_TO_SAY
    proof: str = ""
    acceptable: bool = False
    speed_max_deg_s: float | None = None
    by_file: bool = False

    @property
    def text(self) -> str:
        """The row in one line."""
        line = f"{self.what}: {self.standing} {self.by}".rstrip()
        return f"{line} ({self.detail})" if self.detail else line

    @property
    def in_english(self) -> dict[str, object]:
        """The row as a table of JSON."""
        return {**self._asdict(), "by": str(self.by), "detail": str(self.detail)}

    @property
    def lack(self) -> Spoken:
        """What is lacking and why, as words of the message of an alarm."""
        return Words.LEDGER_LACK(what=self.what, detail=self.detail) if self.detail else self.what

    @property
    def lacking(self) -> bool:
        """Nothing gives it, and nobody has accepted that."""
        return self.standing is Standing.LACKING


@dataclass(frozen=True)
class Proofs:
    """What commissioning has shown of a drive in its present configuration.

    Attributes:
        passed, failed: keys of its steps.
        measured: figures that stops are computed with, by name.
    """

    passed: frozenset[str] = frozenset()
    failed: frozenset[str] = frozenset()
    measured: Mapping[str, float] = field(default_factory=dict)


# Figures of commissioning steps that a ledger reads: the ramp of a drive that takes none, a torque limit that a pulse
# has shown, the time after which a watchdog stops the axis of a dead controller, and the increments of a motor turn in
# a drive that does not name them.
RAMP_DEG_S2 = "quick_stop_dec_deg_s2"
TORQUE_LIMIT_NM = "torque_limit_nm"
SILENT_STOP_S = "silent_stop_s"
INCREMENTS_PER_TURN = "increments_per_turn"
MEASURED = (RAMP_DEG_S2, TORQUE_LIMIT_NM, SILENT_STOP_S, INCREMENTS_PER_TURN)


@dataclass(frozen=True)
class Question:
    """What a property is judged by.

    Attributes:
        facts: the drive as its set-up leaves it.
        parameters: its parameters against those of the machine, by place (`1016:01`).
        profile: what is known of its model; None of an unknown one.
    """

    machine: Machine
    facts: DriveFacts
    parameters: Mapping[str, ParameterRow]
    profile: DriveProfile | None
    proofs: Proofs

    def verdict(self, place: str) -> ParameterVerdict:
        """Verdict on a parameter."""
        row = self.parameters.get(place)
        return ParameterVerdict.ABSENT if row is None else row.verdict

    def has(self, place: str) -> bool:
        """The drive holds what the machine wants there, or only the drive itself can say it does not."""
        return self.verdict(place) in (ParameterVerdict.OK, ParameterVerdict.UNKNOWN)

    def value(self, place: str) -> int | None:
        """What the drive holds there."""
        row = self.parameters.get(place)
        return None if row is None else row.value

    def why_not(self, *places: str) -> Clauses:
        """Say of each place that is not as wanted what it is, in one clause; none where all are."""
        said = [_why(self, place) for place in places if not self.has(place)]
        return Clauses((reduce(_both, said),)) if said else _NOTHING_TO_SAY


def _both(first: Said, second: Said) -> Said:
    return Words.LEDGER_BOTH(first=first, second=second)


def _why(question: Question, place: str) -> Said:
    name = place.removesuffix(":00")
    verdict = question.verdict(place)
    if verdict is ParameterVerdict.ABSENT:
        return Words.LEDGER_NO_OBJECT(object=name)
    row = question.parameters[place]
    words = Words.LEDGER_STAYS if verdict is ParameterVerdict.FIXED else Words.LEDGER_IS
    return words(object=name, have=row.have, want=row.want)


def costs(objects: object, cost: object) -> Said:
    """What a lack of objects costs."""
    return Words.LEDGER_COST(objects=objects, cost=cost)


def step_failed(step: str) -> Said:
    """A proof was tried, and failed."""
    return Words.LEDGER_STEP_FAILED(step=step)
