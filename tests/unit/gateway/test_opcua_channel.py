"""OPC UA: a channel from its first bytes over its renewal to its end."""

from __future__ import annotations

import asyncio
import os
import struct
import time

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua import ua  # noqa: E402
from asyncua.common.utils import Buffer  # noqa: E402
from asyncua.ua.ua_binary import struct_from_binary, struct_to_binary, uatcp_to_binary  # noqa: E402

from support.opcua_bench import Bench, Run  # noqa: E402
from support.opcua_wire import CIPHERS, Refused, Wire  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore")  # of asyncua itself
MODES = ua.MessageSecurityMode


@pytest.mark.parametrize(
    "data",
    [
        struct.pack("<3scI", b"MSG", b"F", 2**31),  # two gigabytes are announced
        struct.pack("<3scI", b"HEL", b"F", 8),  # nothing in it
        struct.pack("<3scI", b"HEL", b"F", 3),
        b"GET / HTTP/1.1\r\n\r\n",
        struct.pack("<3scIII", b"MSG", b"F", 20, 0, 0) + b"\xb1\x0b\x5e\x1f",
        uatcp_to_binary(ua.MessageType.Hello, ua.Hello(ReceiveBufferSize=1, EndpointUrl="")),
    ],
)
def test_what_is_no_opc_ua_is_closed_at_once(run: Run, data: bytes) -> None:
    async def check(bench: Bench) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", bench.port)
        writer.write(data)
        said = await asyncio.wait_for(reader.read(), 2.0)
        assert said[:3] in (b"ERR", b"")
        writer.close()

    run(check)


def test_a_client_says_hello_once(run: Run) -> None:
    """The limits of a connection are those of its beginning."""

    async def check(bench: Bench) -> None:
        wire = await bench.wire()
        await wire.say(uatcp_to_binary(ua.MessageType.Hello, ua.Hello(EndpointUrl="opc.tcp://x/")))
        with pytest.raises(Refused, match="BadTcpMessageTypeInvalid"):
            await wire.hear()

    run(check)


@pytest.mark.parametrize("length", [16, 31, 33])
def test_the_keys_of_a_channel_come_from_a_nonce_of_32_bytes(
    run: Run, monkeypatch: pytest.MonkeyPatch, length: int
) -> None:
    """Of the offered policies (OPC UA Part 7): a shorter one makes keys that are easier to guess."""
    monkeypatch.setattr(CIPHERS["Basic256Sha256"], "secure_channel_nonce_length", length)

    async def check(bench: Bench) -> None:
        with pytest.raises(Refused, match="BadNonceInvalid"):
            await bench.open("Basic256Sha256", MODES.SignAndEncrypt)

    run(check)


async def renewed(wire: Wire, lifetime_ms: int, asked: str = "Renew") -> int:
    """Ask for new keys of an open channel; its lifetime, ms."""
    request = ua.OpenSecureChannelRequest()
    wanted = request.Parameters
    wanted.SecurityMode, wanted.RequestType = MODES.SignAndEncrypt, ua.SecurityTokenRequestType[asked]
    wanted.ClientNonce, wanted.RequestedLifetime = os.urandom(32), lifetime_ms
    data = struct_to_binary(request)
    await wire.say(wire.secure.message_to_binary(data, ua.MessageType.SecureOpen, wire._next()))
    answer = struct_from_binary(ua.OpenSecureChannelResponse, (await wire.hear()).body())
    return int(answer.Parameters.SecurityToken.RevisedLifetime)


def test_a_channel_is_renewed_by_its_own_certificate_only(run: Run) -> None:
    async def check(bench: Bench) -> None:
        (bench.trusted / "stranger.der").write_bytes(bench.certificate("stranger"))
        await bench.listener.sweep()
        wire = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        bench.texts()
        assert await renewed(wire, 60_000) == 60_000
        assert (await wire.ask(ua.ReadRequest()))[0] == "Good"
        # Its own key, and the certificate of somebody else, whose sessions it would be given then.
        wire.secure.security_policy.host_certificate = bench.certificate("stranger")
        with pytest.raises(Refused, match="BadSecurityChecksFailed"):
            await renewed(wire, 60_000)
        assert any("another certificate in a renewal" in text for text in bench.texts())

    run(check)


def test_an_open_channel_is_not_opened_once_more_under_its_sessions(run: Run) -> None:
    async def check(bench: Bench) -> None:
        wire = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        with pytest.raises(Refused, match="BadRequestTypeInvalid"):
            await renewed(wire, 60_000, "Issue")

    run(check)


@pytest.mark.parametrize(
    ("asked_ms", "given_ms"), [(0, 60_000), (60_001, 60_001), (3_600_000, 3_600_000), (2**32 - 1, 3_600_000)]
)
def test_a_channel_that_is_not_renewed_in_time_is_closed(run: Run, asked_ms: int, given_ms: int) -> None:
    """From a minute to an hour, and a quarter more for the renewal (Part 4, section 5.5.2.1)."""

    async def check(bench: Bench) -> None:
        wire = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        (connection,) = bench.listener.connections
        assert await renewed(wire, asked_ms) == given_ms
        left_s = connection.channel._until_s - time.monotonic()
        assert left_s == pytest.approx(1.25e-3 * given_ms, abs=5.0)
        assert (await wire.ask(ua.ReadRequest()))[0] == "Good"
        connection.channel._until_s = time.monotonic() - 1e-3
        with pytest.raises(Refused, match="BadSecureChannelClosed"):
            await wire.ask(ua.ReadRequest())

    run(check)


def test_rubbish_of_a_trusted_client_ends_its_channel_and_nothing_else(run: Run) -> None:
    async def check(bench: Bench) -> None:
        mine = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        bad = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        # A request that cannot be read, then one whose signature is wrong.
        number = bad.secure.message_to_binary(b"\x01\x00\x77\x02" + os.urandom(40), request_id=99)
        await bad.say(number)
        body: Buffer = (await bad.hear()).body()
        assert len(body) > 0
        data = bytearray(bad.secure.message_to_binary(b"\x01\x00\x77\x02" + bytes(60), request_id=100))
        data[-1] ^= 1
        await bad.say(bytes(data))
        with pytest.raises(Refused, match="BadSecurityChecksFailed"):
            await bad.hear()
        assert (await mine.ask(ua.ReadRequest()))[0] == "Good"

    run(check)
