"""One stop on the full plant: cruise at a speed, stop at an angle, watch until the load has calmed down."""

from __future__ import annotations

import math
from enum import Enum
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gantryctl import _core
from gantryctl.engineering.batch import ClosedLoop, Log
from gantryctl.errors import ConfigError
from gantryctl.machine import Machine
from gantryctl.motion import MotionLimits, SetPoint, plan_stop, plan_velocity
from gantryctl.units import deg, rad
from gantryctl.wiring.program import position_law
from gantryctl.wiring.simulator import drive_params, eccentric_moment_nm, gantry_sim, plant_params

Floats = NDArray[np.float64]

AT_REST_DEG_S: Final = 0.05  # motor side: below this the axis counts as standing
_RAMP_UP_S: Final = 5.0  # acceleration to the test speed, gentle enough to leave the load calm
_CRUISE_S: Final = 1.0
_OFF: Final = 0
_QUICK_STOP: Final = 2
_WATCH_S: Final = 2.0  # how long after rest the load and the base are watched
_BRAKE_WATCH_S: Final = 7.0
_USED: Final = (
    "pos_motor_rad", "vel_motor_rad_s", "pos_load_rad", "vel_load_rad_s", "pos_base_rad", "torque_act_nm",
    "torque_mesh_nm",
)  # fmt: skip


class StopClass(Enum):
    """The ways to come to rest."""

    NORMAL = "normal"
    JOG_RELEASE = "jog-release"
    QUICK = "quick"
    BRAKE = "torque off + brake"


class StopResult(NamedTuple):
    """One stop, from the command to rest; angles and speeds at the gantry.

    Attributes:
        angle_deg, time_s: until the motor stands (below 0.05 deg/s); load_angle_deg: farthest way of the load.
        torque_motor_nm, torque_reducer_nm: largest, motor shaft and reducer output.
        base_um: largest base motion at the ring after the static part, peak to peak.
        brake_energy_kj: taken by the brake. torque_limited: the drive's torque limit acted.
        load_swing_deg_s: largest speed of the load after the motor stands.
    """

    stop_class: StopClass
    speed_deg_s: float
    angle_deg: float
    time_s: float
    load_angle_deg: float
    torque_motor_nm: float
    torque_reducer_nm: float
    base_um: float
    brake_energy_kj: float
    torque_limited: bool
    load_swing_deg_s: float


def run_stop(
    machine: Machine,
    stop_class: StopClass,
    speed_deg_s: float,
    at_deg: float,
    quick_dec_deg_s2: float | None = None,
) -> StopResult:
    """Cruise with `speed_deg_s` (sign: direction) and stop at `at_deg`, with the eccentric moment of the check.

    Args:
        quick_dec_deg_s2: another quick-stop deceleration than the machine's.

    Raises:
        ConfigError: the plant is too stiff to be simulated.
    """
    loop = _cruising(machine, speed_deg_s, at_deg, quick_dec_deg_s2)
    if stop_class is StopClass.QUICK:
        ramp_s = abs(speed_deg_s) / (quick_dec_deg_s2 or machine.virtual_axis.quick_dec_deg_s2)
        log = loop.command(_QUICK_STOP, ramp_s + _WATCH_S, brake_open=True)
    elif stop_class is StopClass.BRAKE:
        log = loop.command(_OFF, _BRAKE_WATCH_S, brake_open=False)
    else:
        plan = _ramp(machine, stop_class, SetPoint(rad(at_deg), rad(speed_deg_s), 0.0))
        log = loop.run(plan, plan.duration + _WATCH_S)
    return _evaluate(machine, stop_class, speed_deg_s, log)


def worst_stop(
    machine: Machine, stop_class: StopClass, speed_deg_s: float, quick_dec_deg_s2: float | None = None
) -> StopResult:
    """The stops at +-90 deg in both directions, each figure the worst of the four."""
    runs = [
        run_stop(machine, stop_class, sign * speed_deg_s, at, quick_dec_deg_s2)
        for at in (90.0, -90.0)
        for sign in (1.0, -1.0)
    ]
    worst = {name: max(getattr(r, name) for r in runs) for name in StopResult._fields[2:]}
    return StopResult(stop_class, speed_deg_s, **worst)


