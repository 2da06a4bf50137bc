"""Sessions, and the lock-out after wrong passwords."""

from __future__ import annotations

import secrets
import time
from collections import Counter, OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from gantryctl.errors import StateError
from gantryctl.service.protocol.roles import Role
from gantryctl.service.supervisor.users import User, Users

# Idle time, whole time and waits are those of the table in docs/explanation/security.md.
IDLE_S: Final = 15 * 60.0
WHOLE_S: Final = 8 * 3600.0
FAILURES: Final = 5
LOCK_MAX_S: Final = 15 * 60.0
_WRITTEN: Final = 5
SESSIONS_OF_USER: Final = 16
"""Sessions of one user; one of the peer that has most of them makes room for the next."""
# Bound of memory: guesses from many addresses must not fill it.
_REMEMBERED: Final = 10_000


@dataclass
class Session:
    """One login.

    Attributes:
        key: the password's key at login: another password ends the session. used_s: last request of its user.
        person: whose account it is. peer: who has logged in, as limits know it.
    """

    token: str
    user: str
    role: Role
    person: str
    key: str
    peer: str
    since_s: float
    used_s: float


class Sessions:
    """Sessions in memory."""

    def __init__(self, users: Users, now: Callable[[], float] = time.monotonic) -> None:
        self._users, self._now = users, now
        # Not on disk: a restart of the gateway ends them all, and no file can leak a token (decision 0011).
        self._sessions: dict[str, Session] = {}
        self._known: dict[str, User] = {}
        self._stamp: tuple[int, int] | None = None

    def open(self, user: User, peer: str) -> Session:
        """A new session; when the user has too many, one of the peer with most of them makes room."""
        now_s = self._now()
        own = [each for each in [*self._sessions.values()] if each.user == user.name and self.lives(each)]
        if len(own) >= SESSIONS_OF_USER:
            # Room is made where the flood is: logins from one peer end no session of another one, nor of other users.
            count = Counter(each.peer for each in own)
            count[peer] += 1
            self.close(min(own, key=lambda each: (-count[each.peer], each.used_s)))
        session = Session(
            secrets.token_hex(16), user.name, user.role, user.person, user.key, peer, now_s, now_s
        )
        self._sessions[session.token] = session
        return session

    def find(self, token: str | None) -> Session | None:
        """The living session of a cookie, or None."""
        session = self._sessions.get(token or "")
        return session if session is not None and self.lives(session) else None

    def lives(self, session: Session) -> bool:
        """Whether a session is in time and not closed, its user, role and person unchanged."""
        now_s = self._now()
        user = self._user(session.user)
        alive = (
            session.token in self._sessions
            and now_s - session.used_s < IDLE_S
            and now_s - session.since_s < WHOLE_S
            and user is not None
            and (user.role, user.person, user.key) == (session.role, session.person, session.key)
        )
        if not alive:
            self.close(session)
        return alive

    def use(self, session: Session) -> None:
        """Restart the idle time."""
        session.used_s = self._now()

    def close(self, session: Session) -> None:
        """Log out."""
        self._sessions.pop(session.token, None)

    def _user(self, name: str) -> User | None:
        """The user in the file, which is read when it has changed; a damaged one has no users."""
        # The inode too: a file that is renamed into place may keep the time of the one before.
        try:
            found = self._users.path.stat()
            stamp = (found.st_mtime_ns, found.st_ino)
        except OSError:
            stamp = None
        if stamp != self._stamp:
            self._stamp = stamp
            try:
                self._known = self._users.all()
            except StateError:
                self._known = {}
        return self._known.get(name)


class LockOut:
    """Lock-out by account and address: after five failures each further one doubles the wait.

    An account is not locked for other addresses: a stranger must not be able to lock an operator out.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._failures: OrderedDict[tuple[str, str], tuple[int, float]] = OrderedDict()

    def wait_s(self, account: str, address: str) -> float:
        """How long this pair must still wait; 0 when it may try."""
        count, at_s = self._failures.get((account, address), (0, 0.0))
        if count < FAILURES:
            return 0.0
        # Without a bound of the power no float would hold it after 1029 failures, and nobody could log in any more.
        return max(0.0, at_s + min(LOCK_MAX_S, 2.0 ** min(count - FAILURES, 10)) - self._now())

    def failed(self, account: str, address: str) -> int:
        """Count a wrong password; return the number of them."""
        count = self._failures.pop((account, address), (0, 0.0))[0] + 1
        self._failures[account, address] = (count, self._now())
        if len(self._failures) > _REMEMBERED:
            self._failures.popitem(last=False)
        return count

    def passed(self, account: str, address: str) -> None:
        """Forget the failures after a right password."""
        self._failures.pop((account, address), None)


def worth_writing(count: int) -> bool:
    """Whether this failure of a pair goes into the journal: the first five, then every tenth."""
    return count <= _WRITTEN or count % 10 == 0
