"""The wall clock may jump by hours (F4): the scan does not read it, and the journal is in the order of its numbers."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import pytest

import gantryctl
from gantryctl.service.recorder.journal.proof import verify
from gantryctl.service.recorder.journal.reading import read_journal
from gantryctl.service.recorder.journal.writer import Journal

SOURCES = Path(gantryctl.__file__).parent
# Everything that a scan runs through. What keeps dates (brake test, journal, certificates) lies outside.
SCAN = ("program", "motion", "runtime", "drives", "wiring", "trace")
WALL = {("time", "time"), ("time", "time_ns"), ("datetime", "now"), ("datetime", "utcnow"), ("date", "today")}


def wall_clocks(source: str) -> list[str]:
    """Calls that read the wall clock."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if (node.value.id, node.attr) in WALL:
                found.append(f"{node.value.id}.{node.attr}")
        elif isinstance(node, ast.ImportFrom) and node.module == "time":
            found += [f"time.{each.name}" for each in node.names if ("time", each.name) in WALL]
    return found


def test_a_wall_clock_would_be_found() -> None:
    assert wall_clocks("import time\nx = time.time()\n") == ["time.time"]
    assert wall_clocks("from time import time_ns\n") == ["time.time_ns"]
    assert wall_clocks("from datetime import UTC, datetime\nx = datetime.now(UTC)\n") == ["datetime.now"]


def test_nothing_in_the_scan_reads_the_wall_clock() -> None:
    read = {
        str(path.relative_to(SOURCES)): found
        for package in SCAN
        for path in sorted((SOURCES / package).rglob("*.py"))
        if (found := wall_clocks(path.read_text(encoding="utf-8")))
    }
    assert read == {}


def test_what_hangs_is_ended_by_one_rule_and_no_test_has_a_limit_of_its_own(
    request: pytest.FixtureRequest,
) -> None:
    """Minutes for the fast ones, a day for the slow ones; a person's `--timeout` stands above both."""
    tests = Path(__file__).parents[1]
    marks = "pytest.mark." + "timeout"
    own = [path for path in tests.rglob("*.py") if marks in path.read_text(encoding="utf-8")]
    assert own == [tests / "conftest.py"]
    limits = [mark.args for mark in request.node.iter_markers("timeout")]
    assert limits == ([(600.0,)] if request.config.getoption("timeout") is None else [])


@pytest.mark.usefixtures("keys")
def test_a_clock_that_goes_back_changes_no_order_in_the_journal(tmp_path: Path) -> None:
    """Ten years back, an hour forward: both clocks stay with the event, and the number decides."""
    stamps = (
        "2026-03-29T01:59:59.000+00:00",
        "2016-03-29T02:00:00.000+00:00",
        "2026-03-29T03:00:01.000+00:00",
    )
    journal = Journal(tmp_path)
    for number, utc in enumerate(stamps, start=1):
        values = {"utc": utc, "monotonic_ns": number, "kind": "command", "text": f"event {number}"}
        journal.append(1, 0, number, [json.dumps(values).encode()])
    journal.close()
    rows = read_journal(tmp_path)
    assert [row.values["text"] for row in rows] == ["event 1", "event 2", "event 3"]
    assert [row.values["utc"] for row in rows] == list(stamps)
    assert verify(tmp_path)[:2] == (3, "")
