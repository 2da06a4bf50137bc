"""The paper's sizing equations (1) to (3), printed and complete. Pure functions in SI; speeds in r/min where
named.

"Gantry" is the slow side of the transmission, "motor" the fast one; `ratio` is motor turns per gantry turn
(1144).
"""

from __future__ import annotations

import math

from gantryctl.units import deg, rad_s_from_r_min

# P [kW] = T [N m] n [r/min] / 9550, the rounded 30 000 / pi of the motor catalogues; the paper uses it.
POWER_CONSTANT = 9550.0


def total_ratio(reducer_ratio: float, ring_ratio: float) -> float:
    """Motor turns per gantry turn, 88 x 13."""
    return reducer_ratio * ring_ratio


def motor_speed_r_min(gantry_speed_r_min: float, ratio: float) -> float:
    """Eq. (1): n1 = i n2, r/min."""
    # 1144 r/min for 1 r/min: the rated 1150 leave 0.5 %.
    return gantry_speed_r_min * ratio


def mean_acceleration_rad_s2(gantry_speed_r_min: float, time_s: float) -> float:
    """Angular acceleration at the gantry from standstill to a speed in this time, rad/s2 (paper: 0.105,
    rounded).
    """
    # The paper goes on with 0.105; exactly it is 0.10472.
    return rad_s_from_r_min(gantry_speed_r_min) / time_s


def motor_torque_nm(inertia_kg_m2: float, acceleration_rad_s2: float, ratio: float) -> float:
    """Eq. (2): T1 = J alpha2 / i, N m. Load inertia only, as printed: no rotor, friction, unbalance,
    efficiency.
    """
    # 200.09 N m with the rounded acceleration, 199.55 exactly. The rotor alone would add 27.8 N m.
    return inertia_kg_m2 * acceleration_rad_s2 / ratio


def complete_motor_torque_nm(
    inertia_kg_m2: float,
    acceleration_rad_s2: float,
    ratio: float,
    motor_inertia_kg_m2: float,
    load_torque_nm: float = 0.0,
    friction_torque_nm: float = 0.0,
    gear_efficiency: float = 1.0,
) -> float:
    """Eq. (2) with what it leaves out: motor torque, N m.

    Args:
        inertia_kg_m2: load, at the gantry.
        acceleration_rad_s2: at the gantry.
        ratio: motor turns per gantry turn.
        motor_inertia_kg_m2: rotor and everything on its shaft.
        load_torque_nm: eccentric moment and roller friction at the gantry.
        friction_torque_nm: friction of motor and reducer input, motor side.
        gear_efficiency: of the whole transmission, for driving torque.
    """
    load = (inertia_kg_m2 * acceleration_rad_s2 + load_torque_nm) / (ratio * gear_efficiency)
    return load + motor_inertia_kg_m2 * acceleration_rad_s2 * ratio + friction_torque_nm


def power_kw(torque_nm: float, speed_r_min: float) -> float:
    """Eq. (3): P = T n / 9550, kW."""
    # 23.96 kW for 200 N m at 1144 r/min.
    return torque_nm * speed_r_min / POWER_CONSTANT


def implied_line_voltage_v(power_w: float, current_a: float, power_factor: float, efficiency: float) -> float:
    """Line-to-line voltage that a motor's rating plate implies, V: P / (sqrt(3) I cos(phi) eta)."""
    # 316 V for the paper's motor.
    return power_w / (math.sqrt(3.0) * current_a * power_factor * efficiency)


def encoder_step_deg(counts_per_turn: int, ratio: float) -> float:
    """One count of the motor encoder, at the gantry, deg."""
    # 3.841e-5 deg for 8192 steps; the paper prints 3.8e-5.
    return 360.0 / (counts_per_turn * ratio)


def encoder_range_turns(turns: int, ratio: float) -> float:
    """Multiturn range of the motor encoder in gantry turns."""
    # 3.580 gantry turns for 4096; the paper prints about 3.6.
    return turns / ratio


def reflected_inertia_kg_m2(inertia_kg_m2: float, ratio: float) -> float:
    """A gantry inertia seen at the motor shaft, J / i2, kg m2."""
    return inertia_kg_m2 / ratio**2


def shaft_inertia_kg_m2(inertia_kg_m2: float, ratio: float, motor_inertia_kg_m2: float) -> float:
    """Js of eq. (5): load and rotor at the motor shaft, kg m2 (the wave generator is left out)."""
    # 1.66573 + 0.232 = 1.89773 kg m2; the paper does not print it.
    return reflected_inertia_kg_m2(inertia_kg_m2, ratio) + motor_inertia_kg_m2


def inertia_ratio(inertia_kg_m2: float, ratio: float, motor_inertia_kg_m2: float) -> float:
    """Load to rotor inertia, both at the motor shaft."""
    # 7.18 for the paper's machine.
    return reflected_inertia_kg_m2(inertia_kg_m2, ratio) / motor_inertia_kg_m2


def gantry_acceleration_deg_s2(motor_acceleration_deg_s2: float, ratio: float) -> float:
    """The tuned maximum acceleration at the motor shaft, brought to the gantry, deg/s2."""
    # 450 deg/s2 at the motor are 0.39336 deg/s2.
    return motor_acceleration_deg_s2 / ratio


def acceleration_torque_nm(shaft_inertia_kg_m2: float, motor_acceleration_deg_s2: float) -> float:
    """Js alpha1: torque of the tuned acceleration at the motor shaft, N m."""
    # 14.9 N m, 6 % of the rated torque.
    return shaft_inertia_kg_m2 * math.radians(motor_acceleration_deg_s2)


def sizing_to_tuned_acceleration(
    sizing_acceleration_rad_s2: float, motor_acceleration_deg_s2: float, ratio: float
) -> float:
    """How many times the acceleration of the sizing case exceeds the tuned one."""
    # 15.25: the motor is sized for a move that the tuned machine never makes.
    return deg(sizing_acceleration_rad_s2) / gantry_acceleration_deg_s2(motor_acceleration_deg_s2, ratio)


def speed_step_rad_s(counts_per_turn: int, cycle_s: float) -> float:
    """One encoder count differentiated over one drive cycle, motor side, rad/s."""
    # 6.1 rad/s for 8192 steps and 125 us.
    return 2.0 * math.pi / counts_per_turn / cycle_s


def torque_step_nm(counts_per_turn: int, cycle_s: float, kvp_nm_s_per_rad: float) -> float:
    """Torque command that one encoder count makes through the speed loop's gain, N m."""
    # 477 N m for 8192 steps, 0.93 N m for 2048 x 2048.
    return kvp_nm_s_per_rad * speed_step_rad_s(counts_per_turn, cycle_s)
