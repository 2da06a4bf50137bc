"""Quantities that several rules need: a sheet with its motor in SI."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from gantryctl.engineering.drafting.origin import Drafted, Origin, significant
from gantryctl.engineering.sizing.checks import Fit, usable_torque_nm
from gantryctl.engineering.sizing.motors import MotorFile
from gantryctl.engineering.sizing.sheet import Sheet
from gantryctl.engineering.sizing.train import Train
from gantryctl.machine.specs import Value
from gantryctl.machine.tables.fields import Table
from gantryctl.machine.tables.required import RequiredTable
from gantryctl.units import DEG_S_PER_R_MIN, deg, rad

# A quick stop is asked for 10 % harder than the permitted angle demands: times of monitors live on what that leaves.
_QUICK_RESERVE: Final = 1.1
_QUICK_OVER_MOVE: Final = 1.5
# Servo cycles of drives, the usual one first; and what the simulator follows: natural frequency x cycle of the rotor on
# a transmission that slopes, hysteresis and load of a brake stop make 14 times as stiff. Above 0.35 the brake stop of a
# small table swung up.
_CYCLES_S: Final = (125e-6, 62.5e-6, 31.25e-6)
_STIFFER, _FOLLOWED = 14.0, 0.3


@dataclass(frozen=True)
class Basis:
    """One sheet with one motor that fits it."""

    fit: Fit

    @property
    def sheet(self) -> Sheet:
        """The requirement sheet."""
        return self.fit.train.sheet

    @property
    def motor(self) -> MotorFile:
        """The motor with its encoder and brake."""
        return self.fit.motor

    @property
    def train(self) -> Train:
        """Rigid drive train of sheet and motor."""
        return self.fit.train

    @property
    def ratio(self) -> float:
        """Motor turns per turn of the axis."""
        return self.sheet.gears.ratio

    @property
    def required(self) -> RequiredTable:
        """What the axis must do."""
        return self.sheet.required

    @property
    def speed_deg_s(self) -> float:
        """Highest speed setting."""
        return round(self.sheet.motion.speed_max_r_min * DEG_S_PER_R_MIN, 12)

    @property
    def quick_dec_deg_s2(self) -> float:
        """Quick stop: 1.1 x v^2 / 2 (permitted angle - 60 ms x v), and 1.5 x the acceleration of a move at least."""
        by_angle = _QUICK_RESERVE * deg(self.train.quick_dec_rad_s2)
        return max(by_angle, _QUICK_OVER_MOVE * self.sheet.motion.acc_deg_s2)

    @property
    def room_deg(self) -> float:
        """What a quick stop leaves of the permitted angle: monitors act within it."""
        return self.required.stopping_angle_deg - self.speed_deg_s**2 / (2.0 * self.quick_dec_deg_s2)

    @property
    def jerk_deg_s3(self) -> float:
        """Jerk that reaches the acceleration within one period of the first mode, so that the swing ends with it."""
        return self.sheet.motion.acc_deg_s2 * self.sheet.structure.first_mode_hz

    @property
    def release_dec_deg_s2(self) -> float:
        """A jog key that is let go stops between the gentle and the hard way: their geometric mean."""
        return math.sqrt(self.sheet.motion.acc_deg_s2 * self.quick_dec_deg_s2)

    @property
    def release_jerk_deg_s3(self) -> float:
        """Jerk that reaches this deceleration in 0.1 s."""
        return 10.0 * self.release_dec_deg_s2

    @property
    def mode_rad_s(self) -> float:
        """First mode of the load with the motor held."""
        return 2.0 * math.pi * self.sheet.structure.first_mode_hz

    @property
    def stiffness_nm_per_rad(self) -> float:
        """What the load stands on, transmission and base in series, at the axis: J (2 pi f)^2."""
        return self.sheet.load.inertia_kg_m2 * self.mode_rad_s**2

    @property
    def base_frequency_hz(self) -> float:
        """Rocking frequency of the base, by the sheet's ratio; at most what a machine file takes."""
        structure = self.sheet.structure
        return min(200.0, structure.base_frequency_ratio * structure.first_mode_hz)

    @property
    def base_inertia_kg_m2(self) -> float:
        """Rocking inertia of the base, by the sheet's ratio."""
        return self.sheet.structure.base_inertia_ratio * self.sheet.load.inertia_kg_m2

    @property
    def base_stiffness_nm_per_rad(self) -> float:
        """Its stiffness, Jb (2 pi fb)^2."""
        return self.base_inertia_kg_m2 * (2.0 * math.pi * self.base_frequency_hz) ** 2

    @property
    def largest_moment_nm(self) -> float:
        """Largest steady moment at the axis: the eccentric moment of the check and running friction."""
        load = self.sheet.load
        viscous = load.friction_viscous_nm_s_per_rad * rad(self.speed_deg_s)
        return load.eccentric_check_moment_nm + load.friction_coulomb_nm + viscous

    @property
    def test_torque_nm(self) -> float:
        """Torque that the closed brake must bear in its test."""
        check_nm = self.sheet.load.eccentric_check_moment_nm / self.ratio
        least_nm = 0.2 * min(self.motor.brake.torque_nm, self.motor.motor.torque_rated_nm)
        return significant(max(1.5 * check_nm, least_nm), 3)

    @property
    def running_torque_nm(self) -> float:
        """Largest torque of the motor in a steady motion: that moment, and the friction of motor and gear."""
        gears, at_motor_nm = self.sheet.gears, self.largest_moment_nm / self.ratio
        viscous_nm = gears.friction_viscous_nm_s_per_rad * rad(self.speed_deg_s) * self.ratio
        return (1.0 + gears.load_loss_ratio) * at_motor_nm + gears.friction_coulomb_nm + viscous_nm

    @property
    def wind_torque_nm(self) -> float:
        """Largest torque of the motor that the wind of the sheet takes."""
        return self.sheet.wind.largest_nm / self.ratio

    @property
    def windup_deg(self) -> float:
        """What the load turns under that moment with the motor held."""
        return deg(self.largest_moment_nm / self.stiffness_nm_per_rad)

    @property
    def reversal_torque_nm(self) -> float:
        """Step of the motor torque where the direction turns round: friction of load and motor, twice."""
        load, gears = self.sheet.load, self.sheet.gears
        return 2.0 * (load.friction_coulomb_nm / self.ratio + gears.friction_coulomb_nm)

    @property
    def fine_count_rad(self) -> float:
        """One interpolated step of the encoder, at the motor."""
        return 2.0 * math.pi / (self.motor.encoder.lines * self.motor.encoder.interpolation)

    @property
    def _fastest_rad_s(self) -> float:
        """Rotor on the transmission at its stiffest."""
        at_motor = _STIFFER * self.stiffness_nm_per_rad / self.ratio**2
        return math.sqrt(at_motor / self.train.fast_inertia_kg_m2)

    @property
    def cycle_s(self) -> float:
        """Cycle of the drive: 125 us, or less where rotor and transmission swing too fast for it."""
        return next((cycle for cycle in _CYCLES_S if self._fastest_rad_s * cycle <= _FOLLOWED), _CYCLES_S[-1])

    @property
    def rk4_steps(self) -> int:
        """Sub-steps of Runge-Kutta in such a cycle; 0: one evaluation follows."""
        turns = self._fastest_rad_s * self.cycle_s
        return 0 if turns <= _FOLLOWED else math.ceil(turns / _FOLLOWED)

    @property
    def step_deg(self) -> float:
        """One absolute step of the encoder, at the axis."""
        return 360.0 / (self.motor.encoder.counts_per_turn * self.ratio)

    @property
    def torque_max_nm(self) -> float:
        """Highest torque of the drive: the motor's, or what the reducer bears for a moment."""
        return usable_torque_nm(self.sheet, self.motor)

    @property
    def module_m(self) -> float:
        """Module of pinion and ring: pitch diameter over teeth."""
        teeth = self.sheet.teeth
        return 2.0 * teeth.ring_radius_m / (teeth.pinion_teeth * self.sheet.gears.ring_ratio)

    @cached_property
    def _guesses(self) -> frozenset[str]:
        return frozenset(self.sheet.sheet.guesses)

    def of_sheet(self, path: str) -> Drafted:
        """Value of the sheet at a dotted path; a guess if the sheet calls it one, or does not give it."""
        name, _, key = path.partition(".")
        table: Table = getattr(self.sheet, name)
        value: Value = getattr(table, key)
        if name not in self.sheet.model_fields_set or key not in table.model_fields_set:
            return Drafted(value, Origin.GUESS, f"not in the sheet: [{name}] {key}")
        if path in self._guesses:
            return Drafted(value, Origin.GUESS, f"of the sheet: [{name}] {key}")
        return Drafted(value, Origin.SHEET)

    def catalogue(self, value: Value) -> Drafted:
        """A figure of the motor's file."""
        return Drafted(value, Origin.CATALOGUE, self.motor.name)

    def follows(self, value: Value, rule: str, *paths: str) -> Drafted:
        """A property of the machine by a rule from values of the sheet: a guess as long as one of them is."""
        guess = any(self.of_sheet(path).origin is Origin.GUESS for path in paths)
        return Drafted(value, Origin.GUESS if guess else Origin.COMPUTED, rule)
