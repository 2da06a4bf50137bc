"""A client of OPC UA on the binary wire: it sends what it is told to, a certificate or none, in any order.

The library's structures and ciphers are used; its client, which sends a certificate and names its endpoint by itself,
is not.
"""

from __future__ import annotations

import asyncio
import hashlib
import os
import struct
from contextlib import suppress
from typing import Any

from asyncua import ua
from asyncua.common.connection import SecureConnection, TransportLimits
from asyncua.common.utils import Buffer
from asyncua.crypto import security_policies as ciphers
from asyncua.crypto.uacrypto import x509_from_der
from asyncua.ua.ua_binary import (
    header_from_binary,
    nodeid_from_binary,
    struct_from_binary,
    struct_to_binary,
    uatcp_to_binary,
)

CIPHERS = {
    each.URI.rpartition("#")[2]: each
    for each in (
        ciphers.SecurityPolicyBasic128Rsa15,
        ciphers.SecurityPolicyBasic256,
        ciphers.SecurityPolicyBasic256Sha256,
        ciphers.SecurityPolicyAes128Sha256RsaOaep,
        ciphers.SecurityPolicyAes256Sha256RsaPss,
    )
}


class Refused(Exception):
    """The other end sent an error, or closed the connection ("closed")."""


class Wire:
    """One connection.

    Attributes:
        token: of the session, sent with every request.
        silence_ms: after this time without a request the session ends.
    """

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self.writer = reader, writer
        self.secure = SecureConnection(ciphers.SecurityPolicyNone(), TransportLimits())
        self._number = 0
        self.token = ua.NodeId()
        self.nonce = self.server_nonce = b""
        self.silence_ms = 0.0

    @classmethod
    async def connect(cls, port: int) -> Wire:
        """Connect, and say Hello."""
        made = cls(*await asyncio.open_connection("127.0.0.1", port))
        await made.say(uatcp_to_binary(ua.MessageType.Hello, ua.Hello(EndpointUrl="opc.tcp://x/")))
        await made.hear()
        return made

    async def say(self, data: bytes) -> None:
        """Send bytes as they are."""
        self.writer.write(data)
        await self.writer.drain()

    async def hear(self) -> Any:
        """The next message of the other end."""
        try:
            head = await asyncio.wait_for(self._reader.readexactly(8), 10.0)
            size = struct.unpack_from("<I", head, 4)[0]
            data = head + await self._reader.readexactly(size - 8)
        except (asyncio.IncompleteReadError, ConnectionError):
            raise Refused("closed") from None
        body = Buffer(data)
        header = header_from_binary(body)
        if header.MessageType == ua.MessageType.Error:
            raise Refused(struct_from_binary(ua.ErrorMessage, body).Error.name)
        found = self.secure.receive_from_header_and_body(header, body)
        return await self.hear() if found is None else found

    async def open(
        self,
        policy: str = "None",
        mode: ua.MessageSecurityMode = ua.MessageSecurityMode.None_,
        certificate: bytes = b"",
        key: Any = None,
        server: Any = None,
    ) -> None:
        """Open a secure channel; without a certificate the request goes out in clear."""
        uri, nonce = f"http://opcfoundation.org/UA/SecurityPolicy#{policy}", b""
        if policy in CIPHERS and certificate:
            nonce = os.urandom(CIPHERS[policy].secure_channel_nonce_length)
            # The cipher knows no mode None; what the request says is another thing.
            ciphered = ua.MessageSecurityMode.SignAndEncrypt if mode == ua.MessageSecurityMode.None_ else mode
            self.secure.security_policy = CIPHERS[policy](server, x509_from_der(certificate), key, ciphered)
        request = ua.OpenSecureChannelRequest()
        request.Parameters.SecurityMode, request.Parameters.ClientNonce = mode, nonce or None
        request.Parameters.RequestType = ua.SecurityTokenRequestType.Issue
        request.Parameters.RequestedLifetime = 3_600_000
        data = struct_to_binary(request)
        if nonce or policy == "None":
            await self.say(self.secure.message_to_binary(data, ua.MessageType.SecureOpen, self._next()))
        else:
            await self.say(_in_clear(uri, certificate, data))
        answer = struct_from_binary(ua.OpenSecureChannelResponse, (await self.hear()).body())
        self.secure.set_channel(answer.Parameters, ua.SecurityTokenRequestType.Issue, nonce)

    async def ask(self, request: Any, token: ua.NodeId | None = None) -> tuple[str, Buffer]:
        """Status of a service, and the rest of its answer; the token of another session may be given."""
        request.RequestHeader.AuthenticationToken = self.token if token is None else token
        number = self._next()
        request.RequestHeader.RequestHandle = number
        await self.say(self.secure.message_to_binary(struct_to_binary(request), request_id=number))
        body = (await self.hear()).body()
        nodeid_from_binary(body)
        return struct_from_binary(ua.ResponseHeader, body).ServiceResult.name, body

    async def create(
        self, certificate: bytes, application: str, silence_ms: float = 60_000.0, nonce: int = 32
    ) -> str:
        """CreateSession; status. The session is to live for `silence_ms` without a request; bytes of the nonce."""
        request, self.nonce = ua.CreateSessionRequest(), os.urandom(nonce)
        wanted = request.Parameters
        wanted.ClientDescription.ApplicationUri = application
        wanted.ClientDescription.ApplicationType = ua.ApplicationType.Client
        wanted.ClientNonce, wanted.ClientCertificate = self.nonce, certificate or None
        wanted.EndpointUrl, wanted.RequestedSessionTimeout = "opc.tcp://x/", silence_ms
        status, body = await self.ask(request, ua.NodeId())
        if status == "Good":
            found = struct_from_binary(ua.CreateSessionResult, body)
            self.token, self.server_nonce = found.AuthenticationToken, found.ServerNonce
            self.silence_ms = found.RevisedSessionTimeout
        return status

    async def activate(self, identity: Any, *, signed: bool = True) -> str:
        """ActivateSession; status."""
        request, policy = ua.ActivateSessionRequest(), self.secure.security_policy
        request.Parameters.UserIdentityToken = identity
        request.Parameters.LocaleIds = ["en"]
        if signed:
            data = (policy.peer_certificate or b"") + self.server_nonce
            signature = policy.asymmetric_cryptography.signature(data)
            request.Parameters.ClientSignature = ua.SignatureData(policy.AsymmetricSignatureURI, signature)
        status, body = await self.ask(request)
        if status == "Good":
            self.server_nonce = struct_from_binary(ua.ActivateSessionResult, body).ServerNonce
        return status

    async def close(self) -> None:
        """Leave."""
        self.writer.close()
        with suppress(ConnectionError):
            await self.writer.wait_closed()

    def _next(self) -> int:
        self._number += 1
        return self._number


def _in_clear(uri: str, certificate: bytes, body: bytes) -> bytes:
    """An OpenSecureChannel message of a policy, neither signed nor encrypted."""
    thumb = hashlib.sha1(certificate, usedforsecurity=False).digest() if certificate else None
    security = struct_to_binary(ua.AsymmetricAlgorithmHeader(uri, certificate or None, thumb))
    data = security + struct.pack("<II", 1, 1) + body
    return struct.pack("<3scII", b"OPN", b"F", 12 + len(data), 0) + data


def password(user: str, word: str) -> Any:
    """An identity by name and password, not encrypted once more."""
    return ua.UserNameIdentityToken(PolicyId="username", UserName=user, Password=word.encode())


def requests() -> dict[str, Any]:
    """Every request that the library can write, by the name of its service."""
    names = [
        name[:-7]
        for name in dir(ua)
        if name.endswith("Request") and hasattr(getattr(ua, name), "RequestHeader")
    ]
    return {name: getattr(ua, f"{name}Request") for name in names}
