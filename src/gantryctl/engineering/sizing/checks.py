"""Checks of a motor against a requirement sheet: one line per demand, with what it takes and what there is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from gantryctl.engineering.sizing import equations as eq
from gantryctl.engineering.sizing.duty import Duty, duty
from gantryctl.engineering.sizing.motors import MotorFile
from gantryctl.engineering.sizing.sheet import Sheet
from gantryctl.engineering.sizing.train import Train
from gantryctl.units import behind


class Check(NamedTuple):
    """One demand: `used` may be at most `limit`, both in `unit`.

    Attributes:
        how: what `used` is made of, in words.
    """

    name: str
    used: float
    limit: float
    unit: str
    how: str

    @property
    def fits(self) -> bool:
        """The demand is met; rounding forgiven."""
        # A requirement that is met exactly is met: 1.1 x 1144 must not fail by an ulp.
        return self.used <= self.limit * (1.0 + 1e-9)

    @property
    def part(self) -> float:
        return self.used / self.limit if self.limit > 0.0 else math.inf

    @property
    def sentence(self) -> str:
        """Need against limit, for a table of what does not fit."""
        unit = behind(self.unit)
        return f"{self.name}: {self.used:.4g}{unit} needed ({self.how}), {self.limit:.4g}{unit} given"


@dataclass(frozen=True)
class Fit:
    """One motor on one sheet."""

    motor: MotorFile
    train: Train
    duty: Duty
    checks: tuple[Check, ...]

    @property
    def fits(self) -> bool:
        return all(check.fits for check in self.checks)

    @property
    def reasons(self) -> list[str]:
        """Why it does not fit, the worst first."""
        wrong = sorted((c for c in self.checks if not c.fits), key=lambda check: -check.part)
        return [check.sentence for check in wrong]

    @property
    def tightest(self) -> Check:
        """The demand that uses the largest part of what there is."""
        return max(self.checks, key=lambda check: check.part)


def usable_torque_nm(sheet: Sheet, motor: MotorFile) -> float:
    """Highest torque of the drive: the motor's, or what the reducer bears for a moment."""
    # The reducer and the base are the limit, not the motor: 35.2 kN m over 88 are 400 N m.
    return min(motor.motor.torque_max_nm, sheet.gears.torque_momentary_nm / sheet.gears.reducer_ratio)


def fit(sheet: Sheet, motor: MotorFile) -> Fit:
    """Hold one motor against a sheet."""
    train = Train(sheet, motor.motor.inertia_kg_m2)
    day = duty(train)
    checks = (*_speed_and_torque(sheet, motor, train), *_lasting(motor, train, day), *_encoder(sheet, motor))
    return Fit(motor, train, day, checks)


def _speed_and_torque(sheet: Sheet, motor: MotorFile, train: Train) -> list[Check]:
    speed = eq.motor_speed_r_min(sheet.motion.speed_max_r_min, train.ratio)
    largest = train.largest_nm(train.sizing_acc_rad_s2)
    highest = usable_torque_nm(sheet, motor)
    peak = motor.torque_at_nm(highest, speed)
    margins = sheet.margins
    checks = [
        Check(
            "speed",
            speed * margins.overspeed,
            motor.motor.speed_max_r_min,
            "r/min",
            f"{speed:.4g} x {margins.overspeed:g} overspeed",
        ),
        Check(
            "peak torque",
            largest * margins.peak_torque,
            peak,
            "N m",
            f"sizing case {largest:.4g} x {margins.peak_torque:g}, at {speed:.4g} r/min",
        ),
        Check("quick stop", train.quick_stop_nm, peak, "N m", "largest eccentric moment driving"),
    ]
    # Only a torque above the rated one is limited in time.
    if largest > motor.torque_at_nm(motor.motor.torque_rated_nm, speed):
        checks.append(
            Check(
                "overload time",
                sheet.motion.sizing_time_s,
                motor.drive.overload_time_s,
                "s",
                "the sizing case is above rated torque",
            )
        )
    return checks


def _lasting(motor: MotorFile, train: Train, day: Duty) -> list[Check]:
    sheet, rated = train.sheet, motor.motor.torque_rated_nm
    speed = eq.motor_speed_r_min(sheet.motion.speed_max_r_min, train.ratio)
    margins = sheet.margins
    return [
        Check(
            "normal moves",
            train.largest_nm(train.normal_acc_rad_s2),
            motor.torque_at_nm(rated, speed),
            "N m",
            "largest eccentric moment, within rated torque",
        ),
        Check("holding", train.hold_nm, rated, "N m", "largest eccentric moment at standstill"),
        Check(
            "thermal",
            day.cycle_rms_nm * margins.thermal,
            rated,
            "N m",
            f"r.m.s. of a cycle {day.cycle_rms_nm:.4g} x {margins.thermal:g}",
        ),
        Check(
            "brake",
            train.hold_nm * margins.brake,
            motor.brake.torque_nm,
            "N m",
            f"largest eccentric moment {train.hold_nm:.4g} x {margins.brake:g}",
        ),
        Check(
            "reducer",
            rated,
            usable_torque_nm(sheet, motor),
            "N m",
            "rated torque of the motor, within what the reducer bears for a moment",
        ),
        Check(
            "inertia ratio",
            train.inertia_ratio,
            margins.inertia_ratio_max,
            "-",
            "load over rotor and reducer input",
        ),
    ]


def _encoder(sheet: Sheet, motor: MotorFile) -> list[Check]:
    # The encoder of a linear axis must tell every angle of the travel from every other.
    modulo = sheet.range.kind == "modulo"
    return [
        Check(
            "encoder range",
            sheet.range.told_apart_deg / 360.0,
            eq.encoder_range_turns(motor.encoder.turns, sheet.gears.ratio),
            "turns",
            f"turns of the axis: {'the' if modulo else 'travel and the'} wrap margin on both sides",
        ),
        Check(
            "encoder step",
            eq.encoder_step_deg(motor.encoder.counts_per_turn, sheet.gears.ratio),
            sheet.required.angle_deg / sheet.margins.resolution,
            "deg",
            "one step at the axis, against the required accuracy",
        ),
    ]


def wrap_margin_deg(sheet: Sheet, motor: MotorFile) -> float:
    """Distance from travel to the wrap of a centred encoder, each side, deg; of a modulo axis, half the range."""
    turns = eq.encoder_range_turns(motor.encoder.turns, sheet.gears.ratio)
    covered = sheet.range.told_apart_deg - 2.0 * sheet.range.wrap_margin_min_deg
    return 0.5 * (360.0 * turns - covered)
