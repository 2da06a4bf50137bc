"""The recorder process without a process: what it does in which order, from its first look to its last word."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.program.alarms.codes import Code
from gantryctl.service.memory.memory import JournalState, SharedMemory, Word
from gantryctl.service.recorder import frame_writer, process
from gantryctl.service.recorder.journal.mirror import SystemFile
from gantryctl.service.recorder.process import Note
from gantryctl.service.recorder.retention import RetentionPolicy
from gantryctl.service.recorder.row_filter import RowFilter, _differ
from gantryctl.service.recorder.trace_writer import TraceWriter
from gantryctl.trace.frames.recorder import LogParts


class Bench:
    """All parts of the process, with what was done to them."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.did: list[str] = []
        self.notes: list[Note] = []
        self.looks: list[Callable[[], None]] = []
        self.holds = [True]
        self.left: Any = None
        self.gone, self.orphaned, self.kept, self.ended = True, False, True, False
        self.late, self.held_up_looks = False, 0
        self.handlers: dict[str, Any] = {}
        self.given: dict[str, tuple[Any, ...]] = {}
        names = {name: name for name in ("SIGTERM", "SIGINT", "SIGHUP")}
        for name, part in {
            "signal": SimpleNamespace(signal=self.handlers.__setitem__, **names),
            "die_with_parent": lambda pid: self.did.append(f"dies with {pid}"),
            "keep_no_pool": lambda: None,
            "RunFile": lambda _: SimpleNamespace(hold=self.hold, close=self.says("run file closed")),
            "RunKeeper": lambda *_: SimpleNamespace(
                left_behind=lambda: self.left, look=self.says("run looked at"), end=self.end
            ),
            "EventWriter": self.events,
            "TraceWriter": self.traces,
            "FrameWriter": lambda *given: SimpleNamespace(
                drain=self.says("frames"), close=self.says("frames closed"), _=self.given.update(frames=given)
            ),
            "HeldUp": lambda *_: SimpleNamespace(look=self.look_whether_held_up),
            "Others": self.others,
            "threading": SimpleNamespace(Event=Event, Thread=self.thread),
        }.items():
            monkeypatch.setattr(process, name, part)

    def says(self, what: str) -> Callable[[], None]:
        return lambda: self.did.append(what)

    def hold(self) -> bool:
        return self.holds.pop(0) if len(self.holds) > 1 else self.holds[0]

    def look_whether_held_up(self) -> None:
        self.held_up_looks += 1

    def end(self, *, kept: bool) -> None:
        self.did.append(f"run ended, kept: {kept}")

    def events(self, *_: object) -> Any:
        bench = self

        class Events:
            notes, run, state = bench.notes, None, JournalState.SLOW
            all_kept = property(lambda _: bench.kept)

            def tell(self, text: str) -> None:
                bench.did.append(f"told: {text[:6]}")

            def close(self) -> None:
                bench.did.append("journal closed")

        return Events()

    def traces(self, *_: object) -> Any:
        return SimpleNamespace(
            remove_drafts=self.says("drafts removed"),
            drain=lambda *, at_once=False: self.did.append("rows at once" if at_once else "rows"),
            finish_left=self.says("left ones finished"),
            end=lambda *, last: self.did.append(f"rows ended, last: {last}"),
        )

    def others(self, handle: int, parent: int) -> Any:
        bench = self

        class Others:
            gone = property(lambda _: bench.gone)
            orphaned = property(lambda _: bench.orphaned)

            def look(self, *, ending: bool) -> bool:
                return ending and (bench.gone or bench.late)

        self.did.append(f"others {handle}, {parent}")
        return Others()

    def thread(self, *, target: Any, args: tuple[Any, ...], name: str) -> Any:
        """The journal's: it lives until it is told to end; each wait for it is a round of the process."""
        (ended,) = args

        def join(_: float) -> None:
            self.did.append("-")
            assert self.looks, "the process goes on without an end"
            self.looks.pop(0)()

        return SimpleNamespace(
            start=self.says("journal started"), is_alive=lambda: not ended.is_set(), join=join
        )

    def stop(self) -> None:
        for handler in self.handlers.values():
            handler()


