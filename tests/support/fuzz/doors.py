"""What all hostile clients share: where the service is, who may log in, and what was answered."""

from __future__ import annotations

import asyncio
import re
import socket
import struct
import threading
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from random import Random
from typing import Protocol

from gantryctl.gateway.access import COOKIE

STATUS = re.compile(rb"HTTP/1\.[01] (\d{3}) ")


@dataclass
class Found:
    """What a door has answered.

    Attributes:
        answers: how often, by kind. faults: what must not be, with the case that caused it.
    """

    cases: int = 0
    answers: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    def fault(self, case: str, what: str) -> None:
        """Note what must not be."""
        if len(self.faults) < 100:
            self.faults.append(f"{case}: {what}")


@dataclass(frozen=True)
class Target:
    """A service under attack.

    Attributes:
        cookies: sessions by user.
        calm: while it is set, nobody sends a stop or takes control: the judge moves the axis.
    """

    host: str
    port: int
    cookies: dict[str, list[str]]
    calm: threading.Event

    @property
    def origin(self) -> str:
        return f"http://{self.host}:{self.port}"

    def cookie(self, random: Random) -> str:
        """The header of a session."""
        user = random.choice(list(self.cookies))
        return f"{COOKIE}={random.choice(self.cookies[user])}"


class Attack(Protocol):
    """Hostile clients of one door."""

    found: Found

    async def case(self, name: str, random: Random) -> None:
        """One case: the same bytes for the same random numbers, as far as the answers are the same."""


async def connected(
    host: str, port: int, receive_bytes: int = 0
) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    """A connection, with a small buffer where a slow reader is wanted."""
    made = socket.socket()
    if receive_bytes:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
    made.setblocking(False)
    try:
        await asyncio.wait_for(asyncio.get_running_loop().sock_connect(made, (host, port)), 10.0)
    except BaseException:
        made.close()
        raise
    return await asyncio.open_connection(sock=made)


async def read_for(reader: asyncio.StreamReader, seconds: float, most: int = 2**20) -> bytes:
    """What arrives until nothing has for a time, or the end."""
    taken = b""
    with suppress(TimeoutError, OSError):
        while len(taken) < most:
            data = await asyncio.wait_for(reader.read(65536), seconds)
            if not data:
                break
            taken += data
    return taken


def leave(writer: asyncio.StreamWriter, random: Random) -> None:
    """Go, politely or with a reset."""
    if random.random() < 0.3:
        with suppress(OSError):
            made = writer.get_extra_info("socket")
            made.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    writer.close()
