"""OPC UA under attack: a client on the binary wire that keeps to no rule, against a table of what is allowed."""

from __future__ import annotations

import asyncio
import os
import struct
import time
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua import ua  # noqa: E402
from asyncua.common.utils import Buffer  # noqa: E402
from asyncua.crypto.cert_gen import load_private_key  # noqa: E402
from asyncua.crypto.uacrypto import encrypt_rsa15, load_certificate  # noqa: E402
from asyncua.ua.ua_binary import struct_from_binary, struct_to_binary, uatcp_to_binary  # noqa: E402
from cryptography import x509  # noqa: E402
from cryptography.hazmat.primitives.hashes import SHA256  # noqa: E402
from cryptography.hazmat.primitives.serialization import Encoding  # noqa: E402

from gantryctl.gateway.opcua import listener, services  # noqa: E402
from support.opcua_bench import CLIENT, PASSWORD, Bench, Run, sharing  # noqa: E402
from support.opcua_table import ALL, IDENTITIES, POLICIES, SECURE, opens, status_of  # noqa: E402
from support.opcua_wire import CIPHERS, Refused, Wire, password  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore")  # of asyncua itself
MODES = ua.MessageSecurityMode


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    with sharing(tmp_path_factory.mktemp("opcua")) as made:
        yield made


async def differences(wire: Wire, state: str) -> list[tuple[str, str, str]]:
    """Services that answer otherwise than the table says."""
    found = []
    for service, kind in ALL.items():
        if service == "CloseSession":
            continue  # ends the session: last
        said, _ = await wire.ask(kind())
        if said != status_of(service, state):
            found.append((state, service, said))
    return found


async def cell(bench: Bench, policy: str, mode: Any, key: str, identity: str) -> list[Any]:
    """One policy, one certificate or none, one identity: all services in every state that can be reached."""
    may_open = opens(policy, mode.name.strip("_"), key)
    try:
        wire = await bench.open(policy, mode, key)
    except Refused:
        return ["refused"] if may_open else []
    try:
        if not may_open:
            return ["open"]
        if policy == "None":
            found: list[Any] = await differences(wire, "none")
            for certificate in (b"", bench.certificate("client")):
                said = await wire.create(certificate, CLIENT)
                found += [said] if said != "BadSecurityPolicyRejected" else []
                said = await wire.activate(IDENTITIES[identity][1](), signed=False)
                found += [said] if said != "BadSecurityPolicyRejected" else []
            return found
        found = await differences(wire, "open")
        said = await wire.create(bench.certificate("client"), CLIENT)
        found += [said] if said != "Good" else []
        found += await differences(wire, "created")
        expected, token = IDENTITIES[identity]
        said = await wire.activate(token())
        found += [said] if said != expected else []
        found += await differences(wire, "active" if expected == "Good" else "created")
        said, _ = await wire.ask(ua.CloseSessionRequest())
        found += [said] if said != "Good" else []
        said, _ = await wire.ask(ua.ReadRequest())
        return [*found, said] if said != "BadSessionIdInvalid" else found
    finally:
        await bench.hang_up()


def cells(*, whole: bool) -> Iterator[tuple[str, Any, str, str]]:
    """Policy, mode, certificate, identity: every identity on the channels that open, and once on all others."""
    for policy in POLICIES:
        modes = [MODES.None_] if policy == "None" else [MODES.SignAndEncrypt]
        for mode in (MODES.None_, MODES.Sign, MODES.SignAndEncrypt) if whole else modes:
            for key in ("", "client", "stranger"):
                some = ["right", "anonymous"] if opens(policy, mode.name.strip("_"), key) else ["right"]
                for identity in IDENTITIES if whole else some:
                    yield policy, mode, key, identity
    if not whole:
        for policy in SECURE:
            yield policy, MODES.Sign, "client", "right"
            yield policy, MODES.None_, "client", "right"


async def matrix(bench: Bench, *, whole: bool) -> None:
    wrong, count = [], 0
    for policy, mode, key, identity in cells(whole=whole):
        bench.listener.wall.people._rate._buckets.clear()
        bench.listener.wall.people._locks._failures.clear()
        found = await cell(bench, policy, mode, key, identity)
        count += 1
        wrong += [(policy, mode.name, key, identity, each) for each in found]
    assert not wrong, wrong[:5]
    assert count > (200 if whole else 20)


def test_nothing_is_answered_otherwise_than_the_table_says(run: Run) -> None:
    run(lambda bench: matrix(bench, whole=False))