class Event:
    def __init__(self) -> None:
        self._set = False

    def set(self) -> None:
        self._set = True

    def is_set(self) -> bool:
        return self._set

    def wait(self, _: float) -> bool:
        return self._set


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(monkeypatch)


def run(bench: Bench, tmp_path: Path, *looks: Callable[[], None]) -> SharedMemory:
    """Run the process: after each of its rounds one look."""
    bench.looks = list(looks)
    memory = SharedMemory.create()
    memory.words[Word.SUPERVISOR] = 77
    assert process.main([str(memory.handle), str(tmp_path), RetentionPolicy().to_json(), "-1"]) == 0
    return memory


def nothing() -> None:
    """A round in which nothing happens."""


def test_rows_come_before_what_was_left_and_the_end_before_the_last_word(
    bench: Bench, tmp_path: Path
) -> None:
    memory = run(bench, tmp_path, nothing, bench.stop, nothing)
    round_ = ["rows", "frames", "run looked at", "-"]
    assert bench.did == [
        "others -1, 77", "dies with 77", "journal started", "drafts removed", "rows at once", "left ones finished",
        *round_, *round_, *round_,
        "run ended, kept: True", "frames closed", "rows at once", "rows ended, last: True", "journal closed",
        "run file closed",
    ]  # fmt: skip
    assert memory.words[Word.JOURNAL_STATE] == JournalState.SLOW
    assert memory.words[Word.RECORDER_NS] > 0
    memory.close()


def test_it_goes_on_until_the_others_are_gone(bench: Bench, tmp_path: Path) -> None:
    """And leaves the recording to the recorder that comes next where they are not."""
    bench.gone = False

    def gone() -> None:
        bench.gone = True

    memory = run(bench, tmp_path, bench.stop, nothing, nothing, gone, nothing)
    assert bench.did.count("-") == bench.held_up_looks == 5
    memory.close()


@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT", "SIGHUP"])
def test_each_signal_ends_it_in_order(bench: Bench, tmp_path: Path, name: str) -> None:
    """One that is not caught would end it at once, with events that wait."""

    def hit() -> None:
        bench.handlers[name]()

    memory = run(bench, tmp_path, hit, nothing)
    assert bench.did[-1] == "run file closed"
    memory.close()


def test_a_recorder_that_others_outlive_leaves_its_recording_open(bench: Bench, tmp_path: Path) -> None:
    """The one that comes next goes on with it."""
    bench.gone, bench.late = False, True
    memory = run(bench, tmp_path, bench.stop, nothing)
    assert "rows ended, last: False" in bench.did
    memory.close()


@pytest.mark.parametrize("log", [None, "bus.log"])
def test_the_log_of_all_frames_is_kept_where_it_was_asked_for(
    bench: Bench, tmp_path: Path, log: str | None
) -> None:
    bench.looks = [bench.stop, nothing]
    memory = SharedMemory.create()
    policy = RetentionPolicy(bus_logs=3)
    arguments = [str(memory.handle), str(tmp_path), policy.to_json(), "-1", *([log] if log else [])]
    assert process.main(arguments) == 0
    _, folder, shown, _, asked, _ = bench.given["frames"]
    assert (folder, shown, asked) == (tmp_path / "traces", log and Path(log), policy)
    memory.close()


def test_an_orphan_says_so_once(bench: Bench, tmp_path: Path) -> None:
    bench.orphaned = True
    memory = run(bench, tmp_path, nothing, bench.stop, nothing)
    assert bench.did.count("told: SYS-06") == 1
    memory.close()


