"""Users: names, passwords, the file."""

from __future__ import annotations

import hashlib
import json
import os
import stat
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace

import pytest

from gantryctl.errors import StateError, UsageError
from gantryctl.service.protocol.roles import Role
from gantryctl.service.supervisor import users as module
from gantryctl.service.supervisor.users import FILE, PASSWORD_MAX, User, Users, UserWatch

PASSWORD = "correct horse battery"


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> list[User]:
    """Keys that cost no time; for which users one was made."""
    asked: list[User] = []

    def key(password: str, user: User) -> bytes:
        asked.append(user)
        return hashlib.sha256(f"{user.salt} {password}".encode()).digest()

    monkeypatch.setattr(module, "_key", key)
    return asked


def test_the_right_password_of_the_right_user_and_no_other(tmp_path: Path) -> None:
    users = Users(tmp_path)
    users.add("anna", Role.OPERATOR, PASSWORD)
    users.add("ben", Role.ADMIN, PASSWORD)
    found = users.check("anna", PASSWORD)
    assert found is not None
    assert (found.name, found.role) == ("anna", Role.OPERATOR)
    assert users.check("anna", PASSWORD + " ") is None
    assert users.check("carl", PASSWORD) is None
    assert users.check("", "") is None
    keys = [user.key for user in users.all().values()]
    assert keys[0] != keys[1]  # each has a salt of its own
    users.set_password("anna", "another password")
    assert users.check("anna", PASSWORD) is None
    users.remove("ben")
    assert set(users.all()) == {"anna"}


def test_the_file_is_for_its_owner_only_and_holds_no_password(tmp_path: Path) -> None:
    Users(tmp_path).add("anna", Role.OPERATOR, PASSWORD)
    path = tmp_path / FILE
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert PASSWORD not in path.read_text(encoding="utf-8")
    assert [p.name for p in tmp_path.iterdir()] == [FILE]


@pytest.mark.parametrize("name", ["", "Anna", "a b", "../x", "a" * 33, "1a", "a\n", "ä"])
@pytest.mark.parametrize("person", ["", "anna"])
def test_a_name_is_plain(tmp_path: Path, name: str, person: str) -> None:
    with pytest.raises(UsageError, match=r"user name .*a small letter"):
        Users(tmp_path).add(name, Role.VIEWER, PASSWORD, person)


@pytest.mark.parametrize("password", ["", "short", "x" * 11, "x" * (PASSWORD_MAX + 1)])
def test_a_password_is_long_enough(tmp_path: Path, password: str) -> None:
    with pytest.raises(UsageError, match="12 to 256 characters"):
        Users(tmp_path).add("anna", Role.VIEWER, password)


def test_an_account_is_its_own_person_unless_another_one_is_named(tmp_path: Path, quick: list[User]) -> None:
    users = Users(tmp_path)
    users.add("anna", Role.OPERATOR, PASSWORD)
    users.add("anna.service", Role.SERVICE, PASSWORD, "anna")
    assert [user.person for user in users.all().values()] == ["anna", "anna"]
    users.set_password("anna.service", PASSWORD + "!")
    assert users.person("anna.service") == "anna"
    users.set_person("anna", "bela")
    assert users.person("anna") == "bela"
    assert users.check("anna", PASSWORD) is not None
    assert users.person("root") == ""
    for wrong in ("", "Anna", "anna ", "a b"):
        with pytest.raises(UsageError, match="person"):
            users.set_person("anna", wrong)
    with pytest.raises(UsageError, match="no user 'carl'"):
        users.set_person("carl", "anna")


def test_a_file_without_persons_is_read_and_a_damaged_person_is_not(
    tmp_path: Path, quick: list[User]
) -> None:
    users = Users(tmp_path)
    users.add("anna", Role.OPERATOR, PASSWORD)
    found = json.loads(users.path.read_text(encoding="utf-8"))
    del found["users"]["anna"]["person"]
    users.path.write_text(json.dumps(found), encoding="utf-8")
    assert users.person("anna") == "anna"
    for wrong in ("", "Anna ", None, 3):
        found["users"]["anna"]["person"] = wrong
        users.path.write_text(json.dumps(found), encoding="utf-8")
        with pytest.raises(StateError, match=r"person|string"):
            users.all()
        assert users.person("anna") == ""


