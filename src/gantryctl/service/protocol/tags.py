"""Table of tags: page, REST, OPC UA and local socket show these names and no others.

A tag that says `both` is set by a command; its role is the lowest one that may set it. All others are read only.
"""

from __future__ import annotations

from enum import Enum
from typing import Final, Literal, NamedTuple, TypeAlias

from gantryctl.image import DriveState, Mode
from gantryctl.program import AxisState, BrakeTestOutcome, BrakeTestPhase, PowerPhase
from gantryctl.service.protocol.roles import ARMABLE

Kind: TypeAlias = Literal["float", "int", "bool", "enum", "text", "pairs", "rows", "messages"]
Rate: TypeAlias = Literal["20 Hz", "1 Hz", "on change"]


class CommissioningPhase(Enum):
    """What commissioning does; the labels of the tag `commissioning`."""

    NONE = 0
    SETTING_UP = 1
    WAITING = 2
    RUNNING = 3
    ENDING = 4


class Tag(NamedTuple):
    """One value that the service shows.

    Attributes:
        unit: "" for a tag without one.
        direction: `out` is shown only, `both` can be set by a command too.
        rate: of its computation; `on change` is sent once and then when it changes.
        role: who may read it, or set it where the direction is `both`.
        labels: the words of an enum, in the order of their numbers.
        null: it may be null: unknown, not believed, or not fitted.
    """

    name: str
    unit: str
    kind: Kind
    direction: Literal["out", "both"]
    rate: Rate
    role: str
    meaning: str
    labels: tuple[str, ...] = ()
    null: bool = False


def _labels(kind: type[Enum]) -> tuple[str, ...]:
    return tuple(member.name.lower() for member in kind)


def _out(name: str, unit: str, kind: Kind, rate: Rate, meaning: str, labels: tuple[str, ...] = ()) -> Tag:
    return Tag(name, unit, kind, "out", rate, "viewer", meaning, labels)


def _may(name: str, unit: str, kind: Kind, rate: Rate, meaning: str) -> Tag:
    """Declare a tag that may be null."""
    return _out(name, unit, kind, rate, meaning)._replace(null=True)


def _set(name: str, unit: str, kind: Kind, role: str, meaning: str, labels: tuple[str, ...] = ()) -> Tag:
    return Tag(name, unit, kind, "both", "on change", role, meaning, labels)


_FRAME: Final = (
    _out("issued_ms", "ms", "int", "20 Hz", "Time since the start at which the controller issued these values."),
    _out("epoch", "", "int", "20 Hz", "Command epoch. Commands of another epoch are refused."),
    _out("scan", "", "int", "20 Hz", "Scans since the controller started."),
    _out("time_s", "s", "float", "20 Hz", "Nominal time of the scan since the controller started."),
)  # fmt: skip

_MOTION: Final = (
    _may("pos_act_deg", "deg", "float", "20 Hz", "Measured angle, motor side; null while it is not believed."),
    _may("vel_act_deg_s", "deg/s", "float", "20 Hz", "Measured speed, motor side; null while it is not believed."),
    _out("pos_ref_deg", "deg", "float", "20 Hz", "Set-point angle."),
    _out("vel_ref_deg_s", "deg/s", "float", "20 Hz", "Set-point speed."),
    _out("acc_ref_deg_s2", "deg/s2", "float", "20 Hz", "Set-point acceleration."),
    _may("vel_cmd_deg_s", "deg/s", "float", "20 Hz", "Speed command to the drive, at the load."),
    _may("pos_err_deg", "deg", "float", "20 Hz", "Following error: set-point minus measured angle."),
    _may("torque_act_nm", "N m", "float", "20 Hz", "Motor torque that the drive reports."),
    _may("torque_expected_nm", "N m", "float", "20 Hz",
         "Motor torque expected from the motion so far (learned); null until learned."),
    _may("overload", "", "float", "20 Hz", "Part of the drive's overload budget used, 0..1."),
    _may("target_deg", "deg", "float", "20 Hz", "End of the present set-point plan; null for one without end."),
    _may("time_left_s", "s", "float", "20 Hz", "Time until the plan ends; 0 at rest, null for one without end."),
    _may("stopping_angle_deg", "deg", "float", "20 Hz",
         "Way to rest if the key were released or Stop pressed now; of a quick stop under way, its own."),
    _may("key_lost_angle_deg", "deg", "float", "20 Hz",
         "Longest way to rest from these values if the page were gone while a key is held: speed setting x lease, then "
         "the jog-release ramp."),
    _may("quick_stop_angle_deg", "deg", "float", "20 Hz", "Way to rest with a quick stop now: rigid, no reaction."),
    _may("travel_left_minus_deg", "deg", "float", "20 Hz", "Cable left in the minus direction."),
    _may("travel_left_plus_deg", "deg", "float", "20 Hz", "Cable left in the plus direction."),
    _may("reach_min_deg", "deg", "float", "20 Hz",
         "The set-point can go down to this from where it is: an end of travel, or its clearance to a no-go sector; "
         "of a modulo axis counted on from `pos_ref_deg`, null without a sector."),
    _may("reach_max_deg", "deg", "float", "20 Hz", "The set-point can go up to this."),
)  # fmt: skip

