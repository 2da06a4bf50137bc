// Written by tools/page_tables.py; do not edit, a test compares.

/** A code or words with values, a reason against power, or a text that has none. */
export type Message =
  | { code: string; values: Values }
  | { reason: string; values: Values }
  | { words: string; values: Values }
  | string;
export type Values = Record<string, number | Message | Message[]>;

export interface AlarmRow {
  /** number of the alarm since the controller started */
  id: number;
  /** stable code, e.g. CTL-03 */
  code: string;
  /** INFO, WARNING, REFUSED or STOP */
  severity: string;
  /** two or three words */
  title: string;
  /** what was measured against which limit */
  measured: string;
  /** what was measured, as values: the fields of the message of `code`, angles as people read them */
  values: Values;
  /** what gantryctl did about it */
  done: string;
  /** the same as words and values */
  steps: Message[];
  /** what to do */
  to_do: string;
  /** what it means */
  cause: string;
  /** the whole line */
  text: string;
  /** date and time, UTC */
  at: string;
  /** time of the scan */
  time_s: number;
  /** angle at the alarm, null where its reading was not believed */
  pos_act_deg: number | null;
  /** still latched or present */
  active: boolean;
  /** it stopped the axis */
  first_out: boolean;
  /** code of the first-out alarm that it follows, or empty */
  follows: string;
  /** only service may reset it */
  lock: boolean;
  /** who has seen it, or empty */
  acknowledged_by: string;
}

