"""Proofs of commissioning: the record of a CAN machine, and the stop of its drive without a controller."""

from __future__ import annotations

import json
import tomllib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import NamedTuple

from gantryctl.drives.od.facts import DriveFacts
from gantryctl.errors import StateError
from gantryctl.files import write_whole
from gantryctl.image import LinkHealth
from gantryctl.machine import Machine
from gantryctl.operation.ledger.acceptance import ledger_path, load_acceptances, proven_hash
from gantryctl.operation.ledger.judging import impossible, lacks, ledger, speed_max_deg_s, unproven, unset
from gantryctl.operation.ledger.kept_facts import facts_path, load_facts
from gantryctl.operation.ledger.rows import RAMP_DEG_S2, LedgerRow, Proofs, Standing
from gantryctl.operation.ledger.silence import SILENCE_STEP
from gantryctl.operation.store import StateStore, now_text
from gantryctl.ports import Drive
from gantryctl.program import Code
from gantryctl.program.alarms.reason import ClearedBy, Reason
from gantryctl.program.alarms.words import Clauses, Said, Words, drive_error_words
from gantryctl.program.feedback import FAULTS


@dataclass(frozen=True)
class CommissioningRecord:
    """Drive and configuration that `gantryctl commission` has proven, and the report that shows it.

    Attributes:
        drive: vendor, product and serial number of object 1018. software: its firmware.
        nodes: node id and the same of each node beside the drive.
        steps: those that have passed.
        accepted: rows of the ledger that a person has accepted, in words.
        measured: figures that the ledger and the stops are computed with (`ledger.rows.MEASURED`).
    """

    machine: str
    proven_hash: str
    drive: str
    software: str
    nodes: tuple[str, ...]
    date: str
    by: str
    report_hash: str
    steps: tuple[str, ...]
    accepted: tuple[str, ...]
    measured: dict[str, float]


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
        for name in ("nodes", "steps", "accepted"):
            known[name] = tuple(known[name])
        return CommissioningRecord(**known)
    except (OSError, ValueError, KeyError, TypeError) as fault:
        raise StateError(
            f"{path}: the commissioning record cannot be read ({fault}); commission again"
        ) from None


