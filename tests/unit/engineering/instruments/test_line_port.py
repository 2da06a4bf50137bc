"""The line protocol from both ends, and clients' ends that are rude: each a clear error, and the next reading good."""

from __future__ import annotations

import os
import pty
import socket
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress

import pytest

from gantryctl.engineering.instruments import LinePort, Reading, parse_address
from gantryctl.engineering.instruments.line_port import Address, answer_line
from gantryctl.engineering.instruments.line_server import LineServer
from gantryctl.errors import InstrumentError, UsageError

# Answers come at once in these tests; a second leaves room for a busy computer.
PATIENCE_S = 1.0
GOOD = "12.5 0.0002 deg"

Answer = Callable[[str], bytes | None]
"""From the number of a request to the bytes that go back; None hangs up."""


class Fixed:
    """An instrument that always reads the same."""

    name = "level 7, no. 1234"

    def __init__(self, *, interrupted: bool = False) -> None:
        self.interrupted = interrupted

    def read(self, time_s: float) -> Reading:
        if self.interrupted:
            raise InstrumentError("beam interrupted")
        return Reading(-12.3456789, 0.00015)


@contextmanager
def instrument(*answers: Answer) -> Iterator[Address]:
    """A server that greets well and answers one request after the other; it takes the next connection when one ends."""
    left = list(answers)
    listener = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        with suppress(OSError):
            while True:
                client, _ = listener.accept()
                with client, client.makefile("rb") as lines:
                    for line in lines:
                        words = line.decode().split()
                        if words == ["hello"]:
                            client.sendall(b"instrument T1\n")
                            continue
                        data = left.pop(0)(words[1])
                        if data is None:
                            break
                        client.sendall(data)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield Address(False, "127.0.0.1", listener.getsockname()[1])
    finally:
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()
        thread.join()


def good(number: str) -> bytes:
    return f"{number} {GOOD}\n".encode()


def says(text: str) -> Answer:
    return lambda number: f"{number} {text}\n".encode()


def test_a_reading_goes_from_one_end_to_the_other() -> None:
    with (
        LineServer(Fixed(), lambda: 0.0) as server,
        closing(LinePort(Address(False, "127.0.0.1", server.port))) as port,
    ):
        reading = port.read(3.0)
        assert port.name == Fixed.name
        # Seven digits are on the line: 4e-10 of a turn.
        assert reading == pytest.approx((-12.3456789, 0.00015), abs=5e-8)


def test_an_instrument_without_a_reading_says_why() -> None:
    with LineServer(Fixed(interrupted=True), lambda: 0.0) as server:
        port = LinePort(Address(False, "127.0.0.1", server.port))
        with closing(port), pytest.raises(InstrumentError, match=r"it has no reading: 'beam interrupted'"):
            port.read(0.0)


@pytest.mark.parametrize(
    ("rude", "error"),
    [
        (says("nan 0.0002 deg"), "two finite numbers"),
        (says("inf 0.0002 deg"), "two finite numbers"),
        (says("12.5 nan deg"), "two finite numbers"),
        (says("12.5 0 deg"), "standard uncertainty 0 deg: must be above 0"),
        (says("12.5 2 deg"), "at most 1 deg"),
        (says("45000 0.7 deg"), r"within \+-360 deg; check its unit"),
        (says("0.2182 0.0000035 rad"), "unit rad, must be deg"),
        (says("12.5 0.0002"), "is no reading"),
        (says("12,5 0.0002 deg"), "is no reading"),
        (says(""), "is no reading"),
        (says("x" * 300), "more than 200 bytes|at most 200 bytes"),
        (lambda n: b"\xff\xfe\n", "ASCII"),
        (lambda n: b"\n", "does not begin with the number"),
        (lambda n: b"ready\n", "does not begin with the number"),
        (lambda n: f"{int(n) + 7} {GOOD}\n".encode(), "answers a request that was not made"),
        (lambda n: good(n)[:9], "an answer was cut off"),
        (lambda n: good(n) + good(n), "two answers to request"),
        (lambda n: good(n) + f"{n} 12.6 0.0002 deg\n".encode(), "two answers to request"),
        (lambda n: good(n) + b"12", "an answer was cut off"),
        (lambda n: None, "has closed the connection"),
    ],
)
def test_a_rude_instrument_is_told_of_and_the_next_reading_is_good(rude: Answer, error: str) -> None:
    with instrument(good, rude, good) as address, closing(LinePort(address, 0.3)) as port:
        assert port.read(0.0) == (12.5, 0.0002)
        with pytest.raises(InstrumentError, match=error) as told:
            port.read(0.0)
        assert str(told.value).startswith(f"instrument {address}: ")
        assert port.read(0.0) == (12.5, 0.0002)


