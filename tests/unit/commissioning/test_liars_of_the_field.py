"""Drives with the dictionaries of real ones, and lies: the steps refuse them as they refuse the plain drive's.

What a lie is about must be there: a drive without 1016 cannot ignore it. Each lie is told by one drive in the fast set,
and by all of them in the slow one.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, Final

import pytest

from gantryctl.commissioning import Outcome
from gantryctl.commissioning.field import field_machine
from gantryctl.drives.od.object_table import ObjectTable, read_object_tables
from gantryctl.machine import Machine
from gantryctl.wiring.virtual import shipped_objects
from unit.commissioning.test_field import REFUSED
from unit.commissioning.test_liars import LIES, Lie
from unit.commissioning.virtual_commissioning import MACHINE, VirtualCommissioning

pytestmark = pytest.mark.can

TABLES: Final = read_object_tables(shipped_objects())
# Two have no CSV; the third is commissioned with a watchdog node beside it.
DRIVES: Final = tuple(name for name in TABLES if "runs_csv" not in REFUSED.get(name, ()))
_HEARTBEAT, _DEADLINE, _TORQUE_LIMIT = (0x1016, 1), (0x1400, 5), (0x6072, 0)
_ABOUT: Final = {
    "heartbeat-ignored": (_HEARTBEAT,),
    "deadline-ignored": (_DEADLINE,),
    "torque-limit-ignored": (_TORQUE_LIMIT,),
    **dict.fromkeys(
        ("emcy-only", "stops-at-rest-only", "fault-shown-only", "brake-open-in-silence"),
        (_HEARTBEAT, _DEADLINE),
    ),
}
# Objects of the quick stop: without one of them the drive's own ramp is measured by a step of its own.
_RAMP: Final = ((0x6085, 0), (0x605A, 0))
# The axis of a silent controller goes on for 150 ms instead of 50 where 1016 alone watches; `stops` has 1 deg/s then.
_LATER_DEG: Final = 0.1


def has(table: ObjectTable, place: tuple[int, int]) -> bool:
    return not table.lacks(*place)


@cache
def machine_of(name: str) -> Machine:
    return field_machine(MACHINE, TABLES[name], "", watchdog=name in REFUSED)


def watches(name: str) -> bool:
    return any(has(TABLES[name], place) for place in (_HEARTBEAT, _DEADLINE))


def told(name: str, lie: Lie) -> bool:
    """The drive can tell this lie, and the step asks it."""
    about = _ABOUT.get(lie.liar, ())
    asked = lie.step != "silence" or watches(name)
    return lie.changes is None and asked and (not about or any(has(TABLES[name], place) for place in about))


def cases() -> Iterator[Any]:
    for number, lie in enumerate(LIES):
        able = [name for name in DRIVES if told(name, lie)]
        for name in able:
            fast = name == able[number % len(able)]
            marks = () if fast else pytest.mark.slow
            yield pytest.param(name, lie, id=f"{name.split()[0]}-{lie.liar}-{lie.step}", marks=marks)


def steps_before(name: str, step: str) -> tuple[str, ...]:
    """What the step rests on with this drive."""
    if step != "stops":
        return ()
    return () if watches(name) else ("watchdog",)


@pytest.fixture
def commission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> VirtualCommissioning:
    return VirtualCommissioning(tmp_path, monkeypatch)


@pytest.mark.parametrize(("name", "lie"), list(cases()))
def test_a_liar_of_the_field_is_refused(commission: VirtualCommissioning, name: str, lie: Lie) -> None:
    done = commission(lie.liar, *steps_before(name, lie.step), lie.step, base=machine_of(name))
    assert done.result.outcome is Outcome.FAILED, done.result.proof
    assert "the step watchdog has not passed" not in done.result.proof
    assert done.way_deg <= lie.way_deg + (_LATER_DEG if lie.step == "stops" else 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("step", sorted({lie.step for lie in LIES}))
@pytest.mark.parametrize("name", DRIVES)
def test_the_sound_drive_of_the_field_passes_the_same_steps(
    commission: VirtualCommissioning, name: str, step: str
) -> None:
    result = commission("", *steps_before(name, step), step, base=machine_of(name)).result
    testable = step != "silence" or watches(name)
    assert result.outcome is (Outcome.PASSED if testable else Outcome.NOT_TESTABLE), result.proof


@pytest.mark.slow
@pytest.mark.parametrize("liar", ["slow-quick-stop", "hard-quick-stop", "quick-stop-option-ignored"])
@pytest.mark.parametrize(
    "name", [name for name in DRIVES if not all(has(TABLES[name], place) for place in _RAMP)]
)
def test_an_own_ramp_that_does_not_fit_is_refused_by_the_step_that_measures_it(
    commission: VirtualCommissioning, name: str, liar: str
) -> None:
    done = commission(liar, *steps_before(name, "stops"), "ramp", base=machine_of(name))
    assert done.result.outcome is Outcome.FAILED, done.result.proof


def test_each_lie_is_told_by_a_drive_of_the_field() -> None:
    assert len(DRIVES) == 7
    assert {lie.liar for lie in LIES} == {lie.liar for lie in LIES if any(told(name, lie) for name in DRIVES)}
