"""The gate of OPC UA: every message of a connection is judged here before the library acts on it.

The library checks neither that a channel is secured nor whose session a request is for, so nothing reaches it that is
not in `services` and asked for by the session of this very channel.
"""

from __future__ import annotations

import hashlib
import secrets
import time
from typing import Any, Final, NamedTuple

from asyncua import ua
from asyncua.common.connection import TransportLimits
from asyncua.common.utils import Buffer, ServiceError
from asyncua.crypto.security_policies import SecurityPolicyNone
from asyncua.server.internal_server import InternalServer
from asyncua.server.uaprocessor import UaProcessor
from asyncua.ua.ua_binary import nodeid_from_binary, struct_from_binary, struct_to_binary, uatcp_to_binary

from gantryctl.gateway.opcua.people import People, Reader
from gantryctl.gateway.opcua.reading import Bounded, bounded, judge_identity, read_header
from gantryctl.gateway.opcua.services import ACTIVATE, CHANGES, CLOSE, CREATE, DISCOVERY, READING, Holdings
from gantryctl.gateway.opcua.trust import NotTrusted, TrustList, first_of, speaks_for

BUFFER_MIN: Final = 8192
"""Smallest buffer that a client may announce, bytes (OPC UA Part 6, section 7.1.2.3)."""
MESSAGE_MAX: Final = 2**20
"""Longest message, bytes, both ways."""
LIFETIME_MIN_MS, LIFETIME_MAX_MS = 60_000, 3_600_000
NONCE_MIN: Final = 32
"""Bytes; of the offered policies, and of a session (Part 4, section 5.6.2.2)."""
SESSIONS_MAX: Final = 4
"""Of one channel. Clients have one; when they lose its number in a reconnection, they ask for another beside it."""


class ChannelRefused(Exception):
    """Ends a connection with a status; `journal` is for the journal, and the other end is not told (Part 4, 6.1.3)."""

    def __init__(self, status: int, journal: str = "") -> None:
        super().__init__(journal)
        self.status, self.journal = status, journal


class Sessions(InternalServer):
    """The library's server with sessions that nobody can guess, and that belong to their channel."""

    def create_session(self, *how: Any, **named: Any) -> Any:
        """Make a session."""
        made = super().create_session(*how, **named)
        # The library counts tokens up, and hands a session over to any channel that names one.
        self.unregister_external_session(made)
        made.auth_token = ua.NodeId(secrets.token_bytes(32), 0, ua.NodeIdType.ByteString)
        return made


class Answers(UaProcessor):
    """The library's services for one session, or for none, with a limit on the length of an answer."""

    def send_response(
        self, requesthandle: Any, seqhdr: Any, response: Any, msgtype: Any = ua.MessageType.SecureMessage
    ) -> None:
        """Send an answer, or that it is too long."""
        if len(struct_to_binary(response)) > MESSAGE_MAX:
            response = _fault(ua.StatusCodes.BadResponseTooLarge)
        super().send_response(requesthandle, seqhdr, response, msgtype)


class Wall(NamedTuple):
    """What all channels share.

    Attributes:
        internal: the library's server. policies: its security policies, by their address.
    """

    internal: Sessions
    policies: dict[str, Any]
    trust: TrustList
    people: People
    limits: TransportLimits


