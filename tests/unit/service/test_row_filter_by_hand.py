"""Which rows are recorded, by hand: fifty rows a second of time, set-point, torque and a state; at rest ten."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from gantryctl.service.memory.trace_ring import BAND_KEY
from gantryctl.service.recorder.row_filter import RowFilter

COLUMNS = ("time_s", "pos_ref_rad", "torque_act_nm", "state")


class Rows:
    """A filter, the rows that it was given, and the times that it has recorded."""

    def __init__(self) -> None:
        self.filter = RowFilter(COLUMNS, 0.02, {BAND_KEY + "torque_act_nm": 2.0})
        self.scan, self.times = 0, list[float]()

    def go(
        self, scans: int, mark: float = 0.0, ref: float = 0.0, torque: float = 0.0, state: float = 3.0
    ) -> None:
        for _ in range(scans):
            row = (round(0.02 * self.scan, 3), ref, torque, state)
            self.times += [round(found[0], 3) for found in self.filter.take(mark, row)]
            self.scan += 1

    def rest(self) -> float:
        """Stand for 30 s; the time of the next row."""
        self.go(1500)
        self.times.clear()
        return round(0.02 * self.scan, 3)


EVENTS = {
    "a set-point": {"ref": 1e-9}, "a state": {"state": 4.0}, "a command": {"mark": 1.0},
    "a mark that wraps": {"mark": -1.0}, "a torque": {"torque": 2.001}, "a torque back": {"torque": -2.001},
    "a torque that is lost": {"torque": math.nan}, "a state that is lost": {"state": math.nan},
}  # fmt: skip


@pytest.mark.parametrize("event", EVENTS)
def test_every_row_from_2_s_before_an_event_to_5_s_behind_it_is_recorded(event: str) -> None:
    rows = Rows()
    at_s = rows.rest()
    rows.go(600, **EVENTS[event])
    every = [round(at_s + 0.02 * k, 3) for k in range(-100, 251)]
    assert [time_s for time_s in rows.times if every[0] <= time_s <= every[-1]] == every
    # Before and after it is rest again: a row in a tenth of a second.
    for low, high in ((at_s - 10.0, every[0] - 0.01), (every[-1] + 0.01, at_s + 8.0)):
        outside = [time_s for time_s in rows.times if low <= time_s <= high]
        assert all(later - before > 0.09 for before, later in pairwise(outside))


@pytest.mark.parametrize("torque", [2.0, -2.0])
def test_what_stays_within_its_band_or_stays_unknown_is_no_event(torque: float) -> None:
    rows = Rows()
    rows.rest()
    rows.go(100, torque=torque)
    assert len(rows.times) <= 21
    rows = Rows()
    rows.go(1500, torque=math.nan)
    rows.times.clear()
    rows.go(100, torque=math.nan)
    assert len(rows.times) <= 21


def test_rest_is_what_stands_5_s_behind_an_event() -> None:
    """A torque that has become another one is the new rest: back again is an event."""
    rows = Rows()
    rows.rest()
    rows.go(1500, torque=10.0)
    rows.times.clear()
    rows.go(100, torque=11.9)
    assert len(rows.times) <= 21
    rows.go(1, torque=0.0)
    assert len(rows.times) >= 100


def test_missing_rows_are_an_event() -> None:
    rows = Rows()
    at_s = rows.rest()
    rows.scan += 3
    rows.go(1)
    assert rows.times[-1] == pytest.approx(at_s + 0.06)
    assert len(rows.times) >= 100


@pytest.mark.parametrize("name", ["vel_ref_rad_s", "acc_ref_rad_s2"])
@pytest.mark.parametrize("value", [1e-9, -1e-9])
def test_a_set_point_with_speed_or_acceleration_moves_either_way(name: str, value: float) -> None:
    """In its first scan it has an acceleration alone."""
    made = RowFilter(("time_s", name), 0.02, {})
    for scan in range(1500):
        made.take(0.0, (round(0.02 * scan, 3), 0.0))
    assert made.held == 100
    assert len(made.take(0.0, (30.0, value))) == 101
