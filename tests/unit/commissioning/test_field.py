"""Drives as they are sold: which of the nine in the delivered table can be commissioned, and why the others cannot."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import pytest

from gantryctl.commissioning import Commissioning
from gantryctl.commissioning.field import FieldDrive, commission_field_drive, field_machine
from gantryctl.commissioning.results import Outcome
from gantryctl.drives.od.object_table import ObjectTable, read_object_tables
from gantryctl.errors import CommandRefused, DeviceError
from gantryctl.machine import configs_folder, load_machine, with_values
from gantryctl.operation.store import StateStore
from gantryctl.program.alarms.words import drive_error_words
from gantryctl.wiring.canopen import canopen_drive
from gantryctl.wiring.engine import build_program
from gantryctl.wiring.virtual import shipped_objects
from support.command_line import cli, done, machine_file

pytestmark = pytest.mark.can

BASE = load_machine(configs_folder() / "hust_can.toml")
TABLES = read_object_tables(shipped_objects())
# By hand from the table: no mode 9 in 6060 or 6502; neither 1016 nor 1400:05.
REFUSED: Final = {
    "maxon EPOS2 50/5": {"runs_csv"},
    "Faulhaber MCDC 73-A": {
        "runs_csv", "maps_telegrams", "stops_without_commands", "stops_without_controller",
    },
    "e35 example": {"stops_without_commands", "stops_without_controller"},
}  # fmt: skip
USABLE: Final = set(TABLES) - set(REFUSED)


def commissioned(table: ObjectTable, **how: bool) -> FieldDrive:
    return commission_field_drive(BASE, table, "", lambda line: None, **how)


def rows_of(lines: tuple[str, ...]) -> set[str]:
    return {line.partition(":")[0] for line in lines}


@pytest.mark.parametrize("name", REFUSED)
def test_a_drive_that_cannot_be_run_is_refused_before_any_step(name: str) -> None:
    found = commissioned(TABLES[name])
    assert rows_of(found.refused) == REFUSED[name]
    # A watchdog node is no cure for what else is missing.
    assert found.needs_watchdog is name.startswith("e35")
    assert (found.commissioned, found.steps) == (False, ())


@pytest.mark.parametrize("missing", ["60FF", "6040"])
def test_a_drive_without_an_object_that_is_written_first_is_refused_by_its_row(
    missing: str, tmp_path: Path
) -> None:
    """A Schunk's DCF has no 60FF: an abort of the set-up is no reason that a person can read."""
    heading, *rows = shipped_objects().read_text().splitlines()
    elmo = [row for row in rows if row.startswith("Elmo") and f",{missing}," not in row]
    source = tmp_path / "objects.csv"
    source.write_text("\n".join((heading, *elmo, f"Elmo Gold (DCF),{missing},0,absent,,,,,")) + "\n")
    table = read_object_tables(source)["Elmo Gold (DCF)"]
    found = commission_field_drive(BASE, table, str(source), lambda line: None)
    assert rows_of(found.refused) == {"runs_csv"}
    assert f"no {missing}" in found.refused[0]


# The coarsest unit of speed, 0.005 deg/s at the gantry; a unit that is written to 60A9, and 6076 in uN m.
# Inputs of an I/O node, and 6072 that ends at 1000 per mille.
@pytest.mark.parametrize(
    "name",
    [
        "Yiyou servo v1.4",
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in ("Trinamic TMCM-1617 fw1.06", "maxon EPOS4 0x1018")
        ),
    ],
)
def test_a_drive_of_the_field_passes_what_needs_no_whole_turn(name: str) -> None:
    found = commissioned(TABLES[name], whole=False)
    # The Yiyou counts increments in 6064 and 60FF and has no 608F: nothing in it shows how many a turn has.
    counts = {"knows_counts"} if name.startswith("Yiyou") else set()
    assert not {row.what for row in found.to_accept} - {"limits_torque"} - counts
    assert found.refused == ()
    outcomes = dict(found.steps)
    assert Outcome.FAILED not in outcomes.values()
    for key in ("identity", "parameters", "pdo", "silence", "sign", "velocity", "loop", "stops"):
        assert outcomes[key] is Outcome.PASSED, key


def test_a_drive_that_contradicts_its_profile_is_refused_with_both_values(tmp_path: Path) -> None:
    """The drive counts in r/min and has no 60A9: only its profile says that the machine file is wrong."""
    machine = with_values(
        field_machine(BASE, TABLES["Trinamic TMCM-1617 fw1.06"], ""), {"can.velocity_unit": "inc/s"}
    )
    with StateStore(machine, tmp_path) as store:
        work = Commissioning(machine, store, tmp_path, lambda line: None, lambda step: True)
        with pytest.raises(
            CommandRefused, match=r'velocity_unit = "inc/s", profile trinamic_tmcm_1617 says "r/min"'
        ):
            work.start(again=False)


