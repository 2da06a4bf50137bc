"""Axes that are no gantry, from 0.01 to 1e8 kg m2: whole machines, each with numbers of its own size.

Example numbers, not of a maker: what a rigid sizing gives, locked frequencies of 1.5 to 60 Hz, friction of a tenth of
the motor's rated torque.
"""

from __future__ import annotations

from gantryctl.machine import Machine, default_machine, with_values

T, F, M = "plant.transmission.", "plant.roller_friction.", "plant.motor_friction."
PLAIN: dict[str, object] = {
    "machine.description": "", "required.source": "", "plant.motor.torque_ripple_order": 12,
    "plant.gear_error.ring_um": (10.0, 5.0), "plant.gear_error.pinion_teeth": 20,
    "plant.gear_error.pinion_1x_um": 5.0, "plant.gear_error.mesh_um": 2.0, T + "backlash_mm": 0.01,
}  # fmt: skip


def _plant(
    ring_m: float,
    stiffness: tuple[float, float, float, float],
    ends: tuple[float, float],
    hysteresis_nm: float,
) -> dict[str, object]:
    return {
        "plant.gear_error.ring_radius_m": ring_m,
        T + "reducer_stiffness_1_nm_per_rad": stiffness[0],
        T + "reducer_stiffness_2_nm_per_rad": stiffness[1],
        T + "reducer_stiffness_3_nm_per_rad": stiffness[2],
        T + "rest_stiffness_nm_per_rad": stiffness[3],
        T + "reducer_torque_1_nm": ends[0],
        T + "reducer_torque_2_nm": ends[1],
        T + "hysteresis_torque_nm": hysteresis_nm,
    }


def _friction(rollers_nm: float, viscous: float, motor_nm: float, motor_viscous: float) -> dict[str, object]:
    return {
        F + "coulomb_nm": rollers_nm, F + "breakaway_nm": 1.2 * rollers_nm, F + "viscous_nm_s_per_rad": viscous,
        M + "coulomb_nm": motor_nm, M + "breakaway_nm": 1.2 * motor_nm, M + "viscous_nm_s_per_rad": motor_viscous,
    }  # fmt: skip


def _speeds(top_deg_s: float, acc: float, quick: float) -> dict[str, object]:
    return {
        "speed.setting_min_deg_s": top_deg_s / 10.0, "speed.setting_max_deg_s": top_deg_s,
        "speed.creep_deg_s": top_deg_s / 60.0, "speed.command_clamp_deg_s": 1.05 * top_deg_s,
        "speed.drive_ceiling_deg_s": 1.08 * top_deg_s, "speed.overspeed_trip_deg_s": 1.1 * top_deg_s,
        "virtual_axis.acc_deg_s2": acc, "virtual_axis.dec_deg_s2": acc,
        "virtual_axis.jog_release_dec_deg_s2": 0.5 * (acc + quick),
        "virtual_axis.jog_release_jerk_deg_s3": 10.0 * quick, "virtual_axis.quick_dec_deg_s2": quick,
        "monitors.velocity_deviation_deg_s": top_deg_s / 12.0,
    }  # fmt: skip


def _travel(low: float, high: float, room: tuple[float, float, float] = (0.5, 2.0, 7.0)) -> dict[str, object]:
    ends = {"over_travel": room[0], "limit_switch": room[1], "mechanical_stop": room[2]}
    return (
        {"axis.pos_min_deg": low, "axis.pos_max_deg": high}
        | {f"axis.{key}_min_deg": low - by for key, by in ends.items()}
        | {f"axis.{key}_max_deg": high + by for key, by in ends.items()}
    )


