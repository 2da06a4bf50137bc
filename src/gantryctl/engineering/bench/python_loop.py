"""The rigid job in pure Python, twice: as a program is written, one function a law, and as one hand-inlined loop."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gantryctl.engineering.bench.rigid import (
    ACC,
    CYCLE_S,
    CYCLES,
    ECCENTRIC_NM,
    HALF_S,
    INERTIA_KG_M2,
    KPP,
    KVF,
    KVP,
    LIMIT_NM,
    RATIO,
    SCAN_S,
    TARGET,
    TVI,
    position_law,
    set_point,
    speed_loop,
)


@dataclass(slots=True)
class Drive:
    """State of the speed loop."""

    integral: float = 0.0
    last: float = 0.0

    def torque(self, command: float, pos: float) -> float:
        """One drive cycle."""
        torque, self.integral = speed_loop(command, pos, self.last, self.integral)
        self.last = pos
        return torque


@dataclass(slots=True)
class Plant:
    """State of the motor."""

    pos: float = 0.0
    vel: float = 0.0


def advance(plant: Plant, torque: float) -> None:
    """Semi-implicit Euler, as in C."""
    load = ECCENTRIC_NM * math.sin(plant.pos / RATIO) / RATIO
    plant.vel += CYCLE_S * (torque + load) / INERTIA_KG_M2
    plant.pos += CYCLE_S * plant.vel


def rigid_job(seconds: int) -> list[float]:
    """Motor angle at every whole second, rad."""
    drive, plant = Drive(), Plant()
    angles = []
    for k in range(1000 * seconds):
        pos_ref, vel_ref = set_point(k * SCAN_S)
        command = position_law(pos_ref, vel_ref, plant.pos)
        for _ in range(CYCLES):
            advance(plant, drive.torque(command, plant.pos))
        if k % 1000 == 999:
            angles.append(plant.pos)
    return angles


def rigid_job_inlined(seconds: int) -> list[float]:
    """The same, line for line the loop of rigid_loop.c: the fastest that the interpreter can do."""
    i, js, tu = RATIO, INERTIA_KG_M2, ECCENTRIC_NM
    kpp, kvf, kvp, tvi, limit = KPP, KVF, KVP, TVI, LIMIT_NM
    ts, tp, a, target, half = CYCLE_S, SCAN_S, ACC, TARGET, HALF_S
    sin = math.sin
    thm = wm = integral = last = 0.0
    angles = []
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
        if k % 1000 == 999:
            angles.append(thm)
    return angles
