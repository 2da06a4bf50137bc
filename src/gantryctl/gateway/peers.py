"""Who is at the other end of a connection: its address, and on this machine the user that it runs as.

All local processes have one address. Limits by that alone would let any of them lock the operator out.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import MutableMapping
from typing import Any, Final

from gantryctl.gateway.settings import is_loopback, neighbourhood

# linux/inet_diag.h, linux/sock_diag.h: one socket is asked for by its ends.
_SOCK_DIAG, _BY_FAMILY, _REQUEST = 4, 20, 1
_HEADER: Final = struct.Struct("=IHHII")
_ASKED: Final = struct.Struct("=BBBBI")
_ENDS: Final = struct.Struct("!HH16s16s")
_ANY_COOKIE: Final = struct.pack("=III", 0, 0xFFFFFFFF, 0xFFFFFFFF)
_UID_AT: Final = _HEADER.size + 4 + _ENDS.size + len(_ANY_COOKIE) + 12
_TIMEOUT_S: Final = 0.2


def peer_of(scope: MutableMapping[str, Any]) -> str:
    """The key of limits for a connection: its network, or `uid N` on this machine."""
    client, server = scope.get("client"), scope.get("server")
    address = str(client[0]) if client else ""
    if not client or not server or server[1] is None or not is_loopback(address):
        return neighbourhood(address)
    uid = user_of((address, int(client[1])), (str(server[0]), int(server[1])))
    return neighbourhood(address) if uid is None else f"uid {uid}"


def user_of(client: tuple[str, int], server: tuple[str, int]) -> int | None:
    """User id of the local process at the `client` end of a TCP connection; None when the system does not say."""
    family = socket.AF_INET6 if ":" in client[0] else socket.AF_INET
    try:
        ends = [socket.inet_pton(family, address).ljust(16, b"\0") for address, _ in (client, server)]
        asked = _ASKED.pack(family, socket.IPPROTO_TCP, 0, 0, 0xFFFFFFFF)
        asked += _ENDS.pack(client[1], server[1], *ends) + _ANY_COOKIE
        with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, _SOCK_DIAG) as system:
            system.settimeout(_TIMEOUT_S)
            system.send(_HEADER.pack(_HEADER.size + len(asked), _BY_FAMILY, _REQUEST, 1, 0) + asked)
            said = system.recv(4096)
        kind = _HEADER.unpack_from(said)[1]
        return int(struct.unpack_from("=I", said, _UID_AT)[0]) if kind == _BY_FAMILY else None
    except (OSError, struct.error):
        return None
