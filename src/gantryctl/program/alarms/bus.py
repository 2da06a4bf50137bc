"""Rows of the alarm table: bus between controller and drive."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code, Definition, Reaction, Severity, Text

_STOP: Final = Severity.STOP
_QS, _TO = Reaction.QUICK_STOP, Reaction.TORQUE_OFF

_CABLE: Final = (
    "Check bus cable, terminators and load. Reset with power off, or start again: the drive is set up again."
)
_CABLE_ZH: Final = "检查总线电缆、终端电阻和负载。断电后复位或重新启动：驱动器将被重新设置。"

_SET_UP_ZH: Final = "断电后复位：驱动器将被重新设置。"
_QUIET: Final = "Look for another sender, a wrong bit rate or a bad cable, then reset."
_QUIET_ZH: Final = "查找其他发送者、错误的波特率或不良电缆，然后复位。"
_WARN: Final = Severity.WARNING

BUS: Final = (
    # Fault catalogue E1: the drive acts on SYNC; without it no command takes effect.
    Definition(
        Code.CAN_01, _STOP, _QS,
        Text("SYNC lost", "The controller's SYNC does not appear on the bus",
             "The adapter does not send, or frames of a higher priority hold the bus.", _CABLE),
        Text("SYNC 丢失", "控制器的 SYNC 没有出现在总线上", "适配器不发送，或更高优先级的帧占用总线。", _CABLE_ZH),
    ),
    # Fault catalogue E2: periods that are late by scans stop the axis by SYS-02.
    Definition(
        Code.CAN_02, _WARN, Reaction.W,
        Text("SYNC period uneven", "Three SYNC periods in a row were off by more than half",
             "The controller's computer is busy.",
             "Look at the scan statistics; give the controller a core of its own."),
        Text("SYNC 周期不均", "连续三个 SYNC 周期偏差超过一半", "控制器的计算机繁忙。",
             "查看扫描统计；为控制器分配独立的核心。"),
    ),
    # Fault catalogue E4, E5: the drive's own loop is sound, so its ramp is; what is old is not believed meanwhile.
    Definition(
        Code.CAN_03, _STOP, _QS,
        Text("Telegram of the drive missing",
             "No telegram with {measured} from the drive for {time_ms:.0f} ms, limit {limit:.0f} ms",
             "The drive's telegrams are lost or come late.",
             "Check bus cable, terminators and load, then reset."),
        Text("驱动器报文缺失", "已有 {time_ms} ms 没有收到驱动器的{measured}报文，限值 {limit} ms",
             "驱动器的报文丢失或迟到。", "检查总线电缆、终端电阻和负载，然后复位。"),
    ),
    # Fault catalogue E7: what is not as mapped is never decoded.
    Definition(
        Code.CAN_04, _STOP, _QS,
        Text("Telegram of a wrong length", "Three telegrams of the drive in a row had a wrong length",
             "The mapping of the drive was changed, or another node uses its identifier.",
             "Find out who. Switch power off and start the controller again: the drive is set up again."),
        Text("报文长度错误", "驱动器连续三个报文长度错误", "驱动器的映射被改变，或另一节点使用其标识符。",
             "查明是谁。断电并重新启动控制器：驱动器将被重新设置。"),
    ),
    # Fault catalogue E8, E10: the drive stops on its own ramp; the controller learns it by the drive's fault.
    Definition(
        Code.CAN_05, _STOP, _TO,
        Text("Drive missed the controller", "The drive stopped by its own watch: {measured}",
             "The controller's frames do not reach the drive, or the controller was held up.", _CABLE),
        Text("驱动器未收到控制器", "驱动器因自身监视而停止：{measured}",
             "控制器的帧未到达驱动器，或控制器被延误。", _CABLE_ZH),
    ),
    # Fault catalogue E9: a drive that is not heard cannot be told to stop; the brake can.
    Definition(
        Code.CAN_06, _STOP, _TO,
        Text("Heartbeat of the drive lost", "The drive's heartbeat is missing",
             "The drive is switched off, has crashed, or its cable is open.", _CABLE),
        Text("驱动器心跳丢失", "没有收到驱动器的心跳", "驱动器已关机、死机，或电缆断开。", _CABLE_ZH),
    ),
    # Fault catalogue A16, E4, E5: a late reading in the position loop is a step of the speed command.
    Definition(
        Code.CAN_07, _STOP, _QS,
        Text("Reading too old", "The drive's reading is {measured:.0f} ms old, limit {limit:.0f} ms",
             "The drive's telegrams come late or not at all.",
             "Check bus cable, terminators and load, then reset."),
        Text("读数过旧", "驱动器的读数已有 {measured} ms，限值 {limit} ms", "驱动器的报文迟到或不来。",
             "检查总线电缆、终端电阻和负载，然后复位。"),
    ),
    # Fault catalogue E11: the drive stops by its own watch of the controller.
    Definition(
        Code.CAN_08, _STOP, _TO,
        Text("Bus down", "The CAN controller sends or receives no more: {measured}",
             "Bus-off, an open or short cable, or the adapter was unplugged. The drive's own watch stops the axis.",
             _CABLE),
        Text("总线中断", "CAN 控制器不再收发：{measured}",
             "总线关闭、电缆断路或短路，或适配器被拔下。驱动器自身的监视会使轴停止。", _CABLE_ZH),
    ),
    # Fault catalogue E12: a flood is counted, not stored.
    Definition(
        Code.CAN_09, _WARN, Reaction.W,
        Text("Flood of emergency messages", "More than ten emergency messages of the drive within a second",
             "A cause that comes and goes quickly, or a drive that repeats its message.",
             "Read the messages in `gantryctl status` and the drive's own display."),
        Text("紧急报文泛滥", "驱动器一秒内超过十条紧急报文", "原因快速反复出现，或驱动器重复发送报文。",
             "查看 `gantryctl status` 中的报文和驱动器自身的显示。"),
    ),
    # Fault catalogue E13: frames of a higher priority may hold back every command.
    Definition(
        Code.CAN_10, _STOP, _QS,
        Text("Bus overloaded", "The bus is full: no room for the controller's frames",
             "Another node floods the bus, or the bit rate is lower than set.", _QUIET),
        Text("总线过载", "总线已满：控制器的帧没有空间", "另一节点充斥总线，或波特率低于设定。", _QUIET_ZH),
    ),
    # Fault catalogue E15: it is unknown whose command the drive follows.
    Definition(
        Code.CAN_12, _STOP, _QS,
        Text("Another master on the bus",
             "A frame that only this controller may send came from another sender: {measured}",
             "A second controller, or a service tool that takes part in control.",
             "Take it off the bus. Service resets, with power off: the drive is set up again."),
        Text("总线上有另一个主站", "只有本控制器可以发送的帧来自别处：{measured}",
             "有第二个控制器，或参与控制的维修工具。", "将其从总线上移除。由维修人员复位。"),
        lock=True,
    ),
    # Fault catalogue E16: outside OPERATIONAL the drive takes no process data.
    Definition(
        Code.CAN_13, _STOP, _TO,
        Text("Drive not operational", "The drive has left the NMT state OPERATIONAL",
             "The drive lost the controller's heartbeat, or another master stopped it.", _CABLE),
        Text("驱动器不在运行状态", "驱动器离开了 NMT 状态 OPERATIONAL",
             "驱动器丢失了控制器的心跳，或被他人停止。", _CABLE_ZH),
    ),
    # Which of two telegrams is the drive's cannot be told: neither is believed, and the drive's own ramp is sound.
    Definition(
        Code.CAN_14, _STOP, _QS,
        Text("Two senders of the drive's telegrams",
             "Telegrams of the drive contradict each other within one SYNC period",
             "Another node sends on the drive's identifiers: two nodes with one node id, or somebody forges them.",
             "Find it and take it off the bus. Service resets, with power off: the drive is set up again."),
        Text("驱动器报文有两个发送者", "同一 SYNC 周期内驱动器的报文互相矛盾",
             "另一节点使用驱动器的标识符：两个节点的节点号相同，或有人伪造报文。",
             "查明并将其从总线上移除。由维修人员断电后复位：驱动器将被重新设置。"),
        lock=True,
    ),
    # Fault catalogue E11: what comes before bus-off.
    Definition(
        Code.CAN_15, _WARN, Reaction.W,
        Text("CAN controller disturbed", "The CAN controller of this computer is disturbed: {measured}",
             "Cable, terminators, bit rate, or a node that spoils frames; bus-off may follow.",
             "Check the bus before the next motion; the report of the run counts how often."),
        Text("CAN 控制器受干扰", "本计算机的 CAN 控制器受干扰：{measured}",
             "电缆、终端电阻、波特率，或某节点破坏帧；随后可能总线关闭。",
             "下次运动前检查总线；运行报告给出次数。"),
    ),
    # What is wired to the node shows its safe state meanwhile, and may ask for more than this.
    Definition(
        Code.CAN_16, _STOP, _QS,
        Text("Node lost", "{measured} is not heard",
             "It is switched off, has restarted, or its cable is open.",
             "Check its supply and cable. Reset with power off, or start again: it is set up again."),
        Text("节点丢失", "没有收到{measured}的报文", "它已关机、重新启动，或电缆断开。",
             "检查其电源和电缆。断电后复位或重新启动：它将被重新设置。"),
    ),
    # Fault catalogue D5: a drive that does not obey is not asked for a ramp. Where a quick stop is gentle, one that is
    # obeyed all the same takes 8.9 deg from 3.6 deg/s (a crane), torque off and brake 3.2.
    Definition(
        Code.DRV_05, _STOP, _TO,
        Text("Command ignored", "The drive ignores the command: {measured}",
             "Local control, a limit inside the drive, or a wrong mode.",
             "Read the drive's own display, remove the cause, then reset."),
        Text("指令被忽略", "驱动器忽略指令：{measured}",
             "本地控制、驱动器内部限值或模式错误。", "查看驱动器自身的显示，排除原因后复位。"),
    ),
    # Fault catalogue D6: in another mode 60FF means nothing, or something else.
    Definition(
        Code.DRV_06, _STOP, _TO,
        Text("Wrong mode", "The drive does not show mode 9, cyclic synchronous velocity (6061)",
             "A service tool, or the drive itself, has changed the mode.",
             "Find out who. Reset with power off, or start again: the drive is set up again."),
        Text("模式错误", "驱动器未显示模式 9（循环同步速度，6061）", "调试工具或驱动器自身改变了模式。",
             "查明是谁。" + _SET_UP_ZH),
    ),
    # Fault catalogue D8: a drive that keeps an old target turns the moment it is enabled.
    Definition(
        Code.DRV_08, _STOP, _TO,
        Text("Stale target", "The target speed in the drive (60FF) is not 0 while it is off",
             "The controller's commands do not reach the drive, or another master writes them.",
             "Find out why. Reset with power off, or start again: the drive is set up again."),
        Text("残留目标", "驱动器断电状态下目标速度（60FF）不为 0", "控制器的指令未到达驱动器，或另一主站写入。",
             "查明原因。" + _SET_UP_ZH),
    ),
    # Fault catalogue D9: read again round robin within 60 s (decision 0012).
    Definition(
        Code.DRV_09, Severity.WARNING, Reaction.HLT,
        Text("Drive parameter changed", "A parameter of the drive is not what it was set to: {measured}",
             "It was changed while the axis was in operation, by a service tool or at the drive itself.",
             "Find out who. Switch power off and reset: the drive is set up again. No motion before."),
        Text("驱动器参数被改变", "驱动器的一个参数不再是设定值：{measured}",
             "有人在驱动器运行时用调试工具或在驱动器本体上改变了它。",
             "查明是谁。断电后复位：驱动器将被重新设置。此前不能运动。"),
        blocks_motion=True,
    ),
    # Fault catalogue D10: a stop feeds its energy back, 36 kW at the peak of a quick stop from 6 deg/s.
    Definition(
        Code.DRV_10, _STOP, _TO,
        Text("DC link overvoltage", "The drive reports {measured}",
             "The brake resistor is missing, open or too small for the energy of a stop.",
             "Check the brake resistor and its chopper, then reset. No fast motion before."),
        Text("直流母线过压", "驱动器报告{measured}", "制动电阻缺失、断路或对停车能量来说太小。",
             "检查制动电阻及其斩波器，然后复位。此前不要快速运动。"),
    ),
    # Fault catalogue D11: a drive that has booted has lost mapping and settings.
    Definition(
        Code.DRV_11, _STOP, _TO,
        Text("Drive restarted", "The drive has restarted by itself",
             "Its supply failed, or it was reset. It has lost the settings of the controller.",
             "Look for the cause. Reset with power off, or start again: the drive is set up again."),
        Text("驱动器重新启动", "驱动器自行重新启动", "其供电失效，或有人将其复位。它已忘记控制器的设置。",
             "查找原因。断电后复位或重新启动：驱动器将被重新设置。"),
    ),
    # Fault catalogue D12: what is not known to be a warning stops the axis; a fault shows in the state instead.
    Definition(
        Code.DRV_12, _STOP, _QS,
        Text("Drive complains", "Emergency message of the drive without a fault: {measured}",
             "The drive reports an error and goes on.", "Look the code up in the drive's manual, then reset."),
        Text("驱动器报错", "驱动器的紧急报文但无故障状态：{measured}", "驱动器报告错误但继续运行。",
             "在驱动器手册中查找该代码，然后复位。"),
    ),
)  # fmt: skip
