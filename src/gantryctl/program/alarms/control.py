"""Rows of the alarm table: position control, travel and limit switches."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code, Definition, Reaction, Severity, Text

_STOP, _WARN = Severity.STOP, Severity.WARNING
_QS, _TO = Reaction.QUICK_STOP, Reaction.TORQUE_OFF

_INWARD_ZH: Final = "复位，上电，然后向内移动：返回方向是开放的。"

CONTROL: Final = (
    # Fault catalogue B2: checked before the output of each scan; no drive defines what it does with such a value.
    Definition(
        Code.CTL_02, _STOP, _QS,
        Text("Value not finite", "{measured} is not a finite number",
             "A reading or a computed command was not finite. It never reaches the drive.",
             "Keep the trace and report it; reset when the cause is known."),
        Text("数值不是数", "{measured} 不是有限的数",
             "某个读数或计算出的指令不是有限的数。它绝不会到达驱动器。",
             "保存记录并报告；原因清楚后复位。"),
    ),
    # Fault catalogue B3: the band grows with the speed, as the lag of the loop does.
    Definition(
        Code.CTL_03, _STOP, _QS,
        Text("Following error",
             "Following error {measured:.3f} deg, limit {limit:.3f} deg at {speed:.2f} deg/s",
             "The axis does not follow its set-point: load, friction, torque limit or gains.",
             "Look at torque and following error in the trace, remove the cause, then reset."),
        Text("跟随误差", "{speed} °/s 时跟随误差 {measured}°，限值 {limit}°",
             "轴不跟随设定值：负载、摩擦、转矩限值或增益。",
             "在记录中查看转矩和跟随误差，排除原因后复位。"),
    ),
    # Fault catalogue B4: a quick stop where the drive obeys; much faster means that it does not.
    Definition(
        Code.CTL_04, _STOP, _QS,
        Text("Overspeed", "Speed {measured:.2f} deg/s, limit {limit:.2f} deg/s",
             "The axis runs faster than commanded: drive scaling, gains, or a load that pushes.",
             "Check the drive's speed scaling and ceiling, then reset."),
        Text("超速", "速度 {measured} °/s，限值 {limit} °/s",
             "轴比指令快：驱动器比例、增益，或负载在推动。", "检查驱动器的速度比例和上限，然后复位。"),
    ),
    # Fault catalogue B5, B6: a drive with a wrong sign would ramp in the wrong direction.
    Definition(
        Code.CTL_05, _STOP, _TO,
        Text("Moves against command",
             "Speed {measured:.2f} deg/s while {command:.2f} deg/s was commanded, "
             "limit of the difference {limit:.2f} deg/s",
             "The drive does not obey its speed command: sign, scaling or speed feedback.",
             "Do not move again before sign and scaling of the speed have been tested."),
        Text("运动与指令相反", "指令为 {command} °/s 时速度为 {measured} °/s，差值限值 {limit} °/s",
             "驱动器不服从速度指令：符号、比例或速度反馈。", "在检验速度的符号和比例之前不要再运动。"),
    ),
    # Fault catalogue B8: the limit alone is normal while accelerating; with a growing error the load is too heavy. A
    # drive without torque cannot ramp: its quick stop took 4.56 deg from 6 deg/s at a fiftieth of the torque.
    Definition(
        Code.CTL_07, _STOP, _TO,
        Text("Torque saturated",
             "Torque limit reached for {time_ms:.0f} ms while the following error grew to {measured:.3f} deg",
             "The load needs more torque than the drive may give.",
             "Check balance, friction and overload of the drive, then reset."),
        Text("转矩饱和", "转矩达到限值 {time_ms} ms，跟随误差增至 {measured}°",
             "负载所需转矩超过驱动器允许的转矩。", "检查平衡、摩擦和驱动器过载，然后复位。"),
    ),
    Definition(
        Code.CTL_13, _STOP, _QS,
        Text("Standstill lost", "Moved {measured:.4f} deg at standstill, window {limit:.4f} deg",
             "Something moves the axis while it should stand.",
             "Check load, brake and drive, then reset."),
        Text("静止丧失", "静止时移动了 {measured}°，窗口 {limit}°", "轴应当静止时有东西使它移动。",
             "检查负载、制动器和驱动器，然后复位。"),
    ),
    # Fault catalogue B11: judged by the stop point in each scan, so that the stop still ends inside.
    Definition(
        Code.CTL_10, _STOP, _QS,
        Text("Stop point beyond travel",
             "From {measured:.2f} deg/s the axis would come to rest at {position:.2f} deg, limit {limit:.2f} deg",
             "The measured angle and speed would carry the axis over its travel.",
             "Reset, switch on, then move back inward at low speed; check why the axis ran ahead of its set-point."),
        Text("停止点超出行程", "以 {measured} °/s 轴将停在 {position}°，限值 {limit}°",
             "按实测角度和速度，轴将越出行程。", "复位，上电，然后低速向内移动；查明轴为何超前于设定值。"),
    ),
    # Fault catalogue B12: the set-point has arrived, so nothing would ever end the wait.
    Definition(
        Code.CTL_11, _WARN, Reaction.W,
        Text("Not in position",
             "Not in position {time_s:.1f} s after the end of the motion: "
             "error {measured:.4f} deg, window {limit:.4f} deg",
             "The set-point has arrived, the axis has not: friction, gains or torque.",
             "Do not use this angle. Move again; if it comes back, call service."),
        Text("未到位", "运动结束后 {time_s} s 仍未到位：误差 {measured}°，窗口 {limit}°",
             "设定值已到达而轴没有：摩擦、增益或转矩。",
             "不要使用此角度。重新运动；若再次出现，联系维修。"),
    ),
    Definition(
        Code.CTL_12, _WARN, Reaction.W,
        Text("Following error high",
             "Following error {measured:.3f} deg, warning at {limit:.3f} deg, stop at {trip:.3f} deg",
             "The axis follows worse than usual.", "Look at the trend in the trace; plan service."),
        Text("跟随误差偏高", "跟随误差 {measured}°，警告 {limit}°，停机 {trip}°", "轴的跟随比平时差。",
             "查看记录中的趋势；安排维修。"),
    ),
    Definition(
        Code.CTL_19, _WARN, Reaction.W,
        Text("Eccentric moment changed",
             "The eccentric moment has changed by {measured:.3g} kN m since the calibration, limit {limit:.3g} kN m",
             "The load is another than when the axis was identified, or the torque of the motor is read wrong. "
             "Control follows the change up to the limit and no further.",
             "Find out what has changed on the axis. Identify again, or raise [control.compensation.moment_observer] "
             "limit_nm if the load may be so."),
        Text("偏心力矩已改变", "自标定以来偏心力矩改变了 {measured} kN·m，限值 {limit} kN·m",
             "负载与辨识时不同，或电机转矩读数有误。控制只跟随到限值为止。",
             "查明轴上有何改变。重新辨识；若负载允许如此，提高 [control.compensation.moment_observer] limit_nm。"),
    ),
    Definition(
        Code.CTL_22, _WARN, Reaction.W,
        Text("Calibration no longer fits", "Calibration no longer fits: {measured}",
             "The machine has changed since it was identified, or torque or ring encoder are read wrong: the angle of "
             "the load is less accurate than it was.",
             "Find out what has changed. Run `gantryctl identify`: the warning goes with a new calibration and not "
             "before."),
        Text("标定不再适用", "标定不再适用：{measured}",
             "机器自辨识以来已改变，或转矩、环上编码器读数有误：负载角度的精度已降低。",
             "查明有何改变。运行 `gantryctl identify`：有新标定后警告才消失。"),
    ),
    Definition(
        Code.CTL_23, _STOP, _QS,
        Text("Test signal stopped", "Torque {measured:.3g} N m under a test signal, permitted +-{limit:.3g} N m",
             "The signal of a measurement made more torque than the measurement permits: a signal too large, or an "
             "axis that meets an obstacle or swings by itself.",
             "Look at the axis. Reset, switch on again, measure with a smaller torque."),
        Text("测试信号已中止", "测试信号下转矩为 {measured} N m，允许 ±{limit} N m",
             "测量信号产生的转矩超过该测量允许的值：信号过大，或轴碰到障碍、自身摆动。",
             "查看轴。复位，重新上电，用较小的转矩测量。"),
    ),
    # Fault catalogue G2: the last limit in software before the switches.
    Definition(
        Code.LIM_02, _STOP, _QS,
        Text("Over-travel", "Angle {measured:.2f} deg, limit {limit:.2f} deg",
             "The measured angle passed the over-travel limit.",
             "Reset, switch on, then move back inward: the way back is open."),
        Text("超程", "角度 {measured}°，限值 {limit}°", "实测角度越过超程限值。", _INWARD_ZH),
    ),
    Definition(
        Code.LIM_06, _STOP, _QS,
        Text("No-go sector",
             "At {measured:.2f} deg a stop would end at {position:.2f} deg, no-go sector {begin:.2f} to {end:.2f} deg",
             "Measured angle and speed would carry the axis into a sector of [axis] no_go_deg, or have.",
             "Reset, switch on, then move away from the sector: that way is open."),
        Text("禁区", "在 {measured}° 停止将结束于 {position}°，禁区为 {begin}° 至 {end}°",
             "按实测角度和速度，轴将进入或已进入 [axis] no_go_deg 的禁区。", "复位，上电，然后离开禁区：该方向开放。"),
    ),
    # Fault catalogue G3: the way back is open, and only that.
    Definition(
        Code.LIM_03, _STOP, _QS,
        Text("Limit switch", "The {side} limit switch opened at {measured}",
             "The axis is at the hardware limit, or the switch's wire is broken.",
             "Reset, switch on, then move back inward: the way back is open. Check the switch if the angle is well "
             "inside."),
        Text("限位开关", "{side}限位开关在 {measured} 断开", "轴在硬件限位处，或开关的导线断开。",
             _INWARD_ZH + "若角度远在行程之内，请检查开关。"),
    ),
    # Fault catalogue G4: an axis is not at both ends; a common wire or supply is.
    Definition(
        Code.LIM_04, _STOP, _QS,
        Text("Both limit switches", "Both limit switches are open at {measured}",
             "The axis cannot be at both ends: common wire or supply.", "Repair the wiring, then reset."),
        Text("两个限位开关", "在 {measured} 两个限位开关都断开", "轴不可能同时在两端：公共导线或供电。",
             "修复接线，然后复位。"),
    ),
)  # fmt: skip
