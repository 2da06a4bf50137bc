"""The recorder process: events into the journal, trace rows into files.

It is the only writer of the journal; a slow disk delays only this process.
"""

from __future__ import annotations

import math
import os
import select
import signal
import sqlite3
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.errors import DeviceError
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words
from gantryctl.service.memory.held_up import HeldUp
from gantryctl.service.memory.memory import JournalState, SharedMemory, Word
from gantryctl.service.realtime import die_with_parent
from gantryctl.service.recorder.frame_writer import FrameWriter
from gantryctl.service.recorder.freed_memory import keep_no_pool
from gantryctl.service.recorder.journal.writer import Batch, Journal, JournalFault
from gantryctl.service.recorder.retention import ENOUGH, MB, RetentionPolicy, free_of
from gantryctl.service.recorder.run_record import RunFile, RunKeeper
from gantryctl.service.recorder.trace_writer import TraceWriter
from gantryctl.terminal import tell

# A commit that takes longer shows as `slow`; events wait in their rings meanwhile.
SLOW_S: Final = 1.0
_BATCH: Final = 200
# Pause between two looks for events: replies wait for their commit, and people for replies.
_LOOK_S: Final = 0.002
# Between two looks at files and disk while nothing waits: at every look they would take 4 % of a processor.
_UPKEEP_S: Final = 0.1
_PAUSE_S: Final = 0.010
_RETRY_S: Final = 1.0
_PRUNE_S: Final = 600.0
_ANCHOR_S: Final = 86400.0
# The controller takes 20 s at most to bring the axis to rest, and then keeps its state.
_OTHERS_S: Final = 40.0


class Note(NamedTuple):
    """An event of the recorder itself."""

    kind: str
    text: str
    values: dict[str, object]


