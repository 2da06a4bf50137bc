"""Frames of the bus from their ring into files: the log of everything, and the frames around every alarm."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from gantryctl.errors import DeviceError
from gantryctl.operation.bus_log import frozen_path
from gantryctl.service.memory.frame_ring import FrozenAt, LinkOpened, unpacked
from gantryctl.service.memory.memory import SharedMemory
from gantryctl.service.recorder.retention import MB, RetentionPolicy
from gantryctl.trace.frames.recorder import FrameRecorder, LogParts
from gantryctl.trace.frames.ring import FrameLog

_BATCH: Final = 500
_ROOM_S: Final = 1.0


class FrameWriter:
    """Keeps the latest frames of the controller, and makes files of them.

    Args:
        folder: of the frames around alarms.
        log: first file of all frames, None for none; it goes on in files beside it.
        free_bytes: what is free on the disk.
        tell: takes what has to be told, one line.
    """

    def __init__(
        self,
        memory: SharedMemory,
        folder: Path,
        log: Path | None,
        free_bytes: Callable[[], int],
        policy: RetentionPolicy,
        tell: Callable[[str], None],
    ) -> None:
        self._ring, self._folder, self._free, self._policy = memory.frames, folder, free_bytes, policy
        self._tell = tell
        self._log = log
        self._recorder = self._new(self._log)
        self._take: FrameLog | None = None
        self._room_s = 0.0
        self._told = 0

    def _new(self, log: Path | None) -> FrameRecorder:
        parts = LogParts(self._policy.bus_log_mb * MB, self._policy.bus_logs)
        return FrameRecorder(log, parts=parts, epoch_s=time.time() - time.monotonic())

    @property
    def _short(self) -> bool:
        return self._policy.shortage(self._free() / MB) > 0

    def drain(self) -> None:
        """Take the waiting frames."""
        while records := self._ring.peek(_BATCH):
            for record in records:
                if record is not None:
                    self._take_record(record)
            self._ring.advance(len(records))
        self._check_room()
        self._report()

    def _take_record(self, record: bytes) -> None:
        try:
            found = unpacked(record)
        except ValueError:
            return
        if isinstance(found, LinkOpened):
            self._open(found)
        elif isinstance(found, FrozenAt):
            if self._short:
                self._tell(f"the frames around {found.code} are not kept: the disk is full")
            else:
                self._recorder.alarm(found.code, frozen_path(self._folder, found.code), found.ago_s)
        else:
            if self._take is None:
                # This recorder was started again: the link has been open for longer.
                self._open(LinkOpened("bus", virtual=False))
            assert self._take is not None
            self._take(*found)

    def _open(self, link: LinkOpened) -> None:
        try:
            self._take = self._recorder.link(link.channel, virtual=link.virtual)
        except DeviceError as fault:
            # The log cannot be made: alarms still have their frames.
            self._tell(f"there is no log of the bus: {fault}")
            self._recorder = self._new(None)
            self._log = None
            self._take = self._recorder.link(link.channel, virtual=link.virtual)

    def _check_room(self) -> None:
        """End the log when room is short: events and recordings need it more."""
        now_s = time.monotonic()
        if self._log is None or now_s < self._room_s:
            return
        self._room_s = now_s + _ROOM_S
        if self._short:
            self._recorder.end_log()
            self._tell(f"{self._log}: the log of the bus ends here: the disk is full")
            self._log = None

    def _report(self) -> None:
        for path in self._recorder.frozen[self._told :]:
            self._tell(f"the frames around an alarm are kept: gantryctl can log {path}")
        self._told = len(self._recorder.frozen)
        while self._recorder.faults:
            self._tell(self._recorder.faults.popleft())

    def close(self) -> None:
        """Take what is left and finish the files."""
        self.drain()
        self._recorder.close()
        self._report()
