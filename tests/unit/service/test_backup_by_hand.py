"""What is in a backup and what is not, and what a restore leaves alone: a state directory written by hand."""

from __future__ import annotations

import json
import os
import shutil
import socket
import tarfile
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from gantryctl.errors import GantryctlError, StateError, UsageError
from gantryctl.machine import Machine, default_machine, default_machine_path, load_machine
from gantryctl.operation.store import SERVICE_SOCKET, PeerName
from gantryctl.runtime import Retained, RetainedMemory
from gantryctl.service.backup import archive, create
from gantryctl.service.backup.create import create_backup
from gantryctl.service.backup.restore import restore_backup
from gantryctl.service.backup.settings import settings_of
from gantryctl.service.recorder.journal.places import places_of
from gantryctl.service.recorder.journal.writer import Journal
from gantryctl.service.supervisor.users import FORMAT

NAME = default_machine().name
NOT_KEPT = (
    "lock", SERVICE_SOCKET, "run.state", "journal.mirror", "retain.a.json.part", "before-restore-001/state.json",
)  # fmt: skip
"""Of running processes, unfinished, or what an earlier restore has set aside."""


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine with memory, journal, accounts, and files that are of no backup."""
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path / "state"))
    made = tmp_path / "state"
    directory = made / NAME
    directory.mkdir(parents=True)
    RetainedMemory(directory).store(
        Retained(NAME, "hash", rest_position_counts=123, increment_rad=0.5, speed_rad_s=0.02)
    )
    (made / "users.json").write_text(json.dumps({"format": FORMAT, "users": {}}))
    for name in (*NOT_KEPT, "machine.json", "opcua/trusted/good.der", "opcua/revoked/bad.der"):
        (directory / name).parent.mkdir(parents=True, exist_ok=True)
        (directory / name).write_text(name)
    journaled(directory, "one")
    return made


def journaled(directory: Path, text: str) -> None:
    journal = Journal(directory)
    journal.note("service", text)
    journal.close()


def backed_up(root: Path, machine: Machine | None = None) -> Path:
    out = root.parent / "b.tar.gz"
    out.unlink(missing_ok=True)
    create_backup(machine or default_machine(), root, out)
    return out


def names_in(path: Path) -> set[str]:
    with tarfile.open(path) as tar:
        return set(tar.getnames())


def test_a_link_in_the_state_is_no_file_of_it(root: Path, tmp_path: Path) -> None:
    """Who writes there would have whatever the user of the backup reads carried out of the computer."""
    (tmp_path / "secret").write_text("of somebody else")
    (root / NAME / "traces").mkdir()
    (root / NAME / "traces" / "one.parquet").write_text("a recording")
    for link in ("state.link", "traces/two.parquet"):
        (root / NAME / link).symlink_to(tmp_path / "secret")
    found = [path.name for path in create._state_files(root / NAME, secrets=True, recordings=True)]
    assert "one.parquet" in found
    assert not {"state.link", "two.parquet"} & {*found}


def test_a_backup_has_no_file_of_a_process_no_draft_and_nothing_that_was_set_aside(root: Path) -> None:
    (root / NAME / "retain.b.json").unlink(missing_ok=True)
    assert names_in(backed_up(root)) == {
        "manifest.json",
        f"config/{NAME}.toml",
        "accounts/users.json",
        "accounts/journal.key",
        *(f"state/{name}" for name in (
            "retain.a.json", "machine.json", "journal.sqlite", "opcua/trusted/good.der", "opcua/revoked/bad.der",
        )),
    }  # fmt: skip


def test_the_memory_is_copied_before_the_journal_that_tells_of_it(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A service goes on meanwhile: what its memory speaks of must be in the journal, and not the other way round."""
    copied: list[str] = []
    copy, journal = create._copy, create._copy_journal

    def copying(source: Path, to: Path) -> None:
        copied.append(source.name)
        copy(source, to)

    def copying_journal(directory: Path, folder: Path) -> str:
        copied.append("journal")
        return journal(directory, folder)

    monkeypatch.setattr(create, "_copy", copying)
    monkeypatch.setattr(create, "_copy_journal", copying_journal)
    backed_up(root)
    of_state = [name for name in copied if name not in (f"{NAME}.toml", "users.json", "journal.key")]
    assert of_state[0].startswith("retain.")
    assert of_state[-1] == "journal"


