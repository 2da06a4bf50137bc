"""The rigid job in pure Python, twice: as a program is written, one function a law, and as one hand-inlined loop."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

DEG: Final = math.pi / 180.0
RATIO: Final = 1144.0
INERTIA: Final = 2.18e6 / (RATIO * RATIO) + 0.362
ECCENTRIC_NM: Final = -15990.3
KPP, KVF, KVP, TVI, LIMIT = 10.0, 1.0, 77.6959, 0.01, 385.0
CYCLE_S, SCAN_S = 125e-6, 1e-3
ACC, TARGET = 450.0 / RATIO * DEG, 90.0 * DEG
HALF_S: Final = math.sqrt(TARGET / ACC)


@dataclass(slots=True)
class Drive:
    """State of the speed loop."""

    integral: float = 0.0
    last: float = 0.0


@dataclass(slots=True)
class Plant:
    """State of the motor."""

    pos: float = 0.0
    vel: float = 0.0


def set_point(t: float) -> tuple[float, float]:
    """Trapezoid from 0 to 90 deg: position and speed."""
    if t < HALF_S:
        return 0.5 * ACC * t * t, ACC * t
    if t < 2.0 * HALF_S:
        left = 2.0 * HALF_S - t
        return TARGET - 0.5 * ACC * left * left, ACC * left
    return TARGET, 0.0


def position_law(pos_ref: float, vel_ref: float, pos: float) -> float:
    """Eq. (4)."""
    return KPP * (RATIO * pos_ref - pos) + KVF * RATIO * vel_ref


def speed_loop(drive: Drive, command: float, pos: float) -> float:
    """PI with clamping anti-windup; speed from the difference of positions."""
    error = command - (pos - drive.last) / CYCLE_S
    drive.last = pos
    wanted = KVP * (error + drive.integral)
    torque = min(max(wanted, -LIMIT), LIMIT)
    if torque == wanted or (wanted - torque) * error < 0.0:
        drive.integral += error * CYCLE_S / TVI
    return torque


def advance(plant: Plant, torque: float) -> None:
    """Semi-implicit Euler, as in the other two loops."""
    load = ECCENTRIC_NM * math.sin(plant.pos / RATIO) / RATIO
    plant.vel += CYCLE_S * (torque + load) / INERTIA
    plant.pos += CYCLE_S * plant.vel


def rigid_job(seconds: int) -> float:
    """Run the move 0 to 90 deg for `seconds` of axis time; returns the motor angle at the end, rad."""
    drive, plant = Drive(), Plant()
    for k in range(1000 * seconds):
        pos_ref, vel_ref = set_point(k * SCAN_S)
        command = position_law(pos_ref, vel_ref, plant.pos)
        for _ in range(8):
            advance(plant, speed_loop(drive, command, plant.pos))
    return plant.pos


def rigid_job_inlined(seconds: int) -> float:
    """The same, line for line the loop of rigid_loop.c: the fastest that the interpreter can do."""
    i, js, tu = RATIO, INERTIA, ECCENTRIC_NM
    kpp, kvf, kvp, tvi, limit = KPP, KVF, KVP, TVI, LIMIT
    ts, tp, a, target, half = CYCLE_S, SCAN_S, ACC, TARGET, HALF_S
    sin = math.sin
    thm = wm = integral = last = 0.0
    for k in range(1000 * seconds):
        t = k * tp
        if t < half:
            r, v = 0.5 * a * t * t, a * t
        elif t < 2.0 * half:
            left = 2.0 * half - t
            r, v = target - 0.5 * a * left * left, a * left
        else:
            r, v = target, 0.0
        command = kpp * (i * r - thm) + kvf * i * v
        for _ in range(8):
            measured = (thm - last) / ts
            last = thm
            e = command - measured
            un = kvp * (e + integral)
            u = min(max(un, -limit), limit)
            if u == un or (un - u) * e < 0.0:
                integral += e * ts / tvi
            wm += ts * (u + tu * sin(thm / i) / i) / js
            thm += ts * wm
    return thm
