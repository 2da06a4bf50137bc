"""The folder of a result: a head, and the rows that are there."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from gantryctl.engineering.campaign.job import INDEX, REFUSED
from gantryctl.engineering.campaign.measures import Output
from gantryctl.engineering.campaign.population import Campaign
from gantryctl.engineering.campaign.row_files import RowFiles
from gantryctl.engineering.campaign.sampling import Design
from gantryctl.engineering.scheduler.identity import Identity, identity
from gantryctl.engineering.scheduler.job import Chunk, Rows
from gantryctl.errors import StateError, UsageError
from gantryctl.files import write_whole
from gantryctl.machine import config_hash, field_specs
from gantryctl.machine.reading import printable

HEAD_FILE: Final = "result.json"
CAMPAIGN_FILE: Final = "campaign.toml"
_FORMAT: Final = 1
# Rows that statistics take at once.
_BATCH: Final = 2**16
# Numbers of a small result that are read once and kept: 64 MB.
_HELD: Final = 2**23


@dataclass(frozen=True)
class ResultHead:
    """What the rows of a result are.

    Attributes:
        campaign_hash: of all that decides a row. machine_hash: configuration of the machine of the campaign.
        made_by: code that computes the rows.
        design: how the plants are drawn. factors: names of what varies and drifts, in the order of the design.
        keys: columns of varied keys. outputs: figures by column. limits: by figure.
        required: who requires a limit that the campaign file does not name, by figure.
    """

    name: str
    description: str
    campaign_hash: str
    machine_hash: str
    made_by: Identity
    design: Design
    factors: tuple[str, ...]
    keys: tuple[str, ...]
    outputs: dict[str, Output]
    limits: dict[str, tuple[float, ...]]
    required: dict[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, campaign: Campaign) -> ResultHead:
        """Head of a result that this process computes."""
        order = campaign.settings.campaign
        drift = [f"drift of {factor.name}" for factor in campaign.drift]
        return cls(
            name=campaign.name,
            description=order.description,
            campaign_hash=campaign.hash,
            machine_hash=config_hash(campaign.controls[0].machine),
            made_by=identity(),
            design=campaign.design,
            factors=(*(factor.name for factor in campaign.factors), *drift),
            keys=campaign.varied_keys,
            outputs=campaign.columns,
            limits=dict(campaign.limits),
            required=dict(campaign.required),
        )

    @property
    def scalar_keys(self) -> list[str]:
        """Varied keys that have a column; arrays, such as phases, follow from the number of the row."""
        return [key for key in self.keys if field_specs()[key].kind != "numbers"]

    def limits_of(self, column: str) -> tuple[float, ...]:
        """Limits of the figure of a column."""
        return self.limits.get(column.rpartition(".")[2], ())


class ResultFolder:
    """The folder of one result.

    Args:
        path: of the folder; made by the first write.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def begin(self, campaign: Campaign) -> ResultHead:
        """Make the head, or check that what is there was computed from the same campaign by the same code.

        Raises:
            UsageError: another campaign or other code. StateError: the folder cannot be used.
        """
        head = ResultHead.of(campaign)
        if (self.path / HEAD_FILE).exists():
            self._check_same(self.head(), head)
        elif any(self.path.glob("rows-*.parquet")):
            raise StateError(f"{self.path}: has rows but no {HEAD_FILE}; choose another --out")
        write_whole(self.path / CAMPAIGN_FILE, campaign.text, make_folder=True)
        text = json.dumps({"format": _FORMAT, **asdict(head), **_named(head)}, indent=2, allow_nan=False)
        write_whole(self.path / HEAD_FILE, text + "\n")
        return head

    def head(self) -> ResultHead:
        """Read the head.

        Raises:
            UsageError: the folder holds no result. StateError: its head is damaged or of another version.
        """
        path = self.path / HEAD_FILE
        try:
            data = json.loads(path.read_text("utf-8"))
            if data.pop("format") != _FORMAT:
                raise StateError(f"{path}: was written by another version of gantryctl")
            return ResultHead(
                **data
                | {
                    "made_by": Identity(**data["made_by"]),
                    "design": Design(**data["design"] | {"widths": tuple(data["design"]["widths"])}),
                    "factors": tuple(data["factors"]),
                    "keys": tuple(data["keys"]),
                    "outputs": {name: Output(**output) for name, output in data["outputs"].items()},
                    "limits": {name: tuple(limits) for name, limits in data["limits"].items()},
                }
            )
        except (FileNotFoundError, NotADirectoryError):
            raise UsageError(
                f"{printable(self.path, 300)}: holds no result of a campaign; `gantryctl campaign run` makes one"
            ) from None
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as fault:
            raise StateError(f"{path}: cannot be read: {printable(fault, 200)}") from None

    def missing(self, head: ResultHead) -> list[Chunk]:
        """Rows of the campaign that are not there yet.

        Raises:
            StateError: a file is damaged or of another campaign.
        """
        files = self._files(head)
        files.check()
        found = []
        free = 0
        for chunk in files.ranges():
            if chunk.first > free:
                found.append(Chunk(free, chunk.first - free))
            free = chunk.last + 1
        rows = head.design.rows
        return [*found, Chunk(free, rows - free)] if free < rows else found

    def write(self, head: ResultHead, chunk: Chunk, rows: Rows) -> None:
        """Keep the rows of a chunk: on the disk, whole, when this returns.

        Raises:
            StateError: the disk does not take it.
        """
        self._files(head).write(chunk, rows, _about(head))

    def merge(self, head: ResultHead) -> None:
        """Make few large files of many small ones; only the process that writes the result may.

        Raises:
            StateError: a file is damaged, or the disk does not take the merged one; nothing is lost.
        """
        files = self._files(head)
        files.remove_superseded()
        files.merge(_about(head))

    def rows(self) -> ResultRows:
        """Rows that are there now.

        Raises:
            UsageError: the folder holds no result. StateError: it is damaged.
        """
        head = self.head()
        files = self._files(head)
        return ResultRows(head, files, files.ranges())

    def bytes_on_disk(self) -> int:
        """Size of the rows."""
        return sum(file.stat().st_size for file in self.path.glob("rows-*.parquet"))

    def _files(self, head: ResultHead) -> RowFiles:
        return RowFiles(self.path, head.campaign_hash)

    def _check_same(self, there: ResultHead, wanted: ResultHead) -> None:
        if there.campaign_hash != wanted.campaign_hash:
            raise UsageError(
                f"{self.path}: holds rows of another campaign ({there.name} {there.campaign_hash[:12]}, this one is "
                f"{wanted.name} {wanted.campaign_hash[:12]}): machine, distributions, tests, sampling or seed differ; "
                "choose another --out"
            )
        other = wanted.made_by.differences(there.made_by)
        if other:
            raise UsageError(
                f"{self.path}: its rows were computed by other code: {other}; go on with that one, or choose another "
                "--out"
            )


