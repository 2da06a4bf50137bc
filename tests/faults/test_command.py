"""`gantryctl faults`."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.command_line import cli


def test_the_catalogue_is_listed_and_a_row_is_shown() -> None:
    rows = cli("faults", "list", "--json").json
    assert {row["number"] for row in rows} >= {"A2", "B5", "C4", "D1", "E10", "F3", "G9"}
    assert "encoder freezes in motion" in cli("faults", "list").out
    shown = cli("faults", "show", "a2b", "--json").json
    assert shown == next(row for row in rows if row["number"] == "A2")
    assert [case["number"] for case in shown["cases"]][:2] == ["A2", "A2b"]
    assert "own loop is sound" in cli("faults", "show", "A2b").out
    nobody = cli("faults", "show", "A9").out
    assert "injected on  no axis" in nobody
    assert "test_a_wrap_near_the_travel_is_refused" in nobody
    assert "encoder gain value=0" in cli("faults", "show", "A2").out
    kinds = cli("faults", "list", "--kinds", "--json").json
    assert {"where": "encoder", "kind": "gain"}.items() <= kinds[0].items()
    assert "foreign_nmt" in cli("faults", "list", "--kinds").out


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_a_fault_is_run_with_its_picture(tmp_path: Path, suffix: str) -> None:
    picture = tmp_path / f"run.{suffix}"
    answer = cli("faults", "run", "--fault", "D1", "--speed", "-3", "--angle", "40", "--out", picture)
    assert answer.code == 0
    assert "first alarm  DRV-01" in answer.out
    assert "as it must be" in answer.out
    first = picture.read_bytes()
    assert len(first) > 10_000
    cli("faults", "run", "--fault", "D1", "--speed", "-3", "--angle", "40", "--out", picture)
    # Same seed, same trace, same picture.
    assert picture.read_bytes() == first


@pytest.mark.can
def test_a_fault_is_run_over_the_bus() -> None:
    answer = cli(
        "faults", "run", "--fault", "D1", "--speed", "1", "--bus", "--brake-owner", "object_60FE", "--json"
    )
    found = answer.json
    assert (answer.code, found["ok"], found["drive"], found["brake_owner"]) == (0, True, "bus", "object_60FE")
    assert found["way_deg"] <= found["limit_deg"]


def test_injections_of_a_file_are_run_and_nothing_is_demanded(tmp_path: Path) -> None:
    file = tmp_path / "my.toml"
    file.write_text(
        '[[injection]]\nwhere = "drive"\nkind = "trip"\nargs = { code = 9000 }\nwhen = { angle_deg = 91.0 }\n\n'
        '[[injection]]\nwhere = "brake"\nkind = "slow"\nargs = { late_s = 0.1 }\nwhen = { event = "DRV-01" }\n'
    )
    answer = cli("faults", "run", "--file", file, "--speed", "3", "--json")
    assert answer.code == 0
    assert answer.json["first_out"] == "DRV-01"
    assert answer.json["told_deg"] > 91.0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("run",), "give --fault or --file"),
        (("run", "--fault", "Z1"), "there is no fault 'Z1'"),
        (("run", "--fault", "E10"), "E10 'controller is killed' needs a drive on a bus: --bus"),
        (("run", "--fault", "A9"), "is no fault of the axis"),
        (("run", "--fault", "A2", "--speed", "0"), "speed in deg/s must not be 0"),
        (("run", "--fault", "A2", "--speed", "99"), "speed in deg/s must be from -6 to 6, got 99"),
        (("run", "--fault", "A2", "--angle", "-179"), "the axis would start at"),
        (("run", "--fault", "A2", "--scan", "7.3"), "[control] scan_period_ms = 7.3 ms"),
        (("run", "--fault", "A2", "--out", "x.txt"), "pictures are written as .png, .svg"),
        (("run", "--file", "/nowhere.toml"), "cannot be read"),
        (("show", "A99"), "there is no fault 'A99'"),
    ],
)
def test_what_makes_no_sense_is_one_sentence(arguments: tuple[str, ...], said: str) -> None:
    answer = cli("faults", *arguments)
    assert answer.code == 2
    assert said in answer.err