_STATE: Final = (
    _out("axis_state", "", "enum", "20 Hz", "PLCopen axis state.", _labels(AxisState)),
    _out("drive_state", "", "enum", "20 Hz", "CiA 402 state of the drive.", _labels(DriveState)),
    _out("power_phase", "", "enum", "20 Hz", "Phase of the power sequence.", _labels(PowerPhase)),
    _out("power", "", "bool", "20 Hz", "Power is on: the axis follows commands."),
    _may("brake_open", "", "bool", "20 Hz", "Brake feedback contact; null while it is not heard."),
    _out("brake_open_cmd", "", "bool", "20 Hz", "Brake release command."),
    _out("horn", "", "bool", "20 Hz", "The load moves, or has moved, without a command: people must leave."),
    _out("at_rest", "", "bool", "20 Hz", "The set-point is at rest and no motion waits."),
    _out("in_position", "", "bool", "20 Hz", "At rest within the window for the dwell time."),
    _out("torque_limited", "", "bool", "20 Hz", "The drive is at its torque limit."),
    _out("position_valid", "", "bool", "20 Hz", "The encoder's angle is valid."),
    _out("estop_ok", "", "bool", "20 Hz", "Emergency-stop chain closed."),
    _out("enabling_switch", "", "bool", "20 Hz", "Enabling switch pressed; see `speed_cap_deg_s`."),
    _out("limit_minus_ok", "", "bool", "20 Hz", "Limit switch minus not reached."),
    _out("limit_plus_ok", "", "bool", "20 Hz", "Limit switch plus not reached."),
    _out("mains_ready", "", "bool", "20 Hz", "Mains ready."),
    _may("collision_ok", "", "bool", "20 Hz", "Collision interlock closed; null where it is not fitted."),
    _may("door_ok", "", "bool", "20 Hz", "Room door closed; null where it is not fitted."),
    _may("motion_permit", "", "bool", "20 Hz", "The room permits motion; null where it is not fitted."),
    _may("estop_ok_2", "", "bool", "20 Hz", "Second channel of the emergency-stop chain closed; null without one."),
    _out("lease_left_ms", "ms", "float", "20 Hz", "Time left of the hold-to-run lease; 0 without one."),
    _may("round_trip_ms", "ms", "float", "20 Hz",
         "From the controller to the screen that has control and back, shortest of the last 2 s; null without one. No "
         "key is pressed above 150 ms."),
    _out("alarm_count", "", "int", "20 Hz", "Active alarms."),
    _out("refusal_count", "", "int", "20 Hz", "Commands refused by the program since the start."),
)  # fmt: skip

