"""The self-test before a start, check by check, and who the command line waits for after a change of users."""

from __future__ import annotations

import json
import socket
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.errors import StateError
from gantryctl.operation.store import PeerName
from gantryctl.service.memory import memory as memory_module
from gantryctl.service.recorder.journal.places import places_of
from gantryctl.service.recorder.retention import MB, RetentionPolicy
from gantryctl.service.supervisor import selftest, users_kept
from gantryctl.service.supervisor.installed import InstalledFiles
from gantryctl.service.supervisor.users import Users

pytestmark = pytest.mark.usefixtures("keys")

NAMES = [
    "installed files", "shared memory", "clock", "state", "disk", "journal key", "journal", "users", "secrets"
]  # fmt: skip


class Store:
    """A state directory whose controller and simulated plant have left so much."""

    def __init__(self, directory: Path, *left: bool) -> None:
        self.directory, (self.retained, self.plant) = directory, left or (False, False)
        self.locked = False

    def __enter__(self) -> None:
        self.locked = True

    def __exit__(self, *_: object) -> None:
        self.locked = False

    def load_retained(self) -> object:
        assert self.locked, "another process may have the machine"
        return "memory" if self.retained else None

    def load_plant(self) -> object:
        return "plant" if self.plant else None


def checks_in(folder: Path, *secrets: Path) -> dict[str, selftest.Check]:
    machine: Any = SimpleNamespace(plant_is_local=True)
    store: Any = Store(folder)
    return {
        check.name: check
        for check in selftest.self_test(machine, store, folder, RetentionPolicy(), list(secrets))
    }


def test_all_is_well_in_a_new_folder_and_only_a_wrong_journal_stops_no_start(tmp_path: Path) -> None:
    found = checks_in(tmp_path)
    assert list(found) == NAMES
    assert all(check.ok for check in found.values())
    assert [name for name, check in found.items() if not check.vital] == ["journal"]


def test_a_check_that_fails_ends_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "users.json").write_text("damaged", encoding="utf-8")

    def fails() -> tuple[bool, str]:
        raise StateError("no clock")

    monkeypatch.setattr(selftest, "_clock", fails)
    found = checks_in(tmp_path)
    assert [name for name, check in found.items() if not check.ok] == ["clock", "users"]
    assert found["clock"].text == "no clock"
    assert list(found) == NAMES


def test_a_secret_that_others_read_fails(tmp_path: Path) -> None:
    secret = tmp_path / "key"
    secret.write_bytes(b"secret")
    for mode, ok in ((0o600, True), (0o644, False)):
        secret.chmod(mode)
        assert checks_in(tmp_path, secret)["secrets"].ok is ok


@pytest.mark.parametrize(
    ("local", "retained", "plant", "ok", "text"),
    [
        (True, False, False, True, "a new machine"), (True, True, True, True, "retained memory and plant read"),
        (True, True, False, False, "gantryctl sim reset"), (True, False, True, False, "gantryctl sim reset"),
        (False, True, False, True, "retained memory read"), (False, False, False, True, "no retained memory yet"),
    ],
)  # fmt: skip
def test_a_simulated_plant_belongs_to_its_memory_and_a_real_one_has_none(
    tmp_path: Path, local: bool, retained: bool, plant: bool, ok: bool, text: str
) -> None:
    machine: Any = SimpleNamespace(plant_is_local=local)
    store: Any = Store(tmp_path, retained, plant)
    found, said = selftest._state(machine, store)
    assert found is ok
    assert said.endswith(text)


@pytest.mark.parametrize(("free_mb", "ok"), [(15.9, False), (16.0, True), (1000.0, True)])
def test_the_disk_has_room_for_events(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free_mb: float, ok: bool
) -> None:
    """16 MB are theirs."""
    monkeypatch.setattr(selftest, "free_of", lambda _: lambda: int(free_mb * MB))
    assert selftest._disk(tmp_path, RetentionPolicy())[0] is ok


@pytest.mark.parametrize("wrong", ["", "row 3 is missing"])
def test_a_journal_is_as_right_as_its_newest_events(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wrong: str
) -> None:
    verdict = SimpleNamespace(wrong=wrong, rows=7)
    monkeypatch.setattr(selftest, "verify", lambda _, newest: verdict if newest == 100_000 else None)
    assert selftest._journal(tmp_path) == (True, "a new one")
    (tmp_path / "journal.sqlite").touch()
    assert selftest._journal(tmp_path) == (not wrong, wrong or "7 events, chain intact")


def test_a_changed_program_is_not_started(monkeypatch: pytest.MonkeyPatch) -> None:
    found: InstalledFiles | None = None
    monkeypatch.setattr(selftest, "check_installed", lambda *_: found)
    oks = []
    for found in (None, InstalledFiles(9, ()), InstalledFiles(9, ("a", "b", "c", "d"))):  # noqa: B007
        ok, text = selftest._installed(print)
        oks.append(ok)
    assert oks == [True, True, False]
    assert text.endswith(": 4, among them a, b, c")


def test_memory_that_does_not_give_back_what_it_took_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[object] = []
    close = memory_module.SharedMemory.close
    monkeypatch.setattr(
        memory_module.SharedMemory, "close", lambda memory: (closed.append(memory), close(memory))
    )
    assert selftest._memory()[0]
    assert len(closed) == 1
    with monkeypatch.context() as broken:
        broken.setattr(memory_module.Ring, "take", lambda _: b"something else")
        assert not selftest._memory()[0]
    monkeypatch.setattr(memory_module.SequenceLock, "read", lambda _: b"something else")
    assert not selftest._memory()[0]