def test_without_a_profile_the_machine_file_has_to_name_the_unit() -> None:
    machine = with_values(BASE, {"can.velocity_unit": "profile", "can.encoder.index": 0})
    with pytest.raises(
        DeviceError, match=r'\[can\] velocity_unit = "profile", and no profile fits this drive'
    ):
        canopen_drive(machine)


@pytest.mark.parametrize("name", sorted(USABLE))
def test_a_machine_file_for_each_usable_drive(name: str) -> None:
    """The set-up alone: nothing is refused, and what is not proven is for steps or for a person."""
    drive = canopen_drive(field_machine(BASE, TABLES[name], ""))
    try:
        assert drive.refusals == ()
        assert drive.opened.settings.profile is not None
        assert drive.opened.settings.profile.table == name
    finally:
        drive.close()


def test_an_alarm_gives_the_words_of_the_maker() -> None:
    machine = field_machine(BASE, TABLES["maxon EPOS4 0x1018"], "")
    drive = canopen_drive(machine)
    try:
        texts = build_program(machine, drive).axis.settings.error_texts
    finally:
        drive.close()
    assert "position sensor: index missing" in str(drive_error_words(0x7382, texts))
    # A code of CiA 402 has its own words in both languages; one that nobody knows is a number.
    assert "heartbeat" in str(drive_error_words(0x8130, texts))
    assert str(drive_error_words(0x7399, texts)) == "error 29593 (hexadecimal 7399)"


def test_the_command_tells_the_reason_and_the_count() -> None:
    told = cli("drive", "field", "--drive", "Faulhaber", "--least", 1)
    assert told.code == 1
    assert "no 1400:05, no 1016:01: the drive goes on at its last speed" in told.out
    assert told.out.rstrip().endswith(
        "0 of 1 drives can be commissioned, 0 more with a watchdog node beside them"
    )


def test_an_eds_is_tried_before_the_drive_is_bought(tmp_path: Path) -> None:
    """The EDS of a drive, written by the virtual one: the simulated drive has its objects and no others."""
    eds, config = tmp_path / "elmo.eds", tmp_path / "m.toml"
    done("drive", "sim", "--objects", shipped_objects(), "--drive", "Elmo", "--write-eds", eds)
    machine_file(config, {"drive.kind": "canopen", "control.scan_period_ms": 4.0, "can.eds": str(eds)})
    told = cli(
        "commission", "--with-sim", "--only", "parameters", "--config", config, "--out", tmp_path / "report"
    )
    assert told.code == 0, told.err
    assert "hears_sync: made up for by the answers to SYNC (no 1005" in told.out
    assert "this drive has no 60A9:00, 1005:00, 1400:05" in told.out


@pytest.mark.slow
def test_six_of_nine_drives_of_the_field_can_be_commissioned() -> None:
    found = [commissioned(table) for table in TABLES.values()]
    assert {drive.drive for drive in found if drive.commissioned} == USABLE
    # Nothing is left to a name but a torque limit that no object takes, and increments that no motion shows.
    for drive in found:
        if drive.commissioned:
            assert {row.what for row in drive.to_accept} <= {"limits_torque", "knows_counts"}
    alone = [drive.drive for drive in found if drive.needs_watchdog]
    assert alone == ["e35 example"]
    assert commissioned(TABLES["e35 example"], watchdog=True).commissioned


@pytest.mark.slow
def test_a_node_that_holds_its_enable_makes_a_drive_usable_that_watches_nothing() -> None:
    """Also its stops: from 1 and 3 deg/s the torque goes off and the brake closes, which is no ramp."""
    found = commissioned(TABLES["e35 example"], whole=False, watchdog=True)
    assert found.refused == ()
    assert dict(found.steps)["silence"] is Outcome.NOT_TESTABLE
    for key in ("nodes", "watchdog", "ramp", "stops"):
        assert dict(found.steps)[key] is Outcome.PASSED, key


def test_what_a_drive_does_not_tell_is_not_measured_as_nothing(tmp_path: Path) -> None:
    """The TMCM-6212 has no 6077: its turn gives no moment and no friction, not 0 N m of both."""
    short = with_values(BASE, {"axis.pos_min_deg": -6.0, "axis.pos_max_deg": 6.0})
    machine = field_machine(short, TABLES["Trinamic TMCM-6212 v3.22"], "")
    with StateStore(machine, tmp_path) as store:
        work = Commissioning(machine, store, tmp_path, lambda line: None, lambda step: True)
        work.start(again=False)
        results = [work.do(work.left(key)[0]) for key in ("silence", "velocity", "turn")]
    for result in results:
        assert result is not None
        assert result.outcome is Outcome.PASSED
        assert not [name for name in result.figures if name.endswith("_nm")]
    assert "tells no torque" in work.progress.results["turn"].proof
