"""The address space of OPC UA: PLCopen's reading blocks as objects, and every tag beside them."""

from __future__ import annotations

import json
import math
from datetime import UTC, datetime, timedelta
from typing import Any, Final

from asyncua import Server, ua

from gantryctl.gateway.opcua.units import information, normal_range
from gantryctl.program import AxisState
from gantryctl.service.protocol.limits import STALE_S
from gantryctl.service.protocol.tags import BY_NAME, TAGS, Tag

NAMESPACE: Final = "urn:gantryctl:axis"
# For trends of supervisory systems; the page has frames of 50 ms.
PERIOD_S: Final = 0.2
GONE_S: Final = 5.0
"""Age from which a value is not shown at all; from `STALE_S` to here it is shown as uncertain."""
_TYPES: Final = {"float": ua.VariantType.Double, "int": ua.VariantType.Int64, "bool": ua.VariantType.Boolean}
_UNKNOWN: Final = {ua.VariantType.Double: math.nan, ua.VariantType.Int64: 0, ua.VariantType.Boolean: False}
_NUMBERS: Final = (
    ("ReadActualPosition", "Position", "pos_act_deg"),
    ("ReadActualVelocity", "Velocity", "vel_act_deg_s"),
    ("ReadActualTorque", "Torque", "torque_act_nm"),
)
# Null means "not believed" for these, and "nothing measures it here, or now" for all others.
_MEASURED: Final = frozenset({"pos_act_deg", "vel_act_deg_s", "torque_act_nm"})


class AddressSpace:
    """The nodes, and what they show."""

    def __init__(self, server: Server) -> None:
        self._server = server
        self._nodes: dict[str, Any] = {}
        self._kinds: dict[str, ua.VariantType] = {}
        self._ranges: dict[str, tuple[Tag, Any]] = {}
        self._shown: dict[str, tuple[object, int]] = {}
        self._limits: dict[str, Any] = {}

    async def build(self) -> None:
        """Make the nodes."""
        space = await self._server.register_namespace(NAMESPACE)
        axis = await self._server.nodes.objects.add_object(space, "Axis")
        status = await axis.add_object(space, "ReadStatus")
        for state in AxisState:
            await self._add(
                status, space, _words(state.name), ua.VariantType.Boolean, f"Axis state {state.name}."
            )
        for block, output, name in _NUMBERS:
            made = await axis.add_object(space, block)
            await self._add_tag(made, space, BY_NAME[name], output, f"{block}.{output}")
        error = await axis.add_object(space, "ReadAxisError")
        await self._add(error, space, "AxisErrorID", ua.VariantType.String, "Code of the first-out alarm.")
        await self._add(error, space, "Text", ua.VariantType.String, "The whole line of it.")
        tags = await axis.add_object(space, "Tags")
        for tag in TAGS:
            await self._add_tag(tags, space, tag, tag.name, f"Tags.{tag.name}")

    async def _add_tag(self, parent: Any, space: int, tag: Tag, name: str, key: str) -> None:
        kind = _TYPES.get(tag.kind, ua.VariantType.String)
        node = await self._add(parent, space, name, kind, f"{tag.meaning} {tag.unit}".strip(), key)
        if tag.kind != "float":
            return
        # The library makes plain variables only.
        plain, analogue = ua.ObjectIds.BaseDataVariableType, ua.ObjectIds.AnalogItemType
        await node.delete_reference(ua.NodeId(plain), ua.ObjectIds.HasTypeDefinition)
        await node.add_reference(ua.NodeId(analogue), ua.ObjectIds.HasTypeDefinition)
        limits = await node.add_property(
            ua.NodeId(f"{key}.EURange", space), ua.QualifiedName("EURange"), normal_range(tag, {})
        )
        await node.add_property(
            ua.NodeId(f"{key}.EngineeringUnits", space),
            ua.QualifiedName("EngineeringUnits"),
            information(tag),
        )
        self._ranges[key] = tag, limits

    async def _add(
        self, parent: Any, space: int, name: str, kind: ua.VariantType, meaning: str, key: str = ""
    ) -> Any:
        start, key = _UNKNOWN.get(kind, ""), key or name
        node_id = ua.NodeId(key if "." in key else f"Axis.{key}", space)
        node = await parent.add_variable(node_id, ua.QualifiedName(name, space), start, kind)
        await node.write_attribute(
            ua.AttributeIds.Description, ua.DataValue(ua.Variant(ua.LocalizedText(meaning)))
        )
        waiting = ua.StatusCode(ua.StatusCodes.BadWaitingForInitialData)
        await node.write_value(ua.DataValue(ua.Variant(start, kind), waiting))
        self._nodes[key], self._kinds[key] = node, kind
        return node

    async def show(self, tags: dict[str, Any], age_ms: float) -> None:
        """Write what has changed; old values are marked as such, never shown as good.

        Args:
            age_ms: of the values; inf before there are any.
        """
        if not tags or not age_ms < math.inf:
            return
        age = _status(age_ms)
        values = {f"Tags.{tag.name}": _value(tag, tags.get(tag.name)) for tag in TAGS}
        state = tags.get("axis_state")
        values |= {_words(each.name): (each.name.lower() == state, 0) for each in AxisState}
        for block, output, name in _NUMBERS:
            values[f"{block}.{output}"] = values[f"Tags.{name}"]
        # PLCopen MC_ReadAxisError: the error that stopped the axis, not those that followed.
        first = next((row for row in tags.get("alarms", []) if row["first_out"]), None)
        values["AxisErrorID"] = (first["code"] if first else "", 0)
        values["Text"] = (first["text"] if first else "", 0)
        at = datetime.now(UTC) - timedelta(milliseconds=age_ms)
        for key, (value, lack) in values.items():
            # Only changes: every write goes through the library's subscriptions.
            shown = (value, lack or age)
            if self._shown.get(key) != shown:
                variant = ua.Variant() if value is None else ua.Variant(value, self._kinds[key])
                data = ua.DataValue(variant, ua.StatusCode(shown[1]), at)
                await self._nodes[key].write_value(data)
                self._shown[key] = shown
        await self._show_ranges(tags)

    async def _show_ranges(self, tags: dict[str, Any]) -> None:
        limits = {tag.name: tags.get(tag.name) for tag in TAGS if tag.rate == "on change"}
        if limits == self._limits:
            return
        self._limits = limits
        for tag, node in self._ranges.values():
            await node.write_value(normal_range(tag, tags))


def _status(age_ms: float) -> int:
    """Status of a value of this age (Part 8, section 6.3)."""
    if age_ms <= STALE_S * 1e3:
        return int(ua.StatusCodes.Good)
    if age_ms <= GONE_S * 1e3:
        return int(ua.StatusCodes.UncertainNoCommunicationLastUsableValue)
    return int(ua.StatusCodes.BadNoCommunication)


def _words(name: str) -> str:
    """AXIS_STATE as PLCopen writes it: AxisState."""
    return "".join(word.capitalize() for word in name.split("_"))


def _value(tag: Tag, value: Any) -> tuple[object, int]:
    """What is shown, and what it lacks: a status, or 0."""
    if tag.kind in ("pairs", "rows", "messages"):
        return json.dumps(value or [], ensure_ascii=False), 0
    if value is None:
        lack = ua.StatusCodes.BadSensorFailure if tag.name in _MEASURED else ua.StatusCodes.BadOutOfService
        return None, int(lack)
    return float(value) if tag.kind == "float" else value, 0
