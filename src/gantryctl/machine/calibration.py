"""`<machine>.calibration.toml`: what was identified on one machine, with its origin."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field, ValidationError

from gantryctl.errors import ConfigError
from gantryctl.machine.reading import parse_toml, printable, read_text
from gantryctl.machine.tables.fields import Table

# As many as the compiled laws have places for (`MAP_HARMONICS` and the others of the core).
MAP_HARMONICS: Final = 16
REVERSAL_HARMONICS: Final = 12
SCALE_HARMONICS: Final = 40

_Amplitude = Annotated[float, Field(ge=-0.1, le=0.1)]
Waves = Annotated[tuple[_Amplitude, ...], Field(min_length=1)]
FastWave = tuple[Annotated[float, Field(ge=1.0, le=1e5)], _Amplitude, _Amplitude]


class Origin(Table):
    """[origin]: where the values come from.

    Attributes:
        machine: name of the machine file.
        version: counts the calibrations of this machine.
        date: day of the measurement, YYYY-MM-DD.
        identity: hash of the machine's identity (`identity_hash`).
        encoder_serial: of the motor encoder that was read.
        instrument: what measured the load side.
        trace_sha256: of the recorded samples.
    """

    machine: str = Field(max_length=100)
    version: int = Field(ge=1)
    date: str = Field(pattern=r"^\d{4}-\d{2}-\d{2}$")
    identity: str = Field(pattern=r"^[0-9a-f]{16}$")
    encoder_serial: str = Field(max_length=40)
    instrument: str = Field(max_length=80)
    trace_sha256: str = Field(pattern=r"^[0-9a-f]{64}$")


class Identified(Table):
    """[identified]: numbers at the gantry, SI.

    Attributes:
        moment_sine_nm, moment_cosine_nm: torque that holds the load, sine and cosine part over the angle.
        inertia_kg_m2: load and motor, at the gantry.
        motor_inertia_kg_m2: of what turns with the rotor above the load's frequencies, at the motor.
        stiffness_nm_per_rad: load inertia over `windup_per_acc_s2`.
        windup_per_acc_s2: wind-up per acceleration of the load.
        swing_hz: first mode with the motor held, 1/(2 pi sqrt(windup_per_acc)).
        friction_nm: Coulomb friction, motor and rollers together, without what grows with the load.
        friction_load_ratio: part of the transmitted torque that is lost beside it.
        friction_nm_s_per_rad: its growth with speed.
        dead_time_s: from the scan that computes a command until the torque answers it.
    """

    moment_sine_nm: float = Field(ge=-2e5, le=2e5)
    moment_cosine_nm: float = Field(ge=-2e5, le=2e5)
    inertia_kg_m2: float = Field(gt=0.0, le=1e8)
    motor_inertia_kg_m2: float = Field(gt=0.0, le=1e4)
    stiffness_nm_per_rad: float = Field(ge=1e6, le=1e11)
    windup_per_acc_s2: float = Field(gt=0.0, le=1.0)
    swing_hz: float = Field(ge=0.1, le=100.0)
    friction_nm: float = Field(ge=-2e5, le=2e5)
    friction_load_ratio: float = Field(ge=-1.0, le=1.0)
    friction_nm_s_per_rad: float = Field(ge=-1e7, le=1e7)
    dead_time_s: float = Field(ge=0.0, le=0.1)


class Maps(Table):
    """[maps]: over the gantry angle, rad: mean, sine 1, cosine 1, sine 2, ...

    Attributes:
        gear_rad: what the motor must lead the load by, without wind-up of the eccentric moment.
        reversal_rad: half the difference between both directions.
        scale_rad: load-side encoder minus load; empty without one.
        fast: (cycles per turn, sine, cosine) of waves of many cycles.
    """

    gear_rad: Waves = Field(max_length=2 * MAP_HARMONICS + 1)
    reversal_rad: Waves = Field(max_length=2 * REVERSAL_HARMONICS + 1)
    scale_rad: tuple[_Amplitude, ...] = Field(max_length=2 * SCALE_HARMONICS + 1)
    fast: tuple[FastWave, ...] = Field(max_length=6)


class Calibration(Table):
    """A calibration file."""

    origin: Origin
    identified: Identified
    maps: Maps


def load_calibration(path: Path) -> Calibration:
    """Read and check a calibration file.

    Raises:
        ConfigError: one line per problem, all of them.
    """
    name = printable(path, 300)
    data = parse_toml(read_text(path), name)
    try:
        return Calibration.model_validate_json(json.dumps(data, default=str), strict=True)
    except ValidationError as error:
        lines = [
            f"{name}: {'.'.join(str(part) for part in problem['loc'])}: {problem['msg']}"
            for problem in error.errors(include_url=False, include_input=False)
        ]
        raise ConfigError(
            [*lines, f"{name}: is no usable calibration: run `gantryctl identify` again"]
        ) from None


def calibration_version(path: Path) -> int:
    """Version of a calibration file, which may be of an earlier version of this program.

    Raises:
        ConfigError: it is no calibration file.
    """
    name = printable(path, 300)
    origin = parse_toml(read_text(path), name).get("origin")
    version = origin.get("version") if isinstance(origin, dict) else None
    if not isinstance(version, int) or version < 1:
        raise ConfigError([f"{name}: is no calibration file: [origin] version is missing"])
    return version


def calibration_toml(calibration: Calibration) -> str:
    """The text of a calibration file."""
    lines = ["# Written by `gantryctl identify`; do not edit. SI, angles at the load."]
    for table_name, table in calibration:
        lines += ["", f"[{table_name}]"]
        lines += [f"{key} = {_value(value)}" for key, value in table]
    return "\n".join(lines) + "\n"


def _value(value: object) -> str:
    if not isinstance(value, tuple):
        return json.dumps(value)
    nested = bool(value) and isinstance(value[0], tuple)
    rows = value if nested else [value[k : k + 4] for k in range(0, len(value), 4)]
    lines = (", ".join(repr(x) for x in row) for row in rows)
    return "[\n" + "".join(f"  [{line}],\n" if nested else f"  {line},\n" for line in lines) + "]"
