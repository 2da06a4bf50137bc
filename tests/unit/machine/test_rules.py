"""Every rule between keys fires, and its one line names every key it is about."""

import pytest

from gantryctl.errors import ConfigError
from gantryctl.machine import RULES, Machine, default_machine, field_specs, with_values
from gantryctl.machine.tables.fields import Table

MACHINE = default_machine()
TRANSMISSION = "plant.transmission."
COMPENSATION = "control.compensation."

# By rule: changes that break it.
CAN = {"drive.kind": "canopen", "control.scan_period_ms": 4.0}
BREAKS = {
    "bases_within_travel": {"accuracy.bases_deg": (90.0, 180.0)},
    "displacements_ascend": {"accuracy.displacements_deg": (5.0, 15.0, 10.0)},
    "speeds_within_settings": {"accuracy.speeds_deg_s": (0.6, 6.1)},
    "modulo_has_one_turn": {"axis.kind": "modulo", "axis.pos_max_deg": 170.0},
    "modulo_has_no_ends": {"axis.kind": "modulo"},
    "gear_is_the_ratio": {"axis.gear_motor_turns": 1145},
    "gear_of_modulo_is_exact": {"axis.kind": "modulo", "axis.ring_ratio": 13.00012},
    "encoder_covers_wrap_margin": {"axis.kind": "modulo", "encoder.turns": 16},
    "encoder_outruns_scan": {"encoder.turns": 1, "control.scan_period_ms": 10.0},
    "travel_is_not_empty": {"axis.pos_min_deg": 0.0, "axis.pos_max_deg": 0.5},
    "over_travel_below_lowest": {"axis.pos_min_deg": -181.0},
    "over_travel_above_highest": {"axis.pos_max_deg": 181.0},
    "single_teeth_can_be_drawn": {"plant.switches.tooth_pitch": True, "plant.gear_error.pinion_teeth": 80},
    "warm_motor_has_torque": {
        "plant.switches.thermal": True,
        "plant.thermal.motor_end_k": 100.0,
        "plant.thermal.torque_constant_per_k": -0.006,
    },
    "motor_breaks_away_after_rest": {"plant.switches.ageing": True, "plant.ageing.motor_nm": 360.0},
    "cogging_is_credible": {"plant.switches.cogging": True, "plant.motor.cogging_torque_nm": 52.0},
    "encoder_reading_grows": {
        "plant.switches.encoder_errors": True,
        "plant.encoder.interpolation_2x_rad": 1.3e-4,
    },
    "cables_have_ends": {"axis.kind": "modulo", "plant.switches.cable": True},
    "step_follows_cables": {
        "plant.switches.cable": True,
        "plant.cable.friction_nm": 1e8,
        "plant.cable.presliding_deg": 1e-4,
        "plant.load.inertia_kg_m2": 5e5,
    },
    "second_pinion_has_gears": {"plant.switches.second_pinion": True, "plant.switches.rigid": True},
    "preload_leaves_torque": {"plant.switches.second_pinion": True, "plant.second_pinion.preload_nm": 129.0},
    "preload_within_reducer": {
        "plant.switches.second_pinion": True,
        "plant.second_pinion.preload_nm": 120.0,
        "reducer.torque_rated_nm": 10000.0,
    },
    "one_drive_on_the_bus": CAN | {"plant.switches.second_pinion": True},
    "step_follows_cogging": {"plant.switches.cogging": True, "plant.motor.cogging_order": 144},
    "check_moment_covers_wind": {"plant.switches.wind": True, "plant.wind.moment_nm": 17000.0},
    "guesses_are_keys": {"machine.guesses": ("axis.pos_min_deg", "axis.pos_min")},
    "over_travel_before_lower_switch": {"axis.over_travel_min_deg": -182.0},
    "over_travel_before_upper_switch": {"axis.over_travel_max_deg": 182.0},
    "stop_fits_behind_lower_switch": {"axis.mechanical_stop_min_deg": -185.9},
    "display_is_unambiguous": {
        "axis.display": "0..360", "axis.pos_max_deg": 180.25, "axis.over_travel_max_deg": 180.75,
    },
    "sectors_within_travel": {"axis.no_go_deg": ((20.0, 10.0),)},
    "sectors_leave_stretches": {"axis.no_go_deg": ((10.0, 20.0), (20.5, 30.0))},
    "lower_switch_before_stop": {"axis.limit_switch_min_deg": -187.0},
    "upper_switch_before_stop": {"axis.limit_switch_max_deg": 187.0},
    "stop_fits_behind_upper_switch": {"axis.mechanical_stop_max_deg": 185.9},
    "settings_in_order": {"speed.setting_min_deg_s": 3.0, "speed.setting_max_deg_s": 3.0},
    "creep_is_slow": {"speed.creep_deg_s": 1.21},
    "correction_reserve": {"speed.command_clamp_deg_s": 6.299},
    "clamp_below_ceiling": {"speed.command_clamp_deg_s": 6.51},
    "ceiling_below_trip": {"speed.overspeed_trip_deg_s": 6.5},
    "motor_reaches_ceiling": {"motor.speed_max_r_min": 1200.0},
    "motor_survives_overspeed": {"motor.speed_max_r_min": 1250.0},
    "jog_release_not_softer": {"virtual_axis.dec_deg_s2": 2.1},
    "quick_not_softer": {"virtual_axis.jog_release_dec_deg_s2": 5.6},
    "quick_not_below_acceleration": {"virtual_axis.acc_deg_s2": 5.6},
    "quick_stop_fits_angle": {"virtual_axis.quick_dec_deg_s2": 4.4},
    "jog_release_is_prompt": {"virtual_axis.jog_release_jerk_deg_s3": 1.9},
    "jerk_reaches_acceleration": {
        "virtual_axis.profile": "jerk_limited", "virtual_axis.jerk_deg_s3": 0.039,
    },
    "torques_in_order": {"motor.torque_max_nm": 256.0},
    "overload_is_credible": {"motor.torque_max_nm": 1600.0},
    "motor_speeds_in_order": {"motor.speed_max_r_min": 1149.0},
    "name_plate_agrees": {"motor.power_rated_kw": 35.0},
    "voltage_is_credible": {"motor.current_rated_a": 20.0},
    "reducer_torques_in_order": {"reducer.torque_momentary_nm": 17500.0},
    "motor_gives_quick_stop": {"virtual_axis.quick_dec_deg_s2": 9.6},
    "motor_gives_acceleration": {"virtual_axis.acc_deg_s2": 10.0},
    "reducer_bears_quick_stop": {"reducer.torque_momentary_nm": 15500.0, "reducer.torque_rated_nm": 15000.0},
    "motor_holds_check_moment": {"plant.load.eccentric_check_moment_nm": 295000.0},
    "counts_are_a_power_of_two": {"encoder.counts_per_turn": 8000},
    "turns_are_a_power_of_two": {"encoder.turns": 4000},
    "encoder_covers_travel": {"encoder.turns": 1024},
    "interpolation_is_finer": {"encoder.lines": 1, "encoder.interpolation": 4096},
    "brake_holds_check_moment": {"brake.torque_nm": 56.0},
    "proof_does_not_slip": {"brake.torque_nm": 60.0, "brake.proof_torque_nm": 60.0},
    "proof_within_rating": {"brake.proof_torque_nm": 258.0},
    "motion_within_rating": {"monitors.running_torque_nm": 258.0},
    "wind_within_rating": {"monitors.wind_torque_nm": 258.0},
    "brake_waits_for_arrival": {
        "brake.hold": "brake", "brake.hold_brake_after_s": 0.9, "monitors.in_position_dwell_ms": 1000.0,
    },
    "scan_is_whole_cycles": {"control.scan_period_ms": 1.1},
    "momentary_torque_is_credible": {"reducer.torque_momentary_nm": 176001.0},
    "motor_holds_speed": {"plant.motor_friction.viscous_nm_s_per_rad": 1.8},
    "ripple_is_credible": {"plant.motor.torque_ripple_nm": 51.5},
    "slopes_within_reducer": {TRANSMISSION + "reducer_torque_2_nm": 35201.0},
    "hysteresis_is_credible": {TRANSMISSION + "hysteresis_torque_nm": 45761.0},
    "hysteresis_length_is_credible": {TRANSMISSION + "hysteresis_length_rad": 4.3e-4},
    "rollers_slide_soon": {"plant.roller_friction.presliding_rad": 4.3e-4},
    "rollers_reach_running_friction": {"plant.roller_friction.stribeck_deg_s": 6.0},
    "roller_breakaway_is_credible": {"plant.roller_friction.breakaway_nm": 30001.0},
    "step_follows_hysteresis": {TRANSMISSION + "hysteresis_length_rad": 1.2e-6},
    "slopes_are_credible": {TRANSMISSION + "reducer_stiffness_3_nm_per_rad": 4.7e7},
    "position_loop_is_sampled_enough": {"control.kpp_per_s": 130.0, "control.scan_period_ms": 4.0},
    "integral_is_sampled_enough": {"drive.speed_loop.tvi_ms": 0.2},
    "acceleration_torque_without_steps": {COMPENSATION + "torque.acceleration": True},
    "windup_without_steps": {COMPENSATION + "windup.active": True},
    "backlash_has_a_limit": {
        COMPENSATION + "backlash_observer.active": True,
        COMPENSATION + "moment_observer.active": True,
        COMPENSATION + "moment_observer.limit_nm": 1e3,
        COMPENSATION + "windup.active": True,
        COMPENSATION + "windup.reversal": True,
        COMPENSATION + "calibration": "m.calibration.toml",
        "virtual_axis.profile": "jerk_limited",
    },
    "backlash_goes_with_its_flank": {
        COMPENSATION + "backlash_observer.active": True,
        COMPENSATION + "backlash_observer.limit_deg": 0.005,
        COMPENSATION + "calibration": "m.calibration.toml",
    },
    "gentle_end_without_steps": {"virtual_axis.gentle_end": True},
    "gentle_end_is_over_in_time": {
        "virtual_axis.profile": "jerk_limited",
        "virtual_axis.gentle_end": True,
        "virtual_axis.end_jerk_deg_s3": 0.019,
    },
    "observer_has_a_limit": {COMPENSATION + "moment_observer.active": True},
    "damping_needs_the_load_encoder": {COMPENSATION + "damping.active": True},
    "own_errors_need_the_load_encoder": {COMPENSATION + "load_encoder.own_errors": True},
    "load_encoder_is_there": {COMPENSATION + "load_encoder.active": True},
    "calibration_is_named": {COMPENSATION + "gear_map.active": True},
    "speed_loop_is_sampled_enough": {
        "motor.inertia_kg_m2": 0.005, "plant.motor.wave_generator_inertia_kg_m2": 0.0,
    },
    "brake_test_covers_check_moment": {"brake.test_torque_nm": 56.8},
    "motor_gives_brake_test": {"brake.test_torque_nm": 342.0},
    "brake_test_does_not_slip": {"brake.test_torque_nm": 120.0, "brake.torque_nm": 119.0},
    "standstill_above_resolution": {"monitors.standstill_window_deg": 7e-5},
    "in_position_above_resolution": {"monitors.in_position_window_deg": 7e-5},
    "sag_above_resolution": {"brake.sag_max_deg": 1e-4, "encoder.counts_per_turn": 4096},
    "in_position_inside_following_error": {"monitors.in_position_window_deg": 0.03},
    "following_error_before_over_travel": {"monitors.following_error_base_deg": 0.51},
    "following_error_beyond_accelerations": {
        "control.scan_period_ms": 10.0, "monitors.following_error_base_deg": 0.0019,
        "monitors.in_position_window_deg": 0.001,
    },
    "velocity_deviation_can_act": {"monitors.velocity_deviation_deg_s": 6.0},
    "tolerance_longer_than_dwell": {"monitors.in_position_tolerance_time_s": 0.2},
    "saturation_within_overload": {
        "monitors.torque_saturation_time_ms": 1001.0, "drive.speed_loop.overload_time_s": 1.0,
    },
    "feedback_waits_for_closing": {"brake.close_time_ms": 301.0},
    "feedback_waits_for_opening": {"brake.open_time_ms": 301.0},
    "power_up_waits_for_brake": {"monitors.power_up_time_ms": 101.0},
    "lease_spans_scans": {
        "monitors.lease_ms": 60.0, "control.scan_period_ms": 40.0, "control.kpp_per_s": 1.0,
    },
    "lease_within_stopping_angle": {"monitors.lease_ms": 670.0},
    "scan_within_reaction": {"control.scan_period_ms": 37.5, "control.kpp_per_s": 10.0},
    "deadline_within_reaction": CAN | {"can.rpdo_deadline_ms": 1000.0},
    "heartbeat_before_mechanical_stop": CAN | {"can.heartbeat_timeout_ms": 5000.0},
    "stepped_is_for_virtual_drives": CAN | {"can.stepped": True},
    "following_error_time_within_reaction": {"monitors.following_error_time_ms": 111.0},
    "following_error_widening_within_reaction": {"monitors.following_error_per_speed_s": 0.101},
    "following_error_band_within_reaction": {
        "monitors.following_error_base_deg": 0.46, "monitors.following_error_per_speed_s": 0.03,
    },
    "velocity_deviation_time_within_reaction": {"monitors.velocity_deviation_time_ms": 111.0},
    "velocity_deviation_within_reaction": {"monitors.velocity_deviation_deg_s": 5.9},
    "overspeed_time_within_reaction": {"monitors.overspeed_time_ms": 111.0},
    "saturation_within_stopping_angle": {"monitors.torque_saturation_time_ms": 667.0},
    "brake_feedback_within_stopping_angle": {"monitors.brake_feedback_time_ms": 10000.0},
    "disagreement_time_within_reaction": {COMPENSATION + "load_encoder.disagreement_time_ms": 111.0},
    "disagreement_within_reaction": {COMPENSATION + "load_encoder.disagreement_deg": 0.55},
    "standstill_time_within_reaction": {"monitors.standstill_time_ms": 200.0},
    "standstill_window_within_reaction": {"monitors.standstill_window_deg": 0.2},
    "sag_within_reaction": {"brake.sag_max_deg": 0.5},
    "brake_stop_within_stopping_angle": {"brake.close_time_ms": 240.0},
    "bases_differ": {"accuracy.bases_deg": [0.0, 30.0, 30.0]},
    "nodes_differ": CAN | {"can.node": 127},
    "interface_is_named": CAN | {"can.interface": ""},
    "heartbeat_within_timeout": CAN | {"can.heartbeat_timeout_ms": 99.0},
    "deadline_outlasts_scans": CAN | {"can.rpdo_deadline_ms": 11.0},
    "answers_fit_a_scan": CAN | {"can.answer_ms": 3.0},
    "position_fits_32_bits": CAN | {"can.increments_per_turn": 2**22},
    "limit_in_drive_is_that_of_the_machine": CAN | {"can.torque_limit_in_drive_nm": 386.0},
    "truth_is_for_virtual_drives": CAN | {"can.side_channel": "/run/drive.sock"},
    "node_ids_differ": CAN | {"can.io.node": 2},
    "encoder_node_is_named": CAN | {"can.load_encoder.source": "node"},
    "load_encoder_has_a_source": CAN | {COMPENSATION + "load_encoder.active": True},
    "brake_has_one_output": CAN | {"brake.owner": "controller_output"},
    "io_outputs_have_a_node": CAN | {"can.io.outputs.horn": 1},
    "outputs_leave_the_brake_bit": CAN | {"can.outputs.horn": 0},
    "estop_channels_differ": CAN | {"can.inputs.estop_ok": 20, "can.inputs.estop_ok_2": 20},
    "outputs_share_no_bit": CAN | {"can.outputs.horn": 5, "can.outputs.lamp": 5},
    "watchdog_is_one": CAN | {"can.io.node": 9, "can.io.outputs.drive_enable": 1, "can.outputs.watchdog": 20},
    "watchdog_outlasts_scans": CAN | {"can.watchdog_ms": 15.0},
    "sync_period_fits_60c2": CAN | {"control.scan_period_ms": 2.5},
    "average_within_dwell": {"accuracy.average_s": 6.1},
    "average_spans_scans": {"accuracy.average_s": 0.01, "control.scan_period_ms": 10.0},
    "dwell_longer_than_arrival": {"accuracy.dwell_s": 0.15, "accuracy.average_s": 0.1},
    "load_size_is_credible": {"plant.load.mass_kg": 870.0},
    "check_moment_covers_nominal": {"plant.load.eccentric_check_moment_nm": 15990.0},
    "motor_breaks_away": {
        "plant.motor_friction.breakaway_nm": 300.0, "plant.roller_friction.breakaway_nm": 1e5,
    },
    "first_slope_not_stiffer": {TRANSMISSION + "reducer_stiffness_1_nm_per_rad": 6.5e6},
    "second_slope_not_stiffer": {TRANSMISSION + "reducer_stiffness_2_nm_per_rad": 8.2e6},
    "slopes_in_order": {TRANSMISSION + "reducer_torque_2_nm": 1850.0},
    "roller_breakaway_not_lower": {"plant.roller_friction.breakaway_nm": 5900.0},
    "motor_breakaway_not_lower": {"plant.motor_friction.breakaway_nm": 5.4},
    "ring_has_whole_teeth": {"plant.gear_error.pinion_teeth": 25, "axis.ring_ratio": 13.1},
    "wrap_below_travel": {"plant.encoder.mounting_turns": 587},
    "wrap_above_travel": {"plant.encoder.mounting_turns": 3509},
    "latency_below_scan": {"plant.encoder.latency_us": 1000.0},
    "step_follows_transmission": {
        "motor.inertia_kg_m2": 1e-5, "plant.motor.wave_generator_inertia_kg_m2": 0.0,
        TRANSMISSION + "reducer_stiffness_3_nm_per_rad": 1e8,
    },
    "step_follows_base": {"plant.base.frequency_hz": 200.0, "drive.speed_loop.cycle_us": 1000.0},
    "step_follows_motor_friction": {
        "plant.motor_friction.coulomb_nm": 200.0, "plant.motor_friction.breakaway_nm": 200.0,
        "plant.motor_friction.presliding_rad": 1e-5, "drive.speed_loop.cycle_us": 250.0,
    },
    "step_follows_roller_friction": {
        "plant.roller_friction.coulomb_nm": 2e5, "plant.roller_friction.presliding_rad": 1e-7,
        "plant.load.inertia_kg_m2": 1e4, "plant.roller_friction.breakaway_nm": 2e5,
    },
    "step_follows_brake": {"plant.brake.presliding_rad": 1e-6},
}  # fmt: skip


