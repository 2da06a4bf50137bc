"""An OPC UA client that subscribes to the axis, in a thread of its own."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from asyncua import Client, ua
from asyncua.crypto.cert_gen import setup_self_signed_certificate
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from cryptography.x509.oid import ExtendedKeyUsageOID

from support.service_process import PASSWORD

logging.getLogger("asyncua").setLevel(logging.ERROR)
APPLICATION = "urn:example:client"
SHOWN = ("pos_act_deg", "vel_act_deg_s", "torque_act_nm", "axis_state", "scan", "pos_err_deg")


class Keys(NamedTuple):
    """Files of a client, and of the server."""

    certificate: Path
    key: Path
    server: Path


async def trusted_client(folder: Path, opcua: Path) -> Keys:
    """A certificate that the server will trust: made before it starts."""
    made = Keys(folder / "client.der", folder / "client.pem", opcua / "certificate.der")
    uses = [ExtendedKeyUsageOID.CLIENT_AUTH]
    await setup_self_signed_certificate(
        made.key, made.certificate, APPLICATION, "localhost", uses, {"commonName": "client"}
    )
    trusted = opcua / "trusted"
    trusted.mkdir(parents=True, exist_ok=True)
    (trusted / "client.der").write_bytes(made.certificate.read_bytes())
    return made


class _Count:
    """Counts what a subscription brings."""

    def __init__(self) -> None:
        self.changes = 0

    def datachange_notification(self, *_: Any) -> None:
        self.changes += 1


async def _look(address: str, keys: Keys, count: _Count, ended: threading.Event) -> None:
    client = Client(address, timeout=20)
    client.application_uri = APPLICATION
    client.set_user("viewer")
    client.set_password(PASSWORD)
    while not keys.server.exists():
        await asyncio.sleep(0.1)
    await client.set_security(
        SecurityPolicyBasic256Sha256,
        str(keys.certificate),
        str(keys.key),
        server_certificate=str(keys.server),
    )
    for _ in range(50):  # until it listens
        try:
            await client.connect()
            break
        except OSError:
            await asyncio.sleep(0.2)
    try:
        space = await client.get_namespace_index("urn:gantryctl:axis")
        subscription = await client.create_subscription(200, count)
        nodes = [client.get_node(ua.NodeId(f"Tags.{name}", space)) for name in SHOWN]
        await subscription.subscribe_data_change(nodes)
        while not ended.is_set():
            await asyncio.sleep(0.1)
    finally:
        await client.disconnect()


@contextmanager
def looking(address: str, keys: Keys) -> Iterator[Callable[[], int]]:
    """Subscribed; yields the number of changes so far as a function."""
    count, ended = _Count(), threading.Event()
    thread = threading.Thread(target=lambda: asyncio.run(_look(address, keys, count, ended)), daemon=True)
    thread.start()
    try:
        yield lambda: count.changes if thread.is_alive() else 0
    finally:
        ended.set()
        thread.join(30.0)
