"""What the first process of the service does about the others, and what it tells systemd and the journal."""

from __future__ import annotations

import asyncio
import grp
import os
import signal
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from gantryctl.errors import DeviceError
from gantryctl.machine import default_machine
from gantryctl.operation.store import SERVICE_SOCKET
from gantryctl.service.clients.console_link import LinkGiver
from gantryctl.service.clients.hub import Hub
from gantryctl.service.clients.local import LocalServer
from gantryctl.service.memory.memory import SharedMemory, Source
from gantryctl.service.protocol.roles import Role
from gantryctl.service.recorder.retention import RetentionPolicy
from gantryctl.service.supervisor import child as module
from gantryctl.service.supervisor.child import HANG_S, START_S, Child, Relief, notify
from gantryctl.service.supervisor.process import Options, Supervisor
from gantryctl.service.supervisor.users import Users, UserWatch

PASSWORD = "correct horse battery"
SLEEPER = [sys.executable, "-c", "import time; time.sleep(60)"]
PATIENCE_S = 30.0


def keeping(child: Child, check: Callable[[list[str]], Awaitable[None]]) -> list[str]:
    """What was said while a process is kept running and `check` runs."""
    said: list[str] = []

    async def whole() -> None:
        keeper = asyncio.create_task(child.keep(said.append))
        try:
            await asyncio.wait_for(check(said), PATIENCE_S)
        finally:
            await child.end(1.0)
            await keeper

    asyncio.run(whole())
    return said


def test_a_relief_takes_the_place_of_a_process_once_however_it_ends(tmp_path: Path) -> None:
    """The controller, commissioning, the controller: no pause, and no failure counted, between them."""
    lines = tmp_path / "lines"
    writes = f"import sys; open({str(lines)!r}, 'a').write(sys.argv[1] + chr(10)); "
    first = [sys.executable, "-c", writes, "a"]
    wanted = [True]

    def relief() -> Relief | None:
        taken, wanted[0] = wanted[0], False
        return Relief("commissioning", [sys.executable, "-c", writes + "sys.exit(7)", "b"]) if taken else None

    child = Child("controller", first, [], critical=True, relief=relief)

    async def check(said: list[str]) -> None:
        while not lines.exists() or lines.read_text().split()[:3] != ["a", "b", "a"]:
            await asyncio.sleep(0.02)

    said = keeping(child, check)
    assert said[:2] == [
        "commissioning takes the place of the controller",
        "commissioning ended with code 7; the controller takes its place again",
    ]


def test_a_process_that_cannot_be_started_is_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    child, real, tries = Child("recorder", SLEEPER, []), asyncio.create_subprocess_exec, [0]

    async def flaky(*command: str, **options: object) -> object:
        tries[0] += 1
        if tries[0] <= 3:
            raise OSError(11, "Resource temporarily unavailable")
        return await real(*command, **options)

    monkeypatch.setattr(module.asyncio, "create_subprocess_exec", flaky)

    async def check(_: list[str]) -> None:
        while not child.starts:
            await asyncio.sleep(0.01)

    said = keeping(child, check)
    words = "SYS-06 recorder could not be started: Resource temporarily unavailable; started again in"
    assert said == [f"{words} {pause} s" for pause in ("0", "0.1", "0.3")]
    # Three that were none do not count.
    assert child.starts == 1


def test_a_process_that_hangs_is_ended_and_started_again() -> None:
    beat_ns = [0]
    child = Child("gateway", SLEEPER, [], beat_ns=lambda: beat_ns[0])

    async def check(said: list[str]) -> None:
        while child.process is None:
            await asyncio.sleep(0.01)
        first = child.process.pid
        now_ns = time.monotonic_ns()
        child.end_hung(said.append, now_ns + int((START_S - 1.0) * 1e9))  # it may still be starting
        beat_ns[0] = now_ns
        child.end_hung(said.append, now_ns + int((HANG_S - 0.1) * 1e9))
        assert said == []
        os.kill(first, signal.SIGSTOP)
        child.end_hung(said.append, now_ns + int((HANG_S + 0.1) * 1e9))
        while child.starts < 2:
            await asyncio.sleep(0.01)
        assert child.process.pid != first

    said = keeping(child, check)
    assert said[0] == "SYS-06 gateway has given no sign of life for 10 s: it is ended"
    assert said[1] == "SYS-06 gateway ended with code -9; started again in 0 s"


