"""Trace rows from their ring into files: one recording for each power-up, a long one in several files."""

from __future__ import annotations

import json
import math
import struct
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, Final

from gantryctl.errors import DeviceError, GantryctlError
from gantryctl.runtime.recorder import FLUSH_ROWS, ArrowRecorder
from gantryctl.service.memory.memory import SharedMemory, Word
from gantryctl.service.recorder.freed_memory import give_back
from gantryctl.service.recorder.retention import ENOUGH, MB, RetentionPolicy
from gantryctl.service.recorder.row_filter import RowFilter
from gantryctl.terminal import tell
from gantryctl.trace.columns import SPACING_COLUMN
from gantryctl.trace.files import CLOSED_SUFFIX, LIVE_SUFFIX, Metadata
from gantryctl.trace.naming import number_of, numbered, oldest_first

# Rows wait in the ring for so long at most, before they are written as one block; at rest, where a block of one second
# would be more head than rows, for so long.
BLOCK_S: Final = 1.0
REST_BLOCK_S: Final = 10.0
QUOTA_S: Final = 60.0
FILES_KEPT: Final = 1000
# A file that is larger is followed by the next one: eight minutes of rows of the reference gantry at 1 ms. It is closed
# in two seconds, so that the end of the service leaves none open.
FILE_MB: Final = 64
_WHAT: Final = "service"
_PERIOD: Final = "period_s"


class TraceWriter:
    """Makes a file of every recording: live as an Arrow stream, closed as Parquet.

    While the disk is short of room nothing is recorded; a recording that was left because of that goes on in its file,
    with a gap.

    Args:
        free_bytes: what is free on the disk.
    """

    def __init__(
        self,
        memory: SharedMemory,
        directory: Path,
        free_bytes: Callable[[], int],
        policy: RetentionPolicy | None = None,
    ) -> None:
        self._memory, self._directory, self._free = memory, directory, free_bytes
        self._policy = policy or RetentionPolicy()
        self._file: ArrowRecorder | None = None
        self._filter: RowFilter | None = None
        self._number = 0
        self._unpack: Callable[[bytes], tuple[Any, ...]] | None = None
        # Records of the ring that were taken and are not in the file yet, those first that the filter holds last.
        self._taken = 0
        self._due_s = self._rest_due_s = self._quota_s = -math.inf
        self._closing = _Closing()

    def drain(self, *, at_once: bool = False) -> None:
        """Take the waiting rows: when they are a whole block, when a second has passed, or at once."""
        ring, now_s = self._memory.rows, time.monotonic()
        if len(ring) - self._taken < FLUSH_ROWS and now_s < self._due_s and not at_once:
            return
        self._due_s = now_s + BLOCK_S
        self._check_room()
        while records := ring.peek(FLUSH_ROWS, self._taken):
            for record in records:
                if record is not None:
                    self._take(record)
            self._taken += len(records)
        # At rest a block is small.
        if at_once or not self._held or now_s >= self._rest_due_s or self._taken > ring.slots // 2:
            self._rest_due_s = now_s + REST_BLOCK_S
            self._writing(lambda file: file.flush())
            # A row leaves the ring when it is in the file, or left out for good: a killed recorder loses none, and the
            # next one goes on with the same file, leaving out the rows that are there already (decision 0011).
            ring.advance(self._taken - self._held)
            self._taken = self._held

    @property
    def _held(self) -> int:
        """How many of the newest records the filter has not decided on."""
        return 0 if self._filter is None else self._filter.held

    def _check_room(self) -> None:
        """Leave the recording under way when room is short; go on with it when there is room again."""
        self._keep_house()
        words, size_mb = self._memory.words, self._size() / MB
        free_mb = self._free() / MB / (ENOUGH if words[Word.RECORDING_STOPPED] else 1.0)
        short = self._policy.shortage(free_mb) > 0 or size_mb > self._policy.traces_mb
        words[Word.RECORDING_STOPPED] = short
        if short and self._file is not None:
            self._leave()
        elif not short and self._file is None and self._number:
            self._begin()
        elif size_mb > FILE_MB:
            words[Word.RECORDING_LONG] = self._number

    def _size(self) -> int:
        """Bytes of the file under way; also of one that was left."""
        with suppress(OSError):
            for live in self._files(LIVE_SUFFIX):
                return live.stat().st_size
        return 0

    def _files(self, ending: str) -> list[Path]:
        """The file of the recording under way with an ending; [] where there is none."""
        return list(self._directory.glob(f"{_WHAT}-{self._number:06d}-*{ending}"))

    def _take(self, record: bytes) -> None:
        number, end = int(struct.unpack_from("<d", record)[0]), len(record) == 8
        if number != self._number:
            self.close()
            self._number = number
            if not end:
                self._begin()
        if end:
            # One that was left, by a killed recorder or for want of room, is closed now, if there is room again.
            if self._file is None and self._files(LIVE_SUFFIX):
                self._begin()
            self.close()
            self._number = 0
            return
        if self._file is not None and self._filter is not None and self._unpack is not None:
            _, mark, *row = self._unpack(record)
            self._write(self._filter.take(mark, tuple(row)))

    def _write(self, rows: list[tuple[float, ...]]) -> None:
        for row in rows:
            self._writing(lambda file: file.record(row))  # noqa: B023  # called at once

    def _writing(self, do: Callable[[ArrowRecorder], None]) -> None:
        """Work on the file, if there is one; a failing file is left, the service goes on."""
        if self._file is not None:
            try:
                do(self._file)
            except (DeviceError, struct.error) as fault:
                _say(fault)
                self._file = self._filter = None

    def _begin(self) -> None:
        """Begin a file, or go on with one that this recorder or a killed one has left."""
        about = self._memory.columns.read()
        if about is None or self._memory.words[Word.RECORDING_STOPPED]:
            return
        found = json.loads(about)
        columns, metadata = found["columns"], found["metadata"]
        self._unpack = struct.Struct(f"<{len(columns) + 2}d").unpack
        try:
            # Not its parents: a state directory that was moved away is not begun anew by a recording.
            self._directory.mkdir(exist_ok=True)
            # A closed file is there already when its last rows were still in the ring.
            if self._files(CLOSED_SUFFIX):
                return
            new = self._directory / numbered(_WHAT, self._number, datetime.now(UTC))
            (path,) = self._files(LIVE_SUFFIX) or [new]
            of_file: Metadata = {**metadata, "recording": self._number}
            file = ArrowRecorder(path, (*columns, SPACING_COLUMN), of_file, resume=True)
        except (OSError, GantryctlError) as fault:
            _say(fault)
            return
        self._file, self._filter = file, RowFilter(columns, metadata[_PERIOD], metadata, file.resumed_s)

    # --- the folder -------------------------------------------------------------------------------------------------

    def _keep_house(self) -> None:
        """Once a minute: close what was left, and remove the oldest recordings by count and by size."""
        now_s = time.monotonic()
        if now_s < self._quota_s:
            return
        first, self._quota_s = self._quota_s == -math.inf, now_s + QUOTA_S
        room = self._policy.traces_mb * MB
        files = oldest_first(self._directory.glob(f"{_WHAT}-*"))
        for kept, file in enumerate(reversed(files), 1):
            with suppress(OSError):
                room -= file.stat().st_size
                if (kept > FILES_KEPT or room < 0) and not self._in_use(file):
                    file.unlink()
        # Not at first: whether a file is left or goes on shows when the rows were looked at.
        if not first:
            self.finish_left()

    def _in_use(self, file: Path) -> bool:
        return self._closing.under_way or (self._number != 0 and number_of(file) == self._number)

    def finish_left(self) -> None:
        """Close files that were left: after a kill, a power cut, or for want of room."""
        if self._closing.under_way or self._policy.shortage(self._free() / MB):
            return
        left = oldest_first(self._directory.glob(f"{_WHAT}-*{LIVE_SUFFIX}"))
        found = [live for live in left if not self._number or number_of(live) != self._number]
        if found:
            self._closing.finish(found)

    def remove_drafts(self) -> None:
        """Remove what a recorder that was killed has begun to close; before anything is closed here."""
        for draft in self._directory.glob(f"{_WHAT}-*{CLOSED_SUFFIX}.part"):
            draft.unlink(missing_ok=True)

    # --- the end ----------------------------------------------------------------------------------------------------

    def close(self) -> None:
        """Close the recording under way."""
        made = self._last_rows()
        if made is not None:
            self._closing.close(made)

    def end(self, *, last: bool) -> None:
        """Finish everything with the last process of a service; else leave the file to the recorder that comes next."""
        if last:
            self.close()
            self.join()
            self.finish_left()
        else:
            self._leave()
        self.join()

    def _leave(self) -> None:
        made = self._last_rows()
        if made is not None:
            try:
                made.leave()
            except DeviceError as fault:
                _say(fault)

    def _last_rows(self) -> ArrowRecorder | None:
        """Write what the filter still holds; return the file that was under way."""
        if self._filter is not None:
            self._write(self._filter.flush())
        made, self._file, self._filter = self._file, None, None
        return made

    def join(self) -> None:
        """Wait until everything is closed."""
        self._closing.join()


