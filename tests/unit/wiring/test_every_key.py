"""Each key of the machine file alone: what it changes in program, drive and plant, by a factor written by hand.

A key is changed alone. Exactly the settings of its row change, each to the new value times the factor of the row, or to
what the row's formula says; whatever else changes, or does not, is named. A key without a row fails.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest

from gantryctl import _core
from gantryctl.drives.canopen.settings import (
    EncoderStatus,
    InputBits,
    IoNodeSettings,
    LoadEncoderSettings,
    OutputBits,
)
from gantryctl.drives.profiles import load_profile
from gantryctl.machine import Machine, default_machine, field_specs
from gantryctl.machine.wind import wind_waves
from gantryctl.program.settings import StandstillPolicy
from gantryctl.wiring import compensation
from gantryctl.wiring.canopen import canopen_settings
from gantryctl.wiring.program import axis_settings
from gantryctl.wiring.simulator import drive_params, gantry_sim, plant_params, sim_drive
from gantryctl.wiring.teeth import pinion_deviations_um, ring_deviations_um

DEG = 0.017453292519943295  # rad
MS = 0.001
US = 0.000001
RATIO = 1144.0
TWO_PI = 6.283185307179586

Formula = Callable[[Machine], Any]
Row = Mapping[str, "float | Formula"]

# The reducer's ratio is everywhere where the motor's side is: 88 x 13.


def _least(speed_deg_s: float, angle_deg: float, brake_s: float) -> float:
    """Braking that stops in what is left of an angle behind the brake, rad/s2."""
    return DEG * speed_deg_s**2 / (2.0 * (angle_deg - speed_deg_s * brake_s))


RATIO_ROW: Row = {
    "program.law.ratio": lambda m: m.axis.reducer_ratio * m.axis.ring_ratio,
    "program.monitors.speed_reading_max_rad_s": lambda m: (
        2.0 * m.motor.speed_max_r_min * TWO_PI / 60.0 / (m.axis.reducer_ratio * m.axis.ring_ratio)
    ),
    "program.monitors.speed_change_max_rad_s2": lambda m: (
        785.0 / 0.232 / (m.axis.reducer_ratio * m.axis.ring_ratio)
    ),
    "program.monitors.speed_change_per_torque": lambda m: (
        1.0 / (0.232 * m.axis.reducer_ratio * m.axis.ring_ratio)
    ),
    "drive.vel_max_rad_s": lambda m: 6.5 * DEG * m.axis.reducer_ratio * m.axis.ring_ratio,
    "drive.quick_dec_rad_s2": lambda m: 5.4 * DEG * m.axis.reducer_ratio * m.axis.ring_ratio,
    "bus.quick_dec_rad_s2": lambda m: 5.4 * DEG * m.axis.reducer_ratio * m.axis.ring_ratio,
    "bus.speed_ceiling_rad_s": lambda m: 6.5 * DEG * m.axis.reducer_ratio * m.axis.ring_ratio,
    "plant.ratio": lambda m: m.axis.reducer_ratio * m.axis.ring_ratio,
    "laws.flank_nm": lambda m: 0.0068 * m.motor.torque_rated_nm * m.axis.reducer_ratio * m.axis.ring_ratio,
}


def at_gantry(name: str) -> Formula:
    """Stiffness of the reducer behind the ring, in series with the rest: 1 / (1 / (i2^2 K) + 1 / K_rest)."""

    def stiffness(m: Machine) -> float:
        t = m.plant.transmission
        return 1.0 / (1.0 / (m.axis.ring_ratio**2 * getattr(t, name)) + 1.0 / t.rest_stiffness_nm_per_rad)

    return stiffness


K1, K2, K3 = (at_gantry(f"reducer_stiffness_{n}_nm_per_rad") for n in (1, 2, 3))


def damping(m: Machine) -> float:
    return 2.0 * m.plant.transmission.damping_ratio * math.sqrt(K1(m) * m.plant.load.inertia_kg_m2)


def inertia_motor(m: Machine) -> float:
    return m.motor.inertia_kg_m2 + m.plant.motor.wave_generator_inertia_kg_m2


def eccentric(m: Machine) -> float:
    load = m.plant.load
    return (
        load.eccentric_sign * load.mass_kg * 9.81 * load.eccentricity_m
        if m.plant.switches.eccentric_moment
        else 0.0
    )


def half_backlash(m: Machine) -> float:
    on = m.plant.switches.backlash
    return 0.5 * m.plant.transmission.backlash_mm * 1e-3 / m.plant.gear_error.ring_radius_m if on else 0.0


def per_um(m: Machine) -> float:
    return m.plant.gear_error.scale * 1e-6 / m.plant.gear_error.ring_radius_m


def ring(m: Machine) -> list[float]:
    return [um * per_um(m) for um in m.plant.gear_error.ring_um] + [0.0] * (
        12 - len(m.plant.gear_error.ring_um)
    )


def ring_count(m: Machine) -> int:
    return round(m.plant.gear_error.pinion_teeth * m.axis.ring_ratio)


def ring_pitch(m: Machine) -> list[float]:
    """The drawn teeth in um over the pitch radius."""
    g, t = m.plant.gear_error, m.plant.tooth_pitch
    module_mm = 2e3 * g.ring_radius_m / ring_count(m)
    drawn = ring_deviations_um(ring_count(m), module_mm, t.ring_grade, t.seed)
    return [um * t.scale * 1e-6 / g.ring_radius_m for um in drawn]


def pinion_pitch(m: Machine) -> list[float]:
    g, t = m.plant.gear_error, m.plant.tooth_pitch
    module_mm = 2e3 * g.ring_radius_m / ring_count(m)
    drawn = pinion_deviations_um(g.pinion_teeth, module_mm, t.pinion_grade, t.seed)
    return [um * t.scale * 1e-6 / g.ring_radius_m for um in drawn]


def other_pinion_pitch(m: Machine) -> list[float]:
    """Teeth of another pinion of the same grade, drawn by a seed that no machine file can give."""
    g, t = m.plant.gear_error, m.plant.tooth_pitch
    module_mm = 2e3 * g.ring_radius_m / ring_count(m)
    drawn = pinion_deviations_um(g.pinion_teeth, module_mm, t.pinion_grade, t.seed + 2**31)
    return [um * t.scale * 1e-6 / g.ring_radius_m for um in drawn]


TEETH: Row = {"plant.ring_pitch_rad": ring_pitch, "plant.pinion_pitch_rad": pinion_pitch}


def backlash_growth(m: Machine) -> float:
    """Per kelvin: (R + r) alpha less that of the support, twice its tangent, half of it over R."""
    t = m.plant.thermal
    away = t.expansion_per_k * (1.0 - t.support_share) * (1.0 + 1.0 / m.axis.ring_ratio)
    return -math.tan(t.pressure_angle_deg * DEG) * away


def gusts(m: Machine) -> list[float]:
    return list(wind_waves(m.plant.wind).amplitude_nm)


def pinion(m: Machine) -> float:
    g = m.plant.gear_error
    return g.scale * g.output_1x_rad / m.axis.ring_ratio + g.pinion_1x_um * per_um(m)


def mesh(m: Machine) -> float:
    return m.plant.gear_error.mesh_um * per_um(m)


def reducer(name: str) -> Formula:
    return lambda m: m.plant.gear_error.scale * getattr(m.plant.gear_error, name) / m.axis.ring_ratio


REDUCER = {f"plant.error_{n}_rad": reducer(f"{n}_rad") for n in ("reducer_2x", "reducer_1x", "reducer_4x")}


def base_stiffness(m: Machine) -> float:
    return m.plant.base.inertia_kg_m2 * (TWO_PI * m.plant.base.frequency_hz) ** 2


def base_damping(m: Machine) -> float:
    b = m.plant.base
    return 2.0 * b.damping_ratio * TWO_PI * b.frequency_hz * b.inertia_kg_m2


def brake_torque(m: Machine) -> float:
    return m.brake.torque_nm * m.plant.brake.torque_share


def speed_change(m: Machine) -> float:
    return (m.motor.torque_max_nm + m.brake.torque_nm) / (m.motor.inertia_kg_m2 * RATIO)


def quantum(m: Machine) -> float:
    return TWO_PI / (m.encoder.lines * m.encoder.interpolation)


def bit(m: Machine, name: str) -> int | None:
    return in_use(getattr(m.can.inputs, name))


def in_use(number: int) -> int | None:
    return None if number < 0 else number


def falls_s(machine: Machine) -> float:
    """Three quarters of the 100 ms of a watchdog relay, where an output works one."""
    return 0.075 if machine.can.outputs.watchdog >= 0 or machine.can.io.outputs.watchdog >= 0 else math.inf


ROWS: dict[str, Row] = {
    # --- axis and speed
    "axis.pos_min_deg": {"program.travel.pos_min_rad": DEG},
    "axis.pos_max_deg": {"program.travel.pos_max_rad": DEG},
    "axis.over_travel_min_deg": {"program.travel.over_travel_min_rad": DEG},
    "axis.over_travel_max_deg": {"program.travel.over_travel_max_rad": DEG},
    "axis.limit_switch_min_deg": {"sim.limit_switch_min_rad": DEG},
    "axis.limit_switch_max_deg": {"sim.limit_switch_max_rad": DEG},
    "axis.reducer_ratio": RATIO_ROW | {"plant.reducer_ratio": 1.0},
    "axis.ring_ratio": RATIO_ROW
    | REDUCER
    | {
        "plant.stiffness_1_nm_per_rad": K1,
        "plant.stiffness_2_nm_per_rad": K2,
        "plant.stiffness_3_nm_per_rad": K3,
        "plant.damping_nm_s_per_rad": damping,
        "plant.torque_1_nm": 1850.0,
        "plant.torque_2_nm": 6680.0,
        "plant.error_pinion_rad": pinion,
        "plant.ring_teeth": ring_count,
        "plant.half_backlash_rad_per_k": backlash_growth,
    }
    | TEETH,
    "speed.setting_min_deg_s": {
        "program.speed.setting_min_rad_s": DEG,
        "laws.observer_speed_rad_s": 0.1 * DEG,
    },
    # v^2 / 2 (A - v t)
    "speed.setting_max_deg_s": {
        "program.speed.setting_max_rad_s": DEG,
        "program.power.brake_dec_least_rad_s2": lambda m: _least(m.speed.setting_max_deg_s, 4.0, 0.15),
    },
    "required.stopping_angle_deg": {
        "program.power.brake_dec_least_rad_s2": lambda m: _least(6.0, m.required.stopping_angle_deg, 0.15),
    },
    "speed.creep_deg_s": {"program.speed.creep_rad_s": DEG},
    "speed.command_clamp_deg_s": {"program.speed.command_clamp_rad_s": DEG},
    "speed.drive_ceiling_deg_s": {"drive.vel_max_rad_s": DEG * RATIO, "bus.speed_ceiling_rad_s": DEG * RATIO},
    "speed.overspeed_trip_deg_s": {"program.speed.overspeed_trip_rad_s": DEG},
    # --- ramps and control
    "virtual_axis.profile": {"program.ramps.jerk_rad_s3": lambda m: m.virtual_axis.jerk_deg_s3 * DEG},
    "virtual_axis.acc_deg_s2": {"program.ramps.acc_rad_s2": DEG},
    "virtual_axis.dec_deg_s2": {"program.ramps.dec_rad_s2": DEG},
    "virtual_axis.jerk_deg_s3": {
        "jerk limited.ramps.jerk_rad_s3": DEG,
        "laws.jerk_max_rad_s3": lambda m: 1.01 * m.virtual_axis.jerk_deg_s3 * DEG,
    },
    "virtual_axis.gentle_end": {
        "program.ramps.end_dec_rad_s2": lambda m: m.virtual_axis.end_dec_deg_s2 * DEG,
        "program.ramps.end_jerk_rad_s3": lambda m: m.virtual_axis.end_jerk_deg_s3 * DEG,
    },
    "virtual_axis.end_dec_deg_s2": {"gentle end.ramps.end_dec_rad_s2": DEG},
    "virtual_axis.end_jerk_deg_s3": {"gentle end.ramps.end_jerk_rad_s3": DEG},
    "virtual_axis.jog_release_dec_deg_s2": {"program.ramps.jog_release_dec_rad_s2": DEG},
    "virtual_axis.jog_release_jerk_deg_s3": {"program.ramps.jog_release_jerk_rad_s3": DEG},
    "virtual_axis.quick_dec_deg_s2": {
        "program.ramps.quick_dec_rad_s2": DEG,
        "drive.quick_dec_rad_s2": DEG * RATIO,
        "bus.quick_dec_rad_s2": DEG * RATIO,
    },
    "control.scan_period_ms": {
        "program.period_s": MS,
        "bus.period_s": MS,
        "sim.scan_period_s": MS,
        "laws.period_s": MS,
        "laws.observer_memory": lambda m: math.exp(-m.control.scan_period_ms * MS / 300.0),
        "laws.backlash_memory": lambda m: math.exp(-m.control.scan_period_ms * MS / 100.0),
        "laws.damping_filter": lambda m: 1.0 - math.exp(-m.control.scan_period_ms / 5.0),
        "laws.damping_slow": lambda m: (
            1.0 - math.exp(-m.control.scan_period_ms * MS / m.control.compensation.damping.slow_s)
        ),
    },
    "control.kpp_per_s": {"program.law.kpp_per_s": 1.0},
    "control.kvf": {"program.law.kvf": 1.0},
    # --- compensations
    "control.compensation.latency_us": {"laws.latency_s": US},
    "control.compensation.torque.eccentric": {"laws.torque_eccentric": 1.0},
    "control.compensation.torque.acceleration": {"laws.torque_acceleration": 1.0},
    "control.compensation.torque.limit_nm": {"laws.torque_limit_nm": 1.0},
    "control.compensation.gear_map.active": {"laws.gear_map": 1.0},
    "control.compensation.gear_map.fade_hz": {"laws.fade_rad_s": TWO_PI},
    "control.compensation.gear_map.limit_deg": {"laws.pos_limit_rad": DEG},
    "control.compensation.windup.active": {"laws.windup": 1.0},
    "control.compensation.windup.reversal": {"laws.reversal": 1.0},
    "control.compensation.windup.reversal_length_deg": {"laws.reversal_length_rad": DEG},
    "control.compensation.load_encoder.active": {"laws.load_encoder": 1.0, "second encoder.load_encoder": 1.0},
    "control.compensation.load_encoder.own_errors": {"laws.scale_map": 1.0},
    "control.compensation.load_encoder.integral_per_s": {"laws.encoder_gain_per_s": 1.0},
    "control.compensation.load_encoder.dead_band_deg": {"laws.encoder_dead_band_rad": DEG},
    "control.compensation.load_encoder.limit_deg": {"laws.encoder_limit_rad": DEG},
    "control.compensation.load_encoder.disagreement_deg": {"second encoder.disagreement_rad": DEG},
    "control.compensation.load_encoder.disagreement_time_ms": {"second encoder.disagreement_time_s": MS},
    "control.compensation.moment_observer.active": {
        "laws.moment_observer": 1.0,
        "second encoder.moment_limit_nm": lambda m: m.control.compensation.moment_observer.limit_nm,
    },
    "control.compensation.moment_observer.limit_nm": {"laws.moment_limit_nm": 1.0},
    "control.compensation.moment_observer.memory_s": {
        "laws.observer_memory": lambda m: math.exp(-MS / m.control.compensation.moment_observer.memory_s)
    },
    "control.compensation.backlash_observer.active": {"laws.backlash_observer": 1.0},
    # Eight models of the load, the first without backlash.
    "control.compensation.backlash_observer.limit_deg": {"laws.backlash_step_rad": DEG / 7.0},
    "control.compensation.backlash_observer.memory_s": {
        "laws.backlash_memory": lambda m: math.exp(-MS / m.control.compensation.backlash_observer.memory_s)
    },
    "control.compensation.damping.active": {"laws.damping": 1.0},
    "control.compensation.damping.gain": {"laws.damping_gain": 1.0},
    "control.compensation.damping.filter_ms": {
        "laws.damping_filter": lambda m: 1.0 - math.exp(-1.0 / m.control.compensation.damping.filter_ms)
    },
    "control.compensation.damping.slow_s": {
        "laws.damping_slow": lambda m: 1.0 - math.exp(-MS / m.control.compensation.damping.slow_s)
    },
    # --- motor, encoder, brake
    "motor.torque_rated_nm": {
        "program.power.torque_rated_nm": 1.0,
        "program.thermal.torque_rated_nm": 1.0,
        "program.monitors.torque_still_max_nm": 40.0 / 257.0,
        "drive.torque_rated_nm": 1.0,
        "bus.torque_rated_nm": 1.0,
        "laws.flank_nm": 0.0068 * RATIO,
    },
    "motor.torque_max_nm": {
        "program.power.torque_max_nm": 1.0,
        "program.monitors.speed_change_max_rad_s2": speed_change,
        "drive.torque_max_nm": 1.0,
        "bus.torque_max_nm": 1.0,
    },
    "motor.speed_max_r_min": {"program.monitors.speed_reading_max_rad_s": 2.0 * TWO_PI / 60.0 / RATIO},
    "motor.inertia_kg_m2": {
        "program.monitors.speed_change_per_torque": lambda m: 1.0 / (m.motor.inertia_kg_m2 * RATIO),
        "program.monitors.speed_change_max_rad_s2": speed_change,
        "plant.inertia_motor_kg_m2": inertia_motor,
    },
    "encoder.counts_per_turn": {"coarse.position_count_rad": lambda m: TWO_PI / m.encoder.counts_per_turn},
    "encoder.turns": {"program.law.turns": 1.0, "bus.turns": 1.0, "sim.turns": 1.0},
    "encoder.lines": {
        "drive.encoder_lines": 1.0,
        "drive.speed_count_rad": quantum,
        "drive.position_count_rad": quantum,
        "sim.counts_per_turn": 2048.0,
        "sim.count_offset": 2048.0 * 2048.0,
    },
    "encoder.interpolation": {
        "drive.speed_count_rad": quantum,
        "drive.position_count_rad": quantum,
        "sim.counts_per_turn": 2048.0,
        "sim.count_offset": 2048.0 * 2048.0,
    },
    "encoder.wrap_margin_min_deg": {"program.law.wrap_margin_rad": DEG},
    "brake.owner": {
        "bus.brake_owner": lambda _: "object_60FE",
        "program.power.brake_by_drive": lambda _: False,
        "program.power.unseen_ramp_s": lambda _: 0.0,
        "program.power.untestable": lambda _: None,
    },
    "brake.torque_nm": {
        "program.power.brake_torque_nm": 1.0,
        "program.monitors.speed_change_max_rad_s2": speed_change,
        "program.monitors.twist_least_nm": 0.075 * 2**18 / 2**19,
        "plant.brake_torque_nm": brake_torque,
    },
    "brake.close_time_ms": {
        "program.power.brake_close_time_s": MS,
        "drive.brake_close_s": MS,
        "bus.brake_close_s": MS,
        "program.power.brake_dec_least_rad_s2": lambda m: _least(6.0, 4.0, m.brake.close_time_ms * MS),
    },
    "brake.open_time_ms": {"program.power.brake_open_time_s": MS, "drive.brake_open_s": MS},
    "brake.hold": {"program.power.standstill": lambda _: StandstillPolicy.BRAKE},
    "brake.hold_brake_after_s": {"program.power.hold_brake_after_s": 1.0},
    "brake.proof_torque_nm": {"program.power.proof_torque_nm": 1.0},
    "brake.test_torque_nm": {"program.power.test_torque_nm": 1.0},
    "brake.emergency_stops_max": {"program.power.brake_stops_max": 1.0},
    "brake.sag_max_deg": {"program.power.sag_max_rad": DEG},
    # --- drive and bus
    "drive.speed_loop.cycle_us": {"drive.cycle_s": US},
    "drive.speed_loop.kvp_nm_s_per_rad": {"drive.kvp_nm_s_per_rad": 1.0},
    "drive.speed_loop.tvi_ms": {"drive.tvi_s": MS},
    "drive.speed_loop.delay_cycles": {"drive.delay_cycles": 1.0},
    "drive.speed_loop.feedback": {
        "drive.speed_count_rad": lambda _: TWO_PI / 8192.0,
        "drive.position_count_rad": lambda _: TWO_PI / 8192.0,
        # Two counts in a drive cycle of 125 us, at the gantry.
        "program.speed.rest_rad_s": lambda m: 2.0 * TWO_PI / 8192.0 / 125e-6 / m.axis.ratio,
    },
    "drive.speed_loop.overload_time_s": {"drive.overload_time_s": 1.0},
    "drive.current_loop.bandwidth_hz": {"plant.current_bandwidth_rad_s": TWO_PI},
    "drive.current_loop.ideal": {"plant.current_bandwidth_rad_s": lambda _: 0.0},
    "can.interface": {"bus.answer_s": lambda _: 0.0},
    "can.stepped": {"bus.answer_s": lambda _: 3.0},
    "can.node": {"bus.node": 1.0},
    "can.master_node": {"bus.master_node": 1.0},
    "can.increments_per_turn": {
        "bus.increments_per_turn": 1.0,
        "program.law.counts_per_turn": 1.0,
        "program.monitors.twist_least_nm": lambda m: 30.0 * 2**18 / m.can.increments_per_turn,
    },
    "can.profile": {"bus.profile": lambda _: load_profile("maxon_epos4")},
    "can.velocity_unit": {"bus.velocity_unit": lambda _: "0.1 r/min"},
    "can.torque_reference": {"bus.torque_reference": 1.0},
    "can.inverted": {"bus.inverted": 1.0},
    "can.position_range": {"bus.position_around_zero": lambda _: True},
    "can.follows_bit": {"bus.follows_bit": 1.0},
    "can.remote_bit": {"bus.remote_bit": 1.0},
    "can.bitrate": {"bus.bitrate": 1.0},
    "can.encoder.index": {"bus.encoder.obj": 1.0},
    **{
        f"can.encoder.{name}": {f"bus.encoder.{name}": 1.0}
        for name in ("sub", "length", "checksum_error", "alarm", "warning", "battery")
    },
    # Two heartbeats at least.
    "can.heartbeat_ms": {
        "bus.heartbeat_s": MS,
        "bus.lone_heartbeat_s": lambda machine: 2.0 * MS * machine.can.heartbeat_ms,
    },
    "can.heartbeat_timeout_ms": {"bus.heartbeat_timeout_s": MS},
    "can.heartbeat_alone_ms": {"bus.lone_heartbeat_s": MS},
    "can.rpdo_deadline_ms": {"bus.rpdo_deadline_s": MS},
    "can.answer_ms": {"bus.answer_s": MS},
    "can.sdo_timeout_ms": {"bus.sdo_timeout_s": MS},
    **{
        f"can.inputs.{name}": {f"bus.inputs.{name}": lambda m, name=name: bit(m, name)}
        for name in (
            "estop_ok", "enabling_switch", "mains_ready", "brake_open", "limit_minus", "limit_plus",
            "collision_ok", "door_ok", "motion_permit", "estop_ok_2", "watchdog_closed",
        )
    },
    "can.watchdog_ms": {"bus.watchdog_s": MS},
    **{
        f"can.{where}.{name}": {
            f"bus.{where}.{name}": lambda m, place=f"can.{where}.{name}": in_use(value_of(m, place)),
            **({"program.power.watchdog_falls_s": falls_s} if name == "watchdog" else {}),
        }
        for where, names in (
            ("outputs", OutputBits._fields), ("io.outputs", OutputBits._fields), ("io.inputs", InputBits._fields),
        )
        for name in names
        if (where, name) != ("outputs", "drive_enable")
    },
    "can.io.node": {"bus.io.node": 1.0},
    "can.load_encoder.source": {"bus.load_encoder.node": lambda _: None},
    "can.load_encoder.node": {"bus.load_encoder.node": 1.0},
    "can.load_encoder.counts_per_turn": {"bus.load_encoder.counts_per_turn": 1.0},
    "can.load_encoder.zero_counts": {"bus.load_encoder.zero_counts": 1.0},
    "can.load_encoder.inverted": {"bus.load_encoder.inverted": 1.0},
    # --- monitors
    "control.compensation.first_mode_hz": {"program.monitors.swing_s": lambda _: 0.8},
    "monitors.following_error_base_deg": {"program.monitors.following_error_base_rad": DEG},
    "monitors.following_error_per_speed_s": {"program.monitors.following_error_per_speed_s": 1.0},
    "monitors.following_error_warning_ratio": {"program.monitors.following_error_warning_ratio": 1.0},
    "monitors.following_error_time_ms": {"program.monitors.following_error_time_s": MS},
    "monitors.velocity_deviation_deg_s": {
        "program.monitors.velocity_deviation_rad_s": DEG,
        "program.monitors.speed_change_base_rad_s": 0.4 * DEG,
    },
    "monitors.velocity_deviation_time_ms": {"program.monitors.velocity_deviation_time_s": MS},
    "monitors.overspeed_time_ms": {"program.monitors.overspeed_time_s": MS},
    "monitors.standstill_window_deg": {"program.monitors.standstill_window_rad": DEG},
    "monitors.standstill_time_ms": {"program.monitors.standstill_time_s": MS},
    "monitors.in_position_window_deg": {"program.monitors.in_position_window_rad": DEG},
    "monitors.in_position_dwell_ms": {"program.monitors.in_position_dwell_s": MS},
    "monitors.in_position_tolerance_time_s": {"program.monitors.in_position_tolerance_time_s": 1.0},
    "monitors.torque_saturation_time_ms": {"program.monitors.torque_saturation_time_s": MS},
    "monitors.brake_feedback_time_ms": {"program.power.brake_feedback_time_s": MS},
    "monitors.power_up_time_ms": {"program.power.power_up_time_s": MS},
    "monitors.lease_ms": {"program.monitors.lease_s": MS},
    "monitors.door_reaction": {"program.monitors.door_quick_stop": lambda _: True},
    "monitors.encoder_battery": {"program.monitors.encoder_battery": 1.0},
    "monitors.running_torque_nm": {"program.power.running_torque_nm": 1.0},
    "monitors.wind_torque_nm": {"program.power.wind_torque_nm": 1.0},
    "monitors.motor_thermal_time_constant_s": {"program.thermal.time_constant_s": 1.0},
    "monitors.motor_temp_max_c": {"program.thermal.winding_max_c": 1.0},
    # --- plant
    "plant.load.inertia_kg_m2": {"plant.inertia_load_kg_m2": 1.0, "plant.damping_nm_s_per_rad": damping},
    "plant.load.mass_kg": {"plant.eccentric_moment_nm": eccentric},
    "plant.load.eccentricity_m": {"plant.eccentric_moment_nm": eccentric},
    "plant.load.eccentric_sign": {"plant.eccentric_moment_nm": eccentric},
    "plant.load.eccentric_angle_deg": {"plant.eccentric_angle_rad": DEG},
    "plant.motor.wave_generator_inertia_kg_m2": {"plant.inertia_motor_kg_m2": inertia_motor},
    "plant.motor.torque_ripple_nm": {"plant.ripple_torque_nm": 1.0},
    "plant.motor.torque_ripple_order": {"plant.ripple_order": 1.0},
    "plant.transmission.reducer_stiffness_1_nm_per_rad": {
        "plant.stiffness_1_nm_per_rad": K1,
        "plant.damping_nm_s_per_rad": damping,
    },
    "plant.transmission.reducer_stiffness_2_nm_per_rad": {"plant.stiffness_2_nm_per_rad": K2},
    "plant.transmission.reducer_stiffness_3_nm_per_rad": {"plant.stiffness_3_nm_per_rad": K3},
    "plant.transmission.reducer_torque_1_nm": {"plant.torque_1_nm": 13.0},
    "plant.transmission.reducer_torque_2_nm": {"plant.torque_2_nm": 13.0},
    "plant.transmission.rest_stiffness_nm_per_rad": {
        "plant.stiffness_1_nm_per_rad": K1,
        "plant.stiffness_2_nm_per_rad": K2,
        "plant.stiffness_3_nm_per_rad": K3,
        "plant.damping_nm_s_per_rad": damping,
    },
    "plant.transmission.damping_ratio": {"plant.damping_nm_s_per_rad": damping},
    "plant.transmission.hysteresis_torque_nm": {"plant.hysteresis_torque_nm": 1.0},
    "plant.transmission.hysteresis_load_ratio": {"plant.hysteresis_load_ratio": 1.0},
    "plant.transmission.hysteresis_length_rad": {"plant.hysteresis_length_rad": 1.0},
    "plant.transmission.backlash_mm": {"plant.half_backlash_rad": half_backlash},
    "plant.gear_error.ring_radius_m": {
        "plant.half_backlash_rad": half_backlash,
        "plant.error_ring_rad": ring,
        "plant.error_pinion_rad": pinion,
        "plant.error_mesh_rad": mesh,
    }
    | TEETH,
    "plant.gear_error.pinion_teeth": {"plant.pinion_teeth": 1.0, "plant.ring_teeth": ring_count} | TEETH,
    "plant.tooth_pitch.ring_grade": {"plant.ring_pitch_rad": ring_pitch},
    "plant.tooth_pitch.pinion_grade": {"plant.pinion_pitch_rad": pinion_pitch},
    "plant.tooth_pitch.scale": TEETH,
    "plant.tooth_pitch.contact_ratio": {"plant.contact_ratio": 1.0},
    "plant.tooth_pitch.seed": TEETH,
    "plant.thermal.gears_start_k": {"plant.gear_temp_start_k": 1.0},
    "plant.thermal.gears_end_k": {"plant.gear_temp_end_k": 1.0},
    "plant.thermal.gears_time_s": {"plant.gear_temp_time_s": 1.0},
    "plant.thermal.motor_start_k": {"plant.motor_temp_start_k": 1.0},
    "plant.thermal.motor_end_k": {"plant.motor_temp_end_k": 1.0},
    "plant.thermal.motor_time_s": {"plant.motor_temp_time_s": 1.0},
    "plant.thermal.expansion_per_k": {"plant.half_backlash_rad_per_k": backlash_growth},
    "plant.thermal.support_share": {"plant.half_backlash_rad_per_k": backlash_growth},
    "plant.thermal.pressure_angle_deg": {"plant.half_backlash_rad_per_k": backlash_growth},
    "plant.thermal.viscosity_per_k": {"plant.viscosity_per_k": 1.0},
    "plant.thermal.torque_constant_per_k": {"plant.torque_constant_per_k": 1.0},
    "plant.ageing.roller_nm": {"plant.roller_ageing_nm": 1.0},
    "plant.ageing.roller_time_s": {"plant.roller_ageing_time_s": 1.0},
    "plant.ageing.roller_length_rad": {"plant.roller_ageing_length_rad": 1.0},
    "plant.ageing.motor_nm": {"plant.motor_ageing_nm": 1.0},
    "plant.ageing.motor_time_s": {"plant.motor_ageing_time_s": 1.0},
    "plant.ageing.motor_length_rad": {"plant.motor_ageing_length_rad": 1.0},
    "plant.cable.moment_nm": {"plant.cable_moment_nm": 1.0},
    "plant.cable.moment_1_nm_per_rad": {"plant.cable_moment_1_nm": 1.0},
    "plant.cable.moment_2_nm_per_rad2": {"plant.cable_moment_2_nm": 1.0},
    "plant.cable.moment_3_nm_per_rad3": {"plant.cable_moment_3_nm": 1.0},
    "plant.cable.friction_nm": {"plant.cable_friction_nm": 1.0},
    "plant.cable.presliding_deg": {"plant.cable_presliding_rad": DEG},
    "plant.motor.cogging_torque_nm": {"plant.cogging_torque_nm": 1.0},
    "plant.motor.cogging_order": {"plant.cogging_order": 1.0},
    "plant.motor.cogging_phase_rad": {"plant.cogging_phase_rad": 1.0},
    "plant.motor.torque_constant_ratio": {"plant.torque_constant_ratio": 1.0, "plant.torque_constant": lambda _: True},
    "plant.gear_error.ring_um": {"plant.error_ring_rad": ring},
    "plant.gear_error.reducer_2x_rad": {"plant.error_reducer_2x_rad": reducer("reducer_2x_rad")},
    "plant.gear_error.reducer_1x_rad": {"plant.error_reducer_1x_rad": reducer("reducer_1x_rad")},
    "plant.gear_error.reducer_4x_rad": {"plant.error_reducer_4x_rad": reducer("reducer_4x_rad")},
    "plant.gear_error.output_1x_rad": {"plant.error_pinion_rad": pinion},
    "plant.gear_error.pinion_1x_um": {"plant.error_pinion_rad": pinion},
    "plant.gear_error.mesh_um": {"plant.error_mesh_rad": mesh},
    "plant.gear_error.scale": REDUCER
    | {"plant.error_ring_rad": ring, "plant.error_pinion_rad": pinion, "plant.error_mesh_rad": mesh},
    "plant.gear_error.phases_rad": {
        "plant.phase_ring_rad": lambda m: list(m.plant.gear_error.phases_rad[:12]),
        **{
            f"plant.phase_{name}_rad": lambda m, at=at: m.plant.gear_error.phases_rad[at]
            for at, name in enumerate(("reducer_2x", "reducer_1x", "reducer_4x", "pinion", "mesh"), start=12)
        },
    },
    "plant.roller_friction.coulomb_nm": {"plant.roller_coulomb_nm": 1.0},
    "plant.roller_friction.breakaway_nm": {"plant.roller_breakaway_nm": 1.0},
    "plant.roller_friction.stribeck_deg_s": {"plant.roller_stribeck_rad_s": DEG},
    "plant.roller_friction.viscous_nm_s_per_rad": {"plant.roller_viscous_nm_s_per_rad": 1.0},
    "plant.roller_friction.presliding_rad": {"plant.roller_presliding_rad": 1.0},
    "plant.roller_friction.micro_damping": {"plant.roller_micro_damping": 1.0},
    "plant.motor_friction.coulomb_nm": {"plant.motor_coulomb_nm": 1.0},
    "plant.motor_friction.breakaway_nm": {"plant.motor_breakaway_nm": 1.0},
    "plant.motor_friction.stribeck_rad_s": {"plant.motor_stribeck_rad_s": 1.0},
    "plant.motor_friction.viscous_nm_s_per_rad": {"plant.motor_viscous_nm_s_per_rad": 1.0},
    "plant.motor_friction.load_ratio": {"plant.motor_load_ratio": 1.0},
    "plant.motor_friction.presliding_rad": {"plant.motor_presliding_rad": 1.0},
    "plant.motor_friction.micro_damping": {"plant.motor_micro_damping": 1.0},
    "plant.base.inertia_kg_m2": {
        "plant.base_inertia_kg_m2": 1.0,
        "plant.base_stiffness_nm_per_rad": base_stiffness,
        "plant.base_damping_nm_s_per_rad": base_damping,
    },
    "plant.base.frequency_hz": {
        "plant.base_stiffness_nm_per_rad": base_stiffness,
        "plant.base_damping_nm_s_per_rad": base_damping,
    },
    "plant.base.damping_ratio": {"plant.base_damping_nm_s_per_rad": base_damping},
    "plant.wind.moment_nm": {"plant.wind_moment_nm": 1.0, "plant.wind_wave_nm": gusts},
    "plant.wind.turbulence": {"plant.wind_wave_nm": gusts},
    "plant.wind.speed_m_s": {"plant.wind_wave_nm": gusts},
    "plant.wind.length_m": {"plant.wind_wave_nm": gusts},
    "plant.wind.width_m": {"plant.wind_wave_nm": gusts},
    "plant.wind.seed": {
        "plant.wind_rate_rad_s": lambda m: list(wind_waves(m.plant.wind).rate_rad_s),
        "plant.wind_phase_rad": lambda m: list(wind_waves(m.plant.wind).phase_rad),
    },
    "plant.switches.wind": {"plant.wind": 1.0},
    "plant.brake.presliding_rad": {"plant.brake_presliding_rad": 1.0},
    "plant.brake.torque_share": {"plant.brake_torque_nm": brake_torque},
    "plant.encoder.latency_us": {"drive.latency_s": US},
    "plant.encoder.mounting_turns": {"sim.count_offset": 2048.0 * 2048.0},
    "plant.encoder.interpolation_1x_rad": {"drive.encoder_error_1x_rad": 1.0},
    "plant.encoder.interpolation_2x_rad": {"drive.encoder_error_2x_rad": 1.0},
    "plant.encoder.eccentricity_rad": {"drive.encoder_eccentricity_rad": 1.0},
    "plant.encoder.eccentricity_phase_rad": {"drive.encoder_eccentricity_phase_rad": 1.0},
    "plant.encoder.serial": {"sim.serial": lambda m: m.plant.encoder.serial},
    "plant.switches.tooth_pitch": {
        "plant.tooth_pitch": 1.0,
        "plant.ring_teeth": lambda _: 0,
        "plant.ring_pitch_rad": lambda _: [],
        "plant.pinion_pitch_rad": lambda _: [],
    },
    "plant.switches.thermal": {"plant.thermal": 1.0},
    "plant.switches.ageing": {"plant.ageing": 1.0},
    "plant.switches.cogging": {"plant.cogging": 1.0},
    "plant.switches.encoder_errors": {"drive.encoder_errors": 1.0},
    "plant.switches.cable": {"plant.cable": 1.0},
    "plant.switches.second_pinion": {"plant.second_pinion": 1.0, "plant.second_pinion_pitch_rad": other_pinion_pitch},
    "plant.second_pinion.angle_deg": {"plant.second_angle_rad": DEG},
    "plant.second_pinion.phases_rad": {
        f"plant.second_phase_{name}_rad": lambda m, k=k: m.plant.second_pinion.phases_rad[k]
        for k, name in enumerate(("reducer_2x", "reducer_1x", "reducer_4x", "pinion", "mesh"))
    },
    "plant.second_pinion.preload_nm": {"drive.preload_nm": 1.0},
    "plant.second_pinion.lost": {"plant.lost_motor": lambda _: 2},
    "plant.switches.gear_error": {"plant.gear_error": 1.0},
    "plant.switches.backlash": {"plant.backlash": 1.0, "plant.half_backlash_rad": lambda _: 0.0},
    "plant.switches.hysteresis": {"plant.hysteresis": 1.0},
    "plant.switches.roller_friction": {"plant.roller_friction": 1.0},
    "plant.switches.motor_friction": {"plant.motor_friction": 1.0},
    "plant.switches.eccentric_moment": {"plant.eccentric_moment_nm": lambda _: 0.0},
    "plant.switches.base": {"plant.base": 1.0},
    "plant.switches.torque_ripple": {"plant.ripple": 1.0},
    "plant.switches.three_slopes": {"plant.stiffness_2_nm_per_rad": K1, "plant.stiffness_3_nm_per_rad": K1},
    "plant.switches.rigid": {
        "plant.rigid": 1.0,
        "plant.gear_error": lambda _: False,
        "plant.tooth_pitch": lambda _: False,
        "plant.ring_teeth": lambda _: 0,
        "plant.ring_pitch_rad": lambda _: [],
        "plant.pinion_pitch_rad": lambda _: [],
    },
}  # fmt: skip

# Keys that no setting of program, drive or plant holds, and who reads them.
ELSEWHERE = {
    "machine.name": "shown",
    "machine.description": "shown",
    "machine.guesses": "shown",
    "axis.display": "sentences for people: tests/unit/cli/test_display_of_angles.py",
    "axis.no_go_deg": "travel of the program: tests/plant/test_no_go.py, unit/program/test_no_go.py",
    "axis.kind": "an axis without ends: test_modulo.py",
    "axis.gear_motor_turns": "modulo axes: test_modulo.py",
    "axis.gear_axis_turns": "modulo axes: test_modulo.py",
    "axis.mechanical_stop_min_deg": "rules between keys, gantryctl stops",
    "axis.mechanical_stop_max_deg": "rules between keys, gantryctl stops",
    "required.angle_deg": "verdicts of accuracy",
    "required.speed_error_ratio": "verdicts of the speed test",
    "required.source": "shown beside verdicts",
    "control.compensation.calibration": "read with the file",
    **dict.fromkeys(
        [
            f"control.compensation.calibration_watch.{key}"
            for key in ("active", "moment_nm", "friction_ratio", "backlash_deg", "lost_motion_deg")
        ],
        "with the numbers of a calibration: tests/unit/program/test_calibration_watch.py",
    ),
    "control.compensation.gear_map.cycles_per_turn": "identification",
    "motor.power_rated_kw": "sizing",
    "motor.speed_rated_r_min": "sizing",
    "motor.current_rated_a": "sizing",
    "motor.power_factor": "sizing",
    "motor.efficiency": "sizing",
    "reducer.torque_rated_nm": "gantryctl stops",
    "reducer.torque_momentary_nm": "rules between keys",
    "brake.test_interval_days": "operation, which has the calendar",
    "brake.test_interval_power_ups": "operation",
    "drive.kind": "which drive is made: test_wiring.py",
    "can.channel": "which bus is opened",
    "can.eds": "checks of the drive before it is opened",
    "can.side_channel": "the plant of a virtual drive",
    "can.torque_limit_in_drive_nm": "the ledger, and the pulse that shows it",
    "can.virtual_drive": "which virtual drive is made",
    "can.commissioning_required": "operation",
    "accuracy.bases_deg": "accuracy",
    "accuracy.displacements_deg": "accuracy",
    "accuracy.speeds_deg_s": "accuracy",
    "accuracy.chord_radius_m": "accuracy",
    "accuracy.tracker_noise_um": "accuracy",
    "accuracy.dwell_s": "accuracy",
    "accuracy.average_s": "accuracy",
    "monitors.unheld_power_time_s": "the service: tests/unit/service/test_unheld_power.py",
    "plant.load.eccentric_check_moment_nm": "rules between keys",
    **dict.fromkeys(
        (path for path in field_specs() if path.startswith("plant.structure.")),
        "gantryctl accuracy isocentre",
    ),
    "plant.load_encoder.fitted": "the simulated ring: tests/physics/test_encoder.py",
    "plant.load_encoder.bits": "the simulated ring",
    "plant.load_encoder.noise_rad": "the simulated ring",
    "plant.load_encoder.scale_error_rad": "the simulated ring",
    "plant.load_encoder.latency_us": "the simulated ring",
    **{
        f"plant.uncertainty.{name}_ratio": "gantryctl stops --find-quick: tests/unit/engineering/stops/test_certify.py"
        for name in ("inertia", "friction", "stiffness", "torque_constant", "identified_inertia")
    },
    "plant.integration.scheme": "handed to the compiled plant: tests/physics/test_integration.py",
    "plant.integration.rk4_steps": "handed to the compiled plant",
}

# Where a number cannot be made one percent larger.
CHANGED: dict[str, Any] = {
    "virtual_axis.profile": "jerk_limited",
    "brake.owner": "object_60FE",
    "brake.hold": "brake",
    "drive.kind": "sim",
    "drive.speed_loop.feedback": "counts",
    # Whole numbers of drive cycles to a scan.
    "control.scan_period_ms": 2.0,
    "drive.speed_loop.cycle_us": 250.0,
    "can.interface": "simulated",
    "can.load_encoder.source": "60E4",
    "can.velocity_unit": "0.1 r/min",
    "can.profile": "maxon_epos4",
    "can.position_range": "around 0",
    "monitors.door_reaction": "quick_stop",
    "monitors.running_torque_nm": 90.0,
    "monitors.wind_torque_nm": 30.0,
    "plant.integration.scheme": "rk4",
    "plant.second_pinion.lost": "second",
    "plant.load.eccentric_angle_deg": 3.0,
    **dict.fromkeys(
        [
            *(f"plant.thermal.{part}_{when}_k" for part in ("gears", "motor") for when in ("start", "end")),
            "plant.thermal.support_share",
            "plant.motor.cogging_phase_rad",
            "plant.cable.moment_nm",
            "plant.cable.moment_2_nm_per_rad2",
            "plant.cable.moment_3_nm_per_rad3",
            "plant.encoder.eccentricity_phase_rad",
        ],
        0.5,
    ),
    "plant.load.eccentric_sign": 1.0,
    "plant.encoder.serial": "SIM-0002",
    "control.compensation.first_mode_hz": 1.25,
    "control.compensation.latency_us": 70.0,
    "control.compensation.moment_observer.limit_nm": 2e4,
    "control.compensation.backlash_observer.limit_deg": 0.007,
}


def with_key(machine: Machine, path: str, value: object) -> Machine:
    """The machine with one key changed and the rules between keys left out: it need not be a good machine."""
    head, _, rest = path.partition(".")
    table = getattr(machine, head)
    return machine.model_copy(update={head: with_key(table, rest, value) if rest else value})


def value_of(machine: Machine, path: str) -> Any:
    found: Any = machine
    for name in path.split("."):
        found = getattr(found, name)
    return found


def another(path: str, value: Any) -> Any:
    """A value that differs a little."""
    if path in CHANGED:
        return CHANGED[path]
    match value:
        case bool():
            return not value
        case int():
            return value + 1
        case float():
            return value * 1.01
        case tuple():
            return tuple(each * 1.01 for each in value)
    return f"{value}x"


# On a bus, where the program knows who owns the brake, and a real one, where answers are waited for.
MACHINE = with_key(with_key(default_machine(), "drive.kind", "canopen"), "can.interface", "socketcan")
# In some wind.
MACHINE = with_key(MACHINE, "plant.wind.moment_nm", 5000.0)
# With single teeth: they are drawn only where they are there.
MACHINE = with_key(MACHINE, "plant.switches.tooth_pitch", True)
# With nodes beside the drive.
MACHINE = with_key(with_key(MACHINE, "can.io.node", 3), "can.load_encoder.source", "node")


class Given(NamedTuple):
    """Arguments of the compensation's laws."""

    switches: Mapping[str, bool]
    numbers: Mapping[str, float]


