"""OPC UA: how much a client may ask for and hold, and for how long it may keep its place."""

from __future__ import annotations

import asyncio
from contextlib import suppress

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua import ua  # noqa: E402
from asyncua.ua.ua_binary import struct_from_binary, struct_to_binary  # noqa: E402

from gantryctl.gateway.opcua import listener, services  # noqa: E402
from support.opcua_bench import Bench, Run  # noqa: E402
from support.opcua_wire import Refused, Wire  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore")  # of asyncua itself
MODES = ua.MessageSecurityMode


async def items(wire: Wire, subscription: int, count: int) -> str:
    request = ua.CreateMonitoredItemsRequest()
    request.Parameters.SubscriptionId = subscription
    for _ in range(count):
        item = ua.MonitoredItemCreateRequest()
        item.ItemToMonitor.NodeId = ua.NodeId(ua.ObjectIds.Server_ServerStatus_State)
        item.ItemToMonitor.AttributeId = ua.AttributeIds.Value
        request.Parameters.ItemsToCreate.append(item)
    return (await wire.ask(request))[0]


def test_a_session_has_1000_monitored_items_and_8_subscriptions(run: Run) -> None:
    async def check(bench: Bench) -> None:
        mine = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        numbers = []
        for n in range(services.SUBSCRIPTIONS_MAX + 1):
            wanted = ua.CreateSubscriptionRequest()
            # Nothing of this is a period that a server may run at.
            wanted.Parameters.RequestedPublishingInterval = (0.0, -1.0, 1e-3, float("nan"), 1e300)[n % 5]
            said, body = await mine.ask(wanted)
            if n == services.SUBSCRIPTIONS_MAX:
                assert said == "BadTooManySubscriptions"
                break
            made = struct_from_binary(ua.CreateSubscriptionResult, body)
            assert 200.0 <= made.RevisedPublishingInterval <= 60_000.0
            numbers.append(made.SubscriptionId)
        assert await items(mine, numbers[0], 600) == "Good"
        assert await items(mine, numbers[1], 401) == "BadTooManyMonitoredItems"
        assert await items(mine, numbers[1], 400) == "Good"
        assert await items(mine, numbers[0], 1) == "BadTooManyMonitoredItems"
        other = await bench.session("Basic256Sha256", MODES.SignAndEncrypt, user="other")
        assert await items(other, numbers[0], 1) == "BadSubscriptionIdInvalid"

    run(check)


def test_a_null_list_of_items_is_an_empty_one(run: Run) -> None:
    """A list without a value has no elements (Part 6, section 5.2.5)."""

    async def check(bench: Bench) -> None:
        mine = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        _, body = await mine.ask(ua.CreateSubscriptionRequest())
        number = struct_from_binary(ua.CreateSubscriptionResult, body).SubscriptionId
        assert await items(mine, number, 1) == "Good"
        for request in (ua.DeleteMonitoredItemsRequest(), ua.SetMonitoringModeRequest()):
            request.Parameters.SubscriptionId = number
            for ids in ([], None):
                request.Parameters.MonitoredItemIds = ids
                assert (await mine.ask(request))[0] == "Good"
        # Nothing was deleted or switched off.
        mode = ua.SetMonitoringModeRequest()
        mode.Parameters.SubscriptionId, mode.Parameters.MonitoringMode = number, ua.MonitoringMode.Reporting
        mode.Parameters.MonitoredItemIds = [1]
        assert (await mine.ask(mode))[0] == "Good"

    run(check)


def test_a_changed_item_keeps_ten_values_whatever_it_asks_for(run: Run) -> None:
    """Found by a client that asks for a queue of 0, the longest there is, and never publishes: it kept every value."""

    async def check(bench: Bench) -> None:
        mine = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        _, body = await mine.ask(ua.CreateSubscriptionRequest())
        number = struct_from_binary(ua.CreateSubscriptionResult, body).SubscriptionId
        assert await items(mine, number, 2) == "Good"
        held = bench.listener.wall.internal.subscription_service.subscriptions[number].monitored_item_srv
        first, second = held._monitored_items
        change = ua.ModifyMonitoredItemsRequest()
        change.Parameters.SubscriptionId = number
        for wanted, given in ((0, 10), (2**32 - 1, 10), (11, 10), (3, 3)):
            change.Parameters.ItemsToModify = []
            for each in (first, second):
                item = ua.MonitoredItemModifyRequest()
                item.MonitoredItemId, item.RequestedParameters.QueueSize = each, wanted
                change.Parameters.ItemsToModify.append(item)
            assert (await mine.ask(change))[0] == "Good"
            assert [each.queue_size for each in held._monitored_items.values()] == [given, given]

    run(check)


