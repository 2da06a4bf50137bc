"""Rules of the simulated physics: values that contradict each other, or that the time step cannot follow."""

from __future__ import annotations

import math

from gantryctl.machine.rules.book import RATIO, Broken, at_least, at_most, below, linear_rule, rule
from gantryctl.machine.rules.parts import PINIONS, ROTOR, motors, rotor_inertia_kg_m2, torque_motors
from gantryctl.machine.tables.model import Machine
from gantryctl.units import rad

CYCLE = "drive.speed_loop.cycle_us"


# Strings of keys that several rules are about.
_TOP_SPEED = ("speed.setting_max_deg_s", *RATIO)
_ROLLERS = ("plant.roller_friction.coulomb_nm", "plant.roller_friction.viscous_nm_s_per_rad")
_MOTOR_FRICTION = ("plant.motor_friction.coulomb_nm", "plant.motor_friction.viscous_nm_s_per_rad")
# Contacts slide after some ten micrometres, whatever the size of the machine.
_SLIDES_AFTER_M = 1e-3
# Dry steel on steel has 0.74 / 0.57, lubricated seals and cold grease two to three.
_STICKING = 5.0


@rule("plant.load.inertia_kg_m2", "plant.load.mass_kg")
def load_size_is_credible(m: Machine) -> Broken:
    """The radius of gyration of the load lies between 0.02 and 50 m."""
    radius = math.sqrt(m.plant.load.inertia_kg_m2 / m.plant.load.mass_kg)
    if 0.02 <= radius <= 50.0:
        return None
    return f"gives a radius of gyration of {radius:.4g} m, allowed 0.02..50 m"


@rule("plant.load.eccentric_check_moment_nm", "plant.load.mass_kg", "plant.load.eccentricity_m")
def check_moment_covers_nominal(m: Machine) -> Broken:
    """The moment that stops are proved with is not below the nominal eccentric moment."""
    load, why = m.plant.load, "the nominal eccentric moment, mass x 9.81 x eccentricity"
    return at_least(load.eccentric_check_moment_nm, load.eccentric_moment_nm, why)


@rule(
    "plant.load.eccentric_check_moment_nm", "plant.load.mass_kg", "plant.load.eccentricity_m",
    "plant.wind.moment_nm", "plant.wind.turbulence", "plant.switches.wind",
)  # fmt: skip
def check_moment_covers_wind(m: Machine) -> Broken:
    """The moment that stops are proved with covers the eccentric moment and the largest gust of the wind."""
    if not m.plant.switches.wind:
        return None
    need = m.plant.load.eccentric_moment_nm + m.plant.wind.largest_nm
    why = "the eccentric moment and the wind, mean x (1 + 7 x turbulence)"
    return at_least(m.plant.load.eccentric_check_moment_nm, need, why)


@rule(
    "motor.torque_max_nm", *RATIO, "plant.load.mass_kg", "plant.load.eccentricity_m",
    "plant.roller_friction.breakaway_nm", "plant.motor_friction.breakaway_nm", *PINIONS,
)  # fmt: skip
def motor_breaks_away(m: Machine) -> Broken:
    """The torque limit starts the axis against breakaway friction and the nominal eccentric moment."""
    load = m.plant.load.eccentric_moment_nm + m.plant.roller_friction.breakaway_nm
    need = (load / m.axis.ratio + motors(m) * m.plant.motor_friction.breakaway_nm) / torque_motors(m)
    return at_least(m.motor.torque_max_nm, need, "breakaway friction and nominal eccentric moment")


@rule(
    "motor.torque_rated_nm", *_TOP_SPEED, *_ROLLERS, *_MOTOR_FRICTION, "plant.load.eccentric_check_moment_nm",
    *PINIONS,
)  # fmt: skip
def motor_holds_speed(m: Machine) -> Broken:
    """Rated torque turns the axis at its highest setting against friction and the eccentric moment of the check."""
    rollers, motor = m.plant.roller_friction, m.plant.motor_friction
    v = rad(m.speed.setting_max_deg_s)
    load = m.plant.load.eccentric_check_moment_nm + rollers.coulomb_nm + rollers.viscous_nm_s_per_rad * v
    own = motor.coulomb_nm + motor.viscous_nm_s_per_rad * v * m.axis.ratio
    need = (load / m.axis.ratio + motors(m) * own) / torque_motors(m)
    return at_least(
        m.motor.torque_rated_nm, need, "friction at the highest setting and the moment of the check"
    )