def problems(changes):
    with pytest.raises(ConfigError) as caught:
        with_values(MACHINE, changes)
    return caught.value.problems


def test_there_are_forty_rules_and_more_each_with_a_test():
    assert len(RULES) >= 40
    assert [rule.name for rule in RULES] == list(dict.fromkeys(rule.name for rule in RULES))
    assert {rule.name for rule in RULES} == set(BREAKS)


def others_in(line):
    """The keys that a line names after "; against", in order."""
    others = line.partition("; against ")[2]
    return [part.partition(" = ")[0] for part in others.replace(", [", "\n[").split("\n") if part]


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.name)
def test_the_rule_fires_and_names_every_key(rule):
    places = [field_specs()[path].place for path in rule.paths]
    lines = [
        line
        for line in problems(BREAKS[rule.name])
        if line.startswith(f"hust_gantry with changes: {places[0]} = ") and places[1:] == others_in(line)
    ]
    assert lines, problems(BREAKS[rule.name])
    assert all("must " in line or "gives " in line for line in lines)
    assert all("\n" not in line for line in lines)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.name)
def test_the_reference_machine_keeps_the_rule(rule):
    assert rule.check(MACHINE) is None
    assert rule.sentence.endswith(".")


class Watched:
    """A table that notes which keys are read."""

    def __init__(self, table, path, seen):
        self._table, self._path, self._seen = table, path, seen

    def __getattr__(self, name):
        kind = type(self._table)
        if name not in kind.model_fields:
            return getattr(kind, name).fget(self)
        value = getattr(self._table, name)
        path = f"{self._path}.{name}" if self._path else name
        if isinstance(value, Table):
            return Watched(value, path, self._seen)
        self._seen.add(path)
        return value


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.name)
def test_the_rule_reads_no_key_that_it_does_not_name(rule):
    # Otherwise it would judge a stand-in for a refused value, and the message would hide one of its reasons.
    switched = MACHINE.model_copy(
        update={
            "brake": MACHINE.brake.model_copy(update={"hold": "brake"}),
            "drive": MACHINE.drive.model_copy(update={"kind": "canopen"}),
            "virtual_axis": MACHINE.virtual_axis.model_copy(update={"profile": "jerk_limited"}),
        }
    )
    seen = set()
    rule.check(Watched(switched, "", seen))
    assert seen <= set(rule.paths)
    assert seen or rule.name == "step_follows_transmission"