def test_a_process_that_never_gave_a_sign_of_life_is_ended_too() -> None:
    child = Child("gateway", SLEEPER, [], beat_ns=lambda: 0)

    async def check(said: list[str]) -> None:
        while child.process is None:
            await asyncio.sleep(0.01)
        child.end_hung(said.append, time.monotonic_ns() + int((START_S + 1.0) * 1e9))
        while child.starts < 2:
            await asyncio.sleep(0.01)

    assert "no sign of life" in keeping(child, check)[0]


def test_systemd_is_told_when_it_asks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    notify("READY")  # nobody asks
    for address in (str(tmp_path / "notify"), "\0gantryctl-test"):
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
            systemd.bind(address)
            monkeypatch.setenv("NOTIFY_SOCKET", address.replace("\0", "@"))
            notify("WATCHDOG")
            assert systemd.recv(100) == b"WATCHDOG=1"
    notify("READY")  # it has gone


def test_changes_of_users_are_told_once_and_nothing_of_the_password(tmp_path: Path) -> None:
    users = Users(tmp_path)
    users.add("anna", Role.OPERATOR, PASSWORD)
    watch = UserWatch(users)
    assert watch.changes() == ["users at the start: anna (operator)"]
    assert watch.changes() == []
    assert watch.file_ns == users.path.stat().st_mtime_ns
    users.add("eve", Role.VIEWER, PASSWORD, "anna")
    assert watch.changes() == ["user eve was added, role viewer, an account of anna"]
    users.set_person("eve", "eve")
    assert watch.changes() == ["user eve is an account of eve now, before of anna"]
    assert watch.changes() == []
    users.set_password("eve", PASSWORD + "!")
    users.remove("anna")
    assert watch.changes() == ["user anna was removed", "user eve has a new password"]
    users.path.write_text(users.path.read_text(encoding="utf-8").replace("viewer", "admin"), encoding="utf-8")
    assert watch.changes() == ["user eve has the role admin now, before it was viewer"]
    users.path.write_text("{", encoding="utf-8")
    (line,) = watch.changes()
    assert "users cannot be read" in line
    assert watch.changes() == []
    users.path.unlink()
    assert watch.changes() == ["user eve was removed"]


@pytest.mark.parametrize(("exists", "mode"), [(False, 0o600), (True, 0o660)])
def test_only_the_group_gantry_gets_to_the_local_socket(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, exists: bool, mode: int
) -> None:
    def group(name: str) -> object:
        if not exists:
            raise KeyError(name)
        return SimpleNamespace(gr_gid=os.getgid())

    monkeypatch.setattr(grp, "getgrnam", group)
    memory = SharedMemory.create()

    async def start() -> int:
        server = LocalServer(tmp_path, Hub(memory, Source.LOCAL), str, LinkGiver(memory.words, ""))
        await server.start()
        found = (tmp_path / SERVICE_SOCKET).stat().st_mode
        server.close()
        return stat.S_IMODE(found)

    assert asyncio.run(start()) == mode
    memory.close()


def test_a_first_process_whose_local_socket_is_mute_ends_the_service_in_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def fail(_: Hub) -> None:
        raise ValueError("no picture")

    monkeypatch.setattr(Hub, "run", fail)
    monkeypatch.setattr(Hub, "fresh", True)
    options = Options(RetentionPolicy(), list, second_person=False, users=Users(tmp_path), self_test={})
    supervisor = Supervisor(default_machine(), tmp_path, tmp_path, None, -1, None, lambda _: None, options)
    supervisor.controller = Child("controller", SLEEPER, [], critical=True)
    supervisor.recorder = Child("recorder", SLEEPER, [])
    with pytest.raises(DeviceError, match="no picture"):
        asyncio.run(asyncio.wait_for(supervisor.run(lambda: None), PATIENCE_S))
    for child in (supervisor.controller, supervisor.recorder):
        assert child.process is not None
        assert child.process.returncode == -signal.SIGTERM


@pytest.mark.parametrize(("parent", "ends"), [("os.getppid()", False), ("1", True)])
def test_a_process_whose_parent_was_killed_before_its_first_line_ends(parent: str, ends: bool) -> None:
    lines = f"import os; from gantryctl.service.realtime import die_with_parent; die_with_parent({parent})"
    done = subprocess.run(
        [sys.executable, "-c", f"{lines}; print('goes on')"], capture_output=True, check=False
    )
    assert (done.returncode, done.stdout) == ((-signal.SIGTERM, b"") if ends else (0, b"goes on\n"))
