"""The plans: to a position, to a speed, to rest, and what needs none: standing still, and going on."""

from __future__ import annotations

import math
from typing import Final

from gantryctl._core import Segments
from gantryctl.errors import CommandRefused
from gantryctl.motion.pieces import Piece, after, segments, to_state, to_velocity
from gantryctl.motion.types import MotionLimits, SetPoint

# Below these the set-point counts as standing or as arrived: a tenth of a fine encoder count at the gantry
# (1.3e-9 rad) and less. Shorter plans would be made of rounding errors.
_AT_REST_RAD_S: Final = 1e-12
_AT_REST_RAD_S2: Final = 1e-10
_ARRIVED_RAD: Final = 1e-10
# A start that reaches its speed limit to within this share is planned in two steps. Asked for a position,
# Ruckig may fail on rounding and fall back to profiles that are valid but far from the fastest.
_SPEED_REACHED: Final = 1e-9
# A short move has a gentle end of a smaller deceleration, in an eighth, a 64th ... of the way.
_END_SHARES: Final = (1.0, 0.5, 0.25, 0.125)
# So that Ruckig, which refuses an end beyond the speed limit, is asked for none.
_END_SPEED_SHARE: Final = 0.99


def hold(pos_rad: float) -> Segments:
    """Plan to stand still at `pos_rad`."""
    return rest(pos_rad, 0.0)


def cruise(pos_rad: float, vel_rad_s: float) -> Segments:
    """Plan to go on from `pos_rad` with a constant speed, without an end."""
    return Segments([], [], [], [], [], 0.0, pos_rad, vel_rad_s)


def rest(pos_rad: float, duration_s: float) -> Segments:
    """Plan that stands still at `pos_rad` and ends after `duration_s`."""
    return Segments([], [], [], [], [], duration_s, pos_rad, 0.0)


def plan_move(start: SetPoint, target_rad: float, limits: MotionLimits) -> Segments:
    """Plan to rest at `target_rad`, as fast as `limits` allow.

    With `end_jerk_rad_s3` the deceleration ends so gently that a load behind backlash comes to lie against its gears.
    Where the target lies behind the point at which the axis can stop, it stops first and then comes back from
    rest: what slows it down and what speeds it up are different limits.

    Raises:
        CommandRefused: a value is not finite, or a limit is not above 0.
    """
    start = _prepared(start, limits)
    if not math.isfinite(target_rad):
        raise CommandRefused(f"the target must be a finite angle, got {target_rad}")
    pieces, here, limits = _way_in(start, target_rad, limits)
    way = target_rad - here.pos_rad
    if abs(way) > _ARRIVED_RAD:
        pieces = pieces + _arrive(here, target_rad, limits, math.copysign(1.0, way))
    return segments(start, pieces, target_rad, 0.0)


def plan_velocity(start: SetPoint, vel_rad_s: float, limits: MotionLimits) -> Segments:
    """Plan to the constant speed `vel_rad_s`, without an end; through rest when the sign changes.

    Raises:
        CommandRefused: a value is not finite, above the speed limit, or a limit is not above 0.
    """
    start = _prepared(start, limits)
    if not abs(vel_rad_s) <= limits.vel_rad_s:
        raise CommandRefused(f"the speed must be within +-{limits.vel_rad_s:.6g} rad/s, got {vel_rad_s}")
    if vel_rad_s == 0.0:
        return plan_stop(start, limits)
    pieces: list[Piece] = []
    here = start
    direction = math.copysign(1.0, vel_rad_s)
    if _direction(start) == -direction or _must_stop_first(start, limits):
        pieces = _stop(start, limits)
        here = SetPoint(after(start, pieces).pos_rad)
    pieces = pieces + to_velocity(here, vel_rad_s, limits, direction)
    return segments(start, pieces, None, vel_rad_s)


def plan_stop(start: SetPoint, limits: MotionLimits) -> Segments:
    """Plan to rest with `limits.dec_rad_s2` and jerk, without ever moving back.

    Where the present acceleration cannot be released within the jerk limit before the axis stands, the jerk
    is what it must be: an axis that stops does not swing back.
    """
    start = _prepared(start, limits)
    return segments(start, _stop(start, limits), None, 0.0)


def stop_point(start: SetPoint, limits: MotionLimits) -> float:
    """Angle at which `plan_stop` would come to rest, rad."""
    start = _prepared(start, limits)
    return after(start, _stop(start, limits)).pos_rad


