"""The rows of a machine: one function of machine file, drive, proofs and acceptances, for whoever asks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

from gantryctl.drives.od.facts import DriveFacts
from gantryctl.machine import Machine
from gantryctl.operation.ledger.acceptance import Acceptance, Binding, binding_of
from gantryctl.operation.ledger.equipment import consequence_rows, counts_row, csv_row, telegram_row, unit_row
from gantryctl.operation.ledger.inputs import SAFETY_INPUTS, following_row, input_row
from gantryctl.operation.ledger.limits import brake_row, ramp_row, speed_row, torque_row
from gantryctl.operation.ledger.rows import LedgerRow, Proofs, Question, Standing
from gantryctl.operation.ledger.silence import silence_rows
from gantryctl.program.alarms.words import Clauses, Words

NOTHING_PROVEN: Final = Proofs()


def ledger(
    machine: Machine,
    facts: DriveFacts | None,
    proofs: Proofs = NOTHING_PROVEN,
    acceptances: Sequence[Acceptance] = (),
) -> tuple[LedgerRow, ...]:
    """The rows of a machine with a drive on a bus.

    Args:
        facts: the drive as its set-up leaves it (`wiring.canopen.set_up_facts` of an EDS); None before it was asked.
        proofs: what commissioning has shown of this drive in this configuration.
        acceptances: the newest last; those of another drive, firmware, parameters or configuration do not count.
    """
    rows = [input_row(machine, name, facts) for name in SAFETY_INPUTS]
    rows.append(following_row(machine))
    if facts is None:
        return tuple(rows)
    # Only a machine on a bus loads the bus.
    from gantryctl.wiring.canopen import parameters_of, profile_of_drive

    q = Question(machine, facts, parameters_of(machine, facts), profile_of_drive(machine, facts), proofs)
    rows += [
        csv_row(q),
        telegram_row(q),
        *silence_rows(q),
        torque_row(q),
        speed_row(q),
        ramp_row(q),
        brake_row(q),
        counts_row(q),
        unit_row(q),
        *consequence_rows(q),
    ]
    bound_to = binding_of(machine, facts)
    return tuple(_accepted(row, acceptances, bound_to) for row in rows)


def known_of_model(machine: Machine, facts: DriveFacts) -> tuple[str, ...]:
    """What the profile of a drive says of its model before anything is tried: its lacks and how it saves, in lines."""
    # Only a machine on a bus loads the bus.
    from gantryctl.wiring.canopen import profile_of_drive

    profile = profile_of_drive(machine, facts)
    if profile is None:
        return ()
    return (
        f"profile {profile.name} ({profile.tried.value})",
        *(f"known of the model: lacks {what}: {text}" for what, text in profile.lacks.items()),
        f"known of the model: stores by {profile.saving.text}",
    )


def _accepted(row: LedgerRow, acceptances: Sequence[Acceptance], bound_to: Binding) -> LedgerRow:
    """The row as a person has accepted it; a failed proof and what nobody may accept stay as they are."""
    if not (row.lacking and row.acceptable):
        return row
    for each in reversed(acceptances):  # the newest counts
        if each.what == row.what and each.bound_to == bound_to:
            said = Words.LEDGER_ENTERED_BY(because=each.because, date=each.date, user=each.entered_by)
            return row._replace(standing=Standing.ACCEPTED, by=each.by, detail=Clauses((said, *row.detail)))
    return row


def lacks(rows: Iterable[LedgerRow]) -> tuple[LedgerRow, ...]:
    """What a person could accept and nobody has."""
    return tuple(row for row in rows if row.lacking and row.acceptable)


def unset(rows: Iterable[LedgerRow]) -> tuple[LedgerRow, ...]:
    """What a key of the machine file would give."""
    return tuple(row for row in rows if row.lacking and row.by_file)


def impossible(rows: Iterable[LedgerRow]) -> tuple[LedgerRow, ...]:
    """What no step of commissioning shows, no key gives and nobody may accept."""
    return tuple(row for row in rows if row.lacking and not (row.acceptable or row.proof or row.by_file))


def unproven(rows: Iterable[LedgerRow]) -> tuple[LedgerRow, ...]:
    """What a step of commissioning has yet to show."""
    return tuple(row for row in rows if row.lacking and row.proof)


def speed_max_deg_s(rows: Iterable[LedgerRow]) -> float:
    """Highest speed that the ledger allows; inf without a limit."""
    return min((row.speed_max_deg_s for row in rows if row.speed_max_deg_s is not None), default=math.inf)