@pytest.mark.parametrize(("resolution_s", "ok"), [(9.9e-6, True), (1e-5, False)])
def test_the_clock_is_finer_than_a_hundredth_of_a_scan(
    monkeypatch: pytest.MonkeyPatch, resolution_s: float, ok: bool
) -> None:
    info = SimpleNamespace(resolution=resolution_s)
    monkeypatch.setattr(selftest, "time", SimpleNamespace(get_clock_info=lambda _: info))
    assert selftest._clock()[0] is ok


def test_what_is_left_of_a_journal_is_no_new_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who takes the journal away and leaves a mirror or the anchors is noticed."""
    verdict = SimpleNamespace(wrong="events are missing", rows=0)
    monkeypatch.setattr(selftest, "verify", lambda *_, **__: verdict)
    places = places_of(tmp_path)
    left = (places.database, *places.mirrors, places.anchors)
    assert len(left) >= 3
    for path in left:
        assert selftest._journal(tmp_path) == (True, "a new one")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
        assert selftest._journal(tmp_path) == (False, "events are missing")
        path.unlink()


def test_the_key_of_the_journal_is_there_behind_the_self_test(tmp_path: Path) -> None:
    key = places_of(tmp_path).key
    assert not key.exists()
    assert checks_in(tmp_path)["journal key"].ok
    assert key.exists()


def test_every_open_secret_is_named(tmp_path: Path) -> None:
    secrets = [tmp_path / name for name in ("one", "two", "three")]
    for secret in secrets:
        secret.write_bytes(b"secret")
        secret.chmod(0o600 if secret.name == "two" else 0o644)
    text = checks_in(tmp_path, *secrets)["secrets"].text
    assert [str(secret) in text for secret in secrets] == [True, False, True]


def test_state_that_is_no_json_is_a_check_that_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def damaged(*_: object) -> tuple[bool, str]:
        raise json.JSONDecodeError("no value", "x", 0)

    monkeypatch.setattr(selftest, "_state", damaged)
    check = checks_in(tmp_path)["state"]
    assert (check.ok, check.vital) == (False, True)
    assert "no value" in check.text


def test_the_check_of_the_files_tells_how_far_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def check(_: object, __: object, watch: Callable[[float], None] = lambda part: None) -> None:
        watch(0.25)

    parts: list[float] = []
    monkeypatch.setattr(selftest, "check_installed", check)
    machine: Any = SimpleNamespace(plant_is_local=True)
    store: Any = Store(tmp_path)
    selftest.self_test(machine, store, tmp_path, RetentionPolicy(), [], parts.append)
    assert parts == [0.25]


# --- a change of users --------------------------------------------------------------------------------


def test_a_change_is_kept_where_an_event_of_it_or_of_a_later_one_is_in_the_journal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []

    def events(*given: object, **how: object) -> list[Any]:
        asked.append((given, how))
        rows = [
            ("user", {"file_ns": 500}),
            ("login", {"file_ns": 900}),
            ("user", {}),
            ("user", {"file_ns": 400}),
        ]
        return [SimpleNamespace(values={"kind": kind, "detail": json.dumps(detail)}) for kind, detail in rows]

    monkeypatch.setattr(users_kept, "read_journal", events)
    assert [users_kept._has(tmp_path, ns) for ns in (499, 500, 501)] == [True, True, False]
    assert asked[0] == ((tmp_path,), {"limit": 200, "newest": True})

    def fails(*_: object, **__: object) -> list[Any]:
        raise StateError("damaged")

    monkeypatch.setattr(users_kept, "read_journal", fails)
    assert not users_kept._has(tmp_path, 0)


def test_all_journals_are_waited_for_and_those_without_it_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One has it at once, one after two looks, one not within 3 s of looks in a twentieth of a second."""
    now_s, looks = 100.0, dict[str, int]()

    def has(directory: Path, _: int) -> bool:
        looks[directory.name] = looks.get(directory.name, 0) + 1
        return looks[directory.name] >= {"a": 1, "b": 3, "c": 1000}[directory.name]

    def sleep(pause_s: float) -> None:
        nonlocal now_s
        now_s += pause_s

    monkeypatch.setattr(users_kept, "_has", has)
    monkeypatch.setattr(users_kept, "time", SimpleNamespace(monotonic=lambda: now_s))
    users = Users(tmp_path)
    assert users_kept.not_kept(users, [tmp_path / name for name in "ab"], sleep) == []
    assert now_s == pytest.approx(100.1)
    looks.clear()
    assert users_kept.not_kept(users, [tmp_path / name for name in "abc"], sleep) == ["c"]
    assert now_s == pytest.approx(103.15, abs=0.051)


def test_a_service_runs_where_somebody_listens(tmp_path: Path) -> None:
    """A socket that a killed service has left behind does not count, and neither do other machines."""
    for name in ("alive", "dead", "other"):
        (tmp_path / name).mkdir()
    with socket.socket(socket.AF_UNIX) as alive, socket.socket(socket.AF_UNIX) as dead:
        for name, made in (("alive", alive), ("dead", dead)):
            with PeerName(tmp_path / name) as address:
                made.bind(address)
        alive.listen()
        assert users_kept.running(tmp_path) == [tmp_path / "alive"]
