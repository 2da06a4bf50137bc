"""Injected faults of a simulated drive: standing ones as a set of switches.

The simulated and the virtual drive have the same names with the same meaning; a drive on a real bus has no such object.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from functools import cache
from typing import Annotated, Any, Final, Literal, get_args, get_type_hints

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from gantryctl.errors import UsageError

# Every value that an object of up to 32 bits can show, signed or not.
_U32 = Annotated[int, Field(ge=-(1 << 31), lt=1 << 32)]
FrameKind = Literal["drop", "delay", "duplicate", "swap", "length"]
FRAME_KINDS: Final = get_args(FrameKind)


@dataclass(slots=True)
class FrameFault:
    """Fault of the frames of one TPDO or one identifier."""

    kind: FrameKind
    amount: int = 1
    """delay: frames held back; length: bytes sent."""
    count: int | None = None
    """Number of frames; None: all, until cleared."""


# A bus shows a number of 32 bits; a simulated drive in process may show anything but NaN.
_Finite = Annotated[float, Field(gt=-math.inf, lt=math.inf)]
_Share = Annotated[float, Field(ge=0.0, le=1.0)]


@dataclass(slots=True)
class Faults:
    """Standing faults; the defaults are a sound drive."""

    spoilt: set[str] = field(default_factory=set, init=False, repr=False, compare=False)
    """Names of the faults in force, those of frames apart: a sound drive asks for nothing else in its cycle."""
    freeze_position: bool = False
    """6064 keeps its value (and 606C becomes 0); the drive's own speed loop goes on."""
    position_offset: _U32 = 0
    """Added to 6064, increments: a jump."""
    encoder_gain: _Finite = 1.0
    """Part of the shaft's motion that the encoder shows from now on, to the reading and to the drive's own speed loop:
    0 frozen, -1 sign wrong, 0.9 a coupling that slips."""
    encoder_flags: Annotated[int, Field(ge=0, le=0xFF)] = 0
    """Bits of `EncoderFlag`: checksum error, alarm, warning, battery."""
    velocity_reading: _Finite | None = None
    """Value that 606C shows, rad/s at the motor; the drive's own speed loop goes on."""
    never_move: bool = False
    """Stands still and says that it follows (bit 12 = 1)."""
    ignore_target: bool = False
    """Keeps its speed with bit 12 = 0."""
    command_sign: Literal[1, -1] = 1
    """-1: turns the other way; feedback is true."""
    mode_display: _U32 | None = None
    """Value that 6061 shows."""
    status_set: _U32 = 0
    """Bits of 6041 that are always 1."""
    status_clear: _U32 = 0
    """Bits of 6041 that are always 0."""
    status_value: _U32 | None = None
    """6041 as a whole."""
    stuck_state: bool = False
    """The CiA 402 machine obeys no controlword."""
    quick_stop_off: bool = False
    """A quick stop is acknowledged, and the shaft goes on turning."""
    no_torque: bool = False
    """Enabled, but the power stage gives nothing."""
    torque_limit_share: _Share = 1.0
    """Part of the torque limit that the power stage can give."""
    brake: Literal["closed", "open"] | None = None
    """Position in which the brake is stuck."""
    brake_torque_share: _Share = 1.0
    """Part of its torque that the closed brake has: it slips."""
    brake_close_slow_s: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    """Time by which the brake closes later than it should."""
    brake_feedback: bool | None = None
    """State that the brake contact reports."""
    heartbeat_off: bool = False
    heartbeat_state: _U32 | None = None
    """NMT state that the heartbeat shows."""
    silence: bool = False
    """Off the bus: nothing is sent, nothing is heard. The drive's own time goes on."""
    sdo_silent: bool = False
    sdo_abort: _U32 | None = None
    """Every SDO request is answered by this abort code."""
    sdo_toggle: bool = False
    """Segments come with the wrong toggle bit."""
    warning: bool = False
    """Bit 7 of 6041."""
    estop_ok: bool = True
    """Hard-wired input; False: safe torque off."""
    enabling_switch: bool = True
    mains_ready: bool = True
    estop_ok_2: bool | None = None
    """Second channel of the chain; False: safe torque off too. None here and below: not fitted."""
    collision_ok: bool | None = None
    door_ok: bool | None = None
    motion_permit: bool | None = None
    limit_minus_ok: bool | None = None
    """None: by the load angle."""
    limit_plus_ok: bool | None = None
    torque_offset: Annotated[float, Field(gt=-1e9, lt=1e9)] = 0.0
    """Added to the torque that 6077 reports, N m."""
    motor_temp_c: _Finite | None = None
    """Temperature that the sensor of the motor shows; None: the motor has none."""
    tpdo: dict[int, FrameFault] = field(default_factory=dict)
    """TPDOs, by number, 1 for the first; of `frame_fault`."""
    frames: dict[int, FrameFault] = field(default_factory=dict)
    """Every other frame from or to the drive, by identifier; of `frame_fault`."""

    @property
    def powered(self) -> bool:
        """The power stage has its mains, and no channel of the emergency-stop chain is open."""
        return self.mains_ready and self.estop_ok and self.estop_ok_2 is not False

    def __setattr__(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)
        if name in _SOUND:
            if value == _SOUND[name]:
                self.spoilt.discard(name)
            else:
                self.spoilt.add(name)


