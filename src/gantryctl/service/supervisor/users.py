"""Users of the service: one file with names, roles and scrypt hashes, written by the local command line only."""

from __future__ import annotations

import hashlib
import hmac
import json
import re
import secrets
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

from gantryctl.errors import StateError, UsageError
from gantryctl.files import write_whole
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words
from gantryctl.service.protocol.roles import Role

FILE: Final = "users.json"
FORMAT: Final = "gantryctl users, version 1"
PASSWORD_MIN: Final = 12
PASSWORD_MAX: Final = 256
# Names of users in a line of the journal, which has 500 bytes.
_LISTED: Final = 8
_NAME: Final = re.compile(r"[a-z][a-z0-9._-]{0,31}")
# Decision 0011: 0.1 s and 32 MB a check; one check at a time.
_N, _R, _P = 2**15, 8, 1
_MEMORY: Final = 128 * 2**20


class User(NamedTuple):
    """One user.

    Attributes:
        person: whose account it is: a name as for users. Two accounts of one person are no two persons.
        salt, key: scrypt, hexadecimal. n, r, p: its cost.
        since: when the password was set, UTC.
    """

    name: str
    role: Role
    person: str
    salt: str
    key: str
    n: int
    r: int
    p: int
    since: str


class Users:
    """The users of a state root; read from the file with every question.

    Attributes:
        root: directory of the file. path: the file.
    """

    def __init__(self, root: Path) -> None:
        self.root, self.path = root, root / FILE

    def all(self) -> dict[str, User]:
        """Read all users by name.

        Raises:
            StateError: the file is damaged.
        """
        try:
            found = json.loads(self.path.read_text(encoding="utf-8"))
            if found["format"] != FORMAT:
                raise ValueError(f"format {found['format']!r}")
            return {name: _user(name, values) for name, values in found["users"].items()}
        except FileNotFoundError:
            return {}
        except (OSError, ValueError, KeyError, TypeError, AttributeError, UsageError) as fault:
            raise StateError(f"{self.path}: users cannot be read: {fault}") from fault

    def add(self, name: str, role: Role, password: str, person: str = "") -> None:
        """Add a user; `person` is whose account it is, where it has not the name of its person.

        Raises:
            UsageError: a name is taken or not possible, or the password too short.
        """
        _check_name("user name", name)
        _check_name("person", person or name)
        users = self.all()
        if name in users:
            raise UsageError(
                f"there is a user {name} already: `gantryctl user passwd {name}`, or remove it first"
            )
        self._store({**users, name: made(name, role, person or name, password)})

    def remove(self, name: str) -> None:
        """Remove a user; UsageError for an unknown one."""
        users = self.all()
        _known(users, name)
        self._store({other: user for other, user in users.items() if other != name})

    def set_password(self, name: str, password: str) -> None:
        """Set another password, which ends the user's sessions; UsageError for an unknown user."""
        users = self.all()
        known = _known(users, name)
        self._store({**users, name: made(name, known.role, known.person, password)})

    def set_person(self, name: str, person: str) -> None:
        """Say whose account it is, which ends its sessions; UsageError for an unknown user or a name not possible."""
        users = self.all()
        known = _known(users, name)
        _check_name("person", person)
        self._store({**users, name: known._replace(person=person)})

    def person(self, account: str) -> str:
        """Whose account it is, on the page or of the system with the same name; "" where there is none."""
        try:
            user = self.all().get(account)
        except StateError:
            return ""
        return "" if user is None else user.person

    def changed_ns(self) -> int:
        """When the file was written, ns of the clock of the computer; 0 where there is none."""
        try:
            return self.path.stat().st_mtime_ns
        except OSError:
            return 0

    def check(self, name: str, password: str) -> User | None:
        """Return the user if the password is right."""
        # An unknown name takes the same time: guesses learn nothing about names.
        user = self.all().get(name)
        against = user or _UNKNOWN
        right = hmac.compare_digest(_key(password, against), bytes.fromhex(against.key))
        return user if right and user is not None else None

    def _store(self, users: dict[str, User]) -> None:
        values = {
            name: {k: v for k, v in user._asdict().items() if k != "name"} for name, user in users.items()
        }
        text = json.dumps({"format": FORMAT, "users": values}, indent=1) + "\n"
        write_whole(self.path, text, private=True, make_folder=True)


