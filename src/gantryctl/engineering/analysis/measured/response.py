"""An axis measured in three conditions, and the linear model of the same ratios beside it.

Standing with a torque below breakaway (friction is a spring), standing with more (it begins to slide), and turning
slowly (it slides). The simulated axis runs under `probe.Probe`, a machine on a bus under the scan engine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.analysis.measured.excitation import Excitation, multisine
from gantryctl.engineering.analysis.measured.on_engine import EngineProbe
from gantryctl.engineering.analysis.measured.probe import (
    FrequencyResponse,
    Probe,
    ProbeLimits,
    fit_amplitude,
    measure,
)
from gantryctl.engineering.analysis.models.linear import ComplexArray, FloatArray
from gantryctl.engineering.analysis.models.mechanics import Friction, PlantKind, mechanics
from gantryctl.engineering.analysis.models.sampled import Input, SampledLoop, loop_settings
from gantryctl.engineering.report.origin import Origin, origin_of
from gantryctl.errors import UsageError
from gantryctl.machine import Machine
from gantryctl.machine.places import reach_deg
from gantryctl.operation.run import AxisRun
from gantryctl.units import rad
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import sim_drive

LOW_HZ: Final = 0.25
HIGH_HZ: Final = 200.0
LINES: Final = 70
# Part of the rated torque at which a measurement stops by itself.
TORQUE_LIMIT_SHARE: Final = 0.5
# Listening, four trials, two periods of settling and four of measuring take at most so long: eleven periods of 16 s.
_LONGEST_S: Final = 176.0
_CALM_S: Final = 3.0
# Friction slides at this speed; a slower axis turns as fast as it may.
_TURNING_DEG_S: Final = 0.3
# A tenth of scatter is 0.8 dB, well below the 3 dB that count as another plant.
_SCATTER_TRUSTED: Final = 0.1
_OFF_DB: Final = 3.0
_OFF_DEG: Final = 20.0


@dataclass(frozen=True)
class Condition:
    """Conditions of one measurement.

    Attributes:
        torque_nm: half the swing of the motor torque that the signal makes.
        vel_deg_s: speed at the gantry during the measurement; 0 = standing.
        angle_deg: where; while turning, the middle of the way.
        friction: of the linear model beside it.
    """

    name: str
    torque_nm: float
    vel_deg_s: float
    angle_deg: float
    friction: Friction


def conditions(machine: Machine, angle_deg: float = 75.0, torque_nm: float | None = None) -> list[Condition]:
    """The three conditions.

    Args:
        machine: the larger torque is 4 % of the motor's rated torque, the smaller one a fifth of it.
        angle_deg: where; away from the angles without eccentric moment, so that the gears stay on one flank.
        torque_nm: another larger torque.
    """
    # 4 % of the reference motor's 257 N m begins to slide in the friction, a fifth of it holds.
    large = 0.04 * machine.motor.torque_rated_nm if torque_nm is None else torque_nm
    return [
        Condition("standing, small", large / 5.0, 0.0, angle_deg, Friction.HOLDING),
        Condition("standing, larger", large, 0.0, angle_deg, Friction.HOLDING),
        Condition(
            "turning",
            large,
            min(_TURNING_DEG_S, machine.speed.setting_max_deg_s),
            angle_deg,
            Friction.SLIDING,
        ),
    ]


def axis_time_s(machine: Machine, chosen: Sequence[Condition]) -> float:
    """About how long measuring on a bus takes once the axis stands at the angle: with the way to where it turns."""
    fastest, acc = machine.speed.setting_max_deg_s, machine.virtual_axis.acc_deg_s2
    back_deg = max(how.angle_deg - starts_at_deg(machine, how) for how in chosen)
    return len(chosen) * (_CALM_S + _LONGEST_S) + back_deg / fastest + fastest / acc


class Ratios(NamedTuple):
    """The three responses, measured or of the model; see `FrequencyResponse`."""

    plant: ComplexArray
    speed_loop: ComplexArray
    position_open: ComplexArray


@dataclass(frozen=True)
class MeasuredResponse:
    """One measurement beside the linear model of its condition.

    Attributes:
        origin: whether a machine or the simulator was measured.
    """

    machine: Machine
    condition: Condition
    measured: FrequencyResponse
    origin: Origin

    def model_at(self, hz: FloatArray) -> Ratios:
        """The linear model of this condition."""
        return model_ratios(self.machine, self.condition.friction, self.condition.angle_deg, hz)

    @cached_property
    def model(self) -> Ratios:
        """The linear model at the measured lines."""
        return self.model_at(self.measured.hz)

    @property
    def trusted(self) -> FloatArray:
        """Lines at which the neighbourhood carries less than 0.1 of the line: 1.0, else 0.0."""
        return np.asarray((self.measured.scatter < _SCATTER_TRUSTED).astype(np.float64))

    @property
    def off(self) -> FloatArray:
        """Frequencies, Hz, at which the plant differs by more than 3 dB or 20 deg from the model."""
        ratio = self.measured.plant / self.model.plant
        wrong = (np.abs(20.0 * np.log10(np.abs(ratio))) > _OFF_DB) | (
            np.abs(np.angle(ratio, deg=True)) > _OFF_DEG
        )
        return np.asarray(self.measured.hz[wrong & (self.trusted > 0.0)])

    @property
    def typical_error(self) -> float:
        """Median of |measured/model - 1| of the plant over the trusted lines."""
        ratio = (self.measured.plant / self.model.plant)[self.trusted > 0.0]
        return float(np.median(np.abs(ratio - 1.0)))


def model_ratios(machine: Machine, friction: Friction, angle_deg: float, hz: FloatArray) -> Ratios:
    """Ratios of the linear model at these frequencies, sampled as the drive reports them."""
    plant = mechanics(machine, _kind(machine), friction, angle_rad=rad(angle_deg))
    settings = loop_settings(machine)
    reply = SampledLoop(plant, settings).injected(Input.SPEED, 2.0 * math.pi * hz)
    # On a bus a command acts at the next SYNC.
    late = np.exp(-2j * np.pi * hz * settings.scan_s) if machine.on_bus else 1.0
    return Ratios(
        plant=reply["vel_act_rad_s"] / reply["torque_act_nm"],
        speed_loop=late * reply["vel_act_rad_s"] / reply["vel_cmd_rad_s"],
        position_open=-late * reply["vel_law_rad_s"] / reply["vel_cmd_rad_s"],
    )


def _kind(machine: Machine) -> PlantKind:
    return PlantKind.RIGID if machine.plant.switches.rigid else PlantKind.FULL


def simulated_probe(machine: Machine, angle_deg: float) -> Probe:
    """A probe on the simulated drive of a machine file, standing at an angle with torque off."""
    limits = ProbeLimits(
        torque_nm=TORQUE_LIMIT_SHARE * machine.motor.torque_rated_nm,
        pos_min_rad=rad(reach_deg(machine)[0]),
        pos_max_rad=rad(reach_deg(machine)[1]),
        motion=motion_limits(machine),
        dial=machine.axis.dial,
    )
    scan_s = machine.control.scan_period_ms * 1e-3
    # Torque and travel stop a measurement on a real axis, so they do here.
    return Probe(sim_drive(machine, angle_deg), position_law(machine), scan_s, limits, rad(angle_deg))


def measure_simulated(machine: Machine, condition: Condition) -> MeasuredResponse:
    """Measure a new simulated axis in one condition.

    Raises:
        UsageError: the way that turning takes does not fit into the travel.
        AlarmStop: torque or travel beyond the limits.
    """
    signal = _signal(machine)
    probe = simulated_probe(machine, starts_at_deg(machine, condition))
    probe.enable()
    if condition.vel_deg_s:
        probe.turn(rad(condition.vel_deg_s))
    return MeasuredResponse(
        machine,
        condition,
        measure(probe, fit_amplitude(probe, signal, condition.torque_nm)),
        Origin.SIMULATED,
    )


def measure_on(machine: Machine, run: AxisRun, condition: Condition) -> MeasuredResponse:
    """Measure a machine under power in one condition, through its drive.

    Args:
        run: of `experiment`.

    Raises:
        UsageError: the way that turning takes does not fit into the travel.
        AlarmStop: torque beyond the limit, or an alarm; the axis was stopped.
    """
    start_deg = starts_at_deg(machine, condition)
    run.move(start_deg)
    turning_s = 0.0
    if condition.vel_deg_s:
        lowest = machine.speed.setting_min_deg_s
        end_deg = min(start_deg + _way_deg(machine, condition), reach_deg(machine)[1])
        run.begin_move(end_deg, max(condition.vel_deg_s, lowest), min(1.0, condition.vel_deg_s / lowest))
        turning_s = condition.vel_deg_s / machine.virtual_axis.acc_deg_s2
    run.follow(turning_s + _CALM_S)
    probe = EngineProbe(run, TORQUE_LIMIT_SHARE * machine.motor.torque_rated_nm)
    measured = measure(probe, fit_amplitude(probe, _signal(machine), condition.torque_nm))
    run.halt()
    return MeasuredResponse(machine, condition, measured, origin_of(machine))


def _signal(machine: Machine) -> Excitation:
    scan_s = machine.control.scan_period_ms * 1e-3
    return multisine(Input.SPEED, LOW_HZ, min(HIGH_HZ, 0.2 / scan_s), LINES, scan_s)


def _way_deg(machine: Machine, condition: Condition) -> float:
    """Way while it turns: ramp and calm before the measurement, and the ramp behind it."""
    vel = condition.vel_deg_s
    return vel * (_CALM_S + _LONGEST_S + vel / machine.virtual_axis.acc_deg_s2)


def starts_at_deg(machine: Machine, condition: Condition) -> float:
    """Start of a measurement whose middle is the condition's angle.

    Raises:
        UsageError: the way does not fit into the travel.
    """
    way = _way_deg(machine, condition)
    start = condition.angle_deg - 0.5 * way
    low, high = reach_deg(machine)
    if low < start <= start + way < high:
        return start
    dial = machine.axis.dial
    raise UsageError(
        f"measuring at {dial.text(condition.angle_deg)} deg while turning takes {way:.0f} deg: "
        f"{dial.span(start, start + way, '.0f')} deg must lie within {dial.span(low, high)} deg"
    )
