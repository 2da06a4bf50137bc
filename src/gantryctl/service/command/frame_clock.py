"""The controller's clock of status frames: when each was issued, and whether a connection has received it."""

from __future__ import annotations

import hmac
import math
import secrets
from hashlib import blake2s

from gantryctl.service.protocol.frames import mark_of


class FrameClock:
    """Times of issue by the clock of the scan.

    Args:
        start_s: monotonic time at which the count begins.

    Attributes:
        issued_ms: time of the present scan since the start; a status frame that is published after it carries it.
    """

    # The time alone could be counted up by a client that receives nothing. The key of a frame leaves the controller
    # with that frame, so nobody, not even a gateway that hangs, can name one that has not arrived (decision 0011).
    def __init__(self, start_s: float) -> None:
        self.start_s, self.issued_ms = start_s, 0
        self._secret = secrets.token_bytes(16)

    def tick(self, now_s: float) -> None:
        """Begin a scan."""
        # At its beginning: no value of a frame is older than the frame says. Rounded down: never younger than it is.
        self.issued_ms = int((now_s - self.start_s) * 1e3)

    @property
    def key(self) -> int:
        """The key of the frame that is published now."""
        return self._key(self.issued_ms)

    def issued_s(self, mark: str, client: str) -> float:
        """Monotonic time of issue of the frame with that mark; nan if that connection never received it."""
        issued_ms = int(mark.partition("-")[0])
        known = mark_of(issued_ms, self._key(issued_ms), client)
        return self.start_s + issued_ms * 1e-3 if hmac.compare_digest(mark, known) else math.nan

    def _key(self, issued_ms: int) -> int:
        found = blake2s(issued_ms.to_bytes(8, "little"), key=self._secret, digest_size=8)
        return int.from_bytes(found.digest(), "little")
