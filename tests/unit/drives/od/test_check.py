"""`gantryctl eds check`: what an axis needs, what a file has and lacks, and what follows."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from gantryctl.cli.main import cli
from gantryctl.drives.od.reading import parse_eds, read_eds
from gantryctl.drives.od.standard import WISHES, check_csv_axis, lacking
from gantryctl.errors import GantryctlError

FILES = Path(__file__).parents[3] / "data" / "eds"


def run(*args: str) -> Result:
    return CliRunner().invoke(cli, ["eds", "check", *args], standalone_mode=False)


def test_a_minimal_file_makes_an_axis_and_the_lacks_have_consequences() -> None:
    result = run(str(FILES / "minimal.eds"))
    assert result.return_value == 0
    assert "has    60FF:00 Target velocity" in result.output
    assert "lacks  6077:00" in result.output
    assert "no torque proof before the brake opens" in result.output
    assert "nothing in it stops the axis of a silent controller" in result.output


def test_a_file_without_target_velocity_makes_no_axis() -> None:
    text = (FILES / "minimal.eds").read_text().split("[60FF]")[0]
    device = parse_eds(text.encode())
    assert [finding.wish.place for finding in lacking(check_csv_axis(device))] == ["60FF:00"]


def test_a_target_velocity_that_cannot_be_mapped_makes_no_axis(tmp_path: Path) -> None:
    head, tail = (FILES / "minimal.eds").read_text().split("[60FF]")
    file = tmp_path / "unmappable.eds"
    file.write_text(head + "[60FF]" + tail.replace("PDOMapping=1", "PDOMapping=0"))
    result = run(str(file))
    assert result.return_value == 1
    assert "LACKS  60FF:00" in result.output
    assert "cannot be mapped into a RPDO" in result.output
    assert "No CSV axis by this file: 60FF:00 lacking." in result.output


def test_a_dcf_shows_the_dangerous_value_somebody_configured() -> None:
    result = run(str(FILES / "node_arithmetic.dcf"), "--node", "5")
    assert "DCF 0" in result.output
    assert "0 = a silent controller lets this axis run on" in result.output
    assert "360000 in the drive's unit" in result.output


def test_array_mapping_objects_are_pointed_out() -> None:
    assert "declared as ARRAY" in run(str(FILES / "array_mapping.eds")).output


def test_modes_without_csv_are_pointed_out() -> None:
    text = (FILES / "minimal.eds").read_text()
    text += "[6502]\nParameterName=Modes\nDataType=0x0007\nAccessType=ro\nDefaultValue=0x45\nPDOMapping=0\n"
    findings = check_csv_axis(parse_eds(text.encode()))
    said = [remark for finding in findings if finding.wish.index == 0x6502 for remark in finding.remarks]
    assert said == ["0x45 has no CSV (bit 8): the drive may accept mode 9 and never move"]


def test_json_has_every_need() -> None:
    result = run(str(FILES / "cp1252.eds"), "--json")
    data = json.loads(result.output)
    assert data["usable"] is True
    assert len(data["findings"]) == len(WISHES)
    assert data["notes"][0]["line"] == 4


@pytest.mark.parametrize("name", ["empty.eds", "foreign.ini", "nowhere.eds"])
def test_a_foreign_file_is_an_error_of_the_family(name: str) -> None:
    result = run(str(FILES / name))
    assert isinstance(result.exception, GantryctlError)
    assert name in str(result.exception)


def test_every_need_has_its_name_type_and_access() -> None:
    for wish in WISHES:
        assert wish.standard.name
        assert wish.without
    assert read_eds(FILES / "minimal.eds").entry(0x6040) is not None
