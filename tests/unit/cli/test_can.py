"""can scan, drive and commission on the command line, with the virtual drive inside the process."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from gantryctl.drives.canopen.bus.sdo import SdoClient
from gantryctl.machine import configs_folder, load_machine, with_values
from gantryctl.machine.effective import to_toml
from gantryctl.operation.store import StateStore
from support.command_line import cli

pytestmark = pytest.mark.can

CONFIG = configs_folder() / "hust_can.toml"


def test_scan_names_the_drive_and_what_is_dangerous() -> None:
    answer = cli("can", "scan", "--config", CONFIG)
    assert answer.code == 0
    assert "node 2: gantryctl virtual drive" in answer.out
    assert "nothing watches the controller" in answer.out


def test_scan_compares_with_an_eds(tmp_path: Path) -> None:
    eds = tmp_path / "drive.eds"
    assert cli("drive", "sim", "--write-eds", eds).code == 0
    assert "EDS belongs to it" in cli("can", "scan", "--config", CONFIG, "--eds", eds).out


def test_an_unknown_interface_is_one_line() -> None:
    answer = cli("can", "scan", "--config", CONFIG, "--can", "carrier_pigeon")
    assert answer.code == 2
    assert "python-can has no such interface" in answer.err


def test_status_and_diff_only_look() -> None:
    status = cli("drive", "status", "--config", CONFIG, "--json")
    assert status.json["state"] == "SWITCH_ON_DISABLED"
    diff = cli("drive", "diff", "--config", CONFIG, "--json")
    assert diff.code == 1  # as it comes from the factory
    assert {row["verdict"] for row in diff.json} >= {"ok", "differs"}


def test_a_drive_without_the_mode_on_its_bus_is_shown_without_one(monkeypatch: pytest.MonkeyPatch) -> None:
    there = SdoClient.optional
    monkeypatch.setattr(
        SdoClient, "optional", lambda sdo, index, *more: None if index == 0x6061 else there(sdo, index, *more)
    )
    told = cli("drive", "status", "--config", CONFIG).out.splitlines()
    assert "  mode      unknown: the drive does not give 6061" in told


def test_a_backup_goes_back_where_it_came_from(tmp_path: Path) -> None:
    file = tmp_path / "drive.json"
    assert cli("drive", "backup", "--config", CONFIG, file).code == 0
    kept = json.loads(file.read_text(encoding="utf-8"))
    assert kept["values"]["6085:00"]
    assert cli("drive", "restore", "--config", CONFIG, "--yes", file).code == 0
    other = {**kept, "drive": "00000001-00000001-1"}
    file.write_text(json.dumps(other), encoding="utf-8")
    answer = cli("drive", "restore", "--config", CONFIG, "--yes", file)
    assert answer.code == 2
    assert "another kind of drive" in answer.err


def test_a_backup_is_written_under_the_name_that_was_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`-` is standard input where a file is read, and nothing is read here."""
    monkeypatch.chdir(tmp_path)
    assert cli("drive", "backup", "--config", CONFIG, "-").out.startswith("wrote -: ")
    assert json.loads((tmp_path / "-").read_text(encoding="utf-8"))["values"]


@pytest.mark.parametrize(
    "text", ["", "[]", '{"drive": "x", "values": {"6085": "00"}}', '{"drive": "x", "values": {"6085:00": 3}}']
)
def test_a_file_that_is_no_backup_is_one_line(tmp_path: Path, text: str) -> None:
    file = tmp_path / "drive.json"
    file.write_text(text, encoding="utf-8")
    answer = cli("drive", "restore", "--config", CONFIG, "--yes", file)
    assert answer.code == 2
    assert "is no backup of a drive" in answer.err


def test_save_stores() -> None:
    assert "stored in" in cli("drive", "save", "--config", CONFIG, "--yes").out


def test_a_machine_without_a_bus_is_told_so() -> None:
    answer = cli("drive", "status")
    assert answer.code == 2
    assert "has no bus" in answer.err


def test_a_real_drive_is_not_moved_without_a_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`virtual` is a bus of python-can with nobody on it: the command ends at the silent drive, in words."""
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path / "state"))
    config = tmp_path / "real.toml"
    machine = with_values(
        load_machine(CONFIG), {"can.interface": "virtual", "can.channel": "x", "can.sdo_timeout_ms": 10.0}
    )
    config.write_text(to_toml(machine), encoding="utf-8")
    answer = cli("move", "5", "--config", config)
    assert answer.code == 3
    assert "node 2 does not answer" in answer.err
    assert cli("move", "5", "--config", config, "--fresh").code == 2


def test_status_speaks_of_what_is_retained_when_the_drive_is_out_of_reach(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path / "state"))
    config = tmp_path / "real.toml"
    assert cli("move", "2", "--config", CONFIG).code == 0
    bus = {"can.interface": "virtual", "can.channel": "x", "can.sdo_timeout_ms": 10.0}
    config.write_text(to_toml(with_values(load_machine(CONFIG), bus)), encoding="utf-8")
    answer = cli("status", "--config", config, "--json")
    assert answer.code == 0
    assert answer.json["condition"] == "the drive cannot be reached"
    assert answer.json["moves"] == 1


def test_commission_says_what_could_move() -> None:
    answer = cli("commission", "--with-sim", "--dry-run")
    assert answer.code == 0
    assert "at most 0.05 deg" in answer.out


def test_one_step_of_commissioning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path / "state"))
    answer = cli("commission", "--with-sim", "--only", "sync", "--out", tmp_path / "report")
    assert answer.code == 0
    assert "a command shows 2 scans later" in answer.out
    assert (tmp_path / "report" / "commissioning.html").is_file()
    # What has stopped a rehearsal holds the next one: no command but this one reaches the states of its virtual drive.
    with StateStore(load_machine(CONFIG), tmp_path / "state" / "simulated") as store:
        kept = store.load_retained()
        assert kept is not None
        store.store_retained(replace(kept, error_stop="BRK-02"))
    for said in (True, False):
        again = cli("commission", "--with-sim", "--only", "sync", "--out", tmp_path / "report")
        assert again.code == 0
        assert ("BRK-02 acknowledged" in again.out) is said
    wrong = cli("commission", "--with-sim", "--only", "dance", "--out", tmp_path / "report")
    assert wrong.code == 2
    assert "the steps are identity" in wrong.err
