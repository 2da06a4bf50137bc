"""The simulated axis under test, in the compiled loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum
from functools import partial
from typing import Final

import numpy as np

from gantryctl.engineering.analysis.measured.compiled_probe import CompiledProbe
from gantryctl.engineering.analysis.measured.probe import ProbeLimits
from gantryctl.engineering.analysis.measured.speed_loop import SpeedLoop, measured_speed_loop
from gantryctl.engineering.batch import ClosedLoop, Leg, Runner, alone, in_lockstep
from gantryctl.engineering.identification.experiment import experiment_of
from gantryctl.engineering.identification.fit import calibrate
from gantryctl.engineering.identification.measure import TORQUE_LIMIT_SHARE, quiet_machine
from gantryctl.engineering.identification.samples import MoveLog
from gantryctl.machine import Calibration, Machine
from gantryctl.machine.places import reach_deg
from gantryctl.motion import MotionLimits, SetPoint, plan_move
from gantryctl.units import deg, rad
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import fit_load_encoder, gantry_sim, sim_drive

_COLUMNS: Final = (
    "pos_act_rad", "pos_load_rad", "pos_ring_rad", "vel_ref_rad_s", "acc_ref_rad_s2", "torque_act_nm",
)  # fmt: skip


class LoadInstrument(Enum):
    """Instruments at the load of a simulated axis."""

    # A laser tracker sampling along: inertial, with the noise of [accuracy].
    TRACKER = "tracker"
    # The encoder on the ring: blind to the rocking of the base, and with scale errors of its own.
    LOAD_ENCODER = "load-encoder"


class SimulatedAxis:
    """The axis of a simulated machine, standing where a new machine does.

    Args:
        seed: of the instrument's noise.
        run: moves the plant; no effect on the result.
        advance: told after every motion how much time of the axis it has taken, s.
    """

    def __init__(
        self,
        machine: Machine,
        instrument: LoadInstrument = LoadInstrument.TRACKER,
        seed: int = 0,
        run: Runner = alone,
        advance: Callable[[float], None] = lambda _: None,
    ) -> None:
        self.machine, self._quiet, self._run, self._advance = machine, quiet_machine(machine), run, advance
        self._experiment = experiment_of(machine)
        sim = gantry_sim(machine)
        self._by_ring = instrument is LoadInstrument.LOAD_ENCODER
        if self._by_ring:
            fit_load_encoder(machine, sim)
        self.instrument = instrument.value
        self.sees_space = not self._by_ring
        self.has_ring = machine.plant.load_encoder.fitted or self._by_ring
        self.encoder_serial = machine.plant.encoder.serial
        self.time_s = 0.0
        self._pos_rad = rad(machine.axis.start_angle_deg)
        self._loop = ClosedLoop.standing_at(sim, position_law(machine), self._pos_rad)
        # A reading is latency_us old: at constant speed it lags by speed times age.
        self._latency_s = machine.control.compensation.latency_us * 1e-6
        self._sigma_rad = machine.accuracy.tracker_noise_um * 1e-6 / machine.accuracy.chord_radius_m
        self._rng = np.random.default_rng(seed)

    def go(self, to_deg: float, vel_deg_s: float) -> MoveLog:
        """Move and settle."""
        limits: MotionLimits = motion_limits(self._quiet)._replace(vel_rad_s=rad(vel_deg_s))
        plan = plan_move(SetPoint(self._pos_rad, 0.0, 0.0), rad(to_deg), limits)
        self._pos_rad = rad(to_deg)
        duration_s = plan.duration + self._experiment.settle_s
        self.time_s += duration_s
        log = self._run(self._loop, [Leg(plan, duration_s)], _COLUMNS)
        self._advance(duration_s)
        ring, vel = log["pos_ring_rad"], log["vel_ref_rad_s"]
        seen = log["pos_load_rad"] + self._rng.normal(0.0, self._sigma_rad, len(log))
        return MoveLog(
            period_s=log.period_s,
            act_rad=log["pos_act_rad"] + self._latency_s * vel,
            load_rad=ring if self._by_ring else seen,
            ring_rad=ring,
            vel_rad_s=vel,
            acc_rad_s2=log["acc_ref_rad_s2"],
            torque_nm=log["torque_act_nm"],
            block=max(1, round(self._experiment.block_s / log.period_s)),
            uncertainty_rad=0.0 if self._by_ring else self._sigma_rad,
        )

    def speed_loop(self, torque_nm: float) -> SpeedLoop:
        """Excite the same drive, standing where the axis stands, while it turns slowly."""
        machine = self.machine
        limits = ProbeLimits(
            torque_nm=TORQUE_LIMIT_SHARE * machine.motor.torque_rated_nm,
            pos_min_rad=rad(reach_deg(machine)[0]),
            pos_max_rad=rad(reach_deg(machine)[1]),
            motion=motion_limits(self._quiet),
            dial=machine.axis.dial,
        )
        drive = sim_drive(machine, deg(self._pos_rad))
        probe = CompiledProbe(drive, position_law(machine), limits, self._pos_rad, self._run)
        probe.turn(rad(self._experiment.speed_loop_deg_s))
        return measured_speed_loop(probe, torque_nm)


def calibrate_each(machines: Sequence[Machine], seeds: Sequence[int]) -> list[Calibration | Exception]:
    """Calibrations of simulated machines, each identified by itself; an exception where one cannot be.

    Args:
        seeds: of the noise of each tracker.
    """
    return in_lockstep([partial(_calibrated, *each) for each in zip(machines, seeds, strict=True)])


def _calibrated(machine: Machine, seed: int, run: Runner) -> Calibration:
    return calibrate(SimulatedAxis(machine, seed=seed, run=run))
