"""Client of the local socket of a running service, for the command line."""

from __future__ import annotations

import json
import secrets
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

from gantryctl.errors import CommandRefused, DeviceError
from gantryctl.operation.store import SERVICE_SOCKET, PeerName
from gantryctl.service.protocol.limits import RENEW_S
from gantryctl.service.protocol.messages import WITHOUT_EPOCH

_TIMEOUT_S: Final = 3.0


def console_link(directory: Path) -> str:
    """Ask the running service for a link that opens the page as the console of this machine; "" without a page.

    Raises:
        DeviceError: no service runs, or it does not answer.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
        asking.settimeout(_TIMEOUT_S)
        try:
            with PeerName(directory) as address:
                asking.connect(address)
            asking.sendall(b'{"console":true}\n')
            with asking.makefile("rb") as said:
                return str(json.loads(said.readline())["link"])
        except (OSError, KeyError, ValueError) as fault:
            raise _silent(directory, fault) from fault


def _silent(directory: Path, fault: BaseException) -> DeviceError:
    return DeviceError(
        f"no service answers at {directory / SERVICE_SOCKET} ({fault}): `gantryctl serve` starts one"
    )


class Refused(NamedTuple):
    """Why the service does not do something, as its reply says it."""

    code: str
    text: str

    @classmethod
    def of(cls, reply: dict[str, Any]) -> Refused:
        return cls(reply["code"], reply["text"])

    def __str__(self) -> str:
        return f"{self.code} · {self.text}"


class ServiceLink:
    """A connection to the service of one machine, open from construction; a context manager.

    Args:
        directory: the machine's state directory.
        warn: takes a warning that comes with an answer, one line.

    Attributes:
        tags: the newest values of all tags.
        frame: mark of the newest status frame.
        client: id of this connection.

    Raises:
        DeviceError: no service runs, or it does not answer.
    """

    def __init__(self, directory: Path, warn: Callable[[str], None] = lambda _: None) -> None:
        self._warn = warn
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.settimeout(_TIMEOUT_S)
        self._data, self._ended = b"", ""
        self._seq = 0
        self._replies: dict[int, dict[str, Any]] = {}
        self.tags: dict[str, Any] = {}
        self.frame = ""
        self.fresh = False
        try:
            with PeerName(directory) as address:
                self._socket.connect(address)
            self._socket.sendall(b'{"watch":true}\n')
            self.client: str = self._next()["client"]
            self.look()
        except BaseException as fault:
            self._socket.close()
            if not isinstance(fault, OSError | KeyError | ValueError):
                raise
            raise _silent(directory, fault) from fault

    def __enter__(self) -> ServiceLink:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def look(self) -> dict[str, Any]:
        """Wait for a status frame that is newer than all so far; the tags."""
        frame = self.frame
        until_s = time.monotonic() + _TIMEOUT_S
        while self.frame == frame or not self.fresh:
            if time.monotonic() > until_s:
                raise DeviceError("the service runs, but its controller is silent")
            self._take(self._next())
        return self.tags

    def ask(self, kind: str, **values: Any) -> dict[str, Any]:
        """Send a command and wait for its reply.

        Raises:
            CommandRefused: it was refused.
            DeviceError: no answer.
        """
        seq = self.say(kind, **values)
        until_s = time.monotonic() + _TIMEOUT_S
        while seq not in self._replies:
            if time.monotonic() > until_s:
                raise DeviceError(f"the service does not answer to {kind}")
            self._take(self._next())
        reply = self._replies.pop(seq)
        if not reply["ok"]:
            raise CommandRefused(str(Refused.of(reply)))
        if reply["code"]:
            self._warn(str(Refused.of(reply)))
        self.tags["epoch"] = reply["epoch"]
        return reply

    def say(self, kind: str, **values: Any) -> int:
        """Send a command without waiting; its number."""
        self._seq += 1
        # Stops are judged first and never refused, whatever has happened since (decision 0011): no epoch.
        epoch = {} if kind in WITHOUT_EPOCH else {"epoch": self.tags["epoch"]}
        message = {"type": kind, "seq": self._seq, "frame": self.frame, **epoch, **values}
        try:
            self._socket.sendall(json.dumps(message).encode() + b"\n")
        except OSError as fault:
            raise DeviceError(f"the connection to the service broke: {fault.strerror or fault}") from fault
        return self._seq

    def hold(self, forward: bool, seconds: float, stopped: Callable[[], bool]) -> Refused | None:
        """Hold a key for a time, or until `stopped()`; then let go.

        Returns:
            Why the service has let it go before; None when it has not.
        """
        lease = secrets.token_hex(8)
        self.ask("jog", lease=lease, direction="forward" if forward else "reverse")
        until_s = time.monotonic() + seconds
        self._socket.settimeout(RENEW_S)
        self._replies.clear()
        try:
            while time.monotonic() < until_s and not stopped() and not self._replies:
                self.say("renew", lease=lease)
                self._drain()
            # A renewal has no reply but its refusal: then the key is dead.
            return next(map(Refused.of, self._replies.values()), None)
        finally:
            self._socket.settimeout(_TIMEOUT_S)
            self.ask("release", lease=lease)

    def alive(self) -> None:
        """Keep control: without a sign of life for 2 s it is free."""
        self.say("alive")

    def _drain(self) -> None:
        """Take what comes until the next renewal: until a new status frame, or for its period."""
        until_s, frame = time.monotonic() + RENEW_S, self.frame
        while self.frame == frame and (left_s := until_s - time.monotonic()) > 0.0:
            self._socket.settimeout(left_s)
            try:
                self._take(self._received())
            except TimeoutError:
                return

    def _take(self, message: dict[str, Any]) -> None:
        if message["type"] == "status":
            self.frame, self.fresh = message["frame"], message["fresh"]
            self.tags.update(message["tags"])
        elif message["type"] == "reply":
            self._replies[message["seq"]] = message

    def _next(self) -> dict[str, Any]:
        """Wait for the next message; frames come all the time, so silence is an end, also for what is asked next."""
        if self._ended:
            raise DeviceError(self._ended)
        try:
            return self._received()
        except TimeoutError as silence:
            # Whatever this command still asks for would wait as long, and keep control for that time.
            self._ended = (
                f"the service has said nothing for {_TIMEOUT_S:g} s, and whether the axis moves is not known: stop it "
                "at the machine"
            )
            raise DeviceError(self._ended) from silence

    def _received(self) -> dict[str, Any]:
        while b"\n" not in self._data:
            try:
                more = self._socket.recv(65536)
            except TimeoutError:
                raise
            except OSError as fault:
                raise DeviceError(
                    f"the connection to the service broke: {fault.strerror or fault}"
                ) from fault
            if not more:
                raise DeviceError("the service has closed the connection")
            self._data += more
        line, self._data = self._data.split(b"\n", 1)
        try:
            found: dict[str, Any] = json.loads(line)
        except ValueError as fault:
            raise DeviceError(f"the service says what is not understood: {fault}") from fault
        return found
