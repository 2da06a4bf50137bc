"""Stops on the full plant: cruise at a speed, stop at an angle, watch until the load is calm."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from gantryctl import _core
from gantryctl.engineering.batch import (
    ClosedLoop,
    Leg,
    Log,
    Runner,
    alone,
    base_motion_rad,
    expected,
    grouped,
    in_lockstep,
    settling_s,
)
from gantryctl.engineering.report.text import decimals, figure
from gantryctl.errors import ConfigError
from gantryctl.machine import Machine
from gantryctl.machine.places import heaviest_deg
from gantryctl.machine.rules.reaction import REACTION_S
from gantryctl.motion import MotionLimits, SetPoint, hold, plan_stop, plan_velocity
from gantryctl.notebook import table_html
from gantryctl.units import deg, rad
from gantryctl.wiring.compensation import compensation
from gantryctl.wiring.plant_effects import larger_share_nm
from gantryctl.wiring.program import position_law
from gantryctl.wiring.simulator import drive_params, eccentric_moment_nm, gantry_sim, plant_params

# Speeds that stops are judged at, as parts of the highest one.
SPEED_PARTS: Final = (0.1, 0.5, 1.0)
# Motor side: below this the axis counts as standing; one that is slower than the reference gantry below this part of
# its highest speed. A yaw drive with 0.34 deg/s comes to rest from 0.05 in 0.016 deg.
_AT_REST_DEG_S: Final = 0.05
_AT_REST_SHARE: Final = 1.0 / 120.0
# Acceleration to the test speed, gentle enough to leave the load calm.
_RAMP_UP_S: Final = 5.0
_CRUISE_S: Final = 1.0
_OFF: Final = 0
_QUICK_STOP: Final = 2
# A drive that stands so long has ended its ramp.
_STANDS_S: Final = 0.010
# How long after rest the load and the base are watched.
_WATCH_S: Final = 2.0
_BRAKE_WATCH_S: Final = 7.0
_USED: Final = (
    "pos_motor_rad", "vel_motor_rad_s", "pos_load_rad", "vel_load_rad_s", "pos_base_rad", "torque_act_nm",
    "torque_mesh_nm",
)  # fmt: skip
_COLUMNS: Final = (*_USED, "torque_limited")


class StopClass(Enum):
    """The ways to come to rest."""

    NORMAL = "normal"
    JOG_RELEASE = "jog-release"
    QUICK = "quick"
    BRAKE = "torque off + brake"


class StopResult(NamedTuple):
    """One stop, from the command to rest; angles and speeds at the gantry.

    Attributes:
        angle_deg, time_s: until the motor stands (`at_rest_deg_s`), its farthest way: a load that swings may turn it
            back a little before. load_angle_deg: farthest way of the load.
        torque_motor_nm, torque_reducer_nm: largest, motor shaft and reducer output.
        base_um: largest base motion at the ring after the static part, peak to peak.
        brake_energy_kj: turned to heat by the brake's lining. motor_energy_kj: taken out of the motion by the motor.
        torque_limited: the drive's torque limit acted.
        load_swing_deg_s: largest speed of the load after the motor stands.
        settled_s: until the load swings with less than 0.05 deg/s, by the envelope of its swing (`settling_s`).
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
    motor_energy_kj: float
    torque_limited: bool
    load_swing_deg_s: float
    settled_s: float


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
    return _run(StopCase(machine, stop_class, speed_deg_s, quick_dec_deg_s2), at_deg, alone)


def log_stop(
    machine: Machine,
    stop_class: StopClass,
    speed_deg_s: float,
    at_deg: float,
    quick_dec_deg_s2: float | None = None,
) -> Log:
    """The stop of `run_stop` as it runs, from the command on; under a command to the drive without set-points."""
    case = StopCase(machine, stop_class, speed_deg_s, quick_dec_deg_s2)
    return _log(case, at_deg, alone, _core.LOG_COLUMNS)


