"""Proofs of commissioning: of which drive, nodes, configuration and restart they are; by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.errors import StateError
from gantryctl.image import DriveState, LinkHealth, NodeHealth
from gantryctl.operation import proofs, run
from gantryctl.operation.ledger.acceptance import proven_hash
from gantryctl.operation.ledger.rows import LedgerRow, Standing
from gantryctl.operation.opening import new_machine
from gantryctl.operation.proofs import (
    CommissioningRecord,
    SilentMasterProof,
    ledger_notes,
    ledger_reasons,
    ledger_shown,
    load_record,
    load_silent_master_proof,
    store_record,
    store_silent_master_proof,
    why_in_fault,
    why_not_commissioned,
    why_silence_not_proven,
)
from gantryctl.operation.run import AxisRun
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.reason import ClearedBy
from gantryctl.program.alarms.words import Words

from .kept_bench import MACHINE, REAL

SCALE = new_machine(MACHINE, 20.0).scale
RECORD = CommissioningRecord(
    REAL.name, proven_hash(REAL), "A", "1.0", ("5 X", "6 Y"), "2026-01-01", "x", "", ("sign",), (), {}
)


def health(drive: str = "A", software: str = "1.0", nodes: tuple[str, ...] = ("5 X", "6 Y")) -> LinkHealth:
    beside = tuple(NodeHealth(int(number), key, 0, 0, 0) for number, key in map(str.split, nodes))
    return LinkHealth(drive, software, nodes=beside)


@pytest.mark.parametrize(
    ("record", "now", "words"),
    [
        (RECORD, {}, None),
        (None, {}, Words.NO_RECORD),
        (RECORD, {"drive": "B"}, Words.OTHER_DRIVE),
        (RECORD, {"software": "1.1"}, Words.OTHER_DRIVE),
        (RECORD, {"software": ""}, Words.OTHER_DRIVE),
        (RECORD, {"nodes": ("5 X", "6 Z")}, Words.OTHER_NODES),
        (RECORD, {"nodes": ("5 X",)}, Words.OTHER_NODES),
        (RECORD, {"nodes": ("5 X", "6 Y", "7 Z")}, Words.OTHER_NODES),
        (replace(RECORD, proven_hash="other"), {}, Words.CONFIGURATION_CHANGED),
    ],
)
def test_a_record_is_of_one_drive_with_its_firmware_its_nodes_and_one_configuration(
    record: Any, now: dict[str, Any], words: Any
) -> None:
    why: Any = why_not_commissioned(REAL, record, health(**now))
    assert (None if why is None else why.words) is words


def test_another_firmware_is_told_with_that_of_the_record() -> None:
    why = str(why_not_commissioned(REAL, RECORD, health(software="1.1")))
    assert "the drive on the bus is A firmware 1.1" in why
    assert why.endswith("was commissioned with A firmware 1.0")


@pytest.mark.parametrize(
    ("lacking", "steps"), [((), None), (("sign",), "sign"), (("turn", "sign"), "sign, turn")]
)
def test_each_step_that_is_missing_is_named(lacking: tuple[str, ...], steps: str | None) -> None:
    rows = (
        LedgerRow("has", Standing.PROVEN, proof="silence"),
        *(LedgerRow(each, Standing.LACKING, proof=each) for each in lacking),
    )
    why: Any = why_not_commissioned(REAL, RECORD, health(), rows)
    assert why == (None if steps is None else Words.STEPS_MISSING(steps=steps))


@pytest.mark.parametrize(
    ("drive", "marker", "now", "words"),
    [
        ("A", 7, 7, None),
        ("A", 7, 8, Words.RESTARTED_SINCE),
        ("A", 7, None, Words.RESTARTED_SINCE),
        ("A", None, None, None),
        ("A", None, 8, None),
        ("B", 7, 7, Words.SILENCE_NOT_PROVEN),
        ("", None, None, Words.SILENCE_NOT_PROVEN),
    ],
)
def test_a_proof_of_silence_is_of_one_drive_since_its_last_restart(
    drive: str, marker: Any, now: Any, words: Any
) -> None:
    proof = SilentMasterProof(drive, marker, "2026-01-01")
    why = why_silence_not_proven(proof, LinkHealth("A", restart_marker=now))
    assert getattr(why, "words", why) is words


@pytest.mark.parametrize("state", DriveState)
def test_a_drive_that_was_in_fault_before_the_start_is_told(state: DriveState) -> None:
    read = SimpleNamespace(state=state, error_code=0x8611)
    drive: Any = SimpleNamespace(read=lambda: read, identity=lambda: SCALE.identity)
    reason = why_in_fault(drive)
    assert (reason is not None) is (state in (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE))
    if reason is not None:
        assert reason.cleared_by is ClearedBy.RESET


@pytest.mark.parametrize("marker", [7, None])
def test_a_proof_of_silence_is_read_as_it_was_kept(marker: int | None, tmp_path: Path) -> None:
    path = tmp_path / "silence.json"
    assert load_silent_master_proof(path).drive == ""
    store_silent_master_proof(path, "A", marker)
    found = load_silent_master_proof(path)
    assert (found.drive, found.restart_marker) == ("A", marker)
    path.write_text("{")
    assert load_silent_master_proof(path).drive == ""


def row(standing: Standing, fastest: float | None = None) -> LedgerRow:
    return LedgerRow(f"{standing.name} {fastest}", standing, "by", speed_max_deg_s=fastest)


ROWS = (*map(row, Standing), row(Standing.PROVEN, 5.4))


def test_what_persons_have_accepted_and_what_limits_the_speed_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of a virtual drive nothing needs to be accepted."""
    assert [note.split(":")[1].strip() for note in ledger_notes(REAL, ROWS)] == [
        "ACCEPTED None",
        "PROVEN 5.4",
    ]
    assert [note.split(":")[1].strip() for note in ledger_notes(MACHINE, ROWS)] == ["PROVEN 5.4"]
    monkeypatch.setattr(proofs, "read_ledger", lambda *_: ROWS)
    assert [line.split(":")[0] for line in ledger_shown(REAL, Path())] == [
        "ACCEPTED None",
        "LACKING None",
        "PROVEN 5.4",
    ]
    assert ledger_shown(MACHINE, Path()) == ()


