"""The page of the fault catalogue is written from the table and from measured ways."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gantryctl.engineering.faults.catalogue import CATALOGUE
from gantryctl.engineering.faults.table.page import page
from gantryctl.engineering.faults.table.ways import measure

ROOT = Path(__file__).parents[2]
WAYS = ROOT / "docs/evidence/fault_ways.json"


def test_the_page_is_the_one_written_from_the_table() -> None:
    shown = (ROOT / "docs/reference/faults.md").read_text(encoding="utf-8")
    written = page(json.loads(WAYS.read_text(encoding="utf-8")))
    assert shown == written, (
        "run: python -m gantryctl.engineering.faults.table.page docs/reference/faults.md docs/evidence/fault_ways.json"
    )


def test_what_was_measured_is_still_in_the_catalogue() -> None:
    measured = json.loads(WAYS.read_text(encoding="utf-8"))["cases"]
    assert len(measured) > 50
    assert measured.keys() <= {case.number for case in CATALOGUE}


def test_one_row_measured_again_is_as_long_as_in_the_evidence() -> None:
    again = measure([case for case in CATALOGUE if case.number == "G9"])["cases"]["G9"]
    kept = json.loads(WAYS.read_text(encoding="utf-8"))["cases"]["G9"]
    for speed, found in again.items():
        # Virtual time has no scatter. A change of a reaction that moves it by more than this is to be measured anew.
        assert found["way_deg"] == pytest.approx(kept[speed]["way_deg"], abs=0.05), speed