@pytest.mark.parametrize(
    "changes",
    [
        {"speed.command_clamp_deg_s": 6.3},  # 6 x 1.05 is 6.300000000000001 in binary
        {"required.stopping_angle_deg": 5.0},
        {"virtual_axis.dec_deg_s2": 2.0},
        {"virtual_axis.quick_dec_deg_s2": 5.05},  # 3.56 deg from 6 deg/s: 72 ms are left
        {"motor.torque_max_nm": 6 * 257.0},
        {"control.scan_period_ms": 0.125},
        {"control.scan_period_ms": 4.0},
        {"drive.speed_loop.cycle_us": 1000.0 / 3.0},
        {"accuracy.average_s": 6.0},
        {"plant.motor.wave_generator_inertia_kg_m2": 0.0, "plant.switches.rigid": True},
        {"plant.load.eccentricity_m": 0.0, "plant.load.eccentric_check_moment_nm": 0.0},
        {"plant.roller_friction.coulomb_nm": 0.0, "plant.motor_friction.coulomb_nm": 0.0},
        {"plant.transmission.backlash_mm": 0.4},
        {"plant.gear_error.scale": 0.0},
        {"control.kvf": 0.0},
        {"brake.hold": "brake"},
        {"drive.kind": "ideal"},
        CAN,
        {"axis.pos_min_deg": 0.0},
    ],
    ids=str,
)
def test_limit_cases_and_usual_variations_are_accepted(changes):
    assert isinstance(with_values(MACHINE, changes), Machine)


