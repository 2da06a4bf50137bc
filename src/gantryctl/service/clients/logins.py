"""Who comes and goes, on its way to the journal: a row each, and a count of those beyond what an account may write."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final, NamedTuple

from gantryctl.service.memory.events import EventLog
from gantryctl.service.protocol.limits import RateLimiter
from gantryctl.service.protocol.messages import Identity

# Rows of one account: a hundred pages that are opened and closed at once, then 43 000 a day, some 17 MB.
RESERVE: Final = 200
ROW_S: Final = 2.0


class _Counted(NamedTuple):
    who: Identity
    text: str
    times: int


class LoginLog:
    """Connections of one process that begin and end.

    An account has `RESERVE` rows and one more every `ROW_S`. Without one they are counted, and its next row has their
    number, `count`: nobody who comes and goes all day pushes other events out of the journal, and its rows add up.

    Args:
        events: of this process.
        now: the monotonic time, s.
    """

    def __init__(self, events: EventLog, now: Callable[[], float] = time.monotonic) -> None:
        self._events = events
        self._rows = RateLimiter(1.0 / ROW_S, RESERVE, now)
        self._counted: dict[str, _Counted] = {}

    def put(self, text: str, who: Identity) -> None:
        """Take one."""
        before = self._counted.pop(who.user, None)
        found = _Counted(who, text, 1 if before is None else before.times + 1)
        if self._rows.wait_s(who.user) > 0.0:
            self._counted[who.user] = found
        else:
            self._write(found)

    def close(self) -> None:
        """Write everything that was counted."""
        for each in self._counted.values():
            self._write(each)
        self._counted.clear()

    def _write(self, found: _Counted) -> None:
        who, text, times = found
        if times == 1:
            self._events.put("login", text, who)
        else:
            self._events.put("login", f"{text}; {times - 1} more since the row before", who, count=times)
