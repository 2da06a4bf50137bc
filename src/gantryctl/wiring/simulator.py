"""Machine file to the simulated gantry: parameters of the compiled plant in SI, and the drives in front of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Final

from gantryctl import _core
from gantryctl.drives.ideal import IdealDrive
from gantryctl.drives.simulated import PlantMaker, SimDrive
from gantryctl.machine import Machine
from gantryctl.machine.tables.plant import SCALE_TERMS, GearErrorTable, PlantTable
from gantryctl.machine.wind import wind_waves
from gantryctl.units import rad
from gantryctl.wiring.compensation import lead_deg
from gantryctl.wiring.plant_effects import add_effects, add_encoder_errors

# Below this torque the ripple shrinks with the torque (plant equations S5).
_RIPPLE_FULL_TORQUE_NM: Final = 20.0
_FRICTION: Final = ("coulomb_nm", "breakaway_nm", "viscous_nm_s_per_rad", "presliding_rad", "micro_damping")


def eccentric_moment_nm(machine: Machine) -> float:
    """Eccentric moment T_u with its sign."""
    # The torque on the load is T_u sin(theta - eccentric angle), so a negative moment restores at 0 (plant equations
    # S1).
    load = machine.plant.load
    return load.eccentric_sign * load.eccentric_moment_nm


def plant_params(machine: Machine) -> _core.PlantParams:
    """Parameters of the plant; a switch that is off makes its effect exactly absent (plant equations S6)."""
    plant, switch = machine.plant, machine.plant.switches
    p = _core.PlantParams()
    p.ratio = machine.axis.ratio
    p.reducer_ratio = machine.axis.reducer_ratio
    p.inertia_load_kg_m2 = plant.load.inertia_kg_m2
    # Jm includes the wave generator; the paper's Js = J/i^2 + J_motor leaves it out (plant equations S1).
    p.inertia_motor_kg_m2 = machine.motor.inertia_kg_m2 + plant.motor.wave_generator_inertia_kg_m2
    p.eccentric_moment_nm = eccentric_moment_nm(machine) if switch.eccentric_moment else 0.0
    p.eccentric_angle_rad = rad(plant.load.eccentric_angle_deg)
    # What a drive asks for and reports is a current, times the torque constant that it was told (plant equations S5).
    p.torque_constant_ratio = plant.motor.torque_constant_ratio
    p.torque_constant = p.torque_constant_ratio != 1.0
    p.ripple = switch.torque_ripple
    p.ripple_torque_nm = plant.motor.torque_ripple_nm
    p.ripple_order = plant.motor.torque_ripple_order
    p.ripple_full_torque_nm = _RIPPLE_FULL_TORQUE_NM
    p.brake_torque_nm = machine.brake.torque_nm * machine.plant.brake.torque_share
    p.brake_presliding_rad = plant.brake.presliding_rad
    p.wind = switch.wind
    p.wind_moment_nm = plant.wind.moment_nm
    p.wind_wave_nm, p.wind_rate_rad_s, p.wind_phase_rad = map(list, wind_waves(plant.wind))
    p.rigid = switch.rigid
    current = machine.drive.current_loop
    p.current_bandwidth_rad_s = 0.0 if current.ideal else 2.0 * math.pi * current.bandwidth_hz
    _transmission(p, machine)
    _gear_error(p, plant.gear_error, machine.axis.ring_ratio)
    p.gear_error = switch.gear_error and not switch.rigid
    _friction(p, plant)
    _base(p, plant)
    add_effects(p, machine)
    return p


def _transmission(p: _core.PlantParams, machine: Machine) -> None:
    t, switch = machine.plant.transmission, machine.plant.switches
    ring = machine.axis.ring_ratio

    # K = 1/(1/(i2^2 K_reducer) + 1/K_rest) for each slope of the reducer alone, and c = 2 zeta sqrt(K1 J) (S1).
    def at_gantry(reducer_stiffness: float) -> float:
        return 1.0 / (1.0 / (ring * ring * reducer_stiffness) + 1.0 / t.rest_stiffness_nm_per_rad)

    p.stiffness_1_nm_per_rad = at_gantry(t.reducer_stiffness_1_nm_per_rad)
    p.stiffness_2_nm_per_rad = p.stiffness_3_nm_per_rad = p.stiffness_1_nm_per_rad
    if switch.three_slopes:
        p.stiffness_2_nm_per_rad = at_gantry(t.reducer_stiffness_2_nm_per_rad)
        p.stiffness_3_nm_per_rad = at_gantry(t.reducer_stiffness_3_nm_per_rad)
    p.torque_1_nm = t.reducer_torque_1_nm * ring
    p.torque_2_nm = t.reducer_torque_2_nm * ring
    p.damping_nm_s_per_rad = (
        2.0 * t.damping_ratio * math.sqrt(p.stiffness_1_nm_per_rad * p.inertia_load_kg_m2)
    )
    p.hysteresis = switch.hysteresis
    p.hysteresis_torque_nm = t.hysteresis_torque_nm
    p.hysteresis_load_ratio = t.hysteresis_load_ratio
    p.hysteresis_length_rad = t.hysteresis_length_rad
    # Gears that close at one temperature have a gap at another.
    p.backlash = switch.backlash and (t.backlash_mm > 0.0 or switch.thermal)
    # The gap between the flanks is b = backlash/R at the ring; the mesh takes half of it to either side (S1, S3).
    p.half_backlash_rad = (
        0.5 * t.backlash_mm * 1e-3 / machine.plant.gear_error.ring_radius_m if p.backlash else 0.0
    )


def _gear_error(p: _core.PlantParams, g: GearErrorTable, ring_ratio: float) -> None:
    # Amplitudes of the gear-error map (plant equations S2). Those on the motor side act through the ring ratio i2,
    # those in micrometres through the pitch radius R; the scale of the machine file multiplies all of them.
    phases = g.phases_rad
    per_um = g.scale * 1e-6 / g.ring_radius_m
    ring = [um * per_um for um in g.ring_um]
    p.error_ring_rad = ring + [0.0] * (12 - len(ring))
    p.phase_ring_rad = list(phases[:12])
    p.error_reducer_2x_rad = g.scale * g.reducer_2x_rad / ring_ratio
    p.error_reducer_1x_rad = g.scale * g.reducer_1x_rad / ring_ratio
    p.error_reducer_4x_rad = g.scale * g.reducer_4x_rad / ring_ratio
    p.error_pinion_rad = g.scale * g.output_1x_rad / ring_ratio + g.pinion_1x_um * per_um
    p.error_mesh_rad = g.mesh_um * per_um
    (
        p.phase_reducer_2x_rad,
        p.phase_reducer_1x_rad,
        p.phase_reducer_4x_rad,
        p.phase_pinion_rad,
        p.phase_mesh_rad,
    ) = phases[12:17]
    p.pinion_teeth = g.pinion_teeth


def _friction(p: _core.PlantParams, plant: PlantTable) -> None:
    # One elasto-plastic element for rollers and motor (plant equations S4). Without Coulomb friction it is left out:
    # its state divides by that friction.
    roller, motor, switch = plant.roller_friction, plant.motor_friction, plant.switches
    p.roller_friction = switch.roller_friction and roller.coulomb_nm > 0.0
    p.motor_friction = switch.motor_friction and motor.coulomb_nm > 0.0
    p.roller_stribeck_rad_s, p.motor_stribeck_rad_s = rad(roller.stribeck_deg_s), motor.stribeck_rad_s
    p.motor_load_ratio = motor.load_ratio
    for side, table in (("roller", roller), ("motor", motor)):
        for name in _FRICTION:
            setattr(p, f"{side}_{name}", getattr(table, name))


def _base(p: _core.PlantParams, plant: PlantTable) -> None:
    # kb = Jb (2 pi f)^2, cb = 2 zeta (2 pi f) Jb (plant equations S1).
    omega = 2.0 * math.pi * plant.base.frequency_hz
    p.base = plant.switches.base
    p.base_inertia_kg_m2 = plant.base.inertia_kg_m2
    p.base_stiffness_nm_per_rad = plant.base.inertia_kg_m2 * omega * omega
    p.base_damping_nm_s_per_rad = 2.0 * plant.base.damping_ratio * omega * plant.base.inertia_kg_m2


def drive_params(machine: Machine) -> _core.DriveParams:
    """Parameters of the simulated drive: speed PI, torque limit, encoder evaluation, brake times."""
    loop, motor = machine.drive.speed_loop, machine.motor
    ratio = machine.axis.ratio
    # The speed loop sees the true angle, the interpolated sine (2048 lines x 2048), or the absolute steps (S6).
    count = 2.0 * math.pi / machine.speed_counts_per_turn
    p = _core.DriveParams()
    p.cycle_s = loop.cycle_us * 1e-6
    p.kvp_nm_s_per_rad = loop.kvp_nm_s_per_rad
    p.tvi_s = loop.tvi_ms * 1e-3
    p.torque_rated_nm = motor.torque_rated_nm
    p.torque_max_nm = motor.torque_max_nm
    p.overload_time_s = loop.overload_time_s
    p.vel_max_rad_s = rad(machine.speed.drive_ceiling_deg_s) * ratio
    p.quick_dec_rad_s2 = rad(machine.virtual_axis.quick_dec_deg_s2) * ratio
    p.speed_count_rad = count
    p.position_count_rad = count
    p.latency_s = machine.plant.encoder.latency_us * 1e-6
    p.brake_close_s = machine.brake.close_time_ms * 1e-3
    p.brake_open_s = machine.brake.open_time_ms * 1e-3
    p.delay_cycles = loop.delay_cycles
    p.preload_nm = machine.plant.second_pinion.preload_nm
    add_encoder_errors(p, machine)
    return p


def gantry_sim(
    machine: Machine, plant: _core.PlantParams | None = None, drive: _core.DriveParams | None = None
) -> _core.GantrySim:
    """Compiled drive and plant, by the machine file unless other parameters are given."""
    integration = machine.plant.integration
    sim = _core.GantrySim(
        plant or plant_params(machine),
        drive or drive_params(machine),
        machine.control.scan_period_ms * 1e-3,
        integration.scheme,
        integration.rk4_steps,
    )
    sim.count_offset = float(machine.plant.encoder.mounting_turns * machine.encoder.fine_counts_per_turn)
    if machine.plant.load_encoder.fitted:
        fit_load_encoder(machine, sim)
    return sim


def fit_load_encoder(machine: Machine, sim: _core.GantrySim) -> None:
    """Put the encoder of [plant.load_encoder] on the simulated ring, zeroed at 0 deg."""
    sim.fit_load_encoder(*ring_encoder(machine))


def ring_encoder(machine: Machine) -> tuple[float, float, float, tuple[tuple[float, float, float], ...]]:
    """Encoder of [plant.load_encoder]: step and noise in rad, latency in s, terms of its scale error."""
    encoder = machine.plant.load_encoder
    scale = tuple((waves, gain * encoder.scale_error_rad, phase) for waves, gain, phase in SCALE_TERMS)
    return 2.0 * math.pi / 2.0**encoder.bits, encoder.noise_rad, encoder.latency_us * 1e-6, scale


def sim_drive(
    machine: Machine, angle_deg: float | None = None, state: Mapping[str, float] | None = None
) -> SimDrive:
    """Simulated drive with its gantry, torque off and the brake closed.

    Args:
        angle_deg: angle of the standing gantry; [axis] start_angle_deg when not given.
        state: an earlier `SimDrive.plant_state`, to go on from; `angle_deg` is ignored then.

    Raises:
        ValueError: the state lacks a value or has a non-finite one.
    """
    sim = gantry_sim(machine)
    if state is None:
        sim.static_start(rad(_standing_deg(machine, angle_deg)), False)
    else:
        sim.state = turned_back(machine, state)
    return drive_around(machine, sim)


def turned_back(machine: Machine, state: Mapping[str, float]) -> dict[str, float]:
    """State of a plant in its first turns: everything in it goes round with the axis, so no turn has to be kept.

    Without this the angles of a modulo axis would grow from run to run, and their last bits would be lost. A linear
    axis has no whole turns to lose: its state stays.
    """
    found = dict(state)
    # Only turns that are whole motor turns too: encoder and gear stand then as before.
    gear = machine.axis.gear
    span_rad = math.tau * gear.denominator
    pos_rad = state.get("pos_load", math.nan)
    turns = round(pos_rad / span_rad) if machine.axis.modulo and math.isfinite(pos_rad) else 0
    if turns:
        motor_turns = turns * gear.numerator
        moved = [name for name in ("pos_load", "pos_motor", "pos_motor_2", "drive_pos_last") if name in found]
        for name in moved:
            found[name] -= turns * span_rad if name == "pos_load" else motor_turns * math.tau
        per_turn = machine.encoder.fine_counts_per_turn
        span = machine.encoder.turns * per_turn
        found["count_offset"] = (state["count_offset"] + motor_turns * per_turn) % span
    return found


def drive_around(machine: Machine, sim: _core.GantrySim) -> SimDrive:
    """Simulated drive around a plant in any state; a fault that changes a parameter starts from the machine's."""
    return SimDrive(
        sim,
        PlantMaker(plant_params(machine), drive_params(machine), partial(gantry_sim, machine)),
        serial=machine.plant.encoder.serial,
        counts_per_turn=machine.encoder.fine_counts_per_turn,
        turns=machine.encoder.turns,
        limit_switches_rad=limit_switches_rad(machine),
    )


