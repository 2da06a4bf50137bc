"""Limits of the quick stop: motor overload, reducer, permitted stopping angle."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Final

from gantryctl.engineering.batch import expected, grouped
from gantryctl.engineering.stops.run import (
    SPEED_PARTS,
    StopCase,
    StopClass,
    StopResult,
    within_ratings,
    worst_of,
    worst_stops,
)
from gantryctl.errors import ConfigError
from gantryctl.machine import Machine
from gantryctl.machine.rules.reaction import REACTION_S
from gantryctl.wiring.program import rest_speed_deg_s, speed_step_deg_s

# Steps of the search, of the power of ten below the configured value: 0.1 deg/s2 for 5.4.
_RESOLUTION: Final = 0.1
_FEWEST_STEPS, _MOST_STEPS = 2, 400
# What counts as rest, as part of the highest setting: no faster than the slowest creep that a draft gives.
_REST_SHARE_MAX: Final = 1.0 / 60.0


def hardest_quick_stop(machine: Machine, quick_dec_deg_s2: float | None = None) -> StopResult:
    """Each figure the worst over 1/10, 1/2 and the whole of the highest speed: friction helps a fast stop more."""
    return expected(hardest_quick_stops([machine], quick_dec_deg_s2))[0]


def hardest_quick_stops(
    machines: Sequence[Machine], quick_dec_deg_s2: float | None = None
) -> list[StopResult | Exception]:
    """The same of several machines side by side; an exception where one cannot be simulated."""
    # Friction helps a fast stop more than a slow one, so the highest speed is not always the worst.
    cases = [
        StopCase(machine, StopClass.QUICK, k * machine.speed.setting_max_deg_s, quick_dec_deg_s2)
        for machine in machines
        for k in SPEED_PARTS
    ]
    stops = grouped(worst_stops(cases), [len(SPEED_PARTS)] * len(machines))
    return [
        own if isinstance(own, Exception) else worst_of(StopClass.QUICK, machine.speed.setting_max_deg_s, own)
        for machine, own in zip(machines, stops, strict=True)
    ]


def find_quick_dec(machine: Machine) -> float:
    """The largest quick-stop deceleration that the full plant allows from every speed, deg/s2.

    Bisection to a tenth of the power of ten below the configured value (0.1 deg/s2 for 5.4), rounded down.

    Raises:
        ConfigError: not even the smallest of them is possible.
    """
    speed = machine.speed.setting_max_deg_s
    resolution = _RESOLUTION * 10.0 ** math.floor(math.log10(machine.virtual_axis.quick_dec_deg_s2))

    def possible(steps: int) -> bool:
        dec = steps * resolution
        return within_ratings(machine, hardest_quick_stop(machine, dec))

    low, high = _FEWEST_STEPS, _MOST_STEPS
    if not possible(low):
        raise ConfigError(
            [
                f"{machine.machine.name}: no quick stop from {speed:g} deg/s is within motor.torque_max_nm = "
                f"{machine.motor.torque_max_nm:g} N m and reducer.torque_momentary_nm = "
                f"{machine.reducer.torque_momentary_nm:g} N m with the eccentric moment of the check, "
                f"{machine.plant.load.eccentric_check_moment_nm:g} N m; choose a larger motor or reducer"
            ]
        )
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if possible(middle) else (low, middle)
    return low * resolution


# Every command that moves asks, and an answer takes twelve simulated stops.
@functools.lru_cache(maxsize=16)
def check_quick_stop(machine: Machine) -> StopResult:
    """Check the machine file's quick stop on the full plant; returns the stop from the highest speed.

    A machine that has been checked is not simulated again.

    Raises:
        ConfigError: the deceleration cannot be given, the stopping angle is above the permitted one, or the speed
            is read too coarsely for the end of a stop to be known.
    """
    speed = machine.speed.setting_max_deg_s
    dec = machine.virtual_axis.quick_dec_deg_s2
    stop = hardest_quick_stop(machine)
    problems = []
    where = f"{machine.machine.name}: [virtual_axis] quick_dec_deg_s2 = {dec:g}"
    moment = machine.plant.load.eccentric_check_moment_nm
    if stop.torque_limited:
        problems.append(
            f"{where}: the motor cannot give it: a stop from up to {speed:g} deg/s with {moment:g} N m "
            f"eccentric moment needs more than [motor] torque_max_nm = {machine.motor.torque_max_nm:g} N m; "
            "`gantryctl stops --find-quick` finds the largest possible value"
        )
    if stop.torque_reducer_nm > machine.reducer.torque_momentary_nm:
        problems.append(
            f"{where}: the reducer cannot give it: a stop from up to {speed:g} deg/s with {moment:g} N m "
            f"eccentric moment puts {stop.torque_reducer_nm / 1e3:.1f} kN m on it, [reducer] torque_momentary_nm = "
            f"{machine.reducer.torque_momentary_nm / 1e3:.1f} kN m; "
            "`gantryctl stops --find-quick` finds the largest possible value"
        )
    # Rounded up to the hundredth: a limit is never met by rounding.
    angle = math.ceil((stop.angle_deg + speed * REACTION_S) * 100.0) / 100.0
    if angle > machine.required.stopping_angle_deg:
        problems.append(
            f"{where}: a quick stop from {speed:g} deg/s takes {angle:.2f} deg including {REACTION_S * 1e3:.0f} ms of "
            f"reaction, [required] stopping_angle_deg = {machine.required.stopping_angle_deg:g} deg; stop harder, "
            "go slower or permit more"
        )
    problems += unknown_rest(machine)
    if problems:
        raise ConfigError(problems)
    return stop


def unknown_rest(machine: Machine) -> list[str]:
    """What is wrong where an axis that still turns cannot be told from one at rest."""
    speed, rest = machine.speed.setting_max_deg_s, rest_speed_deg_s(machine)
    if rest <= _REST_SHARE_MAX * speed:
        return []
    finer = (
        "[can] velocity_unit, increments_per_turn or [control] scan_period_ms"
        if machine.on_bus
        else "[drive.speed_loop] feedback or the [encoder]"
    )
    return [
        f"{machine.machine.name}: the speed is read in steps of {speed_step_deg_s(machine):.3g} deg/s, so below "
        f"{rest:.3g} deg/s the axis counts as at rest: more than a 60th of [speed] setting_max_deg_s = {speed:g} "
        f"deg/s, and the end of a stop would not be known; choose finer {finer}"
    ]
