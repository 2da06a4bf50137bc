"""Settings of the gateway process, and limits by address."""

from __future__ import annotations

import ipaddress
import json
from pathlib import Path
from typing import Final, NamedTuple

# Floods: see the table in docs/explanation/security.md. Loopback is everybody on this machine and may have all.
BODY_MAX: Final = 64 * 1024
"""Bytes of a request body."""
CONNECTIONS: Final = 64
CONNECTIONS_REMOTE: Final = 8
"""Connections of one address."""
CONNECTIONS_OF_USER: Final = 16
"""WebSockets of one user, from all addresses together."""
UNUSED_S: Final = 60.0
"""Time without a command of a WebSocket, after which it makes room for another one of its user."""
REQUESTS_PER_S: Final = 10.0
REQUESTS_RESERVE: Final = 40.0
"""Of one peer without a session, and of one session."""
LOGINS_PER_S: Final = 5.0
LOGINS_RESERVE: Final = 20.0
"""Of one peer: a check of a password takes 0.1 s of a processor."""
HEADER_S: Final = 5.0
"""Time limit for a whole request; the connection is closed after it."""
STUCK_S: Final = 5.0
"""Time in which a client takes nothing of an answer, or of the rest of one; the connection is closed after it."""


class Settings(NamedTuple):
    """Arguments of the process.

    Attributes:
        listener: handle of the listening socket, made by the supervisor and kept over restarts.
        certificate, key: files of TLS, or None on loopback.
        names: host names under which browsers reach the page, beside the address.
        root: state root with the users. directory: state directory of the machine.
    """

    host: str
    port: int
    listener: int
    certificate: str | None
    key: str | None
    names: tuple[str, ...]
    root: Path
    directory: Path

    @classmethod
    def from_json(cls, text: str) -> Settings:
        """From the argument of the process."""
        found = json.loads(text)
        paths = {name: Path(found[name]) for name in ("root", "directory")}
        return cls(**{**found, **paths, "names": tuple(found["names"])})

    @property
    def secure(self) -> bool:
        """TLS is on."""
        return self.certificate is not None

    @property
    def hosts(self) -> frozenset[str]:
        """Accepted values of `Host`."""
        names = {_bracketed(self.host), *self.names}
        if is_loopback(self.host):
            names |= {"127.0.0.1", "localhost", "[::1]"}
        # Browsers leave the default port out of Host and Origin.
        default = 443 if self.secure else 80
        plain = names if self.port == default else set()
        return frozenset({f"{name}:{self.port}".lower() for name in names} | {name.lower() for name in plain})

    @property
    def origins(self) -> frozenset[str]:
        """Accepted values of `Origin`."""
        scheme = "https" if self.secure else "http"
        return frozenset(f"{scheme}://{host}" for host in self.hosts)


def is_loopback(host: str) -> bool:
    """Whether an address is of this machine only."""
    try:
        found = ipaddress.ip_address(host)
        # A listener of IPv6 sees this machine as ::ffff:127.0.0.1.
        mapped = found.ipv4_mapped if isinstance(found, ipaddress.IPv6Address) else None
        return (mapped or found).is_loopback
    except ValueError:
        return host == "localhost"


def neighbourhood(address: str) -> str:
    """The key of limits by address: an IPv4 address, or an IPv6 network of 64 bits."""
    # One customer has a /64 at least (RFC 6177): limits by single IPv6 address would be no limit.
    try:
        found = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(found, ipaddress.IPv4Address):
        return str(found)
    return str(found.ipv4_mapped or ipaddress.ip_network((found, 64), strict=False))


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host
