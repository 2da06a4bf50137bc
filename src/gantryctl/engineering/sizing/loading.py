"""From a requirement sheet's file to a `Sheet`, or to the list of everything that is wrong with it."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from pathlib import Path

from gantryctl.engineering.sizing.duty import cycle_time_s
from gantryctl.engineering.sizing.equations import mean_acceleration_rad_s2
from gantryctl.engineering.sizing.sheet import Sheet
from gantryctl.errors import ConfigError
from gantryctl.machine import configs_folder, field_specs, load_table
from gantryctl.machine.rules.reaction import REACTION_S
from gantryctl.machine.specs import unknown_guesses
from gantryctl.units import DEG_S_PER_R_MIN, GRAVITY_M_S2, deg, rad


def default_sheet_path() -> Path:
    """Where the reference machine's requirement sheet lies."""
    return configs_folder() / "requirements" / "hust_gantry.toml"


@functools.cache
def _reference_sheet() -> Sheet:
    return load_sheet(default_sheet_path())


def is_reference_sheet(sheet: Sheet) -> bool:
    """Whether a sheet asks for what the axis of the source paper must do: range, motion, load and gears are its."""
    reference = _reference_sheet()
    tables = ("range", "motion", "load", "gears")
    return all(getattr(sheet, name) == getattr(reference, name) for name in tables)


def load_sheet(path: Path | str) -> Sheet:
    """Read and check a requirement sheet.

    Raises:
        ConfigError: one line per problem, all of them; an impossible requirement is a problem too.
    """
    sheet = load_table(Sheet, path)
    lines = contradictions(sheet)
    if lines:
        raise ConfigError([f"{path}: {line}" for line in lines])
    return sheet


def contradictions(sheet: Sheet) -> list[str]:
    """One line per contradiction: `[table] key = value: what must hold, against what`."""
    return [
        *_guesses(sheet),
        *_required(sheet),
        *_travel(sheet),
        *_motion(sheet),
        *_gears(sheet),
        *_duty(sheet),
    ]


def _guesses(sheet: Sheet) -> Iterator[str]:
    unknown = unknown_guesses(sheet.sheet.guesses, field_specs(Sheet))
    if unknown:
        yield f"[sheet] guesses: names {unknown}: there is no such key in a sheet; correct or delete the row"


def _required(sheet: Sheet) -> Iterator[str]:
    # A machine file may leave it to the default; a sheet is there to say it.
    if "angle_deg" not in sheet.required.model_fields_set:
        allowed = field_specs(Sheet)["required.angle_deg"].allowed
        yield f"[required] angle_deg: is missing; allowed {allowed}"


def _travel(sheet: Sheet) -> Iterator[str]:
    low, high = sheet.range.pos_min_deg, sheet.range.pos_max_deg
    if high - low < 1.0:
        yield (f"[range] pos_min_deg = {low:g} deg: must lie at least 1 deg below pos_max_deg = {high:g} deg")
    if sheet.range.kind == "modulo" and abs(high - low - 360.0) > 1e-9:
        yield (f"[range] kind = modulo: {low:g}..{high:g} deg must be one turn: 0..360 or -180..180 deg")


