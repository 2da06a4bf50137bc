"""Kinds that act on frames."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.drives.faults import FRAME_KINDS, FrameFault, frame_fault
from gantryctl.drives.virtual.communication.nmt import NmtState
from gantryctl.engineering.faults.kinds.kind import Argument, Place, Table, Undo, enters, standing
from gantryctl.engineering.faults.target import Target

KINDS: Final[Table] = {}
kind = enters(KINDS)

_CAN_ID: Final = Argument(int, 0, 0x7FF)
# A data frame of eight bytes with the space behind it, without stuff bits (ISO 11898-1).
_FRAME_BITS: Final = 111

# --- frames ----------------------------------------------------------------------------------------------------------

_SPOILT: Final = {
    "kind": Argument(str, choices=FRAME_KINDS),
    "amount": Argument(int, 0, 1000, default=1),
}


def _spoilt(table: dict[int, FrameFault], key: int, kind: str, amount: int) -> Undo:
    table[key] = frame_fault(kind, amount)

    def end() -> None:
        table.pop(key, None)

    return end


@kind(Place.FRAME, "tpdo", needs_bus=True, number=Argument(int, 1, 4), **_SPOILT)
def _tpdo(target: Target, number: int, kind: str, amount: int) -> Undo:
    """TPDO of the drive is dropped, delayed, doubled, swapped or cut."""
    return _spoilt(target.faults.tpdo, number, kind, amount)


@kind(Place.FRAME, "identifier", needs_bus=True, can_id=_CAN_ID, **_SPOILT)
def _identifier(target: Target, can_id: int, kind: str, amount: int) -> Undo:
    """Frames of an identifier, from or to the drive, are dropped, delayed, doubled, swapped or cut."""
    return _spoilt(target.faults.frames, can_id, kind, amount)


@kind(Place.FRAME, "readings_late", needs_bus=True, late_s=Argument(float, 0.001, 1.0))
def _readings_late(target: Target, late_s: float) -> Undo:
    """Drive hands every reading of state, position and torque over so much later, in every SYNC."""
    scans = math.ceil(late_s / (target.machine.control.scan_period_ms * 1e-3) - 1e-9)
    return _spoilt(target.faults.tpdo, 1, "delay", scans)


@kind(Place.FRAME, "rpdo_lost", needs_bus=True)
def _rpdo_lost(target: Target) -> Undo:
    """Commands of the controller do not reach the drive."""
    return _spoilt(target.faults.frames, 0x200 + target.node.node_id, "drop", 1)


@kind(Place.FRAME, "sync_lost", needs_bus=True)
def _sync_lost(target: Target) -> Undo:
    """SYNC does not reach the drive."""
    return _spoilt(target.faults.frames, 0x80, "drop", 1)


@kind(Place.FRAME, "drive_silent", needs_bus=True)
def _drive_silent(target: Target) -> Undo:
    """Drive is off the bus: sends nothing, hears nothing."""
    return standing(target, "silence", True)


@kind(Place.FRAME, "heartbeat_off", needs_bus=True)
def _heartbeat_off(target: Target) -> Undo:
    """Drive sends no heartbeat."""
    return standing(target, "heartbeat_off", True)


@kind(Place.FRAME, "foreign", needs_bus=True, can_id=_CAN_ID, data=Argument(str))
def _foreign(target: Target, can_id: int, data: str) -> None:
    """Third party sends a frame (data in hexadecimal), which drive and controller hear."""
    target.node.foreign(can_id, bytes.fromhex(data))


@kind(
    Place.FRAME,
    "foreign_nmt",
    needs_bus=True,
    command=Argument(str, choices=("start", "stop", "pre_operational", "reset_node", "reset_communication")),
)
def _foreign_nmt(target: Target, command: str) -> None:
    """Third party sends an NMT command to the drive."""
    codes = {"start": 1, "stop": 2, "pre_operational": 0x80, "reset_node": 0x81, "reset_communication": 0x82}
    target.node.foreign(0, bytes((codes[command], target.node.node_id)))


@kind(Place.FRAME, "flood", needs_bus=True, can_id=_CAN_ID, share=Argument(float, 0.01, 10.0))
def _flood(target: Target, can_id: int, share: float) -> Undo:
    """Third party floods the bus: frames of eight bytes that take this share of the bit rate."""
    key = f"flood {can_id}"
    machine = target.machine
    frames_per_scan = share * machine.can.bitrate * machine.control.scan_period_ms * 1e-3 / _FRAME_BITS
    due = 0.0

    def step() -> None:
        nonlocal due
        due += frames_per_scan
        while due >= 1.0:
            due -= 1.0
            target.node.foreign(can_id, bytes(8))

    target.repeated[key] = step

    def end() -> None:
        target.repeated.pop(key, None)

    return end


@kind(
    Place.FRAME,
    "nmt",
    needs_bus=True,
    state=Argument(str, choices=("STOPPED", "OPERATIONAL", "PRE_OPERATIONAL")),
)
def _nmt(target: Target, state: str) -> None:
    """Drive changes its NMT state by itself."""
    target.node.stack.enter(NmtState[state])