@pytest.mark.slow
def test_nothing_is_answered_otherwise_than_the_whole_table_says(run: Run) -> None:
    run(lambda bench: matrix(bench, whole=True))


def test_a_client_without_certificate_gets_no_session_and_is_not_asked_for_a_password(run: Run) -> None:
    async def check(bench: Bench) -> None:
        wire = await bench.open("None", MODES.None_, "")
        said, _ = await wire.ask(ua.GetEndpointsRequest())
        assert said == "Good"
        assert await wire.create(b"", CLIENT) == "BadSecurityPolicyRejected"
        # As a client that goes on all the same: a password in clear opens nothing.
        assert await wire.activate(password("viewer", PASSWORD), signed=False) == "BadSecurityPolicyRejected"
        assert (await wire.ask(ua.ReadRequest()))[0] == "BadSecurityPolicyRejected"
        assert "OPC UA session" not in bench.texts()

    run(check)


def test_no_request_is_answered_before_a_channel_is_open(run: Run) -> None:
    async def check(bench: Bench) -> None:
        for request in (ua.GetEndpointsRequest(), ua.CreateSessionRequest(), ua.ReadRequest()):
            wire = await bench.wire()
            with pytest.raises(Refused, match=r"BadSecureChannelClosed|closed"):
                await wire.ask(request)

    run(check)


def test_nobody_takes_the_session_of_somebody_else(run: Run) -> None:
    async def check(bench: Bench) -> None:
        (bench.trusted / "stranger.der").write_bytes(bench.certificate("stranger"))
        await bench.listener.sweep()
        mine = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        assert len(mine.token.Identifier) == 32  # random bytes, no number that counts up
        plain = await bench.open("None", MODES.None_, "")
        other = await bench.open("Basic256Sha256", MODES.SignAndEncrypt, "stranger")
        for wire, said in ((plain, "BadSecurityPolicyRejected"), (other, "BadSessionIdInvalid")):
            wire.token, wire.server_nonce = mine.token, mine.server_nonce
            assert await wire.activate(password("viewer", "wrong wrong wrong")) == said
            assert await wire.activate(password("other", PASSWORD)) == said
            assert (await wire.ask(ua.ReadRequest()))[0] == said
        # Its own session does not open mine either, and mine goes on.
        assert await other.create(bench.certificate("stranger"), CLIENT) == "Good"
        assert await other.activate(password("other", PASSWORD)) == "Good"
        assert (await other.ask(ua.ReadRequest(), mine.token))[0] == "BadSessionIdInvalid"
        assert (await mine.ask(ua.ReadRequest()))[0] == "Good"
        subscription = ua.CreateSubscriptionRequest()
        subscription.Parameters.RequestedPublishingInterval = 1000.0
        said, body = await mine.ask(subscription)
        number = struct_from_binary(ua.CreateSubscriptionResult, body).SubscriptionId
        delete = ua.DeleteSubscriptionsRequest()
        delete.Parameters.SubscriptionIds = [number]
        assert (await other.ask(delete))[0] == "BadSubscriptionIdInvalid"
        transfer = ua.TransferSubscriptionsRequest()
        transfer.Parameters.SubscriptionIds = [number]
        assert (await other.ask(transfer))[0] == "BadServiceUnsupported"
        assert (await mine.ask(delete))[0] == "Good"

    run(check)


def test_the_certificate_of_somebody_else_opens_no_session(run: Run) -> None:
    async def check(bench: Bench) -> None:
        # Certificates are public: a stranger names the trusted one in CreateSession.
        with pytest.raises(Refused, match="BadSecurityChecksFailed"):
            await bench.open("Basic256Sha256", MODES.SignAndEncrypt, "stranger")
        assert "not in the trust list" in bench.texts()[-1]
        (bench.trusted / "stranger.der").write_bytes(bench.certificate("stranger"))
        await bench.listener.sweep()
        wire = await bench.open("Basic256Sha256", MODES.SignAndEncrypt, "stranger")
        assert await wire.create(bench.certificate("client"), CLIENT) == "BadCertificateInvalid"
        assert await wire.create(bench.certificate("stranger"), "urn:another") == "BadCertificateUriInvalid"
        # A refused CreateSession leaves nothing behind that could be activated.
        assert await wire.activate(password("viewer", PASSWORD)) == "BadSessionIdInvalid"
        assert await wire.create(bench.certificate("stranger"), CLIENT) == "Good"
        assert (
            await wire.activate(password("viewer", PASSWORD), signed=False)
            == "BadApplicationSignatureInvalid"
        )
        assert (await wire.ask(ua.ReadRequest()))[0] == "BadSessionNotActivated"

    run(check)


