"""Login over OPC UA: the users of the service, until password or role change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from asyncua import Server
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.user_managers import UserManager

from gantryctl.errors import StateError
from gantryctl.gateway.sessions import LockOut, worth_writing
from gantryctl.service.memory.events import EventLog
from gantryctl.service.protocol.messages import Identity
from gantryctl.service.protocol.roles import Role
from gantryctl.service.supervisor import users


# asyncua gives its classes no types that mypy reads: deriving from them needs the word, here and in `server`.
@dataclass
class Reader(User):  # type: ignore[misc]
    """A user as it was at login."""

    known: users.User | None = None


class People(UserManager):  # type: ignore[misc]
    """The users of the service, with the same lock-out; every role may read."""

    def __init__(self, known: users.Users, events: EventLog) -> None:
        self._users, self._events, self._locks = known, events, LockOut()

    def get_user(
        self, iserver: Any, username: str | None = None, password: str | None = None, certificate: Any = None
    ) -> Reader | None:
        """The user of a session, or None."""
        # asyncua hands over no address here, so the lock-out is by account alone.
        name = username or ""
        if not name or password is None or self._locks.wait_s(name[:64], "opcua") > 0.0:
            return None
        try:
            found = self._users.check(name, password)
        except StateError:
            return None
        if found is None:
            count = self._locks.failed(name[:64], "opcua")
            if worth_writing(count):
                who = Identity("", name, Role.VIEWER, "opcua")
                self._events.put("login", f"refused: wrong name or password, {count} times", who)
            return None
        self._locks.passed(name[:64], "opcua")
        self._events.put("login", "OPC UA session", Identity("", found.name, found.role, "opcua"))
        return Reader(UserRole.User, found.name, found)

    async def end_sessions(self, server: Server) -> None:
        """End the sessions of users who are gone, or have another password or role."""
        # While the users file cannot be read there are no users: sessions end.
        try:
            now = self._users.all()
        except StateError:
            now = {}
        for client in list(server.bserver.clients):
            session = client.processor.session
            user = session.user if session is not None and session.is_activated() else None
            if not isinstance(user, Reader) or user.known is None or now.get(user.known.name) == user.known:
                continue
            who = Identity("", user.known.name, user.known.role, "opcua")
            self._events.put("login", "OPC UA session ended: the user has changed", who)
            # With the subscriptions; closing the transport alone would leave the session to a reconnect.
            await session.close_session(True)
            client.transport.close()
