"""The figures of the scan statistics against lists of times that are kept."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.runtime import Histogram, ScanStatistics


@given(
    values=st.lists(st.floats(1e-6, 10.0), min_size=1, max_size=200),
    part=st.sampled_from([0.0, 0.5, 0.99, 0.999, 1.0]),
)
def test_a_quantile_is_right_within_its_bin_and_never_too_small(values: list[float], part: float) -> None:
    histogram = Histogram()
    for scan, value in enumerate(values):
        histogram.add(scan, value)
    exact = sorted(values)[max(0, -int(-part * len(values) // 1) - 1)]
    assert exact <= histogram.quantile_s(part) * (1 + 1e-12) <= exact * 1.05 * (1 + 1e-12)


@given(st.lists(st.floats(0.0, 1e4), max_size=50))
def test_every_value_is_counted_once_and_the_worst_is_exact(values: list[float]) -> None:
    histogram = Histogram()
    for scan, value in enumerate(values):
        histogram.add(scan, value)
    assert sum(histogram.counts) == histogram.count == len(values)
    assert histogram.worst_s == max(values, default=0.0)
    if histogram.worst_s:
        assert histogram.worst_scan == values.index(max(values))


@given(st.lists(st.floats(0.0, 1e4), max_size=50))
def test_coarse_steps_count_every_value_below_their_edges(values: list[float]) -> None:
    histogram = Histogram()
    for scan, value in enumerate(values):
        histogram.add(scan, value)
    seen = 0
    for edge_s, count in histogram.steps():
        seen += count
        # An edge belongs to the bin that it ends.
        assert seen == sum(value <= edge_s for value in values)
    assert seen == len(values)


@given(st.lists(st.floats(1e-6, 10.0), max_size=50), st.lists(st.floats(1e-6, 10.0), max_size=50))
def test_the_figures_since_a_moment_are_those_of_what_came_after(
    before: list[float], after: list[float]
) -> None:
    whole, later = Histogram(), Histogram()
    for value in before:
        whole.add(0, value)
    counts = list(whole.counts)
    for value in after:
        whole.add(0, value)
        later.add(0, value)
    found = whole.since(counts)
    assert (found.counts, found.count) == (later.counts, later.count)


def test_an_overrun_is_a_scan_that_ends_after_the_next_one_was_due() -> None:
    statistics = ScanStatistics(0.010)
    assert not statistics.add(0, 0.0, 0.0099)
    assert statistics.add(1, 0.0, 0.0101)
    assert statistics.add(2, 0.004, 0.007)
    assert statistics.add(3, 0.020, 0.0, 2)
    assert statistics.overruns == 3
    assert statistics.skipped == 2


def test_the_period_is_the_time_between_two_starts_also_across_skipped_deadlines() -> None:
    statistics = ScanStatistics(0.010)
    statistics.add(0, 0.0, 0.001)
    statistics.add(1, 0.003, 0.001)
    assert statistics.period.worst_s == pytest.approx(0.013)
    statistics.add(6, 0.037, 0.001, 4)  # it waited for the fourth deadline after its own
    assert statistics.period.worst_s == pytest.approx(0.047)
    before = statistics.period.count
    statistics.add(7, 0.0, 0.001)
    assert statistics.period.count == before + 1
    assert statistics.period.quantile_s(0.0) == pytest.approx(0.010, rel=0.05)


def test_the_report_says_what_lateness_means_in_degrees() -> None:
    statistics = ScanStatistics(0.001)
    statistics.add(0, 0.0, 0.0002)
    statistics.add(1, 0.010, 0.0002, 10)
    report = statistics.report(6.0)
    assert "at 6 deg/s" in report
    assert "worst 0.0600 deg (scan 1, t = 0.001 s)" in report
    assert "overruns 1, deadlines skipped 10" in report


def test_virtual_time_has_no_lateness_to_report() -> None:
    assert ScanStatistics(0.001).report(6.0) == "virtual time: no scan is ever late"


def test_the_figures_are_json() -> None:
    statistics = ScanStatistics(0.001)
    statistics.add(0, 0.0, 100.0)
    values = json.loads(json.dumps(statistics.to_dict(), allow_nan=False))
    assert values["run_time"]["bins"] == [[None, 1]]
    assert values["overruns"] == 1
