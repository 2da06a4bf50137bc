"""The HTTP server around the application: limits that only it can keep."""

from __future__ import annotations

import asyncio
import logging
import resource
import socket
from collections.abc import Callable
from typing import Any, Final

import h11
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from gantryctl.gateway.door import WAITING, Door
from gantryctl.gateway.guard import Guard
from gantryctl.gateway.live import TOO_MANY
from gantryctl.gateway.places import Place
from gantryctl.gateway.settings import HEADER_S, STUCK_S, Settings
from gantryctl.service.protocol.limits import FLOOD_PER_S, MESSAGE_MAX, RateLimiter

HANDLES: Final = 4096
"""Open files: connections, WebSockets, recordings, and a reserve."""
FRAMES_PER_S: Final = 2.0 * FLOOD_PER_S
"""Frames of any kind of one WebSocket: its messages, which have a limit of their own, and as many pings and pongs."""
_PIECE: Final = 2048
"""Bytes of a WebSocket that are taken apart at a time: 340 of the smallest frames, some 5 ms."""
_LEAVE_S: Final = 1.0
"""Time in which who is closed for a flood may read why."""
# What any client can cause, also without a login, must not fill a log line by line; errors of the program stay.
_LOG: Final = logging.getLogger("uvicorn.error.clients")
# A filter, because uvicorn resets the levels of loggers below its own.
_LOG.addFilter(lambda said: said.levelno >= logging.ERROR and not str(said.msg).startswith("Invalid UTF-8"))


class PatientProtocol(H11Protocol):
    """HTTP with a time limit for every request, from its first byte to the last one of its body, and for every answer.

    Args:
        place: given back when the connection ends or becomes a WebSocket, which has limits of its own.
    """

    def __init__(self, *, place: Place, **uvicorns: Any) -> None:
        super().__init__(**uvicorns)
        self.logger = _LOG
        self._place = place
        self._patience: asyncio.TimerHandle | None = None
        self._stuck: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # uvicorn narrows it too
        """A new connection; closed when it asks for nothing in time."""
        super().connection_made(transport)
        # asyncio reads up to 256 KiB at once: thousands of small frames of a WebSocket, all of them before anybody
        # else has a turn.
        read: Any = transport
        read.max_size = MESSAGE_MAX
        self._watch()

    def data_received(self, data: bytes) -> None:
        """The time of a next request begins with its first byte."""
        asked: Any = self.cycle  # None before the first request
        if asked is not None and self.conn.their_state is h11.IDLE and not self.conn.trailing_data[0]:
            self._rest()
        super().data_received(data)

    def handle_events(self) -> None:
        """Stop the time limit when the request is whole."""
        super().handle_events()
        asked: Any = self.cycle
        more = self.conn.their_state is h11.DONE and self.conn.trailing_data[0]
        if more and asked is not None and not asked.response_complete:
            # Requests before the answer to the last one could wait here without end, and their answers after them.
            asked.keep_alive = False
        self._watch()

    def on_response_complete(self) -> None:
        """Idle until the next request."""
        super().on_response_complete()
        self._watch()

    def send_400_response(self, msg: str) -> None:
        """Refuse what is no HTTP; where an answer has begun already, there is no other one, and the connection ends."""
        # uvicorn would fail, with dozens of lines in the log for each: at a second answer from here, and at that of the
        # application, which does not know of this one.
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            super().send_400_response(msg)
        else:
            self.transport.close()
        asked: Any = self.cycle
        if asked is not None:
            asked.disconnected = True
            asked.message_event.set()

    def pause_writing(self) -> None:
        """The client takes no more of the answer; it has some time to go on."""
        super().pause_writing()
        self._stuck = self._stuck or self.loop.call_later(STUCK_S, self.transport.abort)

    def resume_writing(self) -> None:
        """It has gone on."""
        super().resume_writing()
        self._unstick()

    def handle_websocket_upgrade(self, event: Any) -> None:
        """Hand over to the WebSocket, which has limits of its own."""
        self._place.leave()
        super().handle_websocket_upgrade(event)

    def connection_lost(self, exc: Exception | None) -> None:
        """The connection has ended."""
        self._rest()
        self._place.leave()
        super().connection_lost(exc)
        self._unstick()

    def _watch(self) -> None:
        # A client that sends a byte a minute would hold its place for hours (slow loris).
        missing = self.conn.their_state in (h11.IDLE, h11.SEND_BODY)
        if not missing or not self._place.mine or self.transport.is_closing():
            self._rest()
            self._place.work()
            return
        if self._place.idle is None:
            self._place.rest(self.transport.abort)
        if self._patience is None:
            self._patience = self.loop.call_later(HEADER_S, self.transport.abort)

    def _rest(self) -> None:
        if self._patience is not None:
            self._patience.cancel()
            self._patience = None

    def _unstick(self) -> None:
        if self._stuck is not None:
            self._stuck.cancel()
            self._stuck = None


