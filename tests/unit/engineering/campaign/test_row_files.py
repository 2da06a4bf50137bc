"""Files of rows: every row counts exactly once at every moment of a merge, and after a kill at every moment."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gantryctl.engineering.campaign import row_files as module
from gantryctl.engineering.campaign.row_files import RowFiles
from gantryctl.engineering.scheduler.job import Chunk, Rows
from gantryctl.errors import StateError

ABOUT = {"campaign_hash": "c", "machine_hash": "m"}
# Neighbours, a gap after row 11, neighbours; in the order in which workers end them.
CHUNKS = (Chunk(4, 3), Chunk(0, 4), Chunk(7, 5), Chunk(20, 2), Chunk(22, 6))
THERE = [*range(12), *range(20, 28)]


def rows(chunk: Chunk) -> Rows:
    index = np.arange(chunk.first, chunk.last + 1)
    refused = np.array(["plant.x: limits" if k % 3 == 0 else "" for k in index], dtype=object)
    return {"row": index, "refused_by": refused, "a": np.where(index % 3 == 0, np.nan, 0.1 * index)}


def filled(folder: Path, chunks: Sequence[Chunk] = CHUNKS) -> RowFiles:
    files = RowFiles(folder, "c")
    for chunk in chunks:
        files.write(chunk, rows(chunk), ABOUT)
    return files


def read(files: RowFiles, ranges: Sequence[Chunk] | None = None) -> tuple[list[int], bytes]:
    """Numbers of the rows that a reader sees, and their figures."""
    parts = [part for _, part in files.batches(files.ranges() if ranges is None else ranges, ["row", "a"])]
    return [int(k) for part in parts for k in part["row"]], b"".join(part["a"].tobytes() for part in parts)


def names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


def test_neighbours_become_one_file_with_the_same_rows(tmp_path: Path) -> None:
    files = filled(tmp_path)
    before = read(files)
    files.merge(ABOUT)
    assert names(tmp_path) == [
        "rows-0000000000-0000000011.parquet",
        "rows-0000000020-0000000027.parquet",
    ]
    assert read(files) == before
    assert before[0] == THERE
    inode = (tmp_path / names(tmp_path)[0]).stat().st_ino
    files.merge(ABOUT)
    assert (tmp_path / names(tmp_path)[0]).stat().st_ino == inode  # there is nothing to do


def test_full_files_are_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "FULL_ROWS", 8)
    files = filled(
        tmp_path, [Chunk(0, 3), Chunk(3, 5), Chunk(8, 4), Chunk(12, 4), Chunk(16, 2), Chunk(18, 3)]
    )
    files.merge(ABOUT)
    assert files.ranges() == [Chunk(0, 3), Chunk(3, 5), Chunk(8, 8), Chunk(16, 5)]


def test_a_column_of_another_size_is_no_obstacle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Row groups of 4: a file is decoded in parts, and a merged one is written in parts."""
    monkeypatch.setattr(module, "_GROUP_ROWS", 4)
    files = filled(tmp_path)
    before = read(files)
    files.merge(ABOUT)
    assert read(files) == before


def at_every_step(monkeypatch: pytest.MonkeyPatch, look: Callable[[str], None]) -> None:
    """Call before each thing that a merge does to the disk."""
    for owner, name in ((os, "fsync"), (Path, "replace"), (Path, "unlink")):
        done = getattr(owner, name)

        def watched(*args: Any, _name: str = name, _done: Any = done, **kwargs: Any) -> Any:
            look(_name)
            return _done(*args, **kwargs)

        monkeypatch.setattr(owner, name, watched)


def test_a_reader_sees_each_row_once_at_every_moment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = filled(tmp_path)
    wanted = read(files)
    ranges = files.ranges()
    seen: list[str] = []

    def look(step: str) -> None:
        seen.append(step)
        assert read(files) == wanted, step
        # One that has listed the folder before the merge.
        assert read(files, ranges) == wanted, step

    at_every_step(monkeypatch, look)
    files.merge(ABOUT)
    # Two merged files: draft and folder synchronised, a rename between, then the sources go.
    assert seen == [
        "fsync",
        "replace",
        "fsync",
        *["unlink"] * 3,
        "fsync",
        "replace",
        "fsync",
        *["unlink"] * 2,
    ]


def test_a_merge_in_the_middle_of_a_pass_changes_nothing(tmp_path: Path) -> None:
    files = filled(tmp_path)
    wanted = read(files)[0]
    found: list[int] = []
    for first, part in files.batches(files.ranges(), ["row"]):
        assert first == part["row"][0]
        found += part["row"].tolist()
        files.merge(ABOUT)
    assert found == wanted


