"""Control loop, command and motion (B)."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.case import FaultCase, Instead, Phase, ReactionClass, SeenBy
from gantryctl.engineering.faults.injection import injection
from gantryctl.engineering.faults.physics import drive_outruns_the_reading, moment_turns_the_axis
from gantryctl.program.alarms.codes import Code

_TORQUE_OFF, _QUICK = ReactionClass.TORQUE_OFF, ReactionClass.QUICK_STOP

ROWS: Final = (
    FaultCase(
        number="B1",
        title="absurd number as a command",
        detected_by="range and finiteness of every number, before anything moves",
        reaction=ReactionClass.REFUSED,
        codes=(
            Code.CTL_01,
            Code.CTL_09,
        ),
        reads="speed or angle must be within its range",
        injections=(injection("operator", "move", target_deg=95.0, speed_deg_s=1e300),),
        phase=Phase.ENABLED,
        position_valid=True,
    ),
    FaultCase(
        number="B3",
        title="friction of the motor grows to any load and half of the rated torque",
        detected_by="torque of a motion against that of earlier ones; following error",
        reaction=ReactionClass.HALT,
        codes=(Code.BRK_02,),
        reads="the brake drags: stop on the ramp",
        injections=(injection("plant", "motor_friction", beyond_load_share=0.52, over_s=0.2),),
        seen_by=SeenBy.DRAG,
    ),
    FaultCase(
        number="B5",
        title="drive turns the other way, in motion",
        detected_by="speed against the command, 0.5 deg/s for 2 scans",
        reaction=ReactionClass.FEEDBACK,
        codes=(
            Code.CTL_05,
            Code.CTL_03,
            Code.DRV_13,
        ),
        instead=(
            Instead(
                Code.ENC_14,
                "the drive turns the bare rotor by more in a scan than a speed may change",
                drive_outruns_the_reading,
            ),
        ),
        reads="moves against the command; torque off",
        injections=(injection("drive", "sign"),),
    ),
    FaultCase(
        number="B6",
        title="drive turns the other way, at the first move",
        detected_by="speed against the command, 0.5 deg/s for 2 scans",
        reaction=ReactionClass.STANDSTILL,
        codes=(
            Code.CTL_05,
            Code.CTL_03,
            Code.ENC_12,
        ),
        instead=(
            Instead(
                Code.DRV_13,
                "an eccentric moment above the friction turns the axis: the torque passes through nothing",
                moment_turns_the_axis,
            ),
        ),
        reads="moves against the command; torque off",
        injections=(injection("drive", "sign"),),
        phase=Phase.FIRST_MOVE,
    ),
    FaultCase(
        number="B7",
        title="load shifts at standstill: 0.64 of the rated torque must hold it after 1 s",
        detected_by="holding torque above a part of the rated torque",
        reaction=ReactionClass.STANDSTILL,
        also=Code.CTL_06,
        reads="holding torque high; no new moves",
        injections=(injection("plant", "load_shift", rated_share=0.638, over_s=1.0),),
        phase=Phase.ENABLED,
    ),
    FaultCase(
        number="B8",
        title="torque limit falls to a fiftieth",
        detected_by="torque limited for 200 ms while the following error grows",
        reaction=_TORQUE_OFF,
        codes=(
            Code.CTL_07,
            Code.CTL_03,
            Code.DRV_13,
            Code.CTL_05,
        ),
        reads="torque limit reached; stop",
        injections=(injection("drive", "torque_limit", share=0.02),),
        seen_by=SeenBy.SATURATION,
        from_deviation=True,
    ),
    FaultCase(
        number="B10",
        title="target outside the travel, speed out of range, no way at all",
        detected_by="checks of a command before it begins",
        reaction=ReactionClass.REFUSED,
        codes=(
            Code.CTL_09,
            Code.CTL_01,
        ),
        reads="the target must be within the travel",
        injections=(injection("operator", "move", target_deg=400.0, speed_deg_s=1.0),),
        phase=Phase.ENABLED,
        position_valid=True,
    ),
    FaultCase(
        number="B13",
        title="torque is limited while the load is held by torque",
        detected_by="motion in HOLD, 0.15 deg",
        reaction=ReactionClass.STANDSTILL,
        codes=(
            Code.BRK_03,
            Code.BRK_13,
            Code.BRK_04,
        ),
        reads="load moving: people must leave",
        injections=(injection("drive", "torque_limit", share=0.0),),
        phase=Phase.HOLD,
        hold=True,
        also=Code.BRK_13,
        rests=False,
    ),
)