class QuietWebSocket(WebSocketsSansIOProtocol):
    """A WebSocket that is refused with an HTTP status, without a line in the log for each, and closed when it floods.

    The application sees messages only. Pings, pongs and parts of messages cost as much time, and so does what comes
    after the close.
    """

    def __init__(self, *arguments: Any, **uvicorns: Any) -> None:
        super().__init__(*arguments, **uvicorns)
        self.logger = _LOG
        self._frames, self._flooded = RateLimiter(FRAMES_PER_S), False

    def data_received(self, data: bytes) -> None:
        """Take frames up to the limit; what comes after it is thrown away."""
        # With TLS 256 KiB come at once: 40 000 pings, half a second in which nobody else has a turn.
        for at in range(0, len(data), _PIECE):
            if self._flooded:
                return
            super().data_received(data[at : at + _PIECE])

    def handle_events(self) -> None:
        """Count the frames before they are acted on."""
        if any(self._frames.wait_s() > 0.0 for _ in self.conn.events):
            self._end_flood()
        else:
            super().handle_events()

    def _end_flood(self) -> None:
        """Say why, and leave; the application is told at once, for control ends with the connection."""
        self._flooded = True
        self.stop_keepalive()
        if not self.handshake_complete:
            self.transport.abort()
            return
        self.conn.fail(TOO_MANY)
        self.transport.write(b"".join(self.conn.data_to_send()))
        self.close_sent = True
        self.queue.put_nowait({"type": "websocket.disconnect", "code": TOO_MANY})
        if self.close_timer is not None:
            self.close_timer.cancel()
        self.close_timer = self.loop.call_later(_LEAVE_S, self.transport.abort)

    async def send(self, message: Any) -> None:
        """Mark the handshake as complete after a refusal."""
        # uvicorn would log "ASGI callable returned without completing handshake" as an error for each refusal.
        await super().send(message)
        if message["type"] == "websocket.http.response.body" and not message.get("more_body", False):
            self.handshake_complete = True


def run_server(app: Guard, settings: Settings) -> None:
    """Serve on the listening socket of the supervisor until the end signal."""
    # The supervisor keeps the socket: a gateway that restarts misses no connection (decision 0011).
    raise_handles()
    listener = socket.socket(fileno=settings.listener)
    asyncio.run(make_server(app, settings, app.session_of).serve(sockets=[listener]))


def raise_handles() -> None:
    """Raise the limit of open files to what all connections need, as far as the system allows."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = HANDLES if hard == resource.RLIM_INFINITY else min(HANDLES, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


def make_server(app: Any, settings: Settings, session_of: Callable[[bytes], str] = lambda _: "") -> Door:
    """Configure the server with all its limits; `session_of` see `Door`."""
    config = uvicorn.Config(
        app,
        http=PatientProtocol,
        ws=QuietWebSocket,
        ws_max_size=MESSAGE_MAX,
        ws_ping_interval=5.0,
        ws_ping_timeout=5.0,
        # Frames are small and many; compression would cost a processor that the scan needs.
        ws_per_message_deflate=False,
        limit_concurrency=WAITING,
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
    return Door(config, session_of)
