"""The commissioning record of a CAN machine: which drive was proven, with which configuration, and by which report."""

from __future__ import annotations

import hashlib
import json
import tomllib
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Final

from gantryctl.errors import CommandRefused, StateError
from gantryctl.files import write_whole
from gantryctl.machine import Machine

_PROVEN: Final = ("axis", "control", "motor", "encoder", "brake", "drive", "can")
"""Tables whose change makes the proofs void; speeds and monitors may change."""


@dataclass(frozen=True)
class CommissioningRecord:
    """What `gantryctl commission` has proven."""

    machine: str
    proven_hash: str
    drive: str
    """Vendor, product and serial number of 1018."""
    software: str
    date: str
    by: str
    report_hash: str
    steps: tuple[str, ...]


def proven_hash(machine: Machine) -> str:
    """Hash of everything that the proofs depend on."""
    parts = {name: getattr(machine, name).model_dump(mode="json") for name in _PROVEN}
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def record_path(directory: Path, machine: Machine) -> Path:
    """Where the record lies: with the other retained state of the machine."""
    return directory / f"{machine.name}.commissioned.toml"


def load_record(path: Path) -> CommissioningRecord | None:
    """The record; None when there is none.

    Raises:
        StateError: the file is damaged.
    """
    if not path.exists():
        return None
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
        known = {field.name: data[field.name] for field in fields(CommissioningRecord)}
        return CommissioningRecord(**{**known, "steps": tuple(known["steps"])})
    except (OSError, ValueError, KeyError, TypeError) as fault:
        raise StateError(
            f"{path}: the commissioning record cannot be read ({fault}); commission again"
        ) from None


def store_record(path: Path, record: CommissioningRecord) -> None:
    """Write the record, whole or not at all."""
    lines = [f"{name} = {json.dumps(value, ensure_ascii=False)}" for name, value in asdict(record).items()]
    write_whole(path, "\n".join(lines) + "\n")


def check_record(machine: Machine, record: CommissioningRecord | None, drive_key: str) -> None:
    """Whether the machine may move.

    Raises:
        CommandRefused: not commissioned, another drive, or another configuration than was proven.
    """
    again = f"gantryctl commission --config FILE commissions {machine.name}"
    if record is None:
        raise CommandRefused(f"{machine.name} has no commissioning record: its drive is not proven · {again}")
    if record.drive != drive_key:
        raise CommandRefused(
            f"the drive on the bus is {drive_key}, {machine.name} was commissioned with {record.drive} · {again} again"
        )
    if record.proven_hash != proven_hash(machine):
        raise CommandRefused(
            f"the configuration has changed since {machine.name} was commissioned on {record.date} · {again} again"
        )