class _Closing:
    """Closes files in threads: it takes a second for five minutes of rows, and the next rows do not wait for it.

    A thread that is killed leaves the live file as it was.
    """

    def __init__(self) -> None:
        self._threads: list[threading.Thread] = []
        # What cannot be closed is tried again, and told once.
        self._told: set[Path] = set()

    @property
    def under_way(self) -> bool:
        """Whether anything is being closed."""
        self._threads = [thread for thread in self._threads if thread.is_alive()]
        return bool(self._threads)

    def close(self, made: ArrowRecorder) -> None:
        """Close a file."""
        self._begin([(made.live_path, made.close)])

    def finish(self, left: list[Path]) -> None:
        """Close live files, one after the other; one without a row is removed."""
        self._begin([(live, partial(ArrowRecorder.finish, live)) for live in left])

    def _begin(self, work: list[tuple[Path, Callable[[], None]]]) -> None:
        def close_all() -> None:
            for live, close in work:
                try:
                    close()
                except (OSError, GantryctlError) as fault:
                    if live not in self._told:
                        self._told.add(live)
                        _say(fault)
            give_back()

        self._threads = [thread for thread in self._threads if thread.is_alive()]
        self._threads.append(threading.Thread(target=close_all, name="closing"))
        self._threads[-1].start()

    def join(self) -> None:
        """Wait until everything is closed."""
        for thread in self._threads:
            thread.join()


def _say(fault: Exception) -> None:
    tell(f"recorder: {fault}")