def test_an_answer_that_comes_too_late_answers_nothing_else() -> None:
    late: list[bytes] = []

    def keep(number: str) -> bytes:
        late.append(f"{number} 99.0 0.0002 deg\n".encode())
        return b""

    with instrument(keep, lambda n: late[0] + good(n)) as address, closing(LinePort(address, 0.2)) as port:
        with pytest.raises(InstrumentError, match=r"no answer within 0\.2 s"):
            port.read(0.0)
        assert port.read(0.0).angle_deg == 12.5
        assert port.late_count == 1


def test_a_second_answer_that_shows_at_the_next_request_puts_the_first_in_doubt() -> None:
    first: list[str] = []

    def one(number: str) -> bytes:
        first.append(number)
        return good(number)

    again = lambda n: f"{first[0]} 12.9 0.0002 deg\n".encode() + good(n)  # noqa: E731
    with instrument(one, again) as address, closing(LinePort(address, PATIENCE_S)) as port:
        port.read(0.0)
        with pytest.raises(InstrumentError, match="do two instruments share the line"):
            port.read(0.0)


def test_a_greeting_by_something_else_is_refused() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = LinePort(Address(False, "127.0.0.1", listener.getsockname()[1]), PATIENCE_S)

        def serve() -> None:
            client, _ = listener.accept()
            with client:
                client.sendall(b"HTTP/1.1 400 Bad Request\n")
                client.recv(100)

        thread = threading.Thread(target=serve)
        thread.start()
        with pytest.raises(InstrumentError, match="is no answer to hello"):
            port.identify()
        thread.join()


def test_nobody_there() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        number = listener.getsockname()[1]
    with pytest.raises(InstrumentError, match=rf"instrument tcp:127\.0\.0\.1:{number}: Connection refused"):
        LinePort(Address(False, "127.0.0.1", number)).read(0.0)


def test_a_serial_line() -> None:
    """Over a pseudo terminal; an answer to the process before lies on the line."""
    ours, theirs = pty.openpty()
    tty.setraw(ours)

    def serve() -> None:
        with suppress(OSError), os.fdopen(os.dup(ours), "rb", buffering=0) as lines:
            text = b""
            while True:
                text += lines.read(1) or b""
                if not text.endswith(b"\n"):
                    continue
                answer = answer_line(Fixed(), text.decode(), 0.0)
                stale = b"17 1.0 0.1 deg\n" if text == b"hello\n" else b""
                os.write(ours, stale + answer.encode() + b"\r\n")
                text = b""

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    port = LinePort(parse_address(f"serial:{os.ttyname(theirs)}:19200"), PATIENCE_S)
    with closing(port):
        assert port.read(0.0).angle_deg == pytest.approx(-12.3456789, abs=5e-8)
        assert port.name == Fixed.name
    os.close(theirs)
    os.close(ours)
    thread.join(1.0)


def test_a_file_is_no_serial_device(tmp_path: object) -> None:
    with pytest.raises(InstrumentError, match="is no serial device"):
        LinePort(parse_address(f"serial:{__file__}")).identify()


@pytest.mark.parametrize(
    "text", ["", "tcp:", "tcp:host", "tcp:host:0", "tcp:host:70000", "udp:h:1", "serial:", "4711"]
)
def test_an_address_that_is_none(text: str) -> None:
    with pytest.raises(UsageError, match="must be tcp:HOST:PORT or serial:DEVICE:BAUD"):
        parse_address(text)


@pytest.mark.parametrize("line", ["", "read", "read x", "read 1 2", "stop", "hello you"])
def test_our_own_end_refuses_what_is_no_request(line: str) -> None:
    assert answer_line(Fixed(), line, 0.0) == "0 error a request is hello, or read NUMBER"
