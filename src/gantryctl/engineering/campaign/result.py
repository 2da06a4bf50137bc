"""The folder of a result: a head, and one Parquet file for each chunk that is there."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from gantryctl.engineering.campaign.job import INDEX, REFUSED
from gantryctl.engineering.campaign.measures import Output
from gantryctl.engineering.campaign.population import Campaign
from gantryctl.engineering.campaign.sampling import Design
from gantryctl.engineering.scheduler.identity import Identity, identity
from gantryctl.engineering.scheduler.job import Chunk, Rows
from gantryctl.errors import StateError, UsageError
from gantryctl.files import replacing, write_whole
from gantryctl.machine import config_hash
from gantryctl.machine.reading import printable

HEAD_FILE: Final = "result.json"
CAMPAIGN_FILE: Final = "campaign.toml"
METADATA_KEY: Final = b"gantryctl"
_FORMAT: Final = 1
_ROWS_FILE: Final = re.compile(r"rows-(\d{10})-(\d{10})\.parquet")
# Rows of a plant are unlike each other: a dictionary only grows, streams of equal bytes compress.
_WRITING: Final[dict[str, Any]] = {
    "compression": "zstd",
    "use_dictionary": [REFUSED],
    "use_byte_stream_split": False,
}


@dataclass(frozen=True)
class ResultHead:
    """What the rows of a result are.

    Attributes:
        campaign_hash: of all that decides a row. machine_hash: configuration of the machine of the campaign.
        made_by: code that computes the rows.
        design: how the plants are drawn. factors: names of what varies and drifts, in the order of the design.
        keys: columns of varied keys. outputs: figures by column. limits: by figure.
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
        )

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
        elif self.path.exists() and any(_ROWS_FILE.fullmatch(file.name) for file in self.path.iterdir()):
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
        except FileNotFoundError:
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
        found = []
        free = 0
        for chunk in sorted(self._checked(head)):
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
        import pyarrow as pa
        import pyarrow.parquet as pq

        about = {
            "campaign_hash": head.campaign_hash,
            "machine_hash": head.machine_hash,
            "made_by": head.made_by._asdict(),
        }
        table = pa.table({name: pa.array(column) for name, column in rows.items()})
        table = table.replace_schema_metadata({METADATA_KEY: json.dumps(about, sort_keys=True).encode()})
        path = self.path / f"rows-{chunk.first:010d}-{chunk.last:010d}.parquet"
        with replacing(path) as draft:
            pq.write_table(table, draft, **_WRITING)

    def read(self, columns: Sequence[str]) -> Rows:
        """Columns of all rows that are there, in the order of the rows, with "row" and "refused_by".

        Raises:
            StateError: a file is damaged or of another campaign.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        head = self.head()
        names = [INDEX, REFUSED, *columns]
        files = [self._file(chunk) for chunk in sorted(self._checked(head))]
        if not files:
            return {name: np.empty(0) for name in names}
        table = pa.concat_tables(pq.read_table(file, columns=names) for file in files)
        found = {name: table[name].to_numpy() for name in names}
        # A result that was made longer may end within a chunk.
        inside = found[INDEX] < head.design.rows
        return {name: column[inside] for name, column in found.items()}

    def bytes_on_disk(self) -> int:
        """Size of the rows."""
        return sum(self._file(chunk).stat().st_size for chunk in self._chunks())

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

    def _chunks(self) -> Iterable[Chunk]:
        if not self.path.is_dir():
            return
        for file in self.path.iterdir():
            match = _ROWS_FILE.fullmatch(file.name)
            if match:
                first, last = int(match[1]), int(match[2])
                yield Chunk(first, last - first + 1)

    def _file(self, chunk: Chunk) -> Path:
        return self.path / f"rows-{chunk.first:010d}-{chunk.last:010d}.parquet"

    def _checked(self, head: ResultHead) -> list[Chunk]:
        import pyarrow as pa
        import pyarrow.parquet as pq

        found = sorted(self._chunks())
        for chunk, after in itertools.pairwise(found):
            if after.first <= chunk.last:
                raise StateError(
                    f"{self._file(after)}: its rows are in {self._file(chunk).name} too; remove one"
                )
        for chunk in found:
            path = self._file(chunk)
            try:
                about = pq.read_metadata(path)
                said = json.loads(about.metadata[METADATA_KEY])
                right = about.num_rows == chunk.size and said["campaign_hash"] == head.campaign_hash
            except (pa.ArrowException, OSError, ValueError, KeyError, TypeError) as fault:
                raise StateError(
                    f"{path}: cannot be read: {printable(fault, 200)}; remove it and run again"
                ) from None
            if not right:
                raise StateError(
                    f"{path}: holds other rows than its name and {HEAD_FILE} say; remove it and run again"
                )
        return found


def _named(head: ResultHead) -> dict[str, Any]:
    # Named tuples stay lists in `asdict`.
    return {
        "made_by": head.made_by._asdict(),
        "design": head.design._asdict(),
        "outputs": {name: output._asdict() for name, output in head.outputs.items()},
    }
