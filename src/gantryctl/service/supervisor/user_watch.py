"""Changes of the file of users while the service runs, for the journal: made on the command line, seen here."""

from __future__ import annotations

from gantryctl.errors import StateError
from gantryctl.service.supervisor.users import User, Users


class UserWatch:
    """What has changed since it was last asked."""

    def __init__(self, users: Users) -> None:
        self._users = users
        self._stamp: object = self
        self._known: dict[str, User] | None = None

    def changes(self) -> list[str]:
        """One line for each change; nothing for what was there at the first look."""
        try:
            found = self._users.path.stat()
            stamp: object = (found.st_mtime_ns, found.st_ino, found.st_size)
        except OSError:
            stamp = None
        if stamp == self._stamp:
            return []
        self._stamp = stamp
        try:
            users = self._users.all()
        except StateError as fault:
            return [f"SEC-01 {fault}; nobody can log in"]
        before, self._known = self._known, users
        return [] if before is None else _differences(before, users)


def _differences(before: dict[str, User], now: dict[str, User]) -> list[str]:
    found = [f"user {name} was removed" for name in sorted(before.keys() - now.keys())]
    for name, user in sorted(now.items()):
        old = before.get(name)
        if old is None:
            found.append(f"user {name} was added, role {user.role}")
            continue
        if user.role is not old.role:
            found.append(f"user {name} has the role {user.role} now, before it was {old.role}")
        if user.key != old.key:
            found.append(f"user {name} has a new password")
    return found
