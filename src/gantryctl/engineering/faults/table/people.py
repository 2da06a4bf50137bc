"""Group H: operators, network, files and configuration."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.table.row import Row, State, at
from gantryctl.program.alarms.codes import Code

_SERVICE: Final = "system/test_service.py"
_OPERATOR: Final = "unit/service/test_operator.py"
_KEYS: Final = "system/page/test_hold_to_run.py"
_NETWORK: Final = "unit/service/test_slow_network.py"
_EVIDENCE: Final = "unit/service/test_journal_evidence.py"
_FILES: Final = "unit/machine/test_files.py"

PEOPLE: Final = (
    Row(
        "H1",
        "The page is gone while a key is held",
        "lease of 250 ms from the status frame that it acknowledges",
        "jog-release ramp",
        (Code.CTL_15,),
        (
            *at(_KEYS, "test_it_stops_when_the_page_is_left", "test_it_stops_when_the_browser_is_killed"),
            *at(_SERVICE, "test_a_browser_that_is_gone_stops_its_jog_and_frees_control"),
            *at(_OPERATOR, "test_a_key_held_moves_and_a_lost_holder_stops_within_lease_and_ramp"),
            *at(_NETWORK, "test_gestures_over_networks_of_every_kind"),
        ),
    ),
    Row(
        "H2",
        "The release of a key is missed",
        "every way in which a press can end",
        "jog-release ramp",
        (),
        (
            *at(_KEYS, "test_it_stops_however_the_press_ends", "test_a_finger_is_a_key_too"),
            *at("system/page/test_gestures.py", "test_every_random_gesture_ends_at_rest"),
            *at(_OPERATOR, "test_random_gestures_never_leave_the_axis_moving_without_a_hand_on_the_key"),
        ),
    ),
    Row(
        "H3",
        "A page that hangs renews by itself",
        "30 s at most; above the cap the enabling switch",
        "jog-release ramp",
        (Code.CTL_21, Code.INT_05),
        at(
            "unit/service/test_operator_goes_on.py",
            "test_a_page_that_is_stuck_and_goes_on_renewing_stops_after_30_s",
            "test_letting_go_of_the_enabling_switch_stops_what_is_faster_than_the_cap",
        ),
    ),
    Row(
        "H4",
        "Renewals come late or all at once",
        "age of the status frame that each acknowledges, 200 ms",
        "nothing starts again after a stop",
        (Code.CTL_15, Code.SEC_09, Code.SEC_13),
        (
            *at(
                _NETWORK,
                "test_a_freeze_stops_once_or_not_at_all",
                "test_a_liar_moves_nothing_longer_and_one_that_is_believed_is_seen",
                "test_above_150_ms_there_and_back_a_press_is_refused_in_words",
            ),
            *at(
                _OPERATOR,
                "test_a_frozen_network_stops_once_or_not_at_all_and_never_starts_again",
                "test_press_and_release_in_a_freeze_start_nothing",
            ),
            *at(_KEYS, "test_a_long_freeze_stops_it_once_and_for_good"),
            *at(
                "system/page/test_slow_network.py",
                "test_with_40_ms_there_and_back_a_key_moves_and_stops",
                "test_with_200_ms_a_press_is_refused_and_the_page_says_why_and_what_to_do",
            ),
        ),
    ),
    Row(
        "H5",
        "Two operators command",
        "one holder of control",
        "the second is refused, and may look and stop",
        (Code.SEC_07, Code.SEC_08),
        (
            *at(_SERVICE, "test_two_operators_have_one_control_and_everyone_may_stop"),
            *at("system/page/test_people.py", "test_one_has_control_the_other_sees_who_and_can_stop"),
        ),
    ),
    Row(
        "H6",
        "Control is taken over",
        "standstill, or the local console, which stops first",
        "a new epoch",
        (Code.SEC_08, Code.SEC_03),
        (
            *at(
                _OPERATOR,
                "test_the_local_console_takes_control_and_stops_what_moves",
                "test_a_holder_that_is_silent_loses_control_and_its_move_goes_on",
            ),
            *at(_SERVICE, "test_the_command_line_takes_control_from_nobody"),
        ),
    ),
    Row(
        "H7",
        "An old command is sent again",
        "sequence number, epoch, age of its status frame",
        "refused",
        (Code.SEC_02, Code.SEC_03),
        (
            *at(_SERVICE, "test_what_is_of_the_past_is_refused"),
            *at(_OPERATOR, "test_stop_is_for_everyone_and_kills_what_was_sent_before"),
            *at(_NETWORK, "test_a_press_that_is_sent_again_starts_nothing"),
        ),
    ),
    Row(
        "H8",
        "Commands from a foreign page or host",
        "Host, Origin, session",
        "refused",
        (Code.SEC_04,),
        (
            *at(
                "system/page/test_foreign_site.py",
                "test_it_gets_no_connection",
                "test_its_requests_read_nothing_and_do_nothing",
                "test_its_forms_do_nothing",
                "test_a_name_that_was_rebound_is_not_served",
            ),
            *at(_SERVICE, "test_only_the_page_itself_with_a_session_gets_a_socket"),
        ),
    ),
    Row(
        "H9",
        "Passwords are guessed",
        "five failures of an account and address",
        "a wait that doubles up to 15 min",
        (Code.SEC_01,),
        (
            *at(_SERVICE, "test_five_wrong_passwords_lock_this_account_and_no_other"),
            *at(
                "unit/gateway/test_sessions.py",
                "test_failures_double_the_wait_for_this_account_and_address_only",
                "test_a_flood_of_names_does_not_fill_the_memory",
            ),
        ),
    ),
    Row(
        "H10",
        "OPC UA client without rights",
        "policies, certificates, users",
        "no session",
        (),
        (
            *at(
                "unit/gateway/test_opcua.py",
                "test_nobody_else_gets_in",
                "test_only_policies_that_sign_and_encrypt_are_offered",
                "test_a_trusted_client_reads_the_axis_and_can_change_nothing",
            ),
            *at(
                "unit/gateway/test_opcua_services.py",
                "test_nothing_is_answered_otherwise_than_the_table_says",
            ),
            *at(
                "unit/gateway/test_opcua_sessions.py",
                "test_nobody_takes_the_session_of_somebody_else",
            ),
            *at(
                "unit/gateway/test_opcua_trust.py",
                "test_taking_trust_away_ends_all_sessions_at_once",
            ),
            *at(
                "unit/gateway/test_opcua_login.py",
                "test_guessing_locks_the_guesser_out_and_nobody_else",
            ),
            *at("unit/gateway/test_opcua_limits.py", "test_answers_that_are_never_read_hold_no_place"),
            *at("system/test_opcua_foreign.py", "test_node_opcua_reads_the_axis_and_can_change_nothing"),
        ),
    ),
    Row(
        "H11",
        "Floods, slow connections, huge messages",
        "limits of size, rate, time and number",
        "refused or closed",
        (Code.SEC_06,),
        (
            *at(
                _SERVICE,
                "test_slow_and_huge_requests_are_ended_and_others_are_served",
                "test_a_flood_of_messages_closes_only_its_own_connection",
                "test_too_many_requests_are_refused_for_their_own_address_and_stop_is_not",
            ),
            *at(
                "unit/gateway/test_places.py",
                "test_an_address_has_its_places_and_no_more",
                "test_a_crowd_that_holds_connections_keeps_nobody_out",
            ),
            *at("unit/gateway/test_slow_clients.py", "test_answers_that_are_never_read_are_given_up"),
            *at(
                "unit/gateway/test_odd_requests.py",
                "test_requests_before_the_answer_to_the_last_one_are_not_taken",
            ),
            *at(
                "unit/gateway/test_app.py",
                "test_strangers_of_an_address_take_nothing_from_whoever_is_logged_in_there",
            ),
            *at(
                "unit/service/test_local.py",
                "test_who_was_unused_for_longest_makes_room_and_who_has_control_does_not",
            ),
        ),
    ),
    Row(
        "H12",
        "Paths and links in downloads",
        "recordings by their number only",
        "not found",
        (Code.SEC_12,),
        (
            *at(_SERVICE, "test_a_recording_is_had_by_its_id_and_by_nothing_else"),
            *at("unit/gateway/test_page.py", "test_recordings_have_opaque_ids_and_links_are_not_followed"),
        ),
    ),
    Row(
        "H13",
        "Damaged or hostile EDS file",
        "limits of size and number, one kind of error",
        "refused, with the line",
        (),
        at(
            "unit/drives/od/test_reading.py",
            "test_any_bytes_are_a_description_or_an_eds_error",
            "test_a_file_above_the_size_limit_is_not_read",
            "test_too_many_objects_and_entries_end_in_an_error_with_a_line",
        ),
        State.PARTLY,
        "random files by property tests; the billion executions of the catalogue belong to a "
        "fuzzing campaign",
    ),
    Row(
        "H14",
        "Damaged or hostile machine file",
        "limits of size and depth, one kind of error",
        "refused",
        (),
        (
            *at(
                _FILES,
                "test_contents_that_are_no_machine_file",
                "test_numbers_beyond_every_type",
                "test_a_huge_number_of_problems_is_answered_in_time_and_cut",
            ),
            *at(
                "property/test_machine_files.py",
                "test_random_bytes_are_refused",
                "test_a_damaged_file_is_accepted_or_refused",
            ),
        ),
    ),
    Row(
        "H15",
        "A key of the machine file out of range, of a wrong type, missing or misspelt",
        "the schema",
        "refused, with key, value, range and unit",
        (),
        at(
            "unit/machine/test_fields.py",
            "test_wrong_values_are_refused_with_field_value_and_range",
            "test_values_just_outside_the_bounds_are_refused",
            "test_a_missing_key_is_refused_or_takes_its_default",
            "test_a_misspelt_key_is_refused_with_a_hint",
        ),
    ),
    Row(
        "H16",
        "A value in the wrong unit",
        "ranges, and rules between keys",
        "refused, with the likely mistake",
        (),
        at(
            "unit/machine/test_unit_mistakes.py",
            "test_values_too_large_by_a_unit_are_refused",
            "test_the_hint_names_the_mistake",
            "test_values_too_small_by_a_unit_that_go_unnoticed",
        ),
        State.PARTLY,
        "values that are too large are refused on every key field; some that are too small lie in "
        "the range of a "
        "smaller machine: a test lists them",
    ),
    Row(
        "H17",
        "Keys that contradict each other",
        "rules between keys",
        "refused",
        (),
        (
            *at(
                "unit/machine/test_rules.py",
                "test_the_rule_fires_and_names_every_key",
                "test_there_are_forty_rules_and_more_each_with_a_test",
            ),
            *at(
                "property/test_machine_files.py", "test_a_thousand_valid_machines_are_accepted_and_come_back"
            ),
        ),
    ),
    Row(
        "H18",
        "The machine file is changed while it is in use",
        "none needed: it is read once, and its values are immutable",
        "nothing, until the next start; a command with another file is refused by the hash",
        (),
        (
            *at("unit/machine/test_reference_machine.py", "test_immutable_hashable_and_picklable"),
            *at("unit/machine/test_effective.py", "test_hash_and_diff_notice_every_field"),
            *at(
                "unit/commissioning/test_commissioning.py",
                "test_the_record_is_of_one_drive_and_one_configuration",
            ),
        ),
    ),
    Row(
        "H19",
        "The journal is changed, put back from an older copy, removed or moved; text forges lines in it",
        "hash chain with seals; two mirrors of the newest event; inode and links of open files; every text is escaped",
        "told at once in use, at the next start and by `gantryctl journal verify`; no motion until service resets; "
        "what is removed in use is written anew",
        (Code.JRN_04, Code.JRN_05, Code.JRN_07),
        (
            *at(
                "unit/service/test_journal.py",
                "test_any_changed_field_of_any_row_is_found",
                "test_rows_taken_out_are_found_and_the_journal_is_begun_anew",
                "test_control_characters_do_not_reach_a_log",
                "test_any_text_becomes_one_printable_line_that_fits",
            ),
            *at(
                _EVIDENCE,
                "test_who_knows_everything_but_the_key_cannot_rewrite_history",
                "test_what_is_missing_or_swapped_is_told_by_verify_and_locks_the_next_start",
                "test_a_file_that_is_deleted_or_replaced_in_use_is_written_anew_and_nothing_is_lost",
                "test_a_directory_that_is_moved_away_locks_until_it_is_back_and_keeps_its_events",
            ),
        ),
    ),
)
