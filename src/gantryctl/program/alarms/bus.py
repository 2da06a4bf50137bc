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

BUS: Final = (
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
        Text("Bus down", "The CAN controller sends or receives no more",
             "Bus-off, an open or short cable, or the adapter was unplugged. The drive's own watch stops the axis.",
             _CABLE),
        Text("总线中断", "CAN 控制器不再收发",
             "总线关闭、电缆断路或短路，或适配器被拔下。驱动器自身的监视会使轴停止。", _CABLE_ZH),
    ),
    # Fault catalogue E15: it is unknown whose command the drive follows.
    Definition(
        Code.CAN_12, _STOP, _QS,
        Text("Another master on the bus",
             "Telegrams that only this controller may send came from another sender",
             "A second controller, or a service tool that takes part in control.",
             "Take it off the bus. Service resets, with power off: the drive is set up again."),
        Text("总线上有另一个主站", "只有本控制器可以发送的报文来自别处",
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
    Definition(
        Code.DRV_05, _STOP, _QS,
        Text("Command ignored",
             "The drive is enabled and does not follow the speed command (bit 12 of 6041 is 0)",
             "Local control, a limit inside the drive, or a wrong mode.",
             "Read the drive's own display, remove the cause, then reset."),
        Text("指令被忽略", "驱动器已使能但不跟随速度指令（6041 第 12 位为 0）",
             "本地控制、驱动器内部限值或模式错误。", "查看驱动器自身的显示，排除原因后复位。"),
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
    # Fault catalogue D11: a drive that has booted has lost mapping and settings.
    Definition(
        Code.DRV_11, _STOP, _TO,
        Text("Drive restarted", "The drive has restarted by itself",
             "Its supply failed, or it was reset. It has lost the settings of the controller.",
             "Look for the cause. Reset with power off, or start again: the drive is set up again."),
        Text("驱动器重新启动", "驱动器自行重新启动", "其供电失效，或有人将其复位。它已忘记控制器的设置。",
             "查找原因。断电后复位或重新启动：驱动器将被重新设置。"),
    ),
)  # fmt: skip
