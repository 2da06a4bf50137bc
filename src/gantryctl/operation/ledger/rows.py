"""A row of the ledger, and what the rows are judged by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

from gantryctl.drives.od.facts import DriveFacts
from gantryctl.drives.od.verdicts import ParameterRow, ParameterVerdict
from gantryctl.drives.profiles import DriveProfile
from gantryctl.machine import Machine


class Standing(StrEnum):
    """How a machine stands to a safety property."""

    OBJECT = "has it by"
    PROVEN = "proven by"
    MADE_UP = "made up for by"
    ACCEPTED = "accepted by"
    LACKING = "lacking"


class LedgerRow(NamedTuple):
    """One safety property.

    Attributes:
        what: key of the property; of an input the key of [can.inputs].
        by: the object, the step, what makes up for it, or the person's name; "" where it is lacking.
        detail: the cost of what makes up, why it is lacking, or the person's reason.
        proof: step of commissioning that would show it, "" for none; a row that lacks it keeps power off, except for
            that step.
        acceptable: a person may take the lack upon himself.
        speed_max_deg_s: nothing moves faster because of this row; None without such a limit.
        by_file: a key of the machine file, as the detail names it, ends the lack.
    """

    what: str
    standing: Standing
    by: str = ""
    detail: str = ""
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

    def why_not(self, *places: str) -> str:
        """Say of each place that is not as wanted what it is."""
        return ", ".join(_why(self, place) for place in places if not self.has(place))


def _why(question: Question, place: str) -> str:
    name = place.removesuffix(":00")
    match question.verdict(place):
        case ParameterVerdict.ABSENT:
            return f"no {name}"
        case ParameterVerdict.FIXED:
            row = question.parameters[place]
            return f"{name} stays {row.have}, wanted {row.want}"
        case _:
            row = question.parameters[place]
            return f"{name} = {row.have}, wanted {row.want}"