export interface Tags {
  /** Time since the start at which the controller issued these values. [ms] */
  issued_ms: number | null;
  /** Command epoch. Commands of another epoch are refused. */
  epoch: number | null;
  /** Scans since the controller started. */
  scan: number | null;
  /** Nominal time of the scan since the controller started. [s] */
  time_s: number | null;
  /** Measured angle, motor side; null while it is not believed. [deg] */
  pos_act_deg: number | null;
  /** Measured speed, motor side; null while it is not believed. [deg/s] */
  vel_act_deg_s: number | null;
  /** Set-point angle. [deg] */
  pos_ref_deg: number | null;
  /** Set-point speed. [deg/s] */
  vel_ref_deg_s: number | null;
  /** Set-point acceleration. [deg/s2] */
  acc_ref_deg_s2: number | null;
  /** Speed command to the drive, at the load. [deg/s] */
  vel_cmd_deg_s: number | null;
  /** Following error: set-point minus measured angle. [deg] */
  pos_err_deg: number | null;
  /** Motor torque that the drive reports. [N m] */
  torque_act_nm: number | null;
  /** Motor torque expected from the motion so far (learned); null until learned. [N m] */
  torque_expected_nm: number | null;
  /** Part of the drive's overload budget used, 0..1. */
  overload: number | null;
  /** End of the present set-point plan; null for one without end. [deg] */
  target_deg: number | null;
  /** Time until the plan ends; 0 at rest, null for one without end. [s] */
  time_left_s: number | null;
  /** Way to rest if the key were released or Stop pressed now; of a quick stop under way, its own. [deg] */
  stopping_angle_deg: number | null;
  /** Longest way to rest from these values if the page were gone while a key is held: speed setting x lease, then the jog-release ramp. [deg] */
  key_lost_angle_deg: number | null;
  /** Way to rest with a quick stop now: rigid, no reaction. [deg] */
  quick_stop_angle_deg: number | null;
  /** Cable left in the minus direction. [deg] */
  travel_left_minus_deg: number | null;
  /** Cable left in the plus direction. [deg] */
  travel_left_plus_deg: number | null;
  /** The set-point can go down to this from where it is: an end of travel, or its clearance to a no-go sector; of a modulo axis counted on from `pos_ref_deg`, null without a sector. [deg] */
  reach_min_deg: number | null;
  /** The set-point can go up to this. [deg] */
  reach_max_deg: number | null;
  /** PLCopen axis state. */
  axis_state: 'disabled' | 'standstill' | 'homing' | 'discrete_motion' | 'continuous_motion' | 'synchronized_motion' | 'stopping' | 'error_stop' | null;
  /** CiA 402 state of the drive. */
  drive_state: 'unknown' | 'not_ready_to_switch_on' | 'switch_on_disabled' | 'ready_to_switch_on' | 'switched_on' | 'operation_enabled' | 'quick_stop_active' | 'fault_reaction_active' | 'fault' | null;
  /** Phase of the power sequence. */
  power_phase: 'off' | 'enabling' | 'proving' | 'settling' | 'releasing' | 'sag_watch' | 'on' | 'closing' | 'unloading' | 'disabling' | 'parked' | 'quick_stopping' | 'torque_off' | 'torque_hold' | 'testing' | null;
  /** Power is on: the axis follows commands. */
  power: boolean | null;
  /** Brake feedback contact; null while it is not heard. */
  brake_open: boolean | null;
  /** Brake release command. */
  brake_open_cmd: boolean | null;
  /** The load moves, or has moved, without a command: people must leave. */
  horn: boolean | null;
  /** The set-point is at rest and no motion waits. */
  at_rest: boolean | null;
  /** At rest within the window for the dwell time. */
  in_position: boolean | null;
  /** The drive is at its torque limit. */
  torque_limited: boolean | null;
  /** The encoder's angle is valid. */
  position_valid: boolean | null;
  /** Emergency-stop chain closed. */
  estop_ok: boolean | null;
  /** Enabling switch pressed; see `speed_cap_deg_s`. */
  enabling_switch: boolean | null;
  /** Limit switch minus not reached. */
  limit_minus_ok: boolean | null;
  /** Limit switch plus not reached. */
  limit_plus_ok: boolean | null;
  /** Mains ready. */
  mains_ready: boolean | null;
  /** Collision interlock closed; null where it is not fitted. */
  collision_ok: boolean | null;
  /** Room door closed; null where it is not fitted. */
  door_ok: boolean | null;
  /** The room permits motion; null where it is not fitted. */
  motion_permit: boolean | null;
  /** Second channel of the emergency-stop chain closed; null without one. */
  estop_ok_2: boolean | null;
  /** Time left of the hold-to-run lease; 0 without one. [ms] */
  lease_left_ms: number | null;
  /** From the controller to the screen that has control and back, shortest of the last 2 s; null without one. No key is pressed above 150 ms. [ms] */
  round_trip_ms: number | null;
  /** Active alarms. */
  alarm_count: number | null;
  /** Commands refused by the program since the start. */
  refusal_count: number | null;
  /** Age of the drive's process data (TPDO) in this scan. [ms] */
  feedback_age_ms: number | null;
  /** Age of the drive's last heartbeat; null without a bus. [ms] */
  heartbeat_age_ms: number | null;
  /** Telegrams of the drive that were missing (all TPDOs); null without a bus. */
  bus_missed: number | null;
  /** Those that came after the scan had stopped waiting; null without a bus. */
  bus_late: number | null;
  /** Those that came twice for one SYNC; null without a bus. */
  bus_duplicated: number | null;
  /** Those of another length than was mapped; null without a bus. */
  bus_wrong_length: number | null;
  /** Those that contradict another of the same SYNC; null without a bus. */
  bus_contradicted: number | null;
  /** Frames that the bus did not take; null without a bus. */
  bus_refused: number | null;
  /** Frames of others on the bus; null without a bus. */
  bus_others: number | null;
  /** Nominal scan period. [ms] */
  scan_period_ms: number | null;
  /** Lateness of the scans of the last 10 s, median. [us] */
  scan_lateness_p50_us: number | null;
  /** The same, 99 % are below. [us] */
  scan_lateness_p99_us: number | null;
  /** The latest scan since the start. [us] */
  scan_lateness_max_us: number | null;
  /** The same 99 % as an angle at the highest speed. [deg] */
  scan_lateness_p99_deg: number | null;
  /** The latest scan as an angle at the highest speed. [deg] */
  scan_lateness_max_deg: number | null;
  /** Time a scan takes, median of the last 10 s. [us] */
  scan_run_p50_us: number | null;
  /** The same, 99 % are below. [us] */
  scan_run_p99_us: number | null;
  /** Scans that ended after the next one was due. */
  scan_overruns: number | null;
  /** Deadlines that passed without a scan. */
  scan_skipped: number | null;
  /** SCHED_FIFO and locked memory were granted. */
  real_time: boolean | null;
  /** Events handed to the journal by the controller. */
  journal_sequence: number | null;
  /** The last of them that is safe on the disk. */
  journal_committed: number | null;
  /** Health of the journal; anything but ok or slow refuses new motion. */
  journal_state: 'ok' | 'slow' | 'full' | 'failed' | 'locked' | null;
  /** A trace is being recorded. */
  recording: boolean | null;
  /** Rows that found no place in the trace ring. */
  trace_rows_lost: number | null;
  /** Events of the controller that found no place in the event ring. */
  events_lost: number | null;
  /** Holder of control; empty without one. */
  authority_user: string | null;
  /** Client id of the holder; `welcome.client` is your own. */
  authority_client: string | null;
  /** The holder sits at the local console. */
  authority_local: boolean | null;
  /** Time at rest until power is switched off because nobody has control; null while that does not count. [s] */
  unheld_power_left_s: number | null;
  /** Motion mode; changes at standstill only. */
  mode: 'none' | 'continuous' | 'incremental' | null;
  /** Speed of moves, keys and increments. [deg/s] */
  speed_setting_deg_s: number | null;
  /** One increment. [deg] */
  increment_deg: number | null;
  /** Speed override, 0..100. [%] */
  override_percent: number | null;
  /** Acceleration and deceleration of normal motion. [deg/s2] */
  acc_setting_deg_s2: number | null;
  /** The armed action: the next step executes it. */
  armed_action: 'none' | 'brake_test' | 'reset_locked' | 'commission' | null;
  /** `key` of the armed step of commissioning; empty with anything else. */
  armed_step: string | null;
  /** User who armed it; empty with nothing armed. */
  armed_by: string | null;
  /** Person whose account that is; empty with nothing armed. */
  armed_person: string | null;
  /** Client id of the user who armed it. */
  armed_client: string | null;
  /** Time until the arming ends; 0 with nothing armed. [s] */
  armed_left_s: number | null;
  /** Another person than the one who armed must execute. */
  second_person: boolean | null;
  /** A reset now meets something locked: it needs the service role, and `arm` first. */
  reset_locked: boolean | null;
  /** This machine has a drive that is commissioned. */
  commissioning_available: boolean | null;
  /** What commissioning does; `none` while the controller has the axis. Else no program runs: `axis_state` is disabled, and what the drive shows is told during a step only. */
  commissioning: 'none' | 'setting_up' | 'waiting' | 'running' | 'ending' | null;
  /** Key of the step under way; empty without one. */
  commissioning_step: string | null;
  /** Time until that step ends, about; null without one. [s] */
  commissioning_left_s: number | null;
  /** Read `/commissioning` again when it changes. */
  commissioning_results: number | null;
  /** This machine can test its brake. */
  brake_test_available: boolean | null;
  /** Why it cannot be tested here; empty when it can. */
  brake_test_blocked: string | null;
  /** The same as words and values. */
  brake_test_blocked_messages: Message[] | null;
  /** Phase of the brake test; idle without one. */
  brake_test_phase: 'idle' | 'enabling' | 'plus_rising' | 'plus_held' | 'minus_rising' | 'minus_held' | 'relieving' | 'disabling' | null;
  /** Time until the test under way ends; 0 without one. [s] */
  brake_test_left_s: number | null;
  /** Torque that the test puts on the brake now; the motor's own is `torque_act_nm`. [N m] */
  brake_test_torque_nm: number | null;
  /** Farthest way during the test under way or the last one. [deg] */
  brake_test_moved_deg: number | null;
  /** Torque that the closed brake must hold, both ways. [N m] */
  brake_test_level_nm: number | null;
  /** The axis may move this far under it. [deg] */
  brake_test_limit_deg: number | null;
  /** How the last test ended; aborted ones show nothing. */
  brake_test_result: 'none' | 'passed' | 'failed' | 'aborted' | null;
  /** Tests that have ended since the controller started. */
  brake_tests: number | null;
  /** What the last test measured, in one sentence. */
  brake_test_text: string | null;
  /** The same as words and values, without the outcome. */
  brake_test_messages: Message[] | null;
  /** Torque on the brake in the plus direction, mean while held; null when it was not held. [N m] */
  brake_test_plus_nm: number | null;
  /** The same in the minus direction. [N m] */
  brake_test_minus_nm: number | null;
  /** Date and time (UTC) of the last test that passed or failed; empty when there was none. */
  brake_tested_at: string | null;
  /** The next test is due then (UTC) at the latest; empty where it cannot be tested or never was. */
  brake_test_due_at: string | null;
  /** It is due after so many power-ups at the latest; null where it cannot be tested. */
  brake_test_cycles_left: number | null;
  /** It is overdue: slow motion only. */
  brake_test_overdue: boolean | null;
  /** Lowest speed setting. [deg/s] */
  speed_min_deg_s: number | null;
  /** Highest speed setting. [deg/s] */
  speed_max_deg_s: number | null;
  /** Keys and increments above this need the enabling switch. [deg/s] */
  speed_cap_deg_s: number | null;
  /** Deceleration of a quick stop: as set, or as measured of a drive with a ramp of its own. [deg/s2] */
  quick_dec_deg_s2: number | null;
  /** Moment at the axis that the motor's largest torque holds. [N m] */
  moment_max_nm: number | null;
  /** Lowest acceleration setting. [deg/s2] */
  acc_min_deg_s2: number | null;
  /** Highest acceleration setting, that of the machine file. [deg/s2] */
  acc_max_deg_s2: number | null;
  /** Largest increment. [deg] */
  increment_max_deg: number | null;
  /** The set-point never passes this; of a modulo axis, the begin of its turn. [deg] */
  pos_min_deg: number | null;
  /** The set-point never passes this. [deg] */
  pos_max_deg: number | null;
  /** A measured angle below this trips; a modulo axis has no ends: null. [deg] */
  over_travel_min_deg: number | null;
  /** A measured angle above this trips. [deg] */
  over_travel_max_deg: number | null;
  /** The lower limit switch stands there. [deg] */
  limit_switch_min_deg: number | null;
  /** The upper limit switch stands there. [deg] */
  limit_switch_max_deg: number | null;
  /** The lower mechanical stop stands there. [deg] */
  mechanical_stop_min_deg: number | null;
  /** The upper mechanical stop stands there. [deg] */
  mechanical_stop_max_deg: number | null;
  /** Following error that stops the axis, at this speed. [deg] */
  following_error_trip_deg: number | null;
  /** Rated motor torque. [N m] */
  torque_rated_nm: number | null;
  /** Motor torque limit. [N m] */
  torque_max_nm: number | null;
  /** Name of the machine. */
  machine: string | null;
  /** linear, or modulo: turns without end. */
  axis_kind: string | null;
  /** How people read and type angles: -180..180 or 0..360; tags and commands are signed angles of the axis. */
  display: string | null;
  /** No-go sectors, from and to; of a modulo axis in every turn. [deg] */
  no_go_deg: [number, number][] | null;
  /** What the page draws: couch, an axis that turns around one, or axis. */
  drawing: string | null;
  /** sim, ideal or canopen. */
  drive_kind: string | null;
  /** Short hash of the machine file in force. */
  config_hash: string | null;
  /** Version of gantryctl. */
  version: string | null;
  /** Why power cannot be switched on; empty when it can. */
  blocked_by: string | null;
  /** The same as codes and values (see below). */
  blocked_by_messages: Message[] | null;
  /** Eccentric moment at the load, learned from the torque; null until learned. [N m] */
  eccentric_moment_nm: number | null;
  /** Where it would come to rest by itself; null until learned. [deg] */
  eccentric_angle_deg: number | null;
  /** The last command that the program refused, and why. */
  refusal_text: string | null;
  /** The same as code and values. */
  refusal_messages: Message[] | null;
  /** Active alarms, the first-out first (rows below). */
  alarms: AlarmRow[] | null;
  /** The last 50 alarms, newest first (rows below). */
  alarm_history: AlarmRow[] | null;
}

