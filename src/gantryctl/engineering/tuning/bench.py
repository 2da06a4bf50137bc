"""Experiments on the simulated axis: those of a commissioning engineer with a drive's scope and a level on the gantry.

Every trial starts from a new, quiet axis. Of [plant] only those values count that show on a real gantry: motor
angle and speed, torque, and with instruments on gantry and base their movement.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gantryctl import _core
from gantryctl.engineering.batch import ClosedLoop, Log, base_motion_rad
from gantryctl.engineering.tuning.gains import Gains
from gantryctl.machine import Machine, with_values
from gantryctl.machine.places import fitted_stretch_deg, one_flank_deg
from gantryctl.motion import MotionLimits, SetPoint, hold, plan_move
from gantryctl.units import deg, rad
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import drive_params, gantry_sim, plant_params

Floats = NDArray[np.float64]

# The paper's encoder has 8192 steps; the least averaging of the speed that such an encoder needs in this drive.
# One of 8192 steps in a drive cycle is 477 N m through the paper's Kvp. The value was taken up after it was
# seen to explain that Kvp (docs/explanation/tuning.md).
AVERAGED_S: Final = 0.002
_SPEED_MODE: Final = 1
_CRAWL_RAD_S: Final = 5.0
# Of the highest speed, at most.
_CRAWL_SHARE: Final = 0.1
_STEP_RAD_S: Final = 1.0
# A step that reaches the torque limit says nothing about the gains.
_TORQUE_SHARE: Final = 0.4
_SETTLE_S: Final = 4.0
_BASELINE_S: Final = 0.1
_SCOPE_S: Final = 0.06
_WATCH_S: Final = 4.0
# The load comes to rest beside the motor's angle: it is held against its own mean at rest. The last sample of
# a load that still swings is an accident of its phase.
_MEAN_S: Final = 2.0
_MOVE_DEG: Final = 90.0
_AFTER_S: Final = 6.0
# The first mode is at 2 Hz: two seconds hold four of its periods.
_RESIDUAL_S: Final = (0.2, 2.2)
_ARRIVED_DEG: Final = 0.001


class SpeedStep(NamedTuple):
    """Answer of the motor speed to a step of the speed command, position loop open.

    Attributes:
        time_s, response: of the drive's scope; 0 before, 1 = the step. overshoot: beyond the step, as a part of it.
        limited: the torque limit acted, so the trial says nothing.
    """

    time_s: Floats
    response: Floats
    overshoot: float
    limited: bool


class PositionStep(NamedTuple):
    """Answer of motor and load to a small step of the set-point without speed; 1 = the step.

    The load comes to rest beside the motor's angle (lost motion), so it overshoots its own mean over the last 2 s.
    """

    time_s: Floats
    motor: Floats
    load: Floats
    motor_overshoot: float
    load_overshoot: float
    limited: bool


class TrialMove(NamedTuple):
    """One move from standstill to standstill.

    Attributes:
        speed_overshoot: of the motor, beyond the highest set-point speed, as a part of it.
        cruise_error_deg: following error in the middle of the move.
        motor_error_deg_s, load_error_deg_s: largest difference of speed and set-point.
        base_um, residual_um: movement of the base at the ring, peak to peak, without the part that the eccentric moment
            makes at rest: over the move, and from 0.2 to 2.2 s after it.
        settle_s: after the end of the profile, until the load stays within 0.001 deg of where it comes to rest.
        torque_nm, reducer_nm: largest.
    """

    speed_overshoot: float
    cruise_error_deg: float
    motor_error_deg_s: float
    load_error_deg_s: float
    base_um: float
    residual_um: float
    settle_s: float
    torque_nm: float
    reducer_nm: float
    time_s: float
    limited: bool


@dataclass(frozen=True)
class Bench:
    """An axis to try gains on.

    Attributes:
        machine: the simulated axis.
        speed_average_s: the drive averages its speed over so long (first order with half of it as time constant, the
            same delay); 0 as the machine file has it.
    """

    machine: Machine
    speed_average_s: float = 0.0

    @cached_property
    def drive(self) -> _core.DriveParams:
        """The drive without gains."""
        params = drive_params(self.machine)
        if self.speed_average_s:
            # A first-order lag delays by its time constant, a mean over a time by half of it.
            params.speed_filter = math.exp(-params.cycle_s / (0.5 * self.speed_average_s))
        return params

    @property
    def small_delays_s(self) -> float:
        """Sum of small delays of the speed loop: difference, latency, computing, holding, current loop, averaging."""
        drive, plant = self.drive, plant_params(self.machine)
        current = 1.0 / plant.current_bandwidth_rad_s if plant.current_bandwidth_rad_s else 0.0
        # Half a cycle for the difference, the computing time, half a cycle for holding. 0.58 ms with the
        # drive of hust_gantry.toml, 1.58 ms as the paper's drive saw it.
        cycles = 0.5 + drive.delay_cycles + 0.5
        return cycles * drive.cycle_s + drive.latency_s + current + 0.5 * self.speed_average_s

    @property
    def linear_machine(self) -> Machine:
        """The machine for the linear model, which has no averaging: its lag is put into the current loop, where it
        has the same effect on every open loop but for 1 ms in the position path.
        """
        if not self.speed_average_s:
            return self.machine
        current = plant_params(self.machine).current_bandwidth_rad_s
        lag = 0.5 * self.speed_average_s + (1.0 / current if current else 0.0)
        changes = {
            "drive.current_loop.bandwidth_hz": 1.0 / (2.0 * math.pi * lag),
            "drive.current_loop.ideal": False,
        }
        return with_values(self.machine, changes)

    @property
    def fast_inertia_kg_m2(self) -> float:
        """Inertia that the drive turns above the frequencies of the load: rotor and reducer input."""
        return plant_params(self.machine).inertia_motor_kg_m2

    @property
    def _crawl_rad_s(self) -> float:
        """A slow turn of the motor, also where its highest speed is one."""
        machine = self.machine
        return min(_CRAWL_RAD_S, _CRAWL_SHARE * rad(machine.speed.setting_max_deg_s) * machine.axis.ratio)

    def speed_step(self, gains: Gains) -> SpeedStep:
        """A step on top of a slow turn, so that friction does not change; small enough for the torque limit."""
        cycle = self.drive.cycle_s
        sim = _core.GantrySim(plant_params(self.machine), self._drive_with(gains), cycle)
        sim.static_start(rad(one_flank_deg(self.machine)), True)
        crawl = self._crawl_rad_s
        size = min(
            _STEP_RAD_S,
            0.2 * crawl,
            _TORQUE_SHARE * self.machine.motor.torque_rated_nm / gains.kvp_nm_s_per_rad,
        )
        # Turning slowly, so that friction does not change its sign with the step.
        ramp = round(0.5 * _SETTLE_S / cycle)
        before = [_speed_after(sim, crawl * min(1.0, k / ramp)) for k in range(round(_SETTLE_S / cycle))]
        start = float(np.mean(before[-round(_BASELINE_S / cycle) :]))
        after = np.array([_speed_after(sim, crawl + size) for _ in range(round(_SCOPE_S / cycle))])
        response: Floats = (after - start) / size
        limited = bool(sim.feedback(1.0)[4])
        time: Floats = cycle * np.arange(1.0, len(response) + 1.0)
        return SpeedStep(time, response, max(0.0, float(response.max()) - 1.0), limited)

    def position_step(self, gains: Gains) -> PositionStep:
        """A step of the set-point while standing, without feed-forward, as large as the in-position window."""
        at_deg = one_flank_deg(self.machine)
        loop = self._standing(gains, at_deg, kvf=0.0)
        before = loop.rest(rad(at_deg), 1.0)
        # 0.005 deg: 0.01 deg drove the configured drive into its torque limit (docs/explanation/tuning.md).
        size = rad(self.machine.monitors.in_position_window_deg)
        log = loop.rest(rad(at_deg) + size, _WATCH_S)
        motor = (log["pos_act_rad"] - before["pos_act_rad"][-1]) / size
        load = (log["pos_load_rad"] - before["pos_load_rad"][-1]) / size
        return PositionStep(
            log.time_s,
            motor,
            load,
            max(0.0, float(motor.max()) - 1.0),
            max(0.0, float(load.max()) - float(np.mean(load[log.time_s > _WATCH_S - _MEAN_S]))),
            bool(np.any(log["torque_limited"])),
        )

    def move(self, gains: Gains, way_deg: float = _MOVE_DEG) -> TrialMove:
        """A move, from 0 deg where it fits, with the profile of the machine file and the acceleration of the gains."""
        start_deg, end_deg = fitted_stretch_deg(self.machine, 0.0, way_deg)
        loop = self._standing(gains, start_deg, gains.kvf)
        plan = plan_move(SetPoint(rad(start_deg), 0.0, 0.0), rad(end_deg), self._limits(gains))
        log = loop.run(plan, plan.duration + _AFTER_S)
        return _evaluate(self.machine, log, plan)

    def _limits(self, gains: Gains) -> MotionLimits:
        acc = rad(gains.acc_deg_s2)
        configured = motion_limits(self.machine)
        scale = acc / configured.acc_rad_s2
        # Ramps keep their shape: jerk grows with the acceleration.
        return configured._replace(acc_rad_s2=acc, dec_rad_s2=acc, jerk_rad_s3=configured.jerk_rad_s3 * scale)

    def _drive_with(self, gains: Gains) -> _core.DriveParams:
        params = self.drive.copy()
        params.kvp_nm_s_per_rad, params.tvi_s = gains.kvp_nm_s_per_rad, gains.tvi_s
        return params

    def _standing(self, gains: Gains, angle_deg: float, kvf: float) -> ClosedLoop:
        given = position_law(self.machine)
        law = _core.PositionLaw(
            kpp_per_s=gains.kpp_per_s,
            kvf=kvf,
            ratio=given.ratio,
            counts_per_turn=2.0 * math.pi / given.rad_per_count,
            vel_max_rad_s=given.vel_max_rad_s,
        )
        sim = gantry_sim(self.machine, drive=self._drive_with(gains))
        loop = ClosedLoop.standing_at(sim, law, rad(angle_deg))
        # Every trial begins with an axis that has calmed down.
        loop.run(hold(rad(angle_deg)), 2.0)
        return loop


def bench_of_paper(machine: Machine) -> Bench:
    """The axis as the paper's drive saw it: nothing but the rotor above the load's frequencies (the paper's Js has no
    wave generator), and a speed averaged over 2 ms, without which 8192 steps cannot close the loop.
    """
    return Bench(with_values(machine, {"plant.motor.wave_generator_inertia_kg_m2": 0.0}), AVERAGED_S)


def _speed_after(sim: _core.GantrySim, vel_cmd_rad_s: float) -> float:
    sim.scan(_SPEED_MODE, vel_cmd_rad_s, 0.0, True)
    return sim.truth()[3]


def _evaluate(machine: Machine, log: Log, plan: _core.Segments) -> TrialMove:
    ratio = machine.axis.ratio
    ref, motor, load = log["vel_ref_rad_s"], log["vel_motor_rad_s"] / ratio, log["vel_load_rad_s"]
    top = float(np.max(np.abs(ref)))
    time, after = log.time_s, log.time_s - plan.duration
    rocking = base_motion_rad(machine, log["pos_base_rad"], log["pos_load_rad"])
    shake = 1e6 * machine.plant.gear_error.ring_radius_m * rocking
    residual = (after >= _RESIDUAL_S[0]) & (after <= _RESIDUAL_S[1])
    # Half a second of cruise, far from both ramps.
    middle = np.abs(time - 0.5 * plan.duration) < 0.25
    return TrialMove(
        speed_overshoot=max(0.0, float(np.max(np.abs(motor))) / top - 1.0),
        cruise_error_deg=deg(float(np.mean(np.abs(log["pos_err_rad"][middle])))),
        motor_error_deg_s=deg(float(np.max(np.abs(motor - ref)))),
        load_error_deg_s=deg(float(np.max(np.abs(load - ref)))),
        base_um=float(np.ptp(shake)),
        residual_um=float(np.ptp(shake[residual])),
        settle_s=_settled(log["pos_load_rad"], after),
        torque_nm=float(np.max(np.abs(log["torque_act_nm"]))),
        reducer_nm=float(np.max(np.abs(log["torque_mesh_nm"]))) / machine.axis.ring_ratio,
        time_s=plan.duration,
        limited=bool(np.any(log["torque_limited"])),
    )


def _settled(load: Floats, after_s: Floats) -> float:
    """Time until the load stays within 0.001 deg of its mean over the last second."""
    there = float(np.mean(load[after_s > after_s[-1] - 1.0]))
    outside = np.nonzero((np.abs(load - there) > rad(_ARRIVED_DEG)) & (after_s > 0.0))[0]
    return float(after_s[outside[-1]]) if len(outside) else 0.0
