"""Proofs of commissioning: the record of a CAN machine, and the stop of its drive without a controller."""

from __future__ import annotations

import hashlib
import json
import tomllib
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.errors import StateError
from gantryctl.files import write_whole
from gantryctl.image import LinkHealth
from gantryctl.machine import Machine
from gantryctl.operation.ledger import LedgerRow, Standing, lacks, ledger, ledger_path, load_acceptances
from gantryctl.operation.store import StateStore, now_text
from gantryctl.ports import Drive
from gantryctl.program import Code
from gantryctl.program.alarms.reason import ClearedBy, Reason
from gantryctl.program.alarms.words import Said, Words

# A change in one of these tables makes the proofs void; speeds and monitors may change.
_PROVEN: Final = ("axis", "control", "motor", "encoder", "brake", "drive", "can")


@dataclass(frozen=True)
class CommissioningRecord:
    """Drive and configuration that `gantryctl commission` has proven, and the report that shows it.

    Attributes:
        drive: vendor, product and serial number of object 1018.
    """

    machine: str
    proven_hash: str
    drive: str
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
    """File of the record, beside the other retained state of the machine."""
    return directory / f"{machine.name}.commissioned.toml"


def load_record(path: Path) -> CommissioningRecord | None:
    """Read the record; None when there is no file.

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


class SilentMasterProof(NamedTuple):
    """The last time that a drive was seen to stop the axis of a silent controller.

    Attributes:
        drive: vendor, product and serial number of object 1018.
        restart_marker: number left in the drive, erased by its restart; None where the drive takes none.
    """

    drive: str
    restart_marker: int | None
    date: str


def silent_master_proof_path(directory: Path, machine: Machine) -> Path:
    """File of the proof, beside the commissioning record."""
    return directory / f"{machine.name}.silence.json"


def store_silent_master_proof(path: Path, drive_key: str, restart_marker: int | None) -> None:
    """Keep that the proof was passed just now, with the marker that was left in the drive."""
    # The key is `mark` in files of all versions.
    proof = {"drive": drive_key, "mark": restart_marker, "date": now_text()}
    write_whole(path, json.dumps(proof) + "\n")


def load_silent_master_proof(path: Path) -> SilentMasterProof:
    """Read the proof; the proof of no drive without a file that can be read."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        return SilentMasterProof(str(data["drive"]), data["mark"], str(data["date"]))
    # A proof that cannot be read is no proof: the drive is then asked to show it again, in seconds.
    except (OSError, ValueError, KeyError, TypeError):
        return SilentMasterProof("", None, "")


def bus_reasons(
    machine: Machine, store: StateStore | None, drive: Drive, *, commissioning: bool = False
) -> tuple[Reason, ...]:
    """Why a drive on a bus may not be enabled; () for any other drive.

    Args:
        commissioning: the record is what is being made; what nobody has accepted counts all the same.
    """
    if drive.refusals:
        return (Reason(Code.CFG_CAN_01, {"parameters": "; ".join(drive.refusals)}, ClearedBy.RESTART),)
    health = drive.health()
    if health is None or store is None or not must_be_proven(machine):
        return ()
    missing = why_inputs_missing(read_ledger(machine, store.directory, inputs_sent=health.inputs_sent))
    if missing is not None or commissioning:
        return () if missing is None else (missing,)
    record = load_record(record_path(store.directory, machine))
    proof = load_silent_master_proof(silent_master_proof_path(store.directory, machine))
    found = (why_not_commissioned(machine, record, health.drive_key), why_silence_not_proven(proof, health))
    return tuple(
        Reason(code, {"why": why}, ClearedBy.COMMISSIONING)
        for code, why in zip((Code.CFG_CAN_02, Code.CFG_CAN_03), found, strict=True)
        if why
    )


def must_be_proven(machine: Machine) -> bool:
    """A drive that is not a virtual one: nothing of it is known before it was proven."""
    return machine.on_bus and not machine.plant_is_local and machine.can.commissioning_required


def read_ledger(machine: Machine, directory: Path, *, inputs_sent: bool = True) -> tuple[LedgerRow, ...]:
    """The ledger of a machine, with what is kept in its state directory; `inputs_sent` as the drive has shown.

    Raises:
        StateError: a file is damaged.
    """
    bound_to = proven_hash(machine)
    record = load_record(record_path(directory, machine))
    steps = record.steps if record is not None and record.proven_hash == bound_to else ()
    acceptances = load_acceptances(ledger_path(directory, machine))
    return ledger(machine, acceptances, bound_to, steps, inputs_sent=inputs_sent)


def accepted_lacks(machine: Machine, store: StateStore | None) -> tuple[str, ...]:
    """What persons have accepted, for the journal and for whoever opens the machine."""
    if store is None or not must_be_proven(machine):
        return ()
    rows = read_ledger(machine, store.directory)
    return tuple(f"ledger: {row.text}" for row in rows if row.standing is Standing.ACCEPTED)


def why_inputs_missing(rows: tuple[LedgerRow, ...]) -> Reason | None:
    """The reason against power while a safety input is neither wired nor accepted."""
    missing = lacks(rows)
    if not missing:
        return None
    return Reason(Code.CFG_CAN_04, {"inputs": ", ".join(missing)}, ClearedBy.COMMISSIONING)


def why_not_commissioned(
    machine: Machine, record: CommissioningRecord | None, drive_key: str
) -> Words | Said | None:
    """Say what the record lacks for this drive and configuration; None when it fits."""
    if record is None:
        return Words.NO_RECORD(machine=machine.name)
    if record.drive != drive_key:
        return Words.OTHER_DRIVE(drive=drive_key, machine=machine.name, proven=record.drive)
    if record.proven_hash != proven_hash(machine):
        return Words.CONFIGURATION_CHANGED(machine=machine.name, date=record.date)
    return None


def why_silence_not_proven(proof: SilentMasterProof, health: LinkHealth) -> Words | Said | None:
    """Say why the proof does not hold for the drive as it is now; None when it does."""
    if proof.drive != health.drive_key:
        return Words.SILENCE_NOT_PROVEN
    # A restart may load other parameters than those that were proven (6007, 605E, 1016 decide what a silence does).
    if proof.restart_marker is not None and proof.restart_marker != health.restart_marker:
        return Words.RESTARTED_SINCE(date=proof.date)
    return None
