"""One command makes a backup, one puts it back: whole or not at all, and the axis never moves by it."""

from __future__ import annotations

import gzip
import io
import json
import re
import shutil
import socket
import stat
import tarfile
from contextlib import closing
from pathlib import Path

import pytest

from gantryctl.errors import UsageError
from gantryctl.machine import default_machine
from gantryctl.operation.store import SERVICE_SOCKET, StateStore, state_root
from gantryctl.runtime import StateLock
from gantryctl.service.backup import archive
from gantryctl.service.backup.restore import restore_backup
from gantryctl.service.protocol.roles import Role
from gantryctl.service.recorder.journal.proof import verify
from gantryctl.service.recorder.journal.reading import read_journal
from gantryctl.service.recorder.journal.writer import Journal
from gantryctl.service.recorder.run_record import RunFile
from gantryctl.service.supervisor.users import Users
from support.command_line import cli, done, machine_file, plant_truth

PASSWORD = "correct horse battery"
NAME = default_machine().name


@pytest.fixture(autouse=True)
def _place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)


def directory() -> Path:
    return state_root() / NAME


def journaled(*texts: str) -> None:
    journal = Journal(directory())
    for text in texts:
        journal.note("service", text)
    journal.close()


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A machine that has moved, with a journal, accounts, a key of OPC UA and the trace of its move."""
    made = tmp_path_factory.mktemp("template") / "state"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GANTRYCTL_STATE", str(made))
        done("move", "0.5", "--yes")
        journaled("one", "two")
        Users(made).add("anna", Role.OPERATOR, PASSWORD)
        (directory() / "opcua" / "trusted").mkdir(parents=True)
        (directory() / "opcua" / "key.pem").write_text("private")
        (directory() / "opcua" / "trusted" / "client.der").write_bytes(b"client")
    return made


@pytest.fixture
def in_service(template: Path) -> None:
    shutil.copytree(template, state_root())
    shutil.copytree(keys_of(template), keys_of(state_root()))


def keys_of(root: Path) -> Path:
    """Where the keys of a state root are."""
    return root.with_name(f"{root.name}-keys")


def texts() -> list[str]:
    return [row.values["text"] for row in read_journal(directory())]


def names_in(file: Path) -> set[str]:
    with tarfile.open(file) as tar:
        return set(tar.getnames())


@pytest.mark.usefixtures("in_service")
def test_a_backup_brings_everything_to_an_empty_computer_and_no_power_before_a_mark_was_compared() -> None:
    made = done("backup", "create", "b.tar.gz")
    assert "hust_gantry" in made.out
    assert stat.S_IMODE(Path("b.tar.gz").stat().st_mode) == 0o600
    angle = done("status", "--json").json["angle_deg"]
    shutil.rmtree(state_root())
    shutil.rmtree(keys_of(state_root()))
    answer = done("backup", "restore", "b.tar.gz")
    assert "gantryctl encoder set-zero" in answer.out
    # Nobody can tell there whether events came after the backup: service reads that, and resets.
    assert any(text.startswith("JRN-07") for text in texts())
    assert verify(directory()).wrong == ""
    assert texts()[:2] == ["one", "two"]
    assert texts()[-1].startswith("restored by ")
    assert Users(state_root()).check("anna", PASSWORD) is not None
    assert (directory() / "opcua" / "key.pem").read_text() == "private"
    refused = cli("move", "0.8", "--yes")
    assert refused.code != 0
    assert "ENC-10" in refused.err
    assert plant_truth()[2] == 1  # one move, that of before
    done("encoder", "set-zero", "--angle", f"{angle}", "--witness", "mark at the ring")
    done("move", "0.8", "--yes")
    assert done("status", "--json").json["angle_deg"] == pytest.approx(0.8, abs=0.01)


@pytest.mark.usefixtures("in_service")
def test_an_older_backup_takes_no_event_away_turns_no_machine_back_and_is_asked_for_its_angle() -> None:
    done("backup", "create", "b.tar.gz", "--recordings")
    recorded = next((directory() / "traces").glob("move-*"))
    recorded.write_bytes(b"of another run")
    done("move", "-1", "--yes")
    done("encoder", "set-zero", "--angle", "-1", "--witness", "a new mark")
    journaled("three")
    before, _, _ = plant_truth()
    Users(state_root()).add("bert", Role.VIEWER, PASSWORD)
    answer = done("backup", "restore", "b.tar.gz", "--json").json
    assert plant_truth()[0] == before  # the machine stands where it stands
    assert recorded.read_bytes() == b"of another run"
    assert texts()[:3] == ["one", "two", "three"]
    assert set(Users(state_root()).all()) == {"anna", "bert"}
    assert len(answer["kept"]) == 3
    # What was there is set aside, not gone.
    aside = Path(answer["set_aside"])
    assert json.loads((aside / "retain.a.json").read_text())["record"]["zero_witness"]
    assert "ENC-10" in cli("move", "0", "--yes").err
    done("backup", "restore", "b.tar.gz", "--accounts")
    assert set(Users(state_root()).all()) == {"anna"}
    assert len(list(directory().glob("before-restore-*"))) == 2


@pytest.mark.usefixtures("in_service")
def test_without_secrets_nothing_secret_is_in_it() -> None:
    done("backup", "create", "b.tar.gz", "--without-secrets")
    names = names_in(Path("b.tar.gz"))
    assert not [name for name in names if "users" in name or "key" in name]
    assert "state/opcua/trusted/client.der" in names
    assert "state/journal.sqlite" in names
    assert not [name for name in names if "traces" in name]
    done("backup", "create", "c.tar.gz", "--recordings")
    assert [name for name in names_in(Path("c.tar.gz")) if name.startswith("state/traces/move-")]
    secret = json.loads((state_root() / "users.json").read_text())["users"]["anna"]["key"]
    with tarfile.open("b.tar.gz") as tar:
        content = b"".join(tar.extractfile(entry).read() for entry in tar if entry.isreg())  # type: ignore[union-attr]
    assert secret.encode() not in content


def test_the_machine_file_and_its_calibration_come_back_and_what_was_there_is_set_aside(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "etc"
    folder.mkdir()
    file = machine_file(
        folder / "machine.toml", {"control.compensation.calibration": "axis.calibration.toml"}
    )
    done("move", "0.2", "--yes", "--config", str(file))
    text = file.read_text()
    done("backup", "create", "b.tar.gz", "--config", str(file))
    file.write_text(text.replace("kpp_per_s", "kpp_per_s", 1) + "\n# changed since\n")
    answer = done("backup", "restore", "b.tar.gz", "--json").json
    assert answer["config_file"] == str(file)
    assert file.read_text() == text
    assert "# changed since" in (Path(answer["set_aside"]) / "config" / "machine.toml").read_text()
    other = tmp_path / "other.toml"
    done("backup", "restore", "b.tar.gz", "--config", str(other))
    assert other.read_text() == text
    assert "no such folder" in cli("backup", "restore", "b.tar.gz", "--config", "nowhere/m.toml").err


@pytest.mark.usefixtures("in_service")
def test_a_running_service_is_not_restored_under_and_may_be_backed_up() -> None:
    with StateLock(directory()):
        journal = Journal(directory())
        journal.note("service", "under way")
        done("backup", "create", "b.tar.gz")
        journal.note("service", "afterwards")
        journal.close()
        assert "is in use by process" in cli("backup", "restore", "b.tar.gz").err
    with closing(RunFile(directory())) as run:
        assert run.hold()
        assert "still writes" in cli("backup", "restore", "b.tar.gz").err
    # Between two starts of its controller nobody holds the lock.
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(directory() / SERVICE_SOCKET))
        server.listen()
        assert "the service runs" in cli("backup", "restore", "b.tar.gz").err
    assert "under way" in texts()
    assert not list(directory().glob("before-restore-*"))
    done("backup", "restore", "b.tar.gz")  # a socket that was left behind is no service


def state() -> dict[str, bytes]:
    root = state_root()
    return {str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()}


@pytest.mark.usefixtures("in_service")
def test_a_damaged_backup_is_refused_with_the_name_of_the_file_and_changes_nothing() -> None:
    done("backup", "create", "b.tar.gz")
    before = state()
    plain = bytearray(gzip.decompress(Path("b.tar.gz").read_bytes()))
    with tarfile.open(fileobj=io.BytesIO(bytes(plain))) as tar:
        entries = {entry.name: entry for entry in tar}
    for name, entry in entries.items():
        if not entry.size:
            continue
        for at in (entry.offset, entry.offset_data, entry.offset_data + entry.size - 1):
            damaged = bytearray(plain)
            damaged[at] ^= 1
            Path("d.tar.gz").write_bytes(gzip.compress(bytes(damaged), 1))
            with pytest.raises(
                UsageError, match=re.escape(name) if at > entry.offset else "damaged|not a backup"
            ):
                restore_backup(Path("d.tar.gz"), state_root())
    assert "b.tar.gz" not in cli("backup", "show", "d.tar.gz").out
    whole = Path("b.tar.gz").read_bytes()
    for share in (0.0, 0.1, 0.5, 0.9):
        Path("d.tar.gz").write_bytes(whole[: int(share * len(whole))])
        answer = cli("backup", "restore", "d.tar.gz")
        assert answer.code != 0
        assert "d.tar.gz" in answer.err
    after = state()
    del after[f"{NAME}/lock"], before[f"{NAME}/lock"]
    assert after == before
    assert not [path for path in state_root().iterdir() if path.name.startswith(".restore-")]
    assert "every one as its hash says" in done("backup", "show", "b.tar.gz").out


@pytest.mark.parametrize("name", ["../planted", "/{}/planted", "state/../../planted", "state/link"])
def test_an_archive_made_by_somebody_else_reaches_no_file_outside(name: str, tmp_path: Path) -> None:
    """With a manifest whose hashes fit: only its names are bad, or it has a link for a file."""
    name = name.format(tmp_path)
    made = archive.Manifest(
        NAME, "", "2026-01-01T00:00:00Z", "x", "x", "1", False, "",
        {name: archive.Content(0, "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855")},
    )  # fmt: skip
    text = archive._text(made)
    with tarfile.open("bad.tar.gz", "w:gz") as tar:
        first = tarfile.TarInfo("manifest.json")
        first.size = len(text)
        tar.addfile(first, io.BytesIO(text))
        entry = tarfile.TarInfo(name)
        if name.endswith("link"):
            entry.type, entry.linkname = tarfile.SYMTYPE, "/etc/passwd"
        tar.addfile(entry, io.BytesIO(b""))
    (tmp_path / "state").mkdir()
    answer = cli("backup", "restore", "bad.tar.gz")
    assert answer.code != 0
    assert not list(tmp_path.rglob("planted"))
    assert {path.name for path in (tmp_path / "state").rglob("*")} <= {NAME, "lock"}


@pytest.mark.usefixtures("in_service")
def test_a_backup_is_never_written_over_another_file() -> None:
    Path("b.tar.gz").write_text("precious")
    assert "is there already" in cli("backup", "create", "b.tar.gz").err
    assert Path("b.tar.gz").read_text() == "precious"
    assert "nothing to keep" in cli("backup", "create", "n.tar.gz", "--config", str(other_machine())).err


def other_machine() -> Path:
    return machine_file(Path("other.toml"), {"machine.name": "other"})


@pytest.mark.usefixtures("in_service")
def test_a_damaged_journal_is_kept_as_it_is_and_said() -> None:
    file = directory() / "journal.sqlite"
    file.write_bytes(b"damaged" * 1000)
    answer = cli("backup", "create", "b.tar.gz")
    assert answer.code == 1
    assert "NOT intact" in answer.err
    with tarfile.open("b.tar.gz") as tar:
        kept = tar.extractfile("state/journal.sqlite")
        assert kept is not None
        assert kept.read() == b"damaged" * 1000


@pytest.mark.usefixtures("in_service")
def test_all_settings_are_one_document_without_a_secret() -> None:
    text = done("config", "export").out
    for shown in ("[axis]", "[service]", "[operator]", "[encoder]", "[accounts]", "anna", "client.der"):
        assert shown in text
    data = done("config", "export", "--json").json
    assert data["accounts"][0]["role"] == "operator"
    assert data["values"]["speed.setting_max_deg_s"] == {"value": 6.0, "unit": "deg/s", "origin": "file"}
    secret = json.loads((state_root() / "users.json").read_text())["users"]["anna"]
    for form in (text, json.dumps(data)):
        assert secret["key"] not in form
        assert secret["salt"] not in form
    with StateStore(default_machine()):  # while a service runs
        done("config", "export")