class EventWriter:
    """Moves events from their rings into the journal.

    Args:
        free_bytes: what is free on the disk.
        connect: opens the database; a test puts a failing disk under it.
    """

    def __init__(
        self,
        memory: SharedMemory,
        directory: Path,
        free_bytes: Callable[[], int],
        policy: RetentionPolicy | None = None,
        connect: Callable[[Path], sqlite3.Connection] | None = None,
    ) -> None:
        self._memory, self._directory, self._free = memory, directory, free_bytes
        self._policy, self._connect = policy or RetentionPolicy(), connect
        self._journal: Journal | None = None
        # When the commit under way began, on CLOCK_MONOTONIC.
        self.began_s: float | None = None
        self.failed = False
        # What this process has to say itself, from any thread; it stays until it is kept.
        self.notes: deque[Note] = deque()
        self._disk = 0
        self._failed_since_s = self._prune_s = self._anchor_s = self._upkeep_s = -math.inf
        self._slowest_s = 0.0

    @property
    def state(self) -> JournalState:
        """Health of the journal now."""
        if self.failed:
            return JournalState.FAILED
        if self._free() < self._policy.event_reserve_mb * MB:
            return JournalState.FULL
        journal = self._journal
        if journal is not None and journal.locked:
            return JournalState.LOCKED
        began_s = self.began_s
        slow = began_s is not None and time.monotonic() - began_s > SLOW_S
        return JournalState.SLOW if slow else JournalState.OK

    def drain(self) -> bool:
        """Write the waiting events; False if there were none.

        Raises:
            JournalFault: the events were not written and wait on.
        """
        if self._journal is None:
            self._journal = Journal(self._directory, self._connect)
            self._anchor_s = -math.inf
        try:
            return self._drain(self._journal)
        except JournalFault as fault:
            if fault.damaged:
                # Opened anew it is moved aside, and the events wait for the next one.
                self._journal.close()
                self._journal = None
            raise

    def _drain(self, journal: Journal) -> bool:
        journal.look()
        boot = self._memory.words[Word.BOOT] & (2**62 - 1)
        rings = self._memory.events
        # One commit for all sources: a reply waits for one synchronisation of the disk, whoever else writes events.
        batches = [Batch(n, ring.done + 1, ring.peek(_BATCH)) for n, ring in enumerate(rings) if len(ring)]
        if batches:
            began_s = self.began_s = time.monotonic()
            try:
                journal.append_all(boot, batches)
            finally:
                self.began_s = None
            self._slowest_s = max(self._slowest_s, time.monotonic() - began_s)
            # Decision 0011: an event leaves its ring when it is committed, so a killed recorder loses none, and the
            # numbers of the ring make every event exactly once.
            for source, _, records in batches:
                rings[source].advance(len(records))
        while self.notes:
            note = self.notes[0]
            self._note(note.kind, note.text, **note.values)
            self.notes.popleft()
        self._report_disk()
        journal.reflect()
        self._prune()
        self._keep_anchor(journal)
        journal.settle()
        self._upkeep_s = time.monotonic() + _UPKEEP_S
        self.failed = False
        return bool(batches)

    def _report_disk(self) -> None:
        """Write into the journal what the disk did to it, as soon as it takes events again."""
        free_mb, limits = self._free() / MB, self._policy
        short, nearly = limits.shortage(free_mb), limits.shortage(free_mb / ENOUGH)
        disk = max(short, min(nearly, self._disk))
        if disk != self._disk:
            limit, stop = limits.reserve_mb, limits.event_reserve_mb
            if disk == 0:
                self._note("service", f"the disk has room again: {free_mb:.0f} MB free")
            elif disk == 1:
                self._alarm(Code.JRN_01, reason=Words.NOTHING_RECORDED(free=free_mb, limit=limit))
            else:
                self._alarm(Code.JRN_01, reason=Words.NO_NEW_MOTION(free=free_mb, limit=limit, stop=stop))
            self._disk = disk
        if self._failed_since_s > -math.inf:
            seconds = time.monotonic() - self._failed_since_s
            self._alarm(Code.JRN_02, reason=Words.EVENTS_WAITED(time_s=seconds))
            self._failed_since_s = -math.inf
        if self._slowest_s > SLOW_S:
            self._alarm(Code.JRN_02, reason=Words.DISK_SLOW(time_s=self._slowest_s, limit=SLOW_S))
        self._slowest_s = 0.0

    def _prune(self) -> None:
        """Remove events that are too old or too many, every ten minutes."""
        now_s = time.monotonic()
        if self._journal is None or now_s < self._prune_s:
            return
        taken = self._journal.prune(self._policy.journal_days, int(self._policy.journal_mb * MB))
        self._prune_s = now_s if taken else now_s + _PRUNE_S

    def _keep_anchor(self, journal: Journal) -> None:
        """Keep an anchor at the start and every day: in a file, and on the terminal of the service."""
        now_s = time.monotonic()
        if now_s < self._anchor_s:
            return
        self._anchor_s = now_s + _ANCHOR_S
        made = journal.anchor()
        if made is not None:
            # systemd takes it from there, and passes it on to whoever collects its log.
            tell(f"journal anchor: {made.line}")

    def _alarm(self, code: Code, **values: object) -> None:
        self._note("alarm", refusal(code, **values).line, code=str(code))

    def _note(self, kind: str, text: str, **values: object) -> None:
        assert self._journal is not None
        self._journal.note(kind, text, **values)

    def run(self, ended: threading.Event) -> None:
        """Write events until told to end and everything is written."""
        while True:
            last_round, busy, pause_s = ended.is_set(), False, _LOOK_S
            try:
                if self._waiting or time.monotonic() >= self._upkeep_s:
                    busy = self.drain()
            except DeviceError as fault:
                if not self.failed:
                    self._failed_since_s = time.monotonic()
                self.failed, pause_s = True, _RETRY_S
                tell(f"recorder: {fault}")
            if not busy:
                if last_round:
                    return
                ended.wait(pause_s)

    def tell(self, text: str) -> None:
        """Take a line that the journal is to have."""
        self.notes.append(Note("service", text, {}))

    @property
    def all_kept(self) -> bool:
        """Whether nothing waits for the disk."""
        return not (self.failed or self._waiting)

    @property
    def _waiting(self) -> bool:
        """Whether an event waits."""
        return bool(self.notes) or any(len(ring) for ring in self._memory.events)

    def close(self) -> None:
        """Close the journal."""
        if self._journal is not None:
            self._anchor_s = -math.inf
            with suppress(JournalFault):
                self._keep_anchor(self._journal)
            self._journal.close()