def _cruising(
    machine: Machine, speed_deg_s: float, at_deg: float, quick_dec_deg_s2: float | None
) -> ClosedLoop:
    """The axis in steady motion, just arriving at the angle."""
    plant, drive = plant_params(machine), drive_params(machine)
    if machine.plant.switches.eccentric_moment:
        sign = math.copysign(1.0, eccentric_moment_nm(machine))
        plant.eccentric_moment_nm = sign * machine.plant.load.eccentric_check_moment_nm
    if quick_dec_deg_s2 is not None:
        drive.quick_dec_rad_s2 = rad(quick_dec_deg_s2) * machine.axis.ratio
    speed = rad(speed_deg_s)
    acc = abs(speed) / _RAMP_UP_S
    limits = MotionLimits(abs(speed), acc, acc, acc / 0.5)
    ramp = plan_velocity(SetPoint(0.0, 0.0, 0.0), speed, limits)
    way = ramp.pos_end + speed * _CRUISE_S
    start = rad(at_deg) - way
    plan = plan_velocity(SetPoint(start, 0.0, 0.0), speed, limits)
    loop = ClosedLoop.standing_at(gantry_sim(machine, plant, drive), position_law(machine), start)
    loop.run(plan, plan.duration + _CRUISE_S)
    return loop


def _ramp(machine: Machine, stop_class: StopClass, start: SetPoint) -> _core.Segments:
    """The stop of the virtual axis on its normal or jog-release ramp."""
    axis = machine.virtual_axis
    if stop_class is StopClass.JOG_RELEASE:
        dec, jerk = rad(axis.jog_release_dec_deg_s2), rad(axis.jog_release_jerk_deg_s3)
    else:
        dec = rad(axis.dec_deg_s2)
        jerk = rad(axis.jerk_deg_s3) if axis.profile == "jerk_limited" else math.inf
    return plan_stop(start, MotionLimits(abs(start.vel_rad_s), dec, dec, jerk))


def _evaluate(machine: Machine, stop_class: StopClass, speed_deg_s: float, log: Log) -> StopResult:
    if not all(np.isfinite(log[name]).all() for name in _USED):
        raise ConfigError(
            [
                f"{machine.name}: a stop from {abs(speed_deg_s):g} deg/s does not stay finite: [plant] or the drive's "
                "loops are too stiff to be simulated; go back towards the defaults"
            ]
        )
    ratio = machine.axis.ratio
    motor, vel_motor, load = log["pos_motor_rad"], np.abs(log["vel_motor_rad_s"]), log["pos_load_rad"]
    moving = np.nonzero(vel_motor / ratio > rad(AT_REST_DEG_S))[0]
    rest = min(int(moving[-1]) + 1, len(motor) - 1) if len(moving) else 0
    shake = (log["pos_base_rad"] - _static_base(machine, load)) * machine.plant.gear_error.ring_radius_m * 1e6
    energy = 0.0
    if stop_class is StopClass.BRAKE:
        slipping = log.time_s >= machine.brake.close_time_ms * 1e-3
        energy = machine.brake.torque_nm * float(np.sum(vel_motor[slipping])) * log.period_s * 1e-3
    return StopResult(
        stop_class,
        speed_deg_s,
        angle_deg=deg(abs(float(motor[rest] - motor[0]))) / ratio,
        time_s=rest * log.period_s,
        load_angle_deg=deg(float(np.max(np.abs(load - load[0])))),
        torque_motor_nm=float(np.max(np.abs(log["torque_act_nm"]))),
        torque_reducer_nm=float(np.max(np.abs(log["torque_mesh_nm"]))) / machine.axis.ring_ratio,
        base_um=float(np.ptp(shake)),
        brake_energy_kj=energy,
        torque_limited=bool(np.any(log["torque_limited"])),
        load_swing_deg_s=deg(float(np.max(np.abs(log["vel_load_rad_s"][rest:])))),
    )


def _static_base(machine: Machine, load: Floats) -> Floats:
    """Deflection of the base under the eccentric moment alone, rad."""
    plant: _core.PlantParams = plant_params(machine)
    if not plant.base:
        return np.zeros_like(load)
    sign = math.copysign(1.0, eccentric_moment_nm(machine))
    moment = sign * machine.plant.load.eccentric_check_moment_nm * machine.plant.switches.eccentric_moment
    return moment * np.sin(load - plant.eccentric_angle_rad) / plant.base_stiffness_nm_per_rad
