"""Rules of the monitors and of the accuracy test: thresholds that could never act, or would always act."""

from __future__ import annotations

import math
from itertools import pairwise

from gantryctl.machine.rules.book import (
    RATIO,
    Broken,
    above,
    advice,
    at_least,
    at_most,
    below,
    linear_rule,
    rule,
)
from gantryctl.machine.tables.model import Machine

COUNT = ("encoder.counts_per_turn", *RATIO)


@rule("monitors.standstill_window_deg", *COUNT)
def standstill_above_resolution(m: Machine) -> Broken:
    """The standstill window is at least two absolute encoder steps."""
    return at_least(m.monitors.standstill_window_deg, 2.0 * _step_deg(m), "two encoder steps")


@rule("monitors.in_position_window_deg", *COUNT)
def in_position_above_resolution(m: Machine) -> Broken:
    """The in-position window is at least two absolute encoder steps."""
    return at_least(m.monitors.in_position_window_deg, 2.0 * _step_deg(m), "two encoder steps")


@rule("brake.sag_max_deg", *COUNT)
def sag_above_resolution(m: Machine) -> Broken:
    """The permitted sag is at least two absolute encoder steps."""
    return at_least(m.brake.sag_max_deg, 2.0 * _step_deg(m), "two encoder steps")


@rule("monitors.in_position_window_deg", "monitors.following_error_base_deg")
def in_position_inside_following_error(m: Machine) -> Broken:
    """The in-position window is smaller than the following error at rest that trips."""
    limit = m.monitors.following_error_base_deg
    return below(m.monitors.in_position_window_deg, limit, "or the axis trips before it arrives")


@linear_rule(
    "monitors.following_error_base_deg",
    "axis.over_travel_min_deg",
    "axis.pos_min_deg",
    "axis.pos_max_deg",
    "axis.over_travel_max_deg",
)
def following_error_before_over_travel(m: Machine) -> Broken:
    """At the ends of travel the following error trips before over-travel does."""
    axis = m.axis
    room = min(axis.pos_min_deg - axis.over_travel_min_deg, axis.over_travel_max_deg - axis.pos_max_deg)
    return at_most(m.monitors.following_error_base_deg, room, "the room between travel and over-travel")


@rule(
    "monitors.following_error_base_deg",
    "monitors.following_error_warning_ratio",
    "virtual_axis.acc_deg_s2",
    "virtual_axis.dec_deg_s2",
    "virtual_axis.jog_release_dec_deg_s2",
    "control.scan_period_ms",
    "control.kpp_per_s",
    "drive.kind",
)
def following_error_beyond_accelerations(m: Machine) -> Broken:
    """A sound axis accelerates without a warning of its following error: acceleration x late / Kpp."""
    # A speed command is held for a scan, half a scan late on average, and a drive on a bus takes it one scan later.
    # Friction and jerk come on top: on a drafted rotary table (30 deg/s, 2026-11) 5.1 mdeg by this rule at 10 ms showed
    # as 3.2 more than at 1 ms, 15.2 on a bus as 11.3 more.
    virtual = m.virtual_axis
    steepest = max(virtual.acc_deg_s2, virtual.dec_deg_s2, virtual.jog_release_dec_deg_s2)
    late_s = (1.5 if m.on_bus else 0.5) * m.control.scan_period_ms * 1e-3
    least = steepest * late_s / (m.control.kpp_per_s * m.monitors.following_error_warning_ratio)
    why = "or every acceleration warns; a shorter scan, a gentler ramp or a stiffer loop needs less"
    return at_least(m.monitors.following_error_base_deg, least, why)


@advice(
    "control.kvf",
    "control.kpp_per_s",
    "speed.setting_max_deg_s",
    "monitors.following_error_base_deg",
    "monitors.following_error_per_speed_s",
    "monitors.following_error_warning_ratio",
)
def following_error_beyond_cruise(m: Machine) -> Broken:
    """At the highest setting a P loop keeps |1 - Kvf| x speed / Kpp of following error: within the band that warns."""
    control, monitors, speed = m.control, m.monitors, m.speed.setting_max_deg_s
    trips = monitors.following_error_base_deg + monitors.following_error_per_speed_s * speed
    warns = monitors.following_error_warning_ratio * trips
    kept = abs(1.0 - control.kvf) * speed / control.kpp_per_s
    if kept <= warns * (1.0 + 1e-9):
        return None
    limit, ends = (
        (trips, "trips: no motion at this speed ends by itself")
        if kept > trips
        else (warns, "warns in every motion at this speed")
    )
    # The band at rest and its widening, against an error that grows with the speed alone.
    ratio = monitors.following_error_warning_ratio
    slowest = ratio * monitors.following_error_base_deg * speed
    holds = slowest / (kept - ratio * monitors.following_error_per_speed_s * speed)
    holds = math.floor(holds * 1e3 + 1e-6) / 1e3
    off = warns * control.kpp_per_s / speed
    low, high = max(0.0, math.ceil((1.0 - off) * 1e3) / 1e3), math.floor((1.0 + off) * 1e3) / 1e3
    return (
        f"at {speed:g} deg/s the axis is {'behind' if control.kvf < 1.0 else 'ahead of'} its set-point by "
        f"{kept:.3g} deg (|1 - kvf| x speed / kpp_per_s), and {limit:.3g} deg {ends}; set kvf to 1 "
        f"({low:g} .. {high:g} holds), a higher kpp_per_s, or no speed above {holds:g} deg/s"
    )