_HEALTH: Final = (
    _out("feedback_age_ms", "ms", "float", "20 Hz", "Age of the drive's process data (TPDO) in this scan."),
    _may("heartbeat_age_ms", "ms", "float", "20 Hz", "Age of the drive's last heartbeat; null without a bus."),
    _may("bus_missed", "", "int", "1 Hz", "Telegrams of the drive that were missing (all TPDOs); null without a bus."),
    _may("bus_late", "", "int", "1 Hz", "Those that came after the scan had stopped waiting; null without a bus."),
    _may("bus_duplicated", "", "int", "1 Hz", "Those that came twice for one SYNC; null without a bus."),
    _may("bus_wrong_length", "", "int", "1 Hz", "Those of another length than was mapped; null without a bus."),
    _may("bus_contradicted", "", "int", "1 Hz", "Those that contradict another of the same SYNC; null without a bus."),
    _may("bus_refused", "", "int", "1 Hz", "Frames that the bus did not take; null without a bus."),
    _may("bus_others", "", "int", "1 Hz", "Frames of others on the bus; null without a bus."),
    _out("scan_period_ms", "ms", "float", "1 Hz", "Nominal scan period."),
    _may("scan_lateness_p50_us", "us", "float", "1 Hz", "Lateness of the scans of the last 10 s, median."),
    _may("scan_lateness_p99_us", "us", "float", "1 Hz", "The same, 99 % are below."),
    _may("scan_lateness_max_us", "us", "float", "1 Hz", "The latest scan since the start."),
    _may("scan_lateness_p99_deg", "deg", "float", "1 Hz", "The same 99 % as an angle at the highest speed."),
    _may("scan_lateness_max_deg", "deg", "float", "1 Hz", "The latest scan as an angle at the highest speed."),
    _may("scan_run_p50_us", "us", "float", "1 Hz", "Time a scan takes, median of the last 10 s."),
    _may("scan_run_p99_us", "us", "float", "1 Hz", "The same, 99 % are below."),
    _out("scan_overruns", "", "int", "1 Hz", "Scans that ended after the next one was due."),
    _out("scan_skipped", "", "int", "1 Hz", "Deadlines that passed without a scan."),
    _out("real_time", "", "bool", "1 Hz", "SCHED_FIFO and locked memory were granted."),
    _out("journal_sequence", "", "int", "20 Hz", "Events handed to the journal by the controller."),
    _out("journal_committed", "", "int", "20 Hz", "The last of them that is safe on the disk."),
    _out("journal_state", "", "enum", "20 Hz", "Health of the journal; anything but ok or slow refuses new motion.",
         ("ok", "slow", "full", "failed", "locked")),
    _out("recording", "", "bool", "20 Hz", "A trace is being recorded."),
    _out("trace_rows_lost", "", "int", "1 Hz", "Rows that found no place in the trace ring."),
    _out("events_lost", "", "int", "1 Hz", "Events of the controller that found no place in the event ring."),
)  # fmt: skip

_AUTHORITY: Final = (
    _out("authority_user", "", "text", "on change", "Holder of control; empty without one."),
    _out("authority_client", "", "text", "on change", "Client id of the holder; `welcome.client` is your own."),
    _out("authority_local", "", "bool", "on change", "The holder sits at the local console."),
    _may("unheld_power_left_s", "s", "float", "20 Hz",
         "Time at rest until power is switched off because nobody has control; null while that does not count."),
    _set("mode", "", "enum", "operator", "Motion mode; changes at standstill only.", _labels(Mode)),
    _set("speed_setting_deg_s", "deg/s", "float", "operator", "Speed of moves, keys and increments."),
    _set("increment_deg", "deg", "float", "operator", "One increment."),
    _set("override_percent", "%", "float", "operator", "Speed override, 0..100."),
    _set("acc_setting_deg_s2", "deg/s2", "float", "physicist", "Acceleration and deceleration of normal motion."),
)  # fmt: skip

_ARMED: Final = (
    _out("armed_action", "", "enum", "on change", "The armed action: the next step executes it.", ("none", *ARMABLE)),
    _out("armed_step", "", "text", "on change",
         "`key` of the armed step of commissioning; empty with anything else."),
    _out("armed_by", "", "text", "on change", "User who armed it; empty with nothing armed."),
    _out("armed_person", "", "text", "on change", "Person whose account that is; empty with nothing armed."),
    _out("armed_client", "", "text", "on change", "Client id of the user who armed it."),
    _out("armed_left_s", "s", "float", "20 Hz", "Time until the arming ends; 0 with nothing armed."),
    _out("second_person", "", "bool", "on change", "Another person than the one who armed must execute."),
    _out("reset_locked", "", "bool", "on change",
         "A reset now meets something locked: it needs the service role, and `arm` first."),
)  # fmt: skip

