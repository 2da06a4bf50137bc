"""Who is at the other end of a connection: its address, the user that it runs as on this machine, its console.

All local processes have one address, and so have those that carry connections of others here: tunnels, proxies,
containers. Limits by the address alone would let any process lock the operator out, and nobody is at the console by it.
"""

from __future__ import annotations

import ipaddress
import secrets
import socket
import struct
from collections import OrderedDict
from collections.abc import MutableMapping
from typing import Any, Final

from gantryctl.gateway.settings import is_loopback, neighbourhood

# linux/inet_diag.h, linux/sock_diag.h: one socket is asked for by its ends.
_SOCK_DIAG, _BY_FAMILY, _REQUEST = 4, 20, 1
_HEADER: Final = struct.Struct("=IHHII")
_ASKED: Final = struct.Struct("=BBBBI")
_ENDS: Final = struct.Struct("!HH16s16s")
_ANY_COOKIE: Final = struct.pack("=III", 0, 0xFFFFFFFF, 0xFFFFFFFF)
_ENDS_AT: Final = _HEADER.size + 4
_UID_AT: Final = _ENDS_AT + _ENDS.size + len(_ANY_COOKIE) + 12
_ESTABLISHED: Final = 1
_TIMEOUT_S: Final = 0.2
# Headers by which a proxy names itself (RFC 7239, RFC 9110 section 7.6.3, and what is used beside them).
_FORWARDED: Final = frozenset(
    {b"forwarded", b"via", b"x-forwarded-for", b"x-forwarded-host", b"x-forwarded-proto", b"x-real-ip"}
)
_CONSOLES: Final = 64


def peer_of(scope: MutableMapping[str, Any]) -> str:
    """The key of limits for a connection: its network, or `uid N` on this machine."""
    client = scope.get("client")
    address = str(client[0]) if client else ""
    uid = local_user(scope) if is_loopback(address) else None
    return neighbourhood(address) if uid is None else f"uid {uid}"


def local_user(scope: MutableMapping[str, Any]) -> int | None:
    """User id of the process of this machine at the other end; None for another machine, or where nobody knows."""
    client, server = scope.get("client"), scope.get("server")
    if not client or not server or server[1] is None:
        return None
    return user_of((str(client[0]), int(client[1])), (str(server[0]), int(server[1])))


def user_of(client: tuple[str, int], server: tuple[str, int]) -> int | None:
    """User id of the local process at the `client` end of a TCP connection; None when the system does not say."""
    try:
        addresses = [_plain(address) for address, _ in (client, server)]
        family = socket.AF_INET6 if addresses[0].version == 6 else socket.AF_INET
        ends = _ENDS.pack(client[1], server[1], *(address.packed.ljust(16, b"\0") for address in addresses))
        asked = _ASKED.pack(family, socket.IPPROTO_TCP, 0, 0, 0xFFFFFFFF) + ends + _ANY_COOKIE
        with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, _SOCK_DIAG) as system:
            system.settimeout(_TIMEOUT_S)
            system.send(_HEADER.pack(_HEADER.size + len(asked), _BY_FAMILY, _REQUEST, 1, 0) + asked)
            said = system.recv(4096)
        kind = _HEADER.unpack_from(said)[1]
        # Where no connection has these ends the system offers a socket that listens at one of them: not the peer.
        found = said[_HEADER.size + 1] == _ESTABLISHED and said[_ENDS_AT : _ENDS_AT + _ENDS.size] == ends
        return int(struct.unpack_from("=I", said, _UID_AT)[0]) if kind == _BY_FAMILY and found else None
    except (OSError, struct.error, ValueError, IndexError):
        return None


def _plain(address: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    """An address as its own socket has it: one of IPv4 is seen by a listener of IPv6 as a mapped one."""
    found = ipaddress.ip_address(address)
    mapped = found.ipv4_mapped if isinstance(found, ipaddress.IPv6Address) else None
    return mapped or found


class Consoles:
    """Browsers that have proved to be on this machine, by their cookies, with the user that they run as."""

    def __init__(self) -> None:
        # Not on disk: they end with the gateway.
        self._users: OrderedDict[str, int] = OrderedDict()

    def open(self, uid: int) -> str:
        """The cookie of a browser that has proved it."""
        cookie = secrets.token_hex(16)
        self._users[cookie] = uid
        if len(self._users) > _CONSOLES:
            self._users.popitem(last=False)
        return cookie

    def proves(self, scope: MutableMapping[str, Any], cookie: str | None) -> bool:
        """Whether a connection is from such a browser itself: nobody has carried it here, as far as can be known."""
        uid = self._users.get(cookie or "")
        return uid is not None and not is_forwarded(scope) and local_user(scope) == uid


def is_forwarded(scope: MutableMapping[str, Any]) -> bool:
    """Whether a proxy says that it has carried a request here."""
    return any(name.lower() in _FORWARDED for name, _ in scope["headers"])
