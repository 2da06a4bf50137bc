"""A drive on a bus before it is run, and what is said of the bus afterwards."""

from __future__ import annotations

from gantryctl.drives.canopen import CanopenDrive
from gantryctl.errors import CommandRefused
from gantryctl.machine import Machine
from gantryctl.operation.proofs import check_record, load_record, record_path
from gantryctl.operation.silence import check_silence, silence_path
from gantryctl.operation.store import StateStore
from gantryctl.operation.virtual import is_simulated
from gantryctl.ports import Drive
from gantryctl.runtime import Engine


def judge_bus(machine: Machine, store: StateStore | None, drive: Drive, commissioning: bool = False) -> None:
    """A drive that would not stop by itself is not enabled, nor one that nobody has commissioned.

    Args:
        commissioning: the record is what is being made.

    Raises:
        CommandRefused: with the list of parameters, or what the record lacks, or that the drive has restarted.
    """
    if not isinstance(drive, CanopenDrive):
        return
    if drive.refusals:
        lines = "\n  ".join(drive.refusals)
        raise CommandRefused(f"the drive's parameters forbid enabling it:\n  {lines}")
    required = machine.can.commissioning_required and not is_simulated(machine) and not commissioning
    if required and store is not None:
        check_record(machine, load_record(record_path(store.directory, machine)), drive.opened.identity.key)
        check_silence(silence_path(store.directory, machine), drive)


def set_up_anew(engine: Engine) -> bool:
    """A drive on a bus that was lost, or changed behind our back, is set up again: power off, between two scans.

    Returns:
        Whether there was anything to do.

    Raises:
        DeviceError: it cannot be; the alarms come again.
    """
    drive = engine.drive
    if not isinstance(drive, CanopenDrive) or not drive.lost:
        return False
    engine.between_scans(drive.set_up_anew)
    return True


def leave_bus(drive: Drive) -> None:
    """Leave a bus as it was found; a drive in this process stays as it is."""
    if isinstance(drive, CanopenDrive):
        drive.close()


def bus_lines(drive: Drive) -> tuple[str, ...]:
    """How well the bus worked, and what the drive complained of; () without a bus."""
    if not isinstance(drive, CanopenDrive):
        return ()
    said = [message.text for message in drive.node.emergencies.messages if message.code]
    return (*drive.counters().lines(), *said)
