"""Group F: process, time and storage."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.table.row import Row, State, at
from gantryctl.program.alarms.codes import Code

_REAL_TIME: Final = "unit/runtime/test_real_time.py"
_DURABLE: Final = "system/test_journal_durability.py"
_BITS: Final = "system/test_journal_bits.py"
_EVIDENCE: Final = "unit/service/test_journal_evidence.py"
_JOURNAL: Final = "unit/service/test_journal.py"
_STORE: Final = "unit/runtime/test_retained_store.py"

PROCESS: Final = (
    Row(
        "F1",
        "One scan late by up to a period",
        "lateness of each scan",
        "counted; the set-point is that of the time",
        (),
        (
            *at(
                _REAL_TIME,
                "test_one_overrun_of_a_period_stops_nothing",
                "test_missed_deadlines_are_skipped_and_the_next_one_is_on_time",
            ),
            *at("property/test_stalls.py", "test_a_move_arrives_where_and_when_it_would_have"),
        ),
        why="one late scan is a figure of the statistics (`scan_overruns`), not an alarm",
    ),
    Row(
        "F2",
        "Many scans late",
        "more than 5 in a second, or one by more than 30 ms",
        "quick stop",
        (Code.SYS_02,),
        (
            *at(
                _REAL_TIME,
                "test_more_than_five_overruns_in_a_second_stop",
                "test_overruns_far_apart_do_not_add_up",
            ),
            *at("unit/program/test_system_stop.py", "test_it_is_first_out_in_english_and_chinese"),
        ),
    ),
    Row(
        "F3",
        "Controller frozen for seconds",
        "deadline of the drive meanwhile; own lateness when it wakes",
        "quick stop by the drive; the controller does not resume",
        (Code.SYS_03,),
        (
            *at(_REAL_TIME, "test_a_frozen_controller_does_not_resume"),
            *at(
                "unit/service/test_controller.py",
                "test_a_frozen_controller_is_the_first_alarm_on_page_and_in_the_journal_until_a_reset",
            ),
        ),
        state=State.PARTLY,
        why=(
            "as for E10 a brake worked by 60FE closes only after the torque is off, and the load sinks meanwhile; "
            "what happened while the controller stood is not known, so the angle is doubted too"
        ),
    ),
    Row(
        "F4",
        "The wall clock jumps",
        "none needed: the scan has a monotonic clock, the journal a sequence number",
        "none",
        (),
        at(
            "unit/test_wall_clock.py",
            "test_nothing_in_the_scan_reads_the_wall_clock",
            "test_a_clock_that_goes_back_changes_no_order_in_the_journal",
        ),
    ),
    Row(
        "F5",
        "A clock or counter wraps (2^31 and 2^32 scans, milliseconds, microseconds)",
        "none needed: counters are unbounded, times are scan numbers",
        "none",
        (),
        at("unit/operation/test_long_running.py", "test_a_move_across_the_wrap_is_the_same_bit_for_bit"),
    ),
    Row(
        "F6",
        "The controller is killed in motion",
        "deadline of the drive",
        "quick stop by the drive; after the restart power stays off",
        (Code.SYS_05,),
        (
            *at("system/test_can_processes.py", "test_a_killed_controller_does_not_leave_the_gantry_turning"),
            *at("system/test_service_can.py", "test_the_drive_stops_the_axis_of_a_killed_controller"),
            *at(
                "system/test_service_load.py",
                "test_a_killed_controller_comes_back_with_power_off_and_says_how_it_ended",
            ),
            *at(
                "system/test_service_unclean.py",
                "test_everything_killed_is_told_with_the_angle_and_a_killed_first_process_ends_in_order",
            ),
        ),
        State.PARTLY,
        "hundreds of kills, not the ten thousand of the catalogue: those belong to a campaign",
    ),
    Row(
        "F7",
        "Page server, OPC UA or recorder killed",
        "the supervisor",
        "started again; a hold-to-run key is let go",
        (Code.SYS_06,),
        (
            *at(
                "system/test_service_kills.py",
                "test_a_kill_costs_no_overrun_and_is_mended_within_five_seconds",
                "test_the_recording_is_that_of_a_run_without_kills_bit_for_bit",
            ),
            *at("unit/service/test_supervision.py", "test_a_process_that_hangs_is_ended_and_started_again"),
        ),
    ),
    Row(
        "F8",
        "The controller is told to end in motion",
        "signal",
        "jog-release ramp, brake, torque off, then it ends",
        (Code.SYS_07,),
        (
            *at(
                "unit/service/test_operator.py", "test_a_shutdown_brings_the_axis_to_rest_and_takes_power_off"
            ),
            *at(
                "system/test_process.py",
                "test_a_signal_in_real_time_stops_on_the_ramp",
                "test_a_move_that_nobody_watches_any_more_stops",
            ),
        ),
    ),
    Row(
        "F9",
        "No memory or file handles left",
        "error in a process that is not the controller",
        "the controller goes on: its memory is locked and its scan opens nothing",
        (Code.SYS_06,),
        at(
            "system/test_service_starved.py",
            "test_a_gateway_without_memory_and_without_handles_disturbs_no_motion",
        ),
    ),
    Row(
        "F10",
        "An exception inside the scan",
        "guard around the scan",
        "speed command 0, quick stop, brake, torque off; torque that alone holds the load goes on",
        (Code.SYS_09,),
        (
            *at(
                "unit/operation/test_power_down_of_a_run.py",
                "test_torque_that_alone_holds_a_load_outlives_its_program",
            ),
            *at(
                "unit/runtime/test_engine.py",
                "test_a_program_that_raises_gets_the_drive_a_quick_stop_in_the_same_scan",
                "test_later_scans_bring_the_axis_to_rest_close_the_brake_and_take_the_torque_off",
            ),
            *at(
                "unit/service/test_controller.py",
                "test_whatever_a_scan_raises_the_axis_comes_to_rest_and_it_is_remembered",
            ),
        ),
        State.PARTLY,
        "raised in the program, the drive, the recorder and the operator, not in every single line",
    ),
    Row(
        "F11",
        "Disk full",
        "free space",
        "recordings end first, then new motion is refused; no event is lost",
        (Code.JRN_01,),
        at(
            "system/test_service_disk.py",
            "test_a_full_disk_ends_recordings_then_new_motion_and_loses_no_event",
        ),
    ),
    Row(
        "F12",
        "Disk slow, failing or read-only",
        "time of a commit, 1 s; error of a write",
        "events wait in memory; then no new motion; the scan is not touched",
        (Code.JRN_02,),
        (
            *at(
                "unit/service/test_journal_retention.py",
                "test_events_wait_in_memory_while_the_disk_is_slow_and_none_is_acknowledged_before_it_is_kept",
            ),
            *at(
                "unit/service/test_operator.py",
                "test_a_journal_that_cannot_keep_events_forbids_new_motion_but_no_stop",
            ),
        ),
    ),
    Row(
        "F13",
        "The recorder is killed while it writes",
        "check when it opens the journal again",
        "goes on; nothing lost or kept twice",
        (),
        at(
            _DURABLE,
            "test_a_killed_recorder_loses_nothing_and_keeps_nothing_twice",
            "test_two_hundred_kills_of_the_recorder",
        ),
        State.PARTLY,
        "hundreds of kills, not the hundred thousand of the catalogue: those belong to a campaign",
    ),
    Row(
        "F14",
        "Power cut while the journal is written",
        "hash chain; the newest event in two mirrors",
        "every acknowledged event is there; were one missing, no motion until service resets",
        (Code.JRN_04,),
        (
            *at(
                _DURABLE,
                "test_a_power_cut_loses_nothing_that_was_acknowledged",
                "test_a_hundred_thousand_power_cuts",
                "test_this_test_can_fail_without_full_synchronisation_events_are_lost",
            ),
            *at(_EVIDENCE, "test_what_is_missing_or_swapped_is_told_by_verify_and_locks_the_next_start"),
        ),
    ),
    Row(
        "F15",
        "Journal damaged on the disk",
        "hash chain at the start",
        "kept aside, a new one begun, no motion until service resets",
        (Code.JRN_05,),
        (
            *at(
                "system/test_service_disk.py",
                "test_a_damaged_journal_is_kept_aside_and_nothing_moves_until_service_has_seen_it",
            ),
            *at(
                _JOURNAL,
                "test_any_changed_field_of_any_row_is_found",
            ),
            *at(_BITS, "test_bits_of_every_page_and_frame", "test_every_bit_of_sixty_events"),
        ),
    ),
    Row(
        "F16",
        "Retained memory lost, old or damaged",
        "two copies with checksum and sequence number",
        "one copy bridges the other; without both nothing moves until service has set the angle",
        (Code.ENC_10,),
        (
            *at(
                _STORE,
                "test_a_newer_copy_torn_at_any_byte_falls_back_to_the_older_and_says_so",
                "test_two_damaged_copies_are_refused_in_clear_words_and_not_overwritten",
            ),
            *at("unit/cli/test_motion.py", "test_a_damaged_state_is_told_and_nothing_moves"),
            *at("property/test_runtime_retain.py", "test_any_change_of_bytes_is_found"),
        ),
    ),
)