async def renewed(wire: Wire, lifetime_ms: int, asked: str = "Renew") -> int:
    """Ask for new keys of an open channel; its lifetime, ms."""
    request = ua.OpenSecureChannelRequest()
    wanted = request.Parameters
    wanted.SecurityMode, wanted.RequestType = MODES.SignAndEncrypt, ua.SecurityTokenRequestType[asked]
    wanted.ClientNonce, wanted.RequestedLifetime = os.urandom(32), lifetime_ms
    data = struct_to_binary(request)
    await wire.say(wire.secure.message_to_binary(data, ua.MessageType.SecureOpen, wire._next()))
    answer = struct_from_binary(ua.OpenSecureChannelResponse, (await wire.hear()).body())
    return int(answer.Parameters.SecurityToken.RevisedLifetime)


def test_a_channel_is_renewed_by_its_own_certificate_only(run: Run) -> None:
    async def check(bench: Bench) -> None:
        (bench.trusted / "stranger.der").write_bytes(bench.certificate("stranger"))
        await bench.listener.sweep()
        wire = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        bench.texts()
        assert await renewed(wire, 60_000) == 60_000
        assert (await wire.ask(ua.ReadRequest()))[0] == "Good"
        # Its own key, and the certificate of somebody else, whose sessions it would be given then.
        wire.secure.security_policy.host_certificate = bench.certificate("stranger")
        with pytest.raises(Refused, match="BadSecurityChecksFailed"):
            await renewed(wire, 60_000)
        assert any("another certificate in a renewal" in text for text in bench.texts())

    run(check)


def test_an_open_channel_is_not_opened_once_more_under_its_sessions(run: Run) -> None:
    async def check(bench: Bench) -> None:
        wire = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        with pytest.raises(Refused, match="BadRequestTypeInvalid"):
            await renewed(wire, 60_000, "Issue")

    run(check)


@pytest.mark.parametrize(
    ("asked_ms", "given_ms"), [(0, 60_000), (60_001, 60_001), (3_600_000, 3_600_000), (2**32 - 1, 3_600_000)]
)
def test_a_channel_that_is_not_renewed_in_time_is_closed(run: Run, asked_ms: int, given_ms: int) -> None:
    """From a minute to an hour, and a quarter more for the renewal (Part 4, section 5.5.2.1)."""

    async def check(bench: Bench) -> None:
        wire = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        (connection,) = bench.listener.connections
        assert await renewed(wire, asked_ms) == given_ms
        left_s = connection.channel._until_s - time.monotonic()
        assert left_s == pytest.approx(1.25e-3 * given_ms, abs=5.0)
        assert (await wire.ask(ua.ReadRequest()))[0] == "Good"
        connection.channel._until_s = time.monotonic() - 1e-3
        with pytest.raises(Refused, match="BadSecureChannelClosed"):
            await wire.ask(ua.ReadRequest())

    run(check)


def test_a_password_in_another_cipher_than_that_of_the_policy_is_not_looked_at(run: Run) -> None:
    """RSA PKCS 1.5 would tell a stranger byte by byte whether a guess decrypts."""

    async def check(bench: Bench) -> None:
        wire = await bench.open("Basic256Sha256", MODES.SignAndEncrypt)
        assert await wire.create(bench.certificate("client"), CLIENT) == "Good"
        server = await load_certificate(str(bench.root / "opcua" / "certificate.der"))
        secret = PASSWORD.encode() + wire.server_nonce
        token = password("viewer", "")
        token.Password = encrypt_rsa15(server.public_key(), struct.pack("<I", len(secret)) + secret)
        token.EncryptionAlgorithm = "http://www.w3.org/2001/04/xmlenc#rsa-1_5"
        assert await wire.activate(token) == "BadIdentityTokenInvalid"
        assert await wire.activate(password("viewer", PASSWORD)) == "Good"

    run(check)


def test_a_client_says_hello_once(run: Run) -> None:
    """The limits of a connection are those of its beginning."""

    async def check(bench: Bench) -> None:
        wire = await bench.wire()
        await wire.say(uatcp_to_binary(ua.MessageType.Hello, ua.Hello(EndpointUrl="opc.tcp://x/")))
        with pytest.raises(Refused, match="BadTcpMessageTypeInvalid"):
            await wire.hear()

    run(check)


