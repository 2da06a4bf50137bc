"""Machine file to a drive on a CANopen bus: a real one, or a virtual one in this process."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from gantryctl.drives.canopen import (
    BusLink,
    CanopenDrive,
    CanopenSettings,
    InputBits,
    Link,
    LookedAtDrive,
)
from gantryctl.drives.canopen.bus.bus import ECHOING, open_bus
from gantryctl.drives.canopen.bus.lock import DriveLock
from gantryctl.drives.virtual import ControlClient, DirectBus, DriveNode, personality
from gantryctl.errors import DeviceError
from gantryctl.machine import Machine
from gantryctl.units import rad
from gantryctl.wiring.simulator import total_ratio
from gantryctl.wiring.virtual import drive_hardware

SIMULATED: Final = "simulated"
_STEPPED_ANSWER_S: Final = 1.0
_SETTLE_S: Final = 30.0
_CALM_S: Final = 0.6  # more than a period of the swing
_CALM_RAD_S: Final = 1e-5


def canopen_settings(machine: Machine) -> CanopenSettings:
    """What the master has to know; nothing of [plant]."""
    c, motor, ratio = machine.can, machine.motor, total_ratio(machine)
    bits = {name: None if bit < 0 else bit for name, bit in c.inputs.model_dump().items()}
    answer_s = c.answer_ms * 1e-3
    if c.interface == SIMULATED:
        answer_s = 0.0  # it has answered when `send` returns
    elif c.stepped:
        answer_s = _STEPPED_ANSWER_S
    return CanopenSettings(
        period_s=machine.control.scan_period_ms * 1e-3,
        node=c.node,
        master_node=c.master_node,
        increments_per_turn=c.increments_per_turn,
        turns=machine.encoder.turns,
        velocity_unit=c.velocity_unit,
        torque_rated_nm=motor.torque_rated_nm,
        torque_reference=c.torque_reference,
        torque_max_nm=motor.torque_max_nm,
        quick_dec_rad_s2=rad(machine.virtual_axis.quick_dec_deg_s2) * ratio,
        speed_ceiling_rad_s=rad(machine.speed.drive_ceiling_deg_s) * ratio,
        inverted=c.inverted,
        brake_owner="object_60FE" if machine.brake.owner == "object_60FE" else "drive",
        brake_close_s=machine.brake.close_time_ms * 1e-3,
        heartbeat_s=c.heartbeat_ms * 1e-3,
        heartbeat_timeout_s=c.heartbeat_timeout_ms * 1e-3,
        rpdo_deadline_s=c.rpdo_deadline_ms * 1e-3,
        answer_s=answer_s,
        sdo_timeout_s=c.sdo_timeout_ms * 1e-3,
        follows_bit=c.follows_bit,
        inputs=InputBits(**bits),
    )


def in_virtual_time(machine: Machine) -> bool:
    """The scans need no clock."""
    return machine.drive.kind != "canopen" or machine.can.interface == SIMULATED or machine.can.stepped


class SimulatedCanDrive(CanopenDrive):
    """A CANopen drive whose other end is a virtual one in this process.

    Attributes:
        virtual: the drive, for truth and faults.
    """

    truth_columns: tuple[str, ...] = DriveNode.truth_columns

    def __init__(self, link: Link, settings: CanopenSettings, virtual: DriveNode) -> None:
        super().__init__(link, settings)
        self.virtual = virtual

    def truth(self) -> tuple[float, ...]:
        """True state of load, motor and base."""
        return self.virtual.truth()

    def close(self) -> None:
        """As any drive; then the plant goes on until the load has come to rest."""
        super().close()
        for _ in range(round(_SETTLE_S / _CALM_S) if self.commanded else 0):
            fastest = 0.0
            for _ in range(round(_CALM_S / 0.01)):
                self.virtual.advance(10_000)
                fastest = max(fastest, abs(self.virtual.truth()[1]))
            if fastest < _CALM_RAD_S:
                return


class SideChannelDrive(CanopenDrive):
    """A CANopen drive on a bus whose other end is a virtual one in another process: the truth comes by its socket."""

    truth_columns: tuple[str, ...] = DriveNode.truth_columns

    def __init__(self, link: Link, settings: CanopenSettings, channel: ControlClient) -> None:
        super().__init__(link, settings)
        self.channel = channel
        self._true = self._values(channel.ask("truth"))
        self._asked = False

    def truth(self) -> tuple[float, ...]:
        """True state of load, motor and base: the last answer there is. Nobody waits for a side channel in a scan."""
        if not self._asked:
            self.channel.send("truth")
            self._asked = True
        elif (answer := self.channel.poll()) is not None:
            self._true = self._values(answer)
            self._asked = False
        return self._true

    def _values(self, answer: Mapping[str, float]) -> tuple[float, ...]:
        return tuple(float(answer[name]) for name in self.truth_columns)


def can_link(machine: Machine) -> BusLink:
    """The bus of the machine file, with its drive for this process alone until the link is closed.

    Raises:
        DeviceError, UsageError: it cannot be opened, or another process has the drive.
    """
    c = machine.can
    lock = DriveLock(f"{c.interface} {c.channel}, node {c.node}".replace(" ,", ","))
    try:
        bus = open_bus(c.interface, c.channel or None, c.bitrate)
    except BaseException:
        lock.release()
        raise
    return BusLink(bus, echoes=c.interface in ECHOING, stepped=c.stepped, when_closed=lock.release)


def virtual_node(
    machine: Machine,
    angle_deg: float = 0.0,
    state: Mapping[str, float] | None = None,
    quirks: Sequence[str] = (),
) -> tuple[BusLink, DriveNode]:
    """A virtual drive in this process, booted, and the bus that leads to it.

    Args:
        angle_deg: where the gantry stands.
        state: a state kept from an earlier run, to go on from.
        quirks: personalities.
    """
    bus = DirectBus()
    node = DriveNode(
        drive_hardware(machine, rad(angle_deg)),
        machine.can.node,
        bus.deliver,
        kind=personality(quirks),
        stepped=True,
    )
    if state is not None:
        node.motor.restore(state)
    bus.attach(node)
    node.boot()
    return BusLink(bus, advance=lambda seconds: node.advance(round(seconds * 1e6))), node


def canopen_drive(
    machine: Machine,
    angle_deg: float = 0.0,
    state: Mapping[str, float] | None = None,
    quirks: Sequence[str] = (),
) -> CanopenDrive:
    """The drive of a CAN machine, set up and started, not enabled.

    Args:
        angle_deg, state, quirks: of a virtual drive in this process; a real one stands where it stands.

    Raises:
        DeviceError: bus or drive cannot be used.
    """
    settings = canopen_settings(machine)
    if machine.can.interface == SIMULATED:
        link, node = virtual_node(machine, angle_deg, state, quirks)
        return SimulatedCanDrive(link, settings, node).open()
    link = can_link(machine)
    if not machine.can.side_channel:
        return CanopenDrive(link, settings).open()
    try:
        channel = ControlClient(Path(machine.can.side_channel))
    except DeviceError:
        link.close()
        raise
    return SideChannelDrive(link, settings, channel).open()


def look_at_drive(machine: Machine) -> LookedAtDrive:
    """A drive on a bus as it stands, read by SDO; nothing is written and it is not started.

    Raises:
        DeviceError: it cannot be reached.
    """
    link = can_link(machine)
    try:
        return LookedAtDrive(link, canopen_settings(machine))
    finally:
        link.close()
