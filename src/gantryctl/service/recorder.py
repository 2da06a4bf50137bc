"""The recorder process: events into the journal, trace rows into files.

It is the only writer of the journal. An event leaves its ring when it is on the disk, so a recorder that is killed
loses nothing; a slow disk delays only this process.
"""

from __future__ import annotations

import json
import math
import os
import signal
import struct
import sys
import threading
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from gantryctl.errors import DeviceError, GantryctlError
from gantryctl.runtime import ArrowRecorder
from gantryctl.runtime.recorder import FLUSH_ROWS
from gantryctl.service.journal import Journal, JournalFault
from gantryctl.service.memory import SharedMemory, Word
from gantryctl.service.realtime import die_with_parent

OK, SLOW, FULL, FAILED, LOCKED = range(5)
JOURNAL_RESERVE: Final = 16 * 2**20
"""Bytes free on the disk below which no new motion begins."""
TRACE_RESERVE: Final = 64 * 2**20
"""Bytes free on the disk below which nothing is recorded: they are for the journal."""
TRACES_KEPT: Final = 100
SLOW_S: Final = 1.0
BLOCK_S: Final = 1.0
"""Rows wait in the ring for so long at most, before they are written as one block."""
_BATCH: Final = 200
_OWN: Final = 9
"""Source of the events that the recorder itself writes."""
_PAUSE_S: Final = 0.010
_RETRY_S: Final = 1.0


class EventWriter:
    """Takes events out of their rings when the journal has them.

    Args:
        free_bytes: what is free on the disk.
    """

    def __init__(self, memory: SharedMemory, directory: Path, free_bytes: Callable[[], int]) -> None:
        self._memory, self._directory, self._free = memory, directory, free_bytes
        self._journal: Journal | None = None
        self._locked = False
        self.began_s: float | None = None
        """When the commit under way began, on CLOCK_MONOTONIC."""
        self.failed = False

    @property
    def state(self) -> int:
        """Number of the label of `journal_state`."""
        if self.failed:
            return FAILED
        if self._free() < JOURNAL_RESERVE:
            return FULL
        if self._locked:
            return LOCKED
        began_s = self.began_s
        return SLOW if began_s is not None and time.monotonic() - began_s > SLOW_S else OK

    def drain(self) -> bool:
        """Write what waits; whether there was anything.

        Raises:
            JournalFault: it was not written and waits on.
        """
        if self._journal is None:
            self._open()
        assert self._journal is not None
        boot = self._memory.words[Word.BOOT] & (2**62 - 1)
        busy = False
        for source, ring in enumerate(self._memory.events):
            records = ring.peek(_BATCH)
            if not records:
                continue
            self.began_s = time.monotonic()
            try:
                self._journal.append(boot, source, ring.done + 1, records)
            finally:
                self.began_s = None
            ring.advance(len(records))
            busy = True
            if self._locked and any(r is not None and b'"kind":"journal"' in r for r in records):
                self._locked = False
        self.failed = False
        return busy

    def _open(self) -> None:
        self._journal = Journal(self._directory)
        if self._journal.moved_aside is not None:
            self._locked = True
            text = f"JRN-05 the journal was damaged and moved to {self._journal.moved_aside.name}; service must reset"
            record = {
                "utc": datetime.now(UTC).isoformat(timespec="milliseconds"),
                "monotonic_ns": time.monotonic_ns(),
                "kind": "alarm",
                "text": text,
            }
            self._journal.append(0, _OWN, time.time_ns(), [json.dumps(record).encode()])

    def run(self, ended: threading.Event) -> None:
        """Until told to end and everything is written."""
        while True:
            last_round = ended.is_set()
            try:
                busy = self.drain()
            except (JournalFault, DeviceError) as fault:
                self.failed = True
                sys.stderr.write(f"recorder: {fault}\n")
                if last_round:
                    return
                ended.wait(_RETRY_S)
                continue
            if not busy:
                if last_round:
                    return
                ended.wait(_PAUSE_S)

    def close(self) -> None:
        """Close the journal."""
        if self._journal is not None:
            self._journal.close()


