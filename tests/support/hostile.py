"""A process of rude clients: each opens a connection, does what its kind does, and comes again when it is ended.

    python hostile.py PORT COUNT HOST_HEADER [--session COOKIE] [--file PATH] [--uid N] [--kinds NAME ...]

Without a session they only hold connections: nothing, half a request, a whole one and then nothing. With one they do
all that `KINDS` has, and with `--uid` as another user of the system, which only root may.
"""

from __future__ import annotations

import argparse
import asyncio
import base64
import os
import resource
import socket
from collections.abc import Callable, Coroutine, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

AGAIN_S = 0.2
"""From the end of a connection to the next one of the same client."""
HELD_S = 10.0
"""A client that never reads cannot see that it was ended: after this time it comes again."""
MESSAGES = 1000
"""Of a client that floods its WebSocket, for one connection; 200 a second are too many."""


class Door(NamedTuple):
    """Where the service is, a session for those that have one, and the largest file of its page."""

    port: int
    host: str
    session: str
    file: str

    async def open(self, receive_bytes: int = 0) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """A connection, with a small buffer for who will not read."""
        made = socket.socket()
        if receive_bytes:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
        made.setblocking(False)
        try:
            await asyncio.get_running_loop().sock_connect(made, ("127.0.0.1", self.port))
        except BaseException:
            made.close()
            raise
        return await asyncio.open_connection(sock=made, limit=receive_bytes or 2**16)

    def request(self, line: str, body: str = "", *headers: str) -> bytes:
        """Text of a request."""
        length = [f"Content-Length: {len(body)}", "Content-Type: application/json"] if body else []
        return "\r\n".join([f"{line} HTTP/1.1", f"Host: {self.host}", *length, *headers, "", body]).encode()

    def handshake(self, session: str) -> bytes:
        """Text that asks for a WebSocket."""
        key = base64.b64encode(os.urandom(16)).decode()
        return self.request(
            "GET /api/v1/socket",
            "",
            f"Origin: http://{self.host}",
            "Upgrade: websocket",
            "Connection: Upgrade",
            "Sec-WebSocket-Version: 13",
            f"Sec-WebSocket-Key: {key}",
            f"Cookie: __Host-gantryctl_session={session}",
        )


Kind = Callable[[Door], Coroutine[Any, Any, None]]


def holds(text: Callable[[Door], bytes]) -> Kind:
    """Says something, and nothing more; takes whatever comes."""

    async def kind(door: Door) -> None:
        reader, writer = await door.open()
        writer.write(text(door))
        while await reader.read(65536):
            pass
        writer.close()

    return kind


def repeats(text: Callable[[Door], bytes]) -> Kind:
    """Asks again as soon as anything is answered."""

    async def kind(door: Door) -> None:
        reader, writer = await door.open()
        writer.write(text(door))
        while await reader.read(65536):
            writer.write(text(door))
        writer.close()

    return kind


async def never_reads(door: Door) -> None:
    """Asks for a large file and takes nothing of it."""
    _, writer = await door.open(1024)
    writer.write(door.request(f"GET {door.file}"))
    await asyncio.sleep(HELD_S)
    writer.close()


async def never_reads_frames(door: Door) -> None:
    """A WebSocket that is logged in and takes nothing."""
    _, writer = await door.open(1024)
    writer.write(door.handshake(door.session))
    await asyncio.sleep(HELD_S)
    writer.close()


async def floods_messages(door: Door) -> None:
    """A WebSocket that sends commands as fast as it can."""
    reader, writer = await door.open()
    writer.write(door.handshake(door.session))
    await reader.readuntil(b"\r\n\r\n")
    said = b'{"type":"set","seq":1,"frame":"","epoch":0,"tag":"increment_deg","value":1.0}'
    head = bytes(
        [0x81, 0x80 | len(said), 0, 0, 0, 0]
    )  # RFC 6455, section 5.2: one text, with a mask of zeros
    for _ in range(MESSAGES):
        writer.write(head + said)
        await writer.drain()
    while await reader.read(65536):
        pass
    writer.close()


HOLDERS: dict[str, Kind] = {
    "says nothing": holds(lambda _: b""),
    "half a line": holds(lambda _: b"GET /"),
    "half a body": holds(lambda door: door.request("POST /", "{" + " " * 59)[:-59]),
    "asks once": holds(lambda door: door.request("GET /")),
}
"""Kinds that need no session."""
KINDS: dict[str, Kind] = {
    **HOLDERS,
    "never reads": never_reads,
    "guesses passwords": repeats(
        lambda door: door.request("POST /api/v1/login", '{"user": "operator", "password": "a wrong one"}')
    ),
    "floods the page": repeats(lambda door: door.request("GET /")),
    "floods REST": repeats(lambda door: door.request("GET /api/v1/health")),
    "WebSocket without a session": holds(lambda door: door.handshake("0" * 32)),
    "WebSocket that is idle": holds(lambda door: door.handshake(door.session)),
    "WebSocket that never reads": never_reads_frames,
    "WebSocket that floods": floods_messages,
}


async def come_again(kind: Kind, door: Door) -> None:
    """One client, for as long as the process lives."""
    while True:
        with suppress(OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            await kind(door)
        await asyncio.sleep(AGAIN_S)


async def crowd(door: Door, count: int, names: Sequence[str]) -> None:
    """All clients, of every kind in turn."""
    kinds = [KINDS[name] for name in names or (KINDS if door.session else HOLDERS)]
    tasks = [asyncio.create_task(come_again(kinds[n % len(kinds)], door)) for n in range(count)]
    await asyncio.sleep(0.5)
    print("holding", flush=True)
    await asyncio.gather(*tasks)


if __name__ == "__main__":
    options = argparse.ArgumentParser()
    options.add_argument("port", type=int)
    options.add_argument("count", type=int)
    options.add_argument("host")
    options.add_argument("--session", default="")
    options.add_argument("--file", default="/")
    options.add_argument("--uid", type=int)
    options.add_argument("--kinds", nargs="+", choices=list(KINDS), default=[])
    asked = options.parse_args()
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    if asked.uid is not None:
        os.setuid(asked.uid)
    asyncio.run(crowd(Door(asked.port, asked.host, asked.session, asked.file), asked.count, asked.kinds))
