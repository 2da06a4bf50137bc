"""Rules of the simulated physics: values that contradict each other, or that the time step cannot follow."""

from __future__ import annotations

import math

from gantryctl.machine.rules.book import RATIO, Broken, at_least, at_most, below, rule
from gantryctl.machine.rules.parts import ROTOR, rotor_inertia_kg_m2
from gantryctl.machine.tables.model import Machine

CYCLE = "drive.speed_loop.cycle_us"


@rule("plant.load.inertia_kg_m2", "plant.load.mass_kg")
def load_size_is_credible(m: Machine) -> Broken:
    """The radius of gyration of the load lies between 0.2 and 10 m."""
    radius = math.sqrt(m.plant.load.inertia_kg_m2 / m.plant.load.mass_kg)
    if 0.2 <= radius <= 10.0:
        return None
    return f"gives a radius of gyration of {radius:.4g} m, allowed 0.2..10 m"


@rule("plant.load.eccentric_check_moment_nm", "plant.load.mass_kg", "plant.load.eccentricity_m")
def check_moment_covers_nominal(m: Machine) -> Broken:
    """The moment that stops are proved with is not below the nominal eccentric moment."""
    load, why = m.plant.load, "the nominal eccentric moment, mass x 9.81 x eccentricity"
    return at_least(load.eccentric_check_moment_nm, load.eccentric_moment_nm, why)


@rule(
    "motor.torque_max_nm", *RATIO, "plant.load.mass_kg", "plant.load.eccentricity_m",
    "plant.roller_friction.breakaway_nm", "plant.motor_friction.breakaway_nm",
)  # fmt: skip
def motor_breaks_away(m: Machine) -> Broken:
    """The torque limit starts the axis against breakaway friction and the nominal eccentric moment."""
    load = m.plant.load.eccentric_moment_nm + m.plant.roller_friction.breakaway_nm
    need = load / m.axis.ratio + m.plant.motor_friction.breakaway_nm
    return at_least(m.motor.torque_max_nm, need, "breakaway friction and nominal eccentric moment")


@rule(
    "plant.transmission.reducer_stiffness_1_nm_per_rad", "plant.transmission.reducer_stiffness_2_nm_per_rad"
)
def first_slope_not_stiffer(m: Machine) -> Broken:
    """The reducer gets stiffer from the first slope to the second."""
    t = m.plant.transmission
    limit = t.reducer_stiffness_2_nm_per_rad
    return at_most(t.reducer_stiffness_1_nm_per_rad, limit, "the second slope; a reducer stiffens with load")


@rule(
    "plant.transmission.reducer_stiffness_2_nm_per_rad", "plant.transmission.reducer_stiffness_3_nm_per_rad"
)
def second_slope_not_stiffer(m: Machine) -> Broken:
    """The reducer gets stiffer from the second slope to the third."""
    t = m.plant.transmission
    limit = t.reducer_stiffness_3_nm_per_rad
    return at_most(t.reducer_stiffness_2_nm_per_rad, limit, "the third slope; a reducer stiffens with load")


@rule("plant.transmission.reducer_torque_1_nm", "plant.transmission.reducer_torque_2_nm")
def slopes_in_order(m: Machine) -> Broken:
    """The first slope ends before the second."""
    t = m.plant.transmission
    return below(t.reducer_torque_1_nm, t.reducer_torque_2_nm, "the end of the second slope")


@rule("plant.roller_friction.breakaway_nm", "plant.roller_friction.coulomb_nm")
def roller_breakaway_not_lower(m: Machine) -> Broken:
    """The rollers' breakaway friction is not below their running friction."""
    f = m.plant.roller_friction
    return at_least(f.breakaway_nm, f.coulomb_nm, "the running friction")


@rule("plant.motor_friction.breakaway_nm", "plant.motor_friction.coulomb_nm")
def motor_breakaway_not_lower(m: Machine) -> Broken:
    """The motor's breakaway friction is not below its running friction."""
    f = m.plant.motor_friction
    return at_least(f.breakaway_nm, f.coulomb_nm, "the running friction")


@rule("plant.gear_error.pinion_teeth", "axis.ring_ratio")
def ring_has_whole_teeth(m: Machine) -> Broken:
    """Pinion teeth x ring ratio is a whole number of ring teeth, within 0.02."""
    teeth = m.plant.gear_error.pinion_teeth * m.axis.ring_ratio
    if abs(teeth - round(teeth)) <= 0.02:
        return None
    return f"gives a ring of {teeth:.6g} teeth, must be a whole number"


