"""Rows of the alarm table: engine and processes (SYS), access (SEC), journal (JRN)."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code, Definition, Reaction, Severity, Text

_INFO, _WARN, _STOP, _REFUSED = Severity.INFO, Severity.WARNING, Severity.STOP, Severity.REFUSED
_W, _REF, _QS = Reaction.W, Reaction.REF, Reaction.QUICK_STOP

_BUSY: Final = "Find what kept the processor busy, then reset."
_BUSY_ZH: Final = "查明占用处理器的原因，然后复位。"
_AGAIN: Final = "Look at the screen, then send the command again."
_AGAIN_ZH: Final = "查看屏幕，然后重新发出指令。"

SERVICE: Final = (
    Definition(
        Code.SYS_02, _STOP, _QS,
        Text("Scans late", "{measured}",
             "Another task kept the processor from the controller.", _BUSY),
        Text("扫描迟到", "{measured}", "其他任务占用了控制器的处理器。", _BUSY_ZH),
    ),
    # Fault catalogue F3: what happened meanwhile is not known, so nothing resumes.
    Definition(
        Code.SYS_03, _STOP, _QS,
        Text("Controller frozen", "controller frozen for {late_s:.3f} s (limit {limit_s:.3f} s)",
             "The controller did not run at all for some time.", _BUSY),
        Text("控制器冻结", "控制器冻结 {late_s} s（限值 {limit_s} s）", "控制器有一段时间完全没有运行。", _BUSY_ZH),
    ),
    Definition(
        Code.SYS_05, _INFO, _W,
        Text("Previous run not shut down",
             "the previous run of the controller was not shut down; {when} it was at {where}",
             "The controller or the whole service was killed, or the computer lost its supply.",
             "Look at the journal for the cause, and at the axis before it moves."),
        Text("上次运行未正常关闭",
             "控制器上次运行未正常关闭；{when}位于 {where}",
             "控制器或整个服务被终止，或计算机断电。", "在日志中查找原因；运动前查看轴。"),
    ),
    Definition(
        Code.SYS_06, _WARN, _W,
        Text("Process ended", "{process} {how}",
             "A process of the service has crashed or given no sign of life; the supervisor starts it again.",
             "Look at the journal for the cause; if it comes back, report it."),
        Text("进程结束", "{process} {how}", "服务的一个进程崩溃或没有生命信号；监督进程将其重新启动。",
             "在日志中查找原因；若再次出现，请报告。"),
    ),
    Definition(
        Code.SYS_07, _REFUSED, _REF,
        Text("Shutting down", "the service is being shut down",
             "The service or the computer is being shut down.", "Wait until the service runs again."),
        Text("正在关闭", "服务正在关闭", "服务或计算机正在关闭。", "等待服务重新运行。"),
    ),
    Definition(
        Code.SYS_09, _STOP, _QS,
        Text("Fault in the program", "{failure} in scan {scan} (t = {time_s:.3f} s): {text} ({place})",
             "A custom program, or gantryctl, has a fault.",
             "Correct the program, or report it; then reset."),
        Text("程序故障", "扫描 {scan} 中 {failure}（t = {time_s} s）：{text}（{place}）",
             "自定义程序或 gantryctl 有故障。", "修正程序或报告；然后复位。"),
    ),
    Definition(
        Code.SYS_10, _STOP, Reaction.TORQUE_OFF,
        Text("Power-up did not end", "power-up did not end within {limit:g} s, the axis is {state}",
             "A custom program that does not switch power on when the operator wants it.",
             "Call a Power block with the operator's `power`; then reset."),
        Text("上电未完成", "上电未在 {limit} s 内完成，轴为 {state}",
             "自定义程序在操作员要求时没有接通动力。", "以操作员的 `power` 调用 Power 块；然后复位。"),
    ),
    Definition(
        Code.SYS_11, _REFUSED, _REF,
        Text("Controller silent", "{reason}",
             "The controller is starting, has ended, or its command ring is full.",
             "Wait; if it lasts, look at the journal."),
        Text("控制器无应答", "{reason}", "控制器正在启动、已结束，或其指令队列已满。", "等待；若持续，请查看日志。"),
    ),
    # Not a warning to be accepted: the code that would ask, and stop the axis, is the one in doubt.
    Definition(
        Code.SYS_13, _REFUSED, _REF,
        Text("Program files changed", "files that are not as they were installed: {count}, among them {files}",
             "A fault of the disk, an edit in place, or somebody changed the program. The service does not start.",
             "Find out why, then install the release again (`pip install --force-reinstall`). Machine files and "
             "programs of your own belong outside the installation."),
        Text("程序文件被更改", "与安装时不符的文件：{count} 个，其中 {files}",
             "磁盘故障、直接修改了安装的文件，或有人更改了程序。服务不启动。",
             "查明原因，然后重新安装（`pip install --force-reinstall`）。自己的机器文件和程序应放在安装目录之外。"),
    ),
    Definition(
        Code.SEC_01, _REFUSED, _REF,
        Text("Not permitted", "{reason}",
             "The role may not do it, or there is no login.", "Log in with a role that may."),
        Text("无权执行", "{reason}", "该角色无权执行，或未登录。", "以有权的角色登录。"),
    ),
    Definition(
        Code.SEC_02, _REFUSED, _REF,
        Text("Too old", "{reason}",
             "The command was sent by a screen that showed an old state, or another one than its own.", _AGAIN),
        Text("过旧", "{reason}", "发出指令的屏幕显示的是旧状态，或不是其自身的状态。", _AGAIN_ZH),
    ),
    Definition(
        Code.SEC_03, _REFUSED, _REF,
        Text("Of another epoch", "sent before the last stop, reset or change of control: look, then ask again",
             "A stop, a reset or a change of control ends everything that was sent before.", _AGAIN),
        Text("属于另一时期", "发送于最近一次停止、复位或控制权变更之前：请查看后重新发出",
             "停止、复位或控制权变更使此前发出的一切失效。", _AGAIN_ZH),
    ),
    Definition(
        Code.SEC_04, _REFUSED, _REF,
        Text("Not of this page", "{reason}",
             "A sequence number came twice, or another web page asked.", "Load the page again."),
        Text("不属于此页面", "{reason}", "序号重复，或由其他网页请求。", "重新加载页面。"),
    ),
    Definition(
        Code.SEC_05, _REFUSED, _REF,
        Text("Not understood", "{reason}",
             "Unknown type or key, wrong type of value, not finite, or too long.",
             "Correct the message: docs/reference/service.md."),
        Text("无法理解", "{reason}", "未知的类型或键、值的类型错误、非有限数，或过长。",
             "更正消息：docs/reference/service.md。"),
    ),
    Definition(
        Code.SEC_06, _REFUSED, _REF,
        Text("Too many", "{reason}", "More commands, requests or connections than the service takes.",
             "Send fewer."),
        Text("过多", "{reason}", "指令、请求或连接超过服务所能接受的数量。", "减少发送。"),
    ),
    Definition(
        Code.SEC_07, _REFUSED, _REF,
        Text("No control", "{reason}", "The command needs the control authority.", "Take control first."),
        Text("没有控制权", "{reason}", "该指令需要控制权。", "请先取得控制权。"),
    ),
    Definition(
        Code.SEC_08, _REFUSED, _REF,
        Text("Control is held", "{reason}",
             "Control is taken over at standstill only, and never from the local console.",
             "Wait for standstill, or ask the one who has control."),
        Text("控制权被占用", "{reason}", "控制权只能在静止时接管，且不能从本地控制台接管。",
             "等待静止，或联系持有控制权的人。"),
    ),
    Definition(
        Code.SEC_09, _REFUSED, _REF,
        Text("Lease dead", "{reason}", "A hold-to-run lease that has ended once is never valid again.",
             "Release the key and press it again."),
        Text("租约失效", "{reason}", "按住运行的租约一旦结束便不再有效。", "松开按键后重新按下。"),
    ),
    Definition(
        Code.SEC_10, _REFUSED, _REF,
        Text("Not armed", "{reason}",
             "Not armed, too long ago, in another epoch, at another screen, another step of commissioning, or (second "
             "person) by the same person.",
             "Arm it, then execute in time."),
        Text("未预备", "{reason}",
             "未预备、时间过长、属于另一时期、在另一屏幕、预备的是另一调试步骤，或（第二人）由同一人预备。",
             "先预备，再及时执行。"),
    ),
    Definition(
        Code.SEC_11, _WARN, _W,
        Text("Certificate ends", "{reason}",
             "A certificate of the page, of OPC UA or of one of its clients ends within 30 days, or has ended.",
             "Install a new certificate."),
        Text("证书到期", "{reason}", "网页、OPC UA 或其客户端的证书将在 30 天内到期，或已到期。", "安装新证书。"),
    ),
    Definition(
        Code.SEC_12, _REFUSED, _REF,
        Text("Not found", "not found", "No such address or recording.", "Check the address."),
        Text("未找到", "未找到", "没有该地址或记录。", "检查地址。"),
    ),
    # Decision 0011: the lease counts from the frame that the person sees; what a network takes is gone from it.
    Definition(
        Code.SEC_13, _REFUSED, _REF,
        Text("Connection too slow for a held key",
             "from the controller to this screen and back takes {measured:.0f} ms, limit {limit:.0f} ms for a held "
             "key: use a nearer screen or a wired network",
             "Over a slow network a person sees the axis too late to let the key go in time.",
             "Use a screen nearer to the machine, a wired network, or the local console. Increments and moves need no "
             "held key."),
        Text("连接过慢，不能按住运行",
             "从控制器到此屏幕往返需 {measured} ms，按住运行的限值为 {limit} ms：请使用更近的屏幕或有线网络",
             "网络过慢时，人看到轴的位置太晚，来不及松开按键。",
             "使用离机器更近的屏幕、有线网络或本地控制台；增量和移动到角度不需要按住按键。"),
    ),
    # Fault catalogue F11 and decision 0011: recordings end first, then no new motion begins; events wait.
    Definition(
        Code.JRN_01, _WARN, _REF,
        Text("Disk nearly full", "{reason}",
             "Recordings or other data fill the disk. Below a second limit no new motion begins.",
             "Make room on the disk."),
        Text("磁盘将满", "{reason}",
             "记录或其他数据占满磁盘。低于第二限值时不能启动新运动。", "清理磁盘。"),
    ),
    Definition(
        Code.JRN_02, _REFUSED, _REF,
        Text("Journal not writable", "{reason}",
             "The disk is slow, full or failed. What moves goes on; nothing new begins.",
             "Look at `journal_state` and at the disk."),
        Text("日志不可写", "{reason}", "磁盘缓慢、已满或故障。正在进行的运动继续；不启动新的运动。",
             "查看 `journal_state` 和磁盘。"),
    ),
    # Of a reply whose `ok` is true: only the reply waits for the disk, what was asked for is done (decision 0020).
    Definition(
        Code.JRN_03, _WARN, _W,
        Text("Done, not kept", "done, but not kept: {reason}",
             "The disk is slow, full or failed, or the recorder hangs. A loss of supply now loses the event.",
             "Look at `journal_state` and at the disk; the event is kept when `journal_committed` has its number."),
        Text("已执行，未保存", "已执行，但未保存：{reason}",
             "磁盘缓慢、已满或故障，或记录进程挂起。此时断电会丢失该事件。",
             "查看 `journal_state` 和磁盘；`journal_committed` 达到该编号时事件已保存。"),
    ),
    # Fault catalogue F14: the mirrors of the newest event know what a journal that is whole in itself has lost.
    Definition(
        Code.JRN_04, _WARN, _REF,
        Text("Events missing", "{reason}; service must reset",
             "The journal was removed, cut, or put back from an older copy; or the disk has lost what it had kept.",
             "Read what is missing: `gantryctl journal verify`; keep the file that was moved aside. "
             "Then the service role resets."),
        Text("事件缺失", "{reason}；须由维修人员复位",
             "日志被删除、截短或被较旧的副本替换；或磁盘丢失了已保存的内容。",
             "查看缺失的内容（`gantryctl journal verify`），保留移走的文件；由维修角色复位。"),
    ),
    # Fault catalogue F15: moved aside, never repaired: its chain is evidence.
    Definition(
        Code.JRN_05, _WARN, _REF,
        Text("Journal damaged", "the journal was damaged and moved to {file}; service must reset",
             "Its hash chain or its file was broken: a disk fault, or it was changed.",
             "Keep the file that was moved aside; the service role resets."),
        Text("日志损坏", "日志已损坏并移至 {file}；须由维修人员复位",
             "其哈希链或文件被破坏：磁盘故障，或被人更改。", "保留移走的文件；由维修角色复位。"),
    ),
    Definition(
        Code.JRN_07, _WARN, _REF,
        Text("Journal files touched", "{reason}; service must reset",
             "Somebody removed, replaced, linked or moved files of the journal, or the directory they are in.",
             "Find out who did it; put a directory that was moved back; then the service role resets."),
        Text("日志文件被动过", "{reason}；须由维修人员复位",
             "有人删除、替换、链接或移动了日志文件或其所在目录。",
             "查明是谁所为；将移走的目录放回；然后由维修角色复位。"),
    ),
)  # fmt: skip
