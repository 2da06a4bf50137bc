"""Round trip between the controller and the screen that has control, measured by the controller's clock alone."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

# Of the samples of this time the shortest counts: the rest of the others was waiting, in the screen or for a hand.
_WINDOW_S: Final = 2.0


class RoundTrip:
    """Shortest time from the issue of a status frame to a command that names it, over the last 2 s."""

    # A screen can make it longer only: no frame is named before it was received (`FrameSeals`).
    def __init__(self) -> None:
        # Ages that rise with their times: the front is the shortest.
        self._samples: deque[tuple[float, float]] = deque()

    def take(self, age_s: float, now_s: float) -> None:
        """Take the age of the frame that a command has named; nan, of an unknown frame, counts nothing."""
        if not age_s >= 0.0:
            return
        while self._samples and self._samples[-1][0] >= age_s:
            self._samples.pop()
        self._samples.append((age_s, now_s))

    def shortest_s(self, now_s: float) -> float:
        """The round trip, s; inf while nothing is known."""
        while self._samples and now_s - self._samples[0][1] > _WINDOW_S:
            self._samples.popleft()
        return self._samples[0][0] if self._samples else math.inf
