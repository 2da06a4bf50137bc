"""A channel of OPC UA, by hand: its opening, its sessions, its requests and its end."""

from __future__ import annotations

import asyncio
import math
from types import SimpleNamespace
from typing import Any

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua import ua  # noqa: E402
from asyncua.common.utils import ServiceError  # noqa: E402
from asyncua.crypto.permission_rules import UserRole  # noqa: E402
from asyncua.ua.ua_binary import struct_to_binary  # noqa: E402

from gantryctl.gateway.opcua import channel as channel_module  # noqa: E402
from gantryctl.gateway.opcua import services as services_module  # noqa: E402
from gantryctl.gateway.opcua import trust  # noqa: E402
from gantryctl.gateway.opcua.people import Reader  # noqa: E402
from gantryctl.gateway.opcua.reading import Bounded  # noqa: E402
from gantryctl.service.protocol.roles import Role  # noqa: E402
from support.opcua_by_hand import ANNA, S, status_of  # noqa: E402


@pytest.mark.parametrize(
    ("logged_in", "closed"),
    [
        ((True, False, True, False), 1),
        ((False, False, True, True), 0),
        ((True, True, True), None),
        ((), None),
    ],
)
def test_the_oldest_session_that_is_not_logged_in_makes_room_for_a_fifth(
    monkeypatch: pytest.MonkeyPatch, logged_in: tuple[bool, ...], closed: int | None
) -> None:
    ended: list[int] = []

    def one(number: int, activated: bool) -> Any:
        async def close() -> None:
            ended.append(number)

        return SimpleNamespace(
            number=number, close=close, session=SimpleNamespace(is_activated=lambda: activated)
        )

    monkeypatch.setattr(channel_module, "Answers", lambda *_: SimpleNamespace(number=9))
    made: Any = object.__new__(channel_module.Channel)
    made._sessions = [one(number, activated) for number, activated in enumerate(logged_in)]
    made._wall, made._transport, made._secure = SimpleNamespace(internal=None, limits=None), None, "secure"
    asyncio.run(made._room())
    assert ended == ([] if closed is None else [closed])
    left = [number for number in range(len(logged_in)) if number != closed]
    assert [each.number for each in made._sessions] == [*left, 9]
    assert made._sessions[-1]._connection == "secure"


def test_four_sessions_that_are_logged_in_leave_no_room() -> None:
    made: Any = object.__new__(channel_module.Channel)
    made._sessions = [SimpleNamespace(session=SimpleNamespace(is_activated=lambda: True))] * 4
    with pytest.raises(ServiceError) as refused:
        asyncio.run(made._room())
    assert refused.value.code == S.BadTooManySessions


class Held:
    """A session of a channel: of a user, and whether it was activated; what ended is in `did`."""

    def __init__(self, did: list[str], user: Reader | None, activated: bool = True) -> None:
        async def closes(what: str) -> None:
            did.append(what)

        self.close = lambda: closes("answers")
        self.session: Any = None
        if user is not None:
            self.session = SimpleNamespace(
                user=user,
                is_activated=lambda: activated,
                close_session=lambda with_subscriptions: closes(f"session, {with_subscriptions}"),
            )


def channel_of(certificate: bytes, *sessions: Held, judge: Any = None) -> Any:
    channel: Any = object.__new__(channel_module.Channel)
    channel.certificate, channel._sessions = certificate, list(sessions)
    channel._wall = SimpleNamespace(trust=SimpleNamespace(judge=judge))
    return channel


def test_the_readers_of_a_channel_are_those_who_are_logged_in() -> None:
    anna = Reader(UserRole.User, "anna", ANNA)
    channel = channel_of(b"", Held([], None), Held([], anna, activated=False), Held([], anna))
    assert channel.readers == [anna]


