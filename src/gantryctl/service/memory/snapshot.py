"""Status snapshot of the controller as tags: packed numbers every 10 ms, the rest as JSON when it changes."""

from __future__ import annotations

import json
import math
import struct
import time
from collections.abc import Mapping
from typing import Any, Final

from gantryctl.service.memory.memory import SharedMemory
from gantryctl.service.memory.seqlock import SequenceLock
from gantryctl.service.protocol.tags import BY_NAME, TAGS

# Tags of the packed record, in this order.
FAST: Final = tuple(tag.name for tag in TAGS if tag.rate == "20 Hz")
_PACKED: Final = struct.Struct(f"<QQ{len(FAST)}d")
# Six decimals of a degree are 17 nrad; more would carry the binary tail of every float over the wire.
_DIGITS: Final = 6


# Packed numbers instead of JSON: this record is written a hundred times a second inside the scan's process.
def publish_fast(lock: SequenceLock, values: Mapping[str, float], key: int) -> None:
    """Pack the 20 Hz tags with the time on CLOCK_MONOTONIC and the key of this status frame."""
    lock.publish(_PACKED.pack(time.monotonic_ns(), key, *[values[name] for name in FAST]))


def publish_json(lock: SequenceLock, values: object) -> None:
    """Publish what changes rarely."""
    lock.publish(json.dumps(values, separators=(",", ":"), allow_nan=False, ensure_ascii=False).encode())


class Snapshot:
    """A reader of the status snapshot: the tags as plain JSON values.

    Attributes:
        key: of the newest status frame, see `frames.mark_of`.
        version: rises when a tag that is sent on change has changed.
    """

    def __init__(self, memory: SharedMemory) -> None:
        self._memory = memory
        self._slow: dict[str, Any] = {}
        self._alarms: dict[str, Any] = {"alarms": [], "alarm_history": []}
        self._packed: bytes | None = None
        self._seen = (0, 0)
        self.key = self.version = 0

    def fast(self) -> tuple[dict[str, Any], float]:
        """Read the 20 Hz tags and their age in ms; empty and inf before the controller has published any."""
        found = self._memory.fast.read()
        if found is not None and len(found) == _PACKED.size:
            self._packed = found
        # A controller that does not run for a moment while it publishes leaves a record that cannot be read. The one
        # before stays the newest known state, with its age: an empty one would name no status frame, so that signs of
        # life which answer it are refused.
        if self._packed is None:
            return {}, math.inf
        stamp, self.key, *numbers = _PACKED.unpack(self._packed)
        age_ms = (time.monotonic_ns() - stamp) * 1e-6
        return {name: decode(name, number) for name, number in zip(FAST, numbers, strict=True)}, age_ms

    def slow(self) -> dict[str, Any]:
        """Read all other tags; `version` rises when they changed."""
        now = (self._memory.slow.version, self._memory.alarms.version)
        if now != self._seen:
            slow, alarms = self._memory.slow.read(), self._memory.alarms.read()
            if slow is not None:
                self._slow = json.loads(slow)
            if alarms is not None:
                self._alarms = json.loads(alarms)
            self._seen = now
            self.version += 1
        return {**self._slow, **self._alarms}


def decode(name: str, number: float) -> Any:
    """Turn a packed number into the value of its tag: word, flag, whole number, rounded number, or None."""
    tag = BY_NAME[name]
    if not math.isfinite(number):
        return None
    match tag.kind:
        case "enum":
            index = int(number)
            return tag.labels[index] if 0 <= index < len(tag.labels) else None
        case "bool":
            return number != 0.0
        case "int":
            return int(number)
        case _:
            return rounded(number)


def rounded(value: float) -> float | None:
    """Round a number for its tag; None for one that is not finite."""
    # Plus zero: no minus zero on the wire.
    return round(value, _DIGITS) + 0.0 if math.isfinite(value) else None
