// Written by tools/page_tables.py; do not edit, a test compares.

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
  /** what gantryctl did about it */
  done: string;
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
  /** angle at the alarm */
  pos_act_deg: number;
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
  /** Status frame number of the controller, one every 50 ms. Commands echo it. */
  frame: number | null;
  /** Command epoch. Commands of another epoch are refused. */
  epoch: number | null;
  /** Scans since the controller started. */
  scan: number | null;
  /** Nominal time of the scan since the controller started. [s] */
  time_s: number | null;
  /** Measured angle of the gantry, motor side. [deg] */
  pos_act_deg: number | null;
  /** Measured speed of the gantry, motor side. [deg/s] */
  vel_act_deg_s: number | null;
  /** Set-point angle. [deg] */
  pos_ref_deg: number | null;
  /** Set-point speed. [deg/s] */
  vel_ref_deg_s: number | null;
  /** Set-point acceleration. [deg/s2] */
  acc_ref_deg_s2: number | null;
  /** Speed command to the drive, at the gantry. [deg/s] */
  vel_cmd_deg_s: number | null;
  /** Following error: set-point minus measured angle. [deg] */
  pos_err_deg: number | null;
  /** Motor torque that the drive reports. [N m] */
  torque_act_nm: number | null;
  /** Motor torque expected from the motion so far (learned); null until learned. [N m] */
  torque_expected_nm: number | null;
  /** Part of the drive's overload budget used, 0..1. */
  overload: number | null;
  /** Where the present set-point plan ends. [deg] */
  target_deg: number | null;
  /** Until the set-point plan ends; 0 at rest. [s] */
  time_left_s: number | null;
  /** Way to rest if the key were released or Stop pressed now. [deg] */
  stopping_angle_deg: number | null;
  /** Way to rest with a quick stop now: rigid, no reaction. [deg] */
  quick_stop_angle_deg: number | null;
  /** Cable left in the minus direction. [deg] */
  travel_left_minus_deg: number | null;
  /** Cable left in the plus direction. [deg] */
  travel_left_plus_deg: number | null;
  /** PLCopen axis state. */
  axis_state: 'disabled' | 'standstill' | 'homing' | 'discrete_motion' | 'continuous_motion' | 'synchronized_motion' | 'stopping' | 'error_stop' | null;
  /** CiA 402 state of the drive. */
  drive_state: 'unknown' | 'not_ready_to_switch_on' | 'switch_on_disabled' | 'ready_to_switch_on' | 'switched_on' | 'operation_enabled' | 'quick_stop_active' | 'fault_reaction_active' | 'fault' | null;
  /** Where the power sequence is. */
  power_phase: 'off' | 'enabling' | 'proving' | 'settling' | 'releasing' | 'sag_watch' | 'on' | 'closing' | 'unloading' | 'disabling' | 'parked' | 'quick_stopping' | 'torque_off' | 'holding' | 'testing' | null;
  /** Power is on: the axis follows commands. */
  power: boolean | null;
  /** Brake feedback contact. */
  brake_open: boolean | null;
  /** Brake release command. */
  brake_open_cmd: boolean | null;
  /** The set-point is at rest and no motion waits. */
  at_rest: boolean | null;
  /** At rest within the window for the dwell time. */
  in_position: boolean | null;
  /** The drive is at its torque limit. */
  torque_limited: boolean | null;
  /** The encoder can be believed. */
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
  /** What is left of the hold-to-run lease; 0 when none lives. [ms] */
  lease_left_ms: number | null;
  /** Active alarms. */
  alarm_count: number | null;
  /** Commands refused by the program since the start. */
  refusal_count: number | null;
  /** Age of the drive's process data (TPDO) in this scan. [ms] */
  feedback_age_ms: number | null;
  /** Age of the drive's last heartbeat; null without a bus. [ms] */
  heartbeat_age_ms: number | null;
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
  /** Who has control; empty when nobody. */
  authority_user: string | null;
  /** Client id of the holder; `welcome.client` is one's own. */
  authority_client: string | null;
  /** The holder sits at the local console. */
  authority_local: boolean | null;
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
  /** What is armed: the next step executes it. */
  armed_action: 'none' | 'brake_test' | 'reset_locked' | null;
  /** Who armed it; empty when nothing is armed. */
  armed_by: string | null;
  /** Client id of whoever armed it. */
  armed_client: string | null;
  /** How long it stays armed; 0 when nothing is. [s] */
  armed_left_s: number | null;
  /** Another user than the one who armed must execute. */
  second_person: boolean | null;
  /** A reset now meets something locked: it needs the service role, and `arm` first. */
  reset_locked: boolean | null;
  /** This machine can test its brake. */
  brake_test_available: boolean | null;
  /** Why it cannot be tested here; empty when it can. */
  brake_test_blocked: string | null;
  /** Where the brake test is; idle when none is under way. */
  brake_test_phase: 'idle' | 'enabling' | 'plus_rising' | 'plus_held' | 'minus_rising' | 'minus_held' | 'relieving' | 'disabling' | null;
  /** Until the test under way ends; 0 when none is. [s] */
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
  /** The last test in one sentence, with what was measured. */
  brake_test_text: string | null;
  /** Torque on the brake in the plus direction, mean while held; null when it was not held. [N m] */
  brake_test_plus_nm: number | null;
  /** The same in the minus direction. [N m] */
  brake_test_minus_nm: number | null;
  /** Date and time (UTC) of the last test that passed or failed; empty when there was none. */
  brake_tested_at: string | null;
  /** The next test is due then (UTC) at the latest; empty where it cannot be tested or never was. */
  brake_test_due_at: string | null;
  /** It is due after so many power-ups at the latest. */
  brake_test_cycles_left: number | null;
  /** It is overdue: nothing moves faster than 1 deg/s. */
  brake_test_overdue: boolean | null;
  /** Lowest speed setting. [deg/s] */
  speed_min_deg_s: number | null;
  /** Highest speed setting. [deg/s] */
  speed_max_deg_s: number | null;
  /** Keys and increments above this need the enabling switch. [deg/s] */
  speed_cap_deg_s: number | null;
  /** Lowest acceleration setting. [deg/s2] */
  acc_min_deg_s2: number | null;
  /** Highest acceleration setting, that of the machine file. [deg/s2] */
  acc_max_deg_s2: number | null;
  /** Largest increment. [deg] */
  increment_max_deg: number | null;
  /** The set-point never passes this. [deg] */
  pos_min_deg: number | null;
  /** The set-point never passes this. [deg] */
  pos_max_deg: number | null;
  /** The measured angle trips beyond +- this. [deg] */
  over_travel_deg: number | null;
  /** Limit switches stand at +- this. [deg] */
  limit_switch_deg: number | null;
  /** Mechanical stops stand at +- this. [deg] */
  mechanical_stop_deg: number | null;
  /** Following error that stops the axis, at this speed. [deg] */
  following_error_trip_deg: number | null;
  /** Motor torque for ever. [N m] */
  torque_rated_nm: number | null;
  /** Motor torque limit. [N m] */
  torque_max_nm: number | null;
  /** Name of the machine. */
  machine: string | null;
  /** sim, ideal or canopen. */
  drive_kind: string | null;
  /** Short hash of the machine file in force. */
  config_hash: string | null;
  /** Version of gantryctl. */
  version: string | null;
  /** Why power cannot be switched on; empty when it can. */
  blocked_by: string | null;
  /** Eccentric moment at the gantry, learned from the torque; null until learned. [N m] */
  eccentric_moment_nm: number | null;
  /** Where it would come to rest by itself; null until learned. [deg] */
  eccentric_angle_deg: number | null;
  /** The last command that the program refused, and why. */
  refusal_text: string | null;
  /** Active alarms, the first-out first (rows below). */
  alarms: AlarmRow[] | null;
  /** The last 50 alarms, newest first (rows below). */
  alarm_history: AlarmRow[] | null;
}

