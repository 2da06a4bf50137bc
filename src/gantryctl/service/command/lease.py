"""Hold-to-run: a key is held as long as its lease is renewed in time. A lease that has ended is never valid again."""

from __future__ import annotations

from collections import OrderedDict
from typing import Final

from gantryctl.program.alarms.words import Said, Words
from gantryctl.service.protocol.limits import HELD_S

# Ended leases that are kept against a second use: two days of a busy room, some 230 bytes each. A press that came again
# later would name a status frame that is older than its lease, and end in the same scan.
_REMEMBERED: Final = 1_000


class HoldToRun:
    """The lease of the held key, and the leases that have ended.

    Args:
        lease_s: from the issue of the status frame that the person saw until the axis begins to stop.
        scan_s: period of the scan.

    Attributes:
        forward, reverse: the key levels for the program.
        count: rises with every renewal by a newer frame: the lease that the program itself watches, in scans.
        issued_s: when the newest frame was issued that the key's press or renewals named: the lease counts from there.
        client: the connection that holds the key, or "".
        ended: why the last lease has ended, in words.
        too_long: the last lease has ended because the key was held for too long.
    """

    # The lease is checked twice: here on CLOCK_MONOTONIC, and in scans by the program (decision 0011).

    def __init__(self, lease_s: float, scan_s: float) -> None:
        self.lease_s, self._scan_s = lease_s, scan_s
        self.forward = self.reverse = False
        self.count = 0
        self.client = ""
        self._lease = ""
        self.ended: Words | Said | None = None
        self.too_long = False
        self.issued_s = self._began_s = 0.0
        self._used: OrderedDict[str, None] = OrderedDict()

    @property
    def alive(self) -> bool:
        """Whether a key is held."""
        return bool(self._lease)

    def left_s(self, now_s: float) -> float:
        """Time left of the lease, s; 0 without one."""
        return max(0.0, self.issued_s + self.lease_s - now_s) if self._lease else 0.0

    def begin(self, lease: str, client: str, forward: bool, issued_s: float, now_s: float) -> Words | None:
        """Press a key; return why that is refused.

        Args:
            issued_s: when the status frame was issued that the person saw.
        """
        if lease in self._used:
            return Words.LEASE_USED
        self._remember(lease)
        # Both keys mean stop.
        if self._lease:
            self.end()
            return Words.OTHER_KEY
        self._lease, self.client, self.issued_s = lease, client, issued_s
        self._began_s, self.ended, self.too_long = now_s, None, False
        self.forward, self.reverse = forward, not forward
        self.count += 1
        return None

    def renew(self, lease: str, client: str, issued_s: float, now_s: float) -> Said | None:
        """Renew the lease of the held key by a status frame; return why that is refused."""
        self.check(now_s)
        if not self._lease or lease != self._lease or client != self.client:
            return Words.LEASE_DEAD(why=self.ended or Words.LEASE_ENDED)
        # The same frame again, or one that was overtaken, is no news of the person.
        if issued_s > self.issued_s:
            self.issued_s = issued_s
            self.count += 1
        return None

    def release(self, lease: str, client: str) -> bool:
        """Let the key go; False if another key, or none, is held."""
        # A release may overtake its press: a lease that never began is dead from now on, too.
        self._remember(lease)
        if lease == self._lease and client == self.client:
            self.end()
            return True
        return False

    def check(self, now_s: float) -> bool:
        """End a lease that has just run out; True if it did. Called in every scan."""
        if not self._lease:
            return False
        # In the last scan before its end, so that the ramp has begun when it ends.
        if not now_s + self._scan_s - self.issued_s < self.lease_s:
            self.ended = Words.LEASE_RAN_OUT
        elif not now_s - self._began_s < HELD_S:
            self.ended, self.too_long = Words.KEY_TOO_LONG(limit=HELD_S), True
        else:
            return False
        self.end()
        return True

    def end(self) -> None:
        """Release the key that is held."""
        self._lease = self.client = ""
        self.forward = self.reverse = False

    def _remember(self, lease: str) -> None:
        self._used[lease] = None
        if len(self._used) > _REMEMBERED:
            self._used.popitem(last=False)
