"""Recordings of the service: every row once, whenever the recorder is killed; rows that found no place are seen."""

from __future__ import annotations

import errno
import os
import tempfile
import threading
from datetime import UTC, datetime, timedelta, tzinfo
from pathlib import Path
from types import SimpleNamespace
from typing import Self

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gantryctl.errors import DeviceError
from gantryctl.runtime import recorder
from gantryctl.service.memory.memory import SharedMemory, Word
from gantryctl.service.memory.snapshot import publish_json
from gantryctl.service.memory.trace_ring import RingRecorder
from gantryctl.service.recorder import freed_memory, trace_writer
from gantryctl.service.recorder.retention import MB, RetentionPolicy
from gantryctl.service.recorder.row_filter import BEFORE_S
from gantryctl.service.recorder.trace_writer import TraceWriter
from gantryctl.trace.naming import begun_at, next_number, number_of, oldest_first
from gantryctl.trace.reader import read_trace

COLUMNS = ("time_s", "x_rad")
PERIOD_S = 0.001
PLENTY = 10**12


class Bench:
    """A controller's end of the ring, and recorders one after the other."""

    def __init__(self, directory: Path) -> None:
        self.memory, self.directory = SharedMemory.create(), directory
        publish_json(self.memory.columns, {"columns": COLUMNS, "metadata": {"period_s": PERIOD_S}})
        self.controller = RingRecorder(self.memory.rows, COLUMNS)
        self.controller.number = 41
        self.made = 0
        self.start()

    def start(self) -> None:
        """A new recorder process; the one before left everything as it stood."""
        self.writer = TraceWriter(self.memory, self.directory, lambda: PLENTY)

    def rows(self, count: int) -> None:
        for _ in range(count):
            # Something happens all the time: nothing is left out.
            self.controller.mark = self.made // 1000
            self.controller.record((self.made * PERIOD_S, self.made / 7))
            self.made += 1

    def quiet(self, count: int) -> None:
        """Rows in which nothing happens."""
        for _ in range(count):
            self.controller.record((self.made * PERIOD_S, self.made / 7))
            self.made += 1

    def kept(self) -> list[float]:
        self.writer.join()
        (file,) = self.directory.iterdir()
        return read_trace(file)["x_rad"].tolist()


class Killed(Exception):
    pass


def killed(_: int) -> None:
    raise Killed


@settings(max_examples=25)
@example([(1, "written"), (0, "written")], 1)
@example([(0, "written")], 1)
@given(
    st.lists(st.tuples(st.integers(0, 2500), st.sampled_from(["idle", "written", "cut"])), max_size=6),
    st.integers(1, 60),
)
def test_a_recorder_killed_anywhere_loses_no_row_and_keeps_none_twice(
    kills: list[tuple[int, str]], cut: int
) -> None:
    with tempfile.TemporaryDirectory() as name, pytest.MonkeyPatch.context() as patch:
        bench = Bench(Path(name))
        for count, when in kills:
            bench.rows(count)
            if when == "idle":
                bench.writer.drain(at_once=True)
            else:  # the block is in the file, the ring does not know it yet
                with patch.context() as broken:
                    broken.setattr(bench.memory.rows, "advance", killed)
                    with pytest.raises(Killed):
                        bench.writer.drain(at_once=True)
            for live in Path(name).iterdir() if when == "cut" else ():
                data = live.read_bytes()
                if count * 16 > cut:  # inside the last block
                    live.write_bytes(data[:-cut])
            bench.start()
        bench.rows(10)
        bench.controller.stop()
        bench.writer.drain(at_once=True)
        assert bench.kept() == [k / 7 for k in range(bench.made)]
        bench.memory.close()


def test_a_recorder_killed_after_it_closed_the_file_writes_it_no_second_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(tmp_path)
    bench.rows(100)
    bench.controller.stop()
    with monkeypatch.context() as broken:
        broken.setattr(bench.memory.rows, "advance", killed)
        with pytest.raises(Killed):
            bench.writer.drain(at_once=True)
    bench.writer.join()
    bench.start()
    bench.writer.drain(at_once=True)
    assert bench.kept() == [k / 7 for k in range(100)]
    bench.memory.close()