export type Role = 'viewer' | 'operator' | 'physicist' | 'service' | 'admin';
export type Action = 'view' | 'stop' | 'quick_stop' | 'authority' | 'take_over' | 'power' | 'mode' | 'jog' | 'move' | 'halt' | 'reset' | 'acknowledge' | 'set_speed' | 'set_increment' | 'set_override' | 'set_acceleration' | 'note' | 'brake_test' | 'reset_locked' | 'commission' | 'traces' | 'journal' | 'users';

/** Who may do what, and whether it needs the control authority. */
export const ROLES: Role[] = ["viewer", "operator", "physicist", "service", "admin"];
export const RIGHTS: { action: Action; what: string; roles: Role[]; control: boolean }[] = [
  { action: 'view', what: "see everything that the page shows", roles: ["viewer", "operator", "physicist", "service", "admin"], control: false },
  { action: 'stop', what: "Stop: jog-release ramp", roles: ["viewer", "operator", "physicist", "service", "admin"], control: false },
  { action: 'quick_stop', what: "quick stop: ErrorStop afterwards", roles: ["viewer", "operator", "physicist", "service", "admin"], control: false },
  { action: 'authority', what: "take control when it is free, give it back", roles: ["operator", "physicist", "service"], control: false },
  { action: 'take_over', what: "take control over from somebody, at standstill", roles: ["operator", "physicist", "service"], control: false },
  { action: 'power', what: "power on and off", roles: ["operator", "physicist", "service"], control: true },
  { action: 'mode', what: "choose the motion mode, at standstill", roles: ["operator", "physicist", "service"], control: true },
  { action: 'jog', what: "forward and reverse keys, increments", roles: ["operator", "physicist", "service"], control: true },
  { action: 'move', what: "move to an angle", roles: ["operator", "physicist", "service"], control: true },
  { action: 'halt', what: "stop on the normal ramp", roles: ["operator", "physicist", "service"], control: true },
  { action: 'reset', what: "reset alarms that are not locked", roles: ["operator", "physicist", "service"], control: true },
  { action: 'acknowledge', what: "acknowledge an alarm as seen", roles: ["operator", "physicist", "service"], control: false },
  { action: 'set_speed', what: "speed setting", roles: ["operator", "physicist", "service"], control: true },
  { action: 'set_increment', what: "increment setting", roles: ["operator", "physicist", "service"], control: true },
  { action: 'set_override', what: "speed override", roles: ["operator", "physicist", "service"], control: true },
  { action: 'set_acceleration', what: "acceleration setting, up to that of the machine file", roles: ["physicist", "service"], control: true },
  { action: 'note', what: "write into the shift log", roles: ["operator", "physicist", "service"], control: false },
  { action: 'brake_test', what: "brake test", roles: ["physicist", "service"], control: true },
  { action: 'reset_locked', what: "reset alarms that are locked", roles: ["service"], control: true },
  { action: 'commission', what: "commission the drive, step by step", roles: ["service"], control: true },
  { action: 'traces', what: "list and download recordings", roles: ["operator", "physicist", "service"], control: false },
  { action: 'journal', what: "export the journal", roles: ["physicist", "service", "admin"], control: false },
  { action: 'users', what: "users (on the command line)", roles: ["admin"], control: false },
];

