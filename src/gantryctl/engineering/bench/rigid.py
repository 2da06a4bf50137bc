"""The rigid job: the paper's loop on one inertia, small enough that any tool for dynamics can do it.

One inertia with an eccentric moment, ideal encoder, no friction; P position loop with velocity feed-forward at 1 ms, PI
speed loop with clamping anti-windup at 125 us, its torque held over a cycle; trapezoid from 0 to 90 deg, 60 s. Angles
and speeds without another word are those of the motor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from gantryctl.units import deg, rad

RATIO: Final = 1144.0
INERTIA_KG_M2: Final = 2.18e6 / (RATIO * RATIO) + 0.362
ECCENTRIC_NM: Final = -15990.3
KPP, KVF, KVP, TVI, LIMIT_NM = 10.0, 1.0, 77.6959, 0.01, 385.0
CYCLE_S, SCAN_S = 125e-6, 1e-3
CYCLES: Final = 8
ACC, TARGET = rad(450.0 / RATIO), rad(90.0)
HALF_S: Final = math.sqrt(TARGET / ACC)
SECONDS: Final = 60
"""The whole job, axis seconds."""
TOLERANCE_DEG: Final = 1e-6
"""Largest deviation from the reference that counts as the same job, at the gantry.

Semi-implicit Euler with a step of one drive cycle, which most of the programs use, is within 2e-10 deg; single
precision, and a position law that acts one scan late, are not within this limit.
"""


class Timed(NamedTuple):
    """What one run of a job gives: motor angle at every whole axis second, rad, and the processor time, s."""

    angles: Sequence[float]
    spent_s: float


Run = Callable[[], Timed]


def set_point(t: float) -> tuple[float, float]:
    """Trapezoid from 0 to 90 deg: position and speed at the gantry, rad, rad/s."""
    if t < HALF_S:
        return 0.5 * ACC * t * t, ACC * t
    if t < 2.0 * HALF_S:
        left = 2.0 * HALF_S - t
        return TARGET - 0.5 * ACC * left * left, ACC * left
    return TARGET, 0.0


def set_points(seconds: int) -> list[tuple[float, float]]:
    """Position and speed at the gantry for every scan; for tools that take inputs as tables."""
    return [set_point(k * SCAN_S) for k in range(round(seconds / SCAN_S))]


def position_law(pos_ref: float, vel_ref: float, pos: float) -> float:
    """Eq. (4): speed command, rad/s."""
    return KPP * (RATIO * pos_ref - pos) + KVF * RATIO * vel_ref


def speed_loop(command: float, pos: float, last: float, integral: float) -> tuple[float, float]:
    """PI speed loop with clamping anti-windup: torque, N m, and the new integral."""
    error = command - (pos - last) / CYCLE_S
    wanted = KVP * (error + integral)
    torque = min(max(wanted, -LIMIT_NM), LIMIT_NM)
    if torque == wanted or (wanted - torque) * error < 0.0:
        integral += error * CYCLE_S / TVI
    return torque, integral


def acceleration(pos: float, torque_nm: float) -> float:
    """Of the motor, rad/s2."""
    return (torque_nm + ECCENTRIC_NM * math.sin(pos / RATIO) / RATIO) / INERTIA_KG_M2


def reference(seconds: int, sub_steps: int = 1) -> list[float]:
    """The same loop with the plant integrated by Runge-Kutta of 4th order: motor angle at every whole second, rad.

    A step of a drive cycle is 1e-4 of the plant's own time; halving it changes the angle by less than 1e-11 rad.
    """
    pos = vel = last = integral = 0.0
    h = CYCLE_S / sub_steps
    angles = []
    for k in range(round(seconds / SCAN_S)):
        pos_ref, vel_ref = set_point(k * SCAN_S)
        command = position_law(pos_ref, vel_ref, pos)
        for _ in range(CYCLES):
            torque, integral = speed_loop(command, pos, last, integral)
            last = pos
            for _ in range(sub_steps):
                a1 = acceleration(pos, torque)
                a2 = acceleration(pos + 0.5 * h * vel, torque)
                a3 = acceleration(pos + 0.5 * h * vel + 0.25 * h * h * a1, torque)
                a4 = acceleration(pos + h * vel + 0.5 * h * h * a2, torque)
                pos += h * vel + h * h * (a1 + a2 + a3) / 6.0
                vel += h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
        if (k + 1) % round(1.0 / SCAN_S) == 0:
            angles.append(pos)
    return angles


def deviation_deg(angles: Sequence[float], expected: Sequence[float]) -> float:
    """Largest deviation at the gantry over the seconds that were run; NaN where an angle is no number."""
    apart = [abs(a - b) for a, b in zip(angles, expected, strict=False)]
    return deg(math.nan if any(map(math.isnan, apart)) else max(apart)) / RATIO


def same_job(angles: Sequence[float], expected: Sequence[float], seconds: int) -> bool:
    """Whether these are the angles of this job, within `TOLERANCE_DEG`."""
    return len(angles) == seconds and deviation_deg(angles, expected) <= TOLERANCE_DEG
