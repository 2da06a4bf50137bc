"""The table of the fault catalogue: complete, every row with its evidence."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

from gantryctl.engineering.faults.catalogue import CATALOGUE
from gantryctl.engineering.faults.table.page import REACTIONS_TEST
from gantryctl.engineering.faults.table.row import State
from gantryctl.engineering.faults.table.table import GROUPS, ROWS, base
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.table import ALARMS

ROOT = Path(__file__).parents[2]
# The catalogue has so many rows in each group; what was found later is counted on.
CATALOGUED = {"A": 16, "B": 12, "C": 9, "D": 12, "E": 17, "F": 16, "G": 16, "H": 19}


@cache
def names_in(path: str) -> set[str]:
    file = ROOT / "tests" / path
    return set(re.findall(r"def (test_\w+)", file.read_text(encoding="utf-8"))) if file.is_file() else set()


def test_the_catalogue_has_117_rows_and_all_stand_in_the_table() -> None:
    wanted = {f"{letter}{n}" for letter, count in CATALOGUED.items() for n in range(1, count + 1)}
    assert len(wanted) == 117
    assert wanted <= ROWS.keys()
    assert sum(len(rows) for _, rows in GROUPS) == len(ROWS), "no number is used twice"


@pytest.mark.parametrize("number", ROWS)
def test_every_test_that_a_row_names_exists(number: str) -> None:
    for each in ROWS[number].tests:
        path, *_, name = each.split("::")
        assert name in names_in(path), f"{number} names {each}"


@pytest.mark.parametrize("number", ROWS)
def test_a_row_has_evidence_and_what_is_not_done_has_its_reason(number: str) -> None:
    row = ROWS[number]
    injected = any(base(case.number) == number for case in CATALOGUE)
    if row.state is State.YES:
        assert row.tests or (injected and (ROOT / "tests" / REACTIONS_TEST).is_file()), number
    else:
        # Shorter than a sentence is no argument.
        assert len(row.why) > 40, f"{number} is {row.state}: why?"


@pytest.mark.parametrize("case", CATALOGUE, ids=[case.number for case in CATALOGUE])
def test_every_fault_that_can_be_injected_belongs_to_a_row(case) -> None:
    assert base(case.number) in ROWS


@pytest.mark.parametrize(
    "row", [row for row in ALARMS.values() if row.reaction >= Reaction.QUICK_STOP], ids=str
)
def test_every_alarm_that_stops_the_axis_belongs_to_a_fault(row) -> None:
    read = {code for fault in ROWS.values() for code in fault.codes}
    assert row.code in read | NO_FAULT


NO_FAULT = {
    # A sag after the release, a lost standstill: monitors of a plant, not single faults.
    Code.BRK_10, Code.BRK_11, Code.CTL_13, Code.SYS_10,
    # The torque limit of a measurement: what it excites is asked for.
    Code.CTL_23,
}  # fmt: skip
