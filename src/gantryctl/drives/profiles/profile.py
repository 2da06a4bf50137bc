"""A profile: what is known of a drive model and no object of it says; one TOML file for each model."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from gantryctl.drives.od.facts import DriveFacts
from gantryctl.drives.od.velocity_units import VELOCITY_UNITS
from gantryctl.errors import ConfigError
from gantryctl.units import DriveVelocityUnit

_PLACE: Final = re.compile(r"[0-9A-F]{4}:[0-9A-F]{2}")
_CODE: Final = re.compile(r"[0-9A-F]{4}")


class Tried(StrEnum):
    """What the statements of a profile have been held against."""

    VIRTUAL = "virtual drive"
    """A virtual drive with the object dictionary of the model; never the hardware."""
    MANUAL = "from the manual, not tried"


def _place(text: str) -> str:
    if _PLACE.fullmatch(text) is None:
        raise ValueError(f"'{text}' is no object: write 605A:00")
    return text


def _place_or_nothing(text: str) -> str:
    return _place(text) if text else text


def _code(text: str) -> str:
    if _CODE.fullmatch(text) is None:
        raise ValueError(f"'{text}' is no error code: write four hexadecimal digits, 8130")
    return text


Place = Annotated[str, AfterValidator(_place)]
ErrorCode = Annotated[str, AfterValidator(_code)]
Words = Annotated[str, Field(min_length=1, max_length=300)]
Positive = Annotated[float, Field(gt=0.0)]


def _tried(value: object) -> Tried:
    # The class itself would do, but its signature on Python 3.12 is not that of a validator.
    return Tried(str(value))


def _as_tuple(given: object) -> object:
    return tuple(given) if isinstance(given, list) else given


AsTuple = BeforeValidator(_as_tuple)
Names = Annotated[tuple[Words, ...], AsTuple]
Places = Annotated[tuple[Place, ...], AsTuple]
Numbers = Annotated[tuple[int, ...], AsTuple]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, defer_build=True)


class Match(_Part):
    """Which drives a profile is for."""

    vendor: int
    """1018:01."""
    products: Numbers = ()
    """1018:02; empty where the codes are not known: then the objects decide."""
    has: Places = ()
    lacks: Places = ()
    """Objects by which models of one maker are told apart."""

    def fits(self, facts: DriveFacts) -> bool:
        """Whether a drive is of this model."""
        if facts.vendor != self.vendor or (self.products and facts.product not in self.products):
            return False
        return all(facts.has(*key_of(p)) for p in self.has) and not any(
            facts.has(*key_of(p)) for p in self.lacks
        )


class Units(_Part):
    """What the numbers of the drive mean."""

    velocity: DriveVelocityUnit | None = None
    """Of 60FF, 606C and 60B1; None where the maker's tool sets it and the machine file must name it."""
    velocity_by_60A9: bool = False
    """60A9 can be written: the controller sets the unit above."""
    ramp: DriveVelocityUnit | None = None
    """Of 6083 to 6085, per second; None: that of the velocity."""
    ramp_size: Positive = 1.0
    """So many of that unit in one."""
    position: Words = "increments of the encoder"
    """Of 6064."""
    rated_torque_per_nm: Positive = 1000.0
    """Units of 6076 in one N m; CiA 402 has 1 mN m."""
    torque: Words = "1/1000 of the rated torque"
    """Of 6071, 6072, 6077 and 60B2."""


class DangerousDefault(_Part):
    """Value as delivered that hurts."""

    object: Place
    value: int
    because: Words


_RATE: Final = "Hz"
# Size of a gain unit in SI with current in A: kp in A s/rad, ki in A/rad, both at the motor shaft. An integral gain in
# Hz is a rate, and not one of these.
GAIN_UNITS: Final[dict[str, float]] = {
    "uA s/rad": 1e-6,
    "uA/rad": 1e-6,
    "A/(rev/s)": 1.0 / (2.0 * math.pi),
    _RATE: math.nan,
    "": math.nan,
}


def _unit(text: str) -> str:
    if text not in GAIN_UNITS:
        raise ValueError(
            f"unit '{text}' is not one of {', '.join(filter(None, GAIN_UNITS))}, or empty where unknown"
        )
    return text


