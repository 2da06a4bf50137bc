"""`<machine>.calibration.toml`: what was identified on one machine, with its origin."""

from __future__ import annotations

import json
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeAlias, get_args

from pydantic import Field, ValidationError, model_validator

from gantryctl.errors import ConfigError
from gantryctl.machine.reading import parse_toml, printable, read_text
from gantryctl.machine.tables.compensation import MAX_FAST_WAVES
from gantryctl.machine.tables.fields import Table

# As many as the compiled laws have places for (`MAP_HARMONICS` and the others of the core).
MAP_HARMONICS: Final = 192
REVERSAL_HARMONICS: Final = 12
SCALE_HARMONICS: Final = 40
FAST_WAVES: Final = MAX_FAST_WAVES

# Of all friction, that behind the mesh, give or take half.
_HALF: Final = 0.5

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


class Unknown(StrEnum):
    """Why a number could not be identified."""

    NO_WINDUP = "no_windup"
    NO_FLANK = "no_flank"
    NO_SPEED_LOOP = "no_speed_loop"
    NO_GAP = "no_gap"
    OLDER = "older"
    TOO_WIDE = "too_wide"

    @property
    def words(self) -> str:
        """The reason for people."""
        return _REASONS[self]


_REASONS: Final = {
    Unknown.NO_WINDUP: "the load shows no wind-up under acceleration: a rigid machine, or an instrument that does not "
    "see the load or is too coarse for it",
    Unknown.NO_FLANK: "acceleration turns the torque of the gears round, so backlash and wind-up cannot be told apart",
    Unknown.NO_SPEED_LOOP: "the speed loop of the drive does not answer like a PI with a lag: switch filters and "
    "observers of the drive off",
    Unknown.NO_GAP: "the lead does not jump where the torque of the gears turns round: no backlash, or a torque that "
    "turns round only with the motion; what there is of it stands in the lost motion",
    Unknown.OLDER: "the calibration is older than this number; what there is of it stands in the lost motion",
    Unknown.TOO_WIDE: "on this travel and under these loads it cannot be told from other numbers",
}

Number: TypeAlias = Literal[
    "moment_sine_nm", "moment_cosine_nm", "inertia_kg_m2", "motor_inertia_kg_m2", "stiffness_nm_per_rad",
    "windup_per_acc_s2", "swing_hz", "friction_nm", "friction_load_ratio", "friction_nm_s_per_rad", "dead_time_s",
    "backlash_rad", "friction_load_nm",
]  # fmt: skip
NUMBERS: Final[tuple[Number, ...]] = get_args(Number)
# Files of earlier versions say nothing about these.
_LATER: Final[tuple[Number, ...]] = ("backlash_rad", "friction_load_nm")


class Identified(Table):
    """[identified]: numbers at the gantry, SI; one that could not be identified is left out.

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
        backlash_rad: way of the motor between both flanks, at the gantry.
        friction_load_nm: part of `friction_nm` behind the mesh: with the moment it says on which flank the load lies.
    """

    moment_sine_nm: float | None = Field(default=None, ge=-1e8, le=1e8)
    moment_cosine_nm: float | None = Field(default=None, ge=-1e8, le=1e8)
    inertia_kg_m2: float | None = Field(default=None, gt=0.0, le=1e9)
    motor_inertia_kg_m2: float | None = Field(default=None, gt=0.0, le=1e4)
    stiffness_nm_per_rad: float | None = Field(default=None, ge=1.0, le=1e13)
    windup_per_acc_s2: float | None = Field(default=None, gt=0.0, le=1.0)
    swing_hz: float | None = Field(default=None, ge=0.1, le=1000.0)
    friction_nm: float | None = Field(default=None, ge=-1e8, le=1e8)
    friction_load_ratio: float | None = Field(default=None, ge=-1.0, le=1.0)
    friction_nm_s_per_rad: float | None = Field(default=None, ge=-1e10, le=1e10)
    dead_time_s: float | None = Field(default=None, ge=0.0, le=0.1)
    backlash_rad: float | None = Field(default=None, ge=0.0, le=0.1)
    friction_load_nm: float | None = Field(default=None, ge=-1e8, le=1e8)


