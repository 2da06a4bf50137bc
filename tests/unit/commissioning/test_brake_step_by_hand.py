"""The step brake, by hand: torque against the closed brake of a drive of a few lines, and its verdict."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import pytest

from gantryctl.commissioning import steps_lacks, steps_power
from gantryctl.commissioning.results import Outcome
from gantryctl.image import DriveRequest, DriveState
from gantryctl.machine import with_values
from gantryctl.program.power.brake_test import BrakeTest
from gantryctl.wiring.program import untestable
from unit.commissioning.hand_drive import (
    COUNTS_PER_DEG,
    MACHINE,
    HandDrive,
    axis_of,
    context,
)

pytestmark = pytest.mark.can

S = DriveState


@pytest.mark.parametrize(
    ("push", "slip_deg", "passes"),
    [(1.0, 0.0, True), (1.0, 0.015, True), (0.3, 0.0, False), (1.0, 0.03, False), (1.0, -0.03, False)],
)
def test_the_brake_passes_by_the_torque_that_it_bore_without_slipping(
    step: Any, push: float, slip_deg: float, passes: bool
) -> None:
    """70 N m both ways and less than 0.02 deg; the brake stays closed all the time."""
    drive = HandDrive(push=push)
    drive.spoil = lambda seen: seen._replace(
        pos_act_counts=round(slip_deg * COUNTS_PER_DEG) if abs(seen.torque_act_nm) > 60.0 else 0
    )
    found = step(steps_power, "brake", drive)
    assert (found.outcome is Outcome.PASSED) is passes, found.proof
    assert not any(output.brake_open for output in drive.wrote)
    # The torque is off before the drive is.
    last = next(k for k, output in enumerate(drive.wrote) if output.request is DriveRequest.DISABLE)
    assert abs(push * drive.wrote[last - 1].torque_ff_nm) < 3.0
    # Beside its limit in the report.
    assert found.figures["moved_deg"].high == 0.02
    assert found.number("torque_nm") == 70.0
    if passes:
        assert found.number("moved_deg") == pytest.approx(slip_deg, abs=1e-5)
        assert (found.number("plus_nm"), found.number("minus_nm")) == pytest.approx((70.0, -70.0), abs=1.5)


@pytest.mark.parametrize("own_nm", [5.0, -5.0])
def test_the_torque_of_the_drives_own_loop_is_taken_out_before_it_is_disabled(
    step: Any, own_nm: float
) -> None:
    """At rest its speed loop gives 5 N m beside what is asked for: the brake bears nothing as it goes."""
    drive = HandDrive(torque_nm=own_nm)
    step(steps_power, "brake", drive)
    last = next(k for k, output in enumerate(drive.wrote) if output.request is DriveRequest.DISABLE)
    assert drive.wrote[last - 1].torque_ff_nm + own_nm == pytest.approx(0.0, abs=3.0)


def test_a_brake_test_has_the_limits_of_the_file_in_its_own_units(monkeypatch: pytest.MonkeyPatch) -> None:
    """70 N m, 0.02 deg of sag in rad, 385 N m at most, scans of 4 ms."""
    given: list[float] = []

    class Enough(Exception):
        pass

    def test(*limits: float) -> None:
        given.extend(limits)
        raise Enough

    monkeypatch.setattr(steps_power, "BrakeTest", test)
    with pytest.raises(Enough):
        steps_power._test_brake(context(), axis_of(HandDrive()))
    assert given == pytest.approx([70.0, 3.490659e-4, 385.0, 0.004])


@pytest.mark.parametrize(
    ("kept_nm", "prepared_nm"), [(30.0, 30.0), (-30.0, -30.0), (None, 0.0), (250.0, 250.0)]
)
def test_a_brake_test_begins_with_the_torque_that_held_the_load_and_ends_behind_the_brake(
    monkeypatch: pytest.MonkeyPatch, kept_nm: float | None, prepared_nm: float
) -> None:
    prepared: list[float] = []
    prepare = BrakeTest.prepare
    monkeypatch.setattr(BrakeTest, "prepare", lambda test, nm: (prepared.append(nm), prepare(test, nm))[1])
    drive = HandDrive()
    axis = axis_of(drive)
    axis.retained = replace(axis.retained, holding_torque_nm=kept_nm)
    steps_power._test_brake(context(), axis)
    assert prepared[-1] == prepared_nm
    # Beside what holds the load, up to what the motor gives at most: 320 N m are beyond its rated 257.
    assert max(output.torque_ff_nm for output in drive.wrote) == pytest.approx(prepared_nm + 70.0, abs=1.5)
    assert not any(output.brake_open for output in drive.wrote)
    assert drive.state is S.SWITCH_ON_DISABLED


@pytest.mark.parametrize(
    ("owner", "preload", "testable"),
    [
        ("drive", True, False),
        ("object_60FE", True, True),
        ("controller_output", True, True),
        ("object_60FE", False, False),
    ],
)
def test_only_a_brake_that_the_controller_keeps_closed_is_tested(
    owner: str, preload: bool, testable: bool
) -> None:
    changes = {"brake.owner": owner}
    if owner == "controller_output":
        changes |= {"can.outputs.brake_release": 16}
    machine = with_values(MACHINE, changes)
    assert (untestable(machine, preload) is None) is testable
    if owner == "drive":
        for run in (steps_power.brake, steps_lacks.torque):
            found = run(context(machine))
            assert (found.outcome, found.proof) == (Outcome.NOT_TESTABLE, str(untestable(machine)))


def test_a_brake_is_not_tested_by_a_drive_that_takes_no_torque(step: Any) -> None:
    drive = HandDrive()
    drive.torque_preload = False
    found = step(steps_power, "brake", drive)
    assert (found.outcome, found.proof) == (Outcome.NOT_TESTABLE, str(untestable(MACHINE, False)))
    assert drive.wrote == []


def test_the_next_test_is_due_from_the_power_up_of_this_one_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """As after a test in operation: the 41st power-up of this machine, today."""
    drive, kept = HandDrive(), list[Any]()

    @contextmanager
    def opened(c: object, leash_deg: float, part: str) -> Iterator[Any]:
        axis = axis_of(drive, leash_deg)
        axis.retained = replace(axis.retained, power_ups=41, brake_tests=6)
        yield axis
        kept.append(axis.retained)

    monkeypatch.setattr(steps_power, "open_loop_axis", opened)
    assert steps_power.brake(context()).outcome is Outcome.PASSED
    assert [(each.brake_tested_power_ups, each.brake_tests, each.brake_failed) for each in kept] == [
        (41, 7, "")
    ]