def test_rows_that_found_no_place_are_counted_and_seen_as_a_gap(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.writer.drain(at_once=True)
    bench.rows(bench.memory.rows.slots + 500)  # nobody takes them: 33 s at 1 ms
    assert bench.controller.lost == 500
    bench.writer.drain(at_once=True)
    bench.rows(10)
    bench.controller.stop()
    bench.writer.drain(at_once=True)
    bench.writer.join()
    (file,) = tmp_path.iterdir()
    ((begin_s, end_s),) = read_trace(file).gaps()
    assert (end_s - begin_s) / PERIOD_S == pytest.approx(501)
    assert np.isclose(begin_s, (bench.memory.rows.slots - 1) * PERIOD_S)
    bench.memory.close()


def test_what_a_power_cut_has_left_is_closed_at_the_next_start_and_what_goes_on_is_not(
    tmp_path: Path,
) -> None:
    bench = Bench(tmp_path)
    bench.rows(50)
    bench.writer.drain(at_once=True)
    bench.controller.number += 1  # the next start of the service
    bench.start()
    bench.rows(20)
    bench.writer.drain(at_once=True)
    bench.writer.finish_left()
    bench.writer.join()
    left, going_on = sorted(tmp_path.iterdir())
    assert (left.suffix, going_on.suffix) == (".parquet", ".arrows")
    assert read_trace(left)["x_rad"].tolist() == [k / 7 for k in range(50)]
    assert len(read_trace(going_on)) == 20
    bench.memory.close()


def test_the_oldest_recordings_go_when_all_need_more_than_the_quota_whatever_the_clock_said(
    tmp_path: Path,
) -> None:
    """The clock was at 1970 for the third, and an hour ahead for the second; 999999 is not the last number there is."""
    bench = Bench(tmp_path)
    stamps = ("20260101T000000000", "20260102T010000000", "19700101T000000000", "20260102T000500000")
    names = [f"service-{999_997 + at}-{stamp}.parquet" for at, stamp in enumerate(stamps)]
    for hours_ago, name in enumerate(names):
        (tmp_path / name).write_bytes(bytes(300 * 1024))
        os.utime(tmp_path / name, (hours_ago * 3600,) * 2)
    (tmp_path / "somebody-elses.parquet").write_bytes(bytes(MB))
    TraceWriter(bench.memory, tmp_path, lambda: PLENTY, RetentionPolicy(traces_mb=1)).drain(at_once=True)
    assert {file.name for file in tmp_path.iterdir()} == {*names[1:], "somebody-elses.parquet"}
    bench.memory.close()


def test_a_recording_that_needs_the_whole_quota_alone_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trace_writer, "QUOTA_S", -1.0)  # at every look
    bench = Bench(tmp_path)
    bench.writer = TraceWriter(bench.memory, tmp_path, lambda: PLENTY, RetentionPolicy(traces_mb=0))
    bench.rows(10)
    bench.writer.drain(at_once=True)
    assert not bench.memory.words[Word.RECORDING_STOPPED]
    bench.rows(10)
    bench.writer.drain(at_once=True)
    assert bench.memory.words[Word.RECORDING_STOPPED]
    (live,) = tmp_path.iterdir()
    assert len(read_trace(live)) == 10
    bench.memory.close()


