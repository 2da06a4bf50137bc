"""The step torque, by hand: pushes against the closed brake, and the limit of the drive maker's tool."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gantryctl.commissioning import steps_lacks
from gantryctl.commissioning.results import Figure, Outcome, StepResult
from gantryctl.errors import AlarmStop
from gantryctl.image import DriveRequest
from gantryctl.machine import with_values
from gantryctl.operation.ledger.rows import TORQUE_LIMIT_NM
from unit.commissioning.hand_drive import (
    MACHINE,
    HandDrive,
    axis_of,
)

pytestmark = pytest.mark.can

ENABLE = DriveRequest.ENABLE


def braked(plus: float = 70.0, minus: float = -70.0, outcome: Outcome = Outcome.PASSED) -> StepResult:
    return StepResult("brake", outcome, "", {"plus_nm": Figure(plus), "minus_nm": Figure(minus)})


def limit_drive(**what: Any) -> HandDrive:
    drive = HandDrive(**what)
    drive.machine = with_values(MACHINE, {"can.torque_limit_in_drive_nm": 385.0})  # type: ignore[attr-defined]
    return drive


@pytest.mark.parametrize(
    ("plus", "minus", "level_nm"), [(70.0, -70.0, 28.02), (70.0, -60.0, 22.02), (50.0, -70.0, 16.02)]
)
def test_the_push_is_a_part_of_what_the_brake_has_held(
    step: Any, plus: float, minus: float, level_nm: float
) -> None:
    """0.6 of the weaker direction, less 15.99 kN m / 1144 = 13.98 N m of the load."""
    drive = limit_drive()
    found = step(steps_lacks, "torque", drive, brake=braked(plus, minus))
    assert found.outcome is Outcome.PASSED, found.proof
    asked = [output.torque_ff_nm for output in drive.wrote]
    assert (max(asked), min(asked)) == pytest.approx((level_nm, -level_nm), abs=0.05)
    assert found.number(TORQUE_LIMIT_NM) == pytest.approx(level_nm, abs=0.05)
    assert not any(output.brake_open for output in drive.wrote)


def test_a_push_that_gives_less_or_goes_against_an_unproven_brake_is_refused(step: Any) -> None:
    assert step(steps_lacks, "torque", limit_drive(push=0.7), brake=braked()).outcome is Outcome.FAILED
    drive = limit_drive()
    for outcome in (Outcome.FAILED, Outcome.NOT_TESTABLE):
        assert step(steps_lacks, "torque", drive, brake=braked(outcome=outcome)).outcome is Outcome.FAILED
    assert not drive.wrote


@pytest.mark.parametrize(
    ("push", "outcome"),
    [(0.84, Outcome.FAILED), (0.86, Outcome.PASSED), (1.14, Outcome.PASSED), (1.16, Outcome.FAILED)],
)
def test_a_push_is_given_within_15_percent(step: Any, push: float, outcome: Outcome) -> None:
    """A scale of 6077 further off would make every torque of the controller another one."""
    assert step(steps_lacks, "torque", limit_drive(push=push), brake=braked()).outcome is outcome


@pytest.mark.parametrize(("given_nm", "held"), [(442.0, True), (443.5, False)])
def test_a_limit_of_the_makers_tool_may_be_passed_by_15_percent(
    step: Any, given_nm: float, held: bool
) -> None:
    """385 N m are entered, 466 asked for: at 442.75 the torque goes off."""
    drive = limit_drive()
    drive.spoil = lambda seen: seen._replace(torque_act_nm=max(-given_nm, min(seen.torque_act_nm, given_nm)))
    if held:
        assert step(steps_lacks, "torque", drive, brake=braked(800.0, -800.0)).outcome is Outcome.PASSED
    else:
        with pytest.raises(AlarmStop, match=r"442\.7 N m are the limit of the drive"):
            step(steps_lacks, "torque", drive, brake=braked(800.0, -800.0))


def test_a_load_that_takes_more_than_the_brake_has_held_leaves_nothing_to_push_with(step: Any) -> None:
    """0.6 x 20 N m are less than the 13.98 N m of the load."""
    drive = limit_drive()
    found = step(steps_lacks, "torque", drive, brake=braked(20.0, -20.0))
    assert (found.outcome, found.to_do) == (Outcome.NOT_TESTABLE, "a higher [brake] test_torque_nm")
    assert not drive.wrote


def test_of_two_pushes_the_weaker_is_what_the_limit_was_shown_to_be(step: Any) -> None:
    """28 N m are asked for both ways; back 26 of them are given."""
    drive = limit_drive()
    drive.spoil = lambda seen: seen._replace(torque_act_nm=max(seen.torque_act_nm, -26.0))
    found = step(steps_lacks, "torque", drive, brake=braked())
    assert (found.outcome, found.number(TORQUE_LIMIT_NM)) == (Outcome.PASSED, 26.0)
    assert found.number("pushed_least_nm") == 26.0
    assert found.number("pushed_most_nm") == pytest.approx(28.02, abs=0.05)


def test_a_limit_that_acts_is_what_the_push_is_held_against(step: Any) -> None:
    """0.6 x 800 - 14 = 466 N m are asked for, 385 N m are given: less than 85 % of the push, all of the limit."""
    drive = limit_drive()
    drive.spoil = lambda seen: seen._replace(torque_act_nm=max(-385.0, min(seen.torque_act_nm, 385.0)))
    found = step(steps_lacks, "torque", drive, brake=braked(800.0, -800.0))
    assert (found.outcome, found.number(TORQUE_LIMIT_NM)) == (Outcome.PASSED, 385.0)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_push_never_passes_the_limit_of_the_drive(direction: float) -> None:
    drive = HandDrive(push=3.0)
    with pytest.raises(AlarmStop, match="are the limit"):
        steps_lacks._push(axis_of(drive, following=False), direction * 20.0, 30.0)
    assert abs(drive.wrote[-1].torque_ff_nm) == 0.0


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_push_is_taken_back_and_never_goes_the_other_way(direction: float) -> None:
    """Beside what is asked for the drive gives 2 N m of its own: 60B2 ends where both are 0 together."""
    drive = HandDrive(torque_nm=2.0 * direction)
    steps_lacks._push(axis_of(drive, following=False), direction * 20.0, 30.0)
    asked = [direction * output.torque_ff_nm for output in drive.wrote if output.request is ENABLE]
    assert max(asked) == pytest.approx(20.0)
    # In 0.5 s: 0.16 N m in a scan.
    assert max(np.diff(asked)) == pytest.approx(0.16)
    assert min(asked) == pytest.approx(-2.0)
    assert asked[-1] == pytest.approx(-2.0)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_what_the_enabled_drive_gives_by_itself_is_no_part_of_the_push(direction: float) -> None:
    """Its speed loop holds 10 N m against the closed brake from the moment it is enabled, none before."""
    drive = HandDrive(torque_nm=10.0 * direction)
    given = steps_lacks._push(axis_of(drive, following=False), direction * 20.0, 30.0)
    assert direction * given == pytest.approx(20.0)
