"""Rows of a result in Parquet files, each named by its range; a merged file takes the place of smaller ones."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from gantryctl.engineering.campaign.job import INDEX, REFUSED
from gantryctl.engineering.scheduler.job import Chunk, Rows
from gantryctl.errors import StateError
from gantryctl.files import replacing
from gantryctl.machine.reading import printable

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

METADATA_KEY: Final = b"gantryctl"
# A merged file: some 40 MB of three figures.
FULL_ROWS: Final = 2**20
# Rows that are decoded at once.
_GROUP_ROWS: Final = 2**16
_OTHER_ROWS: Final = "holds other rows than its name and result.json say; remove it and run again"
_NAME: Final = re.compile(r"rows-(\d{10})-(\d{10})\.parquet")
# Rows of a plant are unlike each other: a dictionary only grows, streams of equal bytes compress.
_WRITING: Final[dict[str, Any]] = {
    "compression": "zstd",
    "use_dictionary": [REFUSED],
    "use_byte_stream_split": False,
}


class RowFiles:
    """Files of rows in one folder; one process writes, any number read.

    A file whose range lies within the range of another is superseded: a merge puts the merged file there, whole, and
    then removes its sources. So every row counts once at every moment, whenever the merge is killed, and no list of
    files exists that could disagree with them.

    Args:
        folder: where they are.
        campaign_hash: of the campaign whose rows they hold.
    """

    def __init__(self, folder: Path, campaign_hash: str) -> None:
        self._folder = folder
        self._campaign_hash = campaign_hash

    def ranges(self) -> list[Chunk]:
        """Ranges of rows that are there, ascending, one for each file that counts.

        Raises:
            StateError: a row is in two files, and neither supersedes the other.
        """
        found: list[Chunk] = []
        for chunk in sorted(self._names(), key=lambda each: (each.first, -each.size)):
            if not found or chunk.first > found[-1].last:
                found.append(chunk)
            elif chunk.last > found[-1].last:
                raise StateError(
                    f"{self.file(chunk)}: some of its rows are in {self.file(found[-1]).name} too; remove one"
                )
        return found

    def campaign_hash_there(self) -> str | None:
        """Hash of the campaign whose rows the first file holds; None where there is no file, or it cannot be read."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        for chunk in self.ranges()[:1]:
            with contextlib.suppress(pa.ArrowException, OSError, ValueError, KeyError, TypeError):
                said = json.loads(pq.read_schema(self.file(chunk)).metadata[METADATA_KEY])
                return str(said["campaign_hash"])
        return None

    def check(self) -> None:
        """Look into every file that counts.

        Raises:
            StateError: a file is damaged, or holds other rows than its name and the campaign say.
        """
        for chunk in self.ranges():
            with self._opened(chunk):
                pass

    def write(self, chunk: Chunk, rows: Rows, about: dict[str, Any]) -> None:
        """Keep the rows of a chunk: on the disk, whole, when this returns.

        Raises:
            StateError: the disk does not take it.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        table = pa.table({name: pa.array(column) for name, column in rows.items()})
        table = table.replace_schema_metadata(_metadata(about))
        with replacing(self.file(chunk)) as draft:
            pq.write_table(table, draft, row_group_size=_GROUP_ROWS, **_WRITING)

    def batches(self, ranges: Sequence[Chunk], columns: Sequence[str]) -> Iterator[tuple[int, Rows]]:
        """Columns of ranges that were there at some moment, in the order of the rows, some ten thousand at once.

        Files may be merged meanwhile.

        Returns:
            number of the first row, and rows that follow each other.

        Raises:
            StateError: a file is damaged, or rows have gone.
        """
        for wanted in ranges:
            # Until its sources are removed a merge changes nothing here, then the range is part of a larger one.
            with contextlib.ExitStack() as stack:
                try:
                    held, file = wanted, stack.enter_context(self._opened(wanted))
                except FileNotFoundError:
                    held = self._holder(wanted)
                    file = stack.enter_context(self._opened(held))
                first = held.first
                for batch in self._decoded(held, file, list(columns)):
                    low = max(wanted.first - first, 0)
                    high = min(wanted.last + 1 - first, batch.num_rows)
                    if low < high:
                        part = batch.slice(low, high - low)
                        yield first + low, {name: _array(part.column(name)) for name in columns}
                    first += batch.num_rows

    def remove_superseded(self) -> None:
        """Remove what a merge that was killed has left."""
        counted = set(self.ranges())
        self._remove([chunk for chunk in self._names() if chunk not in counted])

    def merge(self, about: dict[str, Any]) -> None:
        """Make few large files of neighbours that are small.

        Raises:
            StateError: a file is damaged, or the disk does not take the merged one; nothing is lost.
        """
        for group in _groups(self.ranges()):
            merged = Chunk(group[0].first, group[-1].last + 1 - group[0].first)
            # On the disk under its name, before the first source goes.
            with replacing(self.file(merged)) as draft:
                self._copy(group, draft, about)
            self._remove(group)

    def file(self, chunk: Chunk) -> Path:
        """Path of the file of a range."""
        return self._folder / f"rows-{chunk.first:010d}-{chunk.last:010d}.parquet"

    def _names(self) -> set[Chunk]:
        """Ranges of all files, superseded ones too."""
        # A listing that is made during a merge may miss the merged file, which came, and a source, which went.
        found, before = self._listed(), None
        while found != before:
            before, found = found, self._listed()
        return found

    def _listed(self) -> set[Chunk]:
        if not self._folder.is_dir():
            return set()
        matches = filter(None, (_NAME.fullmatch(file.name) for file in self._folder.iterdir()))
        return {Chunk(int(match[1]), int(match[2]) - int(match[1]) + 1) for match in matches}

    def _holder(self, wanted: Chunk) -> Chunk:
        for chunk in self.ranges():
            if chunk.first <= wanted.first and wanted.last <= chunk.last:
                return chunk
        raise StateError(f"{self.file(wanted)}: has gone, and no other file holds its rows; run again")

    def _opened(self, chunk: Chunk) -> pq.ParquetFile:
        """Open a file, and check it.

        Raises:
            FileNotFoundError: it has gone. StateError: it is damaged or holds other rows.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        path = self.file(chunk)
        try:
            file = pq.ParquetFile(path)
            said = json.loads(file.metadata.metadata[METADATA_KEY])
            right = file.metadata.num_rows == chunk.size and said["campaign_hash"] == self._campaign_hash
        except FileNotFoundError:
            raise
        except (pa.ArrowException, OSError, ValueError, KeyError, TypeError) as fault:
            raise self._unreadable(chunk, fault) from None
        if not right:
            raise StateError(f"{path}: {_OTHER_ROWS}")
        return file

    def _decoded(
        self, chunk: Chunk, file: pq.ParquetFile, columns: list[str] | None = None
    ) -> Iterator[pa.RecordBatch]:
        import pyarrow as pa

        batches = iter(file.iter_batches(_GROUP_ROWS, columns=columns))
        while True:
            try:
                batch = next(batches, None)
            except (pa.ArrowException, OSError) as fault:
                raise self._unreadable(chunk, fault) from None
            if batch is None:
                return
            yield batch

    def _unreadable(self, chunk: Chunk, fault: Exception) -> StateError:
        return StateError(
            f"{self.file(chunk)}: cannot be read: {printable(fault, 200)}; remove it and run again"
        )

    def _copy(self, group: Sequence[Chunk], draft: Path, about: dict[str, Any]) -> None:
        """Write the rows of neighbours into one file."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        with contextlib.ExitStack() as stack:
            writer: pq.ParquetWriter | None = None
            waiting: list[pa.RecordBatch] = []
            for batch in self._all_batches(group):
                waiting.append(batch)
                if (
                    sum(each.num_rows for each in waiting) < _GROUP_ROWS
                    and batch[INDEX][-1].as_py() < group[-1].last
                ):
                    continue
                table = pa.Table.from_batches(waiting).replace_schema_metadata(_metadata(about))
                if writer is None:
                    writer = stack.enter_context(pq.ParquetWriter(draft, table.schema, **_WRITING))
                writer.write_table(table, _GROUP_ROWS)
                waiting.clear()

    def _all_batches(self, group: Sequence[Chunk]) -> Iterator[pa.RecordBatch]:
        """All columns of neighbours.

        Raises:
            StateError: a file holds other rows than its name says, which a merge would make lasting.
        """
        for chunk in group:
            with self._opened(chunk) as file:
                first = chunk.first
                for batch in self._decoded(chunk, file):
                    if not np.array_equal(_array(batch[INDEX]), np.arange(first, first + batch.num_rows)):
                        raise StateError(f"{self.file(chunk)}: {_OTHER_ROWS}")
                    first += batch.num_rows
                    yield batch

    def _remove(self, chunks: Sequence[Chunk]) -> None:
        for chunk in chunks:
            # Windows removes no file that a reader has open; it is superseded, and goes the next time.
            with contextlib.suppress(PermissionError, FileNotFoundError):
                self.file(chunk).unlink()


def _groups(ranges: Sequence[Chunk]) -> Iterator[list[Chunk]]:
    """Neighbours that are at most half a full file each and a full one together."""
    group: list[Chunk] = []
    for chunk in ranges:
        joins = group and chunk.first == group[-1].last + 1 and chunk.last + 1 - group[0].first <= FULL_ROWS
        if not joins or 2 * chunk.size > FULL_ROWS:
            if len(group) > 1:
                yield group
            group = []
        if 2 * chunk.size <= FULL_ROWS:
            group.append(chunk)
    if len(group) > 1:
        yield group


def _metadata(about: dict[str, Any]) -> dict[bytes, bytes]:
    return {METADATA_KEY: json.dumps(about, sort_keys=True).encode()}


def _array(column: pa.Array) -> NDArray[Any]:
    return np.asarray(column.to_numpy(zero_copy_only=False))
