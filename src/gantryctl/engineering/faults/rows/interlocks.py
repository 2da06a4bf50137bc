"""Limits, interlocks, people and power (G)."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.case import FaultCase, Phase, ReactionClass
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
