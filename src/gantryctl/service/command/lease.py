"""Hold-to-run: a key is held as long as its lease is renewed in time, and not for ever: a page may be stuck.

A lease that has ended is dead for ever.
"""

from __future__ import annotations

from collections import OrderedDict
from typing import Final

from gantryctl.program.alarms.words import Said, Words
from gantryctl.service.protocol.limits import HELD_S

_REMEMBERED: Final = 10_000


class HoldToRun:
    """The one lease that may live, and those that did.

    Attributes:
        forward, reverse: the key levels for the program.
        count: rises with every renewal: the program's own lease.
        client: whose lease it is, or "".
        ended: why the last lease has ended, in words.
        too_long: it was because the key was held for too long.
    """

    def __init__(self, lease_s: float) -> None:
        self.lease_s = lease_s
        self.forward = self.reverse = False
        self.count = 0
        self.client = ""
        self._lease = ""
        self.ended: Words | Said | None = None
        self.too_long = False
        self._renewed_s = self._began_s = 0.0
        self._used: OrderedDict[str, None] = OrderedDict()

    @property
    def alive(self) -> bool:
        """A key is held."""
        return bool(self._lease)

    def left_s(self, now_s: float) -> float:
        """What is left of the lease, s; 0 when none lives."""
        return max(0.0, self._renewed_s + self.lease_s - now_s) if self._lease else 0.0

    def begin(self, lease: str, client: str, forward: bool, now_s: float) -> Words | None:
        """A key is pressed; None, or why not."""
        if lease in self._used:
            return Words.LEASE_USED
        self._remember(lease)
        if self._lease:
            self.end()
            return Words.OTHER_KEY
        self._lease, self.client, self._renewed_s = lease, client, now_s
        self._began_s, self.ended, self.too_long = now_s, None, False
        self.forward, self.reverse = forward, not forward
        self.count += 1
        return None

    def renew(self, lease: str, client: str, now_s: float) -> Said | None:
        """The key is still held; None, or why it is not any more."""
        self.check(now_s)
        if not self._lease or lease != self._lease or client != self.client:
            return Words.LEASE_DEAD(why=self.ended or Words.LEASE_ENDED)
        self._renewed_s = now_s
        self.count += 1
        return None

    def release(self, lease: str, client: str) -> bool:
        """The key is let go; whether it was this one. A lease that never began is dead from now on too."""
        self._remember(lease)
        if lease == self._lease and client == self.client:
            self.end()
            return True
        return False

    def check(self, now_s: float) -> bool:
        """Once a scan: whether the lease has just run out."""
        if not self._lease:
            return False
        if not now_s - self._renewed_s < self.lease_s:
            self.ended = Words.LEASE_RAN_OUT
        elif not now_s - self._began_s < HELD_S:
            self.ended, self.too_long = Words.KEY_TOO_LONG(limit=HELD_S), True
        else:
            return False
        self.end()
        return True

    def end(self) -> None:
        """No key is held any more."""
        self._lease = self.client = ""
        self.forward = self.reverse = False

    def _remember(self, lease: str) -> None:
        self._used[lease] = None
        if len(self._used) > _REMEMBERED:
            self._used.popitem(last=False)
