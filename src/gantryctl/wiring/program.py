"""Machine file to the settings of the PLC program, in SI; reads nothing of [plant]."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

from gantryctl import _core
from gantryctl.machine import Machine
from gantryctl.machine.tables.axis import VirtualAxisTable
from gantryctl.motion import MotionLimits
from gantryctl.program.alarms.words import Said, Words
from gantryctl.program.settings import (
    AxisSettings,
    LawSettings,
    MonitorSettings,
    PowerSettings,
    RampSettings,
    SpeedSettings,
    StandstillPolicy,
    ThermalSettings,
    TravelSettings,
)
from gantryctl.units import rad, rad_s_from_r_min
from gantryctl.wiring.compensation import compensation_settings

# The program does not know the machine file (decision 0003), and nothing that controls may read [plant]: a test
# changes [plant] and finds the same settings.
_MS: Final = 1e-3
# A reading that stands still for so long is tried (A3): the longest of a sound one under load is 0.09 s.
_STILL_S: Final = 0.25
# Of the rated torque: 40 N m on the reference gantry. A motor of 200 W never comes to these.
_STILL_TORQUE_SHARE: Final = 40.0 / 257.0
# 30 N m turn the reference shaft by 3.75e-5 rad against its closed brake of 400: 1.6 steps of such an encoder.
_FINE_STEPS: Final = 2**18
_TWIST_SHARE: Final = 30.0 / 400.0


def axis_settings(
    machine: Machine,
    holding_torque_nm: float = 0.0,
    torque_preload: bool = True,
    speed_max_deg_s: float = math.inf,
    quick_dec_deg_s2: float | None = None,
    error_texts: Mapping[int, str] = MappingProxyType({}),
) -> AxisSettings:
    """Settings of one axis.

    Args:
        holding_torque_nm: learned holding torque from retained memory, motor side: the preload at the first
            release of the brake.
        torque_preload: the drive takes a torque beside the speed.
        speed_max_deg_s: highest speed setting where it is below that of the machine file.
        quick_dec_deg_s2: quick-stop ramp of the drive where it has its own; that of the machine file when not given.
        error_texts: the maker's words for error codes of the drive.
    """
    encoder = machine.encoder
    return AxisSettings(
        period_s=machine.control.scan_period_ms * _MS,
        travel=travel_settings(machine),
        speed=speed_settings(machine, speed_max_deg_s),
        ramps=_ramps(machine, quick_dec_deg_s2),
        law=LawSettings(
            kpp_per_s=machine.control.kpp_per_s,
            kvf=machine.control.kvf,
            ratio=machine.axis.ratio,
            counts_per_turn=machine.counts_per_turn,
            turns=encoder.turns,
            wrap_margin_rad=rad(encoder.wrap_margin_min_deg),
            turn_counts=machine.axis.gear * machine.counts_per_turn if machine.axis.modulo else None,
        ),
        power=_power(machine, holding_torque_nm, torque_preload),
        monitors=_monitors(machine),
        thermal=ThermalSettings(
            torque_rated_nm=machine.motor.torque_rated_nm,
            time_constant_s=machine.monitors.motor_thermal_time_constant_s,
            winding_max_c=machine.monitors.motor_temp_max_c,
        ),
        compensation=compensation_settings(machine),
        error_texts=error_texts,
    )


_REST_DEG_S: Final = 0.02
_REST_PARTS: Final = 300.0
_REST_STEPS: Final = 2.0
# A reading of two scans ago, the scan that judges it, and one until its command acts.
_NO_GO_SCANS: Final = 4


def travel_settings(machine: Machine) -> TravelSettings:
    """Limits of the angle; a modulo axis has none."""
    axis = machine.axis
    if axis.modulo:
        limits = TravelSettings(-math.inf, math.inf, -math.inf, math.inf, rad(axis.pos_min_deg))
    else:
        limits = TravelSettings(
            pos_min_rad=rad(axis.pos_min_deg),
            pos_max_rad=rad(axis.pos_max_deg),
            over_travel_min_rad=rad(axis.over_travel_min_deg),
            over_travel_max_rad=rad(axis.over_travel_max_deg),
            read_within_turn=axis.display == "0..360",
        )
    if not axis.no_go_deg:
        return limits
    lead_s = 1e-3 * _NO_GO_SCANS * machine.control.scan_period_ms
    # A sound axis stays within the following error that trips; the load swings on by less than that in a quick stop.
    margin_rad = rad(machine.monitors.following_error_base_deg)
    return replace(
        limits,
        no_go_rad=tuple((rad(begin), rad(end)) for begin, end in axis.sectors_deg),
        no_go_margin_rad=margin_rad,
        no_go_lead_s=lead_s,
        no_go_clearance_rad=2.0 * margin_rad + _way_ahead_rad(machine, lead_s),
    )


def _way_ahead_rad(machine: Machine, lead_s: float) -> float:
    """Largest v T + v^2/2 (1/a_quick - 1/a_jog): how far the quick stop that a monitor foresees lies beyond a ramp."""
    virtual, top = machine.virtual_axis, rad(machine.speed.setting_max_deg_s)
    # The jog-release ramp is the steepest that a sound axis stops with.
    k = 0.5 * (1.0 / rad(virtual.jog_release_dec_deg_s2) - 1.0 / rad(virtual.quick_dec_deg_s2))
    vel = top if k <= 0.0 else min(top, 0.5 * lead_s / k)
    return max(0.0, vel * lead_s - k * vel * vel)


def speed_settings(machine: Machine, speed_max_deg_s: float = math.inf) -> SpeedSettings:
    """Speed chain; `speed_max_deg_s` is a limit beside the highest setting."""
    speed = machine.speed
    return SpeedSettings(
        setting_min_rad_s=rad(speed.setting_min_deg_s),
        setting_max_rad_s=rad(min(speed.setting_max_deg_s, speed_max_deg_s)),
        command_clamp_rad_s=rad(speed.command_clamp_deg_s),
        overspeed_trip_rad_s=rad(speed.overspeed_trip_deg_s),
        creep_rad_s=rad(speed.creep_deg_s),
        rest_rad_s=rad(rest_speed_deg_s(machine)),
    )


def rest_speed_deg_s(machine: Machine) -> float:
    """Speed below which the axis counts as at rest, on the motor side, deg/s at the gantry.

    0.02 deg/s, where that is little beside the speeds of the axis: at most a 300th of the highest setting, and half
    of the lowest. But never less than two steps of the speed reading: a shaft that stands between two counts is read
    as one step either way. A reading so coarse that this is much of the highest setting is refused before the axis
    moves (`engineering.stops.check_quick_stop`).
    """
    speed = machine.speed
    slow = min(_REST_DEG_S, speed.setting_max_deg_s / _REST_PARTS, 0.5 * speed.setting_min_deg_s)
    return max(_REST_STEPS * speed_step_deg_s(machine), slow)


def speed_step_deg_s(machine: Machine) -> float:
    """Smallest speed but 0 that is read, deg/s at the gantry; 0 for an ideal drive.

    One count of the speed loop in its cycle. On a bus at least one unit of 606C, and, where the drive has none, one
    increment of 6064 in a scan.
    """
    if machine.drive.kind == "ideal":
        return 0.0
    cycle_s = machine.drive.speed_loop.cycle_us * 1e-6
    turn_s = 1.0 / (machine.speed_counts_per_turn * cycle_s)
    if machine.on_bus:
        from gantryctl.drives.od.velocity_units import VELOCITY_UNITS

        can = machine.can
        # The drive says at its set-up which profile it has: until then the coarsest unit.
        unit = VELOCITY_UNITS["r/min" if can.velocity_unit == "profile" else can.velocity_unit]
        per_turn_s = unit.per_turn_s or unit.per_increment_s * can.increments_per_turn
        scan_s = machine.control.scan_period_ms * _MS
        turn_s = max(turn_s, 1.0 / per_turn_s, 1.0 / (can.increments_per_turn * scan_s))
    return 360.0 * turn_s / machine.axis.ratio


def _ramps(machine: Machine, quick_dec_deg_s2: float | None) -> RampSettings:
    virtual = machine.virtual_axis
    return RampSettings(
        acc_rad_s2=rad(virtual.acc_deg_s2),
        dec_rad_s2=rad(virtual.dec_deg_s2),
        jerk_rad_s3=rad(virtual.jerk_deg_s3) if virtual.profile == "jerk_limited" else math.inf,
        jog_release_dec_rad_s2=rad(virtual.jog_release_dec_deg_s2),
        jog_release_jerk_rad_s3=rad(virtual.jog_release_jerk_deg_s3),
        quick_dec_rad_s2=rad(quick_dec_deg_s2 or virtual.quick_dec_deg_s2),
        end_dec_rad_s2=rad(virtual.end_dec_deg_s2) if virtual.gentle_end else math.inf,
        end_jerk_rad_s3=rad(virtual.end_jerk_deg_s3) if virtual.gentle_end else math.inf,
    )


def _power(machine: Machine, holding_torque_nm: float, torque_preload: bool) -> PowerSettings:
    brake, monitors = machine.brake, machine.monitors
    return PowerSettings(
        torque_max_nm=machine.motor.torque_max_nm,
        torque_rated_nm=machine.motor.torque_rated_nm,
        standstill=StandstillPolicy(brake.hold),
        hold_brake_after_s=brake.hold_brake_after_s,
        torque_preload=torque_preload,
        proof_torque_nm=brake.proof_torque_nm,
        holding_torque_nm=holding_torque_nm,
        sag_max_rad=rad(brake.sag_max_deg),
        brake_open_time_s=brake.open_time_ms * _MS,
        brake_close_time_s=brake.close_time_ms * _MS,
        brake_feedback_time_s=monitors.brake_feedback_time_ms * _MS,
        test_torque_nm=brake.test_torque_nm,
        running_torque_nm=monitors.running_torque_nm,
        wind_torque_nm=monitors.wind_torque_nm,
        brake_torque_nm=brake.torque_nm,
        brake_dec_least_rad_s2=rad(_brake_dec_least_deg_s2(machine)),
        brake_stops_max=brake.emergency_stops_max,
        # The simulated drive always obeys the brake command.
        brake_by_drive=machine.on_bus and brake.owner == "drive",
        unseen_ramp_s=_unseen_ramp_s(machine),
        watchdog_falls_s=_watchdog_falls_s(machine),
        untestable=untestable(machine, torque_preload),
        power_up_time_s=monitors.power_up_time_ms * _MS,
    )


def _unseen_ramp_s(machine: Machine) -> float:
    """How much of a ramp that nobody sees must be left for the brake to end it; see `PowerSettings`.

    A brake of the controller closes within any ramp. A drive that owns its brake takes its torque off first, and how
    far the load goes then is in [plant], which nothing that controls may read: its ramp is trusted.
    """
    return math.inf if machine.on_bus and machine.brake.owner == "drive" else 0.0


def _watchdog_falls_s(machine: Machine) -> float:
    """Time of the relay, and the last edge may be older than the last scan by a quarter of it."""
    if not (machine.on_bus and machine.can.output_place("watchdog")):
        return math.inf
    return 0.75 * machine.can.watchdog_ms * _MS


def _brake_dec_least_deg_s2(machine: Machine) -> float:
    """v^2 / 2 (A - v t): what brakes less from the highest speed, behind a brake that takes t, leaves the angle A."""
    speed = machine.speed.setting_max_deg_s
    left_deg = machine.required.stopping_angle_deg - speed * machine.brake.close_time_ms * _MS
    return 0.5 * speed**2 / left_deg if left_deg > 0.0 else math.inf


def untestable(machine: Machine, torque_preload: bool = True) -> Words | Said | None:
    """Reason why the controller cannot test the brake, or None."""
    # A test keeps the brake closed while the drive gives torque. A drive that owns its brake opens it whenever it is
    # enabled, and without 60B2 and 6077 there is no torque to prove. The simulated drive always obeys the brake
    # command.
    if not machine.on_bus:
        return None
    if machine.brake.owner == "drive":
        return Words.DRIVE_OWNS_BRAKE(owner=machine.brake.owner)
    if not torque_preload:
        return Words.NO_TORQUE_INPUT
    return None


# Of the permitted deviation of the speed: 0.2 deg/s on the reference gantry.
_CHANGE_SHARE: Final = 0.4
# Where the load swings faster the monitors keep the time of the reference gantry: taps of a key come no faster.
_SWING_LEAST_S: Final = 0.5


def _monitors(machine: Machine) -> MonitorSettings:
    m, motor, ratio = machine.monitors, machine.motor, machine.axis.ratio
    ideal, fine = machine.drive.kind == "ideal", _fine_encoder(machine)
    per_torque = math.inf if ideal else 1.0 / (motor.inertia_kg_m2 * ratio)
    return MonitorSettings(
        encoder_still_time_s=math.inf if ideal else _STILL_S,
        torque_still_max_nm=_STILL_TORQUE_SHARE * motor.torque_rated_nm if fine else math.inf,
        encoder_shows_twist=fine,
        twist_least_nm=_TWIST_SHARE * machine.brake.torque_nm * _FINE_STEPS / machine.counts_per_turn,
        speed_reading_max_rad_s=2.0 * rad_s_from_r_min(motor.speed_max_r_min) / ratio,
        speed_change_max_rad_s2=(motor.torque_max_nm + machine.brake.torque_nm) * per_torque,
        speed_change_per_torque=per_torque,
        speed_change_base_rad_s=_CHANGE_SHARE * rad(m.velocity_deviation_deg_s),
        following_error_base_rad=rad(m.following_error_base_deg),
        following_error_per_speed_s=m.following_error_per_speed_s,
        following_error_warning_ratio=m.following_error_warning_ratio,
        following_error_time_s=m.following_error_time_ms * _MS,
        velocity_deviation_rad_s=rad(m.velocity_deviation_deg_s),
        velocity_deviation_time_s=m.velocity_deviation_time_ms * _MS,
        overspeed_time_s=m.overspeed_time_ms * _MS,
        standstill_window_rad=rad(m.standstill_window_deg),
        standstill_time_s=m.standstill_time_ms * _MS,
        in_position_window_rad=rad(m.in_position_window_deg),
        in_position_dwell_s=m.in_position_dwell_ms * _MS,
        in_position_tolerance_time_s=m.in_position_tolerance_time_s,
        torque_saturation_time_s=m.torque_saturation_time_ms * _MS,
        lease_s=m.lease_ms * _MS,
        swing_s=max(_SWING_LEAST_S, 1.0 / machine.control.compensation.first_mode_hz),
        encoder_battery=m.encoder_battery,
        door_quick_stop=m.door_reaction == "quick_stop",
    )


def _fine_encoder(machine: Machine) -> bool:
    """Whether the steps that the controller sees are finer than what torque does to a shaft at rest."""
    if machine.drive.kind == "ideal":
        return False
    coarse = not machine.on_bus and machine.drive.speed_loop.feedback == "counts"
    return (machine.encoder.counts_per_turn if coarse else machine.counts_per_turn) >= _FINE_STEPS


def position_law(machine: Machine) -> _core.PositionLaw:
    """Position loop of the controller."""
    # Equation 4 of the paper: w_cmd = i (Kpp (r - y/i) + Kvf r'), y the motor angle.
    ratio = machine.axis.ratio
    return _core.PositionLaw(
        kpp_per_s=machine.control.kpp_per_s,
        kvf=machine.control.kvf,
        ratio=ratio,
        counts_per_turn=machine.counts_per_turn,
        vel_max_rad_s=rad(machine.speed.command_clamp_deg_s) * ratio,
    )


def motion_limits(machine: Machine, vel_deg_s: float | None = None) -> MotionLimits:
    """Speed, acceleration, deceleration and jerk of a normal move, SI at the gantry.

    Args:
        vel_deg_s: speed of the move; the highest speed setting when not given.
    """
    axis = machine.virtual_axis
    return MotionLimits(
        vel_rad_s=rad(vel_deg_s or machine.speed.setting_max_deg_s),
        acc_rad_s2=rad(axis.acc_deg_s2),
        dec_rad_s2=rad(axis.dec_deg_s2),
        jerk_rad_s3=rad(axis.jerk_deg_s3) if axis.profile == "jerk_limited" else math.inf,
        end_dec_rad_s2=rad(axis.end_dec_deg_s2) if axis.gentle_end else math.inf,
        end_jerk_rad_s3=rad(axis.end_jerk_deg_s3) if axis.gentle_end else math.inf,
    )


def ramps_deg(machine: Machine, speed_deg_s: float) -> float:
    """Shortest move that reaches a speed, deg: the way of both ramps."""
    axis = machine.virtual_axis
    way = 0.5 * speed_deg_s**2 * (1.0 / axis.acc_deg_s2 + 1.0 / axis.dec_deg_s2)
    if axis.profile == "jerk_limited":
        # A jerk-limited ramp takes acc/jerk longer than a trapezoid, at half of the speed on average.
        way += 0.5 * speed_deg_s * (axis.acc_deg_s2 + axis.dec_deg_s2) / axis.jerk_deg_s3
    return way + (_gentle_end_deg(axis) if axis.gentle_end else 0.0)


def _gentle_end_deg(axis: VirtualAxisTable) -> float:
    """Most by which a gentle end lengthens the ramp, deg: time that it lasts longer, at the speed it begins with."""
    dec = min(axis.end_dec_deg_s2, axis.dec_deg_s2)
    longer_s = max(0.0, dec / axis.end_jerk_deg_s3 - dec / axis.jerk_deg_s3)
    return longer_s * 0.5 * dec * dec / axis.end_jerk_deg_s3
