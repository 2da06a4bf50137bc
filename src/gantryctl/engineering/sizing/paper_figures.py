"""The figures of the paper's sizing under fixed names: what a reader checks by hand, and a test by name."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.engineering.analysis.models.profiles import shortest_trapezoid_reaching, trapezoid_time_s
from gantryctl.engineering.sizing import equations as eq
from gantryctl.engineering.sizing.motors import MotorFile
from gantryctl.engineering.sizing.sheet import Sheet
from gantryctl.machine.tables.drive import SpeedLoopTable
from gantryctl.units import DEG_S_PER_R_MIN

# With the paper's profile 5 deg take 7.13 s, 90 deg 30.25 s, 360 deg 75.25 s.
MOVES_DEG: Final = (5, 10, 15, 20, 90, 180, 360)


def printed_acceleration_rad_s2(sheet: Sheet) -> float:
    """The sizing acceleration with the three digits that the paper prints: 0.105 rad/s2."""
    return round(eq.mean_acceleration_rad_s2(sheet.motion.speed_max_r_min, sheet.motion.sizing_time_s), 3)


def printed_torque_nm(sheet: Sheet) -> float:
    """Eq. (2) as printed: the rounded acceleration, the result in whole N m: 200."""
    acc = printed_acceleration_rad_s2(sheet)
    return round(eq.motor_torque_nm(sheet.load.inertia_kg_m2, acc, sheet.gears.ratio))


def paper_figures(sheet: Sheet, motor: MotorFile, loop: SpeedLoopTable) -> dict[str, float]:
    """Every figure of the paper's sizing for one motor.

    Args:
        sheet: requirements. motor: name plate and encoder. loop: cycle and gain of the drive's speed loop.
    """
    inertia, ratio, rotor = sheet.load.inertia_kg_m2, sheet.gears.ratio, motor.motor.inertia_kg_m2
    acc = eq.mean_acceleration_rad_s2(sheet.motion.speed_max_r_min, sheet.motion.sizing_time_s)
    n1 = eq.motor_speed_r_min(sheet.motion.speed_max_r_min, ratio)
    plate = motor.motor
    return {
        "i": eq.total_ratio(sheet.gears.reducer_ratio, sheet.gears.ring_ratio),
        "n1_rpm": n1,
        "alpha2_rad_s2_exact": acc,
        "T1_Nm_paper_rounding": eq.motor_torque_nm(inertia, printed_acceleration_rad_s2(sheet), ratio),
        "T1_Nm_exact": eq.motor_torque_nm(inertia, acc, ratio),
        "T1_with_motor_inertia_Nm": eq.complete_motor_torque_nm(inertia, acc, ratio, rotor),
        "P_kW": eq.power_kw(printed_torque_nm(sheet), n1),
        "P_rated_check_kW": eq.power_kw(plate.torque_rated_nm, plate.speed_rated_r_min),
        "U_line_V_implied": eq.implied_line_voltage_v(
            1e3 * plate.power_rated_kw, plate.current_rated_a, plate.power_factor, plate.efficiency
        ),
        "enc_step_gantry_deg": eq.encoder_step_deg(motor.encoder.counts_per_turn, ratio),
        "enc_range_gantry_rev": eq.encoder_range_turns(motor.encoder.turns, ratio),
        "J_over_i2": eq.reflected_inertia_kg_m2(inertia, ratio),
        "Js": eq.shaft_inertia_kg_m2(inertia, ratio, rotor),
        "inertia_ratio_load_to_motor": eq.inertia_ratio(inertia, ratio, rotor),
        **_normal_move(sheet, rotor, acc),
        **_encoder_noise(motor, loop),
    }


def _normal_move(sheet: Sheet, rotor_kg_m2: float, sizing_acc_rad_s2: float) -> dict[str, float]:
    """The tuned acceleration beside the sizing case."""
    ratio, acc = sheet.gears.ratio, sheet.motion.acc_deg_s2
    speed = sheet.motion.speed_max_r_min * DEG_S_PER_R_MIN
    at_motor = acc * ratio
    shaft = eq.shaft_inertia_kg_m2(sheet.load.inertia_kg_m2, ratio, rotor_kg_m2)
    shortest = shortest_trapezoid_reaching(speed, acc)
    return {
        "acc_gantry_deg_s2": eq.gantry_acceleration_deg_s2(at_motor, ratio),
        "ratio_sizing_to_tuned_acc": eq.sizing_to_tuned_acceleration(sizing_acc_rad_s2, at_motor, ratio),
        "T_acc_tuned_Nm": eq.acceleration_torque_nm(shaft, at_motor),
        f"t_acc_to_{speed:g}deg_s": speed / acc,
        "angle_used_by_acc_deg": shortest / 2.0,
        f"min_move_reaching_{speed:g}deg_s_deg": shortest,
        **{f"t_trap_{way}deg_s": trapezoid_time_s(way, speed, acc) for way in MOVES_DEG},
    }


def _encoder_noise(motor: MotorFile, loop: SpeedLoopTable) -> dict[str, float]:
    """One step of the encoder in one drive cycle, as speed and as torque through the speed loop's gain."""
    counts, fine = motor.encoder.counts_per_turn, motor.encoder.lines * motor.encoder.interpolation
    cycle, kvp = loop.cycle_us * 1e-6, loop.kvp_nm_s_per_rad
    # The name carries the resolution: 2^22 for 2048 x 2048.
    power = math.log2(fine)
    name = f"2^{power:g}" if power.is_integer() else f"{fine}"
    figures = {
        f"speed_LSB_{loop.cycle_us:g}us_rad_s_motor": eq.speed_step_rad_s(counts, cycle),
        f"torque_per_LSB_{counts}_{loop.cycle_us:g}us_Nm": eq.torque_step_nm(counts, cycle, kvp),
    }
    return figures | {f"torque_per_LSB_{name}_{loop.cycle_us:g}us_Nm": eq.torque_step_nm(fine, cycle, kvp)}
