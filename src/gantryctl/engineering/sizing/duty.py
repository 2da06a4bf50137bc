"""One day of work: thermal load of the motor, and energy that comes back while braking."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gantryctl.engineering.analysis.models.profiles import trapezoid_peak_speed, trapezoid_time_s
from gantryctl.engineering.sizing.sheet import Sheet
from gantryctl.engineering.sizing.train import Train
from gantryctl.units import DEG_S_PER_R_MIN, rad

Floats = NDArray[np.float64]
# A sum over 2001 points of a part: the torque is smooth inside each, and the corners are points.
_SAMPLES = 2001


class Duty(NamedTuple):
    """What a day of work asks of a motor.

    Attributes:
        cycle_s: one cycle, moves and stops. moving_s: of it, moving.
        cycle_rms_nm: root mean square torque over a cycle, the servo holding at the stops.
        day_rms_nm: over the day, torque off between the cycles.
        largest_nm: largest torque of the moves.
        returned_j: mechanical energy that comes back to the motor in one cycle.
        returned_mean_w: mean of it over the day.
    """

    cycle_s: float
    moving_s: float
    cycle_rms_nm: float
    day_rms_nm: float
    largest_nm: float
    returned_j: float
    returned_mean_w: float


def legs_deg(sheet: Sheet) -> list[tuple[float, float]]:
    """The moves of one cycle: from the last stop to the first, and on; stops at the same angle are no move."""
    stops = sheet.duty.stops_deg
    # A day is a chain of cycles: each begins where the one before has ended.
    return [(a, b) for a, b in zip((stops[-1], *stops[:-1]), stops, strict=True) if a != b]


def cycle_time_s(sheet: Sheet) -> float:
    """One cycle with trapezoids at the highest speed and the acceleration of normal moves."""
    speed, acc = sheet.motion.speed_max_r_min * DEG_S_PER_R_MIN, sheet.motion.acc_deg_s2
    moving = sum(trapezoid_time_s(b - a, speed, acc) for a, b in legs_deg(sheet))
    return moving + sheet.duty.hold_s * len(sheet.duty.stops_deg)


def duty(train: Train) -> Duty:
    """Evaluate the day of the sheet."""
    sheet = train.sheet
    moving, squared, returned, largest = 0.0, 0.0, 0.0, 0.0
    for start, end in legs_deg(sheet):
        time, torque, power = _move(train, start, end)
        moving += float(time[-1])
        squared += float(np.trapezoid(torque**2, time))
        returned += float(np.trapezoid(np.maximum(-power, 0.0), time))
        largest = max(largest, float(np.max(np.abs(torque))))
    for stop in sheet.duty.stops_deg:
        squared += sheet.duty.hold_s * (float(train.against_nm(rad(stop))) / train.ratio) ** 2
    cycle, day = moving + sheet.duty.hold_s * len(sheet.duty.stops_deg), 3600.0 * sheet.duty.hours
    n = sheet.duty.cycles
    return Duty(
        cycle,
        moving,
        math.sqrt(squared / cycle) if cycle else 0.0,
        math.sqrt(n * squared / day),
        largest,
        returned,
        n * returned / day,
    )


def _move(train: Train, start_deg: float, end_deg: float) -> tuple[Floats, Floats, Floats]:
    """Time, motor torque and mechanical power of one trapezoid."""
    way, acc, top = rad(abs(end_deg - start_deg)), train.normal_acc_rad_s2, train.speed_rad_s
    peak = trapezoid_peak_speed(way, top, acc)
    total, ramp = trapezoid_time_s(way, top, acc), peak / acc
    sign = math.copysign(1.0, end_deg - start_deg)
    # the corners belong to the grid, so that no step of the acceleration is smeared
    corners = (0.0, ramp, total - ramp, total)
    time = np.concatenate([np.linspace(begin, end, _SAMPLES) for begin, end in pairwise(corners)])
    a = np.repeat((acc, 0.0, -acc), _SAMPLES)
    vel = np.minimum(np.minimum(acc * time, peak), acc * (total - time))
    gone = np.concatenate(([0.0], np.cumsum(0.5 * (vel[1:] + vel[:-1]) * np.diff(time))))
    angle = rad(start_deg) + sign * gone
    torque = train.motor_nm(sign * a, sign * vel, train.against_nm(angle))
    return time, torque, torque * sign * vel * train.ratio