class Others:
    """The other processes of the service: the recorder ends after them, whoever told it to end.

    Args:
        handle: end of a pipe whose other end every other process of the service holds; -1 for none of them.
        parent: process number of the first one.
    """

    def __init__(self, handle: int, parent: int) -> None:
        self._handle, self._parent = handle, parent
        self.gone = handle < 0
        self._until_s = math.inf

    @property
    def orphaned(self) -> bool:
        """Whether the first process has ended before this one."""
        return os.getppid() != self._parent

    def look(self, *, ending: bool) -> bool:
        """Whether this process may end now: it is to, and the others are gone, or have taken too long."""
        now_s = time.monotonic()
        if not self.gone:
            readable, _, _ = select.select([self._handle], [], [], 0.0)
            self.gone = bool(readable)  # nobody writes: only its end can be read
        if ending and self._until_s == math.inf:
            self._until_s = now_s + _OTHERS_S
        return (ending and self.gone) or now_s > self._until_s


def main(arguments: list[str]) -> int:
    """Entry point of the process."""
    memory, directory = SharedMemory(int(arguments[0])), Path(arguments[1])
    policy, others = (
        RetentionPolicy.from_json(arguments[2]),
        Others(int(arguments[3]), memory.words[Word.SUPERVISOR]),
    )
    log = Path(arguments[4]) if arguments[4:] else None
    ending, ended = threading.Event(), threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda *_: ending.set())
    die_with_parent(memory.words[Word.SUPERVISOR])
    keep_no_pool()

    run_file = RunFile(directory)
    while not run_file.hold():
        # The recorder of a service whose first process was killed still writes; what comes meanwhile waits in memory.
        memory.words[Word.JOURNAL_STATE] = JournalState.FAILED
        memory.words[Word.RECORDER_NS] = time.monotonic_ns()
        if ending.wait(_PAUSE_S):
            return 0
    run = RunKeeper(memory, run_file)
    free_bytes = free_of(directory)
    events = EventWriter(memory, directory, free_bytes, policy)
    left = run.left_behind()
    if left is not None:
        tell(left.told.line)
        events.notes.append(Note("alarm", left.told.line, {"code": str(left.told.code), **left.numbers}))
    traces = TraceWriter(memory, directory / "traces", free_bytes, policy)
    frames = FrameWriter(memory, directory / "traces", log, free_bytes, policy, events.tell)
    writer = threading.Thread(target=events.run, args=(ended,), name="journal")
    writer.start()
    traces.remove_drafts()
    # First the rows: they say which recording goes on, all others were left by a recorder that is gone.
    traces.drain(at_once=True)
    traces.finish_left()
    orphaned, held_up = False, HeldUp("recorder", events.tell)
    while writer.is_alive():
        held_up.look()
        traces.drain()
        frames.drain()
        # The record of the run before stays until the journal has told it.
        if not events.notes:
            run.look()
        if others.orphaned and not orphaned:
            orphaned = True
            events.tell(refusal(Code.SYS_06, process="supervisor", how=Words.FIRST_PROCESS_GONE).line)
        if others.look(ending=ending.is_set()):
            ended.set()
        memory.words[Word.JOURNAL_STATE] = events.state
        memory.words[Word.RECORDER_NS] = time.monotonic_ns()
        writer.join(_PAUSE_S)
    run.end(kept=events.all_kept)
    frames.close()
    # The journal is closed to this thread: what the end of the files has to say goes to the terminal of the service.
    for note in events.notes:
        tell(f"recorder: {note.text}")
    traces.drain(at_once=True)
    traces.end(last=others.gone)
    events.close()
    run_file.close()
    return 0
