"""Settings whose timers last one scan or a few: running, or run out.

One scan takes two seconds, and the way to full speed as long, so that positions stay on a grid.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from gantryctl.program.alarms.words import Words
from gantryctl.program.settings import (
    AxisSettings,
    LawSettings,
    MonitorSettings,
    PowerSettings,
    RampSettings,
    SpeedSettings,
    StandstillPolicy,
    ThermalSettings,
    TravelSettings,
)
from gantryctl.units import rad

PERIOD_S: Final = 2.0
SPEED_RAD_S: Final = rad(1.0)
WAY_RAD: Final = SPEED_RAD_S * PERIOD_S
"""Way of one scan at the speed setting; the travel is so much to either side."""
# A millionth steeper than one scan: rounding must not make a ramp last a scan longer.
_RAMP_RAD_S2: Final = SPEED_RAD_S / PERIOD_S * (1.0 + 1e-6)


class BriefSettings(AxisSettings):
    """Timers of one scan where they would be of two: running, or run out."""

    __slots__ = ()

    def scans(self, time_s: float, least: int = 1) -> int:
        return max(1, math.ceil(time_s / self.period_s - 1e-9))


def settings(*, parks: bool, torque_preload: bool = True) -> AxisSettings:
    """Settings of the world: `parks`: the brake holds at standstill.

    Args:
        torque_preload: without it a brake cannot be tested either, as the machine files have it.
    """
    travel = WAY_RAD * (1.0 + 1e-6)
    return BriefSettings(
        period_s=PERIOD_S,
        travel=TravelSettings(-travel, travel, -1.3 * WAY_RAD, 1.3 * WAY_RAD),
        speed=SpeedSettings(
            0.5 * SPEED_RAD_S,
            SPEED_RAD_S,
            1.05 * SPEED_RAD_S,
            1.1 * SPEED_RAD_S,
            without_enabling_switch_rad_s=0.75 * SPEED_RAD_S,
        ),
        ramps=RampSettings(_RAMP_RAD_S2, _RAMP_RAD_S2, math.inf, _RAMP_RAD_S2, math.inf, _RAMP_RAD_S2),
        law=LawSettings(1.0, 1.0, 100.0, 1 << 22, 1 << 12, 0.0),
        power=PowerSettings(
            torque_max_nm=385.0,
            torque_rated_nm=257.0,
            brake_stops_max=1 << 60,
            standstill=StandstillPolicy.BRAKE if parks else StandstillPolicy.SERVO,
            hold_brake_after_s=2.0 * PERIOD_S,
            torque_preload=torque_preload,
            untestable=None if torque_preload else Words.NO_TORQUE_INPUT,
            learn_time_s=PERIOD_S,
            # The drive takes three scans to its enable.
            power_up_time_s=3.5 * PERIOD_S,
        ),
        monitors=replace(
            MonitorSettings(),
            # The speed shown is the command of the scan before; the way is that of the set-point.
            encoder_drift_max_rad=1.5 * WAY_RAD,
            lease_s=2.0 * PERIOD_S,
            chatter_time_s=-1.0,
        ),
        # The motor is as warm as its torque says now, and never warm.
        thermal=replace(ThermalSettings(), torque_rated_nm=1e6, time_constant_s=1e-9),
    )
