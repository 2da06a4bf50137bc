"""Ledger of a real machine: for each safety property what gives it, or who has accepted that nothing does.

A row is made from the machine file, the commissioning record and the acceptances of persons; only the acceptances are
kept. An acceptance belongs to one configuration: any change of what commissioning proves makes it void.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import Final, NamedTuple

from pydantic import TypeAdapter

from gantryctl.errors import CommandRefused, StateError, UsageError
from gantryctl.files import write_whole
from gantryctl.machine import Machine
from gantryctl.machine.rules.reaction import driven_acc_deg_s2

# Inputs of [can.inputs] that count as good where they are not wired. The others are options that a site may have.
SAFETY_INPUTS: Final = (
    "estop_ok", "enabling_switch", "mains_ready", "brake_open", "limit_minus", "limit_plus",
)  # fmt: skip
# What nothing covers: no stop is known without these, so no name stands for them.
NEVER_ACCEPTED: Final = ("stop_of_silent_controller",)
SILENCE_STEP: Final = "silence"
_LONGEST: Final = {"by": 64, "because": 300}


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
        detail: the date of a proof, the cost of what makes up, or the person's reason.
    """

    what: str
    standing: Standing
    by: str = ""
    detail: str = ""

    @property
    def text(self) -> str:
        """The row in one line."""
        line = f"{self.what}: {self.standing} {self.by}".rstrip()
        return f"{line} ({self.detail})" if self.detail else line


@dataclass(frozen=True)
class Acceptance:
    """A person takes a lack upon himself.

    Attributes:
        by, because: name and reason as they were given; entered_by: the user who typed them.
        bound_to: hash of the configuration that it is valid for.
    """

    what: str
    by: str
    because: str
    date: str
    entered_by: str
    bound_to: str


def ledger(
    machine: Machine,
    acceptances: Iterable[Acceptance],
    bound_to: str,
    proven_steps: Collection[str],
    *,
    inputs_sent: bool = True,
) -> tuple[LedgerRow, ...]:
    """The rows of a machine with a real drive.

    Args:
        bound_to: hash of the present configuration; acceptances of another one do not count.
        proven_steps: steps of commissioning that have passed in it.
        inputs_sent: the drive has 60FD; without, a bit in the machine file is no input.
    """
    accepted = {each.what: each for each in acceptances if each.bound_to == bound_to}
    return (
        *(_input_row(machine, name, accepted.get(name), inputs_sent) for name in SAFETY_INPUTS),
        _following_row(machine),
        LedgerRow("stop_of_silent_controller", Standing.PROVEN, f"step {SILENCE_STEP}")
        if SILENCE_STEP in proven_steps
        else LedgerRow("stop_of_silent_controller", Standing.LACKING),
    )


def lacks(rows: Iterable[LedgerRow]) -> tuple[str, ...]:
    """Properties that a person could accept and nobody has."""
    return tuple(
        row.what for row in rows if row.standing is Standing.LACKING and row.what not in NEVER_ACCEPTED
    )


def _input_row(machine: Machine, name: str, accepted: Acceptance | None, sent: bool) -> LedgerRow:
    bit = getattr(machine.can.inputs, name)
    if bit >= 0 and sent:
        return LedgerRow(name, Standing.OBJECT, f"60FD bit {bit}")
    if accepted is None:
        return LedgerRow(name, Standing.LACKING, detail="" if sent else "the drive has no 60FD")
    detail = f"{accepted.because}; {accepted.date}, entered by {accepted.entered_by}"
    return LedgerRow(name, Standing.ACCEPTED, accepted.by, detail)


def _following_row(machine: Machine) -> LedgerRow:
    """Whether the drive says that it follows the command."""
    if machine.can.follows_bit:
        return LedgerRow("drive_follows_command", Standing.OBJECT, "6041 bit 12")
    monitors = machine.monitors
    # A drive that ignores the command and drives the axis away shows it by its speed.
    seen_ms = (
        monitors.velocity_deviation_time_ms
        + 1e3 * monitors.velocity_deviation_deg_s / driven_acc_deg_s2(machine)
    )
    cost = f"seen after {seen_ms:.0f} ms instead of {machine.control.scan_period_ms:g} ms"
    return LedgerRow("drive_follows_command", Standing.MADE_UP, "velocity_deviation_deg_s", cost)


def check_acceptance(machine: Machine, what: str, by: str, because: str) -> None:
    """Refuse what nobody can accept.

    Raises:
        CommandRefused: it is there, or no acceptance covers it. UsageError: a name or a reason that says nothing.
    """
    if what in NEVER_ACCEPTED:
        raise CommandRefused(f"{what}: no acceptance covers it; `gantryctl commission` proves it")
    if what not in SAFETY_INPUTS:
        raise UsageError(f"--input {what}: the safety inputs are {', '.join(SAFETY_INPUTS)}")
    bit = getattr(machine.can.inputs, what)
    if bit >= 0:
        raise CommandRefused(f"[can.inputs] {what} = {bit}: it is wired, there is nothing to accept")
    for option, text in (("by", by), ("because", because)):
        if not text.strip() or not text.isprintable() or len(text) > _LONGEST[option]:
            raise UsageError(f"--{option} {text!r}: must be printable, 1 to {_LONGEST[option]} characters")


# --- the file -------------------------------------------------------------------------------------------------


def ledger_path(directory: Path, machine: Machine) -> Path:
    """File of the acceptances, beside the commissioning record."""
    return directory / f"{machine.name}.ledger.json"


def load_acceptances(path: Path) -> tuple[Acceptance, ...]:
    """Read all acceptances, the newest last; () without a file.

    Raises:
        StateError: the file is damaged.
    """
    if not path.exists():
        return ()
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        return TypeAdapter(tuple[Acceptance, ...]).validate_python(data)
    except (OSError, ValueError, TypeError) as fault:
        raise StateError(f"{path}: cannot be read ({fault}); remove it and accept again") from None


def store_acceptances(path: Path, acceptances: Iterable[Acceptance]) -> None:
    """Write all acceptances, whole or not at all. None is ever taken out: the file shows who accepted what when."""
    data = [asdict(each) for each in acceptances]
    write_whole(path, json.dumps(data, indent=1, ensure_ascii=False) + "\n")
