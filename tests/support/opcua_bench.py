"""An OPC UA server in the process of the test, with two users, one trusted client and one stranger."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any, TypeAlias

from asyncua import Client
from asyncua.crypto.cert_gen import load_private_key, setup_self_signed_certificate
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from asyncua.crypto.uacrypto import load_certificate
from cryptography.x509.oid import ExtendedKeyUsageOID

from gantryctl.gateway.opcua.server import Settings, make_server
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.ring import Ring
from gantryctl.service.protocol.roles import Role
from gantryctl.service.supervisor.users import Users
from support.opcua_wire import Wire, password

PASSWORD = "correct horse battery"
CLIENT = "urn:example:client"
USERS = ("viewer", "other")


class Bench:
    """The server, and clients for it."""

    def __init__(self, root: Path, port: int, listener: Any, space: Any, events: Ring) -> None:
        self.root, self.port, self.listener, self.space, self.events = root, port, listener, space, events
        self.address = f"opc.tcp://127.0.0.1:{port}/gantryctl"
        self.trusted = root / "opcua" / "trusted"
        self._wires: list[Wire] = []

    async def client(
        self,
        user: str = "viewer",
        password: str = PASSWORD,
        key: str = "client",
        policy: Any = SecurityPolicyBasic256Sha256,
    ) -> Client:
        """The library's client."""
        made = Client(self.address, timeout=5)
        made.application_uri = CLIENT
        if user:
            made.set_user(user)
            made.set_password(password)
        if key:
            await made.set_security(
                policy, str(self.root / f"{key}.der"), str(self.root / f"{key}.pem"),
                server_certificate=str(self.root / "opcua" / "certificate.der"),
            )  # fmt: skip
        return made

    def certificate(self, key: str) -> bytes:
        """A client's certificate (DER)."""
        return (self.root / f"{key}.der").read_bytes()

    async def wire(self) -> Wire:
        """A connection that has said Hello."""
        self._wires.append(await Wire.connect(self.port))
        return self._wires[-1]

    async def hang_up(self) -> None:
        """Close all connections on the wire."""
        while self._wires:
            await self._wires.pop().close()

    async def open(self, policy: str, mode: Any, key: str = "client") -> Wire:
        """A secure channel on the wire."""
        wire = await self.wire()
        server = await load_certificate(str(self.root / "opcua" / "certificate.der"))
        secret = await load_private_key(self.root / f"{key}.pem") if key else None
        await wire.open(policy, mode, self.certificate(key) if key else b"", secret, server)
        return wire

    async def session(self, policy: str, mode: Any, key: str = "client", user: str = "viewer") -> Wire:
        """A session that is logged in, on the wire."""
        wire = await self.open(policy, mode, key)
        assert await wire.create(self.certificate(key), CLIENT) == "Good"
        assert await wire.activate(password(user, PASSWORD)) == "Good"
        return wire

    def texts(self) -> list[str]:
        """What was written for the journal since the last question."""
        found = []
        while (record := self.events.take()) is not None:
            found.append(json.loads(record)["text"])
        return found


Run: TypeAlias = Callable[[Callable[[Bench], Awaitable[None]]], None]


@asynccontextmanager
async def running(root: Path) -> AsyncIterator[Bench]:
    """A server that runs."""
    for name in USERS:
        Users(root).add(name, Role.VIEWER, PASSWORD)
    uses = [ExtendedKeyUsageOID.CLIENT_AUTH]
    for name in ("client", "stranger"):
        await setup_self_signed_certificate(
            root / f"{name}.pem", root / f"{name}.der", CLIENT, "localhost", uses, {"commonName": name}
        )
    trusted = root / "opcua" / "trusted"
    trusted.mkdir(parents=True)
    (trusted / "client.der").write_bytes((root / "client.der").read_bytes())
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    ring = Ring(memoryview(bytearray(192 + 64 * 1024)), 1024)
    listener, space = await make_server(Settings("127.0.0.1", port, str(root), str(root)), EventLog(ring))
    async with listener:
        yield Bench(root, port, listener, space, ring)


@contextmanager
def sharing(root: Path) -> Iterator[Run]:
    """One server for many checks: its start takes 1.3 s of a processor."""
    with asyncio.Runner() as runner:
        server = running(root)
        bench = runner.run(server.__aenter__())

        def run(check: Callable[[Bench], Awaitable[None]]) -> None:
            runner.run(fresh(bench, check))

        yield run
        runner.run(server.__aexit__(None, None, None))


async def fresh(bench: Bench, check: Callable[[Bench], Awaitable[None]]) -> None:
    """A check, with the trust list and the limits as at the start."""
    people = bench.listener.wall.people
    people._locks._failures.clear()
    people._rate._buckets.clear()
    bench.listener._refused.clear()
    for file in (*bench.trusted.iterdir(), *bench.trusted.with_name("revoked").iterdir()):
        file.unlink()
    (bench.trusted / "client.der").write_bytes(bench.certificate("client"))
    await bench.listener.sweep()
    bench.texts()
    try:
        await asyncio.wait_for(check(bench), 60.0)
    finally:
        await bench.hang_up()
    for connection in list(bench.listener.connections):
        connection.transport.abort()
    while bench.listener.connections:
        await asyncio.sleep(0.01)
