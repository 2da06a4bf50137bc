"""Kinds that act on a node beside the drive: digital inputs and outputs (CiA 401), encoder on the ring (CiA 406)."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.drives.faults import frame_fault
from gantryctl.drives.virtual.nodes.group import spoil
from gantryctl.engineering.faults.kinds.kind import Argument, Place, Table, Undo, enters
from gantryctl.engineering.faults.target import Target

KINDS: Final[Table] = {}
kind = enters(KINDS)

_WHICH: Final = Argument(str, choices=("io", "encoder"))


def _stands(target: Target, which: str, fault: str, value: bool | int = True) -> Undo:
    """Set a standing fault of a node; what ends it."""
    node = target.beside(which)
    spoil(node, fault, value)
    return lambda: spoil(node, fault, type(value)(0))


@kind(Place.NODE, "silent", needs_bus=True, which=_WHICH)
def _silent(target: Target, which: str) -> Undo:
    """Node is off the bus: sends nothing, hears nothing."""
    return _stands(target, which, "silent")


@kind(Place.NODE, "restart", needs_bus=True, which=_WHICH)
def _restart(target: Target, which: str) -> None:
    """Node restarts by itself."""
    target.beside(which).boot()


@kind(Place.NODE, "late", needs_bus=True, which=_WHICH, late_s=Argument(float, 0.001, 1.0))
def _late(target: Target, which: str, late_s: float) -> Undo:
    """Node hands its inputs or its angle over so much later, in every SYNC."""
    scans = math.ceil(late_s / (target.machine.control.scan_period_ms * 1e-3) - 1e-9)
    late = target.beside(which).slave.tpdo
    late[1] = frame_fault("delay", scans)

    def end() -> None:
        late.pop(1, None)

    return end


@kind(Place.NODE, "inputs_stuck", needs_bus=True)
def _inputs_stuck(target: Target) -> Undo:
    """Inputs of the I/O node keep their levels."""
    return _stands(target, "io", "inputs_stuck")


@kind(Place.NODE, "outputs_dead", needs_bus=True)
def _outputs_dead(target: Target) -> Undo:
    """Outputs of the I/O node keep their levels, whatever is commanded."""
    return _stands(target, "io", "outputs_dead")


@kind(Place.NODE, "encoder_frozen", needs_bus=True)
def _encoder_frozen(target: Target) -> Undo:
    """Encoder on the ring keeps its value."""
    return _stands(target, "encoder", "frozen")


@kind(Place.NODE, "encoder_alarm", needs_bus=True)
def _encoder_alarm(target: Target) -> Undo:
    """Encoder on the ring shows a position error (6503)."""
    return _stands(target, "encoder", "alarm")


@kind(Place.NODE, "encoder_jump", needs_bus=True, angle_deg=Argument(float, -360.0, 360.0))
def _encoder_jump(target: Target, angle_deg: float) -> Undo:
    """Encoder on the ring is off by an angle."""
    steps = round(angle_deg / 360.0 * target.machine.can.load_encoder.counts_per_turn)
    return _stands(target, "encoder", "jump", steps)
