"""The first process of the service without the others: what it hands them, what it watches, in which order it ends."""

from __future__ import annotations

import asyncio
import json
import os
import select
import signal
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.errors import DeviceError
from gantryctl.machine import config_hash, default_machine
from gantryctl.service.clients.hub import Hub
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.recorder.retention import RetentionPolicy
from gantryctl.service.supervisor import child as child_module
from gantryctl.service.supervisor import process
from gantryctl.service.supervisor.child import HANG_S, START_S, Child, Relief
from gantryctl.service.supervisor.process import Options, Supervisor
from gantryctl.service.supervisor.users import FORMAT, Users


class Part:
    """A child that writes down what is done to it."""

    def __init__(self, did: list[str], name: str, command: list[str], handles: list[int], **how: Any) -> None:
        self.did, self.name, self.command, self.handles, self.how = did, name, command, handles, how
        self.over = asyncio.Event()
        self.beside: Callable[[], None] = lambda: None

    async def keep(self, _: object) -> None:
        self.did.append(f"{self.name} kept")
        await self.over.wait()

    def leave(self) -> None:
        self.did.append(f"{self.name} left")

    async def end(self, patience_s: float) -> None:
        self.beside()
        self.did.append(f"{self.name} ended in {patience_s:g} s")
        self.over.set()

    def end_hung(self, _: object, now_ns: int) -> None:
        self.did.append(f"{self.name} hangs?")


