"""The way of a stop that is judged, without a run: both directions, what is added to a limit, what has none."""

from __future__ import annotations

from typing import Literal

import pytest

from gantryctl.engineering.fault_campaign.judging.effects import nothing_holds
from gantryctl.engineering.fault_campaign.judging.ways import Way
from gantryctl.engineering.fault_campaign.machines import base_machine
from gantryctl.engineering.fault_campaign.scenario import PlannedFault, Scenario
from gantryctl.engineering.faults.catalogue import fault_case
from gantryctl.machine import default_machine


def fault(number: str) -> PlannedFault:
    return PlannedFault(number=number, at_s=1.0)


def way_of(number: str, *before: str, drive: Literal["sim", "bus"] = "sim") -> Way:
    """At 10 deg, 2 s into the run, from 3 deg/s."""
    earlier = [fault(each) for each in before]
    scenario = Scenario(drive=drive, faults=(*earlier, fault(number)))
    return Way(scenario, default_machine(), earlier, fault(number), 2.0, 10.0, 3.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_way_is_the_farthest_from_the_fault_until_0_2_s_of_rest(sign: float) -> None:
    """2 deg out and half a degree back. Slower than a 120th of 6 deg/s is rest, either way."""
    way = way_of("D1")
    for k, (at_deg, speed_deg_s) in enumerate([(11.0, 3.0), (12.0, 1.0), (11.8, -0.06), (11.5, -0.06)]):
        assert way.goes_on(2.1 + 0.3 * k, 10.0 + sign * (at_deg - 10.0), sign * speed_deg_s)
    assert way.way_deg == pytest.approx(2.0)
    ends = [way.goes_on(3.1 + 0.1 * k, 10.0 + sign * 1.5, sign * 0.04) for k in range(3)]
    assert ends == [True, True, False]
    assert way.way_deg == pytest.approx(2.0)


def test_a_way_that_does_not_end_ends_after_4_s() -> None:
    way = way_of("D1")
    assert [way.goes_on(time_s, 20.0, 3.0) for time_s in (2.1, 5.99, 6.01)] == [True, True, False]


def test_no_way_is_judged_where_any_of_its_faults_has_none() -> None:
    """A brake without torque (C4), before, first or on the way; a trip and an emergency stop have ways."""
    assert not way_of("D1", "C4").bounded
    assert not way_of("C4").bounded
    way = way_of("D1")
    way.also(fault("C11"), 1.0)
    assert way.bounded
    way.also(fault("C4"), 1.0)
    assert not way.bounded
    way.also(fault("C11"), 1.0)
    assert not way.bounded


@pytest.mark.parametrize(
    ("number", "drive", "limit_deg"),
    [
        # A controller that stands still for 40 ms: in process the drive goes on meanwhile, on a bus to its deadline.
        ("F2", "sim", 1.0 + 0.04 * 3.0),
        ("F2", "bus", 1.0),
        # A brake that is 0.2 s late, and one with half of its torque.
        ("C11", "sim", 1.0 + 0.2 * 3.0),
        ("C12", "sim", 2.0),
        ("D1", "sim", 1.0),
    ],
)
def test_what_a_fault_adds_to_a_limit(number: str, drive: Literal["sim", "bus"], limit_deg: float) -> None:
    assert way_of(number, drive=drive)._weakened(1.0, 3.0) == pytest.approx(limit_deg)


@pytest.mark.parametrize(
    ("numbers", "nothing"),
    [
        (("C4",), False), (("C3",), False), (("D1",), False), (("C4", "D1"), True), (("D1", "C3"), True),
        (("C4", "F3"), True), (("C12", "D1"), False), (("C4", "C6"), False),
    ],
)  # fmt: skip
def test_a_load_that_two_faults_let_go_of(numbers: tuple[str, ...], nothing: bool) -> None:
    """A brake without torque, and the drive trips or the controller stands still; either alone leaves the other."""
    assert nothing_holds([fault_case(number) for number in numbers]) is nothing


@pytest.mark.parametrize(
    ("numbers", "limit_deg"),
    [(("E8", "A2"), 3.36), (("E9", "A2"), 3.36), (("E8", "D1"), 1.0), (("E1", "A2"), 1.0)],
)
def test_a_spoilt_encoder_drives_a_drive_on_that_no_command_reaches(
    numbers: tuple[str, str], limit_deg: float
) -> None:
    """From 1 deg/s: 1.196 deg by all torque in the 0.39 s of its own deadline, ramp and brake, and 2.1 of the brake."""
    scenario = Scenario(drive="bus", brake_owner="drive", faults=tuple(map(fault, numbers)))
    machine = base_machine("bus", False, "drive", 4.0)
    way = Way(scenario, machine, [fault(numbers[0])], fault(numbers[1]), 2.0, 10.0, 1.0)
    assert way._weakened(1.0, 1.0) == pytest.approx(limit_deg, rel=0.01)
