"""Names of recordings: `<what>-<number>-<UTC>`, in order by the number whatever the clock says."""

from __future__ import annotations

import re
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

# The number counts on beyond six digits; the date is for people.
_NAME: Final = re.compile(r".+?-(\d{6,})-(\d{8}T\d{9})")


def number_of(path: Path) -> int:
    """Number in the name of a recording; 0 where it has none, as older than all others."""
    found = _NAME.match(path.name)
    return int(found[1]) if found else 0


def begun_at(path: Path) -> datetime | None:
    """Date in the name of a recording, UTC; None where it has none."""
    found = _NAME.match(path.name)
    try:
        return (
            None
            if found is None
            else datetime.strptime(f"{found[2]}000", "%Y%m%dT%H%M%S%f").replace(tzinfo=UTC)
        )
    except ValueError:
        return None


def oldest_first(paths: Iterable[Path]) -> list[Path]:
    """Recordings of one folder in the order in which they were begun."""
    return sorted(paths, key=lambda path: (number_of(path), path.name))


def next_number(folder: Path) -> int:
    """Number above all in a folder."""
    return 1 + max((number_of(path) for path in folder.iterdir()), default=0) if folder.is_dir() else 1


def numbered(what: str, number: int, begun: datetime) -> str:
    """Name of a recording, without its ending; the date is that of the clock at its beginning, right or wrong."""
    return f"{what}-{number:06d}-{begun:%Y%m%dT%H%M%S}{begun.microsecond // 1000:03d}"
