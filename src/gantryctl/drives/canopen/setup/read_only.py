"""Read-only access to a drive over SDO: nothing is written, nothing is started."""

from __future__ import annotations

from gantryctl.drives.base import BaseDrive
from gantryctl.drives.canopen.bus.link import BusLink
from gantryctl.drives.canopen.bus.node import RemoteNode
from gantryctl.drives.canopen.cia402 import decode_statusword
from gantryctl.drives.canopen.process_image import unwrap_of
from gantryctl.drives.canopen.settings import CanopenSettings, drive_identity
from gantryctl.drives.canopen.setup.opening import facts_as_found, parameter_rows
from gantryctl.errors import DeviceError
from gantryctl.image import DriveFeedback, DriveIdentity, EncoderFlag, LinkHealth, OutputImage


class ReadOnlyDrive(BaseDrive):
    """State of a drive at one moment.

    Args:
        link: the bus; not closed here.
        settings: of the drive.

    Attributes:
        who: identity of the node. facts: what it has. rows: its parameter check.

    Raises:
        DeviceError: the drive does not answer.
    """

    def __init__(self, link: BusLink, settings: CanopenSettings) -> None:
        node = RemoteNode(link, settings.node, settings.master_node, settings.sdo_timeout_s)
        self.who, self.facts = facts_as_found(node, settings)
        self.rows = parameter_rows(settings, self.facts)
        self._identity = drive_identity(settings, self.who.text, self.who.key)
        # Only what a question about a standing machine needs: speed, torque and inputs would be from another moment.
        raw = node.sdo.number(0x6064)
        counts = unwrap_of(settings)(-raw if settings.inverted else raw)
        state = decode_statusword(node.sdo.number(0x6041))
        error = node.sdo.optional(0x603F) or 0
        self.mode = node.sdo.optional(0x6061)
        self._feedback = DriveFeedback(state, counts, 0.0, 0.0, False, False, 0.0, EncoderFlag.NONE, error)

    def identity(self) -> DriveIdentity:
        """Name, serial number and resolution."""
        return self._identity

    def read(self) -> DriveFeedback:
        """State, position and error code of that moment."""
        return self._feedback

    def health(self) -> LinkHealth:
        """Identity only: no telegram has been exchanged."""
        return LinkHealth(self.who.key, self.who.software)

    def write(self, output: OutputImage) -> None:
        """Refuse every command."""
        raise DeviceError("this drive was opened read-only and takes no command")

    def close(self) -> None:
        """Nothing: whoever opened the bus closes it."""
