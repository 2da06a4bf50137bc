"""From a state directory to an engine that people can command, and what keeps it from being switched on."""

from __future__ import annotations

from typing import Final, NamedTuple

from gantryctl.image import DriveFeedback, DriveIdentity
from gantryctl.machine import Machine
from gantryctl.operation.brake_policy import LOCKED
from gantryctl.operation.opening import open_axis
from gantryctl.operation.proofs import bus_reasons
from gantryctl.operation.store import StateStore
from gantryctl.ports import Drive
from gantryctl.program import GantryProgram
from gantryctl.runtime import Engine, Retained

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
    opened = open_axis(machine, store)
    retained, program, reasons = opened.retained, opened.program, opened.reasons
    assert isinstance(program, GantryProgram)
    return Opened(
        opened.drive,
        retained,
        program,
        lock=next((reason.text for reason in reasons if not reason.by_reset), ""),
        held="; ".join(reason.text for reason in reasons if reason.by_reset),
        locked_code=retained.error_stop if retained.error_stop in LOCKED else "",
        notes=opened.notes,
    )


def bus_refusal(machine: Machine, store: StateStore, drive: Drive) -> str:
    """Why a drive on a bus may not be enabled, or ""."""
    return next((reason.text for reason in bus_reasons(machine, store, drive)), "")


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
