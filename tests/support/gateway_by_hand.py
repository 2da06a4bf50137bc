"""What tests of the doors share: two people, a clock, and a request."""

from __future__ import annotations

from typing import Any

from gantryctl.gateway.access import Access
from gantryctl.gateway.guard import Guard
from gantryctl.service.protocol.roles import Role
from gantryctl.service.supervisor.users import User

ANNA = User("anna", Role.OPERATOR, "Anna", "", "", 1, 1, 1, "")
BEN = ANNA._replace(name="ben", person="Ben")
HERE = b"127.0.0.1:1"
JSON = (b"content-type", b"application/json")
Headers = list[tuple[bytes, bytes]]


class Clock:
    """A time that the test sets."""

    def __init__(self) -> None:
        self.s = 1000.0

    def __call__(self) -> float:
        return self.s


def scope(method: str = "GET", path: str = "/", headers: Headers | None = None) -> dict[str, Any]:
    """A request from another computer, as the server gives it to an application."""
    return {
        "type": "http", "method": method, "path": path, "query_string": b"", "scheme": "http",
        "client": ("192.0.2.7", 1), "server": ("127.0.0.1", 1), "headers": headers or [],
    }  # fmt: skip


def guard(access: Access, session: Any = None) -> Guard:
    """A guard of no application, with this session for whoever asks."""
    return Guard(None, access.settings, lambda connection: session)  # type: ignore[arg-type]
