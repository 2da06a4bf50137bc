"""Ways to the service: the WebSocket of the page, over the network, and the socket of this machine."""

from __future__ import annotations

import json
import socket
from contextlib import ExitStack, suppress
from pathlib import Path
from ssl import SSLContext
from typing import Final, Protocol

from gantryctl.client.errors import Refused
from gantryctl.errors import DeviceError
from gantryctl.operation.store import SERVICE_SOCKET, PeerName

_OPEN_S: Final = 10.0
# A service that takes nothing for longer has gone, or the network has.
_SEND_S: Final = 5.0


class Wire(Protocol):
    """One connection; texts both ways."""

    def send(self, text: str) -> None:
        """Send one message; DeviceError when the connection has ended."""
        ...

    def receive(self) -> str:
        """Wait for the next message; DeviceError when the connection has ended."""
        ...

    def close(self) -> None:
        """End the connection; may be called twice, and from another thread than `receive`."""
        ...


class WebSocketWire:
    """The WebSocket that the page uses too.

    Args:
        address: of the page, as `https://gantry:8650`. cookie: of a session. trust: of its certificate; None without
            TLS.

    Raises:
        Refused: SEC-.. with what the service says. DeviceError: nobody answers.
    """

    def __init__(self, address: str, path: str, cookie: str, trust: SSLContext | None) -> None:
        from websockets.exceptions import InvalidHandshake, InvalidStatus
        from websockets.sync.client import connect
        from websockets.typing import Origin

        self._open = ExitStack()
        try:
            connecting = connect(
                address.replace("http", "ws", 1) + path,
                # The service takes no connection of a foreign page; a script is not a page.
                origin=Origin(address),
                additional_headers={"Cookie": cookie},
                ssl=trust,
                proxy=None,
                compression=None,
                open_timeout=_OPEN_S,
                close_timeout=1.0,
                # The reader keeps up with the frames; none may wait in between and look fresh.
                max_queue=None,
            )
            self._socket = self._open.enter_context(connecting)
        except InvalidStatus as refused:
            raise refusal_of(refused.response.body or b"", refused.response.status_code) from None
        except (OSError, InvalidHandshake, EOFError) as fault:
            raise DeviceError(f"{address}: the service does not answer: {fault}") from fault

    def send(self, text: str) -> None:
        """Send one message."""
        from websockets.exceptions import ConnectionClosed

        try:
            self._socket.send(text)
        except (ConnectionClosed, OSError) as fault:
            raise DeviceError(f"the connection to the service has ended: {fault}") from fault

    def receive(self) -> str:
        """Wait for the next message."""
        from websockets.exceptions import ConnectionClosed

        try:
            return str(self._socket.recv(decode=True))
        except (ConnectionClosed, OSError) as fault:
            raise DeviceError(f"the connection to the service has ended: {fault}") from fault

    def close(self) -> None:
        """End the connection."""
        self._open.close()


class LocalWire:
    """The socket of this machine, where the system says who asks.

    Args:
        directory: the machine's state directory.

    Raises:
        DeviceError: no service runs.
    """

    def __init__(self, directory: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.settimeout(_SEND_S)
        try:
            with PeerName(directory) as address:
                self._socket.connect(address)
            self._socket.sendall(b'{"watch":true}\n')
        except OSError as fault:
            self._socket.close()
            raise DeviceError(
                f"no service answers at {directory / SERVICE_SOCKET} ({fault}): `gantryctl serve` starts one"
            ) from fault
        self._lines = self._socket.makefile("r", encoding="utf-8", newline="\n")

    def send(self, text: str) -> None:
        """Send one message."""
        try:
            self._socket.sendall(text.encode() + b"\n")
        except OSError as fault:
            raise DeviceError(f"the connection to the service has ended: {fault}") from fault

    def receive(self) -> str:
        """Wait for the next message; frames come all the time, so silence is an end."""
        try:
            line = self._lines.readline()
        except (OSError, ValueError) as fault:
            raise DeviceError(f"the connection to the service has ended: {fault}") from fault
        if not line:
            raise DeviceError("the service has closed the connection")
        return line

    def close(self) -> None:
        """End the connection."""
        # It wakes a reader in another thread, which closing alone does not.
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._lines.close()
        self._socket.close()


def refusal_of(body: bytes | bytearray, status: int) -> Refused | DeviceError:
    """The exception for an answer of the service that is an error."""
    try:
        found = json.loads(body)["error"]
        return Refused(str(found["code"]), str(found["text"]))
    except (ValueError, KeyError, TypeError):
        return DeviceError(f"the service answers with HTTP status {status}, and not as gantryctl does")
