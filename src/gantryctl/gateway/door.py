"""Accepts connections: counted by address before anything is spent on them, TLS with a time limit."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import time
from typing import Any, Final

import uvicorn

from gantryctl.gateway.places import Place, Places
from gantryctl.gateway.settings import CONNECTIONS, CONNECTIONS_REMOTE, HEADER_S, STUCK_S

WAITING: Final = 4 * CONNECTIONS
"""HTTP connections of all addresses together."""
_PAUSE_S: Final = 0.2
"""Pause after a failed accept: no handles, no memory."""
_QUIET_S: Final = 60.0
"""Time between two lines in the log about that."""
_LOG: Final = logging.getLogger("uvicorn.error")


class Door(uvicorn.Server):
    """uvicorn with another way of accepting connections: its `http_protocol_class` is called with `place` too."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self._places = Places(WAITING, loopback=CONNECTIONS, remote=CONNECTIONS_REMOTE)
        self._tasks: set[asyncio.Task[None]] = set()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start the application, then take connections."""
        # uvicorn would accept and start TLS without any limit by address.
        await super().startup(sockets=[])
        for listener in sockets or []:
            listener.setblocking(False)
            self._keep(self._take(listener))
        self._keep(self._tidy())

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Take no more connections, then end."""
        for task in self._tasks:
            task.cancel()
        await super().shutdown(sockets)

    def _keep(self, work: Any) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _take(self, listener: socket.socket) -> None:
        loop, said_s = asyncio.get_running_loop(), -_QUIET_S
        while True:
            try:
                connection, peer = await loop.sock_accept(listener)
            except ConnectionError:  # the client has left the queue of the kernel
                continue
            except (OSError, MemoryError) as fault:
                # Without handles every attempt fails at once: pause, and no line in the log for each.
                if time.monotonic() - said_s >= _QUIET_S:
                    said_s = time.monotonic()
                    _LOG.warning("no connection can be taken: %s", fault)
                await asyncio.sleep(_PAUSE_S)
                continue
            place = self._places.take(str(peer[0]))
            if place is None:
                connection.close()
            else:
                self._keep(self._greet(connection, place))
            # A storm of connections must leave the loop to those that are open.
            await asyncio.sleep(0)

    async def _tidy(self) -> None:
        """End connections that are closed but for answers that nobody takes."""
        # asyncio keeps them until the last byte is gone, and uvicorn waits for that.
        closing: dict[Any, float] = {}
        while True:
            now_s, found = time.monotonic(), [*self.server_state.connections]
            closing = {each: closing.get(each, now_s) for each in found if each.transport.is_closing()}
            for each, since_s in closing.items():
                if now_s - since_s > STUCK_S:
                    each.transport.abort()
            await asyncio.sleep(STUCK_S / 5)

    async def _greet(self, connection: socket.socket, place: Place) -> None:
        """TLS, then HTTP; a connection that does not get so far is closed."""
        config, limits = self.config, {}
        if config.ssl is not None:
            limits = {"ssl_handshake_timeout": HEADER_S, "ssl_shutdown_timeout": HEADER_S}

        def protocol() -> Any:
            made: Any = config.http_protocol_class
            return made(
                config=config, server_state=self.server_state, app_state=self.lifespan.state, place=place
            )

        with contextlib.ExitStack() as failed:
            failed.callback(place.leave)
            failed.callback(connection.close)
            with contextlib.suppress(OSError):
                await asyncio.get_running_loop().connect_accepted_socket(
                    protocol, connection, ssl=config.ssl, **limits
                )
                failed.pop_all()
