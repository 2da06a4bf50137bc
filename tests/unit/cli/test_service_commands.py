"""`user`, `journal` and the refusals of `serve`, as a user sees them."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from contextlib import nullcontext
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.cli.axis import attach
from gantryctl.cli.options import ATTACHED
from gantryctl.cli.service import backup, user
from gantryctl.machine import default_machine, short_hash
from gantryctl.service.backup import restore
from gantryctl.service.clients import link
from gantryctl.service.recorder.journal import proof, reading
from gantryctl.service.recorder.journal.places import places_of
from gantryctl.service.recorder.journal.writer import Journal
from support.command_line import cli, done, refused

PASSWORD = "correct horse battery"


@pytest.fixture(autouse=True)
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))
    return tmp_path


def typing(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(text))


def test_users_are_added_listed_changed_and_removed(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "no users" in done("user", "list").out
    typing(monkeypatch, PASSWORD + "\n")
    assert done("user", "add", "anna", "--role", "operator").out == "user anna may log in as operator\n"
    rows = done("user", "list", "--json").json
    assert [(row["name"], row["role"], row["person"]) for row in rows] == [("anna", "operator", "anna")]
    assert done("user", "person", "anna", "bela").out == "user anna is an account of bela\n"
    assert " bela " in done("user", "list").out
    assert "there is no user" in refused("user", "person", "carl", "bela")
    typing(monkeypatch, PASSWORD + "\n")
    done("user", "add", "anna.service", "--role", "service", "--person", "bela")
    done("user", "remove", "anna.service")
    typing(monkeypatch, PASSWORD + "!\n")
    done("user", "passwd", "anna")
    typing(monkeypatch, "short\n")
    assert "12 to 256 characters" in refused("user", "passwd", "anna")
    done("user", "remove", "anna")
    assert "there are: none" in refused("user", "remove", "anna")
    assert PASSWORD not in done("user", "list").out


def test_the_journal_is_shown_verified_and_exported(root: Path) -> None:
    assert cli("journal", "verify").code == 2
    directory = root / default_machine().name
    made = Journal(directory)
    record = {"utc": "2026-01-01", "monotonic_ns": 1, "kind": "command", "user": "anna", "role": "operator",
              "place": "local", "client": "c", "text": "stop: done"}  # fmt: skip
    made.append(1, 0, 1, [json.dumps(record).encode()] * 3)
    made.close()
    assert done("journal", "verify").out == "3 events, chain and seals intact\n"
    kept = root / "anchors"
    kept.write_text(done("journal", "anchor").out, encoding="utf-8")
    assert done("journal", "verify", "--anchor", kept).out.endswith("1 of 1 anchors found\n")
    journal = kept.read_text(encoding="utf-8").split()[-1]
    kept.write_text(f"3 0123 2026-01-01 {journal}\n", encoding="utf-8")
    assert "event 3 is another one than on 2026-01-01" in cli("journal", "verify", "--anchor", kept).out
    kept.write_text("three\n", encoding="utf-8")
    assert "not lines of `gantryctl journal anchor`" in refused("journal", "verify", "--anchor", kept)
    shown = done("journal", "show", "--last", "2").out
    assert shown.count("stop: done") == 2
    assert "anna (operator, local) " in shown
    assert done("journal", "show", "--json").json[0]["user"] == "anna"
    done("journal", "export", root / "events.jsonl")
    lines = (root / "events.jsonl").read_text(encoding="utf-8").splitlines()
    assert [json.loads(line)["seq"] for line in lines] == [1, 2, 3]
    assert "is there already" in refused("journal", "export", root / "events.jsonl")
    path = directory / "journal.sqlite"
    path.write_bytes(path.read_bytes().replace(b"stop: done", b"move: done"))
    answer = cli("journal", "verify")
    assert answer.code == 1
    assert answer.out.startswith("NOT intact")


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (("--listen", "0.0.0.0:0"), "--tls-cert and --tls-key"),
        (("--listen", "[::]:0"), "--tls-cert and --tls-key"),
        (("--listen", "192.0.2.7:8650"), "--tls-cert and --tls-key"),
        (("--listen", "8650"), "HOST:PORT"),
        (("--listen", "127.0.0.1:99999"), "HOST:PORT"),
        (("--tls-cert", "nowhere.pem"), "belong together"),
        (("--tls-cert", "nowhere.pem", "--tls-key", "nowhere.key"), "no such file"),
    ],
)
def test_serve_refuses_an_address_that_is_not_safe(options: tuple[str, ...], why: str) -> None:
    assert why in refused("serve", *options)


def test_serve_refuses_other_machines_while_there_are_no_users(root: Path) -> None:
    for name in ("cert.pem", "key.pem"):
        (root / name).touch()
    files = ("--tls-cert", root / "cert.pem", "--tls-key", root / "key.pem")
    assert "there are no users" in refused("serve", "--listen", "0.0.0.0:0", *files)


def test_serve_refuses_every_secret_that_others_can_read_in_one_go(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    typing(monkeypatch, PASSWORD + "\n")
    done("user", "add", "anna", "--role", "operator")
    folder = root / default_machine().name / "opcua"
    folder.mkdir(parents=True)
    exposed = [root / "users.json", folder / "key.pem", places_of(folder.parent).key]
    exposed[2].parent.mkdir(parents=True)
    for file in exposed[1:]:
        file.write_text("secret")
    for file in exposed:
        file.chmod(0o644)
    answer = cli("serve", "--no-page")
    assert answer.code == 3
    assert "does not start" in answer.err
    for file in exposed:
        assert f"{file}: mode 0644, other users can read or change it: chmod 06" in answer.err
    # The file of users is private again with the next change.
    typing(monkeypatch, PASSWORD + "!\n")
    done("user", "passwd", "anna")
    answer = cli("serve", "--no-page")
    assert "users.json" not in answer.err
    assert "key.pem: mode 0644" in answer.err


@pytest.mark.parametrize(
    "command", [("status", "--service"), ("move", "1", "--service", "--yes"), ("attach",)]
)
def test_without_a_service_the_commands_say_how_to_start_one(command: tuple[str, ...]) -> None:
    answer = cli(*command)
    assert answer.code == 3
    assert "`gantryctl serve` starts one" in answer.err


def test_what_makes_no_sense_with_a_service_is_refused() -> None:
    assert "--fresh does not go with" in refused("move", "1", "--service", "--fresh")
    assert "--program does not go with" in refused(
        "jog", "+", "--for", "1", "--service", "--program", "a.py:B"
    )


def test_a_certificate_that_has_expired_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("cryptography", reason="the extra [opcua] is not installed")
    from support.certificates import certificate  # it needs cryptography

    key, now = tmp_path / "key.pem", datetime.now(UTC)
    old = certificate(tmp_path / "old.pem", now - timedelta(days=9), now - timedelta(days=1), key)
    listen = ["serve", "--listen", "127.0.0.1:0", "--tls-key", key, "--tls-cert"]
    key.chmod(0o600)
    assert f"old.pem: expired on {now - timedelta(days=1):%Y-%m-%d}" in refused(*listen, old)
    assert "is no certificate" in refused(*listen, key)


def test_a_copy_of_the_journal_is_made_compared_and_checked_without_the_key(root: Path) -> None:
    directory, copy = root / default_machine().name, root / "copy.sqlite"
    made = Journal(directory)
    record = json.dumps({"utc": "2026-01-01", "monotonic_ns": 1, "kind": "command", "text": "stop: done"})
    made.append(1, 0, 1, [record.encode()] * 3)
    assert done("journal", "copy", copy).out == f"events up to 3 in {copy}\n"
    made.append(1, 0, 4, [record.encode()] * 2)
    made.close()
    said = done("journal", "verify", "--copy", copy).out
    assert said.endswith("copy: 3 events alike, 2 newer ones only in the journal\n")
    assert done("journal", "copy", copy).out == f"events up to 5 in {copy}, 2 of them new\n"
    other = root / "other.sqlite"
    other.write_bytes(copy.read_bytes().replace(b"stop: done", b"move: done"))
    answer = cli("journal", "verify", "--copy", other)
    assert (answer.code, "copy: NOT alike" in answer.out) == (1, True)
    assert answer.out.startswith("5 events, chain and seals intact")
    found = cli("journal", "verify", "--copy", other, "--json")
    assert (found.code, found.json["intact"], bool(found.json["wrong"])) == (1, False, True)
    assert (
        done("journal", "verify", "--file", copy, "--without-key").out
        == "5 events, chain intact, seals not checked\n"
    )
    assert done("journal", "verify", "--file", copy).out == "5 events, chain and seals intact\n"
    key = places_of(directory).key.rename(root / "kept.key")
    assert "journal's key cannot be read" in cli("journal", "verify").err
    assert done("journal", "verify", "--file", copy, "--key", key).out == "5 events, chain and seals intact\n"
    assert "not both" in refused("journal", "verify", "--key", key, "--without-key")
    (directory / "journal.sqlite").unlink()
    lost = cli("journal", "verify", "--key", key)
    assert lost.code == 1
    assert "the journal is gone: event 5 was there" in lost.out
    assert "missing  1 to 5" in lost.out
    damaged = bytearray(copy.read_bytes())
    damaged[damaged.index(b"stop: done")] ^= 1
    copy.write_bytes(damaged)
    answer = cli("journal", "verify", "--file", copy, "--key", key, "--json")
    assert answer.code == 1
    (changed,) = answer.json["changed"]
    assert changed[0] == changed[1]  # one event; the others are certain
    assert sum(last - first + 1 for first, last in answer.json["certain"]) == 4


def test_an_export_of_a_journal_that_begins_later_has_each_event_once(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Events 1 to 40 were taken out; two are read at a time."""
    held = [SimpleNamespace(seq=seq, values={}, hash="") for seq in range(41, 46)]

    def read(_: Path, after: int = 0, limit: int = 2) -> list[SimpleNamespace]:
        return [row for row in held if row.seq > after][:limit]

    monkeypatch.setattr(reading, "read_journal", read)
    assert done("journal", "export", root / "events.jsonl").out.startswith("5 events")
    lines = (root / "events.jsonl").read_text(encoding="utf-8").splitlines()
    assert [json.loads(line)["seq"] for line in lines] == [41, 42, 43, 44, 45]