def store_record(path: Path, record: CommissioningRecord) -> None:
    """Write the record, whole or not at all."""
    lines = [
        f"{field.name} = {json.dumps(getattr(record, field.name), ensure_ascii=False)}"
        for field in fields(record)
        if field.name != "measured"
    ]
    lines += ["", "[measured]", *(f"{name} = {float(value)!r}" for name, value in record.measured.items())]
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
        commissioning: the record is what is being made; what no step of it shows counts all the same.
    """
    if drive.refusals:
        return (Reason(Code.CFG_CAN_01, {"parameters": "; ".join(drive.refusals)}, ClearedBy.RESTART),)
    health = drive.health()
    if health is None:
        return ()
    rows = ledger_of(machine, store, drive)
    found = ledger_reasons(machine, rows)
    if found or commissioning or store is None or not must_be_proven(machine):
        return found
    record = load_record(record_path(store.directory, machine))
    proof = load_silent_master_proof(silent_master_proof_path(store.directory, machine))
    # A relay outside of the drive does not change with a boot-up of the drive.
    watches = any(row.proof == SILENCE_STEP for row in rows)
    found_by_code = (
        (Code.CFG_CAN_02, why_not_commissioned(machine, record, health, rows)),
        (Code.CFG_CAN_03, why_silence_not_proven(proof, health) if watches else None),
    )
    return tuple(
        Reason(code, {"why": words}, ClearedBy.COMMISSIONING) for code, words in found_by_code if words
    )


def why_in_fault(drive: Drive) -> Reason | None:
    """Say that an open drive was in fault before this start; None for one that was not."""
    # A controller that was killed cannot keep what stopped the axis: the drive's fault is all that tells of it.
    seen = drive.read()
    if seen.state not in FAULTS:
        return None
    error = drive_error_words(seen.error_code, drive.identity().error_texts)
    return Reason(Code.DRV_15, {"error": error}, ClearedBy.RESET)


def must_be_proven(machine: Machine) -> bool:
    """A drive that is not a virtual one: nothing of it is known before it was proven."""
    return machine.on_bus and not machine.plant_is_local and machine.can.commissioning_required


# --- the ledger ------------------------------------------------------------------------------------------------


def read_ledger(
    machine: Machine, directory: Path, facts: DriveFacts | None = None, proofs: Proofs | None = None
) -> tuple[LedgerRow, ...]:
    """The ledger of a machine, with what is kept in its state directory.

    Args:
        facts: of the drive as it is now; those of its last set-up when not given.
        proofs: of a commissioning under way; those of its record when not given.

    Raises:
        StateError: a file is damaged.
    """
    facts = facts or load_facts(facts_path(directory, machine))
    if proofs is None:
        proofs = _recorded(machine, facts, load_record(record_path(directory, machine)))
    return ledger(machine, facts, proofs, load_acceptances(ledger_path(directory, machine)))


def _recorded(machine: Machine, facts: DriveFacts | None, record: CommissioningRecord | None) -> Proofs:
    """What a record shows of this drive in this configuration."""
    if record is None or facts is None or (facts.key, facts.software) != (record.drive, record.software):
        return Proofs()
    if record.proven_hash != proven_hash(machine):
        return Proofs()
    return Proofs(frozenset(record.steps), frozenset(), record.measured)


def own_ramp_deg_s2(machine: Machine, directory: Path) -> float | None:
    """Quick-stop deceleration of a drive with a ramp of its own, as commissioning has measured it; None of any other.

    Args:
        directory: of the machine's retained state.

    Raises:
        StateError: a file is damaged.
    """
    if not machine.on_bus:
        return None
    record = load_record(record_path(directory, machine))
    proofs = _recorded(machine, load_facts(facts_path(directory, machine)), record)
    return proofs.measured.get(RAMP_DEG_S2)


def ledger_of(machine: Machine, store: StateStore | None, drive: Drive) -> tuple[LedgerRow, ...]:
    """The ledger of a machine with its open drive; () without a bus."""
    if not machine.on_bus:
        return ()
    from gantryctl.wiring.canopen import facts_of_drive  # only a machine on a bus loads the bus

    facts = facts_of_drive(drive)
    return ledger(machine, facts) if store is None else read_ledger(machine, store.directory, facts)


def ledger_reasons(
    machine: Machine, rows: tuple[LedgerRow, ...], *, real: bool = False
) -> tuple[Reason, ...]:
    """The reasons against power by what is lacking and no step of commissioning will show, the gravest first.

    A virtual drive hurts nobody: what a person could accept of it counts as accepted.

    Args:
        real: the drive is a real one, whatever the machine file says of it.
    """
    cleared = ClearedBy.COMMISSIONING
    found = []
    if missing := impossible(rows):
        found.append(Reason(Code.CFG_CAN_05, {"lacks": _lacks(missing)}, cleared))
    slowest = machine.speed.setting_min_deg_s
    if speed_max_deg_s(rows) < slowest:
        limiting = tuple(
            row for row in rows if row.speed_max_deg_s is not None and row.speed_max_deg_s < slowest
        )
        found.append(Reason(Code.CFG_CAN_05, {"lacks": _lacks(limiting)}, cleared))
    open_lacks = (*unset(rows), *(lacks(rows) if real or must_be_proven(machine) else ()))
    if open_lacks:
        found.append(Reason(Code.CFG_CAN_04, {"lacks": _lacks(open_lacks)}, cleared))
    return tuple(found)


def _lacks(rows: tuple[LedgerRow, ...]) -> Clauses:
    return Clauses(row.lack for row in rows)


def ledger_shown(machine: Machine, directory: Path) -> tuple[str, ...]:
    """What `status` shows of the ledger of a machine with a real drive; () for any other.

    Raises:
        StateError: a file is damaged.
    """
    if not must_be_proven(machine):
        return ()
    rows = read_ledger(machine, directory)
    return tuple(
        row.text
        for row in rows
        if row.standing in (Standing.ACCEPTED, Standing.LACKING) or row.speed_max_deg_s is not None
    )


def ledger_notes(machine: Machine, rows: tuple[LedgerRow, ...]) -> tuple[str, ...]:
    """What persons have accepted, and what limits the speed: for the journal and for whoever opens the machine."""
    accepted = must_be_proven(machine)
    return tuple(
        f"ledger: {row.text}"
        for row in rows
        if (accepted and row.standing is Standing.ACCEPTED) or row.speed_max_deg_s is not None
    )


def why_not_commissioned(
    machine: Machine,
    record: CommissioningRecord | None,
    health: LinkHealth,
    rows: tuple[LedgerRow, ...] = (),
) -> Words | Said | None:
    """Say what the record lacks for this drive, the nodes beside it and this configuration; None when it fits."""
    if record is None:
        return Words.NO_RECORD(machine=machine.name)
    # Another firmware of the same drive may do anything else.
    drive, proven = (
        f"{key} firmware {software or '-'}"
        for key, software in ((health.drive_key, health.software), (record.drive, record.software))
    )
    if drive != proven:
        return Words.OTHER_DRIVE(drive=drive, machine=machine.name, proven=proven)
    if record.nodes != health.node_keys:
        nodes, proven = (", ".join(keys) or "-" for keys in (health.node_keys, record.nodes))
        return Words.OTHER_NODES(nodes=nodes, machine=machine.name, proven=proven)
    if record.proven_hash != proven_hash(machine):
        return Words.CONFIGURATION_CHANGED(machine=machine.name, date=record.date)
    if missing := unproven(rows):
        return Words.STEPS_MISSING(steps=", ".join(sorted({row.proof for row in missing})))
    return None


def why_silence_not_proven(proof: SilentMasterProof, health: LinkHealth) -> Words | Said | None:
    """Say why the proof does not hold for the drive as it is now; None when it does."""
    if proof.drive != health.drive_key:
        return Words.SILENCE_NOT_PROVEN
    # A restart may load other parameters than those that were proven (6007, 605E, 1016 decide what a silence does).
    if proof.restart_marker is not None and proof.restart_marker != health.restart_marker:
        return Words.RESTARTED_SINCE(date=proof.date)
    return None
