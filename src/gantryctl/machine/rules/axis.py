"""Rules of travel, speed chain and the three decelerations."""

from __future__ import annotations

from typing import Final

from gantryctl.machine.rules.book import RATIO, Broken, above, at_least, at_most, below, linear_rule, rule
from gantryctl.machine.specs import field_specs, unknown_guesses
from gantryctl.machine.tables.axis import ENDS
from gantryctl.machine.tables.model import Machine
from gantryctl.units import DEG_S_PER_R_MIN


@rule("machine.guesses")
def guesses_are_keys(m: Machine) -> Broken:
    """Every row of the guesses is a key of the machine file."""
    unknown = unknown_guesses(m.machine.guesses, field_specs())
    return f"must be keys of the file: {unknown} is not; correct or delete the row" if unknown else None


# --- travel -------------------------------------------------------------------------------------------------
# The exact gear of a wheel train has small numbers; digits of a rounded ratio have not.
_DENOMINATOR_MAX: Final = 1000
# A hundredth of the finest count of a gantry, 7.5e-8 deg, in a turn.
_SAME_GEAR: Final = 1e-12


@rule("axis.kind", "axis.pos_min_deg", "axis.pos_max_deg")
def modulo_has_one_turn(m: Machine) -> Broken:
    """Of a modulo axis the lowest and the highest angle are one turn apart."""
    if not m.axis.modulo:
        return None
    span = m.axis.pos_max_deg - m.axis.pos_min_deg
    words = f"gives angles over {span:g} deg, must be one turn: 0 and 360, or -180 and 180"
    return None if abs(span - 360.0) <= 1e-9 else words


@rule("axis.kind", *(f"axis.{key}" for key in ENDS))
def modulo_has_no_ends(m: Machine) -> Broken:
    """A modulo axis has no over-travel, limit switches and mechanical stops: their keys are refused."""
    if not m.axis.modulo:
        return None
    given = [key for key in ENDS if key in m.axis.model_fields_set]
    return (
        f'must be "linear" where the ends of travel are given: remove {", ".join(given)}' if given else None
    )


@rule("axis.gear_motor_turns", "axis.gear_axis_turns", *RATIO)
def gear_is_the_ratio(m: Machine) -> Broken:
    """The exact gear is the product of the two ratios to 12 digits."""
    if not m.axis.gear_motor_turns:
        return None
    gear = float(m.axis.gear)
    if abs(m.axis.ratio - gear) <= _SAME_GEAR * gear:
        return None
    return f"gives a ratio of {gear!r}, reducer_ratio x ring_ratio must be that to 12 digits and is {m.axis.ratio!r}"


@rule("axis.kind", *RATIO, "axis.gear_motor_turns", "axis.gear_axis_turns")
def gear_of_modulo_is_exact(m: Machine) -> Broken:
    """The ratio of a modulo axis is exact: a rounded one would lead its angle astray turn by turn."""
    if not m.axis.modulo:
        return None
    gear = m.axis.gear
    if gear.denominator <= _DENOMINATOR_MAX:
        return None
    return (
        f"gives {gear.numerator}/{gear.denominator} by its digits, which is no gear: gear_motor_turns and "
        "gear_axis_turns must be given, as 352 and 3"
    )


@linear_rule("axis.pos_min_deg", "axis.pos_max_deg")
def travel_is_not_empty(m: Machine) -> Broken:
    """The lowest angle lies at least 1 deg below the highest."""
    return at_most(m.axis.pos_min_deg, m.axis.pos_max_deg - 1.0, "or there is no travel")


@linear_rule("axis.over_travel_min_deg", "axis.pos_min_deg")
def over_travel_below_lowest(m: Machine) -> Broken:
    """The over-travel trip does not lie inside travel, at its lower end."""
    return at_most(m.axis.over_travel_min_deg, m.axis.pos_min_deg, "the trip would lie inside travel")


@linear_rule("axis.over_travel_max_deg", "axis.pos_max_deg")
def over_travel_above_highest(m: Machine) -> Broken:
    """The over-travel trip does not lie inside travel, at its upper end."""
    return at_least(m.axis.over_travel_max_deg, m.axis.pos_max_deg, "the trip would lie inside travel")


@linear_rule("axis.over_travel_min_deg", "axis.limit_switch_min_deg")
def over_travel_before_lower_switch(m: Machine) -> Broken:
    """The over-travel trip acts before the lower limit switch."""
    return above(m.axis.over_travel_min_deg, m.axis.limit_switch_min_deg, "the switch would act first")


@linear_rule("axis.over_travel_max_deg", "axis.limit_switch_max_deg")
def over_travel_before_upper_switch(m: Machine) -> Broken:
    """The over-travel trip acts before the upper limit switch."""
    return below(m.axis.over_travel_max_deg, m.axis.limit_switch_max_deg, "the switch would act first")


@linear_rule("axis.limit_switch_min_deg", "axis.mechanical_stop_min_deg")
def lower_switch_before_stop(m: Machine) -> Broken:
    """The lower limit switch stands before the lower mechanical stop."""
    why = "the switch must act before the stop"
    return above(m.axis.limit_switch_min_deg, m.axis.mechanical_stop_min_deg, why)