_SOUND: Final[dict[str, Any]] = {
    each.name: each.default for each in fields(Faults) if each.name not in ("tpdo", "frames", "spoilt")
}


@cache
def _check_of(name: str) -> TypeAdapter[Any]:
    """Values that a fault can take; made when it is set, not by every command that simulates: all of them take 6 ms."""
    hint = get_type_hints(Faults, include_extras=True)[name]
    return TypeAdapter(hint, config=ConfigDict(strict=True))


BUS_ONLY: Final = frozenset(
    {
        "mode_display",
        "status_set",
        "status_clear",
        "status_value",
        "heartbeat_off",
        "heartbeat_state",
        "silence",
        "sdo_silent",
        "sdo_abort",
        "sdo_toggle",
    }
)
"""Faults of what only a drive on a bus has."""


def names() -> tuple[str, ...]:
    """Every standing fault but those of frames."""
    return tuple(_SOUND)


def default_of(name: str) -> Any:
    """Value of a fault in a sound drive."""
    return _SOUND[name]


def set_fault(faults: Faults, name: str, value: Any) -> None:
    """Set one standing fault.

    Raises:
        UsageError: no such fault, or a value it cannot take.
    """
    if name not in _SOUND:
        raise UsageError(f"there is no fault '{name}'; there are: {', '.join(_SOUND)}")
    try:
        setattr(faults, name, _check_of(name).validate_python(value))
    except ValidationError as wrong:
        said = " or ".join(error["msg"] for error in wrong.errors())
        raise UsageError(f"fault '{name}': {said}, got {value!r}") from None


def frame_fault(kind: Any, amount: Any = 1, count: Any = None) -> FrameFault:
    """Fault of frames from values of a request.

    Raises:
        UsageError: an unknown kind or a number out of range.
    """
    if kind not in FRAME_KINDS:
        raise UsageError(f"a fault of frames is one of {', '.join(FRAME_KINDS)}, got {kind!r}")
    for what, value in (("amount", amount), ("count", count)):
        if value is None and what == "count":
            continue
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= 1_000_000:
            raise UsageError(f"{what} of a fault of frames is a whole number, got {value!r}")
    if kind == "length" and amount > 8:
        raise UsageError(f"a frame has at most 8 bytes, got {amount}")
    if kind == "delay" and amount > 1000:
        raise UsageError(f"at most 1000 frames are held back, got {amount}")
    return FrameFault(kind, amount, count)
