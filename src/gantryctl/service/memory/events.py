"""Events on their way to the journal: one JSON record each, written by the process that saw it happen."""

from __future__ import annotations

import time
from datetime import UTC, datetime
from typing import Any, Final

from gantryctl.service.memory.ring import Ring
from gantryctl.service.protocol.messages import Identity, compact

# Longest text of an event, bytes.
TEXT_MAX: Final = 500
# Places in the ring that are kept for stops and alarms: below it nothing new is begun.
RESERVE: Final = 2048


class EventLog:
    """The writer's end of one event ring.

    Attributes:
        lost: events that found the ring full. New motion is refused long before.
    """

    def __init__(self, ring: Ring) -> None:
        self._ring = ring
        self.lost = self._declared = 0

    @property
    def written(self) -> int:
        """Number of the newest event of this source."""
        return self._ring.written

    @property
    def room(self) -> bool:
        """Whether the ring takes more than the reserve."""
        return self._ring.slots - len(self._ring) > RESERVE

    def put(self, kind: str, text: str, who: Identity | None = None, **values: Any) -> int:
        """Hand one event to the journal; return its number, 0 for a lost one.

        Args:
            kind: one word: command, alarm, authority, setting, login, user, service.
            values: numbers and short texts.
        """
        # A gap is declared by the next event that finds two places, so it stands in the journal where it is.
        if self.lost > self._declared:
            if self._ring.slots - len(self._ring) < 2:
                self.lost += 1
                return 0
            missing, self._declared = self.lost - self._declared, self.lost
            self.put(
                "service", f"{missing} events are missing here: they found no place to wait for the recorder"
            )
        record = {
            "utc": now_ms_text(),
            "monotonic_ns": time.monotonic_ns(),
            "kind": kind,
            "user": printable(who.user if who else "", 64),
            "role": str(who.role) if who else "",
            "client": printable(who.client if who else "", 32),
            "place": who.place if who else "",
            "text": printable(text, TEXT_MAX),
            "values": values,
        }
        data = compact(record).encode()
        if len(data) > self._ring.record_max:
            data = compact({**record, "text": printable(text, TEXT_MAX // 2), "values": {}}).encode()
        if not self._ring.put(data):
            self.lost += 1
            return 0
        return self._ring.written


def now_ms_text() -> str:
    """Date and time now in UTC, to the millisecond."""
    # The zone is written by hand, as in `gantryctl.operation.store.time_text`.
    return f"{datetime.now(UTC).replace(tzinfo=None).isoformat(timespec='milliseconds')}+00:00"


def printable(text: str, length: int = TEXT_MAX) -> str:
    """Cut a text to `length` bytes of one line without control characters."""
    # A user name or a message must not forge lines of a log (docs/explanation/security.md, Journal).
    clean = "".join(c if c.isprintable() else "\ufffd" for c in text[:length])
    return clean.encode(errors="replace")[:length].decode(errors="ignore")
