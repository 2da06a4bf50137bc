"""Recordings have every scan around whatever happens, and at rest rows that say how long they stand for."""

from __future__ import annotations

import math
import random
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gantryctl.runtime.recorder import ArrowRecorder
from gantryctl.service.memory.trace_ring import REST_S, rest_metadata
from gantryctl.service.recorder.row_filter import AFTER_S, BEFORE_S, RowFilter
from gantryctl.trace.columns import SPACING_COLUMN
from gantryctl.trace.reader import read_trace
from gantryctl.trace.table import Trace, summarize

PERIOD_S = 0.01
COLUMNS = ("time_s", "pos_ref_rad", "vel_ref_rad_s", "pos_act_rad", "torque_act_nm", "axis_state")
# 5 % of 200 N m and 0.001 deg.
BANDS = rest_metadata(200.0)
RESTING = (0.5, 0.0, 0.5, 8.0, 1.0)
METADATA = {"period_s": PERIOD_S}
QUIET_ROWS = round(30.0 / PERIOD_S)


def recorded(
    changes: dict[int, dict[str, float]], rows: int = QUIET_ROWS, missing: frozenset[int] = frozenset()
) -> Trace:
    """What is recorded of an axis at rest with noise, that differs in some scans; `mark` goes to the filter alone."""
    noise = random.Random(7)
    made = RowFilter(COLUMNS, PERIOD_S, BANDS)
    found: list[tuple[float, ...]] = []
    for scan in range(rows):
        values = dict(zip(COLUMNS[1:], RESTING, strict=True)) | changes.get(scan, {})
        values["torque_act_nm"] += noise.uniform(-0.5, 0.5)
        mark = values.pop("mark", 0.0)
        if scan not in missing:
            found += made.take(mark, (scan * PERIOD_S, *values.values()))
    return Trace.from_rows((*COLUMNS, SPACING_COLUMN), np.array(found + made.flush()), METADATA)


def scans(trace: Trace) -> set[int]:
    return set(np.round(trace.time_s / PERIOD_S).astype(int).tolist())


def around(scan: int, rows: int = QUIET_ROWS) -> set[int]:
    """The scans that must be recorded for something in a scan."""
    first = max(0, scan - round(BEFORE_S / PERIOD_S))
    return set(range(first, min(rows, scan + round(AFTER_S / PERIOD_S) + 1)))


def test_at_rest_one_row_in_a_while_is_recorded_and_says_so() -> None:
    trace = recorded({})
    quiet = trace.slice(AFTER_S + 1.0, 30.0 - BEFORE_S - 1.0)
    assert quiet["spacing_s"] == pytest.approx(REST_S)
    assert np.diff(quiet.time_s) == pytest.approx(REST_S)
    # One in ten of the rows that are neither after the beginning nor before the end.
    left = QUIET_ROWS - (AFTER_S + BEFORE_S) / PERIOD_S
    assert trace.rest_rows == pytest.approx(left * PERIOD_S / REST_S, abs=2)
    assert trace.gaps() == []


EVENTS = {
    "the set-point moves": {"pos_ref_rad": 0.6},
    "a speed": {"vel_ref_rad_s": 1e-9},
    "a speed the other way": {"vel_ref_rad_s": -1e-9},
    "a state": {"axis_state": 2.0},
    "the axis is pushed": {"pos_act_rad": 0.5 + 1.8e-5},
    "torque": {"torque_act_nm": 19.1},
    "an angle that is not known": {"pos_act_rad": math.nan},
    "a command, an alarm, a tag": {"mark": 1.0},
}


@pytest.mark.parametrize("change", EVENTS.values(), ids=EVENTS)
def test_every_scan_around_an_event_is_recorded(change: dict[str, float]) -> None:
    trace = recorded({1500: change})
    assert around(1500) <= scans(trace)
    assert len(trace) < QUIET_ROWS / 1.5  # and not everything else


