"""Effects of the plant that the reference machine has switched off: their parameters in SI."""

from __future__ import annotations

import math
from typing import Final

from gantryctl import _core
from gantryctl.errors import ConfigError
from gantryctl.machine import Machine
from gantryctl.units import rad
from gantryctl.wiring.teeth import pinion_deviations_um, ring_deviations_um

# The teeth of the second pinion are drawn by another seed than any that a machine file can give the first.
_OTHER_SEED: Final = 2**31
_LOST: Final = {"none": 0, "first": 1, "second": 2}


def add_effects(p: _core.PlantParams, machine: Machine) -> None:
    """Single teeth, temperatures, ageing contacts, cogging and cables, each by its switch (plant equations S13).

    The second pinion is S15.
    """
    _teeth(p, machine)
    _temperatures(p, machine)
    _ageing(p, machine)
    _cogging(p, machine)
    _cable(p, machine)
    _second_pinion(p, machine)


def add_encoder_errors(p: _core.DriveParams, machine: Machine) -> None:
    """Errors of the motor encoder within a signal period and a turn (plant equations S13)."""
    encoder = machine.plant.encoder
    p.encoder_errors = machine.plant.switches.encoder_errors
    p.encoder_lines = float(machine.encoder.lines)
    p.encoder_error_1x_rad = encoder.interpolation_1x_rad
    p.encoder_error_2x_rad = encoder.interpolation_2x_rad
    p.encoder_eccentricity_rad = encoder.eccentricity_rad
    p.encoder_eccentricity_phase_rad = encoder.eccentricity_phase_rad


def expect_one_pinion(machine: Machine, what: str) -> None:
    """Refuse a machine with two pinions where something is computed with one motor.

    Raises:
        ConfigError: [plant.switches] second_pinion is on.
    """
    if machine.plant.switches.second_pinion:
        raise ConfigError(
            [
                f"[plant.switches] second_pinion = true, must be false for {what}, which knows one motor: set it to "
                "false, or compute with two pinions what runs the plant: move, stops, accuracy run, speed-test, compare"
            ]
        )


def larger_share_nm(machine: Machine, torque_nm: float) -> float:
    """Torque of the motor that has more of a torque of the axis, without its sign; one motor has all of it."""
    pinion = machine.plant.second_pinion
    if not machine.plant.switches.second_pinion or pinion.lost != "none":
        return abs(torque_nm)
    # u/2 + preload and u/2 - preload, each within its limit (plant equations S15).
    return min(0.5 * abs(torque_nm) + abs(pinion.preload_nm), machine.motor.torque_max_nm)


def ring_teeth(machine: Machine) -> int:
    """Teeth of the ring."""
    return round(machine.plant.gear_error.pinion_teeth * machine.axis.ring_ratio)


def _teeth(p: _core.PlantParams, machine: Machine) -> None:
    switch, g, t = machine.plant.switches, machine.plant.gear_error, machine.plant.tooth_pitch
    p.tooth_pitch = switch.tooth_pitch and not switch.rigid
    p.contact_ratio = t.contact_ratio
    if not p.tooth_pitch:
        return
    count = ring_teeth(machine)
    module_mm = 2e3 * g.ring_radius_m / count
    per_um = t.scale * 1e-6 / g.ring_radius_m
    ring = ring_deviations_um(count, module_mm, t.ring_grade, t.seed)
    pinion = pinion_deviations_um(g.pinion_teeth, module_mm, t.pinion_grade, t.seed)
    p.ring_pitch_rad = [um * per_um for um in ring]
    p.pinion_pitch_rad = [um * per_um for um in pinion]
    if switch.second_pinion:
        other = pinion_deviations_um(g.pinion_teeth, module_mm, t.pinion_grade, t.seed + _OTHER_SEED)
        p.second_pinion_pitch_rad = [um * per_um for um in other]


def _temperatures(p: _core.PlantParams, machine: Machine) -> None:
    t = machine.plant.thermal
    p.thermal = machine.plant.switches.thermal
    p.gear_temp_start_k, p.gear_temp_end_k = t.gears_start_k, t.gears_end_k
    p.motor_temp_start_k, p.motor_temp_end_k = t.motor_start_k, t.motor_end_k
    p.gear_temp_time_s, p.motor_temp_time_s = t.gears_time_s, t.motor_time_s
    # Warm gears grow towards each other by a alpha dT, a = R + r, unless their support grows too; the gap between the
    # flanks closes by 2 tan(pressure angle) of it. Half of that, over R (plant equations S13).
    distance_per_radius = 1.0 + 1.0 / machine.axis.ring_ratio
    growth = t.expansion_per_k * (1.0 - t.support_share) * distance_per_radius
    p.half_backlash_rad_per_k = -math.tan(rad(t.pressure_angle_deg)) * growth
    p.viscosity_per_k = t.viscosity_per_k
    p.torque_constant_per_k = t.torque_constant_per_k


def _ageing(p: _core.PlantParams, machine: Machine) -> None:
    a = machine.plant.ageing
    p.ageing = machine.plant.switches.ageing
    p.roller_ageing_nm, p.roller_ageing_time_s = a.roller_nm, a.roller_time_s
    p.roller_ageing_length_rad = a.roller_length_rad
    p.motor_ageing_nm, p.motor_ageing_time_s = a.motor_nm, a.motor_time_s
    p.motor_ageing_length_rad = a.motor_length_rad


def _cogging(p: _core.PlantParams, machine: Machine) -> None:
    motor = machine.plant.motor
    p.cogging = machine.plant.switches.cogging
    p.cogging_torque_nm, p.cogging_order = motor.cogging_torque_nm, motor.cogging_order
    p.cogging_phase_rad = motor.cogging_phase_rad


def _cable(p: _core.PlantParams, machine: Machine) -> None:
    c = machine.plant.cable
    p.cable = machine.plant.switches.cable
    p.cable_moment_nm, p.cable_moment_1_nm = c.moment_nm, c.moment_1_nm_per_rad
    p.cable_moment_2_nm, p.cable_moment_3_nm = c.moment_2_nm_per_rad2, c.moment_3_nm_per_rad3
    p.cable_friction_nm, p.cable_presliding_rad = c.friction_nm, rad(c.presliding_deg)


def _second_pinion(p: _core.PlantParams, machine: Machine) -> None:
    second = machine.plant.second_pinion
    p.second_pinion = machine.plant.switches.second_pinion
    p.lost_motor = _LOST[second.lost]
    p.second_angle_rad = rad(second.angle_deg)
    (
        p.second_phase_reducer_2x_rad,
        p.second_phase_reducer_1x_rad,
        p.second_phase_reducer_4x_rad,
        p.second_phase_pinion_rad,
        p.second_phase_mesh_rad,
    ) = second.phases_rad
