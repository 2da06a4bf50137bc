"""Group E: CAN bus."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.table.row import Row, State, at
from gantryctl.program.alarms.codes import Code

_DRIVE: Final = "unit/drives/canopen/test_canopen_drive.py"
_PARTS: Final = "unit/drives/canopen/test_canopen_parts.py"
_RUN: Final = "unit/drives/canopen/test_canopen_run.py"
_FOREIGN: Final = "bus/test_foreign_nmt.py"
_LOST: Final = "bus/test_lost_telegrams.py"
_TRAFFIC: Final = "bus/test_traffic.py"
_SENDERS: Final = "bus/test_two_senders.py"
_CONTROLLER: Final = "unit/drives/canopen/test_bus_controller.py"
_VIRTUAL: Final = "unit/drives/virtual/test_faults.py"

BUS: Final = (
    Row(
        "E1",
        "SYNC is lost",
        "own SYNC does not come back for 30 ms, where the interface gives frames back; deadline of "
        "the drive (1400:05); its answers stay away",
        "quick stop, judged by the speed that the drive is asked for by SDO (606C); where it answers none for 0.1 s "
        "the brake too, where that ends no later",
        (Code.CAN_01, Code.CAN_03),
        (
            *at(_TRAFFIC, "test_a_sync_that_never_comes_back_is_lost"),
            *at(_DRIVE, "test_either_silence_alone_stops_the_axis_and_brakes_it"),
            *at(_VIRTUAL, "test_a_sync_that_is_lost_lets_the_time_of_the_drive_go_on"),
        ),
    ),
    Row(
        "E2",
        "SYNC comes irregularly",
        "three periods in a row off by more than half; lateness of the controller's own scan",
        "warning; quick stop by F2",
        (Code.CAN_02, Code.SYS_02),
        at(
            "unit/runtime/test_real_time.py",
            "test_more_than_five_overruns_in_a_second_stop",
            "test_one_overrun_of_a_period_stops_nothing",
        ),
        State.PARTLY,
        "the controller alone sends SYNC, so an irregular one is a late scan, whose quick stop is "
        "tested (F2); the warning beside it has no test of its own",
    ),
    Row(
        "E3",
        "One TPDO missing",
        "age of the reading",
        "bridged by its speed, counted",
        (),
        at(
            _DRIVE,
            "test_missing_and_doubled_telegrams_are_counted_and_bridged",
            "test_a_missing_position_goes_on_with_its_speed_but_not_for_long",
        ),
    ),
    Row(
        "E4",
        "TPDOs missing for longer, all or one of two, or those of a node beside the drive",
        "age of each telegram, 30 ms and at least 3 scans",
        "quick stop; what came with the missing telegram is not believed",
        (Code.CAN_03, Code.CAN_16),
        (
            *at(
                "bus/test_io_node.py",
                "test_a_silent_node_is_a_quick_stop_and_its_brake_closes_by_itself",
                "test_telegrams_missed_for_less_than_30_ms_stop_nothing",
            ),
            *at(
                _LOST,
                "test_a_lost_telegram_ends_in_a_quick_stop",
                "test_a_stop_without_the_speed_telegram_is_judged_by_the_position",
            ),
            *at(_DRIVE, "test_a_missing_position_goes_on_with_its_speed_but_not_for_long"),
        ),
    ),
    Row(
        "E5",
        "TPDO late or out of order",
        "SYNC that it belongs to",
        "as E3 and E4",
        (Code.CAN_03,),
        (
            *at(_PARTS, "test_missed_late_and_wrong_telegrams_are_told_apart"),
            *at(_VIRTUAL, "test_delayed_tpdos_are_old_and_come_in_order"),
            *at(
                "unit/program/test_monitors_feedback.py",
                "test_a_telegram_that_is_older_than_it_looks_is_no_jump",
            ),
        ),
    ),
    Row(
        "E6",
        "TPDO twice",
        "second one of a SYNC; two within three scans that contradict the first are another sender's",
        "counted, not used; another sender: quick stop, service only",
        (Code.CAN_14,),
        (
            *at(
                _SENDERS,
                "test_forged_telegrams_are_noticed_and_stop_the_axis",
                "test_what_a_disturbed_bus_does_is_no_second_sender",
            ),
            *at(_PARTS, "test_a_telegram_counts_once_per_sync"),
            *at(_DRIVE, "test_missing_and_doubled_telegrams_are_counted_and_bridged"),
        ),
    ),
    Row(
        "E7",
        "PDO of the wrong length",
        "length against the mapping",
        "never decoded, counted as missing; three in a row a quick stop",
        (Code.CAN_04, Code.CAN_03),
        (
            *at(_TRAFFIC, "TestInMotion::test_three_telegrams_of_a_wrong_length"),
            *at(_DRIVE, "test_a_telegram_of_the_wrong_length_is_never_decoded"),
            *at("unit/drives/virtual/test_pdo.py", "test_a_short_rpdo_is_refused_whole_with_emcy_8210"),
        ),
    ),
    Row(
        "E8",
        "RPDO lost on its way to the drive",
        "deadline of the drive (1400:05), 50 ms",
        "quick stop by the drive",
        (Code.CAN_05,),
        (
            *at(_TRAFFIC, "test_a_drive_that_misses_its_commands_says_so"),
            *at(_DRIVE, "test_either_silence_alone_stops_the_axis_and_brakes_it"),
            *at(
                "unit/drives/virtual/test_pdo.py", "test_a_missed_rpdo_deadline_is_emcy_8250_and_6007_decides"
            ),
        ),
    ),
    Row(
        "E9",
        "Heartbeat of the drive lost",
        "[can] heartbeat_timeout_ms, 150 ms",
        "torque off and brake",
        (Code.CAN_06,),
        (
            *at(_DRIVE, "test_a_dead_drive_ages_and_its_heartbeat_is_missed"),
            *at("system/test_can_processes.py", "test_a_killed_drive_is_an_alarm_within_three_syncs"),
        ),
        state=State.PARTLY,
        why=(
            "the drive alone ends its ramp with the torque off; a brake that the controller works by 60FE closes"
            " only then, and 16 kN m sink for its closing time: 0.06 deg more than the quick-stop class allows"
        ),
    ),
    Row(
        "E10",
        "Heartbeat of the controller lost",
        "the drive (1016, 1400:05), proven when commissioning and after each restart",
        "quick stop by the drive; a machine whose watch is too slow for its speed is refused",
        (Code.SYS_05, Code.CFG_CAN_03),
        (
            *at(_DRIVE, "test_either_silence_alone_stops_the_axis_and_brakes_it"),
            *at("system/test_service_can.py", "test_the_drive_stops_the_axis_of_a_killed_controller"),
            *at(
                "unit/commissioning/test_commissioning.py",
                "test_a_drive_that_nothing_stops_fails_its_silence",
            ),
            *at(
                "unit/machine/test_rules.py",
                "test_every_time_and_band_before_a_stop_has_the_limit_computed_by_hand",
            ),
        ),
        state=State.PARTLY,
        why=(
            "the drive alone ends its ramp with the torque off; a brake that the controller works by 60FE closes"
            " only then, and 16 kN m sink for its closing time: 0.06 deg more than the quick-stop class allows"
        ),
    ),
    Row(
        "E11",
        "Bus off, cable open or short",
        "error of the adapter, three frames that it does not take",
        "torque off and brake; the drive stops by its own watch; nothing moves when the bus is back",
        (Code.CAN_08,),
        (
            *at(
                _CONTROLLER,
                "test_bus_off_is_named_by_its_alarm",
                "test_a_full_queue_is_named_by_its_alarm",
                "test_error_passive_is_a_warning_that_stays_until_the_reset",
            ),
            *at(_DRIVE, "test_a_bus_that_goes_down_in_motion_and_comes_back_never_moves_the_axis_again"),
            *at(_PARTS, "test_a_dead_bus_is_down_after_three_failures_and_never_raises"),
        ),
    ),
    Row(
        "E12",
        "Flood of emergency messages",
        "more than ten a second",
        "warning; counted, one line a scan, a bounded number kept",
        (Code.CAN_09,),
        (
            *at(_TRAFFIC, "test_a_flood_of_warnings_is_told_and_stops_nothing"),
            *at(
                _PARTS,
                "test_a_flood_in_one_scan_is_one_line",
                "test_emergency_messages_of_any_length_are_kept_within_bounds",
            ),
            *at(_VIRTUAL, "test_emcy_can_flood_without_a_fault"),
        ),
    ),
    Row(
        "E13",
        "Bus full of frames of higher priority",
        "frames that fill 95 % of the bit rate for 20 ms; more of them than two scans in a row can read; "
        "frames that the adapter does not take; "
        "the deadline of the drive",
        "quick stop",
        (Code.CAN_10, Code.CAN_08),
        (
            *at(_TRAFFIC, "TestInMotion::test_a_full_bus", "test_more_frames_than_a_scan_can_read"),
            *at(
                "system/test_can_processes.py",
                "test_ten_thousand_foreign_frames_a_second_are_a_full_bus_and_no_encoder_fault",
            ),
            *at(_PARTS, "test_a_dead_bus_is_down_after_three_failures_and_never_raises"),
        ),
        why=(
            "the virtual bus has no arbitration, so frames hold no others up on it: the load is "
            "counted, and refused and lost frames are injected apart"
        ),
    ),
    Row(
        "E14",
        "SDO aborted, without an answer, or with wrong segments",
        "time limit and checks of each transfer, beside the scan",
        "at the start no power, with the abort code in words; in operation the scan goes on",
        (Code.CFG_CAN_01,),
        (
            *at(
                _PARTS,
                "test_an_abort_is_told_in_words",
                "test_segments_with_the_wrong_toggle_are_refused",
                "test_a_missing_object_is_none_but_silence_is_an_error",
            ),
            *at(
                _RUN,
                "test_no_answer_to_a_request_breaks_a_scan",
                "test_a_parameter_that_is_not_answered_any_more_holds_nothing_up",
            ),
        ),
    ),
    Row(
        "E15",
        "A second master",
        "a frame that only the controller may send, without its own echo",
        "quick stop; service only, with power off; refused before it is enabled too",
        (Code.CAN_12,),
        (
            *at(_FOREIGN, "test_a_second_master_locks_the_axis", "test_no_enable_after_a_foreign_frame"),
            *at(_DRIVE, "test_another_master_is_noticed"),
            *at(_PARTS, "test_own_frames_are_dropped_once_and_a_foreign_copy_is_seen"),
        ),
    ),
    Row(
        "E16",
        "The drive leaves OPERATIONAL",
        "NMT state in the heartbeat",
        "torque off by SDO or NMT, then the brake",
        (Code.CAN_13,),
        at(
            _DRIVE,
            "test_a_node_that_leaves_operational_is_noticed",
            "test_a_turning_drive_that_leaves_operational_is_stopped",
        ),
    ),
    Row(
        "E17",
        "Frames without sense",
        "checks of each frame",
        "counted, nothing else",
        (),
        at(
            "property/test_canopen_frames.py",
            "test_any_frame_from_the_bus_never_raises_and_never_moves_the_axis",
        ),
        State.PARTLY,
        "thousands of random frames a run, not the ten million of the catalogue: those belong to a campaign",
    ),
    Row(
        "E18",
        "A third party stops or resets the drive's communication in motion",
        "foreign NMT frame, 1 scan, without waiting for the heartbeat",
        "torque off by SDO or NMT, then the brake",
        (Code.CAN_12, Code.CAN_13),
        at(_FOREIGN, "test_a_drive_taken_out_of_operation_stops_at_once"),
    ),
    Row(
        "E19",
        "The same at standstill",
        "foreign NMT frame, 1 scan",
        "torque off and brake; service only",
        (Code.CAN_12, Code.CAN_13),
        at(
            _FOREIGN,
            "test_a_drive_taken_out_of_operation_stops_at_once",
            "test_no_enable_after_a_foreign_frame",
        ),
    ),
)