class Maps(Table):
    """[maps]: over the gantry angle, rad: mean, sine 1, cosine 1, sine 2, ...

    Attributes:
        gear_rad: what the motor must lead the load by, without wind-up of the eccentric moment.
        reversal_rad: half the difference between both directions.
        scale_rad: load-side encoder minus load; empty without one.
        lean_rad_per_nm: of the base, per load torque: what of scale_rad goes with the eccentric moment; None where the
            file is older, or encoder and instrument do not show it.
        fast: (cycles per turn, sine, cosine) of waves of many cycles.
    """

    gear_rad: Waves = Field(max_length=2 * MAP_HARMONICS + 1)
    reversal_rad: Waves = Field(max_length=2 * REVERSAL_HARMONICS + 1)
    scale_rad: tuple[_Amplitude, ...] = Field(max_length=2 * SCALE_HARMONICS + 1)
    lean_rad_per_nm: float | None = Field(default=None, gt=0.0, le=1e-3)
    fast: tuple[FastWave, ...] = Field(max_length=FAST_WAVES)


class Calibration(Table):
    """A calibration file.

    Attributes:
        half_width: half of the 95 % interval of each number of [identified].
        unknown: numbers that could not be identified, each with its reason.
    """

    origin: Origin
    identified: Identified
    half_width: dict[Number, Annotated[float, Field(ge=0.0)]]
    unknown: dict[Number, Unknown]
    maps: Maps

    @model_validator(mode="after")
    def _each_once(self) -> Calibration:
        known = {name for name in NUMBERS if getattr(self.identified, name) is not None}
        if known != set(self.half_width):
            odd = sorted(known ^ set(self.half_width))
            raise ValueError(
                f"half_width: must have the numbers of [identified], but not so {', '.join(odd)}"
            )
        if known & set(self.unknown) or known | set(self.unknown) != set(NUMBERS):
            raise ValueError("unknown: must have every number that [identified] has not, and no other")
        return self

    @property
    def friction_behind_mesh_nm(self) -> float:
        """Friction behind the mesh, N m; where it is no number of its own, half of all."""
        known = self.identified.friction_load_nm
        return max(0.0, _HALF * (self.identified.friction_nm or 0.0)) if known is None else known

    @property
    def backlash_held_rad(self) -> float:
        """Backlash that numbers and maps hold, rad; where it is no number of its own, at most all lost motion."""
        known = self.identified.backlash_rad
        return 2.0 * abs(self.maps.reversal_rad[0]) if known is None else known

    def number(self, name: Number) -> float:
        """An identified number.

        Raises:
            ConfigError: it could not be identified.
        """
        value: float | None = getattr(self.identified, name)
        if value is None:
            raise ConfigError(
                [f"{self.origin.machine}: {name} could not be identified: {self.unknown[name].words}"]
            )
        return value


def _of_today(data: dict[str, Any]) -> dict[str, Any]:
    """A file of an earlier version: numbers that it could not know are unknown."""
    identified, unknown = data.get("identified"), data.get("unknown")
    if not isinstance(identified, dict) or not isinstance(unknown, dict):
        return data
    later = {name: Unknown.OLDER.value for name in _LATER if name not in identified | unknown}
    return {**data, "unknown": {**unknown, **later}}


def load_calibration(path: Path) -> Calibration:
    """Read and check a calibration file.

    Raises:
        ConfigError: one line per problem, all of them.
    """
    name = printable(path, 300)
    data = _of_today(parse_toml(read_text(path), name))
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
        rows = table.items() if isinstance(table, Mapping) else iter(table)
        lines += ["", f"[{table_name}]"]
        lines += [f"{key} = {_value(value)}" for key, value in rows if value is not None]
    return "\n".join(lines) + "\n"


def _value(value: object) -> str:
    if not isinstance(value, tuple):
        return json.dumps(value)
    nested = bool(value) and isinstance(value[0], tuple)
    rows = value if nested else [value[k : k + 4] for k in range(0, len(value), 4)]
    lines = (", ".join(repr(x) for x in row) for row in rows)
    return "[\n" + "".join(f"  [{line}],\n" if nested else f"  {line},\n" for line in lines) + "]"
