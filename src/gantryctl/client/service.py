"""A service on the network: login, what it shows, events, recordings, and the connection to its axis."""

from __future__ import annotations

import http.client
import ipaddress
import json
import ssl
import tempfile
from contextlib import suppress
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from types import TracebackType
from typing import Any, Final, NamedTuple
from urllib.parse import quote, urlsplit

from gantryctl.client.axis import Axis
from gantryctl.client.tags import AlarmRow, Tags
from gantryctl.client.wires import WebSocketWire, refusal_of
from gantryctl.errors import DeviceError, GantryctlError, UsageError
from gantryctl.trace.reader import read_trace
from gantryctl.trace.table import Trace

_API: Final = "/api/v1"
_SESSION: Final = "__Host-gantryctl_session"


class Person(NamedTuple):
    """Who is logged in, and what the role may do."""

    user: str
    person: str
    role: str
    may: tuple[str, ...]


class Event(NamedTuple):
    """One event of the journal.

    Attributes:
        seq: its number; `events(after=seq)` goes on behind it. utc: date and time.
        kind: one word, as command, alarm, authority. values: of the event.
        hash: of the chain up to it.
    """

    seq: int
    utc: str
    kind: str
    user: str
    role: str
    place: str
    text: str
    values: dict[str, Any]
    hash: str


class Recording(NamedTuple):
    """A recording that the service has closed; `id` is for `Service.recording`."""

    id: str
    name: str
    size: int
    modified: str


class Service:
    """A session at the service of a machine; a context manager that logs out.

    Args:
        address: of its page, as `https://gantry.example:8650`. Without TLS only on this computer.
        user, password: of an account of the service. There is no second factor.
        certificate: file with the certificate of the service, or of who has signed it, where the system does not know
            it. There is no way to leave the check out.
        timeout_s: for each answer.

    Raises:
        Refused: SEC-01 wrong name or password, or locked after wrong ones.
        DeviceError: nobody answers there, or its certificate is not trusted.
        UsageError: no such address can be.
    """

    def __init__(
        self,
        address: str,
        user: str,
        password: str,
        *,
        certificate: str | Path | None = None,
        timeout_s: float = 10.0,
    ) -> None:
        found = urlsplit(address)
        self._host, self._timeout_s = found.hostname or "", timeout_s
        secure = found.scheme == "https"
        if found.scheme not in ("http", "https") or not self._host or found.path not in ("", "/"):
            raise UsageError(f"{address}: the address of a service is http(s)://HOST:PORT")
        if not secure and not _is_this_computer(self._host):
            raise UsageError(f"{address}: a password goes over the network with TLS only: https://")
        try:
            self._port = found.port or (443 if secure else 80)
            self._trust = ssl.create_default_context(cafile=certificate) if secure else None
        except (OSError, ValueError) as fault:
            raise UsageError(f"{certificate or address}: cannot be used: {fault}") from fault
        self._address = f"{found.scheme}://{found.netloc}"
        self._cookie = ""
        self.who = self._log_in(user, password)

    def __enter__(self) -> Service:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Log out, which ends its connections too; may be called twice."""
        if self._cookie:
            with suppress(GantryctlError):
                self._ask("POST", "/logout", {})
        self._cookie = ""

    def axis(self) -> Axis:
        """Connect to the axis: live tags and commands.

        Raises:
            Refused: SEC-06 too many connections. DeviceError: the service does not answer.
        """
        return Axis(WebSocketWire(self._address, f"{_API}/socket", self._cookie, self._trust))

    def status(self) -> Tags:
        """All tags once.

        Raises:
            DeviceError: the controller is silent.
        """
        found = json.loads(self._ask("GET", "/status"))
        if not found["fresh"]:
            raise DeviceError("the service shows no present state: its controller is silent")
        return Tags.of(found["tags"])

    def alarms(self) -> list[AlarmRow]:
        """The last 50 alarms, newest first; `active` tells which stand."""
        history: list[AlarmRow] = json.loads(self._ask("GET", "/alarms"))["history"]
        return history

    def events(self, after: int = 0, limit: int = 1000) -> list[Event]:
        """Events of the journal behind a number, oldest first, 10 000 at most; the reading is an event itself.

        Raises:
            Refused: SEC-01 the role may not read it.
        """
        lines = self._ask("GET", f"/journal?from={after}&limit={limit}").decode().splitlines()
        return [_event(json.loads(line)) for line in lines]

    def recordings(self) -> list[Recording]:
        """Closed recordings, newest first."""
        return [Recording(**row) for row in json.loads(self._ask("GET", "/traces"))]

    def recording(self, recording: Recording) -> Trace:
        """Fetch and read one recording."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "recording.parquet"
            path.write_bytes(self._ask("GET", f"/traces/{quote(recording.id, safe='')}"))
            return read_trace(path)

    def _log_in(self, user: str, password: str) -> Person:
        found = json.loads(self._ask("POST", "/login", {"user": user, "password": password}))
        return Person(found["user"], found["person"], found["role"], tuple(found["may"]))

    def _ask(self, method: str, path: str, body: object = None) -> bytes:
        headers = {"Cookie": self._cookie} if self._cookie else {}
        if body is not None:
            headers["Content-Type"] = "application/json"
        data = None if body is None else json.dumps(body).encode()
        # No proxy of the environment: the password is for this host.
        if self._trust is None:
            made = http.client.HTTPConnection(self._host, self._port, timeout=self._timeout_s)
        else:
            made = http.client.HTTPSConnection(
                self._host, self._port, timeout=self._timeout_s, context=self._trust
            )
        try:
            made.request(method, _API + path, data, headers)
            answer = made.getresponse()
            content = answer.read()
        except (OSError, http.client.HTTPException) as fault:
            raise DeviceError(f"{self._address}: the service does not answer: {fault}") from fault
        finally:
            made.close()
        if answer.status >= 400:
            raise refusal_of(content, answer.status)
        self._keep_cookie(answer.getheader("Set-Cookie", ""))
        return content

    def _keep_cookie(self, header: str) -> None:
        # A jar of the standard library sends no Secure cookie over http, which the page of this computer has.
        with suppress(CookieError):
            found = SimpleCookie(header).get(_SESSION)
            if found is not None:
                self._cookie = f"{_SESSION}={found.value}"


def _is_this_computer(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _event(row: dict[str, Any]) -> Event:
    values = json.loads(row["detail"])
    return Event(**{name: row[name] for name in Event._fields if name != "values"}, values=values)