# --- encoders -----------------------------------------------------------------------------------------------
@rule("plant.encoder.mounting_turns", *RATIO, "axis.pos_min_deg", "encoder.wrap_margin_min_deg")
def wrap_below_travel(m: Machine) -> Broken:
    """The encoder's lower wrap lies below travel by at least the wrap margin."""
    need = (m.encoder.wrap_margin_min_deg - m.axis.pos_min_deg) / 360.0 * m.axis.ratio
    return at_least(m.plant.encoder.mounting_turns, need, "or the encoder wraps inside travel")


@rule(
    "plant.encoder.mounting_turns", "encoder.turns", *RATIO, "axis.pos_max_deg", "encoder.wrap_margin_min_deg"
)
def wrap_above_travel(m: Machine) -> Broken:
    """The encoder's upper wrap lies above travel by at least the wrap margin."""
    most = m.encoder.turns - (m.axis.pos_max_deg + m.encoder.wrap_margin_min_deg) / 360.0 * m.axis.ratio
    return at_most(m.plant.encoder.mounting_turns, most, "or the encoder wraps inside travel")


@rule("plant.encoder.latency_us", "control.scan_period_ms")
def latency_below_scan(m: Machine) -> Broken:
    """The encoder's latency is below one scan."""
    return below(m.plant.encoder.latency_us, 1000.0 * m.control.scan_period_ms, "one scan")


# --- what the time step can follow: natural frequency x drive cycle at most 1 (explicit steps swing up at 2)
@rule(
    CYCLE, *RATIO, *ROTOR, "plant.switches.rigid",
    "plant.transmission.reducer_stiffness_3_nm_per_rad", "plant.transmission.rest_stiffness_nm_per_rad",
)  # fmt: skip
def step_follows_transmission(m: Machine) -> Broken:
    """The drive cycle follows the swing of the rotor on the transmission."""
    if m.plant.switches.rigid:
        return None
    t = m.plant.transmission
    reducer = m.axis.ring_ratio**2 * t.reducer_stiffness_3_nm_per_rad
    stiffness = 1.0 / (1.0 / reducer + 1.0 / t.rest_stiffness_nm_per_rad)
    return _follows(m, stiffness / m.axis.ratio**2, rotor_inertia_kg_m2(m), "the transmission")


@rule(CYCLE, "plant.base.frequency_hz")
def step_follows_base(m: Machine) -> Broken:
    """The drive cycle follows the rocking of the base."""
    return _follows(m, (2.0 * math.pi * m.plant.base.frequency_hz) ** 2, 1.0, "the base")


@rule(CYCLE, "plant.motor_friction.coulomb_nm", "plant.motor_friction.presliding_rad", *ROTOR)
def step_follows_motor_friction(m: Machine) -> Broken:
    """The drive cycle follows the motor friction before it slides."""
    stiffness = m.plant.motor_friction.coulomb_nm / m.plant.motor_friction.presliding_rad
    return _follows(m, stiffness, rotor_inertia_kg_m2(m), "the motor friction")


@rule(
    CYCLE,
    "plant.roller_friction.coulomb_nm",
    "plant.roller_friction.presliding_rad",
    "plant.load.inertia_kg_m2",
)
def step_follows_roller_friction(m: Machine) -> Broken:
    """The drive cycle follows the roller friction before it slides."""
    stiffness = m.plant.roller_friction.coulomb_nm / m.plant.roller_friction.presliding_rad
    return _follows(m, stiffness, m.plant.load.inertia_kg_m2, "the roller friction")


@rule(CYCLE, "brake.torque_nm", "plant.brake.presliding_rad", *ROTOR)
def step_follows_brake(m: Machine) -> Broken:
    """The drive cycle follows the closed brake before it slides."""
    stiffness = m.brake.torque_nm / m.plant.brake.presliding_rad
    return _follows(m, stiffness, rotor_inertia_kg_m2(m), "the closed brake")


def _follows(m: Machine, stiffness: float, inertia: float, what: str) -> Broken:
    """Whether the drive cycle is short enough for a spring on an inertia, both at the same shaft."""
    # Natural frequency x step: explicit steps are stable up to 2; 1 leaves half of it.
    if stiffness <= 0.0:
        return None
    most = 1e6 / math.sqrt(stiffness / inertia)
    return at_most(m.drive.speed_loop.cycle_us, most, f"or the simulation of {what} swings up")
