"""A python-can bus with the virtual drive on it, without threads and without a network.

`send` hands the frame to the drive and returns when the drive has answered; the answers wait to be received. So a
master, or canopen, can run against a stepped drive as fast as both compute, the same way every time.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import Final

import can

from gantryctl.drives.virtual.node import DriveNode

_FLAGS: Final = ("is_error_frame", "is_remote_frame", "is_extended_id", "is_fd")


def is_plain(message: can.Message) -> bool:
    """A classic data frame with an 11-bit identifier: all that this node listens to."""
    return not any(getattr(message, flag) for flag in _FLAGS)


def frame(can_id: int, data: bytes) -> can.Message:
    """A message of the node."""
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=False)


class DirectBus(can.BusABC):
    """One end of a bus whose other end is the drive.

    Make the bus, make the node with `bus.deliver` as its `send`, `attach` it, `boot` it. Whoever looks at the node
    while another thread uses the bus holds `lock`.
    """

    def __init__(self) -> None:
        self._waiting: deque[can.Message] = deque()
        self.lock = threading.RLock()
        self._arrived = threading.Condition(self.lock)
        self._node: DriveNode | None = None
        self._open = True
        self._can_protocol = can.CanProtocol.CAN_20
        self.channel_info = "virtual drive in this process"
        super().__init__(channel="direct")

    def attach(self, node: DriveNode) -> None:
        """Put the drive on the bus."""
        self._node = node

    def deliver(self, can_id: int, data: bytes) -> None:
        """A frame of the drive: the `send` of its node."""
        message = frame(can_id, data)
        message.timestamp = self._node.time_us * 1e-6 if self._node else 0.0
        with self._arrived:
            self._waiting.append(message)
            self._arrived.notify_all()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """A frame of the master: acted upon before this returns.

        Raises:
            can.CanOperationError: the bus was shut down.
        """
        with self.lock:
            if not self._open:
                raise can.CanOperationError("the bus was shut down")
            if self._node is not None and is_plain(msg):
                self._node.on_frame(msg.arbitration_id, bytes(msg.data))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        until = None if timeout is None else time.monotonic() + timeout
        with self._arrived:
            while not self._waiting:
                if not self._open:
                    raise can.CanOperationError("the bus was shut down")
                rest = None if until is None else until - time.monotonic()
                if rest is not None and rest <= 0.0:
                    return None, False
                self._arrived.wait(rest)
            return self._waiting.popleft(), False

    def shutdown(self) -> None:
        """Close this end; a waiting `recv` ends."""
        with self._arrived:
            self._open = False
            self._arrived.notify_all()
        super().shutdown()