def test_a_channel_goes_on_while_its_certificate_is_trusted_and_its_user_is_as_before() -> None:
    def refuses(certificate: bytes) -> None:
        raise trust.NotTrusted("the certificate is revoked")

    anna = Reader(UserRole.User, "anna", ANNA)
    for judge, certificate, users, why in (
        (lambda _: None, b"c", {"anna": ANNA}, ""),
        (refuses, b"c", {"anna": ANNA}, "the certificate is revoked"),
        (refuses, b"", {"anna": ANNA}, ""),
        (lambda _: None, b"c", {"anna": ANNA._replace(role=Role.ADMIN)}, "the user has changed"),
        (lambda _: None, b"c", {}, "the user has changed"),
    ):
        assert channel_of(certificate, Held([], anna), judge=judge).lapsed(users) == why


def test_the_end_of_a_channel_ends_its_subscriptions_too() -> None:
    """Nobody may find them on another channel."""
    did: list[str] = []
    asyncio.run(channel_of(b"", Held(did, Reader(UserRole.User, "anna", ANNA)), Held(did, None)).end())
    assert did == ["answers", "session, True", "answers"]


def test_a_client_that_closes_its_channel_is_let_go() -> None:
    channel = channel_of(b"certificate")
    channel._greeted, channel._open, channel._until_s = True, True, math.inf
    channel._received = lambda header, body: None
    for kind, goes_on in ((ua.MessageType.SecureMessage, True), (ua.MessageType.SecureClose, False)):
        assert asyncio.run(channel.take(SimpleNamespace(MessageType=kind), None)) is goes_on
    channel._until_s = 0.0
    with pytest.raises(channel_module.ChannelRefused):
        asyncio.run(channel.take(SimpleNamespace(MessageType=ua.MessageType.SecureMessage), None))


def test_nothing_comes_before_hello() -> None:
    """By it the lengths of chunks are agreed on."""
    channel = channel_of(b"")
    channel._greeted = channel._open = False
    opened: list[Any] = []
    channel._open_channel = lambda *what: opened.append(what)
    for kind in (ua.MessageType.SecureOpen, ua.MessageType.SecureMessage, ua.MessageType.SecureClose):
        with pytest.raises(channel_module.ChannelRefused) as refused:
            asyncio.run(channel.take(SimpleNamespace(MessageType=kind), None))
        assert refused.value.status == S.BadTcpMessageTypeInvalid
    assert not opened


def test_a_session_that_was_closed_takes_no_room() -> None:
    channel = channel_of(b"certificate")
    for state in ("Closed", "Activated", "Created"):
        session = SimpleNamespace(state=SimpleNamespace(name=state))
        channel._sessions.append(SimpleNamespace(session=session))
    channel._sessions.append(SimpleNamespace(session=None))
    channel._may_create = lambda body: None

    async def room() -> str:
        return "room"

    channel._room = room
    assert asyncio.run(channel._judged(channel_module.CREATE, None, None)) == ("room", None)
    assert [each.session.state.name for each in channel._sessions] == ["Activated", "Created"]


@pytest.mark.parametrize(
    ("token", "activated", "user", "status"),
    [
        ("other", True, Reader(UserRole.User, "anna", ANNA), S.BadSessionIdInvalid),
        ("own", False, Reader(UserRole.User, "anna", ANNA), S.BadSessionNotActivated),
        ("own", True, SimpleNamespace(name="somebody"), S.BadSessionNotActivated),
        ("own", True, Reader(UserRole.User, "anna", ANNA), S.BadServiceUnsupported),
    ],
)
def test_only_a_session_of_a_reader_asks(token: str, activated: bool, user: Any, status: int) -> None:
    session = SimpleNamespace(
        state=SimpleNamespace(name="Activated"), auth_token="own", user=user, is_activated=lambda: activated
    )
    channel = channel_of(b"certificate")
    channel._sessions.append(SimpleNamespace(session=session))
    with pytest.raises(ServiceError) as refused:
        asyncio.run(channel._judged(99_999, SimpleNamespace(AuthenticationToken=token), None))
    assert refused.value.code == status


