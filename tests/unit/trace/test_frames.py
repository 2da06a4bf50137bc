"""Frames of a bus: the latest in memory, files of python-can, and what is frozen with an alarm."""

from __future__ import annotations

import os
import threading
import time
import zlib
from pathlib import Path

import can
import pytest

from gantryctl.errors import UsageError
from gantryctl.trace.frames.files import (
    SUFFIXES,
    FrameFile,
    check_log_name,
    logs_beside,
    read_alarms,
    read_frames,
)
from gantryctl.trace.frames.recorder import AFTER_S, BEFORE_S, FROZEN_KEPT, FrameRecorder
from gantryctl.trace.frames.ring import BusFrame, FrameRing, tells_telegrams

FRAMES = [
    BusFrame(0.0, 0x000, b"\x01\x02", True),
    BusFrame(0.004, 0x080, b"", True),
    BusFrame(0.0043, 0x182, bytes(range(8)), False),
    BusFrame(1.25, 0x7FF, b"\xff", False),
]


# --- the ring --------------------------------------------------


def test_a_ring_keeps_the_latest_frames_and_finds_a_time() -> None:
    ring = FrameRing(slots=4)
    for k in range(10):
        ring.put(BusFrame(0.1 * k, k, bytes((k,)), k % 2 == 0))
    assert (ring.oldest, ring.written) == (6, 10)
    assert [ring.frame(n) for n in range(6, 10)] == [
        BusFrame(0.1 * k, k, bytes((k,)), k % 2 == 0) for k in range(6, 10)
    ]
    assert ring.first_since(0.75) == 8
    assert ring.first_since(-1.0) == 6
    assert ring.first_since(2.0) == 10


def test_the_setup_outlives_the_ring_in_the_order_of_the_last_words() -> None:
    ring = FrameRing(slots=2)
    clear, entry, count = (bytes.fromhex(text) for text in (
        "2f001a0000000000", "23001a0110004160", "2f001a0001000000",
    ))  # fmt: skip
    for k, data in enumerate((clear, entry, count)):
        ring.put(BusFrame(float(k), 0x602, data, True))
    for k in range(5):
        ring.put(BusFrame(10.0 + k, 0x182, b"", False))
    # The count was written twice: as 0 before the entry, as 1 after it. Only the last word counts.
    assert [frame.data for frame in ring.setup.values()] == [entry, count]


@pytest.mark.parametrize(
    ("can_id", "data", "told"),
    [
        (0x602, "23001a0110004160", True),  # mapping written
        (0x582, "43001a0110004160", True),  # mapping read back
        (0x602, "40001a0100000000", False),  # only asked for
        (0x582, "4376600000570000", True),  # rated torque
        (0x582, "4341600000570000", False),  # statusword
        (0x182, "23001a0110004160", False),  # process data with the same bytes
        (0x602, "23001a01", False),
    ],
)
def test_what_tells_the_telegrams(can_id: int, data: str, told: bool) -> None:
    assert tells_telegrams(can_id, bytes.fromhex(data)) is told


# --- files --------------------------------------------------


def written(path: Path, frames: list[BusFrame]) -> Path:
    file = FrameFile(path, "can0")
    for frame in frames:
        file.write(frame)
    file.close()
    return path


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_is_written_is_read(tmp_path: Path, suffix: str) -> None:
    found = list(read_frames(written(tmp_path / f"bus{suffix}", FRAMES)))
    assert [(f.can_id, f.data) for f in found] == [(f.can_id, f.data) for f in FRAMES]
    # .trc and .csv do not tell who sent a frame, or not the first one; candump, ASC, BLF do.
    if suffix in (".log", ".asc", ".blf"):
        assert [f.sent for f in found] == [f.sent for f in FRAMES]
    first_s = found[0].time_s
    # 0.1 ms is the resolution of the coarsest format, PEAK's.
    assert [f.time_s - first_s for f in found] == pytest.approx([f.time_s for f in FRAMES], abs=1e-4)


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf"])
def test_the_same_frames_are_the_same_bytes(tmp_path: Path, suffix: str) -> None:
    first = written(tmp_path / f"first{suffix}", FRAMES).read_bytes()
    time.sleep(0.02)  # the head of an ASC file would tell milliseconds
    assert written(tmp_path / f"second{suffix}", FRAMES).read_bytes() == first