def _motion(sheet: Sheet) -> Iterator[str]:
    m = sheet.motion
    travel = sheet.range.pos_max_deg - sheet.range.pos_min_deg
    speed = m.speed_max_r_min * DEG_S_PER_R_MIN
    # A normal move may not ask for more than the motor is sized for.
    sizing = deg(mean_acceleration_rad_s2(m.speed_max_r_min, m.sizing_time_s))
    if m.speed_min_r_min >= m.speed_max_r_min:
        yield (
            f"[motion] speed_min_r_min = {m.speed_min_r_min:g} r/min: must be below speed_max_r_min = "
            f"{m.speed_max_r_min:g} r/min"
        )
    if m.acc_deg_s2 > sizing * (1.0 + 1e-9):
        yield (
            f"[motion] acc_deg_s2 = {m.acc_deg_s2:g} deg/s2: must be at most {sizing:.4g} deg/s2, the acceleration "
            f"that sizes the motor: {m.speed_max_r_min:g} r/min in sizing_time_s = {m.sizing_time_s:g} s"
        )
    # An axis without ends turns on until it has its speed.
    if sheet.range.kind != "modulo" and speed**2 / m.acc_deg_s2 > travel:
        yield (
            f"[motion] speed_max_r_min = {m.speed_max_r_min:g} r/min: is never reached: with acc_deg_s2 = "
            f"{m.acc_deg_s2:g} deg/s2 it takes {speed**2 / m.acc_deg_s2:.4g} deg to reach and leave it, the travel "
            f"is {travel:g} deg"
        )
    if speed * REACTION_S >= sheet.required.stopping_angle_deg:
        yield (
            f"[required] stopping_angle_deg = {sheet.required.stopping_angle_deg:g} deg: the axis travels "
            f"{speed * REACTION_S:.3g} deg at {speed:g} deg/s before any stop begins ({1e3 * REACTION_S:g} ms)"
        )


def _gears(sheet: Sheet) -> Iterator[str]:
    g, load = sheet.gears, sheet.load
    if g.torque_momentary_nm < g.torque_rated_nm:
        yield (
            f"[gears] torque_momentary_nm = {g.torque_momentary_nm:g} N m: must be at least torque_rated_nm = "
            f"{g.torque_rated_nm:g} N m"
        )
    nominal = load.mass_kg * GRAVITY_M_S2 * load.eccentricity_m
    if nominal > load.eccentric_check_moment_nm:
        yield (
            f"[load] eccentric_check_moment_nm = {load.eccentric_check_moment_nm:g} N m: must be at least the "
            f"eccentric moment itself, mass x {GRAVITY_M_S2:g} x eccentricity = {nominal:.4g} N m"
        )
    elif nominal + sheet.wind.largest_nm > load.eccentric_check_moment_nm * (1.0 + 1e-9):
        yield (
            f"[load] eccentric_check_moment_nm = {load.eccentric_check_moment_nm:g} N m: must be at least "
            f"{nominal + sheet.wind.largest_nm:.4g} N m: the eccentric moment and [wind] "
            "moment_nm x (1 + 7 x turbulence)"
        )
    sizing = mean_acceleration_rad_s2(sheet.motion.speed_max_r_min, sheet.motion.sizing_time_s)
    for what, acc, key in (
        (f"sizing_time_s = {sheet.motion.sizing_time_s:g} s", sizing, "torque_momentary_nm"),
        (f"acc_deg_s2 = {sheet.motion.acc_deg_s2:g} deg/s2", rad(sheet.motion.acc_deg_s2), "torque_rated_nm"),
    ):
        # Without rotor and losses, which a motor would add: so no motor can be blamed for it, and none can help.
        at_ring = load.inertia_kg_m2 * acc + load.eccentric_check_moment_nm + load.friction_coulomb_nm
        need, limit = at_ring / g.ring_ratio, getattr(g, key)
        if need > limit:
            yield (
                f"[motion] {what}: the load alone puts {need:.4g} N m on the reducer (acceleration, largest eccentric "
                f"moment, rollers), [gears] {key} = {limit:g} N m; no motor can change that"
            )


def _duty(sheet: Sheet) -> Iterator[str]:
    duty = sheet.duty
    low, high = sheet.range.pos_min_deg, sheet.range.pos_max_deg
    for stop in duty.stops_deg:
        if not low <= stop <= high:
            yield (f"[duty] stops_deg = {stop:g} deg: must lie within [range] {low:g}..{high:g} deg")
    hours = duty.cycles * cycle_time_s(sheet) / 3600.0
    if hours > duty.hours:
        yield (
            f"[duty] cycles = {duty.cycles}: take {hours:.3g} h with moves at the highest speed and hold_s = "
            f"{duty.hold_s:g} s at every stop; hours = {duty.hours:g} h"
        )
