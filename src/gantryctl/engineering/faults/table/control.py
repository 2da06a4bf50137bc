"""Group B: control loop, command and motion."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.table.row import Row, at
from gantryctl.program.alarms.codes import Code

_MONITORS: Final = "unit/program/test_monitors.py"

CONTROL: Final = (
    Row(
        "B1",
        "A command with a number that cannot be (NaN, infinity, 1e300, true, text)",
        "type, finiteness and range before anything is queued, at every entrance and again in the axis",
        "refused; nothing changes",
        (Code.CTL_01, Code.SEC_05),
        (
            *at("unit/program/test_blocks.py", "test_bad_numbers_are_errors_and_no_motion"),
            *at(
                "unit/service/test_messages.py",
                "test_values_of_another_kind_or_range_are_refused",
                "test_what_is_no_message_is_refused",
            ),
            *at("property/test_cli_arguments.py", "test_any_value_for_any_option_and_argument"),
        ),
    ),
    Row(
        "B2",
        "A number that is not finite is born inside the controller",
        "guard of the output, every scan",
        "speed command 0, quick stop",
        (Code.CTL_02,),
        at(
            "unit/program/test_monitors_feedback.py",
            "test_the_output_guard_stops_what_is_no_number",
            "test_a_reading_that_is_no_number",
        ),
    ),
    Row(
        "B3",
        "The axis does not follow",
        "following error above 0.03 deg + 0.012 s x speed for 10 ms",
        "quick stop; torque off and brake where the drive does not obey",
        (Code.CTL_03,),
        at(
            _MONITORS,
            "test_b3_following_error_warns_then_stops",
            "test_b3_following_error_of_a_drive_that_does_not_obey_is_torque_off",
            "test_b3_following_error_band_grows_with_speed",
            "test_b3_a_short_excess_is_no_alarm",
        ),
        why=(
            "friction that the motor can overcome is no loss of control: it is told as drag (C2) and "
            "stopped on the ramp"
        ),
    ),
    Row(
        "B4",
        "Too fast",
        "speed above [speed] overspeed_trip for 20 ms",
        "quick stop; much faster: torque off and brake",
        (Code.CTL_04,),
        at(_MONITORS, "test_b4_overspeed", "test_b4_far_too_fast_is_torque_off"),
    ),
    Row(
        "B5",
        "The drive turns the other way",
        "speed differs from the command by 0.5 deg/s for 20 ms",
        "torque off and brake",
        (Code.CTL_05,),
        at(
            _MONITORS,
            "test_b5_moves_against_command",
            "test_b5_from_standstill_within_class_m0",
            "test_velocity_deviation_for_a_moment_is_nothing",
        ),
    ),
    Row(
        "B6",
        "The controller turns the other way",
        "as B5: to the axis both are the same; the sign test of commissioning",
        "torque off and brake",
        (Code.CTL_05,),
        (
            *at(_MONITORS, "test_b5_from_standstill_within_class_m0"),
            *at("unit/commissioning/test_commissioning.py", "test_a_wrong_sign_is_found_within_the_leash"),
        ),
    ),
    Row(
        "B7",
        "The load shifts: eccentric moment near or beyond the torque",
        "holding torque at standstill, 60 % of rated a warning, 90 % a stop; torque saturated with "
        "a growing error",
        "warning; at 90 % the brake closes while the motor still holds, then power off",
        (Code.CTL_06, Code.CTL_07),
        at(
            "plant/test_load.py",
            "test_a_heavy_load_is_told_and_held",
            "test_a_load_that_is_too_heavy_goes_to_the_brake_before_the_torque_goes",
        ),
    ),
    Row(
        "B8",
        "Torque at its limit while the following error grows",
        "torque-limit flag for 200 ms with a growing error",
        "torque off and brake",
        (Code.CTL_07,),
        at(
            _MONITORS, "test_b8_torque_saturated_while_the_error_grows", "test_torque_limit_alone_is_no_fault"
        ),
    ),
    Row(
        "B9",
        "Oscillation by gains or backlash",
        "speed crosses its set-point to both sides by 0.4 of its permitted deviation (0.2 deg/s) for 1 s",
        "quick stop",
        (Code.CTL_08,),
        at(
            "plant/test_load.py",
            "test_an_oscillation_is_stopped_after_a_second",
            "test_the_swing_of_the_load_after_stops_is_no_oscillation",
        ),
    ),
    Row(
        "B10",
        "Target outside the travel, speed out of range, no way",
        "checks of every command",
        "refused",
        (Code.CTL_09, Code.CTL_01),
        (
            *at(
                "unit/program/test_command_checks.py",
                "test_a_target_beyond_the_travel_is_refused_in_these_words",
                "test_a_speed_outside_is_refused_never_clamped",
                "test_the_axis_itself_refuses_the_same_targets_in_the_same_words",
            ),
            *at("property/test_cli_arguments.py", "test_any_move_from_anywhere"),
        ),
    ),
    Row(
        "B11",
        "The stop would end outside the travel",
        "set-point: planned to the end of the travel; measured motion: its stop point, every scan",
        "the set-point never passes the end; measured stop point beyond: quick stop",
        (Code.CTL_10,),
        (
            *at("unit/program/test_monitors_drive.py", "test_b11_stop_point_of_the_measured_motion"),
            *at("unit/program/test_gantry.py", "test_continuous_stops_at_the_end_of_travel"),
            *at("property/test_motion_plans.py", "test_extremes_bound_every_sample"),
        ),
    ),
    Row(
        "B12",
        "The target is never reached",
        "3 s after the set-point has arrived",
        "the command ends with an error; warning",
        (Code.CTL_11,),
        (
            *at(_MONITORS, "test_b12_not_in_position_is_told"),
            *at("unit/operation/test_run.py", "test_a_window_that_is_never_reached_is_not_called_done"),
        ),
    ),
    Row(
        "B13",
        "Torque limited while it holds the load",
        "load moves by 0.15 deg, or faster than 0.1 deg/s after 0.3 s",
        "brake commanded closed, horn; the torque that there is stays on",
        (Code.BRK_13,),
        at("plant/test_hold.py", "test_limited_torque_that_does_not_hold_the_load_is_told_and_stays_on"),
        why=(
            "with no brake and too little torque nothing is left to hold the load: it is told by the "
            "horn, and what torque there is stays on"
        ),
    ),
)