def _prepared(start: SetPoint, limits: MotionLimits) -> SetPoint:
    """Check `start`; drop its acceleration where plans are trapezoids or the axis stands."""
    limits.checked()
    pos, vel, acc = start.checked()
    if math.isinf(limits.jerk_rad_s3) or abs(acc) <= _AT_REST_RAD_S2:
        acc = 0.0
    if abs(vel) <= _AT_REST_RAD_S:
        acc = 0.0 if acc * vel < 0.0 else acc  # the last instant of a stop, not the first of a way back
        vel = 0.0
    return SetPoint(pos, vel, acc)


def _direction(start: SetPoint) -> float:
    """+1 forward, -1 back, 0 at rest."""
    moving = start.vel_rad_s if start.vel_rad_s != 0.0 else start.acc_rad_s2
    return math.copysign(1.0, moving) if moving != 0.0 else 0.0


def _way_in(
    start: SetPoint, target_rad: float, limits: MotionLimits
) -> tuple[list[Piece], SetPoint, MotionLimits]:
    """Pieces before the move proper: a stop, a ramp down to the speed limit, or none.

    Returns the pieces, the state after them, and the limits for the rest of the move.
    """
    direction = _direction(start)
    if direction == 0.0:
        return [], start, limits
    stopping = _stop(start, limits)
    rest = SetPoint(after(start, stopping).pos_rad)
    if (target_rad - rest.pos_rad) * direction <= _ARRIVED_RAD or _must_stop_first(start, limits):
        return stopping, rest, limits
    peak = _peak_speed(start, limits)
    if peak < limits.vel_rad_s * (1.0 - _SPEED_REACHED):
        return [], start, limits
    slowing = to_velocity(start, direction * limits.vel_rad_s, limits, direction)
    slow = SetPoint(after(start, slowing).pos_rad, direction * limits.vel_rad_s)
    if (target_rad - after(slow, _stop(slow, limits)).pos_rad) * direction > _ARRIVED_RAD:
        return slowing, slow, limits
    # Too near for a ramp down in two steps: it only slows down from its present speed.
    return [], start, limits._replace(vel_rad_s=peak)


def _arrive(start: SetPoint, target_rad: float, limits: MotionLimits, direction: float) -> list[Piece]:
    """Pieces to rest at the target; with a gentle end where one is asked for and there is room for it.

    An end of deceleration d and jerk j lasts d/j, begins at the speed d^2/(2j) and takes d^3/(6j^2) of the way.
    """
    jerk = limits.end_jerk_rad_s3
    if not jerk < limits.jerk_rad_s3 < math.inf:
        return to_state(start, SetPoint(target_rad), limits, direction)
    # Before the end the speed is higher by what the ramp takes to come to its deceleration.
    most = math.sqrt(2.0 * limits.vel_rad_s / (1.0 / jerk + 1.0 / limits.jerk_rad_s3))
    dec = min(limits.end_dec_rad_s2, limits.dec_rad_s2, _END_SPEED_SHARE * most)
    for share in _END_SHARES:
        d = share * dec
        vel, acc = direction * d * d / (2.0 * jerk), -direction * d
        begin = SetPoint(target_rad - direction * d**3 / (6.0 * jerk * jerk), vel, acc)
        slowing = to_velocity(start, vel, limits, direction, acc)
        room = (begin.pos_rad - after(start, slowing).pos_rad) * direction
        if room > -_ARRIVED_RAD:
            pieces = to_state(start, begin, limits, direction) if room > _ARRIVED_RAD else slowing
            return [*pieces, Piece(d / jerk, direction * jerk, acc)]
    return to_state(start, SetPoint(target_rad), limits, direction)


def _peak_speed(start: SetPoint, limits: MotionLimits) -> float:
    """Speed once the present acceleration is released: `start` cannot avoid it."""
    _, vel, acc = start
    gain = acc * acc / (2.0 * limits.jerk_rad_s3) if acc * vel >= 0.0 else 0.0
    return abs(vel) + gain


def _must_stop_first(start: SetPoint, limits: MotionLimits) -> bool:
    """Whether the axis slows down so hard that it stands before its acceleration is gone."""
    _, vel, acc = start
    return acc * vel < 0.0 and 2.0 * limits.jerk_rad_s3 * abs(vel) <= acc * acc


def _stop(start: SetPoint, limits: MotionLimits) -> list[Piece]:
    direction = _direction(start)
    if direction == 0.0:
        return []
    _, vel, acc = start
    if math.isinf(limits.jerk_rad_s3):
        return [Piece(abs(vel) / limits.dec_rad_s2, 0.0, -direction * limits.dec_rad_s2)]
    if _must_stop_first(start, limits):
        duration_s = 2.0 * abs(vel / acc)
        return [Piece(duration_s, -acc / duration_s, None)]
    return to_velocity(start, 0.0, limits, direction)
