"""Words that stand in the fields of a message: reasons, quantities, states; English and Chinese in one row."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum, unique
from string import Formatter
from typing import Final, NamedTuple

from gantryctl.image import DriveState

# No quantity of a machine is that large in any unit of a text; a spoilt reading may be.
_ABSURD: Final = 1e12


@unique
class Words(Enum):
    """One row: the English template, with the number formats, and the Chinese one with the same fields.

    The name of a member is what travels on the wire; calling a member fills its fields.
    """

    # Quantities with their units. Ten digits: a limit passed by the last digit of a float still shows as equal.
    ANGLE = "{value:.10g} deg", "{value}°"
    SPEED = "{value:.10g} deg/s", "{value} °/s"
    ACCELERATION = "{value:.10g} deg/s2", "{value} °/s²"
    JERK = "{value:.10g} deg/s3", "{value} °/s³"
    PERCENT = "{value:.10g} %", "{value} %"
    AT = "{value:.2f} deg", "{value}°"
    AT_SPEED = "{value:.2f} deg, {speed:.2f} deg/s", "{value}°、{speed} °/s"
    AGO = "{age_s:.1f} s ago", "{age_s} 秒前"
    AT_TIME = "at {utc}", "于 {utc} "
    AT_UNKNOWN = "an angle that is not known", "未知角度"
    WHILE_COMMANDED = "{value:.2f} deg/s was commanded", "指令为 {value} °/s"
    WHILE_READ = "{value:.2f} deg/s had been read before", "此前读数为 {value} °/s"
    WHILE_TORQUE = "a torque of {value:+.3g} N m turned the motor", "转矩 {value} N m 使电机转动"
    WHILE_DITHERED = (
        "the motor was commanded to move by {value:.0f} counts, forth and back",
        "命令电机往返移动 {value} 个计数",
    )
    POSITION_AWAY = (
        "Position {value:.4f} deg away from what the speed adds up to, limit {limit:.4f} deg",
        "位置与速度积分相差 {value}°，限值 {limit}°",
    )
    GROWS_AGAINST = (
        "Speed grew to {speed:.2f} deg/s against a torque of {torque:+.3g} N m",
        "速度逆着 {torque} N m 的转矩增至 {speed} °/s",
    )
    TURNED_AGAINST = (
        "The reading turned by {value:.0f} counts against a torque of {torque:+.3g} N m",
        "读数逆着 {torque} N m 的转矩转动 {value} 个计数",
    )
    SPEED_CHANGE = (
        "{before:.3g} deg/s and {value:.3g} deg/s one scan later",
        "{before} °/s，一个扫描周期后 {value} °/s",
    )
    WITHIN_ANGLES = "within {low:.4g} and {high:.4g} deg", "在 {low} 和 {high}° 之间"
    WITHIN_TRAVEL = "within {low:.2f} and {high:.2f} deg", "在 {low} 和 {high}° 之间"
    WITHIN_SPEEDS = "within {low:.4g} and {high:.4g} deg/s", "在 {low} 和 {high} °/s 之间"
    WITHIN_ACCELERATIONS = "within {low:.4g} and {high:.4g} deg/s2", "在 {low} 和 {high} °/s² 之间"
    WITHIN_PERCENTS = "within {low:.4g} and {high:.4g} %", "在 {low} 和 {high} % 之间"
    WITHIN_ZERO_AND_ONE = "within 0 and 1", "在 0 和 1 之间"
    AT_MOST_ANGLE = "above 0 and at most {high:.2f} deg", "大于 0 且不超过 {high}°"
    AT_MOST_SPEED = "above 0 and at most {high:.4g} deg/s", "大于 0 且不超过 {high} °/s"
    AT_MOST_JERK = "above 0 and at most {high:.4g} deg/s3", "大于 0 且不超过 {high} °/s³"
    ABOVE_ZERO = "above 0", "大于 0"
    AT_MOST_ACCELERATION = "above 0 and at most {high:.4g} deg/s2", "大于 0 且不超过 {high} °/s²"

    # Names of what a command sets, and sides.
    NAME_SPEED = "speed", "速度"
    NAME_INCREMENT = "increment", "增量"
    NAME_OVERRIDE = "override", "倍率"
    NAME_ACCELERATION = "acceleration", "加速度"
    NAME_DECELERATION = "deceleration", "减速度"
    NAME_JERK = "jerk", "加加速度"
    NAME_TARGET = "target", "目标"
    NAME_POSITION = "position", "位置"
    PLUS = "plus", "正"
    MINUS = "minus", "负"
    FORWARD = "forward", "正向"
    REVERSE = "reverse", "反向"
    OPEN = "open", "松开"
    CLOSED = "closed", "抱紧"

    # Values that are not finite (CTL-02), and what the drive reports.
    TORQUE_READING = "torque reading", "转矩读数"
    SPEED_READING = "speed reading", "速度读数"
    ENCODER_COUNT = "encoder count", "编码器计数"
    SPEED_COMMAND = "speed command {value}", "速度指令 {value}"
    TORQUE_COMMAND = "torque command {value}", "转矩指令 {value}"
    DRIVE_ERROR = "error {error} (hexadecimal {word})", "错误 {error}（十六进制 {word}）"
    DRIVE_ERROR_NAMED = (
        "error {error} (hexadecimal {word}): {name}",
        "错误 {error}（十六进制 {word}）：{name}",
    )
    # Error codes of CiA 301 and CiA 402, by their number.
    ERROR_2310 = "overcurrent at the output", "输出过流"
    ERROR_2350 = "overload of drive or motor (I2t)", "驱动器或电机过载（I2t）"
    ERROR_3210 = "DC link overvoltage", "直流母线过压"
    ERROR_3220 = "DC link undervoltage", "直流母线欠压"
    ERROR_4310 = "drive too hot", "驱动器过热"
    ERROR_7305 = "motor encoder", "电机编码器"
    ERROR_8130 = "the controller's heartbeat was missing", "缺少控制器的心跳"
    ERROR_8250 = "the controller's commands were missing", "缺少控制器的指令"
    ERROR_8611 = "following error in the drive", "驱动器内跟随误差"
    NOT_FOLLOWING = (
        "it is enabled and does not follow the speed command (bit 12 of 6041 is 0)",
        "已使能但不跟随速度指令（6041 第 12 位为 0）",
    )
    NEVER_FOLLOWED = (
        "it is enabled and has not said that it follows the speed command (bit 12 of 6041); a drive without this bit "
        "needs [can] follows_bit = false, and one that ignores the command is then seen by its speed only, not before "
        "{limit:.0f} ms (drive_follows_command in `gantryctl status`)",
        "已使能，但未表示跟随速度指令（6041 第 12 位）；没有该位的驱动器需要 [can] follows_bit = false，"
        "此时只能由速度发现驱动器忽略指令，不早于 {limit} ms（`gantryctl status` 的 drive_follows_command）",
    )
    LOCAL_CONTROL = "it does not obey the bus (bit 9 of 6041 is 0)", "不听从总线（6041 第 9 位为 0）"
    DRIVE_ERROR_UNKNOWN = "without an error code", "没有错误代码"

    # Why the engine stops the axis (SYS-02).
    SCAN_LATE = (
        "scan {late_ms:.1f} ms late (limit {limit_ms:.4g} ms)",
        "扫描迟到 {late_ms} ms（限值 {limit_ms} ms）",
    )
    OVERRUNS = (
        "{count:.0f} overruns within 1 s (limit {limit:.0f})",
        "1 s 内超限 {count} 次（限值 {limit} 次）",
    )
    # Frames that only the controller may send (CAN-12), with their identifier.
    FOREIGN_NMT = "a network command (NMT), identifier {word}", "网络命令（NMT），标识符 {word}"
    FOREIGN_SYNC = "SYNC, identifier {word}", "SYNC，标识符 {word}"
    FOREIGN_COMMAND = (
        "a command to the drive (RPDO), identifier {word}",
        "给驱动器的指令（RPDO），标识符 {word}",
    )
    FOREIGN_SDO = "an access to the drive (SDO), identifier {word}", "对驱动器的访问（SDO），标识符 {word}"
    FOREIGN_HEARTBEAT = "the controller's heartbeat, identifier {word}", "控制器的心跳，标识符 {word}"

    # The controller of the bus, in the computer or its adapter (CAN-08, CAN-15).
    BUS_OFF = (
        "bus-off: after too many errors of its frames it has left the bus",
        "总线关闭：其帧错误过多，已离开总线",
    )
    QUEUE_FULL = (
        "its transmit queue is full (ENOBUFS): nobody acknowledges, or the bus is held",
        "发送队列已满（ENOBUFS）：无人应答，或总线被占用",
    )
    BUS_FAILED = "three times one after the other it failed", "连续三次失败"
    ERROR_PASSIVE = (
        "error passive: it has counted 128 errors",
        "错误被动：错误计数已达 128",
    )

    # Telegrams of a drive on a bus (CAN-03).
    TELEGRAM_POSITION = "state and position", "状态和位置"
    IO_NODE = "The node with inputs and outputs", "输入输出节点"
    LOAD_ENCODER_NODE = "The encoder node on the ring", "齿圈编码器节点"
    TELEGRAM_INPUTS = "speed, inputs or encoder status", "速度、输入或编码器状态"

    # States of the drive, in the words of IEC 61800-7-201 (CiA 402).
    STATE_UNKNOWN = "an unknown state", "未知状态"
    STATE_NOT_READY_TO_SWITCH_ON = "Not ready to switch on", "“未准备好”状态"
    STATE_SWITCH_ON_DISABLED = "Switch on disabled", "“禁止接通”状态"
    STATE_READY_TO_SWITCH_ON = "Ready to switch on", "“准备接通”状态"
    STATE_SWITCHED_ON = "Switched on", "“已接通”状态"
    STATE_OPERATION_ENABLED = "Operation enabled", "“运行使能”状态"
    STATE_QUICK_STOP_ACTIVE = "Quick stop active", "“快速停止中”状态"
    STATE_FAULT_REACTION_ACTIVE = "Fault reaction active", "“故障反应中”状态"
    STATE_FAULT = "Fault", "“故障”状态"

    # Reactions, and how a stop went.
    STOPPING = "Stopping on the jog-release ramp", "正按松键斜坡停止"
    # What was commanded is told as that until the drive has confirmed it; then come the words of what it has shown.
    QUICK_STOP_COMMANDED = "Quick stop commanded", "已指令快速停止"
    TORQUE_OFF_COMMANDED = "Torque off and brake commanded", "已指令切断转矩并制动"
    QUICK_STOP = "Quick stop", "快速停止"
    TORQUE_KEPT = "Torque kept at zero speed", "保持零速转矩"
    NOTHING_ON = "Nothing was switched on", "没有接通任何部分"
    AT_REST_AFTER = "at rest after {time_ms:.0f} ms", "{time_ms} ms 后静止"
    TORQUE_OFF_AFTER = "torque off after {time_ms:.0f} ms", "{time_ms} ms 后转矩切断"
    BRAKE_CLOSED_AFTER = "brake closed after {time_ms:.0f} ms", "{time_ms} ms 后制动器抱紧"
    # By a contact that had been wrong about it: since when, nobody knows.
    BRAKE_CLOSED_SEEN = "brake seen closed after {time_ms:.0f} ms", "{time_ms} ms 后确认制动器抱紧"
    TORQUE_OFF_SEEN = "torque seen off after {time_ms:.0f} ms", "{time_ms} ms 后确认转矩已切断"
    TORQUE_UNCONFIRMED = (
        "torque off commanded, not confirmed: press the emergency stop",
        "已指令切断转矩，未经确认：请按下急停",
    )
    STOP_UNCONFIRMED = (
        "torque off and brake commanded, not confirmed: press the emergency stop",
        "已指令切断转矩并制动，未经确认：请按下急停",
    )
    # Without a contact nothing confirms a brake; a shaft at rest without torque is held by something.
    BRAKE_COMMANDED = "brake commanded closed, not confirmed", "已指令制动器抱紧，未经确认"
    STILL_TURNING = (
        "still turning at {speed:.2f} deg/s: press the emergency stop",
        "仍以 {speed} °/s 转动：请按下急停",
    )
    MOVED_TO = "axis moved {way:.2f} deg to {position:.2f} deg", "轴移动 {way}° 至 {position}°"
    ANGLE_UNKNOWN = "the angle is not known", "角度未知"

    # Why the axis may not be enabled or moved.
    SWITCHING_OFF = "the axis is still being switched off", "轴正在断电"
    LATCHED = "{code} is latched ({measured}): reset first", "{code} 已锁存（{measured}）：请先复位"
    ACTIVE = "{code} is active ({measured}): {first}", "{code} 有效（{measured}）：{first}"
    RESET_FIRST = "reset first", "请先复位"
    SERVICE_FIRST = "service must reset", "须由维修人员复位"
    COOL_FIRST = "let it cool, then reset", "请冷却后复位"
    READY_IN = "ready again in {time_min} min with power off", "断电后 {time_min} 分钟可再次运动"
    READY_WITH_DRIVE = "ready again when the drive has recovered", "驱动器恢复后可再次运动"
    TEST_OR_SERVICE = "a brake test must pass, or service must reset", "须先通过制动器测试，或由维修人员复位"
    ERROR_STOP = (
        "the axis is in ErrorStop by {code} ({measured}): reset first",
        "轴因 {code} 处于故障停止（{measured}）：请先复位",
    )
    SERVICE_ONLY = (
        "{code} ({measured}) may be reset by the service role only",
        "{code}（{measured}）只能由维修角色复位",
    )
    ESTOP_OPEN = "the emergency-stop chain is open", "急停回路断开"
    ESTOP_CHANNELS_DIFFER = (
        "the two channels of the emergency-stop chain differ: repair the chain first",
        "急停回路两个通道不一致：请先修复回路",
    )
    COLLISION_OPEN = (
        "the collision interlock is open: clear the way first",
        "防碰撞联锁断开：请先排除障碍",
    )
    DOOR_OPEN = "the room door is open: close it first", "机房门打开：请先关门"
    PERMIT_MISSING = "the motion permit is not given", "没有给出运动许可"
    PERMIT_INPUT = "motion permit", "运动许可"
    COLLISION_INPUT = "collision interlock", "防碰撞联锁"
    DOOR_INPUT = "room door", "机房门"
    ESTOP_STILL_OPEN = "the emergency-stop chain is still open: release it first", "急停回路仍断开：请先松开"
    MAINS_NOT_READY = "the mains are not ready", "主电源未就绪"
    DRIVE_FAULT = (
        "the drive is in fault or its state is unknown: reset first",
        "驱动器故障或状态未知：请先复位",
    )
    TORQUE_STILL_ON = (
        "the drive is still enabled against its command: take its supply off",
        "驱动器违反指令仍处于使能状态：请切断其供电",
    )
    DRIVE_KEEPS_FAULT = "the drive keeps its fault: read its display", "驱动器故障仍在：查看其显示"
    ENCODER_KEEPS_ALARM = (
        "the encoder still reports its alarm: clear it there first",
        "编码器仍在报警：请先在那里清除",
    )
    POSITION_NOT_VALID = (
        "the position is not valid: service must compare the angle and reset",
        "位置无效：须由维修人员核对角度并复位",
    )
    ACCELERATION_AT_REST = "the acceleration changes at standstill only", "加速度仅在静止时可改"
    PARAMETER_AT_REST = "a parameter changes at standstill only", "参数仅在静止时可改"
    PARAMETER_READ_ONLY = (
        "parameter {number} is read only: limits belong to the machine file",
        "参数 {number} 只读：极限值属于机器文件",
    )
    NO_PARAMETER = "there is no parameter {number}", "没有参数 {number}"
    MODE_AT_REST = "the mode changes at standstill only", "模式仅在静止时可改"
    HELD_BY_STOP = "the axis is held by Stop: release it first", "轴被“停止”保持：请先松开"
    BUFFER_FULL = (
        "a motion waits already for the end of the one under way: there is one place",
        "已有一个运动在等待当前运动结束：只有一个位置",
    )
    NOTHING_BEHIND_KEY = (
        "the motion under way lasts while a key is held: nothing waits for its end",
        "当前运动由按键保持：没有运动可等待其结束",
    )
    MOVING_BY_HAND = "the axis is moving by hand: release the key first", "轴正在手动运动：请先松开按键"
    JOG_FROM_REST = "a motion has not ended: jog from standstill only", "运动尚未结束：点动只能从静止开始"
    INCREMENT_FROM_REST = (
        "a motion has not ended: increments from standstill only",
        "运动尚未结束：增量只能从静止开始",
    )
    JUST_RAISED = "{code} has come only now; look at it, then reset", "{code} 刚刚出现；请先查看，然后复位"
    STILL_STOPPING = "the axis is still stopping: reset when it is at rest", "轴仍在停止：静止后再复位"
    REVERSAL_FROM_REST = (
        "reversal only from standstill: release and press again",
        "换向只能从静止开始：松开后重新按下",
    )
    BOTH_KEYS = "both keys are pressed: one increment needs one key", "两键同时按下：一次增量只需一个键"
    END_OF_TRAVEL = "the end of travel", "行程终点"
    BEFORE_SECTOR = (
        "before the no-go sector {begin:.2f} to {end:.2f} deg",
        "在禁区 {begin}° 至 {end}° 之前",
    )
    NO_WAY_ROUND = "there is no way round", "没有绕行的路"
    WAY_ROUND = "the way round is {way:+.2f} deg", "绕行路径为 {way}°"
    DIRECTION_OF_LINEAR = (
        "a linear axis has one way to an angle: a direction is for a modulo axis",
        "直线轴到某一角度只有一条路径：方向仅用于模数轴",
    )
    HOME_AT_REST = "Home needs Standstill", "Home 需要静止状态"
    REFERENCE_AT_REST = "a new reference needs standstill", "新的参考点需要静止"
    ENCODER_WOULD_WRAP = (
        "the encoder would wrap {margin:.2f} deg from the travel, at least {limit:.2f} deg required",
        "编码器将在距行程 {margin}° 处回绕，至少需要 {limit}°",
    )
    OUTSIDE_ON_THE_WAY = (
        "the way there would pass {angle:.2f} deg, outside the travel; stop first",
        "途中将经过行程之外的 {angle}°；请先停止",
    )
    MODE_NONE = "no motion mode is chosen", "没有选择运动模式"
    MODE_WRONG = (
        "{command} needs the mode {wanted}, it is {mode}",
        "{command} 需要 {wanted} 模式，当前为 {mode}",
    )

    # The brake test: why it cannot begin, and how it ended.
    TEST_UNDER_WAY = "a brake test is under way", "正在测试制动器"
    TEST_NEEDS_POWER_OFF = (
        "a brake test begins with power off: switch it off first",
        "制动器测试须在断电时开始：请先断电",
    )
    TEST_TORQUE_TOO_HIGH = (
        "a brake test with {level:.3g} N m and the load are more than the motor's torque limit",
        "{level} N m 的制动器测试加上负载超过电机转矩限值",
    )
    NOT_TESTABLE = "not testable here: {why}", "不能在此测试：{why}"
    DRIVE_OWNS_BRAKE = (
        '[brake] owner = "{owner}": the drive works the brake itself and opens it whenever it is enabled; '
        "use the drive's own brake test",
        "[brake] owner = {owner}：制动器由驱动器控制，使能时即松开；请使用驱动器自身的制动器测试",
    )
    NO_TORQUE_INPUT = (
        "the drive takes no torque beside the speed (60B2, 6077); use the drive's own brake test",
        "驱动器除速度外不接受转矩（60B2、6077）；请使用驱动器自身的制动器测试",
    )
    TEST_RESULT = (
        "{what}, moved {way:.4f} deg of {limit:.4f} deg allowed",
        "{what}，移动 {way}°，允许 {limit}°",
    )
    TEST_HELD = (
        "held {plus:+.3g} and {minus:+.3g} N m for {time_s:g} s each",
        "各保持 {time_s} s：{plus} 和 {minus} N m",
    )
    TEST_NOT_REACHED = (
        "{given:+.3g} N m reached, {wanted:+.3g} N m required",
        "达到 {given} N m，需要 {wanted} N m",
    )
    TEST_NOT_HELD = "{given:+.3g} N m held of {wanted:+.3g} N m", "保持 {given} N m，需要 {wanted} N m"
    TEST_SLIPPED = "the brake slipped under {given:+.3g} N m", "制动器在 {given} N m 下打滑"
    TEST_SLIPPED_AFTER = (
        "the brake slipped when the torque was taken off after the test",
        "测试后撤去转矩时制动器打滑",
    )
    BRAKE_CONTACT_OPEN = "the brake's contact says that it is open", "制动器触点显示松开"
    TORQUE_NOT_FINITE = "the torque reading is not finite", "转矩读数不是数值"
    STOPPED = "stopped", "已停止"
    POWER_SWITCHED_OFF = "power was switched off", "已断电"
    ENDED_BY = "ended by {code}", "由 {code} 结束"
    ENDED_BY_ALARM = "ended by an alarm", "由报警结束"

    # What of a calibration no longer fits (CTL-22).
    STALE_MOMENT = (
        "eccentric moment changed by {measured:.4g} N m, bound {limit:.4g} N m",
        "偏心力矩改变 {measured} N m，限值 {limit} N m",
    )
    STALE_FRICTION = (
        "friction changed by {measured:+.4g} N m, bound {limit:.4g} N m",
        "摩擦改变 {measured} N m，限值 {limit} N m",
    )
    STALE_BACKLASH = (
        "backlash of {measured:.4f} deg at least, bound {limit:.4f} deg",
        "齿隙至少 {measured}°，限值 {limit}°",
    )
    STALE_LOST_MOTION = (
        "lost motion between both directions changed by {measured:+.4f} deg, bound {limit:.4f} deg",
        "两个方向之间的空程改变 {measured}°，限值 {limit}°",
    )
    STALE_SCALE = (
        "encoder on the ring and motor part by {measured:.4f} deg over the turn, bound {limit:.4f} deg",
        "环上编码器与电机在一圈内相差 {measured}°，限值 {limit}°",
    )

    # Why a torque reading is not believed (DRV-14).
    TORQUE_WHILE_OFF = (
        "{torque:.3g} N m reported while the drive is switched off",
        "驱动器断电时报告 {torque} N m",
    )
    TORQUE_AGAINST_BRAKE = (
        "{torque:.3g} N m reported against the closed brake, {wanted:.3g} N m asked for",
        "对抱紧的制动器报告 {torque} N m，要求 {wanted} N m",
    )
    TORQUE_WITHOUT_EFFECT = (
        "reported torque changed by {change:+.3g} to {torque:.3g} N m without any effect on the speed",
        "报告的转矩变化 {change} 至 {torque} N m，而速度没有任何变化",
    )
    TORQUE_STILL_WRONG = (
        "the reported torque was wrong, and the drive has not been switched off since",
        "报告的转矩有误，此后驱动器尚未断电",
    )

    # The absolute reference: why the angle is not valid (ENC-10).
    NO_ZERO = "no zero offset is stored for this machine", "此机器未存储零点偏移"
    NO_REST_POSITION = (
        "no rest position is stored, so nothing proves the angle",
        "没有存储静止位置，角度无从证明",
    )
    BEYOND_STOPS = (
        "the encoder says {angle:+.2f} deg, which is beyond the mechanical stops",
        "编码器显示 {angle}°，超出机械挡块",
    )
    MOVED_OR_TURNS_LOST = (
        "the axis moved {moved:+.3f} deg while off, or the encoder lost turns",
        "断电期间轴移动了 {moved}°，或编码器丢失圈数",
    )

    # Proofs of a drive on a bus (CFG-CAN-02, CFG-CAN-03).
    NO_RECORD = (
        "{machine} has no commissioning record: its drive is not proven",
        "{machine} 没有调试记录：其驱动器未经验证",
    )
    OTHER_DRIVE = (
        "the drive on the bus is {drive}, {machine} was commissioned with {proven}",
        "总线上的驱动器为 {drive}，{machine} 调试时为 {proven}",
    )
    OTHER_NODES = (
        "the nodes beside the drive are {nodes}, {machine} was commissioned with {proven}",
        "驱动器旁的节点为 {nodes}，{machine} 调试时为 {proven}",
    )
    CONFIGURATION_CHANGED = (
        "the configuration has changed since {machine} was commissioned on {date}",
        "{machine} 于 {date} 调试后配置已改变",
    )
    STEPS_MISSING = (
        "the ledger waits for what these steps show: {steps}",
        "安全台账尚缺以下步骤的证明：{steps}",
    )
    SILENCE_NOT_PROVEN = (
        "it is not proven that this drive stops the axis when its controller falls silent",
        "未证明控制器静默时该驱动器会停止轴",
    )
    RESTARTED_SINCE = (
        "the drive has restarted since it was proven on {date} that it stops the axis when its controller "
        "falls silent",
        "驱动器在 {date} 证明控制器静默时会停止轴之后已重新启动",
    )

    # The ledger of a drive on a bus (CFG-CAN-04, CFG-CAN-05): what gives a safety property, and what it costs.
    LEDGER_LACK = "{what} ({detail})", "缺少 {what}（{detail}）"
    LEDGER_NO_OBJECT = "no {object}", "没有 {object}"
    LEDGER_STAYS = "{object} stays {have}, wanted {want}", "{object} 固定为 {have}，应为 {want}"
    LEDGER_IS = "{object} = {have}, wanted {want}", "{object} = {have}，应为 {want}"
    LEDGER_BOTH = "{first}, {second}", "{first}且{second}"
    LEDGER_COST = "{objects}: {cost}", "{objects}，因此{cost}"
    LEDGER_STEP = "step {step}", "步骤 {step}"
    LEDGER_BY_STEP = "{by}, step {step}", "{by}，步骤 {step}"
    LEDGER_STEP_FAILED = "step {step} has failed", "步骤 {step} 未通过"
    LEDGER_TO_PROVE = "{by} is to be proven", "{by} 尚待证明"
    LEDGER_ENTERED_BY = "{because}; {date}, entered by {user}", "{because}；{date}，由 {user} 录入"
    # A silent controller.
    LEDGER_WAY = (
        "{time_ms:g} ms, then {how}: {angle:.2f} deg from {speed:g} deg/s",
        "{time_ms} ms 后{how}：从 {speed} °/s 起 {angle}°",
    )
    LEDGER_RAMP = "its ramp", "按自身斜坡减速"
    LEDGER_BRAKE = "torque off and brake", "切断转矩并制动"
    LEDGER_RAMP_OR_BRAKE = "its ramp or torque off and brake", "按自身斜坡减速，或切断转矩并制动"
    LEDGER_NOT_FASTER = (
        "permitted {limit:g} deg: not faster than {speed:g} deg/s",
        "允许 {limit}°：速度不超过 {speed} °/s",
    )
    LEDGER_SHORTER_ALLOWS = "{time_ms:.0f} ms allow {speed:g} deg/s", "{time_ms} ms 则允许 {speed} °/s"
    LEDGER_MISSES_CONTROLLER = (
        "it misses the controller, not single commands",
        "它能发现控制器消失，但不能发现个别指令丢失",
    )
    LEDGER_DEAD_SENDS_NOTHING = (
        "a dead controller sends no commands either",
        "失效的控制器也不再发送指令",
    )
    LEDGER_GOES_ON = (
        "the drive goes on at its last speed when its controller is gone",
        "控制器消失后，驱动器以最后的速度继续运行",
    )
    LEDGER_WATCHDOG_WANTED = (
        "only a watchdog outside of it makes up for that: a relay that the controller toggles, or the enable of the "
        "drive on a node that takes it off by itself ([can.io.outputs] watchdog, drive_enable)",
        "只有驱动器之外的看门狗可以弥补：由控制器翻转的继电器，或由能自行撤销的节点给出的驱动器使能"
        "（[can.io.outputs] watchdog、drive_enable）",
    )
    LEDGER_WATCHDOG_RELAY = "the watchdog relay at {place}", "{place} 处的看门狗继电器"
    LEDGER_ENABLE_RELAY = (
        "the enable relay at {place} (1016, 6206, 6207)",
        "{place} 处的使能继电器（1016、6206、6207）",
    )
    # Limits, ramp, brake.
    LEDGER_COMPUTED_TORQUE = (
        "the stops are computed with [motor] torque_max_nm = {torque:g}: give there what the drive has",
        "停止按 [motor] torque_max_nm = {torque} 计算：请在该处填写驱动器的值",
    )
    LEDGER_ENTER_LIMIT = (
        "set the limit with the maker's tool and give it as [can] torque_limit_in_drive_nm",
        "请用厂商工具设置限值，并填入 [can] torque_limit_in_drive_nm",
    )
    LEDGER_ENTERED = "{torque:g} N m set with the maker's tool", "用厂商工具设为 {torque} N m"
    LEDGER_NOT_SHOWN = (
        "{torque:g} N m set with the maker's tool, what lies above {shown:.0f} N m is not shown",
        "用厂商工具设为 {torque} N m，{shown} N m 以上未经证明",
    )
    LEDGER_TOO_SLOW = (
        "the drive does not reach [speed] setting_max_deg_s = {speed:g}",
        "驱动器达不到 [speed] setting_max_deg_s = {speed}",
    )
    LEDGER_OVERSPEED_SEEN = (
        "seen after {time_ms:.0f} ms at {speed:.1f} deg/s",
        "{time_ms} ms 后在 {speed} °/s 时发现",
    )
    LEDGER_RAMP_UNKNOWN = "the drive's own ramp is to be measured", "驱动器自身的斜坡尚待测量"
    LEDGER_OWN_RAMP = (
        "{acceleration:.2f} deg/s2: {angle:.2f} deg from {speed:g} deg/s with {time_ms:g} ms",
        "{acceleration} °/s²：含 {time_ms} ms，从 {speed} °/s 起 {angle}°",
    )
    LEDGER_NOBODY_BRAKES = (
        "no 60FE: nobody commands the brake; another [brake] owner does",
        "没有 60FE：无人控制制动器；请改用另一种 [brake] owner",
    )
    LEDGER_TORQUE_FIRST = (
        "the torque may go before the brake has closed",
        "制动器抱紧之前转矩可能已切断",
    )
    LEDGER_BRAKE_TO_PROVE = (
        "the drive works the brake, which is to be proven",
        "制动器由驱动器控制，尚待证明",
    )
    # Inputs, and the bit by which a drive says that it follows.
    LEDGER_NO_60FD = "the drive has no 60FD", "驱动器没有 60FD"
    LEDGER_SEEN_LATER = (
        "seen after {time_ms:.0f} ms instead of {scan_ms:g} ms",
        "{time_ms} ms 后发现，而非 {scan_ms} ms",
    )
    # Mode, telegrams, scales.
    LEDGER_NOTHING_STANDS_IN = (
        "nothing stands in for these in a CSV axis",
        "在 CSV 轴中它们不可替代",
    )
    LEDGER_PROFILE_MODE = (
        "a drive in a profile mode makes set-points of its own, and nothing here replaces CSV",
        "轮廓模式下驱动器自行生成设定值，此处无可替代 CSV",
    )
    LEDGER_NO_CSV_BY_PROFILE = (
        "no mode {number}, CSV, by the profile {profile}",
        "按配置文件 {profile} 没有模式 {number}（CSV）",
    )
    LEDGER_NO_CSV_BIT = "6502 = {have} has no CSV (bit 8)", "6502 = {have} 不含 CSV（第 8 位）"
    LEDGER_CSV_NOT_TAKEN = "6060 does not take {number}, CSV", "6060 不接受 {number}（CSV）"
    LEDGER_CSV_SEEN = (
        "no 6502; that it shows mode 9, and moves in it, is seen",
        "没有 6502；由其显示模式 9 并在该模式下运动可见",
    )
    LEDGER_NOT_WRITABLE = "{objects} cannot be written", "{objects} 不可写"
    LEDGER_NOT_MAPPABLE = "{objects} cannot be mapped", "{objects} 不可映射"
    LEDGER_SDO_TOO_SLOW = "SDO is too slow for it", "SDO 对此太慢"
    LEDGER_TELEGRAMS_STAY = (
        "the telegrams stay as they are, and SDO is too slow for a speed each SYNC",
        "报文保持不变，而 SDO 太慢，无法每个 SYNC 传送速度",
    )
    LEDGER_NOT_AT_SYNC = (
        "1800:02 is fixed: feedback does not come at SYNC",
        "1800:02 固定：反馈不随 SYNC 到来",
    )
    LEDGER_KIND_STAYS = "1400:02 stays {number}", "1400:02 固定为 {number}"
    LEDGER_ON_ARRIVAL = (
        "a command acts when it arrives, sooner than at the next SYNC",
        "指令到达即生效，早于下一个 SYNC",
    )
    LEDGER_ONE_WRONG = "{said}: one of them is wrong", "{said}：其中一个有误"
    LEDGER_AGAINST_FILE = (
        "{object} = {have}, [can] {key} = {want}",
        "{object} = {have}，而 [can] {key} = {want}",
    )
    LEDGER_AGAINST_PROFILE = (
        "{object} = {have}, profile {profile} says {want}",
        "{object} = {have}，配置文件 {profile} 为 {want}",
    )
    LEDGER_COUNTS_UNSEEN = (
        "60FF counts increments: nothing in this drive shows those of a turn",
        "60FF 以增量计：该驱动器无从显示每转增量数",
    )
    LEDGER_MOTION_TO_SHOW = "a short motion is to show it", "须由一次短距离运动证明"
    # What stands in for an optional object, and what follows.
    LEDGER_ANSWERS_TO_SYNC = "the answers to SYNC", "对 SYNC 的应答"
    LEDGER_ITS_TELEGRAMS = "its telegrams", "其报文"
    LEDGER_EMERGENCY_MESSAGES = "emergency messages", "紧急报文"
    LEDGER_SAG = "the sag after release", "松开后的下沉"
    LEDGER_BRAKE_SEQUENCE = "the drive's brake sequence", "驱动器的制动时序"
    LEDGER_DIFFERENCES = "differences of 6064", "6064 的差分"
    LEDGER_THE_BRAKE = "the brake", "制动器"
    LEDGER_WITHOUT_1005 = (
        "80h is taken for it; a drive without an answer is refused",
        "按 80h 处理；无应答的驱动器被拒绝",
    )
    LEDGER_COUNTED_SYNC = (
        "it expects a counter in SYNC, and this controller sends none",
        "它要求 SYNC 带计数，而本控制器不发送计数",
    )
    LEDGER_WIDE_WINDOW = (
        "a command that comes within the cycle counts",
        "周期之内到达的指令有效",
    )
    LEDGER_NARROW_WINDOW = (
        "a command that comes later after SYNC is dropped, that of a stop too: [control] scan_period_ms must fit in",
        "SYNC 之后更晚到达的指令被丢弃，停止指令也一样：[control] scan_period_ms 须在其内",
    )
    LEDGER_EMERGENCY_IS_SYNC = (
        "each of its fault messages would be a SYNC to every node",
        "它的每条故障报文对所有节点都是一个 SYNC",
    )
    LEDGER_WITHOUT_1014 = (
        "its emergency messages are not heard: a fault is told by its state, a warning without a bit not at all",
        "收不到它的紧急报文：故障由其状态得知，没有状态位的警告则无从得知",
    )
    LEDGER_WITHOUT_1006 = (
        "the drive has the period from 60C2, or from SYNC itself",
        "驱动器由 60C2 或 SYNC 本身得知周期",
    )
    LEDGER_WITHOUT_1017 = (
        "its loss is seen by missing telegrams, after 30 ms",
        "由报文缺失发现其失联，30 ms 后",
    )
    LEDGER_WITHOUT_1029 = (
        "what it does after lost communication is fixed by its maker",
        "通信丢失后的动作由厂商固定",
    )
    LEDGER_WITHOUT_6007 = (
        "its reaction is fixed by its maker: what the step sees",
        "其反应由厂商固定：以该步骤所见为准",
    )
    LEDGER_WITHOUT_603F = "a fault without a message has no code", "没有报文的故障没有代码"
    LEDGER_WITHOUT_6076 = (
        "nothing in the drive confirms the scale of torque",
        "驱动器中没有任何值可确认转矩比例",
    )
    LEDGER_WITHOUT_6077 = (
        "no torque proof before the brake opens, no brake test",
        "制动器松开前没有转矩证明，也没有制动器测试",
    )
    LEDGER_WITHOUT_60B2 = "the load sags a little when the brake opens", "制动器松开时负载略有下沉"
    LEDGER_WITHOUT_606C = "speed has the steps of the encoder", "速度带有编码器的台阶"
    LEDGER_WITHOUT_60FE = "no output of this drive can be set", "该驱动器的输出均不可设置"
    LEDGER_WITHOUT_605E = "count on torque off and brake", "按切断转矩并制动考虑"
    LEDGER_WITHOUT_60C2 = (
        "a drive that needs it does not move, or moves in steps: seen by step velocity",
        "需要它的驱动器不动，或一步一步地动：由步骤 velocity 发现",
    )

    # Events of the service's processes: restarts, certificates, disk.
    STARTED_AGAIN = "{how}; started again in {pause_s:g} s", "{how}；{pause_s} 秒后重新启动"
    NO_SIGN_OF_LIFE = (
        "has given no sign of life for {silent_s:.0f} s: it is ended",
        "已有 {silent_s} 秒没有生命信号：将其结束",
    )
    CERTIFICATE_ENDS = "{file}: expires in {days:.0f} days, on {date}", "{file}：{days} 天后到期，{date}"
    CERTIFICATE_ENDED = "{file}: expired on {date}", "{file}：已于 {date} 到期"
    USERS_DAMAGED = "{fault}; no login is possible", "{fault}；无人可以登录"
    NOTHING_RECORDED = (
        "{free:.0f} MB free on the disk: nothing is recorded below {limit} MB",
        "磁盘剩余 {free} MB：低于 {limit} MB 时不再记录",
    )
    NO_NEW_MOTION = (
        "{free:.0f} MB free on the disk: nothing is recorded below {limit} MB, no new motion below {stop} MB",
        "磁盘剩余 {free} MB：低于 {limit} MB 时不再记录，低于 {stop} MB 时不能启动新运动",
    )
    EVENTS_WAITED = (
        "the journal could not be written for {time_s:.1f} s; the events waited in memory",
        "日志有 {time_s} 秒无法写入；事件在内存中等待",
    )
    DISK_SLOW = (
        "the disk took {time_s:.1f} s to keep events, limit {limit:g} s",
        "磁盘保存事件用了 {time_s} 秒，限值 {limit} 秒",
    )
    EVENT_WAITS = (
        "event {number} is not on the disk after {limit:g} s, it waits in memory",
        "事件 {number} 在 {limit} 秒后仍未写入磁盘，在内存中等待",
    )
    USERS_WAIT = (
        "the journal of {machine} does not have the change of users after {limit:g} s",
        "{machine} 的日志在 {limit} 秒后仍无此用户变更",
    )
    FIRST_PROCESS_GONE = (
        "has ended without a word; the others bring the axis to rest and end",
        "未作说明便已结束；其余进程使轴停止并结束",
    )
    EVENT_LOST = (
        "its event found no place to wait for the recorder",
        "其事件没有位置等待记录进程",
    )

    JOURNAL_GONE = (
        "the journal is gone; its newest event was number {number} of {when}",
        "日志不见了；其最新事件为 {when} 的第 {number} 号",
    )
    JOURNAL_SHORT = (
        "the journal does not have event {number} of {when} as it was, and was moved to {file}",
        "日志中没有 {when} 的第 {number} 号原事件，已移至 {file}",
    )
    MIRROR_GONE = (
        "{file} does not say what the newest event was: whether events are missing cannot be told",
        "{file} 没有给出最新事件：无法判断是否有事件缺失",
    )
    FILE_REPLACED = (
        "{file} was removed or replaced while it was in use, and was written anew",
        "{file} 在使用中被删除或替换，已重新写入",
    )
    FILE_LINKED = "{file} has a second name", "{file} 有第二个名称"
    DIRECTORY_MOVED = (
        "{file} is no longer the directory that was opened; events are kept in that one",
        "{file} 已不是打开时的目录；事件仍保存在原目录中",
    )

    # Refusals of the service: roles, messages, control, leases, arming.
    ROLE_MAY_NOT = "the role {role} may not do this ({action})", "角色 {role} 无权执行（{action}）"
    LOG_IN_FIRST = "log in first", "请先登录"
    WRONG_PASSWORD = "wrong name or password", "用户名或密码错误"
    LOCKED_OUT = "too many wrong passwords: wait", "密码错误次数过多：请等待"
    NO_USERS = "no login is possible: users.json cannot be read", "无法登录：users.json 不可读"
    FRAME_OLD = (
        "its status frame was {measured:.0f} ms old, limit {limit:.0f} ms",
        "其状态帧已有 {measured} ms，限值 {limit} ms",
    )
    FRAME_UNKNOWN = (
        "the controller has sent no such status frame to this connection",
        "控制器未向此连接发送过该状态帧",
    )
    SEQUENCE_USED = "sequence number {number} was used before", "序号 {number} 已用过"
    FOREIGN_PAGE = "asked from a foreign page", "请求来自其他网页"
    FOREIGN_HOST = "this host name is not served here", "此处不提供该主机名"
    MESSAGE_TOO_LONG = "a message of {length} bytes: at most {limit}", "消息长 {length} 字节：最多 {limit}"
    NOT_JSON = "not one JSON object with finite numbers", "不是含有限数的 JSON 对象"
    TYPE_UNKNOWN = "unknown type of message", "未知的消息类型"
    KEY_MISSING = "{kind}: {key} is missing", "{kind}：缺少 {key}"
    KEY_UNKNOWN = "{kind}: {key} is not a key of it", "{kind}：没有 {key} 这个键"
    KEY_NO_NUMBER = "{kind}: {key} is not a finite number", "{kind}：{key} 不是有限数"
    KEY_NO_WHOLE_NUMBER = "{kind}: {key} is not a whole number", "{kind}：{key} 不是整数"
    KEY_NO_BOOLEAN = "{kind}: {key} is neither true nor false", "{kind}：{key} 既非 true 也非 false"
    KEY_NO_TEXT = "{kind}: {key} is not a text", "{kind}：{key} 不是文本"
    KEY_PATTERN = "{kind}: {key} does not match {pattern}", "{kind}：{key} 不符合 {pattern}"
    KEY_NO_CHOICE = "{kind}: {key} is not one of {choices}", "{kind}：{key} 不在 {choices} 之中"
    KEY_BEYOND = "{kind}: {key} {value} is beyond {limit:.16g}", "{kind}：{key} {value} 超出 {limit}"
    METHOD_WRONG = "{method} is not possible here, only {allowed}", "此处不能用 {method}，只能用 {allowed}"
    NO_SUCH_ALARM = "there is no alarm number {number}", "没有第 {number} 号报警"
    JSON_NEEDED = "Content-Type: application/json is needed", "需要 Content-Type: application/json"
    BODY_TOO_LONG = "a body of at most {limit} bytes", "正文最多 {limit} 字节"
    TWO_LENGTHS = (
        "a request has Content-Length or Transfer-Encoding, not both",
        "请求只能有 Content-Length 或 Transfer-Encoding 之一",
    )
    NAME_AND_PASSWORD = (
        "write one JSON object with `user` and `password`",
        "请写一个含 `user` 和 `password` 的 JSON 对象",
    )
    WHOLE_NUMBER = "{name}: a whole number from 0 up", "{name}：不小于 0 的整数"
    TOO_MANY_COMMANDS = "more than {limit:g} commands in a second", "一秒内超过 {limit} 条命令"
    TOO_MANY_REQUESTS = "too many requests", "请求过多"
    TOO_MANY_SCOPES = (
        "all scopes together get {limit:g} answers a second: close one elsewhere",
        "所有示波器合计每秒只得到 {limit} 次应答：请关闭别处的一个",
    )
    NO_RECORDING = (
        "{name}: is damaged, or takes too long to read: `gantryctl trace show` says which",
        "{name}：已损坏或读取时间过长：`gantryctl trace show` 会说明",
    )
    TOO_MANY_CONNECTIONS = "too many connections", "连接过多"
    NO_COMMANDS_NOW = "the controller takes no commands now", "控制器现在不接受命令"
    NO_JOURNAL = (
        "the journal cannot keep events now: no new motion; see `journal_state`",
        "日志现在无法保存事件：不能启动新运动",
    )
    NOTE_NOT_KEPT = (
        "the journal cannot keep events now: the line was not written; see `journal_state`",
        "日志现在无法保存事件：该行未写入",
    )
    NO_ANSWER = "the controller does not answer", "控制器没有应答"
    HAS_CONTROL = "{user} has control", "控制权在 {user}"
    TAKE_CONTROL_FIRST = "take control first", "请先取得控制权"
    LINK_DEAD = (
        "the link was used before, is older than a minute, or was not opened here: `gantryctl console` gives another",
        "链接已用过、超过一分钟，或不是在本机打开：请用 `gantryctl console` 取得新链接",
    )
    HAS_TAKEN_CONTROL = "{user} has taken control", "{user} 已取得控制权"
    HAS_CONTROL_LOCALLY = "{user} has control at the local console", "控制权在本地控制台的 {user}"
    HAS_CONTROL_MOVING = "{user} has control and the axis is moving", "控制权在 {user} 且轴在运动"
    LEASE_USED = "this lease was used before: press again", "此租约已用过：请重新按下"
    OTHER_KEY = "another key is held: both are released", "另一键被按住：两键均已松开"
    LEASE_DEAD = "{why}: release and press again", "{why}：松开后重新按下"
    LEASE_ENDED = "the lease has ended", "租约已结束"
    LEASE_RAN_OUT = "the lease ran out", "租约已到期"
    KEY_TOO_LONG = "the key was held for {limit:g} s, the longest time", "按键已按住 {limit} s，已达最长时间"
    ARM_FIRST = (
        "{action} is not armed: arm it first, then execute within {limit:g} s",
        "{action} 未预备：请先预备，然后在 {limit} 秒内执行",
    )
    OTHER_ARMS_FIRST = (
        "{action} is not armed: another person must arm it first, then execute within {limit:g} s",
        "{action} 未预备：须由另一人先预备，然后在 {limit} 秒内执行",
    )
    OTHER_STEP_ARMED = (
        "the step {step} is not armed: {user} has armed the step {armed}",
        "步骤 {step} 未预备：{user} 预备的是步骤 {armed}",
    )
    OTHER_EXECUTES = (
        "{action} was armed by {user}: another person must execute it",
        "{action} 由 {user} 预备：须由另一人执行",
    )
    PERSON_UNKNOWN = (
        "two persons are needed, and nobody knows whose account {user} is: `gantryctl user add {user}` says it",
        "需要两人，但不知 {user} 是谁的账号：请用 `gantryctl user add {user}` 说明",
    )
    BEING_COMMISSIONED = (
        "the axis is being commissioned: end the commissioning first",
        "轴正在调试中：请先结束调试",
    )
    NOT_BEING_COMMISSIONED = "no commissioning is under way", "未在进行调试"
    NO_DRIVE_TO_COMMISSION = (
        "this machine has no drive on a bus: there is nothing to commission",
        "本机没有总线上的驱动器：无需调试",
    )
    POWER_OFF_TO_COMMISSION = "switch power off first", "请先断电"
    STEP_UNDER_WAY = "wait until the step has ended, or stop it", "请等待步骤结束，或将其停止"
    STEP_UNKNOWN = "there is no step {step} here", "此处没有步骤 {step}"
    STEP_BEFORE = "the step {step} comes first", "须先完成步骤 {step}"
    STEP_AT_CONSOLE = (
        "what moves is begun at the console of the machine only: `gantryctl console`",
        "会产生运动的步骤只能在机器的控制台上开始：`gantryctl console`",
    )
    ARMED_ELSEWHERE = (
        "{action} was armed by {user} at another screen: arm it here",
        "{action} 由 {user} 在另一屏幕预备：请在此预备",
    )

    def __init__(self, english: str, chinese: str) -> None:
        self.english = english
        self.chinese = chinese

    def __str__(self) -> str:
        return self.english

    def __call__(self, **values: object) -> Said:
        """The same with its fields filled."""
        return Said(self, values)


def drive_state_words(state: DriveState) -> Words:
    """The words of a state of the drive."""
    return Words[f"STATE_{state.name}"]


class Said(NamedTuple):
    """Words with the values of their fields."""

    words: Words
    values: Mapping[str, object]

    def __str__(self) -> str:
        return filled(self.words.english, self.values)


class _Filler(Formatter):
    def format_field(self, value: object, format_spec: str) -> str:
        if isinstance(value, float) and not abs(value) < _ABSURD:
            return format(value, ".4g")
        text = format(value, format_spec)
        if format_spec.endswith("g") and "e+" in text:
            return format(float(text), ("+" if format_spec.startswith("+") else "") + ".0f")
        return text


_FILLER: Final = _Filler()


def filled(template: str, values: Mapping[str, object]) -> str:
    """A template with its fields filled: every text of alarms, refusals and words.

    A number of absurd size has four digits and an exponent, where its format would print all of 300 digits; no other
    large one has an exponent.
    """
    return _FILLER.vformat(template, (), values)


class Clauses(tuple[object, ...]):
    """Words one after the other, with their values or without, each whole by itself; on the wire a list."""

    __slots__ = ()

    def __str__(self) -> str:
        return "; ".join(map(str, self))


def drive_error_words(code: int, texts: Mapping[int, str]) -> Words | Said:
    """Words for an error code of a drive: the maker's where it has some, its name by CiA 402, or the number."""
    if not code:
        return Words.DRIVE_ERROR_UNKNOWN
    name = texts.get(code) or Words.__members__.get(f"ERROR_{code:04X}")
    if name is None:
        return Words.DRIVE_ERROR(error=code, word=f"{code:04X}")
    return Words.DRIVE_ERROR_NAMED(error=code, word=f"{code:04X}", name=name)


def foreign_words(can_id: int) -> Said:
    """Words for a frame that only the controller may send, by the pre-defined connection set of CiA 301."""
    word = f"{can_id:03X}h"
    match can_id >> 7:
        case 0:
            return Words.FOREIGN_NMT(word=word)
        case 1:
            return Words.FOREIGN_SYNC(word=word)
        case 12:
            return Words.FOREIGN_SDO(word=word)
        case 14:
            return Words.FOREIGN_HEARTBEAT(word=word)
    return Words.FOREIGN_COMMAND(word=word)
