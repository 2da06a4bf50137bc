"""Hostile OPC UA: before a channel is open, on one without security, and in the session of a trusted client."""

from __future__ import annotations

import asyncio
import struct
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from asyncua import ua
from asyncua.common.connection import MessageChunk
from asyncua.crypto.cert_gen import load_private_key
from asyncua.crypto.uacrypto import load_certificate
from asyncua.ua.ua_binary import nodeid_to_binary, struct_to_binary, uatcp_to_binary

from support.fuzz.doors import Found, connected, leave, read_for
from support.fuzz.words import BYTES, damaged_bytes
from support.opcua_wire import Refused, Wire, password, requests

QUIET_S = 0.05
BODY_MAX = 2**22
"""Bytes, four times what the server takes. All clients share one thread, and one that writes 12 MB holds it for 1.4 s
of a processor, before it encrypts them."""
NESTED_MAX = 2
"""Elements of a list in a list."""
LENGTHS = (-(2**31), -1000, -5, -4, -2, -1, 0, 1, 2**16, 2**24, 2**31 - 1)
DOUBLES = (0.0, -1.0, 1e-9, 1e300, float("nan"), float("inf"), float("-inf"), 200.0)
INTS = (0, 1, 2, 13, 255, 2**16 - 1, 2**31 - 1, 2**32 - 1)
TEXTS = (
    None,
    "",
    "x",
    "\0",
    "\ud800",
    "0:9999999999",
    "1:0",
    "0,0,0,0",
    "-1",
    "é" * 500,
    "A" * 5000,
    "Default Binary",
)
MODES = ua.MessageSecurityMode


class Keys(NamedTuple):
    """Certificate and key of a trusted client, by their files, and its user."""

    certificate: Path
    key: Path
    application: str
    user: str
    word: str


def extension(kind: int, body: bytes, length: int | None = None) -> bytes:
    """An extension object of a type of namespace 0; its length may be wrong."""
    return struct.pack("<BBHBi", 1, 0, kind, 1, len(body) if length is None else length) + body


def literal(value: bytes) -> bytes:
    """A `LiteralOperand`: the shortest extension object with a variant in it."""
    return extension(ua.ObjectIds.LiteralOperand_Encoding_DefaultBinary, value)


def bombs(random: Random) -> bytes:
    """An extension object whose reader may need more time, memory or stack than it has bytes."""
    depth = random.choice((10, 200, 3000, 20_000))
    return random.choice(
        (
            literal(struct.pack("<Bi", 0x80, 2**31 - 1)),  # an array of nothing: no bytes for each
            literal(struct.pack("<Bi", 0x81, 2**31 - 1)),
            literal(b"\x98\x01\0\0\0" * depth + b"\x01\x01"),  # arrays of variants in variants
            literal(b"\x18" * depth + b"\x01\x01"),
            literal(struct.pack("<BiBiii", 0xC1, 1, 1, 2, 10**6, 1)) * 20,  # one element in a million places
            literal(struct.pack("<BiBiii", 0xC1, 1, 1, 2, 2**31 - 1, 2**31 - 1)),
            literal(struct.pack("<BiBiii", 0xC1, 1, 1, 2, -1, -1)),
            literal(b"\x16" + literal(b"\x01\x01")),
            literal(b"\x19" + b"\x40" * depth),  # diagnostic info in diagnostic info
            extension(
                ua.ObjectIds.EventFilter_Encoding_DefaultBinary, struct.pack("<ii", 2**31 - 1, 2**31 - 1)
            ),
            extension(
                ua.ObjectIds.DataChangeFilter_Encoding_DefaultBinary, struct.pack("<iid", 9, 9, float("nan"))
            ),
            extension(random.randrange(1, 20_000), random.randbytes(random.randrange(60))),
            extension(321, b"x", random.choice(LENGTHS)),
            nested(depth),
        )
    )


def nested(depth: int) -> bytes:
    """Extension objects in each other, each in the variant of the one around it."""
    inner = b"\x01\x01"
    for _ in range(min(depth, 300)):
        inner = b"\x16" + literal(inner)
    return literal(inner)


