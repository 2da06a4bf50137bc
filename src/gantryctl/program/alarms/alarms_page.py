"""The pages of alarms and refusals, of the reference and of the operator's guide in Chinese.

`python -m gantryctl.program.alarms.alarms_page docs/reference/alarms.md docs/zh/alarms.md` writes them.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Final

from gantryctl.program.alarms.codes import Definition, Severity
from gantryctl.program.alarms.table import ALARMS, describe_reaction

_HEAD: Final = """\
# Alarms and refusals

Written by `python -m gantryctl.program.alarms.alarms_page docs/reference/alarms.md docs/zh/alarms.md`; do not edit,
a test compares. `gantryctl explain CODE` prints one entry. [中文](../zh/alarms.md)

A code never changes its meaning: one cause, one code. An alarm says, in one line: code and severity, what was
measured against which limit, what was done about it (with times, and how far the axis moved), what to do.
The first alarm that stops the axis is latched as *first out*; whatever follows is folded under it. A refused
command changes nothing.

## Reactions

| class | what the axis does |
|---|---|
| W | nothing: warning or note |
| REF | refuses the command, with the reason |
| HLT | stops on the jog-release ramp; power stays on |
| QUICK_STOP | the drive's quick-stop ramp, then brake, then torque off: ErrorStop |
| TORQUE_OFF | torque off and brake at once: ErrorStop |
| HOLD | torque at zero speed, because the brake is not trusted: ErrorStop |
| LOCK | beside one of the above: only the service role may reset |

QUICK_STOP is for what leaves the feedback believable and the drive obedient. Whatever puts either in doubt is
TORQUE_OFF: with a frozen or wrong encoder the drive's own ramp runs away. A reading in doubt stays so, in every
phase, until service has compared the angle: the alarm says that the angle is not known. A quick stop that the drive
does not obey becomes TORQUE_OFF (DRV-07); a load that a brake does not stop or hold becomes HOLD where the drive can
give torque, the reading is believed and the emergency-stop chain is closed. A load that moves all the same is BRK-13:
the horn sounds, and everybody leaves.

Times in the machine file are turned into scans: at least two, so that one reading alone never trips them. These
act on the first scan: emergency stop, collision, room door, mains, limit switches, over-travel, stop point beyond
travel, drive state and drive fault, encoder jump, encoder alarm, anything that is not a finite number. Frozen
encoder and old readings take at least three.

Reset clears what is latched when its cause is gone. It never enables, never shortens a stop, and leads from
ErrorStop to Disabled when power is off. Power then needs a new rising edge, every motion a new command.
"""


def reference_page() -> str:
    """The whole page."""
    return "\n".join([_HEAD, *(_entry(row) for row in ALARMS.values())])


def _entry(row: Definition) -> str:
    english = row.english
    message = english.message.replace("|", "\\|")
    return (
        f"## {row.code} {english.title}\n\n"
        f"- Severity: {row.severity.value}\n"
        f"- Message: `{message}`\n"
        f"- Cause: {english.cause}\n"
        f"- Reaction: {describe_reaction(row).english}\n"
        f"- What to do: {english.to_do}\n"
    )


_CHINESE_HEAD: Final = """\
# 报警与拒绝

本页由 `python -m gantryctl.program.alarms.alarms_page docs/reference/alarms.md docs/zh/alarms.md` 生成，请勿手工修改。
[English](../reference/alarms.md)

每个代码只有一个含义：一个原因，一个代码。使轴停止的第一个报警为“首发”，其后的报警归在它之下。被拒绝的命令不改变任何状态。
“复位”只清除原因已消失的报警，绝不会上电，也不会缩短停止过程。报警之后怎么做：[报警之后](after-an-alarm.md)。

| 级别 | 含义 |
|---|---|
| 信息 | 仅供了解 |
| 警告 | 轴继续运行，请注意 |
| 拒绝 | 命令未执行 |
| 停机 | 轴已停止，需要复位 |
"""
_SEVERITIES: Final = {
    Severity.INFO: "信息",
    Severity.WARNING: "警告",
    Severity.REFUSED: "拒绝",
    Severity.STOP: "停机",
}


def chinese_page() -> str:
    """The same for the operator, in Chinese."""
    return "\n".join([_CHINESE_HEAD, *(_chinese_entry(row) for row in ALARMS.values())])


def _chinese_entry(row: Definition) -> str:
    chinese = row.chinese
    # Names of values mean nothing to an operator.
    message = re.sub(r"\{\w+\}", "…", chinese.message).replace("|", "\\|")
    return (
        f"## {row.code} {chinese.title}\n\n"
        f"- 级别：{_SEVERITIES[row.severity]}\n"
        f"- 显示：{message}\n"
        f"- 原因：{chinese.cause}\n"
        f"- 反应：{describe_reaction(row).chinese}\n"
        f"- 处理方法：{chinese.to_do}\n"
    )


if __name__ == "__main__":
    for file, text in zip(sys.argv[1:], (reference_page(), chinese_page()), strict=False):
        Path(file).write_text(text, encoding="utf-8")
