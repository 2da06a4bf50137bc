"""The schema for editors: delivered beside machine files and sheets, put beside every one that is written."""

import json
import re
import tomllib
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from gantryctl.machine import configs_folder, field_specs
from gantryctl.machine.schema import MACHINE_LINE, json_schema, put_schemas
from support.command_line import cli, done

CONFIGS = configs_folder()
MACHINES = sorted(path for path in CONFIGS.glob("*.toml") if "calibration" not in path.name)
SHEETS = sorted((CONFIGS / "requirements").glob("*.toml"))
DELIVERED = {"config schema": CONFIGS / "machine.schema.json"}
DELIVERED["config schema --sheet"] = CONFIGS / "requirements" / "sheet.schema.json"


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def named(path: Path) -> Path:
    """The schema that a file names, as Taplo finds it: relative to the file, before anything but comments."""
    for line in path.read_text(encoding="utf-8").splitlines():
        assert line.startswith("#"), f"{path}: no schema before {line}"
        directive = re.fullmatch(r"#:schema (\S+)", line)
        if directive is not None:
            return path.parent / directive[1]
    raise AssertionError(f"{path} is empty")


def refused(path: Path, change=lambda data: None) -> list[str]:
    """What the schema that a file names says about it, after a change."""
    schema = json.loads(named(path).read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(schema)
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    change(data)
    return [error.message for error in Draft202012Validator(schema).iter_errors(data)]


@pytest.mark.parametrize("path", [*MACHINES, *SHEETS], ids=lambda path: path.stem)
def test_every_delivered_file_names_a_schema_that_takes_it_and_no_wrong_key(path):
    assert refused(path) == []
    table = "motion" if path in SHEETS else "axis"
    wrong = {"unheard_of": 1.0}
    assert len(refused(path, lambda data: data[table].update(wrong))) == 1
    assert len(refused(path, lambda data: data.update(no_such_table=wrong))) == 1


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (-1.0, "less than the minimum"),
        (1e9, "greater than the maximum"),
        ("13", "is not of type"),
        (True, ""),
    ],
)
def test_a_value_that_the_machine_file_does_not_take_is_marked(value, said):
    (message,) = refused(CONFIGS / "hust_gantry.toml", lambda data: data["axis"].update(ring_ratio=value))
    assert said in message


@pytest.mark.parametrize("command", DELIVERED)
def test_the_delivered_schema_is_that_of_the_code(command):
    text = DELIVERED[command].read_text(encoding="utf-8")
    assert done(*command.split()).out == text, f"run: gantryctl {command} > {DELIVERED[command]}"


def test_schema_has_bounds_units_and_no_room_for_unknown_keys():
    schema = json.loads(json.dumps(json_schema(), allow_nan=False))
    assert schema["required"] == ["machine", "axis", "motor", "encoder"]
    assert schema["additionalProperties"] is False
    required = schema["$defs"]["RequiredTable"]
    assert required["additionalProperties"] is False
    assert required["properties"]["stopping_angle_deg"] == {
        "default": 4.0,
        "description": field_specs()["required.stopping_angle_deg"].meaning,
        "maximum": 90.0,
        "minimum": 0.01,
        "source": "choice",
        "title": "Stopping Angle Deg",
        "type": "number",
        "unit": "deg",
    }


@pytest.mark.parametrize(
    ("command", "written"),
    [
        ("config init mine.toml", ["mine.toml"]),
        ("config init mine.toml --improved", ["mine.toml"]),
        ("config init mine.toml --can socketcan --channel can0", ["mine.toml"]),
        ("new rig --template tilt_table --gears 0", ["rig.toml", "rig_sheet.toml"]),
        ("size init rig.toml --template tilt_table", ["rig.toml"]),
        (f"config init mine.toml --gears 0 --sheet {SHEETS[0]}", ["mine.toml"]),
        ("size --write sized.toml", ["sized.toml"]),
    ],
)
def test_every_written_file_has_its_schema_beside_it(command, written):
    assert cli(*command.split()).code == 0
    for path in map(Path, written):
        assert named(path).parent == Path()
        assert refused(path) == []


def test_the_schema_of_another_version_is_replaced_and_no_other_file():
    Path("mine.toml").write_text(MACHINE_LINE, encoding="utf-8")
    schema = Path("machine.schema.json")
    schema.write_text('{\n  "title": "gantryctl machine file"\n}\n', encoding="utf-8")
    assert put_schemas([Path("mine.toml"), Path("mine.toml")]) == [schema]
    assert schema.read_bytes() == DELIVERED["config schema"].read_bytes()
    schema.write_text("a person's notes", encoding="utf-8")
    assert put_schemas([Path("mine.toml")]) == []
    assert schema.read_text(encoding="utf-8") == "a person's notes"


def test_a_file_that_names_no_schema_gets_none():
    Path("mine.toml").write_text("[machine]\n", encoding="utf-8")
    assert put_schemas([Path("mine.toml")]) == []
    assert not list(Path().glob("*.json"))
