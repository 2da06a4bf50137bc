"""An instrument behind a line of text: TCP or a serial device. The protocol is in docs/reference/instrument-port.md."""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import select
import socket
import time
from typing import Final, NamedTuple, Protocol

from gantryctl.engineering.instruments.port import Instrument, Reading, checked
from gantryctl.errors import InstrumentError, UsageError

# Longest line either way, bytes, with its end.
LINE_MAX: Final = 200
# An answer may take this long: a tracker averages for a second or two, and looks for its target again before.
ANSWER_S: Final = 10.0
_CONNECT_S: Final = 5.0
# What follows an answer shows within this time: 30 bytes take 0.03 s at 9600 baud.
_SECOND_ANSWER_S: Final = 0.05
_UNIT: Final = "deg"
_NUMBER: Final = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?", re.ASCII)
_BAUD: Final = 9600
_BYTES: Final = 4096


class Address(NamedTuple):
    """Where an instrument listens.

    Attributes:
        place: host name, or the path of a serial device.
        number: TCP port, or baud rate.
    """

    serial: bool
    place: str
    number: int

    def __str__(self) -> str:
        return f"{'serial' if self.serial else 'tcp'}:{self.place}:{self.number}"


def parse_address(text: str) -> Address:
    """`tcp:HOST:PORT` or `serial:DEVICE[:BAUD]`.

    Raises:
        UsageError: it is neither.
    """
    kind, _, rest = text.partition(":")
    place, colon, number = rest.rpartition(":")
    if kind == "serial" and rest and not colon:
        place, number = rest, str(_BAUD)
    highest = 65535 if kind == "tcp" else 4_000_000
    if (
        kind not in ("tcp", "serial")
        or not place
        or not (number.isascii() and number.isdecimal())
        or not 0 < int(number) <= highest
    ):
        raise UsageError(f"instrument {text!r}: must be tcp:HOST:PORT or serial:DEVICE:BAUD")
    return Address(kind == "serial", place, int(number))


class _Stream(Protocol):
    """Bytes to and from an instrument; every fault of the line is an OSError."""

    def send(self, data: bytes) -> None: ...

    def receive(self, timeout_s: float) -> bytes:
        """What has come, b"" when the time is over; ConnectionError when the other end has gone."""
        ...

    def close(self) -> None: ...


class _Tcp:
    def __init__(self, address: Address) -> None:
        self._socket = socket.create_connection((address.place, address.number), _CONNECT_S)

    def send(self, data: bytes) -> None:
        self._socket.settimeout(_CONNECT_S)
        self._socket.sendall(data)

    def receive(self, timeout_s: float) -> bytes:
        self._socket.settimeout(max(timeout_s, 1e-3))
        try:
            data = self._socket.recv(_BYTES)
        except TimeoutError:
            return b""
        if not data:
            raise ConnectionError("the instrument has closed the connection")
        return data

    def close(self) -> None:
        self._socket.close()


