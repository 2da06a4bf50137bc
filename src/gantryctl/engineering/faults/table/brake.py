"""Group C: brake and torque."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.table.row import Row, at
from gantryctl.program.alarms.codes import Code

_DOWN: Final = "unit/program/test_power_down.py"
_UP: Final = "unit/program/test_power.py"
_HOLD: Final = "plant/test_hold.py"

BRAKE: Final = (
    Row(
        "C1",
        "Brake does not release",
        "contact or drive says closed 300 ms after the release command",
        "torque holds at rest until the brake has closed, then torque off",
        (Code.BRK_01,),
        at(_UP, "test_brake_that_does_not_release"),
    ),
    Row(
        "C2",
        "Brake drags",
        "torque of the motion above the learned, retained model: 15 % of rated for 1 s a warning, "
        "30 % a stop",
        "warning; then a stop on the ramp, no motion until reset",
        (Code.BRK_02,),
        at(
            "plant/test_drag.py",
            "test_a_brake_that_drags_is_told_and_stops_the_motion",
            "test_before_it_has_learned_only_more_than_any_load_is_drag",
            "test_what_was_learned_serves_the_next_run",
        ),
    ),
    Row(
        "C3",
        "Brake does not hold at power-off",
        "moved 0.02 deg while the torque goes off in three steps",
        "torque back at zero speed (HOLD); service only",
        (Code.BRK_03, Code.BRK_13),
        (
            *at(
                _DOWN,
                "test_brake_that_does_not_hold_at_power_off_gets_the_torque_back",
                "test_only_service_resets_a_hold_and_then_the_brake_is_tried_again",
            ),
            *at(_HOLD, "test_a_sound_hold_catches_the_load_and_does_not_say_that_it_moves"),
        ),
    ),
    Row(
        "C4",
        "Brake slips later",
        "moved 0.02 deg while off, every scan",
        "torque back at zero speed where the emergency-stop chain is closed, else people are warned",
        (Code.BRK_04, Code.BRK_13),
        (
            *at(
                _DOWN,
                "test_brake_that_slips_later_is_caught_by_the_drive",
                "test_no_holding_with_an_open_emergency_stop",
            ),
            *at(_HOLD, "test_a_slip_with_the_emergency_stop_open_is_told_and_not_held"),
        ),
    ),
    Row(
        "C5",
        "Brake closes in motion",
        "contact says closed, and torque limit, following error, torque without its effect (C10) or half of the "
        "brake's torque within 30 ms shows that the axis feels it",
        "torque off and brake",
        (Code.BRK_05,),
        at("unit/program/test_monitors_drive.py", "test_c5_brake_closes_in_motion_and_the_axis_feels_it"),
        why=(
            "no quick stop: on its ramp the drive pushes against the brake, which takes 4.28 deg from 6 deg/s"
        ),
    ),
    Row(
        "C6",
        "Contact of the brake contradicts its command",
        "for 300 ms",
        "at rest a warning and no motion; in motion a quick stop",
        (Code.BRK_06, Code.BRK_05),
        at(
            "unit/program/test_monitors_drive.py",
            "test_c6_brake_feedback_alone_waits_its_time",
            "test_c6_brake_feedback_at_rest_is_a_warning_that_blocks",
        ),
    ),
    Row(
        "C7",
        "No torque before the brake is released",
        "80 % of the proof torque within 500 ms",
        "brake stays closed, torque off",
        (Code.BRK_07,),
        at(
            _UP,
            "test_torque_not_proven_keeps_the_brake_closed",
            "test_the_brake_opens_only_after_torque_was_proven",
        ),
    ),
    Row(
        "C8",
        "Brake test overdue or failed",
        "[brake] test_interval_days and test_interval_power_ups; 1.3 x the check moment, both ways, 2 s",
        "overdue: slow motion only; failed: no motion until a test passes or service resets",
        (Code.BRK_08, Code.BRK_12),
        (
            *at(
                "unit/program/test_brake_test.py",
                "test_a_brake_that_slips_fails_and_lets_nothing_move",
                "test_an_overdue_test_allows_slow_motion_only",
                "test_or_after_a_reset_by_service_only",
            ),
            *at("unit/cli/test_brake_test.py", "test_weekly_or_after_a_hundred_power_ups"),
        ),
    ),
    Row(
        "C9",
        "Brake worn by emergency stops",
        "stops of the turning axis by the brake, counted with their energy and retained",
        "warning: service due",
        (Code.BRK_09,),
        at(
            "plant/test_drag.py",
            "test_a_stop_by_the_brake_is_counted_with_its_energy",
            "test_torque_off_at_standstill_wears_nothing",
        ),
    ),
    Row(
        "C10",
        "Brake closes in motion, its contact says open",
        "torque of a quarter of the limit (100 N m) and more without its effect on the speed; or, where the motor "
        "turns its brake, half of the brake's torque that comes within 30 ms, holds the shaft back, and stays so long, "
        "or comes slowly and stays in the mean for half a period of the load's swing",
        "torque off and brake",
        (Code.BRK_14, Code.BRK_02),
        (
            *at(
                "plant/test_torque.py",
                "test_torque_lost_and_shaft_blocked",
                "test_a_motor_started_against_a_closed_brake_gives_up_early",
            ),
            *at(
                "unit/program/test_parts_of_drag.py",
                "test_half_of_the_brake_in_the_mean_is_a_closed_brake_that_the_motor_turns",
            ),
        ),
    ),
    Row(
        "C11",
        "Brake closes 0.2 s late",
        "contact, against [brake] close_time_ms",
        "the stop is longer by speed x delay",
        (Code.INT_03,),
        at("unit/machine/test_rules.py", "test_a_weak_brake_must_close_sooner"),
        why=(
            "the machine file is refused where the delay that it names leads beyond the permitted "
            "stopping angle"
        ),
    ),
    Row(
        "C12",
        "Brake has half of its torque",
        "way after the stop; the brake test",
        "the stop is longer",
        (Code.INT_03, Code.BRK_08),
        (
            *at("unit/program/test_brake_test.py", "test_a_brake_that_slips_fails_and_lets_nothing_move"),
            *at("unit/operation/test_brake_on_bus.py", "test_a_weak_brake_fails"),
        ),
    ),
)