def test_unknown_users_and_twins_are_refused(tmp_path: Path, quick: list[User]) -> None:
    users = Users(tmp_path)
    users.add("anna", Role.VIEWER, PASSWORD)
    for wrong in (lambda: users.add("anna", Role.ADMIN, PASSWORD), lambda: users.remove("ben"),
                  lambda: users.set_password("ben", PASSWORD)):  # fmt: skip
        with pytest.raises(UsageError, match="there is"):
            wrong()


@pytest.mark.parametrize("damage", ["", "{", "[]", '{"format": "x", "users": {}}', '{"users": {}}'])
def test_a_damaged_file_lets_nobody_in_and_is_not_overwritten(tmp_path: Path, damage: str) -> None:
    (tmp_path / FILE).write_text(damage, encoding="utf-8")
    with pytest.raises(StateError, match="users cannot be read"):
        Users(tmp_path).add("anna", Role.VIEWER, PASSWORD)
    assert (tmp_path / FILE).read_text(encoding="utf-8") == damage


def test_a_role_that_does_not_exist_is_damage(tmp_path: Path, quick: list[User]) -> None:
    users = Users(tmp_path)
    users.add("anna", Role.VIEWER, PASSWORD)
    found = json.loads(users.path.read_text(encoding="utf-8"))
    found["users"]["anna"]["role"] = "god"
    users.path.write_text(json.dumps(found), encoding="utf-8")
    with pytest.raises(StateError):
        users.check("anna", PASSWORD)


def test_a_password_of_twelve_characters_is_one_and_the_name_is_none(
    tmp_path: Path, quick: list[User]
) -> None:
    users = Users(tmp_path)
    users.add("annabella.maria", Role.VIEWER, "x" * 12)
    for name in ("annabella.maria", "AnnaBella.Maria "):
        with pytest.raises(UsageError, match="must not be the name"):
            users.set_password("annabella.maria", name)
    assert users.check("annabella.maria", "x" * 12) is not None


def test_an_unknown_name_costs_as_much_as_a_known_one(tmp_path: Path, quick: list[User]) -> None:
    users = Users(tmp_path)
    users.add("anna", Role.VIEWER, PASSWORD)
    quick.clear()
    users.check("anna", PASSWORD)
    users.check("carl", PASSWORD)
    assert len(quick) == 2
    # 32 MB a check (decision 0011): 128 x n x r bytes.
    assert {(user.n, user.r, user.p, len(user.salt)) for user in quick} == {(32_768, 8, 1, 32)}


def test_a_new_password_leaves_role_and_person_and_removes_nobody(tmp_path: Path, quick: list[User]) -> None:
    users = Users(tmp_path)
    users.add("anna.s", Role.PHYSICIST, PASSWORD, "anna")
    users.add("ben", Role.OPERATOR, PASSWORD)
    users.set_password("anna.s", PASSWORD + "!")
    found = [(user.name, user.role, user.person) for user in users.all().values()]
    assert found == [("anna.s", Role.PHYSICIST, "anna"), ("ben", Role.OPERATOR, "ben")]
    assert len({user.salt for user in users.all().values()}) == 2


def test_at_the_start_all_users_are_listed_eight_in_a_line(tmp_path: Path, quick: list[User]) -> None:
    users = Users(tmp_path)
    for n in range(17):
        users.add(f"u{n:02d}", Role.VIEWER, PASSWORD)
    lines = UserWatch(users).changes()
    assert [line.count("(viewer)") for line in lines] == [8, 8, 1]
    assert lines[2] == "users at the start: u16 (viewer)"


