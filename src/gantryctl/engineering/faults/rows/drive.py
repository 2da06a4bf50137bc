"""Drive and CiA 402 (D)."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.case import FaultCase, Instead, Phase, ReactionClass, SeenBy
from gantryctl.engineering.faults.injection import injection
from gantryctl.engineering.faults.physics import friction_stops_the_rotor
from gantryctl.program.alarms.codes import Code

_TORQUE_OFF, _QUICK = ReactionClass.TORQUE_OFF, ReactionClass.QUICK_STOP

ROWS: Final = (
    FaultCase(
        number="D1",
        title="drive fault in motion",
        detected_by="state of the drive, one scan",
        reaction=_TORQUE_OFF,
        codes=(Code.DRV_01,),
        reads="the drive has a fault; brake closed",
        injections=(injection("drive", "trip", code=0x2310),),
        position_valid=True,
    ),
    FaultCase(
        number="D2",
        title="warning of the drive",
        detected_by="bit 7 of the statusword, 1 s",
        reaction=ReactionClass.WARNING,
        codes=(Code.DRV_02,),
        reads="the drive warns; the motion goes on",
        injections=(injection("drive", "warning"),),
        position_valid=True,
    ),
    FaultCase(
        number="D3",
        title="drive is stuck in a state",
        detected_by="no transition within its time",
        reaction=ReactionClass.STANDSTILL,
        codes=(Code.DRV_03,),
        reads="the drive is stuck; the brake stays closed",
        injections=(injection("drive", "stuck_state"),),
        phase=Phase.POWER_UP,
        position_valid=True,
    ),
    FaultCase(
        number="D4",
        title="drive leaves Operation enabled by itself",
        detected_by="state of the drive, one scan",
        reaction=_TORQUE_OFF,
        codes=(
            Code.DRV_04,
            Code.DRV_01,
        ),
        reads="the drive is not enabled any more; brake closed",
        injections=(injection("drive", "leaves_enabled"),),
        position_valid=True,
    ),
    FaultCase(
        number="D5",
        title="drive ignores the command and reports it",
        detected_by="bit 12 of the statusword",
        reaction=_TORQUE_OFF,
        codes=(Code.DRV_05,),
        reads="the drive does not follow; torque off",
        injections=(injection("drive", "ignore_target"),),
    ),
    FaultCase(
        number="D6",
        title="drive shows another mode",
        detected_by="mode display 6061",
        reaction=_TORQUE_OFF,
        codes=(Code.DRV_06,),
        reads="the drive is in another mode; torque off",
        injections=(injection("drive", "mode_display", mode=3),),
        buses=("bus",),
    ),
    FaultCase(
        number="D7",
        title="quick stop is not obeyed",
        detected_by="speed against the ramp of the quick stop, 50 ms",
        reaction=ReactionClass.FEEDBACK,
        codes=(
            Code.INT_06,
            Code.DRV_07,
        ),
        reads="the drive does not stop; torque off",
        injections=(injection("drive", "quick_stop_off"), injection("operator", "quick_stop")),
        seen_by=SeenBy.RAMP,
    ),
    FaultCase(
        number="D10",
        title="DC link over-voltage in a quick stop",
        detected_by="drive fault in the stop",
        reaction=_TORQUE_OFF,
        codes=(
            Code.INT_06,
            Code.DRV_10,
        ),
        reads="drive fault in a quick stop; brake closed",
        injections=(injection("drive", "trip", code=0x3210),),
        phase=Phase.QUICK_STOP,
        position_valid=True,
    ),
    FaultCase(
        number="D11",
        title="drive restarts in motion",
        detected_by="boot-up message",
        reaction=_TORQUE_OFF,
        codes=(Code.DRV_11,),
        reads="the drive has restarted; brake closed",
        injections=(injection("drive", "restart", off_s=0.0),),
        buses=("bus",),
    ),
    FaultCase(
        number="D12",
        title="emergency message without a fault state",
        detected_by="emergency message",
        reaction=_QUICK,
        codes=(Code.DRV_12,),
        reads="emergency message of the drive; quick stop",
        injections=(injection("drive", "emcy", code=0x5000),),
        buses=("bus",),
        position_valid=True,
    ),
    FaultCase(
        number="D13",
        title="drive is enabled and gives no torque, in motion",
        detected_by="speed off its command by 0.05 deg/s with a torque of nothing, 50 ms",
        reaction=_TORQUE_OFF,
        codes=(Code.DRV_13,),
        instead=(
            Instead(
                Code.CTL_05,
                "friction stops the rotor beyond the permitted deviation before the torque has been nothing for 50 ms",
                friction_stops_the_rotor,
            ),
        ),
        reads="torque lost; torque off and brake",
        injections=(injection("drive", "no_torque"),),
        from_deviation=True,
    ),
    FaultCase(
        number="D14",
        title="reported torque is off by 0.78 of the torque limit",
        detected_by="a leap without effect on the speed; a torque while the drive is off",
        reaction=ReactionClass.WARNING,
        codes=(Code.DRV_14,),
        reads="the torque reading is wrong; the axis goes on, no motion after it",
        injections=(injection("drive", "torque_reading", limit_share=0.78),),
        position_valid=True,
    ),
)
