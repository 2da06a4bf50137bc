"""The services of OPC UA that a client may use, and how much of each; what is not in the tables is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from asyncua import ua
from asyncua.common.utils import Buffer, ServiceError
from asyncua.ua.ua_binary import struct_from_binary, struct_to_binary

from gantryctl.gateway.opcua.reading import Bounded, judge_filters
from gantryctl.gateway.opcua.space import PERIOD_S

NODES_MAX: Final = 1000
"""Nodes in one request to read or to register."""
PATHS_MAX: Final = 100
"""Nodes in one request to browse, or browse paths: their answers are long."""
SUBSCRIPTIONS_MAX: Final = 8
"""Of all sessions of one channel."""
ITEMS_MAX: Final = 1000
"""Monitored items of all sessions of one channel."""
INTERVAL_MAX_MS: Final = 60_000.0
"""Longest publishing interval."""
QUEUE_MAX: Final = 10
"""Values of a monitored item that wait: times items and messages that nobody has acknowledged, memory of a client."""


def _named(*names: str) -> frozenset[int]:
    return frozenset(getattr(ua.ObjectIds, f"{name}Request_Encoding_DefaultBinary") for name in names)


# OPC UA Part 4, section 5.4: for clients that do not know yet which policy they need.
DISCOVERY: Final = _named("FindServers", "GetEndpoints")
CREATE, ACTIVATE, CLOSE = (
    ua.ObjectIds.CreateSessionRequest_Encoding_DefaultBinary,
    ua.ObjectIds.ActivateSessionRequest_Encoding_DefaultBinary,
    ua.ObjectIds.CloseSessionRequest_Encoding_DefaultBinary,
)
# Services that change something: nobody may, and the status reports it. All others are not there.
CHANGES: Final = _named(
    "Write", "Call", "HistoryUpdate", "AddNodes", "DeleteNodes", "AddReferences", "DeleteReferences"
)


class Holdings:
    """What one session holds in asyncua's server, and all of its channel: subscriptions, and their monitored items.

    Args:
        session: its number. beside: those of all sessions of the channel, this one among them.
    """

    def __init__(self, internal: Any, session: Any, beside: set[Any]) -> None:
        self._internal, self._session, self._beside = internal, session, beside

    def subscriptions(self) -> dict[int, Any]:
        """Subscriptions of the session by their number."""
        return {n: each for n, each in self.of_channel().items() if each.session_id == self._session}

    def of_channel(self) -> dict[int, Any]:
        """Subscriptions of all sessions of the channel by their number."""
        found = self._internal.subscription_service.subscriptions
        return {n: each for n, each in found.items() if each.session_id in self._beside}

    def items(self) -> int:
        """Number of monitored items of all sessions of the channel."""
        # asyncua keeps them private, and has no limit of its own.
        return sum(len(each.monitored_item_srv._monitored_items) for each in self.of_channel().values())

    def must_own(self, *numbers: int) -> None:
        """Raise ServiceError for a subscription of somebody else: asyncua takes any number from anybody."""
        if not set(numbers) <= self.subscriptions().keys():
            raise ServiceError(ua.StatusCodes.BadSubscriptionIdInvalid)


Rule = Callable[[Holdings, Bounded], Buffer]


def _with_list(found: Any, name: str) -> list[Any]:
    """A list of the parameters; a null array means an empty one (Part 6, section 5.2.5), and asyncua fails on it."""
    if getattr(found, name) is None:
        setattr(found, name, [])
    return list(getattr(found, name))


def _list(parameters: Any, name: str, most: int) -> Rule:
    def rule(_: Holdings, body: Bounded) -> Buffer:
        found = struct_from_binary(parameters, body)
        if len(_with_list(found, name)) > most:
            raise ServiceError(ua.StatusCodes.BadTooManyOperations)
        return Buffer(struct_to_binary(found))

    return rule


def _of_one(parameters: Any, name: str = "") -> Rule:
    """Of one subscription of its own; `name` is that of its list, if the request has one."""

    def rule(held: Holdings, body: Bounded) -> Buffer:
        found = struct_from_binary(parameters, body)
        held.must_own(found.SubscriptionId)
        if name:
            _with_list(found, name)
        return Buffer(struct_to_binary(found))

    return rule


def _of_many(parameters: Any) -> Rule:
    def rule(held: Holdings, body: Bounded) -> Buffer:
        found = struct_from_binary(parameters, body)
        held.must_own(*_with_list(found, "SubscriptionIds"))
        return Buffer(struct_to_binary(found))

    return rule


def _subscribe(held: Holdings, body: Bounded) -> Buffer:
    if len(held.of_channel()) >= SUBSCRIPTIONS_MAX:
        raise ServiceError(ua.StatusCodes.BadTooManySubscriptions)
    found = struct_from_binary(ua.CreateSubscriptionParameters, body)
    # asyncua takes any interval, and one of a microsecond would take the processor; NaN fails every comparison.
    wanted = found.RequestedPublishingInterval
    shortest = PERIOD_S * 1e3
    found.RequestedPublishingInterval = min(wanted, INTERVAL_MAX_MS) if wanted >= shortest else shortest
    return Buffer(struct_to_binary(found))


def _monitor(held: Holdings, body: Bounded) -> Buffer:
    judge_filters(body.copy(), new=True)
    found = struct_from_binary(ua.CreateMonitoredItemsParameters, body)
    held.must_own(found.SubscriptionId)
    if held.items() + len(found.ItemsToCreate) > ITEMS_MAX:
        raise ServiceError(ua.StatusCodes.BadTooManyMonitoredItems)
    for item in found.ItemsToCreate:
        _without_deadband(item.RequestedParameters)
    return Buffer(struct_to_binary(found))


def _modify(held: Holdings, body: Bounded) -> Buffer:
    judge_filters(body.copy(), new=False)
    found = struct_from_binary(ua.ModifyMonitoredItemsParameters, body)
    held.must_own(found.SubscriptionId)
    for item in found.ItemsToModify:
        _without_deadband(item.RequestedParameters)
        # asyncua has its limit where an item is made, and none here: of 0, which asks for the longest, no value goes.
        asked = item.RequestedParameters.QueueSize
        item.RequestedParameters.QueueSize = min(asked or QUEUE_MAX, QUEUE_MAX)
    return Buffer(struct_to_binary(found))


def _without_deadband(wanted: Any) -> None:
    # With a deadband asyncua subtracts values and fails where one is missing: the client would not be told that a
    # value has gone bad. So it is told every change.
    if hasattr(wanted.Filter, "DeadbandType"):  # asyncua has two classes of that name
        wanted.Filter.DeadbandType, wanted.Filter.DeadbandValue = ua.DeadbandType.None_, 0.0


def _publish(held: Holdings, body: Bounded) -> Buffer:
    found, own = struct_from_binary(ua.PublishParameters, body), held.subscriptions()
    if not own:
        raise ServiceError(ua.StatusCodes.BadNoSubscription)
    for row in found.SubscriptionAcknowledgements:
        if row.SubscriptionId not in own:
            row.SubscriptionId = 0  # answered with BadSubscriptionIdInvalid
    return Buffer(struct_to_binary(found))


_IDS: Final = ua.ObjectIds
# Services for a session that is logged in.
READING: Final[dict[int, Rule]] = {
    _IDS.ReadRequest_Encoding_DefaultBinary: _list(ua.ReadParameters, "NodesToRead", NODES_MAX),
    _IDS.BrowseRequest_Encoding_DefaultBinary: _list(ua.BrowseParameters, "NodesToBrowse", PATHS_MAX),
    _IDS.TranslateBrowsePathsToNodeIdsRequest_Encoding_DefaultBinary: _list(
        ua.TranslateBrowsePathsToNodeIdsParameters, "BrowsePaths", PATHS_MAX
    ),
    _IDS.RegisterNodesRequest_Encoding_DefaultBinary: _list(
        ua.RegisterNodesParameters, "NodesToRegister", NODES_MAX
    ),
    _IDS.UnregisterNodesRequest_Encoding_DefaultBinary: _list(
        ua.UnregisterNodesParameters, "NodesToUnregister", NODES_MAX
    ),
    _IDS.CreateSubscriptionRequest_Encoding_DefaultBinary: _subscribe,
    _IDS.ModifySubscriptionRequest_Encoding_DefaultBinary: _of_one(ua.ModifySubscriptionParameters),
    _IDS.DeleteSubscriptionsRequest_Encoding_DefaultBinary: _of_many(ua.DeleteSubscriptionsParameters),
    _IDS.SetPublishingModeRequest_Encoding_DefaultBinary: _of_many(ua.SetPublishingModeParameters),
    _IDS.CreateMonitoredItemsRequest_Encoding_DefaultBinary: _monitor,
    _IDS.ModifyMonitoredItemsRequest_Encoding_DefaultBinary: _modify,
    _IDS.DeleteMonitoredItemsRequest_Encoding_DefaultBinary: _of_one(
        ua.DeleteMonitoredItemsParameters, "MonitoredItemIds"
    ),
    _IDS.SetMonitoringModeRequest_Encoding_DefaultBinary: _of_one(
        ua.SetMonitoringModeParameters, "MonitoredItemIds"
    ),
    _IDS.PublishRequest_Encoding_DefaultBinary: _publish,
    _IDS.RepublishRequest_Encoding_DefaultBinary: _of_one(ua.RepublishParameters),
}