def flat(prefix: str, given: Any) -> dict[str, Any]:
    """Settings by dotted name."""
    if is_dataclass(given):
        pairs = [(each.name, getattr(given, each.name)) for each in fields(given)]
    elif isinstance(given, InputBits | EncoderStatus | OutputBits | IoNodeSettings | LoadEncoderSettings):
        pairs = list(given._asdict().items())
    elif type(given).__module__.startswith("gantryctl._core"):
        pairs = [
            (name, getattr(given, name)) for name in dir(given) if not name.startswith("_") and name != "copy"
        ]
    else:
        return {prefix: given}
    return {place: part for name, value in pairs for place, part in flat(f"{prefix}.{name}", value).items()}


def handed_on(machine: Machine) -> dict[str, Any]:
    """Everything that wiring makes of a machine file, by dotted name."""
    given: list[Given] = []
    with pytest.MonkeyPatch.context() as patch:
        keep_the_laws(patch, given)
        found = flat("program", axis_settings(machine)) | flat("drive", drive_params(machine))
        found |= flat("plant", plant_params(machine)) | flat("bus", canopen_settings(machine))
        found |= laws(machine, patch, given)
        smooth = axis_settings(with_key(machine, "virtual_axis.profile", "jerk_limited"))
        gentle = axis_settings(with_key(machine, "virtual_axis.gentle_end", True))
    coarse = drive_params(with_key(machine, "drive.speed_loop.feedback", "counts"))
    simulated = with_key(machine, "drive.kind", "sim")
    drive, sim = sim_drive(simulated), gantry_sim(simulated)
    identity = drive.identity()
    if machine.virtual_axis.profile == MACHINE.virtual_axis.profile:
        found["jerk limited.ramps.jerk_rad_s3"] = smooth.ramps.jerk_rad_s3
    if not machine.virtual_axis.gentle_end:
        for name in ("end_dec_rad_s2", "end_jerk_rad_s3"):
            found[f"gentle end.ramps.{name}"] = getattr(gentle.ramps, name)
    if machine.drive.speed_loop.feedback == MACHINE.drive.speed_loop.feedback:
        found["coarse.position_count_rad"] = coarse.position_count_rad
    return found | {
        "sim.limit_switch_min_rad": drive._lower_switch_rad,
        "sim.limit_switch_max_rad": drive._upper_switch_rad,
        "sim.counts_per_turn": identity.counts_per_turn,
        "sim.turns": identity.turns,
        "sim.serial": identity.encoder_serial,
        "sim.scan_period_s": sim.scan_period_s,
        "sim.count_offset": sim.count_offset,
    }


