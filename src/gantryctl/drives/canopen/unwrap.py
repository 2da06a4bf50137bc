"""Position without wraps: 6064 is a 32-bit number, and some drives wrap it at the multiturn range instead."""

from __future__ import annotations

from typing import Final

SPAN_32: Final = 1 << 32


class Unwrap:
    """Turns a wrapping reading into one that goes on.

    The first reading is put into `0..range - 1`, which is all that an absolute encoder knows. From then on the
    smallest step that explains the next reading counts: over the 32-bit wrap, over the multiturn wrap, or over both.

    Args:
        range_counts: multiturn range in the unit of 6064; what does not fit 32 bits is wrapped there.
    """

    def __init__(self, range_counts: int) -> None:
        span = min(range_counts, SPAN_32)
        self._range = span
        jumps = {a * SPAN_32 + b * span for a in (-1, 0, 1) for b in (-1, 0, 1)} - {0}
        self._jumps = tuple(sorted(jumps, key=abs))
        self._nearest = self._jumps[0] if jumps else SPAN_32
        self._half = abs(self._nearest) // 2
        self._raw: int | None = None
        self._counts = 0

    def __call__(self, raw: int) -> int:
        """The reading without wraps."""
        last, self._raw = self._raw, raw
        if last is None:
            self._counts = raw % self._range
        else:
            step = raw - last
            if not -self._half <= step <= self._half:
                step = min((step + jump for jump in (0, *self._jumps)), key=abs)
            self._counts += step
        return self._counts
