"""Lock of a drive on a bus: one process at a time, whatever its machine file and state directory are called."""

from __future__ import annotations

import socket
import struct
import sys
from typing import Final

from gantryctl.errors import DeviceError

# Process, user and group of the other end (SO_PEERCRED, unix(7)).
_PEER: Final = struct.Struct("3i")


class DriveLock:
    """Lock held from construction; the system releases it when the process ends, however it ends. Linux only.

    Args:
        where: interface, channel and node of the drive, the same words for every process.

    Raises:
        DeviceError: another process holds it.
    """

    def __init__(self, where: str) -> None:
        self._socket: socket.socket | None = None
        if sys.platform != "linux":
            return
        # A name in the abstract namespace of Unix sockets: it belongs to the network namespace, as CAN interfaces and
        # UDP groups do, and neither a private /tmp nor a link in it leads astray.
        name = f"\0gantryctl drive {where}"
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.bind(name)
            self._socket.listen(1)
        except OSError:
            self.release()
            raise DeviceError(
                f"the drive at {where} is in use by process {_holder(name)}: end it first; commands for a running "
                "service take --service"
            ) from None

    def release(self) -> None:
        """Release the drive; may be called twice."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


def _holder(name: str) -> str:
    """Process that holds a name."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
        asking.settimeout(1.0)
        try:
            asking.connect(name)
            peer = asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size)
        except OSError:
            return "unknown"
    return str(_PEER.unpack(peer)[0])
