"""Limits, interlocks, people and power (G)."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.case import FaultCase, Phase, ReactionClass, SeenBy
from gantryctl.engineering.faults.injection import injection
from gantryctl.program.alarms.codes import Code

_TORQUE_OFF, _QUICK = ReactionClass.TORQUE_OFF, ReactionClass.QUICK_STOP

ROWS: Final = (
    FaultCase(
        number="G3",
        title="limit switch opens in motion",
        detected_by="input, one scan",
        reaction=_QUICK,
        codes=(Code.LIM_03,),
        reads="limit switch; quick stop",
        injections=(injection("input", "off", name="limit_plus_ok"),),
        position_valid=True,
    ),
    FaultCase(
        number="G4",
        title="both limit switches open: a broken wire",
        detected_by="both inputs, one scan",
        reaction=_QUICK,
        codes=(Code.LIM_04,),
        reads="both limit switches; quick stop",
        injections=(
            injection("input", "off", name="limit_plus_ok"),
            injection("input", "off", name="limit_minus_ok"),
        ),
        position_valid=True,
    ),
    FaultCase(
        number="G7",
        title="collision interlock opens in motion",
        detected_by="input, one scan",
        reaction=_QUICK,
        codes=(Code.INT_01,),
        reads="collision interlock; quick stop",
        injections=(injection("input", "off", name="collision_ok"),),
        position_valid=True,
    ),
    FaultCase(
        number="G9",
        title="emergency stop in motion",
        detected_by="input, one scan; the hardware acts",
        reaction=_TORQUE_OFF,
        codes=(Code.INT_03,),
        reads="emergency stop",
        injections=(injection("input", "off", name="estop_ok"),),
        position_valid=True,
    ),
    FaultCase(
        number="G9b",
        title="emergency stop in a quick stop",
        detected_by="input, one scan; the hardware acts",
        reaction=_TORQUE_OFF,
        codes=(Code.INT_06,),
        reads="quick stop, then emergency stop",
        injections=(injection("input", "off", name="estop_ok"),),
        phase=Phase.QUICK_STOP,
        position_valid=True,
    ),
    FaultCase(
        number="G10",
        title="second channel of the emergency stop opens alone, in motion",
        detected_by="input, one scan; then the difference for 500 ms",
        reaction=_TORQUE_OFF,
        codes=(Code.INT_03,),
        reads="emergency stop; its channels differ",
        injections=(injection("input", "off", name="estop_ok_2"),),
        position_valid=True,
    ),
    FaultCase(
        number="G11",
        title="room door opens in motion",
        detected_by="input, one scan",
        reaction=ReactionClass.HALT,
        codes=(Code.INT_07,),
        reads="room door; the axis stops on its ramp",
        injections=(injection("input", "off", name="door_ok"),),
        position_valid=True,
    ),
    FaultCase(
        number="G12",
        title="winding at 156 C in motion",
        detected_by="sensor, as part of the permitted rise",
        reaction=_QUICK,
        codes=(Code.THM_04,),
        reads="motor too hot; quick stop",
        injections=(injection("input", "motor_temperature", temp_c=156.0),),
        buses=("sim",),
        position_valid=True,
        seen_by=SeenBy.WINDING,
    ),
    FaultCase(
        number="G13",
        title="temperature sensor open in motion",
        detected_by="outside its range for 1 s",
        reaction=ReactionClass.WARNING,
        codes=(Code.THM_02,),
        reads="the sensor is broken; the model goes on with half of its limit",
        injections=(injection("input", "motor_temperature", temp_c=999.0),),
        buses=("sim",),
        position_valid=True,
    ),
    FaultCase(
        number="G14",
        title="mains lost in motion",
        detected_by="input, or fault of the drive",
        reaction=_TORQUE_OFF,
        codes=(
            Code.PWR_01,
            Code.DRV_01,
        ),
        reads="mains lost; brake closed",
        injections=(injection("input", "off", name="mains_ready"),),
        position_valid=True,
    ),
    FaultCase(
        number="G15",
        title="mains flicker for 0.1 s in motion",
        detected_by="input, or fault of the drive",
        reaction=_TORQUE_OFF,
        codes=(
            Code.PWR_01,
            Code.DRV_01,
        ),
        reads="mains lost; brake closed; nothing starts again",
        injections=(injection("input", "off", name="mains_ready", for_s=0.1),),
        position_valid=True,
    ),
    FaultCase(
        number="G17",
        title="quick stop by a person, nothing is wrong",
        detected_by="the person",
        reaction=_QUICK,
        codes=(Code.INT_06,),
        reads="quick stop by the operator",
        injections=(injection("operator", "quick_stop"),),
        position_valid=True,
    ),
)
