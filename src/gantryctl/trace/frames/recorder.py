"""Recorder of a bus: a log of all frames, and the frames around every alarm."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.errors import DeviceError
from gantryctl.trace.frames.files import FrameFile, logs_beside, next_log, write_alarms
from gantryctl.trace.frames.ring import BusFrame, FrameLog, FrameRing
from gantryctl.trace.naming import oldest_first

# What is frozen: so much before the alarm, and as much after it as a stop takes.
BEFORE_S: Final = 30.0
AFTER_S: Final = 10.0
# A machine that raises alarms all the time makes one file after the other, not one without end.
_LONGEST_S: Final = 60.0
# Frozen logs kept in a folder; at 250 Hz one is 2 MB.
FROZEN_KEPT: Final = 20
FROZEN_NAMES: Final = "bus-*.log"

# The thread works in so small parts that a scan which waits for the interpreter is late by 0.5 ms at most: 32 frames
# take 0.4 ms (python-can 4.6, candump format).
_PART: Final = 32
_REST_S: Final = 0.002
_WAKE_S: Final = 0.020
_FLUSH_S: Final = 1.0
# Without a thread: frames written at once. And the patience with a disk that hangs when a run ends.
_BLOCK: Final = 1024
_END_S: Final = 5.0


class LogParts(NamedTuple):
    """Sizes of a log that has no end.

    Attributes:
        part_bytes: a part that is larger is followed by the next one, within a second.
        kept: parts kept; the oldest ones are removed.
    """

    part_bytes: int
    kept: int


class _Copy:
    """One file that follows the ring."""

    def __init__(self, ring: FrameRing, file: FrameFile, number: int) -> None:
        self._ring, self.file, self.number = ring, file, number
        self.lost = 0

    def step(self, most: int, until_s: float) -> bool:
        """Copy at most so many frames, none after a time; False when there was none."""
        ring, end = self._ring, min(self._ring.written, self.number + most)
        if self.number < ring.oldest:
            self.lost += ring.oldest - self.number
            self.number = ring.oldest
        begun = self.number
        while self.number < end:
            frame = ring.frame(self.number)
            if frame.time_s > until_s:
                break
            self.file.write(frame)
            self.number += 1
        return self.number > begun


class _Frozen:
    """Frames around an alarm, and the alarms that followed it."""

    def __init__(self, copy: _Copy, code: str, at_s: float) -> None:
        self.copy, self.begun_s = copy, at_s
        self.until_s = at_s + AFTER_S
        self.alarms = [(code, at_s)]


class FrameRecorder:
    """Keeps the latest frames and writes files of them: in a thread, or in virtual time by itself.

    A file that cannot be written is given up; the axis goes on, and `faults` reports it.

    Args:
        log: file of all frames, made when the first link is opened; None for none.
        parts: the log goes on in a next file beside the first; None for one file.
        epoch_s: added to the clock of a link in real time.

    Attributes:
        faults: why a file ended early.
        opened: links were opened.
        frozen: paths of the frames around alarms, oldest first.
    """

    def __init__(
        self, log: Path | None = None, *, parts: LogParts | None = None, epoch_s: float = 0.0
    ) -> None:
        self._path, self._parts, self._epoch_s = log, parts, epoch_s
        self._ring = FrameRing()
        self._channel = ""
        self.faults: deque[str] = deque(maxlen=20)
        self.frozen: list[Path] = []
        self.opened = False
        self._log_wanted = True
        self._alarms: deque[tuple[str, Path, float]] = deque()
        self._log: _Copy | None = None
        self._freezing: _Frozen | None = None
        self._flush_s = 0.0
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    # --- the caller's side -----------------------------------------------------------------------------------------

    def link(self, channel: str, *, virtual: bool) -> FrameLog:
        """Make the log of one link; several after one another go on in one log.

        Args:
            channel: name of the bus.
            virtual: the clock of the link begins at 0, and nobody waits for a disk in vain: no thread.

        Raises:
            DeviceError: the file cannot be made.
        """
        if not self.opened:
            self._channel = channel
            if self._path is not None:
                # A part that is there was left by a recorder that has ended, or was killed.
                path = self._path if self._parts is None else next_log(self._path)
                self._log = _Copy(self._ring, FrameFile(path, channel), 0)
            if not virtual:
                self._thread = threading.Thread(target=self._run, name="bus log", daemon=True)
                self._thread.start()
            self.opened = True
        offset_s = self._ring.last_s if virtual else self._epoch_s

        def take(time_s: float, can_id: int, data: bytes, sent: bool) -> None:
            self.take(BusFrame(time_s + offset_s, can_id, data, sent))

        return take

    def take(self, frame: BusFrame) -> None:
        """Keep one frame; costs 2 us and never waits."""
        self._ring.put(frame)
        if self._thread is None and not self._ring.written % _BLOCK:
            self._write(_BLOCK)

    def alarm(self, code: str, path: Path, ago_s: float = 0.0) -> None:
        """Freeze the frames around an alarm.

        Args:
            path: of the file; not used where the one of an alarm shortly before is still being written.
            ago_s: how long before the newest frame it was raised.
        """
        if self._ring.written:
            self._alarms.append((code, path, self._ring.last_s - ago_s))
            if self._thread is None:
                self._write(_BLOCK)

    def end_log(self) -> None:
        """End the file of all frames; those around alarms are still kept."""
        self._log_wanted = False

    def close(self) -> None:
        """Write what is left and finish the files."""
        if self._thread is None:
            self._finish()
        elif not self._ended.is_set():
            self._ended.set()
            self._thread.join(_END_S)
            if self._thread.is_alive():
                self.faults.append(f"the log of the bus was not finished within {_END_S:g} s: the disk hangs")

    # --- the writer's side -----------------------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._ended.wait(_WAKE_S):
            while self._write(_PART) and not self._ended.wait(_REST_S):
                pass
        self._finish()

    def _finish(self) -> None:
        while self._write(_BLOCK):
            pass
        if self._freezing is not None:
            self._close_frozen(self._freezing)
        if self._log is not None:
            self._guarded(self._log, self._log.file.close)
            self._report_lost(self._log)
        self._log = self._freezing = None

    def _write(self, most: int) -> bool:
        """Copy at most so many frames into each file; False when nothing was left."""
        busy = False
        if self._log is not None and not self._log_wanted:
            self._guarded(self._log, self._log.file.close)
            self._log = None
        log = self._log
        if log is not None:
            busy = self._guarded(log, lambda: log.step(most, float("inf")))
            if busy and self._ring.last_s - self._flush_s > _FLUSH_S:
                self._flush_s = self._ring.last_s
                self._guarded(log, log.file.flush)
                if self._parts is not None and self._log is log:
                    self._guarded(log, partial(self._next_part, log, self._parts))
        while self._alarms:
            self._freeze(*self._alarms.popleft())
        frozen = self._freezing
        if frozen is not None:
            more = self._guarded(frozen.copy, lambda: frozen.copy.step(most, frozen.until_s))
            busy = busy or more
            if not more and self._freezing is frozen and self._ring.last_s > frozen.until_s:
                self._close_frozen(frozen)
        return busy

    def _freeze(self, code: str, path: Path, at_s: float) -> None:
        """Begin a file for an alarm, or go on with the one under way."""
        frozen = self._freezing
        if frozen is not None:
            if at_s - frozen.begun_s <= _LONGEST_S:
                frozen.until_s = max(frozen.until_s, at_s + AFTER_S)
                frozen.alarms.append((code, at_s))
                self._guarded(frozen.copy, lambda: write_alarms(frozen.copy.file.path, frozen.alarms))
                return
            self._close_frozen(frozen)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._remove_old(path.parent)
            first = self._ring.first_since(at_s - BEFORE_S)
            copy = _Copy(self._ring, FrameFile(path, self._channel), first)
            since_s = self._ring.frame(first).time_s
            self._write_setup(copy.file, since_s)
            write_alarms(path, [(code, at_s)])
        except (DeviceError, OSError) as fault:
            self.faults.append(f"the frames around {code} are not kept: {fault}")
            return
        self._freezing = _Frozen(copy, code, at_s)
        self.frozen.append(path)

    def _write_setup(self, file: FrameFile, since_s: float) -> None:
        """Begin a file with what the telegrams mean: the set-up may be older than its frames."""
        for frame in list(self._ring.setup.values()):
            if frame.time_s < since_s:
                file.write(frame)

    def _next_part(self, log: _Copy, parts: LogParts) -> None:
        """Go on in the next file where this one is large enough."""
        first = self._path
        assert first is not None
        try:
            if log.file.path.stat().st_size < parts.part_bytes:
                return
            log.file.close()
            log.file = FrameFile(next_log(first), self._channel)
            self._write_setup(log.file, self._ring.last_s)
            for old in logs_beside(first)[: -parts.kept]:
                old.unlink(missing_ok=True)
        except OSError as fault:
            raise DeviceError(f"{log.file.path}: {fault.strerror or fault}") from fault

    def _remove_old(self, folder: Path) -> None:
        for old in oldest_first(folder.glob(FROZEN_NAMES))[: 1 - FROZEN_KEPT]:
            old.unlink(missing_ok=True)
            old.with_suffix(".json").unlink(missing_ok=True)

    def _close_frozen(self, frozen: _Frozen) -> None:
        self._guarded(frozen.copy, frozen.copy.file.close)
        self._report_lost(frozen.copy)
        self._freezing = None

    def _report_lost(self, copy: _Copy) -> None:
        if copy.lost:
            self.faults.append(f"{copy.file.path}: {copy.lost} frames are missing: the disk was too slow")

    def _guarded(self, copy: _Copy, work: Callable[[], bool | None]) -> bool:
        """Work on a file; one that fails is given up."""
        try:
            return bool(work())
        except DeviceError as fault:
            self.faults.append(f"the log of the bus ended at frame {copy.number}: {fault}")
            copy.file.give_up()
            if self._log is copy:
                self._log = None
            elif self._freezing is not None and self._freezing.copy is copy:
                self._freezing = None
            return False
