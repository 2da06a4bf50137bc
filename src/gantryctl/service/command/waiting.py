"""Commands that wait for their scan: in the order they came, and never more than the scan can work off soon."""

from __future__ import annotations

from collections import Counter, deque
from typing import Final, NamedTuple

from gantryctl.service.protocol.messages import SILENT, Identity, Message

OF_CLIENT: Final = 16
OF_SOURCE: Final = 128
"""Waiting at most. The console of the machine has places of its own: no page fills them."""


class Waiting(NamedTuple):
    """A message with its sender, and the source that its reply goes to."""

    source: int
    who: Identity
    message: Message


class Queue:
    """Commands that wait."""

    def __init__(self) -> None:
        self._waiting: deque[Waiting] = deque()
        self._count: Counter[str | int] = Counter()

    def __len__(self) -> int:
        return len(self._waiting)

    def append(self, waiting: Waiting) -> bool:
        """Queue one; False when too many wait already. Of signs of life only the newest of a client waits."""
        client, source = waiting.who.client, waiting.source
        if waiting.message.kind in SILENT:
            self._drop(client, waiting.message.kind)
        if self._count[client] >= OF_CLIENT or self._count[source] >= OF_SOURCE:
            return False
        self._waiting.append(waiting)
        self._count[client] += 1
        self._count[source] += 1
        return True

    def take(self) -> Waiting:
        """The oldest one."""
        waiting = self._waiting.popleft()
        self._leave(waiting)
        return waiting

    def clear(self) -> None:
        """None waits any more."""
        self._waiting.clear()
        self._count.clear()

    def _drop(self, client: str, kind: str) -> None:
        for each in self._waiting:
            if each.who.client == client and each.message.kind == kind:
                self._waiting.remove(each)
                self._leave(each)
                return

    def _leave(self, waiting: Waiting) -> None:
        for key in (waiting.who.client, waiting.source):
            self._count[key] -= 1
            if not self._count[key]:
                del self._count[key]
