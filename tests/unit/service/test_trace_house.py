"""The folder of recordings by hand: how many stay, and what is closed when."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from gantryctl.service.memory.memory import SharedMemory
from gantryctl.service.recorder import trace_writer
from gantryctl.service.recorder.retention import MB, RetentionPolicy
from gantryctl.service.recorder.trace_writer import TraceWriter
from gantryctl.trace.files import CLOSED_SUFFIX, LIVE_SUFFIX


@pytest.fixture
def memory() -> Iterator[SharedMemory]:
    made = SharedMemory.create()
    yield made
    made.close()


def recording(folder: Path, number: int, ending: str, size: int = 1) -> Path:
    path = folder / f"service-{number:06d}-20261122T1515{number:02d}000{ending}"
    path.write_bytes(b"x" * size)
    return path


@pytest.mark.parametrize(
    ("kept", "traces_mb", "left"), [(2, 9, [3, 4]), (4, 9, [1, 2, 3, 4]), (4, 3, [2, 3, 4])]
)
def test_so_many_files_stay_and_so_much_of_them(
    tmp_path: Path,
    memory: SharedMemory,
    monkeypatch: pytest.MonkeyPatch,
    kept: int,
    traces_mb: int,
    left: list[int],
) -> None:
    """Four of 1 MB each; the oldest go, by their numbers."""
    monkeypatch.setattr(trace_writer, "FILES_KEPT", kept)
    paths = {number: recording(tmp_path, number, CLOSED_SUFFIX, MB) for number in (3, 1, 4, 2)}
    writer = TraceWriter(memory, tmp_path, lambda: 10**12, RetentionPolicy(traces_mb=traces_mb))
    writer._keep_house()
    assert [number for number in sorted(paths) if paths[number].exists()] == left


@pytest.mark.parametrize(("free_mb", "closed"), [(64, True), (63, False)])
def test_a_file_that_was_left_is_closed_when_there_is_room_for_it(
    tmp_path: Path, memory: SharedMemory, monkeypatch: pytest.MonkeyPatch, free_mb: int, closed: bool
) -> None:
    """A closing needs the room of a second file; the reserve is 64 MB."""
    live = recording(tmp_path, 1, LIVE_SUFFIX)
    writer = TraceWriter(memory, tmp_path, lambda: free_mb * MB)
    asked: list[Path] = []
    monkeypatch.setattr(writer._closing, "finish", asked.extend)
    writer.finish_left()
    assert asked == ([live] if closed else [])
    # The one under way goes on.
    asked.clear()
    writer._number = 1
    writer.finish_left()
    assert not asked
