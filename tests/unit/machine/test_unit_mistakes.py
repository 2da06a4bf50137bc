"""A value in the wrong unit: 60, 360, 1000 or 1144 times too large. What goes unnoticed is listed here."""

import math

import pytest

from gantryctl.errors import ConfigError
from gantryctl.machine import default_machine, effective_values, field_specs, with_values

FACTORS = (60.0, 360.0, 1000.0, 1144.0)
MACHINE = default_machine()
VALUES = effective_values(MACHINE)

KEY_FIELDS = [
    "axis.pos_min_deg", "axis.pos_max_deg", "axis.over_travel_min_deg", "axis.over_travel_max_deg",
    "axis.limit_switch_min_deg", "axis.limit_switch_max_deg", "axis.mechanical_stop_min_deg",
    "axis.mechanical_stop_max_deg", "required.stopping_angle_deg", "axis.reducer_ratio", "axis.ring_ratio",
    "speed.setting_min_deg_s", "speed.setting_max_deg_s", "speed.creep_deg_s", "speed.command_clamp_deg_s",
    "speed.drive_ceiling_deg_s", "speed.overspeed_trip_deg_s",
    "virtual_axis.acc_deg_s2", "virtual_axis.dec_deg_s2", "virtual_axis.jog_release_dec_deg_s2",
    "virtual_axis.quick_dec_deg_s2", "control.scan_period_ms", "control.kpp_per_s",
    "motor.torque_rated_nm", "motor.torque_max_nm", "motor.speed_rated_r_min", "motor.speed_max_r_min",
    "motor.inertia_kg_m2", "motor.power_rated_kw", "encoder.counts_per_turn", "encoder.turns",
    "brake.torque_nm", "brake.close_time_ms", "monitors.lease_ms", "plant.load.inertia_kg_m2",
    "plant.load.mass_kg", "plant.load.eccentric_check_moment_nm", "reducer.torque_momentary_nm",
]  # fmt: skip

UNNOTICED = {
    # What is true of another axis of any size: 0.01 to 1e8 kg m2.
    "virtual_axis.jerk_deg_s3": list(FACTORS),
    "virtual_axis.jog_release_jerk_deg_s3": list(FACTORS),
    "control.compensation.torque.limit_nm": list(FACTORS),
    "encoder.lines": [60.0, 360.0],
    "drive.speed_loop.tvi_ms": [60.0],
    "plant.motor.torque_ripple_order": [60.0],
    "plant.transmission.rest_stiffness_nm_per_rad": list(FACTORS),
    "plant.roller_friction.stribeck_deg_s": [60.0],
    "plant.roller_friction.viscous_nm_s_per_rad": [60.0],
    "plant.base.inertia_kg_m2": list(FACTORS),
    "plant.cable.moment_1_nm_per_rad": list(FACTORS),
    "plant.cable.friction_nm": list(FACTORS),
    # Held against the motor only where their switch is on: see SEEN_WHEN_ON.
    "plant.motor.cogging_torque_nm": list(FACTORS),
    "plant.ageing.roller_nm": list(FACTORS),
    "plant.ageing.motor_nm": list(FACTORS),
    "plant.second_pinion.preload_nm": list(FACTORS),
    "plant.encoder.interpolation_1x_rad": [60.0],
    "plant.encoder.interpolation_2x_rad": [60.0],
    "plant.encoder.eccentricity_rad": [60.0],  # magnetic encoders have 1 deg
    "plant.ageing.roller_time_s": [60.0],  # grease creeps for seconds to minutes
    "plant.ageing.motor_time_s": [60.0],
    "plant.ageing.roller_length_rad": [60.0],  # true of a small rim
    "plant.structure.nozzle_stiffness_radial_n_per_m": [60.0],  # a stiffer mount of a heavier nozzle
    "plant.structure.nozzle_stiffness_tangential_n_per_m": [60.0],
    "plant.structure.nozzle_tilt_stiffness_nm_per_rad": [60.0],
    # 0 by default, and 0 in every unit.
    "monitors.running_torque_nm": list(FACTORS),  # one that is given is held against the motor
    "monitors.wind_torque_nm": list(FACTORS),  # one that is given is held against the motor
    "control.compensation.moment_observer.limit_nm": list(FACTORS),  # whoever switches it on must give it
    "control.compensation.backlash_observer.limit_deg": list(FACTORS),  # whoever switches it on must give it
    # True of a stiffer load; they matter only where the gentle end is on.
    "virtual_axis.end_dec_deg_s2": list(FACTORS),
    "virtual_axis.end_jerk_deg_s3": list(FACTORS),
    "control.compensation.calibration_watch.moment_nm": list(FACTORS),  # 0: no load comes and goes
    "control.compensation.calibration_watch.backlash_deg": [60.0],  # true of a coarse gear
    "plant.motor.cogging_phase_rad": list(FACTORS),
    "plant.encoder.eccentricity_phase_rad": list(FACTORS),
    "plant.thermal.gears_start_k": list(FACTORS),  # the temperature of alignment
    "plant.thermal.gears_end_k": list(FACTORS),
    "plant.thermal.motor_start_k": list(FACTORS),
    "plant.thermal.motor_end_k": list(FACTORS),
    "plant.thermal.support_share": list(FACTORS),
    "plant.cable.moment_nm": list(FACTORS),
    "plant.cable.moment_2_nm_per_rad2": list(FACTORS),
    "plant.cable.moment_3_nm_per_rad3": list(FACTORS),
    "control.compensation.gear_map.cycles_per_turn": list(FACTORS),  # empty: none is known
    # Seeds have no unit.
    "plant.tooth_pitch.seed": list(FACTORS),
    "plant.structure.track_seed": list(FACTORS),
    "plant.load.eccentric_angle_deg": list(FACTORS),  # 0 deg stays 0 deg in every unit
    "control.compensation.latency_us": list(FACTORS),
    "axis.gear_motor_turns": list(FACTORS),  # 0: by the ratios
    "axis.gear_axis_turns": list(FACTORS),
    "plant.wind.moment_nm": list(FACTORS),  # 0 N m: calm
    "plant.wind.seed": list(FACTORS),
    "can.inputs.limit_minus": list(FACTORS),  # bit 0
    "can.torque_limit_in_drive_nm": list(FACTORS),  # 0 = none
    # None: derived from travel and speed range.
    "accuracy.bases_deg": list(FACTORS),
    "accuracy.displacements_deg": list(FACTORS),
    "accuracy.speeds_deg_s": list(FACTORS),
    "can.node": [60.0],  # any of 1 to 127
    # Numbers without a unit: a count of stops, and the place of an object.
    "brake.emergency_stops_max": [60.0, 360.0, 1000.0],
    "can.io.node": list(FACTORS),  # 0: there is none
    "can.load_encoder.node": list(FACTORS),
    "can.load_encoder.counts_per_turn": [60.0],
    "can.load_encoder.zero_counts": list(FACTORS),
    "can.encoder.index": list(FACTORS),
    "can.encoder.sub": list(FACTORS),
}


