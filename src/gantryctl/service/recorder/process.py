"""The recorder process: events into the journal, trace rows into files.

It is the only writer of the journal. An event leaves its ring when it is on the disk, so a recorder that is killed
loses nothing; a slow disk delays only this process.
"""

from __future__ import annotations

import math
import signal
import sqlite3
import sys
import threading
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from gantryctl.errors import DeviceError
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words
from gantryctl.service.memory.memory import JournalState, SharedMemory, Word
from gantryctl.service.realtime import die_with_parent
from gantryctl.service.recorder.journal import Journal, JournalFault
from gantryctl.service.recorder.retention import ENOUGH, MB, RetentionPolicy, free_of
from gantryctl.service.recorder.trace_writer import TraceWriter

SLOW_S: Final = 1.0
_BATCH: Final = 200
_PAUSE_S: Final = 0.010
_RETRY_S: Final = 1.0
_PRUNE_S: Final = 600.0


class EventWriter:
    """Takes events out of their rings when the journal has them.

    Args:
        free_bytes: what is free on the disk.
        connect: opens the database; a test puts a disk of its own under it.
    """

    def __init__(
        self,
        memory: SharedMemory,
        directory: Path,
        free_bytes: Callable[[], int],
        keeping: RetentionPolicy | None = None,
        connect: Callable[[Path], sqlite3.Connection] | None = None,
    ) -> None:
        self._memory, self._directory, self._free = memory, directory, free_bytes
        self._keeping, self._connect = keeping or RetentionPolicy(), connect
        self._journal: Journal | None = None
        self._locked = False
        # When the commit under way began, on CLOCK_MONOTONIC.
        self.began_s: float | None = None
        self.failed = False
        self._disk = 0
        self._failed_since_s = self._prune_s = -math.inf
        self._slowest_s = 0.0

    @property
    def state(self) -> JournalState:
        """Health of the journal now."""
        if self.failed:
            return JournalState.FAILED
        if self._free() < self._keeping.event_reserve_mb * MB:
            return JournalState.FULL
        if self._locked:
            return JournalState.LOCKED
        began_s = self.began_s
        return (
            JournalState.SLOW
            if began_s is not None and time.monotonic() - began_s > SLOW_S
            else JournalState.OK
        )

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
            began_s = self.began_s = time.monotonic()
            try:
                self._journal.append(boot, source, ring.done + 1, records)
            finally:
                self.began_s = None
            self._slowest_s = max(self._slowest_s, time.monotonic() - began_s)
            ring.advance(len(records))
            busy = True
            if self._locked and any(r is not None and b'"kind":"journal"' in r for r in records):
                self._locked = False
        self.failed = False
        self._say_how_it_goes()
        self._prune()
        return busy

    def _say_how_it_goes(self) -> None:
        """What the disk does to the journal is in the journal, as soon as it can be."""
        free_mb, limits = self._free() / MB, self._keeping
        short, nearly = limits.shortage(free_mb), limits.shortage(free_mb / ENOUGH)
        disk = max(short, min(nearly, self._disk))
        if disk != self._disk:
            limit, stop = limits.reserve_mb, limits.event_reserve_mb
            if disk == 0:
                self._own(f"the disk has room again: {free_mb:.0f} MB free")
            elif disk == 1:
                short_of = Words.NOTHING_RECORDED(free=free_mb, limit=limit)
                self._own(refusal(Code.JRN_01, reason=short_of).line)
            else:
                short_of = Words.NO_NEW_MOTION(free=free_mb, limit=limit, stop=stop)
                self._own(refusal(Code.JRN_01, reason=short_of).line)
            self._disk = disk
        if self._failed_since_s > -math.inf:
            seconds = time.monotonic() - self._failed_since_s
            self._own(refusal(Code.JRN_02, reason=Words.EVENTS_WAITED(time_s=seconds)).line)
            self._failed_since_s = -math.inf
        if self._slowest_s > SLOW_S:
            slow = Words.DISK_SLOW(time_s=self._slowest_s, limit=SLOW_S)
            self._own(refusal(Code.JRN_02, reason=slow).line)
        self._slowest_s = 0.0

    def _prune(self) -> None:
        """Now and then: take out what is too old or too much."""
        now_s = time.monotonic()
        if self._journal is None or now_s < self._prune_s:
            return
        days = self._keeping.journal_days
        before = (datetime.now(UTC) - timedelta(days=days)).isoformat(timespec="milliseconds") if days else ""
        taken = self._journal.prune(before, int(self._keeping.journal_mb * MB))
        self._prune_s = now_s if taken else now_s + _PRUNE_S

    def _own(self, text: str) -> None:
        """An event of the recorder itself."""
        assert self._journal is not None
        self._journal.note("alarm" if text.startswith("JRN") else "service", text)

    def _open(self) -> None:
        self._journal = Journal(self._directory, self._connect)
        aside = self._journal.moved_aside
        if aside is not None:
            self._own(refusal(Code.JRN_05, file=aside.name).line)
        self._locked = self._journal.locked()

    def run(self, ended: threading.Event) -> None:
        """Until told to end and everything is written."""
        while True:
            last_round = ended.is_set()
            try:
                busy = self.drain()
            except (JournalFault, DeviceError) as fault:
                if not self.failed:
                    self._failed_since_s = time.monotonic()
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


def main(arguments: list[str]) -> int:
    """Entry point of the process."""
    memory, directory = SharedMemory(int(arguments[0])), Path(arguments[1])
    keeping = RetentionPolicy.from_json(arguments[2])
    die_with_parent()
    ended = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda *_: ended.set())

    free_bytes = free_of(directory)
    events = EventWriter(memory, directory, free_bytes, keeping)
    traces = TraceWriter(memory, directory / "traces", free_bytes, keeping)
    writer = threading.Thread(target=events.run, args=(ended,), name="journal")
    writer.start()
    traces.drain(at_once=True)  # now it is known which recording goes on
    traces.finish_left()
    while writer.is_alive():
        traces.drain()
        memory.words[Word.JOURNAL_STATE] = events.state
        memory.words[Word.RECORDER_NS] = time.monotonic_ns()
        writer.join(_PAUSE_S)
    traces.drain(at_once=True)
    traces.close()
    traces.join()
    events.close()
    return 0
