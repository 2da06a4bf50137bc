"""The WebSocket: status out, commands in, for as long as the session lives."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Final

from starlette.websockets import WebSocket, WebSocketDisconnect

from gantryctl.gateway.access import Access
from gantryctl.gateway.guard import address_of, deny, error
from gantryctl.gateway.places import Places
from gantryctl.gateway.sessions import Session
from gantryctl.gateway.settings import CONNECTIONS, CONNECTIONS_OF_USER, CONNECTIONS_REMOTE, UNUSED_S
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words
from gantryctl.service.clients.hub import Client, Flooded, Hub

SESSION_ENDED, TOO_SLOW, TOO_MANY, NOT_UNDERSTOOD = 4401, 4408, 4429, 1008
_STUCK_S: Final = 5.0
"""Time limit for sending; the connection is closed after it."""


class Live:
    """The WebSocket endpoint."""

    def __init__(self, access: Access, hub: Hub) -> None:
        self._access, self._hub = access, hub
        self._places = Places(CONNECTIONS, loopback=CONNECTIONS, remote=CONNECTIONS_REMOTE)

    async def serve(self, socket: WebSocket) -> None:
        """One connection from its handshake to its end."""
        session = self._access.session(socket)
        # Browsers send cookies with WebSockets of any page: without this another site could drive the gantry.
        origin = socket.headers.get("origin", "").lower()
        if origin not in self._access.settings.origins:
            await _deny(socket, 403, Code.SEC_04, Words.FOREIGN_PAGE)
            return
        if session is None:
            await _deny(socket, 401, Code.SEC_01, Words.LOG_IN_FIRST)
            return
        # 8 of one remote address, 64 of loopback, 16 of one user: a flood leaves room for the others.
        room = self._hub.make_room(session.user, CONNECTIONS_OF_USER, UNUSED_S)
        place = self._places.take(address_of(socket.scope)) if room else None
        if place is None:
            await _deny(socket, 429, Code.SEC_06, Words.TOO_MANY_CONNECTIONS)
            return
        try:
            await socket.accept()
            code = await self._run(socket, session)
        finally:
            # Not after the close, for which the other end may take its time: its user may connect again at once, and
            # with the places of those that are being closed one user would have all of them.
            place.leave()
        # The other end may be gone already, or take nothing more.
        if code is not None:
            with contextlib.suppress(RuntimeError, asyncio.TimeoutError, WebSocketDisconnect, OSError):
                await asyncio.wait_for(socket.close(code), 1.0)

    async def _run(self, socket: WebSocket, session: Session) -> int | None:
        """Both directions, until one of them ends; the close code, None when the other end has closed."""
        client = self._hub.connect(session.user, session.role, self._access.place(socket), session.person)
        self._log(client, "connected")
        both_ways = (self._receive(socket, client), self._send(socket, client, session))
        tasks = [asyncio.create_task(way) for way in both_ways]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            code = next((task.result() for task in done if task.exception() is None), None)
        finally:
            self._hub.leave(client)
            for task in tasks:
                task.cancel()
            self._log(client, "disconnected")
            # Nothing else holds them: one that is still on its way out would be taken apart by the garbage collector.
            await asyncio.gather(*tasks, return_exceptions=True)
        return code

    async def _receive(self, socket: WebSocket, client: Client) -> int | None:
        """Commands in; the close code, None when the other end has closed."""
        while True:
            message = await socket.receive()
            if message["type"] != "websocket.receive":
                return None
            text = message.get("text")
            if text is None:  # binary
                return NOT_UNDERSTOOD
            try:
                client.take(text)
            except Flooded:
                return TOO_MANY
            # What is there already is taken without a turn of the loop: a flood would hold up the Stop of another one.
            await asyncio.sleep(0)

    async def _send(self, socket: WebSocket, client: Client, session: Session) -> int | None:
        """Status and replies out; the close code."""
        await socket.send_text(self._hub.welcome(client.who))
        while True:
            await client.wake.wait()
            if client.displaced:
                return TOO_MANY
            session.used_s = max(session.used_s, client.used_s)
            if not self._access.sessions.lives(session):
                return SESSION_ENDED
            # A slow reader loses frames, never a reply: `outgoing` gives the newest frame only.
            for text in client.outgoing():
                try:
                    # Not `wait_for`: in Python 3.11 it drops a cancellation that comes as the sending ends, and this
                    # would wait on for news of a client that has left. A task, so that between two messages the loop
                    # has a turn: what is written to a connection that has ended is a line in the log each time.
                    async with asyncio.timeout(_STUCK_S):
                        await asyncio.create_task(socket.send_text(text))
                except TimeoutError:
                    return TOO_SLOW
                except (WebSocketDisconnect, RuntimeError, OSError):
                    return None

    def _log(self, client: Client, text: str) -> None:
        self._hub.logins.put(text, client.who)


async def _deny(socket: WebSocket, status: int, code: Code, reason: Words) -> None:
    await deny(socket.scope, socket.receive, socket.send, error(status, refusal(code, reason=reason)))
