"""Injected faults: standing ones as a set of switches, and the gate that spoils TPDOs; set by the side channel only."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Any, Final, Literal, get_args, get_type_hints

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from gantryctl.errors import UsageError

# Every value that an object of up to 32 bits can show, signed or not.
_U32 = Annotated[int, Field(ge=-(1 << 31), lt=1 << 32)]
TpdoKind = Literal["drop", "delay", "duplicate", "swap", "length"]
TPDO_KINDS: Final = get_args(TpdoKind)


@dataclass(slots=True)
class TpdoFault:
    """Fault of the frames of one TPDO."""

    kind: TpdoKind
    amount: int = 1
    """delay: frames held back; length: bytes sent."""
    count: int | None = None
    """Number of frames; None: all, until cleared."""


@dataclass(slots=True)
class Faults:
    """Standing faults; the defaults are a sound drive."""

    freeze_position: bool = False
    """6064 keeps its value (and 606C becomes 0); the drive's own speed loop goes on."""
    position_offset: _U32 = 0
    """Added to 6064, increments: a jump."""
    never_move: bool = False
    """Stands still and says that it follows (bit 12 = 1)."""
    ignore_target: bool = False
    """Stands still with bit 12 = 0."""
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
    brake: Literal["closed", "open"] | None = None
    """Position in which the brake is stuck."""
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
    limit_minus_ok: bool | None = None
    """None: by the load angle."""
    limit_plus_ok: bool | None = None
    torque_offset: Annotated[float, Field(gt=-1e9, lt=1e9)] = 0.0
    """Added to the torque that 6077 reports, N m."""
    tpdo: dict[int, TpdoFault] = field(default_factory=dict)
    """By number, 1 for the first; set by `tpdo_fault`."""


_CHECKS: Final[dict[str, TypeAdapter[Any]]] = {
    name: TypeAdapter(hint, config=ConfigDict(strict=True))
    for name, hint in get_type_hints(Faults, include_extras=True).items()
    if name != "tpdo"
}


def names() -> tuple[str, ...]:
    """Every standing fault but those of TPDOs."""
    return tuple(_CHECKS)


def default_of(name: str) -> Any:
    """Value of a fault in a sound drive."""
    return getattr(Faults(), name)


def set_fault(faults: Faults, name: str, value: Any) -> None:
    """Set one standing fault.

    Raises:
        UsageError: no such fault, or a value it cannot take.
    """
    if name not in _CHECKS:
        raise UsageError(f"there is no fault '{name}'; there are: {', '.join(_CHECKS)}")
    try:
        setattr(faults, name, _CHECKS[name].validate_python(value))
    except ValidationError as wrong:
        said = " or ".join(error["msg"] for error in wrong.errors())
        raise UsageError(f"fault '{name}': {said}, got {value!r}") from None


def tpdo_fault(kind: Any, amount: Any = 1, count: Any = None) -> TpdoFault:
    """Fault of a TPDO from values of a request.

    Raises:
        UsageError: an unknown kind or a number out of range.
    """
    if kind not in TPDO_KINDS:
        raise UsageError(f"a TPDO fault is one of {', '.join(TPDO_KINDS)}, got {kind!r}")
    for what, value in (("amount", amount), ("count", count)):
        if value is None and what == "count":
            continue
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= 1_000_000:
            raise UsageError(f"{what} of a TPDO fault is a whole number, got {value!r}")
    if kind == "length" and amount > 8:
        raise UsageError(f"a frame has at most 8 bytes, got {amount}")
    if kind == "delay" and amount > 1000:
        raise UsageError(f"at most 1000 frames are held back, got {amount}")
    return TpdoFault(kind, amount, count)


class TpdoGate:
    """Gate between the TPDOs and the bus: drops, delays, duplicates, swaps or cuts frames.

    Args:
        faults: which TPDO is affected.
        send: takes (identifier, data).
    """

    def __init__(self, faults: Faults, send: Callable[[int, bytes], None]) -> None:
        self._faults, self._send = faults, send
        self._held: dict[int, deque[tuple[int, bytes]]] = {}

    def reset(self) -> None:
        """Discard the frames held back."""
        self._held.clear()

    def send(self, number: int, can_id: int, data: bytes) -> None:
        """Send one TPDO (number 0 is the first)."""
        fault = self._faults.tpdo.get(number + 1)
        if fault is None:
            self._flush(number)
            self._send(can_id, data)
            return
        if fault.count is not None:
            fault.count -= 1
            if fault.count <= 0:
                del self._faults.tpdo[number + 1]
        self._spoiled(number, fault, can_id, data)

    def _spoiled(self, number: int, fault: TpdoFault, can_id: int, data: bytes) -> None:
        held = self._held.setdefault(number, deque())
        match fault.kind:
            case "drop":
                pass
            case "duplicate":
                for _ in range(2):
                    self._send(can_id, data)
            case "length":
                self._send(can_id, data[: fault.amount].ljust(fault.amount, b"\0"))
            case "delay":
                held.append((can_id, data))
                if len(held) > fault.amount:
                    self._send(*held.popleft())
            case "swap":
                if held:
                    self._send(can_id, data)
                    self._send(*held.popleft())
                else:
                    held.append((can_id, data))

    def _flush(self, number: int) -> None:
        """Send the frames held back: the fault is over."""
        held = self._held.pop(number, None)
        while held:
            self._send(*held.popleft())