@rule("plant.motor.torque_ripple_nm", "motor.torque_rated_nm", "plant.switches.torque_ripple")
def ripple_is_credible(m: Machine) -> Broken:
    """The torque ripple is at most a fifth of the rated torque."""
    if not m.plant.switches.torque_ripple:
        return None
    return at_most(
        m.plant.motor.torque_ripple_nm, 0.2 * m.motor.torque_rated_nm, "a fifth of the rated torque"
    )


@rule(
    "plant.transmission.reducer_torque_2_nm", "reducer.torque_momentary_nm", "plant.switches.three_slopes",
    "plant.switches.rigid",
)  # fmt: skip
def slopes_within_reducer(m: Machine) -> Broken:
    """The second slope of the reducer's stiffness ends below the torque that it bears for a moment."""
    if m.plant.switches.rigid or not m.plant.switches.three_slopes:
        return None
    limit = m.reducer.torque_momentary_nm
    return at_most(m.plant.transmission.reducer_torque_2_nm, limit, "the momentary torque of the reducer")


@rule(
    "plant.transmission.hysteresis_torque_nm", "reducer.torque_rated_nm", "axis.ring_ratio",
    "plant.switches.hysteresis", "plant.switches.rigid",
)  # fmt: skip
def hysteresis_is_credible(m: Machine) -> Broken:
    """The hysteresis of the transmission is at most a fifth of the reducer's rated torque, at the load."""
    if m.plant.switches.rigid or not m.plant.switches.hysteresis:
        return None
    most = 0.2 * m.reducer.torque_rated_nm * m.axis.ring_ratio
    return at_most(
        m.plant.transmission.hysteresis_torque_nm, most, "a fifth of the rated torque x ring ratio"
    )


@rule("plant.transmission.hysteresis_length_rad", "plant.gear_error.ring_radius_m")
def hysteresis_length_is_credible(m: Machine) -> Broken:
    """The pre-sliding length of the hysteresis is at most 1 mm at the ring."""
    most = _SLIDES_AFTER_M / m.plant.gear_error.ring_radius_m
    return at_most(m.plant.transmission.hysteresis_length_rad, most, "1 mm at the ring")


@rule("plant.roller_friction.presliding_rad", "plant.gear_error.ring_radius_m")
def rollers_slide_soon(m: Machine) -> Broken:
    """The rollers slide within 1 mm at the ring."""
    most = _SLIDES_AFTER_M / m.plant.gear_error.ring_radius_m
    return at_most(m.plant.roller_friction.presliding_rad, most, "1 mm at the ring")


@rule("plant.roller_friction.stribeck_deg_s", "speed.setting_max_deg_s")
def rollers_reach_running_friction(m: Machine) -> Broken:
    """The rollers' breakaway friction has gone over into running friction below the highest setting."""
    limit = m.speed.setting_max_deg_s
    return below(m.plant.roller_friction.stribeck_deg_s, limit, "the highest setting")


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


@rule(
    "plant.transmission.reducer_stiffness_3_nm_per_rad", "plant.transmission.reducer_stiffness_1_nm_per_rad"
)
def slopes_are_credible(m: Machine) -> Broken:
    """The third slope of the reducer is at most ten times the first."""
    # Catalogues of strain-wave gears have 1.5 to 2.5.
    t = m.plant.transmission
    most = 10.0 * t.reducer_stiffness_1_nm_per_rad
    return at_most(t.reducer_stiffness_3_nm_per_rad, most, "10 x the first slope")


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


@rule("plant.roller_friction.breakaway_nm", "plant.roller_friction.coulomb_nm")
def roller_breakaway_is_credible(m: Machine) -> Broken:
    """The rollers' breakaway friction is at most five times their running friction, where they have any."""
    f = m.plant.roller_friction
    if f.coulomb_nm <= 0.0:
        return None
    return at_most(f.breakaway_nm, _STICKING * f.coulomb_nm, "5 x the running friction")


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


# --- effects beyond the reference machine ---------------------------------------------------------------------
# What the core has room for, and what ISO 1328-1 is about.
_RING_TEETH = (24, 1024)
_PINION_TEETH = (5, 128)


