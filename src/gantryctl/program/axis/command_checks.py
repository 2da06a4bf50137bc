"""Checks that refuse a motion whole: range, way, direction, speed.

The axis judges every command with these checks. A command line judges with the same ones before it switches power on,
which spares a power cycle that would end in a refusal.
"""

from __future__ import annotations

import math
from typing import Final

from gantryctl.errors import CommandRefused
from gantryctl.image import Direction
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import Refusal, refusal
from gantryctl.program.alarms.words import Said, Words
from gantryctl.program.axis.motion_command import Dynamics
from gantryctl.program.monitors.interlocks import Interlocks
from gantryctl.program.settings import RampSettings, SpeedSettings, TravelSettings
from gantryctl.program.stretch import Sector
from gantryctl.units import deg, rad

# A way shorter than one fine encoder count at the gantry, 1.3e-9 rad, is no way: 720 increments of 0.25 deg end 3e-14
# rad beyond 180 deg.
_NO_WAY_RAD: Final = 1e-9
# Beyond this the refusal names the range, not the distance left: "target 1e300 deg" has 300 digits.
_ABSURD_RAD: Final = rad(1e6)


def require(refused: Refusal | None) -> None:
    """Raise CommandRefused for a refusal: outside a scan errors are exceptions."""
    if refused is not None:
        raise CommandRefused(refused.text)


def check_range(target_rad: float, travel: TravelSettings) -> Refusal | None:
    """Refuse a target that is not finite, or absurdly far away."""
    if -_ABSURD_RAD <= target_rad <= _ABSURD_RAD:
        return None
    return refusal(
        Code.CTL_01,
        name=Words.NAME_TARGET,
        allowed=Words.WITHIN_TRAVEL(
            low=deg(max(travel.pos_min_rad, -_ABSURD_RAD)), high=deg(min(travel.pos_max_rad, _ABSURD_RAD))
        ),
        measured=Words.ANGLE(value=deg(target_rad)),
    )


def check_destination(
    here_rad: float, target_rad: float, direction: Direction | None, travel: TravelSettings
) -> Refusal | None:
    """Refuse an angle or a direction that the axis does not have.

    A linear axis has one way to an angle, so a direction is refused. To a modulo axis an angle is a place of its turn;
    beyond +-360 deg it may have been meant as a way, so it is refused.
    """
    if not travel.endless:
        if direction is not None:
            return refusal(Code.CTL_14, reason=Words.DIRECTION_OF_LINEAR)
        return check_target(here_rad, target_rad, travel)
    # The limit itself, typed in deg, must pass after its conversion.
    if abs(target_rad) <= math.tau * (1.0 + 1e-9):
        return None
    return refusal(
        Code.CTL_01,
        name=Words.NAME_TARGET,
        allowed=Words.WITHIN_TRAVEL(low=-360.0, high=360.0),
        measured=Words.ANGLE(value=deg(target_rad)),
    )


def inside_turn(here_rad: float, target_rad: float, travel: TravelSettings) -> Direction | None:
    """Direction of a modulo axis that goes from one angle to another as a linear one would: not over the turn's end.

    None for a linear axis. Tests and measurements choose their angles in the turn of the machine file, and their ways
    between these.
    """
    if not travel.endless:
        return None
    return Direction.POSITIVE if target_rad >= travel.shown_rad(here_rad) else Direction.NEGATIVE


def way_to(here_rad: float, target_rad: float, direction: Direction, window_rad: float) -> float:
    """Way of a modulo axis from `here_rad` to an angle of its turn, its sign the direction.

    An angle that lies less than `window_rad` the other way counts as reached: nobody means a whole turn by it. Of two
    ways of half a turn the positive one is the shortest. `Direction.CURRENT` is the caller's to resolve.
    """
    way = math.remainder(target_rad - here_rad, math.tau)
    match direction:
        case Direction.POSITIVE if way < -window_rad:
            return way + math.tau
        case Direction.NEGATIVE if way > window_rad:
            return way - math.tau
        case Direction.SHORTEST if way < window_rad - math.pi:
            return way + math.tau
    return way


def check_target(here_rad: float, target_rad: float, travel: TravelSettings) -> Refusal | None:
    """Refuse a target outside travel or behind a no-go sector, unless it is nearer to what is permitted."""
    low, high, below, above = travel.stretch(here_rad)
    # The way back from outside is always open.
    if target_rad > high + _NO_WAY_RAD and target_rad >= here_rad:
        limit_rad, left_rad, sector = high, high - here_rad, above
    elif target_rad < low - _NO_WAY_RAD and target_rad <= here_rad:
        limit_rad, left_rad, sector = low, here_rad - low, below
    else:
        return check_range(target_rad, travel)
    if sector is not None:
        return check_range(target_rad, travel) or _no_go(here_rad, target_rad, limit_rad, sector, travel)
    return check_range(target_rad, travel) or refusal(
        Code.CTL_09,
        measured=deg(travel.read_rad(target_rad)),
        limit=deg(travel.read_end_rad(limit_rad)),
        position=round(deg(travel.read_rad(here_rad)), 2) + 0.0,  # never "-0.00"
        left=max(0.0, deg(left_rad)),
    )


