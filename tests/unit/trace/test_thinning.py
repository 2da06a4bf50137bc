"""What is drawn of a long curve."""

import numpy as np
import pytest

from gantryctl.trace.thinning import drawn


def test_a_long_curve_keeps_its_extremes() -> None:
    y = np.zeros(50_001)
    y[12_345], y[40_000], y[20_000] = 7.0, -3.0, np.nan
    kept = drawn(y, 200)
    assert len(kept) <= 200
    assert {0, 12_345, 40_000, 50_000} <= set(kept.tolist())
    assert 20_000 not in kept
    assert np.all(np.diff(kept) > 0)


@pytest.mark.parametrize("samples", [0, 1, 200])
def test_a_short_curve_is_drawn_whole(samples: int) -> None:
    assert drawn(np.zeros(samples), 200).tolist() == list(range(samples))
