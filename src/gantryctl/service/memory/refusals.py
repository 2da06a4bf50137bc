"""Refused commands on their way to the journal: the first of a kind at once, what repeats as a count."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any, Final

from gantryctl.service.memory.events import EventLog
from gantryctl.service.protocol.limits import RateLimiter
from gantryctl.service.protocol.messages import NOTE, Identity, Message, MessageRefused, action_of

# Repeats are written after this time, then after twice as long each time.
FIRST_S: Final = 10.0
LONGEST_S: Final = 600.0
# Rows of one account: enough to be refused everything that there is once, then 8640 a day, some 5 MB.
RESERVE: Final = 100
ROW_S: Final = 10.0
# Causes that are counted at the same time; those beyond share one row.
_CAUSES: Final = 256
_OTHERS: Final = ("", "", "")
_NONE: Final[Mapping[str, Any]] = {}
_KINDS: Final = {"set": "setting", "take": "authority", "give": "authority", NOTE: NOTE}


def kind_of(message: Message) -> str:
    """Kind of the event of a command."""
    return _KINDS.get(message.kind, "command")


def in_words(message: Message) -> str:
    """What a command asks for: its type and its values."""
    values = {name: value for name, value in message.values.items() if name != "lease"}
    words = [str(value) for name, value in values.items() if name != "before"]
    words += [f"(before: {values['before']:g})"] if "before" in values else []
    return " ".join([message.kind, *words])


class _Cause:
    """Refusals of one account for one cause.

    Attributes:
        count: those that no row has yet.
        due_s: when they get one; at that time the cause is forgotten if there are none.
    """

    def __init__(self, now_s: float) -> None:
        self.who: Identity | None = None
        self.kind = self.text = ""
        self.values: dict[str, Any] = {}
        self.count, self.rows = 0, 0
        self.since_s = self.due_s = now_s
        self.window_s = FIRST_S


class RefusalLog:
    """Refused commands of one process.

    The first one of an account, code and action is written at once. Those after it are counted and written as one row
    with their number, `count`. An account has `RESERVE` rows and one more every `ROW_S`; without one its refusals wait,
    counted. So no flood fills the journal or pushes other events out, no account takes rows from another, and the rows
    of the journal add up to what was refused.

    Args:
        events: of this process.
        now: the monotonic time, s.
    """

    def __init__(self, events: EventLog, now: Callable[[], float] = time.monotonic) -> None:
        self._events, self._now = events, now
        self._rows = RateLimiter(1.0 / ROW_S, RESERVE, now)
        self._causes: dict[tuple[str, str, str], _Cause] = {}
        self._due_s = 0.0

    def put(
        self,
        who: Identity,
        message: Message | None,
        refused: MessageRefused,
        values: Mapping[str, Any] = _NONE,
    ) -> int:
        """Take one refused command; the number of its event, 0 if it was only counted.

        Args:
            message: None for one that was not understood.
            values: more values of its event.
        """
        if message is None:
            return self.put_text(who, "command", "not understood", "", refused, values)
        action = str(action_of(message))
        return self.put_text(who, kind_of(message), in_words(message), action, refused, values)

    def put_text(
        self,
        who: Identity,
        kind: str,
        asked: str,
        action: str,
        refused: MessageRefused,
        values: Mapping[str, Any] = _NONE,
    ) -> int:
        """As `put`, of a request that is no message: `asked` in words, for the right to do `action`."""
        now_s, code = self._now(), str(refused.refusal.code)
        key = (who.user, code, action)
        if key not in self._causes and len(self._causes) >= _CAUSES:
            key = _OTHERS
        cause = self._causes.setdefault(key, _Cause(now_s))
        cause.who = None if key is _OTHERS else who
        cause.kind, cause.text = kind, f"{asked}: refused: {code} {refused}"
        cause.values = {"code": code, "action": action, **values}
        cause.count += 1
        if cause.rows == 0:
            return self._write(cause, now_s)
        return 0

    def look(self) -> None:
        """Write the row that is due, one a call: it is called in the scan."""
        now_s = self._now()
        if now_s < self._due_s or not self._causes:
            return
        key, cause = min(self._causes.items(), key=lambda item: item[1].due_s)
        if now_s >= cause.due_s:
            if cause.count:
                self._write(cause, now_s)
            else:
                del self._causes[key]
        self._due_s = min((each.due_s for each in self._causes.values()), default=0.0)

    def close(self) -> None:
        """Write everything that was counted."""
        for cause in self._causes.values():
            if cause.count:
                self._put(cause, self._now())
        self._causes.clear()

    def _write(self, cause: _Cause, now_s: float) -> int:
        wait_s = self._rows.wait_s("" if cause.who is None else cause.who.user)
        if wait_s > 0.0:
            cause.due_s = now_s + wait_s
            self._due_s = min(self._due_s, cause.due_s)
            return 0
        number = self._put(cause, now_s)
        cause.rows += 1
        cause.since_s, cause.due_s = now_s, now_s + cause.window_s
        cause.window_s = min(2.0 * cause.window_s, LONGEST_S)
        self._due_s = min(self._due_s, cause.due_s)
        return number

    def _put(self, cause: _Cause, now_s: float) -> int:
        count, cause.count = cause.count, 0
        text, values = cause.text, cause.values
        if cause.rows or count > 1:
            span_s = now_s - cause.since_s
            text = f"{text}; {'once' if count == 1 else f'{count} times'} in {span_s:.0f} s"
            values = {**values, "count": count}
        return self._events.put(cause.kind, text, cause.who, **values)
