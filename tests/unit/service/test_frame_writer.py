"""Frames of the bus on their way through the service: ring, log, the frames around an alarm."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from gantryctl.service.memory.frame_ring import FrozenAt, LinkOpened, RingFrames, unpacked
from gantryctl.service.memory.memory import FRAME_BYTES, SharedMemory
from gantryctl.service.memory.ring import Ring
from gantryctl.service.recorder.frame_writer import FrameWriter
from gantryctl.service.recorder.retention import MB, RetentionPolicy
from gantryctl.trace.frames.files import logs_beside, next_log, read_alarms, read_frames
from gantryctl.trace.frames.ring import BusFrame

ENOUGH = 1000 * MB


@pytest.fixture
def memory() -> Iterator[SharedMemory]:
    made = SharedMemory.create()
    yield made
    made.close()


class Bench:
    """The recorder's end, and everything that it told."""

    def __init__(
        self,
        memory: SharedMemory,
        folder: Path,
        log: Path | None = None,
        policy: RetentionPolicy | None = None,
    ) -> None:
        self.told: list[str] = []
        self.free = ENOUGH
        self.writer = FrameWriter(
            memory, folder / "traces", log, lambda: self.free, policy or RetentionPolicy(), self.told.append
        )


def test_frames_alarms_and_links_go_through_the_ring() -> None:
    ring = Ring(memoryview(bytearray(192 + 8 * FRAME_BYTES)), FRAME_BYTES)
    frames = RingFrames(ring)
    take = frames.link("can0", virtual=False)
    take(1.5, 0x7FF, bytes(range(8)), True)
    take(1.6, 0x080, b"", False)
    frames.alarm("CFG-CAN-01", Path("unused"), 0.25)
    frames.link("simulated", virtual=True)
    found = [unpacked(record) for record in ring.peek(8) if record is not None]
    assert found == [
        LinkOpened("can0", False),
        BusFrame(1.5, 0x7FF, bytes(range(8)), True),
        BusFrame(1.6, 0x080, b"", False),
        FrozenAt("CFG-CAN-01", 0.25),
        LinkOpened("simulated", True),
    ]
    for _ in range(5):
        take(2.0, 0x080, b"", True)
    assert frames.lost == 2  # five places were taken


@pytest.mark.parametrize("record", [b"", b"short", bytes(30)[:-1] + b"\xff" * 9, b"\xff" * 30])
def test_a_damaged_record_is_none(record: bytes) -> None:
    with pytest.raises(ValueError, match=r"unpack|Kind"):
        unpacked(record)


def spoken(memory: SharedMemory, seconds: float = 40.0, alarm_s: float = 35.0) -> None:
    """Ten frames a second, and an alarm."""
    frames = RingFrames(memory.frames)
    take = frames.link("simulated", virtual=True)
    for k in range(round(seconds * 10)):
        take(0.1 * k, 0x182, b"12", False)
        if k == round(alarm_s * 10):
            frames.alarm("CAN-03", Path("unused"))


def test_an_alarm_keeps_the_frames_around_it_and_the_journal_says_where(
    memory: SharedMemory, tmp_path: Path
) -> None:
    bench = Bench(memory, tmp_path, tmp_path / "bus.log")
    spoken(memory)
    bench.writer.drain()
    bench.writer.close()
    (frozen,) = (tmp_path / "traces").glob("bus-CAN-03-*.log")
    assert any(str(frozen) in line for line in bench.told)
    assert read_alarms(frozen) == [("CAN-03", pytest.approx(35.0))]
    times = [frame.time_s for frame in read_frames(frozen)]
    # From 30 s before it to the end, which comes sooner than 10 s after it.
    assert (times[0], times[-1]) == pytest.approx((5.0, 39.9), abs=0.11)
    assert len(list(read_frames(tmp_path / "bus.log"))) == 400


@pytest.mark.parametrize("free_mb", [0, 63])
def test_on_a_full_disk_nothing_is_kept_and_it_is_told(
    memory: SharedMemory, tmp_path: Path, free_mb: int
) -> None:
    """64 MB are reserved."""
    bench = Bench(memory, tmp_path, tmp_path / "bus.log")
    spoken(memory, 1.0, 10.0)
    bench.writer.drain()
    bench.free = free_mb * MB
    spoken(memory)
    bench.writer._room_s = 0.0  # the next look at the disk is due
    bench.writer.drain()
    RingFrames(memory.frames)._take(50.0, 0x182, b"34", False)
    bench.writer.drain()
    bench.writer.close()
    assert not list(tmp_path.glob("traces/*"))
    assert any("the frames around CAN-03 are not kept: the disk is full" in line for line in bench.told)
    assert any("the log of the bus ends here: the disk is full" in line for line in bench.told)
    assert "182#3334" not in (tmp_path / "bus.log").read_text()