class ResultRows:
    """Rows of a result at one moment: every pass over them gives the same ones, whatever is written meanwhile.

    Attributes:
        head: of the result.
        there: number of rows.
    """

    def __init__(self, head: ResultHead, files: RowFiles, ranges: Sequence[Chunk]) -> None:
        rows = head.design.rows
        self.head = head
        self._files = files
        # A result that was made longer may end within a chunk.
        self._ranges = [each for each in ranges if each.first < rows]
        self.there = sum(min(each.size, rows - each.first) for each in self._ranges)
        self._held: list[tuple[int, Rows]] = []

    def batches(self, columns: Sequence[str]) -> Iterator[tuple[int, Rows]]:
        """Columns of all rows: the number of the first row, and rows that follow each other, ascending.

        Where a batch ends depends on the numbers of the rows alone, so sums come out the same whatever files hold them.

        Raises:
            StateError: a file is damaged or of another campaign.
        """
        if self.there * len(self._columns) > _HELD:
            yield from self._aligned(columns)
            return
        if not self._held:
            self._held = list(self._aligned(self._columns))
        for first, rows in self._held:
            yield first, {name: rows[name] for name in columns}

    @property
    def _columns(self) -> list[str]:
        return [INDEX, REFUSED, *self.head.outputs, *self.head.scalar_keys]

    def _aligned(self, columns: Sequence[str]) -> Iterator[tuple[int, Rows]]:
        """Batches that end at multiples of the batch size, at gaps and at the end."""
        waiting: list[Rows] = []
        begin = end = 0
        for first, rows in self._pieces(columns):
            if waiting and (first != end or first % _BATCH == 0):
                yield begin, _joined(waiting)
                waiting.clear()
            if not waiting:
                begin = first
            waiting.append(rows)
            end = first + _length(rows)
        if waiting:
            yield begin, _joined(waiting)

    def _pieces(self, columns: Sequence[str]) -> Iterator[tuple[int, Rows]]:
        for first, rows in self._files.batches(self._ranges, columns):
            count = min(_length(rows), self.head.design.rows - first)
            cuts = [0, *range(-first % _BATCH or _BATCH, count, _BATCH), count]
            for low, high in itertools.pairwise(cuts):
                yield first + low, {name: column[low:high] for name, column in rows.items()}


def _joined(parts: Sequence[Rows]) -> Rows:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _length(rows: Rows) -> int:
    return len(next(iter(rows.values())))


def _about(head: ResultHead) -> dict[str, Any]:
    """What stands in every file of the rows."""
    return {
        "campaign_hash": head.campaign_hash,
        "machine_hash": head.machine_hash,
        "made_by": head.made_by._asdict(),
    }


def _named(head: ResultHead) -> dict[str, Any]:
    # Named tuples stay lists in `asdict`.
    return {
        "made_by": head.made_by._asdict(),
        "design": head.design._asdict(),
        "outputs": {name: output._asdict() for name, output in head.outputs.items()},
    }