def test_a_refusal_answers_its_request(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(channel_module, "nodeid_from_binary", lambda _: ua.NodeId(1, 0))
    monkeypatch.setattr(channel_module, "read_header", lambda _: SimpleNamespace(RequestHandle=4711))
    channel, said = channel_of(b"certificate"), list[Any]()
    faults = [ServiceError(S.BadUserAccessDenied), ValueError("no request")]

    async def judged(*_: Any) -> Any:
        raise faults.pop()

    channel._judged = judged
    channel._answers = SimpleNamespace(send_response=lambda handle, *_: said.append(handle))
    for _ in range(2):
        asyncio.run(channel._request(None, None))
    assert said == [4711, 4711]


def test_a_client_is_known_by_its_certificate(monkeypatch: pytest.MonkeyPatch) -> None:
    """By 16 digits of SHA-256: "abc" begins with ba7816bf 8f01cfea (FIPS 180-4, appendix)."""
    asked: list[Any] = []

    async def admit(*what: Any) -> bool:
        asked.append(what)
        return True

    token = ua.UserNameIdentityToken()
    monkeypatch.setattr(channel_module, "judge_identity", lambda _: None)
    wanted = SimpleNamespace(UserIdentityToken=token, ClientSignature=SimpleNamespace(Signature=b""))
    monkeypatch.setattr(channel_module, "struct_from_binary", lambda *_: wanted)
    channel = channel_of(b"abc")
    channel.address = "192.0.2.7"
    channel._secure = SimpleNamespace(
        security_policy=SimpleNamespace(
            host_certificate=b"", AsymmetricEncryptionURI="", peer_certificate=b"abc",
            asymmetric_cryptography=SimpleNamespace(verify=lambda *_: None),
        )
    )  # fmt: skip
    channel._wall.people = SimpleNamespace(admit=admit)
    channel._wall.internal = SimpleNamespace(decrypt_user_token=lambda *_: ("anna", "right"))
    asyncio.run(channel._may_activate(SimpleNamespace(nonce=b""), SimpleNamespace(copy=lambda: None)))
    assert asked == [("anna", "right", b"abc", "ba7816bf8f01cfea", "192.0.2.7")]


def test_the_opening_of_a_channel_has_one_chunk(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = SimpleNamespace(SecurityPolicyURI=channel_module.SecurityPolicyNone.URI, SenderCertificate=None)
    monkeypatch.setattr(channel_module, "struct_from_binary", lambda *_: asked)
    channel = channel_of(b"")
    channel._open, channel._received = False, lambda *_: None
    header, body = SimpleNamespace(body_size=0), SimpleNamespace(copy=lambda _: None)
    with pytest.raises(channel_module.ChannelRefused) as refused:
        channel._open_channel(header, body)
    assert refused.value.status == S.BadTcpMessageTypeInvalid


@pytest.mark.parametrize(
    ("receives", "sends", "taken"), [(8192, 8192, True), (8191, 8192, False), (8192, 8191, False)]
)
def test_hello_announces_buffers_of_8_kib_both_ways_and_comes_once(
    receives: int, sends: int, taken: bool
) -> None:
    channel, wrote = channel_of(b""), list[Any]()
    channel._greeted = False
    channel._answers = SimpleNamespace(
        _limits=SimpleNamespace(create_acknowledge_and_set_limits=lambda _: ua.Acknowledge())
    )
    channel._transport = SimpleNamespace(write=wrote.append)
    hello = ua.Hello(0, receives, sends, 0, 0, "")
    if not taken:
        with pytest.raises(channel_module.ChannelRefused) as refused:
            channel._hello(hello)
        assert (refused.value.status, wrote) == (S.BadConnectionRejected, [])
        return
    channel._hello(hello)
    assert len(wrote) == 1
    with pytest.raises(channel_module.ChannelRefused):
        channel._hello(hello)


POLICY = "http://opcfoundation.org/UA/SecurityPolicy#Basic256Sha256"
NONE = channel_module.SecurityPolicyNone.URI
RENEW, ISSUE = ua.SecurityTokenRequestType.Renew, ua.SecurityTokenRequestType.Issue
SIGN, BOTH, PLAIN = (
    ua.MessageSecurityMode.Sign,
    ua.MessageSecurityMode.SignAndEncrypt,
    ua.MessageSecurityMode.None_,
)


@pytest.mark.parametrize(
    ("before", "policy", "certificate", "mode", "nonce", "kind", "refused"),
    [
        (None, POLICY, b"one", BOTH, 32, ISSUE, None), (None, NONE, b"", PLAIN, 0, ISSUE, None),
        (None, POLICY, b"one", SIGN, 32, ISSUE, S.BadSecurityModeRejected),
        (None, POLICY, b"one", PLAIN, 32, ISSUE, S.BadSecurityModeRejected),
        (None, NONE, b"", BOTH, 0, ISSUE, S.BadSecurityModeRejected),
        (None, POLICY, b"one", BOTH, 31, ISSUE, S.BadNonceInvalid),
        (None, POLICY, b"one", BOTH, 33, ISSUE, S.BadNonceInvalid),
        (None, POLICY, b"one", BOTH, 32, RENEW, S.BadRequestTypeInvalid),
        (None, "urn:other", b"one", BOTH, 32, ISSUE, S.BadSecurityPolicyRejected),
        ((POLICY, b"one"), POLICY, b"one", BOTH, 32, RENEW, None),
        ((POLICY, b"one"), POLICY, b"one", BOTH, 32, ISSUE, S.BadRequestTypeInvalid),
        ((POLICY, b"one"), POLICY, b"two", BOTH, 32, RENEW, S.BadSecurityChecksFailed),
        ((POLICY, b"one"), NONE, b"", PLAIN, 0, RENEW, S.BadSecurityChecksFailed),
        ((NONE, b""), POLICY, b"one", BOTH, 32, RENEW, S.BadSecurityChecksFailed),
    ],
)  # fmt: skip
def test_a_channel_is_opened_signed_and_encrypted_and_renewed_by_its_client(
    monkeypatch: pytest.MonkeyPatch, before: Any, policy: str, certificate: bytes, mode: Any, nonce: int, kind: Any,
    refused: int | None,
) -> None:  # fmt: skip
    asked = SimpleNamespace(SecurityPolicyURI=policy, SenderCertificate=certificate)
    wanted = SimpleNamespace(
        SecurityMode=mode, ClientNonce=b"n" * nonce, RequestType=kind, RequestedLifetime=5
    )
    found = {ua.AsymmetricAlgorithmHeader: asked, ua.OpenSecureChannelParameters: wanted}
    monkeypatch.setattr(channel_module, "struct_from_binary", lambda which, _: found[which])
    monkeypatch.setattr(channel_module, "first_of", lambda given: given)
    monkeypatch.setattr(channel_module, "bounded", lambda _: None)
    monkeypatch.setattr(channel_module, "nodeid_from_binary", lambda _: None)
    monkeypatch.setattr(channel_module, "read_header", lambda _: SimpleNamespace(RequestHandle=4711))
    monkeypatch.setattr(channel_module, "time", SimpleNamespace(monotonic=lambda: 100.0))
    channel, sent = channel_of(b"" if before is None else before[1], judge=lambda _: None), list[Any]()
    channel._open = before is not None
    channel._secure = SimpleNamespace(
        security_policy=SimpleNamespace(URI="" if before is None else before[0]),
        open=lambda *_: ua.OpenSecureChannelResult(),
    )
    channel._wall.policies, channel._wall.internal = {POLICY: None}, None
    message = SimpleNamespace(body=lambda: None, SequenceHeader=lambda: None)
    channel._received = lambda *_: message
    channel._answers = SimpleNamespace(send_response=lambda handle, *_: sent.append(handle))
    opens = lambda: channel._open_channel(SimpleNamespace(body_size=0), SimpleNamespace(copy=lambda _: None))  # noqa: E731
    if refused is not None:
        with pytest.raises(channel_module.ChannelRefused) as why:
            opens()
        assert (why.value.status, sent) == (refused, [])
        return
    opens()
    # A minute at the least, and a quarter more.
    assert (channel._open, channel.certificate, channel._until_s, sent) == (True, certificate, 175.0, [4711])


def body(found: Any) -> Bounded:
    return Bounded(struct_to_binary(found))


def test_a_channel_without_a_certificate_finds_servers_and_nothing_else() -> None:
    channel = channel_of(b"")
    channel._answers = "answers"
    find = ua.ObjectIds.FindServersRequest_Encoding_DefaultBinary
    assert asyncio.run(channel._judged(find, None, "body")) == ("answers", "body")
    for kind in (channel_module.CREATE, channel_module.ACTIVATE, 99_999):
        assert status_of(lambda kind=kind: asyncio.run(channel._judged(kind, None, None))) == (
            S.BadSecurityPolicyRejected
        )
    assert {
        getattr(ua.ObjectIds, f"{name}Request_Encoding_DefaultBinary")
        for name in ("Write", "Call", "AddNodes")
    } <= services_module.CHANGES
    assert not services_module.CHANGES & services_module.READING.keys()


@pytest.mark.parametrize("sound", [True, False])
def test_a_session_is_activated_with_the_key_of_its_client(
    monkeypatch: pytest.MonkeyPatch, sound: bool
) -> None:
    """It signs the server's certificate and the nonce of this session."""
    signed: list[Any] = []

    async def admit(*_: Any) -> bool:
        return True

    def verify(*what: Any) -> None:
        signed.append(what)
        if not sound:
            raise ValueError("another key")

    monkeypatch.setattr(channel_module, "judge_identity", lambda _: None)
    wanted = SimpleNamespace(
        UserIdentityToken=ua.UserNameIdentityToken(), ClientSignature=SimpleNamespace(Signature=b"signature")
    )
    monkeypatch.setattr(channel_module, "struct_from_binary", lambda *_: wanted)
    channel = channel_of(b"abc")
    channel.address = "192.0.2.7"
    policy = SimpleNamespace(
        host_certificate=b"server", AsymmetricEncryptionURI="", peer_certificate=b"abc",
        asymmetric_cryptography=SimpleNamespace(verify=verify),
    )  # fmt: skip
    channel._secure = SimpleNamespace(security_policy=policy)
    channel._wall.people = SimpleNamespace(admit=admit)
    channel._wall.internal = SimpleNamespace(decrypt_user_token=lambda *_: ("anna", "right"))
    activates = channel._may_activate(SimpleNamespace(nonce=b"nonce"), SimpleNamespace(copy=lambda: None))
    if sound:
        asyncio.run(activates)
    else:
        assert status_of(lambda: asyncio.run(activates)) == S.BadApplicationSignatureInvalid
    assert signed == [(b"servernonce", b"signature")]


def test_the_token_of_a_session_is_known_to_its_channel_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """The library counts tokens up, and hands a session over to whoever names one that it knows."""
    forgotten: list[Any] = []
    made = SimpleNamespace(auth_token="1001")
    internal: Any = object.__new__(channel_module.Sessions)
    monkeypatch.setattr(channel_module.InternalServer, "create_session", lambda *_, **__: made)
    monkeypatch.setattr(
        channel_module.Sessions,
        "unregister_external_session",
        lambda _, each: forgotten.append(each.auth_token),
    )
    tokens = [internal.create_session("name").auth_token.Identifier for _ in range(2)]
    assert forgotten[0] == "1001"
    assert [len(each) for each in tokens] == [32, 32]
    assert tokens[0] != tokens[1]


def test_a_channel_is_renewed_only_while_its_certificate_is_trusted(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses(_: bytes) -> None:
        raise trust.NotTrusted("the certificate is revoked")

    asked = SimpleNamespace(SecurityPolicyURI=POLICY, SenderCertificate=b"one")
    monkeypatch.setattr(channel_module, "struct_from_binary", lambda *_: asked)
    monkeypatch.setattr(channel_module, "first_of", lambda given: given)
    channel = channel_of(b"one", judge=refuses)
    channel._open, channel._wall.policies = True, {POLICY: None}
    channel._secure = SimpleNamespace(security_policy=SimpleNamespace(URI=POLICY))
    channel._received = lambda *_: pytest.fail("it costs a decryption")
    with pytest.raises(channel_module.ChannelRefused, match="the certificate is revoked") as refused:
        channel._open_channel(SimpleNamespace(body_size=0), SimpleNamespace(copy=lambda _: None))
    assert refused.value.status == S.BadSecurityChecksFailed


@pytest.mark.parametrize(("namespace", "judged_as"), [(0, 446), (1, 0), (2, 0)])
def test_a_request_of_another_namespace_is_none_of_this_one(
    monkeypatch: pytest.MonkeyPatch, namespace: int, judged_as: int
) -> None:
    """446 closes a session in namespace 0."""
    judged: list[Any] = []

    async def judge(kind: Any, *_: Any) -> Any:
        judged.append(kind)
        raise ServiceError(S.BadServiceUnsupported)

    monkeypatch.setattr(channel_module, "nodeid_from_binary", lambda _: ua.NodeId(446, namespace))
    monkeypatch.setattr(channel_module, "read_header", lambda _: SimpleNamespace(RequestHandle=1))
    channel = channel_of(b"certificate", judge=None)
    channel._judged, channel._answers = judge, SimpleNamespace(send_response=lambda *_: None)
    asyncio.run(channel._request(None, None))
    assert judged == [judged_as]


def test_only_a_sound_message_closes_a_channel() -> None:
    channel = channel_of(b"certificate")
    channel._greeted, channel._open, channel._until_s = True, True, math.inf

    def forged(*_: Any) -> None:
        raise channel_module.ChannelRefused(S.BadSecurityChecksFailed, "a message is not sound")

    channel._received = forged
    with pytest.raises(channel_module.ChannelRefused, match="not sound"):
        asyncio.run(channel.take(SimpleNamespace(MessageType=ua.MessageType.SecureClose), None))


@pytest.mark.parametrize(
    ("fault", "status", "journal"),
    [
        (ua.uaerrors.BadRequestTooLarge(), S.BadRequestTooLarge, ""),
        (ValueError("x" * 500), S.BadSecurityChecksFailed, f"a message is not sound: ValueError('{'x' * 68}"),
    ],
)
def test_a_message_that_is_not_sound_is_in_the_journal_and_one_that_is_too_long_is_not(
    fault: Exception, status: int, journal: str
) -> None:
    """With eighty letters of what is wrong with it."""

    def fails(*_: Any) -> None:
        raise fault

    channel = channel_of(b"certificate")
    channel._secure = SimpleNamespace(receive_from_header_and_body=fails)
    with pytest.raises(channel_module.ChannelRefused) as refused:
        channel._received(None, None)
    assert (refused.value.status, refused.value.journal) == (status, journal)


@pytest.mark.parametrize(
    ("token", "readable", "right", "refused", "tried"),
    [
        (ua.UserNameIdentityToken(), True, True, None, True),
        (ua.UserNameIdentityToken(), True, False, S.BadUserAccessDenied, True),
        (ua.UserNameIdentityToken(), False, True, S.BadIdentityTokenInvalid, False),
        (ua.UserNameIdentityToken(EncryptionAlgorithm="urn:cipher"), True, True, None, True),
        (ua.UserNameIdentityToken(EncryptionAlgorithm="urn:old"), True, True, S.BadIdentityTokenInvalid, False),
        (ua.AnonymousIdentityToken(), True, True, S.BadIdentityTokenRejected, False),
        (ua.X509IdentityToken(), True, True, S.BadIdentityTokenRejected, False),
    ],
)  # fmt: skip
def test_only_a_password_that_can_be_read_is_tried(
    monkeypatch: pytest.MonkeyPatch, token: Any, readable: bool, right: bool, refused: int | None, tried: bool
) -> None:
    admitted: list[Any] = []

    async def admit(*who: Any) -> bool:
        admitted.append(who[:2])
        return right

    def decrypt(*_: Any) -> tuple[str, None]:
        if not readable:
            raise UnicodeDecodeError("utf-8", b"", 0, 1, "no text")
        return "anna", None

    wanted = SimpleNamespace(UserIdentityToken=token, ClientSignature=SimpleNamespace(Signature=b""))
    monkeypatch.setattr(channel_module, "judge_identity", lambda _: None)
    monkeypatch.setattr(channel_module, "struct_from_binary", lambda *_: wanted)
    channel = channel_of(b"abc")
    channel.address = "192.0.2.7"
    policy = SimpleNamespace(
        host_certificate=b"", AsymmetricEncryptionURI="urn:cipher", peer_certificate=b"abc",
        asymmetric_cryptography=SimpleNamespace(verify=lambda *_: None),
    )  # fmt: skip
    channel._secure = SimpleNamespace(security_policy=policy)
    channel._wall.people = SimpleNamespace(admit=admit)
    channel._wall.internal = SimpleNamespace(decrypt_user_token=decrypt)
    activates = lambda: asyncio.run(  # noqa: E731
        channel._may_activate(SimpleNamespace(nonce=b""), SimpleNamespace(copy=lambda: None))
    )
    if refused is None:
        activates()
    else:
        assert status_of(activates) == refused
    assert admitted == ([("anna", "")] if tried else [])


def test_of_a_chain_the_certificate_of_the_client_is_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is the first one (OPC UA Part 6, section 6.7.2.3): here of two bytes each."""
    judged: list[bytes] = []

    def judge(certificate: bytes) -> None:
        judged.append(certificate)
        raise trust.NotTrusted("it is not in the trust list")

    asked = SimpleNamespace(SecurityPolicyURI=POLICY, SenderCertificate=b"0\x02ab0\x02cd")
    monkeypatch.setattr(channel_module, "struct_from_binary", lambda *_: asked)
    channel = channel_of(b"", judge=judge)
    channel._open, channel._wall.policies = False, {POLICY: None}
    with pytest.raises(channel_module.ChannelRefused, match="not in the trust list"):
        channel._open_channel(SimpleNamespace(body_size=0), SimpleNamespace(copy=lambda _: None))
    assert judged == [b"0\x02ab"]


@pytest.mark.parametrize(("length", "whole"), [(2**20, True), (2**20 + 1, False)])
def test_an_answer_has_a_mebibyte_at_most(monkeypatch: pytest.MonkeyPatch, length: int, whole: bool) -> None:
    sent: list[Any] = []
    monkeypatch.setattr(channel_module, "struct_to_binary", lambda _: bytes(length))
    monkeypatch.setattr(channel_module.UaProcessor, "send_response", lambda _, *what: sent.append(what[:3]))
    answers: Any = object.__new__(channel_module.Answers)
    answers.send_response(7, "sequence", "an answer")
    ((handle, sequence, answer),) = sent
    assert (handle, sequence, answer == "an answer") == (7, "sequence", whole)
    if not whole:
        assert answer.ResponseHeader.ServiceResult.value == S.BadResponseTooLarge
