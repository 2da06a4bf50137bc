"""Rows of the alarm table: brake, drive, interlocks, supply."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code, Definition, Reaction, Severity, Text
from gantryctl.program.alarms.words import Words

_STOP, _WARN = Severity.STOP, Severity.WARNING
_QS, _TO, _HOLD = Reaction.QUICK_STOP, Reaction.TORQUE_OFF, Reaction.HOLD

_CHECK_DRIVE: Final = "Read the drive's own fault display, remove the cause, then reset."
_CHECK_DRIVE_ZH: Final = "查看驱动器自身的故障显示，排除原因后复位。"
# Torque holds the load only where the drive can give it: no word here may promise that it does.
_SECURE: Final = (
    "Keep people away. If torque holds the load, switching off or an emergency stop takes it away. "
    "Secure the load and call service."
)
_SECURE_ZH: Final = "人员远离。若负载由转矩保持，断电或急停会撤去该转矩。固定负载并联系维修。"

POWER: Final = (
    # Fault catalogue C1: full torque against a closed brake would wear it and heat the motor.
    Definition(
        Code.BRK_01, _STOP, _QS,
        Text("Brake does not release",
             "Brake feedback still says closed {time_ms:.0f} ms after the release command, limit {limit:.0f} ms",
             "Brake supply, coil or feedback contact. Where the contact is wrong the brake was open, so the torque "
             "stays until it has closed.",
             "Check the brake's supply and contact, then reset."),
        Text("制动器未松开", "松开指令后 {time_ms} ms 制动器反馈仍为抱紧，限值 {limit} ms",
             "制动器供电、线圈或反馈触点。若触点有误，则制动器已松开，因此转矩保持到制动器抱紧为止。",
             "检查制动器的供电和触点，然后复位。"),
    ),
    # Fault catalogue C2: stopped on the jog-release ramp before the drive's overload ends the motion. C10: torque off.
    Definition(
        Code.BRK_02, _WARN, Reaction.W,
        Text("Brake drags",
             "The motion needs {measured:.3g} N m more than expected, {share:.0f} % of rated",
             "The brake does not open fully, or friction has grown.",
             "Check the brake's supply and air gap. Above 30 % the motion is stopped, above half of the brake's torque "
             "power goes off; a reset by service makes the axis learn anew what it needs."),
        Text("制动器拖滞", "运动所需转矩比预期多 {measured} N m，为额定值的 {share} %",
             "制动器未完全松开，或摩擦增大。",
             "检查制动器的供电和气隙。超过 30 % 时运动被停止，超过制动器转矩的一半时切断转矩；"
             "维修人员复位后轴重新学习所需转矩。"),
    ),
    # Fault catalogue C3: the motor is the only thing left that holds the load, so it keeps its torque.
    Definition(
        Code.BRK_03, _STOP, _HOLD,
        Text("Brake does not hold",
             "Moved {measured:.4f} deg while the torque was taken off, limit {limit:.4f} deg",
             "The brake slips under the load; the motor holds it where it can.",
             _SECURE),
        Text("制动器未抱住", "卸除转矩时移动了 {measured}°，限值 {limit}°",
             "制动器在负载下打滑；可能时由电机保持。",
             _SECURE_ZH),
        lock=True,
    ),
    # Fault catalogue C4: torque comes back only where the emergency-stop chain is closed.
    Definition(
        Code.BRK_04, _STOP, _HOLD,
        Text("Brake slips", "Moved {measured:.4f} deg while switched off, limit {limit:.4f} deg",
             "The closed brake lets the load move; the motor holds it where it can.",
             _SECURE),
        Text("制动器打滑", "断电状态下移动了 {measured}°，限值 {limit}°",
             "抱紧的制动器让负载移动；可能时由电机保持。",
             _SECURE_ZH),
        lock=True, horn=True,
    ),
    # Fault catalogue C5, C6: a contact alone is a quick stop; where the axis feels the brake, the torque goes off.
    Definition(
        Code.BRK_05, _STOP, _QS,
        Text("Brake closed in motion",
             "Brake feedback says closed at {measured:.2f} deg/s, following error {error:.3f} deg",
             "Brake supply lost, or the brake command failed.",
             "Check the brake's supply and wiring; inspect the brake, then reset."),
        Text("运动中制动器抱紧", "{measured} °/s 时制动器反馈为抱紧，跟随误差 {error}°",
             "制动器失电，或制动器指令失效。", "检查制动器的供电和接线；检查制动器，然后复位。"),
    ),
    # Fault catalogue C6: a broken contact is not a reason to stop, but one not to start.
    Definition(
        Code.BRK_06, _WARN, Reaction.W,
        Text("Brake feedback contradicts",
             "Brake feedback says {measured} for {time_ms:.0f} ms, commanded {command}",
             "Feedback contact or its wire, or the brake does not obey its command.",
             "Check contact and wire, then reset. No motion before."),
        Text("制动器反馈矛盾", "制动器反馈为{measured}已 {time_ms} ms，指令为{command}",
             "反馈触点或其导线，或制动器不听从指令。", "检查触点和导线，然后复位。此前不得运动。"),
        blocks_motion=True,
    ),
    # Fault catalogue C7: a drive that is enabled without current would drop the load when the brake opens.
    Definition(
        Code.BRK_07, _STOP, _TO,
        Text("Torque not proven",
             "Torque {measured:.3g} N m after {time_ms:.0f} ms, at least {limit:.3g} N m required "
             "before the brake opens",
             "The drive is enabled but gives no torque: motor cable, current limit, torque scaling.",
             "The brake stayed closed. Check the motor cable and the drive's torque limit, then reset."),
        Text("转矩未验证", "{time_ms} ms 后转矩为 {measured} N m，制动器松开前至少需要 {limit} N m",
             "驱动器已使能但没有转矩：电机电缆、电流限值、转矩比例。",
             "制动器保持抱紧。检查电机电缆和驱动器的转矩限值，然后复位。"),
    ),
    # Fault catalogue C8 and decision 0014: a failed brake is tested again or released by service.
    Definition(
        Code.BRK_08, _WARN, Reaction.W,
        Text("Brake test failed", "Brake test failed: {measured}",
             "The brake slips below its test torque, or the motor does not give it (then nothing moved).",
             "Nothing moves until a brake test passes, or service resets. Inspect the brake and the motor's torque."),
        Text("制动器测试未通过", "制动器测试未通过：{measured}",
             "制动器在测试转矩以下打滑，或电机没有给出转矩（此时没有任何移动）。",
             "在制动器测试通过或维修人员复位之前，一切不能运动。检查制动器和电机转矩。"),
        lock=True, blocks_motion=True, before_motion=Words.TEST_OR_SERVICE,
    ),
    # Fault catalogue C9: counted in retained memory.
    Definition(
        Code.BRK_09, _WARN, Reaction.W,
        Text("Brake due for service",
             "The brake has stopped the turning axis {measured} times, service due at {limit}",
             "Torque off in motion: emergency stops, lost mains, faults.",
             "Measure the air gap and the lining, or replace the brake. The axis goes on."),
        Text("制动器待维修", "制动器已使运动中的轴停止 {measured} 次，达到 {limit} 次时应维修",
             "运动中切断转矩：急停、主电源丢失、故障。", "测量气隙和摩擦片，或更换制动器。轴继续运行。"),
    ),
    Definition(
        Code.BRK_10, _STOP, _QS,
        Text("Sag after release",
             "Moved {measured:.4f} deg after the brake opened, limit {limit:.4f} deg",
             "The drive does not hold the load: preload, gains or torque limit.",
             "The brake was closed again. Check the learned holding torque and the drive's gains, then reset."),
        Text("松开后下沉", "制动器松开后移动了 {measured}°，限值 {limit}°",
             "驱动器没有保持住负载：预加转矩、增益或转矩限值。",
             "制动器已重新抱紧。检查学习到的保持转矩和驱动器增益，然后复位。"),
    ),
    Definition(
        Code.BRK_11, _STOP, _HOLD,
        Text("Load still moving", "Still {measured:.2f} deg/s, {time_s:.1f} s after torque off and brake",
             "The brake does not stop the load.", _SECURE),
        Text("负载仍在运动", "转矩切断并制动 {time_s} s 后仍为 {measured} °/s", "制动器没有使负载停住。",
             _SECURE_ZH),
        lock=True, horn=True,
    ),
    # Follows the alarm that asked for torque (BRK-03, BRK-04, BRK-11): neither brake nor motor holds the load. Torque
    # that is limited still slows the load down, so it goes off only where it drives the motion.
    Definition(
        Code.BRK_13, _STOP, Reaction.W,
        Text("Load moving",
             "The load moves although brake and motor should hold it: {measured:.3f} deg so far, {speed:.2f} deg/s",
             "The brake slips and the motor does not hold the load: torque limit, drive, feedback.",
             "Everyone leaves the room. Secure the load from outside its reach and call service."),
        Text("负载在运动", "制动器和电机应当保持负载，但负载仍在运动：已移动 {measured}°，速度 {speed} °/s",
             "制动器打滑且电机未能保持负载：转矩限值、驱动器、反馈。",
             "所有人员离开房间。从负载可及范围之外固定负载并联系维修。"),
        lock=True, horn=True,
    ),
    # Fault catalogue C1 and C5 with a brake contact that lies, or a torque reading that does: torque is asked for and
    # the shaft does not answer. The two cannot be told apart, and torque off with the brake is right for both.
    Definition(
        Code.BRK_14, _STOP, _TO,
        Text("Torque without effect",
             "Torque {measured:.3g} N m without effect: {speed:.2f} deg/s while {command:.2f} deg/s was commanded",
             "The brake is closed though its contact says open, the shaft is blocked, or the motor does not give "
             "the torque that the drive reports.",
             "Check brake, motor cable and drive, then reset."),
        Text("转矩无效果", "转矩 {measured} N m 没有效果：指令 {command} °/s，实际 {speed} °/s",
             "制动器已抱紧而触点显示松开、轴被卡住，或电机没有给出驱动器报告的转矩。",
             "检查制动器、电机电缆和驱动器，然后复位。"),
    ),
    # Fault catalogue D1: raised by the status word; the following error would show it much later.
    Definition(
        Code.DRV_01, _STOP, _TO,
        Text("Drive fault", "The drive reports a fault: {measured}", "The drive switched itself off.",
             _CHECK_DRIVE),
        Text("驱动器故障", "驱动器报告故障：{measured}", "驱动器自行关断。", _CHECK_DRIVE_ZH),
    ),
    Definition(
        Code.DRV_02, _WARN, Reaction.W,
        Text("Drive warning", "The drive reports a warning",
             "Temperature, overload or supply near its limit.",
             "Read the drive's display. The axis goes on."),
        Text("驱动器警告", "驱动器报告警告", "温度、过载或供电接近限值。",
             "查看驱动器的显示。轴继续运行。"),
    ),
    # Fault catalogue D3: the brake stays closed, and no transition is tried again by itself.
    Definition(
        Code.DRV_03, _STOP, _TO,
        Text("Drive stuck", "Drive stuck in {measured} for {time_ms:.0f} ms, expected {command}",
             "The drive does not make the commanded step: missing release, local control, wrong parameter.",
             _CHECK_DRIVE),
        Text("驱动器卡住", "驱动器停留在{measured}已 {time_ms} ms，应为{command}",
             "驱动器没有执行要求的步骤：缺少释放信号、本地控制、参数错误。", _CHECK_DRIVE_ZH),
    ),
    # Fault catalogue D4: without torque only the brake stops the load.
    Definition(
        Code.DRV_04, _STOP, _TO,
        Text("Drive lost its enable", "Drive went to {measured} without being asked",
             "Another party switched the drive off: release input, tool, supply.",
             _CHECK_DRIVE),
        Text("驱动器失去使能", "驱动器未经要求进入{measured}",
             "他人或他物关断了驱动器：释放输入、工具、供电。", _CHECK_DRIVE_ZH),
    ),
    # Fault catalogue D7: a drive that does not follow its ramp is braked by the brake.
    Definition(
        Code.DRV_07, _STOP, _TO,
        Text("Quick stop not obeyed",
             "Speed {measured:.2f} deg/s in a quick stop, ramp allows {limit:.2f} deg/s",
             "The drive does not brake as set, or its speed feedback is wrong.", _CHECK_DRIVE),
        Text("快速停止未执行", "快速停止中速度 {measured} °/s，斜坡允许 {limit} °/s",
             "驱动器没有按设定制动，或其速度反馈有误。", _CHECK_DRIVE_ZH),
    ),
    # Fault catalogue B7: a quick stop where the torque is nearly used up, so the brake closes while the motor holds.
    Definition(
        Code.CTL_06, _WARN, Reaction.W,
        Text("Holding torque high",
             "Holding torque {measured:.0f} % of rated: {torque:.3g} N m at standstill",
             "The load is out of balance, or something was put on it.",
             "Take off what was put on, check the balance. Above 90 % the brake holds, and power goes off."),
        Text("保持转矩偏高", "保持转矩为额定值的 {measured} %：静止时 {torque} N m", "负载不平衡，或有物体置于其上。",
             "取下所加物体，检查平衡。超过 90 % 时由制动器保持并断电。"),
    ),
    # Fault catalogue B9: the drive's ramp does not need the loop that oscillates.
    Definition(
        Code.CTL_08, _STOP, _QS,
        Text("Oscillation",
             "Speed swings by {measured:.2f} deg/s to both sides of its set-point, {rate:.1f} times a second "
             "for {time_s:.1f} s",
             "Gains too high, or play in the gear.",
             "Check the gains of position and speed loop and the play of the gear, then reset."),
        Text("振荡", "速度在设定值两侧摆动 {measured} °/s，每秒 {rate} 次，已 {time_s} s", "增益过高，或齿轮有间隙。",
             "检查位置环和速度环的增益及齿轮间隙，然后复位。"),
    ),
    # No torque: the drive cannot ramp, so it is never a quick stop.
    Definition(
        Code.DRV_13, _STOP, _TO,
        Text("Torque lost",
             "Torque {measured:.1f} N m while the speed is {deviation:.2f} deg/s off its command for {time_ms:.0f} ms",
             "The drive is enabled and gives no torque: power stage, motor cable, torque limit.",
             _CHECK_DRIVE),
        Text("转矩丧失", "速度偏离指令 {deviation} °/s 已 {time_ms} ms，而转矩为 {measured} N m",
             "驱动器已使能但没有转矩：功率级、电机电缆、转矩限值。", _CHECK_DRIVE_ZH),
    ),
    # The axis goes on: only what is judged by torque is blind, and nothing learns from the reading meanwhile. In the
    # torque proof it is a quick stop, and the brake stays closed.
    Definition(
        Code.DRV_14, _WARN, Reaction.W,
        Text("Torque reading implausible", "{measured}",
             "The drive reports a torque that it does not give: current sensor, scaling, mapping of 6077. At power-up "
             "also a brake that does not hold: the load hangs on the motor.",
             "A motion under way goes on, a power-up is stopped. Switch off, check the torque reading and the brake, "
             "then reset. No motion before."),
        Text("转矩读数不可信", "{measured}",
             "驱动器报告的转矩并非其输出：电流传感器、比例、6077 映射。上电时也可能是制动器未抱住：负载由电机承担。",
             "进行中的运动继续，上电过程停止。断电，检查转矩读数和制动器，然后复位。此前不得运动。"),
        blocks_motion=True,
    ),
    # Fault catalogue G9: the hardware acts; the program mirrors it within a scan.
    Definition(
        Code.INT_03, _STOP, _TO,
        Text("Emergency stop", "The emergency-stop chain opened at {measured}",
             "A button was pressed or the chain is broken. The hardware acts; this mirrors it.",
             "Release the button when it is safe, reset, switch on again."),
        Text("急停", "急停回路在 {measured} 断开",
             "有人按下按钮或回路断线。硬件自行动作；此处只是反映。", "安全时松开按钮，复位，重新上电。"),
    ),
    # Fault catalogue G7: fail-safe, so a broken wire is the same as a touched sensor.
    Definition(
        Code.INT_01, _STOP, _QS,
        Text("Collision interlock", "The collision interlock opened at {measured}",
             "A collision sensor was touched, or its wire is broken.",
             "Look at the axis from all sides. Clear the way, then reset. Nothing moves while it is open: to "
             "free a sensor that stays touched, call service."),
        Text("防碰撞联锁", "防碰撞联锁在 {measured} 时断开", "碰撞传感器被触碰，或其导线断开。",
             "从各个方向查看轴。排除障碍后复位。联锁断开期间一切不能运动：若传感器一直被压住，联系维修。"),
    ),
    # Fault catalogue G8: pulses of a loose wire; each is latched by its first edge.
    Definition(
        Code.INT_02, _STOP, _QS,
        Text("Interlock chatters",
             "Input {name} opened {measured} times within {time_s:.0f} s, limit {limit} a minute",
             "A loose wire, a worn contact, or a sensor at its edge.",
             "Repair wire, plug or sensor, then reset. Do not go on with an interlock that chatters."),
        Text("联锁抖动", "输入 {name} 在 {time_s} s 内断开 {measured} 次，限值每分钟 {limit} 次",
             "导线松动、触点磨损，或传感器处于临界位置。", "修复导线、插头或传感器后复位。联锁抖动时不要继续运行。"),
    ),
    # Fault catalogue G10: one channel that does not switch may not switch next time either.
    Definition(
        Code.INT_04, _STOP, _TO,
        Text("Emergency-stop channels differ",
             "The two channels of the emergency-stop chain have differed for {time_ms:.0f} ms, limit {limit:.0f} ms",
             "A welded contact, a broken wire or a button that is half pressed.",
             "Call service: the chain must be tested channel by channel before anybody relies on it."),
        Text("急停通道不一致", "急停回路两个通道不一致已 {time_ms} ms，限值 {limit} ms",
             "触点熔焊、导线断开或按钮只按下一半。", "联系维修：在依赖急停之前必须逐通道检验回路。"),
        lock=True,
    ),
    # Fault catalogue G11: the machine file may make it a quick stop.
    Definition(
        Code.INT_07, _WARN, Reaction.HLT,
        Text("Room door", "The room door opened at {measured}",
             "Somebody opened the door, or the permit that stands for it was taken away.",
             "See that nobody is in danger, close the door, reset. No motion before."),
        Text("机房门", "机房门在 {measured} 时打开", "有人开门，或代替它的许可信号被撤销。",
             "确认无人处于危险中，关门，复位。此前不能运动。"),
        blocks_motion=True,
    ),
    Definition(
        Code.INT_08, _WARN, Reaction.HLT,
        Text("Motion permit", "The motion permit was taken away at {measured}",
             "The room took its permit away while the axis moved, or a wire of it is broken.",
             "See why. When the permit is given again: reset, then press the key or give the command again."),
        Text("运动许可", "运动许可在 {measured} 时被撤销", "轴运动时机房撤销了许可，或许可线路断开。",
             "查明原因。许可恢复后：复位，然后重新按键或重新下达命令。"),
        blocks_motion=True,
    ),
    Definition(
        Code.INT_06, _STOP, _QS,
        Text("Quick stop asked for",
             "Quick stop by the operator at {measured}",
             "The operator asked for it.", "Reset, switch on again."),
        Text("要求快速停止", "操作员要求快速停止，在 {measured}", "由操作员要求。",
             "复位，重新上电。"),
    ),
    # Fault catalogue G14: the brake closes by its spring; the mirror closes it in order.
    Definition(
        Code.PWR_01, _STOP, _TO,
        Text("Mains lost", "Mains no longer ready at {measured}",
             "Supply switched off or failed.", "Restore the supply, reset, switch on again."),
        Text("主电源丢失", "主电源在 {measured} 时不再就绪", "供电被切断或失效。",
             "恢复供电，复位，重新上电。"),
    ),
    # Fault catalogue G12: a warning, then no new motion, then a stop, before the drive trips by itself.
    Definition(
        Code.THM_01, _WARN, Reaction.W,
        Text("Motor warm", "The motor is at {measured:.0f} % of its thermal limit, warning at {limit:.0f} %",
             "More torque than rated for too long, or the motor's cooling is poor.",
             "Move less or slower; check balance, friction and cooling."),
        Text("电机偏热", "电机已达热极限的 {measured} %，警告值 {limit} %",
             "转矩超过额定值的时间过长，或电机冷却不良。", "减少运动或降低速度；检查平衡、摩擦和冷却。"),
    ),
    # Fault catalogue G13: the axis goes on, and the model alone has half of the limit.
    Definition(
        Code.THM_02, _WARN, Reaction.W,
        Text("Motor temperature sensor",
             "The motor's temperature sensor shows {measured:.0f} C, possible are {low:.0f} to {high:.0f} C",
             "The sensor or its wire is open or shorted.",
             "Have the sensor repaired. Until then the motor counts as twice as warm as computed: it may have to "
             "rest sooner."),
        Text("电机温度传感器", "电机温度传感器显示 {measured} C，可能范围为 {low} 至 {high} C",
             "传感器或其导线断路或短路。", "请修复传感器。在此之前电机按计算温升的两倍计：可能需要更早休息。"),
    ),
    Definition(
        Code.THM_03, _WARN, Reaction.W,
        Text("Motor hot",
             "The motor is at {measured:.0f} % of its thermal limit, no new motion from {limit:.0f} % on; {ready}",
             "More torque than rated for too long, or the motor's cooling is poor.",
             "The motion under way ends as planned. Switch power off and wait; then reset."),
        Text("电机过热", "电机已达热极限的 {measured} %，自 {limit} % 起不再开始新运动；{ready}",
             "转矩超过额定值的时间过长，或电机冷却不良。", "当前运动按计划结束。断电等待，然后复位。"),
        blocks_motion=True, before_motion=Words.COOL_FIRST,
    ),
    Definition(
        Code.THM_04, _STOP, _QS,
        Text("Motor too hot", "The motor is at {measured:.0f} % of its thermal limit; {ready}",
             "More torque than rated for too long, or the motor's cooling is poor.",
             "Let the motor cool with power off, then reset. Find out what took the torque before moving again."),
        Text("电机温度超限", "电机已达热极限的 {measured} %；{ready}",
             "转矩超过额定值的时间过长，或电机冷却不良。", "断电让电机冷却，然后复位。再次运动之前查明转矩的去向。"),
    ),
)  # fmt: skip