def test_a_change_that_keeps_the_size_of_the_file_is_seen(tmp_path: Path, quick: list[User]) -> None:
    users = Users(tmp_path)
    users.add("anna", Role.VIEWER, PASSWORD)
    watch = UserWatch(users)
    watch.changes()
    size = users.path.stat().st_size
    users.set_password("anna", PASSWORD + "!")
    assert users.path.stat().st_size == size
    assert watch.changes() == ["user anna has a new password"]
    users._store(users.all())
    assert watch.changes() == ["the file of users was written again, nothing has changed"]


def test_a_password_counts_to_its_last_character(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """256 of them; of a longer one no more is looked at than shows that it is too long."""
    secrets: list[bytes] = []

    def scrypt(secret: bytes, **_: object) -> bytes:
        secrets.append(secret)
        return hashlib.sha256(secret).digest()

    monkeypatch.setattr(module.hashlib, "scrypt", scrypt)
    users = Users(tmp_path)
    users.add("anna", Role.VIEWER, "x" * 255 + "y")
    found = [users.check("anna", "x" * 255 + last) is not None for last in ("y", "x", "", "yx")]
    assert found == [True, False, False, False]
    users.check("anna", "x" * 10**5)
    assert [len(secret) for secret in secrets] == [256, 256, 256, 255, 257, 257]


@pytest.mark.parametrize("person", ["Anna", "anna ", "a b"])
def test_a_new_account_belongs_to_a_plain_person(tmp_path: Path, quick: list[User], person: str) -> None:
    """Two spellings of one person would be two persons."""
    with pytest.raises(UsageError, match="person"):
        Users(tmp_path).add("anna.service", Role.SERVICE, PASSWORD, person)


def test_a_password_was_set_at_a_time_of_the_whole_world(
    tmp_path: Path, quick: list[User], monkeypatch: pytest.MonkeyPatch
) -> None:
    noon = datetime(2030, 6, 1, 12, tzinfo=UTC)

    def now(zone: object = None) -> datetime:
        return noon if zone is UTC else noon.replace(hour=14, tzinfo=None)

    monkeypatch.setattr(module, "datetime", SimpleNamespace(now=now))
    users = Users(tmp_path / "new" / "root")
    users.add("anna", Role.VIEWER, PASSWORD)
    assert users.all()["anna"].since == "2030-06-01T12:00:00Z"


@pytest.mark.parametrize("what", ["salt", "key"])
def test_a_hash_that_is_none_is_damage_before_anybody_logs_in(
    tmp_path: Path, quick: list[User], what: str
) -> None:
    users = Users(tmp_path)
    users.add("anna", Role.VIEWER, PASSWORD)
    found = json.loads(users.path.read_text(encoding="utf-8"))
    found["users"]["anna"][what] = "no number"
    users.path.write_text(json.dumps(found), encoding="utf-8")
    with pytest.raises(StateError, match="users cannot be read"):
        users.all()


def test_every_change_of_one_write_is_told(tmp_path: Path, quick: list[User]) -> None:
    users = Users(tmp_path)
    users.add("anna", Role.VIEWER, PASSWORD)
    watch = UserWatch(users)
    watch.changes()
    (user,) = users.all().values()
    users._store({"anna": user._replace(role=Role.ADMIN, person="bela", key="00")})
    assert watch.changes() == [
        "user anna has the role admin now, before it was viewer",
        "user anna is an account of bela now, before of anna",
        "user anna has a new password",
    ]


def test_a_file_that_is_written_in_place_is_seen(tmp_path: Path, quick: list[User]) -> None:
    """As an editor does it: the same file of the same size, at another time."""
    users = Users(tmp_path)
    users.add("anna", Role.VIEWER, PASSWORD)
    watch = UserWatch(users)
    watch.changes()
    before = users.path.stat()
    text = users.path.read_text(encoding="utf-8")
    users.path.write_text(text.replace('"anna": {', '"ilse": {'), encoding="utf-8")
    os.utime(users.path, ns=(before.st_mtime_ns, before.st_mtime_ns + 1_000_000_000))
    after = users.path.stat()
    assert (after.st_ino, after.st_size) == (before.st_ino, before.st_size)
    assert watch.changes() == [
        "user anna was removed", "user ilse was added, role viewer, an account of anna"
    ]  # fmt: skip