@linear_rule("axis.limit_switch_max_deg", "axis.mechanical_stop_max_deg")
def upper_switch_before_stop(m: Machine) -> Broken:
    """The upper limit switch stands before the upper mechanical stop."""
    why = "the switch must act before the stop"
    return below(m.axis.limit_switch_max_deg, m.axis.mechanical_stop_max_deg, why)


@linear_rule("axis.mechanical_stop_min_deg", "axis.limit_switch_min_deg", "required.stopping_angle_deg")
def stop_fits_behind_lower_switch(m: Machine) -> Broken:
    """The permitted stopping angle fits between the lower limit switch and its mechanical stop."""
    most = m.axis.limit_switch_min_deg - m.required.stopping_angle_deg
    return at_most(m.axis.mechanical_stop_min_deg, most, "limit switch less permitted stopping angle")


@linear_rule("axis.mechanical_stop_max_deg", "axis.limit_switch_max_deg", "required.stopping_angle_deg")
def stop_fits_behind_upper_switch(m: Machine) -> Broken:
    """The permitted stopping angle fits between the upper limit switch and its mechanical stop."""
    need = m.axis.limit_switch_max_deg + m.required.stopping_angle_deg
    return at_least(m.axis.mechanical_stop_max_deg, need, "limit switch plus permitted stopping angle")


@rule("axis.display", "axis.kind", "axis.pos_min_deg", "axis.pos_max_deg")
def display_is_unambiguous(m: Machine) -> Broken:
    """With display = "0..360" travel is at most one turn, and the turn of a modulo axis is 0 to 360 deg."""
    axis = m.axis
    if axis.display != "0..360":
        return None
    if axis.modulo and axis.pos_min_deg != 0.0:
        return f"the turn of the axis begins at {axis.pos_min_deg:g} deg: must be 0 and 360 deg, or the other display"
    travel = axis.pos_max_deg - axis.pos_min_deg
    return (
        None
        if travel <= 360.0
        else f"travel is {travel:g} deg: must be at most 360 deg, or an angle is read twice"
    )


@rule("axis.no_go_deg", "axis.kind", "axis.pos_min_deg", "axis.pos_max_deg")
def sectors_within_travel(m: Machine) -> Broken:
    """A no-go sector goes from a lower to a higher angle inside travel; that of a modulo axis may begin anywhere."""
    axis = m.axis
    for begin, end in axis.no_go_deg:
        if axis.modulo:
            if not ((end - begin) % 360.0 > 0.0 and abs(begin) <= 360.0 and abs(end) <= 360.0):
                return f"[{begin:g}, {end:g}] must be two different angles of a turn"
        elif not axis.pos_min_deg < begin < end < axis.pos_max_deg:
            return f"[{begin:g}, {end:g}] must go from a lower to a higher angle inside travel; or shorten travel"
    return None


@rule("axis.no_go_deg", "axis.kind", "axis.pos_min_deg", "axis.pos_max_deg")
def sectors_leave_stretches(m: Machine) -> Broken:
    """No-go sectors do not overlap, and leave 1 deg or more between each other and the ends of travel."""
    axis = m.axis
    sectors = sorted(axis.sectors_deg)
    if not sectors:
        return None
    if axis.modulo:
        edges = [*(edge for sector in sectors for edge in sector), sectors[0][0] + 360.0]
        gaps = [edges[k + 1] - edges[k] for k in range(1, len(edges) - 1, 2)]
    else:
        edges = [axis.pos_min_deg, *(edge for sector in sectors for edge in sector), axis.pos_max_deg]
        gaps = [edges[k + 1] - edges[k] for k in range(0, len(edges), 2)]
    least = min(gaps)
    if least >= 1.0:
        return None
    return f"leaves {least:g} deg between two of them or to an end of travel, must be at least 1 deg"


# --- speed chain --------------------------------------------------------------------------------------------
@rule("speed.setting_min_deg_s", "speed.setting_max_deg_s")
def settings_in_order(m: Machine) -> Broken:
    """The lowest speed setting is below the highest."""
    return below(m.speed.setting_min_deg_s, m.speed.setting_max_deg_s, "the highest setting")


@rule("speed.creep_deg_s", "speed.setting_max_deg_s")
def creep_is_slow(m: Machine) -> Broken:
    """Service creep is at most a fifth of the highest setting."""
    most = m.speed.setting_max_deg_s / 5.0
    return at_most(m.speed.creep_deg_s, most, "a fifth of the highest setting, or it is no creep")


@rule("speed.command_clamp_deg_s", "speed.setting_max_deg_s")
def correction_reserve(m: Machine) -> Broken:
    """The command clamp leaves the position loop a reserve of at least 5 % above the highest setting."""
    need = 1.05 * m.speed.setting_max_deg_s
    return at_least(m.speed.command_clamp_deg_s, need, "1.05 x the highest setting, the correction reserve")


