"""Threat model and the table for IEC 62443-4-2 name tests that exist, or say that there is none."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "explanation"
THREATS = (FOLDER / "threat-model.md").read_text(encoding="utf-8")


def rows(text: str) -> Iterator[dict[str, str]]:
    """Rows of all tables of a page that say by what something is shown, by the heads of their columns."""
    head: list[str] = []
    for line in text.splitlines():
        if not line.startswith("|"):
            head = []
            continue
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if not head:
            head = cells
        elif "shown by" in head and set(line) - set("|-"):
            assert len(cells) == len(head), line
            yield dict(zip(head, cells, strict=True))


def wrong(shown: str) -> str:
    """What is wrong with a cell "shown by"; empty when it names tests that exist, or says open."""
    if shown == "*open*":
        return ""
    named = re.findall(r"`(.*?)`", shown)
    if not named or re.sub(r"`.*?`|, ", "", shown):
        return f"{shown!r}: names no test and does not say *open*"
    for each in named:
        file, _, test = each.partition("::")
        path = ROOT / file
        if not (file.startswith("tests/") and path.name.startswith("test_") and path.is_file()):
            return f"{each}: there is no such file"
        if test and not re.search(rf"^(async )?def {test}\(", path.read_text(encoding="utf-8"), re.MULTILINE):
            return f"{each}: there is no such test"
    return ""


@pytest.mark.parametrize(
    ("shown", "found"),
    [
        ("`tests/unit/test_install.py::test_the_package_is_typed`", False),
        ("`tests/unit/test_install.py`, `tests/unit/test_files.py`", False),
        ("*open*", False),
        ("", True),
        ("obvious", True),
        ("`tests/unit/test_install.py` and so on", True),
        ("`tests/unit/test_nothing.py`", True),
        ("`tests/unit/test_install.py::test_the_package`", True),
        ("`tools/parts.py`", True),
    ],
)
def test_a_cell_that_shows_nothing_is_found(shown: str, found: bool) -> None:
    assert bool(wrong(shown)) is found


def test_every_test_of_the_threat_model_exists() -> None:
    assert not [said for row in rows(THREATS) if (said := wrong(row["shown by"]))]


def test_every_door_of_the_picture_is_judged_by_every_letter() -> None:
    doors = re.split(r"^## Door (\d)", THREATS, flags=re.MULTILINE)
    picture = (FOLDER / "trust_boundaries.svg").read_text(encoding="utf-8")
    assert set(doors[1::2]) == set(re.findall(r'class="number".*?>(\d)<', picture))
    for number, text in zip(doors[1::2], doors[2::2], strict=True):
        assert {row[""] for row in rows(text)} == set("STRIDE"), f"door {number}"


def test_what_nothing_shows_has_words_for_what_is_left() -> None:
    for row in rows(THREATS):
        assert row["threat"], row
        assert row["what is done"], row


# Requirements for components at SL 2, from the tables of IEC 62443-4-2:2019, annex B.
SL_2 = """
CCSC 1|CCSC 2|CCSC 3|CCSC 4
CR 1.1|CR 1.1 RE 1|CR 1.2|CR 1.3|CR 1.4|CR 1.5|CR 1.7|CR 1.8|CR 1.9|CR 1.10|CR 1.11|CR 1.12|CR 1.14
CR 2.1|CR 2.1 RE 1|CR 2.1 RE 2|CR 2.2|SAR 2.4|SAR 2.4 RE 1|CR 2.5|CR 2.6|CR 2.8|CR 2.9|CR 2.10
CR 2.11|CR 2.11 RE 1|CR 2.12|EDR/HDR 2.13
CR 3.1|CR 3.1 RE 1|SAR 3.2|CR 3.3|CR 3.4|CR 3.4 RE 1|CR 3.5|CR 3.6|CR 3.7|CR 3.8|CR 3.9
EDR/HDR/NDR 3.10|EDR/HDR/NDR 3.11|EDR/HDR/NDR 3.12|EDR/HDR/NDR 3.13|EDR/HDR/NDR 3.14
CR 4.1|CR 4.2|CR 4.3|CR 5.1|NDR 5.2, 5.3|CR 6.1|CR 6.2
CR 7.1|CR 7.1 RE 1|CR 7.2|CR 7.3|CR 7.3 RE 1|CR 7.4|CR 7.6|CR 7.7|CR 7.8
"""
STANDARD = (FOLDER / "iec-62443-4-2.md").read_text(encoding="utf-8")


def test_every_requirement_of_sl_2_has_one_row() -> None:
    assert [row["number"] for row in rows(STANDARD)] == SL_2.strip().replace("\n", "|").split("|")


def test_what_is_met_is_shown_by_tests_that_exist() -> None:
    for row in rows(STANDARD):
        assert not wrong(row["shown by"]), row["number"]
        assert row["how, and what lacks"], row["number"]
        if row["state"] == "met":
            assert row["shown by"] != "*open*", row["number"]


def test_the_sum_is_that_of_the_rows() -> None:
    states = Counter(row["state"] for row in rows(STANDARD))
    said = ", ".join(
        f"{states.pop(state)} {state}" for state in ("met", "partly", "not", "integrator", "not here")
    )
    assert not states
    assert f"Of {len(list(rows(STANDARD)))} rows: {said}.\n" in STANDARD
