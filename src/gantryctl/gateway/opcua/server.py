"""Read-only OPC UA server, a separate process: `gantryctl serve --opcua HOST:PORT`; needs the extra `[opcua]`.

Signed and encrypted policies only, user name and password only, client certificates from a trust list only. There are
no methods and no writable variables, and every service that could change something is refused. It reads the shared
memory and has no command ring.
"""

from __future__ import annotations

import asyncio
import json
import math
import os
from pathlib import Path
from typing import Any, Final, NamedTuple

from asyncua import Server, ua
from asyncua.crypto.cert_gen import setup_self_signed_certificate
from asyncua.crypto.permission_rules import USER_TYPES, PermissionRuleset, User, UserRole
from asyncua.crypto.validator import CertificateValidator, CertificateValidatorOptions
from cryptography.x509.oid import ExtendedKeyUsageOID

from gantryctl.gateway.opcua.people import People
from gantryctl.gateway.opcua.trust import TrustList
from gantryctl.program import AxisState
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import SharedMemory, Source
from gantryctl.service.memory.snapshot import Snapshot
from gantryctl.service.protocol.limits import STALE_S
from gantryctl.service.protocol.tags import BY_NAME, TAGS, Tag
from gantryctl.service.realtime import die_with_parent
from gantryctl.service.supervisor.users import Users

NAMESPACE: Final = "urn:gantryctl:axis"
APPLICATION: Final = "urn:gantryctl:server"
# For trends of supervisory systems; the page has frames of 50 ms.
PERIOD_S: Final = 0.2
TRUST_TURNS: Final = 10
"""Periods between two readings of trust list and users."""
# No policy without encryption, and none with SHA-1 (Basic128Rsa15, Basic256: deprecated since OPC UA 1.04).
POLICIES: Final = (
    ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
    ua.SecurityPolicyType.Aes128Sha256RsaOaep_SignAndEncrypt,
    ua.SecurityPolicyType.Aes256Sha256RsaPss_SignAndEncrypt,
)
_FORBIDDEN: Final = (
    ua.ObjectIds.WriteRequest_Encoding_DefaultBinary,
    ua.ObjectIds.CallRequest_Encoding_DefaultBinary,
    ua.ObjectIds.RegisterNodesRequest_Encoding_DefaultBinary,
    ua.ObjectIds.UnregisterNodesRequest_Encoding_DefaultBinary,
)
_TYPES: Final = {"float": ua.VariantType.Double, "int": ua.VariantType.Int64, "bool": ua.VariantType.Boolean}
_UNKNOWN: Final = {ua.VariantType.Double: math.nan, ua.VariantType.Int64: 0, ua.VariantType.Boolean: False}
_NUMBERS: Final = (
    ("ReadActualPosition", "Position", "pos_act_deg"),
    ("ReadActualVelocity", "Velocity", "vel_act_deg_s"),
    ("ReadActualTorque", "Torque", "torque_act_nm"),
)


class Settings(NamedTuple):
    """Arguments of the process.

    Attributes:
        root: state root with the users. directory: the machine's state directory; certificates are in `opcua/`.
    """

    host: str
    port: int
    root: str
    directory: str


class ReadOnly(PermissionRuleset):  # type: ignore[misc]
    """Services that change nothing."""

    def __init__(self) -> None:
        self._allowed = {ua.NodeId(number) for number in USER_TYPES if number not in _FORBIDDEN}

    def check_validity(self, user: User, action_type: ua.NodeId, body: object) -> bool:
        """Allow a logged-in user the services that change nothing."""
        return user.role is UserRole.User and action_type in self._allowed


