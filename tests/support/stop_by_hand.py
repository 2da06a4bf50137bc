"""The quick stop a second time, by hand: two inertias and a base on linear springs, and dry friction.

Only the tests use it. Classical Runge-Kutta over the drive's cycle, the PI speed loop, the stop's ramp; no gear error,
backlash, hysteresis, ripple, pre-sliding, current loop or encoder.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gantryctl.machine import Machine

State = np.ndarray
# A swing of 2 Hz after the motor rests: friction no longer helps it then.
AFTER_S = 0.5
# Where dry friction turns round: 0.05 deg/s at the gantry, the motor's rest, and a tenth of it at the load.
MOTOR_SLOW_RAD_S, LOAD_SLOW_RAD_S = 1.0, 1e-4


class StopByHand(NamedTuple):
    """Largest torque asked of the motor, N m; largest at the reducer's output, N m; way of the motor, deg."""

    torque_motor_nm: float
    torque_reducer_nm: float
    angle_deg: float


def quick_stop_by_hand(
    machine: Machine,
    speed_deg_s: float,
    dec_deg_s2: float,
    moment_nm: float,
    torque_constant_ratio: float = 1.0,
) -> StopByHand:
    """Stop from a steady speed under a constant moment on the load that drives it on."""
    plant, ratio = machine.plant, machine.axis.ratio
    load, rotor = (
        plant.load.inertia_kg_m2,
        machine.motor.inertia_kg_m2 + plant.motor.wave_generator_inertia_kg_m2,
    )
    gears = plant.transmission
    slopes = [
        1.0 / (1.0 / (machine.axis.ring_ratio**2 * own) + 1.0 / gears.rest_stiffness_nm_per_rad)
        for own in (
            gears.reducer_stiffness_1_nm_per_rad,
            gears.reducer_stiffness_2_nm_per_rad,
            gears.reducer_stiffness_3_nm_per_rad,
        )
    ]
    knees = [machine.axis.ring_ratio * t for t in (gears.reducer_torque_1_nm, gears.reducer_torque_2_nm)]
    ends = [knees[0] / slopes[0], knees[0] / slopes[0] + (knees[1] - knees[0]) / slopes[1]]
    damping = 2.0 * gears.damping_ratio * math.sqrt(slopes[0] * load)
    base = plant.base.inertia_kg_m2
    omega = 2.0 * math.pi * plant.base.frequency_hz
    base_k, base_c = base * omega**2, 2.0 * plant.base.damping_ratio * omega * base
    rollers, motor = plant.roller_friction, plant.motor_friction
    v, a = math.radians(speed_deg_s), math.radians(dec_deg_s2)
    kvp, tvi, limit = machine.drive.speed_loop.kvp_nm_s_per_rad, 0.010, machine.motor.torque_max_nm
    step = machine.drive.speed_loop.cycle_us * 1e-6

    def friction(mesh_nm: float, speed: float) -> float:
        dry = motor.coulomb_nm + motor.load_ratio * abs(mesh_nm) / ratio
        return dry * math.tanh(speed / MOTOR_SLOW_RAD_S) + motor.viscous_nm_s_per_rad * speed

    def spring(twist: float) -> float:
        size = abs(twist)
        return (
            math.copysign(float(np.interp(size, [0.0, *ends], [0.0, *knees])), twist)
            if size <= ends[1]
            else (math.copysign(knees[1] + slopes[2] * (size - ends[1]), twist))
        )

    def mesh(x: State) -> float:
        return spring(x[0] / ratio - x[2] + x[4]) + damping * float(x[1] / ratio - x[3] + x[5])

    def slope(x: State, torque_nm: float) -> State:
        t = mesh(x)
        rolling = x[3] - x[5]
        drag = (
            rollers.coulomb_nm * math.tanh(rolling / LOAD_SLOW_RAD_S) + rollers.viscous_nm_s_per_rad * rolling
        )
        return np.array([
            x[1], (torque_nm - friction(t, x[1]) - t / ratio) / rotor,
            x[3], (t - drag + moment_nm) / load,
            x[5], (drag - t - base_k * x[4] - base_c * x[5]) / base,
        ])  # fmt: skip

    # Steady motion: the gears hold the moment against the drag of the rollers.
    held = rollers.coulomb_nm + rollers.viscous_nm_s_per_rad * v - moment_nm
    phi = moment_nm / base_k
    twist = math.copysign(float(np.interp(abs(held), [0.0, *knees], [0.0, *ends])), held)
    x = np.array([ratio * (twist - phi), v * ratio, 0.0, v, phi, 0.0])
    given = friction(held, v * ratio) + held / ratio
    integral, ramp, begin = given / (kvp * torque_constant_ratio), v * ratio, x[0]
    largest = reducer = 0.0
    angle = 0.0
    for _ in range(round((speed_deg_s / dec_deg_s2 + AFTER_S) / step)):
        ramp = max(0.0, ramp - a * ratio * step)
        error = ramp - x[1]
        wanted = kvp * (error + integral)
        asked = min(max(wanted, -limit), limit)
        integral += error * step / tvi
        largest, reducer = max(largest, abs(wanted)), max(reducer, abs(mesh(x)))
        k1 = slope(x, given)
        k2 = slope(x + 0.5 * step * k1, given)
        k3 = slope(x + 0.5 * step * k2, given)
        k4 = slope(x + step * k3, given)
        x = x + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        given = torque_constant_ratio * asked
        angle = max(angle, math.degrees(float(x[0] - begin)) / ratio)
    return StopByHand(float(largest), reducer / machine.axis.ring_ratio, angle)
