"""Connections of OPC UA: counted by address, cut into chunks of bounded length, closed when they are of no use."""

from __future__ import annotations

import asyncio
import struct
import time
from collections import Counter, deque
from typing import Any, Final

from asyncua import ua
from asyncua.ua.ua_binary import header_from_binary, uatcp_to_binary

from gantryctl.gateway.opcua.channel import Channel, ChannelRefused, Wall
from gantryctl.gateway.opcua.reading import Bounded
from gantryctl.gateway.places import Place, Places
from gantryctl.gateway.settings import neighbourhood

CONNECTIONS: Final = 32
CONNECTIONS_LOOPBACK: Final = 16
CONNECTIONS_REMOTE: Final = 4
"""Of one address."""
LOGIN_S: Final = 5.0
"""Time without a session that is logged in; the connection is closed after it."""
STUCK_S: Final = 5.0
"""Time in which a client takes nothing of what waits for it; the connection is closed after it."""
_CHUNK: Final = struct.Struct("<3scI")
_KINDS: Final = {b"HEL": b"F", b"OPN": b"F", b"CLO": b"F", b"MSG": b"FCA"}
_WAITING: Final = 32
"""Chunks that wait for their turn; no more are read then."""
_OUT_MAX: Final = 2**20
"""Bytes that wait for a client before its next request is looked at."""


class Connection(asyncio.Protocol):
    """One TCP connection."""

    def __init__(self, listener: Listener) -> None:
        self._listener = listener
        self._data = bytearray()
        self._chunks: deque[bytes] = deque()
        self._arrived, self._writable = asyncio.Event(), asyncio.Event()
        self._writable.set()
        self._work: asyncio.Task[None] | None = None
        self._place: Place | None = None
        self.idle_s = time.monotonic()
        self.stuck_s: float | None = None

    def connection_made(self, transport: Any) -> None:
        """Take a place, or leave at once."""
        self.transport = transport
        peer = transport.get_extra_info("peername")
        self.address = str(peer[0]) if peer else ""
        self._place = self._listener.places.take(self.address)
        if self._place is None:
            transport.abort()
            return
        transport.set_write_buffer_limits(_OUT_MAX)
        self.channel = Channel(self._listener.wall, transport, self.address)
        self._listener.connections.add(self)
        self._work = asyncio.create_task(self._run())

    def connection_lost(self, _: Exception | None) -> None:
        """Give the place back; the sessions end with their connection."""
        if self._place is None:
            return
        self._place.leave()
        self._listener.connections.discard(self)
        if self._work is not None:
            self._work.cancel()
        self._listener.keep(self.channel.end())

    def data_received(self, data: bytes) -> None:
        """Cut chunks; a length that nobody announced here ends the connection before it is read."""
        if self._place is None:
            return
        self._data += data
        while len(self._data) >= _CHUNK.size:
            kind, part, size = _CHUNK.unpack_from(self._data)
            if part not in _KINDS.get(kind, b""):
                return self.refuse(ua.StatusCodes.BadTcpMessageTypeInvalid)
            if not _CHUNK.size < size <= self._listener.wall.limits.max_recv_buffer:
                return self.refuse(ua.StatusCodes.BadTcpMessageTooLarge)
            if len(self._data) < size:
                break
            self._chunks.append(bytes(self._data[:size]))
            del self._data[:size]
            self._arrived.set()
        if len(self._chunks) > _WAITING:
            self.transport.pause_reading()

    def pause_writing(self) -> None:
        """Look at no further request while the client takes no answers."""
        self._writable.clear()
        self.stuck_s = time.monotonic()

    def resume_writing(self) -> None:
        """Go on."""
        self._writable.set()
        self.stuck_s = None

    async def _run(self) -> None:
        while True:
            await self._arrived.wait()
            await self._writable.wait()
            chunk = Bounded(self._chunks.popleft())
            if not self._chunks:
                self._arrived.clear()
            if len(self._chunks) <= _WAITING // 2 and not self.transport.is_closing():
                self.transport.resume_reading()
            try:
                if not await self.channel.take(header_from_binary(chunk), chunk):
                    self.transport.close()
                    return
            except ChannelRefused as refused:
                return self.refuse(refused.status, refused.journal)
            except Exception:  # a chunk that cannot be decoded
                return self.refuse(ua.StatusCodes.BadDecodingError)
            # One client after the other.
            await asyncio.sleep(0)

    def refuse(self, status: int, journal: str = "") -> None:
        """Say why, and close."""
        if journal:
            self._listener.journal(self.address, journal)
        if not self.transport.is_closing():
            error = ua.ErrorMessage(ua.StatusCode(status), "")
            self.transport.write(uatcp_to_binary(ua.MessageType.Error, error))
            self.transport.close()


class Listener:
    """All connections; use it as an asynchronous context manager.

    Attributes:
        connections: that are open.
    """

    def __init__(self, wall: Wall, host: str, port: int) -> None:
        self.wall, self._host, self._port = wall, host, port
        self.places = Places(CONNECTIONS, loopback=CONNECTIONS_LOOPBACK, remote=CONNECTIONS_REMOTE)
        self.connections: set[Connection] = set()
        self._refused: Counter[str] = Counter()
        self._tasks: set[asyncio.Task[None]] = set()

    async def __aenter__(self) -> Listener:
        await self.wall.internal.start()
        make = asyncio.get_running_loop().create_server
        self._server = await make(lambda: Connection(self), self._host, self._port)
        return self

    async def __aexit__(self, *_: object) -> None:
        self._server.close()
        for connection in list(self.connections):
            connection.transport.abort()
        await asyncio.sleep(0)
        await asyncio.gather(*self._tasks)
        await self.wall.internal.stop()

    def keep(self, work: Any) -> None:
        """Hold a task until it is done."""
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def journal(self, address: str, why: str) -> None:
        """Count a refused channel."""
        key = neighbourhood(address)
        if key not in self._refused and len(self._refused) >= 1000:
            self._refused.clear()
        self._refused[key] += 1
        self.wall.people.refused(address, self._refused[key], why)

    async def sweep(self) -> None:
        """Close connections of clients and users that are trusted no more, and those that hold a place for nothing."""
        self.wall.trust.refresh()
        users, now_s = self.wall.people.all(), time.monotonic()
        for each in list(self.connections):
            readers = each.channel.readers
            why = each.channel.lapsed(users)
            if readers:
                each.idle_s = now_s
            if why:
                for reader in readers:
                    self.wall.people.ended(reader, why)
            stuck = each.stuck_s is not None and now_s - each.stuck_s > STUCK_S
            if why:
                await each.channel.end()
                each.refuse(ua.StatusCodes.BadSecureChannelClosed)
            elif stuck or now_s - each.idle_s > LOGIN_S:
                each.transport.abort()
