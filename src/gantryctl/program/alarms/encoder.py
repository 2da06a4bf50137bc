"""Rows of the alarm table: encoder."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code, Definition, Reaction, Severity, Text
from gantryctl.program.alarms.words import Words

_STOP, _WARN = Severity.STOP, Severity.WARNING
_TO: Final = Reaction.TORQUE_OFF

_CALL: Final = "Do not reset. Check encoder cable and plug, then call service."
_CALL_ZH: Final = "请勿复位。检查编码器电缆和插头，然后联系维修。"

ENCODER: Final = (
    # Fault catalogue A1: on a wrong count the drive's own ramp would run away, so torque off, never a quick stop.
    Definition(
        Code.ENC_01, _STOP, _TO,
        Text("Position jumped", "Position jumped {measured:.4f} deg in one scan, limit {limit:.4f} deg",
             "The reading changed by more than the axis can move in a scan. The position is no longer valid.",
             _CALL),
        Text("位置跳变", "一个扫描周期内位置跳变 {measured}°，限值 {limit}°",
             "读数变化超过轴在一个扫描周期内可能的运动。位置不再有效。", _CALL_ZH),
        lock=True,
    ),
    # Fault catalogue A2, A3: with a frozen count the drive would accelerate on its ramp instead of braking.
    Definition(
        Code.ENC_02, _STOP, _TO,
        Text("Encoder frozen",
             "Encoder value unchanged for {time_ms:.0f} ms while {measured}",
             "The encoder, its cable or its evaluation has stopped, the motor is blocked, "
             "or the drive gives no torque.", _CALL),
        Text("编码器冻结", "{measured}时编码器值 {time_ms} ms 未变化",
             "编码器、其电缆或其信号处理已停止，电机被卡住，或驱动器不输出转矩。", _CALL_ZH),
        lock=True,
    ),
    # Fault catalogue A4: one reading is bridged by prediction, which may be wrong by 0.001 deg at most.
    Definition(
        Code.ENC_03, _WARN, Reaction.W,
        Text("One bad encoder reading", "{measured} bad encoder reading, used prediction",
             "A reading came with a checksum error. One is bridged; the count is kept.",
             "If it comes back: check the encoder cable's screen and plug."),
        Text("一次编码器坏读数", "{measured} 次编码器坏读数，已用预测值代替",
             "一次读数校验错误。单次可以跨越；已计数。", "若再次出现：检查编码器电缆的屏蔽和插头。"),
    ),
    Definition(
        Code.ENC_04, _STOP, _TO,
        Text("Too many bad encoder readings",
             "{measured} bad encoder readings within {time_ms:.0f} ms, limit {limit}",
             "Checksum errors in a row: cable, screen, plug or encoder.", _CALL),
        Text("编码器坏读数过多", "{time_ms} ms 内有 {measured} 次编码器坏读数，限值 {limit}",
             "连续校验错误：电缆、屏蔽、插头或编码器。", _CALL_ZH),
        lock=True,
    ),
    # Fault catalogue A6: what the encoder itself doubts is not judged by the controller.
    Definition(
        Code.ENC_05, _STOP, _TO,
        Text("Encoder alarm", "The encoder reports an alarm",
             "Lamp, signal amplitude, position error or supply inside the encoder.",
             "Do not reset. Read the encoder's alarm word with the drive's tool and call service."),
        Text("编码器报警", "编码器自身报警", "编码器内部的光源、信号幅值、位置错误或供电。",
             "请勿复位。用驱动器工具读取编码器报警字并联系维修。"),
        lock=True,
    ),
    # Fault catalogue A7: the count is still right, so the axis goes on.
    Definition(
        Code.ENC_06, _WARN, Reaction.W,
        Text("Encoder warning", "The encoder reports a warning: lamp reserve, temperature or battery",
             "The encoder still measures well, but will fail in time.",
             "Plan its service. The axis goes on."),
        Text("编码器警告", "编码器发出警告：光源余量、温度或电池", "编码器仍测量正常，但不会一直如此。",
             "安排维修。轴继续运行。"),
    ),
    # Decision 0010: the load-side encoder corrects the motor's, so a wrong one of the two is motion.
    Definition(
        Code.ENC_07, _STOP, _TO,
        Text("Encoders disagree",
             "Load-side encoder {measured:.4f} deg away from motor encoder and maps, limit {limit:.4f} deg",
             "One of the two encoders is wrong, the calibration belongs to another machine, or something between "
             "motor and ring has slipped or broken.",
             "Compare the angle with the marks. Find out which encoder is right before anything moves."),
        Text("编码器不一致", "负载侧编码器与电机编码器及误差表相差 {measured}°，限值 {limit}°",
             "两个编码器之一有误、标定属于另一台机器，或电机与齿圈之间有打滑或断裂。",
             "将角度与刻线比较。在任何运动之前先查明哪个编码器正确。"),
        lock=True,
    ),
    # Fault catalogue A15: two signals of one encoder that do not belong together; nobody knows which is right.
    Definition(
        Code.ENC_12, _STOP, _TO,
        Text("Encoder scale or sign wrong", "{measured}",
             "Position, speed and torque do not belong together: scaling or sign of one of them, "
             "or the position stays behind.",
             "Do not move again. Check encoder resolution, polarity and scaling in drive and machine file, "
             "and compare the angle."),
        Text("编码器比例或符号错误", "{measured}",
             "位置、速度与转矩不相符：其中之一的比例或符号有误，或位置滞后。",
             "不要再运动。检查驱动器和机器文件中的编码器分辨率、极性和比例，并核对角度。"),
        lock=True,
    ),
    # Fault catalogue A8: the count is right while the supply is on, and nothing is known once it was off.
    Definition(
        Code.ENC_13, _WARN, Reaction.W,
        Text("Encoder battery", "The battery of the encoder is empty or missing",
             "The battery keeps the turns while the supply is off. Without it turns can be lost unseen.",
             "Keep the supply on and have the battery changed. Then service compares the angle with the marks and "
             "resets. No motion before."),
        Text("编码器电池", "编码器电池耗尽或缺失", "断电期间由电池保持圈数。没有电池时圈数可能悄然丢失。",
             "保持供电并更换电池。然后由维修人员将角度与刻线比较并复位。此前不能运动。"),
        lock=True, blocks_motion=True, before_motion=Words.SERVICE_FIRST,
    ),
    # No torque and no brake can change the speed like that: the reading did, or the encoder's coupling.
    Definition(
        Code.ENC_14, _STOP, _TO,
        Text("Speed reading impossible", "Speed reading {measured}, limit {limit:.3g} deg/s",
             "Nothing can turn the motor, or change its speed, like that: encoder, coupling or speed reading.", _CALL),
        Text("速度读数不可能", "速度读数 {measured}，限值 {limit} °/s",
             "电机不可能这样转动或变速：编码器、联轴器或速度读数。", _CALL_ZH),
        lock=True,
    ),
)  # fmt: skip