class OpcUa:
    """Cases over raw connections; logged-in ones are kept for some dozen cases, as logins are limited."""

    def __init__(self, port: int, clients: list[Keys], server: Path) -> None:
        self.port, self._clients, self._server, self.found = port, clients, server, Found()
        self._sessions: list[tuple[Wire, int]] = []
        self._kinds = requests()

    async def case(self, name: str, random: Random) -> None:
        what = random.random()
        if what < 0.3:
            await self._stranger(random)
        elif what < 0.5:
            await self._plain(random)
        else:
            await self._inside(random)
        self.found.cases += 1

    def _count(self, where: str, said: bytes) -> None:
        kind = said[:3].decode("latin-1") if said else "closed"
        self.found.answers[f"{where} {kind}"] += 1

    # --- before there is a channel ------------------------------------------------------------------

    async def _stranger(self, random: Random) -> None:
        reader, writer = await connected("127.0.0.1", self.port)
        hello = uatcp_to_binary(
            ua.MessageType.Hello,
            ua.Hello(
                0,
                random.choice((65535, 8192, 8191, 2**32 - 1)),
                65535,
                random.choice(INTS),
                random.choice(INTS),
                "opc.tcp://x/",
            ),
        )
        try:
            with suppress(OSError, TimeoutError):
                if random.random() < 0.8:
                    writer.write(damaged_bytes(random, hello) if random.random() < 0.3 else hello)
                for data in self._first(random):
                    writer.write(data)
                    await asyncio.wait_for(writer.drain(), 2.0)
                if random.random() < 0.2:
                    writer.write_eof()
                self._count("stranger", await read_for(reader, QUIET_S))
        finally:
            leave(writer, random)

    def _first(self, random: Random) -> list[bytes]:
        body = self._open_request(random)
        uri = random.choice(("None", "Basic256Sha256", "Aes256_Sha256_RsaPss", "Basic256", "x" * 2000))
        head = struct_to_binary(
            ua.AsymmetricAlgorithmHeader(
                f"http://opcfoundation.org/UA/SecurityPolicy#{uri}",
                random.choice((None, b"", b"0" * 30, random.choice(self._clients).certificate.read_bytes())),
                random.choice((None, b"0" * 20)),
            )
        )
        whole = head + struct.pack("<II", random.choice(INTS), 1) + body
        opened = struct.pack("<3scII", b"OPN", b"F", 12 + len(whole), 0) + whole
        size = random.choice((0, 7, 8, 9, 65535, 65536, 2**31, 2**32 - 1))
        kinds = (b"MSG", b"OPN", b"HEL", b"CLO", b"ACK", b"ERR", b"RHE", b"\0\0\0")
        other = struct.pack(
            "<3scI", random.choice(kinds), random.choice((b"F", b"C", b"A", b"X")), size
        ) + random.randbytes(30)
        made = [
            random.choice(
                (
                    opened,
                    damaged_bytes(random, opened),
                    other,
                    opened[: random.randrange(len(opened))],
                    random.randbytes(50),
                )
            )
        ]
        return made * random.choice((1, 1, 1, 40))

    def _open_request(self, random: Random) -> bytes:
        request = ua.OpenSecureChannelRequest()
        wanted = request.Parameters
        wanted.SecurityMode, wanted.ClientNonce = (
            random.choice(list(MODES)),
            random.choice((None, b"", b"0" * 32)),
        )
        wanted.RequestType = random.choice(list(ua.SecurityTokenRequestType))
        wanted.RequestedLifetime = random.choice(INTS)
        return self._with_header(random, struct_to_binary(request))

    def _with_header(self, random: Random, data: bytes) -> bytes:
        """A request whose header carries what no reader expects, at times."""
        if random.random() < 0.6:
            return data
        # Token, time, handle, diagnostics, audit entry, time limit, extension.
        head = ua.RequestHeader()
        plain = struct_to_binary(head)
        kind = data[: data.index(plain)] if plain in data else data[:4]
        rest = data[len(kind) + len(plain) :]
        made = (
            nodeid_to_binary(ua.NodeId())
            + struct.pack("<q", random.choice((0, -1, 2**62)))
            + struct.pack("<II", 1, random.choice(INTS))
        )
        made += struct.pack("<i", random.choice(LENGTHS)) if random.random() < 0.3 else b"\xff\xff\xff\xff"
        made += struct.pack("<I", random.choice(INTS)) + bombs(random)
        return kind + made + rest

    # --- on a channel without security --------------------------------------------------------------

    async def _plain(self, random: Random) -> None:
        with suppress(OSError, Refused, TimeoutError):
            wire = await Wire.connect(self.port)
            try:
                await wire.open()
                for _ in range(random.randrange(1, 12)):
                    name = random.choice(("GetEndpoints", "FindServers", random.choice(list(self._kinds))))
                    await self._put(wire, random, self._body(random, name))
                self._count("plain", await read_for(wire._reader, QUIET_S))
            finally:
                leave(wire.writer, random)

    # --- inside the session of a trusted client -----------------------------------------------------

    async def _inside(self, random: Random) -> None:
        try:
            wire, left = (
                self._sessions.pop()
                if self._sessions and random.random() < 0.9
                else (await self._log_in(random), 60)
            )
        except (OSError, Refused, TimeoutError) as refused:
            self.found.answers[f"login {refused}"] += 1
            return
        said = b""
        try:
            if random.random() < 0.05:
                await wire.say(self._broken(wire, random))
            for _ in range(random.choice((1, 3, 10, 60))):
                await self._put(
                    wire, random, self._body(random, random.choice(list(self._kinds)), wire.token)
                )
            said = await read_for(wire._reader, QUIET_S)
            self._count("inside", said)
            if left > 0 and said and said[:3] == b"MSG" and not wire._reader.at_eof():
                self._sessions.append((wire, left - 1))
                return
        except (OSError, TimeoutError):
            self._count("inside", b"")
        leave(wire.writer, random)

    async def _log_in(self, random: Random) -> Wire:
        keys = random.choice(self._clients)
        wire = await Wire.connect(self.port)
        try:
            policy = random.choice(("Basic256Sha256", "Aes128_Sha256_RsaOaep", "Aes256_Sha256_RsaPss"))
            certificate, server = keys.certificate.read_bytes(), await load_certificate(str(self._server))
            await wire.open(
                policy, MODES.SignAndEncrypt, certificate, await load_private_key(keys.key), server
            )
            said = await wire.create(certificate, keys.application)
            if said == "Good":
                said = await wire.activate(password(keys.user, keys.word))
            if said not in ("Good", "BadUserAccessDenied"):  # a check a second of one certificate
                self.found.fault("login", said)
            self.found.answers[f"login {said}"] += 1
        except BaseException:
            leave(wire.writer, random)
            raise
        return wire

    async def _put(self, wire: Wire, random: Random, body: bytes) -> None:
        number = wire._next()
        if random.random() < 0.1 and len(body) > 4:  # in several chunks, with or without an end
            cut = len(body) // 2
            for part, kind in ((body[:cut], b"C"), (body[cut:], random.choice((b"F", b"A", b"C")))):
                await wire.say(_chunk(wire, part, kind, number))
        else:
            await wire.say(wire.secure.message_to_binary(body, request_id=number))

    def _broken(self, wire: Wire, random: Random) -> bytes:
        """A chunk that does not fit into its channel."""
        made = bytearray(
            wire.secure.message_to_binary(b"\x01\x00\x77\x02" + bytes(40), request_id=wire._next())
        )
        at = random.choice((8, 12, 16, len(made) - 1))  # channel, token, sequence number, signature
        made[at] ^= 0x55
        return bytes(made)

    def _body(self, random: Random, name: str, token: Any = None) -> bytes:
        request = self._kinds[name]()
        request.RequestHeader.AuthenticationToken = token or ua.NodeId()
        request.RequestHeader.RequestHandle = random.choice(INTS)
        with suppress(AttributeError, TypeError):
            self._fill(random, request, 0)
        request.RequestHeader.AuthenticationToken = token or ua.NodeId()
        try:
            data = struct_to_binary(request)[:BODY_MAX]
        except Exception:  # the library cannot write what was filled in
            data = struct_to_binary(self._kinds[name]())
        what = random.random()
        if what < 0.2:
            # Some count or length in it, wherever four bytes look like one.
            places = [n for n in range(len(data) - 4) if data[n + 1 : n + 4] in (b"\0\0\0", b"\xff\xff\xff")]
            if places:
                at = random.choice(places)
                data = data[:at] + struct.pack("<i", random.choice(LENGTHS)) + data[at + 4 :]
        elif what < 0.35:
            data = damaged_bytes(random, data)
        elif what < 0.45:
            data = self._monitored(random, token)
        elif what < 0.5:
            data = data[: random.randrange(len(data))] + random.choice(BYTES)
        elif what < 0.6 and token is None:
            data = self._with_header(random, data)
        return data

    def _monitored(self, random: Random, token: Any) -> bytes:
        """CreateMonitoredItems with a filter that is a bomb."""
        request = ua.CreateMonitoredItemsRequest()
        request.RequestHeader.AuthenticationToken = token or ua.NodeId()
        request.Parameters.SubscriptionId = random.choice((1, 77, 78, 79, 80))
        request.Parameters.ItemsToCreate = [ua.MonitoredItemCreateRequest()]
        data = struct_to_binary(request)
        # At the end: the empty filter (3 bytes), queue size, discard oldest.
        return data[:-8] + bombs(random) + data[-5:]

    def _fill(self, random: Random, made: Any, depth: int) -> None:
        """Values that no client sends, in the right types."""
        for name, value in list(
            vars(made).items()
            if hasattr(made, "__dict__")
            else ((n, getattr(made, n)) for n in made.__slots__)
        ):
            if name in ("RequestHeader", "TypeId", "Encoding") or random.random() < 0.3:
                continue
            found = _value(random, value)
            if found is not _SAME:
                setattr(made, name, found)
            elif hasattr(value, "__dataclass_fields__") and depth < 4:
                self._fill(random, value, depth + 1)
            elif isinstance(value, list) and depth < 4:
                setattr(made, name, self._list(random, made, name, depth))

    def _list(self, random: Random, made: Any, name: str, depth: int) -> list[Any]:
        hint = str(made.__dataclass_fields__[name].type)
        kind = getattr(ua, hint.rpartition("[")[2].partition("]")[0].rpartition(".")[2], None)
        count = random.choice((0, 1, 2, 50, 1001))
        if depth > 1:
            count = min(count, NESTED_MAX)
        if kind is None or kind is ua.NodeId:
            return [ua.NodeId(random.choice(INTS), random.choice((0, 2, 9)))] * count
        if isinstance(kind, type) and issubclass(kind, int):
            return [random.choice(INTS)] * count
        try:
            one = kind()
        except TypeError:
            return []
        if hasattr(one, "__dataclass_fields__"):
            self._fill(random, one, depth + 1)
        return [one] * count


