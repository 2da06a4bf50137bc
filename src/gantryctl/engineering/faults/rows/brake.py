"""Brake and handing over of the load (C)."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.case import FaultCase, Instead, Phase, ReactionClass, SeenBy
from gantryctl.engineering.faults.injection import When, injection
from gantryctl.engineering.faults.physics import brake_outruns_the_reading
from gantryctl.program.alarms.codes import Code

_TORQUE_OFF, _SLIP = ReactionClass.TORQUE_OFF, ReactionClass.BRAKE_SLIP

ROWS: Final = (
    FaultCase(
        number="C1",
        title="brake does not open",
        detected_by="contact, or torque without motion, 300 ms after the command",
        reaction=ReactionClass.STANDSTILL,
        codes=(Code.BRK_01,),
        reads="the brake does not open; power stays off",
        injections=(injection("brake", "stuck", position="closed"),),
        phase=Phase.POWER_UP,
        position_valid=True,
    ),
    FaultCase(
        number="C2",
        title="brake drags",
        detected_by="torque beyond what was learned, or beyond any load, 15 % of the rated torque for 1 s",
        reaction=ReactionClass.WARNING,
        codes=(Code.BRK_02,),
        reads="the brake drags",
        injections=(injection("plant", "motor_friction", beyond_load_share=0.27, over_s=0.2),),
        position_valid=True,
    ),
    FaultCase(
        number="C3",
        title="brake does not hold at power-off",
        detected_by="way of 0.02 deg while the torque is taken off",
        reaction=_SLIP,
        codes=(
            Code.BRK_03,
            Code.BRK_04,
        ),
        reads="the brake does not hold; torque keeps the load",
        injections=(
            injection("brake", "torque", share=0.0),
            injection("operator", "power_off"),
        ),
        phase=Phase.ENABLED,
        hold=True,
        position_valid=True,
    ),
    FaultCase(
        number="C4",
        title="brake slips at standstill, power off",
        detected_by="way of 0.02 deg while off",
        reaction=_SLIP,
        codes=(Code.BRK_04,),
        reads="the brake slips; torque keeps the load",
        injections=(injection("brake", "torque", share=0.0),),
        phase=Phase.OFF,
        hold=True,
        position_valid=True,
    ),
    FaultCase(
        number="C5",
        title="brake closes by itself in motion",
        detected_by="contact",
        reaction=_TORQUE_OFF,
        codes=(Code.BRK_05,),
        reads="the brake closed in motion; torque off",
        injections=(injection("brake", "stuck", position="closed"),),
    ),
    FaultCase(
        number="C6",
        title="contact of the brake contradicts the command, in motion",
        detected_by="contact against command, 300 ms",
        reaction=ReactionClass.QUICK_STOP,
        codes=(
            Code.BRK_05,
            Code.BRK_06,
        ),
        reads="the contact says closed; quick stop",
        injections=(injection("brake", "contact", open=False),),
        seen_by=SeenBy.BRAKE_CONTACT,
    ),
    FaultCase(
        number="C7",
        title="drive is enabled and gives no torque, at power-up",
        detected_by="torque against the learned holding torque before the brake opens, 500 ms",
        reaction=ReactionClass.STANDSTILL,
        codes=(
            Code.BRK_07,
            Code.DRV_13,
            Code.ENC_12,
        ),
        reads="torque not proven; the brake stays closed",
        injections=(injection("drive", "no_torque"),),
        phase=Phase.POWER_UP,
    ),
    FaultCase(
        number="C10",
        title="brake closes by itself in motion, its contact says open",
        detected_by="torque that rises without effect on the speed",
        reaction=_TORQUE_OFF,
        codes=(Code.BRK_14,),
        instead=(
            Instead(
                Code.ENC_14,
                "the brake stops the bare rotor by more in a scan than a speed may change",
                brake_outruns_the_reading,
            ),
        ),
        reads="torque without effect; torque off",
        injections=(
            injection("brake", "contact", open=True),
            injection("brake", "stuck", position="closed"),
        ),
    ),
    FaultCase(
        number="C11",
        title="brake closes 0.2 s late after torque off",
        detected_by="contact, and the way",
        reaction=ReactionClass.NONE,
        codes=(Code.INT_03,),
        reads="emergency stop",
        injections=(
            injection("brake", "slow", late_s=0.2),
            injection("input", "off", name="estop_ok"),
        ),
    ),
    FaultCase(
        number="C12",
        title="weak brake after torque off: half of its torque",
        detected_by="way after the stop",
        reaction=ReactionClass.NONE,
        codes=(Code.INT_03,),
        reads="emergency stop",
        injections=(
            injection("brake", "torque", share=0.5),
            injection("input", "off", name="estop_ok", when=When(after_s=0.01)),
        ),
    ),
)
