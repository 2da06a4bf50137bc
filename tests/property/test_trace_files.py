"""Any rows come back bit for bit, from every kind of file, and from one that was cut anywhere."""

import struct
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gantryctl.errors import UsageError
from gantryctl.runtime.recorder import ArrowRecorder, MemoryRecorder
from gantryctl.trace.columns import DEGREE_UNITS, SI_UNITS, in_degrees, unit_of
from gantryctl.trace.reader import read_trace

ParameterRow = tuple[float, ...]

# every bit pattern: signed zeros, subnormals, infinities, NaN with any payload
any_double = st.integers(0, 2**64 - 1).map(lambda bits: struct.unpack("<d", struct.pack("<Q", bits))[0])
numbers = st.one_of(st.floats(), any_double)
metadata = st.dictionaries(
    st.text(max_size=8),
    st.one_of(
        st.text(max_size=8), st.integers(-(2**60), 2**60), st.floats(allow_nan=False, allow_infinity=False)
    ),
    max_size=4,
)


@st.composite
def recordings(draw: st.DrawFn) -> tuple[tuple[str, ...], list[ParameterRow]]:
    width = draw(st.integers(1, 5))
    columns = ("time_s", *(f"x{k}_rad" for k in range(width - 1)))
    return columns, draw(st.lists(st.tuples(*[numbers] * width), max_size=30))


def cell_bits(rows: Sequence[ParameterRow]) -> bytes:
    return b"".join(struct.pack(f"{len(row)}d", *row) for row in rows)


@settings(max_examples=40)
@given(recording=recordings(), about=metadata, flush_rows=st.integers(1, 12))
def test_rows_round_trip_bit_for_bit_through_memory_stream_and_parquet(
    recording: tuple[tuple[str, ...], list[ParameterRow]],
    about: dict[str, str | int | float],
    flush_rows: int,
) -> None:
    columns, rows = recording
    with tempfile.TemporaryDirectory() as directory:
        file = ArrowRecorder(Path(directory) / "x", columns, about, flush_rows)
        memory = MemoryRecorder(columns, about)
        for row in rows:
            file.record(row)
            memory.record(row)
        live = read_trace(file.live_path)
        written = len(rows) // flush_rows * flush_rows
        assert live.rows().tobytes() == cell_bits(rows[:written])
        file.close()
        closed = read_trace(file.path)
    assert closed.rows().tobytes() == memory.rows().tobytes() == cell_bits(rows)
    assert closed.columns == columns
    assert closed.metadata == about
    assert closed.hash() == memory.trace().hash()


def test_a_stream_cut_at_any_byte_gives_all_whole_blocks_before_the_cut(tmp_path: Path) -> None:
    columns = ("time_s", "x_rad")
    rows = [(k * 0.001, k / 7) for k in range(13)]
    recorder = ArrowRecorder(tmp_path / "whole", columns, {"machine": "test"}, flush_rows=5)
    ends = [recorder.live_path.stat().st_size]
    for row in rows:
        recorder.record(row)
        ends.append(recorder.live_path.stat().st_size)
    ends = sorted(set(ends))  # the head and two blocks
    assert len(ends) == 3
    whole = recorder.live_path.read_bytes()
    cut = tmp_path / "cut"
    for length in range(len(whole)):
        cut.write_bytes(whole[:length])
        if length < ends[0]:
            with suppress(UsageError):  # the names may be there already
                assert len(read_trace(cut)) == 0
            continue
        trace = read_trace(cut)
        blocks = sum(end <= length for end in ends[1:])
        assert trace.rows().tobytes() == cell_bits(rows[: 5 * blocks])
        assert trace.columns == columns
        assert not trace.complete


@given(content=st.binary(max_size=300), head=st.sampled_from([b"", b"PAR1", b"\xff\xff\xff\xff"]))
def test_any_other_file_is_refused_with_one_kind_of_error(content: bytes, head: bytes) -> None:
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "x"
        path.write_bytes(head + content)
        with pytest.raises(UsageError, match="x: "):
            read_trace(path)


@given(st.sampled_from(sorted(SI_UNITS | DEGREE_UNITS)), st.sampled_from(["pos_ref", "vel_load", "x"]))
def test_every_unit_is_found_behind_any_name_and_degrees_keep_the_quantity(
    suffix: str, quantity: str
) -> None:
    name = f"{quantity}_{suffix}"
    assert unit_of(name).suffix == suffix
    assert in_degrees(name).startswith(quantity)
    assert in_degrees(in_degrees(name)) == in_degrees(name)
