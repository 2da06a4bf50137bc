"""A drive on a bus before it is run, and what is said of the bus afterwards."""

from __future__ import annotations

from gantryctl.errors import CommandRefused
from gantryctl.machine import Machine
from gantryctl.operation.proofs import check_record, load_record, record_path
from gantryctl.operation.silence import check_silence, silence_path
from gantryctl.operation.store import StateStore
from gantryctl.ports import Drive
from gantryctl.runtime import Engine


def judge_bus(machine: Machine, store: StateStore | None, drive: Drive, commissioning: bool = False) -> None:
    """A drive that would not stop by itself is not enabled, nor one that nobody has commissioned.

    Args:
        commissioning: the record is what is being made.

    Raises:
        CommandRefused: with the list of parameters, or what the record lacks, or that the drive has restarted.
    """
    if drive.refusals:
        lines = "\n  ".join(drive.refusals)
        raise CommandRefused(f"the drive's parameters forbid enabling it:\n  {lines}")
    health = drive.health()
    if health is None or machine.plant_is_local or commissioning or not machine.can.commissioning_required:
        return
    if store is not None:
        check_record(machine, load_record(record_path(store.directory, machine)), health.drive_key)
        check_silence(silence_path(store.directory, machine), health)


def set_up_again(engine: Engine) -> bool:
    """A drive on a bus that was lost, or changed behind our back, is set up again: power off, between two scans.

    Returns:
        Whether there was anything to do.

    Raises:
        DeviceError: it cannot be; the alarms come again.
    """
    drive = engine.drive
    if not drive.lost:
        return False
    engine.between_scans(drive.set_up_again)
    return True


def leave_bus(drive: Drive) -> None:
    """Leave a bus as it was found; a drive in this process stays as it is."""
    if drive.health() is not None:
        drive.close()


def bus_lines(drive: Drive) -> tuple[str, ...]:
    """How well the bus worked, and what the drive complained of; () without a bus."""
    health = drive.health()
    return () if health is None else health.lines()