def test_an_admitted_login_opens_one_session(run: Run) -> None:
    """Its password stays nowhere: the next session is checked against the file of users again."""

    async def check(bench: Bench) -> None:
        people = bench.listener.wall.people
        assert await people.admit("viewer", PASSWORD, b"certificate", "client", "192.0.2.7")
        asked = (
            ("other", PASSWORD, b"certificate"),
            ("viewer", "wrong", b"certificate"),
            ("viewer", PASSWORD, b""),
        )
        assert [people.get_user(None, *each) for each in asked] == [None] * 3
        assert people.get_user(None, "viewer", PASSWORD, b"certificate").name == "viewer"
        assert people.get_user(None, "viewer", PASSWORD, b"certificate") is None

    run(check)


@pytest.mark.parametrize("how", ["emptied", "revoked", "revocation list damaged"])
def test_taking_trust_away_ends_all_sessions_at_once(run: Run, how: str) -> None:
    async def check(bench: Bench) -> None:
        wires = [await bench.session(policy, MODES.SignAndEncrypt) for policy in SECURE]
        bench.texts()
        if how == "emptied":
            for file in bench.trusted.iterdir():
                file.unlink()
        else:
            revoked = bench.trusted.with_name("revoked") / "list.der"
            revoked.write_bytes(await crl(bench) if how == "revoked" else b"no list")
        await bench.listener.sweep()
        for wire in wires:
            with pytest.raises((Refused, ConnectionError)):
                await wire.ask(ua.ReadRequest())
        assert sum("OPC UA session ended" in text for text in bench.texts()) == len(wires)
        with pytest.raises(Refused, match="BadSecurityChecksFailed"):
            await bench.open("Basic256Sha256", MODES.SignAndEncrypt)

    run(check)


async def crl(bench: Bench) -> bytes:
    """A list that revokes the client."""
    certificate = x509.load_der_x509_certificate(bench.certificate("client"))
    now = datetime.now(UTC)
    row = (
        x509.RevokedCertificateBuilder().serial_number(certificate.serial_number).revocation_date(now).build()
    )
    made = x509.CertificateRevocationListBuilder().issuer_name(certificate.subject).last_update(now)
    made = made.next_update(now + timedelta(days=1)).add_revoked_certificate(row)
    key = await load_private_key(bench.root / "client.pem")
    return made.sign(key, SHA256()).public_bytes(Encoding.DER)


def test_a_list_that_is_empty_from_the_start_trusts_nobody(run: Run) -> None:
    async def check(bench: Bench) -> None:
        for file in bench.trusted.iterdir():
            file.unlink()
        await bench.listener.sweep()
        assert not any(bench.trusted.iterdir())
        with pytest.raises(Refused):
            await bench.open("Basic256Sha256", MODES.SignAndEncrypt)

    run(check)


def test_a_trusted_client_does_not_make_others_trusted(run: Run) -> None:
    async def check(bench: Bench) -> None:
        # The library's own certificates say that they are an authority.
        issuer = x509.load_der_x509_certificate(bench.certificate("client"))
        assert issuer.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
        stranger = x509.load_der_x509_certificate(bench.certificate("stranger"))
        builder = x509.CertificateBuilder().subject_name(stranger.subject).issuer_name(issuer.subject)
        builder = builder.public_key(stranger.public_key()).serial_number(7)
        builder = builder.not_valid_before(stranger.not_valid_before_utc)
        builder = builder.not_valid_after(stranger.not_valid_after_utc)
        for extension in stranger.extensions:
            builder = builder.add_extension(extension.value, extension.critical)
        made = builder.sign(await load_private_key(bench.root / "client.pem"), SHA256())
        (bench.root / "minted.der").write_bytes(made.public_bytes(Encoding.DER))
        (bench.root / "minted.pem").write_bytes((bench.root / "stranger.pem").read_bytes())
        with pytest.raises(Refused, match="BadSecurityChecksFailed"):
            await bench.open("Basic256Sha256", MODES.SignAndEncrypt, "minted")

    run(check)


def test_guessing_locks_the_guesser_out_and_nobody_else(run: Run) -> None:
    async def check(bench: Bench) -> None:
        (bench.trusted / "stranger.der").write_bytes(bench.certificate("stranger"))
        await bench.listener.sweep()
        wire = await bench.open("Basic256Sha256", MODES.SignAndEncrypt, "stranger")
        assert await wire.create(bench.certificate("stranger"), CLIENT) == "Good"
        for _ in range(6):
            assert await wire.activate(password("viewer", "wrong wrong wrong")) == "BadUserAccessDenied"
        # Locked: the right one is refused, too, from this client and for this account.
        assert await wire.activate(password("viewer", PASSWORD)) == "BadUserAccessDenied"
        assert await wire.activate(password("other", PASSWORD)) == "Good"
        mine = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        assert (await mine.ask(ua.ReadRequest()))[0] == "Good"

    run(check)


