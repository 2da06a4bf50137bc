"""Acceptance of a lack by a person: what it is bound to, what it may cover, and its file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final, NamedTuple

from pydantic import TypeAdapter

from gantryctl.drives.od.facts import DriveFacts
from gantryctl.errors import CommandRefused, StateError, UsageError
from gantryctl.files import write_whole
from gantryctl.machine import Machine
from gantryctl.operation.ledger.rows import LedgerRow, Standing

_LONGEST: Final = {"by": 64, "because": 300}
# A change in one of these tables makes proofs and acceptances void; speeds and monitors may change.
_PROVEN: Final = ("axis", "control", "motor", "encoder", "brake", "drive", "can")


def proven_hash(machine: Machine) -> str:
    """Hash of everything in a machine file that proofs and acceptances depend on."""
    parts = {name: getattr(machine, name).model_dump(mode="json") for name in _PROVEN}
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


class Binding(NamedTuple):
    """What an acceptance is valid for; it dies with any change.

    Attributes:
        drive: vendor, product and serial number of object 1018.
        software: firmware of the drive.
        parameters: checksum of the values that decide what the drive does.
        machine: hash of the machine file, as of a proof.
    """

    drive: str
    software: str
    parameters: str
    machine: str


def binding_of(machine: Machine, facts: DriveFacts) -> Binding:
    """Binding of a machine with its drive as it is now."""
    from gantryctl.wiring.canopen import parameter_checksum  # only a machine on a bus loads the bus

    return Binding(facts.key, facts.software, parameter_checksum(machine, facts), proven_hash(machine))


@dataclass(frozen=True)
class Acceptance:
    """A person takes a lack upon himself.

    Attributes:
        by, because: name and reason as they were given; entered_by: the user who typed them.
    """

    what: str
    by: str
    because: str
    date: str
    entered_by: str
    bound_to: Binding


def check_acceptance(rows: Iterable[LedgerRow], what: str, by: str, because: str) -> None:
    """Refuse what nobody can accept.

    Raises:
        CommandRefused: it is there, or no acceptance covers it. UsageError: no such lack, or a name or a reason that
            says nothing.
    """
    by_name = {row.what: row for row in rows}
    row = by_name.get(what)
    if row is None:
        raise UsageError(f"--lack {what}: the rows of this machine are {', '.join(by_name)}")
    if row.standing not in (Standing.LACKING, Standing.ACCEPTED):
        raise CommandRefused(f"{row.text}: there is nothing to accept")
    if not row.acceptable:
        shown = f"; `gantryctl commission --only {row.proof}` shows it" if row.proof else ""
        raise CommandRefused(f"{row.text}: no acceptance covers it{shown}")
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