def table() -> Machine:
    """Rotary table of 50 kg m2 at 10 to 200 deg: 0 deg lies outside its travel."""
    return with_values(
        default_machine(),
        PLAIN | _travel(10.0, 200.0) | _speeds(12.0, 12.0, 40.0) | _friction(5.0, 10.0, 0.05, 1e-4)
        | _plant(0.25, (1.5e5, 2.0e5, 2.5e5, 2.0e6), (5.0, 25.0), 4.0)
        | {
            "machine.name": "rotary_table", "axis.reducer_ratio": 50.0, "axis.ring_ratio": 3.0,
            "motor.power_rated_kw": 0.75, "motor.torque_rated_nm": 2.4, "motor.torque_max_nm": 7.2,
            "motor.speed_rated_r_min": 3000.0, "motor.speed_max_r_min": 5000.0, "motor.current_rated_a": 2.5,
            "motor.inertia_kg_m2": 1.5e-4, "plant.motor.wave_generator_inertia_kg_m2": 1e-4,
            "plant.motor.torque_ripple_nm": 0.02,
            "reducer.torque_rated_nm": 60.0, "reducer.torque_momentary_nm": 200.0,
            "brake.torque_nm": 3.0, "brake.test_torque_nm": 1.0, "brake.proof_torque_nm": 0.3,
            "brake.close_time_ms": 40.0, "brake.open_time_ms": 30.0,
            "control.kpp_per_s": 20.0, "drive.speed_loop.kvp_nm_s_per_rad": 0.08,
            "plant.load.inertia_kg_m2": 50.0, "plant.load.mass_kg": 300.0, "plant.load.eccentricity_m": 0.002,
            "plant.load.eccentric_check_moment_nm": 20.0,
            "plant.base.inertia_kg_m2": 2000.0, "plant.base.frequency_hz": 30.0, T + "hysteresis_length_rad": 1e-4,
            "accuracy.chord_radius_m": 0.3,
        },
    )  # fmt: skip


def tilt() -> Machine:
    """Tilt axis at -5 to 95 deg, 2000 kg m2, with its weight on one side."""
    return with_values(
        default_machine(),
        PLAIN | _travel(-5.0, 95.0) | _speeds(3.0, 1.5, 6.0) | _friction(60.0, 200.0, 0.2, 5e-4)
        | _plant(0.6, (3e5, 4e5, 5e5, 1e7), (40.0, 160.0), 40.0)
        | {
            "machine.name": "tilt_table", "axis.reducer_ratio": 80.0, "axis.ring_ratio": 5.0,
            "motor.power_rated_kw": 1.5, "motor.torque_rated_nm": 7.16, "motor.torque_max_nm": 20.0,
            "motor.speed_rated_r_min": 2000.0, "motor.speed_max_r_min": 4000.0, "motor.current_rated_a": 4.0,
            "motor.inertia_kg_m2": 1.2e-3, "plant.motor.wave_generator_inertia_kg_m2": 1e-3,
            "plant.motor.torque_ripple_nm": 0.06,
            "reducer.torque_rated_nm": 400.0, "reducer.torque_momentary_nm": 2000.0,
            "brake.torque_nm": 12.0, "brake.test_torque_nm": 6.0, "brake.proof_torque_nm": 1.0,
            "drive.speed_loop.kvp_nm_s_per_rad": 0.7,
            "plant.load.inertia_kg_m2": 2000.0, "plant.load.mass_kg": 1500.0, "plant.load.eccentricity_m": 0.05,
            "plant.load.eccentric_check_moment_nm": 1500.0,
            "plant.base.inertia_kg_m2": 5000.0, "plant.base.frequency_hz": 20.0,
            "accuracy.chord_radius_m": 0.8,
        },
    )  # fmt: skip


