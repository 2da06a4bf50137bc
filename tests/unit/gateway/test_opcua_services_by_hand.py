"""Services of OPC UA, by hand: how much at once, and whose subscriptions."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua import ua  # noqa: E402
from asyncua.common.utils import NotEnoughData, ServiceError  # noqa: E402
from asyncua.ua.ua_binary import struct_from_binary, struct_to_binary  # noqa: E402

from gantryctl.gateway.opcua import services as services_module  # noqa: E402
from gantryctl.gateway.opcua.reading import Bounded, _skip_extension  # noqa: E402
from support.opcua_by_hand import S, status_of  # noqa: E402


@pytest.mark.parametrize("name", ["_monitor", "_modify"])
def test_filters_are_judged_before_anything_else_is_read(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """In a copy: what is judged is read again by the service."""
    judged: list[tuple[str, bool]] = []

    def judge(body: str, *, new: bool) -> None:
        judged.append((body, new))
        raise ServiceError(S.BadMonitoredItemFilterUnsupported)

    monkeypatch.setattr(services_module, "judge_filters", judge)
    body: Any = SimpleNamespace(copy=lambda: "a copy")
    with pytest.raises(ServiceError):
        getattr(services_module, name)(None, body)
    assert judged == [("a copy", name == "_monitor")]


@pytest.mark.parametrize(
    ("request_", "parameters", "name", "item", "most"),
    [
        ("Read", ua.ReadParameters, "NodesToRead", ua.ReadValueId, 1000),
        ("Browse", ua.BrowseParameters, "NodesToBrowse", ua.BrowseDescription, 100),
        (
            "TranslateBrowsePathsToNodeIds",
            ua.TranslateBrowsePathsToNodeIdsParameters,
            "BrowsePaths",
            ua.BrowsePath,
            100,
        ),
        ("RegisterNodes", ua.RegisterNodesParameters, "NodesToRegister", ua.NodeId, 1000),
        ("UnregisterNodes", ua.UnregisterNodesParameters, "NodesToUnregister", ua.NodeId, 1000),
    ],
)
def test_each_service_takes_so_many_at_once(
    request_: str, parameters: Any, name: str, item: Any, most: int
) -> None:
    """Answers to browse are long: a hundred."""
    rule = services_module.READING[getattr(ua.ObjectIds, f"{request_}Request_Encoding_DefaultBinary")]
    for count in (most, most + 1):
        asked = parameters()
        setattr(asked, name, [item() for _ in range(count)])
        body = Bounded(struct_to_binary(asked))
        if count == most:
            assert len(rule(None, body)) > most  # type: ignore[arg-type]
            continue
        with pytest.raises(ServiceError) as refused:
            rule(None, body)  # type: ignore[arg-type]
        assert refused.value.code == S.BadTooManyOperations


@pytest.mark.parametrize(("size", "left"), [(-1, b"cdef"), (0, b""), (2, b"cd"), (4, b"cdef"), (9, b"cdef")])
def test_a_copy_is_of_what_is_left_and_no_longer_than_asked_for(size: int, left: bytes) -> None:
    """And it leaves the message as it was."""
    message = Bounded(b"abcdef")
    assert message.read(2) == b"ab"
    copied = message.copy(size)
    assert copied.read(len(left)) == left
    with pytest.raises(NotEnoughData):
        copied.read(1)
    assert message.read(4) == b"cdef"


def held(*owners: str, items: int = 0) -> Any:
    """What session "own" holds beside "other" on its channel: subscriptions 1, 2, ... of these owners."""
    service = SimpleNamespace(_monitored_items=range(items))
    each = {
        number: SimpleNamespace(session_id=owner, monitored_item_srv=service)
        for number, owner in enumerate(owners, 1)
    }
    internal = SimpleNamespace(subscription_service=SimpleNamespace(subscriptions=each))
    return services_module.Holdings(internal, "own", {"own", "other"})


def body(found: Any) -> Bounded:
    return Bounded(struct_to_binary(found))


def test_a_session_works_on_its_own_subscriptions_alone() -> None:
    """1 is its own, 2 that of another session of its channel, 3 of another channel."""
    mine, ids = held("own", "other", "stranger"), ua.ObjectIds
    reading = services_module.READING
    modify = reading[ids.ModifySubscriptionRequest_Encoding_DefaultBinary]
    delete = reading[ids.DeleteSubscriptionsRequest_Encoding_DefaultBinary]
    for number in (2, 3, 4):
        one = ua.ModifySubscriptionParameters(number)
        assert status_of(lambda one=one: modify(mine, body(one))) == S.BadSubscriptionIdInvalid
        many = ua.DeleteSubscriptionsParameters([1, number])
        assert status_of(lambda many=many: delete(mine, body(many))) == S.BadSubscriptionIdInvalid
        items = ua.CreateMonitoredItemsParameters(number, ua.TimestampsToReturn.Both, [])
        assert (
            status_of(lambda it=items: services_module._monitor(mine, body(it))) == S.BadSubscriptionIdInvalid
        )
    modify(mine, body(ua.ModifySubscriptionParameters(1)))
    delete(mine, body(ua.DeleteSubscriptionsParameters([1])))
    assert (list(mine.subscriptions()), list(mine.of_channel())) == ([1], [1, 2])


def test_a_channel_has_eight_subscriptions_and_a_thousand_items() -> None:
    asked = ua.CreateSubscriptionParameters()
    assert status_of(lambda: services_module._subscribe(held(*["own", "other"] * 4), body(asked))) == (
        S.BadTooManySubscriptions
    )
    services_module._subscribe(held(*["own", "other", "stranger"] * 3), body(asked))
    one = ua.CreateMonitoredItemsParameters(1, ua.TimestampsToReturn.Both, [ua.MonitoredItemCreateRequest()])
    assert services_module._monitor(held("own", "other", items=499), body(one))
    assert status_of(lambda: services_module._monitor(held("own", "other", items=500), body(one))) == (
        S.BadTooManyMonitoredItems
    )


@pytest.mark.parametrize(
    ("asked_ms", "given_ms"),
    [(0.001, 200.0), (200.0, 200.0), (500.0, 500.0), (1e9, 60_000.0), (math.nan, 200.0)],
)
def test_an_interval_is_no_shorter_than_a_turn_and_no_longer_than_a_minute(
    asked_ms: float, given_ms: float
) -> None:
    asked = ua.CreateSubscriptionParameters(asked_ms)
    made = services_module._subscribe(held(), body(asked))
    assert struct_from_binary(ua.CreateSubscriptionParameters, made).RequestedPublishingInterval == given_ms


def test_who_has_no_subscription_waits_for_nothing_and_acknowledges_its_own_alone() -> None:
    rows = [ua.SubscriptionAcknowledgement(number, 7) for number in (1, 2, 3)]
    asked = ua.PublishParameters(rows)
    assert status_of(lambda: services_module._publish(held("other"), body(asked))) == S.BadNoSubscription
    made = services_module._publish(held("own", "other", "own"), body(asked))
    found = struct_from_binary(ua.PublishParameters, made).SubscriptionAcknowledgements
    assert [row.SubscriptionId for row in found] == [1, 0, 3]


def test_a_null_list_is_an_empty_one() -> None:
    """OPC UA Part 6, section 5.2.5; the library fails on it."""
    delete = services_module.READING[ua.ObjectIds.DeleteMonitoredItemsRequest_Encoding_DefaultBinary]
    made = delete(held("own"), body(ua.DeleteMonitoredItemsParameters(1, None)))
    assert struct_from_binary(ua.DeleteMonitoredItemsParameters, made).MonitoredItemIds == []


@pytest.mark.parametrize(
    ("encoding", "status"), [(2, S.BadDataEncodingUnsupported), (3, S.BadDataEncodingUnsupported)]
)
def test_a_body_that_is_not_in_bytes_is_refused_as_such(encoding: int, status: int) -> None:
    """In XML, OPC UA Part 6, section 5.2.2.15: the library knows none. A type of two bytes, 0 and its number."""
    assert status_of(lambda: _skip_extension(Bounded(bytes([0, 5, encoding])))) == status
    assert _skip_extension(Bounded(bytes([0, 5, 0]))) == 5
