"""Figures that follow from a machine file with a rigid body and the name plates: what people check by hand.

Stops on the full plant, with compliance and brake, are `gantryctl stops`.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

from gantryctl.machine.tables.model import Machine
from gantryctl.units import DEG_S_PER_R_MIN, deg, rad, rad_s_from_r_min


class Derived(NamedTuple):
    """Derived figure."""

    name: str
    value: float
    unit: str
    formula: str


Rows: TypeAlias = "list[tuple[str, float, str, str]]"


def derived(machine: Machine) -> list[Derived]:
    """All derived figures, grouped: gear and inertia, encoder, set-point, stops, torque."""
    groups = (_gear, _encoder, _set_point, _stops, _torque)
    return [Derived(*row) for group in groups for row in group(machine)]


def _gear(m: Machine) -> Rows:
    ratio = m.axis.ratio
    reflected = m.plant.load.inertia_kg_m2 / ratio**2
    rotor = m.motor.inertia_kg_m2
    generator = m.plant.motor.wave_generator_inertia_kg_m2
    power_w = m.motor.torque_rated_nm * rad_s_from_r_min(m.motor.speed_rated_r_min)
    return [
        ("ratio", ratio, "-", "reducer x ring: motor turns per turn of the axis"),
        ("motor_speed_at_1_r_min", ratio, "r/min", "ratio x 1 r/min"),
        (
            "motor_speed_at_setting_max",
            m.speed.setting_max_deg_s / DEG_S_PER_R_MIN * ratio,
            "r/min",
            f"at highest setting; rated {m.motor.speed_rated_r_min:g}, highest {m.motor.speed_max_r_min:g}",
        ),
        ("inertia_load_at_motor", reflected, "kg m2", "J_load / ratio^2"),
        (
            "js_load_and_rotor",
            reflected + rotor,
            "kg m2",
            "J_load / ratio^2 + rotor; without wave generator",
        ),
        ("js_with_wave_generator", reflected + rotor + generator, "kg m2", "the same + wave generator"),
        ("inertia_ratio", reflected / rotor, "-", "load at the motor / rotor"),
        ("power_rated_check", power_w / 1000.0, "kW", "rated torque x rated speed"),
    ]


def _encoder(m: Machine) -> Rows:
    e = m.encoder
    turn_deg = 360.0 / m.axis.ratio
    fine = e.lines * e.interpolation
    below = m.plant.encoder.mounting_turns * turn_deg + m.axis.pos_min_deg
    above = (e.turns - m.plant.encoder.mounting_turns) * turn_deg - m.axis.pos_max_deg
    centred = (e.turns * turn_deg - (m.axis.pos_max_deg - m.axis.pos_min_deg)) / 2.0
    # The encoder of a modulo axis may wrap anywhere.
    margins = [
        ("wrap_margin_centred", centred, "deg", "(range - travel) / 2: each side, if centred"),
        ("wrap_margin_below", below, "deg", "lower wrap to travel, as the simulated encoder is mounted"),
        ("wrap_margin_above", above, "deg", "travel to upper wrap, as the simulated encoder is mounted"),
    ]
    return [
        ("counts_per_degree", e.counts_per_turn / turn_deg, "1/deg", "absolute steps per degree of the axis"),
        ("fine_counts_per_degree", fine / turn_deg, "1/deg", "lines x interpolation per degree of the axis"),
        ("encoder_step", turn_deg / e.counts_per_turn, "deg", "one absolute step, at the load"),
        ("fine_encoder_step", turn_deg / fine, "deg", "one interpolated step, at the load"),
        ("encoder_range", e.turns / m.axis.ratio, "turns", "turns of the axis told apart"),
        *([] if m.axis.modulo else margins),
    ]


def _set_point(m: Machine) -> Rows:
    v, a, d = m.speed.setting_max_deg_s, m.virtual_axis.acc_deg_s2, m.virtual_axis.dec_deg_s2
    band = m.monitors.following_error_base_deg + m.monitors.following_error_per_speed_s * v
    return [
        ("acc_motor", a * m.axis.ratio, "deg/s2", "acceleration x ratio: at the motor"),
        ("time_to_setting_max", v / a, "s", "v / a, constant acceleration"),
        ("angle_to_setting_max", v**2 / (2.0 * a), "deg", "v^2 / 2a, constant acceleration"),
        (
            "shortest_move_to_setting_max",
            v**2 / (2.0 * a) + v**2 / (2.0 * d),
            "deg",
            "v^2 / 2a + v^2 / 2d: a shorter move never reaches the highest setting",
        ),
        ("following_error_band_at_setting_max", band, "deg", "base + per_speed x highest setting"),
    ]


def _stops(m: Machine) -> Rows:
    """Angle and time of a rigid stop: no reaction time, no compliance, jerk only where the class has one."""
    found: Rows = []
    v = m.virtual_axis
    normal_jerk = v.jerk_deg_s3 if v.profile == "jerk_limited" else float("inf")
    classes = {
        "normal": (v.dec_deg_s2, normal_jerk),
        "jog_release": (v.jog_release_dec_deg_s2, v.jog_release_jerk_deg_s3),
        "quick": (v.quick_dec_deg_s2, float("inf")),
    }
    speeds = {
        "creep": m.speed.creep_deg_s,
        "setting_min": m.speed.setting_min_deg_s,
        "half_setting_max": m.speed.setting_max_deg_s / 2.0,
        "setting_max": m.speed.setting_max_deg_s,
    }
    for stop, (dec, jerk) in classes.items():
        for label, speed in speeds.items():
            angle, time = rigid_stop(speed, dec, jerk)
            how = f"{dec:.4g} deg/s2" + ("" if jerk == float("inf") else f", {jerk:.4g} deg/s3")
            formula = f"from {speed:g} deg/s with {how}: {time:.4g} s; rigid, without reaction"
            found.append((f"stop_{stop}_from_{label}", angle, "deg", formula))
    return found


def rigid_stop(speed_deg_s: float, dec_deg_s2: float, jerk_deg_s3: float) -> tuple[float, float]:
    """Angle in deg and time in s to rest from a steady speed; jerk may be infinite.

    The speed falls symmetrically, so the mean speed is half the start speed. With jerk the deceleration rises
    for t_j = dec / jerk and falls as long; a speed below dec^2 / jerk never reaches the full deceleration.
    """
    if speed_deg_s * jerk_deg_s3 >= dec_deg_s2**2:
        time = speed_deg_s / dec_deg_s2 + dec_deg_s2 / jerk_deg_s3
    else:
        time = 2.0 * (speed_deg_s / jerk_deg_s3) ** 0.5
    return speed_deg_s * time / 2.0, time


def _torque(m: Machine) -> Rows:
    ratio = m.axis.ratio
    load = m.plant.load
    acc = rad(m.virtual_axis.acc_deg_s2)
    rotor = m.motor.inertia_kg_m2
    whole = load.inertia_kg_m2 / ratio + (rotor + m.plant.motor.wave_generator_inertia_kg_m2) * ratio
    without_rotor = load.inertia_kg_m2 / ratio * acc
    with_rotor = without_rotor + rotor * ratio * acc
    nominal = load.eccentric_moment_nm
    speed = rad(m.speed.setting_max_deg_s)
    roller, friction = m.plant.roller_friction, m.plant.motor_friction
    rollers = (roller.coulomb_nm + roller.viscous_nm_s_per_rad * speed) / ratio
    motor = friction.coulomb_nm + friction.viscous_nm_s_per_rad * speed * ratio
    quick = whole * rad(m.virtual_axis.quick_dec_deg_s2)
    check = load.eccentric_check_moment_nm / ratio
    need = whole * acc + nominal / ratio + rollers + motor
    return [
        ("torque_acc_without_rotor", without_rotor, "N m", "J_load a / ratio, load alone"),
        ("torque_acc_with_rotor", with_rotor, "N m", "(J_load / ratio^2 + rotor) a ratio"),
        ("torque_acc", whole * acc, "N m", "the same with the wave generator"),
        ("eccentric_moment", nominal, "N m", "mass x 9.81 x eccentricity, at the load"),
        ("torque_eccentric", nominal / ratio, "N m", "eccentric moment / ratio, nominal"),
        ("torque_eccentric_check", check, "N m", "eccentric moment of the check / ratio"),
        ("torque_rollers", rollers, "N m", "running friction of the rollers at the highest setting / ratio"),
        (
            "torque_motor_friction",
            motor,
            "N m",
            "friction of motor and reducer at the highest setting, unloaded",
        ),
        ("torque_needed_move", need, "N m", "acceleration + nominal eccentric moment + friction"),
        ("torque_rated", m.motor.torque_rated_nm, "N m", "available continuously"),
        ("torque_needed_quick", quick, "N m", "quick stop of the rigid machine"),
        (
            "torque_needed_quick_check",
            quick + check,
            "N m",
            "the same, the eccentric moment of the check driving",
        ),
        ("torque_max", m.motor.torque_max_nm, "N m", "available for the overload time"),
        ("torque_reserve_quick", m.motor.torque_max_nm / (quick + check), "-", "available / needed, rigid"),
        (
            "reducer_torque_quick",
            load.inertia_kg_m2 * rad(m.virtual_axis.quick_dec_deg_s2) / m.axis.ring_ratio,
            "N m",
            f"rigid load, at the reducer output; momentary limit {m.reducer.torque_momentary_nm:g}",
        ),
        ("brake_reserve", m.brake.torque_nm / max(check, 1e-3), "-", "brake / check moment"),
        (
            "brake_dec",
            deg(m.brake.torque_nm / whole),
            "deg/s2",
            "brake alone on the rigid machine; the load swings on after it",
        ),
    ]
