"""The alarm table in Chinese: for whoever shows an alarm to people. English stays what is kept and compared.

`message` has the fields of the English one; a number comes with the digits it has there.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from gantryctl.program.alarms.codes import Code


class Words(NamedTuple):
    """One row: the four texts of a `Definition`."""

    title: str
    message: str
    cause: str
    to_do: str


_CALL: Final = "请勿复位。检查编码器电缆和插头，然后联系维修。"
_CABLE: Final = "检查总线电缆、终端电阻和负载。断电后复位或重新启动：驱动器将被重新设置。"
_CHECK_DRIVE: Final = "查看驱动器自身的故障显示，排除原因后复位。"
_SECURE: Final = "人员远离。固定负载并联系维修。"
_INWARD: Final = "复位，然后向内移动：返回方向是开放的。"

_ENCODER: Final = {
    Code.ENC_01: Words(
        "位置跳变", "一个扫描周期内位置跳变 {measured}°，限值 {limit}°",
        "读数变化超过轴在一个扫描周期内可能的运动。位置不再有效。", _CALL,
    ),
    Code.ENC_02: Words(
        "编码器冻结", "指令为 {measured} °/s 时编码器值 {time_ms} ms 未变化",
        "编码器、其电缆或其信号处理已停止，或电机被卡住。", _CALL,
    ),
    Code.ENC_03: Words(
        "一次编码器坏读数", "{measured} 次编码器坏读数，已用预测值代替",
        "一次读数校验错误。单次可以跨越；已计数。", "若再次出现：检查编码器电缆的屏蔽和插头。",
    ),
    Code.ENC_04: Words(
        "编码器坏读数过多", "{time_ms} ms 内有 {measured} 次编码器坏读数，限值 {limit}",
        "连续校验错误：电缆、屏蔽、插头或编码器。", _CALL,
    ),
    Code.ENC_05: Words(
        "编码器报警", "编码器自身报警",
        "编码器内部的光源、信号幅值、位置错误或供电。", "请勿复位。用驱动器工具读取编码器报警字并联系维修。",
    ),
    Code.ENC_06: Words(
        "编码器警告", "编码器发出警告：光源余量、温度或电池",
        "编码器仍测量正常，但不会一直如此。", "安排维修。轴继续运行。",
    ),
    Code.ENC_07: Words(
        "编码器不一致", "负载侧编码器与电机编码器及误差表相差 {measured}°，限值 {limit}°",
        "两个编码器之一有误、标定属于另一台机器，或电机与齿圈之间有打滑或断裂。",
        "将角度与刻线比较。在任何运动之前先查明哪个编码器正确。",
    ),
}  # fmt: skip

_BUS: Final = {
    Code.CAN_06: Words("驱动器心跳丢失", "没有收到驱动器的心跳", "驱动器已关机、死机，或电缆断开。", _CABLE),
    Code.CAN_07: Words(
        "读数过旧", "驱动器的读数已有 {measured} ms，限值 {limit} ms",
        "驱动器的报文迟到或不来。", "检查总线电缆、终端电阻和负载，然后复位。",
    ),
    Code.CAN_08: Words(
        "总线中断", "CAN 控制器不再收发",
        "总线关闭、电缆断路或短路，或适配器被拔下。驱动器自身的监视会使轴停止。", _CABLE,
    ),
    Code.CAN_12: Words(
        "总线上有另一个主站", "只有本控制器可以发送的报文来自别处",
        "有第二个控制器，或参与控制的维修工具。", "将其从总线上移除，然后复位。",
    ),
    Code.CAN_13: Words(
        "驱动器不在运行状态", "驱动器离开了 NMT 状态 OPERATIONAL",
        "驱动器丢失了控制器的心跳，或被他人停止。", _CABLE,
    ),
    Code.DRV_05: Words(
        "指令被忽略", "驱动器已使能但不跟随速度指令（6041 第 12 位为 0）",
        "本地控制、驱动器内部限值或模式错误。", "查看驱动器自身的显示，排除原因后复位。",
    ),
    Code.DRV_09: Words(
        "驱动器参数被改变", "驱动器的一个参数不再是设定值：{measured}",
        "有人在驱动器运行时用调试工具或在驱动器本体上改变了它。",
        "查明是谁。断电后复位：驱动器将被重新设置。此前不能运动。",
    ),
    Code.DRV_11: Words(
        "驱动器重新启动", "驱动器自行重新启动",
        "其供电失效，或有人将其复位。它已忘记控制器的设置。",
        "查找原因。断电后复位或重新启动：驱动器将被重新设置。",
    ),
}  # fmt: skip

_CONTROL: Final = {
    Code.CTL_02: Words(
        "数值不是数", "{measured} 不是有限的数",
        "某个读数或计算出的指令不是有限的数。它绝不会到达驱动器。", "保存记录并报告；原因清楚后复位。",
    ),
    Code.CTL_03: Words(
        "跟随误差", "{speed} °/s 时跟随误差 {measured}°，限值 {limit}°",
        "轴不跟随设定值：负载、摩擦、转矩限值或增益。", "在记录中查看转矩和跟随误差，排除原因后复位。",
    ),
    Code.CTL_04: Words(
        "超速", "速度 {measured} °/s，限值 {limit} °/s",
        "轴比指令快：驱动器比例、增益，或负载在推动。", "检查驱动器的速度比例和上限，然后复位。",
    ),
    Code.CTL_05: Words(
        "运动与指令相反", "指令为 {command} °/s 时速度为 {measured} °/s，差值限值 {limit} °/s",
        "驱动器不服从速度指令：符号、比例或速度反馈。", "在检验速度的符号和比例之前不要再运动。",
    ),
    Code.CTL_07: Words(
        "转矩饱和", "转矩达到限值 {time_ms} ms，跟随误差增至 {measured}°",
        "负载所需转矩超过驱动器允许的转矩。", "检查平衡、摩擦和驱动器过载，然后复位。",
    ),
    Code.CTL_10: Words(
        "停止点超出行程", "以 {measured} °/s 轴将停在 {position}°，限值 {limit}°",
        "按实测角度和速度，轴将越出行程。", "低速向内移动；查明轴为何超前于设定值。",
    ),
    Code.CTL_11: Words(
        "未到位", "运动结束后 {time_s} s 仍未到位：误差 {measured}°，窗口 {limit}°",
        "设定值已到达而轴没有：摩擦、增益或转矩。", "不要使用此角度。重新运动；若再次出现，联系维修。",
    ),
    Code.CTL_12: Words(
        "跟随误差偏高", "跟随误差 {measured}°，警告 {limit}°，停机 {trip}°",
        "轴的跟随比平时差。", "查看记录中的趋势；安排维修。",
    ),
    Code.CTL_13: Words(
        "静止丧失", "静止时移动了 {measured}°，窗口 {limit}°",
        "轴应当静止时有东西使它移动。", "检查负载、制动器和驱动器，然后复位。",
    ),
    Code.LIM_02: Words("超程", "角度 {measured}°，限值 {limit}°", "实测角度越过超程限值。", _INWARD),
    Code.LIM_03: Words(
        "限位开关", "{side}限位开关在 {measured}° 断开",
        "轴在硬件限位处，或开关的导线断开。", _INWARD + "若角度远在行程之内，请检查开关。",
    ),
    Code.LIM_04: Words(
        "两个限位开关", "在 {measured}° 两个限位开关都断开",
        "轴不可能同时在两端：公共导线或供电。", "修复接线，然后复位。",
    ),
}  # fmt: skip

_POWER: Final = {
    Code.BRK_01: Words(
        "制动器未松开", "松开指令后 {time_ms} ms 制动器仍抱紧，限值 {limit} ms",
        "制动器供电、线圈或反馈触点。", "检查制动器的供电和触点，然后复位。",
    ),
    Code.BRK_03: Words(
        "制动器未抱住", "卸除转矩时移动了 {measured}°，限值 {limit}°",
        "制动器在负载下打滑；由电机保持。", "不要断电。固定负载并联系维修。",
    ),
    Code.BRK_04: Words(
        "制动器打滑", "断电状态下移动了 {measured}°，限值 {limit}°",
        "抱紧的制动器让负载移动；可能时由电机保持。", _SECURE,
    ),
    Code.BRK_05: Words(
        "运动中制动器抱紧", "{measured} °/s 时制动器反馈为抱紧，跟随误差 {error}°",
        "制动器失电，或制动器指令失效。", "检查制动器的供电和接线；检查制动器，然后复位。",
    ),
    Code.BRK_06: Words(
        "制动器反馈矛盾", "制动器反馈为{measured}已 {time_ms} ms，指令为{command}",
        "反馈触点或其导线，或制动器不听从指令。", "检查触点和导线，然后复位。此前不得运动。",
    ),
    Code.BRK_07: Words(
        "转矩未验证", "{time_ms} ms 后转矩为 {measured} N m，制动器松开前至少需要 {limit} N m",
        "驱动器已使能但没有转矩：电机电缆、电流限值、转矩比例。",
        "制动器保持抱紧。检查电机电缆和驱动器的转矩限值，然后复位。",
    ),
    Code.BRK_08: Words(
        "制动器测试未通过", "制动器测试未通过：{measured}",
        "制动器在测试转矩以下打滑，或电机没有给出转矩（此时没有任何移动）。",
        "在制动器测试通过或维修人员复位之前，一切不能运动。检查制动器和电机转矩。",
    ),
    Code.BRK_10: Words(
        "松开后下沉", "制动器松开后移动了 {measured}°，限值 {limit}°",
        "驱动器没有保持住负载：预加转矩、增益或转矩限值。",
        "制动器已重新抱紧。检查学习到的保持转矩和驱动器增益，然后复位。",
    ),
    Code.BRK_11: Words(
        "负载仍在运动", "转矩切断并制动 {time_s} s 后仍为 {measured} °/s", "制动器没有使负载停住。", _SECURE,
    ),
    Code.DRV_01: Words("驱动器故障", "驱动器报告故障：{measured}", "驱动器自行关断。", _CHECK_DRIVE),
    Code.DRV_02: Words(
        "驱动器警告", "驱动器报告警告", "温度、过载或供电接近限值。", "查看驱动器的显示。轴继续运行。",
    ),
    Code.DRV_03: Words(
        "驱动器卡住", "驱动器停留在{measured}已 {time_ms} ms，应为{command}",
        "驱动器没有执行要求的步骤：缺少释放信号、本地控制、参数错误。", _CHECK_DRIVE,
    ),
    Code.DRV_04: Words(
        "驱动器失去使能", "驱动器未经要求进入{measured}",
        "他人或他物关断了驱动器：释放输入、工具、供电。", _CHECK_DRIVE,
    ),
    Code.DRV_07: Words(
        "快速停止未执行", "快速停止中速度 {measured} °/s，斜坡允许 {limit} °/s",
        "驱动器没有按设定制动，或其速度反馈有误。", _CHECK_DRIVE,
    ),
    Code.INT_03: Words(
        "急停", "急停回路在 {measured}° 断开",
        "有人按下按钮或回路断线。硬件自行动作；此处只是反映。", "安全时松开按钮，复位，重新上电。",
    ),
    Code.INT_06: Words(
        "要求快速停止", "操作员要求快速停止，在 {measured}°、{speed} °/s", "由操作员要求。", "复位，重新上电。",
    ),
    Code.PWR_01: Words(
        "主电源丢失", "主电源在 {measured}°、{speed} °/s 时不再就绪",
        "供电被切断或失效。", "恢复供电，复位，重新上电。",
    ),
    Code.THM_01: Words(
        "过载偏高", "已用驱动器过载余量的 {measured} %，警告值 {limit} %",
        "转矩超过额定值的时间过长。", "减少运动或降低速度；检查平衡和摩擦。",
    ),
}  # fmt: skip

_REFUSALS: Final = {
    Code.CTL_01: Words(
        "数值超限", "{name}必须{allowed}，得到 {measured}",
        "指令中的数不能使用。没有任何改变。", "给出范围内的值。",
    ),
    Code.CTL_09: Words(
        "目标超出行程", "目标 {measured}° 超出 {limit}°；当前 {position}°，还剩 {left}°",
        "轴带电缆，按直线计：没有绕行的路。", "给出行程内的目标。",
    ),
    Code.CTL_14: Words("此状态下不允许", "{measured}", "该指令与轴正在做的事不符。", "等待静止，或先停止。"),
    Code.CTL_15: Words(
        "按住运行未续期", "按住运行 {measured} ms 未续期，限值 {limit} ms",
        "按键信号丢失：离开窗口、连接缓慢或中断。", "松开按键后重新按下。",
    ),
    Code.CTL_21: Words(
        "按住运行过久", "按键已按住 {measured} s，限值 {limit} s",
        "卡住的页面会自行不断续期：按住更久不再被相信。", "松开按键后重新按下。",
    ),
    Code.CTL_16: Words(
        "未选择模式", "没有选择运动模式", "启动后模式为“无”，不会有任何运动。", "选择连续或增量模式。",
    ),
    Code.CTL_17: Words("无法规划", "{measured}", "在限值内没有从当前状态到那里的运动。", "等待静止后重试。"),
    Code.LIM_01: Words("行程终点", "停在 {measured}°，行程终点", "只有速度的运动走到了行程尽头。", "向另一方向移动。"),
    Code.BRK_12: Words(
        "制动器测试逾期", "制动器测试逾期：最高 {limit} °/s，要求 {measured} °/s",
        "制动器必须定期测试：[brake] test_interval_days、test_interval_power_ups。",
        "断电并测试制动器，或低速运动。",
    ),
    Code.LIM_05: Words(
        "只能向内", "在 {measured}° 只开放{side}运动", "轴在行程之外或在限位开关处。", "向内移动。",
    ),
    Code.INT_05: Words(
        "使能开关", "使能开关断开：最高 {limit} °/s，要求 {measured} °/s",
        "更快的手动运动或远程屏幕的运动自始至终需要使能开关。", "按下使能开关或降低速度。",
    ),
    Code.PWR_03: Words("动力未接通", "动力未接通", "只有接通动力轴才跟随指令。", "上电并等待显示接通。"),
    Code.PWR_04: Words("不能上电", "不能上电：{measured}", "上电前必须满足的条件未满足。", "排除原因后重新上电。"),
}  # fmt: skip

_SET_ZERO: Final = "读取见证标记，然后执行 `gantryctl encoder set-zero --angle A --witness TEXT`。"

_START: Final = {
    Code.ENC_08: Words(
        "编码器偏差整圈", "读数偏差 {moved_deg}°，为电机整圈数",
        "编码器多圈部分丢圈，或断电期间机架恰好移动了这一角度。", _SET_ZERO,
    ),
    Code.ENC_09: Words(
        "断电期间移动", "断电期间机架移动 {moved_deg}°（限值 {limit_deg}°）",
        "有人移动了它，或制动器缓慢滑动。限值以内视为齿轮回位：接受并记录。",
        "查看机架；`gantryctl reset` 以您的名义确认。",
    ),
    Code.ENC_10: Words(
        "角度无效", "角度无效：{why}",
        "没有零点偏移，断电期间移动超过 1°，或读数不可能为真。", _SET_ZERO,
    ),
    Code.ENC_11: Words(
        "编码器已更换", "编码器为 {serial}，保存的零点偏移属于另一个编码器",
        "更换了编码器或电机，或保存的数据属于另一台机器。", _SET_ZERO,
    ),
    Code.CFG_ENC_01: Words(
        "编码器量程终点靠近行程", "编码器量程终点在行程以下 {minus_deg}°、以上 {plus_deg}°，过近",
        "零点在多圈量程内位置不当：运动中读数会跳变整个量程。",
        "转动编码器轴或居中安装编码器，然后执行 `gantryctl encoder set-zero`。",
    ),
    Code.CFG_CAN_01: Words(
        "驱动器参数禁止使能", "驱动器参数禁止使能：{parameters}",
        "在这些参数下，控制器失效时驱动器不会自行停止轴。", "更正驱动器或机器文件中的参数，然后重新启动。",
    ),
    Code.CFG_CAN_02: Words(
        "未调试", "机器未调试：{why}",
        "没有该驱动器在此配置下的调试记录：其停止功能未经证明。", "用 `gantryctl commission --config FILE` 调试机器。",
    ),
    Code.CFG_CAN_03: Words(
        "未证明控制器静默时停止", "未证明无控制器时停止：{why}",
        "驱动器自上次重启以来，尚未证明控制器静默时它会停止轴。",
        "`gantryctl commission --only silence --config FILE` 在静止状态下数秒内证明。",
    ),
    Code.SYS_12: Words(
        "先前的停止未确认", "{stopped_by} 在上次运行中使轴停止，尚未确认",
        "每次报警停止都会保持轴，直到有人查看，重新启动后也是如此。",
        "查看报警（`gantryctl alarms --last`），然后 `gantryctl reset`。",
    ),
}  # fmt: skip

ALARMS_ZH: Final[dict[Code, Words]] = {**_ENCODER, **_BUS, **_CONTROL, **_POWER, **_REFUSALS, **_START}
"""Every code with its words."""
