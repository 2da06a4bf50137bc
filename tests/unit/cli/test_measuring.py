"""`stops`, `speed-test`, `accuracy`, `config` and `trace` as they are called: output, files, exit codes, seeds."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gantryctl.cli.engineering.accuracy import _announce
from gantryctl.engineering.accuracy.procedure.plan import chord_test
from gantryctl.engineering.accuracy.table_csv import read_error_table
from gantryctl.machine import default_machine
from support.command_line import cli, done, machine_file


def test_stops_prints_every_class_and_is_exit_code_1_when_one_is_too_long(tmp_path: Path) -> None:
    text = done("stops", "--speed", "6").out
    speeds = [line.split()[1] for line in text.splitlines() if line.startswith(("normal", "quick"))]
    assert speeds == ["6.0", "6.0"], "no other speed than the one that was asked for"
    for name in ("normal", "jog-release", "quick", "torque off + brake"):
        assert any(line.startswith(name) for line in text.splitlines())
    assert "inspect afterwards" in text
    assert max(len(line) for line in text.splitlines()) <= 120
    # The rules see a rigid body: 3.33 deg and 53 ms of reaction; the whole plant takes 3.68 deg with 60 ms.
    tight = machine_file(
        tmp_path / "m.toml",
        {"required.stopping_angle_deg": 3.65, "monitors.velocity_deviation_deg_s": 0.2},
    )
    answer = cli("stops", "--speed", "6", "--config", tight)
    assert answer.code == 1
    assert "permitted: 3.65 deg" in answer.out


def test_speed_test_passes_and_fails(tmp_path: Path) -> None:
    text = done("speed-test", "--speed", "3", "--out", tmp_path).out
    assert [line.split()[0] for line in text.splitlines()] == [
        "speed",
        "asked",
        "pass",
        "pass",
        "motor",
        "report:",
    ]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count('class="recording"') == 2
    assert "at most 0.01°/s" in page
    slack = machine_file(tmp_path / "m.toml", {"control.kvf": 0.0})
    answer = cli("speed-test", "--speed", "3", "--config", slack)
    assert answer.code == 1
    assert "FAIL" in answer.out


@pytest.mark.parametrize("command", [["speed-test"], ["accuracy", "run"]])
def test_what_needs_a_plant_says_so(tmp_path: Path, command: list[str]) -> None:
    ideal = machine_file(tmp_path / "m.toml", {"drive.kind": "ideal"})
    answer = cli(*command, "--config", ideal)
    assert answer.code == 2
    assert 'use "sim"' in answer.err


def accuracy(out: Path, *arguments: object) -> dict[str, object]:
    answer = done("accuracy", "run", "--no-speed-test", "--out", out, "--json", *arguments)
    assert json.loads((out / "report.json").read_text(encoding="utf-8")) == answer.json
    found: dict[str, object] = answer.json
    return found


def test_the_seed_changes_the_noise_and_nothing_else(tmp_path: Path) -> None:
    first, again, other = (accuracy(tmp_path / str(k), "--seed", seed) for k, seed in enumerate((1, 1, 2)))
    assert first["tables"] == again["tables"]
    assert first["a_measured"] == again["a_measured"]
    assert (first["seed"], other["seed"]) == (1, 2)
    tables = [found["tables"] for found in (first, other)]
    assert tables[0]["true"] == tables[1]["true"]
    assert tables[0]["measured"] != tables[1]["measured"]


def test_accuracy_run_writes_its_report_and_leaves_the_state_alone(tmp_path: Path, state: Path) -> None:
    text = done("accuracy", "run", "--no-speed-test", "--out", tmp_path / "r").out
    assert "A = 0.01" in text
    assert "PASS" in text
    assert text.splitlines()[-1] == f"report: {tmp_path / 'r' / 'report.html'}"
    assert sorted(file.name for file in (tmp_path / "r").iterdir()) == [
        "report.html",
        "report.json",
        "table.csv",
    ]
    assert len(read_error_table(tmp_path / "r" / "table.csv", None).rows) == 6
    assert not state.exists()


def test_a_criterion_that_is_not_met_is_exit_code_1() -> None:
    Path("bad.csv").write_text(
        "base_deg,direction,displacement_deg,error_deg\n0,ccw,5,0.2\n0,cw,5,-0.2\n90,ccw,5,0.1\n90,cw,5,-0.1\n"
    )
    answer = cli("accuracy", "report", "--measured", "bad.csv", "--out", "r", "--required", "0.1")
    assert answer.code == 1
    assert "FAIL" in answer.out
    side = cli(
        "accuracy", "report", "--measured", "bad.csv", "--out", "r", "--required", "0.1", "--motor-side"
    )
    assert side.code == 0, "readings of the motor's own encoder get no verdict"
    assert "PASS" not in side.out
    assert "FAIL" not in side.out


def test_accuracy_stats_of_the_paper_s_table() -> None:
    assert (
        "A = 0.0113 deg, largest X + 3 S minus smallest X - 3 S, 6 rows pooled"
        in done("accuracy", "stats", "paper_table2.csv").out
    )
    assert done("accuracy", "stats", "paper_table2.csv", "--json").json["statistics"][
        "a_deg"
    ] == pytest.approx(0.0113, abs=5e-5)


def test_files_that_cannot_be_written_are_exit_code_3(tmp_path: Path) -> None:
    (tmp_path / "r" / "report.html").mkdir(parents=True)
    Path("t.csv").write_text("base_deg,direction,displacement_deg,error_deg\n0,ccw,5,0.001\n0,cw,5,-0.001\n")
    answer = cli("accuracy", "report", "--measured", "t.csv", "--out", tmp_path / "r")
    assert answer.code == 3
    assert answer.err == f"error: {tmp_path / 'r' / 'report.html'}: Is a directory\n"


def test_a_machine_file_of_one_s_own_from_init_to_diff() -> None:
    assert "config check mine.toml" in done("config", "init", "mine.toml").out
    done("config", "check", "mine.toml")
    text = Path("mine.toml").read_text(encoding="utf-8")
    Path("other.toml").write_text(text.replace("kpp_per_s = 10.0 ", "kpp_per_s = 9.5 "))
    assert done("config", "diff", "mine.toml", "other.toml").out == "[control] kpp_per_s: 10.0 -> 9.5 1/s\n"
    assert "9.5" in done("config", "show", "other.toml").out
    assert "properties" in done("config", "schema").json
    done("move", "0.2", "--config", "other.toml")


def test_a_trace_is_shown_plotted_and_exported() -> None:
    file = done("move", "0.2", "--out", "t", "--json").json["trace"]
    assert "pos_ref_rad" in done("trace", "show", file).out
    done("move", "0.1")
    assert "/traces/move-" in done("trace", "show").out
    assert done("trace", "show", "last") == done("trace", "show")
    for name in ("a.png", "a.svg", "a.html"):
        assert done("trace", "plot", file, "--out", name).out == f"wrote {name}\n"
        assert Path(name).stat().st_size > 1000
    done("trace", "export", file, "--format", "csv", "--degrees", "--out", "a.csv")
    header, *lines = Path("a.csv").read_text(encoding="utf-8").splitlines()
    assert header.startswith("time_s,")
    assert len(lines) == done("trace", "show", file, "--json").json["rows"]


def test_a_file_that_is_no_recording_is_a_wrong_command() -> None:
    Path("x").write_text("hello")
    for command in (["show"], ["plot"], ["export", "--format", "csv"]):
        for file in ("x", "nowhere", "."):
            answer = cli("trace", *command, file)
            assert (answer.code, answer.out) == (2, "")
            assert answer.err.count("\n") == 1


@pytest.mark.parametrize(("real_time", "clock"), [(False, "virtual"), (True, "real")])
def test_a_chord_test_says_by_which_clock_it_runs(real_time: bool, clock: str) -> None:
    machine = default_machine()
    told = _announce(machine, chord_test(machine), real_time=real_time)
    assert told.endswith(f"on the simulated axis in {clock} time\n")