def test_a_log_of_another_program_may_hold_what_is_no_data_frame(tmp_path: Path) -> None:
    path = tmp_path / "foreign.blf"
    with can.BLFWriter(str(path)) as writer:
        for message in (
            can.Message(timestamp=1.0, arbitration_id=0x182, data=b"ab", is_extended_id=False),
            can.Message(timestamp=1.1, arbitration_id=0x18FF0102, data=b"cd", is_extended_id=True),
            can.Message(timestamp=1.2, is_error_frame=True),
            can.Message(timestamp=1.3, arbitration_id=0x80, is_extended_id=False),
        ):
            writer(message)
    assert [(f.can_id, f.data) for f in read_frames(path)] == [(0x182, b"ab"), (0x80, b"")]


def test_an_object_may_go_on_in_the_next_container(tmp_path: Path) -> None:
    """Of 16 KiB: some of 1,000 frames of 48 bytes lie across the end of one."""
    frames = [BusFrame(0.001 * number, 0x182, number.to_bytes(8, "little"), False) for number in range(1000)]
    path = written(tmp_path / "long.blf", frames)
    assert [f.data for f in read_frames(path)] == [f.data for f in frames]


def _blf(*objects: bytes, method: int = 0) -> bytes:
    """A head of 144 bytes and a container, as python-can reads them; `method` 2 is zlib."""
    inner = b"".join(objects)
    body = method.to_bytes(2, "little") + bytes(6) + len(inner).to_bytes(4, "little") + bytes(4)
    body += zlib.compress(inner) if method == 2 else inner
    size = 16 + len(body)
    head = b"LOGG" + (144).to_bytes(4, "little") + bytes(136)
    return (
        head
        + b"LOBJ\x10\0\x01\0"
        + size.to_bytes(4, "little")
        + (10).to_bytes(4, "little")
        + body
        + bytes(size % 4)
    )


def _object(size: int, version: int = 4) -> bytes:
    return (
        b"LOBJ\x10\0" + version.to_bytes(2, "little") + size.to_bytes(4, "little") + bytes(max(4, size - 12))
    )


def test_a_length_that_would_never_end_is_refused(tmp_path: Path) -> None:
    """python-can 4.6 stays for good at an object of length 0 whose version it does not know."""
    path = tmp_path / "round.blf"
    for size in (0, 15):
        path.write_bytes(_blf(_object(32), _object(size)))
        with pytest.raises(
            UsageError, match=rf"round.blf.*an object of {size} bytes, and its head alone has 16"
        ):
            list(read_frames(path))
    path.write_bytes(_blf(_object(16), method=2))
    with pytest.raises(UsageError, match="no frame in it"):
        list(read_frames(path))
    path.write_bytes(_blf(bytes(16 * 2**20 + 1), method=2))
    assert path.stat().st_size < 20_000
    with pytest.raises(UsageError, match="a container of more than 16 MiB"):
        list(read_frames(path))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("text.log", b"these are no frames\n"),
        ("binary.log", bytes(range(256))),
        ("number.log", b"(0.1) can0 1G2#00\n"),
        ("empty.blf", b""),
        ("text.blf", b"LOGG, but no more of it"),
        ("text.asc", b"\xff\xfe\x00"),
        ("zip.log.gz", b"not compressed"),
    ],
)
def test_a_damaged_file_is_named(tmp_path: Path, name: str, content: bytes) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(UsageError, match=name):
        list(read_frames(path))


def test_the_frames_before_the_damage_are_given(tmp_path: Path) -> None:
    path = written(tmp_path / "cut.log", FRAMES)
    path.write_bytes(path.read_bytes()[:-6])  # in the middle of the last line, as a kill leaves it
    reading = read_frames(path)
    assert [next(reading).can_id for _ in range(3)] == [0x000, 0x080, 0x182]


@pytest.mark.parametrize("name", ["bus.foo", "bus", "nowhere/bus.log"])
def test_a_name_that_is_no_log_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(UsageError, match=name):
        check_log_name(tmp_path / name)
    with pytest.raises(UsageError, match=name):
        list(read_frames(tmp_path / name))


# --- the recorder --------------------------------------------------


def test_an_alarm_freezes_what_was_before_it_and_the_stop(tmp_path: Path) -> None:
    recorder, frozen = FrameRecorder(), tmp_path / "traces" / "bus-CAN-03-1.log"
    take = recorder.link("can0", virtual=True)
    take(0.0, 0x602, bytes.fromhex("23001a0110004160"), True)  # set-up, older than what is frozen
    for k in range(10_000):
        take(100.0 + 0.01 * k, 0x182, bytes((k % 256,)), False)
        if k == 5000:
            recorder.alarm("CAN-03", frozen, ago_s=0.5)
    recorder.close()
    found = list(read_frames(frozen))
    assert found[0].can_id == 0x602
    at_s = 150.0 - 0.5
    assert found[1].time_s == pytest.approx(at_s - BEFORE_S, abs=0.011)  # a frame comes every 0.01 s
    assert found[-1].time_s == pytest.approx(at_s + AFTER_S, abs=0.011)
    assert len(found) == pytest.approx(1 + 100 * (BEFORE_S + AFTER_S), abs=2)
    assert [(code, at) for code, at in read_alarms(frozen)] == [("CAN-03", pytest.approx(at_s))]
    assert recorder.frozen == [frozen]
    assert not recorder.faults