def changed(path, factor):
    value = VALUES[path]
    if isinstance(value, tuple):
        return tuple(item * factor for item in value)
    return round(value * factor) if field_specs()[path].kind == "integer" else value * factor


def is_refused(path, factor, machine=MACHINE):
    try:
        with_values(machine, {path: changed(path, factor)})
    except ConfigError as error:
        return any(path.split(".")[-1] in line for line in error.problems)
    return False


NUMBERS = [path for path, spec in field_specs().items() if spec.kind in ("number", "integer", "numbers")]


def test_key_fields_are_many():
    assert len(KEY_FIELDS) >= 20
    assert not set(UNNOTICED) & set(KEY_FIELDS)


@pytest.mark.parametrize("path", NUMBERS)
def test_values_too_large_by_a_unit_are_refused(path):
    unnoticed = [factor for factor in FACTORS if not is_refused(path, factor)]
    assert unnoticed == UNNOTICED.get(path, [])


SEEN_WHEN_ON = {
    "plant.motor.cogging_torque_nm": ("cogging", []),
    # 60 x: the motor still breaks away.
    "plant.ageing.roller_nm": ("ageing", [60.0]),
    "plant.ageing.motor_nm": ("ageing", [60.0]),
    "plant.encoder.interpolation_1x_rad": ("encoder_errors", []),
    "plant.encoder.interpolation_2x_rad": ("encoder_errors", []),
    "plant.second_pinion.preload_nm": ("second_pinion", []),
}


@pytest.mark.parametrize("path", SEEN_WHEN_ON)
def test_a_wrong_unit_is_refused_where_the_switch_is_on(path):
    switch, unnoticed = SEEN_WHEN_ON[path]
    on = with_values(MACHINE, {f"plant.switches.{switch}": True})
    assert [factor for factor in FACTORS if not is_refused(path, factor, on)] == unnoticed


# --- too small, the other way round: bounds cannot always tell a small machine from a wrong unit ------------

TOO_SMALL_UNNOTICED = {
    "axis.pos_min_deg": [60.0, 360.0, 1000.0, 1144.0],  # a short travel is allowed
    "axis.pos_max_deg": [60.0, 360.0, 1000.0, 1144.0],
    "speed.setting_min_deg_s": list(FACTORS),  # telescopes track with 0.004 deg/s
    "speed.creep_deg_s": list(FACTORS),
    "virtual_axis.acc_deg_s2": list(FACTORS),  # a gentle one is slow, not wrong
    "virtual_axis.dec_deg_s2": list(FACTORS),
    "control.kpp_per_s": [60.0],
    "motor.inertia_kg_m2": [60.0, 360.0, 1000.0, 1144.0],  # small servo motors are that light
    "brake.close_time_ms": [60.0],
    "plant.load.inertia_kg_m2": list(FACTORS),  # a light load on a strong motor
    "plant.load.mass_kg": [60.0],
}


def test_values_too_small_by_a_unit_that_go_unnoticed():
    found = {}
    for path in KEY_FIELDS:
        if field_specs()[path].kind != "integer":
            found[path] = [factor for factor in FACTORS if not is_refused(path, 1.0 / factor)]
    assert {path: missed for path, missed in found.items() if missed} == TOO_SMALL_UNNOTICED


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("speed.setting_max_deg_s", 360.0, "60 x the usual 6: per minute instead of per second?"),
        ("virtual_axis.acc_deg_s2", 450.0, "1144 x the usual 0.393357: a value at the motor"),
        ("axis.pos_max_deg", 180000.0, "1000 x the usual 180: milli-units"),
        ("axis.pos_max_deg", 180.0 * 180.0 / math.pi, "57.3 x the usual 180: degrees instead of radians?"),
        ("motor.inertia_kg_m2", 232.0, "1000 x the usual 0.232"),
    ],
)
def test_the_hint_names_the_mistake(path, value, words):
    with pytest.raises(ConfigError) as caught:
        with_values(MACHINE, {path: value})
    assert any(words in line for line in caught.value.problems)
