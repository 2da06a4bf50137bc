"""The local socket: commands from the command line of this machine.

JSON lines with the messages of the WebSocket. The first line from the client is `{"watch": true}` or
`{"watch": false}`: with status frames or without. `{"console": true}` is answered by `{"link": ADDRESS}`, and ends it.
"""

from __future__ import annotations

import asyncio
import contextlib
import grp
import json
import os
import pwd
import socket
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Final

from gantryctl.errors import StateError
from gantryctl.operation.store import SERVICE_SOCKET, PeerName
from gantryctl.service.clients.console_link import LinkGiver
from gantryctl.service.clients.hub import Client, Flooded, Hub
from gantryctl.service.protocol.limits import MESSAGE_MAX
from gantryctl.service.protocol.messages import compact
from gantryctl.service.protocol.roles import Role

GROUP: Final = "gantry"
_CREDENTIALS: Final = struct.Struct("3i")
_CONNECTIONS: Final = 64
_CONNECTIONS_OF_USER: Final = 16
_UNUSED_S: Final = 5.0
"""Time without a command, after which a connection makes room for another one of its user."""
_SEND_S: Final = 5.0
_IDLE_S: Final = 60.0
"""Time without a message of a connection that does not watch; it is closed after it."""


class LocalServer:
    """Serves the local socket of one machine.

    Args:
        directory: the machine's state directory.
        hub: of the source LOCAL.
        person: whose account it is that the system names, "" where nobody knows.
        links: open the page as the console of this machine.
    """

    def __init__(self, directory: Path, hub: Hub, person: Callable[[str], str], links: LinkGiver) -> None:
        self._directory, self._hub, self._person, self._links = directory, hub, person, links
        self._server: asyncio.Server | None = None

    async def start(self) -> None:
        """Listen; StateError if the socket cannot be made."""
        path = self._directory / SERVICE_SOCKET
        made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            # The state directory is locked by this service's controller: a socket that is there is a left-over.
            path.unlink(missing_ok=True)
            with PeerName(self._directory) as address:
                made.bind(address)
            path.chmod(0o600)
            # 0660 for the group, 0600 where the system has no such group or this user is not in it.
            with contextlib.suppress(KeyError, PermissionError):
                os.chown(path, -1, grp.getgrnam(GROUP).gr_gid)
                path.chmod(0o660)
        except OSError as fault:
            made.close()
            raise StateError(f"{path}: {fault.strerror or fault}") from fault
        self._server = await asyncio.start_unix_server(self._serve, sock=made, limit=MESSAGE_MAX)

    def close(self) -> None:
        """Take no more connections."""
        if self._server is not None:
            self._server.close()
        (self._directory / SERVICE_SOCKET).unlink(missing_ok=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        uid, user, role = peer(writer.get_extra_info("socket"))
        # One that was unused for longest makes room, so nobody holds all places of his user, nor those of others.
        if len(self._hub) >= _CONNECTIONS or not self._hub.make_room(user, _CONNECTIONS_OF_USER, _UNUSED_S):
            writer.close()
            return
        client = self._hub.connect(user, role, "local", self._person(user))
        self._hub.logins.put(f"{user} at the local socket", client.who)
        sender: asyncio.Task[None] | None = None
        try:
            first = json.loads(await asyncio.wait_for(reader.readline(), _SEND_S))
            if isinstance(first, dict) and first.get("console") is True:
                self._hub.logins.put("asked for a link to the page as the console", client.who)
                writer.write(compact({"link": self._links.give(uid)}).encode() + b"\n")
                return
            watch = isinstance(first, dict) and first.get("watch") is True
            sender = asyncio.create_task(self._send(client, writer, watch=watch))
            while line := await asyncio.wait_for(reader.readline(), None if watch else _IDLE_S):
                client.take(line)
        except (TimeoutError, ConnectionError, ValueError, RecursionError, Flooded, asyncio.CancelledError):
            pass  # all of them end the connection
        finally:
            self._hub.leave(client)
            writer.close()
            # The last replies have some time; who does not read them keeps no handle for longer.
            asyncio.get_running_loop().call_later(_SEND_S, writer.transport.abort)
            if sender is not None:
                sender.cancel()
                # Nothing else holds it: on its way out it would be taken apart by the garbage collector.
                await asyncio.gather(sender, return_exceptions=True)

    async def _send(self, client: Client, writer: asyncio.StreamWriter, *, watch: bool) -> None:
        writer.write(self._hub.welcome(client.who).encode() + b"\n")
        while True:
            await client.wake.wait()
            if client.displaced:
                writer.transport.abort()
                return
            for text in client.outgoing():
                # What is written to a connection that has ended is a line in the log each time.
                if writer.transport.is_closing():
                    return
                if watch or '"type":"status"' not in text[:20]:
                    writer.write(text.encode() + b"\n")
            try:
                # Not `wait_for`: in Python 3.11 it may drop the cancellation, and this would wait without end.
                async with asyncio.timeout(_SEND_S):
                    await writer.drain()
            except (TimeoutError, ConnectionError):
                # What nobody reads must not keep the connection.
                writer.transport.abort()
                return


def peer(connection: socket.socket) -> tuple[int, str, Role]:
    """Ask the system for user number, name and role of the process at the other end."""
    # The service's own user and root have the service role, everybody else who may open the socket is an operator.
    found = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    _, uid, _ = _CREDENTIALS.unpack(found)
    try:
        name = pwd.getpwuid(uid).pw_name
    except KeyError:
        name = f"uid {uid}"
    return uid, name, Role.SERVICE if uid in (0, os.getuid()) else Role.OPERATOR