def test_names_are_in_order_and_unique_while_the_clock_goes_back_to_1970(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(tmp_path)
    clock = datetime(2026, 11, 22, 12, tzinfo=UTC)
    hours = iter((0.0, 1.0, -1.0, -498_000.0, -498_000.0, 0.0))

    class Stepped(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> Self:
            return cls.fromtimestamp((clock + timedelta(hours=next(hours))).timestamp(), tz)

    monkeypatch.setattr(trace_writer, "datetime", Stepped)
    for number in range(41, 47):
        bench.controller.number = number
        bench.rows(10)
        bench.controller.stop()
    bench.writer.drain(at_once=True)
    bench.writer.join()
    found = oldest_first(tmp_path.iterdir())
    assert [number_of(file) for file in found] == list(range(41, 47))
    first_rows = [read_trace(file)["x_rad"][0] * 7 for file in found]
    assert first_rows == pytest.approx([0, 10, 20, 30, 40, 50])
    assert next_number(tmp_path) == 47
    bench.memory.close()


def test_a_recorder_ended_alone_leaves_its_file_to_the_next_and_the_end_of_the_service_closes_it(
    tmp_path: Path,
) -> None:
    bench = Bench(tmp_path)
    bench.rows(100)
    bench.writer.drain(at_once=True)
    bench.writer.end(last=False)
    assert [file.suffix for file in tmp_path.iterdir()] == [".arrows"]
    bench.start()
    bench.rows(100)
    bench.writer.drain(at_once=True)
    bench.writer.end(last=True)
    assert [file.suffix for file in tmp_path.iterdir()] == [".parquet"]
    assert bench.kept() == [k / 7 for k in range(200)]
    bench.memory.close()


def test_the_end_of_a_controller_that_was_killed_closes_its_recording(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.rows(100)
    bench.writer.drain(at_once=True)
    RingRecorder(bench.memory.rows, COLUMNS).end(41)  # by the next controller
    bench.writer.drain(at_once=True)
    assert bench.kept() == [k / 7 for k in range(100)]
    RingRecorder(bench.memory.rows, COLUMNS).end(41)
    bench.writer.drain(at_once=True)
    assert bench.kept() == [k / 7 for k in range(100)]  # twice is no other file
    # Also when recorder and controller were killed.
    bench.controller.number = 42
    bench.rows(100)
    bench.writer.drain(at_once=True)
    bench.start()
    RingRecorder(bench.memory.rows, COLUMNS).end(42)
    bench.writer.drain(at_once=True)
    bench.writer.join()
    assert {number_of(file): file.suffix for file in tmp_path.iterdir()} == {41: ".parquet", 42: ".parquet"}
    bench.memory.close()


def test_a_recorder_killed_at_rest_loses_none_of_the_rows_before_an_event(tmp_path: Path) -> None:
    """Those that were not decided are in the ring still."""
    bench = Bench(tmp_path)
    bench.rows(10)
    bench.quiet(9000)
    bench.writer.drain(at_once=True)
    bench.quiet(1000)
    bench.writer.drain(at_once=True)
    bench.start()
    bench.writer.drain(at_once=True)
    at = bench.made
    bench.rows(1)
    bench.controller.stop()
    bench.writer.drain(at_once=True)
    bench.writer.join()
    (file,) = tmp_path.iterdir()
    scans = np.round(read_trace(file).time_s / PERIOD_S).astype(int)
    before = round(BEFORE_S / PERIOD_S)
    assert set(range(at - before, at + 1)) <= set(scans.tolist())
    bench.memory.close()


def test_what_kills_have_left_is_closed_or_removed(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.rows(100)
    bench.writer.drain(at_once=True)
    (live,) = tmp_path.iterdir()
    whole = live.read_bytes()
    (tmp_path / "service-000040-20260101T000000000.parquet.part").write_bytes(b"half")
    (tmp_path / "service-000039-20260101T000000000.arrows").write_bytes(b"")
    (tmp_path / "service-000038-20260101T000000000.arrows").write_bytes(whole[:100])  # inside the head
    (tmp_path / "service-000037-20260101T000000000.arrows").write_bytes(whole[:-100])  # inside the block
    (tmp_path / "service-000036-20260101T000000000.arrows").write_bytes(whole)
    bench.start()
    bench.writer.remove_drafts()
    bench.writer.finish_left()
    bench.writer.join()
    left = {number_of(file): file.suffix for file in tmp_path.iterdir()}
    assert left == {36: ".parquet", 41: ".parquet"}
    bench.memory.close()


def test_a_full_disk_leaves_the_live_file_and_room_again_closes_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(tmp_path)
    bench.rows(100)
    bench.controller.stop()

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as broken:
        broken.setattr(recorder, "write_parquet", full)
        bench.writer.drain(at_once=True)
        bench.writer.join()
    assert [file.suffix for file in tmp_path.iterdir()] == [".arrows"]
    bench.writer.finish_left()
    assert bench.kept() == [k / 7 for k in range(100)]
    bench.memory.close()


def test_a_long_recording_asks_for_a_next_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trace_writer, "FILE_MB", 0.01)
    bench = Bench(tmp_path)
    bench.rows(10)
    bench.writer.drain(at_once=True)
    bench.writer.drain(at_once=True)
    assert bench.memory.words[Word.RECORDING_LONG] == 0
    bench.rows(1000)
    bench.writer.drain(at_once=True)
    bench.writer.drain(at_once=True)
    assert bench.memory.words[Word.RECORDING_LONG] == 41
    bench.memory.close()


def test_nothing_is_recorded_into_what_is_reserved_and_with_room_again_it_goes_on(tmp_path: Path) -> None:
    """64 MB are reserved; a tenth more must be free before it goes on, or recordings would come and go."""
    bench = Bench(tmp_path)
    free_mb = 1000
    bench.writer = TraceWriter(bench.memory, tmp_path, lambda: free_mb * 2**20)
    stopped = []
    for free_mb in (1000, 63, 69, 71):  # noqa: B007 - the writer looks at it
        bench.rows(100)
        bench.writer.drain(at_once=True)
        stopped.append(bool(bench.memory.words[Word.RECORDING_STOPPED]))
    assert stopped == [False, True, True, False]
    bench.controller.stop()
    bench.writer.drain(at_once=True)
    assert bench.kept() == [k / 7 for k in (*range(100), *range(300, 400))]
    bench.memory.close()


def test_a_recording_whose_end_never_came_is_closed_by_the_next_one(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.rows(100)
    bench.controller.number = 42
    bench.rows(50)
    bench.controller.stop()
    bench.writer.drain(at_once=True)
    bench.writer.join()
    found = oldest_first(tmp_path.iterdir())
    assert [(number_of(file), file.suffix) for file in found] == [(41, ".parquet"), (42, ".parquet")]
    assert [len(read_trace(file)) for file in found] == [100, 50]
    bench.memory.close()


@pytest.mark.parametrize("closing", [True, False])
def test_nothing_is_removed_for_its_size_while_it_is_being_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, closing: bool
) -> None:
    bench = Bench(tmp_path)
    left = tmp_path / "service-000007-20260101T000000000.parquet"
    left.write_bytes(bytes(2 * MB))
    writer = TraceWriter(bench.memory, tmp_path, lambda: PLENTY, RetentionPolicy(traces_mb=1))
    monkeypatch.setattr(trace_writer._Closing, "under_way", closing)
    writer.drain(at_once=True)
    assert left.exists() is closing
    bench.memory.close()


def test_a_recording_says_which_it_is(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.rows(10)
    bench.controller.stop()
    bench.writer.drain(at_once=True)
    bench.writer.join()
    (file,) = tmp_path.iterdir()
    assert read_trace(file).metadata["recording"] == 41


def test_a_command_at_rest_is_an_event_of_its_recording(tmp_path: Path) -> None:
    """Fifty rows a second: of the rest behind 5 s of an event the last 2 s are whole, of the others ten a second."""
    bench = Bench(tmp_path)
    publish_json(bench.memory.columns, {"columns": COLUMNS, "metadata": {"period_s": 0.02}})

    def rows(seconds: int) -> None:
        for _ in range(50 * seconds):
            bench.controller.record((round(0.02 * bench.made, 3), 0.0))
            bench.made += 1

    rows(15)
    bench.controller.mark = 1
    rows(1)
    bench.controller.stop()
    bench.writer.drain(at_once=True)
    bench.writer.join()
    (file,) = tmp_path.iterdir()
    times = read_trace(file)["time_s"]
    # 13 s is 2 s before the event; a row at each end counts for either side.
    assert np.count_nonzero((times > 13.01) & (times < 14.99)) == 99
    assert np.count_nonzero((times > 5.11) & (times < 12.9)) < 80
    bench.memory.close()


def test_rows_behind_a_damaged_one_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(tmp_path)
    bench.rows(10)
    peek = bench.memory.rows.peek
    monkeypatch.setattr(
        bench.memory.rows,
        "peek",
        lambda most, skip: [None if skip + n == 4 else each for n, each in enumerate(peek(most, skip))],
    )
    bench.writer.drain(at_once=True)
    bench.controller.stop()
    bench.writer.drain(at_once=True)
    assert bench.kept() == [k / 7 for k in range(10) if k != 4]
    bench.memory.close()


def test_recordings_are_named_in_utc_wherever_the_computer_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Here(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> Self:
            return cls(2026, 11, 22, 13 if tz is None else 12, tzinfo=tz)

    monkeypatch.setattr(trace_writer, "datetime", Here)
    bench = Bench(tmp_path)
    bench.rows(1)
    bench.writer.drain(at_once=True)
    (file,) = tmp_path.iterdir()
    assert begun_at(file) == datetime(2026, 11, 22, 12, tzinfo=UTC)
    bench.writer.end(last=False)
    bench.memory.close()


def test_one_file_that_cannot_be_closed_holds_up_no_other_and_is_told_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    closing, closed = trace_writer._Closing(), list[str]()

    def fails() -> None:
        raise OSError("no room")

    for _ in range(2):
        closing._begin([(tmp_path / "a", fails), (tmp_path / "b", lambda: closed.append("b"))])
        closing.join()
    assert closed == ["b", "b"]
    assert capsys.readouterr().err == "recorder: no room\n"


@pytest.mark.parametrize(
    ("last", "order"), [(True, ["closed", "joined", "others", "joined"]), (False, ["left", "joined"])]
)
def test_the_end_waits_for_all_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, last: bool, order: list[str]
) -> None:
    """What is being closed counts as in use: files that were left come behind it."""
    bench, did = Bench(tmp_path), list[str]()
    for name, word in {
        "close": "closed",
        "join": "joined",
        "finish_left": "others",
        "_leave": "left",
    }.items():
        monkeypatch.setattr(bench.writer, name, lambda word=word: did.append(word))
    bench.writer.end(last=last)
    assert did == order
    bench.memory.close()


def test_what_was_left_is_looked_for_once_a_minute(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not in the first look: its rows say which recording goes on."""
    bench, looks, now_s = Bench(tmp_path), list[float](), 1000.0
    monkeypatch.setattr(trace_writer, "time", SimpleNamespace(monotonic=lambda: now_s))
    monkeypatch.setattr(bench.writer, "finish_left", lambda: looks.append(now_s))
    for now_s in (1000.0, 1059.0, 1060.0, 1061.0, 1120.0):  # noqa: B007 - the writer looks at it
        bench.writer.drain(at_once=True)
    assert looks == [1060.0, 1120.0]
    bench.memory.close()


def test_files_are_being_closed_until_they_are(tmp_path: Path) -> None:
    closing, goes_on = trace_writer._Closing(), threading.Event()
    assert closing.under_way is False
    closing._begin([(tmp_path / "a", goes_on.wait)])
    assert closing.under_way is True
    goes_on.set()
    closing.join()
    assert closing.under_way is False


def test_a_file_that_cannot_be_left_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def leave() -> None:
        raise DeviceError("no room")

    bench = Bench(tmp_path)
    monkeypatch.setattr(bench.writer, "_last_rows", lambda: SimpleNamespace(leave=leave))
    bench.writer._leave()
    assert capsys.readouterr().err == "recorder: no room\n"
    bench.memory.close()


@pytest.mark.parametrize("asked", ["", "jemalloc"])
def test_buffers_come_from_the_system_unless_somebody_asks_for_another_pool(
    monkeypatch: pytest.MonkeyPatch, asked: str
) -> None:
    environment = {"ARROW_DEFAULT_MEMORY_POOL": asked} if asked else {}
    monkeypatch.setattr(freed_memory, "os", SimpleNamespace(environ=environment))
    freed_memory.keep_no_pool()
    assert environment == {"ARROW_DEFAULT_MEMORY_POOL": asked or "system"}


def test_rows_whose_columns_nobody_has_told_yet_are_no_recording(tmp_path: Path) -> None:
    """It begins with the rows behind them."""
    memory = SharedMemory.create()
    controller = RingRecorder(memory.rows, COLUMNS)
    controller.number = 41
    writer = TraceWriter(memory, tmp_path, lambda: PLENTY)
    controller.record((0.0, 1.0))
    writer.drain(at_once=True)
    assert list(tmp_path.iterdir()) == []
    publish_json(memory.columns, {"columns": COLUMNS, "metadata": {"period_s": PERIOD_S}})
    controller.record((0.001, 2.0))
    controller.stop()
    writer.drain(at_once=True)
    writer.join()
    (file,) = tmp_path.iterdir()
    assert read_trace(file)["x_rad"].tolist() == [2.0]
    memory.close()
