"""The page of numbers: counted from the rows, complete, and honest about what has not been measured."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from gantryctl.engineering.campaign.job import INDEX, REFUSED
from gantryctl.engineering.fault_campaign.job import COLUMNS, FaultJob, row
from gantryctl.engineering.fault_campaign.kinds import FaultCampaign
from gantryctl.engineering.fault_campaign.report import Tally, replayed, report_data, report_page, tally
from gantryctl.engineering.fault_campaign.result import FaultResult
from gantryctl.engineering.scheduler.job import Chunk
from support.command_line import cli


def made(number: str, **others: object) -> dict[str, object]:
    given = {
        "refused": "",
        "violations": [],
        "drive": "sim",
        "scan_ms": 4.0,
        "faults": number,
        "axis_s": 3600.0,
    }
    return row(**{**given, **others})


ROWS = [
    made("A2", way_of="A2", way_deg=2.0, limit_deg=4.5),
    made("A2", way_of="A2", way_deg=1.8, limit_deg=2.0, drive="bus"),
    made("none", nuisances=1, stops="CTL-08", violations=["M2 at 1.000 s: CTL-08 | names nothing"]),
    made("A2+C5"),
    made("E1", refused="only on a bus", axis_s=0.0),
    made("A2", way_of="A2", way_deg=9.0, limit_deg=math.inf),
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    result = FaultResult(tmp_path / "rows", FaultCampaign("random"))
    result.begin()
    columns = {name: np.array([each[name] for each in ROWS]) for name in COLUMNS}
    columns = {
        name: values.astype(object) if COLUMNS[name] is str else values for name, values in columns.items()
    }
    result.write(Chunk(0, len(ROWS)), {INDEX: np.arange(len(ROWS)), **columns})
    return result.folder


def test_the_matrix_counts_no_nuisances() -> None:
    """Its cells begin with a fault: a rate of 0 would tell what nobody has counted."""
    (data,) = report_data([Tally(FaultCampaign("matrix"), played=1, axis_s=3600.0)])
    assert data["nuisances_per_1000_h"] is None
    (data,) = report_data([Tally(FaultCampaign("random"), played=1, axis_s=3600.0)])
    assert data["nuisances_per_1000_h"] == 0.0


def test_the_rows_are_counted(folder: Path) -> None:
    found = tally(FaultResult.read(folder))
    assert (found.played, found.refused, found.over_bus, found.nuisances) == (5, 1, 1, 1)
    assert found.reasons == {"only on a bus": 1}
    assert found.with_faults == {0: 1, 1: 3, 2: 1}
    worst = found.worst["A2"]
    # By the part of its limit: 1.8 of 2.0 is more than 2.0 of 4.5.
    assert (worst.way_deg, worst.limit_deg, worst.seed, worst.runs) == (1.8, 2.0, 1, 2)
    assert [each[INDEX] for each in found.broken] == [2]
    assert found.broken[0][REFUSED] == ""


def test_the_page_says_what_was_measured_and_what_was_not(folder: Path, tmp_path: Path) -> None:
    evidence = tmp_path / "evidence"
    evidence.mkdir()
    areas = [
        {
            "name": "program",
            "mutants": 10,
            "killed": 9,
            "argued": 1,
            "survived": 0,
            "severe": 4,
            "severe_killed": 4,
        }
    ]
    (evidence / "mutation.json").write_text(json.dumps({"areas": areas}))
    page = tmp_path / "page.md"
    answer = cli("faults", "report", folder, "--page", page, "--evidence", evidence, "--json")
    (data,) = answer.json["campaigns"]
    assert (data["played"], data["axis_h"], data["nuisances_per_1000_h"]) == (5, 5.0, 200.0)
    text = page.read_text()
    assert "| random, series 1 | 5 | 1 | 1, 3, 1, 0 | 1 | 5.0 | 1 | 200.0 | 1 |" in text
    assert "| A2 encoder freezes in motion | 1.800 | 2.000 | 90 % | 2 | random 1 |" in text
    assert "| program | 10 | 9 | 1 | 0 | 4 | 4 |" in text
    assert "`make coverage` counts them.\n\nNot measured yet." in text
    assert "CTL-08 / names nothing" in text
    assert text == cli("faults", "report", folder, "--evidence", evidence).out


def test_what_broke_is_played_again_and_the_page_tells_what_holds_today(folder: Path, tmp_path: Path) -> None:
    """Row 2 says that it broke; its scenario holds. Old rows alone would call the product worse than it is."""
    page = tmp_path / "page.md"
    given = ("faults", "report", folder, "--page", page)
    (before,) = cli(*given, "--json").json["campaigns"]
    assert before["broken_now"] is None
    assert "now |" not in page.read_text()
    (data,) = cli(*given, "--replay", "--json").json["campaigns"]
    assert (data["broken"], data["broken_now"]) == (1, 0)
    line = next(line for line in page.read_text().splitlines() if line.startswith("| random, series 1 | 2 |"))
    assert line.endswith("| holds |")


def test_what_breaks_again_is_told_with_what_breaks(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = tally(FaultResult.read(folder))
    broke = row(refused="", violations=["INV-1 at 2.000 s: 3.1 deg"])
    monkeypatch.setattr(
        FaultJob, "_row", lambda self, number: {**broke, "faults": "A2", "drive": "sim", "scan_ms": 4.0}
    )
    replayed(found, [].append)
    text = report_page([found], folder)
    assert "| **INV-1 at 2.000 s: 3.1 deg** |" in text
    assert report_data([found])[0]["broken_now"] == 1