_SAME = object()


def _value(random: Random, value: Any) -> Any:
    if isinstance(value, bool):
        return random.random() < 0.5
    if isinstance(value, ua.NodeId):
        return random.choice(
            (
                ua.NodeId(2253),
                ua.NodeId(2258),
                ua.NodeId("Tags.pos_act_deg", 2),
                ua.NodeId(random.choice(INTS), 0),
                ua.NodeId(b"x" * 300, 7, ua.NodeIdType.ByteString),
            )
        )
    if isinstance(value, int) and type(value) is int:
        return random.choice(INTS)
    if isinstance(value, float):
        return random.choice(DOUBLES)
    if value is None or isinstance(value, str):
        return random.choice(TEXTS)
    return _SAME


def _chunk(wire: Wire, part: bytes, kind: bytes, number: int) -> bytes:
    """One chunk of a message, of the kind that is wanted."""
    secure = wire.secure
    (made,) = MessageChunk.message_to_chunks(
        secure.security_policy, part, 65_535, channel_id=secure.security_token.ChannelId, request_id=number,
        token_id=secure.security_token.TokenId,
    )[:1]  # fmt: skip
    made.MessageHeader.ChunkType = {
        b"C": ua.ChunkType.Intermediate,
        b"F": ua.ChunkType.Single,
        b"A": ua.ChunkType.Abort,
    }[kind]
    secure._sequence_number += 1
    made.SequenceHeader.SequenceNumber = secure._sequence_number
    return made.to_binary()