def limit_switches_rad(machine: Machine) -> tuple[float, float]:
    """Angles of the lower and the upper limit switch; infinite where the axis has none."""
    if machine.axis.modulo:
        return -math.inf, math.inf
    return rad(machine.axis.limit_switch_min_deg), rad(machine.axis.limit_switch_max_deg)


def _standing_deg(machine: Machine, angle_deg: float | None) -> float:
    return machine.axis.start_angle_deg if angle_deg is None else angle_deg


def delivered_zero_counts(machine: Machine, angle_deg: float | None = None) -> int:
    """Encoder reading at gantry angle 0 of a new machine, zeroed with the load standing as of `sim_drive`."""
    if machine.drive.kind == "ideal":
        return _ideal_zero_counts(machine)
    # Maps that are on make the motor lead the load at rest (decision 0010): the lead belongs to the zero.
    standing_deg = _standing_deg(machine, angle_deg)
    drive = sim_drive(machine, standing_deg)
    at_angle = drive.read().pos_act_counts
    motor_deg = standing_deg + lead_deg(machine, standing_deg)
    per_turn = machine.encoder.fine_counts_per_turn
    fine = round(at_angle - motor_deg / 360.0 * machine.axis.ratio * per_turn)
    return round(fine * machine.counts_per_turn / per_turn)


def ideal_drive(
    machine: Machine, angle_deg: float | None = None, state: Mapping[str, float] | None = None
) -> IdealDrive:
    """Ideal drive: its speed is the command, for trying programs without a plant. Arguments as of `sim_drive`."""
    return IdealDrive(
        machine.control.scan_period_ms * 1e-3,
        machine.counts_per_turn,
        machine.axis.ratio,
        pos_rad=rad(_standing_deg(machine, angle_deg)) if state is None else state["pos_ideal"],
        zero_counts=float(_ideal_zero_counts(machine)),
        turns=machine.encoder.turns,
        quick_dec_rad_s2=rad(machine.virtual_axis.quick_dec_deg_s2),
    )


def _ideal_zero_counts(machine: Machine) -> int:
    # The middle of the encoder's range: as far from its wrap as it can be.
    return machine.encoder.turns * machine.counts_per_turn // 2