def test_a_recorder_that_was_killed_is_followed_by_one_with_a_file_of_its_own(
    memory: SharedMemory, tmp_path: Path
) -> None:
    log = tmp_path / "bus.log"
    first = Bench(memory, tmp_path, log)
    spoken(memory, 1.0, 10.0)
    first.writer.drain()
    first.writer.close()  # a killed one leaves what it has flushed
    second = Bench(memory, tmp_path, log)
    # The link was opened before it came.
    RingFrames(memory.frames)._take(5.0, 0x182, b"34", False)
    second.writer.drain()
    second.writer.close()
    assert len(list(read_frames(log))) == 10
    assert [frame.data for frame in read_frames(tmp_path / "bus-2.log")] == [b"34"]


def test_a_log_without_an_end_goes_on_in_parts_of_which_the_latest_are_kept(
    memory: SharedMemory, tmp_path: Path
) -> None:
    """Lines of candump, 50 bytes each: each MB is a part, and says by itself what the telegrams mean."""
    log = tmp_path / "bus.log"
    bench = Bench(memory, tmp_path, log, RetentionPolicy(bus_log_mb=1, bus_logs=2))
    take = RingFrames(memory.frames).link("simulated", virtual=True)
    setup = bytes.fromhex("2300180182010000")  # 1800:01 = 182h
    take(0.0, 0x602, setup, True)
    last = 80_000
    for k in range(1, last + 1):
        take(0.01 * k, 0x182, k.to_bytes(8, "little"), False)
        if not k % 200:
            bench.writer.drain()
    bench.writer.close()
    parts = logs_beside(log)
    assert len(parts) == 2
    assert int(parts[0].stem.removeprefix("bus-")) >= 2
    kept = [list(read_frames(part)) for part in parts]
    assert [part[0].data for part in kept] == [setup, setup]
    # Nothing is missing where one ends and the next begins, and the end is there.
    numbers = [int.from_bytes(f.data, "little") for part in kept for f in part if f.can_id == 0x182]
    assert numbers == list(range(numbers[0], last + 1))
    # A service that is started again replaces nothing.
    assert next_log(log).stem == f"bus-{int(parts[-1].stem.removeprefix('bus-')) + 1}"


def test_a_log_that_cannot_be_made_costs_the_log_only(memory: SharedMemory, tmp_path: Path) -> None:
    bench = Bench(memory, tmp_path, tmp_path / "nowhere" / "bus.log")
    spoken(memory)
    bench.writer.drain()
    bench.writer.close()
    assert any("there is no log of the bus" in line for line in bench.told)
    assert len(list(tmp_path.glob("traces/bus-CAN-03-*.log"))) == 1


def test_a_log_that_was_never_made_does_not_end(memory: SharedMemory, tmp_path: Path) -> None:
    bench = Bench(memory, tmp_path, tmp_path / "nowhere" / "bus.log")
    spoken(memory)
    bench.free = 0
    bench.writer.drain()
    bench.writer._room_s = 0.0
    bench.writer.drain()
    bench.writer.close()
    assert any("there is no log of the bus" in line for line in bench.told)
    assert not any("the log of the bus ends here" in line for line in bench.told)


def test_an_alarm_that_is_told_late_keeps_the_frames_of_its_own_time(
    memory: SharedMemory, tmp_path: Path
) -> None:
    bench = Bench(memory, tmp_path)
    frames = RingFrames(memory.frames)
    take = frames.link("simulated", virtual=True)
    for k in range(400):
        take(0.1 * k, 0x182, b"12", False)
    frames.alarm("CAN-03", Path("unused"), 25.0)
    bench.writer.drain()
    bench.writer.close()
    (frozen,) = (tmp_path / "traces").glob("bus-CAN-03-*.log")
    assert read_alarms(frozen) == [("CAN-03", pytest.approx(39.9 - 25.0))]


def test_frames_that_were_kept_are_told_once(memory: SharedMemory, tmp_path: Path) -> None:
    bench = Bench(memory, tmp_path)
    spoken(memory, 50.0, 35.0)
    for _ in range(3):
        bench.writer.drain()
    bench.writer.close()
    assert len([line for line in bench.told if "the frames around an alarm are kept" in line]) == 1


@pytest.mark.parametrize("torn", [b"", b"torn", b"\xff" * 32])
def test_a_record_that_says_nothing_is_passed_over(memory: SharedMemory, tmp_path: Path, torn: bytes) -> None:
    """One that was damaged on its way ends neither the log nor the recorder: the frame behind it is kept."""
    made = Bench(memory, tmp_path, tmp_path / "bus.log")
    frames = RingFrames(memory.frames)
    take = frames.link("can0", virtual=False)
    assert memory.frames.put(torn)
    take(7.5, 0x181, b"\x01\x02", False)
    made.writer.close()
    assert [frame.can_id for frame in read_frames(tmp_path / "bus.log")] == [0x181]
