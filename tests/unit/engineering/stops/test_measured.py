"""What commissioning has measured stands beside what the simulator says, and only while it is of this configuration."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from gantryctl.engineering.stops.measured import MeasuredStops, measured_stops
from gantryctl.engineering.stops.text import stops_notes
from gantryctl.machine import configs_folder, load_machine, with_values
from gantryctl.operation.ledger.acceptance import proven_hash
from gantryctl.operation.proofs import CommissioningRecord, record_path, store_record

pytestmark = pytest.mark.can

MACHINE = load_machine(configs_folder() / "hust_can.toml")
RECORD = CommissioningRecord(
    machine=MACHINE.name, proven_hash=proven_hash(MACHINE), drive="d", software="s", nodes=(), date="2026-11-01",
    by="A. Person",
    report_hash="r", steps=("stops",), accepted=(), measured={"quick_stop_dec_deg_s2": 5.297, "silent_stop_s": 0.052},
)  # fmt: skip


def test_measured_stops_come_from_the_record(tmp_path: Path) -> None:
    assert measured_stops(MACHINE, tmp_path) is None
    store_record(record_path(tmp_path, MACHINE), RECORD)
    found = measured_stops(MACHINE, tmp_path)
    assert found == MeasuredStops("2026-11-01", "A. Person", 5.297, 0.052)
    first, *others = stops_notes(MACHINE, found)
    assert first == (
        "All figures of the table are simulated, on the full plant of the machine file; measured by A. Person on "
        "2026-11-01: quick stop 5.30 deg/s2, a silent controller's axis stops after 52 ms."
    )
    # A page shows each as a paragraph: half a sentence is none.
    assert all(note[0].isupper() and note.endswith(".") for note in others)
    assert "nothing was measured on this machine" in stops_notes(MACHINE, None)[0]
    store_record(record_path(tmp_path, MACHINE), replace(RECORD, measured={}))
    assert stops_notes(MACHINE, measured_stops(MACHINE, tmp_path))[0].endswith("2026-11-01: nothing.")


def test_a_record_of_another_configuration_says_nothing_of_this_one(tmp_path: Path) -> None:
    store_record(record_path(tmp_path, MACHINE), RECORD)
    assert measured_stops(with_values(MACHINE, {"control.kpp_per_s": 9.0}), tmp_path) is None