@rule("plant.gear_error.pinion_teeth", "axis.ring_ratio", "plant.switches.tooth_pitch")
def single_teeth_can_be_drawn(m: Machine) -> Broken:
    """Single teeth are those of a pinion of 5 to 128 and a ring of 24 to 1024 teeth."""
    pinion = m.plant.gear_error.pinion_teeth
    ring = round(pinion * m.axis.ring_ratio)
    if not m.plant.switches.tooth_pitch or (
        _PINION_TEETH[0] <= pinion <= _PINION_TEETH[1] and _RING_TEETH[0] <= ring <= _RING_TEETH[1]
    ):
        return None
    return f"gives {pinion} and {ring} teeth, allowed 5..128 and 24..1024 with tooth_pitch"


@rule(
    "plant.thermal.motor_start_k", "plant.thermal.motor_end_k", "plant.thermal.torque_constant_per_k",
    "plant.switches.thermal",
)  # fmt: skip
def warm_motor_has_torque(m: Machine) -> Broken:
    """Temperature leaves the motor at least half of its torque per current."""
    t = m.plant.thermal
    if not m.plant.switches.thermal:
        return None
    least = min(1.0 + t.torque_constant_per_k * each for each in (t.motor_start_k, t.motor_end_k))
    return at_least(least, 0.5, "half of the torque per current")


@rule(
    "motor.torque_max_nm", *RATIO, "plant.load.mass_kg", "plant.load.eccentricity_m",
    "plant.roller_friction.breakaway_nm", "plant.motor_friction.breakaway_nm", "plant.ageing.roller_nm",
    "plant.ageing.motor_nm", "plant.switches.ageing", *PINIONS,
)  # fmt: skip
def motor_breaks_away_after_rest(m: Machine) -> Broken:
    """The torque limit starts the axis after a long rest, against grown breakaway and the nominal eccentric moment."""
    if not m.plant.switches.ageing:
        return None
    rollers = m.plant.roller_friction.breakaway_nm + m.plant.ageing.roller_nm
    motor = m.plant.motor_friction.breakaway_nm + m.plant.ageing.motor_nm
    need = ((m.plant.load.eccentric_moment_nm + rollers) / m.axis.ratio + motors(m) * motor) / torque_motors(
        m
    )
    return at_least(m.motor.torque_max_nm, need, "breakaway after rest and nominal eccentric moment")


@rule("plant.motor.cogging_torque_nm", "motor.torque_rated_nm", "plant.switches.cogging")
def cogging_is_credible(m: Machine) -> Broken:
    """The cogging torque is at most a fifth of the rated torque."""
    if not m.plant.switches.cogging:
        return None
    most = 0.2 * m.motor.torque_rated_nm
    return at_most(m.plant.motor.cogging_torque_nm, most, "a fifth of the rated torque")


@rule(
    "plant.encoder.interpolation_1x_rad", "plant.encoder.interpolation_2x_rad", "encoder.lines",
    "plant.switches.encoder_errors",
)  # fmt: skip
def encoder_reading_grows(m: Machine) -> Broken:
    """The encoder's reading grows with the angle: lines x (error 1x + 2 x error 2x) is at most 0.5."""
    if not m.plant.switches.encoder_errors:
        return None
    e = m.plant.encoder
    steepest = m.encoder.lines * (e.interpolation_1x_rad + 2.0 * e.interpolation_2x_rad)
    return at_most(steepest, 0.5, "or the reading runs backwards within a signal period")


@rule("axis.kind", "plant.switches.cable")
def cables_have_ends(m: Machine) -> Broken:
    """An axis without ends has no cable chain."""
    if not (m.axis.modulo and m.plant.switches.cable):
        return None
    return 'must be "linear": [plant.switches] cable is on, and a cable chain does not go round'


@rule("plant.switches.second_pinion", "plant.switches.rigid")
def second_pinion_has_gears(m: Machine) -> Broken:
    """A second pinion needs gears: it is not there in one inertia."""
    if not (m.plant.switches.second_pinion and m.plant.switches.rigid):
        return None
    return "must be false: [plant.switches] rigid = true makes all of the axis one inertia without gears"


@rule("plant.second_pinion.preload_nm", "motor.torque_rated_nm", "plant.switches.second_pinion")
def preload_leaves_torque(m: Machine) -> Broken:
    """The preload of two pinions takes at most half of a motor's rated torque."""
    if not m.plant.switches.second_pinion:
        return None
    most = 0.5 * m.motor.torque_rated_nm
    size = abs(m.plant.second_pinion.preload_nm)
    return at_most(size, most, "half of the rated torque; the rest is for the load")