def keep_the_laws(patch: pytest.MonkeyPatch, given: list[Given]) -> None:
    """Keep what the compensation's laws get; identified values are those of a calibration, not of this file."""
    maps = SimpleNamespace(gear_rad=(), reversal_rad=(), scale_rad=(), fast=())

    def made(switches: Any, numbers: Any, *_: object) -> str:
        given.append(Given(dict(switches), dict(numbers)))
        return "laws"

    patch.setattr(_core, "Compensation", made)
    patch.setattr(compensation, "check_calibration", lambda *_: SimpleNamespace(maps=maps))
    patch.setattr(compensation, "_identified", lambda *_: {})
    patch.setattr(compensation, "_watch", lambda _: None)


def laws(machine: Machine, patch: pytest.MonkeyPatch, given: list[Given]) -> dict[str, Any]:
    """Switches and numbers of the laws, which are made although all of them are off."""
    with patch.context() as inner:
        inner.setattr(type(machine.control.compensation), "any_active", True)
        settings = compensation.compensation_settings(machine)
    assert settings is not None
    switches, numbers = given[-1]
    found = {f"laws.{name}": value for name, value in {**switches, **numbers}.items()}
    return found | {
        f"second encoder.{name}": getattr(settings, name)
        for name in ("load_encoder", "disagreement_rad", "disagreement_time_s", "moment_limit_nm")
    }


@cache
def _unchanged() -> dict[str, Any]:
    return handed_on(MACHINE)


def same(one: Any, other: Any) -> bool:
    return one == other if isinstance(one, float) else str(one) == str(other)


@pytest.mark.parametrize("path", field_specs())
def test_a_key_changes_its_settings_and_no_other(path: str) -> None:
    assert (path in ROWS) != (path in ELSEWHERE), (
        f"{path}: write its row, what it changes and by which factor"
    )
    value = another(path, value_of(MACHINE, path))
    machine = with_key(MACHINE, path, value)
    before, after = _unchanged(), handed_on(machine)
    if path == "drive.kind":
        return
    changed = {name for name in before.keys() & after.keys() if not same(before[name], after[name])}
    row = ROWS.get(path, {})
    assert changed == set(row)
    for name, rule in row.items():
        wanted = rule(machine) if callable(rule) else value * rule
        assert after[name] == (
            # Rounding of a few products.
            pytest.approx(wanted, rel=1e-12) if isinstance(wanted, (float, list)) else wanted
        ), name


def test_every_row_is_of_a_key() -> None:
    assert set(ROWS) | set(ELSEWHERE) == set(field_specs())
