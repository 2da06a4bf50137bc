"""Rows of the alarm table: why an axis is not switched on after a start."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code, Definition, Reaction, Severity, Text

_REF: Final = Severity.REFUSED
_SET_ZERO: Final = "Read the witness mark, then `gantryctl encoder set-zero --angle A --witness TEXT`."
_SET_ZERO_ZH: Final = "读取见证标记，然后执行 `gantryctl encoder set-zero --angle A --witness TEXT`。"

START: Final = (
    Definition(
        Code.ENC_08, _REF, Reaction.REF,
        Text("Encoder off by whole turns",
             "the reading is off by {moved_deg:+.3f} deg, whole motor turns",
             "The multiturn part of the encoder lost turns, or the axis was moved by exactly that while off.",
             _SET_ZERO),
        Text("编码器偏差整圈", "读数偏差 {moved_deg}°，为电机整圈数",
             "编码器多圈部分丢圈，或断电期间轴恰好移动了这一角度。", _SET_ZERO_ZH),
    ),
    Definition(
        Code.ENC_09, _REF, Reaction.REF,
        Text("Moved while off",
             "the axis moved {moved_deg:+.3f} deg while off (limit {limit_deg:g} deg)",
             "It was moved, or the brake let it creep. Up to the limit is gears settling: accepted and recorded.",
             "Look at the axis; `gantryctl reset` acknowledges it under your name."),
        Text("断电期间移动", "断电期间轴移动 {moved_deg}°（限值 {limit_deg}°）",
             "有人移动了它，或制动器缓慢滑动。限值以内视为齿轮回位：接受并记录。",
             "查看轴；`gantryctl reset` 以您的名义确认。"),
    ),
    # Fault catalogue A13: without proof of the angle only a witness mark decides.
    Definition(
        Code.ENC_10, _REF, Reaction.REF,
        Text("Angle not valid", "the angle is not valid: {why}",
             "No zero offset, more than 1 deg moved while off, or a reading that cannot be true.",
             _SET_ZERO),
        Text("角度无效", "角度无效：{why}", "没有零点偏移，断电期间移动超过 1°，或读数不可能为真。",
             _SET_ZERO_ZH),
    ),
    Definition(
        Code.ENC_11, _REF, Reaction.REF,
        Text("Another encoder", "the encoder is {serial}, the stored zero offset belongs to another one",
             "The encoder or the motor was replaced, or the memory is of another machine.", _SET_ZERO),
        Text("编码器已更换", "编码器为 {serial}，保存的零点偏移属于另一个编码器",
             "更换了编码器或电机，或保存的数据属于另一台机器。", _SET_ZERO_ZH),
    ),
    Definition(
        Code.CFG_ENC_01, _REF, Reaction.REF,
        Text("Encoder wraps near the travel",
             "the encoder's range ends {minus_deg:.1f} deg below and {plus_deg:.1f} deg above the travel, "
             "too near",
             "Zero is badly placed in the multiturn range: the reading would jump by the whole range in motion.",
             "Turn the encoder on its shaft or mount it with its range centred, then `gantryctl encoder set-zero`."),
        Text("编码器量程终点靠近行程", "编码器量程终点在行程以下 {minus_deg}°、以上 {plus_deg}°，过近",
             "零点在多圈量程内位置不当：运动中读数会跳变整个量程。",
             "转动编码器轴或居中安装编码器，然后 `gantryctl encoder set-zero`。"),
    ),
    Definition(
        Code.CFG_CAN_01, _REF, Reaction.REF,
        Text("Drive parameters forbid enabling",
             "the drive's parameters forbid enabling it: {parameters}",
             "With these parameters the drive would not stop the axis by itself when the controller is gone.",
             "Correct the parameters in the drive or in the machine file, then start again."),
        Text("驱动器参数禁止使能", "驱动器参数禁止使能：{parameters}",
             "在这些参数下，控制器失效时驱动器不会自行停止轴。",
             "更正驱动器或机器文件中的参数，然后重新启动。"),
    ),
    Definition(
        Code.CFG_CAN_02, _REF, Reaction.REF,
        Text("Not commissioned", "the machine is not commissioned: {why}",
             "There is no commissioning record for this drive with this configuration: its stops are not proven.",
             "Run `gantryctl commission --config FILE`."),
        Text("未调试", "机器未调试：{why}", "没有该驱动器在此配置下的调试记录：其停止功能未经证明。",
             "用 `gantryctl commission --config FILE` 调试机器。"),
    ),
    Definition(
        Code.CFG_CAN_03, _REF, Reaction.REF,
        Text("Stop without controller not proven", "the stop without a controller is not proven: {why}",
             "It is not proven that this drive stops the axis of a silent controller since its last restart.",
             "Run `gantryctl commission --only silence --config FILE`: some seconds, at standstill."),
        Text("未证明控制器静默时停止", "未证明无控制器时停止：{why}",
             "驱动器自上次重启以来，尚未证明控制器静默时它会停止轴。",
             "`gantryctl commission --only silence --config FILE` 在静止状态下数秒内证明。"),
    ),
    Definition(
        Code.CFG_CAN_04, _REF, Reaction.REF,
        Text("Safety property lacking", "nothing gives these, and no person has accepted that: {lacks}",
             "The ledger of the machine names for each safety property what gives it; an input whose bit in "
             "[can.inputs] is -1 would count as good whatever happens.",
             "Wire or set up what is missing, or have it accepted by name: "
             "`gantryctl commission accept --lack NAME --by PERSON --because TEXT --config FILE`."),
        Text("缺少安全特性", "以下特性无任何保障，也无人签字接受：{lacks}",
             "安全台账逐项列出每个安全特性由什么保障；[can.inputs] 中位为 -1 的输入无论发生什么都视为正常。",
             "接线或设置所缺部分，或由负责人签字接受："
             "`gantryctl commission accept --lack NAME --by PERSON --because TEXT --config FILE`。"),
    ),
    Definition(
        Code.CFG_CAN_05, _REF, Reaction.REF,
        Text("Drive not usable", "nothing makes up for what this drive and machine lack: {lacks}",
             "No proof of commissioning and no person's name stands for these.",
             "Set up, add or replace what is named; `gantryctl eds check FILE --config FILE` says it of a drive "
             "before it is bought."),
        Text("驱动器不可用", "该驱动器和机器所缺的特性无可替代：{lacks}",
             "调试证明和个人签字都不能代替这些特性。",
             "设置、补充或更换所列部分；购买前可用 `gantryctl eds check FILE --config FILE` 检查驱动器。"),
    ),
    # A controller that was killed leaves a drive in fault behind and cannot tell the next one.
    Definition(
        Code.DRV_15, _REF, Reaction.REF,
        Text("Drive in fault before the start", "the drive has been in fault since before this start: {error}",
             "The controller of an earlier run was killed or lost the bus, or the drive stopped by itself meanwhile.",
             "Look at the axis and find out why, then `gantryctl reset`; the same command then goes on."),
        Text("启动前驱动器已处于故障", "本次启动之前驱动器已处于故障：{error}",
             "先前运行的控制器被终止或失去总线，或驱动器在此期间自行停止。",
             "查看轴并查明原因，然后 `gantryctl reset`；之后同一命令继续执行。"),
    ),
    Definition(
        Code.SYS_12, _REF, Reaction.REF,
        Text("Earlier stop not acknowledged",
             "{stopped_by} stopped the axis in an earlier run and is not acknowledged",
             "Each stop by an alarm holds the axis until it is acknowledged, also over a restart.",
             "Look at it (`gantryctl alarms --last`), then `gantryctl reset`."),
        Text("先前的停止未确认", "{stopped_by} 在上次运行中使轴停止，尚未确认",
             "每次报警停止都会保持轴，直到有人查看，重新启动后也是如此。",
             "查看报警（`gantryctl alarms --last`），然后 `gantryctl reset`。"),
    ),
)  # fmt: skip