def test_an_alarm_during_the_stop_goes_into_the_same_file(tmp_path: Path) -> None:
    recorder = FrameRecorder()
    take = recorder.link("can0", virtual=True)
    for k in range(6000):
        take(0.01 * k, 0x80, b"", True)
        if k in (1000, 1500, 5000):
            recorder.alarm(f"A-{k}", tmp_path / f"bus-{k}.log")
    recorder.close()
    assert [path.name for path in recorder.frozen] == ["bus-1000.log", "bus-5000.log"]
    assert [code for code, _ in read_alarms(tmp_path / "bus-1000.log")] == ["A-1000", "A-1500"]
    first = list(read_frames(tmp_path / "bus-1000.log"))
    assert (first[0].time_s, first[-1].time_s) == pytest.approx((0.0, 15.0 + AFTER_S), abs=0.011)
    # At the end of a run there may be less than the stop.
    assert list(read_frames(tmp_path / "bus-5000.log"))[-1].time_s == pytest.approx(59.99, abs=1e-6)


def test_only_so_many_frozen_logs_are_kept(tmp_path: Path) -> None:
    for k in range(FROZEN_KEPT + 5):
        old = tmp_path / f"bus-OLD-{k:03}.log"
        old.write_text("")
        os.utime(old, (k, k))
    recorder = FrameRecorder()
    recorder.link("can0", virtual=True)(0.0, 0x80, b"", True)
    recorder.alarm("CAN-03", tmp_path / "bus-CAN-03-1.log")
    recorder.close()
    kept = sorted(file.name for file in tmp_path.glob("*.log"))
    assert len(kept) == FROZEN_KEPT
    assert "bus-CAN-03-1.log" in kept
    assert "bus-OLD-005.log" not in kept


def test_links_after_one_another_are_one_log(tmp_path: Path) -> None:
    path = tmp_path / "bus.log"
    recorder = FrameRecorder(path)
    for _ in range(2):
        take = recorder.link("can0", virtual=True)
        take(0.0, 0x80, b"", True)
        take(1.0, 0x80, b"", True)
    recorder.close()
    assert [frame.time_s for frame in read_frames(path)] == [0.0, 1.0, 1.0, 2.0]


def test_a_full_disk_costs_the_log_and_is_told(tmp_path: Path) -> None:
    path = tmp_path / "full.log"
    path.symlink_to("/dev/full")
    recorder = FrameRecorder(path)
    take = recorder.link("can0", virtual=False)
    for k in range(5000):
        take(0.001 * k, 0x80, b"12345678", True)
    recorder.close()
    assert len(recorder.faults) == 1
    assert "full.log: cannot be written: No space left on device" in recorder.faults[0]


def test_a_disk_that_hangs_holds_up_nobody(tmp_path: Path) -> None:
    # Nobody reads the pipe: it takes 64 KiB, and the write after that waits without end.
    path = tmp_path / "pipe.log"
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    recorder = FrameRecorder(path)
    take = recorder.link("can0", virtual=False)
    slowest_s = 0.0
    for k in range(5000):
        begun_s = time.thread_time()
        take(0.001 * k, 0x80, b"12345678", True)
        slowest_s = max(slowest_s, time.thread_time() - begun_s)
    time.sleep(0.3)  # the thread comes to the end of the pipe
    assert recorder._ring.written == 5000
    # The time of this thread alone: 2 us here; half a millisecond is an eighth of the shortest period.
    assert slowest_s < 0.5e-3
    # Whoever reads on lets it end.
    drained = threading.Thread(target=lambda: [None for _ in iter(lambda: os.read(reader, 65536), b"")])
    os.set_blocking(reader, True)
    drained.start()
    recorder.close()
    drained.join()
    os.close(reader)
    assert not recorder.faults


def test_parts_of_a_log_are_in_the_order_in_which_they_were_written(tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    parts = [log, *(tmp_path / f"bus-{number}.log" for number in range(2, 12))]
    for path in (*parts, tmp_path / "bus-old.log", tmp_path / "bus-2.asc"):
        path.touch()
    assert logs_beside(log) == parts
