"""A request makes the OPC UA server read no more than the bytes that came, whatever it says of itself."""

from __future__ import annotations

import struct
import tracemalloc

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua import ua  # noqa: E402
from asyncua.common.utils import NotEnoughData, ServiceError  # noqa: E402
from asyncua.ua.ua_binary import struct_from_binary, struct_to_binary  # noqa: E402

from gantryctl.gateway.opcua.reading import Bounded  # noqa: E402
from support.fuzz.opcua import extension, literal  # noqa: E402
from support.opcua_bench import CLIENT, Bench, Run  # noqa: E402
from support.opcua_wire import Wire  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore")  # of asyncua itself
MODES = ua.MessageSecurityMode
MANY = 400_000
"""Elements that a bomb says it has: 3.2 MB and more as a list; 2**31 - 1 would be 17 GB and minutes."""
READ_MAX_MB = 1.0
"""Memory for reading a request of a few hundred bytes; measured: 0.1."""
NOTHING = struct.pack("<Bi", 0x80, MANY)  # a variant: an array of nulls, of which none has a byte
DIMENSIONS = struct.pack("<BiBiii", 0xC1, 1, 1, 2, MANY, 1)  # one boolean, in a matrix of 400,000 x 1
# A string of -4 bytes moves the reader back to its own length.
BACKWARDS = struct.pack("<ii", MANY, -4)


def with_header(request: object, extra: bytes) -> bytes:
    """A request whose header carries an extension object, at its end in place of none."""
    data, head = struct_to_binary(request), struct_to_binary(request.RequestHeader)  # type: ignore[attr-defined]
    at = data.index(head) + len(head) - 3
    return data[:at] + extra + data[at + 3 :]


async def read_mb(wire: Wire, data: bytes) -> float:
    """Send a request and wait for what is said to it; memory that its reading took, MB."""
    tracemalloc.start()
    try:
        await wire.say(wire.secure.message_to_binary(data, request_id=wire._next()))
        await wire.hear()
        return tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("bomb", [NOTHING, DIMENSIONS * 2])
def test_strangers_cannot_make_the_server_read_what_they_did_not_send(run: Run, bomb: bytes) -> None:
    async def check(bench: Bench) -> None:
        wire = await bench.open("None", MODES.None_, "")
        assert await read_mb(wire, with_header(ua.GetEndpointsRequest(), literal(bomb))) < READ_MAX_MB
        plain = struct_to_binary(ua.GetEndpointsRequest())
        # The list of locales stands 4 bytes before the end: and each of its names leads back to itself.
        assert await read_mb(wire, plain[:-8] + BACKWARDS + plain[-4:]) < READ_MAX_MB
        assert (await wire.ask(ua.GetEndpointsRequest()))[0] == "Good"

    run(check)


def test_nobody_can_before_the_channel_is_open(run: Run) -> None:
    async def check(bench: Bench) -> None:
        wire = await bench.wire()
        request = ua.OpenSecureChannelRequest()
        request.Parameters.SecurityMode = MODES.None_
        data = with_header(request, literal(NOTHING))
        tracemalloc.start()
        await wire.say(wire.secure.message_to_binary(data, ua.MessageType.SecureOpen, 1))
        await wire.hear()
        most = tracemalloc.get_traced_memory()[1] / 1e6
        tracemalloc.stop()
        assert most < READ_MAX_MB

    run(check)


def test_a_trusted_client_without_a_user_cannot(run: Run) -> None:
    async def check(bench: Bench) -> None:
        wire = await bench.open("Basic256Sha256", MODES.SignAndEncrypt)
        assert await wire.create(bench.certificate("client"), CLIENT) == "Good"
        request = ua.ActivateSessionRequest()
        request.RequestHeader.AuthenticationToken = wire.token
        data = struct_to_binary(request)
        # The identity token stands before an empty signature of 8 bytes.
        assert await read_mb(wire, data[:-11] + literal(NOTHING) + data[-8:]) < READ_MAX_MB
        assert (await wire.ask(request))[0] == "BadIdentityTokenRejected"

    run(check)


def test_filters_are_for_changes_of_data_only(run: Run) -> None:
    async def check(bench: Bench) -> None:
        wire = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        wanted = ua.CreateSubscriptionRequest()
        wanted.Parameters.RequestedPublishingInterval = 1000.0
        _, body = await wire.ask(wanted)
        number = struct_from_binary(ua.CreateSubscriptionResult, body).SubscriptionId
        request = ua.CreateMonitoredItemsRequest()
        request.RequestHeader.AuthenticationToken, request.Parameters.SubscriptionId = wire.token, number
        request.Parameters.ItemsToCreate = [ua.MonitoredItemCreateRequest()]
        data = struct_to_binary(request)
        for bomb in (literal(NOTHING), literal(DIMENSIONS)):
            assert await read_mb(wire, data[:-8] + bomb + data[-5:]) < READ_MAX_MB
        item = request.Parameters.ItemsToCreate[0]
        item.ItemToMonitor.NodeId = ua.NodeId(ua.ObjectIds.Server_ServerStatus_State)
        item.ItemToMonitor.AttributeId = ua.AttributeIds.Value
        for made, said in (
            (ua.EventFilter(), "BadMonitoredItemFilterUnsupported"),
            (ua.DataChangeFilter(), "Good"),
            (None, "Good"),
        ):
            item.RequestedParameters.Filter = made or ua.ExtensionObject()
            assert (await wire.ask(request))[0] == said

    run(check)


@pytest.mark.parametrize("size", [-1, -4, -(2**31)])
def test_a_length_below_zero_is_no_way_back(size: int) -> None:
    data = Bounded(b"0123456789")
    data.read(5)
    with pytest.raises(NotEnoughData):
        data.read(size)
    with pytest.raises(NotEnoughData):
        data.skip(size)
    assert bytes(data.copy().read(5)) == b"56789"


def test_an_extension_object_is_passed_over_as_the_library_reads_it() -> None:
    from gantryctl.gateway.opcua.reading import _skip_extension

    kind = ua.ObjectIds.UserNameIdentityToken_Encoding_DefaultBinary
    body = Bounded(extension(kind, b"abc") + b"rest")
    assert _skip_extension(body) == kind
    assert bytes(body.read(4)) == b"rest"
    # A number of another namespace is another type.
    assert _skip_extension(Bounded(b"\1\2" + kind.to_bytes(2, "little") + b"\0")) is None
    # No body, a body of bytes, a body in XML (Part 6, section 5.2.2.15), and what there is not.
    assert _skip_extension(Bounded(b"\0\0\0")) == 0
    for encoding in (b"\2", b"\3"):
        with pytest.raises(ServiceError):
            _skip_extension(Bounded(b"\0\0" + encoding + b"\0\0\0\0"))
    for wrong in (extension(kind, b"abc", 2**31 - 1), extension(kind, b"abc", -1)):
        with pytest.raises(NotEnoughData):
            _skip_extension(Bounded(wrong))
