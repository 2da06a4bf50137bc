"""SDO access of a command to the drive of a machine file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from gantryctl.cli.options import machine_of

if TYPE_CHECKING:
    from gantryctl.drives.canopen.bus.node import RemoteNode
    from gantryctl.drives.canopen.settings import CanopenSettings
    from gantryctl.drives.profiles import DriveProfile
    from gantryctl.machine import Machine


@contextmanager
def drive_node(config_file: Path | None) -> Iterator[tuple[RemoteNode, CanopenSettings, Machine]]:
    """SDO access to the drive of a machine file, within a with block."""
    from gantryctl.drives.canopen.bus.node import RemoteNode
    from gantryctl.errors import UsageError
    from gantryctl.wiring.canopen import can_link, canopen_settings

    machine = machine_of(config_file)
    if not machine.on_bus:
        raise UsageError(f'{machine.name}: [drive] kind = "{machine.drive.kind}" has no bus; use "canopen"')
    # The lock of the drive is taken with the link: no second master beside a running controller.
    settings = canopen_settings(machine)
    link = can_link(machine)
    try:
        yield RemoteNode(link, settings.node, settings.master_node, settings.sdo_timeout_s), settings, machine
    finally:
        link.close()


def profile_of_node(node: RemoteNode, settings: CanopenSettings) -> DriveProfile | None:
    """Profile of the drive: that of the machine file, else the one that it fits."""
    from gantryctl.drives.canopen.setup.opening import facts_as_found

    return settings.of_drive(facts_as_found(node, settings)[1]).profile
