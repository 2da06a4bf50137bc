"""Recordings as files: closed, live, cut off, foreign."""

import errno
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from gantryctl.errors import DeviceError, UsageError
from gantryctl.runtime.recorder import ArrowRecorder, MemoryRecorder
from gantryctl.trace.files import METADATA_KEY, arrow_schema, record_batch, write_parquet
from gantryctl.trace.reader import read_trace

COLUMNS = ("time_s", "pos_ref_rad", "torque_act_nm")
METADATA = {
    "machine": "hust",
    "config_hash": "ab12",
    "version": "0.1.0",
    "seed": 7,
    "epoch": 3,
    "period_s": 0.01,
}
Row = tuple[float, ...]


def rows(number: int) -> list[Row]:
    return [(k * 0.01, k / 3, -k * 1.7) for k in range(number)]


def recorded(path: Path, data: Sequence[Row], flush_rows: int = 100) -> ArrowRecorder:
    recorder = ArrowRecorder(path, COLUMNS, METADATA, flush_rows)
    record_all(recorder, data)
    return recorder


def record_all(recorder: ArrowRecorder | MemoryRecorder, data: Sequence[Row]) -> None:
    for row in data:
        recorder.record(row)


def reference_hash(data: Sequence[Row]) -> str:
    memory = MemoryRecorder(COLUMNS)
    record_all(memory, data)
    return memory.trace().hash()


def test_a_closed_recording_is_one_parquet_file_with_its_metadata(tmp_path: Path) -> None:
    recorder = recorded(tmp_path / "move_5.5", rows(1234))
    recorder.close()
    recorder.close()
    assert [path.name for path in tmp_path.iterdir()] == ["move_5.5.parquet"]
    trace = read_trace(recorder.path)
    assert trace.hash() == reference_hash(rows(1234))
    assert trace.metadata == METADATA
    assert trace.complete


def test_parquet_is_zstd_byte_stream_split_in_groups_of_30_seconds(tmp_path: Path) -> None:
    recorder = recorded(tmp_path / "x.parquet", rows(7001))
    recorder.close()
    metadata = pq.ParquetFile(recorder.path).metadata
    assert [metadata.row_group(group).num_rows for group in range(metadata.num_row_groups)] == [
        3000,
        3000,
        1001,
    ]
    column = metadata.row_group(0).column(1)
    assert column.compression == "ZSTD"
    assert "BYTE_STREAM_SPLIT" in column.encodings
    assert not column.has_dictionary_page


def test_a_live_recording_can_be_read_block_by_block(tmp_path: Path) -> None:
    recorder = recorded(tmp_path / "x", rows(250))
    live = read_trace(recorder.live_path)
    assert len(live) == 200
    assert not live.complete
    assert live.metadata == METADATA
    record_all(recorder, rows(350)[250:])
    assert len(read_trace(recorder.live_path)) == 300
    assert len(live) == 200
    recorder.close()
    assert len(read_trace(recorder.path)) == 350