class TraceWriter:
    """Makes a file of every recording: live as an Arrow stream, closed as Parquet.

    A row leaves the ring when it is in the file, so a recorder that is killed loses none; the next one goes on with
    the same file and leaves out what is there already.
    """

    def __init__(self, memory: SharedMemory, directory: Path, free_bytes: Callable[[], int]) -> None:
        self._memory, self._directory, self._free = memory, directory, free_bytes
        self._file: ArrowRecorder | None = None
        self._number = 0.0
        self._unpack: Callable[[bytes], tuple[Any, ...]] | None = None
        self._due_s = -math.inf

    def drain(self, *, at_once: bool = False) -> None:
        """Take the rows that wait: when they are a whole block, when a second has passed, or at once."""
        ring, now_s = self._memory.rows, time.monotonic()
        if len(ring) < FLUSH_ROWS and now_s < self._due_s and not at_once:
            return
        self._due_s = now_s + BLOCK_S
        while records := ring.peek(FLUSH_ROWS):
            for record in records:
                if record is not None:
                    self._take(record)
            self._writing(lambda file: file.flush())
            ring.advance(len(records))

    def _take(self, record: bytes) -> None:
        number = struct.unpack_from("<d", record)[0]
        if len(record) == 8:
            self.close()
            return
        if number != self._number:
            self.close()
            self._begin(number)
        file, unpack = self._file, self._unpack
        if file is not None and unpack is not None:
            row = unpack(record)[1:]
            if row[0] > file.resumed_s:
                self._writing(lambda file: file.record(row))

    def _writing(self, do: Callable[[ArrowRecorder], None]) -> None:
        """Do it with the file, if there is one; a file that fails is given up, not the service."""
        if self._file is not None:
            try:
                do(self._file)
            except (DeviceError, struct.error) as fault:
                sys.stderr.write(f"recorder: {fault}\n")
                self._file = None

    def _begin(self, number: float) -> None:
        """A new file, or the one that a killed recorder has left; none while the disk is nearly full."""
        self._number = number
        about = self._memory.columns.read()
        if about is None or self._free() < TRACE_RESERVE:
            return
        found = json.loads(about.data)
        self._unpack = struct.Struct(f"<{len(found['columns']) + 1}d").unpack
        stamp = time.strftime("%Y%m%dT%H%M%S", time.gmtime(number / 1000.0)) + f"{number % 1000:03.0f}"
        path = self._directory / f"service-{stamp}"
        try:
            self._directory.mkdir(parents=True, exist_ok=True)
            self._forget_old()
            if not path.with_suffix(
                ".parquet"
            ).exists():  # else it was closed, but its rows were still in the ring
                self._file = ArrowRecorder(path, found["columns"], found["metadata"], resume=True)
        except (OSError, GantryctlError) as fault:
            sys.stderr.write(f"recorder: {fault}\n")

    def _forget_old(self) -> None:
        for old in sorted(self._directory.glob("service-*"))[: -TRACES_KEPT + 1]:
            old.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the recording under way."""
        made, self._file = self._file, None
        if made is not None:
            try:
                made.close()
            except (OSError, GantryctlError) as fault:
                sys.stderr.write(f"recorder: {fault}\n")


def main(arguments: list[str]) -> int:
    """Entry point of the process."""
    memory, directory = SharedMemory(int(arguments[0])), Path(arguments[1])
    die_with_parent()
    ended = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda *_: ended.set())

    def free_bytes() -> int:
        found = os.statvfs(directory)
        return found.f_bavail * found.f_frsize

    events = EventWriter(memory, directory, free_bytes)
    traces = TraceWriter(memory, directory / "traces", free_bytes)
    writer = threading.Thread(target=events.run, args=(ended,), name="journal")
    writer.start()
    while writer.is_alive():
        traces.drain()
        memory.words[Word.JOURNAL_STATE] = events.state
        memory.words[Word.RECORDER_NS] = time.monotonic_ns()
        writer.join(_PAUSE_S)
    traces.drain(at_once=True)
    traces.close()
    events.close()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