class Desk:
    """A supervisor of parts that only write down, at a time of its own."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, root: Path) -> None:
        self.did: list[str] = []
        self.now_s, self.handlers = 1000.0, dict[int, Callable[[], None]]()
        self.patch, self.root, self.said = monkeypatch, root, list[str]()
        self.events: list[tuple[Any, ...]] = []
        self.watch: Callable[..., Any] = self.nothing
        monkeypatch.setattr(process, "Child", lambda *given, **how: Part(self.did, *given, **how))
        monkeypatch.setattr(process, "notify", self.did.append)
        monkeypatch.setattr(process, "time", SimpleNamespace(monotonic=lambda: self.now_s, monotonic_ns=int))
        monkeypatch.setattr(
            process, "LocalServer", lambda *_: SimpleNamespace(start=self.start, close=self.close)
        )
        monkeypatch.setattr(Hub, "fresh", True)
        monkeypatch.setattr(Hub, "run", self.nothing)

    def options(self, **more: Any) -> Options:
        return Options(RetentionPolicy(), list, False, Users(self.root), {"clock": "fine"})._replace(**more)

    def made(self, *, page: bool | str = True, **options: Any) -> Supervisor:
        gateway, opcua = (["gate", "way"], ["op", "cua"]) if page else (None, None)
        if isinstance(page, str):
            options["page"] = page
        config, directory = self.root / "machine.toml", self.root / "state"
        found = Supervisor(
            default_machine(),
            config,
            directory,
            gateway,
            99,
            opcua,
            self.said.append,
            self.options(**options),
        )
        found.hub.events.put = lambda kind, text, *_, **values: self.event(kind, text, values)  # type: ignore[method-assign]
        found.hub.logins.close = lambda: self.did.append("logins closed")  # type: ignore[method-assign]
        found.hub.refusals.close = lambda: self.did.append("refusals closed")  # type: ignore[method-assign]
        self.patch.setattr(found.memory, "close", lambda: self.did.append("memory closed"))
        return found

    def event(self, kind: str, text: str, values: dict[str, Any]) -> int:
        self.events.append((kind, text, values))
        self.did.append(text)
        return 1

    async def start(self) -> None:
        await asyncio.sleep(0)  # the processes begin meanwhile
        self.did.append("socket opened")

    def close(self) -> None:
        self.did.append("socket closed")

    async def nothing(self, *_: object) -> None:
        await asyncio.Event().wait()

    def run(self, supervisor: Supervisor, then: Callable[[], None]) -> int:
        """Run it; `then` comes when it is ready."""

        async def whole() -> int:
            self.patch.setattr(
                asyncio.get_running_loop(), "add_signal_handler", self.handlers.__setitem__, raising=False
            )
            self.patch.setattr(supervisor, "_watch", self.watch)

            def ready() -> None:
                self.did.append("ready")
                then()

            return await asyncio.wait_for(supervisor.run(ready), 10.0)

        return asyncio.run(whole())


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Desk:
    return Desk(monkeypatch, tmp_path)


ACCOUNT = {"role": "viewer", "salt": "00", "key": "00", "n": 2, "r": 1, "p": 1, "since": ""}


def part(child: Any) -> Part:
    found: Part = child
    return found


# --- what it hands over -------------------------------------------------------------------------------


def test_the_memory_says_what_the_others_count_by(desk: Desk) -> None:
    one, two = desk.made(), desk.made()
    words = one.memory.words
    assert words[Word.SUPERVISOR] == os.getpid()
    assert (words[Word.CONTROLLER_CLEAN], words[Word.LEASE_MS]) == (1, default_machine().monitors.lease_ms)
    assert words[Word.BOOT] != two.memory.words[Word.BOOT]


@pytest.mark.parametrize("second_person", [True, False])
def test_each_process_gets_its_command_and_its_handles(desk: Desk, second_person: bool) -> None:
    """All but the recorder hold the end of a pipe of which the recorder has the other one."""
    made = desk.made(second_person=second_person, bus_log=Path("/log"))
    handle, words = made.memory.handle, made.memory.words
    controller, recorder, gateway, opcua = map(
        part, (made.controller, made.recorder, made.gateway, made.opcua)
    )
    _, here = controller.handles
    _, others = recorder.handles
    os.write(here, b"x")
    assert os.read(others, 1) == b"x"
    assert [each.handles for each in (controller, recorder, gateway, opcua)] == [
        [handle, here], [handle, others], [handle, 99, here], [handle, here]
    ]  # fmt: skip
    opens = [str(handle), str(desk.root / "machine.toml"), config_hash(default_machine()), str(desk.root)]
    more = ["--second-person"] if second_person else []
    assert controller.command[1:] == ["-P", "-m", "gantryctl.service.controller", *opens, *more]
    kept = [str(handle), str(desk.root / "state"), RetentionPolicy().to_json(), str(others), "/log"]
    assert recorder.command[1:] == ["-P", "-m", "gantryctl.service.recorder", *kept]
    assert gateway.command[1:] == ["-P", "-m", "gate", "way", str(handle)]
    assert opcua.command[1:] == ["-P", "-m", "op", "cua", str(handle)]
    assert [each.how.get("critical", False) for each in (controller, recorder, gateway, opcua)] == [
        True, False, False, False
    ]  # fmt: skip
    words[Word.RECORDER_NS], words[Word.GATEWAY_NS] = 5, 6
    assert [each.how["beat_ns"]() for each in (recorder, gateway)] == [5, 6]


@pytest.mark.parametrize(("wanted", "module", "comes"), [(1, "a.b", True), (0, "a.b", False), (1, "", False)])
def test_commissioning_follows_once_where_the_controller_has_handed_the_axis_over(
    desk: Desk, wanted: int, module: str, comes: bool
) -> None:
    made = desk.made(commissioning=module)
    made.memory.words[Word.COMMISSIONING] = wanted
    relief = part(made.controller).how["relief"]
    found = relief()
    assert (found is not None) is comes
    if comes:
        assert found.name == "commissioning"
        command = part(made.controller).command
        assert found.command == [*command[:3], module, *command[4:]]
    assert relief() is None


# --- from start to end --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT", "SIGHUP"])
def test_the_axis_ends_first_and_the_journal_last_whatever_signal_comes(desk: Desk, name: str) -> None:
    made = desk.made()
    ended: list[bool] = []

    def beside() -> None:
        """The recorder is asked to end when all other ends of its pipe are closed."""
        ended.append(bool(select.select([part(made.recorder).handles[1]], [], [], 0.0)[0]))

    def hit() -> None:
        desk.handlers[getattr(signal, name)]()

    part(made.recorder).beside = part(made.controller).beside = beside
    assert desk.run(made, hit) == 0
    assert desk.did == [
        "self-test", "recorder kept", "controller kept", "gateway kept", "opcua kept", "socket opened", "ready",
        "READY", "STOPPING", "the service ends", "gateway left", "opcua left", "controller ended in 25 s",
        "gateway ended in 8 s", "opcua ended in 8 s", "logins closed", "refusals closed", "recorder ended in 8 s",
        "memory closed", "socket closed",
    ]  # fmt: skip
    assert ended == [False, True]
    assert desk.events[0] == ("service", "self-test", {"clock": "fine"})


def test_a_controller_that_cannot_be_kept_ends_the_service_with_an_error(desk: Desk) -> None:
    made = desk.made(page=False)
    assert desk.run(made, part(made.controller).over.set) == DeviceError.exit_code != 0
    assert desk.did[-5:] == [
        "logins closed",
        "refusals closed",
        "recorder ended in 8 s",
        "memory closed",
        "socket closed",
    ]


@pytest.mark.parametrize("how", ["too long", "ended"])
def test_a_controller_that_does_not_start_leaves_no_process_behind(desk: Desk, how: str) -> None:
    """It has 20 s."""
    made = desk.made(page=False)
    desk.patch.setattr(Hub, "fresh", False)
    if how == "ended":
        part(made.controller).over.set()
    turns = 0

    async def sleep(_: float) -> None:
        nonlocal turns
        turns += 1
        assert turns < 30
        if how == "too long":
            desk.now_s += 1.0
        await real(0.0)

    real = asyncio.sleep
    desk.patch.setattr(process.asyncio, "sleep", sleep)
    with pytest.raises(DeviceError, match="the controller does not start"):
        desk.run(made, lambda: None)
    assert turns == (21 if how == "too long" else 1)
    assert "ready" not in desk.did
    assert desk.did[-6:] == [
        "controller ended in 25 s", "logins closed", "refusals closed", "recorder ended in 8 s",
        "memory closed", "socket closed",
    ]  # fmt: skip


def test_a_watch_that_fails_ends_the_service_in_order_with_its_reason(desk: Desk) -> None:
    async def fails() -> None:
        raise ValueError("no clock")

    desk.watch = fails
    with pytest.raises(DeviceError, match=r"the first process of the service failed.*no clock"):
        desk.run(desk.made(page=False), lambda: None)
    assert desk.did[-6:-1] == [
        "controller ended in 25 s", "logins closed", "refusals closed", "recorder ended in 8 s", "memory closed"
    ]  # fmt: skip


def test_a_service_that_is_ended_while_its_socket_opens_is_never_ready(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def start() -> None:
        desk.handlers[signal.SIGTERM]()
        await asyncio.sleep(0)

    monkeypatch.setattr(desk, "start", start)
    assert desk.run(desk.made(), lambda: None) == 0
    assert not {"ready", "READY"} & set(desk.did)
    assert "controller ended in 25 s" in desk.did


def test_the_local_socket_knows_persons_and_the_page(desk: Desk) -> None:
    """Two accounts of one person are one person, here too."""
    given: list[Any] = []
    sources: list[Source] = []

    def server(*each: Any) -> Any:
        given.extend(each)
        return SimpleNamespace(start=desk.start, close=desk.close)

    def hub(memory: SharedMemory, source: Source) -> Hub:
        sources.append(source)
        return Hub(memory, source)

    desk.patch.setattr(process, "Hub", hub)
    desk.patch.setattr(process, "LocalServer", server)
    desk.patch.setattr(process, "LinkGiver", lambda _, page: page)
    made = desk.made(page="https://gantry/")
    users = made._options.users
    users.path.write_text(
        json.dumps({"format": FORMAT, "users": {"anna.s": {**ACCOUNT, "person": "anna"}}}), encoding="utf-8"
    )

    def hit() -> None:
        desk.handlers[signal.SIGTERM]()

    assert desk.run(made, hit) == 0
    directory, its_hub, person, page = given
    assert (directory, its_hub, page) == (desk.root / "state", made.hub, "https://gantry/")
    assert [person(account) for account in ("anna.s", "anna")] == ["anna", ""]
    assert sources == [Source.LOCAL]


def test_without_a_log_of_the_bus_the_recorder_is_told_of_none(desk: Desk) -> None:
    recorder = part(desk.made().recorder)
    assert recorder.command[-1] == str(recorder.handles[1])


def test_a_start_that_is_ended_waits_for_no_controller(desk: Desk) -> None:
    made, ended = desk.made(), asyncio.Event()
    desk.patch.setattr(Hub, "fresh", False)
    ended.set()

    async def whole() -> None:
        waits = asyncio.create_task(asyncio.sleep(10.0))
        await asyncio.wait_for(made._until_ready(waits, ended), 1.0)
        waits.cancel()

    asyncio.run(whole())


def test_what_is_told_stands_on_the_terminal_and_in_the_journal(desk: Desk) -> None:
    desk.made()._tell("a process was killed")
    assert desk.said == ["a process was killed"]
    assert desk.events == [("service", "a process was killed", {})]


# --- the watch ----------------------------------------------------------------------------------------


def watched(desk: Desk, supervisor: Supervisor, *steps_s: float) -> list[list[str]]:
    """What the watch does in its first look, and in those after so many seconds."""
    looks: list[list[str]] = []
    steps: Iterator[float] = iter(steps_s)

    class Over(Exception):
        pass

    async def sleep(pause_s: float) -> None:
        assert pause_s == 1.0
        looks.append(list(desk.did))
        desk.did.clear()
        step_s = next(steps, None)
        if step_s is None:
            raise Over
        desk.now_s += step_s

    desk.patch.setattr(process.asyncio, "sleep", sleep)
    with pytest.raises(Over):
        asyncio.run(supervisor._watch())
    return looks


def test_a_service_that_was_held_up_itself_calls_no_process_hung(desk: Desk) -> None:
    """Three seconds between two looks are too many."""
    made = desk.made()
    hung = ["recorder hangs?", "controller hangs?", "gateway hangs?", "opcua hangs?"]
    looks = watched(desk, made, 1.0, 1.0, 2.9, 3.1, 1.0)
    assert [[text for text in look if text.endswith("?")] for look in looks[1:]] == [
        hung,
        hung,
        hung,
        [],
        hung,
    ]


def test_a_dead_controller_is_dead_for_systemd(desk: Desk) -> None:
    made = desk.made()
    for fresh in (True, False):
        desk.patch.setattr(Hub, "fresh", fresh)
        assert ["WATCHDOG" in look for look in watched(desk, made, 1.0)] == [fresh, fresh]


def test_users_are_looked_at_each_second_and_certificates_each_hour(desk: Desk) -> None:
    changes = iter([["anna was added"], [], ["ben was removed"], []])
    watch = SimpleNamespace(changes=lambda: next(changes), file_ns=12)
    asked: list[Any] = []
    today = datetime(2030, 6, 1, 12, tzinfo=UTC)

    def due(files: object, now: datetime) -> list[str]:
        asked.append(files)
        assert now == today
        return ["it ends"]

    desk.patch.setattr(process, "datetime", SimpleNamespace(now=today.astimezone))

    desk.patch.setattr(process, "UserWatch", lambda _: watch)
    desk.patch.setattr(process, "CertificateWatch", lambda: SimpleNamespace(due=due))
    looks = watched(desk, desk.made(certificates=lambda: [Path("a.pem")]), 1.0, 1.0, 3598.0)
    assert asked == [[Path("a.pem")]] * 2
    assert ["it ends" in look for look in looks] == [True, False, False, True]
    assert desk.said == ["it ends"] * 2
    assert desk.events == [
        ("user", "anna was added", {"file_ns": 12}), ("alarm", "it ends", {}),
        ("user", "ben was removed", {"file_ns": 12}), ("alarm", "it ends", {}),
    ]  # fmt: skip


# --- a process that is kept ---------------------------------------------------------------------------


class Kept:
    """A child whose processes last as long as they are told, at a time of its own.

    Args:
        lasts_s: one number a process; the one behind the last is ended while it runs.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *lasts_s: float, **how: Any) -> None:
        self.now_s, self.pauses, self.said, self.ran = 500.0, list[float](), list[str](), list[str]()
        self.lasts_s = list(lasts_s)
        self.child = Child("gateway", ["first"], [3], **how)
        monkeypatch.setattr(
            child_module, "time", SimpleNamespace(monotonic_ns=lambda: round(self.now_s * 1e9))
        )
        monkeypatch.setattr(self.child, "_run", self.run)
        monkeypatch.setattr(child_module.asyncio, "sleep", self.sleep)
        asyncio.run(self.child.keep(self.said.append))

    async def run(self, command: list[str]) -> str:
        self.ran += command
        if not self.lasts_s:
            self.child.leave()
            return "was ended"
        self.now_s += self.lasts_s.pop(0)
        return "ended with code 1"

    async def sleep(self, pause_s: float) -> None:
        self.pauses.append(pause_s)