KILLED = """
import os, signal, sys
from gantryctl.runtime.recorder import ArrowRecorder
recorder = ArrowRecorder(sys.argv[1], ("time_s", "x_rad"))
for k in range(2500):
    recorder.record((k * 0.001, k))
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_after_a_kill_all_blocks_that_were_full_are_there(tmp_path: Path) -> None:
    killed = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / "x")], check=False)
    assert killed.returncode == -signal.SIGKILL
    trace = read_trace(tmp_path / "x.arrows")
    assert trace["x_rad"].tolist() == list(range(2000))
    assert not trace.complete


def test_a_recording_without_a_row_is_a_recording(tmp_path: Path) -> None:
    recorder = recorded(tmp_path / "x", [])
    assert len(read_trace(recorder.live_path)) == 0
    recorder.close()
    assert len(read_trace(recorder.path)) == 0
    assert read_trace(recorder.path).columns == COLUMNS


def test_some_columns_only(tmp_path: Path) -> None:
    recorder = recorded(tmp_path / "x", rows(250))
    live = read_trace(recorder.live_path, ["torque_act_nm", "time_s"])
    assert live.columns == ("torque_act_nm", "time_s")
    with pytest.raises(UsageError, match="no column 'nothing'"):
        read_trace(recorder.live_path, ["nothing"])
    recorder.close()
    assert read_trace(recorder.path, ["torque_act_nm", "time_s"]).columns == live.columns
    with pytest.raises(UsageError, match="no column 'nothing'"):
        read_trace(recorder.path, ["nothing"])


def test_a_recording_of_a_killed_run_is_never_written_over(tmp_path: Path) -> None:
    recorded(tmp_path / "x", rows(250))
    with pytest.raises(DeviceError, match=r"x\.arrows: left by a run that was killed"):
        ArrowRecorder(tmp_path / "x", COLUMNS)
    assert len(read_trace(tmp_path / "x.arrows")) == 200


def test_a_place_that_does_not_exist_is_named(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match=r"nowhere.*No such file or directory"):
        ArrowRecorder(tmp_path / "nowhere" / "x", COLUMNS)


def test_a_disk_that_fills_up_ends_the_recording_and_keeps_what_is_there(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    recorder = recorded(tmp_path / "x", rows(2000))
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (os.path.getsize(recorder.live_path) + 500, before[1]))
    try:
        with pytest.raises(DeviceError, match=os.strerror(errno.EFBIG)):
            record_all(recorder, rows(4000)[2000:])
        recorder.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not recorder.path.exists()
    assert read_trace(recorder.live_path).hash() == reference_hash(rows(2000))


def test_a_closed_file_that_cannot_be_written_leaves_the_live_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = recorded(tmp_path / "x", rows(250))

    def no_space(handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", no_space)
    with pytest.raises(DeviceError, match=r"x\.parquet: cannot be written: .*No space left"):
        recorder.close()
    assert [path.name for path in tmp_path.iterdir()] == ["x.arrows"]
    assert read_trace(recorder.live_path).hash() == reference_hash(rows(250))
    assert read_trace(recorder.live_path).complete


def test_memory_and_file_hold_the_same(tmp_path: Path) -> None:
    memory = MemoryRecorder(COLUMNS, METADATA)
    record_all(memory, rows(333))
    memory.close()
    assert memory.trace().hash() == reference_hash(rows(333))
    assert memory.trace().metadata == METADATA
    memory.record(rows(334)[-1])  # a trace taken before does not hold the recorder
    assert len(memory.rows()) == 334


def test_whole_blocks_of_different_size_become_the_right_groups(tmp_path: Path) -> None:
    schema = arrow_schema(COLUMNS, {"period_s": 3.0})  # ten rows a group
    data = np.array(rows(47))
    blocks = [record_batch(schema, block) for block in np.split(data, [1, 2, 9, 10, 11, 40])]
    write_parquet(tmp_path / "x.parquet", schema, blocks)
    metadata = pq.ParquetFile(tmp_path / "x.parquet").metadata
    assert [metadata.row_group(g).num_rows for g in range(metadata.num_row_groups)] == [10, 10, 10, 10, 7]
    assert read_trace(tmp_path / "x.parquet").rows().tobytes() == data.tobytes()


# --- what is no recording --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (b"time_s,x\n0,1\n", "neither an Arrow stream nor a Parquet file"),
        (b"PAR1", "damaged or cut off"),
        (b"PAR1" + b"x" * 100 + b"PAR1", "damaged or cut off"),
        (b"\xff\xff\xff\xff", "damaged or cut off"),
        (b"\xff\xff\xff\xff\x10\x00\x00\x00" + b"\x00" * 16, "damaged or cut off"),
    ],
)
def test_a_file_that_is_no_recording_says_so(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "x.parquet"
    path.write_bytes(content)
    with pytest.raises(UsageError, match=message) as caught:
        read_trace(path)
    assert str(caught.value).startswith(str(path))


def test_a_missing_file_and_a_directory_are_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="No such file"):
        read_trace(tmp_path / "missing")
    with pytest.raises(UsageError, match="Is a directory"):
        read_trace(tmp_path)


def test_a_closed_recording_that_was_cut_off_is_refused(tmp_path: Path) -> None:
    recorder = recorded(tmp_path / "x", rows(1000))
    recorder.close()
    recorder.path.write_bytes(recorder.path.read_bytes()[:-20])
    with pytest.raises(UsageError, match="damaged or cut off"):
        read_trace(recorder.path)


def foreign_table(metadata: dict[bytes, bytes] | None, **columns: object) -> pa.Table:
    return pa.table(columns).replace_schema_metadata(metadata)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (foreign_table(None, time_s=[0.0]), "its metadata is missing"),
        (foreign_table({METADATA_KEY: b"{}"}, time_s=["x"]), "not a number: time_s"),
        (foreign_table({METADATA_KEY: b"{}"}, time_s=[1]), "not a number: time_s"),
        (foreign_table({METADATA_KEY: b"{}"}, time_s=[0.0, None]), "time_s has empty cells"),
        (foreign_table({METADATA_KEY: b"{"}, time_s=[0.0]), "its metadata cannot be read"),
        (foreign_table({METADATA_KEY: b"3"}, time_s=[0.0]), "its metadata cannot be read"),
    ],
)
def test_somebody_elses_file_is_refused(tmp_path: Path, table: pa.Table, message: str) -> None:
    pq.write_table(table, tmp_path / "x.parquet")
    with pa.ipc.new_stream(tmp_path / "x.arrows", table.schema) as stream:
        stream.write_table(table)
    for name in ("x.parquet", "x.arrows"):
        with pytest.raises(UsageError, match=message):
            read_trace(tmp_path / name)


def test_no_recording_of_a_run_that_was_killed_is_written_over(tmp_path: Path) -> None:
    left = ArrowRecorder(tmp_path / "run", ["time_s"])
    left.record((1.0,))
    left.flush()
    before = left.live_path.read_bytes()
    with pytest.raises(DeviceError, match="left by a run that was killed"):
        ArrowRecorder(tmp_path / "run", ["time_s"])
    assert left.live_path.read_bytes() == before


def test_a_recording_with_a_block_that_could_not_be_written_stays_as_it_is(tmp_path: Path) -> None:
    made = ArrowRecorder(tmp_path / "run", ["time_s"])
    made.record((1.0,))
    made.flush()
    file, made._file = made._file, Full()
    made.record((2.0,))
    with pytest.raises(DeviceError):
        made.flush()
    made.close()
    file.close()
    assert made.live_path.exists()
    assert not made.path.exists()


class Full:
    """A file on a disk that is full."""

    def write(self, data: object) -> None:
        raise OSError(28, "no space left on device")

    def close(self) -> None:
        pass
