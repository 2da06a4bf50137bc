"""Limits of the invariants, at the axis, on the true motor side, each with its reason."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial
from typing import Final

import numpy as np

from gantryctl.engineering.faults.case import ReactionClass, SeenBy
from gantryctl.engineering.faults.limits import (
    brake_slip_deg,
    computed_deg,
    held_up_deg,
    runs_out_deg,
    standstill_deg,
)
from gantryctl.engineering.faults.physics import friction_nm
from gantryctl.engineering.stops import StopClass as SimulatedStop
from gantryctl.engineering.stops import worst_stop
from gantryctl.machine import Machine
from gantryctl.machine.rules.reaction import driven_acc_deg_s2
from gantryctl.units import deg
from gantryctl.wiring.simulator import plant_params


class StopClass(Enum):
    """Class of a stop: which way and time it may take."""

    QUICK = "quick stop"
    TORQUE_OFF = "torque off and brake"
    NO_RAMP = "a quick stop without a ramp, torque off and brake"
    FEEDBACK = "torque off and brake after a fault of the feedback"
    SILENCE = "drive and outputs by themselves after the last command"


# deg of way from the fault to rest at 1, 3 and 6 deg/s. Quick: 0.06 s of reaction, the stop computed on the full
# plant, and 2 %. Torque off and feedback are the worst of seeded runs, rounded up (fault catalogue, recomputed limits).
# A quick stop without a ramp is as torque off, and where a plant passes that, from when the ramp is seen to be left.
# Silence: torque off and brake 0.2 s later, the longest that a watchdog or a heartbeat of these tests waits.
_WAYS_DEG: Final = {
    StopClass.QUICK: (0.16, 1.04, 3.75),
    StopClass.TORQUE_OFF: (0.45, 1.4, 3.6),
    StopClass.NO_RAMP: (0.45, 1.4, 3.6),
    StopClass.FEEDBACK: (0.8, 2.1, 4.5),
    StopClass.SILENCE: (0.65, 2.0, 4.8),
}
# deg, for a fault at standstill or at the first motion, whatever its class.
_FROM_REST_DEG: Final = 0.35
_REST_S: Final = {
    StopClass.QUICK: 1.5,
    StopClass.TORQUE_OFF: 1.5,
    StopClass.NO_RAMP: 1.5,
    StopClass.FEEDBACK: 1.6,
    StopClass.SILENCE: 1.7,
}
"""From the alarm to rest: 1.2 and 1.1 s from 6 deg/s, and the 50 kN m of the check moment with the 50 ms of a rest
that lasts; silence has no alarm, and is noticed 0.2 s after the last command at the latest."""
TOLD_UNHELD_S: Final = 3.5
"""A load that turns on without torque, its brake commanded closed, is told of after 3 s; half a second for the scans,
and for a speed that swings about what is rest."""
SILENT_MS: Final = 20
"""No command for so long is a controller that commands no more: the longest scan takes 10 ms."""
BRAKE_BEGINS_S: Final = 0.15
"""A brake that closes by itself has its torque this long after it began to close (fault catalogue C5)."""
RAMP_LEFT: Final = 0.55
"""Part of the torque of the brake that a moved load must leave for a quick stop to keep its ramp: 208 of 385 N m turn
the reference gantry 5.5 deg/s2 slower (2.48e6 kg m2), and the brake has 380 to 400."""
BRAKE_ACC_DEG_S2: Final = 10.6
"""What a load as large as the torque of the brake, 400 N m, adds to the speed of the reference gantry."""
RAMP_LEAVES_S: Final = 0.15
"""A ramp that is left is told after the 0.09 s in which the speed is 0.5 deg/s above it, and 0.05 s."""

TOLD_WRONG_S: Final = 0.1
"""So long may an angle be wrong before it is called not valid: an alarm is told within 100 ms."""
BRAKE_CLOSES_S: Final = 0.2
"""Dead time of the brake by its specification."""
OVERSPEED: Final = 1.1
"""Part of the highest speed setting that the true speed never passes without a fault of the feedback."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """Limits that go with the axis; the defaults are those of the reference gantry.

    Attributes:
        sag_deg: motion without a reason, in total: the brake that slips and is caught (C4).
        told_deg: every angle that is told.
        beyond_deg: so far beyond over-travel, or into a no-go sector, a stop of a fault may end: its largest way, from
            the highest speed.
        fault_overspeed_deg_s: what a fault of the feedback may add before the torque is off.
        unheld_acc_deg_s2: what its own load and wind add while neither torque nor brake hold it, at most until the
            brake must have closed.
        untwists_deg_s_per_nm: what a gear gives the rotor as it turns back, for each N m of torque that has gone off
            while no brake holds the shaft.
        rest_deg_s: slower is no motion: a tenth of what the load swings with after a quick stop.
        lasts_ms: what moves behind a shorter rest is still the way of the stop. A rotor that its brake has caught is
            torn off again while the load swings on and twists the gear, within half a swing, and goes with it for as
            long again at most (random 155847: at rest for 53 ms behind 4 deg/s, then 0.23 deg further behind a closed
            brake).
        regulation_deg_s: a command of this size is regulation at standstill, not motion.
        told_rest_deg_s: from the time that is told as "at rest after" on; the controller judges at a fifth.
        dither_deg: a standing encoder is asked by at most so much, forth and back in some ms each.
        rest_s: time to rest by class. way_deg: permitted way by class and speed.
        plant_way_deg: the same, computed on a plant that is not the one of `way_deg`, asked where that is passed.
        held_way_deg: permitted way by speed and time of a controller that stands still with a spoilt feedback.
        driven_acc_deg_s2: what all torque makes meanwhile.
        runs_out_deg: permitted way by speed and part of the torque of a drive that stops by itself, unreached.
    """

    sag_deg: float
    told_deg: float
    beyond_deg: float
    fault_overspeed_deg_s: float
    unheld_acc_deg_s2: float
    untwists_deg_s_per_nm: float
    rest_deg_s: float
    lasts_ms: float
    regulation_deg_s: float
    told_rest_deg_s: float
    dither_deg: float
    rest_s: Mapping[StopClass, float]
    way_deg: Callable[[StopClass, float], float]
    plant_way_deg: Callable[[StopClass, float], float] | None = None
    held_way_deg: Callable[[float, float], float] | None = None
    driven_acc_deg_s2: float = 0.0
    runs_out_deg: Callable[[float, float], float] | None = None


def reference_bounds(machine: Machine) -> Bounds:
    """Those of the reference gantry, for one of its kind whose plant is another (load, friction, stiffness)."""
    return replace(
        REFERENCE,
        plant_way_deg=partial(_computed_way_deg, machine),
        held_way_deg=partial(held_up_deg, machine),
        driven_acc_deg_s2=driven_acc_deg_s2(machine),
        runs_out_deg=partial(runs_out_deg, machine),
    )


def bounds_of(machine: Machine) -> Bounds:
    """The same for any axis: speeds as parts of its highest one, ways and times of its own brake and ramp."""
    top = machine.speed.setting_max_deg_s
    part = top / _TOP_DEG_S
    brake_s = worst_stop(machine, SimulatedStop.BRAKE, top).time_s + _AT_REST_SPARE_S
    quick_s = top / machine.virtual_axis.quick_dec_deg_s2 + _AT_REST_SPARE_S
    return Bounds(
        sag_deg=max(brake_slip_deg(machine), _SAG_SLIPS * machine.brake.sag_max_deg),
        # Half of the required angle, as of the reference gantry, or what goes with the speed.
        told_deg=max(REFERENCE.told_deg * max(1.0, part), 0.5 * machine.required.angle_deg),
        beyond_deg=computed_deg(machine, ReactionClass.FEEDBACK, top),
        fault_overspeed_deg_s=_driven_away_deg_s(machine),
        unheld_acc_deg_s2=_unheld_acc_deg_s2(machine),
        untwists_deg_s_per_nm=_untwists_deg_s_per_nm(machine),
        rest_deg_s=REFERENCE.rest_deg_s * part,
        lasts_ms=max(50.0, _SWING_SPARE * _half_swing_ms(machine)),
        regulation_deg_s=REFERENCE.regulation_deg_s * part,
        told_rest_deg_s=REFERENCE.told_rest_deg_s * part,
        dither_deg=_DITHER_TURNS * 360.0 / machine.axis.ratio,
        rest_s={
            StopClass.QUICK: quick_s,
            StopClass.TORQUE_OFF: brake_s,
            StopClass.NO_RAMP: brake_s,
            StopClass.FEEDBACK: brake_s + 0.1,
            StopClass.SILENCE: max(brake_s, quick_s if machine.on_bus else 0.0) + 0.2,
        },
        way_deg=partial(_computed_way_deg, machine),
        held_way_deg=partial(held_up_deg, machine),
        driven_acc_deg_s2=driven_acc_deg_s2(machine),
        runs_out_deg=partial(runs_out_deg, machine),
    )


def _driven_away_deg_s(machine: Machine) -> float:
    """Speed that all torque makes until the following error trips: the rotor is that much faster, or swings up to it.

    1.6 deg/s on the reference gantry, where 1.2 are specified.
    """
    monitors, acc = machine.monitors, driven_acc_deg_s2(machine)
    top, scan_ms = machine.speed.setting_max_deg_s, machine.control.scan_period_ms
    band_deg = monitors.following_error_base_deg + monitors.following_error_per_speed_s * top
    trips_s = (2.0 * band_deg / acc) ** 0.5
    return float(acc * (trips_s + 1e-3 * (monitors.following_error_time_ms + 2.0 * scan_ms)))


def _unheld_acc_deg_s2(machine: Machine) -> float:
    """Eccentric moment and largest gust of this axis' own wind, less the friction of its rollers and motor.

    A telescope in its wind (73 kN m and gusts) gains 0.22 deg/s in the 0.35 s of a brake that is 0.2 s late, which is
    more than a tenth of its 2 deg/s.
    """
    p = plant_params(machine)
    moment_nm = abs(p.eccentric_moment_nm)
    if p.wind:
        waves = zip(p.wind_wave_nm, p.wind_rate_rad_s, p.wind_phase_rad, strict=True)
        # No row of the table lasts longer.
        time_s = np.arange(0.0, 120.0, 0.01)
        gusts = sum(nm * np.sin(rate * time_s + phase) for nm, rate, phase in waves)
        moment_nm += float(np.abs(p.wind_moment_nm + gusts).max())
    moment_nm -= p.ratio * friction_nm(machine)
    inertia_kg_m2 = p.inertia_load_kg_m2 + p.ratio**2 * p.inertia_motor_kg_m2
    return deg(max(0.0, moment_nm) / inertia_kg_m2)


def _untwists_deg_s_per_nm(machine: Machine) -> float:
    """The energy of a twist is (T i)^2 / 2k, that of the rotor J (i w)^2 / 2: its speed w is T over the root of k J.

    The first stiffness is the smallest. A yaw drive whose brake has no torque gains 0.66 deg/s from 65 N m, where this
    is 0.77 (seed 3210 of other axes).
    """
    p = plant_params(machine)
    return 0.0 if p.rigid else deg(1.0 / (p.stiffness_1_nm_per_rad * p.inertia_motor_kg_m2) ** 0.5)


def _half_swing_ms(machine: Machine) -> float:
    """Half a period of the load against a rotor that stands, at the smallest stiffness."""
    p = plant_params(machine)
    swing = 0.0 if p.rigid else (p.inertia_load_kg_m2 / p.stiffness_1_nm_per_rad) ** 0.5
    return 1e3 * np.pi * swing


def _computed_way_deg(machine: Machine, kind: StopClass, speed_deg_s: float) -> float:
    # However slow the axis is, a fault at standstill may move it as far.
    return max(standstill_deg(machine), _way_from_deg(machine, kind, abs(speed_deg_s)))


def _way_from_deg(machine: Machine, kind: StopClass, speed: float) -> float:
    if kind is StopClass.SILENCE:
        off_deg = computed_deg(machine, ReactionClass.TORQUE_OFF, speed) + 0.2 * speed
        # A drive on a bus misses the commands first, and its ramp may be longer than the way of its brake: a crane of
        # 0.54 Hz, 0.387 deg behind 0.35 deg/s (seed 8081 of other axes on the bus).
        own_ramp = machine.on_bus and not machine.can.output_place("watchdog")
        return (
            max(off_deg, computed_deg(machine, ReactionClass.DRIVE_DEADLINE, speed)) if own_ramp else off_deg
        )
    if kind is StopClass.NO_RAMP:
        return computed_deg(machine, ReactionClass.TORQUE_OFF, speed, SeenBy.RAMP)
    return computed_deg(machine, _REACTIONS[kind], speed)


def way_deg(kind: StopClass, speed_deg_s: float) -> float:
    """Permitted way from the fault to rest, deg; between the speeds of the table by the way per speed."""
    speed = abs(speed_deg_s)
    low, middle, high = (way / at for way, at in zip(_WAYS_DEG[kind], (1.0, 3.0, 6.0), strict=True))
    if speed <= 3.0:
        share = low + (middle - low) * max(0.0, speed - 1.0) / 2.0
    else:
        share = middle + (high - middle) * (speed - 3.0) / 3.0
    return max(_FROM_REST_DEG, share * speed)


REFERENCE: Final = Bounds(
    sag_deg=0.15,
    told_deg=0.05,
    beyond_deg=4.5,
    fault_overspeed_deg_s=1.2,
    # Its 16 kN m add 0.1 deg/s in 0.35 s; the bound has 0.6 deg/s to spare.
    unheld_acc_deg_s2=0.0,
    untwists_deg_s_per_nm=0.0,
    rest_deg_s=0.05,
    # 205 ms (2.18e6 kg m2 on 5.12e8 N m/rad), and 251 with an inertia a fifth larger and a stiffness a fifth smaller.
    lasts_ms=251.0,
    regulation_deg_s=0.05,
    told_rest_deg_s=0.1,
    dither_deg=0.006,
    rest_s=_REST_S,
    way_deg=way_deg,
)
_TOP_DEG_S: Final = 6.0
# Of the motor: 4096 of 524288 counts, and the way back.
_DITHER_TURNS: Final = 2.0 * 4096.0 / 524288.0
# Until torque holds what a brake lets go it sinks by some times of what is noticed.
_SAG_SLIPS: Final = 7.5
# Above the time of the simulated stop: the 50 ms of a rest that lasts, the time to see it, the load that swings on.
_AT_REST_SPARE_S: Final = 0.6
# The root of 1.2/0.8: a plant whose every value is a fifth off.
_SWING_SPARE: Final = 1.225
_REACTIONS: Final = {
    StopClass.QUICK: ReactionClass.QUICK_STOP,
    StopClass.TORQUE_OFF: ReactionClass.TORQUE_OFF,
    StopClass.FEEDBACK: ReactionClass.FEEDBACK,
}
