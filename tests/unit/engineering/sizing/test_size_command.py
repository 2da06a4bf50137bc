"""`gantryctl size`: what it prints, what it writes, what it refuses; every sizing figure of the reference."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from gantryctl.cli.main import cli
from gantryctl.errors import ConfigError, GantryctlError, UsageError
from gantryctl.machine import config_hash, configs_folder, default_machine, load_machine

EXPECTED = json.loads((Path(__file__).parents[3] / "data" / "expected.json").read_text(encoding="utf-8"))
MOTORS = configs_folder() / "motors"
PAPER = MOTORS / "im_31kw_1150.toml"


def run(*arguments):
    result = CliRunner().invoke(cli, ["size", *map(str, arguments)], standalone_mode=False)
    if isinstance(result.exception, GantryctlError):
        raise result.exception
    assert result.exception is None, result.exception
    return result


@pytest.fixture(scope="module")
def printed():
    return json.loads(run("--motor", PAPER, "--json").output)


@pytest.mark.parametrize("name", EXPECTED["1_sizing"])
def test_every_sizing_figure_of_the_reference_is_printed(printed, name):
    entry = EXPECTED["1_sizing"][name]
    assert printed["figures"][name] == pytest.approx(entry["value"], rel=max(entry["rtol"], 1e-15), abs=0.0)


def test_nothing_is_printed_that_is_not_in_the_reference(printed):
    assert set(printed["figures"]) == set(EXPECTED["1_sizing"])


def test_the_paper_s_figures_as_printed_there():
    words = run().output
    assert "(1) motor speed n1 = i n2, r/min" in words
    for figures in (("1144", "1144"), ("0.105", "0.10472"), ("200", "199.55"), ("23.96", "23.905")):
        assert any(line.split()[-2:] == list(figures) for line in words.splitlines()), figures


def test_the_complete_figures_and_the_motors(printed):
    words = " ".join(run().output.split())
    assert "The sizing case takes 328 N m, not the 200 N m of its inertia: above the 257 N m" in words
    assert "im_22kw_1150 does not fit: peak torque" in words
    assert "pm_25kw_1000 does not fit: inertia ratio" in words
    assert "it needs a jerk limit. The reducer and the base are the limit, not the motor." in words
    assert printed["complete"]["sizing"]["torque_nm"] == pytest.approx(327.8, abs=0.1)
    parts = printed["complete"]["sizing"]["parts_nm"]
    assert sum(parts.values()) == pytest.approx(printed["complete"]["sizing"]["torque_nm"])
    assert printed["complete"]["wrap_margin_deg"] == pytest.approx(464.5, abs=0.1)
    assert np.isfinite([printed["duty"][key] for key in printed["duty"]]).all()
    assert [row["angle_deg"] for row in printed["over_angle"]] == [0.0, 45.0, 90.0, 135.0, 180.0]


def test_a_small_axis_has_figures_and_no_zeros():
    """50 kg m2 behind 180 to 10 r/min in 1.25 s: 50 x 0.83776 / 180 = 0.2327 N m, half of it in a normal move; a moment
    of 6.25 N m / 180 = 0.0347; of motion 25 x 1.0472^2 + 0.5 x 1.45e-4 x 188.5^2 = 30.0 J; a reducer of 14.1 N m.
    """
    sheet = configs_folder() / "requirements" / "rotary_table.toml"
    lines = run(sheet, "--motor", MOTORS / "pm_200w_3000.toml").output.splitlines()
    cells = {" ".join(line.split()[:-2]): line.split()[-2:] for line in lines if len(line.split()) > 2}
    assert cells["load inertia alone"] == ["0.23", "0.12"]
    assert cells["largest eccentric moment"] == ["0.03", "0.03"]
    assert cells["energy of motion at the highest speed"] == ["0.030", "kJ"]
    assert any(line.endswith(" 0.014 kN m; 0.056 kN m") for line in lines)


def test_motors_as_the_shell_expands_them():
    names = sorted(MOTORS.glob("im_*.toml"))
    words = run("--motor", *names).output
    assert run("--motor", MOTORS / "im_*.toml").output == words
    assert run(configs_folder() / "requirements" / "hust_gantry.toml", "--motor", *names).output == words
    assert "pm_25kw_1000" not in words


def test_no_motor_fits_is_exit_code_1(changed_sheet):
    sheet = changed_sheet({"margins.peak_torque": 5.0})
    result = run(sheet)
    assert result.return_value == 1
    assert "No motor fits; choose a larger one, or ask for less." in result.output
    assert run().return_value == 0


def test_limits_are_tables_of_a_machine_file():
    text = run("--motor", PAPER, "--limits").output
    assert text.startswith("# requirement sheet hust_gantry, motor im_31kw_1150")
    assert "[speed]\nsetting_min_deg_s = 0.6  # deg/s\nsetting_max_deg_s = 6.0  # deg/s\n" in text


def test_a_written_machine_is_the_reference_machine(tmp_path):
    path = tmp_path / "hust_gantry.toml"
    run("--motor", PAPER, "--write", path)
    assert config_hash(load_machine(path)) == config_hash(default_machine())
    with pytest.raises(UsageError, match="exists already"):
        run("--write", path)


def test_limits_of_a_sheet_of_ones_own_are_those_of_a_motor_that_fits():
    sheet = configs_folder() / "requirements" / "hust_gantry.toml"
    with pytest.raises(ConfigError, match="does not fit hust_gantry: peak torque"):
        run(sheet, "--motor", MOTORS / "im_22kw_1150.toml", "--limits")


def test_a_sheet_of_another_axis_brings_nothing_of_the_gantry(tmp_path):
    """A rotary table of 50 kg m2: gains and monitors are drafted, not those of 2.18e6 kg m2."""
    sheet = configs_folder() / "requirements" / "rotary_table.toml"
    path = tmp_path / "table.toml"
    run(sheet, "--motor", MOTORS / "pm_200w_3000.toml", "--write", path)
    machine, gantry = load_machine(path), default_machine()
    assert "hust_gantry" not in path.read_text(encoding="utf-8")
    assert machine.plant.transmission != gantry.plant.transmission
    assert machine.drive.speed_loop.kvp_nm_s_per_rad < 0.01 * gantry.drive.speed_loop.kvp_nm_s_per_rad


def test_a_machine_sized_on_another_has_a_name_of_its_own(tmp_path):
    path = tmp_path / "larger.toml"
    run("--motor", PAPER, "--config", configs_folder() / "hust_gantry.toml", "--write", path)
    # The state of a machine lies under its name: zero, alarms and recordings of two must not be one.
    assert load_machine(path).name == "larger"
    with pytest.raises(UsageError, match="a name of a machine has"):
        run("--motor", PAPER, "--write", tmp_path / "a b.toml")


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (
            ("--motor", MOTORS / "im_22kw_1150.toml", "--limits"),
            ConfigError,
            "does not fit hust_gantry: peak torque",
        ),
        (("nope.toml",), ConfigError, "nope.toml: does not exist$"),
        (("--motor", "nope/*.toml"), UsageError, "no file has such a name"),
        ((configs_folder() / "hust_gantry.toml",), ConfigError, "is a machine file"),
        (("--write", "/dev/null/x"), UsageError, "--write /dev/null/x: cannot be written"),
        (
            (configs_folder() / "requirements" / "hust_gantry.toml",) * 2,
            UsageError,
            "two requirement sheets",
        ),
    ],
)
def test_what_cannot_be_done_is_refused(arguments, error, message):
    with pytest.raises(error, match=message):
        run(*arguments)
