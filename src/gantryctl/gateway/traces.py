"""Recordings, to download and to look at: an opaque id stands for a file; no name of a request ever becomes a path."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import hmac
import os
import secrets
import stat
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from gantryctl.trace.naming import oldest_first

_CHUNK: Final = 256 * 1024
_LISTED: Final = 500
# A recording of 64 MB takes 2 s of a quiet processor; who waits longer is told so.
TIME_MAX_S: Final = 30.0
_READER: Final = "gantryctl.service.clients.recorded"


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

    def open(self, wanted: str) -> tuple[str, int, Content] | None:
        """Name, size and content of a recording, which the caller closes; None for an unknown id."""
        found = self.handle(wanted)
        return None if found is None else (*found[:2], Content(found[2], found[1]))

    def handle(self, wanted: str) -> tuple[str, int, int] | None:
        """Name, size and descriptor of a recording, which the caller closes; None for an unknown id."""
        for name, _, _ in self._files():
            # In constant time: the time of a miss must not tell how much of an id was right.
            if hmac.compare_digest(self._id(name).encode(), wanted.encode(errors="replace")):
                return self._handle(name)
        return None

    def _handle(self, name: str) -> tuple[str, int, int] | None:
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
        return name, found.st_size, handle

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


class Recorded:
    """Curves of recordings, read by a process of its own, so that no status frame waits for a file.

    One question at a time, of all sessions together.
    """

    def __init__(self) -> None:
        self.busy = False

    async def columns(self, handle: int, name: str, from_ms: int, to_ms: int) -> bytes | None:
        """JSON of `columns_between`; None for a recording that cannot be read.

        Args:
            handle: of the open file; it is not closed here. name: of the recording.
            from_ms, to_ms: from its first row.
        """
        self.busy = True
        try:
            process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", _READER, str(handle), name, str(from_ms), str(to_ms)),
                stdin=asyncio.subprocess.DEVNULL,
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.DEVNULL,
                pass_fds=(handle,),
            )
            try:
                answer, _ = await asyncio.wait_for(process.communicate(), TIME_MAX_S)
            except TimeoutError:
                return None
            finally:
                # Also where the person has gone: nobody needs the answer.
                if process.returncode is None:
                    with contextlib.suppress(ProcessLookupError):
                        process.kill()
                    await process.wait()
            return answer if process.returncode == 0 else None
        finally:
            self.busy = False


class Content:
    """What a recording had when it was opened, in chunks; it keeps the file open until it is closed.

    Not a generator: one whose client has left before the first chunk never begins, and never ends either.
    """

    def __init__(self, handle: int, size: int) -> None:
        self._file, self._left = os.fdopen(handle, "rb"), size

    def __iter__(self) -> Iterator[bytes]:
        return self

    def __next__(self) -> bytes:
        """The next chunk."""
        chunk = self._file.read(min(_CHUNK, self._left))
        if not chunk:
            raise StopIteration
        self._left -= len(chunk)
        return chunk

    def close(self) -> None:
        """Close the file; nothing is read any more."""
        self._file.close()