class StopCase(NamedTuple):
    """A stop of a machine; see `run_stop`. The sign of the speed is the direction."""

    machine: Machine
    stop_class: StopClass
    speed_deg_s: float
    quick_dec_deg_s2: float | None = None


def _run(case: StopCase, at_deg: float, run: Runner) -> StopResult:
    return _evaluate(case, _log(case, at_deg, run, _COLUMNS))


def _log(case: StopCase, at_deg: float, run: Runner, columns: Sequence[str]) -> Log:
    machine, stop_class, speed_deg_s, quick_dec_deg_s2 = case
    loop = _cruising(case, at_deg, run)
    if stop_class is StopClass.QUICK:
        ramp_s = abs(speed_deg_s) / (quick_dec_deg_s2 or machine.virtual_axis.quick_dec_deg_s2)
        leg = Leg(hold(0.0), ramp_s + _WATCH_S, mode=_QUICK_STOP)
    elif stop_class is StopClass.BRAKE:
        leg = Leg(hold(0.0), _BRAKE_WATCH_S, mode=_OFF, brake_open=False)
    else:
        plan = _ramp(machine, stop_class, SetPoint(rad(at_deg), rad(speed_deg_s), 0.0))
        leg = Leg(plan, plan.duration + _WATCH_S)
    return run(loop, [leg], columns)


def worst_stop(
    machine: Machine, stop_class: StopClass, speed_deg_s: float, quick_dec_deg_s2: float | None = None
) -> StopResult:
    """The stops where the eccentric moment is largest, in both directions, each figure the worst of the four."""
    return expected(worst_stops([StopCase(machine, stop_class, speed_deg_s, quick_dec_deg_s2)]))[0]


def worst_stops(cases: Sequence[StopCase]) -> list[StopResult | Exception]:
    """The same for several cases side by side; an exception where one cannot be simulated."""
    # The moment helps or hinders by direction.
    runs = [
        [
            (case._replace(speed_deg_s=sign * case.speed_deg_s), at)
            for at in heaviest_deg(case.machine)
            for sign in (1.0, -1.0)
        ]
        for case in cases
    ]
    stops = in_lockstep([partial(_run, *each) for own in runs for each in own])
    return [
        own if isinstance(own, Exception) else worst_of(case.stop_class, case.speed_deg_s, own)
        for case, own in zip(cases, grouped(stops, [len(own) for own in runs]), strict=True)
    ]


def unbraked_stop_deg(machine: Machine, speed_deg_s: float) -> float:
    """Way of a quick stop whose drive takes its torque off at the end of its ramp, before the brake has closed.

    A silent controller works no brake any more, and a drive without one of its own waits for none: the motor goes with
    the load, and turns back what the gear is twisted by. Worst of four.
    """
    ramp_s = speed_deg_s / machine.virtual_axis.quick_dec_deg_s2 + _STANDS_S
    legs = [
        Leg(hold(0.0), ramp_s, mode=_QUICK_STOP),
        Leg(hold(0.0), _BRAKE_WATCH_S, mode=_OFF, brake_open=False),
    ]
    cases = [
        (StopCase(machine, StopClass.QUICK, sign * speed_deg_s), at)
        for at in heaviest_deg(machine)
        for sign in (1.0, -1.0)
    ]
    logs = expected(in_lockstep([partial(_log_legs, case, at, legs) for case, at in cases]))
    return max(_motor_way(case, log)[0] for (case, _), log in zip(cases, logs, strict=True))


def _log_legs(case: StopCase, at_deg: float, legs: Sequence[Leg], run: Runner) -> Log:
    return run(_cruising(case, at_deg, run), legs, _COLUMNS)


def worst_of(stop_class: StopClass, speed_deg_s: float, stops: Sequence[StopResult]) -> StopResult:
    """Each figure the worst of several stops."""
    worst = {name: max(getattr(stop, name) for stop in stops) for name in StopResult._fields[2:]}
    return StopResult(stop_class, speed_deg_s, **worst)