def _no_go(
    here_rad: float, target_rad: float, limit_rad: float, sector: Sector, travel: TravelSettings
) -> Refusal:
    """Name the sector that the way enters, the nearest permitted angle, and the way round if the axis has one."""
    round_: Words | Said = Words.NO_WAY_ROUND
    if travel.endless:
        other = target_rad - math.copysign(math.tau, target_rad - here_rad)
        stretch = travel.stretch(here_rad)
        if stretch.low_rad <= other <= stretch.high_rad:
            round_ = Words.WAY_ROUND(way=deg(other - here_rad))
    return refusal(
        Code.CTL_18,
        measured=deg(travel.read_rad(target_rad)),
        begin=deg(travel.read_rad(sector[0])),
        end=deg(travel.read_rad(sector[1])),
        position=round(deg(travel.read_rad(here_rad)), 2) + 0.0,
        limit=round(deg(travel.read_rad(limit_rad)), 2) + 0.0,
        round=round_,
    )


def check_way(
    here_rad: float, target_rad: float, travel: TravelSettings, interlocks: Interlocks
) -> Refusal | None:
    """Refuse a target outside the travel, and motion towards an open limit switch."""
    return check_target(here_rad, target_rad, travel) or _inward_only(
        travel.read_rad(here_rad),
        target_rad > here_rad + _NO_WAY_RAD and not interlocks.plus_open,
        target_rad < here_rad - _NO_WAY_RAD and not interlocks.minus_open,
    )


def check_direction(here_rad: float, vel_rad_s: float, travel: TravelSettings) -> Refusal | None:
    """Refuse a speed towards the end of the travel at which the axis stands; its sign is the direction."""
    low, high, below, above = travel.stretch(here_rad)
    at_end = here_rad >= high - _NO_WAY_RAD if vel_rad_s > 0.0 else here_rad <= low + _NO_WAY_RAD
    sector = above if vel_rad_s > 0.0 else below
    if at_end and sector is not None:
        target_rad = sector[0] if vel_rad_s > 0.0 else sector[1]
        return _no_go(here_rad, target_rad, high if vel_rad_s > 0.0 else low, sector, travel)
    return _inward_only(travel.read_rad(here_rad), vel_rad_s > 0.0 and at_end, vel_rad_s < 0.0 and at_end)


def check_speed(speed_rad_s: float, speed_max_rad_s: float) -> Refusal | None:
    """Refuse a speed of 0 or above the highest one: a program may creep below the lowest setting."""
    # Written so that NaN is refused: `nan > limit` is false.
    if 0.0 < speed_rad_s <= speed_max_rad_s:
        return None
    return _wrong_speed(speed_rad_s, Words.AT_MOST_SPEED(high=deg(speed_max_rad_s)))


def check_dynamics(dynamics: Dynamics, ramps: RampSettings) -> Refusal | None:
    """Refuse ramps of one motion that are 0 or above those of the machine."""
    acc, dec, jerk = dynamics
    return (
        check_ramp(Words.NAME_ACCELERATION, acc, ramps.acc_rad_s2)
        or check_ramp(Words.NAME_DECELERATION, dec, ramps.dec_rad_s2)
        or check_jerk(jerk, ramps.jerk_rad_s3)
    )


def check_ramp(name: Words, value_rad_s2: float | None, high_rad_s2: float) -> Refusal | None:
    """Refuse an acceleration or deceleration that is not above 0 and at most `high_rad_s2`; None passes."""
    if value_rad_s2 is None or 0.0 < value_rad_s2 <= high_rad_s2:
        return None
    return refusal(
        Code.CTL_01,
        name=name,
        allowed=Words.AT_MOST_ACCELERATION(high=deg(high_rad_s2)),
        measured=Words.ACCELERATION(value=deg(value_rad_s2)),
    )


def check_jerk(value_rad_s3: float | None, high_rad_s3: float) -> Refusal | None:
    """Refuse a jerk that is not above 0 and at most `high_rad_s3`; None passes, and inf where ramps are trapezoids."""
    if value_rad_s3 is None or 0.0 < value_rad_s3 <= high_rad_s3:
        return None
    allowed = Words.ABOVE_ZERO if math.isinf(high_rad_s3) else Words.AT_MOST_JERK(high=deg(high_rad_s3))
    return refusal(
        Code.CTL_01, name=Words.NAME_JERK, allowed=allowed, measured=Words.JERK(value=deg(value_rad_s3))
    )


def check_setting(speed_rad_s: float, speed: SpeedSettings) -> Refusal | None:
    """Refuse a speed outside the range of the speed setting; it is never clamped."""
    if speed.setting_min_rad_s <= speed_rad_s <= speed.setting_max_rad_s:
        return None
    low, high = deg(speed.setting_min_rad_s), deg(speed.setting_max_rad_s)
    return _wrong_speed(speed_rad_s, Words.WITHIN_SPEEDS(low=low, high=high))


def check_overdue(speed_rad_s: float, speed: SpeedSettings) -> Refusal | None:
    """Refuse a speed that is too high for a brake whose test is overdue."""
    limit_rad_s = speed.brake_overdue_rad_s
    # The limit itself, typed in deg/s, must pass after its conversion.
    if speed_rad_s <= limit_rad_s * (1.0 + 1e-9):
        return None
    return refusal(Code.BRK_12, measured=deg(speed_rad_s), limit=deg(limit_rad_s))


def _inward_only(read_rad: float, plus_shut: bool, minus_shut: bool) -> Refusal | None:
    if not (plus_shut or minus_shut):
        return None
    return refusal(Code.LIM_05, measured=deg(read_rad), side=Words.REVERSE if plus_shut else Words.FORWARD)


def _wrong_speed(speed_rad_s: float, allowed: Said) -> Refusal:
    measured = Words.SPEED(value=deg(speed_rad_s))
    return refusal(Code.CTL_01, name=Words.NAME_SPEED, allowed=allowed, measured=measured)
