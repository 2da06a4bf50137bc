"""A link that opens the page as the console of this machine: once, within a minute, for one user of the system.

The address of a connection proves nothing: a tunnel or a proxy on this machine ends on loopback, too. The link is given
over the local socket, where the system says who asks, and a browser that opens it must run as the same user.
"""

from __future__ import annotations

import hmac
import secrets
import time
from collections.abc import Callable
from typing import Final

from gantryctl.service.memory.memory import Word
from gantryctl.service.protocol.limits import LINK_S

PATH: Final = "/api/v1/console/"


class LinkGiver:
    """The supervisor's end; the newest link counts.

    Args:
        words: numbers by `Word`. page: address of the page with a slash at its end, "" without a page.
    """

    def __init__(self, words: memoryview, page: str, now_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self._words, self._page, self._now_ns = words, page, now_ns

    def give(self, uid: int) -> str:
        """Make a link for a user of the system; "" without a page."""
        if not self._page:
            return ""
        token = secrets.randbits(63) + 1
        # The number of the link last: whoever reads in between finds no link that is half of another.
        self._words[Word.LINK] = 0
        self._words[Word.LINK_UID] = uid
        self._words[Word.LINK_UNTIL_NS] = self._now_ns() + round(LINK_S * 1e9)
        self._words[Word.LINK] = token
        return f"{self._page.rstrip('/')}{PATH}{token:016x}"


class LinkTaker:
    """The gateway's end."""

    def __init__(self, words: memoryview, now_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self._words, self._now_ns = words, now_ns
        # A gateway that was started again does not know which links were used before it.
        self._began_ns = now_ns()
        self._used = 0

    def take(self, token: str, uid: int) -> bool:
        """Use a link up; False for another user, and for one that is unknown, used or too old."""
        number = int(self._words[Word.LINK])
        right = hmac.compare_digest(f"{number:016x}".encode(), token.encode(errors="replace"))
        until_ns = int(self._words[Word.LINK_UNTIL_NS])
        fresh = self._now_ns() < until_ns and until_ns - round(LINK_S * 1e9) > self._began_ns
        if not (right and fresh and number not in (0, self._used) and self._words[Word.LINK_UID] == uid):
            return False
        self._used = number
        return True