def dish() -> Machine:
    """Dish of 40 m, 1e8 kg m2, +-270 deg, with wind of 400 kN m."""
    return with_values(
        default_machine(),
        PLAIN | _travel(-270.0, 270.0, (0.5, 2.0, 15.0)) | _speeds(2.0, 0.1, 0.4)
        | _friction(3e4, 1e5, 3.0, 0.01) | _plant(8.0, (8e6, 1e7, 1.2e7, 2e10), (1e4, 4e4), 1e4)
        | {
            "machine.name": "dish", "axis.reducer_ratio": 200.0, "axis.ring_ratio": 40.0,
            "required.stopping_angle_deg": 12.0,
            "motor.power_rated_kw": 30.0, "motor.torque_rated_nm": 95.5, "motor.torque_max_nm": 200.0,
            "motor.speed_rated_r_min": 3000.0, "motor.speed_max_r_min": 4000.0, "motor.inertia_kg_m2": 0.05,
            "plant.motor.wave_generator_inertia_kg_m2": 0.05,
            "reducer.torque_rated_nm": 4e4, "reducer.torque_momentary_nm": 1.2e5,
            "encoder.turns": 65536, "plant.encoder.mounting_turns": 32768,
            "brake.torque_nm": 100.0, "brake.test_torque_nm": 70.0, "brake.proof_torque_nm": 10.0,
            "brake.close_time_ms": 100.0,
            "control.kpp_per_s": 2.0, "drive.speed_loop.kvp_nm_s_per_rad": 33.0,
            "plant.load.inertia_kg_m2": 1e8, "plant.load.mass_kg": 8e5, "plant.load.eccentricity_m": 0.0,
            "plant.load.eccentric_check_moment_nm": 4e5,
            "plant.base.inertia_kg_m2": 1e7, "accuracy.chord_radius_m": 20.0,
        },
    )  # fmt: skip


def stage() -> Machine:
    """Rotary stage of 0.3 m, 0.01 kg m2, 90 deg/s."""
    return with_values(
        default_machine(),
        PLAIN | _travel(-100.0, 100.0, (0.5, 2.0, 25.0)) | _speeds(90.0, 360.0, 900.0)
        | _friction(0.02, 0.01, 0.002, 1e-6) | _plant(0.05, (80.0, 100.0, 120.0, 4000.0), (0.2, 1.0), 0.02)
        | {
            "machine.name": "rotary_stage", "axis.reducer_ratio": 20.0, "axis.ring_ratio": 5.0,
            "required.stopping_angle_deg": 20.0,
            "motor.power_rated_kw": 0.03, "motor.torque_rated_nm": 0.0955, "motor.torque_max_nm": 0.12,
            "motor.speed_rated_r_min": 3000.0, "motor.speed_max_r_min": 5000.0, "motor.current_rated_a": 1.8,
            "motor.inertia_kg_m2": 2e-6, "plant.motor.wave_generator_inertia_kg_m2": 1e-6,
            "plant.motor.torque_ripple_nm": 0.001,
            "reducer.torque_rated_nm": 1.0, "reducer.torque_momentary_nm": 3.0,
            "brake.torque_nm": 0.1, "brake.test_torque_nm": 0.05, "brake.proof_torque_nm": 0.02,
            "brake.close_time_ms": 20.0, "brake.open_time_ms": 20.0, "monitors.lease_ms": 200.0,
            "monitors.brake_feedback_time_ms": 100.0, "monitors.torque_saturation_time_ms": 100.0,
            "plant.brake.presliding_rad": 0.005, T + "hysteresis_length_rad": 2e-4,
            "plant.motor_friction.presliding_rad": 0.02,
            "plant.roller_friction.presliding_rad": 2e-4,
            "control.kpp_per_s": 20.0, "monitors.following_error_base_deg": 0.04,
            "drive.speed_loop.kvp_nm_s_per_rad": 1e-3,
            "plant.load.inertia_kg_m2": 0.01, "plant.load.mass_kg": 0.9, "plant.load.eccentricity_m": 0.001,
            "plant.load.eccentric_check_moment_nm": 0.05,
            "plant.base.inertia_kg_m2": 1.0, "plant.base.frequency_hz": 60.0, "accuracy.chord_radius_m": 0.15,
        },
    )  # fmt: skip
