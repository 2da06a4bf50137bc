"""Two recordings side by side: largest deviation and its time, on one axis of time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl.errors import UsageError
from gantryctl.trace.comparison import difference, differences, motion_begins_s
from gantryctl.trace.table import Trace

PERIOD_S = 0.001
TIME_S = PERIOD_S * np.arange(1000)


def recording(begins: int, bump_rad: float = 0.0, dial: float | None = None) -> Trace:
    """A ramp from row `begins` on, with a bump 200 rows later."""
    moving = np.arange(1000) >= begins
    pos = np.where(moving, 0.1 * (TIME_S - TIME_S[begins]), 0.0)
    pos[begins + 200] += bump_rad
    metadata = {"period_s": PERIOD_S} | ({} if dial is None else {"turn_begin_deg": dial})
    columns = {
        "time_s": TIME_S,
        "vel_ref_rad_s": 0.1 * moving,
        "pos_act_rad": pos,
        "axis_state": 3.0 * moving,
    }
    return Trace(columns, metadata)


def test_the_largest_deviation_is_found_at_its_time() -> None:
    first, second = recording(100), recording(350, bump_rad=math.radians(-0.25))
    begins = [motion_begins_s(first), motion_begins_s(second)]
    assert begins == [pytest.approx(0.1), pytest.approx(0.35)]
    found = difference(first, second, -0.25)
    # Both have the time from -0.25 s of the second on: 0 to 0.749 s of the first.
    assert (found.time_s[0], found.time_s[-1]) == (0.0, pytest.approx(0.749))
    rows = {row.name: row for row in differences(found)}
    assert rows["pos_act_rad"].largest == pytest.approx(-0.25, abs=1e-9)
    assert rows["pos_act_rad"].time_s == pytest.approx(0.3)
    assert rows["pos_act_rad"].unit == "deg"
    # One row of 750 deviates.
    assert rows["pos_act_rad"].rms == pytest.approx(0.25 / math.sqrt(750), rel=1e-6)


def test_states_are_not_interpolated() -> None:
    shifted = difference(recording(100), recording(100), 0.5 * PERIOD_S)
    assert set(np.abs(shifted["axis_state"])) <= {0.0, 3.0}
    # The ramp is half a row late, to a rounding.
    assert np.max(np.abs(shifted["pos_act_rad"])) == pytest.approx(0.1 * 0.5 * PERIOD_S, rel=1e-6)


def test_the_rounding_of_the_shift_is_no_difference_of_states() -> None:
    """The same motion, begun at each of 300 times: no row is compared with the one before it, and none is left out."""
    first = recording(100)
    for begins in range(100, 400):
        found = difference(first, recording(begins), TIME_S[100] - TIME_S[begins])
        assert len(found) == 1000 - (begins - 100)
        assert not np.any(found["axis_state"])


def test_the_worst_row_is_found_behind_rows_without_a_number() -> None:
    first, second = recording(100), recording(100, bump_rad=math.radians(0.5))
    first["pos_act_rad"][:50] = np.nan
    row = {row.name: row for row in differences(difference(first, second, 0.0))}["pos_act_rad"]
    assert (row.largest, row.time_s) == (pytest.approx(0.5), pytest.approx(0.3))


def test_a_zero_that_moves_on_between_two_rows_is_no_difference() -> None:
    """Scans of 4 ms beside some of 1 ms: between two rows of the second the same axis begins another turn."""
    rate, moves_on_s = 0.5, 0.502
    found = []
    for period_s in (0.001, 0.004):
        time_s = period_s * np.arange(round(1.0 / period_s))
        pos = 3.0 + rate * time_s - np.where(time_s > moves_on_s, 2.0 * math.pi, 0.0)
        found.append(Trace({"time_s": time_s, "pos_act_rad": pos}, {"turn_begin_deg": -180.0}))
    assert np.max(np.abs(difference(*found, 0.0)["pos_act_rad"])) < 1e-9
    assert np.max(np.abs(difference(*found[::-1], 0.0)["pos_act_rad"])) < 1e-9


def test_whole_turns_are_no_difference_of_angles_and_one_of_speeds() -> None:
    first, second = recording(100, dial=0.0), recording(100, dial=0.0)
    second["pos_act_rad"][:] += 2.0 * math.pi
    second["vel_ref_rad_s"][:] += 2.0 * math.pi
    rows = {row.name: row for row in differences(difference(first, second, 0.0))}
    assert rows["pos_act_rad"].largest == pytest.approx(0.0, abs=1e-9)
    assert rows["vel_ref_rad_s"].largest == pytest.approx(360.0)


def test_equal_recordings_have_no_difference_and_strange_ones_are_refused() -> None:
    same = recording(100)
    assert all(row.largest == row.rms == 0.0 for row in differences(difference(same, same, 0.0)))
    with pytest.raises(UsageError, match="no time in common"):
        difference(same, same, 5.0)
    with pytest.raises(UsageError, match="no column in common"):
        difference(same, Trace({"time_s": TIME_S, "torque_act_nm": TIME_S}), 0.0)
    with pytest.raises(UsageError, match="no row"):
        difference(same, same.slice(5.0, 6.0), 0.0)
    nowhere = Trace({"time_s": TIME_S, "pos_act_rad": np.full(1000, math.nan)})
    assert differences(difference(nowhere, same, 0.0))[0].largest is None
    assert motion_begins_s(nowhere) is None


def test_a_recording_may_begin_backwards() -> None:
    backwards = recording(100)
    backwards["vel_ref_rad_s"][:] *= -1.0
    assert motion_begins_s(backwards) == pytest.approx(0.1)
