"""Rows of the alarm table: refused commands and notes."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code, Definition, Reaction, Severity, Text

_INFO, _REF = Severity.INFO, Severity.REFUSED

REFUSALS: Final = (
    Definition(
        Code.CTL_01, _REF, Reaction.REF,
        Text("Value out of range", "{name} must be {allowed}, got {measured}",
             "A command with a number that cannot be used. Nothing was changed.",
             "Give a value within the range."),
        Text("数值超限", "{name}必须{allowed}，得到 {measured}", "指令中的数不能使用。没有任何改变。",
             "给出范围内的值。"),
    ),
    # Fault catalogue B10: the axis is linear with a cable, so there is one way only.
    Definition(
        Code.CTL_09, _REF, Reaction.REF,
        Text("Target beyond travel",
             "target {measured:.2f} deg is beyond {limit:+.2f} deg; you are at {position:.2f} deg, "
             "so {left:.2f} deg are left",
             "The axis is linear with a cable: there is no way round.",
             "Give a target within the travel."),
        Text("目标超出行程", "目标 {measured}° 超出 {limit}°；当前 {position}°，还剩 {left}°",
             "轴带电缆，按直线计：没有绕行的路。", "给出行程内的目标。"),
    ),
    Definition(
        Code.CTL_18, _REF, Reaction.REF,
        Text("Target in or behind a no-go sector",
             "the way to {measured:.2f} deg enters the no-go sector {begin:.2f} to {end:.2f} deg; you are at "
             "{position:.2f} deg, permitted as far as {limit:.2f} deg; {round}",
             "Neither set-point nor a stop may enter a sector of [axis] no_go_deg.",
             "Give a target before the sector, or go the way round."),
        Text("目标在禁区内或禁区之后",
             "到 {measured}° 的路径进入禁区 {begin}° 至 {end}°；当前 {position}°，允许到 {limit}°；{round}",
             "[axis] no_go_deg：设定值和停止都不得进入禁区。", "给出禁区之前的目标，或绕行。"),
    ),
    Definition(
        Code.CTL_14, _REF, Reaction.REF,
        Text("Not in this state", "{reason}", "The command does not fit what the axis is doing.",
             "Wait for standstill, or stop first."),
        Text("此状态下不允许", "{reason}", "该指令与轴正在做的事不符。", "等待静止，或先停止。"),
    ),
    # Fault catalogue H1: the key is believed only while it renews its lease.
    Definition(
        Code.CTL_15, _INFO, Reaction.HLT,
        Text("Hold-to-run not renewed",
             "hold-to-run was not renewed for {measured:.0f} ms, limit {limit:.0f} ms",
             "The key's signal was lost: window left, connection slow or gone.",
             "Release the key and press it again."),
        Text("按住运行未续期", "按住运行 {measured} ms 未续期，限值 {limit} ms",
             "按键信号丢失：离开窗口、连接缓慢或中断。", "松开按键后重新按下。"),
    ),
    # Fault catalogue H3: a page that hangs may renew by itself.
    Definition(
        Code.CTL_21, _INFO, Reaction.HLT,
        Text("Hold-to-run too long", "the key was held for {measured:.0f} s, limit {limit:.0f} s",
             "A page that is stuck can go on renewing by itself: no key is held for longer.",
             "Release the key and press it again."),
        Text("按住运行过久", "按键已按住 {measured} s，限值 {limit} s",
             "卡住的页面会自行不断续期：按住更久不再被相信。", "松开按键后重新按下。"),
    ),
    Definition(
        Code.CTL_16, _REF, Reaction.REF,
        Text("No mode chosen", "{reason}",
             "After a start no mode is chosen and nothing moves.", "Choose continuous or incremental."),
        Text("未选择模式", "{reason}", "启动后模式为“无”，不会有任何运动。",
             "选择连续或增量模式。"),
    ),
    Definition(
        Code.CTL_17, _REF, Reaction.REF,
        Text("No plan", "{reason}", "No motion within the limits leads there from the present state.",
             "Wait for standstill and try again."),
        Text("无法规划", "{reason}", "在限值内没有从当前状态到那里的运动。", "等待静止后重试。"),
    ),
    Definition(
        Code.LIM_01, _INFO, Reaction.HLT,
        Text("End of travel", "stopped at {measured:.2f} deg, {end}",
             "A motion with a speed only ran to the end of its way.", "Move the other way."),
        Text("行程终点", "停在 {measured}°，{end}", "只有速度的运动走到了行程尽头。",
             "向另一方向移动。"),
    ),
    Definition(
        Code.BRK_12, _REF, Reaction.REF,
        Text("Brake test overdue",
             "the brake test is overdue: up to {limit:.2f} deg/s only, asked for {measured:.2f} deg/s",
             "The brake must be tested from time to time: [brake] test_interval_days, test_interval_power_ups.",
             "Switch power off and test the brake (`gantryctl brake-test`), or move slowly."),
        Text("制动器测试逾期", "制动器测试逾期：最高 {limit} °/s，要求 {measured} °/s",
             "制动器必须定期测试：[brake] test_interval_days、test_interval_power_ups。",
             "断电并测试制动器，或低速运动。"),
    ),
    Definition(
        Code.LIM_05, _REF, Reaction.REF,
        Text("Only inward", "at {measured:.2f} deg only motion {side} is open",
             "The axis is outside its travel or at a limit switch.", "Move back inward."),
        Text("只能向内", "在 {measured}° 只开放{side}运动", "轴在行程之外或在限位开关处。", "向内移动。"),
    ),
    Definition(
        Code.INT_05, _REF, Reaction.HLT,
        Text("Enabling switch",
             "the enabling switch is off: up to {limit:.2f} deg/s only, asked for {measured:.2f} deg/s",
             "Faster motion by hand or from a remote screen needs the enabling switch, from the start to the end.",
             "Press the enabling switch or lower the speed."),
        Text("使能开关", "使能开关断开：最高 {limit} °/s，要求 {measured} °/s",
             "更快的手动运动或远程屏幕的运动自始至终需要使能开关。", "按下使能开关或降低速度。"),
    ),
    Definition(
        Code.PWR_03, _REF, Reaction.REF,
        Text("Power is off", "power is off", "The axis follows commands only when power is on.",
             "Switch power on and wait until it shows on."),
        Text("动力未接通", "动力未接通", "只有接通动力轴才跟随指令。", "上电并等待显示接通。"),
    ),
    Definition(
        Code.PWR_04, _REF, Reaction.REF,
        Text("Cannot switch on", "cannot switch on: {reason}",
             "A condition for power is not met.",
             "Remove the cause, then switch on again."),
        Text("不能上电", "不能上电：{reason}", "上电前必须满足的条件未满足。", "排除原因后重新上电。"),
    ),
)  # fmt: skip
