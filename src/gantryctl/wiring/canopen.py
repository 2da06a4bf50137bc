"""Machine file to a drive on a CANopen bus: a real one, or a virtual one in this process."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from gantryctl.drives.base import SimulatedPlant
from gantryctl.drives.canopen.bus.interface import InterfaceCounters
from gantryctl.drives.canopen.bus.link import ECHOING, BusLink, open_bus
from gantryctl.drives.canopen.bus.lock import DriveLock
from gantryctl.drives.canopen.drive import CanopenDrive
from gantryctl.drives.canopen.settings import (
    CanopenSettings,
    EncoderStatus,
    InputBits,
    IoNodeSettings,
    LoadEncoderSettings,
    OutputBits,
)
from gantryctl.drives.canopen.setup.opening import checksum_of, facts_as_set_up, parameter_rows
from gantryctl.drives.od.facts import DriveFacts
from gantryctl.drives.od.verdicts import ParameterRow
from gantryctl.drives.profiles import Contradiction, DriveProfile, load_profile
from gantryctl.errors import DeviceError
from gantryctl.image import DriveState
from gantryctl.machine import Machine
from gantryctl.machine.tables.fields import Table
from gantryctl.ports import Drive
from gantryctl.units import rad
from gantryctl.wiring.bus_log import link_log

# A drive stepped by SYNC needs as long as its process computes; the longest such answer only ends a run that hangs.
_STEPPED_ANSWER_S: Final = 3.0


def canopen_settings(machine: Machine) -> CanopenSettings:
    """Settings of the master; reads nothing of [plant].

    Raises:
        UsageError, ConfigError: [can] profile names none.
    """
    c, motor, ratio = machine.can, machine.motor, machine.axis.ratio
    answer_s = c.answer_ms * 1e-3
    if c.simulated:
        # A virtual drive in this process has answered when `send` returns.
        answer_s = 0.0
    elif c.stepped:
        answer_s = _STEPPED_ANSWER_S
    return CanopenSettings(
        period_s=machine.control.scan_period_ms * 1e-3,
        node=c.node,
        master_node=c.master_node,
        increments_per_turn=c.increments_per_turn,
        turns=machine.encoder.turns,
        velocity_unit=None if c.velocity_unit == "profile" else c.velocity_unit,
        torque_rated_nm=motor.torque_rated_nm,
        torque_reference=c.torque_reference,
        torque_max_nm=motor.torque_max_nm,
        quick_dec_rad_s2=rad(machine.virtual_axis.quick_dec_deg_s2) * ratio,
        speed_ceiling_rad_s=rad(machine.speed.drive_ceiling_deg_s) * ratio,
        position_around_zero=c.position_range == "around 0",
        inverted=c.inverted,
        brake_owner=machine.brake.owner,
        brake_close_s=machine.brake.close_time_ms * 1e-3,
        heartbeat_s=c.heartbeat_ms * 1e-3,
        heartbeat_timeout_s=c.heartbeat_timeout_ms * 1e-3,
        lone_heartbeat_s=c.lone_heartbeat_ms * 1e-3,
        rpdo_deadline_s=c.rpdo_deadline_ms * 1e-3,
        answer_s=answer_s,
        sdo_timeout_s=c.sdo_timeout_ms * 1e-3,
        follows_bit=c.follows_bit,
        remote_bit=c.remote_bit,
        bitrate=c.bitrate,
        inputs=InputBits(**_bits(c.inputs)),
        encoder=EncoderStatus(*c.encoder.model_dump().values()),
        outputs=OutputBits(**_bits(c.outputs)),
        io=_io_node(machine),
        load_encoder=_load_encoder(machine),
        watchdog_s=c.watchdog_ms * 1e-3,
        profile=load_profile(c.profile) if c.profile else None,
    )


def _bits(table: Table) -> dict[str, int | None]:
    """Bits by name; None for what is not wired."""
    return {name: None if bit < 0 else bit for name, bit in table.model_dump().items()}


def _io_node(machine: Machine) -> IoNodeSettings | None:
    io = machine.can.io
    if not io.node:
        return None
    return IoNodeSettings(io.node, InputBits(**_bits(io.inputs)), OutputBits(**_bits(io.outputs)))


def _load_encoder(machine: Machine) -> LoadEncoderSettings | None:
    e = machine.can.load_encoder
    if e.source == "none":
        return None
    node = e.node if e.source == "node" else None
    return LoadEncoderSettings(node, e.counts_per_turn, e.zero_counts, e.inverted)


def can_link(machine: Machine) -> BusLink:
    """Bus of the machine file, its drive locked for this process until the link is closed.

    A virtual drive of this process is new and booted.

    Raises:
        DeviceError, UsageError: the bus cannot be opened, or another process has the drive.
    """
    if machine.can.simulated:
        from gantryctl.wiring.virtual import virtual_node

        return virtual_node(machine)[0]
    # `can scan` and `drive status` take the lock too: they would ask the drive between two scans of a controller.
    c = machine.can
    log = link_log(c.channel or c.interface, virtual=False)
    lock = DriveLock(f"{c.interface} {c.channel}, node {c.node}".replace(" ,", ","))
    try:
        bus = open_bus(c.interface, c.channel or None, c.bitrate)
    except BaseException:
        lock.release()
        raise
    return BusLink(
        bus,
        echoes=c.interface in ECHOING,
        stepped=c.stepped,
        log=log,
        counters=_counters(c.interface, c.channel),
        when_closed=lock.release,
    )


def _counters(interface: str, channel: str) -> InterfaceCounters | None:
    """Frame counters of an interface of SocketCAN; without them nothing is filtered, and every frame is received."""
    if interface != "socketcan" or not channel:
        return None
    try:
        return InterfaceCounters(channel)
    except OSError:
        return None


def canopen_drive(
    machine: Machine,
    angle_deg: float | None = None,
    state: Mapping[str, float] | None = None,
    quirks: Sequence[str] = (),
) -> CanopenDrive:
    """Drive of a CAN machine, set up and started, not enabled.

    Args:
        angle_deg, state, quirks: of a virtual drive in this process; a real drive ignores them.

    Raises:
        DeviceError: bus or drive cannot be used.
    """
    settings = canopen_settings(machine)
    plant: SimulatedPlant | None = None
    if machine.can.simulated:
        # Loaded in this branch only: the controller of a real gantry loads no simulator.
        from gantryctl.wiring.virtual import virtual_node

        link, plant = virtual_node(machine, angle_deg, state, quirks)
    else:
        link = can_link(machine)
        try:
            if machine.can.side_channel:
                from gantryctl.wiring.virtual import remote_plant

                plant = remote_plant(machine)
        except DeviceError:
            link.close()
            raise
    return CanopenDrive(link, settings, plant).open()


def read_only_drive(machine: Machine) -> Drive:
    """Read-only access to a drive on a bus: nothing is written, and it is not started.

    Raises:
        DeviceError: the drive cannot be reached.
    """
    from gantryctl.drives.canopen.setup.read_only import ReadOnlyDrive

    link = can_link(machine)
    try:
        return ReadOnlyDrive(link, canopen_settings(machine))
    finally:
        link.close()


def reset_drive_fault(machine: Machine) -> DriveState:
    """Reset the fault of a drive that nobody runs; its state afterwards.

    Raises:
        DeviceError: the drive cannot be reached.
    """
    from gantryctl.drives.canopen.bus.node import RemoteNode
    from gantryctl.drives.canopen.setup.fault_reset import reset_fault

    link, settings = can_link(machine), canopen_settings(machine)
    try:
        return reset_fault(RemoteNode(link, settings.node, settings.master_node, settings.sdo_timeout_s))
    finally:
        link.close()


# --- what a drive has, for the ledger ------------------------------------------------------------------------


def facts_of_drive(drive: Drive) -> DriveFacts | None:
    """What an open drive on a bus has; None for any other drive."""
    return drive.facts if isinstance(drive, CanopenDrive) else None


def set_up_facts(machine: Machine, facts: DriveFacts) -> DriveFacts:
    """A drive as the set-up of this machine would leave it."""
    return facts_as_set_up(canopen_settings(machine), facts)


def parameters_of(machine: Machine, facts: DriveFacts) -> Mapping[str, ParameterRow]:
    """Parameters of a drive against those of the machine, by index and sub-index (`1016:01`)."""
    return {row.place: row for row in parameter_rows(canopen_settings(machine), facts)}


def counts_increments(machine: Machine, facts: DriveFacts) -> bool:
    """60FF of a drive counts increments of 6064, not turns; False where its unit is not known."""
    settings = canopen_settings(machine).of_drive(facts)
    if settings.velocity_unit is None and settings.profile is None:
        return False
    try:
        return settings.speed_in_increments
    except DeviceError:
        return False


def profile_of_drive(machine: Machine, facts: DriveFacts) -> DriveProfile | None:
    """Profile of a drive: that of the machine file, else the one that it fits."""
    return canopen_settings(machine).of_drive(facts).profile


def contradictions(machine: Machine, facts: DriveFacts) -> tuple[Contradiction, ...]:
    """Where a drive or the machine file say something else than the profile of the drive, with both values."""
    settings = canopen_settings(machine).of_drive(facts)
    return () if settings.profile is None else settings.profile.contradictions(facts, settings.speed_unit)


def parameter_checksum(machine: Machine, facts: DriveFacts) -> str:
    """Checksum of the values that decide what the drive does."""
    return checksum_of(canopen_settings(machine), facts)
