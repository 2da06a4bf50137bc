"""One python-can bus, read and written by the scan itself: no threads, nothing that dies in silence."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from typing import Final, NamedTuple, Protocol

import can

_DOWN_AFTER: Final = 3
"""Failures one after the other: a full transmit queue recovers, a dead controller does not."""
_ECHOES_KEPT: Final = 256
_BUS_OFF: Final = 0x40  # error classes of SocketCAN error frames
_CONTROLLER: Final = 0x04
_PASSIVE: Final = 0x30


class Frame(NamedTuple):
    """A classic data frame with an 11-bit identifier."""

    can_id: int
    data: bytes


class Link(Protocol):
    """What the master needs of a bus."""

    stepped: bool
    """The drive's time goes on by SYNC, not by itself."""
    refused: int
    """Frames that the bus did not take."""

    @property
    def down(self) -> bool:
        """Sending or receiving does not work any more."""
        ...

    def send(self, can_id: int, data: bytes) -> None:
        """One frame; a bus that refuses it is counted, not raised."""
        ...

    def receive(self, timeout_s: float) -> Frame | None:
        """The next frame of somebody else; None when the time is over."""
        ...

    def pause(self, seconds: float) -> None:
        """Let time go on."""
        ...

    def pace(self, period_s: float) -> None:
        """Wait for the next scan, where nothing else paces it; a drive stepped by SYNC needs none."""
        ...

    def now_s(self) -> float:
        """The time that time-outs are counted in, s."""
        ...

    def close(self) -> None:
        """Leave the bus; may be called twice."""
        ...


class BusLink:
    """A python-can bus.

    Args:
        bus: open.
        echoes: the interface delivers our own frames back (udp_multicast does).
        advance: lets the time of a drive in this process go on; without it time is the computer's.
        stepped: the drive's time goes on by SYNC (a drive in this process is so by itself).
        when_closed: called once, after the bus was left.

    Attributes:
        refused, malformed, foreign: frames that the bus did not take, that could not be read, that are of no concern
            (extended, remote, FD, error frames).
        bus_off, passive: what the controller reported last.
    """

    def __init__(
        self,
        bus: can.BusABC,
        *,
        echoes: bool = False,
        advance: Callable[[float], None] | None = None,
        stepped: bool = False,
        when_closed: Callable[[], None] = lambda: None,
    ) -> None:
        self._bus, self._when_closed = bus, when_closed
        self.stepped = stepped or advance is not None
        self._advance = advance
        self._virtual_s = 0.0
        self._sent: Counter[tuple[int, bytes]] | None = Counter() if echoes else None
        self._send_failures = self._receive_failures = 0
        self._open = True
        self.refused = self.malformed = self.foreign = 0
        self.bus_off = self.passive = False

    @property
    def down(self) -> bool:
        """Sending or receiving has failed several times in a row, or the controller is bus-off."""
        return (
            not self._open
            or self.bus_off
            or self._send_failures >= _DOWN_AFTER
            or self._receive_failures >= _DOWN_AFTER
        )

    def send(self, can_id: int, data: bytes) -> None:
        """One frame."""
        if not self._open:
            return
        if self._sent is not None:
            if len(self._sent) > _ECHOES_KEPT:
                self._sent.clear()
            self._sent[can_id, data] += 1
        try:
            self._bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))
        except (can.CanError, OSError):
            self.refused += 1
            self._send_failures += 1
        else:
            self._send_failures = 0
            self.bus_off = False

    def receive(self, timeout_s: float) -> Frame | None:
        """The next plain frame that is not our own echo."""
        end = self.now_s() + timeout_s
        while self._open:
            message = self._next(max(0.0, end - self.now_s()))
            if message is None:
                if self._advance is None or self.now_s() >= end - 1e-7:
                    return None
                self.pause(0.001)
            elif (frame := self._plain(message)) is not None:
                return frame
        return None

    def _next(self, timeout_s: float) -> can.Message | None:
        try:
            message = self._bus.recv(0.0 if self._advance is not None else timeout_s)
        except (can.CanError, OSError):
            self._receive_failures += 1
            return None
        except (ValueError, TypeError):  # udp_multicast and packets that are no CAN frames
            self.malformed += 1
            return None
        self._receive_failures = 0
        return message

    def _plain(self, message: can.Message) -> Frame | None:
        if message.is_error_frame:
            self._error_frame(message)
            return None
        if message.is_extended_id or message.is_remote_frame or message.is_fd:
            self.foreign += 1
            return None
        frame = Frame(message.arbitration_id, bytes(message.data))
        if self._sent is not None and self._sent[frame] > 0:
            self._sent[frame] -= 1
            if not self._sent[frame]:
                del self._sent[frame]
            return None
        return frame

    def _error_frame(self, message: can.Message) -> None:
        self.foreign += 1
        if message.arbitration_id & _BUS_OFF:
            self.bus_off = True
        if message.arbitration_id & _CONTROLLER and len(message.data) > 1:
            self.passive = bool(message.data[1] & _PASSIVE)

    def pause(self, seconds: float) -> None:
        """Sleep, or let the drive in this process live."""
        if self._advance is None:
            time.sleep(seconds)
        else:
            self._virtual_s += seconds
            self._advance(seconds)

    def pace(self, period_s: float) -> None:
        """Sleep; not for a drive that is stepped by SYNC."""
        if not self.stepped:
            time.sleep(period_s)

    def now_s(self) -> float:
        """The monotonic clock, or the time given to the drive in this process."""
        return time.monotonic() if self._advance is None else self._virtual_s

    def close(self) -> None:
        """Leave the bus."""
        if self._open:
            self._open = False
            self._bus.shutdown()
            self._when_closed()