/** Commands with the keys that are theirs; the link adds type, seq, frame and epoch. */
export interface Commands {
  acknowledge: { id: number };
  alive: Record<string, never>;
  arm: { action: 'brake_test' | 'reset_locked' | 'commission'; step?: string };
  commission_begin: Record<string, never>;
  mode: { mode: 'none' | 'continuous' | 'incremental' };
  commission_end: Record<string, never>;
  give: Record<string, never>;
  halt: Record<string, never>;
  increment: { direction: 'forward' | 'reverse' };
  jog: { lease: string; direction: 'forward' | 'reverse' };
  move: { target_deg: number; direction?: 'shortest' | 'positive' | 'negative' | 'current' };
  move_by: { distance_deg: number };
  power: { on: boolean };
  quick_stop: Record<string, never>;
  release: { lease: string };
  renew: { lease: string };
  reset: Record<string, never>;
  commission_step: { step: string };
  set: { tag: 'speed_setting_deg_s' | 'increment_deg' | 'override_percent' | 'acc_setting_deg_s2'; value: number };
  brake_test: Record<string, never>;
  stop: Record<string, never>;
  take: { over: boolean };
  note: { line: string };
}

/** Never too late: sent without an epoch. */
export const WITHOUT_EPOCH = new Set<keyof Commands>(["alive", "quick_stop", "release", "stop", "note"]);
