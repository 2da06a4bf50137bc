"""OPC UA: how much of each service a client gets, rule by rule, and how many chunks of it wait."""

from __future__ import annotations

import asyncio
import math
import struct
from types import SimpleNamespace
from typing import Any

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua import ua  # noqa: E402
from asyncua.common.utils import ServiceError  # noqa: E402
from asyncua.ua.ua_binary import struct_from_binary, struct_to_binary  # noqa: E402

from gantryctl.gateway.opcua.listener import Connection  # noqa: E402
from gantryctl.gateway.opcua.reading import Bounded  # noqa: E402
from gantryctl.gateway.opcua.services import READING, Holdings  # noqa: E402

MINE, BESIDE, OTHERS = 7, 8, 9


def holdings(*, subscriptions: int = 0, items: int = 0) -> Holdings:
    """Subscription 7 of this session, 8 of another one of its channel, 9 of another client, and more of this one."""
    owners = {MINE: "mine", BESIDE: "beside", OTHERS: "other"} | dict.fromkeys(
        range(100, 100 + subscriptions), "mine"
    )
    made = {
        number: SimpleNamespace(
            session_id=owner,
            monitored_item_srv=SimpleNamespace(_monitored_items=range(items if number == BESIDE else 0)),
        )
        for number, owner in owners.items()
    }
    internal = SimpleNamespace(subscription_service=SimpleNamespace(subscriptions=made))
    return Holdings(internal, "mine", {"mine", "beside"})


def allowed(service: str, parameters: Any, held: Holdings | None = None) -> Any:
    """What the library may act on.

    Raises:
        ServiceError: nothing.
    """
    rule = READING[getattr(ua.ObjectIds, f"{service}Request_Encoding_DefaultBinary")]
    body = rule(held or holdings(), Bounded(struct_to_binary(parameters)))
    return struct_from_binary(type(parameters), body)


def status(service: str, parameters: Any, held: Holdings | None = None) -> str:
    try:
        allowed(service, parameters, held)
    except ServiceError as refused:
        return str(ua.StatusCode(refused.code).name)
    return "Good"


@pytest.mark.parametrize(
    ("service", "parameters", "name", "element", "most"),
    [
        ("Read", ua.ReadParameters, "NodesToRead", ua.ReadValueId, 1000),
        ("RegisterNodes", ua.RegisterNodesParameters, "NodesToRegister", ua.NodeId, 1000),
        ("UnregisterNodes", ua.UnregisterNodesParameters, "NodesToUnregister", ua.NodeId, 1000),
        ("Browse", ua.BrowseParameters, "NodesToBrowse", ua.BrowseDescription, 100),
        (
            "TranslateBrowsePathsToNodeIds", ua.TranslateBrowsePathsToNodeIdsParameters, "BrowsePaths", ua.BrowsePath,
            100,
        ),
    ],
)  # fmt: skip
def test_a_request_has_so_many_nodes(
    service: str, parameters: Any, name: str, element: Any, most: int
) -> None:
    for count, said in ((most, "Good"), (most + 1, "BadTooManyOperations")):
        assert status(service, parameters(**{name: [element()] * count})) == said


def test_a_client_acknowledges_its_own_messages_only() -> None:
    """An acknowledged message is not sent again; number 0 is nobody's subscription."""
    wanted = ua.PublishParameters(
        [ua.SubscriptionAcknowledgement(n, 1) for n in (MINE, BESIDE, OTHERS, MINE)]
    )
    rows = allowed("Publish", wanted).SubscriptionAcknowledgements
    assert [row.SubscriptionId for row in rows] == [MINE, 0, 0, MINE]


def test_who_has_no_subscription_waits_for_no_message() -> None:
    nobody = Holdings(
        SimpleNamespace(subscription_service=SimpleNamespace(subscriptions={})), "mine", {"mine"}
    )
    assert status("Publish", ua.PublishParameters(), nobody) == "BadNoSubscription"