def test_the_pauses_grow_and_begin_again_behind_a_calm_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run of more than 10 s is calm; a process that the service can do without is started as often as it fails."""
    kept = Kept(monkeypatch, *[1.0] * 8, 10.1, 10.0, 1.0)
    assert kept.pauses == [0.0, 0.1, 0.3, 0.5, 1.0, 2.0, 2.0, 2.0, 0.0, 0.0, 0.1]
    assert kept.said[1] == "SYS-06 gateway ended with code 1; started again in 0.1 s"
    assert len(kept.said) == 11


def test_the_service_ends_when_a_critical_process_fails_a_seventh_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kept = Kept(monkeypatch, *[1.0] * 20, critical=True)
    assert len(kept.ran) == 7
    assert kept.said[-1] == "gateway ended with code 1, 7 times: the service ends"
    assert kept.pauses == [0.0, 0.1, 0.3, 0.5, 1.0, 2.0]


def test_failures_of_before_commissioning_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """Six failures of the controller, commissioning in its place, a seventh; the service goes on."""
    reliefs = iter([None] * 6 + [Relief("commissioning", ["second"])] + [None] * 20)
    kept = Kept(monkeypatch, *[1.0] * 9, critical=True, relief=lambda: next(reliefs))
    assert kept.ran == [*["first"] * 7, "second", "first", "first"]
    assert kept.pauses == [0.0, 0.1, 0.3, 0.5, 1.0, 2.0, 0.0]
    assert kept.said[6:8] == [
        "commissioning takes the place of the gateway",
        "commissioning ended with code 1; the gateway takes its place again",
    ]


def test_what_was_ended_is_followed_by_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Kept(monkeypatch).ran == ["first"]
    relief = Relief("commissioning", ["second"])
    kept = Kept(monkeypatch, 1.0, relief=lambda: relief)
    assert kept.ran == ["first", "second"]
    assert kept.said == ["commissioning takes the place of the gateway"]


@pytest.mark.parametrize(
    ("beat_s", "now_s", "ended"),
    [
        # Started at 500 s: a sign of before is that of another process.
        (499.0, 499.9 + START_S, False), (499.0, 500.1 + START_S, True), (0.0, 500.1 + START_S, True),
        (510.0, 509.9 + HANG_S, False), (510.0, 510.1 + HANG_S, True),
    ],
)  # fmt: skip
@pytest.mark.parametrize("gone", [False, True])
def test_a_process_hangs_ten_seconds_behind_its_last_sign_or_a_minute_behind_its_start(
    beat_s: float, now_s: float, ended: bool, gone: bool
) -> None:
    said: list[str] = []
    killed: list[str] = []
    child = Child("gateway", [], [], beat_ns=lambda: round(beat_s * 1e9))
    process_: Any = SimpleNamespace(returncode=0 if gone else None, kill=lambda: killed.append("killed"))
    child.process, child._began_ns = process_, 500_000_000_000
    child.end_hung(said.append, round(now_s * 1e9))
    assert len(said) == len(killed) == (ended and not gone)


@pytest.mark.parametrize("listens", [True, False])
def test_a_process_is_asked_to_end_and_killed_if_it_does_not(listens: bool) -> None:
    did: list[str] = []
    over = asyncio.Event()

    def asked() -> None:
        did.append("asked")
        if listens:
            over.set()

    def killed() -> None:
        did.append("killed")
        over.set()

    async def wait() -> None:
        await over.wait()
        did.append("gone")

    child = Child("gateway", [], [])
    process_: Any = SimpleNamespace(returncode=None, terminate=asked, kill=killed, wait=wait)
    child.process = process_
    asyncio.run(child.end(0.01))
    assert did == (["asked", "gone"] if listens else ["asked", "killed", "gone"])
    assert child._ending.is_set()


def test_a_process_is_started_apart_from_terminal_and_folder_with_its_handles(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Ctrl-C reaches the first process alone, which ends the axis first."""
    started: list[Any] = []

    async def start(*command: str, **how: Any) -> Any:
        async def wait() -> int:
            return 3

        started.append((command, how))
        return SimpleNamespace(wait=wait)

    monkeypatch.setattr(child_module.asyncio, "create_subprocess_exec", start)
    assert asyncio.run(Child("gateway", ["a", "b"], [3, 4])._run(["a", "b"])) == "ended with code 3"
    assert started == [(("a", "b"), {"pass_fds": (3, 4), "cwd": "/", "start_new_session": True})]