@rule(
    "plant.second_pinion.preload_nm", "reducer.torque_rated_nm", "axis.reducer_ratio", "plant.switches.second_pinion"
)  # fmt: skip
def preload_within_reducer(m: Machine) -> Broken:
    """The preload of two pinions, which never rests, stays below the rated torque of the reducers."""
    if not m.plant.switches.second_pinion:
        return None
    most = m.reducer.torque_rated_nm / m.axis.reducer_ratio
    return at_most(abs(m.plant.second_pinion.preload_nm), most, "the rated torque of the reducer / its ratio")


# --- encoders -----------------------------------------------------------------------------------------------
@linear_rule("plant.encoder.mounting_turns", *RATIO, "axis.pos_min_deg", "encoder.wrap_margin_min_deg")
def wrap_below_travel(m: Machine) -> Broken:
    """The encoder's lower wrap lies below travel by at least the wrap margin."""
    need = (m.encoder.wrap_margin_min_deg - m.axis.pos_min_deg) / 360.0 * m.axis.ratio
    return at_least(m.plant.encoder.mounting_turns, need, "or the encoder wraps inside travel")


@linear_rule(
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


@rule(
    CYCLE, "plant.transmission.hysteresis_length_rad", "brake.torque_nm", "motor.torque_max_nm", *RATIO, *ROTOR,
    "plant.load.inertia_kg_m2", "speed.overspeed_trip_deg_s", "plant.switches.hysteresis", "plant.switches.rigid",
    "plant.switches.second_pinion",
    "plant.transmission.reducer_stiffness_1_nm_per_rad", "plant.transmission.rest_stiffness_nm_per_rad",
)  # fmt: skip
def step_follows_hysteresis(m: Machine) -> Broken:
    """A drive cycle twists the gears by at most two pre-sliding lengths of the hysteresis, in the hardest stop."""
    if m.plant.switches.rigid or not m.plant.switches.hysteresis:
        return None
    t = m.plant.transmission
    reducer = m.axis.ring_ratio**2 * t.reducer_stiffness_1_nm_per_rad
    stiffness = 1.0 / (1.0 / reducer + 1.0 / t.rest_stiffness_nm_per_rad)
    pinions = motors(m)
    inertia = m.plant.load.inertia_kg_m2 + pinions * m.axis.ratio**2 * rotor_inertia_kg_m2(m)
    acc = max(m.brake.torque_nm, pinions * m.motor.torque_max_nm) * m.axis.ratio / inertia
    # A step of the deceleration swings the load with twice the amplitude of a steady one, and never faster than the
    # axis was. The explicit step of the hysteresis is stable up to two lengths.
    swing = min(
        2.0 * acc / math.sqrt(pinions * stiffness / m.plant.load.inertia_kg_m2),
        rad(m.speed.overspeed_trip_deg_s),
    )
    most = 2e6 * t.hysteresis_length_rad / swing
    return at_most(m.drive.speed_loop.cycle_us, most, "or the simulation of the hysteresis swings up")


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


@rule(
    CYCLE, "plant.cable.friction_nm", "plant.cable.presliding_deg", "plant.load.inertia_kg_m2",
    "plant.switches.cable",
)  # fmt: skip
def step_follows_cables(m: Machine) -> Broken:
    """The drive cycle follows the cable chain before it slides."""
    if not m.plant.switches.cable:
        return None
    stiffness = m.plant.cable.friction_nm / rad(m.plant.cable.presliding_deg)
    return _follows(m, stiffness, m.plant.load.inertia_kg_m2, "the cable chain")


@rule(CYCLE, "plant.motor.cogging_order", "speed.drive_ceiling_deg_s", *RATIO, "plant.switches.cogging")
def step_follows_cogging(m: Machine) -> Broken:
    """A drive cycle passes at most a quarter of a period of the cogging, at the drive's highest speed."""
    if not m.plant.switches.cogging:
        return None
    per_s = m.plant.motor.cogging_order * m.speed.drive_ceiling_deg_s / 360.0 * m.axis.ratio
    return at_most(m.drive.speed_loop.cycle_us, 0.25e6 / per_s, "a quarter of a period of the cogging")


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