def test_the_record_of_a_killed_run_stays_until_the_journal_has_told_it(
    bench: Bench, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bench.left = SimpleNamespace(
        told=SimpleNamespace(line="SYS-05 the run before was killed", code=Code.SYS_05),
        numbers={"pos_deg": 12.5},
    )
    noted: list[Note] = []

    def told() -> None:
        noted.extend(bench.notes)
        bench.notes.clear()

    memory = run(bench, tmp_path, nothing, told, bench.stop, nothing)
    assert noted == [Note("alarm", "SYS-05 the run before was killed", {"code": "SYS-05", "pos_deg": 12.5})]
    rounds = " ".join(bench.did).split("-")
    assert ["run looked at" in each for each in rounds[-5:]] == [False, False, True, True, False]
    assert capsys.readouterr().err.startswith("SYS-05 the run before was killed")
    memory.close()


@pytest.mark.parametrize("kept", [True, False])
def test_what_waits_at_the_end_is_told_on_the_terminal_and_the_run_is_not_clean(
    bench: Bench, tmp_path: Path, capsys: pytest.CaptureFixture[str], kept: bool
) -> None:
    bench.kept = kept

    def ends() -> None:
        bench.notes.append(Note("service", "the disk is full", {}))
        bench.stop()

    memory = run(bench, tmp_path, ends, nothing)
    assert f"run ended, kept: {kept}" in bench.did
    assert capsys.readouterr().err == "recorder: the disk is full\n"
    memory.close()


def test_a_recorder_waits_for_the_one_before_and_may_be_ended_meanwhile(bench: Bench, tmp_path: Path) -> None:
    bench.holds = [False, False, True]
    memory = run(bench, tmp_path, bench.stop, nothing)
    assert "journal started" in bench.did
    bench.did.clear()
    bench.holds = [False]
    usual = Event.wait
    bench.looks = []
    memory.words[Word.RECORDER_NS] = 0
    try:
        Event.wait = lambda _, __: True  # type: ignore[method-assign]
        assert process.main([str(memory.handle), str(tmp_path), RetentionPolicy().to_json(), "-1"]) == 0
    finally:
        Event.wait = usual  # type: ignore[method-assign]
    assert "journal started" not in bench.did
    assert memory.words[Word.JOURNAL_STATE] == JournalState.FAILED
    assert memory.words[Word.RECORDER_NS] > 0
    memory.close()


# --- small parts --------------------------------------------------------------------------------------


def test_a_value_that_becomes_known_or_unknown_is_another_one() -> None:
    nan = float("nan")
    pairs = ((1.0, nan, True), (nan, 1.0, True), (nan, nan, False), (1.0, 1.0, False), (1.0, 1.1, True))
    assert [_differ(a, b, 0.05) for a, b, _ in pairs] == [differ for *_, differ in pairs]


def test_a_mirror_is_no_link_to_another_file_and_is_gone_in_children(tmp_path: Path) -> None:
    file, link = tmp_path / "mirror", tmp_path / "link"
    file.write_bytes(b"....")
    link.symlink_to(file)
    with pytest.raises(OSError, match="symbolic links"):
        SystemFile(link)
    made = SystemFile(file)
    assert not os.get_inheritable(made._handle)
    made.write(2, b"ab")
    made.close()
    assert file.read_bytes() == b"..ab"


def test_frames_have_the_time_of_day_and_the_parts_of_the_policy(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """1000 s on the clock of the computer are 400 s on that of the frames: theirs began at 600."""
    made: list[Any] = []
    monkeypatch.setattr(frame_writer, "FrameRecorder", lambda log, **how: made.append((log, how)))
    monkeypatch.setattr(frame_writer, "time", SimpleNamespace(time=lambda: 1000.0, monotonic=lambda: 400.0))
    memory: Any = SimpleNamespace(frames=None)
    policy = RetentionPolicy(bus_log_mb=3, bus_logs=4)
    frame_writer.FrameWriter(memory, tmp_path, tmp_path / "a.log", lambda: 2**40, policy, print)
    assert made == [(tmp_path / "a.log", {"parts": LogParts(3 * 2**20, 4), "epoch_s": 600.0})]


@pytest.mark.parametrize(
    ("closing", "number", "file", "in_use"),
    [(False, 5, 5, True), (False, 5, 4, False), (False, 0, 4, False), (True, 5, 4, True)],
)
def test_the_recording_under_way_and_what_is_being_closed_are_in_use(
    closing: bool, number: int, file: int, in_use: bool
) -> None:
    """All others may go for want of room."""
    writer: Any = object.__new__(TraceWriter)
    writer._closing, writer._number = SimpleNamespace(under_way=closing), number
    assert writer._in_use(Path(f"service-{file:06d}-20260101T000000000.parquet")) is in_use


def test_rows_that_a_killed_recorder_has_written_are_left_out() -> None:
    made = RowFilter(("time_s",), 0.001, {}, 5.0)
    assert made.take(0.0, (5.0,)) == []
    assert [row[0] for row in made.take(0.0, (5.001,))] == [5.001]