export type Role = 'viewer' | 'operator' | 'physicist' | 'service' | 'admin';
export type Action = 'view' | 'stop' | 'quick_stop' | 'authority' | 'take_over' | 'power' | 'mode' | 'jog' | 'move' | 'halt' | 'reset' | 'acknowledge' | 'set_speed' | 'set_increment' | 'set_override' | 'set_acceleration' | 'brake_test' | 'reset_locked' | 'traces' | 'journal' | 'users';

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
  { action: 'brake_test', what: "brake test", roles: ["physicist", "service"], control: true },
  { action: 'reset_locked', what: "reset alarms that are locked", roles: ["service"], control: true },
  { action: 'traces', what: "list and download recordings", roles: ["operator", "physicist", "service"], control: false },
  { action: 'journal', what: "export the journal", roles: ["physicist", "service", "admin"], control: false },
  { action: 'users', what: "users (on the command line)", roles: ["admin"], control: false },
];

/** Sentences of the service in Chinese: src/gantryctl/service/chinese.py says how they are written. */
export const PHRASES: Record<string, string> = {
  "Position jumped": "位置跳变",
  "Position jumped {measured:.4f} deg in one scan, limit {limit:.4f} deg": "一个扫描周期内位置跳变 {measured}°，限值 {limit}°",
  "The reading changed by more than the axis can move in a scan. The position is not valid any more.": "读数变化超过轴在一个扫描周期内可能的运动。位置不再有效。",
  "Do not reset. Check encoder cable and plug, then call service.": "请勿复位。检查编码器电缆和插头，然后联系维修。",
  "Encoder frozen": "编码器冻结",
  "Encoder value unchanged for {time_ms:.0f} ms while {measured:.2f} deg/s was commanded": "指令为 {measured} °/s 时编码器值 {time_ms} ms 未变化",
  "The encoder, its cable or its evaluation has stopped, or the motor is blocked.": "编码器、其电缆或其信号处理已停止，或电机被卡住。",
  "One bad encoder reading": "一次编码器坏读数",
  "{measured} bad encoder reading, used prediction": "{measured} 次编码器坏读数，已用预测值代替",
  "A reading came with a checksum error. One is bridged; the count is kept.": "一次读数校验错误。单次可以跨越；已计数。",
  "If it comes back: check the encoder cable's screen and plug.": "若再次出现：检查编码器电缆的屏蔽和插头。",
  "Too many bad encoder readings": "编码器坏读数过多",
  "{measured} bad encoder readings within {time_ms:.0f} ms, limit {limit}": "{time_ms} ms 内有 {measured} 次编码器坏读数，限值 {limit}",
  "Checksum errors in a row: cable, screen, plug or encoder.": "连续校验错误：电缆、屏蔽、插头或编码器。",
  "Encoder alarm": "编码器报警",
  "The encoder reports an alarm of its own": "编码器自身报警",
  "Lamp, signal amplitude, position error or supply inside the encoder.": "编码器内部的光源、信号幅值、位置错误或供电。",
  "Do not reset. Read the encoder's alarm word with the drive's tool and call service.": "请勿复位。用驱动器工具读取编码器报警字并联系维修。",
  "Encoder warning": "编码器警告",
  "The encoder reports a warning: lamp reserve, temperature or battery": "编码器发出警告：光源余量、温度或电池",
  "The encoder still measures well, but will not for ever.": "编码器仍测量正常，但不会一直如此。",
  "Plan its service. The axis goes on.": "安排维修。轴继续运行。",
  "Encoders disagree": "编码器不一致",
  "Load-side encoder {measured:.4f} deg away from motor encoder and maps, limit {limit:.4f} deg": "负载侧编码器与电机编码器及误差表相差 {measured}°，限值 {limit}°",
  "One of the two encoders is wrong, the calibration belongs to another machine, or something between motor and ring has slipped or broken.": "两个编码器之一有误、标定属于另一台机器，或电机与齿圈之间有打滑或断裂。",
  "Compare the angle with the marks. Find out which encoder is right before anything moves.": "将角度与刻线比较。在任何运动之前先查明哪个编码器正确。",
  "Heartbeat of the drive lost": "驱动器心跳丢失",
  "The drive's heartbeat is missing": "没有收到驱动器的心跳",
  "The drive is switched off, has crashed, or its cable is open.": "驱动器已关机、死机，或电缆断开。",
  "Check bus cable, terminators and load. Reset with power off, or start again: it sets the drive up anew.": "检查总线电缆、终端电阻和负载。断电后复位或重新启动：驱动器将被重新设置。",
  "Reading too old": "读数过旧",
  "The drive's reading is {measured:.0f} ms old, limit {limit:.0f} ms": "驱动器的读数已有 {measured} ms，限值 {limit} ms",
  "The drive's telegrams come late or not at all.": "驱动器的报文迟到或不来。",
  "Check bus cable, terminators and load, then reset.": "检查总线电缆、终端电阻和负载，然后复位。",
  "Bus down": "总线中断",
  "The CAN controller sends or receives no more": "CAN 控制器不再收发",
  "Bus-off, an open or short cable, or the adapter was unplugged. The drive's own watch stops the axis.": "总线关闭、电缆断路或短路，或适配器被拔下。驱动器自身的监视会使轴停止。",
  "Another master on the bus": "总线上有另一个主站",
  "Telegrams that only this controller may send came from somebody else": "只有本控制器可以发送的报文来自别处",
  "A second controller, or a service tool that takes part in control.": "有第二个控制器，或参与控制的维修工具。",
  "Take it off the bus, then reset.": "将其从总线上移除，然后复位。",
  "Drive not operational": "驱动器不在运行状态",
  "The drive has left the NMT state OPERATIONAL": "驱动器离开了 NMT 状态 OPERATIONAL",
  "The drive lost the controller's heartbeat, or somebody else stopped it.": "驱动器丢失了控制器的心跳，或被他人停止。",
  "Command ignored": "指令被忽略",
  "The drive is enabled and does not follow the speed command (bit 12 of 6041 is 0)": "驱动器已使能但不跟随速度指令（6041 第 12 位为 0）",
  "Local control, a limit inside the drive, or a wrong mode.": "本地控制、驱动器内部限值或模式错误。",
  "Read the drive's own display, remove the cause, then reset.": "查看驱动器自身的显示，排除原因后复位。",
  "Drive parameter changed": "驱动器参数被改变",
  "A parameter of the drive is not what it was set to: {measured}": "驱动器的一个参数不再是设定值：{measured}",
  "Somebody changed it while the drive was run, by a service tool or at the drive itself.": "有人在驱动器运行时用调试工具或在驱动器本体上改变了它。",
  "Find out who. Switch power off and reset: the drive is set up anew. No motion before.": "查明是谁。断电后复位：驱动器将被重新设置。此前不能运动。",
  "Drive restarted": "驱动器重新启动",
  "The drive has restarted by itself": "驱动器自行重新启动",
  "Its supply failed, or somebody reset it. It has forgotten what the controller told it.": "其供电失效，或有人将其复位。它已忘记控制器的设置。",
  "Look for the cause. Reset with power off, or start again: it sets the drive up anew.": "查找原因。断电后复位或重新启动：驱动器将被重新设置。",
  "A value that is no number": "数值不是数",
  "{measured} is not a finite number": "{measured} 不是有限的数",
  "A reading or a computed command was not finite. It never reaches the drive.": "某个读数或计算出的指令不是有限的数。它绝不会到达驱动器。",
  "Keep the trace and report it; reset when the cause is known.": "保存记录并报告；原因清楚后复位。",
  "Following error": "跟随误差",
  "Following error {measured:.3f} deg, limit {limit:.3f} deg at {speed:.2f} deg/s": "{speed} °/s 时跟随误差 {measured}°，限值 {limit}°",
  "The axis does not follow its set-point: load, friction, torque limit or gains.": "轴不跟随设定值：负载、摩擦、转矩限值或增益。",
  "Look at torque and following error in the trace, remove the cause, then reset.": "在记录中查看转矩和跟随误差，排除原因后复位。",
  "Overspeed": "超速",
  "Speed {measured:.2f} deg/s, limit {limit:.2f} deg/s": "速度 {measured} °/s，限值 {limit} °/s",
  "The axis runs faster than it was told: drive scaling, gains, or a load that pushes.": "轴比指令快：驱动器比例、增益，或负载在推动。",
  "Check the drive's speed scaling and ceiling, then reset.": "检查驱动器的速度比例和上限，然后复位。",
  "Moves against command": "运动与指令相反",
  "Speed {measured:.2f} deg/s while {command:.2f} deg/s was commanded, limit of the difference {limit:.2f} deg/s": "指令为 {command} °/s 时速度为 {measured} °/s，差值限值 {limit} °/s",
  "The drive does not obey its speed command: sign, scaling or speed feedback.": "驱动器不服从速度指令：符号、比例或速度反馈。",
  "Do not move again before sign and scaling of the speed have been tested.": "在检验速度的符号和比例之前不要再运动。",
  "Torque saturated": "转矩饱和",
  "Torque limit reached for {time_ms:.0f} ms while the following error grew to {measured:.3f} deg": "转矩达到限值 {time_ms} ms，跟随误差增至 {measured}°",
  "The load needs more torque than the drive may give.": "负载所需转矩超过驱动器允许的转矩。",
  "Check balance, friction and overload of the drive, then reset.": "检查平衡、摩擦和驱动器过载，然后复位。",
  "Standstill lost": "静止丧失",
  "Moved {measured:.4f} deg at standstill, window {limit:.4f} deg": "静止时移动了 {measured}°，窗口 {limit}°",
  "Something moves the axis while it should stand.": "轴应当静止时有东西使它移动。",
  "Check load, brake and drive, then reset.": "检查负载、制动器和驱动器，然后复位。",
  "Stop point beyond travel": "停止点超出行程",
  "From {measured:.2f} deg/s the axis would come to rest at {position:.2f} deg, limit {limit:.2f} deg": "以 {measured} °/s 轴将停在 {position}°，限值 {limit}°",
  "The measured angle and speed would carry the axis over its travel.": "按实测角度和速度，轴将越出行程。",
  "Move back inward at low speed; check why the axis ran ahead of its set-point.": "低速向内移动；查明轴为何超前于设定值。",
  "Not in position": "未到位",
  "Not in position {time_s:.1f} s after the end of the motion: error {measured:.4f} deg, window {limit:.4f} deg": "运动结束后 {time_s} s 仍未到位：误差 {measured}°，窗口 {limit}°",
  "The set-point has arrived, the axis has not: friction, gains or torque.": "设定值已到达而轴没有：摩擦、增益或转矩。",
  "Do not use this angle. Move again; if it comes back, call service.": "不要使用此角度。重新运动；若再次出现，联系维修。",
  "Following error high": "跟随误差偏高",
  "Following error {measured:.3f} deg, warning at {limit:.3f} deg, stop at {trip:.3f} deg": "跟随误差 {measured}°，警告 {limit}°，停机 {trip}°",
  "The axis follows worse than usual.": "轴的跟随比平时差。",
  "Look at the trend in the trace; plan service.": "查看记录中的趋势；安排维修。",
  "Over-travel": "超程",
  "Angle {measured:.2f} deg, limit {limit:.2f} deg": "角度 {measured}°，限值 {limit}°",
  "The measured angle passed the over-travel limit.": "实测角度越过超程限值。",
  "Reset, then move back inward: the way back is open.": "复位，然后向内移动：返回方向是开放的。",
  "Limit switch": "限位开关",
  "The {side} limit switch opened at {measured:.2f} deg": "{side}限位开关在 {measured}° 断开",
  "The axis is at the hardware limit, or the switch's wire is broken.": "轴在硬件限位处，或开关的导线断开。",
  "Reset, then move back inward: the way back is open. Check the switch if the angle is well inside.": "复位，然后向内移动：返回方向是开放的。若角度远在行程之内，请检查开关。",
  "Both limit switches": "两个限位开关",
  "Both limit switches are open at {measured:.2f} deg": "在 {measured}° 两个限位开关都断开",
  "The axis cannot be at both ends: common wire or supply.": "轴不可能同时在两端：公共导线或供电。",
  "Repair the wiring, then reset.": "修复接线，然后复位。",
  "Brake does not release": "制动器未松开",
  "Brake still closed {time_ms:.0f} ms after the release command, limit {limit:.0f} ms": "松开指令后 {time_ms} ms 制动器仍抱紧，限值 {limit} ms",
  "Brake supply, coil or feedback contact.": "制动器供电、线圈或反馈触点。",
  "Check the brake's supply and contact, then reset.": "检查制动器的供电和触点，然后复位。",
  "Brake does not hold": "制动器未抱住",
  "Moved {measured:.4f} deg while the torque was taken off, limit {limit:.4f} deg": "卸除转矩时移动了 {measured}°，限值 {limit}°",
  "The brake slips under the load; the motor holds it.": "制动器在负载下打滑；由电机保持。",
  "Do not switch off. Secure the load and call service.": "不要断电。固定负载并联系维修。",
  "Brake slips": "制动器打滑",
  "Moved {measured:.4f} deg while switched off, limit {limit:.4f} deg": "断电状态下移动了 {measured}°，限值 {limit}°",
  "The closed brake lets the load move; the motor holds it where it can.": "抱紧的制动器让负载移动；可能时由电机保持。",
  "Keep people away. Secure the load and call service.": "人员远离。固定负载并联系维修。",
  "Brake closed in motion": "运动中制动器抱紧",
  "Brake feedback says closed at {measured:.2f} deg/s, following error {error:.3f} deg": "{measured} °/s 时制动器反馈为抱紧，跟随误差 {error}°",
  "Brake supply lost, or the brake command failed.": "制动器失电，或制动器指令失效。",
  "Check the brake's supply and wiring; inspect the brake, then reset.": "检查制动器的供电和接线；检查制动器，然后复位。",
  "Brake feedback contradicts": "制动器反馈矛盾",
  "Brake feedback says {measured} for {time_ms:.0f} ms, commanded {command}": "制动器反馈为{measured}已 {time_ms} ms，指令为{command}",
  "Feedback contact or its wire, or the brake does not do what it is told.": "反馈触点或其导线，或制动器不听从指令。",
  "Check contact and wire, then reset. No motion before.": "检查触点和导线，然后复位。此前不得运动。",
  "Torque not proven": "转矩未验证",
  "Torque {measured:.1f} N m after {time_ms:.0f} ms, at least {limit:.1f} N m wanted before the brake opens": "{time_ms} ms 后转矩为 {measured} N m，制动器松开前至少需要 {limit} N m",
  "The drive is enabled but gives no torque: motor cable, current limit, torque scaling.": "驱动器已使能但没有转矩：电机电缆、电流限值、转矩比例。",
  "The brake stayed closed. Check the motor cable and the drive's torque limit, then reset.": "制动器保持抱紧。检查电机电缆和驱动器的转矩限值，然后复位。",
  "Brake test failed": "制动器测试未通过",
  "Brake test failed: {measured}": "制动器测试未通过：{measured}",
  "The brake slips below its test torque, or the motor does not give it (then nothing moved).": "制动器在测试转矩以下打滑，或电机没有给出转矩（此时没有任何移动）。",
  "Nothing moves until a brake test passes, or service resets. Inspect the brake and the motor's torque.": "在制动器测试通过或维修人员复位之前，一切不能运动。检查制动器和电机转矩。",
  "Sag after release": "松开后下沉",
  "Moved {measured:.4f} deg after the brake opened, limit {limit:.4f} deg": "制动器松开后移动了 {measured}°，限值 {limit}°",
  "The drive does not hold the load: preload, gains or torque limit.": "驱动器没有保持住负载：预加转矩、增益或转矩限值。",
  "The brake was closed again. Check the learned holding torque and the drive's gains, then reset.": "制动器已重新抱紧。检查学习到的保持转矩和驱动器增益，然后复位。",
  "Load still moving": "负载仍在运动",
  "Still {measured:.2f} deg/s, {time_s:.1f} s after torque off and brake": "转矩切断并制动 {time_s} s 后仍为 {measured} °/s",
  "The brake does not stop the load.": "制动器没有使负载停住。",
  "Drive fault": "驱动器故障",
  "The drive reports a fault: {measured}": "驱动器报告故障：{measured}",
  "The drive switched itself off.": "驱动器自行关断。",
  "Read the drive's own fault display, remove the cause, then reset.": "查看驱动器自身的故障显示，排除原因后复位。",
  "Drive warning": "驱动器警告",
  "The drive reports a warning": "驱动器报告警告",
  "Temperature, overload or supply near its limit.": "温度、过载或供电接近限值。",
  "Read the drive's display. The axis goes on.": "查看驱动器的显示。轴继续运行。",
  "Drive stuck": "驱动器卡住",
  "Drive stuck in {measured} for {time_ms:.0f} ms, wanted {command}": "驱动器停留在{measured}已 {time_ms} ms，应为{command}",
  "The drive does not make the step it was asked for: missing release, local control, wrong parameter.": "驱动器没有执行要求的步骤：缺少释放信号、本地控制、参数错误。",
  "Drive lost its enable": "驱动器失去使能",
  "Drive went to {measured} without being asked": "驱动器未经要求进入{measured}",
  "Someone or something else switched the drive off: release input, tool, supply.": "他人或他物关断了驱动器：释放输入、工具、供电。",
  "Quick stop not obeyed": "快速停止未执行",
  "Speed {measured:.2f} deg/s in a quick stop, ramp allows {limit:.2f} deg/s": "快速停止中速度 {measured} °/s，斜坡允许 {limit} °/s",
  "The drive does not brake as set, or its speed feedback is wrong.": "驱动器没有按设定制动，或其速度反馈有误。",
  "Emergency stop": "急停",
  "The emergency-stop chain opened at {measured:.2f} deg": "急停回路在 {measured}° 断开",
  "A button was pressed or the chain is broken. The hardware acts; this mirrors it.": "有人按下按钮或回路断线。硬件自行动作；此处只是反映。",
  "Release the button when it is safe, reset, switch on again.": "安全时松开按钮，复位，重新上电。",
  "Quick stop asked for": "要求快速停止",
  "Quick stop by the operator at {measured:.2f} deg, {speed:.2f} deg/s": "操作员要求快速停止，在 {measured}°、{speed} °/s",
  "The operator asked for it.": "由操作员要求。",
  "Reset, switch on again.": "复位，重新上电。",
  "Mains lost": "主电源丢失",
  "Mains no longer ready at {measured:.2f} deg, {speed:.2f} deg/s": "主电源在 {measured}°、{speed} °/s 时不再就绪",
  "Supply switched off or failed.": "供电被切断或失效。",
  "Restore the supply, reset, switch on again.": "恢复供电，复位，重新上电。",
  "Overload high": "过载偏高",
  "{measured:.0f} % of the drive's overload budget used, warning at {limit:.0f} %": "已用驱动器过载余量的 {measured} %，警告值 {limit} %",
  "More torque than rated for too long.": "转矩超过额定值的时间过长。",
  "Move less or slower; check balance and friction.": "减少运动或降低速度；检查平衡和摩擦。",
  "Value out of range": "数值超限",
  "{name} must be {allowed}, got {measured}": "{name}必须{allowed}，得到 {measured}",
  "A command with a number that cannot be used. Nothing was changed.": "指令中的数不能使用。没有任何改变。",
  "Give a value within the range.": "给出范围内的值。",
  "Target beyond travel": "目标超出行程",
  "target {measured:.2f} deg is beyond {limit:+.2f} deg; you are at {position:.2f} deg, so {left:.2f} deg are left": "目标 {measured}° 超出 {limit}°；当前 {position}°，还剩 {left}°",
  "The axis is linear with a cable: there is no way round.": "轴带电缆，按直线计：没有绕行的路。",
  "Give a target within the travel.": "给出行程内的目标。",
  "Not in this state": "此状态下不允许",
  "The command does not fit what the axis is doing.": "该指令与轴正在做的事不符。",
  "Wait for standstill, or stop first.": "等待静止，或先停止。",
  "Hold-to-run not renewed": "按住运行未续期",
  "hold-to-run was not renewed for {measured:.0f} ms, limit {limit:.0f} ms": "按住运行 {measured} ms 未续期，限值 {limit} ms",
  "The key's signal was lost: window left, connection slow or gone.": "按键信号丢失：离开窗口、连接缓慢或中断。",
  "Release the key and press it again.": "松开按键后重新按下。",
  "Hold-to-run too long": "按住运行过久",
  "the key was held for {measured:.0f} s, limit {limit:.0f} s": "按键已按住 {measured} s，限值 {limit} s",
  "A page that is stuck can go on renewing by itself: nobody is believed to hold a key for longer.": "卡住的页面会自行不断续期：按住更久不再被相信。",
  "No mode chosen": "未选择模式",
  "no motion mode is chosen": "没有选择运动模式",
  "After a start the mode is none and nothing moves.": "启动后模式为“无”，不会有任何运动。",
  "Choose continuous or incremental.": "选择连续或增量模式。",
  "No plan": "无法规划",
  "No motion within the limits leads there from the present state.": "在限值内没有从当前状态到那里的运动。",
  "Wait for standstill and try again.": "等待静止后重试。",
  "End of travel": "行程终点",
  "stopped at {measured:.2f} deg, the end of travel": "停在 {measured}°，行程终点",
  "A motion with a speed only ran to the end of its way.": "只有速度的运动走到了行程尽头。",
  "Move the other way.": "向另一方向移动。",
  "Brake test overdue": "制动器测试逾期",
  "the brake test is overdue: up to {limit:.2f} deg/s only, asked for {measured:.2f} deg/s": "制动器测试逾期：最高 {limit} °/s，要求 {measured} °/s",
  "The brake must be tested from time to time: [brake] test_interval_days, test_interval_power_ups.": "制动器必须定期测试：[brake] test_interval_days、test_interval_power_ups。",
  "Switch power off and test the brake (`gantryctl brake-test`), or move slowly.": "断电并测试制动器，或低速运动。",
  "Only inward": "只能向内",
  "at {measured:.2f} deg only motion {side} is open": "在 {measured}° 只开放{side}运动",
  "The axis is outside its travel or at a limit switch.": "轴在行程之外或在限位开关处。",
  "Move back inward.": "向内移动。",
  "Enabling switch": "使能开关",
  "the enabling switch is off: up to {limit:.2f} deg/s only, asked for {measured:.2f} deg/s": "使能开关断开：最高 {limit} °/s，要求 {measured} °/s",
  "Faster motion by hand or from a remote screen needs the enabling switch, from the start to the end.": "更快的手动运动或远程屏幕的运动自始至终需要使能开关。",
  "Press the enabling switch or lower the speed.": "按下使能开关或降低速度。",
  "Power is off": "动力未接通",
  "power is off": "动力未接通",
  "The axis follows commands only when power is on.": "只有接通动力轴才跟随指令。",
  "Switch power on and wait until it shows on.": "上电并等待显示接通。",
  "Cannot switch on": "不能上电",
  "cannot switch on: {measured}": "不能上电：{measured}",
  "Something that must be right before power is not.": "上电前必须满足的条件未满足。",
  "Remove the cause, then switch on again.": "排除原因后重新上电。",
  "Stopping on the jog-release ramp": "正按松键斜坡停止",
  "Quick stop": "快速停止",
  "Torque off and brake": "转矩切断并制动",
  "Torque kept at zero speed": "保持零速转矩",
  "Nothing was switched on": "没有接通任何部分",
  "at rest after {time:g} ms": "{time} ms 后静止",
  "torque off after {time:g} ms": "{time} ms 后转矩切断",
  "brake closed after {time:g} ms": "{time} ms 后制动器抱紧",
  "gantry moved {way:g} deg to {pos:g} deg": "机架移动 {way}° 至 {pos}°",
  "the angle is not known": "角度未知",
  "{done} (follows {code})": "{done}（由 {code} 引起）",
  "(follows {code})": "（由 {code} 引起）",
  "deg": "°",
  "deg/s": "°/s",
  "deg/s2": "°/s²",
  "{number:g} deg": "{number}°",
  "{number:g} deg/s": "{number} °/s",
  "{number:g} deg/s2": "{number} °/s²",
  "within {low} and {high:g} {unit}": "在 {low} 和 {high} {unit} 之间",
  "within {low:g} and {high:g}": "在 {low} 和 {high} 之间",
  "above 0 and at most {high}": "大于 0 且不超过 {high}",
  "a finite angle": "为有限的角度",
  "speed": "速度",
  "increment": "增量",
  "override": "倍率",
  "acceleration": "加速度",
  "target": "目标",
  "position": "位置",
  "plus": "正",
  "minus": "负",
  "forward": "正向",
  "reverse": "反向",
  "open": "松开",
  "closed": "抱紧",
  "torque reading": "转矩读数",
  "speed reading": "速度读数",
  "encoder count": "编码器计数",
  "speed command {value}": "速度指令 {value}",
  "torque command {value}": "转矩指令 {value}",
  "error {error:g} (hexadecimal {word})": "错误 {error}（十六进制 {word}）",
  "without an error code": "没有错误代码",
  "an unknown state": "未知状态",
  "Not ready to switch on": "“未准备好”状态",
  "Switch on disabled": "“禁止接通”状态",
  "Ready to switch on": "“准备接通”状态",
  "Switched on": "“已接通”状态",
  "Operation enabled": "“运行使能”状态",
  "Quick stop active": "“快速停止中”状态",
  "Fault reaction active": "“故障反应中”状态",
  "Fault": "“故障”状态",
  "the axis is still being switched off": "轴正在断电",
  "{code} is latched ({measured}): reset first": "{code} 已锁存（{measured}）：请先复位",
  "{code} is active ({measured}): {first}": "{code} 有效（{measured}）：{first}",
  "reset first": "请先复位",
  "a brake test must pass, or service must reset": "须先通过制动器测试，或由维修人员复位",
  "a brake test is under way": "正在测试制动器",
  "a brake test is under way already": "已在测试制动器",
  "a brake test begins with power off: switch it off first": "制动器测试须在断电时开始：请先断电",
  "a brake test with {level:g} N m and the load are more than the motor's torque limit": "{level} N m 的制动器测试加上负载超过电机转矩限值",
  "the axis is in ErrorStop by {code} ({measured}): reset first": "轴因 {code} 处于故障停止（{measured}）：请先复位",
  "{code} ({measured}) may be reset by the service role only": "{code}（{measured}）只能由维修角色复位",
  "the emergency-stop chain is open": "急停回路断开",
  "the emergency-stop chain is still open: release it first": "急停回路仍断开：请先松开",
  "the mains are not ready": "主电源未就绪",
  "the drive is in fault or its state is unknown: reset first": "驱动器故障或状态未知：请先复位",
  "the drive keeps its fault: read its display": "驱动器故障仍在：查看其显示",
  "the encoder still reports its alarm: clear it there first": "编码器仍在报警：请先在那里清除",
  "the position is not valid: service must compare the angle and reset": "位置无效：须由维修人员核对角度并复位",
  "the acceleration changes at standstill only": "加速度仅在静止时可改",
  "the mode changes at standstill only": "模式仅在静止时可改",
  "the axis is held by Stop: release it first": "轴被“停止”保持：请先松开",
  "the axis is moving by hand: release the key first": "轴正在手动运动：请先松开按键",
  "the axis is moving: jog from standstill only": "轴在运动：点动只能从静止开始",
  "the axis is moving: increments from standstill only": "轴在运动：增量只能从静止开始",
  "the axis is still stopping: reset when it is at rest": "轴仍在停止：静止后再复位",
  "reversal only from standstill: release and press again": "换向只能从静止开始：松开后重新按下",
  "both keys are pressed: one increment needs one key": "两键同时按下：一次增量只需一个键",
  "Home needs Standstill": "Home 需要静止状态",
  "a new reference needs standstill": "新的参考点需要静止",
  "the encoder would wrap {margin:g} deg from the travel, at least {limit:g} deg wanted": "编码器将在距行程 {margin}° 处回绕，至少需要 {limit}°",
  "the way there would pass {angle:g} deg, outside the travel; stop first": "途中将经过行程之外的 {angle}°；请先停止",
  "not testable here: {why}": "不能在此测试：{why}",
  "[brake] owner = \"{owner}\": the drive works the brake itself and opens it whenever it is enabled; use the drive's own brake test": "[brake] owner = {owner}：制动器由驱动器控制，使能时即松开；请使用驱动器自身的制动器测试",
  "the drive takes no torque beside the speed (60B2, 6077); use the drive's own brake test": "驱动器除速度外不接受转矩（60B2、6077）；请使用驱动器自身的制动器测试",
  "passed: {text}": "通过：{text}",
  "failed: {text}": "未通过：{text}",
  "aborted: {text}": "中止：{text}",
  "{what}, moved {way:g} deg of {limit:g} deg allowed": "{what}，移动 {way}°，允许 {limit}°",
  "held {plus:g} and {minus:g} N m for {time:g} s each": "各保持 {time} s：{plus} 和 {minus} N m",
  "{given:g} N m reached, {wanted:g} N m wanted": "达到 {given} N m，需要 {wanted} N m",
  "{given:g} N m held of {wanted:g} N m": "保持 {given} N m，需要 {wanted} N m",
  "the brake slipped under {given:g} N m": "制动器在 {given} N m 下打滑",
  "the brake slipped when the torque was taken off after the test": "测试后撤去转矩时制动器打滑",
  "the brake's contact says that it is open": "制动器触点显示松开",
  "the torque reading is no number": "转矩读数不是数值",
  "the drive opened its brake when it was enabled: not testable here": "驱动器使能时松开了制动器：不能在此测试",
  "stopped": "已停止",
  "power was switched off": "已断电",
  "ended by {code}": "由 {code} 结束",
  "ended by an alarm": "由报警结束",
  "the role {role} may not do this ({action})": "角色 {role} 无权执行（{action}）",
  "the role {role} may not do this": "角色 {role} 无权执行",
  "{user} has control": "控制权在 {user}",
  "{user} has control at the local console": "控制权在本地控制台的 {user}",
  "{user} has control and the axis is moving": "控制权在 {user} 且轴在运动",
  "take control first": "请先取得控制权",
  "status frame {frame:g} is {behind:g} behind, at most {most:g}": "状态帧 {frame} 落后 {behind} 帧，最多 {most} 帧",
  "sent before the last stop, reset or change of control: look, then ask again": "发送于最近一次停止、复位或控制权变更之前：请查看后重新发出",
  "sequence number {number:g} was used before": "序号 {number} 已用过",
  "more than {number:g} commands in a second": "一秒内超过 {number} 条命令",
  "the controller takes no commands now": "控制器现在不接受命令",
  "the controller does not answer": "控制器没有应答",
  "the journal cannot keep events now: no new motion; see `journal_state`": "日志现在无法保存事件：不能启动新运动",
  "this lease was used before: press again": "此租约已用过：请重新按下",
  "another key is held: both are released": "另一键被按住：两键均已松开",
  "the lease has ended: release and press again": "租约已结束：松开后重新按下",
  "the service is being shut down": "服务正在关闭",
  "{command} needs the mode {wanted}, it is {mode}": "{command} 需要 {wanted} 模式，当前为 {mode}",
  "{action} is not armed: {by}, then execute within {time:g} s": "{action} 未预备：{by}，然后在 {time} 秒内执行",
  "arm it first": "请先预备",
  "another user must arm it first": "须由另一用户先预备",
  "{action} was armed by {user}: another user must execute it": "{action} 由 {user} 预备：须由另一用户执行",
  "{action} was armed by {user} at another screen: arm it here": "{action} 由 {user} 在另一屏幕预备：请在此预备",
  "brake_test": "制动器测试",
  "reset_locked": "复位锁定的报警",
  "there is no alarm number {number:g} (any more)": "（已）没有第 {number} 号报警",
  "{code} stopped the axis in an earlier run: look at it, then reset": "{code} 在上次运行中使轴停止：请查看后复位",
  "no zero offset is stored for this machine, the angle is unknown": "此机器未存储零点偏移，角度未知",
  "the encoder is {serial}, the stored zero offset belongs to another one": "编码器为 {serial}，存储的零点偏移属于另一个",
  "the gantry moved {way:g} deg while off (limit {limit:g} deg)": "断电期间机架移动了 {way}°（限值 {limit}°）",
  "look at it; `gantryctl reset` acknowledges it under your name": "请查看；复位即以您的名义确认",
};
