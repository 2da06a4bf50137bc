"""Watches the files of the journal by their names while they are open: removed, replaced, linked, moved away."""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import suppress
from enum import Enum
from pathlib import Path
from typing import NamedTuple


class Change(Enum):
    """What happened to a file."""

    GONE = "gone"
    """Its name is gone, or belongs to another file."""
    CUT = "cut"
    """It is shorter than it was: none of these files ever shrinks while it is open."""
    LINKED = "linked"
    """It has a second name."""
    MOVED = "moved"
    """The directory has another name, or its name belongs to another directory."""


class Changed(NamedTuple):
    """One change, and the path that it was seen at."""

    change: Change
    path: Path


class FileWatch:
    """The files that are open, by device and inode number.

    Both are compared: while a file is open its inode number cannot be given to another one on the same device.
    """

    def __init__(self, directory: Path, paths: Iterable[Path]) -> None:
        self._directory = directory
        self._handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        self._known: dict[Path, tuple[int, int]] = {}
        self._sizes: dict[Path, int] = {}
        for path in paths:
            self.add(path)

    def add(self, path: Path) -> None:
        """Watch one more file, as it is now."""
        with suppress(FileNotFoundError):
            found = os.lstat(path)
            self._known[path], self._sizes[path] = _identity(found), found.st_size

    def look(self) -> list[Changed]:
        """Compare; what is found is told in every look until it is put right."""
        if self._in_place():
            found = self._changes()
            # Moved while it was looked at, it has lost its files too: nothing is begun anew in its place.
            if all(each.change is not Change.GONE for each in found) or self._in_place():
                return found
        # An empty directory that was removed has no name left: its files are written anew.
        if os.fstat(self._handle).st_nlink:
            return [Changed(Change.MOVED, self._directory)]
        return [Changed(Change.GONE, path) for path in self._known]

    def _changes(self) -> list[Changed]:
        found = []
        for path, known in self._known.items():
            try:
                now = os.lstat(path)
            except OSError:
                found.append(Changed(Change.GONE, path))
                continue
            size, self._sizes[path] = self._sizes[path], now.st_size
            if _identity(now) != known:
                found.append(Changed(Change.GONE, path))
            elif now.st_size < size:
                found.append(Changed(Change.CUT, path))
            elif now.st_nlink != 1:
                found.append(Changed(Change.LINKED, path))
        return found

    def _in_place(self) -> bool:
        with suppress(OSError):
            return _identity(os.stat(self._directory)) == _identity(os.fstat(self._handle))
        return False

    def close(self) -> None:
        """Let go of the directory."""
        os.close(self._handle)


def _identity(found: os.stat_result) -> tuple[int, int]:
    return found.st_dev, found.st_ino
