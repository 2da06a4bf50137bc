"""Real machines and drives for the tests of the ledger."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gantryctl.drives.od.facts import DriveFacts, ObjectFact
from gantryctl.machine import Machine, configs_folder, load_machine, with_values
from gantryctl.operation.ledger import LedgerRow, Proofs
from gantryctl.operation.ledger.acceptance import (
    Acceptance,
    binding_of,
)
from gantryctl.operation.ledger.judging import ledger
from gantryctl.wiring import canopen as canopen_wiring
from gantryctl.wiring.virtual import virtual_node

VIRTUAL = load_machine(configs_folder() / "hust_can.toml")
REAL = with_values(VIRTUAL, {"can.interface": "socketcan", "can.channel": "can0"})


def facts_of_virtual(machine: Machine = VIRTUAL) -> DriveFacts:
    """The virtual drive as the set-up of a machine leaves it."""
    drive = canopen_wiring.canopen_drive(
        with_values(machine, {"can.interface": "simulated", "can.channel": ""})
    )
    drive.close()
    return drive.facts


FACTS = facts_of_virtual()
ALL_PROVEN = Proofs(frozenset({"silence", "sign"}))


def changed(facts: DriveFacts, **objects: int | None) -> DriveFacts:
    """Other values of objects, "o6085=5"; None takes the object away."""
    table = dict(facts.objects)
    for name, value in objects.items():
        index, _, sub = name[1:].partition("_")
        place = int(index, 16), int(sub or "0")
        if value is None:
            table.pop(place, None)
        else:
            known = table.get(place, ObjectFact(True, False, value))
            table[place] = replace(known, default=value, writable=False)
    return replace(facts, objects=table)


SILENT = changed(FACTS, o1016_1=None, o1400_5=None)


def row_of(
    what: str, facts: DriveFacts | None = FACTS, machine: Machine = REAL, proofs: Proofs = ALL_PROVEN
) -> LedgerRow:
    (row,) = [row for row in ledger(machine, facts, proofs) if row.what == what]
    return row


def without(*names: str, machine: Machine = REAL) -> Machine:
    return with_values(machine, {f"can.inputs.{name}": -1 for name in names})


def accepted(machine: Machine, what: str, facts: DriveFacts = FACTS) -> Acceptance:
    return Acceptance(
        what, "A. Person", "the chain cuts the drive's STO", "2026-01-01", "user", binding_of(machine, facts)
    )


def put_virtual_drive(monkeypatch: pytest.MonkeyPatch) -> None:
    """A virtual drive in the place of the real one: the machine knows nothing of it."""
    monkeypatch.setattr(canopen_wiring, "can_link", lambda machine: virtual_node(VIRTUAL)[0])
    monkeypatch.setattr("gantryctl.commissioning.run.can_link", lambda machine: virtual_node(VIRTUAL)[0])


EPOS = with_values(
    VIRTUAL,
    {"can.virtual_drive": "maxon EPOS4@", "can.encoder.index": 0, "can.velocity_unit": "r/min",
     "can.torque_limit_in_drive_nm": 385.0},
)  # fmt: skip
REAL_EPOS = with_values(EPOS, {"can.interface": "socketcan", "can.channel": "can0", "can.virtual_drive": ""})
