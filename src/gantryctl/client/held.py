"""Hold-to-run: a key that is held for as long as the program looks at the axis."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from types import TracebackType
from typing import Literal

from gantryctl.client.connection import Connection, Frame
from gantryctl.client.errors import KeyLost
from gantryctl.client.tags import Tags
from gantryctl.errors import AlarmStop, GantryctlError

Direction = Literal["forward", "reverse"]


class Held:
    """A held key: pressed on entry, let go on leaving, whatever happens in between.

    It is renewed by the loop over its frames and by nothing else: coming back for the next frame acknowledges the last
    one, and the lease ends `welcome.lease_ms` after the issue of the newest frame that was acknowledged. So the axis
    stops when the body of the loop hangs, sleeps or raises, and when the process freezes or dies. A key that was lost
    is never pressed again.

    Args:
        at_rest: waits until the axis stands.
    """

    def __init__(self, connection: Connection, direction: Direction, at_rest: Callable[[], object]) -> None:
        self._connection, self._direction, self._at_rest = connection, direction, at_rest
        self._lease = secrets.token_hex(8)
        self._seen: Frame | None = None
        self._looked_s = 0.0
        self._first_seq = 0
        self._pressed = self._told = False

    def __enter__(self) -> Held:
        if self._pressed:
            raise KeyLost("a key that was let go is not pressed again: make a new one with `hold`")
        self._pressed = True
        self._seen, self._looked_s = self._connection.frame, time.monotonic()
        reply = self._connection.ask("jog", shown=False, lease=self._lease, direction=self._direction)
        self._first_seq = reply.seq + 1
        return self

    def __iter__(self) -> Iterator[Tags]:
        return self

    def __next__(self) -> Tags:
        """Acknowledge the frame before, and wait for the next one.

        Raises:
            KeyLost: the key was let go by the service. AlarmStop: an alarm stopped the axis.
            DeviceError: the connection has ended, or shows no present state.
        """
        seen = self._seen
        if seen is None:
            raise KeyLost("the key is not held: use it in a `with` block")
        self._connection.say("renew", seen.mark, lease=self._lease)
        self._seen, self._looked_s = self._connection.next_frame(seen.number), time.monotonic()
        self._check(self._seen.tags)
        return self._seen.tags

    def keep(self, seconds: float) -> Tags:
        """Hold the key for a time; the tags at its end. Raises what the loop raises."""
        until_s = time.monotonic() + seconds
        tags = next(self)
        while time.monotonic() < until_s:
            tags = next(self)
        return tags

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        silent_s = time.monotonic() - self._looked_s
        self._seen = None
        with suppress(GantryctlError):
            self._connection.ask("release", shown=False, lease=self._lease)
        if error is not None:
            return
        self._at_rest()
        lease_ms = self._connection.welcome.lease_ms
        if 1e3 * silent_s > lease_ms:
            raise KeyLost(
                f"nobody looked at the axis for {silent_s:.2f} s, and the service lets the key go after "
                f"{lease_ms:g} ms: loop over the key's frames, or use its `keep`"
            )

    def _check(self, tags: Tags) -> None:
        refused = self._connection.refusal_from(self._first_seq)
        if refused is None:
            return
        raise_alarm(tags)
        raise KeyLost(refused.text, refused.code)


def raise_alarm(tags: Tags) -> None:
    """Raise AlarmStop when an alarm has stopped the axis."""
    for row in tags.alarms:
        if row["first_out"]:
            raise AlarmStop(row["text"], row["code"])
