"""Side channel, both ends: a unix socket, one JSON object a line, one answer a line."""

from __future__ import annotations

import contextlib
import json
import os
import select
import socket
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from gantryctl.drives.base import TRUTH_COLUMNS
from gantryctl.errors import DeviceError, UsageError

_MAX_LINE: Final = 65536
_MAX_PATH: Final = 100
_ANSWER_S: Final = 10.0
_BACKLOG: Final = 8


class ControlServer:
    """Answer requests on a socket, as a context manager.

    Args:
        path: of the socket; only this user may open it.
        answer: from a parsed request to its answer.
        lock: held around `answer`.

    Raises:
        UsageError: the path cannot be used, or another server listens there.
    """

    def __init__(self, path: Path, answer: Callable[[object], dict[str, Any]], lock: threading.RLock) -> None:
        self.path, self._answer, self._lock = path, answer, lock
        self._clients: set[socket.socket] = set()
        self._listener = _listen(path)
        self._thread = threading.Thread(target=self._accept, name="side channel", daemon=True)

    def __enter__(self) -> ControlServer:
        self._thread.start()
        return self

    def __exit__(self, *_raised: object) -> None:
        self.path.unlink(missing_ok=True)
        for end in (self._listener, *list(self._clients)):
            _hang_up(end)
        self._thread.join()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            self._clients.add(client)
            threading.Thread(
                target=self._serve, args=(client,), name="side channel client", daemon=True
            ).start()

    def _serve(self, client: socket.socket) -> None:
        gone = contextlib.suppress(OSError, ValueError)
        with gone, client, client.makefile("rwb") as lines:
            while line := lines.readline(_MAX_LINE):
                lines.write(self._reply(line))
                lines.flush()
                if not line.endswith(b"\n"):
                    break
        self._clients.discard(client)

    def _reply(self, line: bytes) -> bytes:
        try:
            request = json.loads(line)
        except (ValueError, RecursionError):
            return _line({"ok": False, "error": "a request is one JSON object on one line"})
        with self._lock:
            return _line(self._answer(request))


class ControlClient:
    """Client of a drive's side channel, as a context manager.

    Args:
        path: of the socket.

    Raises:
        DeviceError: no virtual drive listens there.
    """

    def __init__(self, path: Path) -> None:
        self._socket = _unix_socket()
        self._socket.settimeout(_ANSWER_S)
        try:
            self._socket.connect(str(path))
        except OSError as fault:
            self._socket.close()
            raise DeviceError(f"no virtual drive listens on {path}: {fault.strerror or fault}") from None
        self._lines = self._socket.makefile("rwb")

    def send(self, cmd: str, **fields: Any) -> None:
        """Send a request; `poll` fetches its answer later.

        Raises:
            DeviceError: the drive is gone.
        """
        try:
            self._lines.write(_line({"cmd": cmd, **fields}))
            self._lines.flush()
        except OSError as fault:
            raise DeviceError(f"the virtual drive does not answer: {fault}") from None

    def poll(self) -> dict[str, Any] | None:
        """Answer to the request of `send`, None while it is outstanding; never waits.

        Raises:
            DeviceError: the request was refused, or the drive is gone.
        """
        ready, _, _ = select.select([self._socket], [], [], 0.0)
        return self._answer() if ready else None

    def ask(self, cmd: str, **fields: Any) -> dict[str, Any]:
        """Send a request and wait for its answer.

        Raises:
            DeviceError: the request is refused, or the drive is gone.
        """
        self.send(cmd, **fields)
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        try:
            line = self._lines.readline()
        except OSError as fault:
            raise DeviceError(f"the virtual drive does not answer: {fault}") from None
        if not line:
            raise DeviceError("the virtual drive has closed its side channel")
        answer: dict[str, Any] = json.loads(line)
        if not answer.pop("ok"):
            raise DeviceError(str(answer["error"]))
        return answer

    def __enter__(self) -> ControlClient:
        return self

    def __exit__(self, *_raised: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection; may be called twice."""
        # What is still to be sent to a drive that has gone is lost.
        with contextlib.suppress(OSError):
            self._lines.close()
        self._socket.close()


def _line(data: dict[str, Any]) -> bytes:
    return json.dumps(data).encode() + b"\n"


def _unix_socket() -> socket.socket:
    if not hasattr(socket, "AF_UNIX"):
        raise UsageError("the side channel needs unix sockets, which this system has not")
    return socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)


def _listen(path: Path) -> socket.socket:
    if len(os.fsencode(path)) > _MAX_PATH:
        raise UsageError(f"--control {path}: the path of a socket has at most {_MAX_PATH} bytes")
    _remove_stale(path)
    listener = _unix_socket()
    try:
        # Only this user may inject faults: the mask acts when the socket is bound.
        mask = os.umask(0o177)
        try:
            listener.bind(str(path))
        finally:
            os.umask(mask)
        listener.listen(_BACKLOG)
    except OSError as fault:
        listener.close()
        raise UsageError(f"--control {path}: cannot be made: {fault.strerror or fault}") from None
    return listener


def _remove_stale(path: Path) -> None:
    """Remove the socket of a killed process, and nothing else."""
    if not path.exists():
        return
    if not path.is_socket():
        raise UsageError(f"--control {path}: exists and is no socket")
    with _unix_socket() as probe:
        try:
            probe.connect(str(path))
        except OSError:
            path.unlink(missing_ok=True)
            return
    raise UsageError(f"--control {path}: another virtual drive listens there")


def _hang_up(end: socket.socket) -> None:
    # A socket that is not connected cannot be shut down; closing it is enough.
    with contextlib.suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)
    end.close()


class RemotePlant:
    """Gantry of a virtual drive in another process."""

    truth_columns: tuple[str, ...] = TRUTH_COLUMNS

    def __init__(self, channel: ControlClient) -> None:
        self._channel = channel
        self._true = self._values(channel.ask("truth"))
        self._asked = False

    def truth(self) -> tuple[float, ...]:
        """True state of load, motor and base: the last answer. A scan does not wait for a side channel."""
        # One request is under way at a time; a scan takes its answer when it is there.
        if not self._asked:
            self._channel.send("truth")
            self._asked = True
        elif (answer := self._channel.poll()) is not None:
            self._true = self._values(answer)
            self._asked = False
        return self._true

    def plant_state(self) -> dict[str, float]:
        """{}: the other process keeps its plant."""
        return {}

    def let_pass(self, seconds: float) -> None:
        """Let the time of a stepped drive go on."""
        while self._asked:
            self.truth()
        self._channel.ask("advance", s=seconds)

    def settle(self) -> None:
        """Nothing: the other process goes on by itself."""

    def release(self) -> None:
        """Close the side channel."""
        self._channel.close()

    def _values(self, answer: Mapping[str, float]) -> tuple[float, ...]:
        return tuple(float(answer[name]) for name in self.truth_columns)
