"""When a swing has died down: by its envelope, which moves smoothly where the last crossing jumps by half a swing."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def settling_s(deviation: Floats, period_s: float, limit: float) -> float:
    """Time until a swing stays within a limit, s; beyond the record where it is still larger at its end.

    The largest deviations of two half swings that follow each other, p at t_p and n at t_n, give the envelope
    p (n/p)^((t - t_p)/(t_n - t_p)) between them; it is the limit at t_p + (t_n - t_p) ln(p/limit)/ln(p/n). The two are
    the last half swing that leaves the limit and the next, the largest and the next where none does, the last two
    where the record ends too early. Never less than the last time outside; infinite for a swing that grows to the end.

    Args:
        deviation: from where it ends, one value a period, shape (samples,).
        limit: above 0.
    """
    size = np.abs(deviation)
    outside = np.flatnonzero(size > limit)
    last = int(outside[-1]) + 1 if len(outside) else 0
    begins = np.concatenate(([0], np.flatnonzero(np.diff(np.signbit(deviation))) + 1))
    peaks = np.maximum.reduceat(size, begins)
    times = np.array([
        begin + int(np.argmax(size[begin:end]))
        for begin, end in zip(begins, [*begins[1:], len(size)], strict=True)
    ])  # fmt: skip
    leaving = np.flatnonzero(peaks > limit)
    first = int(leaving[-1]) if len(leaving) else int(np.argmax(peaks))
    # What the end of the record cuts off has not shown its largest deviation.
    whole = len(peaks) - (1 if times[-1] == len(size) - 1 else 0)
    if len(leaving):
        first = min(first, whole - 2)
    if first < 0 or first + 1 >= whole:
        # No swing, but a creep: what is outside at the end has not settled.
        return math.inf if last == len(size) and last > 0 else last * period_s
    fall = math.log(peaks[first] / peaks[first + 1]) if peaks[first + 1] > 0.0 else math.inf
    if fall <= 0.0:
        return math.inf if last == len(size) else last * period_s
    reached = times[first] + (times[first + 1] - times[first]) * math.log(peaks[first] / limit) / fall
    return max(float(reached), float(last), 0.0) * period_s