def test_what_stays_within_its_band_is_no_event() -> None:
    trace = recorded({1500: {"pos_act_rad": 0.5 + 1.7e-5, "torque_act_nm": 16.0}})
    assert len(trace) == len(recorded({}))


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.integers(0, QUIET_ROWS - 1), st.sampled_from(sorted(EVENTS))), max_size=4))
def test_whatever_happens_when_every_scan_around_it_is_there_and_the_rows_account_for_all_time(
    happened: list[tuple[int, str]],
) -> None:
    trace = recorded({scan: EVENTS[what] for scan, what in happened})
    for scan, _ in happened:
        assert around(scan) <= scans(trace)
    assert np.all(np.diff(trace.time_s) > 0.0)
    # Nothing was lost: each row stands for all scans since the one before.
    assert trace.gaps() == []
    assert trace["spacing_s"].sum() == pytest.approx(QUIET_ROWS * PERIOD_S)
    # Whoever needs equal times has the scan of every row where it was, and no row more than scans.
    even = trace.every_scan()
    assert even.time_s == pytest.approx(np.arange(QUIET_ROWS) * PERIOD_S)
    at = np.round(trace.time_s / PERIOD_S).astype(int)
    assert np.array_equal(even["torque_act_nm"][at], trace["torque_act_nm"])
    assert np.max(np.abs(even["pos_act_rad"][np.isfinite(even["pos_act_rad"])] - 0.5)) < 2e-5


def test_missing_scans_are_a_gap_of_their_own_length_also_at_rest() -> None:
    trace = recorded({}, missing=frozenset(range(1500, 1507)))
    ((begin_s, end_s),) = trace.gaps()
    assert (begin_s, end_s) == pytest.approx((14.99, 15.07))
    assert around(1507) - set(range(1500, 1507)) <= scans(trace)


def test_a_mean_over_time_counts_a_row_for_as_long_as_it_stands() -> None:
    """8 N m for 27 s at rest, 208 N m for 3 s of motion: the rows of the motion are most of the recording."""
    motion = {scan: {"vel_ref_rad_s": 0.1, "torque_act_nm": 208.0} for scan in range(1500, 1800)}
    trace = recorded(motion)
    true = math.sqrt((27.0 * 8.0**2 + 3.0 * 208.0**2) / 30.0)
    found = {each.name: each for each in summarize(trace)}["torque_act_nm"].rms
    assert found == pytest.approx(true, rel=0.002)  # the noise of 0.3 N m, squared
    alike = math.sqrt(float(np.mean(trace["torque_act_nm"] ** 2)))
    assert alike > 1.2 * true  # the liar: all rows count the same
    assert math.sqrt(float(np.mean(trace.every_scan()["torque_act_nm"] ** 2))) == pytest.approx(
        true, rel=0.002
    )


def test_a_killed_recorder_goes_on_without_a_row_twice_or_a_gap_where_rows_were_left_out() -> None:
    first = RowFilter(COLUMNS, PERIOD_S, BANDS)
    rows = [(scan * PERIOD_S, *RESTING) for scan in range(3000)]
    found: list[tuple[float, ...]] = []
    for row in rows[:2000]:
        found += first.take(0.0, row)
    # What the first had not decided on is in the ring, and the second sees it again.
    second = RowFilter(COLUMNS, PERIOD_S, BANDS, found[-1][0])
    for row in rows[2000 - first.held :]:
        found += second.take(0.0, row)
    found += second.flush()
    trace = Trace.from_rows((*COLUMNS, SPACING_COLUMN), np.array(found), METADATA)
    assert trace.gaps() == []
    assert trace["spacing_s"].sum() == pytest.approx(3000 * PERIOD_S)


@pytest.mark.parametrize("ending", [".parquet", ".arrows"])
def test_a_reader_of_some_columns_still_knows_how_long_a_row_stands(ending: str, tmp_path: Path) -> None:
    trace = recorded({1500: EVENTS["a state"]})
    if ending == ".parquet":
        trace.to_parquet(tmp_path / "rest.parquet")
    else:
        live = ArrowRecorder(tmp_path / "rest", trace.columns, METADATA)
        for row in trace.rows():
            live.record(tuple(row))
        live.leave()
    found = read_trace(tmp_path / f"rest{ending}", ["time_s", "torque_act_nm"])
    assert found.columns == ("time_s", "torque_act_nm", SPACING_COLUMN)
    assert found.gaps() == []
    assert len(found.every_scan()) == QUIET_ROWS


def test_an_axis_that_creeps_away_is_an_event_however_slowly_it_goes() -> None:
    """A microradian in a scan, of a band of 17.5: it leaves the band around where its rest began again and again."""
    creeping = {1500 + step: {"pos_act_rad": 0.5 + 1e-6 * step} for step in range(QUIET_ROWS - 1500)}
    assert set(range(1525, QUIET_ROWS)) <= scans(recorded(creeping))