def at_rest_deg_s(machine: Machine) -> float:
    """A motor that turns more slowly counts as standing, deg/s at the gantry."""
    return min(_AT_REST_DEG_S, _AT_REST_SHARE * machine.speed.setting_max_deg_s)


def within_ratings(machine: Machine, stop: StopResult) -> bool:
    """True when a stop stays below the torque limit of the drive and the momentary torque of the reducer."""
    return not stop.torque_limited and stop.torque_reducer_nm <= machine.reducer.torque_momentary_nm


def _cruising(case: StopCase, at_deg: float, run: Runner) -> ClosedLoop:
    """The axis in steady motion, just arriving at the angle."""
    machine, _, speed_deg_s, quick_dec_deg_s2 = case
    plant, drive = plant_params(machine), drive_params(machine)
    if machine.plant.switches.eccentric_moment:
        plant.eccentric_moment_nm = _check_moment_nm(machine)
    # The wind is in the moment of the check.
    plant.wind = False
    if quick_dec_deg_s2 is not None:
        drive.quick_dec_rad_s2 = rad(quick_dec_deg_s2) * machine.axis.ratio
    speed = rad(speed_deg_s)
    # Gentle, so that the stop is measured and not the start.
    acc = abs(speed) / _RAMP_UP_S
    limits = MotionLimits(abs(speed), acc, acc, acc / 0.5)
    ramp = plan_velocity(SetPoint(0.0, 0.0, 0.0), speed, limits)
    way = ramp.pos_end + speed * _CRUISE_S
    start = rad(at_deg) - way
    plan = plan_velocity(SetPoint(start, 0.0, 0.0), speed, limits)
    sim = gantry_sim(machine, plant, drive)
    loop = ClosedLoop.standing_at(sim, position_law(machine), start, _compensation(machine))
    run(loop, [Leg(plan, plan.duration + _CRUISE_S)], ())
    return loop


def _compensation(machine: Machine) -> _core.Compensation | None:
    """The compensations that are on; none on a machine that is still to be identified, which stops without them."""
    missing = machine.control.compensation.needs_calibration and machine.calibration is None
    return None if missing else compensation(machine)


def _check_moment_nm(machine: Machine) -> float:
    """The eccentric moment that stops are held against, with the sign of the machine's own."""
    return math.copysign(machine.plant.load.eccentric_check_moment_nm, eccentric_moment_nm(machine))


def _ramp(machine: Machine, stop_class: StopClass, start: SetPoint) -> _core.Segments:
    """The stop of the virtual axis on its normal or jog-release ramp."""
    axis = machine.virtual_axis
    if stop_class is StopClass.JOG_RELEASE:
        dec, jerk = rad(axis.jog_release_dec_deg_s2), rad(axis.jog_release_jerk_deg_s3)
    else:
        dec = rad(axis.dec_deg_s2)
        jerk = rad(axis.jerk_deg_s3) if axis.profile == "jerk_limited" else math.inf
    return plan_stop(start, MotionLimits(abs(start.vel_rad_s), dec, dec, jerk))


