"""From the sheet and a motor to a machine file: the same numbers, under the machine file's keys."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from gantryctl.engineering.sizing.checks import Fit, usable_torque_nm
from gantryctl.engineering.sizing.motors import MotorFile
from gantryctl.engineering.sizing.sheet import Sheet
from gantryctl.errors import ConfigError
from gantryctl.machine import Machine, default_machine, field_specs, with_values
from gantryctl.machine.effective import toml_tables
from gantryctl.machine.specs import Value
from gantryctl.machine.tables.fields import Table
from gantryctl.units import DEG_S_PER_R_MIN

_SPEED_CHAIN: Final = ("command_clamp_deg_s", "drive_ceiling_deg_s", "overspeed_trip_deg_s")
# 1 r/min is 6 deg/s: what comes of the conversion must not end in 5.999999999999999.
_DIGITS: Final = 12


def machine_values(sheet: Sheet, motor: MotorFile) -> dict[str, Value]:
    """Every value of a machine file that the sheet or the motor decides, by dotted path."""
    return {
        **_under("required", sheet.required),
        "required.source": sheet.required.source or f"requirement sheet {sheet.sheet.name}",
        **_limits(sheet),
        **_parts(sheet, motor),
        **{f"plant.{path}": value for path, value in _plant(sheet).items()},
    }


def _limits(sheet: Sheet) -> dict[str, Value]:
    # The chain keeps its proportions: clamp 1.05, ceiling 1.083 and trip 1.1 x the highest setting.
    reference = default_machine().speed
    top = round(sheet.motion.speed_max_r_min * DEG_S_PER_R_MIN, _DIGITS)
    chain = {
        f"speed.{key}": round(getattr(reference, key) * top / reference.setting_max_deg_s, _DIGITS)
        for key in _SPEED_CHAIN
    }
    return {
        "axis.kind": sheet.range.kind,
        "axis.pos_min_deg": sheet.range.pos_min_deg,
        "axis.pos_max_deg": sheet.range.pos_max_deg,
        "axis.reducer_ratio": sheet.gears.reducer_ratio,
        "axis.ring_ratio": sheet.gears.ring_ratio,
        "speed.setting_min_deg_s": round(sheet.motion.speed_min_r_min * DEG_S_PER_R_MIN, _DIGITS),
        "speed.setting_max_deg_s": top,
        **chain,
        "virtual_axis.acc_deg_s2": sheet.motion.acc_deg_s2,
        "virtual_axis.dec_deg_s2": sheet.motion.acc_deg_s2,
    }


def _parts(sheet: Sheet, motor: MotorFile) -> dict[str, Value]:
    return {
        **_under("motor", motor.motor),
        "motor.torque_max_nm": usable_torque_nm(sheet, motor),
        "reducer.torque_rated_nm": sheet.gears.torque_rated_nm,
        "reducer.torque_momentary_nm": sheet.gears.torque_momentary_nm,
        **_under("encoder", motor.encoder),
        "encoder.wrap_margin_min_deg": sheet.range.wrap_margin_min_deg,
        **_under("brake", motor.brake),
        "drive.speed_loop.overload_time_s": motor.drive.overload_time_s,
    }


def _plant(sheet: Sheet) -> dict[str, Value]:
    """What the sheet says of the load is also what the simulator simulates."""
    load, gears = sheet.load, sheet.gears
    return {
        "load.inertia_kg_m2": load.inertia_kg_m2,
        "load.mass_kg": load.mass_kg,
        "load.eccentricity_m": load.eccentricity_m,
        "load.eccentric_angle_deg": load.eccentric_angle_deg,
        "load.eccentric_check_moment_nm": load.eccentric_check_moment_nm,
        "motor.wave_generator_inertia_kg_m2": gears.input_inertia_kg_m2,
        "roller_friction.coulomb_nm": load.friction_coulomb_nm,
        "roller_friction.viscous_nm_s_per_rad": load.friction_viscous_nm_s_per_rad,
        "motor_friction.coulomb_nm": gears.friction_coulomb_nm,
        "motor_friction.viscous_nm_s_per_rad": gears.friction_viscous_nm_s_per_rad,
        "motor_friction.load_ratio": gears.load_loss_ratio,
    }


def _under(table: str, values: Table) -> dict[str, Value]:
    return {f"{table}.{key}": value for key, value in values}


def sized_machine(base: Machine, fitted: Fit) -> Machine:
    """A machine file with the sheet's and the motor's values; everything else of `base`.

    Raises:
        ConfigError: the motor does not fit, or the values contradict something else in the machine file.
    """
    if not fitted.fits:
        name = fitted.train.sheet.sheet.name
        raise ConfigError([f"{fitted.motor.name} does not fit {name}: {why}" for why in fitted.reasons])
    return with_values(base, machine_values(fitted.train.sheet, fitted.motor))


def as_tables(values: Mapping[str, Value]) -> str:
    """The values as tables of a machine file, in its order."""
    return toml_tables({path: values[path] for path in field_specs() if path in values}, units=True)
