"""Group G: limits, interlocks, people and power."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.table.row import Row, State, at
from gantryctl.program.alarms.codes import Code

_MONITORS: Final = "unit/program/test_monitors_drive.py"
_SITE: Final = "unit/program/test_site_interlocks.py"
_THERMAL: Final = "unit/program/test_thermal.py"
_STOPS: Final = "unit/program/test_gantry_stops.py"

INTERLOCKS: Final = (
    Row(
        "G1",
        "End of travel by hand",
        "planned to the end of the travel",
        "comes to rest at the end; the way back is open",
        (Code.LIM_01,),
        (
            *at("unit/program/test_gantry.py", "test_continuous_stops_at_the_end_of_travel"),
            *at(
                "unit/operation/test_run.py",
                "test_a_jog_ends_at_the_end_of_the_travel_and_does_not_wait_there",
            ),
        ),
    ),
    Row(
        "G2",
        "Over-travel",
        "measured angle beyond [axis] over_travel_min_deg, over_travel_max_deg, 1 scan",
        "quick stop; the way back is open",
        (Code.LIM_02,),
        (
            *at(_MONITORS, "test_g2_over_travel"),
            *at(_STOPS, "test_over_travel_then_reset_and_back", "test_further_out_trips_again"),
        ),
    ),
    Row(
        "G3",
        "Limit switch opens",
        "input, 1 scan",
        "quick stop; the way back is open",
        (Code.LIM_03,),
        (
            *at(_MONITORS, "test_g3_limit_switch"),
            *at(_STOPS, "test_an_open_limit_switch_leaves_the_way_back"),
        ),
    ),
    Row(
        "G4",
        "Both limit switches open",
        "inputs, 1 scan",
        "quick stop; no motion",
        (Code.LIM_04,),
        (
            *at(_MONITORS, "test_g4_both_limit_switches"),
            *at(_STOPS, "test_both_limit_switches_open_from_the_start"),
        ),
    ),
    Row(
        "G5",
        "The short way across 180 deg",
        "linear axis: there is no short way",
        "the long way, told before the start",
        (),
        (
            *at("unit/program/test_gantry.py", "test_from_179_to_minus_179_the_long_way"),
            *at("unit/cli/test_motion.py", "test_the_long_way_is_said"),
            *at("property/test_cli_arguments.py", "test_any_move_from_anywhere"),
        ),
    ),
    Row(
        "G6",
        "Outside the travel at the start",
        "measured angle",
        "only inward",
        (Code.LIM_05, Code.CTL_09),
        (
            *at(_STOPS, "test_switched_on_far_outside_only_inward", "test_the_way_back_is_open_from_outside"),
            *at("unit/cli/test_state.py", "test_beyond_the_travel_only_the_way_back_is_open"),
        ),
    ),
    Row(
        "G7",
        "Collision interlock opens",
        "input, 1 scan; False is the safe state",
        "quick stop; no power while it is open",
        (Code.INT_01,),
        at(
            _SITE,
            "test_g7_collision_is_a_quick_stop_in_the_first_scan",
            "test_g7_an_open_collision_interlock_cannot_be_reset_and_closing_it_moves_nothing",
        ),
    ),
    Row(
        "G8",
        "Interlock chatters",
        "first opening latched; sixth within a minute",
        "quick stop; never goes on by itself",
        (Code.INT_02,),
        at(
            _SITE,
            "test_g8_pulses_of_one_scan_are_latched_and_the_sixth_in_a_minute_is_a_loose_wire",
            "test_g8_six_in_more_than_a_minute_are_none",
        ),
        why="a pulse shorter than a scan between two readings of the input is not seen: the relay of "
        "the interlock "
        "must hold it for a scan",
    ),
    Row(
        "G9",
        "Emergency stop, in any phase",
        "input, 1 scan; the hardware acts by itself",
        "torque off and brake",
        (Code.INT_03,),
        (
            *at(
                _MONITORS,
                "test_g9_emergency_stop_in_every_phase",
                "test_emergency_stop_still_pressed_cannot_be_reset",
            ),
            *at("unit/program/test_brake_test.py", "test_an_alarm_ends_it_in_every_phase_safely"),
        ),
    ),
    Row(
        "G10",
        "Channels of the emergency stop differ",
        "for 500 ms; either channel alone is the emergency stop",
        "torque off and brake; service only",
        (Code.INT_04, Code.INT_03),
        at(
            _SITE,
            "test_g10_either_channel_is_the_emergency_stop_and_a_difference_locks",
            "test_g10_channels_that_still_differ_cannot_be_reset_by_service",
            "test_channels_that_switch_100_ms_apart_are_no_alarm",
        ),
    ),
    Row(
        "G11",
        "Room door opens",
        "input, 1 scan",
        "jog-release ramp, or a quick stop by [monitors] door_reaction; no motion until reset",
        (Code.INT_07,),
        at(
            _SITE,
            "test_g11_the_door_stops_on_the_ramp_and_stays_latched",
            "test_g11_an_open_door_cannot_be_reset",
            "test_g11_the_machine_file_makes_it_a_quick_stop",
        ),
    ),
    Row(
        "G12",
        "Motor too warm",
        "the largest of model, sensor and the drive's I2t account: 80, 95, 100 %",
        "warning; the motion ends and no other begins; quick stop",
        (Code.THM_01, Code.THM_03, Code.THM_04),
        at(
            _THERMAL,
            "test_g12_warning_at_80_refusal_at_95_and_the_move_ends",
            "test_g12_100_percent_is_a_quick_stop",
            "test_g12_the_overload_account_of_the_drive_counts_too",
            "test_the_model_follows_the_square_of_the_torque",
        ),
        why="over a bus the model works with 6077; CiA 402 has no object for the sensor, whose limit "
        "the drive watches "
        "and tells by its warning and its fault. The cabinet is not watched: it has no input",
    ),
    Row(
        "G13",
        "Temperature sensor open or shorted",
        "outside -30 to 250 C for 1 s",
        "warning; the model goes on with half of its limit",
        (Code.THM_02,),
        at(
            _THERMAL,
            "test_g13_a_broken_sensor_warns_after_a_second_and_the_axis_goes_on_with_half_of_the_limit",
        ),
    ),
    Row(
        "G14",
        "Mains lost",
        "input, 1 scan",
        "torque off; the brake closes by its spring",
        (Code.PWR_01,),
        (
            *at(_MONITORS, "test_g14_mains_lost", "test_mains_off_while_switched_off_is_no_alarm"),
            *at(
                "unit/drives/virtual/test_axis.py",
                "test_mains_lost_while_enabled_is_a_fault_that_cannot_be_reset_before_they_are_back",
            ),
        ),
        State.PARTLY,
        "the rest position is written when the axis has come to rest, so a computer that dies with "
        "the mains leaves "
        "the older one: the encoder is absolute, and the start judges the difference (A11 to A13). "
        "A supply for the "
        "computer is hardware outside the simulator",
    ),
    Row(
        "G15",
        "Mains flicker",
        "as the drive reports: under-voltage fault, or the input",
        "as D1 or G14; never on again by itself",
        (Code.DRV_01, Code.PWR_01),
        (
            *at(
                _MONITORS,
                "test_g14_mains_lost",
                "test_d1_drive_fault",
                "test_nothing_moves_after_reset_without_a_new_command",
            ),
            *at("unit/program/test_power.py", "test_no_power_without_a_rising_edge_after_a_stop"),
        ),
        why="no code of its own: which dip a drive survives is its own matter, and it tells nobody about it",
    ),
    Row(
        "G16",
        "Power of the controller's computer lost, drive alive",
        "deadline of the drive",
        "as F6",
        (Code.SYS_05,),
        (
            *at("system/test_service_can.py", "test_the_drive_stops_the_axis_of_a_killed_controller"),
            *at(
                "system/test_service_load.py",
                "test_a_killed_controller_comes_back_with_power_off_and_says_how_it_ended",
            ),
            *at("unit/service/test_run_record.py", "test_a_power_cut_leaves_what_was_kept"),
        ),
    ),
    Row(
        "G17",
        "Quick stop by a person, nothing is wrong",
        "the operator",
        "quick stop, and nothing else",
        (Code.INT_06,),
        (
            *at("bus/test_quick_stop.py", "test_a_quick_stop_ends_in_order"),
            *at("unit/program/test_gantry_stops.py", "test_halt_stop_and_quick_stop_are_three_ramps"),
        ),
    ),
    Row(
        "G18",
        "A stop would end in a no-go sector",
        "measured angle and speed against the sectors of [axis] no_go_deg, 1 scan",
        "quick stop before the sector; the way out is open",
        (Code.LIM_06,),
        (
            *at("plant/test_no_go.py", "test_a_set_point_that_goes_into_a_sector_is_stopped_before_it"),
            *at("plant/test_no_go.py", "test_an_axis_that_stands_in_a_sector_leaves_it_by_the_nearer_edge"),
        ),
    ),
)
