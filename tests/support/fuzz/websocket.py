"""Hostile WebSockets: handshakes, frames and messages that no page sends."""

from __future__ import annotations

import asyncio
import json
import os
import struct
from contextlib import suppress
from random import Random
from typing import Any

from gantryctl.gateway.routes import API
from gantryctl.service.protocol.messages import FIELDS, WITHOUT_EPOCH, WITHOUT_FRAME
from support.fuzz.doors import STATUS, Found, Target, connected, leave, read_for
from support.fuzz.words import BYTES, damaged_bytes, hostile, mutated_object

TEXT, BINARY, CLOSE, PING, PONG, CONTINUATION = 1, 2, 8, 9, 10, 0
GOOD: dict[str, Any] = {
    "over": False,
    "on": True,
    "mode": "continuous",
    "lease": "00000000000000aa",
    "direction": "forward",
    "target_deg": 5.0,
    "distance_deg": 5.0,
    "id": 1,
    "tag": "speed_setting_deg_s",
    "value": 1.0,
    "action": "brake_test",
}
STOPPING = ("stop", "quick_stop", "take", "halt")
HANDSHAKES = (
    "Sec-WebSocket-Version: 12",
    "Sec-WebSocket-Version: 13, 8",
    "Sec-WebSocket-Key: x",
    "Sec-WebSocket-Key: ",
    "Sec-WebSocket-Extensions: permessage-deflate; server_max_window_bits=99",
    "Sec-WebSocket-Protocol: " + "x," * 2000,
    "Sec-WebSocket-Extensions: " + "x;y=z," * 1500,
    "Origin: http://other.example",
    "Upgrade: WebSocket, h2c",
    "Connection: close",
    "Content-Length: 5",
    "Transfer-Encoding: chunked",
    "Origin: null",
)


def frame(
    opcode: int,
    data: bytes,
    *,
    fin: bool = True,
    reserved: int = 0,
    mask: bytes | None = b"\1\2\3\4",
    length: int | None = None,
) -> bytes:
    """One frame; what it says of its length may be wrong (RFC 6455, section 5.2)."""
    said = len(data) if length is None else length
    first = (0x80 if fin else 0) | reserved << 4 | opcode
    bit = 0x80 if mask is not None else 0
    if said < 126:
        head = struct.pack(">BB", first, bit | said)
    elif said < 2**16:
        head = struct.pack(">BBH", first, bit | 126, said)
    else:
        head = struct.pack(">BBQ", first, bit | 127, said)
    if mask is None:
        return head + data
    return head + mask + bytes(byte ^ mask[n % 4] for n, byte in enumerate(data))


