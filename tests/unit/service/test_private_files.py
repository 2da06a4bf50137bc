"""Files with a secret: what the service accepts, and the command that it tells to type."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.service.recorder.journal.places import places_of
from gantryctl.service.supervisor.private_files import exposed, private_files

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")
STRANGER = 54321


@pytest.mark.parametrize("owner", ["mine", "root"])
def test_every_mode_is_judged_by_who_else_gets_at_the_secret(tmp_path: Path, owner: str) -> None:
    if owner == "root" and os.geteuid() != 0:
        pytest.skip("only root has files of root")
    file = tmp_path / "a key.pem"
    file.write_text("secret")
    allowed = []
    for mode in range(0o1000):
        file.chmod(mode)
        # root reads what nobody may read; for anybody else such a file is refused because it cannot be read.
        if not exposed(file) and mode & 0o700 == 0o600:
            allowed.append(mode)
    # Tests run as root have no file that is theirs and not root's.
    assert allowed == ([0o600] if os.geteuid() else [0o600, 0o640])


@pytest.mark.parametrize("mode", [0o644, 0o660, 0o604, 0o602, 0o666])
def test_what_it_says_names_the_mode_and_the_command_that_mends_it(tmp_path: Path, mode: int) -> None:
    file = tmp_path / "a key.pem"
    file.write_text("secret")
    file.chmod(mode)
    said = exposed(file)
    assert said.startswith(f"{file}: mode {mode:04o}, other users can read or change it: chmod 06")
    subprocess.run(["sh", "-c", said.rpartition(": ")[2]], check=True)
    assert exposed(file) == ""
    assert stat.S_IMODE(file.stat().st_mode) & 0o007 == 0


def test_a_key_of_another_user_is_his_to_read_and_to_change(tmp_path: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root gives files away")
    file = tmp_path / "key.pem"
    file.write_text("secret")
    file.chmod(0o600)
    os.chown(file, STRANGER, -1)
    assert exposed(file) == f"{file}: belongs to {STRANGER}, who can read and change it: chown root {file}"


def test_of_a_link_the_file_behind_it_counts(tmp_path: Path) -> None:
    file, link = tmp_path / "privkey1.pem", tmp_path / "privkey.pem"
    file.write_text("secret")
    file.chmod(0o644)
    link.symlink_to(file)
    assert "mode 0644" in exposed(link)


def test_a_file_that_is_not_there_exposes_nothing_and_a_folder_is_no_key(tmp_path: Path) -> None:
    assert exposed(tmp_path / "key.pem") == ""
    assert "cannot be read" in exposed(tmp_path)


@pytest.mark.usefixtures("keys")
def test_every_secret_of_a_service_is_looked_at(tmp_path: Path) -> None:
    root, directory = tmp_path / "root", tmp_path / "root" / "gantry"
    always = [root / "users.json", directory / "opcua" / "key.pem", places_of(directory).key]
    assert private_files(root, directory, None) == always
    assert private_files(root, directory, tmp_path / "tls.pem") == [*always, tmp_path / "tls.pem"]


def test_a_secret_of_the_user_of_the_service_is_for_nobody_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A group may read that of root alone."""
    if os.geteuid() != 0:
        pytest.skip("only root gives files away")
    file = tmp_path / "key.pem"
    file.write_text("secret")
    os.chown(file, STRANGER, -1)
    monkeypatch.setattr(os, "geteuid", lambda: STRANGER)
    found = []
    for mode in (0o600, 0o601, 0o610, 0o640, 0o604):
        file.chmod(mode)
        found.append(exposed(file) == "")
    assert found == [True, False, False, False, False]


@pytest.mark.parametrize(
    ("owner", "mode", "open_to_others"),
    [
        (0, 0o600, False), (0, 0o640, False), (0, 0o644, True),
        (1000, 0o600, False), (1000, 0o640, True), (1001, 0o600, True), (1001, 0o400, True),
    ],
)  # fmt: skip
def test_a_service_of_its_own_user_reads_its_keys_and_those_of_root(
    monkeypatch: pytest.MonkeyPatch, owner: int, mode: int, open_to_others: bool
) -> None:
    """User 1000: a group may read a key of root, and none of the service."""
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    file: Any = SimpleNamespace(
        stat=lambda: SimpleNamespace(st_uid=owner, st_mode=stat.S_IFREG | mode),
        open=Path(os.devnull).open,
    )
    assert bool(exposed(file)) is open_to_others
