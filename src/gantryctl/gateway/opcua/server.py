"""Read-only OPC UA server, a separate process: `gantryctl serve --opcua HOST:PORT`; needs the extra `[opcua]`.

Signed and encrypted policies only, user name and password only, client certificates from a trust list only. There are
no methods and no writable variables, and every service that could change something is refused. It reads the shared
memory and has no command ring.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

from asyncua import Server, ua
from asyncua.crypto.cert_gen import setup_self_signed_certificate
from cryptography.x509.oid import ExtendedKeyUsageOID

from gantryctl.gateway.opcua.channel import MESSAGE_MAX, Sessions, Wall
from gantryctl.gateway.opcua.listener import Listener
from gantryctl.gateway.opcua.people import People
from gantryctl.gateway.opcua.services import (
    ITEMS_MAX,
    NODES_MAX,
    PATHS_MAX,
    QUEUE_MAX,
    SUBSCRIPTIONS_MAX,
)
from gantryctl.gateway.opcua.space import PERIOD_S, AddressSpace
from gantryctl.gateway.opcua.trust import TrustList
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.held_up import HeldUp
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.memory.snapshot import Snapshot
from gantryctl.service.realtime import die_with_parent
from gantryctl.service.supervisor.users import Users

APPLICATION: Final = "urn:gantryctl:server"
# No policy without encryption, and none with SHA-1 (Basic128Rsa15, Basic256: deprecated since OPC UA 1.04).
POLICIES: Final = (
    ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
    ua.SecurityPolicyType.Aes128Sha256RsaOaep_SignAndEncrypt,
    ua.SecurityPolicyType.Aes256Sha256RsaPss_SignAndEncrypt,
)
SESSION_MAX_MS: Final = 60_000.0
"""Longest time that a silent session lives."""
# Messages of a subscription that nobody has acknowledged.
_UNACKNOWLEDGED_MAX: Final = 20
# What the server says of its limits (Part 5, section 6.3.11).
_SAID: Final = {
    "MaxNodesPerRead": NODES_MAX,
    "MaxNodesPerRegisterNodes": NODES_MAX,
    "MaxNodesPerBrowse": PATHS_MAX,
    "MaxNodesPerTranslateBrowsePathsToNodeIds": PATHS_MAX,
    "MaxMonitoredItemsPerCall": ITEMS_MAX,
}


class Settings(NamedTuple):
    """Arguments of the process.

    Attributes:
        root: state root with the users. directory: the machine's state directory; certificates are in `opcua/`.
    """

    host: str
    port: int
    root: str
    directory: str


async def make_server(settings: Settings, events: EventLog) -> tuple[Listener, AddressSpace]:
    """Prepare a server.

    Its certificate is made once; the private key is readable by its owner only. Clients whose certificate is not in
    `opcua/trusted/` are refused.
    """
    folder = Path(settings.directory) / "opcua"
    trust, people = TrustList(folder, events), People(Users(Path(settings.root)), events)
    internal = Sessions(user_manager=people)
    # The library makes a user named "admin" an administrator unless this is off.
    internal.allow_remote_admin = False
    internal.supported_tokens = (ua.UserNameIdentityToken,)
    internal.max_session_timeout_ms = SESSION_MAX_MS
    internal.max_monitored_item_queue_size = QUEUE_MAX
    internal.max_unacked_messages_per_subscription = _UNACKNOWLEDGED_MAX
    server = Server(internal)
    server.name, server.manufacturer_name, server.product_uri = (
        "gantryctl",
        "gantryctl contributors",
        APPLICATION,
    )
    server.limits.max_message_size, server.limits.max_chunk_count = MESSAGE_MAX, 16
    server.application_type = ua.ApplicationType.Server
    await server.init()
    await _say_limits(server)
    await server.set_application_uri(APPLICATION)
    server.set_endpoint(f"opc.tcp://{settings.host}:{settings.port}/gantryctl")
    server.set_security_policy(list(POLICIES))
    await _identify(server, folder, settings.host)
    trust.refresh()
    # The library would listen by itself, without a gate; it makes its policies when it begins to.
    await server._setup_server_nodes()
    policies = {policy.cls.URI: policy for policy in server._policies}
    space = AddressSpace(server)
    await space.build()
    wall = Wall(internal, policies, trust, people, server.limits)
    return Listener(wall, settings.host, settings.port), space


async def _identify(server: Server, folder: Path, host: str) -> None:
    """Load certificate and key of the server, which are made when they are missing."""
    key, certificate = folder / "key.pem", folder / "certificate.der"
    # The library writes the private key with the umask of the process.
    before = os.umask(0o077)
    try:
        uses = [ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH]
        await setup_self_signed_certificate(
            key, certificate, APPLICATION, host, uses, {"commonName": "gantryctl"}
        )
    finally:
        os.umask(before)
    await server.load_certificate(str(certificate))
    await server.load_private_key(str(key))


async def _say_limits(server: Server) -> None:
    said: dict[str, Any] = {f"OperationLimits_{name}": value for name, value in _SAID.items()}
    said |= {"MaxSubscriptionsPerSession": SUBSCRIPTIONS_MAX, "MaxMonitoredItems": ITEMS_MAX}
    for name, value in said.items():
        node = server.get_node(ua.NodeId(getattr(ua.ObjectIds, f"Server_ServerCapabilities_{name}")))
        await node.write_value(ua.DataValue(ua.Variant(value, ua.VariantType.UInt32)))


async def serve(settings: Settings, memory: SharedMemory) -> None:
    """Serve until cancelled."""
    events = EventLog(memory.events[Source.OPCUA])
    listener, space = await make_server(settings, events)
    picture, held_up = Snapshot(memory), HeldUp("opcua", partial(events.put, "service"))
    async with listener:
        while True:
            held_up.look()
            fast, age_ms = picture.fast()
            await space.show({**fast, **picture.slow()}, age_ms)
            await listener.sweep()
            await asyncio.sleep(PERIOD_S)


def main(arguments: list[str]) -> int:
    """Entry point of the process."""
    memory = SharedMemory(int(arguments[1]))
    die_with_parent(memory.words[Word.SUPERVISOR])
    # Its start costs seconds of a processor and its clients may keep it busy (decision 0011).
    os.nice(5)
    # What clients do wrong stands in the journal, thinned out; the library would write lines for each, without a limit.
    logging.getLogger("asyncua").setLevel(logging.CRITICAL)
    asyncio.run(serve(Settings(**json.loads(arguments[0])), memory))
    return 0
