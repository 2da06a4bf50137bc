"""Settings of an axis, in SI, grouped by meaning.

`wiring` fills these from the machine file. Angles, speeds and accelerations are at the gantry unless a name
says motor. Times stay seconds here; `AxisSettings.scans` turns them into scans where they are used.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from typing import Final

from gantryctl._core import Compensation
from gantryctl.motion import MotionLimits
from gantryctl.program.alarms.words import Said, Words
from gantryctl.program.stretch import Sector, Stretch, stretch_around
from gantryctl.units import within_turn

_DEG: Final = math.pi / 180.0


@dataclass(frozen=True, slots=True)
class TravelSettings:
    """Limits of the angle.

    Attributes:
        pos_min_rad, pos_max_rad: the set-point never passes these two; infinite for a modulo axis.
        over_travel_min_rad, over_travel_max_rad: the measured angle trips outside these two.
        no_go_rad: sectors that neither set-point nor a stop may enter, begin below end.
        no_go_clearance_rad: the set-point keeps it to a sector; no sound motion trips there.
        no_go_margin_rad: a quick stop would end so far before a sector, for the load that swings on.
        no_go_lead_s: from a measured angle to the stop that it causes.
    """

    pos_min_rad: float
    pos_max_rad: float
    over_travel_min_rad: float
    over_travel_max_rad: float

    turn_from_rad: float = -math.pi
    """Where the turn of a modulo axis begins that its angles are shown in."""
    read_within_turn: bool = False
    """People read angles of a linear axis within 0 to 360 deg."""
    no_go_rad: tuple[Sector, ...] = ()
    no_go_clearance_rad: float = 0.0
    no_go_margin_rad: float = 0.0
    no_go_lead_s: float = 0.0

    def stretch(self, pos_rad: float) -> Stretch:
        """What the set-point can reach from an angle."""
        ends = (self.pos_min_rad, self.pos_max_rad)
        if not self.no_go_rad:
            return Stretch(*ends, None, None)
        clearance = self.no_go_clearance_rad
        return stretch_around(pos_rad, ends, self.no_go_rad, clearance, endless=self.endless)

    @property
    def endless(self) -> bool:
        """A modulo axis: it turns without end."""
        return math.isinf(self.pos_max_rad)

    def shown_rad(self, pos_rad: float) -> float:
        """An angle in tags and JSON: of a modulo axis, within its turn."""
        return within_turn(pos_rad, self.turn_from_rad, math.tau) if self.endless else pos_rad

    def read_end_rad(self, end_rad: float) -> float:
        """A limit of the angle in sentences: with its sign where both ends of travel read alike."""
        alike = self.over_travel_max_rad - self.over_travel_min_rad >= math.tau
        return end_rad if self.read_within_turn and alike else self.read_rad(end_rad)

    def read_rad(self, pos_rad: float) -> float:
        """An angle in sentences, as people read it."""
        # Beyond a turn it is no angle of the axis: what was typed is shown.
        if self.read_within_turn and abs(pos_rad) <= math.tau:
            return within_turn(pos_rad, 0.0, math.tau)
        return self.shown_rad(pos_rad)


@dataclass(frozen=True, slots=True)
class SpeedSettings:
    """The speed chain: setting < command clamp < drive ceiling < overspeed trip.

    Attributes:
        creep_rad_s: slow enough to count as standing for a new reference.
        without_enabling_switch_rad_s: highest speed by hand, or from a remote screen, without the enabling switch.
        brake_overdue_rad_s: highest speed while the brake test is overdue.
        rest_rad_s: slower is at rest, on the motor side: after a stop the load swings on by up to 0.53 deg/s.
    """

    # Ramps, short moves and override pass below the lowest setting; creep of service is a setting beside them.
    setting_min_rad_s: float
    setting_max_rad_s: float
    # At least 5 % above the highest setting: the reserve of the position loop for corrections.
    command_clamp_rad_s: float
    overspeed_trip_rad_s: float
    creep_rad_s: float = 0.1 * _DEG
    # On the reference plant a quick stop with 60 ms of reaction takes 0.16 deg from 1 deg/s and 3.75 deg from 6 deg/s.
    without_enabling_switch_rad_s: float = 1.0 * _DEG
    brake_overdue_rad_s: float = 1.0 * _DEG
    rest_rad_s: float = 0.02 * _DEG


@dataclass(frozen=True, slots=True)
class RampSettings:
    """Three decelerations: normal, jog-release, quick (the drive's own ramp). A jerk of inf gives trapezoids.

    Attributes:
        end_dec_rad_s2, end_jerk_rad_s3: the gentle end of a move to an angle; inf for none.
    """

    acc_rad_s2: float
    dec_rad_s2: float
    jerk_rad_s3: float
    # A released key must not coast on the normal ramp: tuned for accuracy, 0.393 deg/s2 takes 46 deg from 6 deg/s.
    jog_release_dec_rad_s2: float
    jog_release_jerk_rad_s3: float
    quick_dec_rad_s2: float
    end_dec_rad_s2: float = math.inf
    end_jerk_rad_s3: float = math.inf

    def below(
        self, acc_rad_s2: float | None, dec_rad_s2: float | None, jerk_rad_s3: float | None
    ) -> RampSettings:
        """These with another acceleration, deceleration and jerk of motions; None keeps what is there."""
        if acc_rad_s2 is None and dec_rad_s2 is None and jerk_rad_s3 is None:
            return self
        return replace(
            self,
            acc_rad_s2=self.acc_rad_s2 if acc_rad_s2 is None else acc_rad_s2,
            dec_rad_s2=self.dec_rad_s2 if dec_rad_s2 is None else dec_rad_s2,
            jerk_rad_s3=self.jerk_rad_s3 if jerk_rad_s3 is None else jerk_rad_s3,
        )

    def normal(self, vel_rad_s: float) -> MotionLimits:
        """Limits of a motion at `vel_rad_s`."""
        return MotionLimits(
            vel_rad_s,
            self.acc_rad_s2,
            self.dec_rad_s2,
            self.jerk_rad_s3,
            self.end_dec_rad_s2,
            self.end_jerk_rad_s3,
        )

    def jog_release(self, vel_rad_s: float) -> MotionLimits:
        """Limits of the stop after a jog key is released, of Stop, and of stops by an alarm."""
        return MotionLimits(
            vel_rad_s, self.acc_rad_s2, self.jog_release_dec_rad_s2, self.jog_release_jerk_rad_s3
        )


@dataclass(frozen=True, slots=True)
class LawSettings:
    """The position law and the encoder behind it.

    Attributes:
        ratio: motor turns per gantry turn.
        counts_per_turn: fine counts per motor turn, `DriveIdentity.counts_per_turn`.
        turns: multiturn range of the encoder in motor turns; it must not wrap within the travel plus `wrap_margin_rad`.
        turn_counts: exact counts of a turn of a modulo axis; None for a linear one. By a ratio that is rounded to a
            double, or to the digits of a data sheet, the angle would go astray turn by turn.
    """

    kpp_per_s: float
    kvf: float
    ratio: float
    counts_per_turn: float
    turns: int
    wrap_margin_rad: float = 5.0 * _DEG
    turn_counts: Fraction | None = None


@dataclass(frozen=True, slots=True)
class MonitorSettings:
    """Bands and times of the monitors.

    Attributes:
        encoder_shows_twist: its steps are finer than what torque does to a shaft at rest.
        twist_least_nm: less torque does not turn the shaft of the closed brake by a step of it.
        encoder_errors_max: that many bad readings within `encoder_errors_time_s` stop the axis.
        encoder_battery: a battery keeps the turns of the encoder while its supply is off.
        door_quick_stop: an opened room door is a quick stop; without, the jog-release ramp.
    """

    # 0.03 deg at rest, 0.10 deg at 6 deg/s.
    following_error_base_rad: float = 0.03 * _DEG
    following_error_per_speed_s: float = 0.012
    following_error_warning_ratio: float = 0.5
    following_error_time_s: float = 0.010
    velocity_deviation_rad_s: float = 0.5 * _DEG
    velocity_deviation_time_s: float = 0.020
    overspeed_time_s: float = 0.020
    standstill_window_rad: float = 0.02 * _DEG
    standstill_time_s: float = 0.010
    in_position_window_rad: float = 0.005 * _DEG
    in_position_dwell_s: float = 0.200
    in_position_tolerance_time_s: float = 3.0
    torque_saturation_time_s: float = 0.200
    # A jump is more than the speed explains: 2 deg/s beyond it for one scan, and 0.02 deg.
    encoder_jump_base_rad: float = 0.02 * _DEG
    encoder_jump_speed_rad_s: float = 2.0 * _DEG
    # Position against integrated speed: at most 0.0004 deg on the sound reference plant, in every stop.
    encoder_drift_max_rad: float = 0.045 * _DEG
    # Twice the highest motor speed, at the gantry. Beyond it a speed is an invalid reading.
    speed_reading_max_rad_s: float = 21.0 * _DEG
    # Full torque and brake on the bare rotor: 169 deg/s2 on the reference machine, where a brake stop shows 56. Without
    # inertia (an ideal drive) any change is possible.
    speed_change_max_rad_s2: float = math.inf
    # Acceleration of the bare rotor, at the gantry, by 1 N m.
    speed_change_per_torque: float = math.inf
    # Resolution and filter of the speed reading, and swings of the load: on the sound reference plant the drive changes
    # its speed by at most 0.07 deg/s in 10 ms, and a brake that closes against it by 0.15.
    speed_change_base_rad_s: float = 0.2 * _DEG
    encoder_frozen_speed_rad_s: float = 0.1 * _DEG
    encoder_frozen_time_s: float = 0.030
    # An encoder that stands to the count for so long, held by the drive, is tried; an ideal one cannot freeze.
    encoder_still_time_s: float = math.inf
    # More torque than that beside the learned one moves the shaft: at most 11 N m on the sound reference machine while
    # the count of a fine encoder stands for 30 ms.
    torque_still_max_nm: float = math.inf
    encoder_shows_twist: bool = False
    twist_least_nm: float = 0.0
    encoder_errors_max: int = 3
    encoder_errors_time_s: float = 0.100
    # Three scans of 10 ms; Feedback never takes fewer than three scans.
    reading_age_s: float = 0.030
    # Both channels of a chain switch within some 10 ms; half a second is a contact or a wire (fault catalogue G10).
    estop_discrepancy_time_s: float = 0.5
    # A period of the load's swing, or longer: within it torque that comes and goes is no load and no brake.
    swing_s: float = 0.5
    # More often than this within a minute is a loose wire, not people (fault catalogue G8).
    chatter_edges_max: int = 5
    chatter_time_s: float = 60.0
    door_quick_stop: bool = False
    encoder_battery: bool = False
    lease_s: float = 0.250


class StandstillPolicy(Enum):
    """What holds the axis at standstill."""

    SERVO = "servo"
    BRAKE = "brake"


@dataclass(frozen=True, slots=True)
class ThermalSettings:
    """Thermal protection of the motor; shares of its limit.

    Attributes:
        warning_share: a warning from here on, and motion again below it.
        refusal_share: from here on a motion that is under way ends, and no other begins.
    """

    torque_rated_nm: float = 257.0
    time_constant_s: float = 1800.0
    winding_max_c: float = 155.0
    # Fault catalogue G12.
    warning_share: float = 0.80
    refusal_share: float = 0.95


@dataclass(frozen=True, slots=True)
class PowerSettings:
    """Brake, torque proof and the times of the power sequence. Torques are the motor's.

    Attributes:
        torque_max_nm: no torque command passes it.
        torque_rated_nm: what the motor gives continuously.
        torque_preload: the drive adds `torque_ff_nm` to its torque (60B2 mapped); without, its own sequence is
            accepted, unproven.
        proof_share: the actual torque must reach this share of the torque asked for against the closed brake.
        proof_excess_nm: a reading that far beyond the torque asked for is wrong.
        settle_time_s: from the proof torque to the preload; as long again before the brake opens.
        learn_time_s: time constant of the learned holding torque.
        holding_torque_nm: learned holding torque from retained memory: the preload at the first release.
        test_torque_nm: what the closed brake must bear both ways in a brake test.
        running_torque_nm: what a steady motion may need until the axis has learned it, where that is more.
        wind_torque_nm: by which a moment from outside may change what a motion needs.
        brake_torque_nm: of the closed brake.
        brake_dec_least_rad_s2: slowest braking by which the highest speed keeps the permitted stopping angle.
        brake_stops_max: stops of a turning axis by the brake, from which on service is due.
        brake_by_drive: the drive works the brake by itself, and opens it as it is enabled.
        unseen_ramp_s: a ramp of which more is left, and whose speed nobody has seen for 0.1 s, is ended by the brake;
            infinite for a drive that owns its brake.
        watchdog_falls_s: a controller that was held up for so long may have let its watchdog relay fall, and the brake
            and the torque with it; infinite without a relay.
        untestable: why the brake cannot be tested by the controller, or nothing.
        unload_step_s: torque goes off in three steps of this length, each with a check of the brake.
    """

    torque_max_nm: float
    torque_rated_nm: float
    standstill: StandstillPolicy = StandstillPolicy.SERVO
    hold_brake_after_s: float = 30.0
    torque_preload: bool = True
    proof_torque_nm: float = 30.0
    proof_share: float = 0.8
    proof_excess_nm: float = 60.0
    proof_time_s: float = 0.5
    settle_time_s: float = 0.050
    learn_time_s: float = 1.0
    holding_torque_nm: float = 0.0
    sag_max_rad: float = 0.02 * _DEG
    sag_watch_s: float = 0.200
    brake_open_time_s: float = 0.100
    brake_close_time_s: float = 0.150
    brake_feedback_time_s: float = 0.300
    power_up_time_s: float = 2.0
    # At least 1.3 times the check moment at the motor: 56.8 N m on the reference machine (decision 14).
    test_torque_nm: float = 70.0
    running_torque_nm: float = 0.0
    wind_torque_nm: float = 0.0
    brake_torque_nm: float = 400.0
    # 6 deg/s, 0.15 s of brake and 4 deg.
    brake_dec_least_rad_s2: float = 5.8 * _DEG
    brake_stops_max: int = 1000
    brake_by_drive: bool = False
    unseen_ramp_s: float = math.inf
    watchdog_falls_s: float = math.inf
    untestable: Words | Said | None = None
    unload_step_s: float = 0.050
    slip_watch_s: float = 2.0


@dataclass(frozen=True, slots=True)
class CalibrationWatchSettings:
    """What the calibration says, SI at the axis, and how far the machine may be from it.

    Attributes:
        identity: of the calibration; what was seen belongs to it.
        inertia_load_kg_m2: behind the mesh. windup_per_acc_s2: wind-up per acceleration; 0 where it is not known.
        friction_load_nm: Coulomb friction behind the mesh. flank_nm: nearer to 0 the flank of the mesh is not known.
        torque_spread_nm: what torque may change by before anything was seen.
        residual_nm: what the balance of torques leaves of one sample.
        speed_min_rad_s: slower motion says nothing about friction.
        moment_bound_nm, friction_bound_nm, lost_motion_bound_rad, scale_bound_rad: of the change since the
            calibration. backlash_bound_rad: of the backlash itself. Infinite where nothing is watched.
    """

    identity: str
    moment_sine_nm: float
    moment_cosine_nm: float
    inertia_kg_m2: float
    inertia_load_kg_m2: float
    windup_per_acc_s2: float
    friction_nm: float
    friction_load_nm: float
    friction_load_ratio: float
    friction_nm_s_per_rad: float
    flank_nm: float
    torque_spread_nm: float
    residual_nm: float
    speed_min_rad_s: float
    moment_bound_nm: float = math.inf
    friction_bound_nm: float = math.inf
    backlash_bound_rad: float = math.inf
    lost_motion_bound_rad: float = math.inf
    scale_bound_rad: float = math.inf


@dataclass(frozen=True, slots=True)
class CompensationSettings:
    """Compensations of the position loop.

    Attributes:
        laws: switches, numbers and maps; every axis takes a copy.
        load_encoder: a load-side encoder is read, and watched against the motor's.
        moment_limit_nm: change of the eccentric moment that a person expects; infinite where none is observed.
        watch: what the calibration says of the machine, to warn when it no longer fits; None where nothing is watched.
    """

    laws: Compensation
    load_encoder: bool = False
    disagreement_rad: float = 0.05 * _DEG
    disagreement_time_s: float = 0.020
    moment_limit_nm: float = math.inf
    watch: CalibrationWatchSettings | None = None


@dataclass(frozen=True, slots=True)
class AxisSettings:
    """Settings of one axis."""

    period_s: float
    travel: TravelSettings
    speed: SpeedSettings
    ramps: RampSettings
    law: LawSettings
    power: PowerSettings
    monitors: MonitorSettings = field(default_factory=MonitorSettings)
    thermal: ThermalSettings = field(default_factory=ThermalSettings)
    compensation: CompensationSettings | None = None
    error_texts: Mapping[int, str] = field(default_factory=dict)
    """The maker's words for error codes of the drive, by code."""

    def scans(self, time_s: float, least: int = 2) -> int:
        """Whole scans that `time_s` lasts, rounded up, never fewer than `least`.

        Two is the least for a monitor that must see more than one reading. What cannot be a bad reading acts on
        the first: emergency stop, mains, limit switches, over-travel, drive state, a jump of the encoder, an
        encoder alarm, anything not finite.
        """
        return max(least, math.ceil(time_s / self.period_s - 1e-9))
