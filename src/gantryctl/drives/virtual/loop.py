"""Virtual drive on a python-can bus, in real time or stepped by SYNC."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import Final, Protocol

import can

from gantryctl.errors import DeviceError

# In real time the drive's clock goes on between frames too: it wakes at least that often.
_WAKE_S: Final = 0.005
_IDLE_S: Final = 0.1
# More than this at once is not made up for: a held-up process would see deadlines pass that frames still in its queue
# have kept. The drive's own time stands still instead.
_MAX_STEP_US: Final = 20_000
_MAX_ERRORS: Final = 100


_FLAGS: Final = ("is_error_frame", "is_remote_frame", "is_extended_id", "is_fd")


def is_plain(message: can.Message) -> bool:
    """Whether a message is a classic data frame with an 11-bit identifier."""
    return not any(getattr(message, flag) for flag in _FLAGS)


def frame(can_id: int, data: bytes) -> can.Message:
    """Message of the node."""
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=False)


class BusEnd(Protocol):
    """What is at the other end of a bus: a drive, or several nodes."""

    @property
    def time_us(self) -> int:
        """Its own time."""
        ...

    @property
    def stepped(self) -> bool:
        """Time goes on by SYNC only."""
        ...

    def boot(self) -> None:
        """Power on."""
        ...

    def advance(self, us: int) -> None:
        """Advance its own time."""
        ...

    def on_frame(self, can_id: int, data: bytes) -> None:
        """Take one frame."""
        ...


class DirectBus(can.BusABC):
    """Bus whose other end is the drive, in the same thread and without a network.

    Make the bus, make the node with `bus.deliver` as its `send`, `attach` it, `boot` it. Hold `lock` to use the node
    while another thread uses the bus.
    """

    # `send` hands a frame to the drive and returns when the drive has answered; the answers wait to be received. So a
    # master, or the canopen library, runs against a stepped drive as fast as both compute, the same way every time.

    def __init__(self) -> None:
        self._waiting: deque[can.Message] = deque()
        self.lock = threading.RLock()
        self._arrived = threading.Condition(self.lock)
        self._node: BusEnd | None = None
        self._open = True
        self._can_protocol = can.CanProtocol.CAN_20
        self.channel_info = "virtual drive in this process"
        super().__init__(channel="direct")

    def attach(self, node: BusEnd) -> None:
        """Put a drive, or several nodes, on the bus."""
        self._node = node

    def deliver(self, can_id: int, data: bytes) -> None:
        """Take a frame of the drive; the `send` of its node."""
        message = frame(can_id, data)
        message.timestamp = self._node.time_us * 1e-6 if self._node else 0.0
        with self._arrived:
            self._waiting.append(message)
            self._arrived.notify_all()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Hand a frame of the master to the drive, which acts before this returns.

        Raises:
            can.CanOperationError: the bus was shut down.
        """
        with self.lock:
            if not self._open:
                raise can.CanOperationError("the bus was shut down")
            if self._node is not None and is_plain(msg):
                self._node.on_frame(msg.arbitration_id, bytes(msg.data))

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next frame that the filters pass; without the clock and the log that python-can asks for each."""
        while True:
            message, _ = self._recv_internal(timeout)
            if message is None or self._matches_filters(message):
                return message

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


class FrameSender:
    """Send the frames of the node and count those that the bus refuses.

    Args:
        bus: any python-can bus.
    """

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus
        self.refused = 0

    def send(self, can_id: int, data: bytes) -> None:
        """Send one frame; a drive does not stop because its bus does."""
        try:
            self.bus.send(frame(can_id, data))
        except can.CanError:
            self.refused += 1


class DriveLoop:
    """Run a node on a bus in real time, or stepped by SYNC.

    Args:
        node: the drive, or several nodes; their `send` is that of the link.
        link: the bus.
    """

    def __init__(self, node: BusEnd, link: FrameSender) -> None:
        self.node, self.link = node, link
        self.lock = threading.RLock()
        """Held while the node works, and by the side channel."""
        self.lost_us = 0
        """Time not made up for."""
        self.malformed = 0
        """Frames that python-can could not read."""
        self._errors = 0

    def run(self, stop: threading.Event) -> None:
        """Run until `stop` is set.

        Raises:
            DeviceError: the bus has failed.
        """
        last_us = round(time.monotonic() * 1e6)
        timeout = _IDLE_S if self.node.stepped else _WAKE_S
        while not stop.is_set():
            message = self._receive(timeout)
            with self.lock:
                if not self.node.stepped:
                    now_us = round(time.monotonic() * 1e6)
                    self._catch_up(now_us - last_us)
                    last_us = now_us
                if message is not None and is_plain(message):
                    self.node.on_frame(message.arbitration_id, bytes(message.data))

    def _catch_up(self, elapsed_us: int) -> None:
        step = min(elapsed_us, _MAX_STEP_US)
        self.lost_us += elapsed_us - step
        self.node.advance(step)

    def _receive(self, timeout: float) -> can.Message | None:
        try:
            message = self.link.bus.recv(timeout)
        # udp_multicast raises the latter two for packets that are no CAN frames.
        except (can.CanError, ValueError, TypeError) as fault:
            self.malformed += 1
            self._errors += 1
            if self._errors >= _MAX_ERRORS:
                raise DeviceError(f"the CAN interface does not receive any more: {fault}") from None
            return None
        self._errors = 0
        return message
