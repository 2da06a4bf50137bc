"""The virtual drive on a python-can bus: in real time, or stepped by SYNC."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

import can

from gantryctl.drives.virtual.direct import frame, is_plain
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.errors import DeviceError

_WAKE_S: Final = 0.005
_IDLE_S: Final = 0.1
_MAX_STEP_US: Final = 20_000
"""More than this at once is not made up for: a held-up process would see deadlines pass that frames still in its
queue have kept. The drive's own time stands still instead."""
_MAX_ERRORS: Final = 100


class BusLink:
    """Sends the node's frames; counts what the bus refuses.

    Args:
        bus: any python-can bus.
    """

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus
        self.refused = 0

    def send(self, can_id: int, data: bytes) -> None:
        """One frame. A drive does not stop because its bus does."""
        try:
            self.bus.send(frame(can_id, data))
        except can.CanError:
            self.refused += 1


class DriveLoop:
    """Receives, lets time go on, until told to stop.

    Args:
        node: the drive; its `send` is that of the link.
        link: the bus.
        clock: seconds, monotonic.
    """

    def __init__(self, node: DriveNode, link: BusLink, clock: Callable[[], float] = time.monotonic) -> None:
        self.node = node
        self.link = link
        self.lock = threading.RLock()
        """Held while the node works; the side channel takes it too."""
        self.lost_us = 0
        """Time that was not made up for."""
        self.malformed = 0
        """Frames that python-can could not read."""
        self._clock = clock
        self._errors = 0

    def run(self, stop: threading.Event) -> None:
        """Run until `stop` is set.

        Raises:
            DeviceError: the bus does not work any more.
        """
        last_us = round(self._clock() * 1e6)
        timeout = _IDLE_S if self.node.stepped else _WAKE_S
        while not stop.is_set():
            message = self._receive(timeout)
            with self.lock:
                if not self.node.stepped:
                    now_us = round(self._clock() * 1e6)
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
        except (
            can.CanError,
            ValueError,
            TypeError,
        ) as fault:  # the latter: udp_multicast and foreign packets
            self.malformed += 1
            self._errors += 1
            if self._errors >= _MAX_ERRORS:
                raise DeviceError(f"the CAN interface does not receive any more: {fault}") from None
            return None
        self._errors = 0
        return message


@contextmanager
def running(loop: DriveLoop) -> Iterator[DriveLoop]:
    """Boot the drive and let it live in a thread of its own while the block runs."""
    stop = threading.Event()
    thread = threading.Thread(target=loop.run, args=(stop,), name="virtual drive", daemon=True)
    with loop.lock:
        loop.node.boot()
    thread.start()
    try:
        yield loop
    finally:
        stop.set()
        thread.join()
