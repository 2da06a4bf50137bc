"""Rules of motor, reducer, encoder, brake and the loops: can these parts do what is asked of them?

Only what follows from a rigid body and the name plates; `gantryctl stops` checks what needs the whole plant.
"""

from __future__ import annotations

import math

from gantryctl.machine.rules.book import RATIO, Broken, at_least, at_most, below, linear_rule, rule
from gantryctl.machine.tables.model import Machine
from gantryctl.units import rad, rad_s_from_r_min

ROTOR = ("motor.inertia_kg_m2", "plant.motor.wave_generator_inertia_kg_m2")
# How many motors there are, and how many have torque.
PINIONS = ("plant.switches.second_pinion", "plant.second_pinion.lost")


# --- motor and reducer --------------------------------------------------------------------------------------
@rule("motor.torque_rated_nm", "motor.torque_max_nm")
def torques_in_order(m: Machine) -> Broken:
    """The torque limit is not below the rated torque."""
    return at_most(m.motor.torque_rated_nm, m.motor.torque_max_nm, "the torque limit")


@rule("motor.torque_max_nm", "motor.torque_rated_nm")
def overload_is_credible(m: Machine) -> Broken:
    """The torque limit is not more than six times the rated torque."""
    return at_most(m.motor.torque_max_nm, 6.0 * m.motor.torque_rated_nm, "6 x rated; no servo motor has more")


@rule("motor.speed_rated_r_min", "motor.speed_max_r_min")
def motor_speeds_in_order(m: Machine) -> Broken:
    """The highest motor speed is not below the rated speed."""
    return at_most(m.motor.speed_rated_r_min, m.motor.speed_max_r_min, "the highest motor speed")


@rule("motor.power_rated_kw", "motor.torque_rated_nm", "motor.speed_rated_r_min")
def name_plate_agrees(m: Machine) -> Broken:
    """Rated power is rated torque times rated speed, within 10 %."""
    power = m.motor.torque_rated_nm * rad_s_from_r_min(m.motor.speed_rated_r_min) / 1000.0
    if abs(m.motor.power_rated_kw - power) <= 0.1 * power:
        return None
    return f"must be {power:.4g} kW within 10 %: rated torque x rated speed"


@rule("motor.current_rated_a", "motor.power_rated_kw", "motor.power_factor", "motor.efficiency")
def voltage_is_credible(m: Machine) -> Broken:
    """Rated power and current belong to a line voltage of 10 to 1000 V."""
    active = math.sqrt(3.0) * m.motor.current_rated_a * m.motor.power_factor * m.motor.efficiency
    voltage = 1000.0 * m.motor.power_rated_kw / active
    if 10.0 <= voltage <= 1000.0:
        return None
    return f"gives a line voltage of {voltage:.4g} V, allowed 10..1000 V"


@rule("reducer.torque_rated_nm", "reducer.torque_momentary_nm")
def reducer_torques_in_order(m: Machine) -> Broken:
    """The reducer's momentary torque is not below its rated torque."""
    return at_most(m.reducer.torque_rated_nm, m.reducer.torque_momentary_nm, "the momentary torque")


@rule("reducer.torque_momentary_nm", "reducer.torque_rated_nm")
def momentary_torque_is_credible(m: Machine) -> Broken:
    """The reducer's momentary torque is not more than ten times its rated torque."""
    # Catalogues have 2 to 3 for planetary gears and up to 5 for cycloidal and strain-wave gears.
    most = 10.0 * m.reducer.torque_rated_nm
    return at_most(m.reducer.torque_momentary_nm, most, "10 x rated; no gear bears more")


@rule(
    "motor.torque_max_nm",
    "virtual_axis.quick_dec_deg_s2",
    *RATIO,
    "plant.load.inertia_kg_m2",
    *ROTOR,
    *PINIONS,
)
def motor_gives_quick_stop(m: Machine) -> Broken:
    """The torque limit covers the quick stop of the rigid machine: load, rotor and wave generator."""
    need = rigid_inertia_kg_m2(m) * rad(m.virtual_axis.quick_dec_deg_s2) * m.axis.ratio
    return at_least(
        m.motor.torque_max_nm, need / torque_motors(m), "what the rigid machine needs for its quick stop"
    )


@rule("motor.torque_max_nm", "virtual_axis.acc_deg_s2", *RATIO, "plant.load.inertia_kg_m2", *ROTOR, *PINIONS)
def motor_gives_acceleration(m: Machine) -> Broken:
    """The torque limit covers the acceleration of the rigid machine."""
    need = rigid_inertia_kg_m2(m) * rad(m.virtual_axis.acc_deg_s2) * m.axis.ratio
    return at_least(
        m.motor.torque_max_nm, need / torque_motors(m), "what the rigid machine needs to accelerate"
    )