@pytest.mark.parametrize(
    ("service", "parameters"),
    [
        ("ModifySubscription", ua.ModifySubscriptionParameters),
        ("DeleteMonitoredItems", ua.DeleteMonitoredItemsParameters),
        ("SetMonitoringMode", ua.SetMonitoringModeParameters),
        ("CreateMonitoredItems", ua.CreateMonitoredItemsParameters),
        ("ModifyMonitoredItems", ua.ModifyMonitoredItemsParameters),
        ("Republish", ua.RepublishParameters),
    ],
)
def test_a_service_is_for_the_own_subscription(service: str, parameters: Any) -> None:
    for number, said in ((MINE, "Good"), *((n, "BadSubscriptionIdInvalid") for n in (BESIDE, OTHERS, 0))):
        assert status(service, parameters(SubscriptionId=number)) == said


@pytest.mark.parametrize(
    ("service", "parameters"),
    [
        ("DeleteSubscriptions", ua.DeleteSubscriptionsParameters),
        ("SetPublishingMode", ua.SetPublishingModeParameters),
    ],
)
def test_all_subscriptions_of_a_request_are_its_own(service: str, parameters: Any) -> None:
    for numbers, said in (
        ([MINE], "Good"),
        ([MINE, BESIDE], "BadSubscriptionIdInvalid"),
        ([OTHERS], "BadSubscriptionIdInvalid"),
    ):
        assert status(service, parameters(SubscriptionIds=numbers)) == said


@pytest.mark.parametrize(
    ("asked_ms", "given_ms"),
    [
        (math.nan, 200.0), (-1.0, 200.0), (199.9, 200.0), (200.0, 200.0), (200.1, 200.1), (60_000.0, 60_000.0),
        (60_001.0, 60_000.0),
    ],
)  # fmt: skip
def test_the_shortest_and_the_longest_interval_of_a_subscription(asked_ms: float, given_ms: float) -> None:
    """Values change every 0.2 s."""
    wanted = ua.CreateSubscriptionParameters(RequestedPublishingInterval=asked_ms)
    assert allowed("CreateSubscription", wanted).RequestedPublishingInterval == given_ms


def test_a_channel_has_eight_subscriptions() -> None:
    """Two of this channel are there."""
    wanted = ua.CreateSubscriptionParameters()
    assert status("CreateSubscription", wanted, holdings(subscriptions=5)) == "Good"
    assert status("CreateSubscription", wanted, holdings(subscriptions=6)) == "BadTooManySubscriptions"


def test_a_channel_has_a_thousand_monitored_items() -> None:
    def asked(held: Holdings) -> str:
        items = [ua.MonitoredItemCreateRequest(), ua.MonitoredItemCreateRequest()]
        return status(
            "CreateMonitoredItems", ua.CreateMonitoredItemsParameters(MINE, ItemsToCreate=items), held
        )

    assert asked(holdings(items=998)) == "Good"
    assert asked(holdings(items=999)) == "BadTooManyMonitoredItems"


def test_a_deadband_is_taken_out_of_every_item() -> None:
    """With one a client would not be told that a value has gone bad."""
    wanted = ua.MonitoringParameters(
        Filter=ua.DataChangeFilter(DeadbandType=ua.DeadbandType.Absolute, DeadbandValue=1.0)
    )
    create = ua.CreateMonitoredItemsParameters(
        MINE, ItemsToCreate=[ua.MonitoredItemCreateRequest(RequestedParameters=wanted)] * 2
    )
    modify = ua.ModifyMonitoredItemsParameters(
        MINE, ItemsToModify=[ua.MonitoredItemModifyRequest(RequestedParameters=wanted)] * 2
    )
    items = [*allowed("CreateMonitoredItems", create).ItemsToCreate]
    items += [*allowed("ModifyMonitoredItems", modify).ItemsToModify]
    filters = [item.RequestedParameters.Filter for item in items]
    assert [(each.DeadbandType, each.DeadbandValue) for each in filters] == [(ua.DeadbandType.None_, 0.0)] * 4