class Gain(_Part):
    """Object with a gain of the speed loop."""

    object: Place
    unit: Annotated[str, AfterValidator(_unit)] = ""
    """Empty where the manual gives none: then only ratios mean something."""
    real: bool = False
    """The object is a REAL32; else a whole number."""

    @property
    def key(self) -> tuple[int, int]:
        """Index and sub-index."""
        return key_of(self.object)

    @property
    def rate(self) -> bool:
        """The integral part is a rate: the integral gain is kp times it."""
        return self.unit == _RATE

    @property
    def si(self) -> float:
        """One unit in A s/rad (kp) or A/rad (ki); NaN where the unit is another or not known."""
        return GAIN_UNITS[self.unit]


class SpeedLoop(_Part):
    """Gains of the drive's speed loop as objects."""

    kp: Gain
    ki: Gain | None = None


class Saving(_Part):
    """How the drive stores its parameters."""

    object: Annotated[str, AfterValidator(_place_or_nothing)] = "1010:01"
    """Empty: nothing that the bus writes is stored, or only the maker's tool stores it, as the remark says."""
    signature: Annotated[int, Field(ge=0, le=0xFFFF_FFFF)] = 0x6576_6173
    """What is written there; by CiA 301 "save"."""
    longest_s: Positive = 5.0
    """The drive has answered after this time."""
    remark: Words = "by the text of CiA 301"

    @property
    def text(self) -> str:
        """Object and remark for people."""
        return f"{self.object or 'no object'}, {self.remark}"


class Contradiction(NamedTuple):
    """A value that a profile contradicts.

    Attributes:
        object: where it is, in the drive or in the machine file.
        have: what it is there. want: what the profile says.
    """

    object: str
    have: str
    profile: str
    want: str


class DriveProfile(_Part):
    """One drive model."""

    name: str
    maker: Words
    model: Words
    tried: Annotated[Tried, BeforeValidator(_tried)]
    sources: Annotated[Names, Field(min_length=1)]
    table: str = ""
    """Name of the drive in the shipped object table; empty where nobody has its dictionary."""
    modes: Numbers
    """Modes of operation that 6060 takes."""
    match: Match
    units: Units
    speed_loop: SpeedLoop | None = None
    saving: Saving = Saving()
    dangerous_defaults: Annotated[tuple[DangerousDefault, ...], AsTuple] = ()
    lacks: dict[str, Words] = Field(default_factory=dict)
    """What the drive cannot do, by object or property, and what follows."""
    error_texts: dict[ErrorCode, Words] = Field(default_factory=dict)
    """The maker's own error codes (EMCY, 603F)."""

    @property
    def texts_by_code(self) -> Mapping[int, str]:
        """The maker's words by error code."""
        return {int(code, 16): text for code, text in self.error_texts.items()}

    def contradictions(self, facts: DriveFacts, unit: DriveVelocityUnit) -> tuple[Contradiction, ...]:
        """Where drive or machine file say something else than the profile, with both values.

        Args:
            unit: of 60FF, of the machine file.
        """
        said = []
        if facts.vendor != self.match.vendor:
            said.append(self._against("1018:01", f"{facts.vendor:X}h", f"{self.match.vendor:X}h"))
        own = self.units.velocity
        word, wanted = facts.value(0x60A9), None if own is None else VELOCITY_UNITS[own].si_unit
        if own is None or self.units.velocity_by_60A9:
            return tuple(said)
        if word is not None and wanted is not None and word != wanted:
            said.append(self._against("60A9", f"{word:X}h", f"{wanted:X}h ({own})"))
        elif unit != own:
            said.append(self._against("[can] velocity_unit", f'"{unit}"', f'"{own}"'))
        return tuple(said)

    def _against(self, place: str, have: str, want: str) -> Contradiction:
        return Contradiction(place, have, self.name, want)


def key_of(place: str) -> tuple[int, int]:
    """Index and sub-index of "605A:00"."""
    index, _, sub = place.partition(":")
    return int(index, 16), int(sub, 16)


def read_profile(path: Path) -> DriveProfile:
    """Read one profile; its name is that of the file.

    Raises:
        ConfigError: the file cannot be read, or is no profile; one line per problem.
    """
    try:
        data: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as fault:
        raise ConfigError([f"{path}: cannot be read: {fault.strerror or fault}"]) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as fault:
        raise ConfigError([f"{path}: {fault}"]) from None
    try:
        return DriveProfile.model_validate({**data, "name": path.stem})
    except ValidationError as error:
        lines = [
            f"{path}: {'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors(include_url=False)
        ]
    raise ConfigError(
        lines
    )  # not inside: the context of a raised error keeps its frames (machine/loading.py)
