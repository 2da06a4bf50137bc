"""What is wrong with the connection to a node, as the flags of the input image."""

from __future__ import annotations

from typing import Final

from gantryctl.drives.canopen.bus.node import NmtState, RemoteNode
from gantryctl.image import LinkFlag

LATCHED: Final = LinkFlag.RESTARTED | LinkFlag.NOT_OPERATIONAL | LinkFlag.HEARTBEAT_LOST
"""What cannot mend itself: it stays until the drive is set up anew."""
LOST: Final = LATCHED | LinkFlag.BUS_DOWN
"""With one of these nothing that the drive said last is believed."""
_WELL: Final = (None, NmtState.BOOT_UP, NmtState.OPERATIONAL)


def connection_flags(
    node: RemoteNode, before: LinkFlag, *, commanded: bool, timeout_scans: int | None
) -> LinkFlag:
    """The flags of this scan.

    Args:
        before: those of the scan before.
        commanded: the node is run, and nothing of what it does by itself is meant.
        timeout_scans: scans without a heartbeat until it counts as lost; None where it sends none.
    """
    flags = before & LATCHED
    if node.link.down:
        flags |= LinkFlag.BUS_DOWN
    if not commanded:
        return flags
    if node.boots:
        flags |= LinkFlag.RESTARTED
    if timeout_scans is not None and node.heartbeat_age > timeout_scans:
        flags |= LinkFlag.HEARTBEAT_LOST
    if node.state not in _WELL and node.heartbeat_age == 0:
        flags |= LinkFlag.NOT_OPERATIONAL
    if node.foreign:
        flags |= LinkFlag.OTHER_MASTER
    return flags