_COMMISSIONING: Final = (
    _out("commissioning_available", "", "bool", "on change", "This machine has a drive that is commissioned."),
    _out("commissioning", "", "enum", "on change",
         "What commissioning does; `none` while the controller has the axis. Else no program runs: `axis_state` is "
         "disabled, and what the drive shows is told during a step only.", _labels(CommissioningPhase)),
    _out("commissioning_step", "", "text", "on change", "Key of the step under way; empty without one."),
    _may("commissioning_left_s", "s", "float", "20 Hz", "Time until that step ends, about; null without one."),
    _out("commissioning_results", "", "int", "on change", "Read `/commissioning` again when it changes."),
)  # fmt: skip

_BRAKE: Final = (
    _out("brake_test_available", "", "bool", "on change", "This machine can test its brake."),
    _out("brake_test_blocked", "", "text", "on change", "Why it cannot be tested here; empty when it can."),
    _out("brake_test_blocked_messages", "", "messages", "on change", "The same as words and values."),
    _out("brake_test_phase", "", "enum", "20 Hz", "Phase of the brake test; idle without one.",
         _labels(BrakeTestPhase)),
    _out("brake_test_left_s", "s", "float", "20 Hz", "Time until the test under way ends; 0 without one."),
    _may("brake_test_torque_nm", "N m", "float", "20 Hz",
         "Torque that the test puts on the brake now; the motor's own is `torque_act_nm`."),
    _may("brake_test_moved_deg", "deg", "float", "20 Hz", "Farthest way during the test under way or the last one."),
    _out("brake_test_level_nm", "N m", "float", "on change", "Torque that the closed brake must hold, both ways."),
    _may("brake_test_limit_deg", "deg", "float", "on change", "The axis may move this far under it."),
    _out("brake_test_result", "", "enum", "on change", "How the last test ended; aborted ones show nothing.",
         _labels(BrakeTestOutcome)),
    _out("brake_tests", "", "int", "on change", "Tests that have ended since the controller started."),
    _out("brake_test_text", "", "text", "on change", "What the last test measured, in one sentence."),
    _out("brake_test_messages", "", "messages", "on change",
         "The same as words and values, without the outcome."),
    _may("brake_test_plus_nm", "N m", "float", "on change",
         "Torque on the brake in the plus direction, mean while held; null when it was not held."),
    _may("brake_test_minus_nm", "N m", "float", "on change", "The same in the minus direction."),
    _out("brake_tested_at", "", "text", "on change",
         "Date and time (UTC) of the last test that passed or failed; empty when there was none."),
    _out("brake_test_due_at", "", "text", "on change",
         "The next test is due then (UTC) at the latest; empty where it cannot be tested or never was."),
    _may("brake_test_cycles_left", "", "int", "on change",
         "It is due after so many power-ups at the latest; null where it cannot be tested."),
    _out("brake_test_overdue", "", "bool", "on change", "It is overdue: slow motion only."),
)  # fmt: skip

_LIMITS: Final = (
    _out("speed_min_deg_s", "deg/s", "float", "on change", "Lowest speed setting."),
    _out("speed_max_deg_s", "deg/s", "float", "on change", "Highest speed setting."),
    _may("speed_cap_deg_s", "deg/s", "float", "on change",
         "Keys and increments above this need the enabling switch."),
    _out("quick_dec_deg_s2", "deg/s2", "float", "on change",
         "Deceleration of a quick stop: as set, or as measured of a drive with a ramp of its own."),
    _out("moment_max_nm", "N m", "float", "on change", "Moment at the axis that the motor's largest torque holds."),
    _out("acc_min_deg_s2", "deg/s2", "float", "on change", "Lowest acceleration setting."),
    _out("acc_max_deg_s2", "deg/s2", "float", "on change", "Highest acceleration setting, that of the machine file."),
    _out("increment_max_deg", "deg", "float", "on change", "Largest increment."),
    _out("pos_min_deg", "deg", "float", "on change",
         "The set-point never passes this; of a modulo axis, the begin of its turn."),
    _out("pos_max_deg", "deg", "float", "on change", "The set-point never passes this."),
    _may("over_travel_min_deg", "deg", "float", "on change",
         "A measured angle below this trips; a modulo axis has no ends: null."),
    _may("over_travel_max_deg", "deg", "float", "on change", "A measured angle above this trips."),
    _may("limit_switch_min_deg", "deg", "float", "on change", "The lower limit switch stands there."),
    _may("limit_switch_max_deg", "deg", "float", "on change", "The upper limit switch stands there."),
    _may("mechanical_stop_min_deg", "deg", "float", "on change", "The lower mechanical stop stands there."),
    _may("mechanical_stop_max_deg", "deg", "float", "on change", "The upper mechanical stop stands there."),
    _out("following_error_trip_deg", "deg", "float", "20 Hz", "Following error that stops the axis, at this speed."),
    _out("torque_rated_nm", "N m", "float", "on change", "Rated motor torque."),
    _out("torque_max_nm", "N m", "float", "on change", "Motor torque limit."),
)  # fmt: skip

