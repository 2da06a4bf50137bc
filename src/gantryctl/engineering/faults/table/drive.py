"""Group D: drive and CiA 402."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.table.row import Row, State, at
from gantryctl.program.alarms.codes import Code

_MONITORS: Final = "unit/program/test_monitors_drive.py"
_TRAFFIC: Final = "bus/test_traffic.py"
_BUS: Final = "unit/drives/canopen/test_canopen_drive.py"

DRIVE: Final = (
    Row(
        "D1",
        "Drive fault in motion",
        "state of the drive, 1 scan",
        "brake at once, torque is off",
        (Code.DRV_01,),
        (
            *at(
                _MONITORS,
                "test_d1_drive_fault",
                "test_an_error_code_that_comes_later_is_told_in_the_same_alarm",
            ),
            *at(
                _BUS,
                "test_a_fault_is_named_by_its_emergency_message",
                "test_a_fault_without_an_emergency_message_is_named_by_603f",
            ),
        ),
    ),
    Row(
        "D2",
        "Warning of the drive",
        "bit 7 of the statusword, 1 scan",
        "warning; the motion goes on",
        (Code.DRV_02,),
        at(_MONITORS, "test_d2_drive_warning"),
    ),
    Row(
        "D3",
        "Drive stuck in a state",
        "wanted state not reached within [monitors] power_up_time_ms; torque off not shown after 0.2 s, on the way "
        "down of a drive that closes its brake by itself after that time and 0.2 s",
        "torque off; the brake stays closed; nothing is tried again by itself; no reset while it has torque, which a "
        "watchdog or enable relay takes",
        (Code.DRV_03,),
        (
            *at("unit/program/test_power.py", "test_drive_stuck_on_the_way_up"),
            *at("unit/program/test_rare_ways.py", "test_a_drive_that_stays_enabled_is_told"),
            *at("bus/test_io_node.py", "test_a_relay_takes_the_torque_of_a_drive_that_keeps_it"),
        ),
    ),
    Row(
        "D4",
        "Drive leaves Operation enabled by itself",
        "state of the drive, 1 scan",
        "torque off and brake",
        (Code.DRV_04,),
        at(_MONITORS, "test_d4_drive_leaves_enabled_unasked"),
    ),
    Row(
        "D5",
        "Drive ignores its command",
        "bit 12 of the statusword is 0 while enabled; bit 9, where [can] remote_bit says that the "
        "drive has it",
        "torque off and brake",
        (Code.DRV_05,),
        (
            *at(_TRAFFIC, "TestInMotion::test_local_control"),
            *at(_BUS, "test_a_drive_that_stops_following_is_told"),
        ),
    ),
    Row(
        "D6",
        "Drive in another mode than CSV",
        "6061, before it is enabled and ten times a second",
        "torque off; not enabled until it is set up again",
        (Code.DRV_06, Code.CFG_CAN_01),
        (
            *at(_TRAFFIC, "TestInMotion::test_another_mode", "test_another_mode_keeps_the_drive_off"),
            *at(_BUS, "test_a_drive_without_csv_is_never_enabled"),
        ),
    ),
    Row(
        "D7",
        "Quick stop not obeyed",
        "speed above the envelope of the ramp by its permitted deviation (0.5 deg/s) for 50 ms; "
        "0.25 s after the end of the ramp, by a tenth of that",
        "torque off and brake",
        (Code.DRV_07,),
        (
            *at("unit/program/test_power_down.py", "test_quick_stop_not_obeyed_becomes_torque_off"),
            *at("system/test_can_axis.py", "test_a_quick_stop_that_is_not_obeyed_takes_the_torque_off"),
            *at("plant/test_stop_phases.py", "test_a_quick_stop_that_is_not_obeyed_shows_at_any_speed"),
        ),
    ),
    Row(
        "D8",
        "Old target velocity when the drive is enabled",
        "60FF read back while it is off, twice a second; 60FF = 0 goes out in every scan in which "
        "the axis does not follow",
        "not enabled",
        (Code.DRV_08,),
        (
            *at(_TRAFFIC, "test_a_target_that_is_not_zero_keeps_the_drive_off"),
            *at("conformance/drive_port.py", "test_a_speed_left_over_while_not_enabled_moves_nothing"),
            *at("unit/drives/virtual/test_motion.py", "test_a_stale_target_moves_the_axis_at_enable"),
        ),
    ),
    Row(
        "D9",
        "Parameter of the drive changed behind the controller",
        "read back at the start and round robin within 60 s",
        "at the start no power; later a stop, and no motion",
        (Code.DRV_09, Code.CFG_CAN_01),
        (
            *at(
                "unit/drives/canopen/test_canopen_run.py",
                "test_parameters_are_read_again_while_the_axis_moves",
                "test_a_parameter_that_is_changed_behind_our_back_is_told_until_it_is_right_again",
            ),
            *at(_BUS, "test_a_parameter_that_does_not_take_is_refused"),
            *at(
                "system/test_can_axis.py",
                "test_a_parameter_changed_behind_our_back_stops_the_axis_and_keeps_it",
            ),
        ),
    ),
    Row(
        "D10",
        "Over-voltage of the intermediate circuit in a quick stop (brake chopper missing)",
        "drive fault during the quick stop, 1 scan",
        "torque off and brake",
        (Code.DRV_10,),
        at(_MONITORS, "test_a_stronger_reaction_follows_the_weaker"),
        State.PARTLY,
        "the simulator has no intermediate circuit and no chopper, so the voltage itself is not "
        "computed: the fault "
        "that a drive raises by it is injected. `gantryctl stops` prints the energy of every stop "
        "for the choice of "
        "the chopper",
    ),
    Row(
        "D11",
        "Drive restarts in motion",
        "boot-up message that nobody waits for",
        "torque off and brake; set up again by a reset",
        (Code.DRV_11,),
        (
            *at(_BUS, "test_a_restart_in_motion_is_told_at_once_and_never_enables_again"),
            *at("system/test_can_axis.py", "test_after_a_restart_of_the_drive_a_reset_is_enough"),
        ),
        why=(
            "the missing telegrams are told first and the restart as their consequence; reaction and "
            "angle are those of the row"
        ),
    ),
    Row(
        "D12",
        "Emergency message without a fault state",
        "a message that no fault follows within 30 ms, unless it is known to be a warning",
        "quick stop",
        (Code.DRV_12,),
        (
            *at(
                _TRAFFIC,
                "TestInMotion::test_an_emergency_message_without_a_fault",
                "test_a_fault_with_its_message_is_no_complaint",
                "test_a_flood_of_warnings_is_told_and_stops_nothing",
            ),
            *at("unit/drives/canopen/test_canopen_parts.py", "test_a_code_says_what_to_do"),
        ),
    ),
    Row(
        "D13",
        "Enabled, and no torque in motion",
        "torque reading of nothing for 50 ms while the speed is 0.05 deg/s off its command",
        "torque off and brake, never a quick stop",
        (Code.DRV_13,),
        at(
            "plant/test_torque.py",
            "test_torque_lost_and_shaft_blocked",
            "test_torque_lost_at_standstill_lets_the_load_go_by_no_more_than_a_brake_that_slips",
        ),
        why=(
            "a drive that does not report its torque (6077) is judged by its speed: 0.5 deg/s off for "
            "20 ms, a longer way"
        ),
    ),
    Row(
        "D14",
        "Reported torque off by 300 N m",
        "torque while off, against the closed brake, or changed without any effect on the speed",
        "warning; the motion ends and no other begins; the reading is neither learned nor given to the motor",
        (Code.DRV_14,),
        at(
            "plant/test_torque.py",
            "test_a_wrong_torque_reading_is_told_and_neither_learned_nor_given",
            "test_a_reset_alone_does_not_make_a_wrong_reading_right",
        ),
    ),
)