def test_the_words_of_a_rule():
    assert problems({"speed.command_clamp_deg_s": 6.2}) == (
        "hust_gantry with changes: [speed] command_clamp_deg_s = 6.2 deg/s: must be at least 6.3 deg/s: "
        "1.05 x the highest setting, the correction reserve; against [speed] setting_max_deg_s = 6.0 deg/s",
    )


# The reference machine on a bus; the limits by hand: 4 deg - 6^2 / (2 x 5.4) deg = 0.6667 deg, at 6 deg/s 111.1 ms.
@pytest.mark.parametrize(
    ("path", "limit"),
    [
        ("can.rpdo_deadline_ms", 111.111 - 4.0),
        # 5 deg from limit switch to mechanical stop, less 3.3333 deg of quick stop, at 6 deg/s.
        ("can.heartbeat_timeout_ms", 277.778),
        ("control.scan_period_ms", 37.037),
        ("monitors.following_error_time_ms", 107.111),
        ("monitors.following_error_per_speed_s", 0.107111 - 0.010),
        # (0.107111 - 0.010 - 0.012) s x 6 deg/s
        ("monitors.following_error_base_deg", 0.510667),
        ("monitors.velocity_deviation_time_ms", 107.111),
        # 385 N m and 50 kN m / 1144 on 2.0278 kg m2 are 211.4 rad/s2 at the motor, 10.59 deg/s2: x 0.087111 s.
        ("monitors.velocity_deviation_deg_s", 0.9224),
        ("monitors.overspeed_time_ms", 107.111),
        ("monitors.torque_saturation_time_ms", 666.667),
        ("monitors.brake_feedback_time_ms", 666.667),
        ("monitors.lease_ms", 666.667),
    ],
)
def test_every_time_and_band_before_a_stop_has_the_limit_computed_by_hand(path, limit):
    spec = field_specs()[path]
    with pytest.raises(ConfigError) as caught:
        with_values(MACHINE, CAN | {path: spec.high})
    start = f"hust_gantry with changes: {spec.place} = "
    told = [
        float(line.partition("must be at most ")[2].partition(":")[0].partition(" ")[0])
        for line in caught.value.problems
        if line.startswith(start) and "must be at most" in line
    ]
    assert any(value == pytest.approx(limit, rel=2e-4) for value in told), caught.value.problems


def test_a_weak_brake_must_close_sooner():
    # 0.36 + 6 t + (6 + 1.08 t)^2 / 2n + ... = 4 deg, n = 400 N m on 2.0278 kg m2 less the check moment.
    slow = "; against [speed] setting_max_deg_s"
    assert any(
        "must be at most 231.8" in line and slow in line for line in problems({"brake.close_time_ms": 240.0})
    )
    assert isinstance(with_values(MACHINE, {"brake.close_time_ms": 231.0}), Machine)
    weak = problems({"brake.torque_nm": 320.0, "brake.close_time_ms": 200.0})
    assert any("[brake] close_time_ms = 200.0 ms: must be at most" in line for line in weak)