_MACHINE: Final = (
    _out("machine", "", "text", "on change", "Name of the machine."),
    _out("axis_kind", "", "text", "on change", "linear, or modulo: turns without end."),
    _out("display", "", "text", "on change",
         "How people read and type angles: -180..180 or 0..360; tags and commands are signed angles of the axis."),
    _out("no_go_deg", "deg", "pairs", "on change", "No-go sectors, from and to; of a modulo axis in every turn."),
    _out("drawing", "", "text", "on change", "What the page draws: couch, an axis that turns around one, or axis."),
    _out("drive_kind", "", "text", "on change", "sim, ideal or canopen."),
    _out("config_hash", "", "text", "on change", "Short hash of the machine file in force."),
    _out("version", "", "text", "on change", "Version of gantryctl."),
    _out("blocked_by", "", "text", "on change", "Why power cannot be switched on; empty when it can."),
    _out("blocked_by_messages", "", "messages", "on change", "The same as codes and values (see below)."),
    _may("eccentric_moment_nm", "N m", "float", "1 Hz",
         "Eccentric moment at the load, learned from the torque; null until learned."),
    _may("eccentric_angle_deg", "deg", "float", "1 Hz", "Where it would come to rest by itself; null until learned."),
    _out("refusal_text", "", "text", "on change", "The last command that the program refused, and why."),
    _out("refusal_messages", "", "messages", "on change", "The same as code and values."),
    _out("alarms", "", "rows", "on change", "Active alarms, the first-out first (rows below)."),
    _out("alarm_history", "", "rows", "on change", "The last 50 alarms, newest first (rows below)."),
)  # fmt: skip

TAGS: Final = (
    *_FRAME,
    *_MOTION,
    *_STATE,
    *_HEALTH,
    *_AUTHORITY,
    *_ARMED,
    *_COMMISSIONING,
    *_BRAKE,
    *_LIMITS,
    *_MACHINE,
)
BY_NAME: Final = {tag.name: tag for tag in TAGS}


class AlarmKey(NamedTuple):
    """One key of a row of `alarms` and `alarm_history`.

    Attributes:
        kind: as of a tag, or `values`.
        null: it may be null.
    """

    kind: Literal["int", "float", "bool", "text", "values", "messages"]
    meaning: str
    null: bool = False


ALARM_ROW: Final = {
    "id": AlarmKey("int", "number of the alarm since the controller started"),
    "code": AlarmKey("text", "stable code, e.g. CTL-03"),
    "severity": AlarmKey("text", "INFO, WARNING, REFUSED or STOP"),
    "title": AlarmKey("text", "two or three words"),
    "measured": AlarmKey("text", "what was measured against which limit"),
    "values": AlarmKey(
        "values",
        "what was measured, as values: the fields of the message of `code`, angles as people read them",
    ),
    "done": AlarmKey("text", "what gantryctl did about it"),
    "steps": AlarmKey("messages", "the same as words and values"),
    "to_do": AlarmKey("text", "what to do"),
    "cause": AlarmKey("text", "what it means"),
    "text": AlarmKey("text", "the whole line"),
    "at": AlarmKey("text", "date and time, UTC"),
    "time_s": AlarmKey("float", "time of the scan"),
    "pos_act_deg": AlarmKey(
        "float", "angle at the alarm, null where its reading was not believed", null=True
    ),
    "active": AlarmKey("bool", "still latched or present"),
    "first_out": AlarmKey("bool", "it stopped the axis"),
    "follows": AlarmKey("text", "code of the first-out alarm that it follows, or empty"),
    "lock": AlarmKey("bool", "only service may reset it"),
    "acknowledged_by": AlarmKey("text", "who has seen it, or empty"),
}
