"""Users: names, passwords, the file."""

from __future__ import annotations

import json
import stat
from pathlib import Path

import pytest

from gantryctl.errors import StateError, UsageError
from gantryctl.service.protocol.roles import Role
from gantryctl.service.supervisor.users import FILE, PASSWORD_MAX, Users

PASSWORD = "correct horse battery"


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
def test_a_name_is_plain(tmp_path: Path, name: str) -> None:
    with pytest.raises(UsageError, match="a small letter"):
        Users(tmp_path).add(name, Role.VIEWER, PASSWORD)


@pytest.mark.parametrize("password", ["", "short", "x" * 11, "x" * (PASSWORD_MAX + 1)])
def test_a_password_is_long_enough(tmp_path: Path, password: str) -> None:
    with pytest.raises(UsageError, match="12 to 256 characters"):
        Users(tmp_path).add("anna", Role.VIEWER, password)


def test_an_account_is_its_own_person_unless_another_one_is_named(tmp_path: Path) -> None:
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


def test_a_file_without_persons_is_read_and_a_damaged_person_is_not(tmp_path: Path) -> None:
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


def test_unknown_users_and_twins_are_refused(tmp_path: Path) -> None:
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


def test_a_role_that_does_not_exist_is_damage(tmp_path: Path) -> None:
    users = Users(tmp_path)
    users.add("anna", Role.VIEWER, PASSWORD)
    found = json.loads(users.path.read_text(encoding="utf-8"))
    found["users"]["anna"]["role"] = "god"
    users.path.write_text(json.dumps(found), encoding="utf-8")
    with pytest.raises(StateError):
        users.check("anna", PASSWORD)
