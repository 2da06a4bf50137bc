"""`gantryctl eds check`: the ledger of a machine with the drive of a file, and what follows."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from gantryctl.cli.main import cli
from gantryctl.errors import GantryctlError

pytestmark = pytest.mark.can

FILES = Path(__file__).parents[3] / "data" / "eds"


def run(*args: str) -> Result:
    return CliRunner().invoke(cli, ["eds", "check", *args], standalone_mode=False)


def test_a_minimal_file_lacks_a_watch_over_the_controller() -> None:
    result = run(str(FILES / "minimal.eds"))
    assert result.return_value == 1
    assert "  maps_telegrams: has it by 1600, 1A00" in result.output
    assert "  runs_csv: made up for by 6061 (no 6502" in result.output
    assert "  tells_its_torque: made up for by the sag after release (no 6077" in result.output
    assert "  stops_without_controller: lacking (no 1400:05, no 1016:01" in result.output
    assert "CFG-CAN-05" in result.output


def test_a_file_without_target_velocity_makes_no_axis(tmp_path: Path) -> None:
    file = tmp_path / "speechless.eds"
    file.write_text((FILES / "minimal.eds").read_text().split("[60FF]")[0])
    result = run(str(file))
    assert result.return_value == 1
    assert "  runs_csv: lacking (no 60FF: nothing stands in for these in a CSV axis)" in result.output


def test_a_target_velocity_that_cannot_be_mapped_makes_no_axis(tmp_path: Path) -> None:
    head, tail = (FILES / "minimal.eds").read_text().split("[60FF]")
    file = tmp_path / "unmappable.eds"
    file.write_text(head + "[60FF]" + tail.replace("PDOMapping=1", "PDOMapping=0"))
    assert "  maps_telegrams: lacking (60FF cannot be mapped" in run(str(file)).output


def test_modes_without_csv_make_no_axis(tmp_path: Path) -> None:
    file = tmp_path / "no_csv.eds"
    modes = "[6502]\nParameterName=Modes\nDataType=0x0007\nAccessType=ro\nDefaultValue=0x45\nPDOMapping=0\n"
    file.write_text((FILES / "minimal.eds").read_text() + modes)
    assert "  runs_csv: lacking (6502 = 45h has no CSV (bit 8)" in run(str(file)).output


def test_json_has_every_row_and_every_reason() -> None:
    result = run(str(FILES / "cp1252.eds"), "--json")
    data = json.loads(result.output)
    assert data["usable"] is False
    assert {"what", "standing", "by", "detail", "proof", "acceptable", "speed_max_deg_s", "by_file"} == set(
        data["ledger"][0]
    )
    assert data["reasons"][0].startswith("CFG-CAN-05")
    assert data["notes"][0]["line"] == 4


def test_a_machine_without_a_bus_has_no_drive_to_check(tmp_path: Path) -> None:
    result = run(str(FILES / "minimal.eds"), "--config", "configs/hust_gantry.toml")
    assert 'kind = "sim" has no bus' in str(result.exception)


@pytest.mark.parametrize("name", ["empty.eds", "foreign.ini", "nowhere.eds"])
def test_a_foreign_file_is_an_error_of_the_family(name: str) -> None:
    result = run(str(FILES / name))
    assert isinstance(result.exception, GantryctlError)
    assert name in str(result.exception)
