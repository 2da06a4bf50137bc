"""Which samples of a long curve are drawn: no peak is lost."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gantryctl.trace.files import Floats


def drawn(values: Floats, points: int) -> NDArray[np.intp]:
    """Indices of at most `points` samples: the first, the last, smallest and largest of each of equal stretches.

    Samples that are not finite are drawn only where a stretch has no other.
    """
    if len(values) <= points:
        return np.arange(len(values))
    # First and last sample take two places, each stretch two more.
    ends = np.linspace(0, len(values), max(1, points // 2 - 1) + 1).round().astype(int)
    known = np.isfinite(values)
    low, high = np.where(known, values, np.inf), np.where(known, values, -np.inf)
    kept = [0, len(values) - 1]
    for start, end in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
        kept += [start + int(low[start:end].argmin()), start + int(high[start:end].argmax())]
    return np.unique(kept)
