"""What a motion command must be: None, or why it is refused."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import Refusal, refusal
from gantryctl.program.monitors.interlocks import Interlocks
from gantryctl.program.settings import TravelSettings
from gantryctl.units import deg, rad

OVERDUE_RAD_S: Final = rad(1.0)
"""Nothing moves faster while the brake test is overdue."""
# A way shorter than this is none: less than one fine count at the gantry.
_NO_WAY_RAD: Final = 1e-9


def check_angle(name: str, angle_rad: float) -> Refusal | None:
    """A number at all."""
    if math.isfinite(angle_rad):
        return None
    return refusal(Code.CTL_01, name=name, allowed="a finite angle", measured=angle_rad)


def check_speed(speed_rad_s: float, top_rad_s: float) -> Refusal | None:
    """Above 0 and no more than the highest speed setting."""
    if 0.0 < speed_rad_s <= top_rad_s:
        return None
    allowed = f"above 0 and at most {deg(top_rad_s):.2f} deg/s"
    return refusal(Code.CTL_01, name="speed", allowed=allowed, measured=f"{deg(speed_rad_s):.6g} deg/s")


def check_overdue(speed_rad_s: float) -> Refusal | None:
    """Slow enough for a brake whose test is overdue."""
    if speed_rad_s <= OVERDUE_RAD_S * (1.0 + 1e-9):
        return None
    return refusal(Code.BRK_12, measured=deg(speed_rad_s), limit=deg(OVERDUE_RAD_S))


def check_direction(here_rad: float, vel_rad_s: float, travel: TravelSettings) -> Refusal | None:
    """A motion with a speed only: forward and back are judged by the sign, not by the target."""
    if vel_rad_s > 0.0 and here_rad >= travel.pos_max_rad - _NO_WAY_RAD:
        return refusal(Code.LIM_05, measured=deg(here_rad), side="reverse")
    if vel_rad_s < 0.0 and here_rad <= travel.pos_min_rad + _NO_WAY_RAD:
        return refusal(Code.LIM_05, measured=deg(here_rad), side="forward")
    return None


def check_way(
    here_rad: float, target_rad: float, travel: TravelSettings, interlocks: Interlocks
) -> Refusal | None:
    """Inside the travel, or at least nearer to it than here; not towards an open limit switch."""
    low, high = travel.pos_min_rad, travel.pos_max_rad
    if target_rad > high and target_rad >= here_rad:
        return _beyond(here_rad, target_rad, high, high - here_rad)
    if target_rad < low and target_rad <= here_rad:
        return _beyond(here_rad, target_rad, low, here_rad - low)
    if target_rad > here_rad + _NO_WAY_RAD and not interlocks.plus_open:
        return refusal(Code.LIM_05, measured=deg(here_rad), side="reverse")
    if target_rad < here_rad - _NO_WAY_RAD and not interlocks.minus_open:
        return refusal(Code.LIM_05, measured=deg(here_rad), side="forward")
    return None


def _beyond(here_rad: float, target_rad: float, limit_rad: float, left_rad: float) -> Refusal:
    return refusal(
        Code.CTL_09,
        measured=deg(target_rad),
        limit=deg(limit_rad),
        position=deg(here_rad),
        left=max(0.0, deg(left_rad)),
    )
