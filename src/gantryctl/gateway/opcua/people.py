"""Login over OPC UA: the users of the service, until password or role change."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import Any, Final

from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.user_managers import UserManager

from gantryctl.errors import StateError
from gantryctl.gateway.sessions import LockOut, worth_writing
from gantryctl.service.memory.events import EventLog
from gantryctl.service.protocol.limits import RateLimiter
from gantryctl.service.protocol.messages import Identity
from gantryctl.service.protocol.roles import Role
from gantryctl.service.supervisor import users

# Of one client, whatever the account: a check takes 0.1 s of a processor (decision 0011).
CHECKS_PER_S: Final = 1.0
CHECKS_RESERVE: Final = 10.0


@dataclass
class Reader(User):
    """A user as it was at login."""

    known: users.User | None = None


class People(UserManager):
    """The users of the service; every role may read.

    Failures lock the pair of account and client out, and a client is known by its certificate: nobody can lock an
    account for others, and a lock here does not lock the page.
    """

    def __init__(self, known: users.Users, events: EventLog) -> None:
        self._users, self._events = known, events
        self._locks, self._rate = LockOut(), RateLimiter(CHECKS_PER_S, CHECKS_RESERVE)
        self._checking = asyncio.Semaphore(1)
        self._admitted: dict[tuple[bytes, str, str], Reader] = {}

    async def admit(self, name: str, password: str, certificate: bytes, client: str, address: str) -> bool:
        """Check a password; what `get_user` asks next for is answered with the user.

        Args:
            certificate: of the channel, DER. client: its fingerprint. address: of the other end.
        """
        if not name or self._rate.wait_s(client) > 0.0:
            return False
        pair = (name[:64], client)
        async with self._checking:
            # Judged inside: an attempt that waited here comes after the failures before it.
            if self._locks.wait_s(*pair) > 0.0:
                return False
            try:
                found = await asyncio.to_thread(self._users.check, name, password)
            except StateError:
                return False
            count = 0 if found is not None else self._locks.failed(*pair)
        if found is None:
            if worth_writing(count):
                who = Identity("", name, Role.VIEWER, "opcua")
                self._events.put(
                    "login",
                    f"refused: wrong name or password, {count} times",
                    who,
                    address=address,
                    client=client,
                )
            return False
        self._locks.passed(*pair)
        who = Identity("", found.name, found.role, "opcua")
        self._events.put("login", "OPC UA session", who, address=address, client=client)
        self._admitted[certificate, name, password] = Reader(UserRole.User, found.name, found)
        return True

    def get_user(
        self, iserver: Any, username: str | None = None, password: str | None = None, certificate: Any = None
    ) -> Reader | None:
        """The user that `admit` has let in a moment ago, once."""
        # asyncua asks inside its event loop and cannot wait for a check of 0.1 s.
        return self._admitted.pop((certificate or b"", username or "", password or ""), None)

    def refused(self, address: str, count: int, why: str) -> None:
        """Write a refused channel into the journal, thinned out."""
        if worth_writing(count):
            self._events.put("login", f"OPC UA: a client was refused, {count} times: {why}", address=address)

    def ended(self, reader: Reader, why: str) -> None:
        """Write the end of a session into the journal."""
        known = reader.known
        who = None if known is None else Identity("", known.name, known.role, "opcua")
        self._events.put("login", f"OPC UA session ended: {why}", who)

    def all(self) -> dict[str, users.User]:
        """All users as they are now."""
        # While the users file cannot be read there are no users: sessions end.
        try:
            return self._users.all()
        except StateError:
            return {}