def test_a_journal_whose_key_does_not_fit_is_not_whole(root: Path) -> None:
    key = places_of(root / NAME).key
    os.chmod(key, 0o600)
    key.write_bytes(bytes(reversed(key.read_bytes())))
    assert create_backup(default_machine(), root, root.parent / "b.tar.gz").journal != ""


def test_of_a_damaged_journal_every_file_is_kept(root: Path) -> None:
    for name in ("journal.sqlite", "journal.sqlite-wal"):
        (root / NAME / name).write_bytes(b"damaged" * 1000)
    assert {"state/journal.sqlite", "state/journal.sqlite-wal"} <= names_in(backed_up(root))


def test_a_disk_that_takes_no_backup_is_left_without_half_of_one(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(GantryctlError, match="No space left"):
        backed_up(root)
    assert not (root.parent / "b.tar.gz").exists()


def test_a_calibration_comes_back_beside_its_machine_and_the_one_that_was_there_is_set_aside(
    root: Path,
) -> None:
    folder = root.parent / "etc"
    folder.mkdir()
    configs = default_machine_path().parent
    machine, calibration = folder / "hust_improved.toml", folder / "hust_improved.calibration.toml"
    for file in (machine, calibration):
        shutil.copy(configs / file.name, file)
    then = calibration.read_text() + "# of then\n"
    now = calibration.read_text() + "# of now!\n"  # as long as the other
    calibration.write_text(then)
    improved = load_machine(machine)
    (root / NAME).rename(root / improved.name)
    made = backed_up(root, improved)
    calibration.write_text(now)
    done = restore_backup(made, root)
    assert calibration.read_text() == then
    assert (done.set_aside / "config" / calibration.name).read_text() == now
    # To another place both go.
    restore_backup(made, root, root.parent / "other.toml")
    assert (root.parent / calibration.name).read_text() == then


@pytest.mark.parametrize("named", ["maps/of_today.toml", "../of_today.toml", "{absolute}/of_today.toml"])
def test_a_calibration_comes_back_wherever_its_machine_file_names_it(root: Path, named: str) -> None:
    """Beside it a file of the same name that does not belong to it, and stays."""
    configs, site = default_machine_path().parent, root.parent / "etc" / "site"
    named = named.format(absolute=root.parent / "far")
    machine, calibration = site / "of_today.toml", site / named
    for folder in (site, calibration.parent):
        folder.mkdir(parents=True, exist_ok=True)
    text = (configs / "hust_improved.toml").read_text().replace("hust_improved.calibration.toml", named)
    machine.write_text(text)
    then, now = (
        (configs / "hust_improved.calibration.toml").read_text() + end for end in ("# then\n", "# now\n")
    )
    calibration.write_text(then)
    improved = load_machine(machine)
    assert improved.calibration is not None
    (root / NAME).rename(root / improved.name)
    made = backed_up(root, improved)
    assert {path.name for path in root.parent.iterdir()} == {"etc", "state", "state-keys", "b.tar.gz"} | (
        {"far"} if "far" in named else set()
    )
    calibration.write_text(now)
    machine.write_text(text + "# changed\n")
    done = restore_backup(made, root)
    assert (calibration.read_text(), machine.read_text()) == (then, text)
    aside = {path.read_text() for path in (done.set_aside / "config").rglob("*") if path.is_file()}
    assert aside == {now, text + "# changed\n"}
    # And where it is gone with its folder.
    if "maps" in named:
        shutil.rmtree(calibration.parent)
        restore_backup(made, root)
        assert calibration.read_text() == then


def test_an_archive_puts_its_calibration_in_the_place_of_no_other_file(root: Path) -> None:
    """Anybody may have written it: a machine file in it can name any place."""
    configs, site = default_machine_path().parent, root.parent / "site"
    machine, other = site / "m.toml", root.parent / "far" / "profile"
    for folder in (site, other.parent):
        folder.mkdir(parents=True)
    text = (configs / "hust_improved.toml").read_text()
    machine.write_text(text.replace("hust_improved.calibration.toml", "../far/profile"))
    shutil.copy(configs / "hust_improved.calibration.toml", other)
    (root / NAME).rename(root / "hust_improved")
    made = backed_up(root, load_machine(machine))
    other.write_text("mine")
    done = restore_backup(made, root)
    assert other.read_text() == "mine"
    assert any(kept.endswith("a calibration whose name does not end with .toml") for kept in done.kept)


def test_an_archive_puts_its_machine_file_in_the_place_of_no_other_file(root: Path) -> None:
    profile = root.parent / "profile"
    profile.write_text(default_machine_path().read_text() + "# mine\n")
    made = backed_up(root, load_machine(profile))
    profile.write_text("mine")
    with pytest.raises(UsageError, match=r"does not end with \.toml: name a place for it with --config"):
        restore_backup(made, root)
    assert profile.read_text() == "mine"
    # Whoever restores may name any place.
    restore_backup(made, root, profile)
    assert "# mine" in profile.read_text()


def test_a_backup_of_before_the_first_run_leaves_no_memory_of_a_later_one(root: Path) -> None:
    """Its angle, brake tests and settings would be those of another state."""
    directory, away = root / NAME, root.parent / "away"
    away.mkdir()
    for copy in directory.glob("retain.*"):
        shutil.move(copy, away)
    made = backed_up(root)
    shutil.copytree(away, directory, dirs_exist_ok=True)
    assert RetainedMemory(directory).load() is not None
    done = restore_backup(made, root)
    assert RetainedMemory(directory).load() is None
    assert RetainedMemory(done.set_aside).load() is not None


def test_a_restore_counts_on_and_sets_aside_accounts_and_keeps_key_and_owner_that_are_here(
    root: Path,
) -> None:
    made = backed_up(root)
    directory = root / NAME
    shutil.rmtree(directory / "before-restore-001")
    (directory / "before-restore-007").mkdir()
    (root / "users.json").write_text('{"users": {"later": {}}}')
    key = places_of(directory).key.read_bytes()
    done = restore_backup(made, root, accounts=True)
    assert done.set_aside.name == "before-restore-008"
    assert "later" in (done.set_aside / "users.json").read_text()
    assert "later" not in (root / "users.json").read_text()
    assert places_of(directory).key.read_bytes() == key
    # Whose directory it is, is noted anew by the next start, by the machine file in force then.
    assert not (directory / "machine.json").exists()


def test_a_key_that_is_here_stays(root: Path) -> None:
    """Made anew after the backup it seals the events that are here; the backup's would call them forged."""
    made = backed_up(root)
    directory = root / NAME
    for name in ("journal.sqlite", "journal.mirror"):
        (directory / name).unlink()
    shutil.rmtree(places_of(directory).outside)
    journaled(directory, "later")
    key = places_of(directory).key.read_bytes()
    restore_backup(made, root)
    assert places_of(directory).key.read_bytes() == key


def test_a_damaged_journal_that_is_here_makes_room_for_that_of_the_backup(root: Path) -> None:
    made = backed_up(root)
    (root / NAME / "journal.sqlite").write_bytes(b"damaged" * 1000)
    done = restore_backup(made, root)
    assert (done.set_aside / "journal.sqlite").read_bytes() == b"damaged" * 1000
    assert not any("journal" in line for line in done.kept)
    assert (root / NAME / "journal.sqlite").read_bytes() != b"damaged" * 1000


def changed(root: Path, **of_manifest: Any) -> Path:
    """An archive with another manifest, written in order."""
    made = backed_up(root)
    folder = root.parent / "unpacked"
    manifest = archive.extract(made, folder)
    made.unlink()
    archive.write_archive(made, manifest._replace(**of_manifest), folder)
    return made


def test_a_backup_of_another_machine_than_its_file_says_is_refused(root: Path) -> None:
    before = json.loads((root / NAME / "retain.a.json").read_text())
    with pytest.raises(StateError, match="is of hust_gantry, not of other"):
        restore_backup(changed(root, machine="other"), root)
    assert json.loads((root / NAME / "retain.a.json").read_text()) == before


def test_a_manifest_that_says_another_name_is_damaged(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One letter of a text, so that all else still fits: who made it is told behind every restore."""
    text = archive._text
    monkeypatch.setattr(archive, "_text", lambda made: text(made).replace(b'"by": "anna"', b'"by": "anni"'))
    made = changed(root, by="anna")
    monkeypatch.undo()
    with pytest.raises(UsageError, match=r"damaged at manifest\.json"):
        archive.read_manifest(made)


def test_settings_are_in_the_units_that_their_names_have(root: Path) -> None:
    found = settings_of(default_machine(), root)
    # 0.5 rad and 0.02 rad/s.
    assert found["operator"]["increment_deg"] == pytest.approx(28.6478897565)
    assert found["operator"]["speed_setting_deg_s"] == pytest.approx(1.1459155903)
    assert (found["opcua_trusted"], found["opcua_revoked"]) == (["good.der"], ["bad.der"])


def test_a_restore_forgets_where_the_axis_rested_and_nothing_else(root: Path) -> None:
    memory = RetainedMemory(root / NAME).load()
    assert memory is not None
    restore_backup(backed_up(root), root)
    found = RetainedMemory(root / NAME).load()
    assert found is not None
    assert found.last_result.startswith("restored by ")
    assert found == replace(memory, rest_position_counts=None, last_result=found.last_result)


def test_a_service_is_found_by_its_socket_however_long_the_path(tmp_path: Path) -> None:
    """A socket address takes 108 bytes. Nothing else of the service lives here: no controller, no recorder."""
    deep = tmp_path / ("d" * 60) / ("e" * 60)
    directory = deep / NAME
    directory.mkdir(parents=True)
    RetainedMemory(directory).store(Retained(NAME, "hash"))
    made = backed_up(deep)
    with closing(socket.socket(socket.AF_UNIX)) as service:
        with PeerName(directory) as address:
            service.bind(address)
        service.listen()
        with pytest.raises(StateError, match="the service runs this machine"):
            restore_backup(made, deep)
    restore_backup(made, deep)  # what it has left behind is no service


@pytest.mark.parametrize("name", ["..", ".", "", "a/b", "../a"])
def test_a_backup_of_what_is_no_name_of_a_machine_is_not_restored(tmp_path: Path, name: str) -> None:
    root = tmp_path / "state" / "root"
    root.mkdir(parents=True)
    archive.write_archive(
        tmp_path / "bad.tar.gz", archive.Manifest(name, "", "", "", "", "1", False, "", {}), tmp_path
    )
    with pytest.raises(StateError, match="is no name of a machine"):
        restore_backup(tmp_path / "bad.tar.gz", root)
    assert {*tmp_path.rglob("*")} == {tmp_path / "bad.tar.gz", tmp_path / "state", root}


def test_root_does_not_restore_the_state_of_another_user(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The service of that user could not read what root has written."""
    made = backed_up(root)
    if os.geteuid() == 0:
        os.chown(root, 12345, -1)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    with pytest.raises(UsageError, match="is of another user"):
        restore_backup(made, root)
