"""Recordings for download: an opaque id stands for a file; no name of a request ever becomes a path."""

from __future__ import annotations

import hashlib
import hmac
import os
import secrets
import stat
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from gantryctl.trace.naming import oldest_first

_CHUNK: Final = 256 * 1024
_LISTED: Final = 500


class Traces:
    """The recordings of one directory."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        # New with every start: an id tells nothing about a name, and cannot be guessed.
        self._key = secrets.token_bytes(16)

    def rows(self) -> list[dict[str, Any]]:
        """Id, name, size and date of every closed recording, newest first by its number."""
        files = {Path(name): (size, modified) for name, size, modified in self._files()}
        found: list[dict[str, Any]] = []
        for path in reversed(oldest_first(files)[-_LISTED:]):
            size, modified = files[path]
            at = datetime.fromtimestamp(modified, UTC).isoformat(timespec="seconds")
            found.append({"id": self._id(path.name), "name": path.name, "size": size, "modified": at})
        return found

    def open(self, wanted: str) -> tuple[str, int, Iterator[bytes]] | None:
        """Name, size and content of a recording; None for an unknown id."""
        for name, _, _ in self._files():
            # In constant time: the time of a miss must not tell how much of an id was right.
            if hmac.compare_digest(self._id(name).encode(), wanted.encode(errors="replace")):
                return self._read(name)
        return None

    def _read(self, name: str) -> tuple[str, int, Iterator[bytes]] | None:
        # Opened below the folder without following links: nothing outside can be swapped in between.
        try:
            folder = os.open(self._directory, os.O_RDONLY | os.O_DIRECTORY)
            try:
                handle = os.open(name, os.O_RDONLY | os.O_NOFOLLOW, dir_fd=folder)
            finally:
                os.close(folder)
        except OSError:
            return None
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode):
            os.close(handle)
            return None
        return name, found.st_size, _chunks(handle, found.st_size)

    def _files(self) -> list[tuple[str, int, float]]:
        try:
            with os.scandir(self._directory) as entries:
                files = [
                    (entry.name, entry.stat(follow_symlinks=False))
                    for entry in entries
                    if entry.name.endswith(".parquet") and entry.is_file(follow_symlinks=False)
                ]
            return [(name, found.st_size, found.st_mtime) for name, found in files]
        except OSError:
            return []

    def _id(self, name: str) -> str:
        return hmac.new(self._key, name.encode(), hashlib.sha256).hexdigest()[:32]


def _chunks(handle: int, size: int) -> Iterator[bytes]:
    with os.fdopen(handle, "rb") as file:
        left = size
        while left > 0 and (chunk := file.read(min(_CHUNK, left))):
            left -= len(chunk)
            yield chunk
