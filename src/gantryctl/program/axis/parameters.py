"""Parameters of the axis under the numbers of PLCopen Part 1: which can be read and written, what they mean here.

Limits belong to the machine file. A program may lower those of its own motions (MAX_..._APPL) and raise them again,
never above the machine's; monitors and the travel cannot be changed or left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from enum import IntEnum
from typing import TYPE_CHECKING, Final

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import Refusal, refusal
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.command_checks import check_jerk, check_ramp, check_speed

if TYPE_CHECKING:
    from gantryctl.program.axis.axis import Axis


class Parameter(IntEnum):
    """Parameters of PLCopen Part 1, table 5; rad, rad/s, rad/s2, rad/s3 at the gantry."""

    COMMANDED_POSITION = 1
    SW_LIMIT_POS = 2
    """End of the stretch that the set-point reaches now: of the travel, or before a no-go sector."""
    SW_LIMIT_NEG = 3
    ENABLE_LIMIT_POS = 4
    ENABLE_LIMIT_NEG = 5
    ENABLE_POS_LAG_MONITORING = 6
    MAX_POSITION_LAG = 7
    """Following error that trips at the speed of the set-point now."""
    MAX_VELOCITY_SYSTEM = 8
    MAX_VELOCITY_APPL = 9
    ACTUAL_VELOCITY = 10
    COMMANDED_VELOCITY = 11
    MAX_ACCELERATION_SYSTEM = 12
    MAX_ACCELERATION_APPL = 13
    MAX_DECELERATION_SYSTEM = 14
    MAX_DECELERATION_APPL = 15
    MAX_JERK_SYSTEM = 16
    """inf: ramps are trapezoids."""
    MAX_JERK_APPL = 17


def _position_lag(axis: Axis) -> float:
    monitors = axis.settings.monitors
    return monitors.following_error_base_rad + monitors.following_error_per_speed_s * abs(
        axis.virtual.vel_ref_rad_s
    )


_READ: Final[dict[int, Callable[[Axis], float]]] = {
    Parameter.COMMANDED_POSITION: lambda axis: axis.settings.travel.shown_rad(axis.virtual.pos_ref_rad),
    Parameter.SW_LIMIT_POS: lambda axis: axis.settings.travel.stretch(axis.virtual.pos_ref_rad).high_rad,
    Parameter.SW_LIMIT_NEG: lambda axis: axis.settings.travel.stretch(axis.virtual.pos_ref_rad).low_rad,
    Parameter.MAX_POSITION_LAG: _position_lag,
    Parameter.MAX_VELOCITY_SYSTEM: lambda axis: axis.settings.speed.setting_max_rad_s,
    Parameter.MAX_VELOCITY_APPL: lambda axis: axis.motion.speed_max_rad_s,
    Parameter.ACTUAL_VELOCITY: lambda axis: axis.feedback.vel_rad_s,
    Parameter.COMMANDED_VELOCITY: lambda axis: axis.virtual.vel_ref_rad_s,
    Parameter.MAX_ACCELERATION_SYSTEM: lambda axis: axis.settings.ramps.acc_rad_s2,
    Parameter.MAX_ACCELERATION_APPL: lambda axis: axis.virtual.ramps.acc_rad_s2,
    Parameter.MAX_DECELERATION_SYSTEM: lambda axis: axis.settings.ramps.dec_rad_s2,
    Parameter.MAX_DECELERATION_APPL: lambda axis: axis.virtual.ramps.dec_rad_s2,
    Parameter.MAX_JERK_SYSTEM: lambda axis: axis.settings.ramps.jerk_rad_s3,
    Parameter.MAX_JERK_APPL: lambda axis: axis.virtual.ramps.jerk_rad_s3,
}

# A modulo axis has no ends of travel, but it may have a no-go sector; all else that protects the axis is always on.
_READ_BOOL: Final[dict[int, Callable[[Axis], bool]]] = {
    Parameter.ENABLE_LIMIT_POS: lambda axis: math.isfinite(_READ[Parameter.SW_LIMIT_POS](axis)),
    Parameter.ENABLE_LIMIT_NEG: lambda axis: math.isfinite(_READ[Parameter.SW_LIMIT_NEG](axis)),
    Parameter.ENABLE_POS_LAG_MONITORING: lambda axis: True,
}


def read_parameter(axis: Axis, number: int) -> float | Refusal:
    """Value of the parameter with that number, or why there is none."""
    reader = _READ.get(number)
    return _unknown(number) if reader is None else reader(axis)


def read_bool_parameter(axis: Axis, number: int) -> bool | Refusal:
    """Value of a parameter that is TRUE or FALSE, or why there is none."""
    reader = _READ_BOOL.get(number)
    return _unknown(number) if reader is None else reader(axis)


def write_parameter(axis: Axis, number: int, value: float) -> Refusal | None:
    """Set a limit of later motions; None, or the reason of a refusal. Only at standstill."""
    ramps, lowered = axis.settings.ramps, axis.virtual.ramps
    match number:
        case Parameter.MAX_VELOCITY_APPL:
            refused = check_speed(value, axis.settings.speed.setting_max_rad_s)
        case Parameter.MAX_ACCELERATION_APPL:
            refused = check_ramp(Words.NAME_ACCELERATION, value, ramps.acc_rad_s2)
            lowered = replace(lowered, acc_rad_s2=value)
        case Parameter.MAX_DECELERATION_APPL:
            refused = check_ramp(Words.NAME_DECELERATION, value, ramps.dec_rad_s2)
            lowered = replace(lowered, dec_rad_s2=value)
        case Parameter.MAX_JERK_APPL:
            refused = check_jerk(value, ramps.jerk_rad_s3)
            lowered = replace(lowered, jerk_rad_s3=value)
        case _ if number in _READ or number in _READ_BOOL:
            refused = refusal(Code.CTL_14, reason=Words.PARAMETER_READ_ONLY(number=number))
        case _:
            refused = _unknown(number)
    if refused is None and not axis.at_rest:
        refused = refusal(Code.CTL_14, reason=Words.PARAMETER_AT_REST)
    if refused is not None:
        return refused
    if number == Parameter.MAX_VELOCITY_APPL:
        axis.motion.speed_max_rad_s = value
    axis.virtual.ramps = lowered
    return None


def _unknown(number: int) -> Refusal:
    return refusal(Code.CTL_14, reason=Words.NO_PARAMETER(number=number))
