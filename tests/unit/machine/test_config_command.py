"""`gantryctl config`: what it prints; wrong files end in a `ConfigError` for the top level to show."""

import json

import pytest
from click.testing import CliRunner

from gantryctl.cli.main import cli
from gantryctl.errors import ConfigError, UsageError
from gantryctl.machine import (
    config_hash,
    configs_folder,
    default_machine,
    default_machine_path,
    field_specs,
    load_machine,
    short_hash,
)
from gantryctl.machine.derived import derived


def run(*arguments):
    result = CliRunner().invoke(cli, ["config", *map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


@pytest.fixture
def machine_file(tmp_path):
    path = tmp_path / "hust_gantry.toml"
    run("init", path)
    return path


@pytest.mark.parametrize(
    "name", sorted(p.name for p in configs_folder().glob("*.toml") if ".calibration" not in p.name)
)
def test_every_delivered_machine_passes_its_own_check(name):
    assert ": ok: " in run("check", configs_folder() / name).output


def test_init_copies_the_reference_file_with_its_comments(tmp_path, machine_file):
    text = default_machine_path().read_text(encoding="utf-8")
    assert machine_file.read_bytes() == text.encode()
    with pytest.raises(UsageError, match="exists already; --force"):
        run("init", machine_file)
    machine_file.write_text("x", encoding="utf-8")
    run("init", machine_file, "--force")
    assert machine_file.read_bytes() == text.encode()
    (tmp_path / "folder").mkdir()
    run("init", tmp_path / "folder")
    assert (tmp_path / "folder" / "hust_gantry.toml").exists()
    with pytest.raises(UsageError, match="cannot be written"):
        run("init", tmp_path / "no" / "such" / "place.toml")


@pytest.mark.parametrize("options", [(), ("--improved",), ("--can", "vcan0")])
def test_a_new_machine_has_the_name_of_its_file(options, tmp_path):
    run("init", tmp_path / "my_axis.toml", *options)
    assert load_machine(tmp_path / "my_axis.toml").name == "my_axis"
    with pytest.raises(UsageError):
        run("init", tmp_path / "my axis.toml", *options)


def test_init_without_a_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "config check machine.toml" in run("init").output
    assert (tmp_path / "machine.toml").exists()


def test_check(machine_file):
    result = run("check", machine_file)
    assert result.exit_code == 0
    assert result.output.startswith(
        f"{machine_file}: ok: hust_gantry, {len(field_specs())} keys given, 0 by default"
    )
    assert short_hash(default_machine()) in result.output
    assert run("check").exit_code == 0
    assert run("check", "--config", machine_file).output == result.output
    with pytest.raises(UsageError, match="two machine files"):
        run("check", machine_file, "--config", "other.toml")


def test_check_of_a_wrong_file(machine_file):
    text = machine_file.read_text(encoding="utf-8")
    machine_file.write_text(
        text.replace("kpp_per_s = 10.0", "kp = 10.0").replace("turns = 4096", "turns = 4000")
    )
    with pytest.raises(ConfigError) as caught:
        run("check", machine_file)
    assert len(caught.value.problems) == 2
    result = CliRunner().invoke(cli, ["config", "check", str(machine_file), "--json"])
    assert isinstance(result.exception, ConfigError)
    assert json.loads(result.stdout) == {
        "file": str(machine_file),
        "ok": False,
        "problems": list(caught.value.problems),
    }


def test_check_as_json(machine_file):
    answer = json.loads(run("check", machine_file, "--json").stdout)
    assert answer["ok"] is True
    assert answer["hash"] == config_hash(default_machine())


def test_show_tells_value_unit_and_origin(machine_file):
    text = machine_file.read_text(encoding="utf-8")
    machine_file.write_text(text.replace("stopping_angle_deg = 4.0", "").replace("kpp_per_s = 10.0", ""))
    lines = run("show", machine_file).output.splitlines()
    assert lines[0].startswith(f"# hust_gantry: {machine_file}, hash ")
    assert [line.split() for line in lines if line.startswith("stopping_angle_deg")] == [
        ["stopping_angle_deg", "4.0", "deg", "default,", "choice"]
    ]
    assert ["kpp_per_s", "10.0", "1/s", "default,", "paper"] in [line.split() for line in lines]
    assert ["mass_kg", "200000.0", "kg", "file"] in [line.split() for line in lines]
    for name in (
        "js_load_and_rotor",
        "wrap_margin_centred",
        "stop_quick_from_setting_max",
        "torque_needed_quick",
    ):
        assert any(line.startswith(f"{name} ") for line in lines)
    assert not any(
        line.startswith("js_load_and_rotor") for line in run("show", "--no-derived").output.splitlines()
    )


def test_show_as_json(machine_file):
    answer = json.loads(run("show", machine_file, "--json").stdout)
    assert answer["hash"] == config_hash(default_machine())
    assert list(answer["values"]) == list(field_specs())
    assert answer["values"]["axis.pos_max_deg"] == {"value": 180.0, "unit": "deg", "origin": "file"}
    assert [figure["name"] for figure in answer["derived"]] == [f.name for f in derived(default_machine())]
    assert "derived" not in json.loads(run("show", "--json", "--no-derived").stdout)


def test_schema():
    assert json.loads(run("schema").stdout)["title"] == "gantryctl machine file"


def test_diff(tmp_path, machine_file):
    other = tmp_path / "other.toml"
    text = machine_file.read_text(encoding="utf-8")
    other.write_text(
        text.replace("kvf = 1.0", "kvf = 0.9").replace("pos_max_deg = 180.0", "pos_max_deg = 170")
    )
    assert run("diff", machine_file, other).output.splitlines() == [
        "[axis] pos_max_deg: 180.0 -> 170.0 deg",
        "[control] kvf: 1.0 -> 0.9",
    ]
    assert json.loads(run("diff", machine_file, other, "--json").stdout)[1] == {
        "path": "control.kvf", "first": 1.0, "second": 0.9, "unit": "-",
    }  # fmt: skip
    assert run("diff", machine_file, machine_file).output == "the values in force are the same\n"


def test_check_refuses_what_move_would_refuse(tmp_path):
    """Fields and rules hold, and the motor does not give the quick stop on the full plant: 5.4 deg/s2 at most."""
    path = tmp_path / "harder.toml"
    text = default_machine_path().read_text(encoding="utf-8")
    path.write_text(text.replace("quick_dec_deg_s2 = 5.4 ", "quick_dec_deg_s2 = 6.5 "), encoding="utf-8")
    with pytest.raises(ConfigError, match="the motor cannot give it"):
        run("check", path)
