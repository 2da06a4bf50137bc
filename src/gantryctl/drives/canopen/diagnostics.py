"""Diagnostics of one TPDO: age in scans; telegrams missed, late, duplicated, of the wrong length."""

from __future__ import annotations


class TpdoWatch:
    """Assign the telegrams of one identifier to the SYNC they answer.

    `begin` is called when SYNC goes out. The first telegram after it is its answer; one that comes when the next SYNC
    is due is late, and any other is a duplicate and changes nothing.

    Args:
        size: bytes of the mapping.

    Attributes:
        data: of the newest telegram; None before the first.
        wrong_in_row: telegrams of the wrong length since the last right one.
        age: scans since it was sampled; 0 when it belongs to this scan.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self.data: bytes | None = None
        self.age = 0
        self.waiting = False
        self.wrong_in_row = 0
        self.received = self.missed = self.late = self.duplicated = self.wrong_length = 0
        self.longest_age = self.wrong_in_row = 0

    def begin(self, periods: int = 1) -> None:
        """SYNC goes out, `periods` after the one before: a telegram still outstanding is missed."""
        # Whatever waits on the bus is read before SYNC goes out: only a telegram that takes longer than a period
        # could be taken for the answer to a later SYNC.
        if self.waiting:
            self.missed += 1
        self.waiting = True
        self.age += periods

    def take(self, data: bytes, in_time: bool) -> bool:
        """Store one telegram; True if it is new.

        Args:
            in_time: the scan still waited for it.
        """
        if len(data) != self.size:
            self.wrong_length += 1
            self.wrong_in_row += 1
            return False
        # A drive sends one telegram for each SYNC: a second one would date the position by a wrong SYNC.
        if not self.waiting:
            self.duplicated += 1
            return False
        self.waiting = False
        self.received += 1
        self.late += not in_time
        self.age = 0
        self.data = data
        return True

    def end(self) -> None:
        """End the wait of this scan: note the longest age."""
        self.longest_age = max(self.longest_age, self.age)
