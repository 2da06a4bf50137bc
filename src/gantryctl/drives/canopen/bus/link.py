"""Link to a python-can bus, opened by name; the scan itself reads and writes it, without a thread."""

from __future__ import annotations

import errno
import time
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any, Final, NamedTuple

import can

from gantryctl.drives.canopen.bus.interface import Counted, InterfaceCounters
from gantryctl.errors import DeviceError, UsageError
from gantryctl.image import LinkFlag
from gantryctl.trace.frames.ring import FrameLog

# Failures one after the other: a full transmit queue recovers, a dead controller does not.
_DOWN_AFTER: Final = 3
_ECHOES_KEPT: Final = 256
_SYNC: Final = 0x080
_ID_MASK: Final = 0x7FF
# Classic frame with an 11-bit identifier and the space behind it (ISO 11898-1), without data.
_FRAME_BITS: Final = 47
# Classes of SocketCAN error frames, and of their second byte the states of the controller (linux/can/error.h).
_CONTROLLER: Final = 0x04
_BUS_OFF: Final = 0x40
_RESTARTED: Final = 0x100
_STATES: Final = 0x7C
_PASSIVE: Final = 0x30


# python-can's IPv4 group; its default, the IPv6 one, is lost on many hosts.
UDP_GROUP: Final = "239.74.163.2"
# Interfaces that deliver our own frames back. Undropped, the echo overwrote a freshly set controlword in 463 of 500
# cycles of a library on udp_multicast.
ECHOING: Final = ("udp_multicast", "socketcan")


class Frame(NamedTuple):
    """Classic data frame with an 11-bit identifier."""

    can_id: int
    data: bytes


def open_bus(interface: str, channel: str | None = None, bitrate: int | None = None) -> can.BusABC:
    """Open a bus without python-can's own configuration files.

    Raises:
        UsageError: there is no such interface. DeviceError: it cannot be opened.
    """
    if interface not in can.VALID_INTERFACES:
        known = ", ".join(sorted(can.VALID_INTERFACES))
        raise UsageError(f"CAN interface {interface!r}: python-can has no such interface; it has: {known}")
    if not channel and interface == "udp_multicast":
        channel = UDP_GROUP
    options: dict[str, Any] = {} if bitrate is None else {"bitrate": bitrate}
    if interface == "socketcan":
        # They come back when they were really sent.
        options["receive_own_messages"] = True
    if channel:
        options["channel"] = channel
    try:
        return can.Bus(interface=interface, ignore_config=True, **options)
    except (can.CanError, OSError, ValueError, ImportError, TypeError) as fault:
        where = interface if not channel else f"{interface}, channel {channel}"
        raise DeviceError(f"the CAN interface cannot be opened ({where}): {fault}") from None


class Traffic(NamedTuple):
    """Data frames on the bus since the link was opened."""

    bits: int
    """Without stuff bits."""
    filtered: int
    """Frames of others that a filter in the kernel kept from this process."""


