"""What the service says, in Chinese: the page looks a sentence up here when it is read in Chinese.

Replies, alarms and the journal are English everywhere else. A sentence is a template with fields: `{limit:g}` stands
for a number, `{code}` for a code, any other field for words that may be a sentence themselves. What is not found
stays English.
"""

from __future__ import annotations

from typing import Final

from gantryctl.program import ALARMS
from gantryctl.program.alarms.chinese import ALARMS_ZH

_STOPS: Final = {
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
}
"""What was done about an alarm."""

_VALUES: Final = {
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
}
"""What stands in the fields of other sentences."""

_PROGRAM: Final = {
    "the axis is still being switched off": "轴正在断电",
    "{code} is latched ({measured}): reset first": "{code} 已锁存（{measured}）：请先复位",
    "{code} is active ({measured}): {first}": "{code} 有效（{measured}）：{first}",
    "reset first": "请先复位",
    "a brake test must pass, or service must reset": "须先通过制动器测试，或由维修人员复位",
    "a brake test is under way": "正在测试制动器",
    "a brake test is under way already": "已在测试制动器",
    "a brake test begins with power off: switch it off first": "制动器测试须在断电时开始：请先断电",
    "a brake test with {level:g} N m and the load are more than the motor's torque limit":
        "{level} N m 的制动器测试加上负载超过电机转矩限值",
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
    "the encoder would wrap {margin:g} deg from the travel, at least {limit:g} deg wanted":
        "编码器将在距行程 {margin}° 处回绕，至少需要 {limit}°",
    "the way there would pass {angle:g} deg, outside the travel; stop first": "途中将经过行程之外的 {angle}°；请先停止",
}  # fmt: skip
"""Reasons of the program that stand inside its refusals."""

_BRAKE: Final = {
    "not testable here: {why}": "不能在此测试：{why}",
    '[brake] owner = "{owner}": the drive works the brake itself and opens it whenever it is enabled; use the '
    "drive's own brake test": "[brake] owner = {owner}：制动器由驱动器控制，使能时即松开；请使用驱动器自身的制动器测试",
    "the drive takes no torque beside the speed (60B2, 6077); use the drive's own brake test":
        "驱动器除速度外不接受转矩（60B2、6077）；请使用驱动器自身的制动器测试",
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
}  # fmt: skip
"""What a brake test says."""

_SERVICE: Final = {
    "the role {role} may not do this ({action})": "角色 {role} 无权执行（{action}）",
    "the role {role} may not do this": "角色 {role} 无权执行",
    "{user} has control": "控制权在 {user}",
    "{user} has control at the local console": "控制权在本地控制台的 {user}",
    "{user} has control and the axis is moving": "控制权在 {user} 且轴在运动",
    "take control first": "请先取得控制权",
    "status frame {frame:g} is {behind:g} behind, at most {most:g}": "状态帧 {frame} 落后 {behind} 帧，最多 {most} 帧",
    "sent before the last stop, reset or change of control: look, then ask again":
        "发送于最近一次停止、复位或控制权变更之前：请查看后重新发出",
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
    "the encoder is {serial}, the stored zero offset belongs to another one":
        "编码器为 {serial}，存储的零点偏移属于另一个",
    "the gantry moved {way:g} deg while off (limit {limit:g} deg)": "断电期间机架移动了 {way}°（限值 {limit}°）",
    "look at it; `gantryctl reset` acknowledges it under your name": "请查看；复位即以您的名义确认",
}  # fmt: skip
"""What the service refuses with, and why power cannot be switched on."""


def phrases() -> dict[str, str]:
    """Every sentence with its Chinese one: the alarm table first, then what stands in it and around it."""
    found: dict[str, str] = {}
    for code, row in ALARMS.items():
        words = ALARMS_ZH[code]
        found |= {row.title: words.title, row.message: words.message}
        found |= {row.cause: words.cause, row.to_do: words.to_do}
    found.pop("{measured}")  # a field alone says nothing
    return {**found, **_STOPS, **_VALUES, **_PROGRAM, **_BRAKE, **_SERVICE}