# --- chunks -----------------------------------------------------------------------------------------------------------

SHORT = struct.pack("<3scI", b"MSG", b"F", 12) + bytes(4)


class Line(Connection):
    """A connection whose other end is the test; chunks of 64 KiB were agreed.

    Attributes:
        refused: statuses. paused, resumed: how many chunks waited then.
    """

    def __init__(self) -> None:
        limits = SimpleNamespace(max_recv_buffer=65_536)
        listener: Any = SimpleNamespace(
            wall=SimpleNamespace(limits=limits), connections={self}, keep=lambda work: work
        )
        super().__init__(listener)
        self.refused, self.paused, self.resumed = list[str](), list[int](), list[int]()
        self.left = 0
        self._place: Any = SimpleNamespace(leave=self._leave)
        self.transport: Any = SimpleNamespace(
            pause_reading=lambda: self.paused.append(len(self._chunks)),
            resume_reading=lambda: self.resumed.append(len(self._chunks)),
            is_closing=lambda: False,
        )

    def _leave(self) -> None:
        self.left += 1

    def refuse(self, status: int, journal: str = "") -> None:
        self.refused.append(str(ua.StatusCode(status).name))


def test_a_client_with_32_chunks_that_wait_is_read_no_further() -> None:
    """The server takes one of each client in turn; what a client sends beyond them stays in its own computer."""
    line = Line()
    for _ in range(34):
        line.data_received(SHORT)
    assert line.paused == [33, 34]


def test_a_client_is_read_again_when_half_of_its_chunks_are_done() -> None:
    line, taken = Line(), []

    async def take(header: Any, body: Any) -> bool:
        taken.append(len(line._chunks))
        return True

    async def work() -> None:
        line.channel = SimpleNamespace(take=take)  # type: ignore[assignment]
        line.data_received(20 * SHORT)
        task = asyncio.create_task(line._run())
        while len(taken) < 20:
            await asyncio.sleep(0)
        task.cancel()

    asyncio.run(work())
    assert taken == list(range(19, -1, -1))
    assert line.resumed == list(range(16, -1, -1))


@pytest.mark.parametrize(
    ("size", "said"),
    [
        (0, ["BadTcpMessageTooLarge"]), (8, ["BadTcpMessageTooLarge"]), (9, []), (65_536, []),
        (65_537, ["BadTcpMessageTooLarge"]),
    ],
)  # fmt: skip
def test_a_chunk_has_more_than_its_head_and_no_more_than_was_agreed(size: int, said: list[str]) -> None:
    line = Line()
    line.data_received(struct.pack("<3scI", b"MSG", b"F", size))
    assert (line.refused, len(line._chunks)) == (said, 0)
    if not said:
        line.data_received(bytes(size - 8) + SHORT[:7])
        assert [len(chunk) for chunk in line._chunks] == [size]
        line.data_received(SHORT[7:])
        assert [len(chunk) for chunk in line._chunks] == [size, 12]


@pytest.mark.parametrize(
    ("kind", "parts"),
    [(b"HEL", b"F"), (b"OPN", b"F"), (b"CLO", b"F"), (b"MSG", b"FCA"), (b"ACK", b""), (b"ERR", b"")],
)
def test_a_chunk_is_of_a_kind_that_there_is(kind: bytes, parts: bytes) -> None:
    """Final, one of several, or the end of a message that is abandoned (Part 6, section 6.7.2.2)."""
    for part in b"FCAX\0":
        line = Line()
        line.data_received(struct.pack("<3scI", kind, bytes((part,)), 12) + bytes(4))
        assert line.refused == ([] if part in parts else ["BadTcpMessageTypeInvalid"])


def test_a_connection_gives_its_place_back() -> None:
    line, ended = Line(), []
    line.channel = SimpleNamespace(end=lambda: ended.append(1))  # type: ignore[assignment]
    line.connection_lost(None)
    assert (line.left, line._listener.connections, ended) == (1, set(), [1])