class _Serial:
    """A serial device: 8 data bits, no parity, 1 stop bit, nothing translated."""

    def __init__(self, address: Address) -> None:
        try:
            import termios
            import tty
        except ImportError:
            raise UsageError(f"{address}: serial devices need a POSIX system; use tcp:") from None
        rate = getattr(termios, f"B{address.number}", None)
        if rate is None:
            raise UsageError(f"{address}: this system has no {address.number} baud")
        self._file = os.open(address.place, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            tty.setraw(self._file)
            settings = termios.tcgetattr(self._file)
            settings[4] = settings[5] = rate  # ispeed, ospeed
            settings[2] |= termios.CLOCAL | termios.CREAD
            termios.tcsetattr(self._file, termios.TCSANOW, settings)
            # What came before this port was opened answers nobody.
            termios.tcflush(self._file, termios.TCIFLUSH)
        except (OSError, termios.error) as fault:
            self.close()
            raise OSError(f"is no serial device ({fault})") from None

    def send(self, data: bytes) -> None:
        _, ready, _ = select.select([], [self._file], [], _CONNECT_S)
        if not ready or os.write(self._file, data) != len(data):
            raise OSError("the line does not take a request")

    def receive(self, timeout_s: float) -> bytes:
        ready, _, _ = select.select([self._file], [], [], timeout_s)
        if not ready:
            return b""
        data = os.read(self._file, _BYTES)
        if not data:
            raise ConnectionError("the instrument has gone")
        return data

    def close(self) -> None:
        os.close(self._file)


class LinePort:
    """Instrument at the other end of a line of text. It is connected when it is first asked, and again after a fault.

    Args:
        address: see `parse_address`.
        answer_s: longest time of an answer.

    Attributes:
        late_count: answers that came after their time and were left out.
    """

    def __init__(self, address: Address, answer_s: float = ANSWER_S) -> None:
        self.address, self._answer_s = address, answer_s
        self._stream: _Stream | None = None
        self._received = b""
        self._name = str(address)
        # Not 1: on a serial line an answer to a process that was killed must not answer this one.
        self._number = secrets.randbelow(1_000_000)
        self._answered = -1
        self._unanswered: set[int] = set()
        self.late_count = 0

    @property
    def name(self) -> str:
        """What the instrument calls itself; its address until it was asked."""
        return self._name

    def close(self) -> None:
        """Leave the line; may be called twice."""
        stream, self._stream, self._received = self._stream, None, b""
        if stream is not None:
            with contextlib.suppress(OSError):
                stream.close()

    def identify(self) -> str:
        """Connect, and return the instrument's name.

        Raises:
            InstrumentError: nobody answers, or with something else.
        """
        try:
            self._connect()
        except (OSError, InstrumentError) as fault:
            self.close()
            raise self._error(fault) from None
        return self._name

    def read(self, time_s: float) -> Reading:
        """One reading, now.

        Raises:
            InstrumentError: it did not come, or cannot be used.
        """
        try:
            self._connect()
            self._number += 1
            number = self._number
            self._unanswered.add(number)
            self._send(f"read {number}")
            reading = self._reading(self._answer(number))
            self._unanswered.discard(number)
            self._answered = number
            return reading
        except TimeoutError as late:
            # The line stays open: the answer will be known by its number when it comes.
            raise self._error(late) from None
        except (OSError, InstrumentError) as fault:
            self.close()
            raise self._error(fault) from None

    def _error(self, fault: Exception) -> InstrumentError:
        text = fault.strerror or str(fault) if isinstance(fault, OSError) else str(fault)
        return InstrumentError(f"instrument {self.address}: {text}")

    def _connect(self) -> None:
        """Open the line and greet, where that was not done."""
        if self._stream is not None:
            return
        self._stream = _Serial(self.address) if self.address.serial else _Tcp(self.address)
        try:
            self._greet()
        except TimeoutError:
            # Nobody is known to be there.
            self.close()
            raise

    def _greet(self) -> None:
        self._send("hello")
        deadline = time.monotonic() + self._answer_s
        while True:
            words = self._line(deadline).split(None, 1)
            if words[:1] == ["instrument"] and len(words) == 2:
                self._name = words[1]
                return
            # A serial line may still carry answers to a process that was here before.
            if not (self.address.serial and words and words[0].isdecimal()):
                raise InstrumentError(f"{_shown(' '.join(words))} is no answer to hello: instrument NAME")

    def _send(self, line: str) -> None:
        assert self._stream is not None
        self._stream.send(f"{line}\n".encode())

    def _answer(self, number: int) -> str:
        """What follows the number in the answer to a request."""
        deadline = time.monotonic() + self._answer_s
        found: str | None = None
        while True:
            try:
                line = self._line(deadline)
            except TimeoutError:
                if found is not None:
                    return found
                raise
            first, _, rest = line.partition(" ")
            if not (first.isascii() and first.isdecimal()):
                raise InstrumentError(f"{_shown(line)} does not begin with the number of a request")
            if int(first) != number:
                self._earlier(int(first), line)
            elif found is not None:
                raise InstrumentError(f"two answers to request {number}: {_shown(found)} and {_shown(rest)}")
            else:
                found = rest
                # Who answers twice does it at once.
                deadline = time.monotonic() + _SECOND_ANSWER_S

    def _earlier(self, number: int, line: str) -> None:
        """An answer to another request than the one under way."""
        if number in self._unanswered:
            self._unanswered.discard(number)
            self.late_count += 1
        elif number == self._answered:
            raise InstrumentError(
                f"a second answer to request {number}, which was answered before: {_shown(line)}; do two instruments "
                "share the line? the reading before this one is in doubt"
            )
        else:
            raise InstrumentError(f"{_shown(line)} answers a request that was not made")

    def _line(self, deadline: float) -> str:
        """The next whole line."""
        assert self._stream is not None
        while b"\n" not in self._received:
            if len(self._received) > LINE_MAX:
                raise InstrumentError(f"a line of more than {LINE_MAX} bytes: {_shown(self._received)}")
            left_s = deadline - time.monotonic()
            data = self._stream.receive(left_s) if left_s > 0.0 else b""
            if not data and left_s <= 0.0:
                if self._received.strip():
                    raise InstrumentError(
                        f"an answer was cut off: {_shown(self._received)} has no end of line"
                    )
                raise TimeoutError(f"no answer within {self._answer_s:g} s")
            self._received += data
        line, _, self._received = self._received.partition(b"\n")
        if len(line) > LINE_MAX or not line.isascii():
            raise InstrumentError(f"a line must be ASCII and at most {LINE_MAX} bytes: {_shown(line)}")
        return line.decode("ascii").strip()

    def _reading(self, answer: str) -> Reading:
        words = answer.split()
        if words[:1] == ["error"]:
            raise InstrumentError(f"it has no reading: {_shown(' '.join(words[1:]))}")
        if len(words) != 3 or not all(_NUMBER.fullmatch(word) for word in words[:2]):
            raise InstrumentError(
                f"{_shown(answer)} is no reading: ANGLE UNCERTAINTY {_UNIT}, two finite numbers"
            )
        if words[2] != _UNIT:
            raise InstrumentError(f"{_shown(answer)}: unit {words[2]}, must be {_UNIT}")
        return checked(Reading(float(words[0]), float(words[1])), _shown(answer))


def _shown(text: str | bytes) -> str:
    """What came, short enough for a message and without control characters."""
    shown = text.decode("ascii", "backslashreplace") if isinstance(text, bytes) else text
    return repr(shown[:60])


def answer_line(instrument: Instrument, line: str, time_s: float) -> str:
    """The other end of the protocol: the answer of an instrument to one line."""
    words = line.split()
    if words == ["hello"]:
        return f"instrument {instrument.name}"
    if len(words) != 2 or words[0] != "read" or not words[1].isdecimal():
        return "0 error a request is hello, or read NUMBER"
    try:
        reading = instrument.read(time_s)
    except InstrumentError as fault:
        return f"{words[1]} error {fault}"
    return f"{words[1]} {reading.angle_deg:.7f} {reading.uncertainty_deg:.7f} {_UNIT}"