def test_too_much_in_one_request_is_refused(run: Run) -> None:
    async def check(bench: Bench) -> None:
        mine = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        node = ua.ReadValueId(ua.NodeId(ua.ObjectIds.Server_NamespaceArray), ua.AttributeIds.Value)
        for count, said in ((1000, "Good"), (1001, "BadTooManyOperations")):
            read = ua.ReadRequest()
            read.Parameters.NodesToRead = [node] * count
            assert (await mine.ask(read))[0] == said
        browse = ua.BrowseRequest()
        browse.Parameters.NodesToBrowse = [ua.BrowseDescription(ua.NodeId(85))] * 101
        assert (await mine.ask(browse))[0] == "BadTooManyOperations"
        # A request that is small, with an answer that is not: 5 KB a thousand times.
        rows = [{"first_out": False, "code": "", "text": "", "more": "x" * 5000}]
        await bench.space.show({"axis_state": "disabled", "alarms": rows}, 0.0)
        read = ua.ReadRequest()
        big = ua.ReadValueId(ua.NodeId("Tags.alarms", 2), ua.AttributeIds.Value)
        read.Parameters.NodesToRead = [big] * 1000
        assert (await mine.ask(read))[0] == "BadResponseTooLarge"
        read.Parameters.NodesToRead = [big]
        assert (await mine.ask(read))[0] == "Good"

    run(check)


def test_registered_nodes_are_read_by_what_the_server_answers(run: Run) -> None:
    async def check(bench: Bench) -> None:
        mine = await bench.session("Aes256_Sha256_RsaPss", MODES.SignAndEncrypt)
        await bench.space.show({"axis_state": "disabled", "scan": 7}, 0.0)
        register = ua.RegisterNodesRequest()
        register.Parameters.NodesToRegister = [ua.NodeId("Tags.scan", 2)]
        said, body = await mine.ask(register)
        (node,) = struct_from_binary(ua.RegisterNodesResult, body).RegisteredNodeIds
        read = ua.ReadRequest()
        read.Parameters.NodesToRead = [ua.ReadValueId(node, ua.AttributeIds.Value)]
        assert (await mine.ask(read))[0] == said == "Good"
        release = ua.UnregisterNodesRequest()
        release.Parameters.NodesToUnregister = [node]
        assert (await mine.ask(release))[0] == "Good"

    run(check)


def test_one_address_does_not_take_all_places_and_idle_ones_are_taken_back(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def check(bench: Bench) -> None:
        mine = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        idle = [await asyncio.open_connection("127.0.0.1", bench.port) for _ in range(listener.CONNECTIONS)]
        await asyncio.sleep(0.1)
        assert len(bench.listener.connections) == listener.CONNECTIONS_LOOPBACK
        monkeypatch.setattr(listener, "LOGIN_S", 0.05)
        await bench.listener.sweep()
        for reader, _ in idle:
            with suppress(ConnectionError):
                assert await asyncio.wait_for(reader.read(), 2.0) == b""
        for _, writer in idle:
            writer.close()
        assert (await mine.ask(ua.ReadRequest()))[0] == "Good"
        # A session that is closed is no reason to stay either.
        assert (await mine.ask(ua.CloseSessionRequest()))[0] == "Good"
        await asyncio.sleep(0.06)
        await bench.listener.sweep()
        with pytest.raises((Refused, ConnectionError)):
            await mine.ask(ua.GetEndpointsRequest())

    run(check)


def test_answers_that_are_never_read_hold_no_place(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    async def check(bench: Bench) -> None:
        mine = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        rows = [{"first_out": False, "code": "", "text": "", "more": "x" * 900_000}]
        await bench.space.show({"axis_state": "disabled", "alarms": rows}, 0.0)
        read = ua.ReadRequest()
        read.RequestHeader.AuthenticationToken = mine.token
        read.Parameters.NodesToRead = [ua.ReadValueId(ua.NodeId("Tags.alarms", 2), ua.AttributeIds.Value)]
        for n in range(40):  # 36 MB of answers: more than all buffers in between
            mine.writer.write(mine.secure.message_to_binary(struct_to_binary(read), request_id=1000 + n))
        (connection,) = bench.listener.connections
        for _ in range(300):
            await asyncio.sleep(0.01)
            if connection.stuck_s is not None:
                break
        assert connection.stuck_s is not None
        # Not more than one answer beyond the limit waits in the server.
        assert connection.transport.get_write_buffer_size() < 2 * listener._OUT_MAX + 2**20
        monkeypatch.setattr(listener, "STUCK_S", 0.05)
        await asyncio.sleep(0.06)
        await bench.listener.sweep()
        await asyncio.sleep(0.05)
        assert not bench.listener.connections

    run(check)