# A child for each kill, of a parent that has pyarrow imported and nothing of it running.
KILLED = """
import os, shutil, signal, sys
from pathlib import Path
import pyarrow as pa, pyarrow.parquet as pq
from gantryctl.engineering.campaign.row_files import RowFiles

pa.set_cpu_count(1)
source, place = Path(sys.argv[1]), Path(sys.argv[2])
for step in range(100):
    folder = place / str(step)
    shutil.copytree(source, folder)
    child = os.fork()
    if child == 0:
        left = step
        def killing(done):
            def before(*args, **kwargs):
                global left
                if left == 0:
                    os.kill(os.getpid(), signal.SIGKILL)
                left -= 1
                return done(*args, **kwargs)
            return before
        for owner, name in ((os, "fsync"), (Path, "replace"), (Path, "unlink"), (pq.ParquetWriter, "write_table")):
            setattr(owner, name, killing(getattr(owner, name)))
        RowFiles(folder, "c").merge({"campaign_hash": "c", "machine_hash": "m"})
        os._exit(0)
    if os.waitpid(child, 0)[1] == 0:
        print(step)
        break
"""


@pytest.mark.skipif(sys.platform == "win32", reason="forks, and kills by signal")
def test_a_kill_between_any_two_steps_loses_and_doubles_nothing(tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.mkdir()
    wanted = read(filled(source))
    ran = subprocess.run(
        [sys.executable, "-c", KILLED, source, tmp_path],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    kills = int(ran.stdout)
    # Two merged files: written, synchronised, renamed, synchronised, and five sources removed.
    assert kills == 2 * 4 + 5
    for step in range(kills + 1):
        folder = tmp_path / str(step)
        files = RowFiles(folder, "c")
        assert read(files) == wanted, (step, names(folder))
        files.remove_superseded()
        assert read(files) == wanted, (step, names(folder))
        files.merge(ABOUT)
        assert read(files) == wanted, (step, names(folder))
        assert [name for name in names(folder) if name.endswith(".parquet")] == [
            "rows-0000000000-0000000011.parquet",
            "rows-0000000020-0000000027.parquet",
        ], step


def test_a_merge_does_not_make_damage_lasting(tmp_path: Path) -> None:
    """A file with right name, size and campaign whose rows are others."""
    files = filled(tmp_path)
    files.write(Chunk(4, 3), rows(Chunk(5, 3)), ABOUT)
    with pytest.raises(StateError, match=r"rows-0000000004-0000000006\.parquet: holds other rows"):
        files.merge(ABOUT)
    assert len(list(tmp_path.glob("*.parquet"))) == 5


def test_a_file_that_is_damaged_in_the_middle_is_named_by_readers_and_by_a_merge(tmp_path: Path) -> None:
    files = filled(tmp_path)
    path = files.file(Chunk(4, 3))
    content = bytearray(path.read_bytes())
    content[4:60] = bytes(56)  # pages come first, the description of the file last
    path.write_bytes(content)
    files.check()
    with pytest.raises(StateError, match=r"rows-0000000004-0000000006\.parquet: cannot be read"):
        read(files)
    with pytest.raises(StateError, match=r"rows-0000000004-0000000006\.parquet: cannot be read"):
        files.merge(ABOUT)
    assert len(names(tmp_path)) == 5


def test_a_disk_that_is_full_in_a_merge_costs_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import pyarrow.parquet as pq

    def full(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    files = filled(tmp_path)
    wanted = read(files)
    monkeypatch.setattr(pq.ParquetWriter, "write_table", full)
    with pytest.raises(
        StateError, match=r"rows-0000000000-0000000011\.parquet: cannot be written: No space left"
    ):
        files.merge(ABOUT)
    monkeypatch.undo()
    assert len(names(tmp_path)) == 5
    assert read(files) == wanted


def test_ranges_that_overlap_and_hold_neither_are_refused(tmp_path: Path) -> None:
    files = filled(tmp_path, [Chunk(0, 4), Chunk(2, 4)])
    with pytest.raises(StateError, match="some of its rows are in rows-0000000000-0000000003"):
        files.ranges()


def test_rows_that_have_gone_are_named(tmp_path: Path) -> None:
    files = filled(tmp_path)
    ranges = files.ranges()
    files.file(Chunk(4, 3)).unlink()
    with pytest.raises(StateError, match=r"rows-0000000004-0000000006\.parquet: has gone"):
        read(files, ranges)
