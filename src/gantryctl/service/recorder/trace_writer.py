"""Trace rows from their ring into files: one recording for each power-up."""

from __future__ import annotations

import json
import math
import struct
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

from gantryctl.errors import DeviceError, GantryctlError
from gantryctl.runtime.recorder import FLUSH_ROWS, ArrowRecorder
from gantryctl.service.memory.memory import SharedMemory, Word
from gantryctl.service.recorder.retention import ENOUGH, MB, RetentionPolicy
from gantryctl.trace.files import CLOSED_SUFFIX, LIVE_SUFFIX

# Rows wait in the ring for so long at most, before they are written as one block.
BLOCK_S: Final = 1.0
QUOTA_S: Final = 60.0
TRACES_KEPT: Final = 100


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
        self._number = 0.0
        self._unpack: Callable[[bytes], tuple[Any, ...]] | None = None
        self._due_s = self._quota_s = -math.inf
        self._closing: list[threading.Thread] = []

    def drain(self, *, at_once: bool = False) -> None:
        """Take the waiting rows: when they are a whole block, when a second has passed, or at once."""
        ring, now_s = self._memory.rows, time.monotonic()
        if len(ring) < FLUSH_ROWS and now_s < self._due_s and not at_once:
            return
        self._due_s = now_s + BLOCK_S
        self._check_room()
        while records := ring.peek(FLUSH_ROWS):
            for record in records:
                if record is not None:
                    self._take(record)
            self._writing(lambda file: file.flush())
            # A row leaves the ring when it is in the file: a killed recorder loses none, and the next one goes on with
            # the same file, leaving out the rows that are there already (decision 0011).
            ring.advance(len(records))

    def _check_room(self) -> None:
        """Leave the recording under way when room is short; go on with it when there is room again."""
        self._apply_quota()
        words = self._memory.words
        free_mb = self._free() / MB / (ENOUGH if words[Word.RECORDING_STOPPED] else 1.0)
        short = self._policy.shortage(free_mb) > 0 or self._size() > self._policy.traces_mb * MB
        words[Word.RECORDING_STOPPED] = short
        if short and self._file is not None:
            self._writing(lambda file: file.leave())
            self._file = None
        elif not short and self._file is None and self._number:
            self._begin()

    def _size(self) -> int:
        """Bytes of the recording under way."""
        try:
            return self._path().with_suffix(LIVE_SUFFIX).stat().st_size
        except OSError:
            return 0

    def _path(self) -> Path:
        """Path of the recording under way, without its ending."""
        milliseconds = f"{self._number % 1000:03.0f}"
        stamp = time.strftime("%Y%m%dT%H%M%S", time.gmtime(self._number / 1000.0)) + milliseconds
        return self._directory / f"service-{stamp}"

    def _take(self, record: bytes) -> None:
        number = struct.unpack_from("<d", record)[0]
        if len(record) == 8:
            if self._file is None:
                self._begin()  # left for want of room: now it is closed, if there is room again
            self.close()
            self._number = 0.0
            return
        if number != self._number:
            self.close()
            self._number = number
            self._begin()
        file, unpack = self._file, self._unpack
        if file is not None and unpack is not None:
            row = unpack(record)[1:]
            if row[0] > file.resumed_s:
                self._writing(lambda file: file.record(row))

    def _writing(self, do: Callable[[ArrowRecorder], None]) -> None:
        """Work on the file, if there is one; a failing file is left, the service goes on."""
        if self._file is not None:
            try:
                do(self._file)
            except (DeviceError, struct.error) as fault:
                sys.stderr.write(f"recorder: {fault}\n")
                self._file = None

    def _begin(self) -> None:
        """Begin a file, or go on with one that this recorder or a killed one has left."""
        about = self._memory.columns.read()
        if about is None or self._memory.words[Word.RECORDING_STOPPED]:
            return
        found = json.loads(about)
        self._unpack = struct.Struct(f"<{len(found['columns']) + 1}d").unpack
        path = self._path()
        try:
            self._directory.mkdir(parents=True, exist_ok=True)
            # A closed file is there already when its last rows were still in the ring.
            if not path.with_suffix(CLOSED_SUFFIX).exists():
                self._file = ArrowRecorder(path, found["columns"], found["metadata"], resume=True)
        except (OSError, GantryctlError) as fault:
            sys.stderr.write(f"recorder: {fault}\n")

    def _apply_quota(self) -> None:
        """Remove the oldest recordings once a minute, by count and by size; never the one under way."""
        now_s = time.monotonic()
        if now_s < self._quota_s:
            return
        self._quota_s = now_s + QUOTA_S
        room, name = self._policy.traces_mb * MB, self._path().name
        for kept, file in enumerate(sorted(self._directory.glob("service-*"), reverse=True), 1):
            room -= file.stat().st_size
            if (kept > TRACES_KEPT or room < 0) and file.stem != name:
                file.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the recording under way."""
        made, self._file = self._file, None
        if made is not None:
            self._beside(made.close)

    def finish_left(self) -> None:
        """Close files that earlier recorders left after a power cut or for want of room."""
        for live in sorted(self._directory.glob(f"service-*{LIVE_SUFFIX}")):
            if live.stem != self._path().name:
                self._beside(partial(ArrowRecorder.finish, live))

    def _beside(self, close: Callable[[], None]) -> None:
        # Closing takes a second for five minutes of rows: in a thread, so that the next rows do not wait for it. A
        # thread that is killed leaves the live file as it was.
        def closed() -> None:
            try:
                close()
            except (OSError, GantryctlError) as fault:
                sys.stderr.write(f"recorder: {fault}\n")

        self._closing = [thread for thread in self._closing if thread.is_alive()]
        self._closing.append(threading.Thread(target=closed, name="closing"))
        self._closing[-1].start()

    def join(self) -> None:
        """Wait until everything is closed."""
        for thread in self._closing:
            thread.join()