def made(name: str, role: Role, person: str, password: str) -> User:
    """Make a user with a fresh salt; UsageError for a password that is too short or too long."""
    if not PASSWORD_MIN <= len(password) <= PASSWORD_MAX:
        raise UsageError(
            f"a password has {PASSWORD_MIN} to {PASSWORD_MAX} characters, this one has {len(password)}"
        )
    if password.lower().strip() == name:
        raise UsageError("the password must not be the name")
    when = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    user = User(name, role, person, secrets.token_hex(16), "", _N, _R, _P, when)
    return user._replace(key=_key(password, user).hex())


def _key(password: str, user: User) -> bytes:
    salt, secret = bytes.fromhex(user.salt), password[: PASSWORD_MAX + 1].encode(errors="surrogatepass")
    return hashlib.scrypt(secret, salt=salt, n=user.n, r=user.r, p=user.p, maxmem=_MEMORY, dklen=32)


def _user(name: str, values: dict[str, Any]) -> User:
    bytes.fromhex(values["salt"]), bytes.fromhex(values["key"])
    # A file of before has no persons: each account is then one of its own.
    person = values.get("person", name)
    _check_name("person", person)
    rest = {k: values[k] for k in ("salt", "key", "n", "r", "p", "since")}
    return User(name, Role(values["role"]), person, **rest)


def _check_name(what: str, name: str) -> None:
    if not _NAME.fullmatch(name):
        raise UsageError(f"{what} {name!a}: a small letter, then at most 31 of a-z 0-9 . _ -")


def _known(users: dict[str, User], name: str) -> User:
    if name not in users:
        raise UsageError(f"there is no user {name!a}; there are: {', '.join(sorted(users)) or 'none'}")
    return users[name]


_UNKNOWN: Final = User("", Role.VIEWER, "", "00" * 16, "00" * 32, _N, _R, _P, "")


class UserWatch:
    """Changes of the file while the service runs, for the journal.

    Attributes:
        file_ns: time of the file that was seen last, as `Users.changed_ns`.
    """

    def __init__(self, users: Users) -> None:
        self._users = users
        self._stamp: object = self
        self._known: dict[str, User] | None = None
        self.file_ns = 0

    def changes(self) -> list[str]:
        """Return one line for each change since the last call; at the first, who there is."""
        try:
            found = self._users.path.stat()
            stamp: object = (found.st_mtime_ns, found.st_ino, found.st_size)
        except OSError:
            stamp = None
        if stamp == self._stamp:
            return []
        self._stamp, self.file_ns = stamp, self._users.changed_ns()
        try:
            users = self._users.all()
        except StateError as fault:
            return [refusal(Code.SEC_01, reason=Words.USERS_DAMAGED(fault=fault)).line]
        before, self._known = self._known, users
        if before is None:
            return _listed(users)
        # Whoever wrote the file waits for an event.
        return _differences(before, users) or ["the file of users was written again, nothing has changed"]


def _listed(users: dict[str, User]) -> list[str]:
    """Who there is, some in a line: changes that were made while no service ran can be seen so."""
    names = [f"{name} ({user.role})" for name, user in sorted(users.items())]
    parts = [names[n : n + _LISTED] for n in range(0, len(names), _LISTED)]
    return [f"users at the start: {', '.join(part)}" for part in parts]


def _differences(before: dict[str, User], now: dict[str, User]) -> list[str]:
    found = [f"user {name} was removed" for name in sorted(before.keys() - now.keys())]
    for name, user in sorted(now.items()):
        old = before.get(name)
        if old is None:
            whose = "" if user.person == name else f", an account of {user.person}"
            found.append(f"user {name} was added, role {user.role}{whose}")
            continue
        if user.role is not old.role:
            found.append(f"user {name} has the role {user.role} now, before it was {old.role}")
        if user.person != old.person:
            found.append(f"user {name} is an account of {user.person} now, before of {old.person}")
        if user.key != old.key:
            found.append(f"user {name} has a new password")
    return found
