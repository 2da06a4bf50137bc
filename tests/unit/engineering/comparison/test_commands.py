"""`gantryctl identify` and `gantryctl compare` from the outside."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gantryctl.engineering.comparison.key_figures import KEY_FIGURES
from gantryctl.machine import default_machine_path, load_calibration, load_machine, with_values
from gantryctl.wiring.compensation import compensation, lead_deg
from gantryctl.wiring.simulator import delivered_zero_counts, sim_drive
from support.command_line import cli

IMPROVED = default_machine_path().with_name("hust_improved.toml")


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.toml").write_text(IMPROVED.read_text("utf-8"), "utf-8")


@pytest.mark.slow
def test_identify_writes_the_file_that_the_machine_names_and_counts_versions_on() -> None:
    first = cli("identify", "--config", "m.toml")
    assert first.code == 0, first.err
    assert "beside the truth" in first.out
    assert "hust_improved.calibration.toml (version 1)" in first.out
    assert compensation(load_machine("m.toml")) is not None
    again = cli("identify", "--config", "m.toml")
    assert again.code == 2
    assert "--force" in again.err
    forced = cli("identify", "--config", "m.toml", "--force", "--instrument", "load-encoder", "--json")
    assert forced.code == 0, forced.err
    assert json.loads(forced.out)["calibration"]["origin"]["version"] == 2
    assert load_calibration(Path("hust_improved.calibration.toml")).origin.instrument == "load-encoder"


def test_identify_replaces_nothing_that_is_no_calibration() -> None:
    refused = cli("identify", "--config", "m.toml", "--out", "m.toml", "--force")
    assert refused.code == 2
    assert "is no calibration file" in refused.err
    assert load_machine("m.toml").name == "hust_improved"


@pytest.mark.parametrize(("place", "said"), [("nowhere/c.toml", "no directory"), (".", "--force")])
def test_identify_refuses_a_place_it_cannot_write_to_before_it_moves(place: str, said: str) -> None:
    refused = cli("identify", "--config", "m.toml", "--out", place)
    assert refused.code == 2
    assert said in refused.err


def test_identify_needs_a_gantry_behind_the_drive() -> None:
    text = Path("m.toml").read_text("utf-8") + '\n[drive]\nkind = "ideal"\n'
    Path("ideal.toml").write_text(text, "utf-8")
    refused = cli("identify", "--config", "ideal.toml")
    assert refused.code == 2
    assert 'use "sim" or "canopen"' in refused.err


def test_compare_without_a_calibration_says_what_to_do() -> None:
    refused = cli("compare", "paper", "m.toml")
    assert refused.code == 2
    assert "gantryctl identify" in refused.err


def test_config_check_knows_whether_the_calibration_belongs() -> None:
    assert "gantryctl identify" in cli("config", "check", "m.toml").err
    name = "hust_improved.calibration.toml"
    Path(name).write_text(IMPROVED.with_name(name).read_text("utf-8"), "utf-8")
    assert cli("config", "check", "m.toml").code == 0
    Path("other.toml").write_text(Path("m.toml").read_text("utf-8").replace("= 0.232", "= 0.3"), "utf-8")
    refused = cli("config", "check", "other.toml")
    assert refused.code == 2
    assert "another machine" in refused.err


def test_config_init_gives_the_improved_machine_with_its_calibration() -> None:
    assert cli("config", "init", "better.toml", "--improved").code == 0
    delivered = load_machine(IMPROVED)
    assert load_machine("better.toml") == with_values(delivered, {"machine.name": "better"})
    assert load_machine("better.toml").calibration == delivered.calibration
    assert cli("config", "check", "better.toml").code == 0
    assert cli("config", "init", "better.toml", "--improved").code == 2


def test_compare_refuses_different_machines() -> None:
    text = Path("m.toml").read_text("utf-8") + "\n[plant.load]\ninertia_kg_m2 = 2.0e6\n"
    Path("other.toml").write_text(text, "utf-8")
    refused = cli("compare", "paper", "other.toml")
    assert refused.code == 2
    assert "plant.load.inertia_kg_m2" in refused.err


@pytest.mark.parametrize(
    "arguments",
    [
        ("--ensemble", "1"),
        ("--ensemble", "-3"),
        ("--threads", "0"),
        ("--drift", "hust", "--ensemble", "4"),
        ("--drift", "nowhere"),
        ("--identify",),
        ("--on-top", "teeth"),
        ("--drift", "hust", "--on-top", "tooth"),
        ("--stale-days", "3", "--ensemble", "4"),
        ("--stale-days", "-1"),
    ],
)
def test_compare_refuses_sizes_that_make_no_sense(arguments: tuple[str, ...]) -> None:
    assert cli("compare", *arguments).code == 2


def test_a_machine_on_the_command_line_moves_with_its_compensations() -> None:
    moved = cli("move", "2", "--fresh", "--config", str(IMPROVED), "--no-trace")
    assert moved.code == 0, moved.err


def test_a_zero_set_away_from_0_counts_the_lead_of_the_motor() -> None:
    """Zeroed at 60 deg the load stands at 0 deg within the lost motion; without the lead it would be 0.002 deg off."""
    machine = load_machine(IMPROVED)
    assert abs(lead_deg(machine, 60.0)) > 0.002
    drive = sim_drive(machine, 60.0)
    counts = drive.read().pos_act_counts
    per_deg = 360.0 / (machine.counts_per_turn * machine.axis.ratio)
    at_60, at_0 = (counts - (a + lead_deg(machine, a)) / per_deg for a in (60.0, 0.0))
    assert delivered_zero_counts(machine, 60.0) == pytest.approx(at_60, abs=1.0)
    assert delivered_zero_counts(machine, 60.0) == pytest.approx(
        delivered_zero_counts(machine), abs=0.0015 / per_deg
    )
    assert at_0 != at_60


@pytest.mark.slow
def test_compare_prints_every_row_and_figure() -> None:
    done = cli("compare", "paper", "improved", "--json", "--out", "report")
    assert done.code == 0, done.err
    data = json.loads(done.out)
    assert data == json.loads(Path("report/compare.json").read_text("utf-8"))
    # Both machines, each of eleven compensations alone, and all without the encoder.
    assert len(data["rows"]) == 14
    assert all(set(row) == set(KEY_FIGURES) for row in data["rows"].values())
    alone = data["rows"]["gear map alone"]
    assert alone["a_true_a"] < 0.5 * data["rows"]["profile alone"]["a_true_a"]


@pytest.mark.slow
def test_compare_on_the_delivered_drift_prints_what_the_readme_says() -> None:
    done = cli("compare", "paper", "improved", "--drift", "hust", "--json", "--out", "report")
    assert done.code == 0, done.err
    data = json.loads(done.out)
    assert data == json.loads(Path("report/drift.json").read_text("utf-8"))
    readme = (Path(__file__).parents[4] / "README.md").read_text("utf-8")
    (row,) = (
        line for line in readme.splitlines() if "`gantryctl compare paper improved --drift hust`" in line
    )
    followed = "without the load encoder, moment and backlash followed, without a gentle end"
    controls = (
        "hust_gantry", "hust_improved", "hust_improved, nothing followed",
        followed, "without the load encoder, nothing followed",
    )  # fmt: skip
    for control in controls:
        spread = data["over_rows"][control]["a_true"]
        for part in ("median", "high", "worst"):
            assert f"{spread[part]:.4f}" in row, (control, part)
