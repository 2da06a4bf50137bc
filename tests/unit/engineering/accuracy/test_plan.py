"""The plan of the accuracy tests: the paper's on the reference machine, one that fits on every other axis."""

from __future__ import annotations

import pytest

from gantryctl.engineering.accuracy.procedure.plan import (
    chord_plan,
    chord_test,
    fastest_within,
    speeds_to_test,
)
from gantryctl.engineering.accuracy.procedure.procedures import StopRole, chord_procedure
from gantryctl.engineering.accuracy.speed_test import speed_test
from gantryctl.errors import UsageError
from gantryctl.machine import Machine, default_machine, is_reference_machine, with_values
from gantryctl.wiring.program import ramps_deg
from support.modulo_machine import modulo_machine

SLOW = {
    "speed.setting_min_deg_s": 0.02,
    "speed.setting_max_deg_s": 2.0,
    "speed.creep_deg_s": 0.02,
    "speed.command_clamp_deg_s": 2.1,
    "speed.drive_ceiling_deg_s": 2.17,
    "speed.overspeed_trip_deg_s": 2.2,
}


def axis(low: float, high: float, **changes: object) -> Machine:
    """The reference machine with another travel."""
    sides = {
        f"axis.{name}_{side}_deg": end + sign * beyond
        for side, end, sign in (("min", low, -1.0), ("max", high, 1.0))
        for name, beyond in (
            ("pos", 0.0),
            ("over_travel", 0.5),
            ("limit_switch", 2.0),
            ("mechanical_stop", 7.0),
        )
    }
    turns = {"encoder.turns": 65536, "plant.encoder.mounting_turns": 32768}
    return with_values(default_machine(), {**sides, **turns, **changes})


@pytest.mark.parametrize("name", "ABCDE")
def test_the_reference_machine_keeps_the_plan_of_the_paper(name: str) -> None:
    assert chord_test(default_machine(), name) == chord_procedure(name)
    assert speeds_to_test(default_machine()) == (0.6, 3.0, 6.0)


@pytest.mark.parametrize("name", "ABCDE")
@pytest.mark.parametrize("travel", [(-5.0, 95.0), (10.0, 200.0), (-270.0, 270.0), (-2.0, 2.0), (-180.0, 0.0)])
def test_every_travel_has_a_plan_that_fits(travel: tuple[float, float], name: str) -> None:
    procedure = chord_test(axis(*travel), name)
    low, high = procedure.travel_deg
    assert travel[0] < low < high < travel[1]
    # A plan that keeps to a corner of the travel would prove little of it.
    bases = procedure.bases_deg
    assert max(bases) - min(bases) == pytest.approx(0.5 * (travel[1] - travel[0]))
    points = [stop for stop in procedure.stops if stop.role is StopRole.POINT]
    assert len(points) == (6 if name == "E" else 24)


def test_a_short_travel_has_shorter_chords() -> None:
    assert chord_plan(axis(-5.0, 95.0)).displacements_deg == (5.0, 10.0, 15.0, 20.0)
    small = chord_plan(axis(-2.0, 2.0))
    assert small.displacements_deg == pytest.approx((0.2, 0.4, 0.6, 0.8))
    assert small.approach_deg == pytest.approx(0.4)


def test_the_machine_file_gives_another_plan_and_a_command_yet_another() -> None:
    machine = with_values(
        default_machine(),
        {
            "accuracy.bases_deg": (30.0,),
            "accuracy.displacements_deg": (2.0, 4.0),
            "accuracy.speeds_deg_s": (1.0,),
        },
    )
    plan = chord_plan(machine)
    assert (plan.bases_deg, plan.displacements_deg) == ((30.0,), (2.0, 4.0))
    assert speeds_to_test(machine) == (1.0,)
    assert chord_plan(machine, (60.0,), (3.0,)).bases_deg == (60.0,)
    assert speeds_to_test(machine, (2.0, 4.0)) == (2.0, 4.0)
    assert [run.speed_deg_s for run in speed_test(machine)] == [1.0, 1.0]


def test_the_short_procedure_takes_one_displacement_out_of_the_plan() -> None:
    assert chord_test(default_machine(), "E", displacements_deg=(1.0, 2.0)).displacements_deg == (2.0,)
    assert chord_test(default_machine(), "E", displacements_deg=(7.0,)).displacements_deg == (7.0,)


def test_a_plan_that_the_axis_cannot_do_names_what_fits() -> None:
    tilt = axis(-5.0, 95.0)
    with pytest.raises(
        UsageError, match=r"from 90 deg goes from 70 to 110 deg, the axis reaches -5 to 95 deg"
    ):
        chord_test(tilt, bases_deg=(90.0,))
    with pytest.raises(
        UsageError, match=r"bases from 15 to 75 deg, or displacements up to 5 deg from these bases"
    ):
        chord_test(tilt, bases_deg=(90.0,))
    # What was named fits indeed.
    assert chord_test(tilt, bases_deg=(75.0,)).travel_deg == (55.0, 95.0)
    with pytest.raises(UsageError, match=r"the setting goes from 0.6 to 6 deg/s"):
        speeds_to_test(tilt, (6.6,))
    with pytest.raises(UsageError, match=r"the setting goes from 0.6 to 6 deg/s"):
        speeds_to_test(tilt, (float("nan"),))


def test_a_travel_too_short_for_the_highest_setting_is_tested_as_fast_as_it_goes() -> None:
    short = axis(-20.0, 20.0)
    fastest = fastest_within(short)
    assert speeds_to_test(short) == (0.6, pytest.approx(0.5 * fastest), fastest)
    # 3.86 deg/s: v^2 / a = 38 deg of 40 deg.
    assert fastest == pytest.approx((38.0 * 450.0 / 1144.0) ** 0.5, abs=0.01)
    assert ramps_deg(short, fastest) <= 38.0
    with pytest.raises(UsageError, match=rf"91.5 deg .* the travel is 40 deg: {fastest:g} deg/s fits"):
        speeds_to_test(short, (6.0,))


def test_a_slow_axis_is_tested_at_its_own_speeds() -> None:
    dish = axis(-270.0, 270.0, **SLOW)
    assert speeds_to_test(dish) == (0.02, 1.0, 2.0)


def test_a_plan_keeps_to_the_stretch_between_no_go_sectors() -> None:
    machine = with_values(default_machine(), {"axis.no_go_deg": [[40.0, 60.0]]})
    low, high = chord_test(machine).travel_deg
    assert -180.0 < low < high < 40.0
    ends = [run.travel_deg for run in speed_test(machine)]
    assert all(-180.0 <= end < 40.0 for way in ends for end in way)
    with pytest.raises(UsageError, match=r"the axis reaches -180 to 39.5 deg"):
        chord_test(machine, bases_deg=(90.0,))


@pytest.mark.parametrize("name", "ACE")
def test_a_modulo_axis_is_tested_within_one_turn(name: str) -> None:
    machine = modulo_machine()
    assert chord_test(machine, name) == chord_procedure(name)
    assert speeds_to_test(machine) == (0.6, 3.0, 6.0)
    # It has no printed table: the machine of the paper has a travel with two ends.
    assert not is_reference_machine(machine)