@rule("monitors.velocity_deviation_deg_s", "speed.setting_max_deg_s")
def velocity_deviation_can_act(m: Machine) -> Broken:
    """The permitted velocity deviation is below the highest setting, or it could never act."""
    limit = m.speed.setting_max_deg_s
    return below(m.monitors.velocity_deviation_deg_s, limit, "or it never acts")


@rule("monitors.in_position_tolerance_time_s", "monitors.in_position_dwell_ms")
def tolerance_longer_than_dwell(m: Machine) -> Broken:
    """The time to come into position is longer than the dwell inside the window."""
    need = m.monitors.in_position_dwell_ms / 1000.0
    return above(m.monitors.in_position_tolerance_time_s, need, "the in-position dwell")


@rule("monitors.torque_saturation_time_ms", "drive.speed_loop.overload_time_s")
def saturation_within_overload(m: Machine) -> Broken:
    """Torque saturation trips before the overload time is used up."""
    most = 1000.0 * m.drive.speed_loop.overload_time_s
    return at_most(m.monitors.torque_saturation_time_ms, most, "the drive's overload time")


@rule("monitors.brake_feedback_time_ms", "brake.close_time_ms")
def feedback_waits_for_closing(m: Machine) -> Broken:
    """The brake feedback is given the time the brake needs to close."""
    return at_least(m.monitors.brake_feedback_time_ms, m.brake.close_time_ms, "the brake's closing time")


@rule("monitors.brake_feedback_time_ms", "brake.open_time_ms")
def feedback_waits_for_opening(m: Machine) -> Broken:
    """The brake feedback is given the time the brake needs to open."""
    return at_least(m.monitors.brake_feedback_time_ms, m.brake.open_time_ms, "the brake's opening time")


@rule("monitors.power_up_time_ms", "brake.open_time_ms", "control.scan_period_ms")
def power_up_waits_for_brake(m: Machine) -> Broken:
    """The power-up time covers the brake's opening and two scans."""
    need = m.brake.open_time_ms + 2.0 * m.control.scan_period_ms
    return at_least(m.monitors.power_up_time_ms, need, "the brake's opening time and two scans")


@rule("monitors.lease_ms", "control.scan_period_ms")
def lease_spans_scans(m: Machine) -> Broken:
    """The lease lasts at least two scans."""
    return at_least(m.monitors.lease_ms, 2.0 * m.control.scan_period_ms, "two scans")


@rule("monitors.lease_ms", "speed.setting_max_deg_s", "required.stopping_angle_deg")
def lease_within_stopping_angle(m: Machine) -> Broken:
    """At the highest setting a lost lease acts before the permitted stopping angle is used up."""
    most = 1000.0 * m.required.stopping_angle_deg / m.speed.setting_max_deg_s
    return at_most(m.monitors.lease_ms, most, "permitted stopping angle / highest setting")


# --- accuracy test ------------------------------------------------------------------------------------------
@rule("accuracy.average_s", "accuracy.dwell_s")
def average_within_dwell(m: Machine) -> Broken:
    """The averaged time lies inside the dwell."""
    return at_most(m.accuracy.average_s, m.accuracy.dwell_s, "the dwell")


@rule("accuracy.average_s", "control.scan_period_ms")
def average_spans_scans(m: Machine) -> Broken:
    """The averaged time holds at least two scans."""
    return at_least(m.accuracy.average_s, 0.002 * m.control.scan_period_ms, "two scans")


@rule("accuracy.bases_deg", "axis.pos_min_deg", "axis.pos_max_deg")
def bases_within_travel(m: Machine) -> Broken:
    """The bases of the chord test lie within travel."""
    low, high = m.axis.pos_min_deg, m.axis.pos_max_deg
    return None if all(low < base < high for base in m.accuracy.bases_deg) else "must lie within travel"


@rule("accuracy.bases_deg")
def bases_differ(m: Machine) -> Broken:
    """No base of the chord test is listed twice."""
    bases = m.accuracy.bases_deg
    twice = next((base for number, base in enumerate(bases) if base in bases[:number]), None)
    return (
        None if twice is None else f"must list {twice:g} deg once: chords from a base are measured once a run"
    )


@rule("accuracy.displacements_deg")
def displacements_ascend(m: Machine) -> Broken:
    """The displacements of the chord test ascend."""
    steps = m.accuracy.displacements_deg
    return None if all(a < b for a, b in pairwise(steps)) else "must ascend"


@rule("accuracy.speeds_deg_s", "speed.setting_min_deg_s", "speed.setting_max_deg_s")
def speeds_within_settings(m: Machine) -> Broken:
    """The speeds of the speed test lie between the lowest and the highest setting."""
    low, high = m.speed.setting_min_deg_s, m.speed.setting_max_deg_s
    inside = all(low <= speed <= high for speed in m.accuracy.speeds_deg_s)
    return None if inside else "must lie between the lowest and the highest setting"


@rule("accuracy.dwell_s", "monitors.in_position_dwell_ms")
def dwell_longer_than_arrival(m: Machine) -> Broken:
    """The rest at each point is not shorter than the in-position dwell."""
    return at_least(m.accuracy.dwell_s, m.monitors.in_position_dwell_ms / 1000.0, "the in-position dwell")


def _step_deg(m: Machine) -> float:
    """One absolute encoder step at the gantry."""
    return 360.0 / (m.encoder.counts_per_turn * m.axis.ratio)
