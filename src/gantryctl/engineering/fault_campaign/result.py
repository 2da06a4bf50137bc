"""The folder of a fault campaign: what it is, the rows that are there, and one line of a log for each slice."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from gantryctl.engineering.campaign.job import INDEX
from gantryctl.engineering.campaign.row_files import RowFiles
from gantryctl.engineering.fault_campaign.job import COLUMNS, Row
from gantryctl.engineering.fault_campaign.kinds import FaultCampaign
from gantryctl.engineering.scheduler.job import Chunk, Rows
from gantryctl.errors import StateError, UsageError
from gantryctl.files import write_whole

HEAD_FILE: Final = "fault_campaign.json"
LOG_FILE: Final = "slices.log"
_FORMAT: Final = 1


class FaultResult:
    """Rows of one campaign in a folder.

    Rows of several versions of the code may lie beside each other: a long campaign goes on while the product grows.
    Each row names the code that played it, so a row is repeated with the code of its commit.

    Args:
        folder: made by the first write.
    """

    def __init__(self, folder: Path, campaign: FaultCampaign) -> None:
        self.folder, self.campaign = folder, campaign
        self._files = RowFiles(folder, campaign.hash)
        self._about = {"campaign_hash": campaign.hash, "campaign": campaign.name}

    @classmethod
    def read(cls, folder: Path) -> FaultResult:
        """The result of a folder.

        Raises:
            UsageError: there is none, or an earlier version drew its scenarios in another way. StateError: its head
                is damaged or of another version.
        """
        path = folder / HEAD_FILE
        try:
            data = json.loads(path.read_text("utf-8"))
            if data.pop("format") != _FORMAT:
                raise StateError(f"{path}: was written by another version of gantryctl")
            result = cls(folder, FaultCampaign(**data))
        except (FileNotFoundError, NotADirectoryError):
            raise UsageError(
                f"{folder}: holds no fault campaign; `gantryctl faults campaign` makes one"
            ) from None
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as fault:
            raise StateError(f"{path}: cannot be read: {fault}") from None
        result._check_drawing()
        return result

    def _check_drawing(self) -> None:
        there, campaign = self._files.campaign_hash_there(), self.campaign
        earlier = None if there is None else campaign.earlier_drawing(there)
        if earlier is not None:
            raise UsageError(
                f"{self.folder}: holds runs of drawing {earlier} of '{campaign.kind}'; this version has drawing "
                f"{campaign.drawing}, in which the same numbers are other scenarios: begin anew in another --out; "
                "to go on with these runs, or to report them, use the version of gantryctl that made them"
            )

    def begin(self) -> None:
        """Make the head, or check that what is there is of the same campaign.

        Raises:
            UsageError: it is of another one. StateError: the folder cannot be used.
        """
        if (self.folder / HEAD_FILE).exists():
            there = self.read(self.folder).campaign
            if there != self.campaign:
                raise UsageError(
                    f"{self.folder}: holds another campaign ({there.name}; this one is {self.campaign.name}); choose "
                    "another --out"
                )
            return
        data = {
            "format": _FORMAT,
            "kind": self.campaign.kind,
            "series": self.campaign.series,
            "scan_ms": self.campaign.scan_ms,
            "drive": self.campaign.drive,
        }
        write_whole(self.folder / HEAD_FILE, json.dumps(data, indent=2) + "\n", make_folder=True)

    def missing(self, first: int, count: int) -> list[Chunk]:
        """Ranges of runs `first` to `first + count - 1` that are not there yet.

        Raises:
            StateError: a file is damaged or of another campaign.
        """
        self._files.check()
        found, free, end = [], first, first + count
        for chunk in self._files.ranges():
            low, high = max(chunk.first, first), min(chunk.last + 1, end)
            if low >= high:
                continue
            if low > free:
                found.append(Chunk(free, low - free))
            free = high
        return [*found, Chunk(free, end - free)] if free < end else found

    def write(self, chunk: Chunk, rows: Rows) -> None:
        """Keep the rows of a chunk: on the disk, whole, when this returns.

        Raises:
            StateError: the disk does not take it.
        """
        self._files.write(chunk, rows, self._about)

    def merge(self) -> None:
        """Make few large files of many small ones.

        Raises:
            StateError: a file is damaged, or the disk does not take the merged one; nothing is lost.
        """
        self._files.remove_superseded()
        self._files.merge(self._about)

    def log(self, line: str) -> None:
        """A line of the log of slices.

        Raises:
            StateError: the disk does not take it.
        """
        try:
            with (self.folder / LOG_FILE).open("a", encoding="utf-8") as file:
                file.write(line + "\n")
        except OSError as fault:
            raise StateError(
                f"{self.folder / LOG_FILE}: cannot be written: {fault.strerror or fault}"
            ) from None

    @property
    def there(self) -> int:
        """Number of rows."""
        return sum(chunk.size for chunk in self._files.ranges())

    def broken(self, first: int, count: int) -> int:
        """Runs `first` to `first + count - 1` that are there and in which something broke.

        Raises:
            StateError: a file is damaged.
        """
        found = 0
        for at, batch in self._files.batches(self._files.ranges(), ["violations"]):
            wanted = batch["violations"][max(0, first - at) : max(0, first + count - at)]
            found += int((wanted != "").sum())
        return found

    def rows(self) -> Iterator[Row]:
        """Every row that is there, by its number."""
        names = [INDEX, *COLUMNS]
        for _, batch in self._files.batches(self._files.ranges(), names):
            for values in zip(*(batch[name].tolist() for name in names), strict=True):
                yield dict[str, Any](zip(names, values, strict=True))