def test_guesses_with_ever_new_names_cost_no_more_than_a_check_a_second(run: Run) -> None:
    async def check(bench: Bench) -> None:
        wire = await bench.open("Basic256Sha256", MODES.SignAndEncrypt)
        assert await wire.create(bench.certificate("client"), CLIENT) == "Good"
        checked = 0
        people = bench.listener.wall.people
        check_one = people._users.check

        def counted(*how: str) -> Any:
            nonlocal checked
            checked += 1
            return None

        people._users.check = counted
        begin_s = time.monotonic()
        try:
            for n in range(60):
                assert await wire.activate(password(f"name{n}", "wrong wrong wrong")) == "BadUserAccessDenied"
        finally:
            people._users.check = check_one
        # Ten at once, then one a second.
        assert checked <= 10 + (time.monotonic() - begin_s) + 1

    run(check)


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


async def items(wire: Wire, subscription: int, count: int) -> str:
    request = ua.CreateMonitoredItemsRequest()
    request.Parameters.SubscriptionId = subscription
    for _ in range(count):
        item = ua.MonitoredItemCreateRequest()
        item.ItemToMonitor.NodeId = ua.NodeId(ua.ObjectIds.Server_ServerStatus_State)
        item.ItemToMonitor.AttributeId = ua.AttributeIds.Value
        request.Parameters.ItemsToCreate.append(item)
    return (await wire.ask(request))[0]


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


@pytest.mark.parametrize(
    "data",
    [
        struct.pack("<3scI", b"MSG", b"F", 2**31),  # two gigabytes are announced
        struct.pack("<3scI", b"HEL", b"F", 8),  # nothing in it
        struct.pack("<3scI", b"HEL", b"F", 3),
        b"GET / HTTP/1.1\r\n\r\n",
        struct.pack("<3scIII", b"MSG", b"F", 20, 0, 0) + b"\xb1\x0b\x5e\x1f",
        uatcp_to_binary(ua.MessageType.Hello, ua.Hello(ReceiveBufferSize=1, EndpointUrl="")),
    ],
)
def test_what_is_no_opc_ua_is_closed_at_once(run: Run, data: bytes) -> None:
    async def check(bench: Bench) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", bench.port)
        writer.write(data)
        said = await asyncio.wait_for(reader.read(), 2.0)
        assert said[:3] in (b"ERR", b"")
        writer.close()

    run(check)


def test_rubbish_of_a_trusted_client_ends_its_channel_and_nothing_else(run: Run) -> None:
    async def check(bench: Bench) -> None:
        mine = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        bad = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        # A request that cannot be read, then one whose signature is wrong.
        number = bad.secure.message_to_binary(b"\x01\x00\x77\x02" + os.urandom(40), request_id=99)
        await bad.say(number)
        body: Buffer = (await bad.hear()).body()
        assert len(body) > 0
        data = bytearray(bad.secure.message_to_binary(b"\x01\x00\x77\x02" + bytes(60), request_id=100))
        data[-1] ^= 1
        await bad.say(bytes(data))
        with pytest.raises(Refused, match="BadSecurityChecksFailed"):
            await bad.hear()
        assert (await mine.ask(ua.ReadRequest()))[0] == "Good"

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


@pytest.mark.parametrize("length", [16, 31, 33])
def test_the_keys_of_a_channel_come_from_a_nonce_of_32_bytes(
    run: Run, monkeypatch: pytest.MonkeyPatch, length: int
) -> None:
    """Of the offered policies (OPC UA Part 7): a shorter one makes keys that are easier to guess."""
    monkeypatch.setattr(CIPHERS["Basic256Sha256"], "secure_channel_nonce_length", length)

    async def check(bench: Bench) -> None:
        with pytest.raises(Refused, match="BadNonceInvalid"):
            await bench.open("Basic256Sha256", MODES.SignAndEncrypt)

    run(check)


def test_the_token_of_a_session_cannot_be_guessed(run: Run) -> None:
    async def check(bench: Bench) -> None:
        tokens = []
        for _ in range(2):
            wire = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
            tokens.append(wire.token.Identifier)
        assert tokens[0] != tokens[1]
        # Of 32 random bytes 30 are different; 16 or fewer in one of 10^12.
        assert all(len(token) == 32 and len(set(token)) > 16 for token in tokens)

    run(check)
