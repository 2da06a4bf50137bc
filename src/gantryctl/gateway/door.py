"""Where connections come in: counted for each address before anything is done for them, TLS with a time limit."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import time
from collections import Counter
from typing import Any, Final

import uvicorn

from gantryctl.gateway.settings import (
    CONNECTIONS,
    CONNECTIONS_REMOTE,
    HEADER_S,
    is_loopback,
    neighbourhood,
)

WAITING: Final = 4 * CONNECTIONS
"""Connections of all addresses that are no WebSockets."""
_PAUSE_S: Final = 0.2
"""After a connection that could not be taken: no handles, no memory."""
_QUIET_S: Final = 60.0
"""Between two lines in the log about that."""
_LOG: Final = logging.getLogger("uvicorn.error")


class Places:
    """Places for connections, so many for each address."""

    def __init__(self) -> None:
        self._taken: Counter[str] = Counter()

    def take(self, address: str) -> Place | None:
        """A place, or None when there is none for this address."""
        key = neighbourhood(address)
        most = CONNECTIONS if is_loopback(address) else CONNECTIONS_REMOTE
        if self._taken[key] >= most or self._taken.total() >= WAITING:
            return None
        self._taken[key] += 1
        return Place(self._taken, key)


class Place:
    """One connection's place, given back once.

    Attributes:
        mine: it was not given back yet.
    """

    def __init__(self, taken: Counter[str], key: str) -> None:
        self._taken, self._key, self.mine = taken, key, True

    def leave(self) -> None:
        """Somebody else may have it."""
        if self.mine:
            self.mine = False
            self._taken[self._key] -= 1
            if not self._taken[self._key]:
                del self._taken[self._key]


class Door(uvicorn.Server):
    """uvicorn with its own way of taking connections: its `http_protocol_class` is called with `place` too."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self._places = Places()
        self._tasks: set[asyncio.Task[None]] = set()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start the application, then take connections."""
        await super().startup(sockets=[])
        for listener in sockets or []:
            listener.setblocking(False)
            self._keep(self._take(listener))

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
            except ConnectionError:
                continue  # it has gone while it waited
            except (OSError, MemoryError) as fault:
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
            await asyncio.sleep(0)  # a storm of connections leaves room for the others

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
