"""From a state directory to an engine that people can command, and what keeps it from being switched on."""

from __future__ import annotations

from typing import Final, NamedTuple

from gantryctl.errors import CommandRefused
from gantryctl.image import DriveFeedback, DriveIdentity
from gantryctl.machine import Machine
from gantryctl.operation import StateStore
from gantryctl.operation.brake_policy import LOCKED, restore_failure
from gantryctl.operation.bus import judge_bus
from gantryctl.operation.home_reference import RestVerdict, evaluate, refusal, unwrapped
from gantryctl.operation.virtual import encoder_scale, open_machine
from gantryctl.ports import Drive
from gantryctl.program import GantryProgram
from gantryctl.runtime import Engine, Retained
from gantryctl.wiring.engine import build_program

BUS: Final = "CFG-CAN"
"""Beginning of a refusal that comes from the bus."""


class Opened(NamedTuple):
    """One machine as the last run left it, with power off.

    Attributes:
        lock: why power cannot be switched on, whatever is reset, or "".
        held: why it cannot be until a reset, or "".
        locked_code: alarm of an earlier run that only service may reset, or "".
        notes: what had to be done to open it.
    """

    drive: Drive
    retained: Retained
    program: GantryProgram
    lock: str
    held: str
    locked_code: str
    notes: tuple[str, ...]


def open_service(machine: Machine, store: StateStore) -> Opened:
    """Open drive and program of a machine, and judge encoder and bus.

    Raises:
        StateError: retained memory or plant cannot be used. DeviceError: a drive on a bus cannot be reached.
    """
    virtual = open_machine(machine, store)
    retained, drive = virtual.retained, virtual.drive
    counts = drive.read().pos_act_counts
    scale = encoder_scale(machine, drive)
    reading = evaluate(scale, counts, retained)
    zero = retained.zero_offset_counts
    zero_counts = counts if zero is None else zero + counts - unwrapped(scale, counts, zero)
    moved = reading.verdict is RestVerdict.MOVED  # a reset acknowledges it, and nothing else of the encoder
    wrong = refusal(reading) or ""
    held = [wrong] if moved else []
    if retained.error_stop:
        held.append(f"{retained.error_stop} stopped the axis in an earlier run: look at it, then reset")
    program = build_program(
        machine, drive, zero_counts=zero_counts, holding_torque_nm=retained.holding_torque_nm or 0.0
    )
    assert isinstance(program, GantryProgram)
    restore_failure(program.axis, retained)
    return Opened(
        drive,
        retained,
        program,
        lock=("" if moved else wrong) or bus_refusal(machine, store, drive),
        held="; ".join(held),
        locked_code=retained.error_stop if retained.error_stop in LOCKED else "",
        notes=virtual.notes,
    )


def bus_refusal(machine: Machine, store: StateStore, drive: Drive) -> str:
    """Why a drive on a bus may not be enabled, or ""."""
    try:
        judge_bus(machine, store, drive)
    except CommandRefused as reason:
        return f"{BUS} {' '.join(str(reason).split())}"
    return ""


class LastRead:
    """What the last scan has read: a drive on a bus is read once a scan and no more."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def identity(self) -> DriveIdentity:
        """Encoder."""
        return self._engine.drive.identity()

    def read(self) -> DriveFeedback:
        """The reading of the last scan."""
        return self._engine.image.drive