class WebSockets:
    """Cases over raw connections: each opens one, says a few dozen things, and goes."""

    def __init__(self, target: Target) -> None:
        self.target, self.found = target, Found()

    async def case(self, name: str, random: Random) -> None:
        slow = random.random() < 0.05
        reader, writer = await connected(self.target.host, self.target.port, 2048 if slow else 0)
        answer = b""
        try:
            with suppress(OSError, TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
                writer.write(self._handshake(random))
                answer = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), 5.0)
                if answer.startswith(b"HTTP/1.1 101"):
                    await self._talk(name, random, reader, writer, slow=slow)
        finally:
            leave(writer, random)
        status = next(iter(STATUS.findall(answer)), b"none").decode()
        self.found.answers[f"handshake {status}"] += 1
        if status == "500":
            self.found.fault(name, f"{answer[:300]!r}")
        self.found.cases += 1

    def _handshake(self, random: Random) -> bytes:
        rows = [
            f"GET {API}/socket HTTP/1.1",
            f"Host: {self.target.host}:{self.target.port}",
            f"Origin: {self.target.origin}",
            f"Cookie: {self.target.cookie(random)}",
            "Upgrade: websocket",
            "Connection: Upgrade",
            "Sec-WebSocket-Version: 13",
            "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
        ]
        if random.random() < 0.2:
            if random.random() < 0.5:
                del rows[random.randrange(1, len(rows))]
            else:
                rows.append(random.choice(HANDSHAKES))
        data = ("\r\n".join(rows) + "\r\n\r\n").encode()
        return damaged_bytes(random, data) if random.random() < 0.03 else data

    async def _talk(
        self,
        name: str,
        random: Random,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        *,
        slow: bool,
    ) -> None:
        told = await read_for(reader, 0.06, 60_000)
        mark, epoch = _newest(told)
        kind = random.choice((self._messages, self._messages, self._messages, self._frames, self._flood))
        for data in kind(random, mark, epoch):
            writer.write(data)
            await asyncio.wait_for(writer.drain(), 5.0)
            if random.random() < 0.2:
                await asyncio.sleep(0.005)
        if random.random() < 0.2 and writer.can_write_eof():
            writer.write_eof()
        if slow:
            await asyncio.sleep(2.0)
        said = await read_for(reader, 0.06, 200_000)
        for word in (b'"type":"reply"', b'"ok":true', b"SEC-05"):
            self.found.answers[f"{word.decode()}"] += said.count(word)

    def _messages(self, random: Random, mark: str, epoch: int) -> list[bytes]:
        made = []
        for seq in range(random.randrange(1, 40)):
            kind = random.choice(list(FIELDS))
            if self.target.calm.is_set() and kind in STOPPING:
                kind = "acknowledge"
            values: dict[str, Any] = {"type": kind, "seq": seq, "frame": mark, "epoch": epoch}
            for each in (
                *(("frame",) if kind in WITHOUT_FRAME else ()),
                *(("epoch",) if kind in WITHOUT_EPOCH else ()),
            ):
                values.pop(each, None)
            values |= {each: GOOD[each] for each in FIELDS[kind] if each in GOOD}
            text = hostile(random) if random.random() < 0.05 else mutated_object(random, values)
            # A stop that has slipped through a mutation is one all the same.
            if self.target.calm.is_set() and any(f'"{each}"' in text for each in STOPPING):
                continue
            data = text.encode("utf-8", "surrogatepass")
            made += _fragments(random, data) if random.random() < 0.15 else [frame(TEXT, data)]
        return made

    def _frames(self, random: Random, mark: str, epoch: int) -> list[bytes]:
        good = json.dumps({"type": "alive", "seq": 0, "frame": mark}).encode()
        wrong = [
            frame(CONTINUATION, good),
            frame(TEXT, good, fin=False) + frame(TEXT, good),
            frame(TEXT, good, reserved=random.randrange(1, 8)),
            frame(random.choice((3, 4, 5, 6, 7, 11, 12, 13, 14, 15)), good),
            frame(TEXT, good, mask=None),
            frame(PING, b"x" * 126),
            frame(PING, b"x", fin=False),
            frame(TEXT, good, length=2**63 - 1),
            frame(TEXT, good, length=2**64 - 1),
            frame(TEXT, good, length=2**31),
            frame(TEXT, b" " * 16_385),
            frame(TEXT, b" " * 16_384),
            frame(TEXT, b"\xff\xfe" + good),
            frame(TEXT, random.choice(BYTES)),
            frame(BINARY, good),
            frame(BINARY, b""),
            frame(CLOSE, b"\x00"),
            frame(CLOSE, struct.pack(">H", random.choice((0, 999, 1005, 1006, 1015, 4999, 65535)))),
            frame(CLOSE, b"\x03\xe8\xff\xfe"),
            frame(PONG, b"x"),
            frame(PING, b""),
            frame(TEXT, b""),
            frame(TEXT, good, length=len(good) + 10),
            os.urandom(0) + b"\x81",
            frame(TEXT, good, fin=False) + frame(PING, b"x") + frame(CONTINUATION, b"", fin=True),
        ]
        made = [frame(TEXT, good)] * random.randrange(3) + random.sample(wrong, random.randrange(1, 4))
        return [damaged_bytes(random, each) if random.random() < 0.1 else each for each in made]

    def _flood(self, random: Random, mark: str, epoch: int) -> list[bytes]:
        kind = random.choice(("alive", "renew", "acknowledge", "set", "release", "ping", "jog"))
        if kind == "ping":
            return [frame(PING, b"x" * random.randrange(126))] * 2000
        values: dict[str, Any] = {"type": kind, "seq": 1, "frame": mark, "epoch": epoch}
        for each in (
            *(("frame",) if kind in WITHOUT_FRAME else ()),
            *(("epoch",) if kind in WITHOUT_EPOCH else ()),
        ):
            values.pop(each, None)
        values |= {each: GOOD[each] for each in FIELDS[kind] if each in GOOD}
        return [frame(TEXT, json.dumps(values).encode())] * random.choice((30, 150, 400))


def _fragments(random: Random, data: bytes) -> list[bytes]:
    cuts = sorted(random.randrange(len(data) + 1) for _ in range(random.randrange(1, 6)))
    parts = [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]
    made = [
        frame(TEXT if n == 0 else CONTINUATION, part, fin=n == len(parts) - 1) for n, part in enumerate(parts)
    ]
    if random.random() < 0.5:
        made.insert(random.randrange(1, len(made)), frame(PING, b"between"))
    return made


def _newest(told: bytes) -> tuple[str, int]:
    """Mark of the newest frame and the epoch, read without a parser: the bytes may end anywhere."""
    mark = told.rpartition(b'"frame":"')[2].partition(b'"')[0].decode("latin-1")
    epoch = told.rpartition(b'"epoch":')[2][:20].partition(b",")[0]
    return mark or "1-0000000000000000", int(epoch) if epoch.isdigit() else 0
