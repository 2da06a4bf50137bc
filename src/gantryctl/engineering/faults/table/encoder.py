"""Group A: encoder and position."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.table.row import Row, State, at
from gantryctl.program.alarms.codes import Code

_FEEDBACK: Final = "unit/program/test_monitors_feedback.py"
_DOUBT: Final = "plant/test_feedback_in_doubt.py"
_HOME: Final = "unit/operation/test_home_reference.py"

ENCODER: Final = (
    Row(
        "A1",
        "Count jumps in motion",
        "step of the count against the speed of the scan before, and the sum of the steps against "
        "the sum of the speeds: 0.05 deg at any speed, direction and scan",
        "torque off and brake; position not valid",
        (Code.ENC_01, Code.ENC_14),
        (
            *at(
                _FEEDBACK,
                "test_a1_jump",
                "test_a1_the_step_of_a_fast_axis_is_no_jump",
                "test_a_jump_soon_after_late_telegrams_is_caught",
            ),
            *at(_DOUBT, "test_a_jump_is_seen_with_and_against_the_motion"),
        ),
    ),
    Row(
        "A2",
        "Encoder frozen in motion, or in a quick stop",
        "a speed that nothing could take away so fast, 1 scan; count unchanged for 30 ms, at least "
        "3 scans, while more than 0.1 deg/s is commanded; sum of the steps against the speed",
        "torque off and brake, never a quick stop; position not valid",
        (Code.ENC_02, Code.ENC_14, Code.ENC_12),
        (
            *at(
                _FEEDBACK,
                "test_a2_frozen_in_motion",
                "test_a2_frozen_at_a_low_speed",
                "test_frozen_is_judged_in_time_not_in_scans",
            ),
            *at(
                _DOUBT,
                "test_encoder_of_the_drive_fails_in_motion",
                "test_encoder_freezes_in_a_quick_stop",
                "test_only_the_reading_freezes",
            ),
        ),
    ),
    Row(
        "A3",
        "Encoder frozen at standstill, before power-up, or seen at the first motion",
        "the count at the torque proof, and under small changes of torque while enabled; as A2 from"
        " the first motion on; torque without effect",
        "torque off and brake; position not valid",
        (Code.ENC_02,),
        (
            *at(
                "plant/test_liveness.py",
                "test_the_torque_proof_shows_a_wrong_encoder_behind_the_closed_brake",
                "test_without_a_proof_it_shows_when_the_brake_has_opened",
                "test_at_standstill",
                "test_frozen_in_the_last_instants_of_a_quick_stop",
            ),
            *at(_FEEDBACK, "test_a3_frozen_before_the_first_move"),
        ),
    ),
    Row(
        "A4",
        "One checksum error",
        "flag of the reading",
        "reading bridged by prediction; warning",
        (Code.ENC_03,),
        at(_FEEDBACK, "test_a4_one_bad_reading_is_bridged"),
    ),
    Row(
        "A5",
        "Three checksum errors within 100 ms",
        "count of the flags",
        "torque off and brake",
        (Code.ENC_04,),
        at(_FEEDBACK, "test_a5_three_bad_readings_in_100_ms", "test_a5_rare_bad_readings_go_on"),
    ),
    Row(
        "A6",
        "Alarm of the encoder (lamp, amplitude, position, supply)",
        "alarm flag, 1 scan",
        "torque off and brake; service only, after it is cleared at the encoder",
        (Code.ENC_05,),
        at(_FEEDBACK, "test_a6_encoder_alarm_and_its_lock"),
        State.PARTLY,
        "the bit is not named: a drive hands on one alarm flag, and the word of the encoder is read "
        "with the tool of the drive, as the alarm says",
    ),
    Row(
        "A7",
        "Warning of the encoder (lamp reserve, temperature, battery low)",
        "warning flag, 1 scan",
        "warning; the motion goes on",
        (Code.ENC_06,),
        at(_FEEDBACK, "test_a7_encoder_warning_goes_on"),
    ),
    Row(
        "A8",
        "Battery of a battery-buffered encoder empty",
        "battery flag, with [monitors] encoder_battery only; 1 scan",
        "at the start: position not valid, no power; in motion: the motion ends and no other "
        "begins; service only",
        (Code.ENC_13,),
        at(
            "unit/program/test_thermal.py",
            "test_a8_at_the_start_the_angle_is_not_valid_and_nothing_is_enabled",
            "test_a8_in_motion_the_move_ends_and_no_other_begins",
            "test_a_geared_encoder_has_no_battery",
        ),
        why="in motion the position stays valid: while the encoder has its supply the battery counts nothing",
    ),
    Row(
        "A9",
        "Range of the encoder ends inside the travel",
        "distance between travel and wrap below [encoder] wrap_margin_min_deg, at the start",
        "no power",
        (Code.CFG_ENC_01,),
        at(
            _HOME,
            "test_a_wrap_near_the_travel_is_refused",
            "test_unwrapping_never_jumps_wherever_the_wrap_is",
        ),
    ),
    Row(
        "A10",
        "Encoder loses whole turns",
        "in motion as A1, one turn is 0.315 deg; at the start against the stored rest position",
        "in motion torque off and brake; at the start no power until service has set the angle",
        (Code.ENC_01, Code.ENC_08),
        (
            *at(_FEEDBACK, "test_a1_jump"),
            *at(_HOME, "test_lost_turns_are_not_a_motion_to_be_acknowledged"),
            *at(
                "unit/service/test_controller.py",
                "test_no_reset_opens_an_encoder_that_lost_turns_also_when_a_scan_was_late",
            ),
        ),
    ),
    Row(
        "A11",
        "Turned while off, less than 0.05 deg",
        "against the stored rest position",
        "accepted and recorded",
        (),
        (
            *at(_HOME, "test_a_motion_while_off_is_judged_by_its_size"),
            *at(
                "unit/operation/test_run.py",
                "test_small_motions_while_off_are_recorded_when_they_are_accepted",
            ),
        ),
    ),
    Row(
        "A12",
        "Turned while off, 0.05 to 1 deg",
        "against the stored rest position",
        "no power until acknowledged by name",
        (Code.ENC_09,),
        (
            *at(_HOME, "test_a_motion_while_off_is_judged_by_its_size"),
            *at(
                "unit/service/test_controller.py",
                "test_a_motion_while_off_that_was_acknowledged_is_forgotten",
            ),
        ),
    ),
    Row(
        "A13",
        "Turned while off, more than 1 deg, or ambiguous",
        "against the stored rest position",
        "position not valid; service sets the angle by a witness mark",
        (Code.ENC_10,),
        at(
            _HOME,
            "test_no_motion_above_the_limit_is_accepted_in_silence",
            "test_the_ambiguity_of_the_range_is_never_a_proof",
            "test_without_a_stored_rest_position_nothing_proves_the_angle",
        ),
    ),
    Row(
        "A14",
        "Encoder replaced, or memory of another machine",
        "serial number against the stored one, at the start",
        "no power until service sets the angle",
        (Code.ENC_11,),
        at(_HOME, "test_another_serial_is_refused_even_where_the_reading_fits"),
    ),
    Row(
        "A15",
        "Scale or sign of the feedback wrong in the configuration",
        "position against speed; motion that grows against its torque; the sign test of commissioning",
        "torque off and brake; position not valid",
        (Code.ENC_12, Code.CTL_05),
        (
            *at(
                "unit/commissioning/test_commissioning.py",
                "test_a_wrong_sign_is_found_within_the_leash",
                "test_a_wrong_unit_of_speed_is_found",
            ),
            *at("unit/program/test_monitors.py", "test_b5_from_standstill_within_class_m0"),
        ),
    ),
    Row(
        "A16",
        "Reading late by some scans",
        "age of the reading, 30 ms and at least 3 scans",
        "quick stop",
        (Code.CAN_07,),
        at(_FEEDBACK, "test_a16_old_readings", "test_one_old_reading_is_nothing"),
        state=State.PARTLY,
        why=(
            "telegrams that a drive hands over less than 30 ms late but in every SYNC carry no age on the "
            "bus: at low speed nothing shows it, at high speed it shows as a jump"
        ),
    ),
    Row(
        "A17",
        "Coupling of the encoder slips, 90 % of the motion",
        "change of the speed against the torque that answers it; a load-side encoder",
        "torque off and brake; position not valid",
        (Code.ENC_14, Code.ENC_07),
        at(
            "plant/test_liveness.py",
            "test_a_coupling_that_slips",
            "test_a_tenth_that_slips_at_once_is_seen_from_a_fifth_of_a_degree_per_second_on",
        ),
        State.PARTLY,
        "the measured runs see a slip of a tenth at 6 deg/s, and not at 3 and 1 deg/s; an encoder on the ring shows it "
        "at 0.05 deg, after half a degree of way at any speed; one that grows slowly agrees with itself in every "
        "signal that a drive has, and only a load-side encoder or a mark on the load tells",
    ),
    Row(
        "A18",
        "Coupling of the encoder slips, 98 % of the motion",
        "torque against motion; slower slip only at the next comparison with a second encoder or a mark",
        "none at once: the axis goes on at 98 % of its speed",
        (),
        (),
        State.PARTLY,
        "an encoder that shows 98 % of the motion agrees with itself in every signal that a drive "
        "has: only a load-side "
        "encoder ([control.compensation] load_encoder) or a mark on the load tells. The "
        "way of the run below "
        "is that of the motion that goes on, not of a stop",
    ),
    Row(
        "A19",
        "Speed reading absurd (1e300)",
        "speed beyond what the motor can turn, 1 scan",
        "torque off and brake; position not valid",
        (Code.ENC_14,),
        (
            *at(_DOUBT, "test_an_absurd_speed_is_torque_off_at_once"),
            *at(_FEEDBACK, "test_a_reading_that_is_no_number"),
        ),
    ),
    Row(
        "A20",
        "Sign of the encoder wrong while torque holds the load",
        "torque that drives the motion: same sign, speed growing",
        "torque off and brake; horn",
        (Code.BRK_13, Code.ENC_14),
        at(
            "plant/test_hold.py",
            "test_torque_that_drives_the_load_goes_off",
            "test_no_torque_by_itself_after_feedback_or_drive_were_in_doubt",
        ),
        why=(
            "with no brake and torque that drives the load nothing is left to hold it: it is told by "
            "the horn, and the torque goes off"
        ),
    ),
)
