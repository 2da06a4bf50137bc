"""Serves an instrument of this process over the line protocol, one answer at a time."""

from __future__ import annotations

import contextlib
import socketserver
import threading
from collections.abc import Callable
from typing import Final

from gantryctl.engineering.instruments.line_port import LINE_MAX, answer_line
from gantryctl.engineering.instruments.port import Instrument
from gantryctl.errors import UsageError

_LOOK_S: Final = 0.1


class _Server(socketserver.ThreadingTCPServer):
    # A port that was served a minute ago is free again.
    allow_reuse_address = True
    daemon_threads = True


class LineServer:
    """Server of an instrument, as a context manager.

    Args:
        instrument: asked by one client at a time.
        clock: time of the axis, s.
        host, port: where it listens; port 0 takes a free one.

    Raises:
        UsageError: it cannot listen there.
    """

    def __init__(
        self, instrument: Instrument, clock: Callable[[], float], host: str = "127.0.0.1", port: int = 0
    ) -> None:
        lock = threading.Lock()

        class Client(socketserver.StreamRequestHandler):
            """One client."""

            def handle(self) -> None:
                # A client that goes away has its reason: the next one is served.
                with contextlib.suppress(OSError):
                    while line := self.rfile.readline(LINE_MAX):
                        with lock:
                            answer = answer_line(instrument, line.decode("ascii", "replace"), clock())
                        self.wfile.write(f"{answer}\n".encode())

        try:
            self._server = _Server((host, port), Client)
        except OSError as fault:
            raise UsageError(f"port {host}:{port}: cannot listen: {fault.strerror or fault}") from None
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(_LOOK_S,), name="instrument", daemon=True
        )

    @property
    def port(self) -> int:
        """TCP port that it listens on."""
        return int(self._server.server_address[1])

    def __enter__(self) -> LineServer:
        self._thread.start()
        return self

    def __exit__(self, *_raised: object) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()
