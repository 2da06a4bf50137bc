"""Replies that wait for the disk: what they confirm is done, and its event is not committed yet."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import Refusal, to_wire
from gantryctl.program.alarms.words import Words
from gantryctl.service.memory.ring import Ring
from gantryctl.service.protocol.limits import KEEP_S

Reply = dict[str, Any]


class _Waiting(NamedTuple):
    client: str
    reply: Reply
    until_s: float


class CommitWait:
    """Holds replies until the recorder has committed their events, or for `KEEP_S`.

    Only replies wait here. The scan has done its part, and what stops the axis never comes here (decision 0020).

    Args:
        events: ring of the controller's events; an event leaves it when it is on the disk.
        now: the monotonic time, s.
    """

    def __init__(self, events: Ring, now: Callable[[], float] = time.monotonic) -> None:
        self._events, self._now = events, now
        self._waiting: list[_Waiting] = []

    def __len__(self) -> int:
        return len(self._waiting)

    def add(self, client: str, reply: Reply) -> None:
        """Hold the reply to a command that was carried out."""
        # An event without a number found no place in its ring: waiting would not help.
        wait_s = KEEP_S if reply["journal"] else 0.0
        self._waiting.append(_Waiting(client, reply, self._now() + wait_s))

    def take(self) -> list[tuple[str, Reply]]:
        """Take the replies that are to go out: kept ones as they are, those that waited for too long with JRN-03."""
        if not self._waiting:
            return []
        done, now_s = self._events.done, self._now()
        found, left = [], []
        for each in self._waiting:
            if 0 < each.reply["journal"] <= done:
                found.append((each.client, each.reply))
            elif now_s >= each.until_s:
                found.append((each.client, _not_kept(each.reply)))
            else:
                left.append(each)
        self._waiting = left
        return found


def _not_kept(reply: Reply) -> Reply:
    waits = Words.EVENT_WAITS(number=reply["journal"], limit=KEEP_S)
    refusal = Refusal(Code.JRN_03, {"reason": waits if reply["journal"] else Words.EVENT_LOST})
    return {**reply, "code": str(refusal.code), "text": refusal.text, "values": to_wire(refusal.values)}
