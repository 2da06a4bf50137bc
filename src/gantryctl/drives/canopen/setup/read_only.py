"""A drive on a bus, looked at: read by SDO, nothing written, nothing started."""

from __future__ import annotations

from gantryctl.drives.base import BaseDrive
from gantryctl.drives.canopen.bus.link import BusLink
from gantryctl.drives.canopen.bus.node import RemoteNode
from gantryctl.drives.canopen.cia402 import decode_statusword
from gantryctl.drives.canopen.process_image import Unwrap
from gantryctl.drives.canopen.settings import CanopenSettings, drive_identity
from gantryctl.drives.canopen.setup.opening import look
from gantryctl.errors import DeviceError
from gantryctl.image import DriveFeedback, DriveIdentity, EncoderFlag, LinkHealth, OutputImage


class ReadOnlyDrive(BaseDrive):
    """What a drive said when it was asked once.

    Args:
        link: the bus; not closed here.
        settings: of the drive.

    Attributes:
        who: identity of the node. rows: its parameters against what they must be.

    Raises:
        DeviceError: nobody answers.
    """

    def __init__(self, link: BusLink, settings: CanopenSettings) -> None:
        node = RemoteNode(link, settings.node, settings.master_node, settings.sdo_timeout_s)
        self.who, self.rows = look(node, settings)
        self._identity = drive_identity(settings, self.who.text, self.who.key)
        raw = node.sdo.number(0x6064)
        span = self._identity.counts_per_turn * self._identity.turns
        counts = Unwrap(span)(-raw if settings.inverted else raw)
        state = decode_statusword(node.sdo.number(0x6041))
        error = node.sdo.optional(0x603F) or 0
        self.mode = node.sdo.optional(0x6061)
        self._feedback = DriveFeedback(state, counts, 0.0, 0.0, False, False, 0.0, EncoderFlag.NONE, error)

    def identity(self) -> DriveIdentity:
        """As for a drive that is run."""
        return self._identity

    def read(self) -> DriveFeedback:
        """State, position and error of that moment; nothing else."""
        return self._feedback

    def health(self) -> LinkHealth:
        """Who it is; no telegram has been exchanged."""
        return LinkHealth(self.who.key, self.who.software)

    def write(self, output: OutputImage) -> None:
        """Refused: it is only looked at."""
        raise DeviceError("a drive that is only looked at takes no command")

    def close(self) -> None:
        """Nothing to leave."""
