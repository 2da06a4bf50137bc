"""OPC UA: what a client with the right certificate, name and password sees, and what everybody else does not."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua import Client, ua  # noqa: E402
from asyncua.crypto.cert_gen import (  # noqa: E402
    load_private_key,
    setup_self_signed_certificate,
)
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256  # noqa: E402
from cryptography import x509  # noqa: E402
from cryptography.hazmat.primitives.hashes import SHA256  # noqa: E402
from cryptography.hazmat.primitives.serialization import Encoding  # noqa: E402
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID  # noqa: E402

from gantryctl.gateway.opcua.server import POLICIES, Settings, make_server  # noqa: E402
from gantryctl.service.memory.events import EventLog  # noqa: E402
from gantryctl.service.memory.ring import Ring  # noqa: E402
from gantryctl.service.protocol.roles import Role  # noqa: E402
from gantryctl.service.protocol.tags import TAGS  # noqa: E402
from gantryctl.service.supervisor.users import Users  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore")  # of asyncua itself
PASSWORD = "correct horse battery"
CLIENT = "urn:example:client"


class Bench:
    def __init__(self, root: Path, port: int, server: Any, space: Any, trust: Any, events: Ring) -> None:
        self.root, self.server, self.space, self.trust, self.events = root, server, space, trust, events
        self.address = f"opc.tcp://127.0.0.1:{port}/gantryctl"

    async def client(self, user: str = "viewer", password: str = PASSWORD, key: str = "client") -> Client:
        made = Client(self.address, timeout=5)
        made.application_uri = CLIENT
        if user:
            made.set_user(user)
            made.set_password(password)
        if key:
            await made.set_security(
                SecurityPolicyBasic256Sha256, str(self.root / f"{key}.der"), str(self.root / f"{key}.pem"),
                server_certificate=str(self.root / "opcua" / "certificate.der"),
            )  # fmt: skip
        return made


@asynccontextmanager
async def running(root: Path) -> AsyncIterator[Bench]:
    Users(root).add("viewer", Role.VIEWER, PASSWORD)
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
    settings = Settings("127.0.0.1", port, str(root), str(root))
    server, space, trust = await make_server(settings, EventLog(ring))
    async with server:
        yield Bench(root, port, server, space, trust, ring)


def run(root: Path, check: Callable[[Bench], Awaitable[None]]) -> None:
    async def whole() -> None:
        async with running(root) as bench:
            await asyncio.wait_for(check(bench), 60)

    asyncio.run(whole())


SHOWN = {"axis_state": "continuous_motion", "pos_act_deg": 12.5, "power": True, "scan": 7, "machine": "m",
         "alarms": [{"first_out": True, "code": "CTL-03", "text": "CTL-03 STOP"}]}  # fmt: skip


def test_a_trusted_client_reads_the_axis_and_can_change_nothing(tmp_path: Path) -> None:
    async def check(bench: Bench) -> None:
        await bench.space.show(SHOWN, fresh=True)
        async with await bench.client() as client:
            space = await client.get_namespace_index("urn:gantryctl:axis")

            async def value(name: str) -> Any:
                return await client.get_node(ua.NodeId(name, space)).read_value()

            assert await value("ReadActualPosition.Position") == 12.5
            assert [await value(f"Axis.{name}") for name in ("ContinuousMotion", "Standstill")] == [
                True,
                False,
            ]
            assert await value("Axis.AxisErrorID") == "CTL-03"
            assert [await value(f"Tags.{name}") for name in ("power", "scan", "machine")] == [True, 7, "m"]
            assert json.loads(await value("Tags.alarms"))[0]["code"] == "CTL-03"
            tags = await client.nodes.objects.get_child([f"{space}:Axis", f"{space}:Tags"])
            assert {(await node.read_browse_name()).Name for node in await tags.get_children()} == {
                tag.name for tag in TAGS
            }
            node = client.get_node(ua.NodeId("Tags.pos_act_deg", space))
            for change in (
                node.write_value(1.0),
                client.nodes.objects.add_variable(space, "mine", 1),
                client.nodes.server.call_method("0:GetMonitoredItems", 1),
                node.delete(),
            ):
                with pytest.raises(ua.UaError):
                    await change
            assert await value("Tags.pos_act_deg") == 12.5
            await bench.space.show(SHOWN, fresh=False)
            with pytest.raises(ua.UaStatusCodeError, match="BadNoCommunication"):
                await value("ReadActualPosition.Position")

    run(tmp_path, check)


def test_nobody_else_gets_in(tmp_path: Path) -> None:
    async def check(bench: Bench) -> None:
        wrong: tuple[dict[str, str], ...] = (
            {"key": ""},  # no security
            {"key": "", "user": ""},
            {"user": ""},  # anonymous
            {"user": "admin", "password": ""},
            {"password": "wrong wrong wrong"},
            {"key": "stranger"},  # a certificate that is not trusted
        )
        for how in wrong:
            client = await bench.client(**how)
            with pytest.raises((ua.UaError, ConnectionError, asyncio.TimeoutError, OSError)):
                await client.connect()
        async with await bench.client():
            pass

    run(tmp_path, check)


def texts(events: Ring) -> list[str]:
    """What was written for the journal."""
    found = []
    while (record := events.take()) is not None:
        found.append(json.loads(record)["text"])
    return found


def test_wrong_passwords_are_in_the_journal(tmp_path: Path) -> None:
    async def check(bench: Bench) -> None:
        for _ in range(2):
            client = await bench.client(password="wrong wrong wrong")
            with pytest.raises((ua.UaError, ConnectionError, asyncio.TimeoutError, OSError)):
                await client.connect()
        assert texts(bench.events) == [f"refused: wrong name or password, {n} times" for n in (1, 2)]

    run(tmp_path, check)


@pytest.mark.parametrize("change", ["password", "damaged"])
def test_a_session_ends_when_its_user_is_not_the_same_any_more(tmp_path: Path, change: str) -> None:
    async def check(bench: Bench) -> None:
        users = Users(tmp_path)
        client = await bench.client()
        await client.connect()
        await bench.server.iserver.user_manager.end_sessions(bench.server)
        assert await client.nodes.server_state.read_value() is not None  # nothing has changed yet
        if change == "password":
            users.set_password("viewer", PASSWORD + "!")
        else:
            users.path.write_text("{", encoding="utf-8")
        await bench.server.iserver.user_manager.end_sessions(bench.server)
        with pytest.raises((ua.UaError, ConnectionError, asyncio.TimeoutError, OSError)):
            await client.nodes.server_state.read_value()
        assert texts(bench.events) == ["OPC UA session", "OPC UA session ended: the user has changed"]
        with suppress(ua.UaError, ConnectionError, asyncio.TimeoutError, OSError):
            await client.disconnect()

    run(tmp_path, check)


async def refused(bench: Bench, key: str) -> bool:
    try:
        async with await bench.client(key=key):
            return False
    except (TimeoutError, ua.UaError, ConnectionError, OSError):
        return True


def test_the_trust_list_is_read_again_without_a_new_start(tmp_path: Path) -> None:
    async def refused(bench: Bench, key: str) -> bool:
        try:
            async with await bench.client(key=key):
                return False
        except (TimeoutError, ua.UaError, ConnectionError, OSError):
            return True

    async def check(bench: Bench) -> None:
        trusted = bench.root / "opcua" / "trusted"
        assert await refused(bench, "stranger")
        (trusted / "stranger.der").write_bytes((bench.root / "stranger.der").read_bytes())
        await bench.trust.refresh()
        assert not await refused(bench, "stranger")
        (trusted / "broken.der").write_bytes(b"no certificate")
        await bench.trust.refresh()  # the list before stays in force
        assert not await refused(bench, "stranger")
        (trusted / "broken.der").unlink()
        (trusted / "stranger.der").unlink()
        await bench.trust.refresh()
        assert await refused(bench, "stranger")
        assert not await refused(bench, "client")

    run(tmp_path, check)


def of_client(key: Any, days: int) -> x509.Certificate:
    """A client's certificate whose last day is so far away."""
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "dated")])
    uses = dict.fromkeys(
        ("digital_signature", "content_commitment", "key_encipherment", "data_encipherment"), True
    )
    never = dict.fromkeys(
        ("key_agreement", "key_cert_sign", "crl_sign", "encipher_only", "decipher_only"), False
    )
    now = datetime.now(UTC)
    return (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=10))
        .not_valid_after(now + timedelta(days=days))
        .add_extension(x509.SubjectAlternativeName([x509.UniformResourceIdentifier(CLIENT)]), critical=False)
        .add_extension(x509.KeyUsage(**uses, **never), critical=False)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.CLIENT_AUTH]), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .sign(key, SHA256())
    )


def test_a_client_certificate_that_has_expired_is_refused(tmp_path: Path) -> None:
    async def check(bench: Bench) -> None:
        key = await load_private_key(bench.root / "client.pem")
        (bench.root / "dated.pem").write_bytes((bench.root / "client.pem").read_bytes())
        for days in (1, -1):
            made = of_client(key, days).public_bytes(Encoding.DER)
            (bench.root / "dated.der").write_bytes(made)
            (bench.root / "opcua" / "trusted" / "dated.der").write_bytes(made)
            await bench.trust.refresh()
            assert await refused(bench, "dated") is (days < 0)

    run(tmp_path, check)


def test_only_policies_that_sign_and_encrypt_are_offered(tmp_path: Path) -> None:
    async def check(bench: Bench) -> None:
        offered = await Client(bench.address).connect_and_get_server_endpoints()
        assert len(offered) == len(POLICIES)
        for endpoint in offered:
            assert endpoint.SecurityMode == ua.MessageSecurityMode.SignAndEncrypt
            assert [token.TokenType for token in endpoint.UserIdentityTokens] == [ua.UserTokenType.UserName]
        assert (bench.root / "opcua" / "key.pem").stat().st_mode & 0o077 == 0

    run(tmp_path, check)