def _evaluate(case: StopCase, log: Log) -> StopResult:
    machine, stop_class, speed_deg_s, _ = case
    if not all(np.isfinite(log[name]).all() for name in _USED):
        raise ConfigError(
            [
                f"{machine.name}: a stop from {abs(speed_deg_s):g} deg/s does not stay finite: [plant] or the drive's "
                "loops are too stiff to be simulated; go back towards the defaults"
            ]
        )
    vel_motor, load = np.abs(log["vel_motor_rad_s"]), log["pos_load_rad"]
    angle_deg, rest = _motor_way(case, log)
    moment = _check_moment_nm(machine) * machine.plant.switches.eccentric_moment
    rocking = base_motion_rad(machine, log["pos_base_rad"], load, moment)
    shake = rocking * machine.plant.gear_error.ring_radius_m * 1e6
    lining = 0.0
    if stop_class is StopClass.BRAKE:
        # Until then the brake is on its way: the motor coasts. A worn lining has a part of its torque.
        slipping = log.time_s >= machine.brake.close_time_ms * 1e-3
        lining = (
            plant_params(machine).brake_torque_nm * float(np.sum(vel_motor[slipping])) * log.period_s * 1e-3
        )
    shaft_nm = log["torque_act_nm"] * machine.plant.motor.torque_constant_ratio
    taken = -float(np.sum(shaft_nm * log["vel_motor_rad_s"])) * log.period_s * 1e-3
    return StopResult(
        stop_class,
        speed_deg_s,
        angle_deg=angle_deg,
        time_s=rest * log.period_s,
        load_angle_deg=deg(float(np.max(np.abs(load - load[0])))),
        torque_motor_nm=larger_share_nm(machine, float(np.max(np.abs(log["torque_act_nm"])))),
        torque_reducer_nm=float(np.max(np.abs(log["torque_mesh_nm"]))) / machine.axis.ring_ratio,
        base_um=float(np.ptp(shake)),
        brake_energy_kj=lining,
        motor_energy_kj=taken,
        torque_limited=bool(np.any(log["torque_limited"])),
        load_swing_deg_s=deg(float(np.max(np.abs(log["vel_load_rad_s"][rest:])))),
        settled_s=rest * log.period_s
        + settling_s(log["vel_load_rad_s"][rest:], log.period_s, rad(_AT_REST_DEG_S)),
    )


def _motor_way(case: StopCase, log: Log) -> tuple[float, int]:
    """Farthest way of the motor until it stands, deg at the gantry, and the row from which on it does."""
    ratio, motor = case.machine.axis.ratio, log["pos_motor_rad"]
    fast = np.abs(log["vel_motor_rad_s"]) / ratio > rad(at_rest_deg_s(case.machine))
    moving = np.nonzero(fast)[0]
    rest = min(int(moving[-1]) + 1, len(motor) - 1) if len(moving) else 0
    return deg(float(np.max(np.abs(motor[: rest + 1] - motor[0])))) / ratio, rest


class StopRow(NamedTuple):
    """A stop, its angle with reaction, and whether to inspect the machine.

    Attributes:
        angle_with_reaction_deg: stopping angle with 60 ms of travel before it.
        inspect: the stop is above the ratings of motor or reducer: inspect afterwards.
    """

    stop: StopResult
    angle_with_reaction_deg: float
    inspect: bool


class StopTable(list[StopRow]):
    """Rows of `stop_table`; a notebook shows them as a table."""

    def _repr_html_(self) -> str:
        head = ("stop", "from, deg/s", "angle, deg", "with reaction, deg", "time, s", "motor, N m", "")
        torque = decimals([row.stop.torque_motor_nm for row in self], 0)
        rows = [
            (
                row.stop.stop_class.value,
                figure(row.stop.speed_deg_s, 1),
                f"{row.stop.angle_deg:.2f}",
                f"{row.angle_with_reaction_deg:.2f}",
                f"{row.stop.time_s:.2f}",
                f"{row.stop.torque_motor_nm:.{torque}f}",
                "inspect afterwards" if row.inspect else "",
            )
            for row in self
        ]
        return table_html("Stops", head, rows)


def stop_table(machine: Machine, speeds_deg_s: tuple[float, ...] | None = None) -> StopTable:
    """Every stop class at 1/10, 1/2 and the whole of the highest speed (or at `speeds_deg_s`), worst of four cases."""
    top = machine.speed.setting_max_deg_s
    speeds = speeds_deg_s or tuple(k * top for k in SPEED_PARTS)
    cases = [StopCase(machine, stop_class, speed) for stop_class in StopClass for speed in speeds]
    rows = StopTable()
    for stop in expected(worst_stops(cases)):
        angle = stop.angle_deg + stop.speed_deg_s * REACTION_S
        rows.append(StopRow(stop, angle, inspect=not within_ratings(machine, stop)))
    return rows
