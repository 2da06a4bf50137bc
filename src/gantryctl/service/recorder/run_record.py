"""How a run of the service stands, on the disk: shut down or not, and where the axis was last seen.

Whoever kills the service, and a power cut, leave a record that is not clean: the next start tells it (SYS-05).
"""

from __future__ import annotations

import fcntl
import json
import math
import os
import struct
import time
import zlib
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

from gantryctl.errors import DeviceError
from gantryctl.operation.store import time_text
from gantryctl.program.alarms.log import Refusal
from gantryctl.program.alarms.words import Words
from gantryctl.service.memory.last_seen import LastSeen
from gantryctl.service.memory.memory import SharedMemory, Word
from gantryctl.service.memory.snapshot import Snapshot
from gantryctl.terminal import tell
from gantryctl.units import SIGNED, Dial

FILE: Final = "run.state"
# One sector each. The first is written often and not synchronised: it survives kills. The other two take turns, each
# on the disk before the other one is touched: one of them survives a power cut, whatever becomes of the rest.
_BLOCK: Final = 512
_BLOCKS: Final = 3
_HEAD: Final = struct.Struct("<II")
_RIGHTS: Final = 0o640

# Period of the records that survive a kill: 0.3 deg at 6 deg/s.
NOTE_S: Final = 0.05
# Period of those that survive a power cut, while the axis moves and while it stands.
KEEP_S: Final = 1.0
KEEP_AT_REST_S: Final = 10.0
_MOVED_DEG: Final = 0.01


class RunRecord(NamedTuple):
    """One record.

    Attributes:
        boot: random number of the start of the service.
        clean: the controller was shut down, and all events are kept.
        utc_s: time of the reading on the clock of the computer, s since 1970.
        time_s: the same on the clock of the scan, as in recordings and events of commands.
        pos_deg, vel_deg_s: last angle, as people read it, and speed; None where they were not known.
    """

    boot: int
    clean: bool
    utc_s: float
    time_s: float
    pos_deg: float | None
    vel_deg_s: float | None

    @property
    def seen(self) -> LastSeen:
        """Where the axis was."""
        return LastSeen(self.pos_deg, self.vel_deg_s)

    @property
    def told(self) -> Refusal:
        """SYS-05 about a run that ended with this record."""
        utc = time_text(datetime.fromtimestamp(self.utc_s, UTC))
        return self.seen.told(Words.AT_TIME(utc=utc))

    @property
    def numbers(self) -> dict[str, object]:
        """Values of the event that tells it."""
        found = self._asdict()
        return {name: found[name] for name in ("utc_s", "time_s", "pos_deg", "vel_deg_s")}


