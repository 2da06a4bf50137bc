"""Axes without ends, gears of fractions, brakes of drives, gentle profiles on their way to the program, by hand."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from gantryctl.machine import Machine, configs_folder, default_machine, load_machine, with_values
from gantryctl.wiring.program import (
    axis_settings,
    motion_limits,
    ramps_deg,
    speed_step_deg_s,
    travel_settings,
    untestable,
)
from gantryctl.wiring.simulator import delivered_zero_counts, gantry_sim, plant_params, sim_drive, turned_back
from support.modulo_machine import modulo_machine

approx = pytest.approx
MACHINE = default_machine()
BUS = load_machine(configs_folder() / "hust_can.toml")


# --- axes without ends ------------------------------------------------------------------------------------------------


def test_a_sector_over_0_deg_of_an_axis_without_ends_goes_on_into_the_next_turn() -> None:
    """From 350 to 10 deg are 20 deg, not the 340 on the other side."""
    found = travel_settings(modulo_machine({"axis.no_go_deg": [[150.0, -170.0]]}))
    (sector,) = found.no_go_rad
    assert sector == approx((math.radians(150.0), math.radians(190.0)))


@pytest.mark.parametrize(("display", "read_deg"), [("0..360", 270.0), ("-180..180", -90.0)])
def test_an_angle_is_read_as_the_file_says(display: str, read_deg: float) -> None:
    travel = travel_settings(with_values(default_machine(), {"axis.display": display}))
    assert math.degrees(travel.read_rad(math.radians(-90.0))) == approx(read_deg)


@pytest.mark.parametrize(("begin_deg", "shown_deg"), [(-180.0, -10.0), (0.0, 350.0)])
def test_angles_of_an_axis_without_ends_are_shown_in_the_turn_of_the_file(
    begin_deg: float, shown_deg: float
) -> None:
    ends = {"axis.pos_min_deg": begin_deg, "axis.pos_max_deg": begin_deg + 360.0}
    travel = axis_settings(modulo_machine(ends)).travel
    assert math.degrees(travel.shown_rad(math.radians(350.0))) == approx(shown_deg)


def test_a_turn_of_an_axis_without_ends_has_the_counts_of_its_teeth() -> None:
    """3433/3 motor turns are no double: by that, the angle would go astray turn by turn."""
    gear = {"axis.gear_motor_turns": 3433, "axis.gear_axis_turns": 3, "axis.reducer_ratio": 3433.0 / 39.0}
    law = axis_settings(modulo_machine(gear)).law
    assert law.turn_counts == Fraction(3433 * 4_194_304, 3)
    assert axis_settings(MACHINE).law.turn_counts is None


def test_the_state_of_an_axis_with_ends_stays_as_it_is_and_one_without_goes_back_by_whole_turns() -> None:
    """Two turns are 2288 of the motor: 35 times the 64 of the encoder, and 48."""
    state = {
        "pos_load": 4.0 * math.pi + 0.1,
        "pos_motor": 2288.0 * 2.0 * math.pi + 114.4,
        "count_offset": 5.0,
    }
    assert turned_back(MACHINE, state) == state
    found = turned_back(modulo_machine(), state)
    assert (found["pos_load"], found["pos_motor"]) == approx((0.1, 114.4))
    assert found["count_offset"] == 48.0 * 4_194_304 + 5.0


def test_only_turns_that_are_whole_turns_of_the_motor_are_taken_back() -> None:
    """With 3433/3 three turns of the axis are 3433 of the motor: 7 turns go back by 6, 6866 turns of the motor."""
    gear = {"axis.gear_motor_turns": 3433, "axis.gear_axis_turns": 3, "axis.reducer_ratio": 3433.0 / 39.0}
    state = {"pos_load": 14.0 * math.pi, "pos_motor": 7.0 * 3433.0 / 3.0 * 2.0 * math.pi, "count_offset": 0.0}
    found = turned_back(modulo_machine(gear), state)
    assert (found["pos_load"], found["pos_motor"]) == approx((2.0 * math.pi, 3433.0 / 3.0 * 2.0 * math.pi))
    assert found["count_offset"] == 18.0 * 4_194_304  # 6866 turns are 107 times the 64 of the encoder, and 18


# --- brakes and drives ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("machine", "owner", "by_drive"),
    [(MACHINE, "drive", False), (BUS, "drive", True), (BUS, "object_60FE", False)],
)
def test_a_simulated_drive_obeys_the_brake_command_whoever_the_file_says_owns_it(
    machine: Machine, owner: str, by_drive: bool
) -> None:
    changed = with_values(machine, {"brake.owner": owner})
    assert axis_settings(changed).power.brake_by_drive is by_drive
    assert bool(untestable(changed)) is by_drive


@pytest.mark.parametrize(
    ("machine", "torque_input", "tested"), [(BUS, True, True), (BUS, False, False), (MACHINE, False, True)]
)
def test_a_brake_is_tested_where_the_drive_takes_a_torque(
    machine: Machine, torque_input: bool, tested: bool
) -> None:
    changed = with_values(machine, {"brake.owner": "object_60FE"})
    assert (axis_settings(changed, torque_preload=torque_input).power.untestable is None) is tested


def test_the_step_of_a_speed_whose_unit_only_the_drive_knows_is_the_coarsest() -> None:
    """1 r/min of the motor are 6 deg/s, 0.0052 deg/s behind 1144 turns."""
    profile = with_values(BUS, {"can.velocity_unit": "profile"})
    assert speed_step_deg_s(profile) == approx(6.0 / 1144.0)


# --- profiles ---------------------------------------------------------------------------------------------------------

RAMPS = {
    "virtual_axis.acc_deg_s2": 2.0, "virtual_axis.dec_deg_s2": 1.0, "virtual_axis.jerk_deg_s3": 4.0,
    "virtual_axis.end_dec_deg_s2": 0.2, "virtual_axis.end_jerk_deg_s3": 0.1,
    # Every delivered axis has ten times its lowest setting as its highest.
    "speed.setting_min_deg_s": 0.2,
}  # fmt: skip
SMOOTH = {"virtual_axis.profile": "jerk_limited"}


def test_a_trapezoid_has_no_jerk_and_no_gentle_end_whatever_else_the_file_says() -> None:
    found = motion_limits(with_values(MACHINE, RAMPS), 3.0)
    assert (found.vel_rad_s, found.acc_rad_s2, found.dec_rad_s2) == approx(
        (math.radians(3.0), math.radians(2.0), math.radians(1.0))
    )
    assert (found.jerk_rad_s3, found.end_dec_rad_s2, found.end_jerk_rad_s3) == (math.inf, math.inf, math.inf)


def test_a_gentle_profile_has_the_jerks_of_the_file() -> None:
    found = motion_limits(with_values(MACHINE, RAMPS | SMOOTH | {"virtual_axis.gentle_end": True}))
    assert found.vel_rad_s == approx(math.radians(6.0))
    assert (found.jerk_rad_s3, found.end_dec_rad_s2, found.end_jerk_rad_s3) == approx(
        (math.radians(4.0), math.radians(0.2), math.radians(0.1))
    )


def test_the_shortest_move_has_both_ramps_and_what_the_jerk_adds_to_each() -> None:
    """4 deg/s: 4 deg up at 2 deg/s2 and 8 down at 1; at 4 deg/s3 the ramps take 0.5 and 0.25 s longer at 2 deg/s."""
    assert ramps_deg(with_values(MACHINE, RAMPS), 4.0) == approx(12.0)
    assert ramps_deg(with_values(MACHINE, RAMPS | SMOOTH), 4.0) == approx(13.5)


# --- the simulated gantry ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("ratio", "differs"), [(0.9, True), (1.0, False), (1.1, True)])
def test_a_motor_that_is_weaker_or_stronger_than_its_plate_is_simulated_so(
    ratio: float, differs: bool
) -> None:
    found = plant_params(with_values(MACHINE, {"plant.motor.torque_constant_ratio": ratio}))
    assert (found.torque_constant, found.torque_constant_ratio) == (differs, ratio)


def test_a_drive_on_a_bus_counts_its_own_increments_and_is_mounted_in_turns() -> None:
    """2^19 increments of 6064 where the encoder has 2^22 counts; the mounting is whole turns of the encoder."""
    assert gantry_sim(BUS).count_offset == BUS.plant.encoder.mounting_turns * 4_194_304.0
    assert delivered_zero_counts(BUS) == approx(delivered_zero_counts(MACHINE) / 8.0, abs=1.0)


def test_a_gantry_that_is_asked_for_at_0_deg_stands_there() -> None:
    """Also where a new one stands in the middle of a travel without it."""
    ends = {"axis.no_go_deg": [[-20.0, 20.0]]}
    machine = with_values(MACHINE, ends)
    assert machine.axis.start_angle_deg == -100.0
    assert math.degrees(sim_drive(machine).sim.state["pos_load"]) == approx(-100.0, abs=0.01)
    assert math.degrees(sim_drive(machine, 0.0).sim.state["pos_load"]) == approx(0.0, abs=0.01)


@pytest.mark.parametrize(
    ("angle_deg", "stands"), [(186.9, True), (187.1, False), (-186.9, True), (-187.1, False)]
)
def test_an_axis_can_stand_beyond_its_travel_as_far_as_its_stops(angle_deg: float, stands: bool) -> None:
    assert MACHINE.axis.within_stops(angle_deg) is stands
