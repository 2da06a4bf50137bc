"""Diagnostics of one TPDO: age in scans; telegrams missed, late, doubled, contradicted, of the wrong length."""

from __future__ import annotations

from typing import Final

# SYNCs whose telegrams are missing may still be answered, those of so long a time and for so long: the answer to one of
# them that comes behind a newer one is late, and no second sender. At least so many scans of each.
_OWED_S: Final = 0.030
_OWED_MIN: Final = 3
_KEPT_S: Final = 0.1
_KEPT_MIN: Final = 10
_CROWDED_FACTOR: Final = 10


class TpdoWatch:
    """Assign the telegrams of one identifier to the SYNC they answer.

    `begin` is called when SYNC goes out, `settle` when the scan has waited for the answers. The first telegram after
    SYNC is its answer; one that comes when the next SYNC is due is late. A drive sends one telegram for each SYNC: a
    second one changes nothing, and one that says something else contradicts the first: two nodes use the identifier.
    What was contradicted before the scan has used it is not used at all.

    Args:
        size: bytes of the mapping.
        period_s: SYNC period.

    Attributes:
        behind: SYNCs before this one whose telegrams may still come: so many scans old may the one of this scan be.
        data: of the newest telegram; None before the first.
        wrong_in_row: telegrams of the wrong length since the last right one.
        age: scans since it was sampled; 0 when it belongs to this scan.
        contradicted: telegrams beyond one for each SYNC that differ from the answer.
    """

    def __init__(self, size: int, period_s: float = 0.010) -> None:
        self.size = size
        self._owed_max = max(_OWED_MIN, round(_OWED_S / period_s))
        self._kept_scans = max(_KEPT_MIN, round(_KEPT_S / period_s))
        self.data: bytes | None = None
        self.age = 0
        self.waiting = False
        self.received = self.missed = self.late = self.duplicated = self.wrong_length = self.contradicted = 0
        self.longest_age = self.wrong_in_row = 0
        self._answer: bytes | None = None
        self._newest = b""
        self._doubted = False
        self._owed = self._answered_scans = self.behind = 0

    def begin(self, periods: int = 1, *, crowded: bool = False) -> None:
        """SYNC goes out: a telegram still outstanding is missed.

        Args:
            periods: since the SYNC before.
            crowded: frames of others may hold telegrams up for long, one behind the other.
        """
        # Whatever waits on the bus is read before SYNC goes out: only a telegram that takes longer than a period
        # could be taken for the answer to a later SYNC.
        if self.waiting:
            self.missed += 1
            self._answered_scans = 0
        else:
            self._answered_scans += 1
            if self._answered_scans >= self._kept_scans * (_CROWDED_FACTOR if crowded else 1):
                self._owed = 0
        self.behind = min(self._owed, self._owed_max)
        self._owed = self.behind + 1
        self.waiting = True
        self.age += periods
        self._answer, self._doubted = None, False

    def pass_over(self) -> None:
        """Count a telegram whose age cannot be told, and leave it."""
        self.late += 1
        self._owed = max(0, self._owed - 1)

    def take(self, data: bytes, in_time: bool) -> bool:
        """Take one telegram; True if it is a late answer, which counts at once. `settle` judges one that is in time.

        Args:
            in_time: the scan still waited for it.
        """
        if len(data) != self.size:
            self.wrong_length += 1
            self.wrong_in_row += 1
            self._beyond_one()
            return False
        if not self.waiting:
            self._second(data)
            return False
        self._beyond_one()
        self._newest = data
        self.wrong_in_row = 0
        self.waiting = False
        self.received += 1
        if in_time:
            self._answer = data
            return False
        self.late += 1
        self.age, self.data = 0, data
        return True

    def _second(self, data: bytes) -> None:
        """Take one more telegram of a SYNC."""
        self.duplicated += 1
        if data == self._newest:
            return
        if self._beyond_one():
            self._doubted = True
            return
        # The one before it was the late answer to an earlier SYNC: a bus keeps the order of a node's frames.
        self._newest = data
        if self._answer is not None:
            self._answer = data

    def _beyond_one(self) -> bool:
        """Count a telegram; True if there was one for each SYNC already."""
        if self._owed:
            self._owed -= 1
            return False
        self.contradicted += 1
        return True

    def settle(self) -> bytes | None:
        """End the wait of this scan, and note the longest age; its answer, None without one that is to be used."""
        answer = None if self._doubted else self._answer
        if answer is not None:
            self.age, self.data = 0, answer
        self.longest_age = max(self.longest_age, self.age)
        return answer

    def forget(self) -> None:
        """Invalidate the newest telegram."""
        self.data, self._answer, self.age, self.waiting = None, None, 0, False