class RunFile:
    """The file of a state directory, held by one process at a time.

    Args:
        directory: it is made where there is none.

    Raises:
        DeviceError: the file cannot be used.
    """

    def __init__(self, directory: Path) -> None:
        self.path = directory / FILE
        try:
            directory.mkdir(parents=True, exist_ok=True)
            self._handle = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, _RIGHTS)
        except OSError as fault:
            raise DeviceError(
                f"{self.path}: {fault.strerror or fault}; it must be a file of this user"
            ) from fault
        self._number = self._turn = 0

    def hold(self) -> bool:
        """Take the file for this process; False while another one has it."""
        try:
            fcntl.flock(self._handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True

    def read(self) -> RunRecord | None:
        """Read the newest record; None for a new file. What is damaged counts as a run of which nothing is known."""
        data = os.pread(self._handle, _BLOCK * _BLOCKS, 0)
        if not data:
            return None
        found = RunRecord(0, clean=False, utc_s=0.0, time_s=0.0, pos_deg=None, vel_deg_s=None)
        for turn in range(_BLOCKS):
            block = _unpacked(data[turn * _BLOCK : (turn + 1) * _BLOCK])
            if block is not None and block[0] > self._number:
                self._number, self._turn, found = block[0], turn, block[1]
        return found

    def note(self, record: RunRecord) -> None:
        """Write a record that survives the death of all processes."""
        self._write(0, record)

    def keep(self, record: RunRecord) -> None:
        """Write a record that survives a power cut: it is on the disk when this returns."""
        self._turn = 2 if self._turn == 1 else 1
        self._write(self._turn, record)
        os.fdatasync(self._handle)

    def _write(self, turn: int, record: RunRecord) -> None:
        self._number += 1
        text = json.dumps({"number": self._number, **record._asdict()}).encode()
        head = _HEAD.pack(len(text), zlib.crc32(text))
        os.pwrite(self._handle, (head + text).ljust(_BLOCK, b"\0"), turn * _BLOCK)

    def close(self) -> None:
        """Close the file; another process may hold it then."""
        os.close(self._handle)


def _unpacked(block: bytes) -> tuple[int, RunRecord] | None:
    """Number and record of a block; None for a damaged one."""
    try:
        length, check = _HEAD.unpack_from(block)
        text = block[_HEAD.size : _HEAD.size + length]
        if len(text) != length or zlib.crc32(text) != check:
            return None
        found: dict[str, Any] = json.loads(text)
        number = found.pop("number")
        return int(number), RunRecord(**found)
    except (struct.error, ValueError, KeyError, TypeError, AttributeError):
        return None


class RunKeeper:
    """Keeps the record of this run.

    Args:
        file: held by this process.
        utc: the clock of the computer, s since 1970. now: the monotonic time, s.
    """

    def __init__(
        self,
        memory: SharedMemory,
        file: RunFile,
        utc: Callable[[], float] = time.time,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._memory, self._file, self._utc, self._now = memory, file, utc, now
        self._snapshot = Snapshot(memory)
        self._note_s = self._keep_s = -math.inf
        self._kept_deg = math.nan
        self._failed = False
        self.before = file.read()

    @property
    def _boot(self) -> int:
        return self._memory.words[Word.BOOT]

    def left_behind(self) -> RunRecord | None:
        """The record of an earlier run that was not shut down."""
        # One of this run was left by a recorder that was killed: the run goes on.
        if self.before is None or self.before.clean or self.before.boot == self._boot:
            return None
        return self.before

    def look(self) -> None:
        """Write what is due; called every few milliseconds, once the record before is in the journal."""
        now_s = self._now()
        if now_s < self._note_s:
            return
        self._note_s = now_s + NOTE_S
        record = self._record(clean=False)
        if record is None:
            return
        moved = record.pos_deg is not None and not abs(record.pos_deg - self._kept_deg) < _MOVED_DEG
        if now_s >= self._keep_s + (KEEP_S if moved else KEEP_AT_REST_S):
            self._keep_s = now_s
            self._kept_deg = math.nan if record.pos_deg is None else record.pos_deg
            self._writing(self._file.keep, record)
        else:
            self._writing(self._file.note, record)

    def end(self, *, kept: bool) -> None:
        """Write the last record, clean if the controller was shut down and all events were kept."""
        clean = kept and bool(self._memory.words[Word.CONTROLLER_CLEAN])
        record = self._record(clean=clean)
        if record is not None:
            self._writing(self._file.keep, record)

    def _record(self, *, clean: bool) -> RunRecord | None:
        """The newest snapshot as a record; None before the first one of this run."""
        tags, age_ms = self._snapshot.fast()
        if not tags:
            return None
        about = self._memory.columns.read()
        dial = SIGNED if about is None else Dial.of_recording(json.loads(about)["metadata"])
        seen = LastSeen.of(tags, dial)
        return RunRecord(self._boot, clean, self._utc() - age_ms * 1e-3, tags["time_s"], *seen)

    def _writing(self, write: Callable[[RunRecord], None], record: RunRecord) -> None:
        """Write a record; a failing disk is told once."""
        try:
            write(record)
            self._failed = False
        except OSError as fault:
            if not self._failed:
                tell(f"recorder: {self._file.path}: {fault.strerror or fault}")
            self._failed = True
