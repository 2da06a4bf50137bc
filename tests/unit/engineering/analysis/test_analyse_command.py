"""`gantryctl analyse`: what it prints, what it writes, what it refuses; every linear reference figure."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from gantryctl.cli.main import cli
from gantryctl.errors import ConfigError, GantryctlError, UsageError
from gantryctl.machine import default_machine, default_machine_path, with_values
from gantryctl.machine.effective import to_toml

EXPECTED = json.loads((Path(__file__).parents[3] / "data" / "expected.json").read_text(encoding="utf-8"))


def run(*arguments):
    result = CliRunner().invoke(cli, ["analyse", *map(str, arguments)], standalone_mode=False)
    if isinstance(result.exception, GantryctlError):
        raise result.exception
    assert result.exception is None, result.exception
    return result


def data_of(*arguments):
    return json.loads(run(*arguments, "--json").output)


@pytest.fixture(scope="module")
def printed():
    """The figures as the command prints them, by section of the reference."""
    return {
        "3_linear_rigid": data_of("--plant", "rigid")["figures"],
        "5_linear_two_mass": data_of("--plant", "two-mass")["figures"],
    }


def numbers(value):
    """A nested entry as one flat array; pairs are complex numbers, in any order."""
    if isinstance(value, dict):
        return np.concatenate([numbers(item) for item in value.values()])
    array = np.asarray(value)
    if array.ndim == 2:
        return np.sort_complex(array[:, 0] + 1j * array[:, 1])
    return np.atleast_1d(array)


@pytest.mark.parametrize(
    ("section", "name"),
    [(section, name) for section in ("3_linear_rigid", "5_linear_two_mass") for name in EXPECTED[section]],
)
def test_every_linear_reference_figure_is_printed(printed, section, name):
    entry, found = EXPECTED[section][name], printed[section][name]
    if name == "definition":
        assert "k=5e+08" in found
        assert "zeta=0.025" in found
        return
    if entry["value"] is None:
        assert found is None
        return
    if isinstance(entry["value"], dict):
        assert list(found) == list(entry["value"])
    expected, actual = numbers(entry["value"]), numbers(found)
    assert actual.shape == expected.shape
    limit = entry.get("atol", 0.0) + entry.get("rtol", 0.0) * np.abs(expected)
    assert np.all(np.abs(actual - expected) <= np.maximum(limit, 4.0 * np.finfo(float).eps))


def test_nothing_is_printed_that_is_not_in_the_reference(printed):
    for section, figures in printed.items():
        assert set(figures) == set(EXPECTED[section])


def test_equation_5_in_symbols_numbers_and_words():
    output = run("--plant", "rigid").output
    assert "(Js/Kt) s^3 + Kvp s^2 + (Kvp/Tvi + Kvp Kpp) s + Kpp Kvp/Tvi" in output
    assert "1.89773 s^3 + 77.6959 s^2 + 8546.55 s + 77695.9" in output
    assert "poles -15.6 ± 62.9j, -9.749; zeros -100, -10 rad/s" in output
    words = " ".join(output.split())
    assert "the tuned speed loop has 35 deg phase margin" in words
    assert "below 0.22 of its gain the whole loop is unstable, for example in torque saturation" in words


def test_the_full_plant_is_the_default_and_names_its_modes():
    words = " ".join(run().output.split())
    assert "hust_gantry, full plant" in words
    assert "The load mode has 2.00 Hz and 1.64 % damping while the motor is held, 1.98 Hz and 0.91 %" in words
    assert "take 45 % of its damping away" in words
    assert "The base mode has 8.52 Hz" in words


def test_cuts_are_in_the_json():
    data = data_of()
    assert set(data["cuts"]) == {"position command", "speed command", "speed error", "torque"}
    assert data["cuts"]["torque"]["gain_reduction_margin"] == pytest.approx(0.439, abs=0.001)
    assert data["stable"] is True
    assert data["loop"]["cycles_per_scan"] == 8
    assert data["equation_5"]["zeros"][0][0] == pytest.approx(-100.0)
    assert [mode["name"] for mode in data["modes"]] == ["load mode", "base mode"]


@pytest.fixture(scope="module")
def everything(tmp_path_factory, measurements):
    """One run with all options; the measurements were made before."""
    folder = tmp_path_factory.mktemp("analysis") / "new" / "folder"
    ready = {result.condition: result for result in measurements}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "gantryctl.engineering.analysis.measured.response.measure_simulated",
            lambda machine, how: ready[how],
        )
        output = run("--robust", "--measure", "--plot", "--out", folder).output
    return folder, output


def test_the_worst_case_shows_where_the_gains_are_unstable(everything):
    folder, output = everything
    data = json.loads((folder / "analysis.json").read_text())["robust"]
    ((low, high),) = data["unstable_stiffness_nm_per_rad"]["two-mass, continuous"]["0.01"]
    assert (low / 1e9, high / 1e9) == (pytest.approx(0.65, abs=0.03), pytest.approx(1.6, abs=0.03))
    assert data["worst_damping"]["zeta"] < 0.0
    assert data["unstable"] > 0
    words = " ".join(output.split())
    assert "unstable for k = 0.63..1.60e9 N m/rad" in words


def test_plots_are_written(everything):
    written = {path.name: path for path in everything[0].iterdir()}
    pictures = {"bode.png", "nyquist.png", "closed_loops.png", "responses.png", "damping.png", "measured.png"}
    assert set(written) == pictures | {"analysis.json"}
    for name in pictures:
        assert written[name].read_bytes().startswith(b"\x89PNG")
        assert written[name].stat().st_size > 20_000
    assert json.loads(written["analysis.json"].read_text())["plant"] == "full"


def test_without_out_the_pictures_have_a_place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "wrote analysis/bode.png" in run("--plant", "rigid", "--plot").output


def file_with(tmp_path, changes):
    path = tmp_path / "machine.toml"
    path.write_text(to_toml(with_values(default_machine(), changes)), encoding="utf-8")
    return path


def test_an_unstable_loop_is_said_and_is_exit_code_1(tmp_path):
    path = file_with(tmp_path, {"control.kpp_per_s": 200.0, "plant.switches.rigid": True})
    result = run("--config", path)
    assert result.return_value == 1
    assert "rigid plant" in result.output
    assert "The loop is UNSTABLE: a motion at" in result.output
    assert run("--config", default_machine_path(), "--plant", "rigid").return_value == 0


def test_a_driven_mode_is_said(tmp_path):
    path = file_with(
        tmp_path,
        {"plant.transmission.damping_ratio": 0.001, "plant.transmission.rest_stiffness_nm_per_rad": 3e9},
    )
    result = run("--config", path)
    assert result.return_value == 1
    words = " ".join(result.output.split())
    assert "is driven by the loop" in words
    assert "it swings up" in words
    assert "to grow from a tenth" in words


def test_coarse_counts_are_warned_about(tmp_path):
    path = file_with(tmp_path, {"drive.speed_loop.feedback": "counts"})
    assert "one encoder step in a drive cycle is a torque step of 477 N m" in " ".join(
        run("--config", path).output.split()
    )


def test_friction_that_holds_is_explained():
    words = " ".join(run("--plant", "two-mass", "--friction", "holding").output.split())
    assert "every friction element is a spring" in words


def test_measured_responses_are_there(everything):
    folder, output = everything
    assert "Measured on the simulator standing, small" in output
    data = json.loads((folder / "analysis.json").read_text())
    assert len(data["measured"]) == 3
    assert all(math.isfinite(value) for value in data["measured"][2]["measured"]["plant"]["magnitude"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--measure", "--at", "200"), r"--at 200: must lie within travel, -180 to 180 deg"),
        (("--measure", "--torque", "900"), "a test torque of 180 N m"),
        (("--measure", "--at", "179"), r"takes 54 deg: 152 to 206 deg must lie"),
        (("--out", "/dev/null/x"), "cannot be made"),
    ],
)
def test_what_cannot_be_done_is_refused(arguments, message):
    with pytest.raises(UsageError, match=message):
        run(*arguments)


def test_measuring_needs_a_simulated_drive(tmp_path):
    with pytest.raises(UsageError, match="needs a drive with an axis behind it"):
        run("--measure", "--config", file_with(tmp_path, {"drive.kind": "ideal"}))


def test_a_wrong_machine_file_is_a_list_of_problems(tmp_path):
    path = tmp_path / "machine.toml"
    path.write_text("[control]\nkpp_per_s = nan\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="kpp_per_s = nan: is not a finite number"):
        run("--config", path)
