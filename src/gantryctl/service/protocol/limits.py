"""Periods, ages and rates of the protocol, each number in this one place.

The lease and the speed caps belong to the machine: `[monitors] lease_ms` and `wiring`.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable
from typing import Final, NamedTuple

# Longest message, bytes.
MESSAGE_MAX: Final = 16 * 1024

# Period of the status frames, and of those to the connection that holds a key.
FRAME_S: Final = 0.050
KEY_FRAME_S: Final = 0.020
# Oldest status frame that a command may name, by the controller's clock: no clock of a browser is trusted, and what
# waited in a frozen network is old by itself (decision 0011).
VIEW_MAX_S: Final = 0.5
# Older snapshots are stale: no client shows them as the present state.
STALE_S: Final = 0.5

# Period in which a client renews its lease, beside once for each status frame.
RENEW_S: Final = 0.030
# A held key needs a fresher view: oldest frame of a press or renewal, and longest round trip for a press. Both end
# before the lease: 250 ms leave one frame of 50 ms for the next renewal.
_KEY_VIEW_MAX_S: Final = 0.200
_ROUND_TRIP_MAX_S: Final = 0.150
_VIEW_PART: Final = 0.8
_ROUND_TRIP_PART: Final = 0.6
# Longest time that a key may be held (CTL-21): a page that hangs may go on renewing.
HELD_S: Final = 30.0
# A holder of control that is silent for longer loses it.
SILENCE_S: Final = 2.0
# A step of commissioning whose watcher is silent for longer is stopped; a page gives a sign of life every 0.4 s.
WATCHED_S: Final = 1.0
# Time between arming and executing.
ARMED_S: Final = 10.0
# Time in which a link to the page as the console must be opened.
LINK_S: Final = 60.0
# A controller that takes longer to reply counts as silent.
ANSWER_S: Final = 1.0

# A reply waits no longer for the commit of its event; on a quiet disk it waits a few milliseconds.
KEEP_S: Final = 1.0

# Of one connection; stop, quick stop and release each have as many of their own.
COMMANDS_PER_S: Final = 20.0
# Signs of life of each kind; surplus ones are dropped. A held key renews 50 + 33 times a second.
SIGNS_PER_S: Final = 100.0
# Messages of any kind; a connection that sends more is closed. One that is longer counts once more for each of these.
FLOOD_PER_S: Final = 200.0
FLOOD_BYTES: Final = 1024
_SENDERS: Final = 10_000


class KeyLimits(NamedTuple):
    """Limits of a held key, s.

    Attributes:
        view_max_s: a press or renewal that names an older status frame is void.
        round_trip_max_s: a press over a slower connection is refused.
    """

    view_max_s: float
    round_trip_max_s: float


def key_limits(lease_s: float) -> KeyLimits:
    """The limits with a lease of that length: 200 and 150 ms from 250 ms up."""
    return KeyLimits(
        min(_KEY_VIEW_MAX_S, _VIEW_PART * lease_s), min(_ROUND_TRIP_MAX_S, _ROUND_TRIP_PART * lease_s)
    )


class RateLimiter:
    """Token buckets, one for each sender.

    Args:
        per_s: refill rate, in messages a second.
        reserve: size of a bucket, the burst after a pause; as large as one second's refill when not given.
    """

    def __init__(
        self, per_s: float, reserve: float | None = None, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._per_s, self._reserve, self._now = per_s, per_s if reserve is None else reserve, now
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def wait_s(self, sender: str = "") -> float:
        """Take one token; 0 when there was one, else the time until there is."""
        now_s = self._now()
        left, filled_s = self._buckets.pop(sender, (self._reserve, now_s))
        left = min(self._reserve, left + (now_s - filled_s) * self._per_s)
        allowed = left >= 1.0
        self._buckets[sender] = (left - 1.0 if allowed else left, now_s)
        # A scan of the address space must not fill the memory: the sender that was quiet longest is forgotten.
        if len(self._buckets) > _SENDERS:
            self._buckets.popitem(last=False)
        return 0.0 if allowed else (1.0 - left) / self._per_s