class BusLink:
    """Link of the master to a python-can bus.

    Args:
        bus: open.
        echoes: the interface delivers our own frames back.
        advance: lets the time of a drive in this process go on; without it time is the computer's.
        stepped: the drive's time goes on by SYNC; always so for a drive in this process.
        log: called for each data frame sent or received, not for the echo of one; it must not raise.
        counters: of an interface whose frames can be filtered in the kernel (SocketCAN).
        when_closed: called once, after the bus was left.

    Attributes:
        refused: frames that the bus did not take. queue_full: of these, for a full transmit queue (ENOBUFS).
        ignored: frames that could not be read, or that are of no concern (extended, remote, FD, error frames).
        bus_offs, passives: times that the controller of the bus reported bus-off, or error passive.
        unseen: SYNCs sent since one of them came back; 0 on an interface that gives none back.
    """

    def __init__(
        self,
        bus: can.BusABC,
        *,
        echoes: bool = False,
        advance: Callable[[float], None] | None = None,
        stepped: bool = False,
        log: FrameLog | None = None,
        counters: InterfaceCounters | None = None,
        when_closed: Callable[[], None] = lambda: None,
    ) -> None:
        self._bus, self._when_closed, self._log = bus, when_closed, log
        self.stepped = stepped or advance is not None
        self._advance = advance
        self._virtual_s = 0.0
        self._echoes: Counter[tuple[int, bytes]] | None = Counter() if echoes else None
        self._send_failures = self._receive_failures = 0
        self._open = True
        self._counters, self._accepted = counters, set[int]()
        self._sent_bits = self._received_bits = self._sent_frames = self._received = 0
        self._last: Traffic | None = None
        self._begun = counters.read() if counters is not None else Counted(0, 0)
        self.refused = self.queue_full = self.ignored = self.unseen = 0
        self.bus_offs = self.passives = 0
        self._bus_off = self._passive = False

    @property
    def down(self) -> bool:
        """Sending or receiving has failed several times in a row, or the controller is bus-off."""
        failures = max(self._send_failures, self._receive_failures)
        return not self._open or self._bus_off or failures >= _DOWN_AFTER

    @property
    def trouble(self) -> LinkFlag:
        """State of the controller of the bus: BUS_OFF, ERROR_PASSIVE, or neither."""
        found = LinkFlag.BUS_OFF if self._bus_off else LinkFlag.NONE
        return found | LinkFlag.ERROR_PASSIVE if self._passive else found

    # --- the traffic of others ------------------------------------------------------------------------------------

    def accept(self, identifiers: Iterable[int]) -> None:
        """Let the kernel pass only these identifiers, and those accepted before, where it counts the others.

        Frames of others cost the scan nothing then. Elsewhere every frame is received.
        """
        if self._counters is None:
            return
        self._accepted.update(identifiers)
        wanted = sorted(self._accepted)
        # Error frames have a filter of their own and pass.
        self._bus.set_filters([{"can_id": i, "can_mask": _ID_MASK, "extended": False} for i in wanted])

    @property
    def traffic(self) -> Traffic:
        """Count what was on the bus while it was open, frames that were filtered out included."""
        if self._last is not None:
            return self._last
        if self._counters is not None:
            # An interface that has gone shows by sending and receiving.
            with suppress(OSError):
                return self._counted(self._counters)
        return Traffic(self._sent_bits + self._received_bits, 0)

    def _counted(self, counters: InterfaceCounters) -> Traffic:
        now = counters.read()
        frames, data_bytes = now.frames - self._begun.frames, now.data_bytes - self._begun.data_bytes
        bits = _FRAME_BITS * frames + 8 * data_bytes
        if counters.counts_own:
            return Traffic(bits, max(0, frames - self._received - self._sent_frames))
        return Traffic(bits + self._sent_bits, max(0, frames - self._received))

    # --- frames ---------------------------------------------------------------------------------------------------

    def send(self, can_id: int, data: bytes) -> bool:
        """Send one frame; False for one that the bus refused, which is counted, not raised."""
        if not self._open:
            return False
        self._sent_bits += _FRAME_BITS + 8 * len(data)
        self.unseen += self._echoes is not None and can_id == _SYNC
        try:
            self._bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))
        except (can.CanError, OSError) as fault:
            self.refused += 1
            self._send_failures += 1
            number = fault.error_code if isinstance(fault, can.CanError) else fault.errno
            self.queue_full += number == errno.ENOBUFS
            return False
        # Of a controller that is bus-off the kernel still takes frames: only one that was seen proves anything.
        self._send_failures = 0
        self._sent_frames += 1
        if self._echoes is not None:
            if len(self._echoes) > _ECHOES_KEPT:
                self._echoes.clear()
            self._echoes[can_id, data] += 1
        if self._log is not None:
            self._log(self.now_s(), can_id, data, True)
        return True

    def receive(self, timeout_s: float) -> Frame | None:
        """Receive the next classic data frame that is not an echo; None when the time is over."""
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

    def take_over(self) -> None:
        """Go on after a copy of this process that has had the bus: what it has sent and got is not for this one."""
        while self._next(0.0) is not None:
            pass
        if self._echoes is not None:
            self._echoes.clear()
        self.unseen = 0

    def log_nothing(self) -> None:
        """From now on no frame is logged: a copy of this process must not write into the file of the original."""
        self._log = None

    def _next(self, timeout_s: float) -> can.Message | None:
        try:
            message = self._bus.recv(0.0 if self._advance is not None else timeout_s)
        except (can.CanError, OSError):
            self._receive_failures += 1
            return None
        # udp_multicast raises these for packets that are no CAN frames; a receiver thread would die of them.
        except (ValueError, TypeError):
            self.ignored += 1
            return None
        self._receive_failures = 0
        return message

    def _plain(self, message: can.Message) -> Frame | None:
        if message.is_error_frame:
            self._error_frame(message)
            return None
        if message.is_extended_id or message.is_remote_frame or message.is_fd:
            self.ignored += 1
            self._received_bits += _FRAME_BITS + 8 * len(message.data)
            return None
        self._bus_off = False
        frame = Frame(message.arbitration_id, bytes(message.data))
        if self._echoes is not None and self._echoes[frame] > 0:
            self._echoes[frame] -= 1
            if not self._echoes[frame]:
                del self._echoes[frame]
            if frame.can_id == _SYNC:
                self.unseen = 0
            return None
        self._received += 1
        self._received_bits += _FRAME_BITS + 8 * len(frame.data)
        if self._log is not None:
            self._log(self.now_s(), frame.can_id, frame.data, False)
        return frame

    def _error_frame(self, message: can.Message) -> None:
        self.ignored += 1
        kind = message.arbitration_id
        if kind & _BUS_OFF and not self._bus_off:
            self._bus_off = True
            self.bus_offs += 1
        if kind & _RESTARTED:
            self._bus_off = self._passive = False
        # One frame for each change of the state, and it names the state that was reached.
        state = message.data[1] & _STATES if kind & _CONTROLLER and len(message.data) > 1 else 0
        if state:
            passive = bool(state & _PASSIVE)
            self.passives += passive and not self._passive
            self._passive = passive

    def pause(self, seconds: float) -> None:
        """Sleep, or advance the drive in this process."""
        if self._advance is None:
            time.sleep(seconds)
        else:
            self._virtual_s += seconds
            self._advance(seconds)

    def pace(self, period_s: float) -> None:
        """Sleep until the next scan; a drive stepped by SYNC needs none."""
        if not self.stepped:
            time.sleep(period_s)

    def now_s(self) -> float:
        """Time for time-outs, s: the monotonic clock, or the time of the drive in this process."""
        return time.monotonic() if self._advance is None else self._virtual_s

    def close(self) -> None:
        """Leave the bus."""
        if self._open:
            self._open = False
            self._last = self.traffic
            self._bus.shutdown()
            if self._counters is not None:
                self._counters.close()
            self._when_closed()