@rule("speed.command_clamp_deg_s", "speed.drive_ceiling_deg_s")
def clamp_below_ceiling(m: Machine) -> Broken:
    """The drive's ceiling is not below the command clamp."""
    ceiling = m.speed.drive_ceiling_deg_s
    return at_most(m.speed.command_clamp_deg_s, ceiling, "the drive would cut the command")


@rule("speed.drive_ceiling_deg_s", "speed.overspeed_trip_deg_s")
def ceiling_below_trip(m: Machine) -> Broken:
    """The overspeed trip is above the drive's ceiling."""
    return below(m.speed.drive_ceiling_deg_s, m.speed.overspeed_trip_deg_s, "or a permitted speed would trip")


@rule("speed.drive_ceiling_deg_s", *RATIO, "motor.speed_max_r_min")
def motor_reaches_ceiling(m: Machine) -> Broken:
    """The motor may turn as fast as the drive's ceiling asks."""
    most = m.motor.speed_max_r_min * DEG_S_PER_R_MIN / m.axis.ratio
    return at_most(m.speed.drive_ceiling_deg_s, most, "highest motor speed divided by the ratio")


@rule("speed.overspeed_trip_deg_s", *RATIO, "motor.speed_max_r_min")
def motor_survives_overspeed(m: Machine) -> Broken:
    """The overspeed trip acts before the motor's highest permitted speed."""
    most = m.motor.speed_max_r_min * DEG_S_PER_R_MIN / m.axis.ratio
    return at_most(m.speed.overspeed_trip_deg_s, most, "highest motor speed divided by the ratio")


# --- decelerations ------------------------------------------------------------------------------------------
@rule("virtual_axis.jog_release_dec_deg_s2", "virtual_axis.dec_deg_s2")
def jog_release_not_softer(m: Machine) -> Broken:
    """The jog-release ramp is at least as steep as the normal deceleration."""
    v = m.virtual_axis
    return at_least(v.jog_release_dec_deg_s2, v.dec_deg_s2, "not softer than a normal stop")


@rule("virtual_axis.quick_dec_deg_s2", "virtual_axis.jog_release_dec_deg_s2")
def quick_not_softer(m: Machine) -> Broken:
    """The quick stop is at least as steep as the jog-release ramp."""
    v = m.virtual_axis
    return at_least(v.quick_dec_deg_s2, v.jog_release_dec_deg_s2, "not softer than letting a jog key go")


@rule("virtual_axis.quick_dec_deg_s2", "virtual_axis.acc_deg_s2")
def quick_not_below_acceleration(m: Machine) -> Broken:
    """The quick stop is at least as steep as the acceleration."""
    v = m.virtual_axis
    return at_least(v.quick_dec_deg_s2, v.acc_deg_s2, "the axis must stop faster than it starts")


@rule("virtual_axis.quick_dec_deg_s2", "speed.setting_max_deg_s", "required.stopping_angle_deg")
def quick_stop_fits_angle(m: Machine) -> Broken:
    """A rigid quick stop from the highest setting, without reaction, fits the permitted stopping angle."""
    need = m.speed.setting_max_deg_s**2 / (2.0 * m.required.stopping_angle_deg)
    return at_least(m.virtual_axis.quick_dec_deg_s2, need, "to stop within the permitted stopping angle")


@rule("virtual_axis.jog_release_jerk_deg_s3", "virtual_axis.jog_release_dec_deg_s2")
def jog_release_is_prompt(m: Machine) -> Broken:
    """The jog-release ramp reaches its deceleration within 1 s."""
    v = m.virtual_axis
    return at_least(v.jog_release_jerk_deg_s3, v.jog_release_dec_deg_s2, "the deceleration within 1 s")


@rule(
    "virtual_axis.jerk_deg_s3", "virtual_axis.acc_deg_s2", "virtual_axis.dec_deg_s2", "virtual_axis.profile"
)
def jerk_reaches_acceleration(m: Machine) -> Broken:
    """With profile = "jerk_limited" the jerk reaches acceleration and deceleration within 10 s."""
    v = m.virtual_axis
    if v.profile != "jerk_limited":
        return None
    need = max(v.acc_deg_s2, v.dec_deg_s2) / 10.0
    return at_least(v.jerk_deg_s3, need, "to reach the acceleration within 10 s")


@rule("virtual_axis.gentle_end", "virtual_axis.profile")
def gentle_end_without_steps(m: Machine) -> Broken:
    """A gentle end needs a jerk-limited profile."""
    wrong = m.virtual_axis.gentle_end and m.virtual_axis.profile == "trapezoid"
    return (
        'must go with [virtual_axis] profile = "jerk_limited": a trapezoid ends with a step'
        if wrong
        else None
    )


@rule("virtual_axis.end_jerk_deg_s3", "virtual_axis.end_dec_deg_s2", "virtual_axis.gentle_end")
def gentle_end_is_over_in_time(m: Machine) -> Broken:
    """A gentle end is over within 10 s."""
    v = m.virtual_axis
    if not v.gentle_end:
        return None
    return at_least(v.end_jerk_deg_s3, v.end_dec_deg_s2 / 10.0, "the end of a move within 10 s")
