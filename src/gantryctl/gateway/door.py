"""Accepts connections: counted by address before anything is spent on them, TLS with a time limit."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import time
from collections.abc import Callable
from functools import partial
from typing import Any, Final

import uvicorn

from gantryctl.gateway.peers import peer_of
from gantryctl.gateway.places import Place, Places, Waiting
from gantryctl.gateway.settings import CONNECTIONS, CONNECTIONS_REMOTE, HEADER_S, STUCK_S

WAITING: Final = 4 * CONNECTIONS
"""HTTP connections of all addresses together."""
ARRIVALS: Final = 1024
"""Connections that wait for one of these places."""
_TOGETHER: Final = 16
"""Connections that are accepted in one turn of the loop: 0.03 ms each, a request takes a millisecond."""
_HEAD: Final = 4096
"""Bytes of a request that are looked at for its session; they stay in the kernel."""
_PAUSE_S: Final = 0.2
"""Pause after a failed accept: no handles, no memory."""
_QUIET_S: Final = 60.0
"""Time between two lines in the log about that."""
_LOG: Final = logging.getLogger("uvicorn.error")


class Door(uvicorn.Server):
    """uvicorn with another way of accepting connections: its `http_protocol_class` is called with `place` too.

    Args:
        session_of: key of the session that the first bytes of a connection name, "" for none.
    """

    def __init__(self, config: uvicorn.Config, session_of: Callable[[bytes], str] = lambda _: "") -> None:
        super().__init__(config)
        self._session_of = session_of
        self._places = Places(WAITING, loopback=CONNECTIONS, remote=CONNECTIONS_REMOTE)
        self._arrivals: list[tuple[socket.socket, tuple[Any, ...]]] = []
        self._waiting, self._arrived = Waiting(ARRIVALS, HEADER_S), asyncio.Event()
        self._tasks: set[asyncio.Task[None]] = set()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start the application, then take connections."""
        # uvicorn would accept and start TLS without any limit by address.
        await super().startup(sockets=[])
        for listener in sockets or []:
            listener.setblocking(False)
            self._keep(self._take(listener))
        self._keep(self._let_in())
        self._keep(self._tidy())

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Take no more connections, then end."""
        for task in self._tasks:
            task.cancel()
        self._sort()
        self._waiting.close()
        await super().shutdown(sockets)

    def _keep(self, work: Any) -> asyncio.Task[None]:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def _take(self, listener: socket.socket) -> None:
        """Accept what the kernel has, in its order, before anything is spent on one of them."""
        loop, said_s = asyncio.get_running_loop(), -_QUIET_S
        while True:
            try:
                self._add(*await loop.sock_accept(listener))
                for _ in range(_TOGETHER - 1):
                    self._add(*listener.accept())
            except BlockingIOError:  # no more for now
                pass
            except ConnectionError:  # the client has left the queue of the kernel
                continue
            except (OSError, MemoryError) as fault:
                # Without handles every attempt fails at once: pause, and no line in the log for each.
                if time.monotonic() - said_s >= _QUIET_S:
                    said_s = time.monotonic()
                    _LOG.warning("no connection can be taken: %s", fault)
                await asyncio.sleep(_PAUSE_S)
                continue
            # A storm of connections must leave the loop to those that are open.
            await asyncio.sleep(0)

    def _add(self, connection: socket.socket, peer: tuple[Any, ...]) -> None:
        connection.setblocking(False)
        self._arrivals.append((connection, peer))
        self._arrived.set()

    def _sort(self) -> None:
        """Find out whose the arrivals are; their requests have had the time of a turn to arrive."""
        arrivals, self._arrivals = self._arrivals, []
        for connection, peer in arrivals:
            try:
                self._waiting.add(connection, str(peer[0]), self._party(connection, peer))
            except (
                Exception
            ):  # gone, or nothing left to take it with: whatever it is, the door stays open for others
                connection.close()

    def _party(self, connection: socket.socket, peer: tuple[Any, ...]) -> str:
        head = b""
        with contextlib.suppress(BlockingIOError):  # nothing there yet
            head = connection.recv(_HEAD, socket.MSG_PEEK)
        ends = {"client": peer[:2], "server": connection.getsockname()[:2]}
        return self._session_of(head) or peer_of(ends)

    async def _let_in(self) -> None:
        """Give places to those that wait, one in a turn of the loop."""
        while True:
            self._sort()
            found = self._waiting.next()
            if found is None:
                self._arrived.clear()
                await self._arrived.wait()
                continue
            try:
                place = self._places.take(found.address)
                if place is None:
                    found.connection.close()
                else:
                    task = self._keep(self._greet(found.connection, place))
                    # One that is cancelled before its first step closes nothing.
                    task.add_done_callback(partial(_close_cancelled, found.connection))
            except MemoryError:
                found.connection.close()
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


def _close_cancelled(connection: socket.socket, task: asyncio.Task[None]) -> None:
    if task.cancelled():
        connection.close()