@rule(
    "reducer.torque_momentary_nm",
    "virtual_axis.quick_dec_deg_s2",
    "axis.ring_ratio",
    "plant.load.inertia_kg_m2",
)
def reducer_bears_quick_stop(m: Machine) -> Broken:
    """The reducer's momentary torque covers the quick stop of the rigid load."""
    need = m.plant.load.inertia_kg_m2 * rad(m.virtual_axis.quick_dec_deg_s2) / m.axis.ring_ratio
    why = "what the rigid load's quick stop puts on the reducer"
    return at_least(m.reducer.torque_momentary_nm, need, why)


@rule("motor.torque_rated_nm", *RATIO, "plant.load.eccentric_check_moment_nm")
def motor_holds_check_moment(m: Machine) -> Broken:
    """Rated torque holds the eccentric moment of the check."""
    need = m.plant.load.eccentric_check_moment_nm / m.axis.ratio
    return at_least(m.motor.torque_rated_nm, need, "to hold the eccentric moment of the check")


# --- encoder ------------------------------------------------------------------------------------------------
@rule("encoder.counts_per_turn")
def counts_are_a_power_of_two(m: Machine) -> Broken:
    """Absolute steps per turn are a power of two."""
    return _power_of_two(m.encoder.counts_per_turn)


@rule("encoder.turns", "drive.kind")
def turns_are_a_power_of_two(m: Machine) -> Broken:
    """The number of turns told apart is a power of two; a drive on a bus may count them otherwise."""
    return None if m.on_bus else _power_of_two(m.encoder.turns)


@linear_rule("encoder.turns", *RATIO, "axis.pos_min_deg", "axis.pos_max_deg", "encoder.wrap_margin_min_deg")
def encoder_covers_travel(m: Machine) -> Broken:
    """A centred encoder covers travel and the wrap margin on both sides."""
    travel = m.axis.pos_max_deg - m.axis.pos_min_deg + 2.0 * m.encoder.wrap_margin_min_deg
    need = travel / 360.0 * m.axis.ratio
    return at_least(m.encoder.turns, need, "travel plus the wrap margin on both sides")


@rule("encoder.turns", *RATIO, "axis.kind", "encoder.wrap_margin_min_deg")
def encoder_covers_wrap_margin(m: Machine) -> Broken:
    """The encoder of a modulo axis tells the wrap margin apart both ways: so far it may move while off."""
    if not m.axis.modulo:
        return None
    need = 2.0 * m.encoder.wrap_margin_min_deg / 360.0 * m.axis.ratio
    return at_least(m.encoder.turns, need, "the wrap margin both ways")


@rule("encoder.turns", *RATIO, "speed.overspeed_trip_deg_s", "control.scan_period_ms")
def encoder_outruns_scan(m: Machine) -> Broken:
    """In three scans, at the speed that trips, the encoder makes less than a quarter of its range: wraps are seen."""
    way = 3.0e-3 * m.control.scan_period_ms * m.speed.overspeed_trip_deg_s
    return at_least(
        m.encoder.turns, 4.0 * way / 360.0 * m.axis.ratio, "or a wrap is no more known from a motion"
    )


@rule("encoder.lines", "encoder.interpolation", "encoder.counts_per_turn")
def interpolation_is_finer(m: Machine) -> Broken:
    """Lines x interpolation is not coarser than the absolute steps."""
    need = m.encoder.counts_per_turn / m.encoder.interpolation
    return at_least(m.encoder.lines, need, "lines x interpolation not coarser than the absolute steps")


# --- brake --------------------------------------------------------------------------------------------------
@rule("brake.torque_nm", *RATIO, "plant.load.eccentric_check_moment_nm")
def brake_holds_check_moment(m: Machine) -> Broken:
    """The brake holds 1.3 times the eccentric moment of the check."""
    need = 1.3 * m.plant.load.eccentric_check_moment_nm / m.axis.ratio
    return at_least(m.brake.torque_nm, need, "1.3 x the eccentric moment of the check")


@rule("brake.proof_torque_nm", "brake.torque_nm")
def proof_does_not_slip(m: Machine) -> Broken:
    """The torque proof stays below the brake's torque, or the brake slips under it."""
    return below(m.brake.proof_torque_nm, m.brake.torque_nm, "or the closed brake slips")


@rule("brake.proof_torque_nm", "motor.torque_rated_nm")
def proof_within_rating(m: Machine) -> Broken:
    """The torque proof is within the motor's rated torque."""
    return at_most(m.brake.proof_torque_nm, m.motor.torque_rated_nm, "the motor's rated torque")


@rule("brake.test_torque_nm", *RATIO, "plant.load.eccentric_check_moment_nm")
def brake_test_covers_check_moment(m: Machine) -> Broken:
    """The brake test asks for 1.3 times the eccentric moment of the check, or more."""
    need = 1.3 * m.plant.load.eccentric_check_moment_nm / m.axis.ratio
    return at_least(m.brake.test_torque_nm, need, "1.3 x the eccentric moment of the check")