class AddressSpace:
    """PLCopen's reading blocks as objects, and every tag beside them."""

    def __init__(self, server: Server) -> None:
        self._server = server
        self._nodes: dict[str, Any] = {}
        self._kinds: dict[str, ua.VariantType] = {}
        self._shown: dict[str, object] = {}
        self._fresh: bool | None = None

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
            meaning = f"{BY_NAME[name].meaning} {BY_NAME[name].unit}"
            await self._add(made, space, output, ua.VariantType.Double, meaning, f"{block}.{output}")
        error = await axis.add_object(space, "ReadAxisError")
        await self._add(error, space, "AxisErrorID", ua.VariantType.String, "Code of the first-out alarm.")
        await self._add(error, space, "Text", ua.VariantType.String, "The whole line of it.")
        tags = await axis.add_object(space, "Tags")
        for tag in TAGS:
            kind = _TYPES.get(tag.kind, ua.VariantType.String)
            meaning = f"{tag.meaning} {tag.unit}".strip()
            await self._add(tags, space, tag.name, kind, meaning, f"Tags.{tag.name}")

    async def _add(
        self, parent: Any, space: int, name: str, kind: ua.VariantType, meaning: str, key: str = ""
    ) -> None:
        start, key = _UNKNOWN.get(kind, ""), key or name
        node_id = ua.NodeId(key if "." in key else f"Axis.{key}", space)
        node = await parent.add_variable(node_id, ua.QualifiedName(name, space), start, kind)
        await node.write_attribute(
            ua.AttributeIds.Description, ua.DataValue(ua.Variant(ua.LocalizedText(meaning)))
        )
        self._nodes[key], self._kinds[key] = node, kind

    async def show(self, tags: dict[str, Any], fresh: bool) -> None:
        """Write what has changed; old values are marked as such, never shown as good."""
        values: dict[str, object] = {f"Tags.{tag.name}": _value(tag, tags.get(tag.name)) for tag in TAGS}
        state = tags.get("axis_state")
        values |= {_words(each.name): each.name.lower() == state for each in AxisState}
        for block, output, name in _NUMBERS:
            values[f"{block}.{output}"] = values[f"Tags.{name}"]
        # PLCopen MC_ReadAxisError: the error that stopped the axis, not those that followed.
        first = next((row for row in tags.get("alarms", []) if row["first_out"]), None)
        values["AxisErrorID"], values["Text"] = (first["code"], first["text"]) if first else ("", "")
        status = ua.StatusCodes.Good if fresh else ua.StatusCodes.BadNoCommunication
        for key, value in values.items():
            # Only changes: every write goes through asyncua's subscriptions.
            if fresh is not self._fresh or self._shown.get(key) != value:
                data = ua.DataValue(ua.Variant(value, self._kinds[key]), ua.StatusCode(status))
                await self._nodes[key].write_value(data)
        self._shown, self._fresh = values, fresh


def _words(name: str) -> str:
    """AXIS_STATE as PLCopen writes it: AxisState."""
    return "".join(word.capitalize() for word in name.split("_"))


def _value(tag: Tag, value: Any) -> object:
    if tag.kind in ("rows", "messages"):
        return json.dumps(value or [], ensure_ascii=False)
    if value is None:
        return _UNKNOWN.get(_TYPES.get(tag.kind, ua.VariantType.String), "")
    return float(value) if tag.kind == "float" else value


async def make_server(settings: Settings, events: EventLog) -> tuple[Server, AddressSpace, TrustList]:
    """Prepare a server.

    Its certificate is made once; the private key is readable by its owner only. Clients whose certificate is not in
    `opcua/trusted/` (DER) are refused.
    """
    folder = Path(settings.directory) / "opcua"
    trust = TrustList(folder, events)
    key, certificate = folder / "key.pem", folder / "certificate.der"
    server = Server(user_manager=People(Users(Path(settings.root)), events))
    server.name, server.manufacturer_name, server.product_uri = (
        "gantryctl",
        "gantryctl contributors",
        APPLICATION,
    )
    # asyncua makes a user named "admin" an administrator unless this is off.
    server.iserver.allow_remote_admin = False
    server.iserver.max_connections, server.iserver.max_subscriptions = 32, 64
    server.iserver.max_pending_activation_seconds = 5.0
    server.limits.max_message_size, server.limits.max_chunk_count = 2**20, 16
    await server.init()
    await server.set_application_uri(APPLICATION)
    server.set_endpoint(f"opc.tcp://{settings.host}:{settings.port}/gantryctl")
    server.set_security_policy(list(POLICIES), permission_ruleset=ReadOnly())
    server.set_identity_tokens([ua.UserNameIdentityToken])
    # asyncua writes the private key with the umask of the process.
    before = os.umask(0o077)
    try:
        uses = [ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH]
        await setup_self_signed_certificate(
            key, certificate, APPLICATION, settings.host, uses, {"commonName": "gantryctl"}
        )
    finally:
        os.umask(before)
    await server.load_certificate(str(certificate))
    await server.load_private_key(str(key))
    trust.never_empty(certificate)
    await trust.refresh()
    options = CertificateValidatorOptions.TRUSTED_VALIDATION | CertificateValidatorOptions.PEER_CLIENT
    server.set_certificate_validator(CertificateValidator(options, trust.store))
    space = AddressSpace(server)
    await space.build()
    return server, space, trust


async def serve(settings: Settings, memory: SharedMemory) -> None:
    """Serve until cancelled."""
    server, space, trust = await make_server(settings, EventLog(memory.events[Source.OPCUA]))
    picture, turn = Snapshot(memory), 0
    async with server:
        while True:
            fast, age_ms = picture.fast()
            await space.show({**fast, **picture.slow()}, age_ms <= STALE_S * 1e3)
            turn += 1
            if turn % TRUST_TURNS == 0:
                await trust.refresh()
                await server.iserver.user_manager.end_sessions(server)
            await asyncio.sleep(PERIOD_S)


def main(arguments: list[str]) -> int:
    """Entry point of the process."""
    memory = SharedMemory(int(arguments[1]))
    die_with_parent()
    # Its start costs seconds of a processor and its clients may keep it busy (decision 0011).
    os.nice(5)
    asyncio.run(serve(Settings(**json.loads(arguments[0])), memory))
    return 0
