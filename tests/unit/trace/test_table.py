"""A trace in memory."""

from pathlib import Path

import numpy as np
import pytest

from gantryctl.errors import UsageError
from gantryctl.trace.files import Floats
from gantryctl.trace.reader import read_trace
from gantryctl.trace.table import Trace, TraceHash
from gantryctl.units import RAD_PER_DEG


def example(rows: int = 100) -> Trace:
    time_s = np.arange(rows) * 0.01
    data = {"time_s": time_s, "pos_ref_rad": time_s * RAD_PER_DEG, "torque_act_nm": np.sin(time_s)}
    return Trace(data, {"machine": "test", "period_s": 0.01})


def test_columns_are_arrays_by_name() -> None:
    trace = example()
    assert trace.columns == ("time_s", "pos_ref_rad", "torque_act_nm")
    assert len(trace) == 100
    assert trace.duration_s == pytest.approx(0.99)
    assert "pos_ref_rad" in trace
    assert "pos_load_rad" not in trace


def test_a_column_that_is_not_there_is_named_with_those_that_are() -> None:
    with pytest.raises(UsageError, match="no column 'pos_load_rad'; there are: time_s, pos_ref_rad"):
        example()["pos_load_rad"]


def test_columns_of_unequal_length_are_refused() -> None:
    with pytest.raises(UsageError, match="equally long"):
        Trace({"time_s": np.zeros(3), "pos_ref_rad": np.zeros(2)})


def test_a_slice_holds_both_ends_and_the_metadata() -> None:
    part = example().slice(0.1, 0.2)
    assert part.time_s[[0, -1]] == pytest.approx([0.1, 0.2])
    assert len(part) == 11
    assert part.metadata["machine"] == "test"


def test_an_empty_trace_has_no_length_and_no_duration() -> None:
    assert len(example().slice(5.0, 6.0)) == 0
    assert example().slice(5.0, 6.0).duration_s == 0.0
    assert len(Trace({})) == 0


def test_degrees_change_names_and_values() -> None:
    trace = example().in_degrees()
    assert trace.columns == ("time_s", "pos_ref_deg", "torque_act_nm")
    assert trace["pos_ref_deg"] == pytest.approx(trace["time_s"])


def test_the_hash_sees_every_bit_every_name_and_the_order() -> None:
    reference = example().hash()
    assert example().hash() == reference
    names = example().columns

    def changed(**columns: Floats) -> str:
        return Trace({name: example()[name] for name in names} | columns).hash()

    assert changed() == reference  # the metadata does not count
    one_bit = example()["pos_ref_rad"].copy()
    one_bit[57] = np.nextafter(one_bit[57], 1.0)
    assert changed(pos_ref_rad=one_bit) != reference
    negative_zero = example()["time_s"].copy()
    negative_zero[0] = -0.0
    assert changed(time_s=negative_zero) != reference
    assert Trace({name: example()[name] for name in names[::-1]}).hash() != reference
    renamed = dict(
        zip(("time_s", "pos_act_rad", "torque_act_nm"), (example()[n] for n in names), strict=True)
    )
    assert Trace(renamed).hash() != reference


def test_the_hash_can_grow_with_the_recording() -> None:
    trace = example(25_000)
    digest = TraceHash(trace.columns)
    for start in range(0, len(trace), 777):
        digest.update(trace.rows(start, start + 777))
    assert digest.hexdigest() == trace.hash()
    with pytest.raises(UsageError, match="rows of 3 values"):
        digest.update(np.zeros((2, 4)))


def test_export_to_parquet_reads_back(tmp_path: Path) -> None:
    example().to_parquet(tmp_path / "x.parquet")
    again = read_trace(tmp_path / "x.parquet")
    assert again.hash() == example().hash()
    assert again.metadata == example().metadata
    assert again.complete


def test_export_to_csv_has_one_header_line_and_exact_numbers(tmp_path: Path) -> None:
    data = {
        "time_s": np.array([0.0, 0.1, 0.2, 0.30000000000000004]),
        "x": np.array([1 / 3, -0.0, np.nan, 1e300]),
    }
    trace = Trace(data)
    trace.to_csv(tmp_path / "x.csv")
    header, *lines = (tmp_path / "x.csv").read_text().splitlines()
    assert header == "time_s,x"
    values = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    assert values.tobytes() == trace.rows().tobytes()


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    for write in (example().to_csv, example().to_parquet):
        with pytest.raises(UsageError, match="nowhere"):
            write(tmp_path / "nowhere" / "x")


def thinned() -> Trace:
    """Scans of 10 ms; rows at 40 and 70 ms stand for 4 and 3 of them, and 100 ms are missing before the last."""
    times_s = np.array([0.00, 0.04, 0.05, 0.08, 0.18])
    spacing_s = np.array([0.01, 0.04, 0.01, 0.03, 0.01])
    return Trace({"time_s": times_s, "spacing_s": spacing_s, "x": np.arange(5.0)}, {"period_s": 0.01})


def test_a_row_at_rest_stands_for_the_scans_before_it() -> None:
    even = thinned().every_scan()
    np.testing.assert_allclose(even.time_s, [0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.18])
    assert even["x"].tolist() == [0.0, 1.0, 1.0, 1.0, 1.0, 2.0, 3.0, 3.0, 3.0, 4.0]
    assert "spacing_s" not in even


def test_a_row_at_rest_is_no_gap_and_neither_is_the_row_behind_it() -> None:
    assert thinned().gaps() == [(0.08, 0.18)]