class Channel:
    """One connection, from Hello to its end.

    Attributes:
        certificate: of the client (DER), empty before there is a secured channel.
        address: of the other end.
    """

    def __init__(self, wall: Wall, transport: Any, address: str) -> None:
        self._wall, self._transport, self.address = wall, transport, address
        self._answers = Answers(wall.internal, transport, wall.limits)
        self._answers.set_policies(list(wall.policies.values()))
        self._secure = self._answers._connection
        self._sessions: list[Answers] = []
        self._greeted = self._open = False
        self._until_s = 0.0
        self.certificate = b""

    @property
    def readers(self) -> list[Reader]:
        """Who is logged in, once for each session."""
        found = (each.session for each in self._sessions)
        return [each.user for each in found if each is not None and each.is_activated()]

    def lapsed(self, users: dict[str, Any]) -> str:
        """Why the sessions may not go on, "" if they may.

        Args:
            users: those of the service as they are now.
        """
        if self.certificate:
            try:
                self._wall.trust.judge(self.certificate)
            except NotTrusted as fault:
                return str(fault)
        known = [reader.known for reader in self.readers if reader.known is not None]
        return "the user has changed" if any(users.get(each.name) != each for each in known) else ""

    async def end(self) -> None:
        """End the sessions with everything that they hold."""
        for each in self._sessions:
            await each.close()
            if each.session is not None:
                # With the subscriptions: nobody may find them on another channel.
                await each.session.close_session(True)

    async def take(self, header: Any, body: Buffer) -> bool:
        """Act on one chunk; False when the client closes the channel.

        Raises:
            ChannelRefused: the connection is to be closed.
        """
        kind = header.MessageType
        if kind == ua.MessageType.Hello:
            self._hello(struct_from_binary(ua.Hello, body))
        elif not self._greeted:
            raise ChannelRefused(ua.StatusCodes.BadTcpMessageTypeInvalid)
        elif kind == ua.MessageType.SecureOpen:
            self._open_channel(header, body)
        elif kind not in (ua.MessageType.SecureMessage, ua.MessageType.SecureClose):
            raise ChannelRefused(ua.StatusCodes.BadTcpMessageTypeInvalid)
        elif not self._open or time.monotonic() > self._until_s:
            raise ChannelRefused(ua.StatusCodes.BadSecureChannelClosed)
        else:
            message = self._received(header, body)
            if kind == ua.MessageType.SecureClose:
                return False
            if message is not None:
                await self._request(message.SequenceHeader(), bounded(message.body()))
        return True

    def _hello(self, hello: Any) -> None:
        if self._greeted:
            raise ChannelRefused(ua.StatusCodes.BadTcpMessageTypeInvalid)
        if min(hello.ReceiveBufferSize, hello.SendBufferSize) < BUFFER_MIN:
            raise ChannelRefused(ua.StatusCodes.BadConnectionRejected)
        self._greeted = True
        answer = self._answers._limits.create_acknowledge_and_set_limits(hello)
        self._transport.write(uatcp_to_binary(ua.MessageType.Acknowledge, answer))

    def _received(self, header: Any, body: Buffer) -> Any:
        """Decrypt and verify a chunk; the whole message with its last one."""
        try:
            return self._secure.receive_from_header_and_body(header, body)
        except ua.uaerrors.BadRequestTooLarge:
            raise ChannelRefused(ua.StatusCodes.BadRequestTooLarge) from None
        except Exception as fault:  # whatever the library and cryptography find
            raise ChannelRefused(
                ua.StatusCodes.BadSecurityChecksFailed, f"a message is not sound: {fault!r:.80}"
            ) from None

    # --- the channel ------------------------------------------------------------------------------

    def _open_channel(self, header: Any, body: Buffer) -> None:
        asked = struct_from_binary(ua.AsymmetricAlgorithmHeader, body.copy(header.body_size))
        secured = asked.SecurityPolicyURI != SecurityPolicyNone.URI
        if secured and asked.SecurityPolicyURI not in self._wall.policies:
            raise ChannelRefused(ua.StatusCodes.BadSecurityPolicyRejected)
        certificate = first_of(asked.SenderCertificate) if secured else b""
        if secured:
            # Before anything is decrypted: a stranger costs nothing.
            try:
                self._wall.trust.judge(certificate)
            except NotTrusted as fault:
                raise ChannelRefused(ua.StatusCodes.BadSecurityChecksFailed, str(fault)) from None
        if self._open and (asked.SecurityPolicyURI, certificate) != (
            self._secure.security_policy.URI,
            self.certificate,
        ):
            raise ChannelRefused(ua.StatusCodes.BadSecurityChecksFailed, "another certificate in a renewal")
        message = self._received(header, body)
        if message is None:  # an OpenSecureChannel message has one chunk
            raise ChannelRefused(ua.StatusCodes.BadTcpMessageTypeInvalid)
        opening = bounded(message.body())
        nodeid_from_binary(opening)
        head = read_header(opening)
        wanted = struct_from_binary(ua.OpenSecureChannelParameters, opening)
        mode = ua.MessageSecurityMode.SignAndEncrypt if secured else ua.MessageSecurityMode.None_
        if wanted.SecurityMode != mode:
            raise ChannelRefused(ua.StatusCodes.BadSecurityModeRejected)
        if secured and len(wanted.ClientNonce or b"") != NONCE_MIN:
            raise ChannelRefused(ua.StatusCodes.BadNonceInvalid)
        if (wanted.RequestType == ua.SecurityTokenRequestType.Renew) is not self._open:
            raise ChannelRefused(ua.StatusCodes.BadRequestTypeInvalid)
        wanted.RequestedLifetime = min(max(wanted.RequestedLifetime, LIFETIME_MIN_MS), LIFETIME_MAX_MS)
        answer = ua.OpenSecureChannelResponse()
        answer.Parameters = self._secure.open(wanted, self._wall.internal)
        self._open, self.certificate = True, certificate
        # Clients renew at three quarters; a quarter more is theirs (Part 4, section 5.5.2.1).
        self._until_s = time.monotonic() + wanted.RequestedLifetime * 1.25e-3
        self._answers.send_response(
            head.RequestHandle, message.SequenceHeader(), answer, ua.MessageType.SecureOpen
        )

    # --- requests ---------------------------------------------------------------------------------

    async def _request(self, sequence: Any, body: Bounded) -> None:
        handle = 0
        try:
            kind = nodeid_from_binary(body)
            head = read_header(body)
            handle = head.RequestHandle
            number = kind.Identifier if kind.NamespaceIndex == 0 else 0
            answers, allowed = await self._judged(number, head, body)
            await answers._process_message(kind, head, sequence, allowed)
        except (ServiceError, ua.uaerrors.UaStatusCodeError) as fault:
            self._answers.send_response(handle, sequence, _fault(fault.code))
        except Exception:  # a request that the library cannot read
            self._answers.send_response(handle, sequence, _fault(ua.StatusCodes.BadDecodingError))

    async def _judged(self, kind: Any, head: Any, body: Bounded) -> tuple[Answers, Buffer]:
        """Whose request it is, and the body that the library may act on.

        Raises:
            ServiceError: the request is refused.
        """
        if kind in DISCOVERY:
            return self._answers, body
        if not self.certificate:
            raise ServiceError(ua.StatusCodes.BadSecurityPolicyRejected)
        self._sessions = [each for each in self._sessions if not _closed(each.session)]
        if kind == CREATE:
            self._may_create(body)
            return await self._room(), body
        # Another token is another channel's, whoever asks.
        asked = [each for each in self._sessions if each.session.auth_token == head.AuthenticationToken]
        if not asked:
            raise ServiceError(ua.StatusCodes.BadSessionIdInvalid)
        answers, session = asked[0], asked[0].session
        if kind == ACTIVATE:
            await self._may_activate(session, body)
            return answers, body
        if kind == CLOSE:
            return answers, body
        if not session.is_activated() or not isinstance(session.user, Reader):
            raise ServiceError(ua.StatusCodes.BadSessionNotActivated)
        if kind in CHANGES:
            raise ServiceError(ua.StatusCodes.BadUserAccessDenied)
        rule = READING.get(kind)
        if rule is None:
            raise ServiceError(ua.StatusCodes.BadServiceUnsupported)
        beside = {each.session.session_id for each in self._sessions}
        return answers, rule(Holdings(self._wall.internal, session.session_id, beside), body)

    def _may_create(self, body: Bounded) -> None:
        wanted = struct_from_binary(ua.CreateSessionParameters, body.copy())
        # The library looks at this one alone, and anybody can send the certificate of somebody else.
        if first_of(wanted.ClientCertificate) != self.certificate:
            raise ServiceError(ua.StatusCodes.BadCertificateInvalid)
        if not speaks_for(self._wall.trust.judge(self.certificate), wanted.ClientDescription):
            raise ServiceError(ua.StatusCodes.BadCertificateUriInvalid)
        if len(wanted.ClientNonce or b"") < NONCE_MIN:
            raise ServiceError(ua.StatusCodes.BadNonceInvalid)

    async def _room(self) -> Answers:
        """The place of a new session; the oldest one that is not logged in makes room (Part 4, section 5.6.2.1)."""
        if len(self._sessions) >= SESSIONS_MAX:
            idle = [each for each in self._sessions if not each.session.is_activated()]
            if not idle:
                raise ServiceError(ua.StatusCodes.BadTooManySessions)
            await idle[0].close()  # with its session, which is not logged in
            self._sessions.remove(idle[0])
        made = Answers(self._wall.internal, self._transport, self._wall.limits)
        made._connection = self._secure
        self._sessions.append(made)
        return made

    async def _may_activate(self, session: Any, body: Bounded) -> None:
        judge_identity(body.copy())
        wanted = struct_from_binary(ua.ActivateSessionParameters, body.copy())
        token, policy = wanted.UserIdentityToken, self._secure.security_policy
        if not isinstance(token, ua.UserNameIdentityToken):
            raise ServiceError(ua.StatusCodes.BadIdentityTokenRejected)
        try:
            signed = policy.host_certificate + session.nonce
            policy.asymmetric_cryptography.verify(signed, wanted.ClientSignature.Signature)
        except Exception:  # none, or another one
            raise ServiceError(ua.StatusCodes.BadApplicationSignatureInvalid) from None
        # The channel encrypts; a password may be encrypted once more, as its policy does it. The library would take
        # RSA PKCS 1.5, too, and tell a stranger byte by byte whether a guess decrypts.
        if token.EncryptionAlgorithm not in (None, "", policy.AsymmetricEncryptionURI):
            raise ServiceError(ua.StatusCodes.BadIdentityTokenInvalid)
        try:
            name, password = self._wall.internal.decrypt_user_token(session, token)
        except Exception:  # not encrypted for us, or no text
            raise ServiceError(ua.StatusCodes.BadIdentityTokenInvalid) from None
        client = hashlib.sha256(self.certificate).hexdigest()[:16]
        people = self._wall.people
        if not await people.admit(name or "", password or "", policy.peer_certificate, client, self.address):
            raise ServiceError(ua.StatusCodes.BadUserAccessDenied)


def _closed(session: Any) -> bool:
    # None: the library failed to make it.
    return session is None or bool(session.state.name == "Closed")


def _fault(status: int) -> Any:
    answer = ua.ServiceFault()
    answer.ResponseHeader.ServiceResult = ua.StatusCode(status)
    return answer