def test_a_process_that_is_being_made_when_all_ends_is_ended_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """The system takes its time to start it: nobody would end it afterwards, and a controller would take the axis."""
    did: list[str] = []

    async def whole() -> None:
        made, over = asyncio.Event(), asyncio.Event()

        async def start(*_: object, **__: object) -> Any:
            did.append("making")
            await made.wait()
            return SimpleNamespace(returncode=None, terminate=asked, kill=asked, wait=wait)

        def asked() -> None:
            did.append("asked")
            over.set()

        async def wait() -> int:
            await over.wait()
            return 0

        monkeypatch.setattr(child_module.asyncio, "create_subprocess_exec", start)
        child = Child("controller", ["a"], [])
        keeper = asyncio.create_task(child.keep(did.append))
        await asyncio.sleep(0)
        ending = asyncio.create_task(child.end(1.0))
        await asyncio.sleep(0)
        made.set()
        await asyncio.wait_for(ending, 1.0)
        did.append("ended")
        await asyncio.wait_for(keeper, 1.0)

    asyncio.run(whole())
    assert did == ["making", "asked", "ended"]


@pytest.mark.parametrize("gone", ["terminate", "kill"])
def test_a_process_that_has_just_gone_is_no_failure_of_whoever_ends_it(gone: str) -> None:
    """Between the last look at it and the signal: a failure here would leave the others running."""
    did: list[str] = []
    over = asyncio.Event()

    def asked() -> None:
        did.append("asked")
        if gone == "terminate":
            over.set()
            raise ProcessLookupError

    def killed() -> None:
        did.append("killed")
        over.set()
        raise ProcessLookupError

    async def wait() -> None:
        await over.wait()

    child = Child("gateway", [], [], beat_ns=lambda: 0)
    process_: Any = SimpleNamespace(returncode=None, terminate=asked, kill=killed, wait=wait)
    child.process, child._began_ns = process_, 0
    asyncio.run(child.end(0.01))
    assert did == (["asked"] if gone == "terminate" else ["asked", "killed"])
    said: list[str] = []
    child.end_hung(said.append, round((START_S + 1.0) * 1e9))
    assert did[-1] == "killed"
    assert len(said) == 1


def test_a_process_that_was_never_started_needs_no_end() -> None:
    child = Child("gateway", ["a"], [])
    asyncio.run(child.end(1.0))
    child.end_hung(print, 10**18)
    assert child._ending.is_set()
