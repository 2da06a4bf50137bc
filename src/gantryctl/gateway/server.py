"""The HTTP server around the application: limits that only it can keep."""

from __future__ import annotations

import asyncio
import socket
from typing import Any, ClassVar

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from gantryctl.gateway.settings import CONNECTIONS, CONNECTIONS_REMOTE, HEADER_S, Settings, is_loopback
from gantryctl.service.messages import MESSAGE_MAX


class PatientProtocol(H11Protocol):
    """HTTP with a time limit for the first request and a limit of connections for each address."""

    _of_address: ClassVar[dict[str, int]] = {}
    """Connections of each address: one table for all."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """A new connection; closed when it asks for nothing in time."""
        super().connection_made(transport)
        peer: Any = transport.get_extra_info("peername")
        self._address = str(peer[0]) if peer else ""
        self._counted = True
        table = self._of_address
        table[self._address] = table.get(self._address, 0) + 1
        most = CONNECTIONS if is_loopback(self._address) else CONNECTIONS_REMOTE
        self._patience: asyncio.TimerHandle | None = None
        if table[self._address] > most:
            transport.close()
            return
        self._patience = self.loop.call_later(HEADER_S, self._too_late)

    def handle_events(self) -> None:
        """The time limit ends with the first whole request."""
        super().handle_events()
        if self._asked and self._patience is not None:
            self._patience.cancel()
            self._patience = None

    def handle_websocket_upgrade(self, event: Any) -> None:
        """From here on it is a WebSocket, which has limits of its own."""
        if self._patience is not None:
            self._patience.cancel()
        self._leave()
        super().handle_websocket_upgrade(event)

    def connection_lost(self, exc: Exception | None) -> None:
        """The connection has ended."""
        if self._patience is not None:
            self._patience.cancel()
        self._leave()
        super().connection_lost(exc)

    def _leave(self) -> None:
        if self._counted:
            self._counted = False
            self._of_address[self._address] -= 1
            if not self._of_address[self._address]:
                del self._of_address[self._address]

    def _too_late(self) -> None:
        if not self._asked and not self.transport.is_closing():
            self.transport.close()

    @property
    def _asked(self) -> bool:
        """A whole request has come."""
        found: Any = self.cycle
        return found is not None


def run_server(app: Any, settings: Settings) -> None:
    """Serve on the listening socket that the supervisor has made, until told to end."""
    listener = socket.socket(fileno=settings.listener)
    config = uvicorn.Config(
        app,
        http=PatientProtocol,
        ws="websockets-sansio",
        ws_max_size=MESSAGE_MAX,
        ws_ping_interval=5.0,
        ws_ping_timeout=5.0,
        ws_per_message_deflate=False,
        limit_concurrency=4 * CONNECTIONS,
        timeout_keep_alive=5,
        timeout_graceful_shutdown=2,
        h11_max_incomplete_event_size=16 * 1024,
        ssl_certfile=settings.certificate,
        ssl_keyfile=settings.key,
        server_header=False,
        proxy_headers=False,
        access_log=False,
        log_level="warning",
        lifespan="on",
    )
    asyncio.run(uvicorn.Server(config).serve(sockets=[listener]))