def test_only_rows_that_are_too_slow_are_named_as_that() -> None:
    """0.6 deg/s is the lowest setting itself; a row without a speed limits none."""
    rows = (
        row(Standing.PROVEN, 0.5), row(Standing.PROVEN, 0.6), row(Standing.PROVEN), row(Standing.PROVEN, 5.4),
    )  # fmt: skip
    (reason,) = ledger_reasons(REAL, rows)
    assert "PROVEN 0.5" in str(reason.values["lacks"])
    assert not [other for other in ("0.6", "None", "5.4") if other in str(reason.values["lacks"])]
    assert ledger_reasons(REAL, rows[1:]) == ()


@pytest.mark.parametrize(("real", "codes"), [(True, [Code.CFG_CAN_04]), (False, [])])
def test_a_lack_of_a_real_drive_counts_whatever_the_machine_file_says_of_it(
    real: bool, codes: list[Code]
) -> None:
    """As an EDS is judged by the file of a machine with a virtual drive: a person would have to accept the lack."""
    lack = LedgerRow("limits_torque", Standing.LACKING, acceptable=True)
    assert [reason.code for reason in ledger_reasons(MACHINE, (lack,), real=real)] == codes


def test_other_nodes_are_told_with_those_of_the_record_and_no_node_with_a_dash() -> None:
    why = why_not_commissioned(REAL, RECORD, health(nodes=()))
    assert why is not None
    assert (why.values["nodes"], why.values["proven"]) == ("-", "5 X, 6 Y")
    why = why_not_commissioned(REAL, RECORD, health(nodes=("5 X", "6 Z")))
    assert why is not None
    assert why.values["nodes"] == "5 X, 6 Z"


@pytest.mark.parametrize("damage", ["drive = ", 'drive = "A"\n'])
def test_a_damaged_record_is_no_missing_one(tmp_path: Path, damage: str) -> None:
    """The person is told to commission again, and which file is damaged."""
    path = tmp_path / "record.toml"
    assert load_record(path) is None
    path.write_text(damage, encoding="utf-8")
    with pytest.raises(StateError, match=r"record\.toml: the commissioning record cannot be read"):
        load_record(path)
    store_record(path, RECORD)
    assert load_record(path) == RECORD


def test_a_run_is_held_by_record_and_brake_unless_it_says_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[dict[str, Any]] = []

    def opens(*_: Any, **options: Any) -> None:
        asked.append(options)
        raise StateError

    monkeypatch.setattr(run, "open_axis", opens)
    for options in ({}, {"commissioning": True}):
        with pytest.raises(StateError):
            AxisRun(MACHINE, **options)
    assert [options["commissioning"] for options in asked] == [False, True]