@pytest.mark.parametrize(
    "change", [("add", "anna", "--role", "viewer"), ("passwd", "anna"), ("person", "anna", "bela"), ("remove", "anna")]
)  # fmt: skip
def test_each_change_of_the_users_waits_for_the_journals(
    monkeypatch: pytest.MonkeyPatch, change: tuple[str, ...]
) -> None:
    did: list[str] = []

    def note(name: str) -> Callable[..., None]:
        return lambda *_: did.append(name)

    accounts = SimpleNamespace(
        add=note("changed"), set_password=note("changed"), set_person=note("changed"), remove=note("changed")
    )
    monkeypatch.setattr(user, "_users", lambda: accounts)
    monkeypatch.setattr(user, "_wait_until_kept", note("waited"))
    typing(monkeypatch, PASSWORD + "\n")
    done("user", *change)
    assert did == ["changed", "waited"]


def test_a_user_that_could_not_be_made_is_not_told_as_one(monkeypatch: pytest.MonkeyPatch) -> None:
    typing(monkeypatch, "short\n")
    assert cli("user", "add", "anna", "--role", "viewer").out == ""


def test_commands_go_to_a_service_of_their_own_configuration_only(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was refused is not attached, and who is not attached may be detached."""
    machine = default_machine()
    (root / machine.name).mkdir()
    running = {"config_hash": "0123"}
    monkeypatch.setattr(attach, "ServiceLink", lambda _: nullcontext(SimpleNamespace(tags=running)))
    assert "the service runs configuration 0123" in refused("attach")
    assert not (root / machine.name / ATTACHED).exists()
    running["config_hash"] = short_hash(machine)
    done("attach")
    assert (root / machine.name / ATTACHED).exists()
    for _ in range(2):
        done("detach")
    assert not (root / machine.name / ATTACHED).exists()


def test_over_ssh_nobody_asks_for_a_link_to_the_console(monkeypatch: pytest.MonkeyPatch) -> None:
    """The newest link counts: that of the person at the screen would be void."""
    asked: list[Path] = []
    monkeypatch.setattr(link, "console_link", lambda directory: asked.append(directory) or "")
    monkeypatch.setenv("SSH_CONNECTION", "192.0.2.7 1 192.0.2.1 22")
    assert "came over ssh" in refused("console")
    assert not asked
    monkeypatch.delenv("SSH_CONNECTION")
    assert "without a page" in cli("console").err
    assert len(asked) == 1


def test_anchors_of_events_that_were_taken_out_are_told(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    verdict = SimpleNamespace(wrong="", rows=3, first=41, anchors=1, sealed=True)
    monkeypatch.setattr(proof, "verify", lambda *_, **__: verdict)
    kept = root / "anchors"
    kept.write_text("".join(f"{seq} 0123 2026-01-01 {'0' * 32}\n" for seq in (7, 42)), encoding="utf-8")
    assert done("journal", "verify", "--anchor", kept).out.splitlines() == [
        "3 events from number 41 on, chain and seals intact",
        "1 of 2 anchors found, the others are of events taken out since",
    ]


def test_a_restore_tells_what_stays_and_what_is_to_be_done(monkeypatch: pytest.MonkeyPatch) -> None:
    manifest = SimpleNamespace(machine="one", made="2026-01-01")
    restored = SimpleNamespace(
        config_file=Path("one.toml"), set_aside=Path("aside"), kept=("users.json",), manifest=manifest
    )
    monkeypatch.setattr(restore, "restore_backup", lambda *_, **__: restored)
    told = done("backup", "restore", "file.tar").out.splitlines()
    assert told == [
        "one is restored as on 2026-01-01",
        "machine file: one.toml",
        "not replaced: users.json",
        "what was here before: aside",
        "no power until the angle was compared: gantryctl encoder set-zero --angle A --witness TEXT --config one.toml",
    ]


@pytest.mark.parametrize(("secrets", "told"), [(True, "keep it like a key"), (False, "without accounts")])
def test_a_backup_tells_whether_keys_are_in_it(
    capsys: pytest.CaptureFixture[str], secrets: bool, told: str
) -> None:
    manifest: Any = SimpleNamespace(
        files={},
        machine="one",
        made="now",
        by="anna",
        host="here",
        config_file="",
        secrets=secrets,
        journal="",
    )
    backup._say(Path("file.tar"), manifest, False)
    assert told in capsys.readouterr().out
