"""Limits of the quick stop: motor overload, reducer, permitted stopping angle."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Final

from gantryctl.engineering.analysis.models.mechanics import PlantKind, mechanics
from gantryctl.engineering.analysis.models.sampled import SampledLoop, loop_settings
from gantryctl.engineering.batch import expected, grouped
from gantryctl.engineering.stops.certify import certified_on, largest_dec_deg_s2
from gantryctl.engineering.stops.run import (
    SPEED_PARTS,
    StopCase,
    StopClass,
    StopResult,
    within_ratings,
    worst_of,
    worst_stops,
)
from gantryctl.engineering.stops.uncertain import INERTIA, Factors, plants
from gantryctl.errors import ConfigError
from gantryctl.machine import Machine, with_values
from gantryctl.machine.rules.reaction import REACTION_S
from gantryctl.wiring.program import rest_speed_deg_s, speed_step_deg_s

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
    """The largest quick-stop deceleration that the full plant of the file allows from every speed, deg/s2.

    Bisection to a tenth of the power of ten below the configured value (0.1 deg/s2 for 5.4), rounded down.

    Raises:
        ConfigError: not even the smallest of them is possible.
    """
    return largest_dec_deg_s2(machine, list(plants(machine, [Factors()])))


# Every command that moves asks, and an answer takes twelve simulated stops.
@functools.lru_cache(maxsize=16)
def check_quick_stop(machine: Machine, *, propose: bool = False) -> StopResult:
    """Check the machine file's quick stop on the full plant; returns the stop from the highest speed.

    The load is as heavy as [plant.uncertainty] identified_inertia_ratio lets an identified one be; a lighter one is
    easier to stop. A calibration that has found it heavier is refused. A machine that has been checked is not
    simulated again.

    Args:
        propose: say with a refusal which deceleration and speed would hold; takes a second.

    Raises:
        ConfigError: the deceleration cannot be given, the stopping angle is above the permitted one, or the speed
            is read too coarsely for the end of a stop to be known.
    """
    speed = machine.speed.setting_max_deg_s
    dec = machine.virtual_axis.quick_dec_deg_s2
    more = machine.plant.uncertainty.identified_inertia_ratio
    heaviest = next(plants(machine, [Factors(inertia=1.0 + more)])).machine
    stop = hardest_quick_stop(heaviest)
    problems = _too_heavy(machine, propose)
    where = f"{machine.machine.name}: [virtual_axis] quick_dec_deg_s2 = {dec:g}"
    moment = machine.plant.load.eccentric_check_moment_nm
    if not within_ratings(machine, stop) and not _loop_is_stable(machine):
        loop = machine.drive.speed_loop
        raise ConfigError(
            [
                *problems,
                f"{machine.machine.name}: [control] kpp_per_s = {machine.control.kpp_per_s:g}, [drive.speed_loop] "
                f"kvp_nm_s_per_rad = {loop.kvp_nm_s_per_rad:g}, tvi_ms = {loop.tvi_ms:g}: this loop is unstable on the "
                "plant of the file, and no stop goes by its ramp; `gantryctl analyse` shows it, `gantryctl tune` finds "
                "gains",
            ]
        )
    way_out = "`gantryctl stops --find-quick` finds the largest possible value"
    if propose and not within_ratings(machine, stop):
        way_out = f"{_holds(heaviest)}; {way_out}"
    heavier = f" and a load up to {100.0 * more:g} % heavier than [plant.load] inertia_kg_m2" if more else ""
    if stop.torque_limited:
        problems.append(
            f"{where}: the motor cannot give it: a stop from up to {speed:g} deg/s with {moment:g} N m "
            f"eccentric moment{heavier} needs more than [motor] torque_max_nm = {machine.motor.torque_max_nm:g} N m; "
            f"{way_out}"
        )
    if stop.torque_reducer_nm > machine.reducer.torque_momentary_nm:
        problems.append(
            f"{where}: the reducer cannot give it: a stop from up to {speed:g} deg/s with {moment:g} N m "
            f"eccentric moment{heavier} puts {stop.torque_reducer_nm / 1e3:.4g} kN m on it, [reducer] "
            f"torque_momentary_nm = {machine.reducer.torque_momentary_nm / 1e3:.4g} kN m; {way_out}"
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


def _loop_is_stable(machine: Machine) -> bool:
    """Both loops on the linear full plant, motor side."""
    return SampledLoop(mechanics(machine, PlantKind.FULL), loop_settings(machine)).stable()


def identified_load_kg_m2(machine: Machine) -> float | None:
    """Inertia of the load by the calibration: what was identified without rotor and wave generator; None without it."""
    found = machine.calibration
    if found is None or found.identified.inertia_kg_m2 is None:
        return None
    rotor = machine.motor.inertia_kg_m2 + machine.plant.motor.wave_generator_inertia_kg_m2
    return found.identified.inertia_kg_m2 - rotor * machine.axis.ratio**2


def _too_heavy(machine: Machine, propose: bool) -> list[str]:
    """What is wrong where identification has found a heavier load than the quick stop is checked with."""
    load, identified = machine.plant.load.inertia_kg_m2, identified_load_kg_m2(machine)
    more = machine.plant.uncertainty.identified_inertia_ratio
    if identified is None or identified <= load * (1.0 + more):
        return []
    way_out = "`gantryctl stops --find-quick` finds what holds for it"
    if propose:
        heavier = with_values(machine, {INERTIA: identified}).calibrated(machine.calibration)
        way_out = f"with [plant.load] inertia_kg_m2 = {identified:.4g} {_holds(heavier)}"
    return [
        f"{machine.name}: the load was identified with {identified:.4g} kg m2, "
        f"{100.0 * (identified / load - 1.0):.1f} % more than [plant.load] inertia_kg_m2 = {load:.4g}; [virtual_axis] "
        f"quick_dec_deg_s2 = {machine.virtual_axis.quick_dec_deg_s2:g} is checked for "
        f"{100.0 * more:g} % more ([plant.uncertainty] identified_inertia_ratio); {way_out}"
    ]


def _holds(machine: Machine) -> str:
    """Deceleration and speed that hold on the plant of a file, as a proposal."""
    try:
        found = certified_on(machine, list(plants(machine, [Factors()])))
    except ConfigError as none:
        return "; ".join(none.problems)
    return (
        f"set quick_dec_deg_s2 = {found.dec_deg_s2:.4g} and [speed] setting_max_deg_s = {found.speed_deg_s:.4g} at "
        "most, which hold"
    )


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
