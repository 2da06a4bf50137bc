"""Tags of the service by name. Written by tools/client_tags.py; do not edit, a test compares."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, Literal, TypedDict

from gantryctl.errors import DeviceError

# A code, a reason or words with values, or English without.
Message = str | dict[str, Any]


class AlarmRow(TypedDict):
    """Row of `alarms` and `alarm_history`."""

    id: int
    """Number of the alarm since the controller started."""
    code: str
    """Stable code, e.g. CTL-03."""
    severity: str
    """INFO, WARNING, REFUSED or STOP."""
    title: str
    """Two or three words."""
    measured: str
    """What was measured against which limit."""
    values: dict[str, Any]
    """What was measured, as values: the fields of the message of `code`, angles as people read them."""
    done: str
    """What gantryctl did about it."""
    steps: list[Message]
    """The same as words and values."""
    to_do: str
    """What to do."""
    cause: str
    """What it means."""
    text: str
    """The whole line."""
    at: str
    """Date and time, UTC."""
    time_s: float
    """Time of the scan."""
    pos_act_deg: float | None
    """Angle at the alarm, null where its reading was not believed."""
    active: bool
    """Still latched or present."""
    first_out: bool
    """It stopped the axis."""
    follows: str
    """Code of the first-out alarm that it follows, or empty."""
    lock: bool
    """Only service may reset it."""
    acknowledged_by: str
    """Who has seen it, or empty."""


@dataclass(frozen=True, slots=True)
class Tags:
    """What the service shows in one status frame; None is unknown, not believed, or not fitted."""

    issued_ms: int
    """Time since the start at which the controller issued these values. [ms]"""
    epoch: int
    """Command epoch. Commands of another epoch are refused."""
    scan: int
    """Scans since the controller started."""
    time_s: float
    """Nominal time of the scan since the controller started. [s]"""
    pos_act_deg: float | None
    """Measured angle, motor side; None while it is not believed. [deg]"""
    vel_act_deg_s: float | None
    """Measured speed, motor side; None while it is not believed. [deg/s]"""
    pos_ref_deg: float
    """Set-point angle. [deg]"""
    vel_ref_deg_s: float
    """Set-point speed. [deg/s]"""
    acc_ref_deg_s2: float
    """Set-point acceleration. [deg/s2]"""
    vel_cmd_deg_s: float | None
    """Speed command to the drive, at the load. [deg/s]"""
    pos_err_deg: float | None
    """Following error: set-point minus measured angle. [deg]"""
    torque_act_nm: float | None
    """Motor torque that the drive reports. [N m]"""
    torque_expected_nm: float | None
    """Motor torque expected from the motion so far (learned); None until learned. [N m]"""
    overload: float | None
    """Part of the drive's overload budget used, 0..1."""
    target_deg: float | None
    """End of the present set-point plan; None for one without end. [deg]"""
    time_left_s: float | None
    """Time until the plan ends; 0 at rest, None for one without end. [s]"""
    stopping_angle_deg: float | None
    """Way to rest if the key were released or Stop pressed now; of a quick stop under way, its own.
    [deg]"""
    key_lost_angle_deg: float | None
    """Longest way to rest from these values if the page were gone while a key is held: speed setting x
    lease, then the jog-release ramp. [deg]"""
    quick_stop_angle_deg: float | None
    """Way to rest with a quick stop now: rigid, no reaction. [deg]"""
    travel_left_minus_deg: float | None
    """Cable left in the minus direction. [deg]"""
    travel_left_plus_deg: float | None
    """Cable left in the plus direction. [deg]"""
    reach_min_deg: float | None
    """The set-point can go down to this from where it is: an end of travel, or its clearance to a no-go
    sector; of a modulo axis counted on from `pos_ref_deg`, None without a sector. [deg]"""
    reach_max_deg: float | None
    """The set-point can go up to this. [deg]"""
    axis_state: Literal[
        "disabled",
        "standstill",
        "homing",
        "discrete_motion",
        "continuous_motion",
        "synchronized_motion",
        "stopping",
        "error_stop",
    ]
    """PLCopen axis state."""
    drive_state: Literal[
        "unknown",
        "not_ready_to_switch_on",
        "switch_on_disabled",
        "ready_to_switch_on",
        "switched_on",
        "operation_enabled",
        "quick_stop_active",
        "fault_reaction_active",
        "fault",
    ]
    """CiA 402 state of the drive."""
    power_phase: Literal[
        "off",
        "enabling",
        "proving",
        "settling",
        "releasing",
        "sag_watch",
        "on",
        "closing",
        "unloading",
        "disabling",
        "parked",
        "quick_stopping",
        "torque_off",
        "torque_hold",
        "testing",
    ]
    """Phase of the power sequence."""
    power: bool
    """Power is on: the axis follows commands."""
    brake_open: bool | None
    """Brake feedback contact; None while it is not heard."""
    brake_open_cmd: bool
    """Brake release command."""
    horn: bool
    """The load moves, or has moved, without a command: people must leave."""
    at_rest: bool
    """The set-point is at rest and no motion waits."""
    in_position: bool
    """At rest within the window for the dwell time."""
    torque_limited: bool
    """The drive is at its torque limit."""
    position_valid: bool
    """The encoder's angle is valid."""
    estop_ok: bool
    """Emergency-stop chain closed."""
    enabling_switch: bool
    """Enabling switch pressed; see `speed_cap_deg_s`."""
    limit_minus_ok: bool
    """Limit switch minus not reached."""
    limit_plus_ok: bool
    """Limit switch plus not reached."""
    mains_ready: bool
    """Mains ready."""
    collision_ok: bool | None
    """Collision interlock closed; None where it is not fitted."""
    door_ok: bool | None
    """Room door closed; None where it is not fitted."""
    motion_permit: bool | None
    """The room permits motion; None where it is not fitted."""
    estop_ok_2: bool | None
    """Second channel of the emergency-stop chain closed; None without one."""
    lease_left_ms: float
    """Time left of the hold-to-run lease; 0 without one. [ms]"""
    round_trip_ms: float | None
    """From the controller to the screen that has control and back, shortest of the last 2 s; None
    without one. No key is pressed above 150 ms. [ms]"""
    alarm_count: int
    """Active alarms."""
    refusal_count: int
    """Commands refused by the program since the start."""
    feedback_age_ms: float
    """Age of the drive's process data (TPDO) in this scan. [ms]"""
    heartbeat_age_ms: float | None
    """Age of the drive's last heartbeat; None without a bus. [ms]"""
    bus_missed: int | None
    """Telegrams of the drive that were missing (all TPDOs); None without a bus."""
    bus_late: int | None
    """Those that came after the scan had stopped waiting; None without a bus."""
    bus_duplicated: int | None
    """Those that came twice for one SYNC; None without a bus."""
    bus_wrong_length: int | None
    """Those of another length than was mapped; None without a bus."""
    bus_contradicted: int | None
    """Those that contradict another of the same SYNC; None without a bus."""
    bus_refused: int | None
    """Frames that the bus did not take; None without a bus."""
    bus_others: int | None
    """Frames of others on the bus; None without a bus."""
    scan_period_ms: float
    """Nominal scan period. [ms]"""
    scan_lateness_p50_us: float | None
    """Lateness of the scans of the last 10 s, median. [us]"""
    scan_lateness_p99_us: float | None
    """The same, 99 % are below. [us]"""
    scan_lateness_max_us: float | None
    """The latest scan since the start. [us]"""
    scan_lateness_p99_deg: float | None
    """The same 99 % as an angle at the highest speed. [deg]"""
    scan_lateness_max_deg: float | None
    """The latest scan as an angle at the highest speed. [deg]"""
    scan_run_p50_us: float | None
    """Time a scan takes, median of the last 10 s. [us]"""
    scan_run_p99_us: float | None
    """The same, 99 % are below. [us]"""
    scan_overruns: int
    """Scans that ended after the next one was due."""
    scan_skipped: int
    """Deadlines that passed without a scan."""
    real_time: bool
    """SCHED_FIFO and locked memory were granted."""
    journal_sequence: int
    """Events handed to the journal by the controller."""
    journal_committed: int
    """The last of them that is safe on the disk."""
    journal_state: Literal["ok", "slow", "full", "failed", "locked"]
    """Health of the journal; anything but ok or slow refuses new motion."""
    recording: bool
    """A trace is being recorded."""
    trace_rows_lost: int
    """Rows that found no place in the trace ring."""
    events_lost: int
    """Events of the controller that found no place in the event ring."""
    authority_user: str
    """Holder of control; empty without one."""
    authority_client: str
    """Client id of the holder; `welcome.client` is your own."""
    authority_local: bool
    """The holder sits at the local console."""
    unheld_power_left_s: float | None
    """Time at rest until power is switched off because nobody has control; None while that does not
    count. [s]"""
    mode: Literal["none", "continuous", "incremental"]
    """Motion mode; changes at standstill only."""
    speed_setting_deg_s: float
    """Speed of moves, keys and increments. [deg/s]"""
    increment_deg: float
    """One increment. [deg]"""
    override_percent: float
    """Speed override, 0..100. [%]"""
    acc_setting_deg_s2: float
    """Acceleration and deceleration of normal motion. [deg/s2]"""
    armed_action: Literal["none", "brake_test", "reset_locked", "commission"]
    """The armed action: the next step executes it."""
    armed_step: str
    """`key` of the armed step of commissioning; empty with anything else."""
    armed_by: str
    """User who armed it; empty with nothing armed."""
    armed_person: str
    """Person whose account that is; empty with nothing armed."""
    armed_client: str
    """Client id of the user who armed it."""
    armed_left_s: float
    """Time until the arming ends; 0 with nothing armed. [s]"""
    second_person: bool
    """Another person than the one who armed must execute."""
    reset_locked: bool
    """A reset now meets something locked: it needs the service role, and `arm` first."""
    commissioning_available: bool
    """This machine has a drive that is commissioned."""
    commissioning: Literal["none", "setting_up", "waiting", "running", "ending"]
    """What commissioning does; `none` while the controller has the axis. Else no program runs:
    `axis_state` is disabled, and what the drive shows is told during a step only."""
    commissioning_step: str
    """Key of the step under way; empty without one."""
    commissioning_left_s: float | None
    """Time until that step ends, about; None without one. [s]"""
    commissioning_results: int
    """Read `/commissioning` again when it changes."""
    brake_test_available: bool
    """This machine can test its brake."""
    brake_test_blocked: str
    """Why it cannot be tested here; empty when it can."""
    brake_test_blocked_messages: list[Message]
    """The same as words and values."""
    brake_test_phase: Literal[
        "idle",
        "enabling",
        "plus_rising",
        "plus_held",
        "minus_rising",
        "minus_held",
        "relieving",
        "disabling",
    ]
    """Phase of the brake test; idle without one."""
    brake_test_left_s: float
    """Time until the test under way ends; 0 without one. [s]"""
    brake_test_torque_nm: float | None
    """Torque that the test puts on the brake now; the motor's own is `torque_act_nm`. [N m]"""
    brake_test_moved_deg: float | None
    """Farthest way during the test under way or the last one. [deg]"""
    brake_test_level_nm: float
    """Torque that the closed brake must hold, both ways. [N m]"""
    brake_test_limit_deg: float | None
    """The axis may move this far under it. [deg]"""
    brake_test_result: Literal["none", "passed", "failed", "aborted"]
    """How the last test ended; aborted ones show nothing."""
    brake_tests: int
    """Tests that have ended since the controller started."""
    brake_test_text: str
    """What the last test measured, in one sentence."""
    brake_test_messages: list[Message]
    """The same as words and values, without the outcome."""
    brake_test_plus_nm: float | None
    """Torque on the brake in the plus direction, mean while held; None when it was not held. [N m]"""
    brake_test_minus_nm: float | None
    """The same in the minus direction. [N m]"""
    brake_tested_at: str
    """Date and time (UTC) of the last test that passed or failed; empty when there was none."""
    brake_test_due_at: str
    """The next test is due then (UTC) at the latest; empty where it cannot be tested or never was."""
    brake_test_cycles_left: int | None
    """It is due after so many power-ups at the latest; None where it cannot be tested."""
    brake_test_overdue: bool
    """It is overdue: slow motion only."""
    speed_min_deg_s: float
    """Lowest speed setting. [deg/s]"""
    speed_max_deg_s: float
    """Highest speed setting. [deg/s]"""
    speed_cap_deg_s: float | None
    """Keys and increments above this need the enabling switch. [deg/s]"""
    quick_dec_deg_s2: float
    """Deceleration of a quick stop: as set, or as measured of a drive with a ramp of its own.
    [deg/s2]"""
    moment_max_nm: float
    """Moment at the axis that the motor's largest torque holds. [N m]"""
    acc_min_deg_s2: float
    """Lowest acceleration setting. [deg/s2]"""
    acc_max_deg_s2: float
    """Highest acceleration setting, that of the machine file. [deg/s2]"""
    increment_max_deg: float
    """Largest increment. [deg]"""
    pos_min_deg: float
    """The set-point never passes this; of a modulo axis, the begin of its turn. [deg]"""
    pos_max_deg: float
    """The set-point never passes this. [deg]"""
    over_travel_min_deg: float | None
    """A measured angle below this trips; a modulo axis has no ends: None. [deg]"""
    over_travel_max_deg: float | None
    """A measured angle above this trips. [deg]"""
    limit_switch_min_deg: float | None
    """The lower limit switch stands there. [deg]"""
    limit_switch_max_deg: float | None
    """The upper limit switch stands there. [deg]"""
    mechanical_stop_min_deg: float | None
    """The lower mechanical stop stands there. [deg]"""
    mechanical_stop_max_deg: float | None
    """The upper mechanical stop stands there. [deg]"""
    following_error_trip_deg: float
    """Following error that stops the axis, at this speed. [deg]"""
    torque_rated_nm: float
    """Rated motor torque. [N m]"""
    torque_max_nm: float
    """Motor torque limit. [N m]"""
    machine: str
    """Name of the machine."""
    axis_kind: str
    """linear, or modulo: turns without end."""
    display: str
    """How people read and type angles: -180..180 or 0..360; tags and commands are signed angles of the
    axis."""
    no_go_deg: list[list[float]]
    """No-go sectors, from and to; of a modulo axis in every turn. [deg]"""
    drawing: str
    """What the page draws: couch, an axis that turns around one, or axis."""
    drive_kind: str
    """sim, ideal or canopen."""
    config_hash: str
    """Short hash of the machine file in force."""
    version: str
    """Version of gantryctl."""
    blocked_by: str
    """Why power cannot be switched on; empty when it can."""
    blocked_by_messages: list[Message]
    """The same as codes and values (see below)."""
    eccentric_moment_nm: float | None
    """Eccentric moment at the load, learned from the torque; None until learned. [N m]"""
    eccentric_angle_deg: float | None
    """Where it would come to rest by itself; None until learned. [deg]"""
    refusal_text: str
    """The last command that the program refused, and why."""
    refusal_messages: list[Message]
    """The same as code and values."""
    alarms: list[AlarmRow]
    """Active alarms, the first-out first (rows below)."""
    alarm_history: list[AlarmRow]
    """The last 50 alarms, newest first (rows below)."""

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Tags:
        """Make them of what the service sends; tags that this version does not know are left out.

        Raises:
            DeviceError: the service lacks one: it is of another version.
        """
        try:
            return cls(**{name: values[name] for name in _names()})
        except KeyError as missing:
            version = values.get("version", "unknown")
            raise DeviceError(f"the service has no tag {missing}: it is of version {version}") from None


@cache
def _names() -> tuple[str, ...]:
    return tuple(field.name for field in fields(Tags))
