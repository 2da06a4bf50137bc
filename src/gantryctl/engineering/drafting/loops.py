"""Position loop, speed loop, compensations and monitors of a draft: from inertia, first mode and encoder."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from gantryctl.engineering.drafting.basis import Basis
from gantryctl.engineering.drafting.gains import DraftGains
from gantryctl.engineering.drafting.origin import Drafted, Values, chosen, computed, guessed, significant
from gantryctl.units import deg, rad

_SCAN_MS: Final = 1.0
# Part of the required angle that belongs to a window, and reserve over what the loop does by itself.
_BAND, _STANDSTILL, _ARRIVED, _ARRIVED_MOST = 0.3, 0.2, 0.05, 0.3
_RESERVE: Final = 3.0
# s in which an axis is expected in its window, and which are late; reserve for more friction than drafted.
_ARRIVES_S: Final = 3.0
_LATE_S: Final = 10.0
_ARRIVAL_RESERVE: Final = 1.5


def following_error_deg(basis: Basis, gains: DraftGains) -> float:
    """Largest error of a sound loop at the axis, eq. (5).

    Friction that turns round, and the jerk of a move or of a jog key that is let go.
    """
    jerk_deg_s3 = max(basis.jerk_deg_s3, basis.release_jerk_deg_s3)
    jerk = basis.train.inertia_kg_m2 * gains.tvi_s * rad(jerk_deg_s3)
    return _friction_deg(basis, gains) + deg(jerk / (gains.kpp_per_s * gains.kvp_nm_s_per_rad))


def _friction_deg(basis: Basis, gains: DraftGains) -> float:
    return deg(basis.reversal_torque_nm * gains.tvi_s / gains.kvp_nm_s_per_rad / basis.ratio)


class Arrival(NamedTuple):
    """When a sound axis of a draft counts as arrived.

    Attributes:
        window_deg: distance that counts as arrived. after_s: until then it is there, behind the end of a motion.
    """

    window_deg: float
    after_s: float


def arrival(basis: Basis, gains: DraftGains) -> Arrival:
    """Window and time that friction of the motor leaves a P loop over a PI loop.

    Behind a motion the error decays by exp(-Kpp t). An error e of a motor that stands asks the speed loop for Kpp e i,
    by which its torque grows with Kvp Kpp e i / Tvi; until that has turned the friction round, nothing moves.
    """
    least = max(_ARRIVED * basis.required.angle_deg, 3.0 * basis.step_deg)
    stands = _ARRIVAL_RESERVE * _friction_deg(basis, gains) / gains.kpp_per_s
    window = min(0.2, max(least, min(_ARRIVED_MOST * basis.required.angle_deg, stands / _ARRIVES_S)))
    decays = math.log(max(1.0, following_error_deg(basis, gains) / window)) / gains.kpp_per_s
    usual = max(_ARRIVES_S, 6.0 / basis.sheet.structure.first_mode_hz, 10.0 * gains.tvi_s)
    return Arrival(window, max(usual, _ARRIVAL_RESERVE * decays + stands / window))


class SoftLoop(NamedTuple):
    """A loop that is too soft for its axis: a small motor or a coarse encoder before much inertia or friction.

    Attributes:
        following_error_deg: of a sound axis. band_deg: most that a monitor may permit it, by the room of the stops.
        window_deg: distance that counts as arrived. arrives_s: behind the end of a motion.
    """

    following_error_deg: float
    band_deg: float
    window_deg: float
    arrives_s: float

    @property
    def text(self) -> str:
        """One sentence, with what would help."""
        return (
            f"a sound axis follows with up to {self.following_error_deg:.2g} deg (band {self.band_deg:.2g} deg), and "
            f"is within {self.window_deg:.2g} deg of its target {self.arrives_s:.0f} s behind a motion: a larger "
            "motor, a finer encoder, a larger ratio, less friction or less jerk"
        )


def soft_loop(basis: Basis, gains: DraftGains) -> SoftLoop | None:
    """Whether the loop does not keep its own band, or comes late to its window; None where it does both."""
    error, there, band = following_error_deg(basis, gains), arrival(basis, gains), _band_most_deg(basis)
    if _RESERVE * error <= band and there.after_s <= max(_LATE_S, 6.0 / basis.sheet.structure.first_mode_hz):
        return None
    return SoftLoop(error, band, there.window_deg, there.after_s)


def _band_most_deg(basis: Basis) -> float:
    return min(1.0, 0.1 * basis.room_deg)


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
    required, v = basis.required.angle_deg, basis.speed_deg_s
    error = _RESERVE * following_error_deg(basis, gains)
    reaches_ms = 1e3 * basis.required.stopping_angle_deg / v
    arrived = arrival(basis, gains)

    def window(part: float) -> float:
        return significant(
            min(1.0, 0.1 * basis.room_deg, max(part * required, error, 1.5 * arrived.window_deg))
        )

    def within(usual_ms: float) -> Drafted:
        value = min(usual_ms, significant(0.8 * reaches_ms, 2))
        return computed(value, f"{usual_ms:g} ms, or 0.8 x stopping angle / highest setting")

    mass = basis.motor.identity.mass_kg
    running_nm = min(significant(basis.running_torque_nm, 3), basis.motor.motor.torque_rated_nm)
    # Where friction is above everything; else the torque of the brake test is more.
    running: Values = (
        {}
        if running_nm <= basis.test_torque_nm
        else {
            "monitors.running_torque_nm": computed(
                running_nm, "moment of the check, and friction at the highest setting"
            )
        }
    )
    wind_nm = min(significant(basis.wind_torque_nm, 3), basis.motor.motor.torque_rated_nm)
    wind: Values = (
        {"monitors.wind_torque_nm": computed(wind_nm, "largest moment of the wind, at the motor")}
        if wind_nm
        else {}
    )
    return {
        **running,
        **wind,
        "monitors.following_error_base_deg": computed(
            window(_BAND), "0.3 x required angle, or 3 x what friction and jerk make"
        ),
        "monitors.velocity_deviation_deg_s": computed(significant(v / 12.0), "highest setting / 12"),
        "monitors.standstill_window_deg": computed(
            window(_STANDSTILL), "0.2 x required angle, or 3 x what friction makes"
        ),
        "monitors.in_position_window_deg": computed(
            significant(arrived.window_deg),
            "0.05 to 0.3 x required angle by friction, or 3 steps of the encoder",
        ),
        "monitors.in_position_tolerance_time_s": computed(
            significant(min(100.0, arrived.after_s)),
            "6 swings, 3 s at least; 1.5 x decay of the error and friction",
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
