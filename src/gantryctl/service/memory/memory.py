"""The shared memory of the service: one anonymous file, made by the supervisor and inherited by every process."""

from __future__ import annotations

import mmap
import os
import sys
import time
from enum import IntEnum
from typing import Final

from gantryctl.errors import DeviceError
from gantryctl.service.memory.ring import Ring
from gantryctl.service.memory.seqlock import SequenceLock

# Slot of a command or reply.
COMMAND_BYTES: Final = 1024
EVENT_BYTES: Final = 1024
# Slot of a trace row: up to 64 columns, the number of the recording, the mark, the header.
ROW_BYTES: Final = 8 * 67
# At 1 ms, 33 s: 2 s that may come to lie before an event, 10 s that wait at rest for their block, and 20 s without a
# recorder.
ROWS: Final = 32768
# Slot of a frame of the bus: 30 bytes and the header; 16384 frames are 2 s of a full bus at 1 Mbit/s.
FRAME_BYTES: Final = 40

# A recorder that is silent for longer keeps no events.
RECORDER_S: Final = 10.0

_COMMANDS: Final = 192 + 256 * COMMAND_BYTES
_EVENTS: Final = 192 + 10240 * EVENT_BYTES


class Source(IntEnum):
    """The writer of commands and events."""

    # The gateway.
    WEB = 0
    # The local socket, in the supervisor.
    LOCAL = 1
    # Events only.
    CONTROLLER = 2
    # Events only.
    OPCUA = 3


class Word(IntEnum):
    """Single numbers, each with one writer."""

    # CLOCK_MONOTONIC when the recorder was last alive.
    RECORDER_NS = 0
    # Random number of this start of the service.
    BOOT = 1
    # A `JournalState`.
    JOURNAL_STATE = 4
    # 1 when the last controller was shut down, and ended at rest with the brake closed.
    CONTROLLER_CLEAN = 5
    # CLOCK_MONOTONIC when the gateway was last alive.
    GATEWAY_NS = 6
    # Hold-to-run lease of the machine, for clients to know before the controller runs.
    LEASE_MS = 2
    # 1 while the disk is too full to record.
    RECORDING_STOPPED = 7
    # Number of the newest recording; it outlives a controller.
    RECORDING = 8
    # Number of a recording that is to go on in a next file.
    RECORDING_LONG = 9
    # Link that opens the page as the console: its number, for which user of the system, until when (CLOCK_MONOTONIC).
    LINK = 16
    LINK_UID = 17
    LINK_UNTIL_NS = 18
    # 1 when commissioning takes the controller's place next: written by the controller as it ends, cleared by the
    # supervisor then.
    COMMISSIONING = 11
    # Process number of the supervisor, for the others to end with it.
    SUPERVISOR = 10


class JournalState(IntEnum):
    """Health of the journal, the labels of the tag `journal_state`; with OK and SLOW it keeps events."""

    OK = 0
    SLOW = 1
    FULL = 2
    FAILED = 3
    LOCKED = 4


class JournalHealth:
    """Health of the journal as the recorder reports it.

    Args:
        words: numbers by `Word`.
    """

    def __init__(self, words: memoryview) -> None:
        self._words = words

    @property
    def keeps(self) -> bool:
        """Whether events reach the disk: the recorder is alive and the journal takes them."""
        alive = time.monotonic_ns() - self._words[Word.RECORDER_NS] < RECORDER_S * 1e9
        return alive and self._words[Word.JOURNAL_STATE] <= JournalState.SLOW

    @property
    def locked(self) -> bool:
        """Whether the journal before was damaged, and service has not acknowledged it."""
        return bool(self._words[Word.JOURNAL_STATE] == JournalState.LOCKED)


_AREAS: Final = (
    ("words", 512), ("fast", 4096), ("slow", 64 * 1024), ("alarms", 256 * 1024), ("columns", 8192),
    ("commissioning", 128 * 1024),
    ("commands0", _COMMANDS), ("commands1", _COMMANDS), ("replies0", _COMMANDS), ("replies1", _COMMANDS),
    ("events0", _EVENTS), ("events1", _EVENTS), ("events2", _EVENTS), ("events3", _EVENTS),
    ("rows", 192 + ROWS * ROW_BYTES), ("frames", 192 + 16384 * FRAME_BYTES),
)  # fmt: skip


class SharedMemory:
    """The areas of the shared memory by name.

    Attributes:
        words: numbers by `Word`.
        fast: tags of 20 Hz, packed. slow: the other tags, JSON. alarms: alarm rows, JSON.
        columns: names of the trace's columns, JSON. commissioning: its steps and ledger, JSON.
        commands, replies: one ring each for WEB and LOCAL. events: one ring a source.
        rows: trace rows. frames: frames of the bus.
    """

    def __init__(self, handle: int) -> None:
        self.handle = handle
        self._map = mmap.mmap(handle, sum(size for _, size in _AREAS))
        whole = memoryview(self._map)
        area: dict[str, memoryview] = {}
        at = 0
        for name, size in _AREAS:
            area[name] = whole[at : at + size]
            at += size
        self.words = area["words"].cast("Q")
        self.fast, self.slow = SequenceLock(area["fast"]), SequenceLock(area["slow"])
        self.alarms, self.columns = SequenceLock(area["alarms"]), SequenceLock(area["columns"])
        self.commissioning = SequenceLock(area["commissioning"])
        self.commands = tuple(Ring(area[f"commands{n}"], COMMAND_BYTES) for n in range(2))
        self.replies = tuple(Ring(area[f"replies{n}"], COMMAND_BYTES) for n in range(2))
        self.events = tuple(Ring(area[f"events{n}"], EVENT_BYTES) for n in range(4))
        self.rows = Ring(area["rows"], ROW_BYTES)
        self.frames = Ring(area["frames"], FRAME_BYTES)

    @classmethod
    def create(cls) -> SharedMemory:
        """Make new memory, all zero.

        Raises:
            DeviceError: the system has none.
        """
        if sys.platform != "linux":
            raise DeviceError("`gantryctl serve` needs Linux: its processes share an anonymous memory file")
        # Decision 0011: an anonymous file has no name, no permissions to get wrong, and is gone with its last process.
        try:
            handle = os.memfd_create("gantryctl")
            os.set_inheritable(handle, True)
            os.ftruncate(handle, sum(size for _, size in _AREAS))
        except OSError as fault:
            raise DeviceError(f"shared memory of the service: {fault.strerror or fault}") from fault
        return cls(handle)

    def close(self) -> None:
        """Close the handle in this process; the mapping stays until it is collected."""
        os.close(self.handle)