@rule("brake.test_torque_nm", "motor.torque_max_nm", *RATIO, "plant.load.eccentric_check_moment_nm")
def motor_gives_brake_test(m: Machine) -> Broken:
    """The motor's torque limit covers the brake test on top of the load that it holds."""
    most = m.motor.torque_max_nm - m.plant.load.eccentric_check_moment_nm / m.axis.ratio
    return at_most(m.brake.test_torque_nm, most, "the motor's torque limit less the load that it holds")


@rule("brake.test_torque_nm", "brake.torque_nm")
def brake_test_does_not_slip(m: Machine) -> Broken:
    """The brake test stays below the brake's torque, or a sound brake slips."""
    return below(m.brake.test_torque_nm, m.brake.torque_nm, "or a sound brake slips")


@rule("monitors.running_torque_nm", "motor.torque_rated_nm")
def motion_within_rating(m: Machine) -> Broken:
    """A steady motion needs no more than the motor gives continuously."""
    return at_most(m.monitors.running_torque_nm, m.motor.torque_rated_nm, "the motor's rated torque")


@rule("monitors.wind_torque_nm", "motor.torque_rated_nm")
def wind_within_rating(m: Machine) -> Broken:
    """A wind takes no more than the motor gives continuously, or it could not hold the axis in it."""
    return at_most(m.monitors.wind_torque_nm, m.motor.torque_rated_nm, "the motor's rated torque")


def motion_torque_nm(m: Machine) -> float:
    """Torque of the motor that a steady motion may need, N m: what the brake is tested with, or more by friction."""
    return max(m.brake.test_torque_nm, m.monitors.running_torque_nm)


@rule("brake.hold_brake_after_s", "monitors.in_position_dwell_ms", "brake.hold")
def brake_waits_for_arrival(m: Machine) -> Broken:
    """With hold = "brake" the brake closes after the axis counts as arrived, not before."""
    if m.brake.hold != "brake":
        return None
    need = m.monitors.in_position_dwell_ms / 1000.0
    return at_least(m.brake.hold_brake_after_s, need, "the in-position dwell")


# --- scan and loops -----------------------------------------------------------------------------------------
@rule("control.scan_period_ms", "drive.speed_loop.cycle_us")
def scan_is_whole_cycles(m: Machine) -> Broken:
    """The scan is a whole number of drive cycles."""
    cycles = m.control.scan_period_ms * 1000.0 / m.drive.speed_loop.cycle_us
    if round(cycles) >= 1 and abs(cycles - round(cycles)) <= 1e-9 * cycles:
        return None
    return f"must be a whole number of drive cycles, now {cycles:.6g}"


@rule("control.kpp_per_s", "control.scan_period_ms")
def position_loop_is_sampled_enough(m: Machine) -> Broken:
    """Position gain x scan period is at most 0.5."""
    return at_most(m.control.kpp_per_s, 500.0 / m.control.scan_period_ms, "0.5 / scan period")


@rule("drive.speed_loop.tvi_ms", "drive.speed_loop.cycle_us")
def integral_is_sampled_enough(m: Machine) -> Broken:
    """The integral time is at least two drive cycles."""
    loop = m.drive.speed_loop
    return at_least(loop.tvi_ms, 2.0 * loop.cycle_us / 1000.0, "two drive cycles")


@rule(
    "drive.speed_loop.kvp_nm_s_per_rad", "drive.speed_loop.cycle_us", *ROTOR, "plant.switches.rigid",
    "plant.switches.second_pinion",
)  # fmt: skip
def speed_loop_is_sampled_enough(m: Machine) -> Broken:
    """The speed loop on the rotor alone does not correct more than the whole error in one drive cycle."""
    inertia = rigid_inertia_kg_m2(m) if m.plant.switches.rigid else rotor_inertia_kg_m2(m)
    most = inertia / (m.drive.speed_loop.cycle_us * 1e-6)
    return at_most(m.drive.speed_loop.kvp_nm_s_per_rad, most, "rotor inertia / drive cycle, or it swings up")


def rotor_inertia_kg_m2(m: Machine) -> float:
    """Rotor with wave generator, at the motor shaft."""
    return m.motor.inertia_kg_m2 + m.plant.motor.wave_generator_inertia_kg_m2


def rigid_inertia_kg_m2(m: Machine) -> float:
    """Load, rotor and wave generator as one body, at the motor shaft; both rotors where there are two."""
    return m.plant.load.inertia_kg_m2 / m.axis.ratio**2 + motors(m) * rotor_inertia_kg_m2(m)


def motors(m: Machine) -> int:
    """Motors on the ring."""
    return 2 if m.plant.switches.second_pinion else 1


def torque_motors(m: Machine) -> int:
    """Those of them that have torque."""
    return 1 if m.plant.second_pinion.lost != "none" else motors(m)


def _power_of_two(value: int) -> Broken:
    return None if value & (value - 1) == 0 else "must be a power of two, as in every absolute encoder"
