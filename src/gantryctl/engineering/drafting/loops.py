"""Position loop, speed loop, compensations and monitors of a draft: from inertia, first mode and encoder."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.drafting.basis import Basis
from gantryctl.engineering.drafting.gains import DraftGains
from gantryctl.engineering.drafting.origin import Drafted, Values, chosen, computed, guessed, significant
from gantryctl.units import deg, rad

_SCAN_MS: Final = 1.0
# Part of the required angle that belongs to a window, and reserve over what the loop does by itself.
_BAND, _STANDSTILL, _ARRIVED = 0.3, 0.2, 0.05
_RESERVE: Final = 3.0


def following_error_deg(basis: Basis, gains: DraftGains) -> float:
    """Largest error of a sound loop at the axis: friction that turns round, and the jerk of a move (eq. (5))."""
    friction = basis.reversal_torque_nm * gains.tvi_s / gains.kvp_nm_s_per_rad / basis.ratio
    jerk = basis.train.inertia_kg_m2 * gains.tvi_s * rad(basis.jerk_deg_s3)
    return deg(friction + jerk / (gains.kpp_per_s * gains.kvp_nm_s_per_rad))


def loop_values(basis: Basis, gains: DraftGains) -> Values:
    """[control], [drive.speed_loop] and [monitors], as far as they belong to the machine."""
    return {**_gains(basis, gains), **_compensation(basis), **_monitors(basis, gains)}


def _gains(basis: Basis, gains: DraftGains) -> Values:
    peak = f"sensitivity {gains.sensitivity:.3g}; then `gantryctl tune`"
    return {
        "control.kpp_per_s": computed(
            significant(gains.kpp_per_s, 3), f"at most Kvp / 4 J, 0.8 x 2 pi first mode; {peak}"
        ),
        "drive.speed_loop.kvp_nm_s_per_rad": computed(
            significant(gains.kvp_nm_s_per_rad),
            f"near (rotor + input) / 3 ms, at most 1 % of rated torque a step of the encoder; {peak}",
        ),
        "drive.speed_loop.tvi_ms": computed(
            significant(1e3 * gains.tvi_s, 3),
            f"10 ms at least; leaves 80 % of the first mode's damping; {peak}",
        ),
        "drive.speed_loop.cycle_us": computed(
            1e6 * basis.cycle_s, "125 us, or less where rotor and transmission swing too fast for it"
        ),
        "drive.speed_loop.overload_time_s": basis.catalogue(basis.motor.drive.overload_time_s),
    }


def _compensation(basis: Basis) -> Values:
    """Settings of compensations that are off: those of another machine would be wrong as soon as one is on."""
    sheet, required, mode = basis.sheet, basis.required.angle_deg, basis.sheet.structure.first_mode_hz
    ratio, teeth = basis.ratio, sheet.teeth.pinion_teeth * sheet.gears.ring_ratio
    at = "control.compensation"
    # A wave that two sources share is identified once.
    waves = tuple(dict.fromkeys(round(wave, 6) for wave in (teeth, ratio, 2.0 * ratio, 4.0 * ratio)))
    return {
        f"{at}.first_mode_hz": computed(significant(min(25.0, mode)), "first mode, 25 Hz at most"),
        f"{at}.torque.limit_nm": computed(
            significant(0.25 * basis.motor.motor.torque_rated_nm), "a quarter of the rated torque"
        ),
        f"{at}.gear_map.cycles_per_turn": basis.follows(
            waves,
            "ring teeth; motor turns x 1, 2, 4",
            "teeth.pinion_teeth",
        ),
        f"{at}.gear_map.fade_hz": computed(significant(min(100.0, 4.0 * mode)), "4 x first mode"),
        f"{at}.gear_map.limit_deg": computed(
            significant(min(0.5, 0.5 * required)), "half the required angle"
        ),
        f"{at}.windup.reversal_length_deg": computed(
            significant(min(0.05, max(1e-4, 0.4**3 / 6.0 * basis.sheet.motion.acc_deg_s2 / mode**2))),
            "way of the first two fifths of an acceleration ramp: then the flank of the gears may change",
        ),
        f"{at}.load_encoder.integral_per_s": computed(
            significant(min(10.0, max(0.01, 0.5 * mode))), "half the first mode: what stands, not what swings"
        ),
        f"{at}.load_encoder.dead_band_deg": computed(
            significant(min(0.005, required / 1000.0)), "required angle / 1000"
        ),
        f"{at}.load_encoder.limit_deg": computed(
            significant(min(0.5, 0.5 * required)), "half the required angle"
        ),
        f"{at}.load_encoder.disagreement_deg": computed(
            significant(min(2.5, 0.4 * basis.room_deg, max(0.001, 0.5 * required, 2.0 * basis.windup_deg))),
            "half the required angle, or twice the largest wind-up; within what a stop leaves",
        ),
        f"{at}.damping.slow_s": computed(significant(min(20.0, max(0.1, 0.8 / mode))), "0.8 / first mode"),
    }


def _monitors(basis: Basis, gains: DraftGains) -> Values:
    required, v, step = basis.required.angle_deg, basis.speed_deg_s, basis.step_deg
    error = _RESERVE * following_error_deg(basis, gains)
    reaches_ms = 1e3 * basis.required.stopping_angle_deg / v
    arrived = max(_ARRIVED * required, 3.0 * step)

    def window(part: float) -> float:
        return significant(min(1.0, 0.1 * basis.room_deg, max(part * required, error, 1.5 * arrived)))

    def within(usual_ms: float) -> Drafted:
        value = min(usual_ms, significant(0.8 * reaches_ms, 2))
        return computed(value, f"{usual_ms:g} ms, or 0.8 x stopping angle / highest setting")

    mass = basis.motor.identity.mass_kg
    return {
        "monitors.following_error_base_deg": computed(
            window(_BAND), "0.3 x required angle, or 3 x what friction and jerk make"
        ),
        "monitors.velocity_deviation_deg_s": computed(significant(v / 12.0), "highest setting / 12"),
        "monitors.standstill_window_deg": computed(
            window(_STANDSTILL), "0.2 x required angle, or 3 x what friction makes"
        ),
        "monitors.in_position_window_deg": computed(
            significant(min(0.2, arrived)), "0.05 x required angle, or 3 steps of the encoder"
        ),
        "monitors.in_position_tolerance_time_s": computed(
            significant(max(3.0, 6.0 / basis.sheet.structure.first_mode_hz, 10.0 * gains.tvi_s)),
            "6 swings, 3 s at least",
        ),
        "monitors.torque_saturation_time_ms": within(200.0),
        "monitors.brake_feedback_time_ms": within(300.0),
        "monitors.lease_ms": within(250.0),
        "monitors.motor_thermal_time_constant_s": guessed(
            significant(300.0 * mass ** (1.0 / 3.0), 2), "300 s x cube root of the motor's kg"
        ),
        "brake.sag_max_deg": computed(window(_STANDSTILL), "as the standstill window"),
        "control.scan_period_ms": chosen(_SCAN_MS),
    }
