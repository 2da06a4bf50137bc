"""Angles as people read and type them: signed, or within 0 to 360 deg (IEC 61217); numbers for machines stay."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gantryctl.machine import default_machine, with_values
from gantryctl.machine.effective import to_toml
from support.axes import tilt
from support.command_line import cli, done

IEC = with_values(default_machine(), {"axis.display": "0..360", "machine.name": "iec"})


@pytest.mark.parametrize(
    ("angle_deg", "read_deg"), [(0.0, 0.0), (90.0, 90.0), (-10.0, 350.0), (-180.0, 180.0), (180.0, 180.0)]
)
def test_iec_61217_counts_from_0_to_360(angle_deg: float, read_deg: float) -> None:
    assert IEC.axis.read_deg(angle_deg) == read_deg
    assert default_machine().axis.read_deg(angle_deg) == angle_deg


@pytest.mark.parametrize(
    ("typed_deg", "angle_deg"),
    [
        (350.0, -10.0), (190.0, -170.0), (180.0, 180.0), (-10.0, -10.0), (360.0, 0.0),
        (900.0, 900.0), (500.0, 500.0), (360.1, 360.1), (-190.0, -190.0),
    ],
)  # fmt: skip
def test_what_the_display_shows_may_be_typed(typed_deg: float, angle_deg: float) -> None:
    assert IEC.axis.meant_deg(typed_deg) == angle_deg
    # Where angles are signed, 350 deg lie beyond travel, and nothing is guessed.
    assert default_machine().axis.meant_deg(typed_deg) == typed_deg


@pytest.mark.parametrize(
    ("angle_deg", "text"),
    [
        (-180.0, "180.00 (- end)"), (180.0, "180.00 (+ end)"), (-175.0, "185.00 (- end)"), (174.0, "174.00 (+ end)"),
        (-172.9, "187.10"), (172.9, "172.90"), (-0.001, "0.00"), (90.0, "90.00"),
    ],
)  # fmt: skip
def test_of_two_places_that_read_alike_the_end_is_named(angle_deg: float, text: str) -> None:
    """The mechanical stops stand at +-187 deg: from 173 to 187 deg a reading is two places."""
    assert IEC.axis.dial.text(angle_deg, ".2f") == text
    # Signed angles, and a travel without two such places, need no word.
    assert "end" not in default_machine().axis.dial.text(angle_deg, ".2f")
    assert "end" not in with_values(tilt(), {"axis.display": "0..360"}).axis.dial.text(angle_deg, ".2f")


def test_the_ends_of_travel_are_told_apart_in_refusals_and_on_the_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path / "state"))
    file = tmp_path / "iec.toml"
    file.write_text(to_toml(IEC), encoding="utf-8")
    assert "stands at 180 (- end) deg" in done("sim", "reset", "--angle=-180", "--config", file).out
    assert "179.9996 (- end) deg" in done("status", "--config", file).out
    back = done("move", "--by", "0.2", "--config", file, "--no-trace").out
    assert re.search(r"done: 179\.99\d* \(- end\) -> 180\.(19|20)\d* \(- end\) deg", back), back
    told = cli("move", "--by", "-10", "--config", file, "--no-trace").err
    assert "is beyond -180.00 deg" in told
    told = cli("sim", "reset", "--angle", "190", "--config", file)
    assert "stands at 190 deg" in told.out
    told = cli("sim", "reset", "--angle", "800", "--config", file)
    assert "mechanical stops are at 173 (- end) and 187 (+ end) deg" in told.err


def test_an_angle_beyond_travel_stays_what_was_typed() -> None:
    """A tilt axis of -5 to 95 deg has 355 to 360 deg, and no 200 deg."""
    axis = with_values(tilt(), {"axis.display": "0..360"}).axis
    assert (axis.meant_deg(357.0), axis.meant_deg(200.0)) == (-3.0, 200.0)


def test_a_move_is_typed_and_printed_as_the_display_has_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path / "state"))
    file = tmp_path / "iec.toml"
    file.write_text(to_toml(IEC), encoding="utf-8")
    moved = cli("move", "355", "--config", file, "--no-trace")
    assert moved.code == 0
    assert "done: 0.0000 -> 355.0" in moved.out or "done: 0.0000 -> 354.9" in moved.out
    shown = cli("status", "--config", file)
    assert "angle" in shown.out
    assert "355.0" in shown.out or "354.9" in shown.out
    # A number for a machine is the angle of the axis.
    assert cli("status", "--config", file, "--json").json["angle_deg"] == pytest.approx(-5.0, abs=0.01)
    assert "angle                 35" in cli("encoder", "show", "--config", file).out
    assert cli("encoder", "show", "--config", file, "--json").json["angle_deg"] == pytest.approx(
        -5.0, abs=0.01
    )
    assert "target 900.00 deg is beyond" in cli("move", "900", "--config", file, "--no-trace").err


def test_ends_of_a_profile_are_typed_as_the_display_has_them(tmp_path: Path) -> None:
    """350 deg is -10 deg of this axis, and 10 deg the same place twice."""
    file = tmp_path / "iec.toml"
    file.write_text(to_toml(with_values(IEC, {"drive.kind": "sim"})), encoding="utf-8")
    assert "from 350 to 350 deg is no move" in cli("profile", "--config", file, "--move", "350", "-10").err
    assert "from 350 to 350 deg is no move" in cli("profile", "--config", file, "--move", "-10", "350").err
    told = cli("profile", "--config", file, "--move", "350", "700").err
    assert "700 deg is beyond travel, 180 (- end) to 180 (+ end) deg" in told


def test_tables_of_a_chord_test_name_bases_as_they_are_read(tmp_path: Path) -> None:
    """A base of -90 deg is typed as 270 and printed as 270; the table for machines keeps -90."""
    file = tmp_path / "iec.toml"
    file.write_text(to_toml(IEC), encoding="utf-8")
    out = tmp_path / "report"
    answer = cli(
        "accuracy", "run", "--config", file, "--procedure", "E", "--base", "270", "--ensemble", "0",
        "--no-speed-test", "--out", out,
    )  # fmt: skip
    assert answer.code in (0, 1), answer.err
    assert "270 ccw" in answer.out
    assert "rms by base: 270 deg" in answer.out
    assert "-90" not in answer.out.replace(str(tmp_path), "")
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "<td>270 ccw</td>" in page
    assert "−90" not in page
    assert (out / "table.csv").read_text(encoding="utf-8").splitlines()[1].startswith("-90")
